//! Planes of `f32` gray values, and the Gaussian scale space of an image.

mod blur;
mod scale_space;

pub(crate) use blur::Blur;
pub(crate) use scale_space::{Extent, Grown, Octave};
pub use scale_space::{Levels, Location, ScaleSpace};

use crate::image::Image;
use crate::simd;
use std::ops::Range;

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

    /// Two rows, from `2 * y` on, of a plane twice as wide and high, by linear interpolation: pixel (x, y) is at
    /// (2 x, 2 y). `ring` holds the last ones of that plane.
    fn double_row(&self, y: usize, ring: &mut Self) {
        let (row, next) = (self.row(y), self.row((y + 1).min(self.height - 1)));
        double(row, self.wraps, ring.row_mut(2 * y % ring.height));
        let between: Vec<f32> = row.iter().zip(next).map(|(a, b)| (a + b) / 2.0).collect();
        double(&between, self.wraps, ring.row_mut((2 * y + 1) % ring.height));
    }

    /// Rows `rows` of a plane of every other column of every other row, from the first on. Where a plane of odd
    /// width wraps, the last column and the first then are neighbors that lie only one pixel of before apart.
    fn halve_rows(&self, rows: Range<usize>, halved: &mut Self) {
        let width = halved.width;
        let halved = halved.rows_mut(rows.clone());
        for (y, row) in rows.zip(halved.chunks_exact_mut(width)) {
            row.iter_mut().zip(self.row(2 * y).chunks(2)).for_each(|(value, pair)| *value = pair[0]);
        }
    }

    /// The values of some rows, to write to. Panics when there are no such rows.
    pub fn rows_mut(&mut self, rows: Range<usize>) -> &mut [f32] {
        &mut self.values[rows.start * self.width..rows.end * self.width]
    }

    /// Makes it one of another size, which wraps or does not. What it then holds means nothing until it is
    /// written to.
    pub fn resize(&mut self, (width, height): (usize, usize), wraps: bool) {
        (self.width, self.height, self.wraps) = (width, height, wraps);
        self.values.resize(width * height, 0.0);
    }
}

fn double(row: &[f32], wraps: bool, doubled: &mut [f32]) {
    let (pairs, _) = doubled.as_chunks_mut::<2>();
    for (pair, values) in pairs.iter_mut().zip(row.windows(2)) {
        *pair = [values[0], (values[0] + values[1]) / 2.0];
    }
    if let (Some(last), Some(&value)) = (pairs.last_mut(), row.last()) {
        *last = [value, if wraps { (value + row[0]) / 2.0 } else { value }];
    }
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

    fn plane(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> Plane {
        let values = (0..width * height).map(|idx| value(idx % width, idx / width)).collect();
        Plane { width, height, wraps: false, values }
    }

    fn doubled(original: &Plane) -> Plane {
        let mut doubled = Plane::default();
        doubled.resize((2 * original.width, 2 * original.height), original.wraps);
        (0..original.height).for_each(|y| original.double_row(y, &mut doubled));
        doubled
    }

    #[test]
    fn halving_undoes_doubling() {
        for (width, height) in [(1, 1), (5, 4), (8, 3)] {
            let original = plane(width, height, |x, y| (x * x + 3 * y) as f32);
            let doubled = doubled(&original);
            let mut halved = plane(width, height, |_, _| f32::NAN);
            (0..height).for_each(|y| doubled.halve_rows(y..y + 1, &mut halved));
            assert_eq!(halved, original);
        }
    }

    #[test]
    fn doubling_interpolates() {
        assert_eq!(
            doubled(&plane(2, 2, |x, y| (x + 2 * y) as f32)).values,
            [0.0, 0.5, 1.0, 1.0, 1.0, 1.5, 2.0, 2.0, 2.0, 2.5, 3.0, 3.0, 2.0, 2.5, 3.0, 3.0]
        );
        let doubled = doubled(&Plane { wraps: true, ..plane(2, 1, |x, _| x as f32) });
        assert_eq!(doubled.values, [0.0, 0.5, 1.0, 0.5, 0.0, 0.5, 1.0, 0.5]);
    }
}
