//! `roomsight experiment`: the tables and figures of the papers.

use super::data::{self, CameraName, ConfigArgs};
use super::output::{self, say};
use crate::cli::manners::note;
use anyhow::{Context, bail};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use roomsight_lab::dataset::{self, Dataset};
use roomsight_lab::experiment::report::{self, Data, Entry, Origin, Report, Table, Value};
use roomsight_lab::experiment::{self, Cache, Drives, Experiment, Paper, Plan};
use roomsight_lab::part::Part;
use roomsight_recognition::model::{Config, Representation, all_opinions};
use roomsight_vision::camera::CameraKind;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::SystemTime;
use std::{env, fs, io, iter};

/// Repeat the experiments of the papers, and one on opinions, on sequences of COLD, or of the simulated lab
///
/// Writes report.html and report.json, and each table as LaTeX and CSV. Answers are kept in a folder beside them: an
/// interrupted run goes on where it stopped, and a second one takes seconds.
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
    /// Only keep the answers of this part of the cells, beside the report that another run makes of all: so that several machines
    /// that share the folder share the work. What takes time is measured by that run
    #[arg(long, value_name = "NUMBER/OF", conflicts_with = "json")]
    part: Option<Part>,
    /// Print report.json instead of the tables
    #[arg(long)]
    json: bool,
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

/// What is going to be measured, and on which drives.
struct Planned {
    plan: Plan,
    drives: Rc<Drives>,
}

/// Measures, prints the tables, writes the report.
pub(super) fn run(args: &ExperimentArgs) -> anyhow::Result<()> {
    let dataset = dataset::open(&args.data)?;
    data::report_all(&dataset);
    if dataset.frames.is_empty() {
        dataset.check()?;
    }
    let (mut n_seeds, mut stride) = (args.seeds, args.stride);
    if args.quick {
        (n_seeds, stride) = (n_seeds.min(2), stride.max(quick_stride(&dataset)));
    }
    let simulated = data::is_simulated(&args.data);
    // All are planned before the first starts, and before there is a folder: what is missing shows at once.
    let all_planned = args.plan(&dataset, stride)?;
    if all_planned.is_empty() {
        bail!("nothing was measured: {} has no sequences for these experiments", args.data.display());
    }
    let cache = Cache::open(&args.report.join("answers"))?;
    let mut entries = Vec::new();
    for Planned { mut plan, drives } in all_planned {
        if let Some(part) = args.part {
            plan = plan.with_part(part);
        }
        if simulated {
            plan.forget_printed();
        }
        let bar = output::progress(&plan.title, plan.n_steps(n_seeds));
        let measured = experiment::run(&plan, &drives, n_seeds, &cache, |step| {
            bar.set_position(step.n_done as u64);
            bar.set_message(step.cell);
        })?;
        bar.finish_and_clear();
        if args.part.is_some() {
            continue;
        }
        let entry = Entry { plan, measured, simulated, drives };
        if !args.json {
            print(&entry)?;
        }
        entries.push(entry);
    }
    if let Some(part) = args.part {
        return Ok(say!("The answers of part {part} are kept in {}.", output::quoted(&args.report))?);
    }
    let data = Data::of(&entries);
    let report = Report { origin: origin(), simulated, n_seeds, stride, data, entries: &entries };
    write_all(&report, &args.report)?;
    if args.json {
        say!("{}", report.to_json()?)?;
    } else {
        say!(
            "\n{} is ready; report.json and the tables beside it.",
            args.report.join("report.html").display()
        )?;
    }
    Ok(())
}

/// What made the report, as far as it is the same on every machine.
fn origin() -> Origin {
    let arguments = env::args_os().skip(1).map(|argument| output::quoted(Path::new(&argument)));
    Origin {
        roomsight: env!("CARGO_PKG_VERSION"),
        sources: experiment::SOURCES,
        command: ["roomsight".to_owned()].into_iter().chain(arguments).collect::<Vec<_>>().join(" "),
        created: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
    }
}

