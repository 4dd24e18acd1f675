//! Frames of recordings: pictures of a topic, and the rooms that labels, a topic or a map give them.
//!
//! | file | what |
//! |---|---|
//! | `taking` | what is taken of recordings |
//! | `labels` | rooms by time: a list, or a topic of texts |
//! | `poses` | where the robot was |
//! | `map` | rooms by place |

mod labels;
mod map;
mod poses;
mod taking;

pub use taking::{Clock, Taking};

use super::by_time::ByTime;
use super::{Dataset, DatasetError, Format, Frame, Problem, files};
use crate::cold_layout::tdf::Timed;
use labels::RoomTrack;
use map::RoomMap;
use poses::PoseTrack;
use roomsight_recognition::model::Scan;
use roomsight_recording::message::{Picture, Sweep, stamp_ns, sweep};
use roomsight_recording::{Kind, Message, Recording, Topic, is_called_so};
use roomsight_vision::camera::CameraKind;
use roomsight_vision::image::Limits;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Nanoseconds of a second.
const SECOND: f64 = 1e9;

/// The most topics that an error names.
const MAX_NAMED: usize = 12;

/// How deep recordings may lie in folders, the given one included.
const MAX_DEPTH: usize = 4;

/// A message in a recording.
#[derive(Clone)]
pub struct RecordedMessage {
    recording: Arc<Recording>,
    message: Message,
}

impl PartialEq for RecordedMessage {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.recording, &other.recording) && self.message == other.message
    }
}

impl fmt::Debug for RecordedMessage {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_tuple("RecordedMessage").field(&self.recording.path()).field(&self.message).finish()
    }
}

impl RecordedMessage {
    /// The recording.
    pub fn recording(&self) -> &Arc<Recording> {
        &self.recording
    }

    /// Where it lies in it.
    pub fn message(&self) -> &Message {
        &self.message
    }

    /// Its topic.
    pub fn topic(&self) -> &Topic {
        &self.recording.topics()[self.message.topic_idx]
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        self.recording.read(&self.message).map_err(|error| error.to_string())
    }

    /// The scan that it holds.
    ///
    /// # Errors
    /// Why it cannot be read.
    pub fn scan(&self) -> Result<Scan, String> {
        scan_of(self.topic(), &self.bytes()?)
    }

    /// The picture that it holds, and what it says of it.
    ///
    /// # Errors
    /// Why it cannot be read.
    pub fn picture(&self, limits: &Limits) -> Result<Picture, String> {
        let message = self.bytes()?;
        let picture = Picture::read(self.topic(), &message).map_err(|error| error.to_string())?;
        match picture.encoded.len() {
            n_bytes if n_bytes > limits.max_bytes => {
                Err(format!("{n_bytes} bytes long, at most {} are read", limits.max_bytes))
            }
            _ => Ok(picture),
        }
    }
}

/// The scan of a message of a laser.
///
/// # Errors
/// Why it cannot be read.
pub fn scan_of(topic: &Topic, message: &[u8]) -> Result<Scan, String> {
    let sweep = sweep(topic, message).map_err(|error| error.to_string())?;
    let Sweep { angle_min, angle_increment, range_max, ranges } = sweep;
    Scan::new(angle_min, angle_increment, range_max, ranges).map_err(|error| error.to_string())
}

/// The recordings in a folder and in folders in it that can be read.
pub(super) fn find(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    add_recordings(folder, MAX_DEPTH, &mut found);
    found.sort_by(|one, other| files::natural_order(&one.to_string_lossy(), &other.to_string_lossy()));
    found
}

fn add_recordings(path: &Path, n_deeper: usize, found: &mut Vec<PathBuf>) {
    if is_called_so(path) {
        found.push(path.to_owned());
    } else if path.is_dir() && n_deeper > 0 {
        let entries = fs::read_dir(path).into_iter().flatten().filter_map(Result::ok);
        entries.for_each(|entry| add_recordings(&entry.path(), n_deeper - 1, found));
    }
}

/// What a drive is called: as its recording, with the folders in which it lies below the root.
fn drive_name(root: &Path, recording: &Path) -> String {
    let name = files::name(recording);
    let stem = name.split('.').next().unwrap_or_default();
    let folders = recording.parent().and_then(|folder| folder.strip_prefix(root).ok());
    let folders = folders.into_iter().flat_map(Path::components);
    let mut parts: Vec<String> =
        folders.map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
    parts.push(stem.to_owned());
    parts.join("/")
}

/// The data set of these recordings: a drive each, called as its file.
pub(super) fn read(root: &Path, paths: &[PathBuf], taking: &Taking) -> Result<Dataset, DatasetError> {
    let mut dataset = Dataset::new(root, Format::Recording);
    for path in paths {
        match Recording::open(path) {
            Ok(recording) => add(&mut dataset, &Arc::new(recording), taking)?,
            Err(error) => dataset.report(path, error.to_string()),
        }
    }
    Ok(dataset)
}

