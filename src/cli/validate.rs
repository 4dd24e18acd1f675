//! `roomsight validate`: how well a configuration does on a data set, over splits and seeds.

use super::data::{self, ConfigArgs, DataArgs, FoldArgs, LimitArgs};
use super::output::{self, say};
use crate::dataset::{Dataset, Described};
use crate::evaluate::{Evaluation, Summary};
use crate::model::{Config, Extractor, Model, Sample};
use crate::validate::{self, Answered, Protocol};
use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use serde::Serialize;
use std::collections::BTreeMap;
use std::io;

/// Measure a configuration: train on some frames, answer the others, for several seeds
///
/// Either a protocol makes the split, or the split is given: by sequences (--train and --test) or by the
/// data set's own (--train-split and --test-split). Rates of frames that trained are never reported.
#[derive(Args)]
pub(super) struct ValidateArgs {
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    limits: LimitArgs,
    /// How to split [default: sequences, unless a split is given]
    #[arg(long, value_enum, conflicts_with_all = ["train", "train_split"])]
    protocol: Option<ProtocolName>,
    /// With --protocol random: how many frames of each room train
    #[arg(long, default_value_t = 100, value_name = "N", value_parser = data::at_least(1))]
    train_frames: usize,
    /// Train on sequences that match, such as '*cloudy1'
    #[arg(long, value_name = "PATTERNS", requires = "test")]
    train: Option<String>,
    /// Answer sequences that match; each pattern gets a line
    #[arg(long, value_name = "PATTERNS", requires = "train", value_delimiter = ',')]
    test: Vec<String>,
    /// Train on this split, such as gallery
    #[arg(long, value_name = "SPLIT", requires = "test_split", conflicts_with = "train")]
    train_split: Option<String>,
    /// Answer this split, such as query
    #[arg(long, value_name = "SPLIT", requires = "train_split")]
    test_split: Option<String>,
    #[command(flatten)]
    folds: FoldArgs,
    #[command(flatten)]
    config: ConfigArgs,
    /// Print the rates as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum ProtocolName {
    /// Whole sequences are left out, in folds
    Sequences,
    /// Every frame is left out once
    LeaveOneOut,
    /// Some frames of each room train, drawn at random for each seed
    Random,
}

/// What is answered in each run, under one name.
struct Test {
    name: String,
    dataset: Dataset,
    described: Described,
}

/// The rates of one test.
#[derive(Serialize)]
struct Report {
    test: String,
    simulated: bool,
    /// Over the seeds, of the rates of all frames.
    rate: Option<Summary>,
    /// Over the seeds, of the mean of the rooms' rates.
    mean_by_place: Option<Summary>,
    /// Over the seeds, away from room borders.
    without_border: Option<Summary>,
    /// One a seed.
    evaluations: Vec<Evaluation>,
}

/// Runs all seeds and prints mean, deviation and best.
pub(super) fn run(args: &ValidateArgs) -> anyhow::Result<()> {
    let dataset = args.data.open(None)?;
    let config = args.config.read()?;
    let reports = match (&args.train, &args.train_split) {
        (None, None) => vec![by_protocol(args, &config, &dataset)?],
        (train, train_split) => {
            let take = |dataset: &Dataset, sequences: Option<&str>, split: Option<&str>| {
                let dataset = dataset.clone();
                Ok::<_, anyhow::Error>(match (sequences, split) {
                    (Some(patterns), _) => dataset.with_sequences(patterns)?,
                    (_, Some(split)) => dataset.with_split(split)?,
                    _ => dataset,
                })
            };
            let training = take(&dataset, train.as_deref(), train_split.as_deref())?;
            let mut tests = Vec::new();
            for pattern in &args.test {
                tests.push((pattern.clone(), take(&dataset, Some(pattern), None)?));
            }
            if let Some(split) = &args.test_split {
                tests.push((split.clone(), take(&dataset, None, Some(split))?));
            }
            by_given_split(args, &config, &training, tests)?
        }
    };
    if args.json {
        say!("{}", serde_json::to_string_pretty(&reports)?)?;
    } else {
        print(&reports)?;
    }
    Ok(())
}

