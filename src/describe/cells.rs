//! Histograms of pattern codes over the cells of a region.

use super::region::{Region, Window};

/// A grid of cells over a region, each with a histogram of the same number of bins.
pub(super) struct Cells {
    region_side: usize,
    /// Where the histogram of each pixel's cell starts, row after row.
    histogram_start: Vec<usize>,
    weights: Vec<u32>,
    counts: Vec<u32>,
}

impl Cells {
    /// `n_cells` x `n_cells` cells of `n_bins` bins.
    pub(super) fn new(region: &Region, n_cells: usize, n_bins: usize) -> Self {
        let side = region.side;
        let cell = |position: usize| position * n_cells / side;
        let histogram_start =
            (0..side * side).map(|idx| (cell(idx / side) * n_cells + cell(idx % side)) * n_bins);
        Self {
            region_side: side,
            histogram_start: histogram_start.collect(),
            weights: region.weights(),
            counts: vec![0; n_cells * n_cells * n_bins],
        }
    }

    /// All histograms one after the other, scaled to unit L2 length, into `row`.
    ///
    /// `codes` holds the region's pixels in rows of the window's side; `bins` maps a code to its bin.
    pub(super) fn describe(&mut self, codes: &[u8], bins: &[u8; 256], window: &Window, row: &mut [f32]) {
        let side = self.region_side;
        self.counts.fill(0);
        for (y, code_row) in codes.chunks(window.side()).enumerate() {
            let starts = &self.histogram_start[y * side..][..side];
            let weights = &self.weights[y * side..][..side];
            let valid = window.validity().map(|valid| &valid[y * side..][..side]);
            for (x, (&code, (&start, &weight))) in code_row.iter().zip(starts.iter().zip(weights)).enumerate()
            {
                let counted = valid.is_none_or(|valid| valid[x]);
                self.counts[start + usize::from(bins[usize::from(code)])] += if counted { weight } else { 0 };
            }
        }
        let square = |&count: &u32| u64::from(count) * u64::from(count);
        let length = (self.counts.iter().map(square).sum::<u64>() as f64).sqrt();
        let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
        for (value, &count) in row.iter_mut().zip(&self.counts) {
            *value = (f64::from(count) * scale) as f32;
        }
    }
}
