//! Multi-class support vector machines over rows of numbers (bags), and their probabilities.
//!
//! A [`LinearSvm`] is a set of binary machines, one a class or one a pair of classes. Each gives a
//! decision value; a [`Calibration`] turns these into one probability a class.

mod coupling;
mod kernel;
mod probability;
mod smo;
#[cfg(test)]
mod tests;

pub use probability::{Calibration, most_probable};

use crate::matrix::Matrix;
use kernel::Kernel;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use smo::{Problem, Solution};

/// How binary machines are put together to tell several classes apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scheme {
    /// One machine a class, in the order of the classes: that class against all others.
    #[default]
    OneVsAll,
    /// One machine a pair of classes, in the order (0, 1), (0, 2), ... (1, 2), ...: the first of the
    /// pair is the positive one.
    OneVsOne,
}

impl Scheme {
    /// The number of binary machines for `n_classes` classes.
    pub fn n_machines(self, n_classes: usize) -> usize {
        match self {
            Self::OneVsAll => n_classes,
            Self::OneVsOne => n_classes.saturating_mul(n_classes.saturating_sub(1)) / 2,
        }
    }

    fn machines(self, n_classes: usize) -> Vec<Machine> {
        match self {
            Self::OneVsAll => (0..n_classes).map(|positive| Machine { positive, negative: None }).collect(),
            Self::OneVsOne => coupling::class_pairs(n_classes)
                .map(|(positive, negative)| Machine { positive, negative: Some(negative) })
                .collect(),
        }
    }
}

/// How much an error on a row of each class costs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ClassWeights {
    /// Every row costs the same: C.
    #[default]
    Equal,
    /// Both sides of a machine cost the same in all: C n / (2 n_side) a row, where n is the number of
    /// rows the machine is trained on and n_side those of the row's side.
    Balanced,
}

/// What to train.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// How binary machines are put together.
    pub scheme: Scheme,
    /// The cost C of an error; positive. Larger fits the training rows more closely.
    pub c: f64,
    /// Training stops when no pair of rows violates the optimality conditions by more than this;
    /// positive, in units of the margin.
    pub tolerance: f64,
    /// Whether rare classes count for more.
    pub class_weights: ClassWeights,
}

impl Default for Config {
    fn default() -> Self {
        Self { scheme: Scheme::OneVsAll, c: 1.0, tolerance: 1e-3, class_weights: ClassWeights::Equal }
    }
}

/// Why an SVM or a calibration was not made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the texts say it")]
pub enum SvmError {
    #[error("at least two classes are needed, {n_classes} given: add rows of another class")]
    TooFewClasses { n_classes: usize },
    #[error("class {class_idx} has no row to train on: add rows of it, or leave the class out")]
    EmptyClass { class_idx: usize },
    #[error("{n_labels} labels for {n_rows} rows: every row needs exactly one")]
    LabelCount { n_labels: usize, n_rows: usize },
    #[error(
        "row {row_idx} has label {label}, but of {n_classes} classes the last is one less: mend the labels"
    )]
    UnknownLabel { row_idx: usize, label: usize, n_classes: usize },
    #[error("row {row_idx} holds a number that is not finite: remove the row or mend its features")]
    NotFinite { row_idx: usize },
    #[error("row {row_idx} holds numbers too large to multiply: scale the features down")]
    TooLarge { row_idx: usize },
    #[error("{name} is {value}: it must be positive and finite")]
    NotPositive { name: &'static str, value: f64 },
    #[error("training did not converge: lower c, raise the tolerance, or scale the features to about 1")]
    NotConverged,
    #[error("the {name} of the machines: {found} found, {expected} expected")]
    WrongShape { name: &'static str, found: usize, expected: usize },
    #[error("the {name} of machine {machine_idx} are damaged: {reason}")]
    Damaged { name: &'static str, machine_idx: usize, reason: &'static str },
}

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
        for (name, value) in [("c", config.c), ("the tolerance", config.tolerance)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(SvmError::NotPositive { name, value });
            }
        }
        check_rows(rows, labels, n_classes)?;
        check_every_class_has_rows(labels, n_classes)?;
        let kernel = Kernel::linear(rows)?;
        let trained: Vec<BinaryMachine> = config
            .scheme
            .machines(n_classes)
            .par_iter()
            .map(|machine| machine.train(&kernel, rows, labels, config))
            .collect::<Result<_, _>>()?;
        let mut svm = Self {
            scheme: config.scheme,
            n_classes,
            weights: Matrix::new(rows.n_cols()),
            rho: Vec::new(),
            n_support_vectors: Vec::new(),
        };
        for machine in trained {
            svm.weights.push_row(&machine.weights);
            svm.rho.push(machine.rho);
            svm.n_support_vectors.push(machine.n_support_vectors);
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
        let value = |weights, rho: &f32| kernel::dot(weights, row) - f64::from(*rho);
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

/// Which rows a binary machine tells apart: those of a class from those of another, or from all others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Machine {
    positive: usize,
    negative: Option<usize>,
}

