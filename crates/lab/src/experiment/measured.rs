//! What comes out of a cell.

use super::Drives;
use crate::evaluate::{Answer, Evaluation, Summary};
use serde::{Deserialize, Serialize};

/// The answer to one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameAnswer {
    /// Which frame of the drive.
    pub frame_idx: usize,
    /// The room that was answered.
    #[serde(rename = "place")]
    pub room: String,
    /// How many keypoints the answer rests on.
    pub n_keypoints: usize,
}

/// A cell, measured.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Measured {
    /// How often the right room was answered.
    Rates(Box<Rates>),
    /// Keypoints found again in other light.
    Matches(Matches),
    /// Time and memory.
    Cost(Cost),
    /// It cannot be measured on these drives; the other cells can.
    Impossible {
        /// Why not.
        reason: String,
    },
}

/// Shares of right answers.
#[derive(Clone, Debug, Serialize)]
pub struct Rates {
    /// Over the seeds: the mean, over the splits, of the rates of the answered frames.
    pub rate: Option<Summary>,
    /// Over the seeds: the same away from room borders.
    pub without_border: Option<Summary>,
    /// Of the best seed, all splits together.
    pub best: Evaluation,
    /// The best seed.
    pub best_seed: u64,
    /// Of the best seed: the answers to each answered drive.
    #[serde(skip)]
    pub best_answers: Vec<(usize, Vec<FrameAnswer>)>,
    /// Of the best seed.
    pub keypoints: KeypointCounts,
}

/// How many keypoints the answered frames have.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct KeypointCounts {
    /// Of the frame that has fewest.
    pub least: usize,
    /// Over the frames.
    pub mean: f64,
    /// Of the frame that has most.
    pub most: usize,
}

/// Means over pairs of frames that show one place in two kinds of light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Matches {
    /// How many pairs.
    pub n_pairs: usize,
    /// Keypoints found in the frame of the one drive, and of the other.
    pub found: [f64; 2],
    /// Keypoints matched.
    pub matched: f64,
    /// Of these, those that lie where the others say.
    pub correct: f64,
}

/// What a model costs on this machine: medians over frames, on one thread.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// The machine's CPU.
    pub cpu: String,
    /// Finding and describing keypoints, in milliseconds.
    pub features_ms: f64,
    /// From descriptors to a room, in milliseconds.
    pub classify_ms: f64,
    /// From the file's bytes to a room, in milliseconds.
    pub whole_ms: f64,
    /// From described frames to a model, on all threads, in seconds.
    pub training_s: f64,
    /// The size of the model file.
    pub model_bytes: usize,
    /// Words and numbers a word.
    pub vocabulary: [usize; 2],
    /// Training frames each machine rests on.
    pub n_support_vectors: Vec<usize>,
}

/// For each split, for each drive that it tests: the drive and the answers to it.
pub(super) type Answers = Vec<Vec<(usize, Vec<FrameAnswer>)>>;

impl Measured {
    /// The rates, where rates were measured.
    pub fn rates(&self) -> Option<&Rates> {
        match self {
            Self::Rates(rates) => Some(rates.as_ref()),
            _ => None,
        }
    }
}

impl Rates {
    /// Of the answers of each seed.
    pub(super) fn new(drives: &Drives, seeds: &[Answers]) -> Self {
        let rates = |value: fn(&Evaluation) -> Option<f64>| -> Vec<f64> {
            seeds.iter().filter_map(|splits| mean_over_splits(drives, splits, value)).collect()
        };
        let overall = rates(|evaluation| evaluation.overall.rate);
        let best_seed = (0..overall.len()).max_by(|&a, &b| overall[a].total_cmp(&overall[b]).then(b.cmp(&a)));
        let best_seed = best_seed.unwrap_or_default();
        let best_answers: Vec<_> = seeds.get(best_seed).into_iter().flatten().flatten().cloned().collect();
        Self {
            rate: Summary::of(&overall),
            without_border: Summary::of(&rates(|evaluation| evaluation.without_border.rate)),
            best: evaluate(drives, &best_answers),
            best_seed: best_seed as u64,
            keypoints: KeypointCounts::of(best_answers.iter().flat_map(|(_, answers)| answers)),
            best_answers,
        }
    }
}

impl KeypointCounts {
    fn of<'a>(answers: impl Iterator<Item = &'a FrameAnswer>) -> Self {
        let counts: Vec<usize> = answers.map(|answer| answer.n_keypoints).collect();
        Self {
            least: counts.iter().min().copied().unwrap_or_default(),
            mean: counts.iter().sum::<usize>() as f64 / counts.len().max(1) as f64,
            most: counts.iter().max().copied().unwrap_or_default(),
        }
    }
}

fn mean_over_splits(drives: &Drives, splits: &Answers, value: fn(&Evaluation) -> Option<f64>) -> Option<f64> {
    let rates: Vec<f64> = splits.iter().filter_map(|answers| value(&evaluate(drives, answers))).collect();
    Summary::of(&rates).map(|summary| summary.mean)
}

fn evaluate(drives: &Drives, answers: &[(usize, Vec<FrameAnswer>)]) -> Evaluation {
    let answers = answers.iter().flat_map(|(drive_idx, answers)| {
        let drive = drives.get(*drive_idx);
        answers.iter().map(move |answer| Answer {
            room: &drive.dataset.frames[answer.frame_idx].room,
            answered: &answer.room,
            near_border: drive.near_border[answer.frame_idx],
        })
    });
    Evaluation::new(&answers.collect::<Vec<_>>())
}
