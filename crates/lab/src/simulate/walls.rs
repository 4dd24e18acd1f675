//! The walls of a lab as lines on its plan, for whoever draws a map of it. They lie beside the labels of each sequence.

use super::plan::{OpeningKind, Plan, Room, Side};
use std::fs;
use std::path::Path;

/// Where a sequence keeps them; COLD has no such file.
pub(super) const WALLS_FILE: &str = "localization/walls.csv";

/// A straight piece of wall, in meters, in the coordinates of the poses. Doors and passages are gaps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// One end.
    pub from: [f32; 2],
    /// The other end.
    pub to: [f32; 2],
}

impl Wall {
    /// Those beside the labels of a simulated sequence; none where there is no such file, as in COLD. Lines that are no
    /// wall are left out.
    pub fn read(sequence: &Path) -> Vec<Self> {
        let text = fs::read_to_string(sequence.join(WALLS_FILE)).unwrap_or_default();
        let wall = |line: &str| {
            let numbers: Vec<f32> =
                line.split(',').map(|field| field.trim().parse().ok()).collect::<Option<_>>()?;
            match numbers[..] {
                [x1, y1, x2, y2] if numbers.iter().all(|number| number.is_finite()) => {
                    Some(Self { from: [x1, y1], to: [x2, y2] })
                }
                _ => None,
            }
        };
        text.lines().filter_map(wall).collect()
    }

    /// A header and a line for each, as they are read.
    pub(super) fn to_csv(walls: &[Self]) -> String {
        let line =
            |Self { from: [x1, y1], to: [x2, y2] }: &Self| format!("{x1:.3},{y1:.3},{x2:.3},{y2:.3}\n");
        ["x1,y1,x2,y2\n".to_owned()].into_iter().chain(walls.iter().map(line)).collect()
    }
}

impl Plan {
    /// All walls. Where two rooms touch, each has its own.
    pub fn walls(&self) -> Vec<Wall> {
        self.rooms
            .iter()
            .flat_map(|room| Side::ALL.into_iter().flat_map(|side| walls_of(room, side)))
            .collect()
    }
}

/// The pieces between the openings that one can go through.
fn walls_of(room: &Room, side: Side) -> Vec<Wall> {
    let rect = room.rect;
    let is_along_x = matches!(side, Side::South | Side::North);
    let (start, end) = if is_along_x { (rect.x0, rect.x1) } else { (rect.y0, rect.y1) };
    let across = match side {
        Side::South => rect.y0,
        Side::North => rect.y1,
        Side::West => rect.x0,
        Side::East => rect.x1,
    };
    let mut gaps: Vec<[f32; 2]> = room
        .openings
        .iter()
        .filter(|opening| opening.side == side && opening.kind != OpeningKind::Window)
        .map(|opening| [opening.center - opening.width / 2.0, opening.center + opening.width / 2.0])
        .collect();
    gaps.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let from = [start].into_iter().chain(gaps.iter().map(|gap| gap[1]));
    let to = gaps.iter().map(|gap| gap[0]).chain([end]);
    let point = |along: f32| if is_along_x { [along, across] } else { [across, along] };
    from.zip(to)
        .filter(|(from, to)| from < to)
        .map(|(from, to)| Wall { from: point(from), to: point(to) })
        .collect()
}
