//! Multi-class support vector machines, and their probabilities.
//!
//! An SVM is a set of binary machines, one a class or one a pair of classes. A [`LinearSvm`] keeps one
//! weight vector a machine; a [`KernelSvm`] the training rows it rests on, for any [`KernelFunction`]; a
//! [`MatchSvm`] whole sets of descriptors, compared by the match kernel. Each machine gives a decision
//! value; a [`Calibration`] turns these into one probability a class.

mod coupling;
mod dual;
mod function;
mod incremental;
mod kernel;
mod kernel_svm;
mod libsvm_file;
mod linear;
mod machine;
mod match_kernel;
mod probability;
mod smo;
#[cfg(test)]
mod tests;

pub use dual::DualSvm;
pub use function::KernelFunction;
pub use incremental::IncrementalSvm;
pub use kernel_svm::{KernelConfig, KernelSvm};
pub use libsvm_file::{LibsvmError, LibsvmModel};
pub use linear::LinearSvm;
pub use match_kernel::{DescriptorSet, InnerKernel, MatchConfig, MatchSvm, match_gram};
pub use probability::{Calibration, most_probable};

use crate::labeled::{
    LabeledError, check_every_class_has_rows, check_finite_rows, check_n_classes, check_rows,
};
use machine::Machine;
use serde::{Deserialize, Serialize};

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

impl Config {
    /// That the numbers are in range.
    pub fn check(&self) -> Result<(), SvmError> {
        check_positive("c", self.c)?;
        check_positive("the tolerance", self.tolerance)
    }
}

/// Why an SVM or a calibration was not made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the texts say it")]
pub enum SvmError {
    #[error(transparent)]
    Labeled(#[from] LabeledError),
    #[error("row {row_idx} holds numbers too large to multiply: scale the features down")]
    TooLarge { row_idx: usize },
    #[error("row {row_idx} holds a negative number: this kernel compares histograms, take another one")]
    Negative { row_idx: usize },
    #[error("coef0 is {value}: it must be finite")]
    Coef0 { value: f64 },
    #[error(
        "the threshold of the reduction is {value}: it must be zero or more, and small enough to keep a \
         support vector"
    )]
    Threshold { value: f64 },
    #[error("{name} is {value}: it must be positive and finite")]
    NotPositive { name: &'static str, value: f64 },
    #[error("training did not converge: lower c, raise the tolerance, or scale the features to about 1")]
    NotConverged,
    #[error("the {name} of the machines: {found} found, {expected} expected")]
    WrongShape { name: &'static str, found: usize, expected: usize },
    #[error("the {name} of machine {machine_idx} are damaged: {reason}")]
    Damaged { name: &'static str, machine_idx: usize, reason: &'static str },
}

/// Narrows without ever becoming infinite.
fn to_f32(value: f64) -> f32 {
    value.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
}

fn check_positive(name: &'static str, value: f64) -> Result<(), SvmError> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(SvmError::NotPositive { name, value }) }
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
