//! What a person would ask about a model.

use serde::{Deserialize, Serialize};

/// What a model was trained on and how well it did. Part of the model file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Card {
    /// What it recognizes, in a sentence.
    pub description: String,
    /// Whether any frame that it was trained on is simulated.
    pub simulated: bool,
    /// The version of roomsight that trained it.
    pub trained_by: String,
    /// The number of frames it was trained on.
    pub n_frames: usize,
    /// The sequences they come from.
    pub sequences: Vec<String>,
    /// How well it did on frames that it was not trained on.
    pub measured: Vec<Measurement>,
    /// Among what its opinions were chosen, where there was a choice.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub choice: Option<Choice>,
    /// How held-out frames were answered without the costlier opinions, of models that do without where the others are sure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub early: Option<EarlyAnswers>,
    /// Which of the sequences were added later, in their order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub additions: Vec<Addition>,
}

/// A sequence that was added to a trained model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Addition {
    /// Its name; empty when unknown.
    pub sequence: String,
    /// The number of its frames.
    pub n_frames: usize,
    /// The share at which support vectors were dropped; see [`super::Model::add`].
    pub forget: f64,
    /// What opinions kept before, in all: support vectors, rows of frames, descriptors.
    pub n_before: usize,
    /// What they keep since.
    pub n_left: usize,
}

/// Held-out frames that were answered without the costlier opinions.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EarlyAnswers {
    /// All held-out frames.
    pub n_held_out: usize,
    /// Those that were answered so.
    pub n_frames: usize,
    /// Those of them that were answered with the right room.
    pub n_right: usize,
    /// Those of them that all opinions together would have answered with the right room.
    pub n_right_by_all: usize,
}

/// A rate of correct answers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// The frames it was measured on.
    pub data: String,
    /// How many.
    pub n_frames: usize,
    /// The share answered with the right room, 0 to 1.
    pub rate: f64,
}

/// How a candidate did on held-out frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    /// What people call it.
    pub name: String,
    /// The opinions it has.
    pub opinions: Vec<String>,
    /// Frames answered with the right room.
    pub n_right: usize,
    /// Frames answered.
    pub n_frames: usize,
}

/// What was chosen, and why.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// The index of the chosen one.
    pub chosen: usize,
    /// How all candidates did, in the order of preference.
    pub tallies: Vec<Tally>,
}

impl Choice {
    /// The chosen one.
    pub fn tally(&self) -> &Tally {
        &self.tallies[self.chosen]
    }
}
