//! Whether a model answers worse than the version that serves.

use crate::cli::data;
use crate::cli::output::say;
use roomsight_lab::dataset::{Dataset, Described};
use roomsight_lab::validate::{self, Answered};
use roomsight_recognition::model::{Extractor, Model};
use roomsight_vision::image::Limits;
use serde::Serialize;
use std::collections::BTreeMap;
use std::{fmt, io};

/// Fewer frames that both were not trained on say nothing.
const LEAST_FRAMES: usize = 10;

/// How the model that was trained does beside the version that serves.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Comparison {
    /// The version that serves.
    pub serving: String,
    /// The frames on which both were compared.
    pub compared_on: ComparedOn,
    /// How many frames the version that serves answers right, of so many.
    pub before: Share,
    /// How many the model that was trained does.
    pub now: Share,
    /// Whether it is worse by more than chance.
    pub is_worse: bool,
}

/// What two models are compared by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum ComparedOn {
    /// Frames that neither had learned when it answered them.
    SameFrames,
    /// The rates on the frames that each held out when it was trained.
    OwnHeldOut,
}

/// How many frames are right, of how many.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Share {
    pub n_right: usize,
    pub n_frames: usize,
}

impl Share {
    fn rate(self) -> f64 {
        self.n_right as f64 / self.n_frames.max(1) as f64
    }
}

impl Comparison {
    /// Of held-out answers with those of the version that serves, where it has not learned the frame; where there are few of
    /// those, of the rates on the frames that each held out. `None` where that one says no such rate.
    pub(super) fn new(
        (serving, before): (&str, &Model),
        (dataset, described): (&Dataset, &Described),
        answers: &[Answered],
        limits: &Limits,
    ) -> Option<Self> {
        let learned = before.learned_pictures();
        let is_new = |answer: &&Answered| {
            let picture = described.samples[answer.sample_idx].picture;
            // A version that does not say what it has learned may have learned anything.
            !learned.is_empty() && picture.is_some_and(|picture| !learned.contains(&picture))
        };
        let new: Vec<&Answered> = answers.iter().filter(is_new).collect();
        let serving = serving.to_owned();
        if new.len() < LEAST_FRAMES {
            return Self::of_rates(serving, before, described, answers);
        }
        let of_frame: BTreeMap<usize, &Answered> =
            new.iter().map(|answer| (described.frame_idxs[answer.sample_idx], *answer)).collect();
        let mut subset = dataset.clone();
        subset.frames = of_frame.keys().map(|&frame_idx| dataset.frames[frame_idx].clone()).collect();
        let extractor = Extractor::new(before.config(), before.camera().clone());
        let again = data::describe_quietly(&subset, &extractor, limits).ok()?;
        let pairs = (0..again.samples.len()).filter_map(|sample_idx| {
            let room = &again.samples[sample_idx].room;
            let frame_idx = of_frame.keys().nth(again.frame_idxs[sample_idx])?;
            let was_right = validate::answer(before, &again.samples, sample_idx).room == *room;
            Some([was_right, of_frame[frame_idx].room == *room])
        });
        Some(Self::of_pairs(serving, &pairs.collect::<Vec<_>>()))
    }

    /// Whether each frame was answered right before, and is now. Worse is one that loses more frames than it gains by more than
    /// a standard error (McNemar, "Note on the sampling error of the difference between correlated proportions or
    /// percentages", Psychometrika 1947).
    fn of_pairs(serving: String, pairs: &[[bool; 2]]) -> Self {
        let count = |wanted: fn(&&[bool; 2]) -> bool| pairs.iter().filter(wanted).count();
        let share = |n_right| Share { n_right, n_frames: pairs.len() };
        let (gained, lost) = (count(|pair| !pair[0] && pair[1]), count(|pair| pair[0] && !pair[1]));
        Self {
            serving,
            compared_on: ComparedOn::SameFrames,
            before: share(count(|pair| pair[0])),
            now: share(count(|pair| pair[1])),
            is_worse: lost > gained && (lost - gained).pow(2) > lost + gained,
        }
    }

    /// The version that serves has learned the same frames.
    fn of_rates(
        serving: String,
        before: &Model,
        described: &Described,
        answers: &[Answered],
    ) -> Option<Self> {
        let measured = before.card().measured.last().filter(|measured| measured.n_frames > 0)?;
        let is_right = |answer: &&Answered| described.samples[answer.sample_idx].room == answer.room;
        let before = Share {
            n_right: (measured.rate * measured.n_frames as f64).round() as usize,
            n_frames: measured.n_frames,
        };
        let now = Share { n_right: answers.iter().filter(is_right).count(), n_frames: answers.len() };
        let variance = |share: Share| share.rate() * (1.0 - share.rate()) / share.n_frames.max(1) as f64;
        let error = (variance(before) + variance(now)).sqrt();
        let is_worse = now.n_frames > 0 && now.rate() < before.rate() - error;
        Some(Self { serving, compared_on: ComparedOn::OwnHeldOut, before, now, is_worse })
    }

    pub(super) fn print(&self) -> io::Result<()> {
        say!("{self}.")
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { serving, compared_on, before, now, .. } = self;
        let frames = match compared_on {
            ComparedOn::SameFrames => "on frames that neither had learned",
            ComparedOn::OwnHeldOut => "on the frames that each held out",
        };
        write!(
            f,
            "Beside {serving}, which serves: right {frames} {:.4} of {}, that one {:.4} of {}",
            now.rate(),
            now.n_frames,
            before.rate(),
            before.n_frames
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_is_worse_that_loses_clearly_more_frames_than_it_gains() {
        let pairs = |n_gained, n_lost| {
            let gained = std::iter::repeat_n([false, true], n_gained);
            let lost = std::iter::repeat_n([true, false], n_lost);
            gained.chain(lost).chain(std::iter::repeat_n([true, true], 20)).collect::<Vec<_>>()
        };
        let is_worse = |gained, lost| Comparison::of_pairs("home/1".into(), &pairs(gained, lost)).is_worse;
        assert!(is_worse(0, 5) && is_worse(5, 15));
        assert!(!is_worse(0, 1) && !is_worse(5, 8) && !is_worse(8, 5) && !is_worse(0, 0));
        let comparison = Comparison::of_pairs("home/1".into(), &pairs(5, 15));
        let told = comparison.to_string();
        assert!(told.ends_with("that neither had learned 0.6250 of 40, that one 0.8750 of 40"), "{told}");
    }
}
