//! Light: baked diffuse light from lamps, windows and sunlit spots, and the sun itself.
//!
//! All lights are small flat emitters. The light that they throw on each point of a coarse grid in every
//! room, shadows included, is stored for six directions as an ambient cube (McTaggart, *Half-Life 2 /
//! Valve Source Shading*, 2004) and interpolated between. What walls reflect is one constant a room.

use super::caster::Caster;
use super::plan::{Plan, Rect};
use super::vector::{Color, Vec3, vec3};
use rayon::prelude::*;

/// A small flat emitter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Light {
    pub position: Vec3,
    pub normal: Vec3,
    /// Radiance times area, in square meters.
    pub power: Color,
    /// The room that it hangs in.
    pub room_idx: usize,
}

/// A window's glass, through which the sun may shine.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pane {
    pub center: Vec3,
    /// The horizontal unit normal that points into the room.
    pub inward: Vec3,
    pub half_width: f32,
    pub half_height: f32,
    pub room_idx: usize,
}

impl Pane {
    /// The horizontal unit vector along the pane.
    pub fn along(&self) -> Vec3 {
        vec3(-self.inward.y, self.inward.x, 0.0)
    }
}

/// The sun, seen through the panes that face it.
pub(super) struct Sun {
    /// The unit vector toward it.
    pub toward: Vec3,
    /// Radiance of a white surface that faces it.
    pub strength: Color,
    /// Only panes that it shines through.
    panes: Vec<Pane>,
}

impl Sun {
    pub fn new(toward: Vec3, strength: Color, panes: &[Pane]) -> Self {
        let faces = |pane: &&Pane| toward.dot(pane.inward) < -0.1;
        Self { toward, strength, panes: panes.iter().filter(faces).copied().collect() }
    }

    /// Where the sun's ray through a point comes through a pane, if it does.
    pub fn entry(&self, point: Vec3) -> Option<Vec3> {
        self.panes.iter().find_map(|pane| {
            let distance = (pane.center - point).dot(pane.inward) / self.toward.dot(pane.inward);
            let crossing = point + self.toward * distance;
            let offset = crossing - pane.center;
            let is_inside =
                offset.z.abs() < pane.half_height && offset.dot(pane.along()).abs() < pane.half_width;
            (distance > 0.0 && is_inside).then_some(crossing)
        })
    }

    /// The spots that the sun lights, as emitters of what they reflect.
    pub fn reflections(&self, caster: &Caster) -> Vec<Light> {
        const ALBEDO: f32 = 0.45;
        const PER_SIDE: usize = 4;
        let mut lights = Vec::new();
        for pane in &self.panes {
            let area = 4.0 * pane.half_width * pane.half_height / (PER_SIDE * PER_SIDE) as f32;
            let flux = area * -self.toward.dot(pane.inward);
            for idx in 0..PER_SIDE * PER_SIDE {
                let share = |i: usize| (i as f32 + 0.5) / PER_SIDE as f32 * 2.0 - 1.0;
                let from = pane.center
                    + pane.along() * (share(idx % PER_SIDE) * pane.half_width)
                    + vec3(0.0, 0.0, share(idx / PER_SIDE) * pane.half_height)
                    + pane.inward * 0.02;
                let to_floor = from.z / self.toward.z;
                let (distance, normal) = match caster.cast(from, -self.toward, to_floor) {
                    Some(hit) => {
                        let point = from - self.toward * hit.distance;
                        (hit.distance, caster.solid(hit.solid_idx).surface(point).normal)
                    }
                    None => (to_floor, vec3(0.0, 0.0, 1.0)),
                };
                let position = from - self.toward * distance + normal * 0.02;
                let power = self.strength * (ALBEDO * flux);
                lights.push(Light { position, normal, power, room_idx: pane.room_idx });
            }
        }
        lights
    }
}

/// The diffuse light of all rooms.
pub(super) struct LightField {
    rooms: Vec<RoomField>,
}

/// A grid of ambient cubes that fills a room; the light in the order +x, -x, +y, -y, +z, -z.
struct RoomField {
    corner: Vec3,
    spacing: Vec3,
    n_cells: [usize; 3],
    cubes: Vec<[Color; 6]>,
}

const DIRECTIONS: [Vec3; 6] = [
    vec3(1.0, 0.0, 0.0),
    vec3(-1.0, 0.0, 0.0),
    vec3(0.0, 1.0, 0.0),
    vec3(0.0, -1.0, 0.0),
    vec3(0.0, 0.0, 1.0),
    vec3(0.0, 0.0, -1.0),
];

impl LightField {
    /// Bakes the light of `lights` in every room.
    pub fn bake(plan: &Plan, caster: &Caster, lights: &[Light]) -> Self {
        let bake = |room_idx: usize| {
            // Light comes into a room from itself, or through a door from or by the corridor.
            let reaches = |light: &&Light| light.room_idx == room_idx || light.room_idx == 0 || room_idx == 0;
            let near: Vec<Light> = lights.iter().filter(reaches).copied().collect();
            let own = |light: &&Light| light.room_idx == room_idx;
            let total = lights.iter().filter(own).fold(Color::default(), |sum, light| sum + light.power);
            RoomField::bake(plan.rooms[room_idx].rect, plan.ceiling, |corner_to_cell| {
                let ambient = total * (1.0 / surface_area(plan.rooms[room_idx].rect, plan.ceiling));
                cube(corner_to_cell, caster, &near, ambient)
            })
        };
        Self { rooms: (0..plan.rooms.len()).map(bake).collect() }
    }

    /// The radiance of a white surface with this normal at a point of a room, without direct sun.
    #[inline]
    pub fn irradiance(&self, room_idx: usize, point: Vec3, normal: Vec3) -> Color {
        self.rooms[room_idx].irradiance(point, normal)
    }
}