/// Why a recording does not give what is asked of it.
fn unusable(recording: &Recording, reason: impl Into<String>) -> DatasetError {
    DatasetError::Recording { path: recording.path().to_owned(), reason: reason.into() }
}

fn add(dataset: &mut Dataset, recording: &Arc<Recording>, taking: &Taking) -> Result<(), DatasetError> {
    let path = recording.path().to_owned();
    recording.problems().iter().for_each(|problem| dataset.note(&path, problem.as_str()));
    let topic_idx = topic_of_pictures(recording, taking)?;
    let (messages, problems) =
        recording.messages(&[topic_idx]).map_err(|error| unusable(recording, error.to_string()))?;
    problems.into_iter().for_each(|problem| dataset.report(&path, problem));
    let times = times(dataset, recording, &messages, taking.clock);
    let Some(first_ns) = times.iter().flatten().min().copied() else {
        dataset.report(&path, format!("no picture is recorded under {}", recording.topics()[topic_idx].name));
        return Ok(());
    };
    let poses = PoseTrack::of(recording, taking)?;
    let odometry = PoseTrack::of_odometry(recording, taking)?;
    let scans = scans(recording, taking)?;
    let has_scans = recording.topics().iter().any(|topic| topic.kind() == Kind::LaserScan);
    dataset.has_other_scans |= has_scans && !taking.laser;
    let rooms = Rooms::of(recording, taking, first_ns)?;
    let sequence = drive_name(&dataset.root, &path);
    let mut last_ns = None;
    let (n_labeled, n_unlabeled) = (dataset.frames.len(), dataset.unlabeled.len());
    for (message, time_ns) in messages.into_iter().zip(times) {
        let Some(time_ns) = time_ns.filter(|time_ns| taking.wants(*time_ns, first_ns, last_ns)) else {
            continue;
        };
        last_ns = Some(time_ns);
        // Whatever clock pictures are dated by, what was recorded beside them belongs to them.
        let at_ns = message.time_ns;
        let pose = poses.as_ref().and_then(|poses| poses.at(at_ns));
        let when = Moment { time_ns, recorded_ns: at_ns };
        let room = rooms.as_ref().and_then(|rooms| rooms.at(when, pose.as_ref()));
        let frame = Frame {
            path: path.join(format!("{}.{:09}", time_ns / 1_000_000_000, time_ns % 1_000_000_000)),
            room: room.unwrap_or_default().to_owned(),
            sequence: sequence.clone(),
            camera: CameraKind::Perspective,
            split: String::new(),
            time: Some(time_ns as f64 / SECOND),
            pose,
            odometry: odometry.as_ref().and_then(|odometry| odometry.at(at_ns)),
            scan: scans.at(at_ns as f64 / SECOND).cloned().map(Into::into),
            recorded: Some(RecordedMessage { recording: recording.clone(), message }),
        };
        if frame.room.is_empty() { dataset.unlabeled.push(frame) } else { dataset.frames.push(frame) }
    }
    let without = &dataset.unlabeled[n_unlabeled..];
    if let (Some(rooms), [first, ..], [.., last]) = (&rooms, without, without)
        && dataset.frames.len() == n_labeled
    {
        let [from, to] = [first, last].map(|frame| frame.time.unwrap_or_default());
        return Err(unusable(recording, rooms.why_none(from, to)));
    }
    Ok(())
}

/// Where the scans are that lie beside pictures; none where they are not wanted.
fn scans(recording: &Arc<Recording>, taking: &Taking) -> Result<ByTime<RecordedMessage>, DatasetError> {
    if !taking.laser {
        return Ok(ByTime::new(Vec::new()));
    }
    let wanted = Wanted {
        what: "scans of a laser",
        option: "--scan-topic",
        name: taking.scan_topic.as_deref(),
        is_wanted: |topic| topic.kind() == Kind::LaserScan,
    };
    let topic_idx = wanted.topic_of(recording)?;
    let (messages, _) =
        recording.messages(&[topic_idx]).map_err(|error| unusable(recording, error.to_string()))?;
    let source = |message: Message| {
        let time = message.time_ns as f64 / SECOND;
        Timed { time, what: RecordedMessage { recording: Arc::clone(recording), message } }
    };
    Ok(ByTime::new(messages.into_iter().map(source).collect()))
}

/// What is looked for among the topics of a recording.
struct Wanted<'a> {
    what: &'static str,
    /// What chooses among several.
    option: &'static str,
    /// The one that is asked for; the only one where none is.
    name: Option<&'a str>,
    is_wanted: fn(&Topic) -> bool,
}

