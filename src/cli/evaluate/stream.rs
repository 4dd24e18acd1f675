//! How answers follow robots from room to room, each frame by itself and filtered.

use super::by_sequence;
use crate::cli::manners::note;
use crate::cli::output::{self, say};
use anyhow::bail;
use roomsight_lab::dataset::{Dataset, Described, Frame};
use roomsight_lab::evaluate::{Changes, Lateness, N_HELD, Rate};
use roomsight_lab::validate::{self, Answered};
use roomsight_recognition::filter::Trust;
use roomsight_recognition::model::Model;
use serde::Serialize;
use std::collections::BTreeMap;
use std::io;

/// The answers to all sequences.
#[derive(Serialize)]
pub(super) struct Stream {
    /// Of the filter; none where each frame was answered by itself.
    trust: Option<Trust>,
    #[serde(flatten)]
    all: Followed,
    by_sequence: BTreeMap<String, Followed>,
}

/// What the answers are worth.
#[derive(Serialize)]
struct Followed {
    rate: Rate,
    /// Answers that are known.
    known: Rate,
    changes: Changes,
}

/// Refuses frames in no known order, and tells where only that within a room is known.
pub(super) fn check(dataset: &Dataset) -> anyhow::Result<()> {
    let is_of_drive = |frame: &Frame| frame.is_elsewhere() || !frame.sequence.is_empty();
    if !dataset.frames.iter().all(is_of_drive) {
        bail!(
            "--filter follows robots, but not all of these frames come in the order they were taken: give folders of drives \
             in those of the rooms (kitchen/monday/0001.jpg), sequences of the COLD database, or a frames.csv that names the \
             sequence of every frame"
        );
    }
    if !dataset.is_in_order() {
        note!(
            "note: folders do not tell in which order a drive went through the rooms: each room of a drive is followed by itself"
        );
    }
    Ok(())
}

/// The answers as they are, then filtered with each trust.
pub(super) fn follow(
    model: &Model,
    dataset: &Dataset,
    described: &Described,
    answers: &[Answered],
    trusts: &[Trust],
) -> Vec<Stream> {
    let followed = |answers: &[Answered]| Followed {
        rate: validate::evaluate(dataset, described, answers).overall,
        known: Rate::new(answers.iter().filter(|answer| answer.recognition.known).count(), answers.len()),
        changes: validate::changes(dataset, described, answers),
    };
    let stream = |trust, answers: &[Answered]| {
        let by_sequence = by_sequence(described, answers).into_iter();
        let by_sequence = by_sequence.map(|(name, answers)| (name, followed(&answers))).collect();
        Stream { trust, all: followed(answers), by_sequence }
    };
    let mut streams = vec![stream(None, answers)];
    for &trust in trusts {
        let filtered = validate::filtered(model, dataset, described, answers, trust);
        streams.push(stream(Some(trust), &filtered));
    }
    streams
}

pub(super) fn print(streams: &[Stream]) -> io::Result<()> {
    let mut table =
        output::table(["trust", "rate", "known", "missed", "frames late", "seconds late", "room changes"]);
    let lateness = |late: Option<Lateness>| {
        late.map_or("-".to_owned(), |late| format!("{:.1} / {:.1}", late.median, late.p90))
    };
    for Stream { trust, all: Followed { rate, known, changes }, .. } in streams {
        table.add_row([
            trust.map_or("unfiltered".to_owned(), |trust| f32::from(trust).to_string()),
            output::rate(rate),
            output::rate(known),
            format!("{} of {}", changes.n_missed, changes.n_changes),
            lateness(changes.late_frames),
            lateness(changes.late_seconds),
            changes.n_answered.to_string(),
        ]);
    }
    say!("\nFollowed from frame to frame:\n{table}")?;
    say!(
        "Late: median / 90th percentile from a change of room to the first of {N_HELD} answers that hold. \
         Room changes: of the answers."
    )
}
