//! Opinions: the ways to tell rooms apart that a model may have, each in a file of its own.
//!
//! To add one, write its file: a configuration that says what it looks at ([`Sight`]), what is wrong with its
//! parameters, which are worth trying, how it is calibrated, how much it counts where nothing is known and what its answers tell of how
//! familiar a frame is ([`Sign`]); and a [`Recognizer`] that is trained, answers, goes on learning, gives its reasons, and has arrays. Then name both in the enums here. Everything else
//! (calibration, weights, the file, evaluation, tuning, experiments) works on opinions without knowing which.

pub(crate) mod calibration;
pub(crate) mod error;
mod kept;
mod laser;
pub(crate) mod logit;
mod machines;
mod memory;
mod patterns;
pub(crate) mod pool;
mod vector;
mod whole;

pub use laser::LaserConfig;
pub use machines::{Classifier, MachinesConfig, Representation};
pub use memory::{MemoryConfig, Remembered};
pub use patterns::PatternsConfig;
pub use vector::VectorConfig;

use crate::file::arrays::{Array, Arrays};
use crate::file::error::FormatError;
use crate::look::features::Features;
use crate::look::lens::Lens;
use crate::look::sight::{Seen, Sight};
use crate::opinions::calibration::{Calibration, Way};
use crate::opinions::error::{AddError, TrainError};
use laser::Laser;
use machines::Machines;
use memory::Remembrance;
use patterns::Patterns;
use roomsight_vision::camera::CameraKind;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use vector::Vector;
use whole::WholeConfig;

/// A training frame by its number, as an opinion finds it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Near {
    /// Its number among the frames that the model has learned.
    pub(crate) frame_idx: usize,
    pub(crate) nearness: f32,
    /// Columns and rows in what was looked at.
    pub(crate) points: Vec<[f32; 2]>,
}

/// A way to tell rooms apart, with its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum OpinionConfig {
    /// Machines over the local features of a frame.
    Machines(MachinesConfig),
    /// Machines over the patterns of the whole frame.
    Patterns(PatternsConfig),
    /// Machines over the vector of a network.
    Vector(VectorConfig),
    /// A memory of local features.
    Memory(MemoryConfig),
    /// Machines over the scan of a laser.
    Laser(LaserConfig),
}

/// A parameter of an opinion, and values of it that are worth trying, as in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tries {
    /// Its name within the opinion.
    pub parameter: &'static str,
    /// The values.
    pub values: &'static [&'static str],
}

/// What an opinion says of a frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Said {
    /// The decision values: one finite number a machine or room, as [`Way`] says.
    pub(crate) values: Vec<f32>,
    /// How much the frame looks like what was learned, whatever room it may be: one finite number for each of
    /// [`OpinionConfig::signs`], larger where it is more familiar.
    pub(crate) signs: Vec<f32>,
}

impl Said {
    /// The same for other rooms or machines.
    pub(crate) fn with_values(&self, values: Vec<f32>) -> Self {
        Self { values, signs: self.signs.clone() }
    }
}

/// A sign of how familiar a frame is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sign {
    /// What people call it.
    pub(crate) name: &'static str,
    /// How much it counts where nothing is known of how well it tells, in standard deviations over frames of trained
    /// rooms.
    pub(crate) prior_weight: f64,
}

/// What a kind of opinion learns from frames, and says of them.
pub(crate) trait Recognizer: Sized {
    type Config;
    /// What trainings on parts of the same frames have in common.
    type Prepared;

    /// Looks at all training frames once.
    fn prepare(config: &Self::Config, frames: &[&Seen], seed: u64) -> Result<Self::Prepared, TrainError>;

    /// Learns from some of these frames.
    fn train(
        config: &Self::Config,
        prepared: &Self::Prepared,
        frames: &[&Seen],
        chosen: &Chosen,
    ) -> Result<Self, TrainError>;

    /// What it says of a frame; `None` of one that shows it nothing.
    fn answer(&self, seen: &Seen) -> Option<Said>;

    /// Whether it keeps what [`Recognizer::add`] needs.
    fn check_addition(&self) -> Result<(), AddError>;