impl Wanted<'_> {
    fn topic_of(&self, recording: &Recording) -> Result<usize, DatasetError> {
        let (topics, what) = (recording.topics(), self.what);
        let there: Vec<usize> = (0..topics.len()).filter(|&idx| (self.is_wanted)(&topics[idx])).collect();
        let listed = || named(topics, &there);
        match (self.name, &there[..]) {
            (Some(name), there) => {
                there.iter().copied().find(|&idx| topics[idx].name == name).ok_or_else(|| {
                    unusable(
                        recording,
                        format!("there is no topic {name} with {what}; there are: {}", listed()),
                    )
                })
            }
            (None, [only]) => Ok(*only),
            (None, []) => Err(unusable(recording, format!("no topic holds {what}"))),
            (None, _) => {
                let why =
                    format!("several topics hold {what}: choose one with {}: {}", self.option, listed());
                Err(unusable(recording, why))
            }
        }
    }
}

/// The topic whose pictures are taken.
fn topic_of_pictures(recording: &Recording, taking: &Taking) -> Result<usize, DatasetError> {
    let topics = recording.topics();
    let pictures: Vec<usize> = (0..topics.len()).filter(|&idx| topics[idx].kind().is_picture()).collect();
    if let Some(name) = &taking.topic {
        return pictures.iter().copied().find(|&idx| topics[idx].name == *name).ok_or_else(|| {
            let why = match topics.iter().find(|topic| topic.name == *name) {
                Some(topic) => format!("the topic {topic} holds no pictures that are read"),
                None => format!("there is no topic {name}"),
            };
            unusable(recording, format!("{why}; pictures are recorded under {}", named(topics, &pictures)))
        });
    }
    match &pictures[..] {
        [only] => Ok(*only),
        [] => {
            let all: Vec<usize> = (0..topics.len()).collect();
            Err(unusable(recording, format!("no topic holds pictures; there are {}", named(topics, &all))))
        }
        _ => Err(unusable(
            recording,
            format!("several topics hold pictures: choose one with --topic: {}", named(topics, &pictures)),
        )),
    }
}

/// Topics by name and type, some of many.
fn named(topics: &[Topic], idxs: &[usize]) -> String {
    let mut names: Vec<String> = idxs.iter().take(MAX_NAMED).map(|&idx| topics[idx].to_string()).collect();
    if idxs.len() > MAX_NAMED {
        names.push(format!("{} more", idxs.len() - MAX_NAMED));
    }
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// When each picture was taken, by the clock that is wanted.
fn times(
    dataset: &mut Dataset,
    recording: &Recording,
    messages: &[Message],
    clock: Clock,
) -> Vec<Option<u64>> {
    if clock == Clock::Recorder {
        return messages.iter().map(|message| Some(message.time_ns)).collect();
    }
    let stamp = |message: &Message| {
        let bytes = recording.read(message).map_err(|error| error.to_string())?;
        let stamp_ns = stamp_ns(&recording.topics()[message.topic_idx], &bytes);
        stamp_ns.map_err(|error| error.to_string())?.ok_or_else(|| "a picture without a stamp".to_owned())
    };
    let mut times = Vec::with_capacity(messages.len());
    for message in messages {
        match stamp(message) {
            Ok(time_ns) => times.push(Some(time_ns)),
            Err(reason) => {
                dataset.problems.push(Problem::new(recording.path(), reason));
                times.push(None);
            }
        }
    }
    times
}

/// What tells rooms.
enum Rooms {
    /// By the clock that is wanted.
    List(RoomTrack),
    /// By the recorder's clock.
    Topic(RoomTrack),
    Map(RoomMap),
}

/// When a picture was taken, by the clock that is wanted and by the recorder's, in nanoseconds.
#[derive(Clone, Copy)]
struct Moment {
    time_ns: u64,
    recorded_ns: u64,
}

impl Rooms {
    /// Of a recording; none where nothing tells them.
    fn of(recording: &Recording, taking: &Taking, first_ns: u64) -> Result<Option<Self>, DatasetError> {
        if let Some(topic) = &taking.room_topic {
            return Ok(Some(Self::Topic(RoomTrack::of_topic(recording, topic)?)));
        }
        if let Some(map) = &taking.map {
            return Ok(Some(Self::Map(RoomMap::read(map)?)));
        }
        let beside = taking.labels.clone().or_else(|| labels::beside(recording.path()));
        let read = |path: PathBuf| RoomTrack::read(&path, first_ns).map(Self::List);
        beside.map(read).transpose()
    }

    /// The room where a robot was when a picture was taken.
    fn at(&self, when: Moment, pose: Option<&super::Pose>) -> Option<&str> {
        match self {
            Self::List(track) => track.at(when.time_ns),
            Self::Topic(track) => track.at(when.recorded_ns),
            Self::Map(map) => map.at(pose?),
        }
    }

    /// Why no picture from one time to another, in seconds, has a room.
    fn why_none(&self, from: f64, to: f64) -> String {
        match self {
            Self::List(track) | Self::Topic(track) => track.why_none(from, to),
            Self::Map(_) => {
                "no pose of it lies in a room of the map: is the map in other coordinates?".to_owned()
            }
        }
    }
}