/// A trained [`Machine`].
struct BinaryMachine {
    weights: Vec<f32>,
    rho: f32,
    n_support_vectors: usize,
}

impl Machine {
    /// Whether rows of class `label` are on the positive side; `None` where the machine ignores them.
    fn side(self, label: usize) -> Option<bool> {
        if label == self.positive {
            Some(true)
        } else {
            self.negative.is_none_or(|negative| label == negative).then_some(false)
        }
    }

    fn train(
        self,
        kernel: &Kernel,
        rows: &Matrix,
        labels: &[usize],
        config: &Config,
    ) -> Result<BinaryMachine, SvmError> {
        let (row_idxs, positive): (Vec<usize>, Vec<bool>) = labels
            .iter()
            .enumerate()
            .filter_map(|(row_idx, &label)| Some((row_idx, self.side(label)?)))
            .unzip();
        let (c_positive, c_negative) = costs(&positive, config);
        let problem = Problem { positive: &positive, c_positive, c_negative, tolerance: config.tolerance };
        let solution = if row_idxs.len() == rows.n_rows() {
            smo::solve(kernel, &problem)?
        } else {
            smo::solve(&kernel.subset(&row_idxs), &problem)?
        };
        Ok(collapse(&solution, &row_idxs, rows))
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

/// Sums the support vectors into one weight vector.
fn collapse(solution: &Solution, row_idxs: &[usize], rows: &Matrix) -> BinaryMachine {
    let mut weights = vec![0.0; rows.n_cols()];
    let mut n_support_vectors = 0;
    for (&multiplier, &row_idx) in solution.multipliers.iter().zip(row_idxs) {
        if multiplier != 0.0 {
            n_support_vectors += 1;
            for (weight, &feature) in weights.iter_mut().zip(rows.row(row_idx)) {
                *weight += multiplier * f64::from(feature);
            }
        }
    }
    BinaryMachine {
        weights: weights.into_iter().map(to_f32).collect(),
        rho: to_f32(solution.rho),
        n_support_vectors,
    }
}

/// Narrows without ever becoming infinite.
fn to_f32(value: f64) -> f32 {
    value.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
}

fn check_n_classes(n_classes: usize) -> Result<(), SvmError> {
    if n_classes < 2 { Err(SvmError::TooFewClasses { n_classes }) } else { Ok(()) }
}

fn check_rows(rows: &Matrix, labels: &[usize], n_classes: usize) -> Result<(), SvmError> {
    check_n_classes(n_classes)?;
    if labels.len() != rows.n_rows() {
        return Err(SvmError::LabelCount { n_labels: labels.len(), n_rows: rows.n_rows() });
    }
    if let Some(row_idx) = labels.iter().position(|&label| label >= n_classes) {
        return Err(SvmError::UnknownLabel { row_idx, label: labels[row_idx], n_classes });
    }
    match rows.rows().position(|row| row.iter().any(|value| !value.is_finite())) {
        Some(row_idx) => Err(SvmError::NotFinite { row_idx }),
        None => Ok(()),
    }
}

fn check_every_class_has_rows(labels: &[usize], n_classes: usize) -> Result<(), SvmError> {
    match (0..n_classes).find(|class_idx| !labels.contains(class_idx)) {
        Some(class_idx) => Err(SvmError::EmptyClass { class_idx }),
        None => Ok(()),
    }
}

fn check_shape(name: &'static str, found: usize, expected: usize) -> Result<(), SvmError> {
    if found == expected { Ok(()) } else { Err(SvmError::WrongShape { name, found, expected }) }
}

fn check_finite(name: &'static str, machine_idx: usize, values: &[f32]) -> Result<(), SvmError> {
    if values.iter().all(|value| value.is_finite()) {
        Ok(())
    } else {
        Err(SvmError::Damaged { name, machine_idx, reason: "they are not finite" })
    }
}
