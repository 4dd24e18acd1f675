//! Labeled frames from disk: one reader a format behind [`open`]. Frames of the place [`ELSEWHERE`] show no room.
//!
//! | format | what lies there |
//! |---|---|
//! | [`Format::Folder`] | a folder a room: `kitchen/*.jpg`, or `kitchen/SEQUENCE/*.jpg`; also in `train`, `val`, ... |
//! | [`Format::Manifest`] | `frames.csv` with the columns `file,place,sequence,camera,split` |
//! | [`Format::Cold`] | COLD sequences: `seq3_cloudy1/{std_cam,omni_cam,localization/places.lst}` |
//! | [`Format::Recording`] | recordings of robots, with their rooms in `run.rooms.csv` beside `run.mcap`, in a topic, or on a map |
//!
//! A folder of described parts ([`Shard`]) stands for the pictures that were described, and has their format.
//!
//! What cannot be used is never skipped in silence: it is a [`Problem`] beside the frames, or, where
//! nothing sensible can be made of the whole, a [`DatasetError`]. One name is one room: names are compared as
//! [`Dataset::check`] says.

mod by_time;
pub mod cold;
mod describe;
mod drives;
mod error;
mod files;
mod folder;
mod glob;
mod look;
mod manifest;
pub mod names;
mod recorded;
mod senses;
mod shard;
#[cfg(test)]
mod tests;
mod tree;

pub use by_time::MAX_APART;
pub use describe::{Copied, Described};
pub use error::{DatasetError, Problem, ProblemKind, by_kind};
pub use look::{Look, near_pairs};
pub use recorded::{Clock, RecordedMessage, Taking, scan_of};
pub use senses::ScanSource;
pub use shard::{Shard, ShardError};
pub use tree::Tree;

pub use roomsight_recognition::model::Pose;
use roomsight_recognition::model::{ELSEWHERE, Scan};
use roomsight_vision::camera::CameraKind;
use roomsight_vision::image::{Image, ImageError, Limits};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// One labeled frame on disk.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The image file; of a recording, the recording and the time.
    pub path: PathBuf,
    /// The room that it shows, or [`ELSEWHERE`]; empty in [`Dataset::unlabeled`] alone.
    pub room: String,
    /// The drive that it comes from; empty when unknown.
    pub sequence: String,
    /// The kind of camera that took it.
    pub camera: CameraKind,
    /// The author's split, such as `train`; empty when there is none.
    pub split: String,
    /// When it was taken, in seconds.
    pub time: Option<f64>,
    /// Where it was taken.
    pub pose: Option<Pose>,
    /// Where the robot was by its wheels, in coordinates of the drive, which grow wrong with the way; where that is taken.
    pub odometry: Option<Pose>,
    /// What its laser measured beside the picture, where that is taken.
    pub scan: Option<ScanSource>,
    /// Where it lies in a recording; none where it is a file.
    pub recorded: Option<RecordedMessage>,
}

impl Frame {
    /// Whether it shows none of the rooms.
    pub fn is_elsewhere(&self) -> bool {
        self.room == ELSEWHERE
    }

    /// Reads and decodes the image, its luma alone; its size is checked before a byte of it is read.
    pub fn read(&self, limits: &Limits) -> Result<Image, Problem> {
        Image::decode(&self.read_encoded(limits)?, limits).map_err(|error| self.undecoded(&error))
    }

    /// The problem that what was read is no image.
    fn undecoded(&self, error: &ImageError) -> Problem {
        Problem::new(&self.path, error.to_string())
    }

    /// Reads the image as it is encoded; its size is checked before a byte of it is read.
    pub fn read_encoded(&self, limits: &Limits) -> Result<Vec<u8>, Problem> {
        let Some(recorded) = &self.recorded else { return read_file(&self.path, limits) };
        let picture = recorded.picture(limits).map_err(|reason| Problem::new(&self.path, reason))?;
        Ok(picture.encoded)
    }

    /// Reads what the laser measured beside it; none where there is none, or it is not taken.
    pub fn read_scan(&self) -> Result<Option<Arc<Scan>>, Problem> {
        let scan = self.scan.as_ref().map(ScanSource::read).transpose();
        scan.map_err(|reason| Problem::new(&self.path, reason))
    }

    /// The file that it lies in.
    fn file(&self) -> &Path {
        self.recorded.as_ref().map_or(&self.path, |recorded| recorded.recording().path())
    }
}

