//! `roomsight validate`: how well a configuration does on a data set, over splits and seeds.

use super::data::{self, ConfigArgs, DataArgs, FoldArgs, LimitArgs};
use super::output::{self, say};
use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use rayon::prelude::*;
use roomsight_lab::dataset::{Dataset, Described};
use roomsight_lab::evaluate::{Evaluation, Knowledge, Rate, Summary};
use roomsight_lab::validate::{self, Answered, Cost, Method, Protocol, Round, Trained};
use roomsight_recognition::model::{Config, Extractor, Sample, all_opinions};
use roomsight_vision::image::Limits;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::ops::Range;

/// Frames of each room that train where they are drawn at random.
const DEFAULT_TRAIN_FRAMES: usize = 100;

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
    /// How many frames of each room train, drawn anew for each seed [default: 100 with --protocol random, else all]
    #[arg(long, value_name = "N", value_parser = data::at_least(1))]
    train_frames: Option<usize>,
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
    /// Measure each opinion of the configuration alone, each pair, and all together, with what they cost
    #[arg(long)]
    each: bool,
    /// Leave this many rooms out of training, others for each seed, and tell whether their frames are called unknown
    #[arg(long, value_name = "N", default_value_t = 0)]
    without_rooms: usize,
    /// The first of the seeds, so that several machines can share them
    #[arg(long, value_name = "SEED", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..1 << 32))]
    first_seed: u64,
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

/// What is trained: the configuration of all opinions, and models of all or of some of them.
struct Trainee {
    config: Config,
    method: Method,
}

/// The rates of one test, of the models of one team of opinions.
#[derive(Serialize)]
struct Report {
    test: String,
    simulated: bool,
    /// The opinions, joined by `+`, or how they were chosen.
    opinions: String,
    /// Over the seeds, of the rates of all frames.
    rate: Option<Summary>,
    /// Over the seeds, of the mean of the rooms' rates.
    #[serde(rename = "mean_by_place")]
    mean_by_room: Option<Summary>,
    /// Over the seeds, away from room borders.
    without_border: Option<Summary>,
    /// What answering a frame takes, where that was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    cost: Option<Cost>,
    /// Frames, over all seeds, and those of them that were answered without asking all opinions.
    early: Rate,
    /// How often each candidate was preferred.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    preferred: BTreeMap<String, usize>,
    /// One a seed.
    evaluations: Vec<Evaluation>,
    /// What "known" is worth, one a seed.
    knowledge: Vec<Knowledge>,
}

/// Runs all seeds and prints mean, deviation and best.
pub(super) fn run(args: &ValidateArgs) -> anyhow::Result<()> {
    let dataset = args.data.open(None)?;
    let trainee = args.trainee(&dataset)?;
    let reports = match (&args.train, &args.train_split) {
        (None, None) => by_protocol(args, &trainee, &dataset)?,
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
            by_given_split(args, &trainee, &training, tests)?
        }
    };
    if args.json {
        say!("{}", serde_json::to_string_pretty(&reports)?)?;
    } else {
        print(&reports, args.first_seed)?;
    }
    Ok(())
}

impl ValidateArgs {
    fn trainee(&self, dataset: &Dataset) -> anyhow::Result<Trainee> {
        let candidates = self.config.candidates(dataset)?;
        let config = all_opinions(&candidates).context("there is nothing to train")?;
        let method =
            if self.each { Method::Every(validate::teams(&config)) } else { Method::Preferred(candidates) };
        Ok(Trainee { config, method })
    }

    fn seeds(&self) -> Range<u64> {
        self.first_seed..self.first_seed + self.folds.seeds
    }

    /// The rooms that this seed's models are trained without.
    fn left_out_rooms(&self, training: &Dataset, seed: u64) -> anyhow::Result<BTreeSet<String>> {
        let rooms: BTreeSet<String> = training.rooms().into_iter().collect();
        if self.without_rooms > 0 && rooms.len() < self.without_rooms + 2 {
            bail!("--without-rooms {}: of {} rooms, two must be left", self.without_rooms, rooms.len());
        }
        Ok(validate::left_out_rooms(&rooms, self.without_rooms, seed))
    }
}

