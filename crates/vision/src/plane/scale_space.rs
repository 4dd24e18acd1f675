//! The Gaussian scale space of an image: Lowe, "Distinctive image features from scale-invariant keypoints",
//! IJCV 60(2), 2004, section 3.
//!
//! An octave holds `n_layers + 3` planes, each blurred by 2^(1 / n_layers) times the sigma of the one before.
//! The next octave begins with every other pixel of the plane that has twice the sigma of the first.

use super::Plane;
use std::ops::Range;

/// The sigma that the camera itself has blurred an image by, in pixels.
const CAMERA_SIGMA: f32 = 0.5;

/// Octaves with a shorter side are not built.
const MIN_SIDE: usize = 12;

/// The levels of a scale space.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Levels {
    /// The sigma of the first plane of each octave, in pixels of the octave.
    pub sigma: f32,
    /// Levels an octave.
    pub n_layers: usize,
    /// Whether the first octave is of twice the image's size.
    pub doubled: bool,
}

impl Levels {
    /// The sigma of a layer in pixels of its octave; layers may lie between planes.
    pub fn sigma(&self, layer: f32) -> f32 {
        self.sigma * (layer / self.n_layers as f32).exp2()
    }

    /// The size of a pixel of an octave in pixels of the image.
    pub fn pixel(&self, octave_idx: usize) -> f32 {
        let first = if self.doubled { 0.5 } else { 1.0 };
        first * (octave_idx as f32).exp2()
    }

    /// The memory that all planes of an image take, the image being square: four bytes a pixel, and each octave
    /// a quarter of the one before.
    pub fn max_bytes(&self, side: usize) -> u64 {
        let first_side = side as u64 * if self.doubled { 2 } else { 1 };
        let n_pixels = first_side.saturating_mul(first_side);
        n_pixels.saturating_mul(4 * (self.n_layers as u64 + 3)).saturating_add(n_pixels) / 3 * 4
    }

    /// The level, counted from the first plane of the first octave, whose sigma is nearest to `scale` pixels
    /// of the image; below 0 for smaller ones.
    fn nearest(&self, scale: f32) -> f32 {
        ((scale / (self.pixel(0) * self.sigma)).log2() * self.n_layers as f32).round()
    }
}

/// Where a point of an image is in its scale space.
#[derive(Clone, Copy, Debug)]
pub struct Location<'a> {
    /// The plane whose sigma is nearest.
    pub plane: &'a Plane,
    /// Column in the plane. Where that wraps it is counted from a turn before, so that what lies to the left
    /// of the seam has a column too; see [`Location::image_column`].
    pub x: f32,
    /// Row in the plane.
    pub y: f32,
    /// The point's sigma in pixels of the plane.
    pub scale: f32,
    /// The size of a pixel of the plane in pixels of the image.
    pub pixel: f32,
}

impl Location<'_> {
    /// The columns and rows of the pixels nearer than `radius` pixels of the plane along either axis, without
    /// the border of the plane. Where it wraps, columns run over three turns.
    pub fn window(&self, radius: f32) -> (Range<usize>, Range<usize>) {
        let span = |center: f32, size: usize| {
            let start = ((center.round() - radius).max(1.0) as usize).min(size);
            let end = ((center.round() + radius + 1.0).max(0.0) as usize).min(size - 1);
            start..end.max(start)
        };
        let n_turns = if self.plane.wraps() { 3 } else { 1 };
        (span(self.x, n_turns * self.plane.width()), span(self.y, self.plane.height()))
    }

    /// Where a column of the window lies in the image.
    pub fn image_column(&self, column: usize) -> f32 {
        (column as f32 - first_turn(self.plane)) * self.pixel
    }
}

/// An image blurred more and more. The memory is used again for the next one.
#[derive(Clone, Debug, Default)]
pub struct ScaleSpace {
    levels: Levels,
    doubled: Plane,
    octaves: Vec<Vec<Plane>>,
}

impl ScaleSpace {
    /// Replaces it by that of an image: the levels that points of a sigma of at most `coarsest` pixels are at,
    /// down to octaves of a few pixels. Its planes wrap where the image does.
    pub fn build(&mut self, image: &Plane, levels: Levels, coarsest: f32) {
        self.levels = levels;
        let (base, blurred) = if levels.doubled {
            image.double_into(&mut self.doubled);
            (&self.doubled, 2.0 * CAMERA_SIGMA)
        } else {
            (image, CAMERA_SIGMA)
        };
        // What the cast cannot hold is the largest number: all levels.
        let last_level = levels.nearest(coarsest).max(0.0) as usize;
        let mut n_octaves = 0;
        loop {
            let n_planes = last_level.saturating_add(1).saturating_sub(n_octaves * levels.n_layers);
            self.octaves.resize_with(self.octaves.len().max(n_octaves + 1), Vec::new);
            let (finer, rest) = self.octaves.split_at_mut(n_octaves);
            let planes = &mut rest[0];
            planes.resize_with(n_planes.clamp(1, levels.n_layers + 3), Plane::default);
            match finer.last() {
                None => base.blur_into(missing_sigma(blurred, levels.sigma), &mut planes[0]),
                Some(finer) => finer[levels.n_layers].halve_into(&mut planes[0]),
            }
            for layer in 1..planes.len() {
                let (previous, next) = planes.split_at_mut(layer);
                let [from, to] = [layer - 1, layer].map(|layer| levels.sigma(layer as f32));
                previous[layer - 1].blur_into(missing_sigma(from, to), &mut next[0]);
            }
            let side = planes[0].width.min(planes[0].height);
            let has_next = planes.len() > levels.n_layers && side >= 2 * MIN_SIDE;
            n_octaves += 1;
            if !has_next {
                break;
            }
        }
        self.octaves.truncate(n_octaves);
    }

