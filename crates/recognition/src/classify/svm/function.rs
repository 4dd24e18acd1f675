//! How alike two rows are: the kernel functions.

use super::{SvmError, check_positive, to_f32};
use roomsight_vision::matrix::Matrix;
use roomsight_vision::simd;
use serde::{Deserialize, Serialize};

/// Rows that gamma is estimated from for [`KernelFunction::ChiSquared`], evenly spaced.
const MAX_SAMPLE: usize = 200;

/// A kernel k(x, z) of two rows of n features.
///
/// Where gamma may be left out (`KernelFunction<Option<f64>>`), it is then taken from the training rows:
/// 1 / (n variance) for `Rbf` and `Sigmoid`, where the variance is that of all features of all rows; one by
/// the mean distance of two rows for `ChiSquared`. Rows that are all equal give 1 / n.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum KernelFunction<Gamma = f64> {
    /// x . z
    Linear,
    /// exp(-gamma |x - z|^2)
    Rbf {
        /// How fast it falls; positive.
        gamma: Gamma,
    },
    /// tanh(gamma x . z + coef0). No Mercer kernel for every gamma and coef0.
    Sigmoid {
        /// How steep it is; positive.
        gamma: Gamma,
        /// The value before tanh of rows at right angles.
        #[serde(default)]
        coef0: f64,
    },
    /// exp(-gamma D) with D = 1/2 sum of (x_i - z_i)^2 / (x_i + z_i), for rows without negative numbers
    /// (Zhang et al., "Local Features and Kernels for Classification of Texture and Object Categories",
    /// 2007, which takes one by the mean of D as gamma).
    ChiSquared {
        /// How fast it falls; positive.
        gamma: Gamma,
    },
    /// The sum of min(x_i, z_i), for rows without negative numbers.
    HistogramIntersection,
}

impl KernelFunction<Option<f64>> {
    /// That the parameters that are given are in range.
    pub(super) fn check_given(self) -> Result<(), SvmError> {
        match self {
            Self::Rbf { gamma: Some(gamma) }
            | Self::Sigmoid { gamma: Some(gamma), .. }
            | Self::ChiSquared { gamma: Some(gamma) } => check_positive("gamma", gamma)?,
            _ => {}
        }
        match self {
            Self::Sigmoid { coef0, .. } if !coef0.is_finite() => Err(SvmError::Coef0 { value: coef0 }),
            _ => Ok(()),
        }
    }

    /// The kernel with its gamma given, if need be from `rows`, the finite training rows.
    ///
    /// # Errors
    /// A gamma that is not positive and finite, a coef0 that is not finite, negative numbers for a kernel
    /// that compares histograms.
    pub fn resolve(self, rows: &Matrix) -> Result<KernelFunction, SvmError> {
        let kernel = match self {
            Self::Linear => KernelFunction::Linear,
            Self::Rbf { gamma } => KernelFunction::Rbf { gamma: gamma.unwrap_or_else(|| scale_gamma(rows)) },
            Self::Sigmoid { gamma, coef0 } => {
                KernelFunction::Sigmoid { gamma: gamma.unwrap_or_else(|| scale_gamma(rows)), coef0 }
            }
            Self::ChiSquared { gamma } => {
                KernelFunction::ChiSquared { gamma: gamma.unwrap_or_else(|| distance_gamma(rows)) }
            }
            Self::HistogramIntersection => KernelFunction::HistogramIntersection,
        };
        kernel.check(rows)?;
        Ok(kernel)
    }
}

impl From<KernelFunction> for KernelFunction<Option<f64>> {
    fn from(kernel: KernelFunction) -> Self {
        match kernel {
            KernelFunction::Linear => Self::Linear,
            KernelFunction::Rbf { gamma } => Self::Rbf { gamma: Some(gamma) },
            KernelFunction::Sigmoid { gamma, coef0 } => Self::Sigmoid { gamma: Some(gamma), coef0 },
            KernelFunction::ChiSquared { gamma } => Self::ChiSquared { gamma: Some(gamma) },
            KernelFunction::HistogramIntersection => Self::HistogramIntersection,
        }
    }
}

