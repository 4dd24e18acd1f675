//! How the decision values of one opinion become probabilities.

use crate::classify::svm;
use crate::classify::svm::Scheme;
use crate::file::arrays::{Array, Arrays, require};
use crate::file::error::FormatError;
use crate::opinions::error::TrainError;
use crate::opinions::logit::softmax;
use roomsight_vision::matrix::Matrix;
use serde::{Deserialize, Serialize};

/// How decision values become probabilities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CalibrationConfig {
    /// Training frames are dealt into this many folds, whole sequences where there are several; each fold
    /// is answered by a model that was trained without it. At least 2.
    pub n_folds: usize,
    /// Whether each machine has its own sigmoid.
    pub sigmoids: Sigmoids,
    /// How often known answers are to be right, from 0 to 1: thresholds of probability and novelty are chosen so that
    /// held-out answers keep it, even where one frame in twenty shows a place that was never trained.
    pub known_precision: f32,
}

impl Default for CalibrationConfig {
    fn default() -> Self {
        Self { n_folds: 5, sigmoids: Sigmoids::Shared, known_precision: 0.95 }
    }
}

/// The sigmoids that turn decision values of machines into probabilities.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sigmoids {
    /// One a machine, as in LIBSVM. Needs held-out frames that are like those to come.
    PerMachine,
    /// The same for all machines: held-out frames decide how sure the answers are, but not which they are.
    Shared,
}

/// How far the logarithm of a fitted slope typically lies from that of the slope that is taken where nothing is
/// known.
const PRIOR_SPREAD: f64 = 1.0;

/// How many e-foldings a slope is looked for to both sides of the prior one.
const MAX_FOLDINGS: f64 = 6.0;

/// Which way an opinion is calibrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Way {
    /// Machines: a sigmoid each, see [`svm::Calibration`].
    Sigmoids(Scheme),
    /// One decision value a room: exponentials of it over their sum, with one slope for all rooms, so that the room of
    /// the largest value stays the most probable. A slope of `prior_slope`, in log-odds a unit, is taken where nothing
    /// is known.
    Softmax {
        /// Positive.
        prior_slope: f64,
    },
}

/// Turns the decision values of an opinion into probabilities.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Calibration {
    Sigmoids(svm::Calibration),
    /// In log-odds a unit of decision value.
    Softmax(f32),
}

/// Decision values of frames that the opinion was not trained on.
pub(crate) struct HeldOutValues {
    /// One row a frame, one column a machine or room.
    pub(crate) values: Matrix,
    /// The room that each frame shows.
    pub(crate) labels: Vec<usize>,
}

impl Way {
    /// The number of decision values for so many rooms.
    pub(crate) fn n_values(self, n_rooms: usize) -> usize {
        match self {
            Self::Sigmoids(scheme) => scheme.n_machines(n_rooms),
            Self::Softmax { .. } => n_rooms,
        }
    }
}

impl Calibration {
    /// Fits it to held-out frames; without any it is what is taken where nothing is known.
    pub(crate) fn fit(
        way: Way,
        held_out: &HeldOutValues,
        n_rooms: usize,
        config: &CalibrationConfig,
    ) -> Result<Self, TrainError> {
        let HeldOutValues { values, labels } = held_out;
        match way {
            Way::Softmax { prior_slope } => Ok(Self::Softmax(fit_slope(held_out, prior_slope) as f32)),
            Way::Sigmoids(scheme) => {
                let fit = match config.sigmoids {
                    Sigmoids::PerMachine => svm::Calibration::fit,
                    Sigmoids::Shared => svm::Calibration::fit_shared,
                };
                Ok(Self::Sigmoids(fit(scheme, values, labels, n_rooms)?))
            }
        }
    }

    /// One probability a room.
    pub(crate) fn probabilities(&self, values: &[f32]) -> Vec<f32> {
        match self {
            Self::Sigmoids(sigmoids) => sigmoids.probabilities(values),
            Self::Softmax(slope) => {
                let scaled: Vec<f64> =
                    values.iter().map(|&value| f64::from(*slope) * f64::from(value)).collect();
                softmax(&scaled).into_iter().map(|probability| probability as f32).collect()
            }
        }
    }

    pub(crate) fn to_arrays(&self) -> Vec<Array> {
        match self {
            Self::Sigmoids(sigmoids) => vec![
                Array::vector("calibration.slopes", sigmoids.slopes()),
                Array::vector("calibration.offsets", sigmoids.offsets()),
            ],
            Self::Softmax(slope) => vec![Array::vector("calibration.slope", &[*slope])],
        }
    }

