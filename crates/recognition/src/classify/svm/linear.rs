//! The linear kernel, for which all support vectors of a machine collapse into one weight vector.

use super::function::dot;
use super::kernel::Kernel;
use super::machine::Training;
use super::smo::Solution;
use super::{
    Config, KernelFunction, Scheme, SvmError, check_finite, check_n_classes, check_rows, check_shape, to_f32,
};
use roomsight_vision::matrix::Matrix;

/// A trained multi-class SVM with the linear kernel: one weight vector w and one threshold rho a
/// machine, the decision value of a row x is w . x - rho.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearSvm {
    scheme: Scheme,
    n_classes: usize,
    weights: Matrix,
    rho: Vec<f32>,
    n_support_vectors: Vec<usize>,
}

impl LinearSvm {
    /// Trains on `rows` (n x n_features), where row i is of class `labels[i]` < `n_classes`.
    ///
    /// The result depends on the arguments only, not on the number of threads. Kernel matrices take no
    /// more than about three GiB for any number of rows; up to 4,500 rows they take under 0.3.
    ///
    /// # Errors
    /// Fewer than two classes, a class without rows, a label too many or out of range, features that
    /// are not finite or above about 1e18, c or the tolerance not positive, no convergence.
    pub fn train(
        rows: &Matrix,
        labels: &[usize],
        n_classes: usize,
        config: &Config,
    ) -> Result<Self, SvmError> {
        check_rows(rows, labels, n_classes)?;
        let training = Training { labels, n_classes, config, shrinking: false };
        let mut svm = Self {
            scheme: config.scheme,
            n_classes,
            weights: Matrix::new(rows.n_cols()),
            rho: Vec::new(),
            n_support_vectors: Vec::new(),
        };
        for solution in training.solve(&Kernel::new(rows, KernelFunction::Linear)?)? {
            svm.weights.push_row(&collapse(&solution, rows));
            svm.rho.push(to_f32(solution.rho));
            svm.n_support_vectors.push(solution.support_idxs().count());
        }
        svm.validated()
    }

    /// Puts a machine together from its arrays, as [`LinearSvm::weights`], [`LinearSvm::rho`] and
    /// [`LinearSvm::n_support_vectors`] gave them.
    ///
    /// # Errors
    /// Arrays whose shapes do not agree with `scheme` and `n_classes`, or hold numbers that are not
    /// finite.
    pub fn from_parts(
        scheme: Scheme,
        n_classes: usize,
        weights: Matrix,
        rho: Vec<f32>,
        n_support_vectors: Vec<usize>,
    ) -> Result<Self, SvmError> {
        Self { scheme, n_classes, weights, rho, n_support_vectors }.validated()
    }

    fn validated(self) -> Result<Self, SvmError> {
        check_n_classes(self.n_classes)?;
        let expected = self.scheme.n_machines(self.n_classes);
        check_shape("weights", self.weights.n_rows(), expected)?;
        check_shape("thresholds", self.rho.len(), expected)?;
        check_shape("support vector counts", self.n_support_vectors.len(), expected)?;
        for (machine_idx, weights) in self.weights.rows().enumerate() {
            check_finite("weights", machine_idx, weights)?;
            check_finite("thresholds", machine_idx, &self.rho[machine_idx..=machine_idx])?;
        }
        Ok(self)
    }

    /// One decision value a machine, finite for finite features, positive for the machine's positive
    /// class. Panics when `row` has not [`LinearSvm::n_features`] numbers.
    pub fn decision_values(&self, row: &[f32]) -> Vec<f32> {
        assert_eq!(row.len(), self.n_features(), "a row of another width");
        let value = |weights, rho: &f32| dot(weights, row) - f64::from(*rho);
        self.weights.rows().zip(&self.rho).map(|(weights, rho)| to_f32(value(weights, rho))).collect()
    }

    /// How the machines are put together.
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// The number of classes.
    pub fn n_classes(&self) -> usize {
        self.n_classes
    }

    /// The number of features of a row.
    pub fn n_features(&self) -> usize {
        self.weights.n_cols()
    }

    /// The weights w: n_machines x n_features.
    pub fn weights(&self) -> &Matrix {
        &self.weights
    }

    /// The threshold of each machine.
    pub fn rho(&self) -> &[f32] {
        &self.rho
    }

    /// The number of training rows each machine rests on.
    pub fn n_support_vectors(&self) -> &[usize] {
        &self.n_support_vectors
    }
}

/// Sums the support vectors into one weight vector.
pub(super) fn collapse(solution: &Solution, rows: &Matrix) -> Vec<f32> {
    let mut weights = vec![0.0; rows.n_cols()];
    for row_idx in solution.support_idxs() {
        let multiplier = solution.multipliers[row_idx];
        for (weight, &feature) in weights.iter_mut().zip(rows.row(row_idx)) {
            *weight += multiplier * f64::from(feature);
        }
    }
    weights.into_iter().map(to_f32).collect()
}
