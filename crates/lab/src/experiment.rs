//! The experiments of the two papers, and one beside them, on sequences laid out as the COLD database.
//!
//! The papers, **Lu** and **Ullah**, are cited by [`Paper::citation`]. An [`Experiment`] makes a [`Plan`]: cells of a table, each trained on some drives and measured on others.
//! [`run()`] fills the cells over several seeds; [`report`] writes them.

mod cache;
mod cost;
mod drives;
mod measured;
mod paper;
mod plan;
pub mod report;
mod run;
mod stability;

pub use cache::Cache;
pub use drives::{Drive, Drives, Occlusion};
pub use measured::{Cost, FrameAnswer, KeypointCounts, Matches, Measured, Rates};
pub use paper::Paper;
pub use plan::{Cell, Chart, Plan, Split, Work};
pub use run::{SOURCES, Step, run};

#[cfg(feature = "clap")]
use clap::ValueEnum;
use serde::Serialize;
use std::fmt;
use std::io;
use std::path::PathBuf;

/// An experiment of one of the papers, or beside them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[cfg_attr(feature = "clap", derive(ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Experiment {
    /// Local features (Lu, table 1)
    Features,
    /// Keypoints found again in other light (Lu, table 2)
    Stability,
    /// Keypoints a frame in different light (Lu, figure 5)
    Keypoints,
    /// The number of words (Lu, figure 7)
    Words,
    /// Kernels over bags (Lu, table 3)
    Kernels,
    /// The light that is trained in (Lu, table 4)
    Illumination,
    /// Confusion matrices, errors on the map, and the match kernel (Lu, tables 5 to 7)
    Best,
    /// Parts of the frames hidden (Lu, figure 13)
    Occlusion,
    /// Time and memory (Lu, section 6.8)
    Cost,
    /// Each opinion that --effort has, each pair, and all (beside the papers)
    Opinions,
    /// Every pair of drives of a lab (Ullah, figure 4)
    Dynamic,
    /// The same parameters in every lab (Ullah, section V)
    Geographic,
    /// Rooms of a lab that was never seen (Ullah, figure 6)
    Categorical,
}

impl fmt::Display for Experiment {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&format!("{self:?}").to_lowercase())
    }
}

/// Why an experiment was not run.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// No drive has a name of COLD.
    #[error(
        "no sequence is named as those of COLD are (seq3_cloudy1): experiments need to know lab, path and \
         light; use `validate` for other data"
    )]
    NoDrives,
    /// Drives that an experiment cannot do without.
    #[error("{experiment} needs {needed}, and there are only: {present}")]
    MissingDrives {
        /// The experiment.
        experiment: String,
        /// What it needs.
        needed: String,
        /// What there is.
        present: String,
    },
    /// A drive through one room.
    #[error("sequence {0} shows one room only: nothing can be told apart")]
    OneRoom(String),
    /// The frames show no mirror.
    #[error("no mirror was found in the frames of {0}: take frames of one size, from a robot that moves")]
    NoMirror(String),
    /// Nothing of a drive could be read.
    #[error("none of the frames of {0} can be read")]
    Unreadable(String),
    /// Frames fewer than the folds of calibration.
    #[error(
        "sequence {sequence} has {n_frames} frames, fewer than the {n_folds} folds of calibration: take more of its \
         frames (--stride), or lower calibration.n_folds"
    )]
    TooShort {
        /// The sequence.
        sequence: String,
        /// Its frames.
        n_frames: usize,
        /// The folds.
        n_folds: usize,
    },
    /// Parameters that do not fit the experiment.
    #[error("{experiment}: {reason}")]
    Config {
        /// The experiment.
        experiment: String,
        /// What does not fit.
        reason: String,
    },
    /// One cell cannot be measured; the report says why in its place.
    #[error("{0}")]
    Impossible(String),
    /// The disk said no.
    #[error("cannot write {path}: {source}", path = path.display())]
    Write {
        /// What was written.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
}
