//! The Gaussian scale space of an image: Lowe, "Distinctive image features from scale-invariant keypoints",
//! IJCV 60(2), 2004, section 3.
//!
//! An octave holds `n_layers + 3` planes, each blurred by 2^(1 / n_layers) times the sigma of the one before.
//! The next octave begins with every other pixel of the plane that has twice the sigma of the first.

use super::{Blur, Plane};
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
    /// The last rows of the image, doubled.
    doubled: Plane,
    octaves: Vec<Octave>,
}

/// The planes of an octave.
#[derive(Clone, Debug, Default)]
pub(crate) struct Octave {
    planes: Vec<Plane>,
    /// What each plane is made by, from the one before or from the image; of an octave that halves another, the
    /// first is not used. There is one for the plane after the last that was built.
    blurs: Vec<Blur>,
}

/// How much of a scale space is built, beyond what points are described in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    /// No points of larger sigmas are looked for, in pixels of the image.
    pub(crate) coarsest: f32,
    /// Planes of each octave after the one that the next begins with.
    pub(crate) n_more: usize,
}

/// Rows that have just been added to a plane of an octave.
pub(crate) struct Grown<'a> {
    pub(crate) octave_idx: usize,
    pub(crate) layer: usize,
    pub(crate) rows: Range<usize>,
    /// Those up to this layer have all rows up to these.
    pub(crate) planes: &'a [Plane],
}

impl Octave {
    /// Those that were built, from the first on.
    pub(crate) fn planes(&self) -> &[Plane] {
        &self.planes
    }

    /// The values round a pixel that is not on the border, row by row: of a plane that was built, or the one after.
    pub(crate) fn around(&self, layer: usize, column: usize, row: usize) -> [[f32; 3]; 3] {
        match self.planes.get(layer) {
            Some(plane) => {
                let columns = plane.around(column);
                [row - 1, row, row + 1].map(|y| columns.map(|x| plane.row(y)[x]))
            }
            None => self.blurs[layer].around(&self.planes[layer - 1], column, row),
        }
    }

    /// Makes it one of `n_planes`.
    fn resize(&mut self, n_planes: usize, size: (usize, usize), wraps: bool) {
        self.planes.resize_with(n_planes, Plane::default);
        self.planes.iter_mut().for_each(|plane| plane.resize(size, wraps));
    }

