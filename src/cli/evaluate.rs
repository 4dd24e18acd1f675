//! `roomsight evaluate`: the rates of a model on labeled frames.

use super::data::{self, DataArgs};
use super::output;
use crate::evaluate::Evaluation;
use crate::model::{Extractor, Model};
use crate::validate::{self, Answered};
use anyhow::bail;
use clap::Args;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Measure a model on labeled frames
///
/// Frames of rooms that the model does not know count as errors; how many is said.
#[derive(Args)]
pub(super) struct EvaluateArgs {
    /// Model folder
    model: PathBuf,
    #[command(flatten)]
    data: DataArgs,
    /// Print the rates as JSON
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    model: PathBuf,
    simulated: bool,
    /// Frames of rooms that the model does not know.
    n_of_unknown_rooms: usize,
    evaluation: Evaluation,
}

/// Answers all frames and prints the rates.
pub(super) fn run(args: &EvaluateArgs) -> anyhow::Result<()> {
    let model = Model::load(&args.model)?.model;
    let dataset = args.data.open(Some(model.camera().projection.kind()))?;
    if dataset.frames.is_empty() {
        bail!("{} holds no labeled frame", args.data.data.display());
    }
    let extractor = Extractor::new(model.config(), model.camera().clone());
    let described = data::describe(&dataset, &extractor)?;
    let answers: Vec<Answered> = (0..described.samples.len())
        .map(|sample_idx| validate::answer(&model, &described.samples, sample_idx))
        .collect();
    let evaluation = validate::evaluate(&dataset, &described, &answers);
    let known: BTreeSet<&String> = model.places().iter().collect();
    let n_of_unknown_rooms = described.samples.iter().filter(|sample| !known.contains(&sample.place)).count();
    let simulated = data::is_simulated(&args.data.data);
    if args.json {
        let report = Report { model: args.model.clone(), simulated, n_of_unknown_rooms, evaluation };
        println!("{}", serde_json::to_string_pretty(&report)?);
        return Ok(());
    }
    if simulated {
        println!("Simulated frames.\n");
    }
    output::print_evaluation(&evaluation);
    if n_of_unknown_rooms > 0 {
        println!("\n{n_of_unknown_rooms} frames show rooms that the model does not know.");
    }
    Ok(())
}
