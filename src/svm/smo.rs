//! Sequential minimal optimization for the binary C-SVC, in the formulation of LIBSVM.
//!
//! For training rows x_t with targets y_t = +1 or -1 and costs C_t, the dual problem is
//!
//! ```text
//! min over a   1/2 a'Qa - e'a     where Q_ts = y_t y_s K_ts
//! subject to   0 <= a_t <= C_t,   y'a = 0
//! ```
//!
//! (Cortes and Vapnik, "Support-Vector Networks", 1995; Chang and Lin, "LIBSVM: A Library for Support
//! Vector Machines", 2011, eq. 2.) Each step moves the two multipliers that second-order information
//! picks (Fan, Chen and Lin, "Working Set Selection Using Second Order Information for Training Support
//! Vector Machines", JMLR 2005, WSS 2), all others fixed.
//!
//! Here the signed multipliers b_t = y_t a_t are moved instead. Then the targets only appear in the
//! bounds, 0 <= b_t <= C_t or -C_t <= b_t <= 0, the constraint is that the b_t sum to zero, and the
//! negative gradient with respect to b_t is the residual r_t = y_t - sum_s K_ts b_s: what is left of
//! the target. A step adds as much to one multiplier as it takes from another. The point is optimal
//! when no multiplier that can grow has a larger residual than one that can shrink.

use super::SvmError;
use super::kernel::Kernel;

/// Stands for a curvature that is not positive, as it is for equal rows.
const TINY_CURVATURE: f64 = 1e-12;

/// The steps after which a problem counts as one that will not converge, as in LIBSVM.
const MAX_STEPS: usize = 10_000_000;

/// One binary problem over all rows of a kernel matrix.
pub(super) struct Problem<'a> {
    /// The side of each row.
    pub(super) positive: &'a [bool],
    /// The upper bound C_t of rows on the positive side.
    pub(super) c_positive: f64,
    /// The upper bound C_t of rows on the negative side.
    pub(super) c_negative: f64,
    /// The largest difference of residuals that counts as optimal.
    pub(super) tolerance: f64,
}

/// The decision value of x is the sum over t of `multipliers[t]` k(x_t, x), less `rho`.
pub(super) struct Solution {
    /// y_t a_t for each training row; zero where it is no support vector.
    pub(super) multipliers: Vec<f64>,
    /// The threshold.
    pub(super) rho: f64,
}

/// Solves `problem` over the rows of `kernel`. Deterministic.
///
/// # Errors
/// No convergence.
pub(super) fn solve(kernel: &Kernel, problem: &Problem) -> Result<Solution, SvmError> {
    let mut state = State::new(kernel, problem);
    for _ in 0..MAX_STEPS {
        let Some(grow_idx) = state.most_to_grow() else { break };
        let grow_row = kernel.row(grow_idx);
        let Some(shrink_idx) = state.best_to_shrink(grow_idx, &grow_row, problem.tolerance) else {
            return Ok(state.into_solution());
        };
        let shrink_row = kernel.row(shrink_idx);
        state.step(grow_idx, shrink_idx, &grow_row, &shrink_row);
    }
    Err(SvmError::NotConverged)
}

