//! Several ways to tell rooms apart by a frame, and how they agree.

use super::machines::Machines;
use super::{Config, Features};
use crate::camera::CameraKind;
use crate::describe::FrameLbp;
use crate::svm::{self, Calibration, Scheme};
use serde::{Deserialize, Serialize};

/// What is seen of a frame beside its keypoints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Cue {
    /// The local binary patterns of the whole frame.
    FrameLbp(FrameLbpCue),
}

/// Support vector machines with the linear kernel, one a room, over histograms of the whole frame. The defaults
/// were chosen on held-out frames (docs/RESULTS.md).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FrameLbpCue {
    /// How much it counts beside the keypoints, which count the rest: from 0 to 1.
    pub weight: f64,
    /// The histograms.
    pub histograms: FrameLbp,
    /// The cost C of an error of the machines, see [`svm::Config::c`].
    pub c: f64,
}

impl Default for FrameLbpCue {
    fn default() -> Self {
        Self { weight: 0.5, histograms: FrameLbp::default(), c: 10.0 }
    }
}

impl FrameLbpCue {
    /// How its machines are trained.
    pub(super) fn machines(&self) -> svm::Config {
        svm::Config { c: self.c, ..svm::Config::default() }
    }
}

impl Cue {
    pub(super) fn check(&self) -> Result<(), String> {
        let Self::FrameLbp(cue) = self;
        if !(0.0..=1.0).contains(&cue.weight) {
            return Err(format!("the weight of a cue must be from 0 to 1, not {}", cue.weight));
        }
        cue.histograms.check()?;
        cue.machines().check().map_err(|error| format!("of the cue, {error}"))
    }

    pub(super) fn n_dimensions(&self, camera: CameraKind) -> usize {
        let Self::FrameLbp(cue) = self;
        cue.histograms.n_dimensions(camera)
    }
}

/// What machines see of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sight<'a> {
    /// The descriptors of its keypoints.
    Keypoints,
    /// What a cue sees of the frame as a whole.
    Frame(&'a Cue),
}

impl Config {
    /// Everything that is seen of a frame; the keypoints come first.
    pub(super) fn sights(&self) -> impl Iterator<Item = Sight<'_>> {
        std::iter::once(Sight::Keypoints).chain(self.cue.as_ref().map(Sight::Frame))
    }

    /// How the machines of a sight are put together.
    pub(super) fn scheme(&self, sight: Sight) -> Scheme {
        match sight {
            Sight::Keypoints => self.classifier.scheme(),
            Sight::Frame(Cue::FrameLbp(cue)) => cue.machines().scheme,
        }
    }

    /// How much a sight counts; the weights sum to 1.
    pub(super) fn weight(&self, sight: Sight) -> f64 {
        match (sight, &self.cue) {
            (Sight::Keypoints, None) => 1.0,
            (Sight::Keypoints, Some(Cue::FrameLbp(cue))) => 1.0 - cue.weight,
            (Sight::Frame(Cue::FrameLbp(cue)), _) => cue.weight,
        }
    }
}

/// Machines that see one thing of a frame, and how sure they are.
#[derive(Clone, Debug)]
pub(super) struct Opinion {
    pub(super) machines: Machines,
    pub(super) calibration: Calibration,
    pub(super) weight: f64,
}

impl Opinion {
    /// One probability a room, and how much they count; `None` of a frame that shows the machines nothing.
    pub(super) fn of(&self, features: &Features) -> Option<(f64, Vec<f32>)> {
        let values = self.machines.decision_values(features)?;
        Some((self.weight, self.calibration.probabilities(&values)))
    }
}

/// One probability a room from those of each sight that saw something, nothing without any: their product, each
/// to the power of its weight, over the sum of the rooms (the logarithmic opinion pool; Genest and Zidek,
/// "Combining Probability Distributions: A Critique and an Annotated Bibliography", Statistical Science 1986).
/// So who is sure counts more than who is not, as in Pronobis and Caputo, "Confidence-based Cue Integration for
/// Visual Place Recognition", IROS 2007.
pub(super) fn pooled(opinions: impl Iterator<Item = (f64, Vec<f32>)>) -> Vec<f32> {
    let mut opinions = opinions.filter(|(weight, _)| *weight > 0.0).peekable();
    let Some((weight, first)) = opinions.next() else { return Vec::new() };
    if opinions.peek().is_none() {
        return first;
    }
    // In logarithms, kept from minus infinity: a certain no is not the last word.
    let logs = |weight: f64, probabilities: Vec<f32>| {
        probabilities.into_iter().map(move |p| weight * f64::from(p.max(f32::MIN_POSITIVE)).ln())
    };
    let mut sums: Vec<f64> = logs(weight, first).collect();
    for (weight, probabilities) in opinions {
        sums.iter_mut().zip(logs(weight, probabilities)).for_each(|(sum, log)| *sum += log);
    }
    let largest = sums.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let products: Vec<f64> = sums.into_iter().map(|log| (log - largest).exp()).collect();
    let sum: f64 = products.iter().sum();
    products.into_iter().map(|product| (product / sum) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_opinion_is_the_answer() {
        assert_eq!(pooled([(1.0, vec![0.1, 0.9])].into_iter()), [0.1, 0.9]);
    }

    #[test]
    fn the_surer_opinion_wins() {
        let pool = |first: [f32; 3], second: [f32; 3], weight: f64| {
            pooled([(1.0 - weight, first.to_vec()), (weight, second.to_vec())].into_iter())
        };
        let answer = pool([0.4, 0.3, 0.3], [0.05, 0.9, 0.05], 0.5);
        assert!(answer[1] > answer[0] && (answer.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{answer:?}");
        let product = [0.4_f64 * 0.05, 0.3 * 0.9, 0.3 * 0.05].map(f64::sqrt);
        assert!((f64::from(answer[1]) - product[1] / product.iter().sum::<f64>()).abs() < 1e-6);
        let unheard = pool([0.6, 0.3, 0.1], [0.0, 0.0, 1.0], 0.0);
        assert_eq!(unheard, [0.6, 0.3, 0.1]);
        assert!(pooled([(0.0, vec![0.6, 0.4])].into_iter()).is_empty());
        assert!(pool([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.5).iter().all(|p| p.is_finite()));
    }
}