fn by_protocol(args: &ValidateArgs, config: &Config, dataset: &Dataset) -> anyhow::Result<Report> {
    let (name, protocol) = match args.protocol {
        None | Some(ProtocolName::Sequences) => ("left-out sequences", Protocol::Sequences(args.folds.folds)),
        Some(ProtocolName::LeaveOneOut) => ("left-out frames", Protocol::LeaveOneOut),
        Some(ProtocolName::Random) => ("random split", Protocol::Random(args.train_frames)),
    };
    dataset.check()?;
    if let Protocol::Sequences(_) = protocol {
        args.folds.check(dataset)?;
    }
    let limits = args.limits.limits();
    let camera = args.config.camera(dataset, &limits)?;
    let described = data::describe_to_train(dataset, &Extractor::new(config, camera.clone()), &limits)?;
    let rounds = |seed| validate::rounds(&described.samples, &protocol, seed);
    let bar = output::progress("training", args.folds.seeds as usize * rounds(0).len());
    let mut evaluations = Vec::new();
    for seed in 0..args.folds.seeds {
        let config = Config { seed, ..config.clone() };
        let rounds = rounds(seed);
        if rounds.is_empty() {
            bail!("no room has frames both to train and to answer: there are too few sequences or frames");
        }
        let answers = validate::run(&described.samples, &rounds, (&config, &camera), || bar.inc(1))?;
        evaluations.push(validate::evaluate(dataset, &described, &answers));
    }
    bar.finish_and_clear();
    Ok(Report::new(name, data::is_simulated(&args.data.data), evaluations))
}

fn by_given_split(
    args: &ValidateArgs,
    config: &Config,
    training: &Dataset,
    tests: Vec<(String, Dataset)>,
) -> anyhow::Result<Vec<Report>> {
    training.check()?;
    if let Some((name, frame)) = tests.iter().find_map(|(name, test)| {
        let shared = test.frames.iter().find(|frame| training.frames.contains(frame));
        shared.map(|frame| (name, frame))
    }) {
        let path = frame.path.display();
        bail!(
            "{path} would train and be answered ({name}): choose sequences or splits without common frames"
        );
    }
    let limits = args.limits.limits();
    let camera = args.config.camera(training, &limits)?;
    let extractor = Extractor::new(config, camera.clone());
    let trained_on = data::describe_to_train(training, &extractor, &limits)?;
    let samples: Vec<&Sample> = trained_on.samples.iter().collect();
    let tests: Vec<Test> = tests
        .into_iter()
        .map(|(name, dataset)| {
            let dataset = dataset.with_camera(camera.projection.kind()).context("the test's camera")?;
            let described = data::describe_to_answer(&dataset, &extractor, &limits, &trained_on)?;
            Ok(Test { name, dataset, described })
        })
        .collect::<anyhow::Result<_>>()?;
    let bar = output::progress("training", args.folds.seeds as usize);
    let mut evaluations: BTreeMap<usize, Vec<Evaluation>> = BTreeMap::new();
    for seed in 0..args.folds.seeds {
        let config = Config { seed, ..config.clone() };
        let model = Model::train(&samples, &config, camera.clone(), |_| ())?.model;
        for (test_idx, test) in tests.iter().enumerate() {
            let answers: Vec<Answered> = (0..test.described.samples.len())
                .map(|sample_idx| validate::answer(&model, &test.described.samples, sample_idx))
                .collect();
            let evaluation = validate::evaluate(&test.dataset, &test.described, &answers);
            evaluations.entry(test_idx).or_default().push(evaluation);
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    let simulated = data::is_simulated(&args.data.data);
    let report =
        |(test, evaluations): (&Test, Vec<Evaluation>)| Report::new(&test.name, simulated, evaluations);
    Ok(tests.iter().zip(evaluations.into_values()).map(report).collect())
}

impl Report {
    fn new(test: &str, simulated: bool, evaluations: Vec<Evaluation>) -> Self {
        let summary = |value: fn(&Evaluation) -> Option<f64>| {
            Summary::of(&evaluations.iter().filter_map(value).collect::<Vec<_>>())
        };
        Self {
            test: test.to_owned(),
            simulated,
            rate: summary(|evaluation| evaluation.overall.rate),
            mean_by_place: summary(|evaluation| evaluation.mean_by_place),
            without_border: summary(|evaluation| evaluation.without_border.rate),
            evaluations,
        }
    }
}

fn print(reports: &[Report]) -> io::Result<()> {
    if reports.iter().any(|report| report.simulated) {
        say!("Simulated frames.\n")?;
    }
    let mut table =
        output::table(["answered", "frames", "seeds", "mean", "std", "best", "by room", "off borders"]);
    let digits = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.4}"));
    for report in reports {
        let n_frames = report.evaluations.first().map_or(0, |evaluation| evaluation.overall.n_frames);
        table.add_row([
            report.test.clone(),
            n_frames.to_string(),
            report.evaluations.len().to_string(),
            digits(report.rate.map(|rate| rate.mean)),
            digits(report.rate.and_then(|rate| rate.std)),
            digits(report.rate.map(|rate| rate.best)),
            digits(report.mean_by_place.map(|rate| rate.mean)),
            digits(report.without_border.map(|rate| rate.mean)),
        ]);
    }
    say!("{table}")?;
    for report in reports {
        if let Some(first) = report.evaluations.first() {
            say!("\n{}, seed 0:", report.test)?;
            output::print_evaluation(first)?;
        }
    }
    Ok(())
}
