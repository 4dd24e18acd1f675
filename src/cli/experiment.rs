//! `roomsight experiment`: the tables and figures of the papers.

use super::data::{self, CameraName, ConfigArgs};
use super::output::{self, say};
use crate::camera::CameraKind;
use crate::dataset::{self, Dataset};
use crate::experiment::report::{self, Entry, Report};
use crate::experiment::{self, Cache, Chart, Drives, Experiment, Measured, Plan};
use crate::model::{Config, Representation, all_opinions};
use anyhow::{Context, bail};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::iter;
use std::path::{Path, PathBuf};

/// Repeat the experiments of the papers, and one on opinions, on sequences of COLD, or of the simulated lab
///
/// Writes report.html and report.json. Answers are kept in a folder beside them: an interrupted run goes on
/// where it stopped, and a second one takes seconds.
#[derive(Args)]
pub(super) struct ExperimentArgs {
    /// Which one
    #[arg(value_parser = Selection::parser())]
    name: Selection,
    /// Sequences of the COLD database, or of the simulated lab
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Folder for the report
    #[arg(long, value_name = "OUT")]
    report: PathBuf,
    /// Over how many seeds
    #[arg(long, default_value_t = 10, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    /// Take every Nth frame of each sequence
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = data::at_least(1))]
    stride: usize,
    /// Two seeds, some forty frames of each sequence, few rounds of k-means: to see that it works, not to learn from
    #[arg(long)]
    quick: bool,
    /// Whose frames [default: omnidirectional for the experiments of Lu, perspective for those of Ullah]
    #[arg(long, value_enum)]
    camera: Option<CameraName>,
    #[command(flatten)]
    config: ConfigArgs,
}

/// What may be asked for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Selection {
    All,
    One(Experiment),
}

impl Selection {
    fn includes(self, experiment: Experiment) -> bool {
        self == Self::All || self == Self::One(experiment)
    }

    fn parser() -> impl TypedValueParser<Value = Self> {
        let all =
            PossibleValue::new("all").help("All; those that the data does not allow are left out, and named");
        let one = Experiment::value_variants().iter().filter_map(Experiment::to_possible_value);
        PossibleValuesParser::new(iter::once(all).chain(one))
            .map(|name| Experiment::from_str(&name, false).map_or(Self::All, Self::One))
    }
}

/// Measures, prints the tables, writes the report.
pub(super) fn run(args: &ExperimentArgs) -> anyhow::Result<()> {
    let mut config = args.config.read()?;
    let dataset = dataset::open(&args.data)?;
    data::report_all(&dataset);
    if dataset.frames.is_empty() {
        dataset.check()?;
    }
    let (mut n_seeds, mut stride) = (args.seeds, args.stride);
    if args.quick {
        (n_seeds, stride) = (n_seeds.min(2), stride.max(quick_stride(&dataset)));
        config = quick(config);
    }
    let cache = Cache::open(&args.report.join("answers"))?;
    let simulated = data::is_simulated(&args.data);
    let mut entries = Vec::new();
    let mut all_drives = None;
    for (camera, experiments) in by_camera(args) {
        let dataset = match dataset.clone().with_camera(camera) {
            Ok(dataset) => dataset,
            Err(error) if args.name == Selection::All => {
                say!("left out: {}: {error}", names(&experiments))?;
                continue;
            }
            Err(error) => return Err(error.into()),
        };
        let drives = Drives::new(&dataset, stride)?;
        // All are planned before the first starts: what is missing shows at once.
        let mut plans = Vec::new();
        let opinions =
            experiments.contains(&Experiment::Opinions).then(|| args.opinions(&dataset)).transpose()?;
        for experiment in experiments {
            let base = opinions.as_ref().filter(|_| experiment == Experiment::Opinions).unwrap_or(&config);
            match experiment.plan(&drives, base) {
                Ok(plan) => plans.push(plan),
                Err(error) if args.name == Selection::All => say!("left out: {error}")?,
                Err(error) => return Err(error.into()),
            }
        }
        for plan in plans {
            let bar = output::progress(&plan.title, plan.n_steps(n_seeds));
            let measured = experiment::run(&plan, &drives, n_seeds, &cache, |step| {
                bar.set_position(step.n_done as u64);
                bar.set_message(step.cell);
            })?;
            bar.finish_and_clear();
            print(&plan, &measured, simulated)?;
            entries.push(Entry { plan, measured });
        }
        all_drives = Some(all_drives.unwrap_or(drives));
    }
    let Some(drives) = all_drives.filter(|_| !entries.is_empty()) else {
        bail!("nothing was measured: {} has no sequences for these experiments", args.data.display());
    };
    let names = drives.iter().map(|drive| drive.sequence.clone()).collect();
    let report = Report { simulated, n_seeds, stride, drives: names, entries: &entries };
    write(&args.report.join("report.json"), &report.to_json()?)?;
    write(&args.report.join("report.html"), &report.to_html(&drives))?;
    say!("\n{} is ready; report.json beside it.", args.report.join("report.html").display())?;
    Ok(())
}

