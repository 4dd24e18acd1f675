//! Training rows that a model keeps, so that machines over them can be trained anew when frames come or go.

use crate::file::arrays::{Array, Arrays, require};
use crate::file::error::FormatError;
use crate::opinions::error::AddError;
use crate::opinions::{Added, Left, Near, Shape};
use roomsight_vision::matrix::Matrix;

/// One row a frame, in whole numbers of a 127th of the row's largest magnitude: a quarter of the space, and far below
/// the noise of what is counted or seen.
#[derive(Clone, Debug, Default)]
pub(crate) struct KeptRows {
    n_cols: usize,
    values: Vec<i8>,
    /// One a row: what a value of 1 stands for.
    units: Vec<f32>,
    /// The length of each row, in its unit.
    lengths: Vec<f32>,
}

const LARGEST: f32 = 127.0;

impl KeptRows {
    pub(crate) fn new(rows: &Matrix) -> Self {
        let mut kept = Self { n_cols: rows.n_cols(), ..Self::default() };
        rows.rows().for_each(|row| kept.push(row));
        kept
    }

    fn push(&mut self, row: &[f32]) {
        let (values, unit) = rounded(row);
        self.push_values(&values, unit);
    }

    fn push_values(&mut self, values: &[i8], unit: f32) {
        self.values.extend(values);
        self.units.push(unit);
        self.lengths.push((product(values, values) as f32).sqrt());
    }

    /// The largest cosine between a row of as many numbers and one that is kept, -1 without any.
    pub(crate) fn nearest_cosine(&self, row: &[f32]) -> f32 {
        self.cosines(row).fold(-1.0, f32::max)
    }

    /// The rows of the largest cosines, of which the first is [`KeptRows::nearest_cosine`].
    pub(crate) fn nearest(&self, row: &[f32], n_rows: usize) -> Vec<Near> {
        let near = |(frame_idx, nearness)| Near { frame_idx, nearness, points: Vec::new() };
        let mut nearest: Vec<Near> = self.cosines(row).enumerate().map(near).collect();
        nearest.sort_by(|a, b| b.nearness.total_cmp(&a.nearness));
        nearest.truncate(n_rows);
        nearest
    }

    /// The cosines between a row of as many numbers and those that are kept.
    fn cosines(&self, row: &[f32]) -> impl Iterator<Item = f32> {
        // In whole numbers, since the compiler then multiplies many at once.
        let (row, _) = rounded(row);
        let of_row = (product(&row, &row) as f32).sqrt();
        let cosine = move |(values, of_kept): (&[i8], &f32)| {
            product(values, &row) as f32 / (of_kept * of_row).max(f32::MIN_POSITIVE)
        };
        let rows = self.values.chunks_exact(self.n_cols.max(1)).zip(&self.lengths);
        rows.map(cosine)
    }

    pub(crate) fn n_rows(&self) -> usize {
        self.units.len()
    }

    /// Whether there are any, without which machines cannot go on.
    pub(crate) fn check(&self) -> Result<(), AddError> {
        if self.n_rows() == 0 { Err(AddError::NothingKept) } else { Ok(()) }
    }

    /// The rows as they were, but for rounding.
    pub(crate) fn rows(&self) -> Matrix {
        let mut rows = Matrix::new(self.n_cols);
        for (values, unit) in self.values.chunks_exact(self.n_cols.max(1)).zip(&self.units) {
            rows.push_row(&Vec::from_iter(values.iter().map(|&value| f32::from(value) * unit)));
        }
        rows
    }

    /// With those of frames that are learned in addition; `None` where not all of before were kept.
    pub(crate) fn with(&self, rows: &Matrix, added: &Added) -> Option<Self> {
        let mut kept = self.clone();
        rows.rows().for_each(|row| kept.push(row));
        (self.n_rows() > 0 && kept.n_rows() == added.labels.len()).then_some(kept)
    }

    /// Those of frames that are left; `None` where not all were kept.
    pub(crate) fn left(&self, left: &Left) -> Option<Self> {
        if self.n_rows() == 0 || self.n_rows() != left.is_left.len() {
            return None;
        }
        let mut kept = Self { n_cols: self.n_cols, ..Self::default() };
        let rows = self.values.chunks_exact(self.n_cols.max(1)).zip(&self.units);
        for ((values, unit), _) in rows.zip(left.is_left).filter(|(_, is_left)| **is_left) {
            kept.push_values(values, *unit);
        }
        Some(kept)
    }

    pub(crate) fn to_arrays(&self) -> Vec<Array> {
        if self.n_rows() == 0 {
            return Vec::new();
        }
        vec![
            Array::bytes("kept.values", [self.n_rows(), self.n_cols], &self.values),
            Array::vector("kept.units", &self.units),
        ]
    }

