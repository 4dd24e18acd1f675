//! Which room a robot is in, judged by all frames of its stream: a Bayes filter over the rooms.
//!
//! A hidden Markov model (Rabiner, "A tutorial on hidden Markov models and selected applications in speech
//! recognition", 1989, section III.A) whose states are the rooms and whose observations are the frames.
//! Between frames the belief spreads as [`Transitions`] say; a frame then multiplies it by the
//! probabilities of its rooms. These are posteriors, not likelihoods; they are proportional to them where the
//! prior behind them is uniform. A shared sigmoid treats all rooms alike, so that this nearly holds. Where each
//! machine has a sigmoid of its own, it takes over how often its room was held out: after unbalanced training
//! frames the filter believes a little too much in the rooms that had many.
//!
//! One departure: a frame's probabilities are raised to a power, its [`Trust`]. Neighboring frames are
//! nearly the same picture and are wrong together, which asks for less than 1; calibrated probabilities are
//! cautious, which asks for more.

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
    /// `probabilities`, and returns the new belief. Equal probabilities, as of a frame in which nothing was seen,
    /// say nothing: only time passes. An `elapsed` that is negative or no number counts as 0.
    ///
    /// Panics when the filter, the transitions and the frame are not of the same number of rooms.
    pub fn update(&mut self, transitions: &Transitions, elapsed: f64, probabilities: &[f32]) -> &[f32] {
        assert_eq!(probabilities.len(), self.belief.len(), "probabilities of other rooms");
        let mut weights = transitions.predict(&self.belief, elapsed);
        for (weight, probability) in weights.iter_mut().zip(probabilities) {
            // What is no number becomes the least, as the maximum is the other number.
            let probability = f64::from(probability.clamp(0.0, 1.0).max(MIN_PROBABILITY));
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
