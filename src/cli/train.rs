//! `roomsight train`: labeled frames to a model folder.

mod compare;
mod curve;
mod golden;
mod not_held_out;
mod verdict;

use super::data::{self, ConfigArgs, DataArgs, LimitArgs};
use super::models::{self, CacheArgs, Local};
use super::output::{self, GateFailed, say};
use crate::cli::manners::note;
use anyhow::{Context, bail};
use clap::Args;
use compare::Comparison;
use curve::LearningCurve;
use not_held_out::NotHeldOut;
use roomsight_lab::dataset::{Dataset, Described};
use roomsight_lab::evaluate::Evaluation;
use roomsight_lab::validate::{self, Answered};
use roomsight_protocol::version_id::VersionId;
use roomsight_recognition::model::{
    Addition, Card, Choice, Extractor, GoldenFrame, HeldOut, LeftOut, Measurement, Model, Sample, Training,
    TrainingStep, all_opinions, train_preferred,
};
use roomsight_vision::image::Limits;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use verdict::Verdict;

/// Below this rate of held-out frames it is told whether more frames would help.
const WORTH_ADVICE: f64 = 0.95;

/// Up to here the default kernel answered held-out drives as well as without dropping (docs/RESULTS.md).
const DEFAULT_FORGET: f64 = 0.7;

/// Train a model on labeled frames
///
/// The frames are dealt into folds, whole sequences where there are several; each fold is answered by a
/// model trained without it. These answers calibrate the probabilities and give the rates that are
/// printed. The model itself is trained on all frames.
///
/// Which opinions the model has is chosen among a few combinations by the same answers (--effort), unless
/// parameters are given.
///
/// With --add, a trained model learns the frames in addition, sequence by sequence, each answered before
/// it is learned. The frames of before are not needed: the model keeps what it takes to go on, unless it was
/// configured to boost or to compare sets of descriptors.
///
/// In the end it says whether the model is worth serving. Exit code 3 where a gate (--min-rate, --min-known) fails, or where
/// --publish finds a better version serving; no model is written then.
#[derive(Args)]
pub(super) struct TrainArgs {
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    limits: LimitArgs,
    /// New folder for the model
    #[arg(short, long, value_name = "MODEL", required_unless_present = "publish")]
    output: Option<PathBuf>,
    /// Instead: make the model the next version of --name in this repository, a folder or s3://BUCKET/PREFIX.
    /// A service that runs on it lets it serve, unless its policy is manual
    #[arg(long, value_name = "REPOSITORY", conflicts_with = "output", requires = "name")]
    publish: Option<String>,
    /// With --publish: the name of the model
    #[arg(long, value_name = "NAME", requires = "publish", value_parser = models::name)]
    name: Option<String>,
    /// With --publish: also where the version that serves answers more frames right
    #[arg(long, requires = "publish")]
    even_if_worse: bool,
    /// With --output: say how the model does beside the one in this folder. It is written also where it is worse
    #[arg(long, value_name = "MODEL", conflicts_with = "publish")]
    beside: Option<PathBuf>,
    /// With --beside: what that model is called in what is said [default: its folder]
    #[arg(long, value_name = "TEXT", requires = "beside")]
    beside_name: Option<String>,
    #[command(flatten)]
    cache: CacheArgs,
    /// Add the frames to what this model has learned; its configuration, camera and words stay
    #[arg(long, value_name = "MODEL", conflicts_with_all = ["config", "parameters", "precision", "early_precision", "opinions", "effort", "mask", "camera"])]
    add: Option<PathBuf>,
    /// With --add, of kernel machines: drop support vectors of which the others make up all but this share. 0 loses nothing,
    /// more makes a smaller and faster model that answers a little worse
    #[arg(long, value_name = "SHARE", requires = "add", default_value_t = DEFAULT_FORGET)]
    #[arg(value_parser = share, allow_negative_numbers = true)]
    forget: f64,
    #[command(flatten)]
    config: ConfigArgs,
    /// A sentence about the model for its card [default with --add: the one it has]
    #[arg(long, default_value = "", hide_default_value = true, value_name = "TEXT")]
    description: String,
    /// Write no model where less than this share of held-out frames is answered right, from 0 to 1
    #[arg(long, value_name = "SHARE", value_parser = share)]
    min_rate: Option<f64>,
    /// Write no model where less than this share of the right held-out answers is known, from 0 to 1
    #[arg(long, value_name = "SHARE", value_parser = share)]
    min_known: Option<f64>,
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
    #[serde(skip_serializing_if = "Option::is_none")]
    published: Option<String>,
    card: Card,
    held_out: Evaluation,
    /// Why the other frames have no held-out answer.
    not_held_out: Vec<NotHeldOut>,
    verdict: Verdict,
    /// With the version that serves.
    #[serde(skip_serializing_if = "Option::is_none")]
    comparison: Option<Comparison>,
}

