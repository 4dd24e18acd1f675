//! The Gaussian scale space of an image: Lowe, "Distinctive image features from scale-invariant keypoints",
//! IJCV 60(2), 2004, section 3.
//!
//! An octave holds `n_layers + 3` planes, each blurred by 2^(1 / n_layers) times the sigma of the one before.
//! The next octave begins with every other pixel of the plane that has twice the sigma of the first.

use super::Plane;
use crate::image::Image;
use std::ops::Range;

/// The sigma that the camera itself has blurred an image by, in pixels.
const CAMERA_SIGMA: f32 = 0.5;

/// Octaves with a shorter side are not built.
const MIN_SIDE: usize = 12;

/// The levels of a scale space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Levels {
    /// The sigma of the first plane of each octave, in pixels of the octave.
    pub sigma: f32,
    /// Levels an octave.
    pub n_layers: usize,
    /// Whether the first octave is of twice the image's size.
    pub doubled: bool,
}

/// Where a point of an image is in its scale space.
#[derive(Clone, Copy, Debug)]
pub struct Location<'a> {
    /// The plane whose sigma is nearest.
    pub plane: &'a Plane,
    /// Column in the plane.
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
    /// the border of the plane.
    pub fn window(&self, radius: f32) -> (Range<usize>, Range<usize>) {
        let span = |center: f32, size: usize| {
            let start = ((center.round() - radius).max(1.0) as usize).min(size);
            let end = ((center.round() + radius + 1.0).max(0.0) as usize).min(size - 1);
            start..end.max(start)
        };
        (span(self.x, self.plane.width()), span(self.y, self.plane.height()))
    }
}

/// An image blurred more and more.
#[derive(Clone, Debug)]
pub struct ScaleSpace {
    levels: Levels,
    octaves: Vec<Vec<Plane>>,
}

impl ScaleSpace {
    /// All levels down to octaves of a few pixels.
    pub fn new(image: &Image, levels: Levels) -> Self {
        Self::up_to(image, levels, f32::INFINITY)
    }

    /// The levels that points of a sigma of at most `coarsest` pixels are at.
    pub fn up_to(image: &Image, levels: Levels, coarsest: f32) -> Self {
        let plane = Plane::from(image);
        let (plane, blurred) =
            if levels.doubled { (plane.doubled(), 2.0 * CAMERA_SIGMA) } else { (plane, CAMERA_SIGMA) };
        let mut first = plane.blurred(missing_sigma(blurred, levels.sigma));
        let mut space = Self { levels, octaves: Vec::new() };
        // What the cast cannot hold is the largest number: all levels.
        let last_level = space.level(coarsest).max(0.0) as usize;
        loop {
            let first_level = space.octaves.len() * levels.n_layers;
            let n_planes =
                last_level.saturating_add(1).saturating_sub(first_level).clamp(1, levels.n_layers + 3);
            let octave = space.octave(first, n_planes);
            let next = octave.get(levels.n_layers).and_then(Plane::halved);
            space.octaves.push(octave);
            match next {
                Some(next) if next.width.min(next.height) >= MIN_SIDE => first = next,
                _ => return space,
            }
        }
    }

    /// Its levels.
    pub fn levels(&self) -> Levels {
        self.levels
    }

    /// The planes of each octave.
    pub fn octaves(&self) -> &[Vec<Plane>] {
        &self.octaves
    }

    /// The size of a pixel of an octave in pixels of the image.
    pub fn pixel(&self, octave_idx: usize) -> f32 {
        let first = if self.levels.doubled { 0.5 } else { 1.0 };
        first * (octave_idx as f32).exp2()
    }

    /// The sigma of a layer in pixels of its octave; layers may lie between planes.
    pub fn sigma(&self, layer: f32) -> f32 {
        self.levels.sigma * (layer / self.levels.n_layers as f32).exp2()
    }

    /// Where the image's point (x, y) of sigma `scale` is: in the plane of the nearest sigma, or the last
    /// that there is.
    pub fn locate(&self, (x, y): (f32, f32), scale: f32) -> Location<'_> {
        let n_layers = self.levels.n_layers;
        let level = self.level(scale).max(0.0) as usize;
        // Of an octave, extrema are found in the layers 1 to n_layers.
        let octave_idx = (level.saturating_sub(1) / n_layers).min(self.octaves.len() - 1);
        let octave = &self.octaves[octave_idx];
        let plane = &octave[(level - octave_idx * n_layers).min(octave.len() - 1)];
        let pixel = self.pixel(octave_idx);
        Location { plane, x: x / pixel, y: y / pixel, scale: scale / pixel, pixel }
    }

    /// The level, counted from the first plane of the first octave, whose sigma is nearest to `scale` pixels
    /// of the image.
    fn level(&self, scale: f32) -> f32 {
        ((scale / (self.pixel(0) * self.levels.sigma)).log2() * self.levels.n_layers as f32).round()
    }

    fn octave(&self, first: Plane, n_planes: usize) -> Vec<Plane> {
        let mut planes = Vec::with_capacity(n_planes);
        let mut previous = first;
        for layer in 1..n_planes {
            let (from, to) = (self.sigma(layer as f32 - 1.0), self.sigma(layer as f32));
            let next = previous.blurred(missing_sigma(from, to));
            planes.push(previous);
            previous = next;
        }
        planes.push(previous);
        planes
    }
}

/// The blur that turns a sigma into another; hardly any when it is larger already.
fn missing_sigma(from: f32, to: f32) -> f32 {
    (to * to - from * from).max(0.01).sqrt()
}
