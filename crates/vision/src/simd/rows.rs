//! Vectors in fixed point.

use super::dispatch;
use crate::matrix::Matrix;

/// One in the fixed-point numbers: the products of vectors of unit length then fit 32 bits.
pub const ONE: f32 = 16_384.0;

/// How far rounding to fixed point moves a number, at most.
pub const ROUNDING: f32 = 0.5 / ONE;

/// The fixed-point product that stands for one.
pub const ONE_PRODUCT: i32 = 1 << 28;

/// Numbers that are rounded at once.
const BLOCK: usize = 16;

/// Vectors of at most unit length, rounded to the nearest fixed-point numbers, halves away from zero. Numbers lie two by two,
/// as they are multiplied; a row of odd length ends with a zero.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct UnitRows {
    pub(super) pairs: Vec<[i16; 2]>,
    pub(super) n_pairs_a_row: usize,
}

impl UnitRows {
    /// The rows of `matrix`, none of which is longer than 1.
    pub fn new(matrix: &Matrix) -> Self {
        Self::from_slice(matrix.as_slice(), matrix.n_cols())
    }

    /// Rows of `n_cols` numbers that lie one after the other in `values`, none of which is longer than 1.
    pub fn from_slice(values: &[f32], n_cols: usize) -> Self {
        let n_pairs_a_row = n_cols.div_ceil(2);
        let n_rows = values.len().checked_div(n_cols).unwrap_or(0);
        let mut pairs = vec![[0; 2]; n_rows * n_pairs_a_row];
        round_rows(values, n_cols, pairs.as_flattened_mut());
        Self { pairs, n_pairs_a_row }
    }

    /// No rows, which will be as wide as these.
    pub fn none(&self) -> Self {
        Self { pairs: Vec::new(), n_pairs_a_row: self.n_pairs_a_row }
    }

    /// Appends a row of fixed-point numbers, two by two.
    ///
    /// # Panics
    /// When it is of another width.
    pub fn push(&mut self, row: &[[i16; 2]]) {
        assert_eq!(row.len(), self.n_pairs_a_row, "a row of another width");
        self.pairs.extend_from_slice(row);
    }

    /// The number of rows.
    #[inline]
    pub fn n_rows(&self) -> usize {
        self.pairs.len().checked_div(self.n_pairs_a_row).unwrap_or(0)
    }

    /// A row, two numbers by two numbers.
    ///
    /// # Panics
    /// When there is no such row.
    #[inline]
    pub fn row(&self, row_idx: usize) -> &[[i16; 2]] {
        &self.pairs[row_idx * self.n_pairs_a_row..][..self.n_pairs_a_row]
    }

    /// All rows in order.
    #[inline]
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[[i16; 2]]> {
        self.pairs.chunks_exact(self.n_pairs_a_row.max(1))
    }

    /// The squared length of each row, in fixed point.
    pub fn squared_lengths(&self) -> Vec<i32> {
        self.rows().map(|row| product_of_rows(row, row)).collect()
    }
}

dispatch! {
    /// Rounds rows of `n_cols` values to fixed point, each into a row of an even number of `numbers`.
    round_rows, round_rows_kernel, (values: &[f32], n_cols: usize, numbers: &mut [i16])
}

#[inline(always)]
fn round_rows_kernel(values: &[f32], n_cols: usize, numbers: &mut [i16]) {
    if n_cols.is_multiple_of(2) {
        return round_row(values, numbers);
    }
    for (row, numbers) in values.chunks_exact(n_cols).zip(numbers.chunks_exact_mut(n_cols + 1)) {
        round_row(row, numbers);
    }
}

#[inline(always)]
fn round_row(values: &[f32], numbers: &mut [i16]) {
    let n = values.len().min(numbers.len());
    let (values, rest) = values[..n].as_chunks::<BLOCK>();
    let (numbers, of_rest) = numbers[..n].as_chunks_mut::<BLOCK>();
    for (values, numbers) in values.iter().zip(numbers) {
        for lane in 0..BLOCK {
            numbers[lane] = fixed(values[lane]);
        }
    }
    of_rest.iter_mut().zip(rest).for_each(|(number, &value)| *number = fixed(value));
}

/// The nearest fixed-point number, halves away from zero; the last one beyond the range, 0 for what is no number.
#[inline(always)]
pub(super) fn fixed(value: f32) -> i16 {
    let sum = value * ONE + 0.5f32.copysign(value);
    let (least, most) = (f32::from(i16::MIN), f32::from(i16::MAX));
    // Comparisons that vectors have instructions for, which a conversion that saturates has not.
    let sum = if sum > least { sum } else { least };
    let sum = if sum < most { sum } else { most };
    // SAFETY: within the range, as what is no number is not larger than the least.
    let number = unsafe { sum.to_int_unchecked::<i32>() };
    let is_number = i32::from(!value.is_nan()).wrapping_neg();
    (number & is_number) as i16
}

/// The product of two pairs. Vectors that are too long give wrong distances, but no overflow.
#[inline(always)]
pub(super) fn product(a: [i16; 2], b: [i16; 2]) -> i32 {
    (i32::from(a[0]) * i32::from(b[0])).wrapping_add(i32::from(a[1]) * i32::from(b[1]))
}

/// The product of two rows, of which the same holds.
#[inline(always)]
pub(super) fn product_of_rows(a: &[[i16; 2]], b: &[[i16; 2]]) -> i32 {
    let numbers = a.as_flattened().iter().zip(b.as_flattened());
    numbers.fold(0i32, |sum, (&a, &b)| sum.wrapping_add(i32::from(a) * i32::from(b)))
}

#[cfg(test)]
mod tests;
