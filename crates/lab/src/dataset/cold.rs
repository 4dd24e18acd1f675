//! The COLD database as it lies on disk, opened at any level.
//!
//! `cold-LAB/part_{a,b}/seqN_{cloudy,night,sunny}K/` holds `std_cam/`, `omni_cam/` and
//! `localization/places.lst`; older archives leave out the part folder and the `cold-`. Source:
//! M. M. Ullah et al., "The COLD database", technical report, 2007.

mod labels;
mod senses;

use labels::frame_name;
pub use labels::{LabelLine, parse_places};
use senses::Senses;

use super::tree::Tree;
use super::{Dataset, DatasetError, Format, Frame, Problem, Taking, files};
use crate::cold_layout::{
    LAB_PREFIX, LABEL_FILE, LABEL_FOLDER, OMNIDIRECTIONAL_FOLDER, PART_FOLDERS, PERSPECTIVE_FOLDER,
    sequence_number,
};
use roomsight_vision::camera::CameraKind;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs;
use std::path::Path;

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
        let (part, path) = [Part::A, Part::B]
            .into_iter()
            .flat_map(|part| [(part, DrivenPath::Standard), (part, DrivenPath::Extended)])
            .find(|&(part, path)| {
                number == sequence_number(part as usize, path == DrivenPath::Extended).to_string()
            })?;
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

/// The folders of all sequences at or below `tree`, in order.
pub(super) fn find_sequences(tree: &Tree) -> Vec<&Tree> {
    find_below(tree, MAX_DEPTH)
}

/// Reads these sequences, found below `root`.
pub(super) fn read(root: &Tree, sequences: &[&Tree], taking: &Taking) -> Result<Dataset, DatasetError> {
    let mut dataset = Dataset::new(&root.path, Format::Cold);
    let location = |folder: &Path| fs::canonicalize(folder).map_err(|error| DatasetError::io(folder, error));
    dataset.problems.extend(root.all_unreadable().into_iter().cloned());
    let root = location(&root.path)?;
    let mut folder_of: HashMap<String, &Path> = HashMap::new();
    for sequence in sequences {
        let name = sequence_name(&root, &location(&sequence.path)?);
        match folder_of.get(&name) {
            Some(other) => {
                let reason = "its name, of lab, part and sequence, is that of another: open them one by one";
                let problem = Problem::new(&sequence.path, reason);
                dataset.problems.push(problem.with(format!("{name}, as {}", other.display())));
            }
            None => {
                folder_of.insert(name.clone(), &sequence.path);
                add_sequence(&mut dataset, sequence, name, taking);
            }
        }
    }
    Ok(dataset)
}

/// From the root down: two folders around all, lab, part, sequence.
const MAX_DEPTH: usize = 5;
const CAMERA_FOLDERS: [(&str, CameraKind); 2] =
    [(PERSPECTIVE_FOLDER, CameraKind::Perspective), (OMNIDIRECTIONAL_FOLDER, CameraKind::Omnidirectional)];
const LABS: [&str; 3] = ["freiburg", "saarbruecken", "ljubljana"];

fn find_below(tree: &Tree, n_levels: usize) -> Vec<&Tree> {
    if is_sequence(tree) {
        vec![tree]
    } else if n_levels > 0 {
        tree.folders.iter().flat_map(|below| find_below(below, n_levels - 1)).collect()
    } else {
        Vec::new()
    }
}

fn is_sequence(tree: &Tree) -> bool {
    tree.path.join(LABEL_FOLDER).join(LABEL_FILE).exists()
        || CAMERA_FOLDERS.iter().any(|(name, _)| tree.folder(name).is_some())
}

fn is_part_folder(name: &str) -> bool {
    PART_FOLDERS.contains(&name)
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
        let short = name.strip_prefix(LAB_PREFIX);
        if short.is_some() || LABS.contains(&name.as_str()) || (lab.starts_with(root) && lab != root) {
            names.push(short.unwrap_or(&name).to_owned());
        }
    }
    names.reverse();
    names.join("/")
}

/// One sequence: its name, its labels by the names of the frames, and what was sensed beside them.
struct Sequence<'a> {
    name: String,
    lines: HashMap<&'a str, &'a LabelLine>,
    senses: Senses,
}

fn add_sequence(dataset: &mut Dataset, tree: &Tree, name: String, taking: &Taking) {
    let label_file = tree.path.join(LABEL_FOLDER).join(LABEL_FILE);
    let mut lines = Vec::new();
    if label_file.exists() {
        match files::read_labels(&label_file) {
            Ok(text) => {
                let problems;
                (lines, problems) = parse_places(&text, &label_file);
                dataset.problems.extend(problems);
            }
            Err(problem) => dataset.problems.push(problem),
        }
    } else {
        dataset.report(&label_file, "no such file: the frames of this sequence have no place");
    }
    note_unknown(dataset, &label_file, &lines);
    let senses = Senses::read(dataset, &tree.path, taking);
    let lines_by_frame = lines.iter().map(|line| (line.frame.as_str(), line)).collect();
    let sequence = Sequence { name, lines: lines_by_frame, senses };
    let mut has_camera = false;
    for (camera_folder, camera) in CAMERA_FOLDERS {
        if let Some(camera_folder) = tree.folder(camera_folder) {
            has_camera = true;
            add_frames(dataset, &sequence, camera_folder, camera);
        }
    }
    if !has_camera {
        dataset.report(&tree.path, format!("labels: {}, but neither std_cam nor omni_cam", lines.len()));
    }
}

/// Notes each label that the table does not have, once a file.
fn note_unknown(dataset: &mut Dataset, label_file: &Path, lines: &[LabelLine]) {
    let mut n_frames: BTreeMap<&str, usize> = BTreeMap::new();
    for line in lines.iter().filter(|line| !line.known) {
        *n_frames.entry(&line.place).or_default() += 1;
    }
    for (label, n_frames) in n_frames {
        let reason = format!("the label `{label}` is none of COLD's: taken as the name of a room");
        dataset.notes.push(Problem::new(label_file, reason).with(format!("frames: {n_frames}")));
    }
}

/// Adds what has both a file and a label; whatever lacks one of them is a problem.
fn add_frames(dataset: &mut Dataset, sequence: &Sequence, folder: &Tree, camera: CameraKind) {
    dataset.problems.extend(folder.all_left_out().into_iter().cloned());
    let mut missing: BTreeSet<&str> = sequence.lines.keys().copied().collect();
    for path in &folder.pictures {
        let file = files::name(path);
        let frame = frame_name(&file).unwrap_or(&file);
        let Some(line) = sequence.lines.get(frame) else {
            dataset.report(path, "no label in places.lst");
            continue;
        };
        if !missing.remove(frame) {
            dataset.report(path, "the same frame as another file beside it, but for the ending");
            continue;
        }
        dataset.frames.push(Frame {
            path: path.clone(),
            room: line.place.clone(),
            sequence: sequence.name.clone(),
            camera,
            split: String::new(),
            time: Some(line.time),
            pose: Some(line.pose),
            odometry: sequence.senses.odometry_at(line.time),
            scan: sequence.senses.scan_at(line.time),
            recorded: None,
        });
    }
    for frame in missing {
        dataset.report(&folder.path.join(frame), "labeled in places.lst, but there is no such file");
    }
}
