//! Procedural textures: painted once a lab, sampled with a mipmap by bilinear interpolation.

mod canvas;
mod pattern;

pub(super) use pattern::Pattern;

use super::seeded;
use super::vector::{Color, vec3};
use canvas::Canvas;
use rayon::prelude::*;

/// A texture in the order in which a [`Palette`] was asked for them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TextureId(usize);

/// Collects which textures a scene needs, so that only those are painted.
#[derive(Default)]
pub(super) struct Palette {
    wanted: Vec<(Pattern, u32)>,
}

impl Palette {
    /// The texture of a pattern in one of its variants; any number is taken for a variant.
    pub fn texture(&mut self, pattern: Pattern, variant: u32) -> TextureId {
        let key = (pattern, variant % pattern.n_variants());
        let known = self.wanted.iter().position(|other| *other == key);
        TextureId(known.unwrap_or_else(|| {
            self.wanted.push(key);
            self.wanted.len() - 1
        }))
    }

    /// Paints all textures asked for. A variant looks the same wherever the seed is the same.
    pub fn paint(&self, seed: u64) -> Textures {
        let paint = |&(pattern, variant): &(Pattern, u32)| {
            let mut rng = seeded(&[seed, pattern as u64, u64::from(variant)]);
            Mipmap::new(&pattern.paint(&mut rng))
        };
        Textures(self.wanted.par_iter().map(paint).collect())
    }
}

/// The painted textures.
pub(super) struct Textures(Vec<Mipmap>);

impl Textures {
    /// The linear color at (u, v), both in repeats of the texture with v downward, averaged over about
    /// `footprint` repeats.
    #[inline]
    pub fn sample(&self, id: TextureId, [u, v]: [f32; 2], footprint: f32) -> Color {
        self.0[id.0].sample([u, v], footprint)
    }
}

/// A texture in halving resolutions; texels are gamma-encoded by a square root.
struct Mipmap {
    levels: Vec<Level>,
}

struct Level {
    side: usize,
    texels: Vec<[u8; 4]>,
}

impl Mipmap {
    fn new(canvas: &Canvas) -> Self {
        let mut side = canvas.side();
        let mut colors: Vec<Color> = canvas.texels().iter().map(|&color| color * color).collect();
        let mut levels = vec![Level::encoded(side, &colors)];
        while side > 1 {
            side /= 2;
            colors = halved(side, &colors);
            levels.push(Level::encoded(side, &colors));
        }
        Self { levels }
    }

    fn sample(&self, [u, v]: [f32; 2], footprint: f32) -> Color {
        let texels = footprint * self.levels[0].side as f32 * std::f32::consts::SQRT_2;
        // The exponent of a float is the whole part of its logarithm.
        let level_idx = ((texels.max(1.0).to_bits() >> 23) - 127) as usize;
        self.levels[level_idx.min(self.levels.len() - 1)].sample(u, v)
    }
}

impl Level {
    fn encoded(side: usize, colors: &[Color]) -> Self {
        let encode = |value: f32| (value.clamp(0.0, 1.0).sqrt() * 255.0 + 0.5) as u8;
        let texels = colors.iter().map(|c| [encode(c.x), encode(c.y), encode(c.z), 0]).collect();
        Self { side, texels }
    }

    #[inline]
    fn sample(&self, u: f32, v: f32) -> Color {
        let (column, right) = split(u * self.side as f32 - 0.5);
        let (row, lower) = split(v * self.side as f32 - 0.5);
        let mask = self.side - 1;
        let texel = |column: isize, row: isize| {
            let [r, g, b, _] = self.texels[(row as usize & mask) * self.side + (column as usize & mask)];
            let value = vec3(f32::from(r), f32::from(g), f32::from(b));
            value * value
        };
        let upper_row = texel(column, row) * (1.0 - right) + texel(column + 1, row) * right;
        let lower_row = texel(column, row + 1) * (1.0 - right) + texel(column + 1, row + 1) * right;
        (upper_row * (1.0 - lower) + lower_row * lower) * (1.0 / 65_025.0)
    }
}

/// The integer below, and the rest. Faster than `floor` where the instruction set has none.
fn split(x: f32) -> (isize, f32) {
    let truncated = x as isize;
    let whole = truncated - isize::from(x < truncated as f32);
    (whole, x - whole as f32)
}

fn halved(side: usize, colors: &[Color]) -> Vec<Color> {
    let fine = |x: usize, y: usize| colors[y * 2 * side + x];
    let mean = |x: usize, y: usize| {
        (fine(2 * x, 2 * y) + fine(2 * x + 1, 2 * y) + fine(2 * x, 2 * y + 1) + fine(2 * x + 1, 2 * y + 1))
            * 0.25
    };
    (0..side * side).map(|idx| mean(idx % side, idx / side)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_away_a_texture_is_its_mean_color() {
        let mut canvas = Canvas::new(8, vec3(0.0, 0.5, 1.0));
        canvas.rect([0.0, 0.0, 0.5, 1.0], vec3(1.0, 0.5, 0.0));
        let far = Mipmap::new(&canvas).sample([0.3, 0.7], 5.0);
        let mean = vec3(0.5, 0.25, 0.5);
        assert!((far - mean).length() < 0.01, "{far:?}");
    }

    #[test]
    fn near_a_texture_is_exact_at_texel_centers_and_repeats() {
        let mut canvas = Canvas::new(8, vec3(0.2, 0.2, 0.2));
        canvas.rect([0.25, 0.5, 0.375, 0.625], vec3(1.0, 1.0, 1.0));
        let mipmap = Mipmap::new(&canvas);
        for repeat in [-2.0, 0.0, 3.0] {
            let lit = mipmap.sample([2.5 / 8.0 + repeat, 4.5 / 8.0 - repeat], 0.001);
            let dark = mipmap.sample([3.5 / 8.0 + repeat, 4.5 / 8.0 - repeat], 0.001);
            assert!((lit.x - 1.0).abs() < 1e-3 && (dark.x - 0.04).abs() < 1e-3, "{lit:?} {dark:?}");
        }
    }
}
