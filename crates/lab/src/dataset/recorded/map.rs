//! Rooms by place: polygons in the coordinates of a robot's map, in meters.
//!
//! A map is GeoJSON (`.geojson`, `.json`), whose polygons have the property `name` or `room`, or a list in YAML:
//!
//! ```yaml
//! rooms:
//!   - name: kitchen
//!     polygon: [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]
//! ```

use super::{DatasetError, files};
use crate::dataset::{Pose, Problem};
use geojson::{FeatureCollection, GeometryValue};
use serde::Deserialize;
use std::path::Path;

/// The most corners of a map: a map of a building has hundreds.
const MAX_CORNERS: usize = 1_000_000;

/// A corner of a polygon, in meters.
type Corner = [f64; 2];

/// The floor of a room: what is within its outline, and not within a hole of it.
#[derive(Clone, Debug, PartialEq)]
struct Floor {
    room: String,
    /// The outline first.
    rings: Vec<Vec<Corner>>,
}

/// A list in YAML.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RoomList {
    rooms: Vec<ListedRoom>,
}

/// A room of it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ListedRoom {
    name: String,
    polygon: Vec<Corner>,
}

/// Where rooms are.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RoomMap {
    floors: Vec<Floor>,
}

impl RoomMap {
    /// Reads a map.
    pub(super) fn read(path: &Path) -> Result<Self, DatasetError> {
        let failed = |reason: String| DatasetError::Manifest(Problem::new(path, reason));
        let text = files::read_labels(path).map_err(DatasetError::Manifest)?;
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        let is_json = extension == "geojson" || extension == "json";
        let map = if is_json { Self::of_geojson(&text) } else { Self::of_yaml(&text) };
        map.map_err(failed)
    }

    fn of_yaml(text: &str) -> Result<Self, String> {
        let list: RoomList = serde_saphyr::from_str(text).map_err(|error| {
            format!("no list of rooms (`rooms`, each with `name` and `polygon`): {error}")
        })?;
        let floor = |ListedRoom { name, polygon }| Floor { room: name, rings: vec![polygon] };
        Self::new(list.rooms.into_iter().map(floor).collect())
    }

    fn of_geojson(text: &str) -> Result<Self, String> {
        let features: FeatureCollection =
            text.parse().map_err(|error| format!("no GeoJSON with a collection of features: {error}"))?;
        let mut floors = Vec::new();
        for feature in features.features {
            let name = ["name", "room"].into_iter().find_map(|key| feature.property(key)?.as_str());
            let polygons = match feature.geometry.as_ref().map(|geometry| &geometry.value) {
                Some(GeometryValue::Polygon { coordinates }) => std::slice::from_ref(coordinates),
                Some(GeometryValue::MultiPolygon { coordinates }) => &coordinates[..],
                // Doors, docks and other things that maps hold.
                _ => continue,
            };
            let name = name.ok_or("a polygon has neither the property `name` nor `room`")?;
            for polygon in polygons {
                let corner = |position: &geojson::Position| position.as_slice().first_chunk().copied();
                let ring =
                    |ring: &Vec<geojson::Position>| ring.iter().map(corner).collect::<Option<Vec<Corner>>>();
                let rings: Option<Vec<_>> = polygon.iter().map(ring).collect();
                let rings = rings.ok_or("a corner has fewer than two coordinates")?;
                floors.push(Floor { room: name.to_owned(), rings });
            }
        }
        Self::new(floors)
    }

    fn new(floors: Vec<Floor>) -> Result<Self, String> {
        if floors.is_empty() {
            return Err("it has no room: no polygon is in it".to_owned());
        }
        let corners = || floors.iter().flat_map(|floor| &floor.rings);
        if corners().map(Vec::len).sum::<usize>() > MAX_CORNERS {
            return Err(format!("it has more than {MAX_CORNERS} corners"));
        }
        if let Some(floor) = floors.iter().find(|floor| floor.rings.first().is_none_or(|ring| ring.len() < 3))
        {
            return Err(format!("the polygon of `{}` has fewer than three corners", floor.room));
        }
        if !corners().flatten().flatten().all(|value| value.is_finite()) {
            return Err("a corner is nowhere".to_owned());
        }
        Ok(Self { floors })
    }

