//! The SIFT descriptor: Lowe, "Distinctive image features from scale-invariant keypoints", IJCV 60(2), 2004,
//! section 6.
//!
//! Histograms of gradient directions over 4 x 4 cells of a square that is turned and scaled with the
//! keypoint, 8 directions each. A gradient is shared between neighboring cells and directions by linear
//! interpolation and counts by a Gaussian round the keypoint. The 128 numbers are scaled to unit length, cut
//! at 0.2 and scaled again.

use crate::camera::View;
use crate::detect::Keypoint;
use crate::image::Image;
use crate::matrix::Matrix;
use crate::plane::{Extent, Gradients, Levels, Location, Plane, ScaleSpace, gaussian_at};
use crate::simd::{self, CellHistograms, CellRow, N_CELL_DIRECTIONS as N_DIRECTIONS, N_CELLS};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// No number of a descriptor of unit length exceeds this before it is scaled again.
const HIGHEST: f32 = 0.2;

/// The SIFT descriptor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SiftDescriptor {
    /// The side of a cell in scales of the keypoint, from 1 to 16. Detectors that look at pixels find
    /// keypoints of scale 1.
    pub magnification: f32,
}

impl Default for SiftDescriptor {
    fn default() -> Self {
        Self { magnification: 3.0 }
    }
}

impl SiftDescriptor {
    /// The most levels of the scale space that keypoints are described in; the first octave is doubled only if
    /// they need it.
    pub const LEVELS: Levels = Levels { sigma: 1.6, n_layers: 3, doubled: true };

    pub(super) fn n_dimensions() -> usize {
        N_CELLS * N_CELLS * N_DIRECTIONS
    }

    pub(super) fn check(&self) -> Result<(), String> {
        if !(1.0..=16.0).contains(&self.magnification) {
            return Err(format!(
                "the magnification of the SIFT descriptor must be from 1 to 16, not {}",
                self.magnification
            ));
        }
        Ok(())
    }

    /// Half the side of the square that is described, in pixels, and the direction of its upper edge.
    pub(super) fn square(&self, keypoint: &Keypoint, view: &View) -> (f32, (f32, f32)) {
        let (sine, cosine) = angle(keypoint, view).sin_cos();
        (N_CELLS as f32 / 2.0 * self.magnification * keypoint.scale, (cosine, sine))
    }

    pub(super) fn describe(&self, image: &Image, keypoints: &[Keypoint], view: &View) -> Matrix {
        let scales = keypoints.iter().map(|keypoint| keypoint.scale);
        let (finest, coarsest) =
            scales.fold((f32::INFINITY, 0.0f32), |(low, high), scale| (low.min(scale), high.max(scale)));
        // Nearer to the level below the first one than to that.
        let Levels { sigma, n_layers, .. } = Self::LEVELS;
        let doubled = finest < sigma * (-0.5 / n_layers as f32).exp2();
        let levels = Levels { doubled, ..Self::LEVELS };
        let mut space = ScaleSpace::default();
        space.build(&Plane::new(image, view.wraps()), levels, Extent { coarsest, n_more: 0 }, |_| ());
        self.describe_in(&space, keypoints, view)
    }

