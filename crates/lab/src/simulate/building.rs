//! The shell of a room: walls with their openings, doors, windows, lamps.

use super::Illumination;
use super::builder::{Builder, Frame};
use super::light::{Light, Pane};
use super::plan::{Opening, OpeningKind, Room, RoomKind, Side};
use super::solid::{Mapping, Material};
use super::texture::Pattern;
use super::vector::{Color, gray, vec3};
use rand::Rng;

/// How thick each room's half of a wall is, in meters.
pub(super) const WALL: f32 = 0.06;

/// A wall of a room as a place to build at: local x along it, y into the room.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wall {
    pub frame: Frame,
    pub length: f32,
    side: Side,
}

impl Wall {
    /// The wall on one side of a room.
    pub fn of(room: &Room, side: Side) -> Self {
        use std::f32::consts::{FRAC_PI_2, PI};
        let rect = room.rect;
        let [width, depth] = rect.size();
        let (x, y, yaw, length) = match side {
            Side::South => (rect.x0, rect.y0, 0.0, width),
            Side::North => (rect.x1, rect.y1, PI, width),
            Side::West => (rect.x0, rect.y1, -FRAC_PI_2, depth),
            Side::East => (rect.x1, rect.y0, FRAC_PI_2, depth),
        };
        Self { frame: Frame { origin: vec3(x, y, 0.0), yaw }, length, side }
    }

    /// Where along the wall a plan coordinate is.
    pub fn along(&self, center: f32) -> f32 {
        match self.side {
            Side::South => center - self.frame.origin.x,
            Side::North => self.frame.origin.x - center,
            Side::West => self.frame.origin.y - center,
            Side::East => center - self.frame.origin.y,
        }
    }

    /// The openings in this wall, from one end to the other.
    pub fn openings(&self, room: &Room) -> Vec<Opening> {
        let mut openings: Vec<Opening> =
            room.openings.iter().filter(|opening| opening.side == self.side).copied().collect();
        openings.sort_by(|a, b| self.along(a.center).total_cmp(&self.along(b.center)));
        openings
    }

    /// Whether a stretch of the wall, at least up to a height, has no opening in it.
    pub fn is_solid(&self, room: &Room, [low, high]: [f32; 2], height: f32) -> bool {
        self.openings(room).iter().all(|opening| {
            let center = self.along(opening.center);
            let half = opening.width / 2.0 + 0.08;
            opening.bottom >= height || center + half < low || center - half > high
        })
    }
}

/// What all rooms of a lab share.
pub(super) struct Shell {
    pub ceiling: f32,
    pub illumination: Illumination,
    pub trim: Material,
    pub leaf: Material,
    pub view: Material,
    /// Round (true) or long lamps.
    pub has_square_lamps: bool,
}

impl Shell {
    /// The looks of a lab.
    pub fn new(b: &mut Builder, ceiling: f32, illumination: Illumination) -> Self {
        let shade = b.fixed(0.25, 0.8);
        let trim = b.paint(vec3(shade, shade * 0.93, shade * 0.85));
        let variant = b.variant();
        let leaf = b.fitted(Pattern::DoorLeaf, variant);
        let (pattern, glow) = match illumination {
            Illumination::Cloudy => (Pattern::DayView, 4.0),
            Illumination::Sunny => (Pattern::DayView, 7.0),
            Illumination::Night => (Pattern::NightView, 0.5),
        };
        let variant = b.variant();
        let view = Material { mapping: Mapping::Outside, glow, ..b.fitted(pattern, variant) };
        let has_square_lamps = b.layout.random_bool(0.5);
        Self { ceiling, illumination, trim, leaf, view, has_square_lamps }
    }

    /// Builds the shell of a room; `is_open` says for each room whether its door stands open.
    pub fn build(&self, b: &mut Builder, room: &Room, is_open: bool) {
        let wall_material = wall_material(b, room.kind);
        for side in Side::ALL {
            let wall = Wall::of(room, side);
            b.frame = wall.frame;
            self.wall(b, &wall, &wall.openings(room), wall_material);
            for opening in wall.openings(room) {
                let center = wall.along(opening.center);
                b.at([center, 0.0, 0.0], 0.0, |b| match opening.kind {
                    OpeningKind::Window => self.window(b, &opening),
                    OpeningKind::Passage => self.trim(b, &opening),
                    OpeningKind::Door { has_leaf, .. } => {
                        self.trim(b, &opening);
                        if has_leaf {
                            self.leaf(b, &opening, center < wall.length / 2.0, is_open);
                        }
                    }
                });
            }
        }
        self.lamps(b, room);
    }