fn by_protocol(args: &ValidateArgs, trainee: &Trainee, dataset: &Dataset) -> anyhow::Result<Vec<Report>> {
    if args.train_frames.is_some() && !matches!(args.protocol, Some(ProtocolName::Random)) {
        bail!("--train-frames draws frames for --protocol random, or of a given split");
    }
    let (name, protocol) = match args.protocol {
        None | Some(ProtocolName::Sequences) => ("left-out sequences", Protocol::Sequences(args.folds.folds)),
        Some(ProtocolName::LeaveOneOut) => ("left-out frames", Protocol::LeaveOneOut),
        Some(ProtocolName::Random) => {
            ("random split", Protocol::Random(args.train_frames.unwrap_or(DEFAULT_TRAIN_FRAMES)))
        }
    };
    dataset.check()?;
    if let Protocol::Sequences(_) = protocol {
        args.folds.check(dataset)?;
    }
    let limits = args.limits.limits();
    let camera = args.config.camera(dataset, &limits)?;
    let Trainee { config, method } = trainee;
    let described = data::describe_to_train(dataset, &Extractor::new(config, camera.clone()), &limits)?;
    let rounds = |seed| validate::rounds(&described.samples, &protocol, seed);
    let bar = output::progress("training", args.folds.seeds as usize * rounds(args.first_seed).len());
    let simulated = data::is_simulated(&args.data.data);
    let mut reports = Report::none_yet(name, simulated, method);
    for seed in args.seeds() {
        let config = Config { seed, ..config.clone() };
        let rounds = rounds(seed);
        if rounds.is_empty() {
            bail!("no room has frames both to train and to answer: there are too few sequences or frames");
        }
        let mut preferred = Vec::new();
        let left_out = args.left_out_rooms(dataset, seed)?;
        let rounds: Vec<Round> =
            rounds.iter().map(|round| round.without(&described.samples, &left_out)).collect();
        let answers = validate::run(&described.samples, &rounds, method, &config, &camera, |choice| {
            preferred.extend(choice.map(|choice| choice.tally().name.clone()));
            bar.inc(1);
        })?;
        for (report, answers) in reports.iter_mut().zip(answers) {
            report.add(dataset, &described, &answers, &left_out);
            preferred.iter().for_each(|name| *report.preferred.entry(name.clone()).or_default() += 1);
        }
    }
    bar.finish_and_clear();
    if args.each {
        let samples: Vec<&Sample> = described.samples.iter().collect();
        let models = method.train(&samples, config, &camera)?;
        measure(&mut reports, &models, dataset, &limits)?;
    }
    Ok(reports.into_iter().map(Report::summed_up).collect())
}

fn by_given_split(
    args: &ValidateArgs,
    trainee: &Trainee,
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
    let Trainee { config, method } = trainee;
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
    let simulated = data::is_simulated(&args.data.data);
    let none_yet = |test: &Test| Report::none_yet(&test.name, simulated, method);
    let mut by_test: Vec<Vec<Report>> = tests.iter().map(none_yet).collect();
    for seed in args.seeds() {
        let config = Config { seed, ..config.clone() };
        let left_out = args.left_out_rooms(training, seed)?;
        let mut drawn: Vec<&Sample> = match args.train_frames {
            Some(n_of_room) => validate::draw(&trained_on.samples, n_of_room, seed)
                .into_iter()
                .map(|idx| samples[idx])
                .collect(),
            None => samples.clone(),
        };
        drawn.retain(|sample| !left_out.contains(&sample.room));
        let models = method.train(&drawn, &config, &camera)?;
        for (test, reports) in tests.iter().zip(&mut by_test) {
            for Trained { team_idx, model, choice } in &models {
                let answer = |sample_idx| validate::answer(model, &test.described.samples, sample_idx);
                let answers: Vec<Answered> =
                    (0..test.described.samples.len()).into_par_iter().map(answer).collect();
                let report = &mut reports[*team_idx];
                report.add(&test.dataset, &test.described, &answers, &left_out);
                if let Some(choice) = choice {
                    *report.preferred.entry(choice.tally().name.clone()).or_default() += 1;
                }
            }
        }
        bar.inc(1);
        if args.each && seed + 1 == args.seeds().end {
            for (test, reports) in tests.iter().zip(&mut by_test) {
                measure(reports, &models, &test.dataset, &limits)?;
            }
        }
    }
    bar.finish_and_clear();
    Ok(by_test.into_iter().flatten().map(Report::summed_up).collect())
}

/// Times what each model does with some frames, on this thread.
fn measure(
    reports: &mut [Report],
    models: &[Trained],
    dataset: &Dataset,
    limits: &Limits,
) -> anyhow::Result<()> {
    for Trained { team_idx, model, .. } in models {
        reports[*team_idx].cost = Some(Cost::measure(model, dataset, limits)?);
    }
    Ok(())
}

impl Report {
    /// One for each of a method's models, without any evaluation yet.
    fn none_yet(test: &str, simulated: bool, method: &Method) -> Vec<Self> {
        let report = |opinions: String| Self {
            test: test.to_owned(),
            simulated,
            opinions,
            rate: None,
            mean_by_room: None,
            without_border: None,
            cost: None,
            early: Rate::new(0, 0),
            preferred: BTreeMap::new(),
            evaluations: Vec::new(),
            knowledge: Vec::new(),
        };
        method.names().into_iter().map(report).collect()
    }