    /// Fills all planes, strip by strip: a plane is blurred where the one before has just been, while that is in the
    /// cache. `first_rows` fills those of the first plane and says how many there are now.
    fn fill(
        &mut self,
        octave_idx: usize,
        mut first_rows: impl FnMut(&mut Plane, usize) -> usize,
        mut grown: impl FnMut(Grown<'_>),
    ) {
        let height = self.planes[0].height;
        let mut n_rows = vec![0; self.planes.len()];
        while n_rows.last().is_some_and(|&n_rows| n_rows < height) {
            for layer in 0..n_rows.len() {
                let before = n_rows[layer];
                let (finer, rest) = self.planes.split_at_mut(layer);
                n_rows[layer] = match finer.last() {
                    None if before == height => height,
                    None => first_rows(&mut rest[0], before),
                    Some(finer) => {
                        let n_ready = self.blurs[layer].n_ready(finer.height, n_rows[layer - 1]);
                        let blurred = rest[0].rows_mut(before..n_ready);
                        self.blurs[layer].blur_rows(finer, before, blurred);
                        n_ready
                    }
                };
                let rows = before..n_rows[layer];
                if !rows.is_empty() {
                    grown(Grown { octave_idx, layer, rows, planes: &self.planes[..=layer] });
                }
            }
        }
    }
}

impl ScaleSpace {
    /// Replaces it by that of an image, down to octaves of a few pixels. Its planes wrap where the image does.
    /// `grown` sees the planes grow.
    pub(crate) fn build(
        &mut self,
        image: &Plane,
        levels: Levels,
        extent: Extent,
        mut grown: impl FnMut(Grown<'_>),
    ) {
        self.levels = levels;
        let camera_sigma = if levels.doubled { 2.0 * CAMERA_SIGMA } else { CAMERA_SIGMA };
        let layer_sigma = |layer: usize| levels.sigma(layer as f32);
        let to_next = |layer: usize| Blur::new(missing_sigma(layer_sigma(layer - 1), layer_sigma(layer)));
        let first = std::iter::once(Blur::new(missing_sigma(camera_sigma, levels.sigma)));
        let blurs: Vec<Blur> = first.chain((1..levels.n_layers + 3).map(to_next)).collect();
        // What the cast cannot hold is the largest number: all levels.
        let last_level = levels.nearest(extent.coarsest).max(0.0) as usize;
        let scale = if levels.doubled { 2 } else { 1 };
        let mut size = (scale * image.width, scale * image.height);
        let mut n_octaves = 0;
        loop {
            let n_planes = last_level.saturating_add(1).saturating_sub(n_octaves * levels.n_layers);
            let n_planes = n_planes.clamp(1, levels.n_layers + 3);
            let has_next = n_planes > levels.n_layers && size.0.min(size.1) >= 2 * MIN_SIDE;
            self.octaves.resize_with(self.octaves.len().max(n_octaves + 1), Octave::default);
            let (finer, rest) = self.octaves.split_at_mut(n_octaves);
            let octave = &mut rest[0];
            // Points of larger sigmas are looked for in the next octave, where there is one.
            let n_built = if has_next { levels.n_layers + 1 + extent.n_more } else { n_planes };
            octave.resize(n_planes.min(n_built), size, image.wraps);
            octave.blurs.clone_from(&blurs);
            match finer.last() {
                Some(finer) => {
                    let finer = &finer.planes[levels.n_layers];
                    let halve = |plane: &mut Plane, n_rows: usize| {
                        let end = (n_rows + Blur::STRIP).min(plane.height);
                        finer.halve_rows(n_rows..end, plane);
                        end
                    };
                    octave.fill(n_octaves, halve, &mut grown);
                }
                None => {
                    let mut blur = blurs[0].clone();
                    let ring = &mut self.doubled;
                    let mut n_doubled = 0;
                    if levels.doubled {
                        // A strip ends anywhere between two doubled rows.
                        ring.resize((size.0, blur.n_rows_at_once() + 2), image.wraps);
                    }
                    let blur_base = |plane: &mut Plane, n_rows: usize| {
                        let end = (n_rows + Blur::STRIP).min(plane.height);
                        if !levels.doubled {
                            blur.blur_rows(image, n_rows, plane.rows_mut(n_rows..end));
                            return end;
                        }
                        while blur.n_ready(size.1, n_doubled) < end {
                            image.double_row(n_doubled / 2, ring);
                            n_doubled += 2;
                        }
                        blur.blur_ring(ring, size.1, n_rows, plane.rows_mut(n_rows..end));
                        end
                    };
                    octave.fill(n_octaves, blur_base, &mut grown);
                }
            }
            n_octaves += 1;
            if !has_next {
                break;
            }
            size = (size.0.div_ceil(2), size.1.div_ceil(2));
        }
        self.octaves.truncate(n_octaves);
    }

    /// From fine to coarse.
    pub(crate) fn octaves(&self) -> &[Octave] {
        &self.octaves
    }

    /// Where the image's point (x, y) of sigma `scale` is: in the plane of the nearest sigma, or the last
    /// that there is.
    pub fn locate(&self, (x, y): (f32, f32), scale: f32) -> Location<'_> {
        let n_layers = self.levels.n_layers;
        let level = self.levels.nearest(scale).max(0.0) as usize;
        // Of an octave, extrema are found in the layers 1 to n_layers.
        let octave_idx = (level.saturating_sub(1) / n_layers).min(self.octaves.len() - 1);
        let octave = self.octaves[octave_idx].planes();
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
    use proptest::prelude::*;

    const LEVELS: Levels = Levels { sigma: 1.6, n_layers: 3, doubled: true };

    fn build_again(space: &mut ScaleSpace, image: &Image, levels: Levels, coarsest: f32) {
        space.build(&Plane::new(image, false), levels, Extent { coarsest, n_more: 2 }, |_| ());
    }

    fn build(image: &Image, levels: Levels, coarsest: f32) -> ScaleSpace {
        let mut space = ScaleSpace::default();
        build_again(&mut space, image, levels, coarsest);
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
        for (layer, plane) in space.octaves()[0].planes().iter().enumerate() {
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
            assert!(std::ptr::eq(location.plane, &space.octaves()[octave_idx].planes()[layer]), "{scale}");
            let pixel = [0.5, 1.0, 2.0][octave_idx];
            assert_eq!((location.x, location.y, location.pixel), (30.0 / pixel, 20.0 / pixel, pixel));
            assert_eq!(location.scale, scale / pixel);
        }
        let largest = space.locate((30.0, 20.0), 1e9).plane;
        assert!(std::ptr::eq(largest, space.octaves().last().unwrap().planes().last().unwrap()));
    }

    proptest! {
        #[test]
        fn planes_grow_to_what_whole_ones_are(
            (width, height) in (1usize..70, 1usize..70), doubled: bool, wraps: bool, n_layers in 1usize..4,
            n_more in 0usize..2,
        ) {
            let image = Plane::new(&noise(width, height), wraps);
            let levels = Levels { n_layers, doubled, ..LEVELS };
            let mut space = ScaleSpace::default();
            let mut n_rows = std::collections::BTreeMap::new();
            let extent = Extent { coarsest: f32::INFINITY, n_more };
            space.build(&image, levels, extent, |Grown { octave_idx, layer, rows, planes }| {
                assert_eq!(planes.len(), layer + 1);
                let before = n_rows.insert((octave_idx, layer), rows.end).unwrap_or(0);
                assert_eq!(before, rows.start);
            });
            let blur = |plane: &Plane, layer: usize| {
                let mut blurred = plane.clone();
                let from = if layer == 0 { 0.5 * levels.pixel(0).recip() } else { levels.sigma(layer as f32 - 1.0) };
                let mut blur = Blur::new(missing_sigma(from, levels.sigma(layer as f32)));
                blur.blur_rows(plane, 0, blurred.rows_mut(0..plane.height));
                blurred
            };
            let mut base = image.clone();
            if doubled {
                base.resize((2 * width, 2 * height), wraps);
                (0..height).for_each(|y| image.double_row(y, &mut base));
            }
            let mut first = blur(&base, 0);
            for (octave_idx, octave) in space.octaves().iter().enumerate() {
                let planes = octave.planes();
                let is_last = octave_idx + 1 == space.octaves().len();
                prop_assert_eq!(planes.len(), n_layers + if is_last { 3 } else { 1 + n_more });
                prop_assert_eq!(&planes[0], &first);
                for layer in 1..planes.len() {
                    // The same bits, whole or strip by strip.
                    prop_assert_eq!(&planes[layer], &blur(&planes[layer - 1], layer));
                    prop_assert_eq!(n_rows[&(octave_idx, layer)], planes[layer].height());
                }
                if !is_last && planes[0].width() > 2 {
                    let next = blur(&planes[planes.len() - 1], planes.len());
                    let expected = [0, 1, 2].map(|y| [0, 1, 2].map(|x| next.row(y)[x]));
                    prop_assert_eq!(octave.around(planes.len(), 1, 1), expected);
                }
                let halved = planes[n_layers.min(planes.len() - 1)].clone();
                first.resize((halved.width().div_ceil(2), halved.height().div_ceil(2)), wraps);
                (0..first.height()).for_each(|y| halved.halve_rows(y..y + 1, &mut first));
            }
        }
    }

    #[test]
    fn leaving_out_coarser_levels_and_using_the_memory_again_changes_nothing() {
        let image = noise(100, 80);
        let whole = build(&image, LEVELS, f32::INFINITY);
        let mut space = build(&noise(150, 200), Levels { n_layers: 4, ..LEVELS }, f32::INFINITY);
        for scale in [0.5, 1.0, 1.6, 2.0, 3.3] {
            build_again(&mut space, &image, LEVELS, scale);
            let (found, expected) = (space.locate((5.0, 6.0), scale), whole.locate((5.0, 6.0), scale));
            assert_eq!(found.plane, expected.plane, "{scale}");
        }
        assert!(space.octaves().len() < whole.octaves().len());
    }
}