impl KernelFunction {
    /// The kernel of two finite rows of the same length; finite, and the same with the rows exchanged, bit
    /// for bit.
    pub fn value(&self, left: &[f32], right: &[f32]) -> f32 {
        to_f32(self.exact_value(left, right))
    }

    /// As [`KernelFunction::value`], before it is rounded.
    pub(super) fn exact_value(&self, left: &[f32], right: &[f32]) -> f64 {
        match *self {
            Self::Linear => dot(left, right),
            Self::Rbf { gamma } => {
                let squared_distance = sum(left, right, |x, z| (x - z) * (x - z));
                (-gamma * squared_distance).exp()
            }
            Self::Sigmoid { gamma, coef0 } => (gamma * dot(left, right) + coef0).tanh(),
            Self::ChiSquared { gamma } => (-gamma * chi_squared(left, right)).exp(),
            Self::HistogramIntersection => sum(left, right, f64::min),
        }
    }

    /// That the parameters are in range, and that the kernel is made for these rows.
    pub(super) fn check(&self, rows: &Matrix) -> Result<(), SvmError> {
        match *self {
            Self::Rbf { gamma } | Self::Sigmoid { gamma, .. } | Self::ChiSquared { gamma } => {
                check_positive("gamma", gamma)?;
            }
            Self::Linear | Self::HistogramIntersection => {}
        }
        match *self {
            Self::Sigmoid { coef0, .. } if !coef0.is_finite() => Err(SvmError::Coef0 { value: coef0 }),
            Self::ChiSquared { .. } | Self::HistogramIntersection => {
                match rows.rows().position(|row| row.iter().any(|&value| value < 0.0)) {
                    Some(row_idx) => Err(SvmError::Negative { row_idx }),
                    None => Ok(()),
                }
            }
            _ => Ok(()),
        }
    }
}

/// The product of two rows.
pub(super) fn dot(left: &[f32], right: &[f32]) -> f64 {
    let mut product = 0.0;
    simd::dot(left, right, &mut product);
    product
}

fn chi_squared(left: &[f32], right: &[f32]) -> f64 {
    let term = |x: f64, z: f64| if x + z > 0.0 { (x - z) * (x - z) / (x + z) } else { 0.0 };
    0.5 * sum(left, right, term)
}

/// Sums a term of each pair of numbers, in `f64` in a fixed order.
#[inline(always)]
fn sum(left: &[f32], right: &[f32], term: impl Fn(f64, f64) -> f64) -> f64 {
    const LANES: usize = 8;
    let (left_chunks, left_rest) = left.as_chunks::<LANES>();
    let (right_chunks, right_rest) = right.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (left, right) in left_chunks.iter().zip(right_chunks) {
        for lane in 0..LANES {
            sums[lane] += term(f64::from(left[lane]), f64::from(right[lane]));
        }
    }
    let rest: f64 = left_rest.iter().zip(right_rest).map(|(l, r)| term(f64::from(*l), f64::from(*r))).sum();
    sums.iter().sum::<f64>() + rest
}

/// 1 / (n_cols variance).
fn scale_gamma(rows: &Matrix) -> f64 {
    let numbers = || rows.as_slice().iter().map(|&number| f64::from(number));
    let count = numbers().len().max(1) as f64;
    let mean = numbers().sum::<f64>() / count;
    let variance = numbers().map(|number| (number - mean).powi(2)).sum::<f64>() / count;
    one_by(rows.n_cols() as f64 * variance, rows)
}

/// 1 / mean chi-squared distance of two rows.
fn distance_gamma(rows: &Matrix) -> f64 {
    let step = rows.n_rows().div_ceil(MAX_SAMPLE).max(1);
    let sample: Vec<&[f32]> = rows.rows().step_by(step).collect();
    let n_pairs = sample.len() * sample.len().saturating_sub(1) / 2;
    let of_row = |(idx, row): (usize, &&[f32])| -> f64 {
        sample[..idx].iter().map(|other| chi_squared(row, other)).sum()
    };
    let total: f64 = sample.iter().enumerate().map(of_row).sum();
    one_by(total / n_pairs.max(1) as f64, rows)
}

fn one_by(spread: f64, rows: &Matrix) -> f64 {
    if spread > 0.0 { 1.0 / spread } else { 1.0 / rows.n_cols().max(1) as f64 }
}
