//! Histograms of pattern codes over the cells of a region.

use super::region::{Region, Weighting, Window};
use crate::simd;

/// Up to this many bins it is faster to count bin by bin, many pixels at once, than pixel by pixel.
const MAX_BINS_COUNTED_APART: usize = 16;

/// A grid of cells over a region, each with a histogram of the same number of bins.
pub(super) struct Cells {
    region_side: usize,
    n_cells: usize,
    n_bins: usize,
    /// The cell row or column of each position along a side.
    cell_of: Vec<usize>,
    weights: Vec<u32>,
    is_uniform: bool,
    /// Of each cell column, as [`simd::count_codes`] takes them.
    masks: Vec<[u8; simd::COUNT_BLOCK]>,
    counts: Vec<u32>,
}

impl Cells {
    /// `n_cells` x `n_cells` cells of `n_bins` bins.
    pub(super) fn new(region: &Region, n_cells: usize, n_bins: usize) -> Self {
        let cell_of: Vec<usize> = (0..region.side).map(|position| position * n_cells / region.side).collect();
        let mask = |block: usize, column: usize| {
            let is_in_column = |x: usize| cell_of.get(block * simd::COUNT_BLOCK + x) == Some(&column);
            std::array::from_fn(|x| if is_in_column(x) { u8::MAX } else { 0 })
        };
        let n_blocks = region.side.div_ceil(simd::COUNT_BLOCK);
        Self {
            region_side: region.side,
            n_cells,
            n_bins,
            masks: (0..n_blocks * n_cells).map(|idx| mask(idx / n_cells, idx % n_cells)).collect(),
            cell_of,
            weights: region.weights(),
            is_uniform: region.weighting == Weighting::Uniform,
            counts: vec![0; n_cells * n_cells * n_bins],
        }
    }

    /// All histograms one after the other, scaled to unit L2 length, into `row`.
    ///
    /// `codes` holds the region's pixels in rows of the window's side, and is overwritten where they do not
    /// count; `bins` maps a code to its bin. Up to [`MAX_BINS_COUNTED_APART`] bins, every code is its own.
    pub(super) fn describe(&mut self, codes: &mut [u8], bins: &[u8; 256], window: &Window, row: &mut [f32]) {
        self.counts.fill(0);
        if self.is_uniform && self.n_bins <= MAX_BINS_COUNTED_APART {
            strike_out(codes, self.region_side, window);
            self.count_bin_by_bin(codes, window);
        } else {
            self.count_pixel_by_pixel(codes, bins, window);
        }
        let square = |&count: &u32| u64::from(count) * u64::from(count);
        let length = (self.counts.iter().map(square).sum::<u64>() as f64).sqrt();
        let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
        for (value, &count) in row.iter_mut().zip(&self.counts) {
            *value = (f64::from(count) * scale) as f32;
        }
    }

    fn count_pixel_by_pixel(&mut self, codes: &[u8], bins: &[u8; 256], window: &Window) {
        let side = self.region_side;
        for (y, code_row) in codes.chunks(window.side()).take(side).enumerate() {
            for (x, &code) in code_row[..side].iter().enumerate() {
                if window.outside().is_none_or(|outside| outside[y * side + x] == 0) {
                    let cell = self.cell_of[y] * self.n_cells + self.cell_of[x];
                    let bin = usize::from(bins[usize::from(code)]);
                    self.counts[cell * self.n_bins + bin] += self.weights[y * side + x];
                }
            }
        }
    }

    /// The same where every pixel counts one, every code is its own bin, and codes beyond the bins do not
    /// count.
    fn count_bin_by_bin(&mut self, codes: &[u8], window: &Window) {
        // A region has at most 255 rows; see `Region::check`.
        for (cell_row, counts) in self.counts.chunks_mut(self.n_cells * self.n_bins).enumerate() {
            let first_row = self.cell_of.partition_point(|&cell| cell < cell_row);
            let end_row = self.cell_of.partition_point(|&cell| cell <= cell_row);
            let codes = &codes[first_row * window.side()..];
            simd::count_codes(codes, window.side(), end_row - first_row, &self.masks, self.n_bins, counts);
        }
    }
}

/// Gives the pixels that do not count the code 255, which is no bin.
fn strike_out(codes: &mut [u8], region_side: usize, window: &Window) {
    let Some(outside) = window.outside() else { return };
    for (codes, outside) in codes.chunks_mut(window.side()).zip(outside.chunks(region_side)) {
        codes.iter_mut().zip(outside).for_each(|(code, &outside)| *code |= outside);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Projection};
    use crate::describe::testing::noise;
    use crate::detect::Keypoint;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn counting_bin_by_bin_equals_counting_pixel_by_pixel(
            side in 8usize..70, n_cells in 1usize..8, n_bins in 1usize..=16, center in 4f32..100.0,
            random in prop::collection::vec(any::<u8>(), 80 * 90),
        ) {
            let region = Region { side, ..Region::default() };
            let image = noise(200, 200);
            let view = Camera::new(Projection::Perspective).view(200, 200);
            let mut window = Window::new(&region, 3);
            // In the corner, some of the window is outside.
            window.take(&image, &Keypoint::new(center, center + 5.0, 0.0), &view);
            let mut codes = window.new_codes();
            let codes = codes.as_flattened_mut();
            codes.iter_mut().zip(&random).for_each(|(code, random)| *code = random % n_bins as u8);
            let bins = std::array::from_fn(|code| code as u8);
            let (mut apart, mut plain) = (Cells::new(&region, n_cells, n_bins), Cells::new(&region, n_cells, n_bins));
            plain.count_pixel_by_pixel(codes, &bins, &window);
            strike_out(codes, side, &window);
            apart.count_bin_by_bin(codes, &window);
            prop_assert_eq!(&apart.counts, &plain.counts);
        }
    }
}
