//! Whether a model is worth serving, as far as held-out frames tell, and what would make it better.

use super::curve::LearningCurve;
use crate::cli::output::{self, say};
use roomsight_lab::evaluate::{Evaluation, Knowledge, Rate};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::io;

/// The most pairs of rooms that are named.
const MAX_PAIRS: usize = 5;

/// The most rooms that are named in a sentence.
const MAX_ROOMS: usize = 8;

/// Rooms that are answered right less often need more frames.
const GOOD_RATE: f64 = 0.8;

/// What held-out frames say of a model.
#[derive(Debug, Serialize)]
pub(super) struct Verdict {
    /// How often it would be right to name always the room that has most frames.
    pub guessing: f64,
    /// Whether it is better than guessing by more than chance; none where held-out frames cannot tell.
    pub is_better_than_guessing: Option<bool>,
    /// What "known" will mean.
    pub knowledge: Knowledge,
    /// Whether any answer can be known.
    pub knows: bool,
    /// How much half of the frames would have told.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub learning_curve: Option<LearningCurve>,
    /// Rooms that are taken for each other, the most often first.
    pub confused: Vec<Confused>,
    /// Rooms that are answered right least often, the worst first.
    pub weak_rooms: Vec<WeakRoom>,
    /// Rooms whose frames are all of one drive, where there are several.
    pub rooms_of_one_drive: Vec<String>,
}

/// A room that was answered as another.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub(super) struct Confused {
    pub shown: String,
    pub answered: String,
    pub n_frames: usize,
}

/// A room that is answered right too seldom.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct WeakRoom {
    pub room: String,
    pub rate: f64,
    pub n_frames: usize,
    /// About how many frames more it needs to be answered right four times of five; none where that is not foreseen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n_more: Option<usize>,
}

/// The room and the drive of a training frame.
pub(super) type Taken<'a> = (&'a str, &'a str);

impl Verdict {
    /// Of held-out answers, among training frames that were taken so; `knows` where the model can know any answer.
    pub(super) fn of(
        evaluation: &Evaluation,
        knowledge: Knowledge,
        knows: bool,
        learning_curve: Option<LearningCurve>,
        taken: &[Taken],
    ) -> Self {
        let most = evaluation.by_room.iter().map(|room| room.n_frames).max().unwrap_or_default();
        let n_frames = evaluation.overall.n_frames;
        let guessing = most as f64 / n_frames.max(1) as f64;
        let deviation = (guessing * (1.0 - guessing) / n_frames.max(1) as f64).sqrt();
        let beyond_chance = guessing + 2.0 * deviation;
        // Where nearly all held-out frames are of one room, nothing could be better.
        let is_better_than_guessing =
            evaluation.overall.rate.filter(|_| beyond_chance < 1.0).map(|rate| rate > beyond_chance);
        let mut confused = Vec::new();
        let mut weak_rooms = Vec::new();
        for (shown_idx, shown) in evaluation.rooms.iter().enumerate() {
            for (answered_idx, answered) in evaluation.rooms.iter().enumerate() {
                let n_frames = evaluation.confusion[shown_idx][answered_idx];
                if shown_idx != answered_idx && n_frames > 0 {
                    confused.push(Confused { shown: shown.clone(), answered: answered.clone(), n_frames });
                }
            }
            let Rate { n_frames, rate, .. } = evaluation.by_room[shown_idx];
            if let Some(rate) = rate.filter(|rate| *rate < GOOD_RATE) {
                let n_more = learning_curve.and_then(|curve| curve.n_more(n_frames, rate, GOOD_RATE));
                weak_rooms.push(WeakRoom { room: shown.clone(), rate, n_frames, n_more });
            }
        }
        confused.sort_by_key(|pair| std::cmp::Reverse(pair.n_frames));
        confused.truncate(MAX_PAIRS);
        weak_rooms.sort_by(|a, b| a.rate.total_cmp(&b.rate));
        let mut drives: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
        taken.iter().for_each(|&(room, drive)| _ = drives.entry(room).or_default().insert(drive));
        let has_several = drives.values().flatten().collect::<BTreeSet<_>>().len() > 1;
        let of_one = drives.iter().filter(|(_, drives)| has_several && drives.len() == 1);
        let rooms_of_one_drive = of_one.map(|(room, _)| (*room).to_owned()).collect();
        Self {
            guessing,
            is_better_than_guessing,
            knowledge,
            knows,
            learning_curve,
            confused,
            weak_rooms,
            rooms_of_one_drive,
        }
    }

    /// Whether somebody should let the model serve.
    pub(super) fn is_worth_serving(&self) -> bool {
        self.is_better_than_guessing != Some(false)
    }

