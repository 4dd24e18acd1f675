//! Floor plans: a corridor with rooms on both sides, in the labs' names of COLD.

use super::{Lab, Part, Route};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// A rectangle of the floor, in meters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub x0: f32,
    pub y0: f32,
    pub x1: f32,
    pub y1: f32,
}

impl Rect {
    pub fn contains(&self, x: f32, y: f32) -> bool {
        self.x0 <= x && x < self.x1 && self.y0 <= y && y < self.y1
    }

    /// The size along x and along y.
    pub fn size(&self) -> [f32; 2] {
        [self.x1 - self.x0, self.y1 - self.y0]
    }

    pub fn center(&self) -> [f32; 2] {
        [(self.x0 + self.x1) / 2.0, (self.y0 + self.y1) / 2.0]
    }

    /// The distance from a point to the rectangle's outline.
    pub fn border_distance(&self, x: f32, y: f32) -> f32 {
        let outside = [(self.x0 - x).max(x - self.x1), (self.y0 - y).max(y - self.y1)];
        let deepest = outside[0].max(outside[1]);
        if deepest <= 0.0 { -deepest } else { outside[0].max(0.0).hypot(outside[1].max(0.0)) }
    }
}

/// What a room is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RoomKind {
    Corridor,
    OnePersonOffice,
    TwoPersonOffice,
    LargeOffice,
    ConferenceRoom,
    TerminalRoom,
    RoboticsLab,
    PrinterArea,
    Kitchen,
    Bathroom,
    Stairs,
}

impl RoomKind {
    /// The kind of a COLD label without its part suffix.
    fn of_token(token: &str) -> Self {
        match token {
            "1PO" => Self::OnePersonOffice,
            "2PO" | "2PO1" | "2PO2" => Self::TwoPersonOffice,
            "LO" => Self::LargeOffice,
            "CNR" => Self::ConferenceRoom,
            "TR" => Self::TerminalRoom,
            "RL" | "LAB" => Self::RoboticsLab,
            "PA" => Self::PrinterArea,
            "KT" => Self::Kitchen,
            "TL" => Self::Bathroom,
            "ST" => Self::Stairs,
            _ => Self::Corridor,
        }
    }

    /// The smallest width along the corridor and depth away from it, in meters.
    fn base_size(self) -> [f32; 2] {
        match self {
            Self::Corridor => [0.0, 2.1],
            Self::OnePersonOffice => [3.3, 4.2],
            Self::TwoPersonOffice => [4.2, 4.5],
            Self::LargeOffice => [6.0, 5.0],
            Self::ConferenceRoom => [5.4, 5.0],
            Self::TerminalRoom => [5.0, 5.2],
            Self::RoboticsLab => [5.4, 5.0],
            Self::PrinterArea => [3.0, 2.8],
            Self::Kitchen => [3.4, 5.0],
            Self::Bathroom => [3.0, 4.6],
            Self::Stairs => [3.0, 4.6],
        }
    }

    /// Whether the room opens to the corridor without a door.
    fn is_open(self) -> bool {
        matches!(self, Self::PrinterArea | Self::Stairs)
    }

    /// How many windows the outer wall has.
    fn n_windows(self) -> usize {
        match self {
            Self::Corridor => 0,
            Self::PrinterArea | Self::Bathroom | Self::Kitchen | Self::Stairs => 1,
            Self::OnePersonOffice | Self::TwoPersonOffice => 2,
            _ => 3,
        }
    }
}

/// A wall of a rectangle, by the compass with north along y.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    South,
    North,
    West,
    East,
}

impl Side {
    pub const ALL: [Self; 4] = [Self::South, Self::North, Self::West, Self::East];

    pub fn opposite(self) -> Self {
        match self {
            Self::South => Self::North,
            Self::North => Self::South,
            Self::West => Self::East,
            Self::East => Self::West,
        }
    }
}

/// What fills a hole in a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OpeningKind {
    /// A door into the room `to`, which has its leaf. The corridor's side of it has none.
    Door { has_leaf: bool, to: usize },
    /// A passage without a door.
    Passage,
    /// A window to the outside.
    Window,
}