struct State<'k> {
    diagonal: &'k [f32],
    multipliers: Vec<f64>,
    residuals: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl<'k> State<'k> {
    /// All multipliers are zero, so that the residuals are the targets.
    fn new(kernel: &'k Kernel, problem: &Problem) -> Self {
        let sides = problem.positive.iter();
        Self {
            diagonal: kernel.diagonal(),
            multipliers: vec![0.0; problem.positive.len()],
            residuals: sides.clone().map(|&positive| if positive { 1.0 } else { -1.0 }).collect(),
            lower: sides.clone().map(|&positive| if positive { 0.0 } else { -problem.c_negative }).collect(),
            upper: sides.map(|&positive| if positive { problem.c_positive } else { 0.0 }).collect(),
        }
    }

    /// The multiplier with the largest residual of those that can grow.
    fn most_to_grow(&self) -> Option<usize> {
        let mut best = (f64::NEG_INFINITY, None);
        for (idx, &residual) in self.residuals.iter().enumerate() {
            if residual > best.0 && self.multipliers[idx] < self.upper[idx] {
                best = (residual, Some(idx));
            }
        }
        best.1
    }

    /// Of the multipliers that can shrink, the one whose step with `grow_idx` lowers the objective most;
    /// `None` at the optimum. The gain is half of gap^2 / curvature.
    fn best_to_shrink(&self, grow_idx: usize, grow_row: &[f32], tolerance: f64) -> Option<usize> {
        let top = self.residuals[grow_idx];
        let grow_diagonal = f64::from(self.diagonal[grow_idx]);
        let mut widest_gap = f64::NEG_INFINITY;
        let mut best = (0.0, None);
        for (idx, &residual) in self.residuals.iter().enumerate() {
            let gap = top - residual;
            if gap > 0.0 && self.multipliers[idx] > self.lower[idx] {
                widest_gap = widest_gap.max(gap);
                let curvature =
                    grow_diagonal + f64::from(self.diagonal[idx]) - 2.0 * f64::from(grow_row[idx]);
                let gain = gap * gap / positive_or_tiny(curvature);
                if gain > best.0 {
                    best = (gain, Some(idx));
                }
            }
        }
        best.1.filter(|_| widest_gap > tolerance)
    }

    /// Goes to the minimum along the direction, or to the first bound.
    fn step(&mut self, grow_idx: usize, shrink_idx: usize, grow_row: &[f32], shrink_row: &[f32]) {
        let curvature = f64::from(self.diagonal[grow_idx]) + f64::from(self.diagonal[shrink_idx])
            - 2.0 * f64::from(grow_row[shrink_idx]);
        let gap = self.residuals[grow_idx] - self.residuals[shrink_idx];
        let free = gap / positive_or_tiny(curvature);
        let room_above = self.upper[grow_idx] - self.multipliers[grow_idx];
        let room_below = self.multipliers[shrink_idx] - self.lower[shrink_idx];
        let length = free.min(room_above).min(room_below);
        // A step to a bound lands on it but for ties in rounding, which do no harm.
        self.multipliers[grow_idx] += length;
        self.multipliers[shrink_idx] -= length;
        for (residual, (&grow, &shrink)) in self.residuals.iter_mut().zip(grow_row.iter().zip(shrink_row)) {
            *residual -= length * (f64::from(grow) - f64::from(shrink));
        }
    }

    fn into_solution(self) -> Solution {
        let rho = -self.bias();
        Solution { multipliers: self.multipliers, rho }
    }

    /// At the optimum the residual of every multiplier strictly between its bounds is the bias: their
    /// mean. Without any the bias can be anything between two limits: their middle.
    fn bias(&self) -> f64 {
        let (mut sum, mut n_free) = (0.0, 0_u32);
        let (mut above, mut below) = (f64::NEG_INFINITY, f64::INFINITY);
        for (idx, &residual) in self.residuals.iter().enumerate() {
            let can_grow = self.multipliers[idx] < self.upper[idx];
            let can_shrink = self.multipliers[idx] > self.lower[idx];
            if can_grow && can_shrink {
                sum += residual;
                n_free += 1;
            } else if can_grow {
                above = above.max(residual);
            } else {
                below = below.min(residual);
            }
        }
        if n_free > 0 { sum / f64::from(n_free) } else { f64::midpoint(above, below) }
    }
}

fn positive_or_tiny(curvature: f64) -> f64 {
    if curvature > 0.0 { curvature } else { TINY_CURVATURE }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::Matrix;

    /// Solved by scikit-learn 1.9.1: SVC(kernel="linear", C=C, tol=1e-9).
    #[test]
    fn golden_problem_is_solved_as_by_scikit_learn() {
        let points = [0.0, 0.0, 1.0, 0.5, 0.25, 1.0, 1.5, 1.5, 2.0, 1.0, 1.0, 2.0, 0.75, 0.75, 2.5, 2.0];
        let rows = Matrix::from_vec(points.to_vec(), 2).unwrap();
        let positive = [true, true, true, true, false, false, false, false];
        let golden = [
            (0.5, -1.0, [0.0, 0.5, 0.5, 0.5, -0.5, -0.5, -0.5, 0.0]),
            (10.0, -2.428_571, [0.0, 10.0, 1.306_122, 10.0, -7.663_265, -3.642_857, -10.0, 0.0]),
        ];
        for (c, rho, multipliers) in golden {
            let problem = Problem { positive: &positive, c_positive: c, c_negative: c, tolerance: 1e-9 };
            let solution = solve(&Kernel::linear(&rows).unwrap(), &problem).unwrap();
            assert!((solution.rho - rho).abs() < 1e-5, "c {c}: {}", solution.rho);
            for (found, expected) in solution.multipliers.iter().zip(multipliers) {
                assert!((found - expected).abs() < 1e-5, "c {c}: {found} and {expected}");
            }
        }
    }

    /// With a single row a side the machine is the perpendicular bisector: w = 2 d / |d|^2.
    #[test]
    fn two_rows_of_any_scale_are_split_in_the_middle() {
        for scale in [1e-9_f32, 1.0, 1e9] {
            let rows = Matrix::from_vec(vec![3.0 * scale, -scale], 1).unwrap();
            let positive = [true, false];
            let problem =
                Problem { positive: &positive, c_positive: 1e30, c_negative: 1e30, tolerance: 1e-6 };
            let solution = solve(&Kernel::linear(&rows).unwrap(), &problem).unwrap();
            let expected = 2.0 / f64::from(4.0 * scale).powi(2);
            assert!((solution.multipliers[0] / expected - 1.0).abs() < 1e-5);
            assert!((solution.rho - 0.5).abs() < 1e-5, "scale {scale}: {}", solution.rho);
        }
    }

    #[test]
    fn equal_rows_on_both_sides_with_hardly_any_bound_are_an_error() {
        let rows = Matrix::from_vec(vec![1.0, 1.0], 1).unwrap();
        let positive = [true, false];
        let problem = Problem { positive: &positive, c_positive: 1e300, c_negative: 1e300, tolerance: 1e-3 };
        assert_eq!(solve(&Kernel::linear(&rows).unwrap(), &problem).err(), Some(SvmError::NotConverged));
    }
}
