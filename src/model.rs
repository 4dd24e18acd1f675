//! The whole pipeline: labeled frames to a model, a frame to a room.
//!
//! Lu et al., "Robust place recognition based on omnidirectional vision and real-time local visual
//! features for mobile robots": detect, describe, count words, classify.

mod add;
mod arrays;
mod card;
mod config;
mod cue;
mod features;
mod folder;
mod format;
mod golden;
mod held_out;
mod machines;
mod train;
mod trial;

pub use add::AddError;
pub use card::{Addition, Card, Measurement};
pub use config::{CalibrationConfig, Classifier, Config, Representation, Sigmoids};
pub use cue::{Cue, FrameLbpCue};
pub use features::{Extractor, Features, Scratch};
pub use folder::{
    ABOUT_FILE, LoadError, LoadedModel, MAX_MODEL_BYTES, MAX_SIDE_FILE_BYTES, MODEL_FILE, SaveError,
    VerifiedFile, move_into_place, write_about,
};
pub use format::{FORMAT_VERSION, FormatError};
pub use golden::{GOLDEN_FOLDER, GoldenFrame};
pub use train::{HeldOut, Sample, TrainError, Training, TrainingStep};
pub use trial::{Stage, TrialError, TriedModel, try_model};

use crate::camera::Camera;
use crate::filter::Transitions;
use crate::image::Image;
use crate::svm::{LinearSvm, Scheme, most_probable};
use crate::vocabulary::Vocabulary;
use cue::{Opinion, pooled};
use held_out::HeldOutDecisions;
use machines::Machines;

/// The answer for one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Recognition {
    /// Index into [`Model::places`] of the most probable room, the first of equal ones.
    pub place_idx: usize,
    /// Whether held-out frames answered at least as confidently were mostly right; never where nothing was
    /// seen: no keypoint, and no cue to be asked.
    pub known: bool,
    /// One probability a room, in the order of [`Model::places`]; they sum to 1.
    pub probabilities: Vec<f32>,
    /// The number of keypoints the answer rests on.
    pub n_keypoints: usize,
}

impl Recognition {
    /// The probability of the room that was answered.
    pub fn probability(&self) -> f32 {
        self.probabilities[self.place_idx]
    }
}

/// One keypoint's share in an answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Evidence {
    /// Column in the frame as it came, in pixels.
    pub x: f32,
    /// Row in the frame as it came, in pixels.
    pub y: f32,
    /// The word of the vocabulary it was assigned to.
    pub word_idx: usize,
    /// Its share in the decision value of the room; negative speaks against it.
    pub weight: f32,
}

/// A trained model. It never changes; share it between threads behind an `Arc`.
#[derive(Clone, Debug)]
pub struct Model {
    config: Config,
    places: Vec<String>,
    extractor: Extractor,
    classification: Classification,
    transitions: Transitions,
    /// What the calibration rests on, of models that training can go on from.
    held_out: Option<HeldOutDecisions>,
    card: Card,
}

/// From features to probabilities.
#[derive(Clone, Debug)]
struct Classification {
    /// One for each sight of the configuration; that of the keypoints is always there, and the first.
    opinions: Vec<Opinion>,
    /// Answers of at least this probability are known; none are where there is none.
    known_probability: Option<f32>,
}

impl Model {
    /// The rooms, sorted.
    pub fn places(&self) -> &[String] {
        &self.places
    }

    /// What it was configured to be.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The camera whose frames it takes.
    pub fn camera(&self) -> &Camera {
        self.extractor.camera()
    }

    /// What a person would ask about it: what it was trained on, how well it did.
    pub fn card(&self) -> &Card {
        &self.card
    }

    /// The same model with another card.
    pub fn with_card(self, card: Card) -> Self {
        Self { card, ..self }
    }

    /// How robots move between its rooms.
    pub fn transitions(&self) -> &Transitions {
        &self.transitions
    }

    /// The same model with these transitions between its rooms, as [`Transitions::learn`] finds them.
    pub fn with_transitions(self, transitions: Transitions) -> Self {
        Self { transitions, ..self }
    }

    /// The number of words of the vocabulary; 0 where descriptors are compared themselves.
    pub fn n_words(&self) -> usize {
        self.machines().vocabulary().map_or(0, Vocabulary::n_words)
    }

    /// The number of training frames each support vector machine rests on; none for other machines.
    pub fn n_support_vectors(&self) -> Vec<usize> {
        self.machines().n_support_vectors()
    }

    /// Those that see the keypoints.
    fn machines(&self) -> &Machines {
        &self.classification.opinions[0].machines
    }

