//! The COLD database as it lies on disk, opened at any level.
//!
//! `cold-LAB/part_{a,b}/seqN_{cloudy,night,sunny}K/` holds `std_cam/`, `omni_cam/` and
//! `localization/places.lst`; older archives leave out the part folder and the `cold-`. Source:
//! M. M. Ullah et al., "The COLD database", technical report, 2007.

mod labels;

pub use labels::{LabelLine, parse_places};

use super::files::{self, list};
use super::{Dataset, DatasetError, Format, Frame};
use crate::camera::CameraKind;
use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::{Path, PathBuf};

/// One of the two areas of a lab that the robot drove through.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Part {
    /// Sequences 1 and 2.
    A,
    /// Sequences 3 and 4.
    B,
}

/// How far the robot drove.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DrivenPath {
    /// The rooms that every lab has: sequences 1 and 3.
    Standard,
    /// These and more: sequences 2 and 4.
    Extended,
}

/// The light of a sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Illumination {
    /// Daylight without sun.
    Cloudy,
    /// Lamps only.
    Night,
    /// Direct sun.
    Sunny,
}

/// What the name of a sequence says.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct SequenceName {
    /// Such as `saarbruecken`; empty when unknown.
    pub lab: String,
    /// The area of the lab.
    pub part: Part,
    /// The standard or the extended path.
    pub path: DrivenPath,
    /// The light.
    pub illumination: Illumination,
    /// Counts the drives of one path in one light, from 1.
    pub run: u32,
}

impl SequenceName {
    /// Parses [`Frame::sequence`] of a COLD data set, such as `saarbruecken/part_b/seq3_cloudy1`.
    pub fn parse(sequence: &str) -> Option<Self> {
        let (above, name) = sequence.rsplit_once('/').unwrap_or(("", sequence));
        let lab = above.split('/').find(|folder| !is_part_folder(folder)).unwrap_or_default();
        let (number, light) = name.strip_prefix("seq")?.split_once('_')?;
        let (part, path) = match number {
            "1" => (Part::A, DrivenPath::Standard),
            "2" => (Part::A, DrivenPath::Extended),
            "3" => (Part::B, DrivenPath::Standard),
            "4" => (Part::B, DrivenPath::Extended),
            _ => return None,
        };
        let (illumination, run) = [
            (Illumination::Cloudy, "cloudy"),
            (Illumination::Night, "night"),
            (Illumination::Sunny, "sunny"),
        ]
        .into_iter()
        .find_map(|(illumination, prefix)| Some((illumination, light.strip_prefix(prefix)?)))?;
        Some(Self { lab: lab.to_owned(), part, path, illumination, run: run.parse().ok()? })
    }
}

/// The folders of all sequences at or below `path`, sorted.
pub(super) fn find_sequences(path: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    find_below(path, MAX_DEPTH)
}

/// Reads these sequences, found below `root`.
pub(super) fn read(root: &Path, sequences: &[PathBuf]) -> Result<Dataset, DatasetError> {
    let mut dataset = Dataset::new(root, Format::Cold);
    let root = fs::canonicalize(root).map_err(|error| DatasetError::io(root, error))?;
    for folder in sequences {
        let location = fs::canonicalize(folder).map_err(|error| DatasetError::io(folder, error))?;
        add_sequence(&mut dataset, folder, sequence_name(&root, &location))?;
    }
    Ok(dataset)
}

/// From the root down: lab, part, sequence.
const MAX_DEPTH: usize = 3;
const CAMERA_FOLDERS: [(&str, CameraKind); 2] =
    [("std_cam", CameraKind::Perspective), ("omni_cam", CameraKind::Omnidirectional)];
const LABEL_FILE: &str = "localization/places.lst";
const LABS: [&str; 3] = ["freiburg", "saarbruecken", "ljubljana"];