/// A model whose card says what it was trained on, and the frames that it has just learned.
struct Trained {
    training: Training,
    /// As far as training tells.
    card: Card,
    dataset: Dataset,
    described: Described,
    /// On what the held-out rate was measured.
    held_out: &'static str,
}

/// Where the model goes.
enum Destination<'a> {
    Folder(&'a Path, Option<Beside<'a>>),
    Repository(Box<Local>, &'a str),
}

/// A model that the new one is compared with.
struct Beside<'a> {
    folder: &'a Path,
    name: String,
}

/// Trains, prints the held-out rates, writes the model.
pub(super) fn run(args: &TrainArgs) -> anyhow::Result<()> {
    let destination = Destination::of(args)?;
    let trained = match &args.add {
        Some(folder) => add_to(folder, args)?,
        None => train(args)?,
    };
    let Trained { training, dataset, described, .. } = &trained;
    let Training { model, held_out, .. } = training;
    let answers: Vec<Answered> = held_out.iter().map(|held_out| answered(model, held_out)).collect();
    let evaluation = validate::evaluate(dataset, described, &answers);
    let of_rooms = || described.samples.iter().filter(|sample| !sample.is_elsewhere());
    let taken: Vec<_> = of_rooms().map(|sample| (sample.room.as_str(), sample.sequence.as_str())).collect();
    let knowledge = validate::knowledge(described, &answers);
    // It takes about half as long as the training, and advises nobody whose rooms are told apart.
    let is_wanted = args.add.is_none() && evaluation.overall.rate.is_some_and(|rate| rate < WORTH_ADVICE);
    let curve = if is_wanted { learning_curve(&trained) } else { None };
    let verdict = Verdict::of(&evaluation, knowledge, model.known_probability().is_some(), curve, &taken);
    args.gates_hold(&verdict, &evaluation)?;
    let comparison = destination.comparison((dataset, described), &answers, &args.limits.limits())?;
    if let Some(comparison) = comparison
        .as_ref()
        .filter(|comparison| comparison.is_worse && args.publish.is_some() && !args.even_if_worse)
    {
        return Err(GateFailed(format!("it is worse. {comparison}. To publish it: --even-if-worse")).into());
    }
    let card = card(args, &trained, &evaluation);
    let transitions = match &args.add {
        // Those of the first training stay: what was seen then is not there to be counted again.
        Some(_) => model.transitions().clone(),
        None => dataset.transitions(model.rooms()),
    };
    let model = training.finish(card.clone(), transitions);
    let golden = if args.no_golden_frames {
        Vec::new()
    } else {
        golden::frames(&model, dataset, described, &args.limits.limits())
    };
    if golden.is_empty() && !args.no_golden_frames {
        note!(
            "note: no frame is kept with the model, by which others check it: the pictures are not at hand"
        );
    }
    let (folder, published) = destination.take(&model, &golden)?;
    let not_held_out = NotHeldOut::of(held_out, &described.samples, args.add.is_some());

    if args.json {
        let published = published.map(|id| id.to_string());
        let report = Report {
            model: folder,
            published,
            card,
            held_out: evaluation,
            not_held_out,
            verdict,
            comparison,
        };
        say!("{}", serde_json::to_string_pretty(&report)?)?;
        return Ok(());
    }
    let frames = if card.simulated { "simulated frames" } else { "frames" };
    let when = if args.add.is_some() { ", given before they were learned" } else { "" };
    say!("Held-out answers to {} of {} {frames}{when}:\n", answers.len(), taken.len())?;
    for NotHeldOut { reason, n_frames, rooms } in &not_held_out {
        say!("  without one: {n_frames} {reason} ({})", rooms.join(", "))?;
    }
    if !not_held_out.is_empty() {
        say!()?;
    }
    output::print_evaluation(&evaluation)?;
    let n_elsewhere = described.samples.len() - taken.len();
    if n_elsewhere > 0 {
        say!("Pictures of elsewhere that tell what is no room: {n_elsewhere}.")?;
    }
    verdict.print(args.add.is_none())?;
    if let Some(comparison) = &comparison {
        comparison.print()?;
    }
    if let Some(choice) = &card.choice {
        say!("\n{}", choices(choice))?;
    }
    if let Some(early) = &card.early {
        say!("\nWithout asking all opinions: {}.", output::early_text(early))?;
    }
    if args.add.is_some() {
        say!("\n{}", additions(&card.additions))?;
    }
    let (program, quoted) = (output::program(), output::quoted(&folder));
    let (ready, models) = match (&args.publish, published) {
        (Some(repository), Some(id)) => (id.to_string(), output::quoted(Path::new(repository))),
        _ => (folder.display().to_string(), quoted.clone()),
    };
    if verdict.is_worth_serving() {
        say!("\n{ready} is ready. Try it:")?;
    } else {
        say!("\n{ready} is written, but it is no better than guessing: do not let it serve. To look at it:")?;
    }
    say!("  {program} recognize {quoted} FRAME.jpg")?;
    say!("  {program} serve --models {models}")?;
    if let Destination::Repository(repository, name) = &destination
        && let Some(default) = repository.default_name()?.filter(|default| default != name)
    {
        say!("Requests that name no model are answered by {default}. To let {name} answer them:")?;
        say!("  {program} models default {name} --models {models}")?;
    }
    Ok(())
}