    /// See [`super::Descriptor::describe`], in the scale space that the keypoints were detected in.
    pub fn describe_in(&self, space: &ScaleSpace, keypoints: &[Keypoint], view: &View) -> Matrix {
        let mut descriptors = Matrix::zeros(keypoints.len(), Self::n_dimensions());
        let mut gradients = Gradients::default();
        let mut outside = Vec::new();
        for (row_idx, keypoint) in keypoints.iter().enumerate() {
            let location = space.locate((keypoint.x, keypoint.y), keypoint.scale);
            let square = Square::new(&location, self.magnification * location.scale, angle(keypoint, view));
            let is_inside = view.contains(keypoint.x, keypoint.y, square.radius * location.pixel);
            let (columns, rows) = location.window(square.radius);
            let column_weights = gaussian_at(location.x, columns.clone(), square.sigma());
            let row_weights = gaussian_at(location.y, rows.clone(), square.sigma());
            let mut histograms = [[0.0; N_DIRECTIONS]; (N_CELLS + 2) * (N_CELLS + 2)];
            for (y, row_weight) in rows.zip(row_weights) {
                let inside = square.columns(y, &columns);
                if inside.is_empty() {
                    continue;
                }
                gradients.take(location.plane, y, &inside);
                if !is_inside {
                    outside.resize(inside.len(), 0);
                    let start = (location.image_column(inside.start), y as f32 * location.pixel);
                    view.mark_outside(start, (location.pixel, 0.0), location.pixel, &mut outside);
                    let hidden = gradients.lengths.iter_mut().zip(&outside).filter(|(_, mark)| **mark != 0);
                    hidden.for_each(|(length, _)| *length = 0.0);
                }
                let row = CellRow {
                    start: (inside.start, y),
                    center: square.center,
                    along: square.along,
                    turn: square.turn,
                    lengths: &gradients.lengths,
                    turns: &gradients.turns,
                    weights: &column_weights[inside.start - columns.start..],
                    row_weight,
                };
                simd::share_gradients(&row, &mut histograms);
            }
            write(&histograms, descriptors.row_mut(row_idx));
        }
        descriptors
    }
}

/// Which way a keypoint's square is turned.
fn angle(keypoint: &Keypoint, view: &View) -> f32 {
    let radial = || view.radial_direction(keypoint.x, keypoint.y).map(|(dx, dy)| dy.atan2(dx));
    keypoint.angle.or_else(radial).unwrap_or(0.0)
}

/// The square round a keypoint, in pixels of a plane.
struct Square {
    center: (f32, f32),
    /// The unit vector along its rows, divided by the side of a cell.
    along: (f32, f32),
    cell: f32,
    /// In turns.
    turn: f32,
    /// Half the diagonal, with half a cell on each side.
    radius: f32,
}

impl Square {
    fn new(location: &Location, cell: f32, angle: f32) -> Self {
        let (sine, cosine) = f64::from(angle).sin_cos();
        Self {
            center: (location.x, location.y),
            along: (cosine as f32 / cell, sine as f32 / cell),
            cell,
            turn: angle / std::f32::consts::TAU,
            radius: (0.5 * (N_CELLS + 1) as f32 * cell * std::f32::consts::SQRT_2).round(),
        }
    }

    /// Of the Gaussian that gradients count by: half the side.
    fn sigma(&self) -> f32 {
        0.5 * N_CELLS as f32 * self.cell
    }

    /// In cells from the center of the first: how far the pixel (x, y) is along the rows and columns.
    #[inline]
    fn position(&self, x: f32, y: f32) -> (f32, f32) {
        const MIDDLE: f32 = 0.5 * (N_CELLS - 1) as f32;
        let (dx, dy) = (x - self.center.0, y - self.center.1);
        (MIDDLE + dx * self.along.0 + dy * self.along.1, MIDDLE + dy * self.along.0 - dx * self.along.1)
    }

    /// Those of `columns` whose pixels in row `y` are in the square.
    fn columns(&self, y: usize, columns: &Range<usize>) -> Range<usize> {
        let start = self.position(columns.start as f32, y as f32);
        let mut span = (0.0, columns.len() as f32);
        for (start, step) in [(start.0, self.along.0), (start.1, -self.along.1)] {
            // Where start + step * t is -1 and N_CELLS; infinities, in the right order, along that side.
            let (a, b) = ((-1.0 - start) / step, (N_CELLS as f32 - start) / step);
            span = (f32::max(span.0, a.min(b)), f32::min(span.1, a.max(b)));
        }
        let column = |offset: f32| columns.start + (offset.ceil() as usize).min(columns.len());
        column(span.0)..column(span.1)
    }
}

