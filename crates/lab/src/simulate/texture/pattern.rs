//! What is painted on things. The same patterns serve all rooms of all labs; seeds tell them apart.

use super::canvas::Canvas;
use crate::simulate::vector::{Color, gray, vec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// A kind of surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::simulate) enum Pattern {
    Plaster,
    Carpet,
    Linoleum,
    Tiles,
    CeilingTiles,
    Wood,
    Paint,
    Fabric,
    Steel,
    Leaves,
    Cardboard,
    Poster,
    Notices,
    Paper,
    Books,
    Screen,
    Keyboard,
    Whiteboard,
    Drawers,
    Cupboard,
    DoorLeaf,
    Appliance,
    Electronics,
    DayView,
    NightView,
}

impl Pattern {
    /// How many different ones a lab has.
    pub fn n_variants(self) -> u32 {
        match self {
            Self::Poster => 18,
            Self::Books | Self::Screen | Self::Paper => 6,
            Self::Notices | Self::Whiteboard | Self::Appliance | Self::Electronics => 4,
            Self::Plaster | Self::Fabric | Self::Carpet | Self::Wood | Self::Cardboard => 3,
            _ => 2,
        }
    }

    /// Paints one of its kind.
    pub(super) fn paint(self, rng: &mut ChaCha8Rng) -> Canvas {
        match self {
            Self::Plaster => plaster(rng),
            Self::Carpet => carpet(rng),
            Self::Linoleum => linoleum(rng),
            Self::Tiles => tiles(rng),
            Self::CeilingTiles => ceiling_tiles(rng),
            Self::Wood => wood(rng),
            Self::Paint => clouded(64, gray(0.85), 0.05, rng),
            Self::Fabric => fabric(rng),
            Self::Steel => clouded(64, gray(0.62), 0.12, rng),
            Self::Leaves => leaves(rng),
            Self::Cardboard => cardboard(rng),
            Self::Poster => poster(rng),
            Self::Notices => notices(rng),
            Self::Paper => paper(rng),
            Self::Books => books(rng),
            Self::Screen => screen(rng),
            Self::Keyboard => keyboard(rng),
            Self::Whiteboard => whiteboard(rng),
            Self::Drawers => fronts(&[0.03, 0.3, 0.6, 0.97], &[0.03, 0.97], rng),
            Self::Cupboard => fronts(&[0.02, 0.45, 0.98], &[0.02, 0.5, 0.98], rng),
            Self::DoorLeaf => door_leaf(rng),
            Self::Appliance => appliance(rng),
            Self::Electronics => electronics(rng),
            Self::DayView => day_view(rng),
            Self::NightView => night_view(rng),
        }
    }
}

/// A color about on the way between two.
fn between(low: Color, high: Color, rng: &mut ChaCha8Rng) -> Color {
    let share: f32 = rng.random();
    let mut near = || (share + rng.random_range(-0.12..0.12)).clamp(0.0, 1.0);
    low + (high - low) * vec3(near(), near(), near())
}

/// Any color that ink or paint has; most are not bright.
fn vivid(rng: &mut ChaCha8Rng) -> Color {
    let shade = gray(rng.random_range(0.08..0.85));
    let hue = vec3(rng.random(), rng.random(), rng.random());
    let purity = rng.random_range(0.05..0.6);
    shade * (1.0 - purity) + hue * purity
}

/// A color with lumps of several sizes.
fn clouded(side: usize, color: Color, amplitude: f32, rng: &mut ChaCha8Rng) -> Canvas {
    let mut canvas = Canvas::new(side, color);
    for n_cells in [3, 11, 37] {
        canvas.clouds([n_cells, n_cells], amplitude / 2.0, rng);
    }
    canvas
}

fn plaster(rng: &mut ChaCha8Rng) -> Canvas {
    let color = between(vec3(0.78, 0.76, 0.7), vec3(0.92, 0.9, 0.86), rng);
    let mut canvas = clouded(256, color, 0.06, rng);
    for _ in 0..6 {
        let spot = [rng.random(), rng.random()];
        canvas.disk(spot, rng.random_range(0.002..0.006), color * rng.random_range(0.6..0.9));
    }
    canvas.grain(0.012, rng);
    canvas
}

