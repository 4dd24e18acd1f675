//! Which furniture stands where: along the walls of each kind of room, with pictures above.

mod item;
mod office;
mod utility;

pub(super) use item::Item;

use super::builder::{Builder, Frame};
use super::building::{WALL, Wall};
use super::plan::{Room, RoomKind, Side};
use super::texture::Pattern;
use super::vector::vec3;
use rand::Rng;
use rand::seq::SliceRandom;

/// Furnishes a room. What there is and about where is the same in every sequence of a lab.
pub(super) fn furnish(b: &mut Builder, room: &Room) {
    if room.kind == RoomKind::Corridor {
        return furnish_corridor(b, room);
    }
    let entrance = room.entrance();
    let [first, second] = match entrance {
        Side::South | Side::North => [Side::West, Side::East],
        _ => [Side::South, Side::North],
    };
    let [far, left, right] = program(room.kind).map(|items| {
        let mut items = items.to_vec();
        items.shuffle(&mut b.layout);
        items
    });
    let (left, right) = if b.layout.random_bool(0.5) { (left, right) } else { (right, left) };
    line_wall(b, room, entrance.opposite(), [0.15, 0.15], &far);
    for (side, items) in [(first, left), (second, right)] {
        // Corners belong to the far wall; near the door the floor stays free.
        let is_door_low = (side == Side::East) == (entrance == Side::South);
        let margins = if is_door_low { [1.35, 0.9] } else { [0.9, 1.35] };
        line_wall(b, room, side, margins, &items);
        hang_pictures(b, room, side, 0.55);
    }
    hang_pictures(b, room, entrance, 0.7);
    match room.kind {
        RoomKind::ConferenceRoom => island(b, room, 1.75, Item::ConferenceTable),
        RoomKind::LargeOffice | RoomKind::TerminalRoom | RoomKind::RoboticsLab => {
            island(b, room, 1.95, Item::Workbench);
        }
        _ => {}
    }
}

/// What stands along the far wall and the two side walls.
fn program(kind: RoomKind) -> [&'static [Item]; 3] {
    use Item::{
        Bin, Bookshelf, Boxes, Chair, CoatRack, Counter, Cupboard, Desk, DiningTable, MobileRobot, Plant,
        Printer, Rack, Refrigerator, Sofa, Stairs, Stall, Terminal, Urinal, Washbasin, Whiteboard, Workbench,
    };
    match kind {
        RoomKind::OnePersonOffice => {
            [&[Desk, Plant, Bin], &[Bookshelf, Cupboard, CoatRack], &[Desk, Bookshelf, Whiteboard]]
        }
        RoomKind::TwoPersonOffice => {
            [&[Desk, Bin, Plant, Chair], &[Desk, Bookshelf, Cupboard], &[Desk, Bookshelf, CoatRack]]
        }
        RoomKind::LargeOffice => {
            [&[Desk, Desk, Desk, Plant], &[Desk, Bookshelf, Cupboard], &[Desk, Printer, Bookshelf, Boxes]]
        }
        RoomKind::ConferenceRoom => {
            [&[Plant, Chair, Chair, Bin], &[Whiteboard, Chair, Plant], &[Whiteboard, Chair, Chair]]
        }
        RoomKind::TerminalRoom => [
            &[Terminal, Terminal, Terminal, Terminal, Terminal],
            &[Terminal, Terminal, Terminal, Bin],
            &[Terminal, Terminal, Whiteboard, Printer],
        ],
        RoomKind::RoboticsLab => [
            &[Workbench, Workbench, Boxes, MobileRobot],
            &[Rack, Rack, Desk, Boxes],
            &[MobileRobot, Desk, Whiteboard],
        ],
        RoomKind::PrinterArea => [&[Printer, Bin, Printer, Boxes], &[Cupboard, Boxes], &[Cupboard, Printer]],
        RoomKind::Kitchen => {
            [&[DiningTable, Plant, Bin], &[Counter, Refrigerator], &[DiningTable, Cupboard, Bin]]
        }
        RoomKind::Bathroom => {
            [&[Stall, Stall, Stall], &[Washbasin, Bin, Washbasin], &[Urinal, Urinal, Urinal]]
        }
        RoomKind::Stairs => [&[Stairs], &[Plant, Bin], &[Sofa]],
        RoomKind::Corridor => [&[], &[], &[]],
    }
}