    /// Learns more frames in addition.
    fn add(&self, addition: &Added) -> Result<Self, AddError>;

    /// Forgets frames, and the rooms of which none is left.
    fn without(&self, left: &Left) -> Result<Self, AddError>;

    /// What spoke for and against a room, in any order; nothing where it cannot be told.
    fn clues(&self, seen: &Seen, room_idx: usize) -> Vec<Clue>;

    /// The training frames that are most like a frame, the nearest first, at most so many; none where none are kept.
    fn nearest(&self, seen: &Seen, n_frames: usize) -> Vec<Near>;

    /// All that [`Recognizer::from_arrays`] needs beside the configuration.
    fn to_arrays(&self) -> Vec<Array>;

    /// One of unknown origin that fits its checked configuration and `shape`, and cannot fail to answer.
    fn from_arrays(config: &Self::Config, shape: Shape, arrays: &Arrays) -> Result<Self, FormatError>;

    /// What people and tables are told of it.
    fn size(&self) -> Size;
}

/// Frames to learn from.
pub(crate) struct Chosen<'a> {
    /// Which of all.
    pub(crate) frame_idxs: &'a [usize],
    /// The class of each of these, below `n_classes`; no class is without a frame.
    pub(crate) labels: &'a [usize],
    pub(crate) n_classes: usize,
}

/// Frames that are learned in addition.
pub(crate) struct Added<'a> {
    /// What is seen of them.
    pub(crate) frames: &'a [&'a Seen],
    /// The room of each frame that was learned, those in addition last, as rooms are numbered from now on.
    pub(crate) labels: &'a [usize],
    pub(crate) n_rooms: usize,
    /// Which number each room of before has from now on; ascending.
    pub(crate) of_earlier: &'a [usize],
    /// The share at which support vectors are dropped; see [`crate::model::Model::add`].
    pub(crate) forget: f64,
}

/// Frames that are left when others are forgotten.
pub(crate) struct Left<'a> {
    /// Whether each frame that was learned is left.
    pub(crate) is_left: &'a [bool],
    /// The room of each that is left, as rooms are numbered from now on.
    pub(crate) labels: &'a [usize],
    pub(crate) n_rooms: usize,
}

/// What the arrays of an opinion must agree with.
#[derive(Clone, Copy)]
pub(crate) struct Shape {
    /// The kind of camera whose frames it answers.
    pub(crate) camera: CameraKind,
    pub(crate) n_rooms: usize,
    /// Of what it looks at; see [`Sight`].
    pub(crate) n_dimensions: usize,
    /// The number of frames that the model says it has learned; 0 in files that do not say.
    pub(crate) n_frames: usize,
}

/// How much an opinion holds.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Size {
    /// The words of its vocabulary, if it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n_words: Option<usize>,
    /// The training frames that each of its machines rests on; none where they rest on none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub n_support_vectors: Vec<usize>,
    /// What it keeps of the frames that it has learned, to go on from: support vectors, rows or descriptors.
    pub n_kept: usize,
}

/// A keypoint's share in what an opinion says of a room.
pub(crate) struct Clue {
    /// In pixels of the frame at working size.
    pub(crate) x: f32,
    pub(crate) y: f32,
    pub(crate) likeness: Likeness,
    /// Its share in the decision value of the room; negative speaks against it.
    pub(crate) weight: f32,
}

/// What a keypoint looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Likeness {
    /// This word of the opinion's vocabulary.
    Word(usize),
    /// Something in this frame that was learned.
    Frame(usize),
}