/// A hole in a wall: centered at `center` (x for south and north walls, y for west and east ones).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Opening {
    pub side: Side,
    pub kind: OpeningKind,
    pub center: f32,
    pub width: f32,
    pub bottom: f32,
    pub top: f32,
}

/// A room: walls run along the outline of its rectangle, inside it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Room {
    pub kind: RoomKind,
    /// As in `places.lst`, with the part suffix.
    pub label: String,
    pub rect: Rect,
    pub openings: Vec<Opening>,
    /// Whether the standard path goes there; the extended path goes everywhere.
    pub is_standard: bool,
}

impl Room {
    /// The wall through which the room is entered; for the corridor, its western end.
    pub fn entrance(&self) -> Side {
        let is_entrance = |opening: &&Opening| opening.kind != OpeningKind::Window;
        match self.kind {
            RoomKind::Corridor => Side::West,
            _ => self.openings.iter().find(is_entrance).map_or(Side::South, |opening| opening.side),
        }
    }

    /// Where along its wall the room is entered, in plan coordinates.
    pub fn entrance_center(&self) -> f32 {
        let side = self.entrance();
        let on_side = |opening: &&Opening| opening.side == side && opening.kind != OpeningKind::Window;
        self.openings.iter().find(on_side).map_or(self.rect.center()[0], |opening| opening.center)
    }
}

/// The rooms of one part of a lab. Rectangles share borders, so that every point inside has one room.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plan {
    /// The corridor first.
    pub rooms: Vec<Room>,
    /// The height of all rooms, in meters.
    pub ceiling: f32,
}

/// The rooms off the corridor in the order in which the robot finds them, as in COLD's label files
/// (Ljubljana's part B does not exist there).
fn program(lab: Lab, part: Part) -> &'static [(&'static str, Route)] {
    use Route::{Extended, Standard};
    match (lab, part) {
        (Lab::Freiburg, Part::A) => &[
            ("PA", Standard),
            ("LO", Extended),
            ("2PO1", Standard),
            ("2PO2", Extended),
            ("1PO", Extended),
            ("ST", Standard),
            ("TL", Standard),
        ],
        (Lab::Freiburg, Part::B) => {
            &[("2PO", Standard), ("1PO", Standard), ("KT", Extended), ("ST", Standard), ("TL", Standard)]
        }
        (Lab::Saarbruecken, Part::A) => &[
            ("TR", Extended),
            ("RL", Extended),
            ("2PO", Standard),
            ("1PO", Extended),
            ("CNR", Extended),
            ("PA", Standard),
            ("TL", Extended),
        ],
        (Lab::Saarbruecken, Part::B) => {
            &[("TL", Standard), ("KT", Extended), ("1PO", Standard), ("PA", Standard)]
        }
        (Lab::Ljubljana, Part::A) => {
            &[("PA", Standard), ("KT", Extended), ("LAB", Standard), ("2PO", Standard), ("TL", Standard)]
        }
        (Lab::Ljubljana, Part::B) => &[
            ("1PO", Standard),
            ("PA", Standard),
            ("CNR", Extended),
            ("2PO", Standard),
            ("KT", Extended),
            ("TL", Standard),
        ],
    }
}

