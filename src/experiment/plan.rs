//! What each experiment trains and answers, and what its paper prints.

mod lu;
mod ullah;

use super::{Drives, Experiment, ExperimentError};
use crate::model::Config;
use serde::Serialize;

/// An experiment, laid out on the drives that there are.
#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    /// Which experiment.
    pub experiment: Experiment,
    /// What it is about.
    pub title: String,
    /// Where the paper reports it.
    pub source: &'static str,
    /// How its chart looks.
    pub chart: Chart,
    /// What is done otherwise than in the paper.
    pub differences: Vec<&'static str>,
    /// What is measured, in the order in which it is.
    pub cells: Vec<Cell>,
}

/// How the rates of a plan are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Chart {
    /// A group of bars a row, a bar a column.
    Bars,
    /// A line a column over the rows.
    Lines,
}

/// One figure of a table.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// Its row.
    pub row: String,
    /// Its column.
    pub column: String,
    /// What is trained and answered; the figure is the mean over all.
    #[serde(skip)]
    pub splits: Vec<Split>,
    /// What is trained.
    #[serde(skip)]
    pub config: Config,
    /// What is hidden of the answered frames.
    #[serde(skip)]
    pub occlusion: Occlusion,
    /// The rate that the paper prints, of COLD.
    pub printed: Option<f64>,
}

/// Drives that train, and others that are answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Split {
    /// Indices of drives.
    pub train: Vec<usize>,
    /// Indices of drives.
    pub test: Vec<usize>,
}

/// Stripes of a frame whose pixels are not looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Occlusion {
    /// How much is hidden, in sixteenths of the frame, from 0 to 8.
    pub sixteenths: u8,
}

impl Experiment {
    /// What it trains and answers of these drives, with `base` for all parameters that it does not set.
    ///
    /// # Errors
    /// Drives that it needs are missing.
    pub fn plan(self, drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
        match self {
            Self::Features => lu::features(drives, base),
            Self::Keypoints => lu::keypoints(drives, base),
            Self::Words => lu::words(drives, base),
            Self::Kernels => lu::kernels(drives, base),
            Self::Illumination => lu::illumination(drives, base),
            Self::Best => lu::best(drives, base),
            Self::Occlusion => lu::occlusion(drives, base),
            Self::Dynamic => Ok(ullah::dynamic(drives, base)),
            Self::Geographic => Ok(ullah::geographic(drives, base)),
            Self::Categorical => ullah::categorical(drives, base),
        }
        .and_then(|plan| {
            if plan.cells.is_empty() {
                Err(self.missing("drives that fit together", drives))
            } else {
                Ok(plan)
            }
        })
    }

    fn missing(self, needed: &str, drives: &Drives) -> ExperimentError {
        ExperimentError::MissingDrives {
            experiment: self.to_string(),
            needed: needed.to_owned(),
            present: drives.names(),
        }
    }
}