    /// Adds a seed's answers. Those to frames of rooms that were left out on purpose are no errors.
    fn add(
        &mut self,
        dataset: &Dataset,
        described: &Described,
        answers: &[Answered],
        left_out: &BTreeSet<String>,
    ) {
        let is_trained = |answer: &&Answered| !left_out.contains(&described.samples[answer.sample_idx].room);
        let of_trained: Vec<Answered> = answers.iter().filter(is_trained).cloned().collect();
        let n_early = answers.iter().filter(|answered| answered.recognition.is_early).count();
        self.early = Rate::new(self.early.n_correct + n_early, self.early.n_frames + answers.len());
        self.evaluations.push(validate::evaluate(dataset, described, &of_trained));
        self.knowledge.push(validate::knowledge(described, answers));
    }

    /// With the summaries of its evaluations.
    fn summed_up(self) -> Self {
        let summary = |value: fn(&Evaluation) -> Option<f64>| {
            Summary::of(&self.evaluations.iter().filter_map(value).collect::<Vec<_>>())
        };
        Self {
            rate: summary(|evaluation| evaluation.overall.rate),
            mean_by_room: summary(|evaluation| evaluation.mean_by_room),
            without_border: summary(|evaluation| evaluation.without_border.rate),
            ..self
        }
    }
}

/// What "known" is worth, summed over seeds.
fn print_knowledge(reports: &[Report]) -> io::Result<()> {
    let mut table = output::table([
        "answered",
        "opinions",
        "known right",
        "right known",
        "new unknown",
        "AUROC",
        "ECE",
        "early",
    ]);
    for report in reports {
        let sum = |of: fn(&Knowledge) -> &Rate| {
            let rates = || report.knowledge.iter().map(of);
            Rate::new(rates().map(|rate| rate.n_correct).sum(), rates().map(|rate| rate.n_frames).sum())
        };
        let mean = |of: fn(&Knowledge) -> Option<f64>| {
            let values: Vec<f64> = report.knowledge.iter().filter_map(of).collect();
            Summary::of(&values).map_or("-".to_owned(), |summary| format!("{:.3}", summary.mean))
        };
        let share = |rate: &Rate| match rate.rate {
            Some(share) => format!("{share:.3} of {}", rate.n_frames),
            None => "-".to_owned(),
        };
        table.add_row([
            report.test.clone(),
            report.opinions.clone(),
            share(&sum(|knowledge| &knowledge.known)),
            share(&sum(|knowledge| &knowledge.right_known)),
            share(&sum(|knowledge| &knowledge.new_unknown)),
            mean(|knowledge| knowledge.auroc),
            mean(|knowledge| knowledge.calibration_error),
            output::rate(&report.early),
        ]);
    }
    say!("\n{table}")
}

fn print(reports: &[Report], first_seed: u64) -> io::Result<()> {
    if reports.iter().any(|report| report.simulated) {
        say!("Simulated frames.\n")?;
    }
    let has_costs = reports.iter().any(|report| report.cost.is_some());
    let mut header =
        vec!["answered", "opinions", "frames", "seeds", "mean", "std", "best", "by room", "off borders"];
    header.extend(has_costs.then_some(["see ms", "tell ms", "model MB"]).into_iter().flatten());
    let mut table = output::table(header);
    let digits = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.4}"));
    for report in reports {
        let n_frames = report.evaluations.first().map_or(0, |evaluation| evaluation.overall.n_frames);
        let mut row = vec![
            report.test.clone(),
            report.opinions.clone(),
            n_frames.to_string(),
            report.evaluations.len().to_string(),
            digits(report.rate.map(|rate| rate.mean)),
            digits(report.rate.and_then(|rate| rate.std)),
            digits(report.rate.map(|rate| rate.best)),
            digits(report.mean_by_room.map(|rate| rate.mean)),
            digits(report.without_border.map(|rate| rate.mean)),
        ];
        if let Some(cost) = &report.cost {
            row.extend([format!("{:.1}", cost.features_ms), format!("{:.1}", cost.classify_ms)]);
            row.push(format!("{:.2}", cost.model_bytes as f64 / 1e6));
        }
        table.add_row(row);
    }
    say!("{table}")?;
    print_knowledge(reports)?;
    for report in reports.iter().filter(|report| !report.preferred.is_empty()) {
        let times = report.preferred.iter().map(|(name, n_times)| format!("{name} {n_times} times"));
        say!(
            "\n{}: held-out training frames preferred {}",
            report.test,
            times.collect::<Vec<_>>().join(", ")
        )?;
    }
    if reports.len() == 1 || !has_costs {
        for report in reports {
            if let Some(first) = report.evaluations.first() {
                say!("\n{}, seed {first_seed}:", report.test)?;
                output::print_evaluation(first)?;
            }
        }
    }
    Ok(())
}
