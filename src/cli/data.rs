//! What all commands share that read labeled frames or a configuration.

mod config;
mod recordings;

pub(super) use config::ConfigArgs;
pub(super) use recordings::RecordingArgs;

use super::output;
use crate::cli::manners::note;
use anyhow::{Context, bail};
use clap::builder::RangedU64ValueParser;
use clap::{Args, ValueEnum};
use roomsight_lab::check::other_camera;
use roomsight_lab::dataset::{self, Dataset, Described, Problem, Taking, Tree};
use roomsight_recognition::model::{Extractor, LoadedModel, MODEL_FILE, Model};
use roomsight_vision::camera::CameraKind;
use roomsight_vision::image::{Image, Limits};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Kinds of problems that get a line each; more are counted.
const N_LISTED_KINDS: usize = 10;

/// The most that `--max-pixels` takes.
const MAX_PIXELS: u64 = 4_000_000_000;

/// The longest side of a frame: what JPEG allows.
const MAX_SIDE: u32 = 65_535;

/// Bytes a pixel that decoding takes at most: samples of 16 bits with their transparency, and luma.
const MEMORY_PER_PIXEL: u64 = 10;

/// Which frames of a data set to take.
#[derive(Args)]
pub(super) struct DataArgs {
    /// Labeled frames: a folder with a folder for each room (or with train, val, ... and the rooms in them), a
    /// frames.csv with the columns file and place, sequences of the COLD database, or recordings of robots (MCAP, rosbag2,
    /// ROS 1 bags), one or a folder of them
    pub data: PathBuf,
    /// Take the frames of this camera [default: the only one there is; perspective for a folder a room]
    #[arg(long, value_enum)]
    camera: Option<CameraName>,
    /// Take the sequences whose names match, such as '*cloudy1,*night?' [default: all]
    #[arg(long, value_name = "PATTERNS")]
    sequences: Option<String>,
    /// Take the frames of this split, such as train: a column of frames.csv, or a folder [default: all]
    #[arg(long)]
    split: Option<String>,
    /// Pictures that show none of the rooms, also in folders below: they tell what new places look like. The same as a room
    /// called elsewhere
    #[arg(long, value_name = "FOLDER")]
    elsewhere: Option<PathBuf>,
    /// Also take the scans of the robot's laser that lie beside pictures, of recordings and COLD sequences: models are trained
    /// to look at them, too. A model that does so takes them without being told
    #[arg(long)]
    laser: bool,
    /// Also take how far the robot went, by its odometry, of recordings and COLD sequences: a filter takes the way instead of
    /// the time
    #[arg(long)]
    odometry: bool,
    #[command(flatten)]
    recordings: RecordingArgs,
}

/// How large frames may be.
#[derive(Args)]
pub(super) struct LimitArgs {
    /// The most pixels that are decoded of a frame; JPEGs of more are decoded at a half, a quarter or an
    /// eighth of their size
    #[arg(long, value_name = "N", default_value_t = Limits::default().max_pixels)]
    #[arg(value_parser = clap::value_parser!(u64).range(1..=MAX_PIXELS))]
    max_pixels: u64,
    /// The longest file of a frame, in bytes
    #[arg(long, value_name = "N", default_value_t = Limits::default().max_bytes, value_parser = at_least(1))]
    max_bytes: usize,
}

impl LimitArgs {
    /// Limits that agree: as many pixels as are allowed are within the others too.
    pub(super) fn limits(&self) -> Limits {
        let defaults = Limits::default();
        Limits {
            max_bytes: self.max_bytes,
            max_pixels: self.max_pixels,
            max_side: MAX_SIDE,
            max_memory: defaults.max_memory.max(self.max_pixels * MEMORY_PER_PIXEL),
            ..defaults
        }
    }
}

/// A camera on the command line.
#[derive(Clone, Copy, ValueEnum)]
pub(super) enum CameraName {
    /// An ordinary lens
    Perspective,
    /// A full panorama
    Equirectangular,
    /// A mirror seen from below
    Omnidirectional,
}

impl From<CameraName> for CameraKind {
    fn from(name: CameraName) -> Self {
        match name {
            CameraName::Perspective => Self::Perspective,
            CameraName::Equirectangular => Self::Equirectangular,
            CameraName::Omnidirectional => Self::Omnidirectional,
        }
    }
}