    fn wall(&self, b: &mut Builder, wall: &Wall, openings: &[Opening], material: Material) {
        let mut piece = |[low, high]: [f32; 2], [bottom, top]: [f32; 2]| {
            if high - low > 0.01 && top - bottom > 0.01 {
                let center = [(low + high) / 2.0, WALL / 2.0, (bottom + top) / 2.0];
                b.block(center, [high - low, WALL, top - bottom], material);
                if bottom == 0.0 && top > 0.5 {
                    let base = [center[0], WALL / 2.0 + 0.006, 0.04];
                    b.block(base, [high - low, WALL + 0.012, 0.08], self.trim);
                }
            }
        };
        let mut from = 0.0;
        for opening in openings {
            let center = wall.along(opening.center);
            let [low, high] = [center - opening.width / 2.0, center + opening.width / 2.0];
            piece([from, low], [0.0, self.ceiling]);
            piece([low, high], [0.0, opening.bottom]);
            piece([low, high], [opening.top, self.ceiling]);
            from = high;
        }
        piece([from, wall.length], [0.0, self.ceiling]);
    }

    /// The frame round a door or passage: it stands out from the wall, also into the opening.
    fn trim(&self, b: &mut Builder, opening: &Opening) {
        const WIDTH: f32 = 0.08;
        const INTO: f32 = 0.01;
        const DEPTH: f32 = WALL + 0.02;
        let half = (opening.width + WIDTH) / 2.0 - INTO;
        for x in [-half, half] {
            b.block([x, DEPTH / 2.0, opening.top / 2.0], [WIDTH, DEPTH, opening.top], self.trim);
        }
        let lintel = [0.0, DEPTH / 2.0, opening.top + WIDTH / 2.0 - INTO];
        b.block(lintel, [opening.width + 2.0 * (WIDTH - INTO), DEPTH, WIDTH], self.trim);
    }

    /// A door's leaf, hinged on the side of the nearer corner.
    fn leaf(&self, b: &mut Builder, opening: &Opening, is_hinged_low: bool, is_open: bool) {
        let angle = if is_open { b.varying(1.35, 1.9) } else { 0.0 };
        let sign = if is_hinged_low { 1.0 } else { -1.0 };
        let half = opening.width / 2.0;
        b.at([-sign * half, WALL, 0.0], sign * angle, |b| {
            let place = [sign * half, 0.0, opening.top / 2.0];
            b.block(place, [opening.width, 0.04, opening.top - 0.01], self.leaf);
        });
    }

    fn window(&self, b: &mut Builder, opening: &Opening) {
        let height = opening.top - opening.bottom;
        let middle = (opening.top + opening.bottom) / 2.0;
        b.block([0.0, 0.005, middle], [opening.width, 0.01, height], self.view);
        for x in [-0.5, 0.0, 0.5] {
            let bar = [x * (opening.width - 0.05), 0.03, middle];
            b.block(bar, [0.05, 0.05, height], self.trim);
        }
        for z in [opening.bottom + 0.025, opening.top - 0.025] {
            b.block([0.0, 0.03, z], [opening.width, 0.05, 0.05], self.trim);
        }
        let sill = b.paint(gray(0.9));
        b.block([0.0, 0.1, opening.bottom], [opening.width + 0.1, 0.2, 0.03], sill);
        if opening.bottom < 1.0 {
            let radiator = b.paint(gray(0.82));
            for rib in 0..10 {
                let x = (rib as f32 - 4.5) * 0.1;
                b.block([x, WALL + 0.07, 0.45], [0.07, 0.09, 0.6], radiator);
            }
        }
        self.blind(b, opening);
        let inward = b.frame.point([0.0, 1.0, 0.0]) - b.frame.origin;
        let [half_width, half_height] = [opening.width / 2.0, height / 2.0];
        // Just before the glass, so that the bars throw shadows.
        let center = b.frame.point([0.0, 0.012, middle]);
        b.panes.push(Pane { center, inward, half_width, half_height, room_idx: b.room_idx });
        self.skylight(b, [opening.width, height], middle);
    }