/// Sets items along a wall from one end to the other, for as long as there is room.
fn line_wall(b: &mut Builder, room: &Room, side: Side, margins: [f32; 2], items: &[Item]) {
    let wall = Wall::of(room, side);
    let widths: f32 = items.iter().map(|item| item.width()).sum();
    let space = wall.length - margins[0] - margins[1];
    let gap = ((space - widths) / (items.len() + 1) as f32).clamp(0.02, 0.5);
    let mut from = margins[0] + gap * b.fixed(0.3, 1.0);
    for &item in items {
        let to = from + item.width();
        if to > wall.length - margins[1] {
            continue;
        }
        if wall.is_solid(room, [from, to], item.height()) {
            let shift = b.varying(-0.5, 0.5) * gap.min(0.2);
            let is_away = item.is_movable() && b.run.random_bool(0.25);
            let yaw = if item.is_movable() { b.varying(-0.3, 0.3) } else { b.varying(-0.01, 0.01) };
            b.frame = wall.frame;
            let n_solids = b.solids.len();
            b.at([(from + to) / 2.0 + shift, WALL + 0.01, 0.0], yaw, |b| b.beside_the_way(|b| item.build(b)));
            if is_away {
                b.solids.truncate(n_solids);
            }
        }
        from = to + gap;
    }
}

/// Hangs posters, notices and the like where the wall is free of openings.
fn hang_pictures(b: &mut Builder, room: &Room, side: Side, density: f64) {
    let wall = Wall::of(room, side);
    let mut from = b.fixed(0.15, 0.6);
    loop {
        let width = b.fixed(0.35, 0.95);
        let to = from + width;
        if to > wall.length - 0.15 {
            return;
        }
        let (is_hung, height, bottom) =
            (b.layout.random_bool(density), b.fixed(0.4, 0.95), b.fixed(1.1, 1.5));
        let (variant, is_notice) = (b.variant(), b.layout.random_bool(0.25));
        // Now and then somebody hangs up another one.
        let variant = if b.run.random_bool(0.12) { b.run.random() } else { variant };
        if is_hung && wall.is_solid(room, [from, to], f32::INFINITY) {
            let pattern = if is_notice { Pattern::Notices } else { Pattern::Poster };
            let picture = b.fitted(pattern, variant);
            b.frame = wall.frame;
            let place = [(from + to) / 2.0, WALL + 0.006, bottom + height / 2.0];
            b.fronted([place, [width, 0.012, height]], picture, picture);
        }
        from = to + b.fixed(0.1, 0.7);
    }
}

/// A large piece in the middle of a room, `margin` from the walls.
fn island(b: &mut Builder, room: &Room, margin: f32, item: Item) {
    let [width, depth] = room.rect.size().map(|size| size - 2.0 * margin);
    if depth < 0.7 || width < item.width() {
        return;
    }
    let [x, y] = room.rect.center();
    let yaw = b.varying(-0.04, 0.04);
    b.frame = Frame { origin: vec3(x, y, 0.0), yaw };
    let n_pieces = (width / item.width()) as usize;
    for piece in 0..n_pieces {
        let x = (piece as f32 - (n_pieces - 1) as f32 / 2.0) * item.width();
        b.at([x, -item.depth() / 2.0, 0.0], 0.0, |b| b.beside_the_way(|b| item.build(b)));
    }
}

/// Corridors have things on their walls, and a few that stand about.
fn furnish_corridor(b: &mut Builder, room: &Room) {
    for side in [Side::South, Side::North] {
        hang_pictures(b, room, side, 0.55);
        let wall = Wall::of(room, side);
        for opening in wall.openings(room) {
            let sheet_variant = b.variant();
            let sheet = b.fitted(Pattern::Paper, sheet_variant);
            b.frame = wall.frame;
            let beside = wall.along(opening.center) + opening.width / 2.0 + 0.2;
            b.block([beside, WALL + 0.005, 1.5], [0.2, 0.01, 0.14], sheet);
        }
        let mut from = b.fixed(0.5, 2.0);
        while from < wall.length - 1.0 {
            let choices = [Item::Bin, Item::Plant, Item::Extinguisher, Item::Extinguisher, Item::Boxes];
            let item = choices[b.layout.random_range(0..choices.len())];
            let is_away = b.run.random_bool(0.25);
            let at = from + b.varying(-0.1, 0.1);
            let reach = item.width() / 2.0 + 0.15;
            if wall.is_solid(room, [at - reach, at + reach], 1.0) {
                let n_solids = b.solids.len();
                b.frame = wall.frame;
                b.at([at, WALL + 0.01, 0.0], 0.0, |b| b.beside_the_way(|b| item.build(b)));
                if is_away {
                    b.solids.truncate(n_solids);
                }
            }
            from += b.fixed(1.8, 4.5);
        }
    }
}