    /// The planes of each octave.
    pub fn octaves(&self) -> &[Vec<Plane>] {
        &self.octaves
    }

    /// Where the image's point (x, y) of sigma `scale` is: in the plane of the nearest sigma, or the last
    /// that there is.
    pub fn locate(&self, (x, y): (f32, f32), scale: f32) -> Location<'_> {
        let n_layers = self.levels.n_layers;
        let level = self.levels.nearest(scale).max(0.0) as usize;
        // Of an octave, extrema are found in the layers 1 to n_layers.
        let octave_idx = (level.saturating_sub(1) / n_layers).min(self.octaves.len() - 1);
        let octave = &self.octaves[octave_idx];
        let plane = &octave[(level - octave_idx * n_layers).min(octave.len() - 1)];
        let pixel = self.levels.pixel(octave_idx);
        Location { plane, x: x / pixel + first_turn(plane), y: y / pixel, scale: scale / pixel, pixel }
    }
}

/// How many columns come before the plane's own: a turn where it wraps, else none.
fn first_turn(plane: &Plane) -> f32 {
    if plane.wraps { plane.width as f32 } else { 0.0 }
}

/// The blur that turns a sigma into another; hardly any when it is larger already.
fn missing_sigma(from: f32, to: f32) -> f32 {
    (to * to - from * from).max(0.01).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;

    const LEVELS: Levels = Levels { sigma: 1.6, n_layers: 3, doubled: true };

    fn build(image: &Image, levels: Levels, coarsest: f32) -> ScaleSpace {
        let mut space = ScaleSpace::default();
        space.build(&Plane::new(image, false), levels, coarsest);
        space
    }

    fn noise(width: usize, height: usize) -> Image {
        let pixels = (0..width * height).map(|idx| (idx * idx % 251) as u8).collect();
        Image::from_pixels(width, height, pixels).unwrap()
    }

    #[test]
    fn planes_have_the_sigma_of_their_layer() {
        // The blur of a point has its variance.
        let pixels = (0..101 * 101).map(|idx| if idx == 50 * 101 + 50 { 255 } else { 0 }).collect();
        let image = Image::from_pixels(101, 101, pixels).unwrap();
        let space = build(&image, Levels { doubled: false, ..LEVELS }, f32::INFINITY);
        for (layer, plane) in space.octaves()[0].iter().enumerate() {
            let along = plane.row(50);
            let spread = along.iter().enumerate().map(|(x, value)| value * (x as f32 - 50.0).powi(2));
            let variance = spread.sum::<f32>() / along.iter().sum::<f32>();
            let expected = LEVELS.sigma(layer as f32).powi(2) - CAMERA_SIGMA * CAMERA_SIGMA;
            assert!((variance / expected - 1.0).abs() < 0.02, "{layer}: {variance} {expected}");
        }
    }

    #[test]
    fn points_are_in_the_plane_of_the_nearest_sigma() {
        let space = build(&noise(100, 80), LEVELS, f32::INFINITY);
        for (scale, octave_idx, layer) in
            [(0.1, 0, 0), (0.8, 0, 0), (1.0, 0, 1), (1.6, 0, 3), (2.0, 1, 1), (3.2, 1, 3), (4.1, 2, 1)]
        {
            let location = space.locate((30.0, 20.0), scale);
            assert!(std::ptr::eq(location.plane, &space.octaves()[octave_idx][layer]), "{scale}");
            let pixel = [0.5, 1.0, 2.0][octave_idx];
            assert_eq!((location.x, location.y, location.pixel), (30.0 / pixel, 20.0 / pixel, pixel));
            assert_eq!(location.scale, scale / pixel);
        }
        let largest = space.locate((30.0, 20.0), 1e9).plane;
        assert!(std::ptr::eq(largest, space.octaves().last().unwrap().last().unwrap()));
    }

    #[test]
    fn leaving_out_coarser_levels_and_using_the_memory_again_changes_nothing() {
        let image = noise(100, 80);
        let whole = build(&image, LEVELS, f32::INFINITY);
        let mut space = build(&noise(150, 200), Levels { n_layers: 4, ..LEVELS }, f32::INFINITY);
        for scale in [0.5, 1.0, 1.6, 2.0, 3.3] {
            space.build(&Plane::new(&image, false), LEVELS, scale);
            let (found, expected) = (space.locate((5.0, 6.0), scale), whole.locate((5.0, 6.0), scale));
            assert_eq!(found.plane, expected.plane, "{scale}");
        }
        assert!(space.octaves().len() < whole.octaves().len());
    }
}
