//! The whole pipeline: labeled frames to a model, a frame to a room.
//!
//! A model is a list of opinions. Each looks at a frame in its way and tells rooms apart by what it sees; their
//! decision values are calibrated on held-out frames, and the probabilities multiplied, each to the power of a
//! weight that was fitted on held-out frames too. A single opinion, machines over bags of words, is the method of Lu et
//! al., "Robust place recognition based on omnidirectional vision and real-time local visual features for mobile
//! robots": detect, describe, count words, classify.

mod add;
mod card;
mod cascade;
mod choose;
mod config;
mod described;
mod effort;
mod expected;
mod extractor;
mod folder;
mod format;
mod golden;
mod held_out;
mod known;
#[cfg(test)]
mod laser_tests;
mod learned;
mod left_out;
mod looking;
mod nearest;
#[cfg(test)]
mod network_tests;
mod novelty;
mod pose;
mod sample;
mod train;
mod training;
mod trial;
mod trials;

pub use crate::file::disk::{LoadError, MAX_SIDE_FILE_BYTES, MODEL_FILE};
pub use crate::file::error::{FORMAT_VERSION, FormatError};
pub use crate::file::names::{BAG, PATTERNS};
pub use crate::file::networks::{
    CarriedNetwork, Digest, MAX_NETWORK_BYTES, NETWORKS_FOLDER, NetworkEntry, NetworkStore, Networks,
};
pub use crate::look::features::Features;
pub use crate::look::flaw::Flaw;
pub use crate::look::laser::LaserShape;
pub use crate::look::lens::{DEFAULT_NETWORK, Lens};
pub use crate::look::local::LocalFeatures;
pub use crate::look::scan::{Frame, Scan, ScanError};
pub use crate::look::sight::{Seen, Sight};
pub use crate::opinions::calibration::{CalibrationConfig, Sigmoids};
pub use crate::opinions::error::{AddError, TrainError};
pub use crate::opinions::{
    Classifier, LaserConfig, MachinesConfig, MemoryConfig, OpinionConfig, PatternsConfig, Remembered,
    Representation, Size, Tries, VectorConfig,
};
pub use add::Forgotten;
pub use card::{Addition, Card, Choice, EarlyAnswers, Measurement, Tally};
pub use choose::{
    Candidate, HeldOutAnswers, LeftOut, Preferred, all_opinions, answer_held_out, train_preferred,
};
pub use config::Config;
pub use described::{FeaturesError, Looked, features_from_bytes, features_to_bytes};
pub use effort::{Effort, Means};
pub use expected::Expected;
pub use extractor::{Extractor, ScanFieldError, Scratch};
pub use folder::{
    ABOUT_FILE, LoadedModel, MAX_MODEL_BYTES, SaveError, VerifiedFile, move_into_place, networks_in,
    networks_of, write_about,
};
pub use golden::{GOLDEN_FOLDER, GoldenFrame};
pub use looking::Looking;
pub use nearest::{N_NEAREST, NearFrame};
pub use pose::{Pose, PoseEstimate};
pub use sample::{ELSEWHERE, Sample};
pub use training::{HeldOut, Training, TrainingStep};
pub use trial::{Stage, TrialError, TriedModel, try_model};
pub use trials::{Trials, Unit};

