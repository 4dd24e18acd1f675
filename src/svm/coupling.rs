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

const MAX_ROUNDS: usize = 1000;

const TOLERANCE: f64 = 1e-8;

/// One probability a class, summing to 1. `pairs` holds r_ij for (0, 1), (0, 2), ... (1, 2), ...
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
    let mut pairs = pairs.iter().map(|r| r.clamp(MIN_PROBABILITY, 1.0 - MIN_PROBABILITY));
    for i in 0..n_classes {
        for j in i + 1..n_classes {
            let r_ij = pairs.next().unwrap_or(0.5);
            let r_ji = 1.0 - r_ij;
            q[i][i] += r_ji * r_ji;
            q[j][j] += r_ij * r_ij;
            q[i][j] = -r_ji * r_ij;
            q[j][i] = q[i][j];
        }
    }
    q
}

fn inner(left: &[f64], right: &[f64]) -> f64 {
    left.iter().zip(right).map(|(l, r)| l * r).sum()
}