impl ExperimentArgs {
    /// A configuration of all opinions that are measured alone and together: those configured, or else those of the effort.
    fn opinions(&self, dataset: &Dataset) -> anyhow::Result<Config> {
        let opinions = all_opinions(&self.config.candidates(dataset)?).context("there is no opinion")?;
        Ok(if self.quick { quick(opinions) } else { opinions })
    }
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    fs::write(path, text).with_context(|| path.display().to_string())
}

/// The experiments asked for, by the camera whose frames they take.
fn by_camera(args: &ExperimentArgs) -> Vec<(CameraKind, Vec<Experiment>)> {
    let wanted: Vec<Experiment> =
        Experiment::value_variants().iter().copied().filter(|&one| args.name.includes(one)).collect();
    if let Some(camera) = args.camera {
        return vec![(camera.into(), wanted)];
    }
    let of =
        |camera| wanted.iter().copied().filter(|&experiment| paper_camera(experiment) == camera).collect();
    [CameraKind::Omnidirectional, CameraKind::Perspective]
        .map(|camera| (camera, of(camera)))
        .into_iter()
        .filter(|(_, experiments): &(CameraKind, Vec<Experiment>)| !experiments.is_empty())
        .collect()
}

fn paper_camera(experiment: Experiment) -> CameraKind {
    match experiment {
        Experiment::Dynamic | Experiment::Geographic | Experiment::Categorical => CameraKind::Perspective,
        _ => CameraKind::Omnidirectional,
    }
}

fn names(experiments: &[Experiment]) -> String {
    experiments.iter().map(Experiment::to_string).collect::<Vec<_>>().join(", ")
}

fn quick(mut config: Config) -> Config {
    if config.machines().is_some() {
        config = config.with_bag(|machines| {
            if let Representation::Bag(bag) = &mut machines.representation {
                bag.max_descriptors = bag.max_descriptors.min(20_000);
                bag.max_rounds = bag.max_rounds.min(5);
            }
        });
    }
    config.calibration.n_folds = 2;
    config
}

/// One frame in this many leaves at most forty of the longest sequence, and at most one in five.
fn quick_stride(dataset: &Dataset) -> usize {
    const N_FRAMES: usize = 40;
    let mut n_frames: BTreeMap<(&str, CameraKind), usize> = BTreeMap::new();
    for frame in &dataset.frames {
        *n_frames.entry((&frame.sequence, frame.camera)).or_default() += 1;
    }
    n_frames.values().max().map_or(0, |longest| longest.div_ceil(N_FRAMES)).max(5)
}

fn print(plan: &Plan, measured: &[Measured], simulated: bool) -> io::Result<()> {
    let kind = if simulated { ", simulated frames" } else { "" };
    say!("\n{} ({}{kind})", plan.title, plan.source)?;
    match plan.experiment {
        Experiment::Cost => print_costs(plan, measured)?,
        _ => print_figures(plan, measured, simulated)?,
    }
    report::impossible(plan, measured).iter().try_for_each(|reason| say!("{reason}"))
}

fn print_figures(plan: &Plan, measured: &[Measured], simulated: bool) -> io::Result<()> {
    let figure = if plan.chart == Chart::Table { "mean" } else { "mean \u{b1} std (best)" };
    let mut table = output::table(["", "answered", figure, "printed", "keypoints"]);
    for (cell, measured) in plan.cells.iter().zip(measured) {
        let printed = cell.printed.filter(|_| !simulated);
        table.add_row([
            cell.row.clone(),
            cell.column.clone(),
            report::figure(measured),
            printed.map_or("-".to_owned(), |rate| format!("{rate:.4}")),
            measured.rates().map_or("-".to_owned(), |rates| format!("{:.0}", rates.keypoints.mean)),
        ]);
    }
    say!("{table}")
}

fn print_costs(plan: &Plan, measured: &[Measured]) -> io::Result<()> {
    let mut table = output::table([&[""][..], &report::COST_COLUMNS].concat());
    for (cell, measured) in plan.cells.iter().zip(measured) {
        if let Measured::Cost(cost) = measured {
            table.add_row([&[cell.row.clone()][..], &report::cost_row(cost)].concat());
        }
    }
    say!("{table}")?;
    report::cpu(measured).map_or(Ok(()), |cpu| say!("On one thread of {cpu}."))
}
