//! `roomsight train`: labeled frames to a model folder.

use super::data::{self, ConfigArgs, DataArgs};
use super::output::{self, say};
use crate::dataset::{Dataset, Described};
use crate::evaluate::Evaluation;
use crate::model::{Card, Extractor, GoldenFrame, HeldOut, Measurement, Model, Sample, Training};
use crate::validate::{self, Answered};
use anyhow::bail;
use clap::Args;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

/// Frames kept with the model to tell that it still answers the same.
const N_GOLDEN_FRAMES: usize = 8;

/// The longest frame that is kept so, in bytes.
const MAX_GOLDEN_BYTES: u64 = 1 << 20;

/// Train a model on labeled frames
///
/// The frames are dealt into folds, whole sequences where there are several; each fold is answered by a
/// model trained without it. These answers calibrate the probabilities and give the rates that are
/// printed. The model itself is trained on all frames.
#[derive(Args)]
pub(super) struct TrainArgs {
    #[command(flatten)]
    data: DataArgs,
    /// New folder for the model; serve finds models as MODELS/NAME/VERSION, such as models/lab/1
    #[arg(short, long, value_name = "MODEL")]
    output: PathBuf,
    #[command(flatten)]
    config: ConfigArgs,
    /// A sentence about the model for its card
    #[arg(long, default_value = "", hide_default_value = true, value_name = "TEXT")]
    description: String,
    /// Do not keep a frame of each room with the model, by which others check that it answers the same
    #[arg(long)]
    no_golden_frames: bool,
    /// Print the rates as JSON
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    model: PathBuf,
    card: Card,
    held_out: Evaluation,
}

/// Trains, prints the held-out rates, writes the model.
pub(super) fn run(args: &TrainArgs) -> anyhow::Result<()> {
    if args.output.exists() {
        bail!("{} exists already; a model never changes: choose another folder", args.output.display());
    }
    let dataset = args.data.open(None)?;
    dataset.check()?;
    let config = args.config.read()?;
    let camera = args.config.camera(&dataset)?;
    let extractor = Extractor::new(&config, camera.clone());
    let described = data::describe(&dataset, &extractor)?;

    let samples: Vec<&Sample> = described.samples.iter().collect();
    let bar = output::progress("training", 1);
    let Training { model, held_out } = Model::train(&samples, &config, camera, |step| {
        bar.set_length(step.n_steps as u64);
        bar.set_position(step.n_done as u64);
    })?;
    bar.finish_and_clear();

    let answers: Vec<Answered> = held_out.iter().map(|held_out| answered(&model, held_out)).collect();
    let evaluation = validate::evaluate(&dataset, &described, &answers);
    let card = card(args, &dataset, &described, &evaluation);
    let transitions = dataset.transitions(model.places());
    let model = model.with_card(card.clone()).with_transitions(transitions);
    let golden = if args.no_golden_frames { Vec::new() } else { golden_frames(&model, &dataset, &described) };
    model.save(&args.output, &golden)?;

    if args.json {
        let report = Report { model: args.output.clone(), card, held_out: evaluation };
        say!("{}", serde_json::to_string_pretty(&report)?)?;
        return Ok(());
    }
    let frames = if card.simulated { "simulated frames" } else { "frames" };
    say!("Held-out answers to {} of {} {frames}:\n", answers.len(), described.samples.len())?;
    output::print_evaluation(&evaluation)?;
    let (program, folder) = (output::program(), output::quoted(&args.output));
    say!("\n{} is ready. Try it:", args.output.display())?;
    say!("  {program} recognize {folder} FRAME.jpg")?;
    say!("  {program} serve --models {folder}")?;
    Ok(())
}

fn answered(model: &Model, held_out: &HeldOut) -> Answered {
    let HeldOut { sample_idx, recognition } = held_out.clone();
    Answered { sample_idx, place: model.places()[recognition.place_idx].clone(), recognition }
}

fn card(args: &TrainArgs, dataset: &Dataset, described: &Described, evaluation: &Evaluation) -> Card {
    let sequences: BTreeSet<&str> = dataset.frames.iter().map(|frame| frame.sequence.as_str()).collect();
    let simulated = data::is_simulated(&args.data.data);
    let held_out = if sequences.len() > 1 { "held-out sequences" } else { "held-out frames" };
    let data = if simulated { format!("{held_out}, simulated") } else { held_out.to_owned() };
    let rate = evaluation.overall.rate;
    let measurement = rate.map(|rate| Measurement { data, n_frames: evaluation.overall.n_frames, rate });
    Card {
        description: args.description.clone(),
        simulated,
        trained_by: concat!("roomsight ", env!("CARGO_PKG_VERSION")).to_owned(),
        n_frames: described.samples.len(),
        sequences: sequences.into_iter().map(str::to_owned).collect(),
        measured: measurement.into_iter().collect(),
    }
}

/// The middle frame of each room, up to [`N_GOLDEN_FRAMES`] rooms.
fn golden_frames(model: &Model, dataset: &Dataset, described: &Described) -> Vec<GoldenFrame> {
    let golden = |place: &String| {
        let of_place: Vec<usize> =
            (0..described.samples.len()).filter(|&idx| described.samples[idx].place == *place).collect();
        let sample_idx = *of_place.get(of_place.len() / 2)?;
        let path = &dataset.frames[described.frame_idxs[sample_idx]].path;
        let extension = path.extension().map_or("jpg".into(), |extension| extension.to_string_lossy());
        let is_small = fs::metadata(path).is_ok_and(|metadata| metadata.len() <= MAX_GOLDEN_BYTES);
        let bytes = fs::read(path).ok().filter(|_| is_small)?;
        let answer = validate::answer(model, &described.samples, sample_idx);
        Some(GoldenFrame {
            name: format!("{}.{extension}", file_name(place)),
            bytes,
            probability: answer.recognition.probability(),
            place: answer.place,
        })
    };
    model.places().iter().take(N_GOLDEN_FRAMES).filter_map(golden).collect()
}

/// A room's name as a file name.
fn file_name(place: &str) -> String {
    place.chars().map(|letter| if letter.is_alphanumeric() { letter } else { '_' }).collect()
}