/// The page, the JSON file, and the files of each table.
fn write_all(report: &Report, folder: &Path) -> anyhow::Result<()> {
    let tables = folder.join(report::TABLES_FOLDER);
    fs::create_dir_all(&tables).with_context(|| tables.display().to_string())?;
    for table in report.entries.iter().flat_map(Entry::tables) {
        write(&tables.join(format!("{}.tex", table.name)), &table.to_latex())?;
        write(&tables.join(format!("{}.csv", table.name)), &table.to_csv())?;
    }
    write(&folder.join("report.json"), &report.to_json()?)?;
    write(&folder.join("report.html"), &report.to_html())
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    fs::write(path, text).with_context(|| path.display().to_string())
}

impl ExperimentArgs {
    /// The experiments that were asked for and are possible. Of all, those that are not are named and left out.
    fn plan(&self, dataset: &Dataset, stride: usize) -> anyhow::Result<Vec<Planned>> {
        let config = self.config.read()?;
        let config = if self.quick { quick(config) } else { config };
        let mut all_planned = Vec::new();
        for (camera, experiments) in by_camera(self) {
            let dataset = match dataset.clone().with_camera(camera) {
                Ok(dataset) => dataset,
                Err(error) if self.name == Selection::All => {
                    note!("left out: {}: {error}", names(&experiments));
                    continue;
                }
                Err(error) => return Err(error.into()),
            };
            let drives = Rc::new(Drives::new(&dataset, stride)?);
            let opinions =
                experiments.contains(&Experiment::Opinions).then(|| self.opinions(&dataset)).transpose()?;
            for experiment in experiments {
                let base =
                    opinions.as_ref().filter(|_| experiment == Experiment::Opinions).unwrap_or(&config);
                match experiment.plan(&drives, base) {
                    Ok(plan) => all_planned.push(Planned { plan, drives: Rc::clone(&drives) }),
                    Err(error) if self.name == Selection::All => note!("left out: {error}"),
                    Err(error) => return Err(error.into()),
                }
            }
        }
        Ok(all_planned)
    }

    /// A configuration of all opinions that are measured alone and together: those configured, or else those of the effort.
    fn opinions(&self, dataset: &Dataset) -> anyhow::Result<Config> {
        let opinions = all_opinions(&self.config.candidates(dataset)?).context("there is no opinion")?;
        Ok(if self.quick { quick(opinions) } else { opinions })
    }
}

/// The experiments asked for, by the camera whose frames they take.
fn by_camera(args: &ExperimentArgs) -> Vec<(CameraKind, Vec<Experiment>)> {
    let wanted: Vec<Experiment> =
        Experiment::value_variants().iter().copied().filter(|&one| args.name.includes(one)).collect();
    if let Some(camera) = args.camera {
        return vec![(camera.into(), wanted)];
    }
    // What is beside the papers is on the drives of Lu.
    let camera_of = |experiment: Experiment| experiment.paper().unwrap_or(Paper::Lu).camera();
    let of = |camera| wanted.iter().copied().filter(|&experiment| camera_of(experiment) == camera).collect();
    [CameraKind::Omnidirectional, CameraKind::Perspective]
        .map(|camera| (camera, of(camera)))
        .into_iter()
        .filter(|(_, experiments): &(CameraKind, Vec<Experiment>)| !experiments.is_empty())
        .collect()
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

/// The table of the plan; the others are in the report.
fn print(entry: &Entry) -> io::Result<()> {
    let Entry { plan, measured, .. } = entry;
    say!("\n{} ({})", plan.title, plan.source)?;
    for Table { corner, columns, rows, notes, .. } in entry.tables().into_iter().take(1) {
        let mut table =
            output::table([corner].into_iter().chain(columns.into_iter().map(|column| column.name)));
        for (name, values) in rows {
            table.add_row([name].into_iter().chain(values.iter().map(Value::text)));
        }
        say!("{table}")?;
        notes.iter().try_for_each(|note| say!("{note}"))?;
    }
    report::impossible(plan, measured).iter().try_for_each(|reason| say!("{reason}"))
}