    /// Rows of unknown origin, of frames of so many numbers; none where the file holds none.
    pub(crate) fn from_arrays(n_cols: usize, shape: Shape, arrays: &Arrays) -> Result<Self, FormatError> {
        if !arrays.has("kept.values") {
            return Ok(Self { n_cols, ..Self::default() });
        }
        let ([n_rows, width], values) = arrays.bytes("kept.values")?;
        let units = arrays.vector("kept.units")?;
        require(width == n_cols, "its kept rows fit no machine")?;
        require(n_rows == units.len() && n_rows == shape.n_frames, "its kept rows are not one a frame")?;
        let are_units = units.iter().all(|unit| unit.is_finite() && (0.0..1e9).contains(unit));
        require(are_units, "its kept rows are not finite")?;
        let mut kept = Self { n_cols, ..Self::default() };
        for (row, unit) in values.chunks_exact(n_cols.max(1)).zip(units) {
            kept.push_values(row, unit);
        }
        Ok(kept)
    }
}

/// A row in whole numbers, and what 1 stands for.
fn rounded(row: &[f32]) -> (Vec<i8>, f32) {
    let largest = row.iter().fold(0.0_f32, |largest, value| largest.max(value.abs()));
    let unit = if largest > 0.0 { largest / LARGEST } else { 1.0 };
    (row.iter().map(|value| (value / unit).round() as i8).collect(), unit)
}

/// The sum of the products.
fn product(a: &[i8], b: &[i8]) -> i64 {
    /// So many products fit into 32 bits.
    const CHUNK: usize = 1 << 16;
    let of_chunk = |(a, b): (&[i8], &[i8])| {
        i64::from(a.iter().zip(b).map(|(&a, &b)| i32::from(a) * i32::from(b)).sum::<i32>())
    };
    a.chunks(CHUNK).zip(b.chunks(CHUNK)).map(of_chunk).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rows_come_back_but_for_rounding(values in prop::collection::vec(-3.0_f32..3.0, 12)) {
            let rows = Matrix::from_vec(values, 4).unwrap();
            let back = KeptRows::new(&rows).rows();
            for (row, back) in rows.rows().zip(back.rows()) {
                let largest = row.iter().fold(0.0_f32, |largest, value| largest.max(value.abs()));
                prop_assert!(row.iter().zip(back).all(|(a, b)| (a - b).abs() <= largest / 250.0));
            }
        }
    }

    #[test]
    fn the_nearest_row_is_the_one_of_the_same_direction() {
        let kept = KeptRows::new(&Matrix::from_vec(vec![1.0, 0.0, 3.0, 4.0], 2).unwrap());
        assert!((kept.nearest_cosine(&[6.0, 8.0]) - 1.0).abs() < 1e-4);
        assert!(kept.nearest_cosine(&[0.0, -1.0]).abs() < 1e-4);
        let nearest = kept.nearest(&[6.0, 8.0], 5);
        assert_eq!((nearest.len(), nearest[0].frame_idx, nearest[1].frame_idx), (2, 1, 0));
        assert_eq!(nearest[0].nearness, kept.nearest_cosine(&[6.0, 8.0]));
        assert!((kept.nearest_cosine(&[0.1, -0.01]) - 0.995).abs() < 0.01);
        assert_eq!(kept.nearest_cosine(&[0.0, 0.0]), 0.0);
        // More than 32 bits hold.
        let long = vec![1.0; 1 << 18];
        let kept_long = KeptRows::new(&Matrix::from_vec(long.clone(), long.len()).unwrap());
        assert!((kept_long.nearest_cosine(&long) - 1.0).abs() < 1e-4);
        assert_eq!(KeptRows::default().nearest_cosine(&[1.0]), -1.0);
    }

    #[test]
    fn rows_join_and_leave_in_step_with_their_frames() {
        let rows = Matrix::from_vec(vec![0.0, 0.0, 1.0, 0.5], 2).unwrap();
        let kept = KeptRows::new(&rows);
        assert_eq!(kept.rows().row(0), [0.0, 0.0]);
        let added = |labels| Added { frames: &[], labels, n_rooms: 2, of_earlier: &[0, 1], forget: 0.0 };
        assert!(kept.with(&rows, &added(&[0, 1, 0])).is_none());
        let more = kept.with(&rows, &added(&[0, 1, 0, 1])).unwrap();
        let left = Left { is_left: &[false, true, false, false], labels: &[0], n_rooms: 1 };
        let last = more.left(&left).unwrap();
        assert_eq!(last.n_rows(), 1);
        assert!((last.rows().row(0)[1] - 0.5).abs() < 0.01);
        assert!(kept.left(&left).is_none());
    }
}