impl TrainArgs {
    /// An error that names the gates that do not hold.
    fn gates_hold(&self, verdict: &Verdict, evaluation: &Evaluation) -> Result<(), GateFailed> {
        let rates = [
            ("right on held-out frames", "--min-rate", self.min_rate, evaluation.overall.rate),
            ("known of the right ones", "--min-known", self.min_known, verdict.knowledge.right_known.rate),
        ];
        let failed = rates.into_iter().filter_map(|(what, gate, least, rate)| {
            let (least, rate) = (least?, rate.unwrap_or_default());
            (rate < least).then(|| format!("{rate:.4} {what}, below {gate} {least}"))
        });
        let failed: Vec<String> = failed.collect();
        if failed.is_empty() { Ok(()) } else { Err(GateFailed(failed.join("; "))) }
    }
}

impl<'a> Destination<'a> {
    /// Seen to before the training, which takes long.
    fn of(args: &'a TrainArgs) -> anyhow::Result<Self> {
        match (&args.output, &args.publish, &args.name) {
            (Some(folder), ..) if folder.exists() => {
                bail!("{} exists already; a model never changes: choose another folder", folder.display())
            }
            (Some(folder), ..) => {
                let beside = args.beside.as_deref().map(|folder| Beside {
                    folder,
                    name: args.beside_name.clone().unwrap_or_else(|| folder.display().to_string()),
                });
                Ok(Self::Folder(folder, beside))
            }
            (None, Some(repository), Some(name)) => {
                let local = Local::open_to_add(repository, &args.cache.models_cache)?;
                Ok(Self::Repository(Box::new(local), name))
            }
            _ => bail!("where does the model go? Give --output, or --publish and --name"),
        }
    }

    /// How a model whose held-out answers are these does beside the version that serves there, if one does.
    fn comparison(
        &self,
        trained: (&Dataset, &Described),
        answers: &[Answered],
        limits: &Limits,
    ) -> anyhow::Result<Option<Comparison>> {
        let (name, folder) = match self {
            Self::Folder(_, None) => return Ok(None),
            Self::Folder(_, Some(Beside { folder, name })) => (name.clone(), folder.to_path_buf()),
            Self::Repository(repository, name) => match repository.serving(name)? {
                Some(id) => (id.to_string(), repository.folder(&id)?),
                None => return Ok(None),
            },
        };
        match Model::load(&folder) {
            Ok(loaded) => Ok(Comparison::new((&name, &loaded.model), trained, answers, limits)),
            Err(error) => {
                note!("note: not compared with {name}: {error}");
                Ok(None)
            }
        }
    }

    /// Writes the model there; returns its folder and, in a repository, what it is called.
    fn take(&self, model: &Model, golden: &[GoldenFrame]) -> anyhow::Result<(PathBuf, Option<VersionId>)> {
        match self {
            Self::Folder(folder, _) => {
                model.save(folder, golden)?;
                Ok((folder.to_path_buf(), None))
            }
            Self::Repository(repository, name) => {
                let temporary = TempDir::new()?;
                let folder = temporary.path().join(name);
                model.save(&folder, golden)?;
                let id = repository.push(&folder, name, None)?;
                Ok((repository.folder(&id)?, Some(id)))
            }
        }
    }
}

fn train(args: &TrainArgs) -> anyhow::Result<Trained> {
    let dataset = args.data.open(None)?;
    dataset.check()?;
    let candidates = args.config.candidates(&dataset)?;
    let config = all_opinions(&candidates).context("there is nothing to train")?;
    let limits = args.limits.limits();
    let camera = args.config.camera(&dataset, &limits)?;
    let described = data::describe_to_train(&dataset, &Extractor::new(&config, camera.clone()), &limits)?;
    let samples: Vec<&Sample> = described.samples.iter().collect();
    let mut choice = None;
    let training = with_progress(|progress| {
        let preferred = train_preferred(&samples, &candidates, &camera, progress)?;
        for LeftOut { opinion, reason } in &preferred.left_out {
            note!("left out: the opinion {opinion}: {reason}");
        }
        choice = Some(preferred.choice);
        Ok(preferred.training)
    })?;
    let sequences = sequences(&dataset);
    let held_out = match sequences.len() {
        _ if training.are_single_frames => "held-out frames, since sequences show other parts of the rooms",
        0 | 1 => "held-out frames",
        _ => "held-out sequences",
    };
    let card = Card {
        n_frames: samples.iter().filter(|sample| !sample.is_elsewhere()).count(),
        sequences: sequences.into_iter().map(str::to_owned).collect(),
        choice: choice.filter(|choice| choice.tallies.len() > 1),
        ..training.model.card().clone()
    };
    Ok(Trained { training, card, dataset, described, held_out })
}

