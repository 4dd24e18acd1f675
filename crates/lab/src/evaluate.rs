//! Rates from answers: the confusion matrix, frames near a border told apart, runs summed up.
//!
//! Frames near the border of two rooms show both, and their label says only on which side the robot
//! stood. Lu et al. find nearly all errors there, so every rate is also given without such frames.

mod changes;
mod knowledge;
mod poses;

pub use changes::{Changes, Lateness, N_HELD, StreamAnswer};
pub use knowledge::{Bin, Knowledge, N_BINS, Trusted};
pub use poses::PoseErrors;

use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// How near a border a frame counts as a border frame, in meters.
pub const BORDER_DISTANCE: f64 = 0.5;

/// One frame, answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer<'a> {
    /// The room that the frame shows.
    pub room: &'a str,
    /// The room that was answered.
    pub answered: &'a str,
    /// Whether the frame lies near a border, where that is known; see [`near_borders`].
    pub near_border: Option<bool>,
}

/// A share of frames answered correctly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Rate {
    /// Answered correctly.
    pub n_correct: usize,
    /// Answered.
    pub n_frames: usize,
    /// `n_correct / n_frames`, 0 to 1; none without frames.
    pub rate: Option<f64>,
}

impl Rate {
    /// `n_correct` of `n_frames`.
    pub fn new(n_correct: usize, n_frames: usize) -> Self {
        let rate = (n_frames > 0).then(|| n_correct as f64 / n_frames as f64);
        Self { n_correct, n_frames, rate }
    }

    fn of<'a>(answers: impl Iterator<Item = &'a Answer<'a>>) -> Self {
        let (n_correct, n_frames) = answers.fold((0, 0), |(n_correct, n_frames), answer| {
            (n_correct + usize::from(answer.answered == answer.room), n_frames + 1)
        });
        Self::new(n_correct, n_frames)
    }
}

/// What the answers to a set of frames are worth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// Every room that occurs, true or answered, sorted.
    #[serde(rename = "places")]
    pub rooms: Vec<String>,
    /// How often each room (row) was answered as each room (column), in the order of `rooms`.
    pub confusion: Vec<Vec<usize>>,
    /// Of all frames.
    pub overall: Rate,
    /// Of the frames of each room, in the order of `rooms`.
    #[serde(rename = "by_place")]
    pub by_room: Vec<Rate>,
    /// The mean of the rates of the rooms that have frames: each room counts the same.
    #[serde(rename = "mean_by_place")]
    pub mean_by_room: Option<f64>,
    /// Of the frames known to lie away from borders.
    pub without_border: Rate,
    /// Of the frames known to lie near a border.
    pub only_border: Rate,
}

impl Evaluation {
    /// Counts answers.
    pub fn new(answers: &[Answer]) -> Self {
        let names: BTreeSet<&str> =
            answers.iter().flat_map(|answer| [answer.room, answer.answered]).collect();
        let room_idx: BTreeMap<&str, usize> = names.iter().copied().zip(0..).collect();
        let mut confusion = vec![vec![0; names.len()]; names.len()];
        for answer in answers {
            confusion[room_idx[answer.room]][room_idx[answer.answered]] += 1;
        }
        let by_room: Vec<Rate> =
            confusion.iter().enumerate().map(|(idx, row)| Rate::new(row[idx], row.iter().sum())).collect();
        let rates: Vec<f64> = by_room.iter().filter_map(|room| room.rate).collect();
        let known = |near| answers.iter().filter(move |answer| answer.near_border == Some(near));
        Self {
            rooms: names.into_iter().map(str::to_owned).collect(),
            confusion,
            overall: Rate::of(answers.iter()),
            by_room,
            mean_by_room: Summary::of(&rates).map(|summary| summary.mean),
            without_border: Rate::of(known(false)),
            only_border: Rate::of(known(true)),
        }
    }
}

/// Where a labeled frame was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting<'a> {
    /// The drive: positions of different drives are not compared.
    pub sequence: &'a str,
    /// The room.
    pub room: &'a str,
    /// In meters.
    pub position: Option<[f64; 2]>,
}

/// Whether each frame was taken within `distance` meters of a border; none without a position.
///
/// A border is the midpoint of two consecutive positions of a sequence whose rooms differ. `frames`
/// are in time order within each sequence.
pub fn near_borders(frames: &[Sighting], distance: f64) -> Vec<Option<bool>> {
    let mut borders: BTreeMap<&str, Vec<[f64; 2]>> = BTreeMap::new();
    let mut last: BTreeMap<&str, (&str, [f64; 2])> = BTreeMap::new();
    for frame in frames {
        let Some(here) = frame.position else { continue };
        if let Some((room, there)) = last.insert(frame.sequence, (frame.room, here))
            && room != frame.room
        {
            let midpoint = [(here[0] + there[0]) / 2.0, (here[1] + there[1]) / 2.0];
            borders.entry(frame.sequence).or_default().push(midpoint);
        }
    }
    let is_near = |frame: &Sighting| {
        let [x, y] = frame.position?;
        let mut borders = borders.get(frame.sequence).into_iter().flatten();
        Some(borders.any(|border| (border[0] - x).hypot(border[1] - y) <= distance))
    };
    frames.iter().map(is_near).collect()
}