use crate::classify::svm::most_probable;
use crate::file::networks;
use crate::filter::{Observation, RoomFilter, Transitions};
use crate::opinions::{Clue, Likeness, Opinion, Said, pool};
use cascade::Early;
use held_out::HeldOutFrames;
use known::Known;
use learned::LearnedFrames;
use novelty::Novelty;
use roomsight_vision::camera::Camera;
use roomsight_vision::image::{Image, ImageError, Limits};
use roomsight_vision::network::NetworkError;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// The answer for one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Recognition {
    /// Index into [`Model::rooms`] of the most probable room, the first of equal ones.
    pub room_idx: usize,
    /// Whether a robot may act on it: frames that were held out, and answered at least as surely and to frames no newer,
    /// were right as often as [`CalibrationConfig::known_precision`] promises.
    pub known: bool,
    /// How probable it is that the frame shows a place that was never trained, from 0 to 1, as if every other frame did.
    /// `None` of models that cannot tell, and where nothing was seen.
    pub novelty: Option<f32>,
    /// Why it is not known; `None` where it is.
    pub unknown: Option<Unknown>,
    /// One probability a room, in the order of [`Model::rooms`]; they sum to 1.
    pub probabilities: Vec<f32>,
    /// The number of keypoints the answer rests on.
    pub n_keypoints: usize,
    /// Whether cheap opinions were so sure that the others were not asked.
    pub is_early: bool,
}

/// Why an answer is not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Unknown {
    /// No room is probable enough.
    Unsure,
    /// It looks like no place that was trained.
    NewPlace,
    /// There is nothing to see in it.
    NoDetail,
    /// It is too dark to see anything.
    Dark,
    /// Something is before the lens.
    Covered,
}

impl fmt::Display for Unknown {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Unsure => "unsure",
            Self::NewPlace => "new place",
            Self::NoDetail => "nothing to see",
            Self::Dark => "too dark",
            Self::Covered => "lens covered",
        })
    }
}

impl Recognition {
    /// What it tells a filter.
    pub fn observation(&self) -> Observation<'_> {
        match self.unknown {
            Some(Unknown::NoDetail | Unknown::Dark | Unknown::Covered) => {
                Observation { probabilities: &[], novelty: None }
            }
            _ => Observation { probabilities: &self.probabilities, novelty: self.novelty },
        }
    }

    /// The probability of the room that was answered.
    pub fn probability(&self) -> f32 {
        self.probabilities[self.room_idx]
    }
}

/// The rooms of these probabilities, the most probable first: all, or the first `top`.
pub fn by_probability(probabilities: &[f32], top: Option<usize>) -> Vec<usize> {
    let mut order: Vec<usize> = (0..probabilities.len()).collect();
    order.sort_by(|&a, &b| probabilities[b].total_cmp(&probabilities[a]));
    order.truncate(top.unwrap_or(usize::MAX));
    order
}

/// One keypoint's share in an answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Evidence {
    /// The opinion that saw it.
    pub opinion: String,
    /// Column in the frame as it came, in pixels.
    pub x: f32,
    /// Row in the frame as it came, in pixels.
    pub y: f32,
    /// The word of the opinion's vocabulary that it was assigned to, where there is one.
    pub word_idx: Option<usize>,
    /// What the frame is called that has something like it, of those that were learned, where that is known.
    pub frame: Option<String>,
    /// Its share in the opinion's decision value of the room; negative speaks against it.
    pub weight: f32,
}

/// A trained model. It never changes; share it between threads behind an `Arc`.
#[derive(Clone, Debug)]
pub struct Model {
    config: Config,
    rooms: Vec<String>,
    extractor: Extractor,
    classification: Classification,
    /// Who answers alone where that is sure, in the order of being asked; none where all are always asked.
    early: Vec<Early>,
    transitions: Transitions,
    /// What it has learned; nothing in files that do not say.
    learned: LearnedFrames,
    /// What the calibration rests on; nothing in files that do not say.
    held_out: HeldOutFrames,
    /// Frames of rooms that were left out, on which rests what tells new places; nothing in files that do not say.
    left_out: HeldOutFrames,
    networks: Networks,
    card: Card,
}

/// From features to probabilities.
#[derive(Clone, Debug)]
struct Classification {
    n_rooms: usize,
    /// In the order of the configuration's.
    opinions: Vec<Opinion>,
    /// The share of frames that show what was never seen, of which no room is more probable.
    doubt: f64,
    /// Tells frames of places that were never trained; not in files of before.
    novelty: Option<Novelty>,
    /// Which answers are known; none are where there is none.
    known: Option<Known>,
}

