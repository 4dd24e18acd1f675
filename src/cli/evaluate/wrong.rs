//! Which frames were answered wrong, and which training frames are to blame.

use crate::cli::contact_sheet::{Card, Section};
use crate::cli::output::{self, say};
use roomsight_lab::dataset::{Dataset, Described};
use roomsight_lab::validate::Answered;
use roomsight_recognition::model::{Features, Model, Unknown};
use serde::Serialize;
use std::collections::{BTreeMap, VecDeque};
use std::io;
use std::path::PathBuf;

/// The most frames that are printed; `--json` has all.
const MAX_PRINTED: usize = 30;

/// Among so many nearest frames of each opinion those of the answered room are looked for.
const N_NEAREST: usize = 10;

/// The most training frames that are named for each.
const MAX_BLAMED: usize = 3;

/// A frame that was answered wrong, or right and yet unknown.
#[derive(Debug, Serialize)]
pub(super) struct WrongFrame {
    frame: PathBuf,
    /// The room that it shows.
    room: String,
    /// The room that was answered.
    answered: String,
    /// Of that room.
    probability: f32,
    /// Why the answer is not known; none where it is.
    unknown: Option<Unknown>,
    #[serde(skip_serializing_if = "Option::is_none")]
    novelty: Option<f32>,
    /// The training frames of the answered room that are most like it, by their names, of models that keep frames.
    because_of: Vec<String>,
}

impl WrongFrame {
    fn is_wrong(&self) -> bool {
        self.room != self.answered
    }
}

/// The wrong answers, the surest first, then the right ones that are unknown, the least sure first.
pub(super) fn wrong_frames(
    model: &Model,
    dataset: &Dataset,
    described: &Described,
    answers: &[Answered],
) -> Vec<WrongFrame> {
    let told = |answer: &Answered| {
        let sample = &described.samples[answer.sample_idx];
        let recognition = &answer.recognition;
        if sample.is_elsewhere() && !recognition.known {
            // As it should be.
            return None;
        }
        let frame = WrongFrame {
            frame: dataset.frames[described.frame_idxs[answer.sample_idx]].path.clone(),
            room: sample.room.clone(),
            answered: answer.room.clone(),
            probability: recognition.probability(),
            unknown: recognition.unknown,
            novelty: recognition.novelty,
            because_of: Vec::new(),
        };
        let because_of = || blamed(model, &sample.features, recognition.room_idx);
        if frame.is_wrong() {
            Some(WrongFrame { because_of: because_of(), ..frame })
        } else {
            frame.unknown.is_some().then_some(frame)
        }
    };
    let mut frames: Vec<WrongFrame> = answers.iter().filter_map(told).collect();
    frames.sort_by(|a, b| {
        let by_kind = b.is_wrong().cmp(&a.is_wrong());
        let by_probability = b.probability.total_cmp(&a.probability);
        by_kind.then(if a.is_wrong() { by_probability } else { by_probability.reverse() })
    });
    frames
}

/// The frames as parts of a contact sheet. The training frames to blame are shown where they lie in the same data set.
pub(super) fn sections(dataset: &Dataset, frames: &[WrongFrame]) -> Vec<Section> {
    let card = |frame: &WrongFrame| {
        let known = frame.unknown.map_or("known".to_owned(), |why| format!("unknown: {why}"));
        let said = format!("answered {} ({:.2}), {known}", frame.answered, frame.probability);
        let blamed = frame.because_of.iter().map(|name| (dataset.folder().join(name), name.clone()));
        let (at_hand, elsewhere): (Vec<_>, Vec<_>) = blamed.partition(|(path, _)| path.is_file());
        let elsewhere = elsewhere.into_iter().map(|(_, name)| format!("because of {name}"));
        let shown = [dataset.name_of(&frame.frame), format!("shows {}", frame.room), said];
        Card {
            picture: frame.frame.clone(),
            lines: shown.into_iter().chain(elsewhere).collect(),
            beside: at_hand,
        }
    };
    let section = |heading: &str, is_wrong| Section {
        heading: heading.to_owned(),
        cards: frames.iter().filter(|frame| frame.is_wrong() == is_wrong).map(card).collect(),
    };
    vec![section("Answered wrong, the surest first", true), section("Right but unknown", false)]
}

/// The training frames of a room that are most like a frame, as the opinions see them in turn.
fn blamed(model: &Model, features: &Features, room_idx: usize) -> Vec<String> {
    let mut by_opinion: BTreeMap<String, VecDeque<String>> = BTreeMap::new();
    for near in model.nearest(features, N_NEAREST) {
        if near.room_idx == room_idx && !near.name.is_empty() {
            by_opinion.entry(near.opinion).or_default().push_back(near.name);
        }
    }
    let mut blamed: Vec<String> = Vec::new();
    while blamed.len() < MAX_BLAMED && by_opinion.values().any(|names| !names.is_empty()) {
        for name in by_opinion.values_mut().filter_map(VecDeque::pop_front) {
            if !blamed.contains(&name) {
                blamed.push(name);
            }
        }
    }
    blamed.truncate(MAX_BLAMED);
    blamed
}

pub(super) fn print(frames: &[WrongFrame]) -> io::Result<()> {
    if frames.is_empty() {
        return say!("\nNo frame was answered wrong, and all answers are known.");
    }
    let n_wrong = frames.iter().filter(|frame| frame.is_wrong()).count();
    say!("\nAnswered wrong, the surest first: {n_wrong}. Right but unknown: {}.", frames.len() - n_wrong)?;
    let mut table = output::table(["frame", "shows", "answered", "", "known", "because of"]);
    for frame in frames.iter().take(MAX_PRINTED) {
        table.add_row([
            output::path_cell(&frame.frame),
            frame.room.clone(),
            frame.answered.clone(),
            format!("{:.2}", frame.probability),
            frame.unknown.map_or("yes".to_owned(), |why| format!("no: {why}")),
            frame.because_of.join("\n"),
        ]);
    }
    output::keep_first_column(&mut table);
    say!("{table}")?;
    if frames.len() > MAX_PRINTED {
        say!("{} more: see --json.", frames.len() - MAX_PRINTED)?;
    }
    Ok(())
}