/// How a data set lies on disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// A folder a room; says nothing of cameras and splits.
    Folder,
    /// A `frames.csv` manifest.
    Manifest,
    /// Sequences of the COLD database, or of the simulated lab.
    Cold,
    /// Recordings of robots, a drive each; say nothing of cameras and splits.
    Recording,
}

impl Format {
    /// Whether it says which camera frames are of.
    fn names_cameras(self) -> bool {
        match self {
            Self::Manifest | Self::Cold => true,
            Self::Folder | Self::Recording => false,
        }
    }
}

/// Labeled frames, and what was wrong with the rest.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// What was opened.
    pub root: PathBuf,
    /// How it lies on disk.
    pub format: Format,
    /// By sequence, then time, then name; numbers in names count by value.
    pub frames: Vec<Frame>,
    /// Everything that was left out, in the order it was met.
    pub problems: Vec<Problem>,
    /// What was taken otherwise than a user may expect.
    pub notes: Vec<Problem>,
    /// Frames without a room.
    pub unlabeled: Vec<Frame>,
    /// Whether scans of a laser lie beside frames that were not asked for.
    pub has_other_scans: bool,
    /// What was seen of the frames before, where it was.
    pub(crate) shards: Vec<Arc<Shard>>,
}

/// Opens a data set, telling its format by what lies at `path`. No image is decoded.
pub fn open(path: &Path) -> Result<Dataset, DatasetError> {
    open_for(path, &[], &Taking::default())
}

/// The same for a model that knows these rooms: a folder of such a name is a room, also where it is the only
/// one and might be taken for a folder around the rooms. Of recordings that is taken which `taking` says.
pub fn open_for(path: &Path, rooms: &[String], taking: &Taking) -> Result<Dataset, DatasetError> {
    let metadata = fs::metadata(path).map_err(|error| DatasetError::io(path, error))?;
    let is_one_recording = roomsight_recording::is_called_so(path);
    let mut dataset = if is_one_recording {
        recorded::read(path, &[path.to_owned()], taking)?
    } else if metadata.is_dir() {
        in_folder(path, rooms, taking)?
    } else {
        manifest::read(path)?
    };
    dataset.settle_names();
    dataset.sort();
    Ok(dataset)
}

fn in_folder(path: &Path, rooms: &[String], taking: &Taking) -> Result<Dataset, DatasetError> {
    if let Some(list) = manifest::find(path).map_err(|error| DatasetError::io(path, error))? {
        return manifest::read(&list);
    }
    let parts = shard::find(path).map_err(|error| DatasetError::io(path, error))?;
    if !parts.is_empty() {
        return shard::read(path, &parts);
    }
    let tree = Tree::read(path)?;
    let sequences = cold::find_sequences(&tree);
    if !sequences.is_empty() {
        return cold::read(&tree, &sequences, taking);
    }
    if let Some(list) = wrapped_manifest(&tree) {
        return manifest::read(list);
    }
    let recordings = if tree.has_pictures() { Vec::new() } else { recorded::find(path) };
    if recordings.is_empty() {
        return folder::read(&tree, rooms);
    }
    let mut dataset = recorded::read(path, &recordings, taking)?;
    dataset.problems.extend(tree.all_unreadable().into_iter().cloned());
    Ok(dataset)
}

/// The manifest in the only folder of a folder, as archives are unpacked.
fn wrapped_manifest(tree: &Tree) -> Option<&PathBuf> {
    let [only] = &tree.folders[..] else { return None };
    let list = only.lists.iter().find(|list| manifest::is_called_so(list));
    if tree.pictures.is_empty() { list.or_else(|| wrapped_manifest(only)) } else { None }
}

impl Dataset {
    fn new(root: &Path, format: Format) -> Self {
        let (frames, unlabeled, problems, notes) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (root, has_other_scans, shards) = (root.to_owned(), false, Vec::new());
        Self { root, format, frames, problems, notes, unlabeled, has_other_scans, shards }
    }

    fn report(&mut self, path: &Path, reason: impl Into<String>) {
        self.problems.push(Problem::new(path, reason));
    }

    fn note(&mut self, path: &Path, reason: impl Into<String>) {
        self.notes.push(Problem::new(path, reason));
    }

    /// The same with pictures that show none of the rooms, each a frame of [`ELSEWHERE`].
    pub fn with_elsewhere(mut self, pictures: impl IntoIterator<Item = PathBuf>, camera: CameraKind) -> Self {
        let frame = |path| Frame {
            path,
            room: ELSEWHERE.to_owned(),
            sequence: String::new(),
            camera,
            split: String::new(),
            time: None,
            pose: None,
            odometry: None,
            scan: None,
            recorded: None,
        };
        self.frames.extend(pictures.into_iter().map(frame));
        self
    }