impl Model {
    /// The rooms, sorted.
    pub fn rooms(&self) -> &[String] {
        &self.rooms
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

    /// The networks that it uses.
    pub fn networks(&self) -> &Networks {
        &self.networks
    }

    /// What its file says of them.
    pub fn network_entries(&self) -> Vec<NetworkEntry> {
        networks::entries(&self.networks)
    }

    /// The same model with these networks.
    pub fn with_networks(self, networks: Networks) -> Self {
        Self { networks, ..self }
    }

    /// How robots move between its rooms.
    pub fn transitions(&self) -> &Transitions {
        &self.transitions
    }

    /// What tells the pictures that it has learned from others, as [`Sample::picture`] does; none in files that do not say.
    pub fn learned_pictures(&self) -> BTreeSet<u64> {
        self.learned.pictures().collect()
    }

    /// How much each opinion holds, by name.
    pub fn sizes(&self) -> BTreeMap<&str, Size> {
        self.opinions().map(|(name, opinion)| (name, opinion.size())).collect()
    }

    /// How much each opinion counts, by name.
    pub fn weights(&self) -> BTreeMap<&str, f64> {
        self.opinions().map(|(name, opinion)| (name, opinion.weight)).collect()
    }

    fn opinions(&self) -> impl Iterator<Item = (&str, &Opinion)> {
        self.config.opinions.keys().map(String::as_str).zip(&self.classification.opinions)
    }

    /// From which probability on an answer is known; `None` when none ever is, since held-out answers were
    /// wrong too often at any.
    pub fn known_probability(&self) -> Option<f32> {
        self.classification.known.map(|known| known.least_probability)
    }

    /// Up to which novelty an answer is known; `None` when none ever is, or the model cannot tell.
    pub fn known_novelty(&self) -> Option<f32> {
        self.classification.novelty.as_ref()?;
        self.classification.known.map(|known| known.most_novelty)
    }

    /// Whether a robot may act on what a filter of its answers says: never where no single answer is known.
    pub fn knows(&self, filter: &RoomFilter) -> bool {
        self.known_probability().is_some() && filter.is_sure()
    }

    /// Whether it tells places that were never trained.
    pub fn tells_new_places(&self) -> bool {
        self.classification.novelty.is_some()
    }

    /// What sees in frames what its opinions look at.
    pub fn extractor(&self) -> &Extractor {
        &self.extractor
    }

    /// Makes it ready to see on so many threads at once, so that none has to wait on its first frame.
    ///
    /// # Errors
    /// A network that cannot be had so often.
    pub fn prepare(&self, n_threads: usize) -> Result<(), NetworkError> {
        self.extractor.prepare(n_threads)
    }

    /// Whether it looks at the scans of lasers, where frames bring them.
    pub fn wants_scans(&self) -> bool {
        self.extractor.laser().is_some()
    }

    /// Whether it looks at the colors of frames.
    pub fn wants_colors(&self) -> bool {
        self.extractor.wants_colors()
    }

    /// Decodes a frame of unknown origin to what the model looks at, as [`Extractor::decode`] does.
    pub fn decode(&self, bytes: &[u8], limits: &Limits) -> Result<Image, ImageError> {
        self.extractor.decode(bytes, limits)
    }

    /// Detects and describes all that its opinions look at.
    pub fn features<'a>(&self, frame: impl Into<Frame<'a>>, scratch: &mut Scratch) -> Features {
        self.extractor.extract(frame, scratch)
    }