fn find_below(folder: &Path, n_levels: usize) -> Result<Vec<PathBuf>, DatasetError> {
    if is_sequence(folder) {
        return Ok(vec![folder.to_owned()]);
    }
    let mut sequences = Vec::new();
    if n_levels > 0 && folder.is_dir() {
        for below in list(folder)?.folders {
            sequences.extend(find_below(&below, n_levels - 1)?);
        }
    }
    Ok(sequences)
}

fn is_sequence(folder: &Path) -> bool {
    folder.join(LABEL_FILE).exists() || CAMERA_FOLDERS.iter().any(|(name, _)| folder.join(name).is_dir())
}

fn is_part_folder(name: &str) -> bool {
    name == "part_a" || name == "part_b"
}

/// `LAB/PART/SEQUENCE`. A folder above `root` counts as the lab only when its name says so.
fn sequence_name(root: &Path, folder: &Path) -> String {
    let mut names = vec![files::name(folder)];
    let mut above = folder.parent();
    if let Some(part) = above.filter(|folder| is_part_folder(&files::name(folder))) {
        names.push(files::name(part));
        above = part.parent();
    }
    if let Some(lab) = above {
        let name = files::name(lab);
        let short = name.strip_prefix("cold-");
        if short.is_some() || LABS.contains(&name.as_str()) || (lab.starts_with(root) && lab != root) {
            names.push(short.unwrap_or(&name).to_owned());
        }
    }
    names.reverse();
    names.join("/")
}

/// One sequence: its name, and its labels by file name.
struct Sequence<'a> {
    name: String,
    lines: HashMap<&'a str, &'a LabelLine>,
}

fn add_sequence(dataset: &mut Dataset, folder: &Path, name: String) -> Result<(), DatasetError> {
    let label_file = folder.join(LABEL_FILE);
    let mut lines = Vec::new();
    if label_file.exists() {
        let problems;
        (lines, problems) = parse_places(&files::read_labels(&label_file)?, &label_file);
        dataset.problems.extend(problems);
    } else {
        dataset.report(&label_file, "no such file: the frames of this sequence have no place");
    }
    report_unknown(dataset, &label_file, &lines);
    let sequence = Sequence { name, lines: lines.iter().map(|line| (line.file.as_str(), line)).collect() };
    let mut has_camera = false;
    for (camera_folder, camera) in CAMERA_FOLDERS {
        let camera_folder = folder.join(camera_folder);
        if camera_folder.is_dir() {
            has_camera = true;
            add_frames(dataset, &sequence, &camera_folder, camera)?;
        }
    }
    if !has_camera {
        dataset.report(folder, format!("labels: {}, but neither std_cam nor omni_cam", lines.len()));
    }
    Ok(())
}

/// Reports each label that the table does not have, once a file.
fn report_unknown(dataset: &mut Dataset, label_file: &Path, lines: &[LabelLine]) {
    let mut n_frames: BTreeMap<&str, usize> = BTreeMap::new();
    for line in lines.iter().filter(|line| !line.known) {
        *n_frames.entry(&line.place).or_default() += 1;
    }
    for (label, n_frames) in n_frames {
        dataset.report(label_file, format!("unknown label `{label}` kept as it is (frames: {n_frames})"));
    }
}

/// Adds what has both a file and a label; whatever lacks one of them is a problem.
fn add_frames(
    dataset: &mut Dataset,
    sequence: &Sequence,
    folder: &Path,
    camera: CameraKind,
) -> Result<(), DatasetError> {
    let mut lines = sequence.lines.clone();
    for path in list(folder)?.images() {
        let Some(line) = lines.remove(files::name(path).as_str()) else {
            dataset.report(path, "no label in places.lst");
            continue;
        };
        dataset.frames.push(Frame {
            path: path.clone(),
            place: line.place.clone(),
            sequence: sequence.name.clone(),
            camera,
            split: String::new(),
            time: Some(line.time),
            pose: Some(line.pose),
        });
    }
    let mut missing: Vec<&str> = lines.into_keys().collect();
    missing.sort_unstable();
    for file in missing {
        dataset.report(&folder.join(file), "labeled in places.lst, but there is no such file");
    }
    Ok(())
}