    /// The same with the frames without a room among the others: what is only answered, or played, needs none.
    pub fn with_unlabeled(mut self) -> Self {
        let mut unlabeled = std::mem::take(&mut self.unlabeled);
        if self.frames.is_empty() {
            self.frames = unlabeled;
        } else {
            self.frames.append(&mut unlabeled);
        }
        self.sort();
        self
    }

    fn sort(&mut self) {
        // Sorting takes room, which a long recording, in order as it is, is not to need.
        if !self.frames.is_sorted_by(|one, other| in_order(one, other).is_le()) {
            self.frames.sort_by(in_order);
        }
    }

    /// Reads the picture of a frame that is called so, or else a file.
    pub fn read_picture(&self, path: &Path, limits: &Limits) -> Result<Vec<u8>, Problem> {
        match self.frames.iter().find(|frame| frame.path == path) {
            Some(frame) => frame.read_encoded(limits),
            None => read_file(path, limits),
        }
    }

    /// Brings the names of rooms, sequences and splits into one form; a frame whose room cannot be named is a
    /// problem. Which names of rooms became one is noted.
    fn settle_names(&mut self) {
        let mut spellings: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        // Of their size at once: there may be very many.
        let empty_like = |frames: &Vec<Frame>| Vec::with_capacity(frames.len());
        let (no_frames, no_unlabeled) = (empty_like(&self.frames), empty_like(&self.unlabeled));
        let frames = std::mem::replace(&mut self.frames, no_frames);
        let unlabeled = std::mem::replace(&mut self.unlabeled, no_unlabeled);
        for mut frame in frames.into_iter().chain(unlabeled) {
            let room = names::settled(&frame.room);
            let room = if room.eq_ignore_ascii_case(ELSEWHERE) { ELSEWHERE.to_owned() } else { room };
            frame.sequence = names::settled(&frame.sequence);
            frame.split = names::settled(&frame.split);
            let unnamed = |name: &&String| !name.is_empty();
            let fault = [&frame.sequence, &frame.split]
                .into_iter()
                .filter(unnamed)
                .find_map(|name| names::fault(name));
            let fault = if frame.room.is_empty() { fault } else { names::fault(&room).or(fault) };
            if let Some(fault) = fault {
                self.report(&frame.path, fault);
                continue;
            }
            if frame.room.is_empty() {
                self.unlabeled.push(frame);
                continue;
            }
            spellings.entry(room.clone()).or_default().insert(std::mem::replace(&mut frame.room, room));
            self.frames.push(frame);
        }
        let root = self.root.clone();
        for spellings in spellings.into_values().filter(|spellings| spellings.len() > 1) {
            let spelled: Vec<String> = spellings.iter().map(|name| names::spelled(name)).collect();
            let reason = "differ in spaces or in how letters are encoded: taken as one room";
            self.note(&root, format!("{} {reason}", spelled.join(" and ")));
        }
    }

    /// The rooms, sorted, each once.
    pub fn rooms(&self) -> Vec<String> {
        let of_rooms = self.frames.iter().filter(|frame| !frame.is_elsewhere() && !frame.room.is_empty());
        let rooms: BTreeSet<&str> = of_rooms.map(|frame| frame.room.as_str()).collect();
        rooms.into_iter().map(str::to_owned).collect()
    }

    /// Keeps the frames of one camera. Folders and recordings do not name the camera, so there it is set to `camera`.
    pub fn with_camera(mut self, camera: CameraKind) -> Result<Self, DatasetError> {
        if !self.format.names_cameras() {
            self.frames.iter_mut().for_each(|frame| frame.camera = camera);
            return Ok(self);
        }
        let wanted = camera_name(camera);
        self.keep("camera", wanted, |frame| camera_name(frame.camera), |name| name == wanted)
    }

    /// Keeps the sequences that match one of `patterns`: whole names, separated by commas, with `*`
    /// for any characters and `?` for one, such as `*cloudy1,*night?`.
    pub fn with_sequences(self, patterns: &str) -> Result<Self, DatasetError> {
        let matches = |name: &str| patterns.split(',').any(|pattern| glob::matches(pattern.trim(), name));
        self.keep("sequence", patterns, |frame| &frame.sequence, matches)
    }

