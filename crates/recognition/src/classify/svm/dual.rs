//! Machines in dual form: one coefficient a machine and support vector.

use super::function::dot;
use super::kernel::Kernel;
use super::machine::Training;
use super::smo::Solution;
use super::{Config, Scheme, SvmError, check_finite, check_n_classes, check_rows, check_shape, to_f32};
use roomsight_vision::matrix::Matrix;
use std::collections::BTreeSet;

/// A trained multi-class SVM that sees its rows only through the kernel: the decision value of a row x is
/// the sum over the support vectors s of coefficient(s) k(s, x), less rho. All machines share the support
/// vectors.
#[derive(Clone, Debug, PartialEq)]
pub struct DualSvm {
    scheme: Scheme,
    n_classes: usize,
    coefficients: Matrix,
    rho: Vec<f32>,
}

impl DualSvm {
    /// Trains on a precomputed kernel matrix `gram` (n x n, symmetric), where row i is of class
    /// `labels[i]` < `n_classes`. Also gives the rows that are support vectors, ascending.
    ///
    /// # Errors
    /// A matrix that is not square or not finite, fewer than two classes, a class without rows, a label too
    /// many or out of range, c or the tolerance not positive, no convergence.
    pub fn train(
        gram: &Matrix,
        labels: &[usize],
        n_classes: usize,
        config: &Config,
    ) -> Result<(Self, Vec<usize>), SvmError> {
        check_rows(gram, labels, n_classes)?;
        check_shape("columns of the kernel matrix", gram.n_cols(), gram.n_rows())?;
        Self::train_over(&Kernel::precomputed(gram), labels, n_classes, config)
    }

    /// As [`DualSvm::train`] over the rows of `kernel`, each of which has a label below `n_classes`.
    pub(super) fn train_over(
        kernel: &Kernel,
        labels: &[usize],
        n_classes: usize,
        config: &Config,
    ) -> Result<(Self, Vec<usize>), SvmError> {
        let training = Training { labels, n_classes, config, shrinking: true };
        let solutions = training.solve(kernel)?;
        let support_idxs: BTreeSet<usize> = solutions.iter().flat_map(Solution::support_idxs).collect();
        let support_idxs = Vec::from_iter(support_idxs);
        let mut coefficients = Matrix::new(support_idxs.len());
        for solution in &solutions {
            let of_machine = support_idxs.iter().map(|&row_idx| to_f32(solution.multipliers[row_idx]));
            coefficients.push_row(&Vec::from_iter(of_machine));
        }
        let rho = solutions.iter().map(|solution| to_f32(solution.rho)).collect();
        Ok((Self::from_parts(config.scheme, n_classes, coefficients, rho)?, support_idxs))
    }

    /// Puts machines together from `coefficients` (n_machines x n_support_vectors) and their thresholds.
    ///
    /// # Errors
    /// Arrays whose shapes do not agree with `scheme` and `n_classes`, or hold numbers that are not
    /// finite.
    pub fn from_parts(
        scheme: Scheme,
        n_classes: usize,
        coefficients: Matrix,
        rho: Vec<f32>,
    ) -> Result<Self, SvmError> {
        check_n_classes(n_classes)?;
        let expected = scheme.n_machines(n_classes);
        check_shape("coefficients", coefficients.n_rows(), expected)?;
        check_shape("thresholds", rho.len(), expected)?;
        for (machine_idx, of_machine) in coefficients.rows().enumerate() {
            check_finite("coefficients", machine_idx, of_machine)?;
            check_finite("thresholds", machine_idx, &rho[machine_idx..=machine_idx])?;
        }
        Ok(Self { scheme, n_classes, coefficients, rho })
    }

    /// One decision value a machine, finite, positive for the machine's positive class, for a row with
    /// these finite kernel values, one a support vector. Panics when there are more or fewer.
    pub fn decision_values(&self, kernel_values: &[f32]) -> Vec<f32> {
        assert_eq!(kernel_values.len(), self.n_support_vectors(), "kernel values of other support vectors");
        let value = |of_machine, rho: &f32| dot(of_machine, kernel_values) - f64::from(*rho);
        let machines = self.coefficients.rows().zip(&self.rho);
        machines.map(|(of_machine, rho)| to_f32(value(of_machine, rho))).collect()
    }

    /// How the machines are put together.
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// The number of classes.
    pub fn n_classes(&self) -> usize {
        self.n_classes
    }

    /// The number of support vectors of all machines together.
    pub fn n_support_vectors(&self) -> usize {
        self.coefficients.n_cols()
    }

    /// n_machines x n_support_vectors; zero where a machine does not rest on a support vector.
    pub fn coefficients(&self) -> &Matrix {
        &self.coefficients
    }

    /// The threshold of each machine.
    pub fn rho(&self) -> &[f32] {
        &self.rho
    }
}