    /// Prints it in sentences; `can_promise_less` where the promise is not kept with the model.
    pub(super) fn print(&self, can_promise_less: bool) -> io::Result<()> {
        let Knowledge { known, right_known, .. } = &self.knowledge;
        if self.is_better_than_guessing.is_some() {
            say!("Naming always the room with most frames would be right on {:.4}.", self.guessing)?;
        }
        if self.knows {
            say!(
                "Known: {} of the right answers; of the {} known answers {} are right.",
                output::rate(right_known),
                known.n_frames,
                known.n_correct
            )?;
        } else {
            let advice = if can_promise_less { ", or promise less (--precision 0.8)" } else { "" };
            say!(
                "No answer will be known: too few held-out answers were right to promise anything. Take more frames{advice}."
            )?;
        }
        if let Some(curve) = self.learning_curve {
            let LearningCurve { rate_of_half, rate_of_all } = curve;
            let more = if curve.is_rising() {
                "more frames will help"
            } else {
                "more frames of the same kind will hardly help"
            };
            say!(
                "Of every other frame {rate_of_half:.4} are right where only those are trained, {rate_of_all:.4} where all \
                 are: {more}."
            )?;
        }
        if !self.confused.is_empty() {
            let pair = |pair: &Confused| format!("{} for {} ({})", pair.shown, pair.answered, pair.n_frames);
            say!("Taken for another: {}.", self.confused.iter().map(pair).collect::<Vec<_>>().join(", "))?;
        }
        if !self.weak_rooms.is_empty() {
            let room = |WeakRoom { room, rate, n_frames, n_more }: &WeakRoom| match n_more {
                Some(n_more) => format!("{room} ({rate:.2} of {n_frames}; about {n_more} more)"),
                None => format!("{room} ({rate:.2} of {n_frames})"),
            };
            let advice = "from other places in the room, at other times of day";
            say!("More frames, {advice}, help most of: {}.", listed(self.weak_rooms.iter().map(room)))?;
        }
        if !self.rooms_of_one_drive.is_empty() {
            let rooms = listed(self.rooms_of_one_drive.iter().cloned());
            say!("From one drive only, so that nothing tells how another day looks: {rooms}.")?;
        }
        Ok(())
    }
}

/// The first of them, and how many more.
fn listed(names: impl ExactSizeIterator<Item = String>) -> String {
    let n_more = names.len().saturating_sub(MAX_ROOMS);
    let first = names.take(MAX_ROOMS).collect::<Vec<_>>().join(", ");
    if n_more == 0 { first } else { format!("{first} and {n_more} more") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use roomsight_lab::evaluate::Answer;

    fn verdict(answers: &[(&str, &str)], taken: &[Taken]) -> Verdict {
        let answer = |&(room, answered)| Answer { room, answered, near_border: None };
        let evaluation = Evaluation::new(&answers.iter().map(answer).collect::<Vec<_>>());
        Verdict::of(&evaluation, Knowledge::new(&[]), true, None, taken)
    }

    #[test]
    fn a_model_that_guesses_is_not_worth_serving() {
        let guesses = [("hall", "hall"), ("hall", "bath"), ("bath", "hall"), ("bath", "bath")].repeat(10);
        let guessing = verdict(&guesses, &[]);
        assert_eq!((guessing.guessing, guessing.is_better_than_guessing), (0.5, Some(false)));
        assert!(!guessing.is_worth_serving());
        assert_eq!(guessing.weak_rooms.len(), 2);
        let right = [("hall", "hall"), ("bath", "bath")].repeat(10);
        assert!(verdict(&right, &[]).is_worth_serving());
        assert_eq!(verdict(&[], &[]).is_better_than_guessing, None);
        assert_eq!(verdict(&[("hall", "hall"); 20], &[]).is_better_than_guessing, None, "of one room only");
    }

    #[test]
    fn what_would_help_is_named() {
        let answers = [("hall", "hall"), ("bath", "hall"), ("bath", "hall"), ("attic", "attic")];
        let taken = [("hall", "monday"), ("hall", "tuesday"), ("bath", "monday"), ("attic", "monday")];
        let verdict = verdict(&answers, &taken);
        let expected = Confused { shown: "bath".into(), answered: "hall".into(), n_frames: 2 };
        assert_eq!(verdict.confused, [expected]);
        assert_eq!(
            verdict.weak_rooms,
            [WeakRoom { room: "bath".into(), rate: 0.0, n_frames: 2, n_more: None }]
        );
        assert_eq!(verdict.rooms_of_one_drive, ["attic", "bath"]);
    }

    #[test]
    fn long_lists_are_cut() {
        assert_eq!(listed((0..3).map(|n| n.to_string())), "0, 1, 2");
        assert_eq!(listed((0..10).map(|n| n.to_string())), "0, 1, 2, 3, 4, 5, 6, 7 and 2 more");
    }
}
