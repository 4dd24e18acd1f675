//! A square that patterns are painted on. Coordinates are fractions of its side, x right, y down, and
//! wrap round, so that textures tile.

use crate::simulate::vector::{Color, gray};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// A square of gamma-encoded colors.
pub(super) struct Canvas {
    side: usize,
    texels: Vec<Color>,
}

impl Canvas {
    /// A canvas of one color; the side is a power of two.
    pub fn new(side: usize, color: Color) -> Self {
        Self { side, texels: vec![color; side * side] }
    }

    pub fn side(&self) -> usize {
        self.side
    }

    pub fn texels(&self) -> &[Color] {
        &self.texels
    }

    /// Fills the rectangle `[left, top, right, bottom]`.
    pub fn rect(&mut self, [left, top, right, bottom]: [f32; 4], color: Color) {
        for y in self.texel(top)..self.texel(bottom) {
            for x in self.texel(left)..self.texel(right) {
                *self.at(x, y) = color;
            }
        }
    }

    /// Draws the outline of a rectangle, `width` wide and inside it.
    pub fn outline(&mut self, [left, top, right, bottom]: [f32; 4], width: f32, color: Color) {
        self.rect([left, top, right, top + width], color);
        self.rect([left, bottom - width, right, bottom], color);
        self.rect([left, top, left + width, bottom], color);
        self.rect([right - width, top, right, bottom], color);
    }

    /// Fills a disk.
    pub fn disk(&mut self, [center_x, center_y]: [f32; 2], radius: f32, color: Color) {
        let [x0, y0] = [center_x, center_y].map(|center| self.texel(center - radius));
        let n_texels = ((2.0 * radius * self.side as f32) as usize).max(1);
        let half = n_texels as f32 / 2.0;
        for (dx, dy) in (0..n_texels * n_texels).map(|idx| (idx % n_texels, idx / n_texels)) {
            if (dx as f32 + 0.5 - half).hypot(dy as f32 + 0.5 - half) <= half {
                *self.at(x0 + dx, y0 + dy) = color;
            }
        }
    }

    /// Draws a straight stroke, `width` wide.
    pub fn stroke(&mut self, [from, to]: [[f32; 2]; 2], width: f32, color: Color) {
        let length = (to[0] - from[0]).hypot(to[1] - from[1]);
        let n_steps = (length * self.side as f32).ceil().max(1.0) as usize;
        for step in 0..=n_steps {
            let share = step as f32 / n_steps as f32;
            let point = [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]));
            self.disk(point, width / 2.0, color);
        }
    }

    /// Lines of dark words on a page: `[left, top, right, bottom]`, the height of a line, the ink.
    pub fn text(&mut self, page: [f32; 4], line: f32, ink: Color, rng: &mut ChaCha8Rng) {
        let [left, top, right, bottom] = page;
        let mut y = top;
        while y + line < bottom {
            let mut x = left;
            let end =
                if rng.random_bool(0.2) { left + (right - left) * rng.random_range(0.3..0.9) } else { right };
            while x < end {
                let word = line * rng.random_range(0.8..3.5);
                self.rect([x, y, (x + word).min(right), y + line * 0.5], ink);
                x += word + line * 0.6;
            }
            y += line;
        }
    }

    /// Multiplies by smooth noise of `cells` lumps along x and y, by up to 1 +- `amplitude`.
    pub fn clouds(&mut self, cells: [usize; 2], amplitude: f32, rng: &mut ChaCha8Rng) {
        let knots: Vec<f32> = (0..cells[0] * cells[1]).map(|_| rng.random_range(-1.0..1.0)).collect();
        let knot = |x: usize, y: usize| knots[(y % cells[1]) * cells[0] + x % cells[0]];
        for (idx, texel) in self.texels.iter_mut().enumerate() {
            let x = (idx % self.side) as f32 / self.side as f32 * cells[0] as f32;
            let y = (idx / self.side) as f32 / self.side as f32 * cells[1] as f32;
            let (column, row) = (x as usize, y as usize);
            let [right, lower] = [x - column as f32, y - row as f32].map(|t| t * t * (3.0 - 2.0 * t));
            let upper_row = knot(column, row) * (1.0 - right) + knot(column + 1, row) * right;
            let lower_row = knot(column, row + 1) * (1.0 - right) + knot(column + 1, row + 1) * right;
            let noise = upper_row * (1.0 - lower) + lower_row * lower;
            *texel = *texel * (1.0 + amplitude * noise);
        }
    }

    /// Adds independent noise to every texel.
    pub fn grain(&mut self, amplitude: f32, rng: &mut ChaCha8Rng) {
        for texel in &mut self.texels {
            *texel += gray(rng.random_range(-amplitude..amplitude));
        }
    }

    /// The texel that a fraction falls on, of a canvas that goes on to the right and below; fractions
    /// from -1 on are fine.
    fn texel(&self, fraction: f32) -> usize {
        ((fraction + 1.0).max(0.0) * self.side as f32 + 0.5) as usize
    }

    fn at(&mut self, x: usize, y: usize) -> &mut Color {
        &mut self.texels[(y % self.side) * self.side + x % self.side]
    }
}