    /// What spoke for and against a room, the strongest first: of each opinion that can tell, in units of its own
    /// decision values.
    pub fn explain(&self, features: &Features, room_idx: usize) -> Vec<Evidence> {
        let by_opinion = |(name, opinion): (&str, &Opinion)| {
            let of_clue = |Clue { x, y, likeness, weight }| Evidence {
                opinion: name.to_owned(),
                x: x * features.scale,
                y: y * features.scale,
                word_idx: match likeness {
                    Likeness::Word(word_idx) => Some(word_idx),
                    Likeness::Frame(_) => None,
                },
                frame: match likeness {
                    Likeness::Frame(frame_idx) => self.learned.name(frame_idx).map(str::to_owned),
                    Likeness::Word(_) => None,
                },
                weight,
            };
            opinion.clues(features, room_idx).into_iter().map(of_clue).collect::<Vec<_>>()
        };
        let mut evidence: Vec<Evidence> = self.opinions().flat_map(by_opinion).collect();
        evidence.sort_by(|a, b| b.weight.abs().total_cmp(&a.weight.abs()));
        evidence
    }
}

impl Classification {
    /// The answer to a frame of which opinions say this, of what they saw.
    fn recognition(
        &self,
        config: &Config,
        said: &[Option<Said>],
        seen: &[&Seen],
        flaw: Option<Flaw>,
    ) -> Recognition {
        let (probabilities, novelty) = self.answer(config, said);
        let known = self.known.filter(|_| said.iter().any(Option::is_some));
        Recognition::new(probabilities, novelty, known, seen, flaw)
    }

    /// The rooms' probabilities for a frame of which opinions say this, and how new it is, where any says something.
    fn answer(&self, config: &Config, said: &[Option<Said>]) -> (Vec<f32>, Option<f32>) {
        let by_opinion = self.opinions.iter().zip(said);
        let by_opinion: Vec<Option<Vec<f32>>> = by_opinion
            .map(|(opinion, said)| Some(opinion.calibration.probabilities(&said.as_ref()?.values)))
            .collect();
        let weights: Vec<f64> = self.opinions.iter().map(|opinion| opinion.weight).collect();
        let probabilities = pool::answer(&by_opinion, &weights, self.doubt, self.n_rooms);
        let sees = said.iter().any(Option::is_some);
        let novelty = self
            .novelty
            .as_ref()
            .filter(|_| sees)
            .map(|novelty| novelty.of(&novelty::signs_of(config, said, &by_opinion, &probabilities)));
        (probabilities, novelty)
    }

    /// What each opinion says of a frame.
    fn said(&self, features: &Features) -> Vec<Option<Said>> {
        self.opinions.iter().map(|opinion| opinion.answer(features)).collect()
    }

    /// What opinions keep to go on from, in all.
    fn n_kept(&self) -> usize {
        self.opinions.iter().map(|opinion| opinion.size().n_kept).sum()
    }
}

impl Recognition {
    /// The answer to a frame of which this was seen, where so much is known.
    fn new(
        probabilities: Vec<f32>,
        novelty: Option<f32>,
        known: Option<Known>,
        seen: &[&Seen],
        flaw: Option<Flaw>,
    ) -> Self {
        let room_idx = most_probable(&probabilities);
        let is_trusted = known.is_some_and(|known| known.holds(probabilities[room_idx], novelty));
        let is_new = novelty.is_some_and(|novelty| novelty > known.map_or(EVEN, |known| known.most_novelty));
        let nothing_seen = seen.iter().all(|seen| seen.is_nothing());
        let unknown = match flaw {
            Some(Flaw::Dark) => Some(Unknown::Dark),
            Some(Flaw::Covered) => Some(Unknown::Covered),
            Some(Flaw::Flat) => Some(Unknown::NoDetail),
            None if nothing_seen => Some(Unknown::NoDetail),
            None if is_trusted => None,
            None if is_new => Some(Unknown::NewPlace),
            None => Some(Unknown::Unsure),
        };
        let n_keypoints =
            seen.iter().filter_map(|seen| seen.local()).map(|local| local.keypoints.len()).sum();
        let known = unknown.is_none();
        Self { room_idx, known, novelty, unknown, probabilities, n_keypoints, is_early: false }
    }
}

/// Above this novelty a frame is more probably of another place than not.
const EVEN: f32 = 0.5;

#[cfg(test)]
pub(crate) mod tests;