    /// The room at a place; none outside of all, and where polygons of two rooms overlap.
    pub(super) fn at(&self, pose: &Pose) -> Option<&str> {
        let mut rooms =
            self.floors.iter().filter(|floor| floor.holds([pose.x, pose.y])).map(|floor| floor.room.as_str());
        let room = rooms.next()?;
        rooms.all(|other| other == room).then_some(room)
    }
}

impl Floor {
    fn holds(&self, point: Corner) -> bool {
        // A hole is a ring within a ring.
        self.rings.iter().filter(|ring| is_within(point, ring)).count() % 2 == 1
    }
}

/// Whether a point is within a ring, by how often a ray from it crosses the ring (even-odd rule).
fn is_within([x, y]: Corner, ring: &[Corner]) -> bool {
    let next = ring.iter().cycle().skip(1);
    let crosses = |&(&[x0, y0], &[x1, y1]): &(&Corner, &Corner)| {
        (y0 > y) != (y1 > y) && x < x0 + (y - y0) / (y1 - y0) * (x1 - x0)
    };
    ring.iter().zip(next).filter(crosses).count() % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(map: &RoomMap, x: f64, y: f64) -> Option<&str> {
        map.at(&Pose { x, y, angle: 0.0 })
    }

    #[test]
    fn rooms_are_where_their_polygons_are() {
        let yaml = "rooms:\n- name: hall\n  polygon: [[0,0],[4,0],[4,2],[0,2]]\n- name: bath\n  polygon: [[3,1],[6,1],[6,3],[3,3]]\n";
        let map = RoomMap::of_yaml(yaml).unwrap();
        assert_eq!(at(&map, 1.0, 1.0), Some("hall"));
        assert_eq!(at(&map, 5.0, 2.0), Some("bath"));
        assert_eq!(at(&map, 3.5, 1.5), None, "in both");
        assert_eq!(at(&map, -1.0, 1.0), None);
    }

    #[test]
    fn geojson_may_have_holes_parts_and_other_things() {
        let text = r#"{"type": "FeatureCollection", "features": [
            {"type": "Feature", "properties": {"room": "court"}, "geometry": {"type": "MultiPolygon", "coordinates": [
                [[[0,0],[9,0],[9,9],[0,9],[0,0]], [[3,3],[6,3],[6,6],[3,6],[3,3]]],
                [[[20,0],[21,0],[21,1],[20,0]]]]}},
            {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": [1, 2]}}]}"#;
        let map = RoomMap::of_geojson(text).unwrap();
        assert_eq!(
            [at(&map, 1.0, 1.0), at(&map, 4.0, 4.0), at(&map, 20.8, 0.2)],
            [Some("court"), None, Some("court")]
        );
    }

    #[test]
    fn a_map_without_rooms_is_refused() {
        assert!(RoomMap::of_yaml("rooms: []").unwrap_err().contains("no room"));
        assert!(RoomMap::of_yaml("image: map.pgm\nresolution: 0.05\n").unwrap_err().contains("rooms"));
        assert!(
            RoomMap::of_yaml("rooms:\n- name: a\n  polygon: [[0,0],[1,1]]\n").unwrap_err().contains("three")
        );
        assert!(
            RoomMap::of_geojson(r#"{"type": "FeatureCollection", "features": []}"#)
                .unwrap_err()
                .contains("no room")
        );
        assert!(RoomMap::of_geojson("{}").is_err());
    }

    proptest! {
        #[test]
        fn no_map_panics(text in "[ -~\n]{0,120}") {
            let _ = RoomMap::of_yaml(&text);
            let _ = RoomMap::of_geojson(&text);
        }

        #[test]
        fn a_box_holds_what_lies_between_its_sides(x in -1.0..3.0_f64, y in -1.0..3.0_f64) {
            let ring = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
            let expected = (0.0..2.0).contains(&x) && (0.0..2.0).contains(&y);
            prop_assert_eq!(is_within([x, y], &ring), expected);
        }
    }
}
