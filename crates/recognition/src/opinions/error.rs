//! Why nothing was learned.

use crate::classify::boost::BoostError;
use crate::classify::memory::MemoryError;
use crate::classify::svm::SvmError;
use crate::vocabulary::VocabularyError;

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
    TooFewRooms(usize),
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
    pub(crate) fn of(self, name: &str) -> Self {
        Self::Opinion { name: name.to_owned(), error: Box::new(self) }
    }
}

/// Why nothing was added to a model, or forgotten by it.
#[derive(Debug, thiserror::Error)]
pub enum AddError {
    /// A classifier without anything to go on from.
    #[error(
        "a model with the classifier {classifier} does not keep what training needs to go on: train one with \
         classifier.kind = linear_svm or kernel_svm, or by default"
    )]
    Classifier {
        /// Its name in a configuration.
        classifier: &'static str,
    },
    /// A classifier that does not know which frames it learned from.
    #[error(
        "a model with the classifier {classifier} does not know what came from which frame, so it cannot forget one: \
         train one with classifier.kind = linear_svm, or by default"
    )]
    Unforgettable {
        /// Its name in a configuration.
        classifier: &'static str,
    },
    /// A model file of an earlier version.
    #[error(
        "the version of roomsight that trained this model did not keep what training needs to go on: train \
         it again"
    )]
    NothingKept,
    /// Frames that the model knows say nothing of how well it does.
    #[error(
        "the model has learned the sequence {sequence} before, so it cannot be answered as new: leave it out, \
         or give new frames another name"
    )]
    KnownSequence {
        /// Its name.
        sequence: String,
    },
    /// Every support vector of a room was dropped.
    #[error("the model has forgotten {room}: add frames of it, or forget less")]
    ForgottenRoom {
        /// The room.
        room: String,
    },
    /// A class that has no frame left, before its name is known.
    #[error("the model has forgotten a room: add frames of it, or forget less")]
    ForgottenClass {
        /// Its number.
        class_idx: usize,
    },
    /// What is to be forgotten was never learned.
    #[error("the model has learned no {what} called {name}: {learned}")]
    NeverLearned {
        /// A drive or a room.
        what: &'static str,
        /// As it was called.
        name: String,
        /// What there is.
        learned: String,
    },
    /// What would be left is no model.
    #[error("without it the model would know {0} rooms only: it needs two")]
    TooFewLeft(usize),
    /// No calibration.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// No support vector machine.
    #[error(transparent)]
    Svm(#[from] SvmError),
}
