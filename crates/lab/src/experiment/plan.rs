//! What each experiment trains and answers, and what its paper prints.

mod lu;
mod ullah;

use super::{Drives, Experiment, ExperimentError, Occlusion};
use roomsight_recognition::classify::svm::Scheme;
use roomsight_recognition::model::{Config, MachinesConfig, Sigmoids};
use serde::Serialize;
use std::collections::BTreeSet;

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
    /// What its rows are, with the unit where they are numbers.
    pub rows_are: &'static str,
    /// What the paper prints besides the figures that stand beside cells, of COLD.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub printed: Option<&'static str>,
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
    /// A line a column over the parameter of the rows.
    Lines,
    /// They are not.
    Table,
}

/// One figure of a table.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// Its row.
    pub row: String,
    /// Its column.
    pub column: String,
    /// What the row says, where it is a number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameter: Option<f64>,
    /// The parameters.
    #[serde(skip)]
    pub config: Config,
    /// What is done with them.
    #[serde(skip)]
    pub work: Work,
    /// The rate that the paper prints, of COLD.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub printed: Option<f64>,
}

/// What a cell is measured by.
#[derive(Clone, Debug)]
pub enum Work {
    /// Frames are answered.
    Rate {
        /// What is trained and answered; the figure is the mean over all.
        splits: Vec<Split>,
        /// What is hidden of the answered frames.
        occlusion: Occlusion,
    },
    /// Keypoints of two drives are compared.
    Match {
        /// Indices of drives.
        drives: [usize; 2],
    },
    /// A model is timed.
    Cost {
        /// The index of the drive that it is trained on.
        train: usize,
        /// The index of the drive that it answers.
        test: usize,
    },
}

/// Drives that train, and others that are answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Split {
    /// Indices of drives.
    pub train: Vec<usize>,
    /// Indices of drives.
    pub test: Vec<usize>,
}

impl Experiment {
    /// What it trains and answers of these drives, with `base` for all parameters that it does not set.
    ///
    /// # Errors
    /// Drives that it needs are missing, or too short for the folds; parameters that do not go together.
    pub fn plan(self, drives: &Drives, base: &Config) -> Result<Plan, ExperimentError> {
        let base = &quickly_calibrated(base.clone());
        match self {
            Self::Features => lu::features(drives, base),
            Self::Stability => lu::stability(drives, base),
            Self::Keypoints => lu::keypoints(drives, base),
            Self::Words => lu::words(drives, base),
            Self::Kernels => lu::kernels(drives, base),
            Self::Illumination => lu::illumination(drives, base),
            Self::Best => lu::best(drives, base),
            Self::Occlusion => lu::occlusion(drives, base),
            Self::Cost => lu::cost(drives, base),
            Self::Opinions => lu::opinions(drives, base),
            Self::Dynamic => Ok(ullah::dynamic(drives, base)),
            Self::Geographic => Ok(ullah::geographic(drives, base)),
            Self::Categorical => ullah::categorical(drives, base),
        }
        .and_then(|mut plan| {
            if plan.cells.is_empty() {
                return Err(self.missing("drives that fit together", drives));
            }
            if self.paper().is_some_and(|paper| !paper.is_on(drives)) {
                plan.forget_printed();
            }
            plan.cells.iter().try_for_each(|cell| self.check(cell, drives))?;
            Ok(plan)
        })
    }

    /// What would otherwise show only after hours.
    fn check(self, cell: &Cell, drives: &Drives) -> Result<(), ExperimentError> {
        let reason = |reason| ExperimentError::Config { experiment: self.to_string(), reason };
        cell.config.check().map_err(reason)?;
        let n_folds = cell.config.calibration.n_folds;
        let trained: Vec<usize> = match &cell.work {
            Work::Rate { splits, .. } => splits.iter().flat_map(|split| split.train.clone()).collect(),
            Work::Match { .. } => Vec::new(),
            Work::Cost { train, .. } => vec![*train],
        };
        let trained = trained.into_iter().map(|drive_idx| drives.get(drive_idx));
        match trained.min_by_key(|drive| drive.dataset.frames.len()) {
            Some(drive) if drive.dataset.frames.len() < n_folds => Err(ExperimentError::TooShort {
                sequence: drive.sequence.clone(),
                n_frames: drive.dataset.frames.len(),
                n_folds,
            }),
            _ => Ok(()),
        }
    }

    fn missing(self, needed: &str, drives: &Drives) -> ExperimentError {
        ExperimentError::MissingDrives {
            experiment: self.to_string(),
            needed: needed.to_owned(),
            present: drives.names(),
        }
    }
}

/// The answers to one drive after training on others, without anything hidden; the paper prints nothing for it.
fn cell(row: &str, column: &str, train: &[usize], test: usize, config: Config) -> Cell {
    Cell {
        row: row.to_owned(),
        column: column.to_owned(),
        parameter: None,
        config,
        work: Work::Rate {
            splits: vec![Split { train: train.to_vec(), test: vec![test] }],
            occlusion: Occlusion::default(),
        },
        printed: None,
    }
}

/// One sigmoid for machines of one class each decides how sure answers are, but not which they are: two folds are
/// enough to fit it.
fn quickly_calibrated(mut config: Config) -> Config {
    let is_one_vs_all = |machines: &MachinesConfig| {
        machines.classifier.scheme() == Scheme::OneVsAll && config.opinions.len() == 1
    };
    if config.calibration.sigmoids == Sigmoids::Shared && config.machines().is_some_and(is_one_vs_all) {
        config.calibration.n_folds = 2;
    }
    config
}

impl Plan {
    /// Leaves out what the paper prints: figures of other frames.
    pub fn forget_printed(&mut self) {
        self.printed = None;
        self.cells.iter_mut().for_each(|cell| cell.printed = None);
    }

    /// The names of the rows and of the columns, in the order in which they first occur.
    pub(super) fn axes(&self) -> (Vec<&str>, Vec<&str>) {
        let in_order = |name: fn(&Cell) -> &str| {
            let mut seen = BTreeSet::new();
            self.cells.iter().map(name).filter(|name| seen.insert(*name)).collect()
        };
        (in_order(|cell| &cell.row), in_order(|cell| &cell.column))
    }
}
