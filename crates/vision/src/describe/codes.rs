//! The codes that pixels get from their neighbors.

use super::circle::NeighborCircle;
use crate::simd;

/// How the pixels of a picture get their codes.
pub(super) struct Codes {
    /// Of neighbors, each a bit of a code.
    pub(super) n_pairs: usize,
    /// In 1/256 of a gray value.
    pub(super) threshold: u16,
    pub(super) circle: NeighborCircle,
    /// How many pixels beyond those that get a code are read.
    pub(super) margin: usize,
}

impl Codes {
    /// The codes of the pixels that lie the margin away from the border of `pixels`, rows of `stride`.
    pub(super) fn write(&self, pixels: &[u8], stride: usize, codes: &mut [[u8; simd::CODE_BLOCK]]) {
        codes.as_flattened_mut().fill(0);
        for pair in 0..self.n_pairs {
            let neighbors = self.circle.neighbors_in(pair, pixels, stride);
            let opposite = self.circle.neighbors_in(pair + self.n_pairs, pixels, stride);
            simd::mark_brighter(neighbors, opposite, self.threshold, 1 << pair, codes);
        }
    }
}
