//! What training gives, and what it is doing.

use super::Card;
use crate::filter::Transitions;
use crate::model::{Model, Recognition};

/// A model and how it did on frames it had not seen.
#[derive(Debug)]
pub struct Training {
    /// The model, trained on all samples; [`Training::finish`] makes the one to keep.
    pub model: Model,
    /// Answers to samples of rooms by models trained without the sample's fold.
    pub held_out: Vec<HeldOut>,
    /// Whether the folds are of single frames although these came in sequences: the sequences show other parts of the rooms,
    /// so that each would tell nothing of the others.
    pub are_single_frames: bool,
}

impl Training {
    /// The model with what only its maker knows: what a person would ask about it, and how robots move between its rooms
    /// ([`Transitions::learn`]; samples do not say when they were taken).
    pub fn finish(&self, card: Card, transitions: Transitions) -> Model {
        Model { card, transitions, ..self.model.clone() }
    }
}

/// The answer to a sample by a model trained and calibrated without it.
#[derive(Clone, Debug)]
pub struct HeldOut {
    /// Which sample.
    pub sample_idx: usize,
    /// The answer; its rooms are [`Model::rooms`].
    pub recognition: Recognition,
}

/// What training is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrainingStep {
    /// Steps done.
    pub n_done: usize,
    /// All steps.
    pub n_steps: usize,
}