fn carpet(rng: &mut ChaCha8Rng) -> Canvas {
    let color = between(vec3(0.28, 0.28, 0.3), vec3(0.5, 0.48, 0.5), rng);
    let mut canvas = clouded(256, color, 0.1, rng);
    canvas.grain(0.05, rng);
    canvas
}

fn linoleum(rng: &mut ChaCha8Rng) -> Canvas {
    let color = between(vec3(0.45, 0.45, 0.42), vec3(0.68, 0.64, 0.6), rng);
    let mut canvas = clouded(256, color, 0.05, rng);
    for _ in 0..500 {
        let fleck = [rng.random(), rng.random()];
        canvas.disk(fleck, rng.random_range(0.002..0.006), color * rng.random_range(0.8..1.15));
    }
    canvas.outline([0.0, 0.0, 1.0, 1.0], 0.004, color * 0.8);
    canvas
}

fn tiles(rng: &mut ChaCha8Rng) -> Canvas {
    let color = between(vec3(0.62, 0.66, 0.68), vec3(0.9, 0.9, 0.88), rng);
    let mut canvas = Canvas::new(256, color);
    let n_tiles = 4;
    for idx in 0..n_tiles * n_tiles {
        let [left, top] = [idx % n_tiles, idx / n_tiles].map(|i| i as f32 / n_tiles as f32);
        let tile = [left, top, left + 0.25, top + 0.25];
        canvas.rect(tile, color * rng.random_range(0.94..1.03));
        canvas.outline(tile, 0.006, color * 0.72);
    }
    canvas.clouds([7, 7], 0.03, rng);
    canvas
}

fn ceiling_tiles(rng: &mut ChaCha8Rng) -> Canvas {
    let mut canvas = clouded(128, gray(0.88), 0.02, rng);
    for _ in 0..120 {
        canvas.disk([rng.random(), rng.random()], 0.004, gray(0.74));
    }
    canvas.outline([0.0, 0.0, 1.0, 1.0], 0.02, gray(0.76));
    canvas
}

fn wood(rng: &mut ChaCha8Rng) -> Canvas {
    let color = between(vec3(0.5, 0.36, 0.22), vec3(0.8, 0.66, 0.48), rng);
    let mut canvas = Canvas::new(256, color);
    for (cells, amplitude) in [([2, 11], 0.1), ([4, 41], 0.09), ([7, 120], 0.06)] {
        canvas.clouds(cells, amplitude, rng);
    }
    canvas
}

fn fabric(rng: &mut ChaCha8Rng) -> Canvas {
    let color = between(vec3(0.12, 0.12, 0.16), vec3(0.55, 0.45, 0.55), rng);
    let mut canvas = clouded(64, color, 0.12, rng);
    canvas.grain(0.03, rng);
    canvas
}

fn leaves(rng: &mut ChaCha8Rng) -> Canvas {
    let mut canvas = Canvas::new(128, vec3(0.1, 0.18, 0.08));
    for _ in 0..160 {
        let from: [f32; 2] = [rng.random(), rng.random()];
        let to = from.map(|x| x + rng.random_range(-0.09..0.09));
        let color = between(vec3(0.12, 0.28, 0.1), vec3(0.4, 0.6, 0.3), rng);
        canvas.stroke([from, to], rng.random_range(0.015..0.04), color);
    }
    canvas
}

fn cardboard(rng: &mut ChaCha8Rng) -> Canvas {
    let color = between(vec3(0.55, 0.42, 0.28), vec3(0.72, 0.6, 0.44), rng);
    let mut canvas = clouded(128, color, 0.05, rng);
    canvas.rect([0.44, 0.0, 0.56, 1.0], color * 1.15);
    canvas.text([0.1, 0.6, 0.4, 0.85], 0.07, color * 0.4, rng);
    canvas
}

