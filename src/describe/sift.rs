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
use crate::plane::{Gradients, Levels, Location, ScaleSpace, gaussian_at};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Cells a side of the square.
const N_CELLS: usize = 4;

/// Directions of a cell.
const N_DIRECTIONS: usize = 8;

/// No number of a descriptor of unit length exceeds this before it is scaled again.
const HIGHEST: f32 = 0.2;

/// Of the scale space that keypoints are described in; the first octave is doubled if they need it.
const SIGMA: f32 = 1.6;
const N_LAYERS: usize = 3;

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

/// With a cell beyond each side, for gradients that only partly lie inside.
type Histograms = [[[f32; N_DIRECTIONS]; N_CELLS + 2]; N_CELLS + 2];

impl SiftDescriptor {
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
        let doubled = finest < SIGMA * (-0.5 / N_LAYERS as f32).exp2();
        let levels = Levels { sigma: SIGMA, n_layers: N_LAYERS, doubled };
        let mut space = ScaleSpace::default();
        space.build(image, levels, coarsest);
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
            let mut histograms = Histograms::default();
            for (y, row_weight) in rows.zip(row_weights) {
                let inside = square.columns(y, &columns);
                if inside.is_empty() {
                    continue;
                }
                gradients.take(location.plane, y, &inside);
                if !is_inside {
                    outside.resize(inside.len(), 0);
                    let start = (inside.start as f32 * location.pixel, y as f32 * location.pixel);
                    view.mark_outside(start, (location.pixel, 0.0), location.pixel, &mut outside);
                    let hidden = gradients.lengths.iter_mut().zip(&outside).filter(|(_, mark)| **mark != 0);
                    hidden.for_each(|(length, _)| *length = 0.0);
                }
                let weights = &column_weights[inside.start - columns.start..];
                gradients
                    .lengths
                    .iter_mut()
                    .zip(weights)
                    .for_each(|(length, weight)| *length *= weight * row_weight);
                square.count(y, inside.start, &gradients, &mut histograms);
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

    /// Shares the gradients of row `y`, from column `start` on, among the histograms.
    fn count(&self, y: usize, start: usize, gradients: &Gradients, histograms: &mut Histograms) {
        for (x, (&length, &turn)) in (start..).zip(gradients.lengths.iter().zip(&gradients.turns)) {
            let (column, row) = self.position(x as f32, y as f32);
            // Directions are counted from the x axis of the square, against the sense of the angle.
            let direction = (self.turn - turn + 1.0) * N_DIRECTIONS as f32;
            // All are above -1: the cast rounds down.
            let (column, row) = (column + 1.0, row + 1.0);
            let (column_idx, row_idx, direction_idx) = (column as usize, row as usize, direction as usize);
            if column_idx > N_CELLS || row_idx > N_CELLS {
                continue;
            }
            let right = column - column_idx as f32;
            let lower = row - row_idx as f32;
            let next = direction - direction_idx as f32;
            for (row_idx, share) in [(row_idx, 1.0 - lower), (row_idx + 1, lower)] {
                let share = share * length;
                for (column_idx, share) in
                    [(column_idx, share * (1.0 - right)), (column_idx + 1, share * right)]
                {
                    let histogram = &mut histograms[row_idx][column_idx];
                    histogram[direction_idx % N_DIRECTIONS] += share * (1.0 - next);
                    histogram[(direction_idx + 1) % N_DIRECTIONS] += share * next;
                }
            }
        }
    }
}

/// The inner cells, of unit length, without high numbers.
fn write(histograms: &Histograms, descriptor: &mut [f32]) {
    let inner = histograms[1..=N_CELLS].iter().flat_map(|row| row[1..=N_CELLS].as_flattened());
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
