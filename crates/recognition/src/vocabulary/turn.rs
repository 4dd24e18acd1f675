//! Vectors turned so that their first numbers differ most.

use super::pca::PrincipalComponents;
use rayon::prelude::*;
use roomsight_vision::matrix::Matrix;
use roomsight_vision::simd::{self, LinearMap, UnitRows};

/// Rows that tell well enough in which directions all differ.
const N_SAMPLED: usize = 2048;

/// Rows that one thread turns at a time.
const BLOCK_ROWS: usize = 2048;

/// A turn round the origin to the principal axes of some rows. Distances stay what they are, but for rounding.
pub(super) struct Turn {
    there: LinearMap,
    back: LinearMap,
    width: usize,
}

impl Turn {
    /// The turn to the axes of these rows.
    pub(super) fn of(rows: &Matrix) -> Self {
        let width = rows.n_cols();
        let mut sample = Matrix::new(width);
        rows.rows().step_by(rows.n_rows().div_ceil(N_SAMPLED).max(1)).for_each(|row| sample.push_row(row));
        let directions = PrincipalComponents::of(&sample).directions;
        let map = |weight: &dyn Fn(usize, usize) -> f64| {
            let weights: Vec<f32> =
                (0..width * width).map(|idx| weight(idx / width, idx % width) as f32).collect();
            LinearMap::new(&weights, &vec![0.0; width], width)
        };
        Self {
            there: map(&|to, from| directions[to][from]),
            back: map(&|to, from| directions[from][to]),
            width,
        }
    }

    /// The rows, none of which is longer than 1, turned and in fixed point.
    pub(super) fn there(&self, rows: &Matrix) -> UnitRows {
        let turn = |rows: &[f32]| self.there.apply(rows);
        let blocks: Vec<Vec<f32>> =
            rows.as_slice().par_chunks(BLOCK_ROWS * self.width.max(1)).map(turn).collect();
        UnitRows::from_slice(&blocks.concat(), self.width)
    }

    /// Turned rows as they lay before.
    pub(super) fn back(&self, rows: &UnitRows) -> Matrix {
        let mut back = Matrix::new(self.width);
        for row in rows.rows() {
            let row = row.as_flattened().iter().take(self.width);
            let row: Vec<f32> = row.map(|&number| f32::from(number) / simd::ONE).collect();
            back.push_row(&self.back.apply(&row));
        }
        back
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rows_come_back_and_their_distances_stay(
            width in 1usize..20, values in prop::collection::vec(-0.2f32..0.2, 200),
        ) {
            let rows = Matrix::from_vec(values[..200 / width * width].to_vec(), width).unwrap();
            let turn = Turn::of(&rows);
            let back = turn.back(&turn.there(&rows));
            for (value, back) in rows.as_slice().iter().zip(back.as_slice()) {
                prop_assert!((value - back).abs() < 3e-4, "{value} {back}");
            }
        }
    }
}
