//! Planes of `f32` gray values, and the Gaussian scale space of an image.

mod scale_space;

pub use scale_space::{Levels, Location, ScaleSpace};

use crate::image::Image;
use crate::simd;
use std::ops::Range;

/// How many sigmas of a Gaussian are summed on each side.
const KERNEL_REACH: f32 = 4.0;

/// A plane of gray values from 0 (black) to 1 (white), row-major; empty until something is written to it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plane {
    width: usize,
    height: usize,
    wraps: bool,
    values: Vec<f32>,
}

impl Plane {
    /// The gray values of an image, whose left and right edges meet where it `wraps`.
    pub fn new(image: &Image, wraps: bool) -> Self {
        let values = image.pixels().iter().map(|&pixel| f32::from(pixel) / 255.0).collect();
        Self { width: image.width(), height: image.height(), wraps, values }
    }

    /// The number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Whether the left and right edges meet.
    pub fn wraps(&self) -> bool {
        self.wraps
    }

    /// The columns that have a neighbor on either side.
    pub fn inner_columns(&self) -> Range<usize> {
        if self.wraps { 0..self.width } else { 1..self.width.saturating_sub(1) }
    }

    /// One of the [`Plane::inner_columns`] between its neighbors.
    pub fn around(&self, column: usize) -> [usize; 3] {
        [(column + self.width - 1) % self.width, column, (column + 1) % self.width]
    }

    /// The values of row `y`. Panics when there is no such row.
    pub fn row(&self, y: usize) -> &[f32] {
        &self.values[y * self.width..][..self.width]
    }

    /// The values of row `y`, to write to. Panics when there is no such row.
    pub fn row_mut(&mut self, y: usize) -> &mut [f32] {
        &mut self.values[y * self.width..][..self.width]
    }

    /// Blurs by a Gaussian of `sigma` pixels; beyond the plane its border is repeated, or its
    /// columns when it wraps.
    pub fn blur_into(&self, sigma: f32, blurred: &mut Self) {
        let weights = gaussian(sigma);
        let radius = weights.len() - 1;
        blurred.resize((self.width, self.height), self.wraps);
        // Down the columns into one row, from there along it: the row stays in the nearest cache.
        let mut padded = vec![0.0; self.width + 2 * radius];
        let mut rows = Vec::with_capacity(2 * radius + 1);
        for (y, blurred) in blurred.values.chunks_exact_mut(self.width).enumerate() {
            rows.clear();
            rows.extend(
                (y..=y + 2 * radius).map(|y| self.row(y.saturating_sub(radius).min(self.height - 1))),
            );
            simd::blur_columns(&rows, &weights, &mut padded[radius..radius + self.width]);
            pad(&mut padded, radius, self.wraps);
            simd::blur_row(&padded, &weights, blurred);
        }
    }

    /// Twice as wide and high, by linear interpolation: pixel (x, y) is at (2 x, 2 y).
    pub fn double_into(&self, doubled: &mut Self) {
        let width = 2 * self.width;
        doubled.resize((width, 2 * self.height), self.wraps);
        let mut between = vec![0.0; self.width];
        for (y, rows) in doubled.values.chunks_exact_mut(2 * width).enumerate() {
            let (even, odd) = rows.split_at_mut(width);
            let (row, next) = (self.row(y), self.row((y + 1).min(self.height - 1)));
            double_row(row, self.wraps, even);
            for ((between, a), b) in between.iter_mut().zip(row).zip(next) {
                *between = (a + b) / 2.0;
            }
            double_row(&between, self.wraps, odd);
        }
    }

    /// Every other column of every other row, from the first on. Where a plane of odd width wraps, the last
    /// column and the first then are neighbors that lie only one pixel of before apart.
    pub fn halve_into(&self, halved: &mut Self) {
        halved.resize((self.width.div_ceil(2), self.height.div_ceil(2)), self.wraps);
        for (y, row) in halved.values.chunks_exact_mut(halved.width).enumerate() {
            row.iter_mut().zip(self.row(2 * y).chunks(2)).for_each(|(value, pair)| *value = pair[0]);
        }
    }

    /// Makes it one of another size, which wraps or does not. What it then holds means nothing until it is
    /// written to.
    pub fn resize(&mut self, (width, height): (usize, usize), wraps: bool) {
        (self.width, self.height, self.wraps) = (width, height, wraps);
        self.values.resize(width * height, 0.0);
    }
}

/// Continues the row in the middle of `padded` by `radius` values on either side: by its ends, or by the row
/// itself when it wraps.
fn pad(padded: &mut [f32], radius: usize, wraps: bool) {
    let width = padded.len() - 2 * radius;
    for beyond in 0..radius {
        let (before, after) =
            if wraps { (width - 1 - beyond % width, beyond % width) } else { (0, width - 1) };
        padded[radius - 1 - beyond] = padded[radius + before];
        padded[radius + width + beyond] = padded[radius + after];
    }
}

fn double_row(row: &[f32], wraps: bool, doubled: &mut [f32]) {
    let (pairs, _) = doubled.as_chunks_mut::<2>();
    for (pair, values) in pairs.iter_mut().zip(row.windows(2)) {
        *pair = [values[0], (values[0] + values[1]) / 2.0];
    }
    if let (Some(last), Some(&value)) = (pairs.last_mut(), row.last()) {
        *last = [value, if wraps { (value + row[0]) / 2.0 } else { value }];
    }
}