/// A conference poster, an art print or a photograph.
fn poster(rng: &mut ChaCha8Rng) -> Canvas {
    let is_print = rng.random_bool(0.35);
    let background = if is_print { vivid(rng) } else { between(gray(0.75), gray(1.0), rng) };
    let mut canvas = Canvas::new(256, background);
    if is_print {
        for _ in 0..rng.random_range(4..12) {
            let center = [rng.random_range(0.1..0.9), rng.random_range(0.1..0.9)];
            let size = rng.random_range(0.04..0.2);
            let color = vivid(rng);
            if rng.random_bool(0.5) {
                canvas.disk(center, size, color);
            } else {
                let height = rng.random_range(0.03..0.2);
                canvas.rect([center[0], center[1], center[0] + size, center[1] + height], color);
            }
        }
        canvas.clouds([9, 9], 0.15, rng);
        canvas.outline([0.0, 0.0, 1.0, 1.0], 0.05, between(gray(0.1), gray(0.95), rng));
        return canvas;
    }
    let theme = vivid(rng);
    canvas.rect([0.0, 0.0, 1.0, 0.13], theme);
    canvas.text([0.08, 0.03, 0.92, 0.12], 0.07, gray(0.95), rng);
    let n_columns = rng.random_range(2..4);
    let width = 0.92 / n_columns as f32;
    for column in 0..n_columns {
        let left = 0.05 + column as f32 * width;
        let mut y = 0.17_f32;
        while y < 0.88 {
            let bottom = (y + rng.random_range(0.12..0.3)).min(0.96);
            let block = [left, y, left + width - 0.04, bottom];
            if rng.random_bool(0.45) {
                picture(&mut canvas, block, rng);
            } else {
                canvas.text(block, 0.026, gray(0.35), rng);
            }
            y = bottom + 0.03;
        }
    }
    canvas
}

/// A small chart or photograph.
fn picture(canvas: &mut Canvas, [left, top, right, bottom]: [f32; 4], rng: &mut ChaCha8Rng) {
    canvas.rect([left, top, right, bottom], between(gray(0.5), gray(0.95), rng));
    let inside = |rng: &mut ChaCha8Rng| [rng.random_range(left..right), rng.random_range(top..bottom)];
    if rng.random_bool(0.5) {
        let color = vivid(rng);
        let mut from = inside(rng);
        for _ in 0..6 {
            let to = inside(rng);
            canvas.stroke([from, to], 0.008, color);
            from = to;
        }
    } else {
        for _ in 0..5 {
            let [x, y] = inside(rng);
            let color = vivid(rng);
            canvas.rect([x, y, (x + 0.1).min(right), (y + 0.1).min(bottom)], color);
        }
    }
}

fn notices(rng: &mut ChaCha8Rng) -> Canvas {
    let mut canvas = clouded(256, vec3(0.62, 0.48, 0.32), 0.1, rng);
    canvas.outline([0.0, 0.0, 1.0, 1.0], 0.03, gray(0.7));
    for _ in 0..9 {
        let [left, top] = [rng.random_range(0.05..0.75), rng.random_range(0.05..0.65)];
        let sheet = [left, top, left + rng.random_range(0.1..0.2), top + rng.random_range(0.15..0.3)];
        let color = if rng.random_bool(0.6) { gray(0.93) } else { between(gray(0.5), gray(1.0), rng) };
        canvas.rect(sheet, color);
        let [left, top, right, bottom] = sheet;
        canvas.text([left + 0.02, top + 0.03, right - 0.02, bottom - 0.02], 0.03, gray(0.3), rng);
    }
    canvas
}

fn paper(rng: &mut ChaCha8Rng) -> Canvas {
    let mut canvas = Canvas::new(64, between(gray(0.85), gray(0.98), rng));
    canvas.text([0.12, 0.12, 0.88, 0.9], 0.07, gray(0.45), rng);
    canvas
}

fn books(rng: &mut ChaCha8Rng) -> Canvas {
    let mut canvas = Canvas::new(256, vec3(0.16, 0.12, 0.1));
    let n_shelves = rng.random_range(4..6);
    let shelf = 1.0 / n_shelves as f32;
    for shelf_idx in 0..n_shelves {
        let bottom = (shelf_idx + 1) as f32 * shelf - 0.015;
        let mut x = 0.03;
        while x < 0.93 {
            if rng.random_bool(0.12) {
                x += rng.random_range(0.03..0.15);
                continue;
            }
            let width = rng.random_range(0.018_f32..0.06).min(0.97 - x);
            let top = bottom - shelf * rng.random_range(0.6..0.88);
            let color = vivid(rng);
            canvas.rect([x, top, x + width, bottom], color);
            canvas.rect([x + width * 0.2, top + 0.03, x + width * 0.8, top + 0.07], color * 0.5 + gray(0.35));
            x += width + 0.003;
        }
        canvas.rect([0.0, bottom, 1.0, bottom + 0.018], vec3(0.6, 0.48, 0.34));
    }
    canvas.outline([0.0, 0.0, 1.0, 1.0], 0.025, vec3(0.6, 0.48, 0.34));
    canvas
}

