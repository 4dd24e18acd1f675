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

/// The most steps between two looks for rows to leave out, as in LIBSVM.
const MAX_SHRINK_PERIOD: usize = 1000;

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
    /// Whether to leave rows out of sight that seem settled at a bound. The solution is as good.
    pub(super) shrinking: bool,
}

/// The decision value of x is the sum over t of `multipliers[t]` k(x_t, x), less `rho`.
pub(super) struct Solution {
    /// y_t a_t for each training row; zero where it is no support vector.
    pub(super) multipliers: Vec<f64>,
    /// The threshold.
    pub(super) rho: f64,
}

impl Solution {
    /// The rows with a multiplier other than zero, in order.
    pub(super) fn support_idxs(&self) -> impl Iterator<Item = usize> {
        (0..self.multipliers.len()).filter(|&row_idx| self.multipliers[row_idx] != 0.0)
    }
}

/// Solves `problem` over the rows of `kernel`. Deterministic.
///
/// # Errors
/// No convergence.
pub(super) fn solve(kernel: &Kernel, problem: &Problem) -> Result<Solution, SvmError> {
    let mut state = State::new(kernel, problem);
    let n_rows = problem.positive.len();
    let shrink_period = n_rows.min(MAX_SHRINK_PERIOD);
    let mut next_shrink = shrink_period;
    for step_idx in 0..MAX_STEPS {
        if problem.shrinking && step_idx == next_shrink {
            state.shrink(problem.tolerance);
            next_shrink += shrink_period;
        }
        if let Some((grow_idx, shrink_idx)) = state.pair(problem.tolerance) {
            state.step(grow_idx, shrink_idx);
        } else if state.active.len() < n_rows {
            state.activate_all();
            // All rows are looked at for one step, or found optimal.
            next_shrink = step_idx + 2;
        } else if state.residuals.iter().all(|residual| residual.is_finite()) {
            return Ok(state.into_solution());
        } else {
            break;
        }
    }
    Err(SvmError::NotConverged)
}

struct State<'k> {
    kernel: &'k Kernel<'k>,
    multipliers: Vec<f64>,
    /// Only those of active rows are kept up to date.
    residuals: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// The rows that are looked at, in order.
    active: Vec<usize>,
    /// Whether all rows were made active once near the end, where wrongly settled ones would cost most.
    is_near_end: bool,
}

impl<'k> State<'k> {
    /// All multipliers are zero, so that the residuals are the targets.
    fn new(kernel: &'k Kernel, problem: &Problem) -> Self {
        let sides = problem.positive.iter();
        Self {
            kernel,
            multipliers: vec![0.0; problem.positive.len()],
            residuals: sides.clone().map(|&positive| target(positive)).collect(),
            lower: sides.clone().map(|&positive| if positive { 0.0 } else { -problem.c_negative }).collect(),
            upper: sides.map(|&positive| if positive { problem.c_positive } else { 0.0 }).collect(),
            active: (0..problem.positive.len()).collect(),
            is_near_end: false,
        }
    }

    fn can_grow(&self, idx: usize) -> bool {
        self.multipliers[idx] < self.upper[idx]
    }

    fn can_shrink(&self, idx: usize) -> bool {
        self.multipliers[idx] > self.lower[idx]
    }

    /// The next multiplier to grow and the one to shrink; `None` at the optimum of the active rows.
    fn pair(&self, tolerance: f64) -> Option<(usize, usize)> {
        let grow_idx = self.most_to_grow()?;
        Some((grow_idx, self.best_to_shrink(grow_idx, tolerance)?))
    }

    /// The multiplier with the largest residual of those that can grow.
    fn most_to_grow(&self) -> Option<usize> {
        let mut best = (f64::NEG_INFINITY, None);
        for &idx in &self.active {
            if self.residuals[idx] > best.0 && self.can_grow(idx) {
                best = (self.residuals[idx], Some(idx));
            }
        }
        best.1
    }

