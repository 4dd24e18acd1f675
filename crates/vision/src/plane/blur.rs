//! Gaussian blurs of whole planes, rows of them, or round a pixel.

use super::Plane;
use crate::simd;

/// How many sigmas of a Gaussian are summed on each side.
const KERNEL_REACH: f32 = 4.0;

/// A Gaussian blur. Beyond a plane its border is repeated, or its columns when it wraps.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blur {
    /// From the center outward; with both sides they sum to 1.
    weights: Vec<f32>,
    /// Rows that were blurred down the columns, continued on either side.
    padded: Vec<f32>,
}

impl Blur {
    /// Rows that are best blurred at once.
    pub(crate) const STRIP: usize = 4;

    /// By `sigma` pixels.
    pub(crate) fn new(sigma: f32) -> Self {
        let radius = (KERNEL_REACH * sigma).round().max(1.0) as usize;
        let weights = super::gaussian_at(0.0, 0..radius + 1, sigma);
        let sum = 2.0 * weights.iter().sum::<f32>() - weights[0];
        Self { weights: weights.iter().map(|weight| weight / sum).collect(), padded: Vec::new() }
    }

    /// How many rows can be blurred of a plane of `height` rows whose first `n_rows` are there: whole strips, and at
    /// its end all.
    pub(crate) fn n_ready(&self, height: usize, n_rows: usize) -> usize {
        if n_rows == height {
            return n_rows;
        }
        n_rows.saturating_sub(self.radius()) / Self::STRIP * Self::STRIP
    }

    /// Blurs rows of `plane`, from `first` on, into those of `blurred`, which has the same width.
    pub(crate) fn blur_rows(&mut self, plane: &Plane, first: usize, blurred: &mut [f32]) {
        self.blur_ring(plane, plane.height, first, blurred);
    }

    /// The same for a plane of `height` rows of which `ring` holds the last ones, at the remainders of their numbers:
    /// at least [`Blur::n_rows_at_once`].
    pub(crate) fn blur_ring(&mut self, ring: &Plane, height: usize, first: usize, blurred: &mut [f32]) {
        let (radius, width) = (self.radius(), ring.width);
        let padded_width = width + 2 * radius;
        self.padded.resize(Self::STRIP * padded_width, 0.0);
        let mut rows = Vec::with_capacity(Self::STRIP + 2 * radius);
        // Down the columns of a few rows, from there along them: these stay in the nearest cache.
        for (first, blurred) in (first..).step_by(Self::STRIP).zip(blurred.chunks_mut(Self::STRIP * width)) {
            let n_rows = blurred.len() / width;
            let reach = first..first + n_rows + 2 * radius;
            rows.clear();
            rows.extend(reach.map(|y| ring.row(y.saturating_sub(radius).min(height - 1) % ring.height)));
            let padded = &mut self.padded[..n_rows * padded_width];
            let middle = padded.chunks_exact_mut(padded_width).map(|row| &mut row[radius..radius + width]);
            simd::blur_columns(&rows, &self.weights, &mut middle.collect::<Vec<_>>());
            for (padded, blurred) in
                padded.chunks_exact_mut(padded_width).zip(blurred.chunks_exact_mut(width))
            {
                pad(padded, radius, ring.wraps);
                simd::blur_row(padded, &self.weights, blurred);
            }
        }
    }

    /// What [`Blur::blur_rows`] makes of the pixels round one that has neighbors on all sides, row by row.
    pub(crate) fn around(&self, plane: &Plane, column: usize, row: usize) -> [[f32; 3]; 3] {
        let (radius, side) = (self.radius(), 2 * self.radius() + 3);
        let mut patch = vec![0.0; side * side];
        for (y, patch) in (row..).zip(patch.chunks_exact_mut(side)) {
            let row = plane.row(y.saturating_sub(radius + 1).min(plane.height - 1));
            if column > radius && column + radius + 1 < plane.width {
                patch.copy_from_slice(&row[column - radius - 1..][..side]);
                continue;
            }
            for (x, value) in (column..).zip(patch) {
                *value = row[if plane.wraps {
                    (x + side * plane.width - radius - 1) % plane.width
                } else {
                    x.saturating_sub(radius + 1).min(plane.width - 1)
                }];
            }
        }
        let rows: Vec<&[f32]> = patch.chunks_exact(side).collect();
        let mut down = vec![0.0; 3 * side];
        simd::blur_columns(&rows, &self.weights, &mut down.chunks_exact_mut(side).collect::<Vec<_>>());
        let mut blurred = [[0.0; 3]; 3];
        for (row, blurred) in down.chunks_exact(side).zip(&mut blurred) {
            simd::blur_row(row, &self.weights, blurred);
        }
        blurred
    }

    /// The rows that a strip of blurred ones is made of.
    pub(crate) fn n_rows_at_once(&self) -> usize {
        Self::STRIP + 2 * self.radius()
    }

    fn radius(&self) -> usize {
        self.weights.len() - 1
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn blurring_weighs_by_a_gaussian_and_repeats_the_border_or_the_columns(
            (width, height) in (1usize..90, 1usize..12), sigma in 0.3f32..4.0, wraps: bool,
        ) {
            let values = (0..width * height).map(|idx| ((idx % width * 7 + idx / width * 13) % 5) as f32 / 5.0);
            let original = Plane { width, height, wraps, values: values.collect() };
            let mut blur = Blur::new(sigma);
            let mut blurred = vec![0.0; width * height];
            blur.blur_rows(&original, 0, &mut blurred);
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
                prop_assert!((blurred[y * width + x] - sum / n).abs() < 1e-4);
            }
            // The same bits from only some rows, and only round a pixel.
            let mut last_rows = vec![0.0; height / 2 * width];
            blur.blur_rows(&original, height - height / 2, &mut last_rows);
            prop_assert_eq!(&last_rows, &blurred[(height - height / 2) * width..]);
            for (x, y) in original.inner_columns().flat_map(|x| (1..height.max(1) - 1).map(move |y| (x, y))) {
                let expected = [y - 1, y, y + 1].map(|y| original.around(x).map(|x| blurred[y * width + x]));
                prop_assert_eq!(blur.around(&original, x, y), expected);
            }
        }
    }
}