impl RoomField {
    fn bake(rect: Rect, ceiling: f32, cube: impl Fn(Vec3) -> [Color; 6] + Sync) -> Self {
        const SPACING: f32 = 0.35;
        let size = vec3(rect.size()[0], rect.size()[1], ceiling);
        let n_cells = [size.x, size.y, size.z].map(|length| (length / SPACING).ceil() as usize);
        let [nx, ny, nz] = n_cells;
        let spacing = vec3(size.x / nx as f32, size.y / ny as f32, size.z / nz as f32);
        let corner = vec3(rect.x0, rect.y0, 0.0);
        let center = |idx: usize| {
            let [x, y, z] = [idx % nx, idx / nx % ny, idx / nx / ny].map(|cell| cell as f32 + 0.5);
            corner + spacing * vec3(x, y, z)
        };
        let cubes = (0..nx * ny * nz).into_par_iter().map(|idx| cube(center(idx))).collect();
        Self { corner, spacing, n_cells, cubes }
    }

    #[inline]
    fn irradiance(&self, point: Vec3, normal: Vec3) -> Color {
        // A little off the surface, where cells are not half inside of it.
        const LIFT: f32 = 0.15;
        let place = point + normal * LIFT - self.corner;
        let cell = |at: f32, spacing: f32, n: usize| {
            let at = (at / spacing - 0.5).clamp(0.0, (n - 1) as f32);
            let low = (at as usize).min(n.saturating_sub(2));
            (low, (low + 1).min(n - 1), at - low as f32)
        };
        let [nx, ny, nz] = self.n_cells;
        let (x0, x1, right) = cell(place.x, self.spacing.x, nx);
        let (y0, y1, far) = cell(place.y, self.spacing.y, ny);
        let (z0, z1, up) = cell(place.z, self.spacing.z, nz);
        let faces = [
            (usize::from(normal.x < 0.0), normal.x * normal.x),
            (2 + usize::from(normal.y < 0.0), normal.y * normal.y),
            (4 + usize::from(normal.z < 0.0), normal.z * normal.z),
        ];
        let mut sum = Color::default();
        for (face, weight) in faces {
            if weight < 1e-3 {
                continue;
            }
            let at = |x: usize, y: usize, z: usize| self.cubes[(z * ny + y) * nx + x][face];
            let row = |y: usize, z: usize| at(x0, y, z) * (1.0 - right) + at(x1, y, z) * right;
            let layer = |z: usize| row(y0, z) * (1.0 - far) + row(y1, z) * far;
            sum += (layer(z0) * (1.0 - up) + layer(z1) * up) * weight;
        }
        sum
    }
}

/// The light on six faces at a point.
fn cube(point: Vec3, caster: &Caster, lights: &[Light], ambient: Color) -> [Color; 6] {
    const REACH: f32 = 9.0;
    let mut faces = [ambient; 6];
    for light in lights {
        let way = light.position - point;
        let squared = way.dot(way);
        let direction = way * (1.0 / squared.sqrt());
        let leaving = -direction.dot(light.normal);
        if squared > REACH * REACH || leaving <= 0.0 || !caster.is_clear(light.position, point) {
            continue;
        }
        // Near an emitter the formula of a point runs away.
        let arriving = light.power * (leaving / (std::f32::consts::PI * squared.max(0.15)));
        for (face, axis) in faces.iter_mut().zip(DIRECTIONS) {
            *face += arriving * direction.dot(axis).max(0.0);
        }
    }
    faces
}

fn surface_area(rect: Rect, ceiling: f32) -> f32 {
    let [width, depth] = rect.size();
    2.0 * (width * depth + (width + depth) * ceiling)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::plan::Plan;
    use crate::simulate::vector::gray;
    use crate::simulate::{Lab, Part, seeded};

    #[test]
    fn light_falls_off_with_distance_and_stays_in_its_room() {
        let plan = Plan::draw(Lab::Ljubljana, Part::A, &mut seeded(&[1]));
        let [x, y] = plan.rooms[1].rect.center();
        let (position, normal) = (vec3(x, y, plan.ceiling - 0.1), vec3(0.0, 0.0, -1.0));
        let lamp = Light { position, normal, power: gray(1.0), room_idx: 1 };
        let caster = Caster::new(Vec::new(), plan.bounds());
        let field = LightField::bake(&plan, &caster, &[lamp]);
        let up = vec3(0.0, 0.0, 1.0);
        let below = field.irradiance(1, vec3(x, y, 0.0), up).x;
        let aside = field.irradiance(1, vec3(x + 1.2, y, 0.0), up).x;
        assert!(below > 1.2 * aside && aside > 0.0, "{below} {aside}");
        let [x, y] = plan.rooms[2].rect.center();
        assert_eq!(field.irradiance(2, vec3(x, y, 0.0), up).x, 0.0);
    }

    #[test]
    fn the_sun_enters_only_through_panes_that_face_it() {
        let pane = |y: f32, inward: f32| Pane {
            center: vec3(0.0, y, 1.5),
            inward: vec3(0.0, inward, 0.0),
            half_width: 0.5,
            half_height: 0.5,
            room_idx: 0,
        };
        let toward = vec3(0.0, -1.0, 1.0).normalized();
        let sun = Sun::new(toward, gray(1.0), &[pane(0.0, 1.0), pane(4.0, -1.0)]);
        assert!(
            sun.entry(vec3(0.0, 1.5, 0.0)).is_some(),
            "a ray of 45 degrees ends as far in as the pane is high"
        );
        assert!(sun.entry(vec3(0.0, 2.5, 0.0)).is_none());
        assert!(sun.entry(vec3(0.8, 1.5, 0.0)).is_none());
    }
}