    /// Of the multipliers that can shrink, the one whose step with `grow_idx` lowers the objective most;
    /// `None` at the optimum. The gain is half of gap^2 / curvature.
    fn best_to_shrink(&self, grow_idx: usize, tolerance: f64) -> Option<usize> {
        let grow_row = self.kernel.row(grow_idx);
        let diagonal = self.kernel.diagonal();
        let top = self.residuals[grow_idx];
        let grow_diagonal = f64::from(diagonal[grow_idx]);
        let mut widest_gap = f64::NEG_INFINITY;
        let mut best = (0.0, None);
        for &idx in &self.active {
            let gap = top - self.residuals[idx];
            if gap > 0.0 && self.can_shrink(idx) {
                widest_gap = widest_gap.max(gap);
                let curvature = grow_diagonal + f64::from(diagonal[idx]) - 2.0 * f64::from(grow_row[idx]);
                let gain = gap * gap / positive_or_tiny(curvature);
                if gain > best.0 {
                    best = (gain, Some(idx));
                }
            }
        }
        best.1.filter(|_| widest_gap > tolerance)
    }

    /// Goes to the minimum along the direction, or to the first bound.
    fn step(&mut self, grow_idx: usize, shrink_idx: usize) {
        let (grow_row, shrink_row) = (self.kernel.row(grow_idx), self.kernel.row(shrink_idx));
        let diagonal = self.kernel.diagonal();
        let curvature = f64::from(diagonal[grow_idx]) + f64::from(diagonal[shrink_idx])
            - 2.0 * f64::from(grow_row[shrink_idx]);
        let gap = self.residuals[grow_idx] - self.residuals[shrink_idx];
        let free = gap / positive_or_tiny(curvature);
        let room_above = self.upper[grow_idx] - self.multipliers[grow_idx];
        let room_below = self.multipliers[shrink_idx] - self.lower[shrink_idx];
        let length = free.min(room_above).min(room_below);
        // A step to a bound lands on it but for ties in rounding, which do no harm.
        self.multipliers[grow_idx] += length;
        self.multipliers[shrink_idx] -= length;
        for &idx in &self.active {
            self.residuals[idx] -= length * (f64::from(grow_row[idx]) - f64::from(shrink_row[idx]));
        }
    }

    /// Leaves out the rows at a bound that they are pressed against harder than any active row calls for
    /// (Chang and Lin, section 5.1); once, when the optimum is near, takes all back in first.
    fn shrink(&mut self, tolerance: f64) {
        let (top, bottom) = self.limits();
        if !self.is_near_end && top - bottom <= 10.0 * tolerance {
            self.is_near_end = true;
            self.activate_all();
        }
        let (top, bottom) = self.limits();
        let mut active = std::mem::take(&mut self.active);
        active.retain(|&idx| match (self.can_grow(idx), self.can_shrink(idx)) {
            (true, false) => self.residuals[idx] >= bottom,
            (false, true) => self.residuals[idx] <= top,
            _ => true,
        });
        self.active = active;
    }

    /// The largest residual of the active multipliers that can grow, and the smallest of those that can
    /// shrink.
    fn limits(&self) -> (f64, f64) {
        self.active.iter().fold((f64::NEG_INFINITY, f64::INFINITY), |(top, bottom), &idx| {
            let residual = self.residuals[idx];
            (
                if self.can_grow(idx) { top.max(residual) } else { top },
                if self.can_shrink(idx) { bottom.min(residual) } else { bottom },
            )
        })
    }

