//! From probabilities of pairs of classes to one probability a class.
//!
//! Wu, Lin and Weng, "Probability Estimates for Multi-class Classification by Pairwise Coupling", JMLR
//! 2004, the second method: with r_ij the probability of i among i and j, find
//!
//! ```text
//! min over p   sum over i and j != i of (r_ji p_i - r_ij p_j)^2     subject to   sum of p = 1
//! ```
//!
//! which is p'Qp with Q_ii = sum over j != i of r_ji^2 and Q_ij = -r_ji r_ij. Algorithm 2 of the paper,
//! as in LIBSVM but to a smaller tolerance, solves it one class at a time.

/// Pairs are kept this far from certain, as in LIBSVM: Q stays regular.
const MIN_PROBABILITY: f64 = 1e-7;

/// About ten are enough for any input.
const MAX_ROUNDS: usize = 100;

/// How far from optimal is good enough, for each class.
const TOLERANCE: f64 = 1e-8;

/// All pairs of classes, in the order (0, 1), (0, 2), ... (1, 2), ...
pub(super) fn class_pairs(n_classes: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n_classes).flat_map(move |i| (i + 1..n_classes).map(move |j| (i, j)))
}

/// One probability a class, summing to 1. `pairs` holds r_ij in the order of [`class_pairs`].
pub(super) fn couple(pairs: &[f64], n_classes: usize) -> Vec<f64> {
    let q = objective(pairs, n_classes);
    let mut p = vec![1.0 / n_classes as f64; n_classes];
    for _ in 0..MAX_ROUNDS {
        let mut qp: Vec<f64> = q.iter().map(|row| inner(row, &p)).collect();
        let mut pqp = inner(&p, &qp);
        let worst = qp.iter().map(|value| (value - pqp).abs()).fold(0.0, f64::max);
        if worst < TOLERANCE / n_classes as f64 {
            break;
        }
        for t in 0..n_classes {
            let change = (pqp - qp[t]) / q[t][t];
            let scale = 1.0 + change;
            p[t] += change;
            pqp = (pqp + change * (change * q[t][t] + 2.0 * qp[t])) / (scale * scale);
            for i in 0..n_classes {
                qp[i] = (qp[i] + change * q[t][i]) / scale;
                p[i] /= scale;
            }
        }
    }
    p
}

/// The matrix Q.
fn objective(pairs: &[f64], n_classes: usize) -> Vec<Vec<f64>> {
    let mut q = vec![vec![0.0; n_classes]; n_classes];
    for ((i, j), r) in class_pairs(n_classes).zip(pairs) {
        let r_ij = r.clamp(MIN_PROBABILITY, 1.0 - MIN_PROBABILITY);
        let r_ji = 1.0 - r_ij;
        q[i][i] += r_ji * r_ji;
        q[j][j] += r_ij * r_ij;
        q[i][j] = -r_ji * r_ij;
        q[j][i] = q[i][j];
    }
    q
}

fn inner(left: &[f64], right: &[f64]) -> f64 {
    left.iter().zip(right).map(|(l, r)| l * r).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Solves Qp + b e = 0, e'p = 1 by Gauss-Jordan elimination (eq. 21 of the paper).
    fn naive(pairs: &[f64], n_classes: usize) -> Vec<f64> {
        let n = n_classes + 1;
        let mut system = vec![vec![1.0; n + 1]; n];
        for (i, row) in objective(pairs, n_classes).iter().enumerate() {
            system[i][..n_classes].copy_from_slice(row);
            system[i][n] = 0.0;
        }
        system[n_classes][n_classes] = 0.0;
        for column in 0..n {
            let pivot =
                (column..n).max_by(|&i, &j| system[i][column].abs().total_cmp(&system[j][column].abs()));
            system.swap(column, pivot.unwrap());
            let pivot_row = system[column].clone();
            for row in (0..n).filter(|&row| row != column) {
                let factor = system[row][column] / pivot_row[column];
                for (value, pivot) in system[row].iter_mut().zip(&pivot_row) {
                    *value -= factor * pivot;
                }
            }
        }
        (0..n_classes).map(|i| system[i][n] / system[i][i]).collect()
    }

    fn pairs() -> impl Strategy<Value = (usize, Vec<f64>)> {
        (2_usize..9)
            .prop_flat_map(|n| (Just(n), proptest::collection::vec(0.001_f64..0.999, n * (n - 1) / 2)))
    }

    proptest! {
        #[test]
        fn coupling_solves_the_linear_system((n_classes, pairs) in pairs()) {
            let p = couple(&pairs, n_classes);
            for (value, expected) in p.iter().zip(naive(&pairs, n_classes)) {
                prop_assert!((value - expected).abs() < 1e-5, "{} and {}", value, expected);
            }
        }

        #[test]
        fn coupling_is_near_libsvm((n_classes, pairs) in pairs()) {
            let mut r = vec![vec![0.0; n_classes]; n_classes];
            for ((i, j), &r_ij) in class_pairs(n_classes).zip(&pairs) {
                r[i][j] = r_ij;
                r[j][i] = 1.0 - r_ij;
            }
            let mut theirs = vec![0.0; n_classes];
            libsvm_rs::probability::multiclass_probability(n_classes, &r, &mut theirs);
            for (value, expected) in couple(&pairs, n_classes).iter().zip(theirs) {
                prop_assert!((value - expected).abs() < 0.02, "{} and {}", value, expected);
            }
        }
    }

    #[test]
    fn two_classes_keep_their_probability() {
        for r in [0.0001, 0.3, 0.5, 0.9] {
            assert!((couple(&[r], 2)[0] - r).abs() < 1e-6);
        }
    }
}