fn screen(rng: &mut ChaCha8Rng) -> Canvas {
    let mut canvas = Canvas::new(128, between(vec3(0.05, 0.1, 0.2), vec3(0.3, 0.4, 0.6), rng));
    for _ in 0..rng.random_range(1..4) {
        let [left, top] = [rng.random_range(0.05..0.5), rng.random_range(0.05..0.4)];
        let window = [left, top, left + rng.random_range(0.25..0.45), top + rng.random_range(0.3..0.5)];
        let is_dark = rng.random_bool(0.4);
        canvas.rect(window, gray(if is_dark { 0.1 } else { 0.9 }));
        canvas.rect([left, top, window[2], top + 0.05], vec3(0.4, 0.5, 0.7));
        let ink = gray(if is_dark { 0.7 } else { 0.3 });
        canvas.text([left + 0.02, top + 0.08, window[2] - 0.02, window[3]], 0.045, ink, rng);
    }
    canvas.outline([0.0, 0.0, 1.0, 1.0], 0.05, gray(0.15));
    canvas
}

fn keyboard(rng: &mut ChaCha8Rng) -> Canvas {
    let color = gray(rng.random_range(0.2..0.7));
    let mut canvas = Canvas::new(64, color);
    for row in 0..5 {
        for key in 0..14 {
            let [left, top] = [0.03 + key as f32 * 0.067, 0.08 + row as f32 * 0.17];
            canvas.rect([left, top, left + 0.05, top + 0.12], color * 1.3);
        }
    }
    canvas
}

fn whiteboard(rng: &mut ChaCha8Rng) -> Canvas {
    let mut canvas = clouded(256, gray(0.93), 0.02, rng);
    canvas.outline([0.0, 0.0, 1.0, 1.0], 0.02, gray(0.6));
    for _ in 0..rng.random_range(3..9) {
        let inks = [vec3(0.1, 0.1, 0.15), vec3(0.1, 0.15, 0.6), vec3(0.65, 0.1, 0.1), vec3(0.1, 0.45, 0.2)];
        let ink = inks[rng.random_range(0..inks.len())];
        let mut from: [f32; 2] = [rng.random_range(0.08..0.75), rng.random_range(0.1..0.8)];
        if rng.random_bool(0.5) {
            let page = [from[0], from[1], (from[0] + 0.25).min(0.95), (from[1] + 0.2).min(0.92)];
            canvas.text(page, 0.05, ink, rng);
            continue;
        }
        for _ in 0..6 {
            let to = from.map(|x: f32| (x + rng.random_range(-0.15..0.15)).clamp(0.06, 0.94));
            canvas.stroke([from, to], 0.009, ink);
            from = to;
        }
    }
    canvas
}

/// Doors or drawers between these lines, each with a handle.
fn fronts(rows: &[f32], columns: &[f32], rng: &mut ChaCha8Rng) -> Canvas {
    let color = between(vec3(0.5, 0.42, 0.34), vec3(0.86, 0.84, 0.8), rng);
    let mut canvas = clouded(128, color, 0.05, rng);
    for (row, column) in rows.windows(2).flat_map(|row| columns.windows(2).map(move |column| (row, column))) {
        let front = [column[0], row[0], column[1], row[1]];
        canvas.outline(front, 0.012, color * 0.5);
        let middle = (column[0] + column[1]) / 2.0;
        canvas.rect([middle - 0.07, row[0] + 0.06, middle + 0.07, row[0] + 0.085], gray(0.25));
    }
    canvas
}

