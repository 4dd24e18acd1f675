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
//! Beside the rooms it holds a belief that the robot is elsewhere, in a place that was never trained: a chain of two states,
//! among the rooms and elsewhere, whose observations are the frames' novelties.
//!
//! Where odometry says how a robot moved ([`Motion`]), the way that it went counts instead of time: one that stands does not
//! drift to another room, however long, and looks again at what was counted already; one that turns in place sees more of the
//! same room; after a jump, which no robot drives, it may be anywhere.
//!
//! One departure: a frame's probabilities are raised to a power, its [`Trust`]. Neighboring frames are
//! nearly the same picture and are wrong together, which asks for less than 1; calibrated probabilities are
//! cautious, which asks for more.

mod interval;
mod transitions;
mod trust;

pub use interval::{Interval, Motion};
pub use transitions::{Step, Transitions, TransitionsError};
pub use trust::{Trust, TrustError};

use crate::classify::svm::most_probable;

/// What a frame says at least for every room, so that no frame rules one out for good.
const MIN_PROBABILITY: f32 = 1e-6;

/// How long a robot stays among the rooms before it is carried elsewhere, on average, in seconds.
const SECONDS_AMONG_ROOMS: f64 = 600.0;

/// How long it stays elsewhere, in seconds.
const SECONDS_ELSEWHERE: f64 = 60.0;

/// How sure a single frame is at most that it shows a new place, or none.
const MAX_NOVELTY: f64 = 0.98;

/// A robot whose frames nobody has seen may as well be elsewhere.
const FIRST_NOVELTY: f64 = 0.5;

/// A robot is surely in a room that is believed in so much, elsewhere being told apart: of frames whose rooms are known 19 in 20
/// are right, and the filter is asked for a little less, since it says so for every frame of a stay.
const SURE: f32 = 0.9;

/// What a frame says of where a robot is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation<'a> {
    /// One probability a room; equal ones say nothing. Empty where nothing could be seen: then only time passes.
    pub probabilities: &'a [f32],
    /// The probability of a place that was never trained, from 0 to 1, where that can be told.
    pub novelty: Option<f32>,
}

/// The belief about where one robot is. It starts without any: all rooms alike.
#[derive(Clone, Debug, PartialEq)]
pub struct RoomFilter {
    belief: Vec<f32>,
    /// The probability that it is in none of the rooms, once a frame has told a novelty.
    elsewhere: Option<f32>,
    trust: Trust,
}

impl RoomFilter {
    /// For a model of `n_rooms` rooms, at least 1.
    pub fn new(n_rooms: usize, trust: Trust) -> Self {
        Self { belief: vec![1.0 / n_rooms as f32; n_rooms], elsewhere: None, trust }
    }

    /// One that goes on from the [`RoomFilter::belief`] and the [`RoomFilter::novelty`] of another. `None` where they are not
    /// those of a filter.
    pub fn restored(belief: Vec<f32>, elsewhere: Option<f32>, trust: Trust) -> Option<Self> {
        let is_share = |share: &f32| (0.0..=1.0).contains(share);
        let is_belief = belief.iter().all(is_share) && (belief.iter().sum::<f32>() - 1.0).abs() < 1e-3;
        (is_belief && elsewhere.iter().all(is_share)).then_some(Self { belief, elsewhere, trust })
    }

    /// One probability a room, summing to 1: what the frames up to now say together.
    pub fn belief(&self) -> &[f32] {
        &self.belief
    }

    /// The most probable room, the first of equal ones.
    pub fn room_idx(&self) -> usize {
        most_probable(&self.belief)
    }

    /// The probability that the robot is in none of the rooms, from 0 to 1, where frames can tell.
    pub fn novelty(&self) -> Option<f32> {
        self.elsewhere
    }

    /// Whether the frames up to now say surely that it is in the most probable room. Whether that may be acted on depends on
    /// the model too: see [`crate::model::Model::knows`].
    pub fn is_sure(&self) -> bool {
        (1.0 - self.elsewhere.unwrap_or_default()) * self.belief[self.room_idx()] >= SURE
    }

    /// The same belief about the rooms, for frames of a model that tells new places otherwise, or not at all.
    pub fn forget_elsewhere(&mut self) {
        self.elsewhere = None;
    }

    /// Takes in a frame and returns the new belief about the rooms. `since` is what lies between it and the frame before: a
    /// number of seconds, or with the way of the robot an [`Interval`].
    ///
    /// Panics when the filter, the transitions and the frame are not of the same number of rooms.
    pub fn update(
        &mut self,
        transitions: &Transitions,
        since: impl Into<Interval>,
        frame: Observation,
    ) -> &[f32] {
        let since = since.into();
        if since.is_jump() {
            let elsewhere = self.elsewhere.map(|_| FIRST_NOVELTY as f32);
            *self = Self { elsewhere, ..Self::new(self.belief.len(), self.trust) };
        }
        let elapsed = since.driven_seconds(transitions.speed());
        let mut weights = transitions.predict(&self.belief, elapsed);
        if !frame.probabilities.is_empty() {
            let exponent = self.trust.exponent() * since.new_view();
            assert_eq!(frame.probabilities.len(), self.belief.len(), "probabilities of other rooms");
            for (weight, probability) in weights.iter_mut().zip(frame.probabilities) {
                // What is no number becomes the least, as the maximum is the other number.
                let probability = f64::from(probability.clamp(0.0, 1.0).max(MIN_PROBABILITY));
                *weight *= probability.powf(exponent);
            }
        }
        let sum: f64 = weights.iter().sum();
        for (belief, weight) in self.belief.iter_mut().zip(weights) {
            *belief = (weight / sum) as f32;
        }
        if self.elsewhere.is_some() || frame.novelty.is_some() {
            let before = self.elsewhere.map_or(FIRST_NOVELTY, f64::from);
            self.elsewhere = Some(elsewhere(before, elapsed, frame.novelty, since.new_view()) as f32);
        }
        &self.belief
    }
}

/// The probability that a robot is elsewhere, `elapsed` seconds after it was with the probability `before`, and where a
/// frame says so that counts so much.
fn elsewhere(before: f64, elapsed: f64, novelty: Option<f32>, weight: f64) -> f64 {
    let (leaves, returns) = (1.0 / SECONDS_AMONG_ROOMS, 1.0 / SECONDS_ELSEWHERE);
    let after_long = leaves / (leaves + returns);
    let predicted = after_long + (before - after_long) * (-(leaves + returns) * elapsed).exp();
    let Some(novelty) = novelty.filter(|novelty| novelty.is_finite()) else { return predicted };
    let novelty = f64::from(novelty).clamp(1.0 - MAX_NOVELTY, MAX_NOVELTY);
    let (is_new, is_not) = (novelty.powf(weight), (1.0 - novelty).powf(weight));
    let (is_new, is_not) = (predicted * is_new, (1.0 - predicted) * is_not);
    is_new / (is_new + is_not)
}

#[cfg(test)]
mod tests;