impl DataArgs {
    /// Opens the data set, takes the frames asked for, and reports what is wrong with the rest. For a model
    /// that is there already, its rooms are known, and its camera is taken where none is asked for.
    pub(super) fn open(&self, model: Option<&Model>) -> anyhow::Result<Dataset> {
        let dataset = dataset::open_for(&self.data, model.map_or(&[], Model::rooms), &self.taking(model))?;
        report_all(&dataset);
        if self.laser && dataset.laser().is_none() {
            bail!(
                "{} has no scans of a laser within a quarter of a second of its pictures: leave out --laser",
                self.data.display()
            );
        }
        if model.is_none() && dataset.has_other_scans {
            note!("note: scans of a laser lie beside the pictures: --laser lets the model look at them too");
        }
        let n_without = dataset.frames.iter().filter(|frame| frame.scan.is_none()).count();
        if self.laser && n_without > 0 && dataset.described_projection().is_none() {
            note!(
                "note: frames without a scan of the laser beside them: {n_without} of {}",
                dataset.frames.len()
            );
        }
        self.choose(dataset, model)
    }

    /// The same with the frames that have no room.
    pub(super) fn open_with_unlabeled(&self, model: Option<&Model>) -> anyhow::Result<Dataset> {
        let rooms = model.map_or(&[][..], Model::rooms);
        let dataset = dataset::open_for(&self.data, rooms, &self.taking(model))?.with_unlabeled();
        report_all(&dataset);
        self.choose(dataset, model)
    }

    /// What is taken beside pictures, also what the model looks at.
    fn taking(&self, model: Option<&Model>) -> Taking {
        let laser = self.laser || model.is_some_and(Model::wants_scans);
        Taking { laser, odometry: self.odometry, ..self.recordings.taking() }
    }

    /// The frames that are asked for.
    fn choose(&self, mut dataset: Dataset, model: Option<&Model>) -> anyhow::Result<Dataset> {
        let model_camera = model.map(|model| model.camera().projection.kind());
        if let Some(camera) = self.camera.map(CameraKind::from).or(model_camera) {
            dataset = dataset.with_camera(camera)?;
        }
        if let Some(patterns) = &self.sequences {
            dataset = dataset.with_sequences(patterns)?;
        }
        if let Some(split) = &self.split {
            dataset = dataset.with_split(split)?;
        }
        if let Some(folder) = &self.elsewhere {
            let camera = dataset.frames.first().map_or(CameraKind::Perspective, |frame| frame.camera);
            dataset = dataset.with_elsewhere(pictures_in(folder)?, camera);
        }
        Ok(dataset)
    }
}

/// How often a configuration is measured.
#[derive(Args)]
pub(super) struct FoldArgs {
    /// Where whole sequences are left out: into how many folds they are dealt
    #[arg(long, default_value_t = 5, value_name = "N", value_parser = at_least(2))]
    pub folds: usize,
    /// How often to repeat, with seeds 0, 1, 2, ...
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub seeds: u64,
}

impl FoldArgs {
    /// Refuses a single sequence that has fewer frames than there are folds: a fold would be empty.
    pub(super) fn check(&self, dataset: &Dataset) -> anyhow::Result<()> {
        let sequences: BTreeSet<&str> = dataset.frames.iter().map(|frame| frame.sequence.as_str()).collect();
        let n_frames = dataset.frames.len();
        if sequences.len() == 1 && n_frames < self.folds {
            bail!(
                "{n_frames} frames are fewer than {} folds: take more frames, or lower --folds",
                self.folds
            );
        }
        Ok(())
    }
}

/// Reads an image file within limits: its luma.
fn read_image(path: &Path, limits: &Limits) -> anyhow::Result<Image> {
    Image::decode(&read_encoded(path, limits)?, limits).with_context(|| path.display().to_string())
}

/// Reads a frame within limits, as far as `extractor` looks at it.
pub(super) fn read_frame(path: &Path, extractor: &Extractor, limits: &Limits) -> anyhow::Result<Image> {
    extractor.decode(&read_encoded(path, limits)?, limits).with_context(|| path.display().to_string())
}

/// All pictures in a folder and below it; what else lies there is named.
pub(super) fn pictures_in(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let tree = Tree::read(folder)?;
    let left_out: Vec<Problem> =
        tree.all_left_out().into_iter().chain(tree.all_unreadable()).cloned().collect();
    report("left out", &left_out);
    let pictures: Vec<PathBuf> = tree.all_pictures().into_iter().cloned().collect();
    if pictures.is_empty() {
        bail!("{} holds no picture that can be read", folder.display());
    }
    Ok(pictures)
}

pub(super) fn read_encoded(path: &Path, limits: &Limits) -> anyhow::Result<Vec<u8>> {
    if path.is_dir() {
        bail!("{} is a folder, not an image", path.display());
    }
    let mut bytes = Vec::new();
    File::open(path)
        // One byte more than is taken, so that a longer file is refused and not cut.
        .and_then(|file| file.take(limits.max_bytes as u64 + 1).read_to_end(&mut bytes))
        .with_context(|| path.display().to_string())?;
    Ok(bytes)
}

