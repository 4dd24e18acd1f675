//! The directions in which vectors differ most.

use crate::matrix::{Covariance, Matrix};

/// Rounds of powers. Directions that are not quite the main ones cost comparisons, never an answer.
const N_ROUNDS: usize = 8;

/// About the `n_directions` directions of largest variance of the rows, of unit length and at right angles, one after
/// the other: orthogonal iteration (Golub and Van Loan, "Matrix Computations", section 8.2.4).
pub(super) fn main_directions(rows: &Matrix, n_directions: usize) -> Vec<f32> {
    let width = rows.n_cols();
    let covariance = Covariance::of(rows).values;
    let start = |direction: usize| (0..width).map(|idx| f64::from(u8::from(idx == direction))).collect();
    let mut directions: Vec<Vec<f64>> = (0..n_directions).map(start).collect();
    for _ in 0..N_ROUNDS {
        for direction in &mut directions {
            *direction = covariance.iter().map(|row| product(row, direction)).collect();
        }
        straighten(&mut directions);
    }
    directions.concat().into_iter().map(|value| value as f32).collect()
}

/// Makes vectors of unit length and at right angles to each other (Gram and Schmidt, twice); those that lie in the span of others
/// become zeros.
fn straighten(vectors: &mut [Vec<f64>]) {
    for idx in 0..vectors.len() {
        let (before, rest) = vectors.split_at_mut(idx);
        let vector = &mut rest[0];
        let size = product(vector, vector).sqrt();
        for _ in 0..2 {
            for other in before.iter() {
                let along = product(vector, other);
                vector.iter_mut().zip(other).for_each(|(value, other)| *value -= along * other);
            }
        }
        let length = product(vector, vector).sqrt();
        let is_new = length > size * 1e-9;
        vector.iter_mut().for_each(|value| *value = if is_new { *value / length } else { 0.0 });
    }
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
