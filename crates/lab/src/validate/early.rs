//! What it is worth that sure frames are answered without asking all opinions of a model.

use super::Answered;
use super::cost::{MAX_FRAMES, timed};
use crate::dataset::{Dataset, Described};
use crate::evaluate::Rate;
use roomsight_recognition::model::{Model, Scratch};
use roomsight_vision::image::Limits;
use serde::Serialize;

/// Frames that were answered early, and what that saves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EarlyWorth {
    /// All frames, and those of them that were answered early.
    pub early: Rate,
    /// Those, and how many of them were answered right.
    pub right: Rate,
    /// Those, and how many of them all opinions together answer right.
    pub right_by_all: Rate,
    /// What a frame takes on one thread from pixels to its answer, in milliseconds: the mean over some frames.
    pub frame_ms: f64,
    /// The same where all opinions are always asked.
    pub frame_ms_by_all: f64,
}

impl EarlyWorth {
    /// Of a model that answered described frames; `None` of one that always asks all. Frames are timed on this thread.
    pub fn measure(
        model: &Model,
        (dataset, described): (&Dataset, &Described),
        answers: &[Answered],
        limits: &Limits,
    ) -> Option<Self> {
        if !model.answers_early() {
            return None;
        }
        let by_all = model.asking_all();
        let early = || answers.iter().filter(|answered| answered.recognition.is_early);
        let room = |answered: &Answered| &described.samples[answered.sample_idx].room;
        let is_right = |answered: &&Answered| answered.room == *room(answered);
        let is_right_by_all = |answered: &&Answered| {
            let answer = by_all.classify(&described.samples[answered.sample_idx].features);
            by_all.rooms()[answer.room_idx] == *room(answered)
        };
        let n_early = early().count();
        let [frame_ms, frame_ms_by_all] = frame_ms([model, &by_all], dataset, limits);
        Some(Self {
            early: Rate::new(n_early, answers.len()),
            right: Rate::new(early().filter(is_right).count(), n_early),
            right_by_all: Rate::new(early().filter(is_right_by_all).count(), n_early),
            frame_ms,
            frame_ms_by_all,
        })
    }
}

/// What a frame takes each of two models, on average: each frame is answered by one after the other.
fn frame_ms(models: [&Model; 2], dataset: &Dataset, limits: &Limits) -> [f64; 2] {
    let limits = limits.enough_for(models[0].config().longest_side);
    let stride = dataset.frames.len().div_ceil(MAX_FRAMES).max(1);
    let frames = dataset.frames.iter().step_by(stride);
    let mut scratches = [Scratch::default(), Scratch::default()];
    let (mut sums, mut n_frames) = ([0.0; 2], 0);
    for image in frames.filter_map(|frame| frame.read(&limits).ok()) {
        for ((model, scratch), sum) in models.iter().zip(&mut scratches).zip(&mut sums) {
            *sum += timed(|| model.recognize(&image, scratch)).1;
        }
        n_frames += 1;
    }
    sums.map(|sum| sum / f64::from(n_frames.max(1)))
}