/// The model in a folder, or the highest version in the folder of its versions.
pub(super) fn load_model(path: &Path) -> anyhow::Result<LoadedModel> {
    if !path.join(MODEL_FILE).exists()
        && let Some(version) = highest_version(path)
    {
        let path = path.join(version.to_string());
        note!("note: taking the highest version, {}", path.display());
        return load_model(&path);
    }
    let is_picture = path.is_file() && path.extension().is_some_and(|ending| ending != "json");
    let hint = if is_picture { ": the model's folder comes first" } else { "" };
    Model::load(path).with_context(|| format!("{} holds no model that can be loaded{hint}", path.display()))
}

/// The highest version of the model whose versions are in a folder, if it is one of such.
fn highest_version(folder: &Path) -> Option<u64> {
    let entries = fs::read_dir(folder).ok()?.filter_map(Result::ok);
    let version = |entry: fs::DirEntry| {
        let version = entry.file_name().to_string_lossy().parse().ok()?;
        entry.path().join(MODEL_FILE).is_file().then_some(version)
    };
    entries.filter_map(version).max()
}

/// A parser of numbers that are at least this.
pub(super) fn at_least(least: u64) -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(least..)
}

/// Describes all frames behind a progress bar and reports those that cannot be read, and copies.
pub(super) fn describe(
    dataset: &Dataset,
    extractor: &Extractor,
    limits: &Limits,
) -> anyhow::Result<Described> {
    let described = describe_quietly(dataset, extractor, limits)?;
    let copies: Vec<Problem> = described.copies(dataset).into_iter().map(|copied| copied.problem).collect();
    report("note", &copies);
    Ok(described)
}

/// The same, copies included and unnamed.
pub(super) fn describe_quietly(
    dataset: &Dataset,
    extractor: &Extractor,
    limits: &Limits,
) -> anyhow::Result<Described> {
    some(describe_all(dataset, extractor, limits), dataset)
}

/// The same for training, which leaves copies out: one that is trained makes the rate of one that is held out
/// look too good.
pub(super) fn describe_to_train(
    dataset: &Dataset,
    extractor: &Extractor,
    limits: &Limits,
) -> anyhow::Result<Described> {
    let described = some(describe_all(dataset, extractor, limits).without_copies(dataset), dataset)?;
    let camera = extractor.camera().projection.kind();
    let others: Vec<Problem> = described
        .looks
        .iter()
        .zip(&described.frame_idxs)
        .filter_map(|(look, &frame_idx)| {
            let why = other_camera(camera, look.aspect())?;
            Some(Problem::new(&dataset.frames[frame_idx].path, format!("its shape is odd, {why}")))
        })
        .collect();
    report("note", &others);
    Ok(described)
}

/// The same to answer frames with a model that was trained on `trained`, which are left out.
pub(super) fn describe_to_answer(
    dataset: &Dataset,
    extractor: &Extractor,
    limits: &Limits,
    trained: &Described,
) -> anyhow::Result<Described> {
    some(describe_all(dataset, extractor, limits).without_trained(dataset, trained), dataset)
}

fn describe_all(dataset: &Dataset, extractor: &Extractor, limits: &Limits) -> Described {
    let bar = output::progress("describing frames", dataset.frames.len());
    let described = dataset.describe(extractor, limits, || bar.inc(1));
    bar.finish_and_clear();
    described
}

/// Tells what was left out, refuses to go on without any sample, and names the rooms that are left without one.
fn some(described: Described, dataset: &Dataset) -> anyhow::Result<Described> {
    report("note", &described.notes);
    report("left out", &described.problems);
    if described.samples.is_empty() {
        bail!("none of the {} frames can be used; why is told above", dataset.frames.len());
    }
    let usable: BTreeSet<&str> = described.samples.iter().map(|sample| sample.room.as_str()).collect();
    for room in dataset.rooms().iter().filter(|room| !usable.contains(room.as_str())) {
        note!("left out: the room {room}: none of its frames can be used");
    }
    Ok(described)
}

/// Whether a data set was written by `roomsight simulate`.
pub(super) fn is_simulated(data: &Path) -> bool {
    data.ancestors().any(|folder| folder.join(roomsight_lab::simulate::MARKER_FILE).is_file())
}

/// Tells on standard error what a data set leaves out and what is odd about it.
pub(super) fn report_all(dataset: &Dataset) {
    report("note", &dataset.notes);
    report("left out", &dataset.problems);
    if !dataset.unlabeled.is_empty() {
        note!("left out: frames without a room: {}", dataset.unlabeled.len());
    }
}

/// A line for each kind of problem.
fn report(what: &str, problems: &[Problem]) {
    let kinds = dataset::by_kind(problems);
    let (listed, others) = kinds.split_at(kinds.len().min(N_LISTED_KINDS));
    for kind in listed {
        note!("{what}: {kind}");
    }
    if !others.is_empty() {
        let n_problems: usize = others.iter().map(|kind| kind.n_problems).sum();
        note!("{what}: {n_problems} more, for {} other reasons", others.len());
    }
}