fn door_leaf(rng: &mut ChaCha8Rng) -> Canvas {
    let color = between(vec3(0.4, 0.35, 0.3), vec3(0.8, 0.76, 0.7), rng);
    let mut canvas = Canvas::new(128, color);
    canvas.clouds([23, 2], 0.05, rng);
    canvas.rect([0.06, 0.5, 0.17, 0.525], gray(0.2));
    canvas.rect([0.06, 0.47, 0.1, 0.58], gray(0.35));
    if rng.random_bool(0.6) {
        canvas.rect([0.35, 0.3, 0.65, 0.36], gray(0.92));
        canvas.text([0.38, 0.31, 0.62, 0.36], 0.02, gray(0.2), rng);
    }
    canvas
}

/// The front of a printer, refrigerator or oven: panels, a display, buttons.
fn appliance(rng: &mut ChaCha8Rng) -> Canvas {
    let color = gray(rng.random_range(0.55..0.9));
    let mut canvas = clouded(128, color, 0.03, rng);
    let mut y = 0.22;
    while y < 0.9 {
        canvas.rect([0.04, y, 0.96, y + 0.012], color * 0.55);
        canvas.rect([0.4, y + 0.04, 0.6, y + 0.065], color * 0.4);
        y += rng.random_range(0.18..0.4);
    }
    canvas.rect([0.08, 0.06, 0.36, 0.16], vec3(0.15, 0.25, 0.25));
    for button in 0..5 {
        let center = [0.46 + 0.1 * button as f32, 0.11];
        canvas.disk(center, 0.03, vivid(rng));
    }
    canvas
}

/// A rack or an open robot: boards, cables, lamps.
fn electronics(rng: &mut ChaCha8Rng) -> Canvas {
    let mut canvas = clouded(128, gray(0.2), 0.2, rng);
    for row in 0..6 {
        let top = 0.03 + row as f32 * 0.16;
        let panel = between(gray(0.15), gray(0.6), rng);
        canvas.rect([0.04, top, 0.96, top + 0.13], panel);
        for column in 0..8 {
            if rng.random_bool(0.5) {
                canvas.disk([0.1 + column as f32 * 0.11, top + 0.06], 0.02, vivid(rng));
            }
        }
    }
    for _ in 0..5 {
        let ends = [[rng.random(), rng.random()], [rng.random(), rng.random()]];
        canvas.stroke(ends, 0.02, vivid(rng));
    }
    canvas
}

/// Houses and trees under the sky, all round; the horizon is in the middle.
fn day_view(rng: &mut ChaCha8Rng) -> Canvas {
    let mut canvas = Canvas::new(256, gray(0.95));
    canvas.clouds([8, 12], 0.05, rng);
    canvas.rect([0.0, 0.52, 1.0, 1.0], vec3(0.4, 0.45, 0.35));
    houses(&mut canvas, vec3(0.5, 0.45, 0.42), vec3(0.3, 0.33, 0.4), rng);
    for _ in 0..30 {
        let center = [rng.random(), rng.random_range(0.46..0.54)];
        let color = between(vec3(0.2, 0.3, 0.15), vec3(0.4, 0.5, 0.3), rng);
        canvas.disk(center, rng.random_range(0.01..0.04), color);
    }
    canvas
}

/// The same with some lights on.
fn night_view(rng: &mut ChaCha8Rng) -> Canvas {
    let mut canvas = Canvas::new(256, vec3(0.03, 0.035, 0.05));
    houses(&mut canvas, vec3(0.05, 0.05, 0.05), vec3(0.08, 0.07, 0.06), rng);
    for _ in 0..26 {
        let [x, y] = [rng.random(), rng.random_range(0.4..0.55)];
        canvas.rect([x, y, x + 0.012, y + 0.012], vec3(1.0, 0.85, 0.55));
    }
    canvas
}

fn houses(canvas: &mut Canvas, wall: Color, window: Color, rng: &mut ChaCha8Rng) {
    let mut x = 0.0;
    while x < 0.95 {
        let width = rng.random_range(0.05..0.16);
        let top = rng.random_range(0.3..0.48);
        canvas.rect([x, top, x + width, 0.56], wall * rng.random_range(0.8..1.4));
        for column in 0..(width / 0.025) as usize {
            for row in 0..((0.54 - top) / 0.04) as usize {
                let [left, y] = [x + 0.006 + column as f32 * 0.025, top + 0.012 + row as f32 * 0.04];
                canvas.rect([left, y, left + 0.012, y + 0.02], window);
            }
        }
        x += width + rng.random_range(0.0..0.12);
    }
}