/// A configuration, and what its trainings have in common.
pub(crate) enum Learner<'a> {
    Machines(&'a MachinesConfig, <Machines as Recognizer>::Prepared),
    Patterns(&'a PatternsConfig, <Patterns as Recognizer>::Prepared),
    Vector(&'a VectorConfig, <Vector as Recognizer>::Prepared),
    Memory(&'a MemoryConfig, <Remembrance as Recognizer>::Prepared),
    Laser(&'a LaserConfig, <Laser as Recognizer>::Prepared),
}

/// What has learned to tell rooms apart.
#[derive(Clone, Debug)]
pub(crate) enum Trained {
    Machines(Machines),
    Patterns(Patterns),
    Vector(Vector),
    Memory(Remembrance),
    Laser(Laser),
}

/// Calls what all kinds have.
macro_rules! of_each {
    ($kinds:ident, $value:expr, $inner:ident => $body:expr) => {
        match $value {
            $kinds::Machines($inner) => $body,
            $kinds::Patterns($inner) => $body,
            $kinds::Vector($inner) => $body,
            $kinds::Memory($inner) => $body,
            $kinds::Laser($inner) => $body,
        }
    };
}

/// The same for what gives one of the kind again.
macro_rules! again_each {
    ($value:expr, $inner:ident => $body:expr) => {
        match $value {
            Trained::Machines($inner) => Trained::Machines($body),
            Trained::Patterns($inner) => Trained::Patterns($body),
            Trained::Vector($inner) => Trained::Vector($body),
            Trained::Memory($inner) => Trained::Memory($body),
            Trained::Laser($inner) => Trained::Laser($body),
        }
    };
}

impl OpinionConfig {
    /// What it looks at.
    pub fn sight(&self) -> Sight {
        of_each!(Self, self, config => config.sight())
    }

    /// The network that it looks through, if it does, to be linked.
    pub(crate) fn lens_mut(&mut self) -> Option<&mut Lens> {
        of_each!(Self, self, config => config.lens_mut())
    }

    /// Whether what it learns depends on the seed when frames of known sequences are compared with each other.
    pub fn is_random(&self) -> bool {
        of_each!(Self, self, config => config.is_random())
    }

    /// What is worth trying where it is to do better on other frames than those that the defaults were chosen on. None changes
    /// what it looks at.
    pub fn tries(&self) -> Vec<Tries> {
        of_each!(Self, self, config => config.tries())
    }

    /// What is wrong with the parameters beside those of its sight, if anything.
    pub(crate) fn check(&self) -> Result<(), String> {
        of_each!(Self, self, config => config.check())
    }

    /// How it is calibrated.
    pub(crate) fn way(&self) -> Way {
        of_each!(Self, self, config => config.way())
    }

    /// How much it counts beside others where nothing is known of how well it does.
    pub(crate) fn prior_weight(&self) -> f64 {
        of_each!(Self, self, config => config.prior_weight())
    }

    /// What its answers tell of how familiar a frame is, in their order.
    pub(crate) fn signs(&self) -> &'static [Sign] {
        of_each!(Self, self, config => config.signs())
    }

    /// Looks at all training frames once.
    pub(crate) fn learner(&self, frames: &[&Seen], seed: u64) -> Result<Learner<'_>, TrainError> {
        Ok(match self {
            Self::Machines(config) => Learner::Machines(config, Machines::prepare(config, frames, seed)?),
            Self::Patterns(config) => Learner::Patterns(config, Patterns::prepare(config, frames, seed)?),
            Self::Vector(config) => Learner::Vector(config, Vector::prepare(config, frames, seed)?),
            Self::Memory(config) => Learner::Memory(config, Remembrance::prepare(config, frames, seed)?),
            Self::Laser(config) => Learner::Laser(config, Laser::prepare(config, frames, seed)?),
        })
    }

    /// One of unknown origin.
    pub(crate) fn read(&self, shape: Shape, arrays: &Arrays) -> Result<Trained, FormatError> {
        Ok(match self {
            Self::Machines(config) => Trained::Machines(Machines::from_arrays(config, shape, arrays)?),
            Self::Patterns(config) => Trained::Patterns(Patterns::from_arrays(config, shape, arrays)?),
            Self::Vector(config) => Trained::Vector(Vector::from_arrays(config, shape, arrays)?),
            Self::Memory(config) => Trained::Memory(Remembrance::from_arrays(config, shape, arrays)?),
            Self::Laser(config) => Trained::Laser(Laser::from_arrays(config, shape, arrays)?),
        })
    }
}

impl Learner<'_> {
    pub(crate) fn train(&self, frames: &[&Seen], chosen: &Chosen) -> Result<Trained, TrainError> {
        Ok(match self {
            Self::Machines(config, prepared) => {
                Trained::Machines(Machines::train(config, prepared, frames, chosen)?)
            }
            Self::Patterns(config, prepared) => {
                Trained::Patterns(Patterns::train(config, prepared, frames, chosen)?)
            }
            Self::Vector(config, prepared) => {
                Trained::Vector(Vector::train(config, prepared, frames, chosen)?)
            }
            Self::Memory(config, prepared) => {
                Trained::Memory(Remembrance::train(config, prepared, frames, chosen)?)
            }
            Self::Laser(config, prepared) => Trained::Laser(Laser::train(config, prepared, frames, chosen)?),
        })
    }

    /// What one of those that it trained says of one of the same frames.
    pub(crate) fn answer(&self, trained: &Trained, frames: &[&Seen], frame_idx: usize) -> Option<Said> {
        match (self, trained) {
            (Self::Machines(_, prepared), Trained::Machines(machines)) => {
                machines.answer_prepared(prepared, frames, frame_idx)
            }
            _ => trained.answer(frames[frame_idx]),
        }
    }
}

impl Trained {
    pub(crate) fn answer(&self, seen: &Seen) -> Option<Said> {
        of_each!(Self, self, recognizer => recognizer.answer(seen))
    }

    pub(crate) fn check_addition(&self) -> Result<(), AddError> {
        of_each!(Self, self, recognizer => recognizer.check_addition())
    }

    pub(crate) fn add(&self, added: &Added) -> Result<Self, AddError> {
        Ok(again_each!(self, recognizer => recognizer.add(added)?))
    }

    pub(crate) fn without(&self, left: &Left) -> Result<Self, AddError> {
        Ok(again_each!(self, recognizer => recognizer.without(left)?))
    }

    fn clues(&self, seen: &Seen, room_idx: usize) -> Vec<Clue> {
        of_each!(Self, self, recognizer => recognizer.clues(seen, room_idx))
    }

    fn to_arrays(&self) -> Vec<Array> {
        of_each!(Self, self, recognizer => recognizer.to_arrays())
    }

    fn nearest(&self, seen: &Seen, n_frames: usize) -> Vec<Near> {
        of_each!(Self, self, recognizer => recognizer.nearest(seen, n_frames))
    }

    fn size(&self) -> Size {
        of_each!(Self, self, recognizer => recognizer.size())
    }
}

#[cfg(test)]
impl Trained {
    /// As in files of versions that did not keep the rooms of support vectors.
    pub(crate) fn forget_support_labels(&mut self) {
        if let Self::Machines(machines) = self {
            machines.forget_support_labels();
        }
    }
}

/// One opinion of a model.
#[derive(Clone, Debug)]
pub(crate) struct Opinion {
    /// How it looks at frames.
    pub(crate) sight: Sight,
    pub(crate) trained: Arc<Trained>,
    pub(crate) calibration: Calibration,
    pub(crate) weight: f64,
}

impl Opinion {
    /// `None` of a frame that shows it nothing. Of a picture in which nothing can be seen, it is not asked where a scan is.
    pub(crate) fn answer(&self, features: &Features) -> Option<Said> {
        let is_blind = features.flaw.is_some() && self.sight.laser().is_none() && features.has_scan();
        self.trained.answer(features.of(&self.sight).filter(|_| !is_blind)?)
    }

    /// What spoke for and against a room.
    pub(crate) fn clues(&self, features: &Features, room_idx: usize) -> Vec<Clue> {
        features.of(&self.sight).map_or_else(Vec::new, |seen| self.trained.clues(seen, room_idx))
    }

    /// The training frames that are most like a frame; see [`Recognizer::nearest`].
    pub(crate) fn nearest(&self, features: &Features, n_frames: usize) -> Vec<Near> {
        features.of(&self.sight).map_or_else(Vec::new, |seen| self.trained.nearest(seen, n_frames))
    }

    pub(crate) fn size(&self) -> Size {
        self.trained.size()
    }

    /// Named as within the opinion.
    pub(crate) fn to_arrays(&self) -> Vec<Array> {
        let mut arrays = self.trained.to_arrays();
        arrays.extend(self.calibration.to_arrays());
        arrays
    }
}