/// One figure over several runs, such as a rate over seeds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The number of runs, at least 1.
    pub n_runs: usize,
    /// The mean.
    pub mean: f64,
    /// The sample standard deviation (over n - 1); none for a single run.
    pub std: Option<f64>,
    /// The largest.
    pub best: f64,
}

impl Summary {
    /// Sums up one value a run; none when there is no run.
    pub fn of(values: &[f64]) -> Option<Self> {
        let n_runs = values.len();
        let best = values.iter().copied().reduce(f64::max)?;
        let mean = values.iter().sum::<f64>() / n_runs as f64;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let std = (n_runs > 1).then(|| (squares / (n_runs - 1) as f64).sqrt());
        Some(Self { n_runs, mean, std, best })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn answer<'a>(room: &'a str, answered: &'a str, near_border: Option<bool>) -> Answer<'a> {
        Answer { room, answered, near_border }
    }

    #[test]
    fn answers_are_counted_by_true_and_answered_room() {
        let answers = [
            answer("hall", "hall", Some(false)),
            answer("hall", "kitchen", Some(true)),
            answer("hall", "hall", Some(true)),
            answer("hall", "hall", None),
            answer("kitchen", "bath", Some(false)),
            answer("kitchen", "kitchen", Some(false)),
        ];
        let evaluation = Evaluation::new(&answers);
        assert_eq!(evaluation.rooms, ["bath", "hall", "kitchen"]);
        assert_eq!(evaluation.confusion, [[0, 0, 0], [0, 3, 1], [1, 0, 1]]);
        assert_eq!(evaluation.overall, Rate::new(4, 6));
        assert_eq!(evaluation.by_room, [Rate::new(0, 0), Rate::new(3, 4), Rate::new(1, 2)]);
        assert_eq!(evaluation.mean_by_room, Some(0.625));
        assert_eq!(evaluation.without_border, Rate::new(2, 3));
        assert_eq!(evaluation.only_border, Rate::new(1, 2));
    }

    #[test]
    fn no_answers_have_no_rate() {
        let json = serde_json::to_value(Evaluation::new(&[])).unwrap();
        assert_eq!(json["overall"], serde_json::json!({"n_correct": 0, "n_frames": 0, "rate": null}));
        assert_eq!(json["mean_by_place"], serde_json::Value::Null);
    }

    #[test]
    fn a_border_is_midway_between_the_frames_where_the_room_changes() {
        let frame = |sequence, room, x: f64| Sighting { sequence, room, position: Some([x, 0.0]) };
        let frames = [
            frame("a", "hall", 0.0),
            frame("b", "bath", 1.5),
            frame("a", "hall", 1.0),
            Sighting { sequence: "a", room: "bath", position: None },
            frame("a", "kitchen", 2.0),
            frame("a", "kitchen", 2.1),
            frame("b", "bath", 1.5),
        ];
        let found = near_borders(&frames, BORDER_DISTANCE);
        // The border is at 1.5 m. Sequence b stands on it, but has none of its own.
        let expected = [Some(false), Some(false), Some(true), None, Some(true), Some(false), Some(false)];
        assert_eq!(found, expected);
    }

    #[test]
    fn runs_are_summed_up_by_mean_sample_deviation_and_best() {
        let summary = Summary::of(&[0.5, 0.75, 1.0]).unwrap();
        assert_eq!(summary, Summary { n_runs: 3, mean: 0.75, std: Some(0.25), best: 1.0 });
        assert_eq!(Summary::of(&[0.5]).unwrap().std, None);
        assert_eq!(Summary::of(&[]), None);
    }

    proptest! {
        #[test]
        fn the_confusion_matrix_holds_every_answer_once(
            pairs in proptest::collection::vec(("[a-d]", "[a-d]"), 0..60)
        ) {
            let answers: Vec<Answer> = pairs.iter().map(|(room, answered)| answer(room, answered, None)).collect();
            let evaluation = Evaluation::new(&answers);
            prop_assert_eq!(evaluation.confusion.iter().flatten().sum::<usize>(), pairs.len());
            let n_diagonal: usize = (0..evaluation.rooms.len()).map(|idx| evaluation.confusion[idx][idx]).sum();
            prop_assert_eq!(n_diagonal, evaluation.overall.n_correct);
            prop_assert_eq!(pairs.iter().filter(|(room, answered)| room == answered).count(), n_diagonal);
        }
    }
}
