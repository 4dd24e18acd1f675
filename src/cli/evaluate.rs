//! `roomsight evaluate`: the rates of a model on labeled frames.

mod stream;
mod wrong;

use super::contact_sheet;
use super::data::{self, DataArgs, LimitArgs};
use super::output::{self, say};
use anyhow::bail;
use clap::Args;
use roomsight_lab::dataset::Described;
use roomsight_lab::evaluate::{Evaluation, Knowledge, PoseErrors};
use roomsight_lab::validate::{self, Answered, EarlyWorth};
use roomsight_recognition::filter::Trust;
use roomsight_recognition::model::{Extractor, Sample};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::PathBuf;
use stream::Stream;
use wrong::WrongFrame;

/// The most sequences that get a line each.
const MAX_SEQUENCES: usize = 20;

/// Measure a model on labeled frames
///
/// Frames of rooms that the model does not know count as errors; how many is said.
#[derive(Args)]
pub(super) struct EvaluateArgs {
    /// Folder of the model, as `train` wrote it
    model: PathBuf,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    limits: LimitArgs,
    /// Also follow each sequence with a Bayes filter over the rooms, as the service follows a stream of
    /// frames; several amounts of trust in a single frame, such as --filter=0.5,1,2, get a line each
    /// [default: the filter's own]
    #[arg(long, value_name = "TRUST", num_args = 0.., require_equals = true, value_delimiter = ',')]
    filter: Option<Vec<Trust>>,
    /// Also list the frames that were answered wrong, or right but unknown, with what they were taken for and the training
    /// frames that spoke for it
    #[arg(long)]
    wrong: bool,
    /// With --wrong: also write a page that shows these frames
    #[arg(long, value_name = "FILE", requires = "wrong")]
    html: Option<PathBuf>,
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
    /// Those rooms, sorted.
    unknown_rooms: Vec<String>,
    /// Frames that the model has learned: their answers say nothing of other frames.
    n_learned: usize,
    evaluation: Evaluation,
    /// What "known" is worth.
    knowledge: Knowledge,
    /// What it is worth that sure frames are answered without asking all opinions, of models that do so.
    #[serde(skip_serializing_if = "Option::is_none")]
    early: Option<EarlyWorth>,
    /// How far off estimated poses are, of models and frames that have some.
    #[serde(skip_serializing_if = "Option::is_none")]
    poses: Option<PoseErrors>,
    /// The same rates for each sequence, by name.
    by_sequence: BTreeMap<String, Evaluation>,
    /// With `--filter`: each frame by itself, then each trust.
    #[serde(skip_serializing_if = "Option::is_none")]
    streams: Option<Vec<Stream>>,
    /// With `--wrong`.
    #[serde(skip_serializing_if = "Option::is_none")]
    wrong: Option<Vec<WrongFrame>>,
}

