//! Labeled frames to a model.

use super::{Config, Features, Model, Pose, Recognition, Trials, Unit};
use crate::boost::BoostError;
use crate::memory::MemoryError;
use crate::svm::SvmError;
use crate::vocabulary::VocabularyError;
use roomsight_vision::camera::Camera;

/// One labeled frame, described.
#[derive(Clone, Debug)]
pub struct Sample {
    /// The room that it shows, or [`ELSEWHERE`].
    pub place: String,
    /// The drive that it comes from; empty when unknown.
    pub sequence: String,
    /// What it is called, such as its path in the data set; may be empty.
    pub name: String,
    /// Where it was taken, if that is known.
    pub pose: Option<Pose>,
    /// What tells its picture from others: the first bytes of the BLAKE3 digest of its file, if it came from one.
    pub picture: Option<u64>,
    /// What an [`Extractor`] of the model's configuration and camera found.
    pub features: Features,
}

/// The place of frames that show none of the rooms: they tell what new places look like, and are never a room.
pub const ELSEWHERE: &str = "elsewhere";

impl Sample {
    /// Whether it shows none of the rooms.
    pub fn is_elsewhere(&self) -> bool {
        self.place == ELSEWHERE
    }
}

/// A model and how it did on frames it had not seen.
#[derive(Debug)]
pub struct Training {
    /// The model, trained on all samples.
    pub model: Model,
    /// Answers to samples of rooms by models trained without the sample's fold.
    pub held_out: Vec<HeldOut>,
    /// Whether the folds are of single frames although these came in sequences: the sequences show other parts of the rooms,
    /// so that each would tell nothing of the others.
    pub are_single_frames: bool,
}

/// The answer to a sample by a model trained and calibrated without it.
#[derive(Clone, Debug)]
pub struct HeldOut {
    /// Which sample.
    pub sample_idx: usize,
    /// The answer; its places are [`Model::places`].
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

/// Why no model was made.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// A parameter makes no sense.
    #[error("the configuration is wrong: {0}")]
    Config(String),
    /// What one of several opinions cannot learn.
    #[error("of the opinion {name}: {error}")]
    Opinion {
        /// Its name.
        name: String,
        /// Why not.
        error: Box<Self>,
    },
    /// Samples of an extractor of another configuration.
    #[error("the frames were described for another configuration: describe them for this one")]
    OtherSights,
    /// Fewer than two rooms.
    #[error("a model needs frames of at least two rooms; these show {0}")]
    TooFewPlaces(usize),
    /// No vocabulary.
    #[error(transparent)]
    Vocabulary(#[from] VocabularyError),
    /// No support vector machine.
    #[error(transparent)]
    Svm(#[from] SvmError),
    /// No memory.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// No ensembles.
    #[error(transparent)]
    Boost(#[from] BoostError),
}

impl TrainError {
    /// The same of an opinion.
    pub(super) fn of(self, name: &str) -> Self {
        Self::Opinion { name: name.to_owned(), error: Box::new(self) }
    }
}

impl Model {
    /// Trains on samples that were described by `extractor`, which was made from the same `config`.
    ///
    /// Probabilities and weights of opinions are fitted on held-out folds; see [`crate::folds`]. Where no room has two
    /// frames nothing can be held out: they are those that are taken where nothing is known, and no answer is known.
    /// The result depends on the arguments alone. Samples do not say when they were taken: transitions between rooms are left to
    /// [`Model::with_transitions`]. `progress` is called before each step.
    pub fn train(
        samples: &[&Sample],
        config: &Config,
        camera: Camera,
        mut progress: impl FnMut(TrainingStep),
    ) -> Result<Training, TrainError> {
        Trials::run(samples, config, Unit::Drives, &mut progress)?.finish(config, camera, progress)
    }
}