impl Plan {
    /// Draws the plan of one part of a lab: which rooms is fixed, their sizes and sides are drawn.
    pub fn draw(lab: Lab, part: Part, rng: &mut ChaCha8Rng) -> Self {
        let suffix = part.suffix();
        let half_width = (RoomKind::Corridor.base_size()[1] + rng.random_range(0.0..0.5)) / 2.0;
        let mut corridor_openings = Vec::new();
        let mut rooms = Vec::new();
        let mut reach = [rng.random_range(0.6..1.4), rng.random_range(0.6..2.2)];
        for (room_idx, &(token, route)) in program(lab, part).iter().enumerate() {
            let side_idx = usize::from(reach[1] < reach[0]);
            let mut room = draw_room(RoomKind::of_token(token), reach[side_idx], side_idx == 0, rng);
            room.label = format!("{token}-{suffix}");
            room.is_standard = route == Route::Standard;
            let (shift, mirrored) =
                if side_idx == 0 { (half_width, Side::North) } else { (-half_width, Side::South) };
            room.rect.y0 += shift;
            room.rect.y1 += shift;
            reach[side_idx] = room.rect.x1 + rng.random_range(0.1..1.2);
            for opening in &mut room.openings {
                if opening.kind == OpeningKind::Window {
                    continue;
                }
                let mut kind = opening.kind;
                if let OpeningKind::Door { has_leaf, to } = &mut kind {
                    *has_leaf = false;
                    *to = room_idx + 1;
                }
                corridor_openings.push(Opening { side: mirrored, kind, ..*opening });
            }
            rooms.push(room);
        }
        let length = reach[0].max(reach[1]) + rng.random_range(0.4..1.0);
        for side in [Side::West, Side::East] {
            let (kind, width) = (OpeningKind::Window, half_width * rng.random_range(0.7..1.1));
            corridor_openings.push(Opening { side, kind, center: 0.0, width, bottom: 0.9, top: 2.2 });
        }
        let corridor = Room {
            kind: RoomKind::Corridor,
            label: format!("CR-{suffix}"),
            rect: Rect { x0: 0.0, y0: -half_width, x1: length, y1: half_width },
            openings: corridor_openings,
            is_standard: true,
        };
        rooms.insert(0, corridor);
        Self { rooms, ceiling: rng.random_range(2.6..2.95) }
    }

    /// The index of the room that a point stands in; the nearest one for points outside of all.
    #[inline]
    pub fn room_at(&self, x: f32, y: f32) -> usize {
        let inside = self.rooms.iter().position(|room| room.rect.contains(x, y));
        inside.unwrap_or_else(|| {
            let distance = |idx: &usize| self.rooms[*idx].rect.border_distance(x, y);
            (0..self.rooms.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
        })
    }

    /// The rectangle round all rooms.
    pub fn bounds(&self) -> Rect {
        self.rooms.iter().skip(1).fold(self.rooms[0].rect, |bounds, room| Rect {
            x0: bounds.x0.min(room.rect.x0),
            y0: bounds.y0.min(room.rect.y0),
            x1: bounds.x1.max(room.rect.x1),
            y1: bounds.y1.max(room.rect.y1),
        })
    }
}

/// A room whose western wall is at `x0`, beyond the corridor's wall at y = 0 to the north or south.
fn draw_room(kind: RoomKind, x0: f32, is_north: bool, rng: &mut ChaCha8Rng) -> Room {
    let [width, depth] = kind.base_size().map(|size| size * rng.random_range(1.0..1.18));
    let (y0, y1) = if is_north { (0.0, depth) } else { (-depth, 0.0) };
    let rect = Rect { x0, y0, x1: x0 + width, y1 };
    let entrance = if is_north { Side::South } else { Side::North };
    let mut openings = Vec::new();
    if kind.is_open() {
        let width = width * rng.random_range(0.55..0.7);
        let (kind, center) = (OpeningKind::Passage, rect.center()[0]);
        openings.push(Opening { side: entrance, kind, center, width, bottom: 0.0, top: 2.35 });
    } else {
        let from_corner = rng.random_range(0.8..1.0);
        let center = if rng.random_bool(0.5) { rect.x0 + from_corner } else { rect.x1 - from_corner };
        let width = rng.random_range(0.92..1.02);
        let kind = OpeningKind::Door { has_leaf: true, to: 0 };
        openings.push(Opening { side: entrance, kind, center, width, bottom: 0.0, top: 2.05 });
    }
    let n_windows = kind.n_windows();
    let bay = width / n_windows.max(1) as f32;
    let window_width = (bay * 0.72).min(1.5);
    let bottom = if kind == RoomKind::Bathroom { 1.45 } else { 0.9 };
    for window_idx in 0..n_windows {
        let center = x0 + bay * (window_idx as f32 + 0.5);
        let (side, kind) = (entrance.opposite(), OpeningKind::Window);
        openings.push(Opening { side, kind, center, width: window_width, bottom, top: 2.25 });
    }
    Room { kind, label: String::new(), rect, openings, is_standard: false }
}