/// Answers all frames and prints the rates.
pub(super) fn run(args: &EvaluateArgs) -> anyhow::Result<()> {
    let model = data::load_model(&args.model)?.model;
    let dataset = args.data.open(Some(&model))?;
    if dataset.frames.is_empty() {
        bail!("{} holds no labeled frame that can be used", args.data.data.display());
    }
    if args.filter.is_some() {
        stream::check(&dataset)?;
    }
    let extractor = Extractor::new(model.config(), model.camera().clone());
    let described = data::describe(&dataset, &extractor, &args.limits.limits())?;
    let answers: Vec<Answered> = (0..described.samples.len())
        .map(|sample_idx| validate::answer(&model, &described.samples, sample_idx))
        .collect();
    let evaluate = |answers: &[Answered]| validate::evaluate(&dataset, &described, answers);
    let streams = args.filter.as_ref().map(|trusts| {
        let defaults = [Trust::default()];
        let trusts = if trusts.is_empty() { &defaults } else { trusts.as_slice() };
        stream::follow(&model, &dataset, &described, &answers, trusts)
    });
    let learned = model.learned_pictures();
    let is_learned = |sample: &&Sample| sample.picture.is_some_and(|picture| learned.contains(&picture));
    let n_learned = described.samples.iter().filter(is_learned).count();
    let by_sequence = by_sequence(&described, &answers).into_iter();
    let known: BTreeSet<&String> = model.rooms().iter().collect();
    let report = Report {
        model: args.model.clone(),
        simulated: data::is_simulated(&args.data.data),
        n_of_unknown_rooms: described
            .samples
            .iter()
            .filter(|sample| !sample.is_elsewhere() && !known.contains(&sample.room))
            .count(),
        unknown_rooms: dataset.rooms().into_iter().filter(|room| !known.contains(room)).collect(),
        n_learned,
        evaluation: evaluate(&answers),
        knowledge: validate::knowledge(&described, &answers),
        early: EarlyWorth::measure(&model, (&dataset, &described), &answers, &args.limits.limits()),
        poses: validate::poses(&model, &dataset, &described),
        by_sequence: by_sequence.map(|(name, answers)| (name, evaluate(&answers))).collect(),
        streams,
        wrong: args.wrong.then(|| wrong::wrong_frames(&model, &dataset, &described, &answers)),
    };
    if let (Some(path), Some(frames)) = (&args.html, &report.wrong) {
        let title = format!("{} by {}", args.data.data.display(), args.model.display());
        let sections = wrong::sections(&dataset, frames);
        contact_sheet::write(path, &title, &sections, &dataset, &args.limits.limits())?;
    }
    if args.json {
        say!("{}", serde_json::to_string_pretty(&report)?)?;
    } else {
        print(&report)?;
    }
    Ok(())
}

fn by_sequence(described: &Described, answers: &[Answered]) -> BTreeMap<String, Vec<Answered>> {
    let mut by_sequence: BTreeMap<String, Vec<Answered>> = BTreeMap::new();
    for answer in answers {
        let sequence = &described.samples[answer.sample_idx].sequence;
        by_sequence.entry(sequence.clone()).or_default().push(answer.clone());
    }
    by_sequence
}

fn print(report: &Report) -> io::Result<()> {
    if report.simulated {
        say!("Simulated frames.\n")?;
    }
    if report.n_learned > 0 {
        say!(
            "Of these frames the model has learned {}: the rates below are better than on frames it has not seen.\n",
            report.n_learned
        )?;
    }
    if (2..=MAX_SEQUENCES).contains(&report.by_sequence.len()) {
        let mut table = output::table(["sequence", "frames", "rate", "near borders", "farther away"]);
        for (sequence, evaluation) in &report.by_sequence {
            table.add_row([
                sequence.clone(),
                evaluation.overall.n_frames.to_string(),
                output::rate(&evaluation.overall),
                output::rate(&evaluation.only_border),
                output::rate(&evaluation.without_border),
            ]);
        }
        say!("{table}")?;
    }
    output::print_evaluation(&report.evaluation)?;
    output::print_knowledge(&report.knowledge)?;
    if let Some(EarlyWorth { early, right, right_by_all, frame_ms, frame_ms_by_all }) = &report.early {
        say!(
            "Answered without asking all opinions: {} of {} frames, {} right where asking all answers {} right. A frame takes \
             {frame_ms:.1} ms on average, asking all {frame_ms_by_all:.1} ms.",
            early.n_correct,
            early.n_frames,
            right.n_correct,
            right_by_all.n_correct
        )?;
    }
    if let Some(PoseErrors { n_frames, median, percentile_90, median_heading, .. }) = &report.poses {
        say!(
            "Poses of {n_frames} frames: off by {median:.2} m (middle), {percentile_90:.2} m (nine of ten), \
             {median_heading:.0} degrees (middle)."
        )?;
    }
    if report.n_of_unknown_rooms > 0 {
        let (n_frames, rooms) = (report.n_of_unknown_rooms, report.unknown_rooms.join(", "));
        say!("\nFrames of rooms that the model does not know: {n_frames} ({rooms})")?;
    }
    if let Some(streams) = &report.streams {
        stream::print(streams)?;
    }
    if let Some(frames) = &report.wrong {
        wrong::print(frames)?;
    }
    Ok(())
}