/// The weights of a Gaussian from its center outward; with both sides they sum to 1.
fn gaussian(sigma: f32) -> Vec<f32> {
    let radius = (KERNEL_REACH * sigma).round().max(1.0) as usize;
    let weights = gaussian_at(0.0, 0..radius + 1, sigma);
    let sum = 2.0 * weights.iter().sum::<f32>() - weights[0];
    weights.iter().map(|weight| weight / sum).collect()
}

/// A Gaussian round `center`, 1 in its middle, at the whole numbers of `positions`.
pub fn gaussian_at(center: f32, positions: Range<usize>, sigma: f32) -> Vec<f32> {
    let value = |position: usize| {
        let distance = f64::from(position as f32 - center) / f64::from(sigma);
        (-0.5 * distance * distance).exp() as f32
    };
    positions.map(value).collect()
}

/// The gradients of the pixels of a row; the memory is used again and again.
#[derive(Debug, Default)]
pub struct Gradients {
    /// In gray values per two pixels.
    pub lengths: Vec<f32>,
    /// From the x axis toward the y axis, in turns from 0 to 1.
    pub turns: Vec<f32>,
    /// Rows that reach across the seam of a plane that wraps.
    across: [Vec<f32>; 3],
}

impl Gradients {
    /// Takes those of the pixels `columns` of row `y`, none of which is on the border of `plane`. Where the
    /// plane wraps, its columns go on after the last with the first again.
    pub fn take(&mut self, plane: &Plane, y: usize, columns: &Range<usize>) {
        self.lengths.resize(columns.len(), 0.0);
        self.turns.resize(columns.len(), 0.0);
        let rows = [y - 1, y, y + 1].map(|y| plane.row(y));
        let (first, n) = ((columns.start - 1) % plane.width, columns.len() + 2);
        if first + n <= plane.width {
            let rows = rows.map(|row| &row[first..first + n]);
            simd::gradients(rows, &mut self.lengths, &mut self.turns);
            return;
        }
        for (across, row) in self.across.iter_mut().zip(rows) {
            across.clear();
            across.extend((first..first + n).map(|column| row[column % plane.width]));
        }
        let rows = self.across.each_ref().map(Vec::as_slice);
        simd::gradients(rows, &mut self.lengths, &mut self.turns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn plane(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> Plane {
        let values = (0..width * height).map(|idx| value(idx % width, idx / width)).collect();
        Plane { width, height, wraps: false, values }
    }

    proptest! {
        #[test]
        fn blurring_weighs_by_a_gaussian_and_repeats_the_border_or_the_columns(
            (width, height) in (1usize..90, 1usize..12), sigma in 0.3f32..4.0, wraps: bool,
        ) {
            let original =
                Plane { wraps, ..plane(width, height, |x, y| ((x * 7 + y * 13) % 5) as f32 / 5.0) };
            let mut blurred = Plane::default();
            original.blur_into(sigma, &mut blurred);
            let reach = (4.0 * sigma).round().max(1.0) as isize;
            for (x, y) in [(0, 0), (width / 2, height / 2), (width - 1, height - 1)] {
                let (mut sum, mut n) = (0.0, 0.0);
                for (dx, dy) in (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy))) {
                    let weight = (-((dx * dx + dy * dy) as f32) / (2.0 * sigma * sigma)).exp();
                    let at = |position: usize, offset: isize, size: usize| {
                        (position as isize + offset).clamp(0, size as isize - 1) as usize
                    };
                    let column = if wraps {
                        (x as isize + dx).rem_euclid(width as isize) as usize
                    } else {
                        at(x, dx, width)
                    };
                    sum += weight * original.row(at(y, dy, height))[column];
                    n += weight;
                }
                prop_assert!((blurred.row(y)[x] - sum / n).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn halving_undoes_doubling() {
        for (width, height) in [(1, 1), (5, 4), (8, 3)] {
            let original = plane(width, height, |x, y| (x * x + 3 * y) as f32);
            let (mut doubled, mut halved) = (Plane::default(), Plane::default());
            original.double_into(&mut doubled);
            doubled.halve_into(&mut halved);
            assert_eq!((doubled.width(), doubled.height()), (2 * width, 2 * height));
            assert_eq!(halved, original);
        }
    }

    #[test]
    fn doubling_interpolates() {
        let mut doubled = Plane::default();
        plane(2, 2, |x, y| (x + 2 * y) as f32).double_into(&mut doubled);
        assert_eq!(
            doubled.values,
            [0.0, 0.5, 1.0, 1.0, 1.0, 1.5, 2.0, 2.0, 2.0, 2.5, 3.0, 3.0, 2.0, 2.5, 3.0, 3.0]
        );
        Plane { wraps: true, ..plane(2, 1, |x, _| x as f32) }.double_into(&mut doubled);
        assert_eq!(doubled.values, [0.0, 0.5, 1.0, 0.5, 0.0, 0.5, 1.0, 0.5]);
    }
}