    /// What is taken where nothing is known.
    pub(crate) fn usual(way: Way, n_rooms: usize, config: &CalibrationConfig) -> Result<Self, TrainError> {
        let none = HeldOutValues { values: Matrix::new(way.n_values(n_rooms)), labels: Vec::new() };
        Self::fit(way, &none, n_rooms, config)
    }

    /// A calibration of unknown origin. That of what was called a cue in files of format version 1 is one of sigmoids,
    /// one a room.
    pub(crate) fn from_arrays(way: Way, n_rooms: usize, arrays: &Arrays) -> Result<Self, FormatError> {
        let has_sigmoids = arrays.has("calibration.slopes");
        match way {
            Way::Softmax { .. } if has_sigmoids => {
                Self::from_arrays(Way::Sigmoids(Scheme::OneVsAll), n_rooms, arrays)
            }
            Way::Sigmoids(scheme) => {
                let slopes = arrays.vector("calibration.slopes")?;
                let offsets = arrays.vector("calibration.offsets")?;
                svm::Calibration::from_parts(scheme, n_rooms, slopes, offsets)
                    .map(Self::Sigmoids)
                    .map_err(|error| FormatError::Damaged(error.to_string()))
            }
            Way::Softmax { .. } => {
                let slope = arrays.vector("calibration.slope")?;
                let is_slope = slope.len() == 1 && slope[0].is_finite() && slope[0] > 0.0;
                require(is_slope, "the slope of a calibration is no positive number")?;
                Ok(Self::Softmax(slope[0]))
            }
        }
    }
}

/// The slope under which the rooms that the frames show are most probable, with a normal prior on its logarithm, by
/// golden section.
fn fit_slope(HeldOutValues { values, labels }: &HeldOutValues, prior_slope: f64) -> f64 {
    let cost = |foldings: f64| {
        let slope = prior_slope * foldings.exp();
        let of_frame = |(values, &label): (&[f32], &usize)| {
            let scaled: Vec<f64> = values.iter().map(|&value| slope * f64::from(value)).collect();
            -softmax(&scaled)[label].max(f64::MIN_POSITIVE).ln()
        };
        let prior = (foldings / PRIOR_SPREAD).powi(2) / 2.0;
        prior + values.rows().zip(labels).map(of_frame).sum::<f64>()
    };
    let golden = (5.0_f64.sqrt() - 1.0) / 2.0;
    let (mut low, mut high) = (-MAX_FOLDINGS, MAX_FOLDINGS);
    let inner = |low: f64, high: f64| [high - golden * (high - low), low + golden * (high - low)];
    let [mut left, mut right] = inner(low, high);
    let (mut of_left, mut of_right) = (cost(left), cost(right));
    while high - low > 1e-4 {
        if of_left <= of_right {
            (high, right, of_right) = (right, left, of_left);
            left = inner(low, high)[0];
            of_left = cost(left);
        } else {
            (low, left, of_left) = (left, right, of_right);
            right = inner(low, high)[1];
            of_right = cost(right);
        }
    }
    prior_slope * f64::midpoint(low, high).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classify::svm::most_probable;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Frames whose rooms are drawn as a softmax of this slope says.
    fn drawn(slope: f64, n_frames: usize) -> HeldOutValues {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let mut held_out = HeldOutValues { values: Matrix::new(4), labels: Vec::new() };
        for _ in 0..n_frames {
            let values: [f32; 4] = std::array::from_fn(|_| random.random());
            let scaled: Vec<f64> = values.iter().map(|&value| slope * f64::from(value)).collect();
            let mut left = random.random::<f64>();
            let probabilities = softmax(&scaled);
            let label = probabilities.iter().position(|p| {
                left -= p;
                left < 0.0
            });
            held_out.values.push_row(&values);
            held_out.labels.push(label.unwrap_or(3));
        }
        held_out
    }

    #[test]
    fn the_slope_that_frames_were_drawn_with_is_found() {
        let found = fit_slope(&drawn(5.0, 4000), 1.0);
        assert!((found / 5.0).ln().abs() < 0.1, "{found}");
    }

    #[test]
    fn without_frames_the_slope_is_the_prior_one() {
        assert!((fit_slope(&drawn(5.0, 0), 3.0) - 3.0).abs() < 1e-3);
        let few = fit_slope(&drawn(5.0, 2), 3.0);
        assert!((1.0..9.0).contains(&few), "{few}");
    }

    #[test]
    fn the_largest_value_stays_the_most_probable() {
        let values = [0.2, -0.7, 0.9, 0.4];
        let probabilities = Calibration::Softmax(3.0).probabilities(&values);
        assert_eq!(most_probable(&probabilities), 2);
        assert!((probabilities.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        assert!(Calibration::Softmax(1e30).probabilities(&values).iter().all(|p| p.is_finite()));
    }
}