    /// Keeps the frames of one split, such as `train`.
    pub fn with_split(self, split: &str) -> Result<Self, DatasetError> {
        self.keep("split", split, |frame| &frame.split, |name| name == split)
    }

    /// Refuses what no model can be trained on: no frame, one room only, cameras mixed, or names of rooms that
    /// only differ in case, in the kind of spaces, or in characters that cannot be seen.
    pub fn check(&self) -> Result<(), DatasetError> {
        if self.frames.is_empty() {
            return Err(DatasetError::NoFrames { root: self.root.clone(), hint: self.why_empty() });
        }
        if let [room] = self.rooms().as_slice() {
            return Err(DatasetError::OneRoom { room: room.clone() });
        }
        self.check_names(&[])?;
        self.check_camera()
    }

    /// Refuses names of rooms that only differ in case, in the kind of spaces, or in characters that cannot be
    /// seen, from each other or from `rooms`, those of a model.
    pub fn check_names(&self, rooms: &[String]) -> Result<(), DatasetError> {
        let of_model = rooms.iter().map(|room| (room, None));
        let of_frames = self.frames.iter().map(|frame| (&frame.room, Some(frame)));
        let origin = |frame: Option<&Frame>| {
            frame.map_or_else(|| "a room of the model".to_owned(), |frame| frame.path.display().to_string())
        };
        let mut seen: BTreeMap<String, (&String, Option<&Frame>)> = BTreeMap::new();
        for (room, frame) in of_model.chain(of_frames) {
            let (other, other_frame) = *seen.entry(names::look(room)).or_insert((room, frame));
            if other != room {
                return Err(DatasetError::LookAlike {
                    left: names::spelled(other),
                    right: names::spelled(room),
                    left_origin: origin(other_frame),
                    right_origin: origin(frame),
                });
            }
        }
        Ok(())
    }

    /// Refuses frames of several kinds of camera together: a model knows one.
    pub fn check_camera(&self) -> Result<(), DatasetError> {
        let cameras: BTreeSet<&str> = self.frames.iter().map(|frame| camera_name(frame.camera)).collect();
        if cameras.len() > 1 {
            return Err(DatasetError::MixedCameras { cameras: error::enumerate(&cameras) });
        }
        Ok(())
    }

    fn keep(
        mut self,
        what: &'static str,
        wanted: &str,
        name: impl Fn(&Frame) -> &str,
        matches: impl Fn(&str) -> bool,
    ) -> Result<Self, DatasetError> {
        if !self.frames.iter().any(|frame| matches(name(frame))) {
            let present: BTreeSet<&str> =
                self.frames.iter().map(name).filter(|name| !name.is_empty()).collect();
            let present = error::enumerate(&present);
            return Err(DatasetError::NoMatch { what, wanted: wanted.to_owned(), present });
        }
        // Pictures of no room are of no drive and no split either, unless they say so.
        self.frames.retain(|frame| matches(name(frame)) || (frame.is_elsewhere() && name(frame).is_empty()));
        Ok(self)
    }

    fn why_empty(&self) -> String {
        match self.problems.first() {
            Some(first) => format!("problems: {}, the first: {first}", self.problems.len()),
            None if self.format == Format::Recording => format!(
                "frames without a room: {}. Say where the robot was: with NAME.rooms.csv beside NAME.mcap, --labels, \
                 --room-topic, or --map",
                self.unlabeled.len()
            ),
            None => format!("frames without a place: {}", self.unlabeled.len()),
        }
    }
}

/// Reads a picture's file; its size is checked first.
fn read_file(path: &Path, limits: &Limits) -> Result<Vec<u8>, Problem> {
    files::read_bounded(path, limits.max_bytes as u64).map_err(|error| Problem::new(path, error.to_string()))
}

/// The names of the cameras, as in a manifest.
const CAMERAS: [CameraKind; 3] =
    [CameraKind::Perspective, CameraKind::Equirectangular, CameraKind::Omnidirectional];

fn camera_name(camera: CameraKind) -> &'static str {
    match camera {
        CameraKind::Perspective => "perspective",
        CameraKind::Equirectangular => "equirectangular",
        CameraKind::Omnidirectional => "omnidirectional",
    }
}

fn in_order(left: &Frame, right: &Frame) -> Ordering {
    files::natural_order(&left.sequence, &right.sequence)
        .then_with(|| left.time.partial_cmp(&right.time).unwrap_or(Ordering::Equal))
        .then_with(|| files::natural_order(&left.path.to_string_lossy(), &right.path.to_string_lossy()))
}