fn add_to(folder: &Path, args: &TrainArgs) -> anyhow::Result<Trained> {
    let model = data::load_model(folder)?.model;
    let dataset = args.data.open(Some(&model))?;
    dataset.check_names(model.rooms())?;
    model.check_addition(sequences(&dataset))?;
    let extractor = Extractor::new(model.config(), model.camera().clone());
    let described = data::describe_to_train(&dataset, &extractor, &args.limits.limits())?;
    let samples: Vec<&Sample> = described.samples.iter().collect();
    let training = with_progress(|progress| Ok(model.add(&samples, args.forget, progress)?))?;
    let card = training.model.card().clone();
    Ok(Trained { training, card, dataset, described, held_out: "added sequences, before they were learned" })
}

/// Trains behind a progress bar.
fn with_progress(
    train: impl FnOnce(&mut dyn FnMut(TrainingStep)) -> anyhow::Result<Training>,
) -> anyhow::Result<Training> {
    let bar = output::progress("training", 1);
    let training = train(&mut |step| {
        bar.set_length(step.n_steps as u64);
        bar.set_position(step.n_done as u64);
    });
    bar.finish_and_clear();
    training
}

/// Held-out rates with half of the frames beside those with all, where that can be told.
fn learning_curve(trained: &Trained) -> Option<LearningCurve> {
    let Trained { training: Training { model, held_out, .. }, described, .. } = trained;
    let bar = output::progress("with half of them", 1);
    let curve = LearningCurve::measure(&described.samples, model, held_out, |step| {
        bar.set_length(step.n_steps as u64);
        bar.set_position(step.n_done as u64);
    });
    bar.finish_and_clear();
    match curve {
        Ok(curve) => curve,
        Err(error) => {
            note!("note: how much more frames would help cannot be told: {error}");
            None
        }
    }
}

fn sequences(dataset: &Dataset) -> BTreeSet<&str> {
    let of_rooms = dataset.frames.iter().filter(|frame| !frame.is_elsewhere());
    of_rooms.map(|frame| frame.sequence.as_str()).collect()
}

fn answered(model: &Model, held_out: &HeldOut) -> Answered {
    let HeldOut { sample_idx, recognition } = held_out.clone();
    Answered { sample_idx, room: model.rooms()[recognition.room_idx].clone(), recognition, is_new: false }
}

/// The card as training left it, completed by what the command knows.
fn card(args: &TrainArgs, trained: &Trained, evaluation: &Evaluation) -> Card {
    let mut card = trained.card.clone();
    let is_simulated = data::is_simulated(&args.data.data);
    let data = format!("{}{}", trained.held_out, if is_simulated { ", simulated" } else { "" });
    let rate = evaluation.overall.rate;
    card.measured.extend(rate.map(|rate| Measurement { data, n_frames: evaluation.overall.n_frames, rate }));
    card.simulated |= is_simulated;
    card.trained_by = concat!("roomsight ", env!("CARGO_PKG_VERSION")).to_owned();
    if !args.description.is_empty() {
        card.description.clone_from(&args.description);
    }
    card
}

/// What each addition did to what is kept, those of earlier calls included.
fn additions(additions: &[Addition]) -> comfy_table::Table {
    let mut table = output::table(["added", "frames", "--forget", "kept before", "kept now"]);
    for Addition { sequence, n_frames, forget, n_before, n_left } in additions {
        let [n_frames, n_before, n_left] = [n_frames, n_before, n_left].map(ToString::to_string);
        table.add_row([sequence.clone(), n_frames, forget.to_string(), n_before, n_left]);
    }
    table
}

/// How the candidates did on held-out frames.
fn choices(choice: &Choice) -> comfy_table::Table {
    let mut table = output::table(["tried", "opinions", "right", "of", ""]);
    for (idx, tally) in choice.tallies.iter().enumerate() {
        let mark = if idx == choice.chosen { "chosen" } else { "" };
        let [n_right, n_frames] = [tally.n_right, tally.n_frames].map(|n| n.to_string());
        table.add_row([tally.name.clone(), tally.opinions.join(", "), n_right, n_frames, mark.to_owned()]);
    }
    table
}

/// Reads a share of which something is left.
fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|share| (0.0..1.0).contains(share));
    share.ok_or_else(|| "it must be from 0 to below 1".to_owned())
}
