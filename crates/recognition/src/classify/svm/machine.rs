//! The binary machines that a multi-class SVM is made of.

use super::kernel::Kernel;
use super::smo::{self, Problem, Solution};
use super::{ClassWeights, Config, SvmError, check_every_class_has_rows};
use rayon::prelude::*;

/// What all machines of one SVM are trained with. There are as many labels as the kernel matrix has rows,
/// each below `n_classes`.
pub(super) struct Training<'a> {
    pub(super) labels: &'a [usize],
    pub(super) n_classes: usize,
    pub(super) config: &'a Config,
    /// Whether the solver leaves rows out of sight that seem settled.
    pub(super) shrinking: bool,
}

impl Training<'_> {
    /// Solves every machine over the rows of `kernel`: the solutions in the order of the machines, each with
    /// a multiplier for every row. Depends on the arguments only, not on the number of threads.
    ///
    /// # Errors
    /// A class without rows, c or the tolerance not positive, no convergence.
    pub(super) fn solve(&self, kernel: &Kernel) -> Result<Vec<Solution>, SvmError> {
        self.config.check()?;
        check_every_class_has_rows(self.labels, self.n_classes)?;
        let machines = self.config.scheme.machines(self.n_classes);
        machines.par_iter().map(|machine| self.solve_machine(*machine, kernel)).collect()
    }

    fn solve_machine(&self, machine: Machine, kernel: &Kernel) -> Result<Solution, SvmError> {
        let n_rows = self.labels.len();
        let sides = self.labels.iter().enumerate();
        let (row_idxs, positive): (Vec<usize>, Vec<bool>) =
            sides.filter_map(|(row_idx, &label)| Some((row_idx, machine.side(label)?))).unzip();
        let (c_positive, c_negative) = costs(&positive, self.config);
        let problem = Problem {
            positive: &positive,
            c_positive,
            c_negative,
            tolerance: self.config.tolerance,
            shrinking: self.shrinking,
        };
        if row_idxs.len() == n_rows {
            return smo::solve(kernel, &problem);
        }
        let solution = smo::solve(&kernel.subset(&row_idxs), &problem)?;
        let mut multipliers = vec![0.0; n_rows];
        for (row_idx, multiplier) in row_idxs.into_iter().zip(solution.multipliers) {
            multipliers[row_idx] = multiplier;
        }
        Ok(Solution { multipliers, rho: solution.rho })
    }
}

/// Which rows a binary machine tells apart: those of a class from those of another, or from all others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Machine {
    pub(super) positive: usize,
    pub(super) negative: Option<usize>,
}

impl Machine {
    /// Whether rows of class `label` are on the positive side; `None` where the machine ignores them.
    pub(super) fn side(self, label: usize) -> Option<bool> {
        if label == self.positive {
            Some(true)
        } else {
            self.negative.is_none_or(|negative| label == negative).then_some(false)
        }
    }
}

/// The cost of an error on the positive and on the negative side.
fn costs(positive: &[bool], config: &Config) -> (f64, f64) {
    match config.class_weights {
        ClassWeights::Equal => (config.c, config.c),
        ClassWeights::Balanced => {
            let n = positive.len() as f64;
            let n_positive = positive.iter().filter(|&&is_positive| is_positive).count() as f64;
            (config.c * n / (2.0 * n_positive), config.c * n / (2.0 * (n - n_positive)))
        }
    }
}
