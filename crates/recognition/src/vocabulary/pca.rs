//! Principal components: the directions in which rows vary most.

use roomsight_vision::matrix::{Covariance, Matrix};

/// Rounds of rotations; each makes what is left beside the diagonal much smaller, and ten are more than enough.
const MAX_ROUNDS: usize = 30;

/// The mean of rows and the directions round it, the one of largest variance first.
pub(crate) struct PrincipalComponents {
    pub(crate) mean: Vec<f64>,
    /// One a row, of unit length, as many as the rows have columns.
    pub(crate) directions: Vec<Vec<f64>>,
    /// Of each direction.
    pub(crate) variances: Vec<f64>,
}

impl PrincipalComponents {
    /// Of at least one row.
    pub(crate) fn of(rows: &Matrix) -> Self {
        let Covariance { mean, values } = Covariance::of(rows);
        let (variances, directions) = eigenvectors(values);
        Self { mean, directions, variances }
    }
}

/// The eigenvalues of a symmetric matrix, largest first, and their eigenvectors of unit length, one a row:
/// Jacobi's method, cyclic (Golub and Van Loan, "Matrix Computations", section 8.5). The largest number of each
/// vector is positive, so that no sign is left to chance.
fn eigenvectors(mut matrix: Vec<Vec<f64>>) -> (Vec<f64>, Vec<Vec<f64>>) {
    let n = matrix.len();
    let mut vectors: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    let size: f64 = matrix.iter().flatten().map(|value| value * value).sum();
    for _ in 0..MAX_ROUNDS {
        let beside: f64 = (0..n).flat_map(|i| matrix[i][i + 1..].iter()).map(|value| value * value).sum();
        if beside <= size * 1e-24 {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                if matrix[p][q] != 0.0 {
                    rotate(&mut matrix, &mut vectors, p, q);
                }
            }
        }
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| matrix[b][b].total_cmp(&matrix[a][a]));
    let values = order.iter().map(|&i| matrix[i][i]).collect();
    let vector = |&i: &usize| {
        let vector = std::mem::take(&mut vectors[i]);
        let largest = vector.iter().copied().fold(0.0f64, |a, b| if b.abs() > a.abs() { b } else { a });
        if largest < 0.0 { vector.into_iter().map(|value| -value).collect() } else { vector }
    };
    (values, order.iter().map(vector).collect())
}

/// Turns axes `p` < `q` so that `matrix[p][q]` becomes 0.
fn rotate(matrix: &mut [Vec<f64>], vectors: &mut [Vec<f64>], p: usize, q: usize) {
    let off = matrix[p][q];
    let theta = (matrix[q][q] - matrix[p][p]) / (2.0 * off);
    let tangent = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
    let sine = tangent * cosine;
    let turn = |rows: &mut [Vec<f64>]| {
        let (before, after) = rows.split_at_mut(q);
        for (a, b) in before[p].iter_mut().zip(after[0].iter_mut()) {
            (*a, *b) = (cosine * *a - sine * *b, sine * *a + cosine * *b);
        }
    };
    turn(matrix);
    // The matrix is symmetric: its columns are turned as its rows were.
    for row in matrix.iter_mut() {
        (row[p], row[q]) = (cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]);
    }
    turn(vectors);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn eigenvectors_are_scaled_by_the_matrix_and_stand_upright(
            n in 1usize..12, values in prop::collection::vec(-1.0f64..1.0, 144),
        ) {
            let matrix: Vec<Vec<f64>> =
                (0..n).map(|i| (0..n).map(|j| values[i.min(j) * 12 + i.max(j)]).collect()).collect();
            let (eigenvalues, vectors) = eigenvectors(matrix.clone());
            prop_assert!(eigenvalues.is_sorted_by(|a, b| a >= b));
            let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            for (i, (value, vector)) in eigenvalues.iter().zip(&vectors).enumerate() {
                for (row, number) in matrix.iter().zip(vector) {
                    prop_assert!((product(row, vector) - value * number).abs() < 1e-9);
                }
                for (j, other) in vectors.iter().enumerate() {
                    prop_assert!((product(vector, other) - f64::from(u8::from(i == j))).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn the_first_direction_is_the_longest() {
        let rows = Matrix::from_vec(vec![1.0, 1.0, 3.0, 3.0, 2.25, 1.75, 1.75, 2.25], 2).unwrap();
        let found = PrincipalComponents::of(&rows);
        assert_eq!(found.mean, [2.0, 2.0]);
        let diagonal = 0.5f64.sqrt();
        assert!(found.directions[0].iter().all(|value| (value - diagonal).abs() < 1e-6));
        assert!((found.variances[0] - 1.0).abs() < 1e-6 && (found.variances[1] - 0.0625).abs() < 1e-6);
    }
}