    /// A blind let down by some way, as somebody left it.
    fn blind(&self, b: &mut Builder, opening: &Opening) {
        let drop = b.varying(-0.4, 0.6).max(0.04);
        let fabric = b.paint(vec3(0.75, 0.72, 0.66));
        for slat in 0..(drop / 0.06) as usize {
            let z = opening.top - 0.06 * slat as f32 - 0.03;
            b.block([0.0, WALL + 0.015, z], [opening.width, 0.02, 0.045], fabric);
        }
    }

    /// What the sky gives through a window.
    fn skylight(&self, b: &mut Builder, [width, height]: [f32; 2], middle: f32) {
        let radiance = match self.illumination {
            Illumination::Cloudy => vec3(3.6, 3.8, 4.0),
            Illumination::Sunny => vec3(4.6, 5.0, 5.5),
            Illumination::Night => gray(0.02),
        };
        let normal = b.frame.point([0.0, 1.0, 0.0]) - b.frame.origin;
        for (x, z) in [(-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)] {
            let position = b.frame.point([x * width, WALL + 0.06, middle + z * height]);
            let power = radiance * (width * height / 4.0);
            b.lights.push(Light { position, normal, power, room_idx: b.room_idx });
        }
    }

    fn lamps(&self, b: &mut Builder, room: &Room) {
        b.frame = Frame { origin: vec3(room.rect.x0, room.rect.y0, 0.0), yaw: 0.0 };
        let size = room.rect.size();
        let [n_x, n_y] = size.map(|length| (length / 2.6).round().max(1.0));
        let lamp = if self.has_square_lamps { [0.6, 0.6] } else { [1.2, 0.2] };
        let is_dark_room = matches!(
            room.kind,
            RoomKind::Corridor | RoomKind::Bathroom | RoomKind::Stairs | RoomKind::PrinterArea
        );
        let is_lit = match self.illumination {
            Illumination::Night => true,
            _ => b.run.random_bool(if is_dark_room { 0.9 } else { 0.25 }),
        };
        for idx in 0..(n_x * n_y) as usize {
            let x = size[0] * ((idx % n_x as usize) as f32 + 0.5) / n_x;
            let y = size[1] * ((idx / n_x as usize) as f32 + 0.5) / n_y;
            let is_broken = b.run.random_bool(0.06);
            let radiance = if is_lit && !is_broken { lamp_radiance(b) } else { Color::default() };
            let panel = Material { glow: radiance.x, ..b.paint(vec3(1.0, 0.97, 0.9)) };
            let housing = b.paint(gray(0.7));
            b.block([x, y, self.ceiling - 0.02], [lamp[0] + 0.06, lamp[1] + 0.06, 0.04], housing);
            b.block([x, y, self.ceiling - 0.035], [lamp[0], lamp[1], 0.04], panel);
            for end in [-0.3, 0.3] {
                let position = b.frame.point([x + end * lamp[0], y, self.ceiling - 0.08]);
                let power = radiance * (lamp[0] * lamp[1] / 2.0);
                let normal = vec3(0.0, 0.0, -1.0);
                b.lights.push(Light { position, normal, power, room_idx: b.room_idx });
            }
        }
    }
}

/// Lamps are warmer than daylight and not all equally bright.
fn lamp_radiance(b: &mut Builder) -> Color {
    vec3(1.0, 0.88, 0.68) * b.varying(8.0, 11.0)
}

fn wall_material(b: &mut Builder, kind: RoomKind) -> Material {
    let variant = b.variant();
    let shade = b.fixed(0.82, 1.0);
    let tint = vec3(shade, shade * b.fixed(0.95, 1.02), shade * b.fixed(0.88, 1.02));
    let material = match kind {
        RoomKind::Bathroom => b.tiled(Pattern::Tiles, variant, 0.8),
        _ => b.tiled(Pattern::Plaster, variant, 1.9),
    };
    Material { tint, ..material }
}

/// What the floor of a room is made of.
pub(super) fn floor_material(b: &mut Builder, kind: RoomKind) -> Material {
    let variant = b.variant();
    match kind {
        RoomKind::Bathroom | RoomKind::Kitchen => b.tiled(Pattern::Tiles, variant, 1.2),
        RoomKind::Corridor | RoomKind::Stairs | RoomKind::PrinterArea => b.tiled(Pattern::Linoleum, 0, 1.5),
        _ if b.layout.random_bool(0.5) => b.tiled(Pattern::Carpet, variant, 1.1),
        _ => b.tiled(Pattern::Linoleum, 1, 1.5),
    }
}