/// The inner cells, of unit length, without high numbers.
fn write(histograms: &CellHistograms, descriptor: &mut [f32]) {
    let rows = histograms.chunks_exact(N_CELLS + 2).skip(1).take(N_CELLS);
    let inner = rows.flat_map(|row| row[1..=N_CELLS].as_flattened());
    descriptor.iter_mut().zip(inner).for_each(|(number, &count)| *number = count);
    scale_to_unit(descriptor);
    descriptor.iter_mut().for_each(|number| *number = number.min(HIGHEST));
    scale_to_unit(descriptor);
}

/// Zeros stay zeros.
fn scale_to_unit(numbers: &mut [f32]) {
    let length = numbers.iter().map(|number| number * number).sum::<f32>().sqrt();
    if length > 0.0 {
        numbers.iter_mut().for_each(|number| *number /= length);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;
    use super::*;
    use crate::camera::{Camera, Mirror, Projection};
    use proptest::prelude::*;

    fn keypoint(x: f32, y: f32, scale: f32, angle: Option<f32>) -> Keypoint {
        Keypoint { scale, angle, ..Keypoint::new(x, y, 1.0) }
    }

    #[test]
    fn an_edge_across_the_square_is_one_direction() {
        // Brighter toward the angle: the first direction of each cell.
        for angle in [0.0f32, 0.6, 2.2, 4.0] {
            let pixel = |idx: usize| {
                let (dx, dy) = ((idx % 120) as f32 - 60.0, (idx / 120) as f32 - 60.0);
                (128.0 + (dx * angle.cos() + dy * angle.sin())) as u8
            };
            let image = Image::from_pixels(120, 120, (0..120 * 120).map(pixel).collect()).unwrap();
            let found = [keypoint(60.0, 60.0, 3.0, Some(angle))];
            let described = SiftDescriptor::default().describe(&image, &found, &whole(&image));
            for (number_idx, &number) in described.row(0).iter().enumerate() {
                let is_first = number_idx % N_DIRECTIONS == 0;
                assert_eq!(number > 0.1, is_first, "{angle} {number_idx}: {number}");
            }
        }
    }

    #[test]
    fn turned_and_scaled_surroundings_are_described_alike() {
        use crate::detect::testing::{SIDE, blobs};
        let middle = SIDE as f32 / 2.0;
        let (angle, factor) = (1.0f32, 1.4);
        let (upright, turned) = (blobs(0.0, 1.0, 1.0), blobs(angle, factor, 0.7));
        for (dx, dy, scale) in [(0.0, 0.0, 2.0), (20.0, -10.0, 3.0), (-30.0, 12.0, 2.5)] {
            let x = middle + factor * (dx * angle.cos() - dy * angle.sin());
            let y = middle + factor * (dy * angle.cos() + dx * angle.sin());
            let old = [keypoint(middle + dx, middle + dy, scale, Some(0.3))];
            let new = [keypoint(x, y, scale * factor, Some(0.3 + angle))];
            let old = SiftDescriptor::default().describe(&upright, &old, &whole(&upright));
            let new = SiftDescriptor::default().describe(&turned, &new, &whole(&turned));
            let similarity: f32 = old.row(0).iter().zip(new.row(0)).map(|(a, b)| a * b).sum();
            assert!(similarity > 0.98, "{dx} {dy}: {similarity}");
        }
    }

    #[test]
    fn what_is_outside_the_mirror_does_not_count() {
        let mirror = Mirror { center_x: 0.5, center_y: 0.5, inner_radius: 0.1, outer_radius: 0.4 };
        let view = Camera::new(Projection::Omnidirectional(mirror)).view(200, 200);
        let image = noise(200, 200);
        // Smoothing spreads what is nearer to the rim than its kernel.
        let changed = (0..200 * 200).map(|idx| {
            let (dx, dy) = ((idx % 200) as f32 - 100.0, (idx / 200) as f32 - 100.0);
            if dx.hypot(dy) > 90.0 { 0 } else { image.pixels()[idx] }
        });
        let changed = Image::from_pixels(200, 200, changed.collect()).unwrap();
        let found = [keypoint(178.0, 100.0, 2.0, None)];
        let distance = |view: &View| {
            let [a, b] =
                [&image, &changed].map(|image| SiftDescriptor::default().describe(image, &found, view));
            a.row(0).iter().zip(b.row(0)).map(|(a, b)| (a - b) * (a - b)).sum::<f32>().sqrt()
        };
        assert!(distance(&view) < 1e-5, "{}", distance(&view));
        assert!(distance(&whole(&image)) > 0.1, "{}", distance(&whole(&image)));
    }

    #[test]
    fn the_scale_space_of_the_default_detector_describes_alike() {
        use crate::detect::testing::blobs;
        use crate::detect::{Detector, Sift};
        let image = blobs(0.0, 1.0, 1.0);
        let (view, sift) = (whole(&image), SiftDescriptor::default());
        let mut space = ScaleSpace::default();
        let found = Detector::Sift(Sift::default()).detect_with(&image, &view, &mut space);
        assert_eq!(sift.describe_in(&space, &found, &view), sift.describe(&image, &found, &view));
    }

    #[test]
    fn a_turned_panorama_is_described_alike() {
        use crate::detect::testing::panorama;
        let view = Camera::new(Projection::Equirectangular).view(256, 128);
        let found = |x: f32| [1.0, 4.0, 9.0].map(|scale| keypoint(x, 64.0, scale, Some(1.0)));
        for (x, turn) in [(0.0, 128), (3.5, 64), (250.25, 208), (130.0, 128)] {
            let turned_x = (x - turn as f32).rem_euclid(256.0);
            let here = SiftDescriptor::default().describe(&panorama(256, 128, 0), &found(x), &view);
            let there =
                SiftDescriptor::default().describe(&panorama(256, 128, turn), &found(turned_x), &view);
            for (a, b) in here.as_slice().iter().zip(there.as_slice()) {
                assert!((a - b).abs() < 1e-3, "{x}: {a} {b}");
            }
        }
    }

    #[test]
    fn flat_surroundings_have_no_numbers() {
        let image = Image::from_pixels(50, 50, vec![90; 2500]).unwrap();
        let found = [keypoint(25.0, 25.0, 2.0, None)];
        let described = SiftDescriptor::default().describe(&image, &found, &whole(&image));
        assert_eq!(described, Matrix::zeros(1, 128));
    }

    #[test]
    fn absurd_parameters_are_refused() {
        for magnification in [0.5, 100.0, f32::NAN] {
            assert!(SiftDescriptor { magnification }.check().is_err());
        }
        assert_eq!(SiftDescriptor::default().check(), Ok(()));
    }

    proptest! {
        #[test]
        fn any_keypoint_gets_a_row_of_at_most_unit_length(
            (width, height) in (1usize..40, 1usize..40), x in 0.0f32..1.0, y in 0.0f32..1.0,
            scale in 0.1f32..40.0, angle in prop::option::of(0.0f32..6.3), quarter in 0u8..4,
        ) {
            let image = noise(width, height);
            // Along the axes, too.
            let angle = angle.or(Some(f32::from(quarter) * std::f32::consts::FRAC_PI_2));
            let found = [keypoint(x * width as f32, y * height as f32, scale, angle), keypoint(0.0, 0.0, 1.0, None)];
            let described = SiftDescriptor::default().describe(&image, &found, &whole(&image));
            for row in described.rows() {
                let length = row.iter().map(|number| number * number).sum::<f32>().sqrt();
                prop_assert!(length == 0.0 || (length - 1.0).abs() < 1e-5, "{length}");
            }
        }
    }
}