    /// Looks at all rows again, and computes the residuals of those that were left out.
    fn activate_all(&mut self) {
        let mut is_active = vec![false; self.multipliers.len()];
        self.active.iter().for_each(|&idx| is_active[idx] = true);
        let inactive: Vec<usize> = (0..is_active.len()).filter(|&idx| !is_active[idx]).collect();
        for &idx in &inactive {
            // Rows on the positive side are those whose multiplier may be above zero.
            self.residuals[idx] = target(self.upper[idx] > 0.0);
        }
        for (support_idx, &multiplier) in self.multipliers.iter().enumerate() {
            if multiplier != 0.0 {
                let row = self.kernel.row(support_idx);
                for &idx in &inactive {
                    self.residuals[idx] -= multiplier * f64::from(row[idx]);
                }
            }
        }
        self.active = (0..is_active.len()).collect();
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
            match (self.can_grow(idx), self.can_shrink(idx)) {
                (true, true) => {
                    sum += residual;
                    n_free += 1;
                }
                (true, false) => above = above.max(residual),
                _ => below = below.min(residual),
            }
        }
        if n_free > 0 { sum / f64::from(n_free) } else { f64::midpoint(above, below) }
    }
}

fn target(positive: bool) -> f64 {
    if positive { 1.0 } else { -1.0 }
}

fn positive_or_tiny(curvature: f64) -> f64 {
    if curvature > 0.0 { curvature } else { TINY_CURVATURE }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classify::svm::KernelFunction;
    use crate::classify::svm::tests::{Set, bags, with_duplicates};
    use proptest::prelude::*;
    use roomsight_vision::matrix::Matrix;

    proptest! {
        #[test]
        fn shrinking_leads_to_the_same_machine(
            seed in 0_u64..1_000_000,
            n_rows in 4_usize..120,
            noise in 0.2_f32..2.0,
            c in prop_oneof![Just(0.1), Just(1.0), Just(30.0), Just(1000.0)],
        ) {
            let Set { rows, labels, .. } = with_duplicates(bags(seed, n_rows, 2, noise));
            let positive: Vec<bool> = labels.iter().map(|&label| label == 0).collect();
            let kernel = Kernel::new(&rows, KernelFunction::Rbf { gamma: 5.0 }).unwrap();
            let decision_values = |shrinking| -> Vec<f64> {
                let tolerance = 1e-5;
                let problem =
                    Problem { positive: &positive, c_positive: c, c_negative: c, tolerance, shrinking };
                let solution = solve(&kernel, &problem).unwrap();
                let value = |row_idx| {
                    let row = kernel.row(row_idx);
                    let terms = solution.multipliers.iter().zip(&*row);
                    terms.map(|(b, k)| b * f64::from(*k)).sum::<f64>() - solution.rho
                };
                (0..n_rows).map(value).collect()
            };
            for (with, without) in decision_values(true).into_iter().zip(decision_values(false)) {
                prop_assert!((with - without).abs() < 1e-3, "{} and {}", with, without);
            }
        }
    }

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
            let problem = Problem {
                positive: &positive,
                c_positive: c,
                c_negative: c,
                tolerance: 1e-9,
                shrinking: false,
            };
            let solution = solve(&Kernel::new(&rows, KernelFunction::Linear).unwrap(), &problem).unwrap();
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
            let problem = Problem {
                positive: &positive,
                c_positive: 1e30,
                c_negative: 1e30,
                tolerance: 1e-6,
                shrinking: false,
            };
            let solution = solve(&Kernel::new(&rows, KernelFunction::Linear).unwrap(), &problem).unwrap();
            let expected = 2.0 / f64::from(4.0 * scale).powi(2);
            assert!((solution.multipliers[0] / expected - 1.0).abs() < 1e-5);
            assert!((solution.rho - 0.5).abs() < 1e-5, "scale {scale}: {}", solution.rho);
        }
    }

    #[test]
    fn equal_rows_on_both_sides_with_hardly_any_bound_are_an_error() {
        let rows = Matrix::from_vec(vec![1.0, 1.0], 1).unwrap();
        let positive = [true, false];
        let problem = Problem {
            positive: &positive,
            c_positive: 1e300,
            c_negative: 1e300,
            tolerance: 1e-3,
            shrinking: false,
        };
        assert_eq!(
            solve(&Kernel::new(&rows, KernelFunction::Linear).unwrap(), &problem).err(),
            Some(SvmError::NotConverged)
        );
    }
}
