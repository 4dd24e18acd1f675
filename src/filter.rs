//! Which room a robot is in, judged by all frames of its stream: a Bayes filter over the rooms.
//!
//! A hidden Markov model (Rabiner, "A tutorial on hidden Markov models and selected applications in speech
//! recognition", 1989, section III.A) whose states are the rooms and whose observations are the frames.
//! Between frames the belief spreads as [`Transitions`] say; a frame then multiplies it by the
//! probabilities of its rooms. These are posteriors, not likelihoods: divided by the prior of the rooms,
//! which is uniform, they are proportional to them.
//!
//! One departure: neighboring frames are nearly the same picture and are wrong together, so a frame's
//! probabilities are raised to a power, its [`Trust`].

mod transitions;
mod trust;

pub use transitions::{Step, Transitions, TransitionsError};
pub use trust::{Trust, TrustError};

use crate::svm::most_probable;

/// What a frame says at least for every room, so that no frame rules one out for good.
const MIN_PROBABILITY: f32 = 1e-6;

/// The belief about where one robot is. It starts without any: all rooms alike.
#[derive(Clone, Debug, PartialEq)]
pub struct RoomFilter {
    belief: Vec<f32>,
    trust: Trust,
}

impl RoomFilter {
    /// For a model of `n_places` rooms, at least 1.
    pub fn new(n_places: usize, trust: Trust) -> Self {
        Self { belief: vec![1.0 / n_places as f32; n_places], trust }
    }

    /// One probability a room, summing to 1: what the frames up to now say together.
    pub fn belief(&self) -> &[f32] {
        &self.belief
    }

    /// The most probable room, the first of equal ones.
    pub fn place_idx(&self) -> usize {
        most_probable(&self.belief)
    }

    /// Takes in a frame, `elapsed` seconds after the one before (0 for the first), whose rooms have these
    /// `probabilities`, and returns the new belief. Equal probabilities, as of a frame without keypoints,
    /// say nothing: only time passes. An `elapsed` that is negative or no number counts as 0.
    ///
    /// Panics when the filter, the transitions and the frame are not of the same number of rooms.
    pub fn update(&mut self, transitions: &Transitions, elapsed: f64, probabilities: &[f32]) -> &[f32] {
        assert_eq!(probabilities.len(), self.belief.len(), "probabilities of other rooms");
        let mut weights = transitions.predict(&self.belief, elapsed);
        for (weight, probability) in weights.iter_mut().zip(probabilities) {
            let probability = f64::from(probability.max(MIN_PROBABILITY).min(1.0));
            *weight *= probability.powf(self.trust.exponent());
        }
        let sum: f64 = weights.iter().sum();
        for (belief, weight) in self.belief.iter_mut().zip(weights) {
            *belief = (weight / sum) as f32;
        }
        &self.belief
    }
}

#[cfg(test)]
mod tests;
