//! The nearest of a few vectors.

use crate::simd::dispatch;
use crate::simd::rows::{UnitRows, product_of_rows};

/// One of many vectors, and how near it is: 2 row . vector - |vector|^2 in fixed point, larger where nearer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Nearness {
    /// Its index.
    pub idx: u32,
    /// In units of 2^-28.
    pub score: i32,
}

/// Vectors of at most unit length with their squared lengths.
#[derive(Clone, Debug)]
pub struct MeasuredRows {
    rows: UnitRows,
    squared_lengths: Vec<i32>,
}

impl MeasuredRows {
    /// Measures rows.
    pub fn new(rows: UnitRows) -> Self {
        let squared_lengths = rows.squared_lengths();
        Self { rows, squared_lengths }
    }

    /// The number of rows.
    pub fn n_rows(&self) -> usize {
        self.squared_lengths.len()
    }

    /// The one of these that is nearest to a row, as [`super::nearest_columns`] has it, ties to the smallest index; index
    /// `u32::MAX` without any.
    ///
    /// # Panics
    /// When there are no such rows, or they are not as wide.
    pub fn nearest_among(&self, rows: &UnitRows, row_idx: usize, candidates: &[u32]) -> Nearness {
        assert_eq!(rows.n_pairs_a_row, self.rows.n_pairs_a_row, "rows of another width");
        let mut nearest = Nearness { idx: u32::MAX, score: i32::MIN };
        nearest_among(self, rows.row(row_idx), candidates, &mut nearest);
        nearest
    }
}

dispatch! {
    nearest_among, nearest_among_kernel,
    (all: &MeasuredRows, row: &[[i16; 2]], candidates: &[u32], nearest: &mut Nearness)
}

#[inline(always)]
fn nearest_among_kernel(all: &MeasuredRows, row: &[[i16; 2]], candidates: &[u32], nearest: &mut Nearness) {
    for &idx in candidates {
        let product = product_of_rows(row, all.rows.row(idx as usize));
        let score = product.wrapping_mul(2).wrapping_sub(all.squared_lengths[idx as usize]);
        if score > nearest.score || (score == nearest.score && idx < nearest.idx) {
            *nearest = Nearness { idx, score };
        }
    }
}