    /// From which probability on an answer is known; `None` when none ever is, since held-out answers were
    /// wrong too often at any.
    pub fn known_probability(&self) -> Option<f32> {
        self.classification.known_probability
    }

    /// Which room a frame shows.
    pub fn recognize(&self, image: &Image, scratch: &mut Scratch) -> Recognition {
        self.classify(&self.features(image, scratch))
    }

    /// Detects and describes: the first half of [`Model::recognize`].
    pub fn features(&self, image: &Image, scratch: &mut Scratch) -> Features {
        self.extractor.extract(image, scratch)
    }

    /// Counts words and weighs them: the second half of [`Model::recognize`].
    pub fn classify(&self, features: &Features) -> Recognition {
        self.classification.classify(features)
    }

    /// What each keypoint said, the cue left out, for and against a room, the strongest first. With one machine a pair of
    /// rooms, the sum over the machines that the room takes part in. Only linear machines can be taken apart
    /// like this; for others there is nothing.
    pub fn explain(&self, features: &Features, place_idx: usize) -> Vec<Evidence> {
        let Machines::Linear(vocabulary, svm) = self.machines() else { return Vec::new() };
        let words = vocabulary.quantize(&features.descriptors);
        let weights = keypoint_weights((vocabulary, svm), (features, &words), place_idx);
        let mut evidence: Vec<Evidence> = words
            .iter()
            .zip(&features.keypoints)
            .zip(weights)
            .map(|((&word, keypoint), weight)| Evidence {
                x: keypoint.x * features.scale,
                y: keypoint.y * features.scale,
                word_idx: word as usize,
                weight,
            })
            .collect();
        evidence.sort_by(|a, b| b.weight.abs().total_cmp(&a.weight.abs()));
        evidence
    }
}

impl Classification {
    fn classify(&self, features: &Features) -> Recognition {
        let n_keypoints = features.keypoints.len();
        let probabilities = pooled(self.opinions.iter().filter_map(|opinion| opinion.of(features)));
        if probabilities.is_empty() {
            // Nothing was seen: no room is more probable than another.
            let n_places = self.opinions[0].machines.n_classes();
            let probabilities = vec![1.0 / n_places as f32; n_places];
            return Recognition { place_idx: 0, known: false, probabilities, n_keypoints };
        }
        let place_idx = most_probable(&probabilities);
        let known = is_known(probabilities[place_idx], self.known_probability);
        Recognition { place_idx, known, probabilities, n_keypoints }
    }
}

/// Whether an answer of this probability is known, where those of at least `known_probability` are.
fn is_known(probability: f32, known_probability: Option<f32>) -> bool {
    known_probability.is_some_and(|least| probability >= least)
}

/// How much each keypoint of a frame with these words adds to the decision value of a room: an equal share of what
/// each block of the row adds that it counts in.
fn keypoint_weights(
    (vocabulary, svm): (&Vocabulary, &LinearSvm),
    (features, words): (&Features, &[u32]),
    place_idx: usize,
) -> Vec<f32> {
    let row = vocabulary.row_of_words(features.described(), words);
    let width = vocabulary.block_width();
    let blocks = || words.iter().zip(&features.spots).map(|(&word, &spot)| vocabulary.blocks(word, spot));
    let mut counts = vec![0.0; row.len() / width];
    blocks().flatten().for_each(|block| counts[block] += 1.0);
    let share = |block: usize| {
        let column = |column: usize| {
            let signed = signed_machines(svm, place_idx);
            let sum: f32 = signed.map(|(machine, sign)| sign * svm.weights().row(machine)[column]).sum();
            sum * row[column]
        };
        (block * width..(block + 1) * width).map(column).sum::<f32>() / f32::max(counts[block], 1.0)
    };
    let shares: Vec<f32> = (0..counts.len()).map(share).collect();
    blocks().map(|blocks| blocks.map(|block| shares[block]).sum()).collect()
}

/// The machines that speak of a room, and whether their positive side is it.
fn signed_machines(svm: &LinearSvm, place_idx: usize) -> impl Iterator<Item = (usize, f32)> {
    let n_places = svm.n_classes();
    let one_vs_all = (svm.scheme() == Scheme::OneVsAll).then_some((place_idx, 1.0));
    let pairs = (0..n_places).flat_map(move |a| (a + 1..n_places).map(move |b| (a, b))).enumerate();
    let one_vs_one = pairs.filter_map(move |(machine, (a, b))| {
        let sign = if a == place_idx { 1.0 } else { -1.0 };
        (one_vs_all.is_none() && (a == place_idx || b == place_idx)).then_some((machine, sign))
    });
    one_vs_all.into_iter().chain(one_vs_one)
}

#[cfg(test)]
mod tests;
