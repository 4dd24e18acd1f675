//! Who is there: all robots that stream or send requests under a name, and for a while those that left.
//!
//! | file | what |
//! |---|---|
//! | `record` | what is known of one robot |
//! | `frames` | the last frame of each |
//! | `rate`, `ribbon` | how fast its frames come; where it was in the last minutes |
//!
//! A robot is found under its name. Of several streams with one name the one that began last has it, since a robot
//! comes back before its old connection is known to be broken; the others are found under their streams' names.

mod frames;
mod rate;
mod record;
mod ribbon;

pub use frames::LastFrames;
pub use record::{LastAnswer, Revision, RobotRecord};

use crate::access::Key;
use crate::engine::events::Events;
use crate::settings::Settings;
use bytes::Bytes;
use record::Turn;
use roomsight_protocol::event::{Event, RobotFound, RobotInfo, RobotState, RoomChange};
use roomsight_protocol::stream::{Mode, StreamResult};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// For how long a robot is told of that left.
const REMEMBERED: Duration = Duration::from_secs(3600);
/// The most robots that are told of without a stream: callers make up names.
const MAX_WITHOUT_STREAM: usize = 1000;

/// All robots.
pub struct Robots {
    by_id: Mutex<BTreeMap<String, Arc<RobotRecord>>>,
    frames: LastFrames,
    lost_after: Duration,
    events: Events,
}

impl Robots {
    /// As the settings say; what happens to them is told as events.
    pub fn new(settings: &Settings, events: Events) -> Self {
        Self {
            by_id: Mutex::default(),
            frames: LastFrames::new(settings.live_frames_bytes),
            lost_after: settings.lost_after(),
            events,
        }
    }

    /// A stream began.
    pub fn enter(&self, record: &Arc<RobotRecord>) {
        self.place(&mut self.by_id(), record);
    }

    /// A stream is over.
    pub fn left(&self, record: &RobotRecord) {
        record.left();
        self.prune(&mut self.by_id());
    }

    /// A stream is configured so.
    pub fn configured(&self, record: &Arc<RobotRecord>, robot: Option<&str>, mode: Mode) {
        let has_other_name = record.robot().as_deref() != robot;
        record.configured(robot, mode);
        if has_other_name {
            let mut by_id = self.by_id();
            // One that has not begun yet is placed when it does.
            if is_at(&by_id, &record.id(), record) {
                self.place(&mut by_id, record);
            }
        }
    }

    /// The robot of this name that sends requests, or a stream beside.
    pub fn named(&self, robot: &str, key: Option<&Arc<Key>>) -> Arc<RobotRecord> {
        let mut by_id = self.by_id();
        match by_id.get(robot) {
            Some(record) if record.stream().is_none() || record.streams() => record.clone(),
            _ => {
                let record = Arc::new(RobotRecord::of_requests(robot, key.cloned()));
                self.place(&mut by_id, &record);
                self.prune(&mut by_id);
                record
            }
        }
    }

    /// A robot was told a room. Whoever listens hears what that changes.
    pub fn answered(&self, record: &RobotRecord, answer: LastAnswer) {
        for turn in record.answered(answer, self.lost_after) {
            self.events.tell(match turn {
                Turn::Lost(since) => {
                    let lost = record.lost(since);
                    tracing::info!(robot = lost.who.id, "a robot is lost");
                    Event::RobotLost(lost)
                }
                Turn::Found { room, lost } => {
                    let found =
                        RobotFound { who: record.who(), room: room.to_string(), lost_s: lost.as_secs_f64() };
                    tracing::info!(robot = found.who.id, room = found.room, "a robot is found");
                    Event::RobotFound(found)
                }
                Turn::Room { from, to } => {
                    let from = from.map(|room| room.to_string());
                    Event::RoomChanged(RoomChange { who: record.who(), from, to: to.to_string() })
                }
            });
        }
    }

    /// A stream's frame was told a room.
    pub fn answered_in_stream(&self, record: &RobotRecord, result: &StreamResult, latency_ms: f64) {
        self.answered(record, LastAnswer::of_stream(result, latency_ms));
    }

    /// A number for a frame that a robot sent, for [`Robots::keep`].
    pub fn frame_number(&self) -> u64 {
        self.frames.number()
    }

    /// Keeps a robot's last frame, where any are kept.
    pub fn keep(&self, record: &RobotRecord, number: u64, bytes: impl FnOnce() -> Bytes) {
        self.frames.keep(&record.last_frame, number, bytes);
    }

    /// A robot's last frame and its number, if it is kept.
    pub fn frame(&self, record: &RobotRecord) -> Option<(u64, Bytes)> {
        self.frames.get(&record.last_frame)
    }

    /// The last frames of all.
    pub fn frames(&self) -> &LastFrames {
        &self.frames
    }

    /// All robots, in the order of their ids.
    pub fn all(&self) -> Vec<Arc<RobotRecord>> {
        let mut by_id = self.by_id();
        self.prune(&mut by_id);
        by_id.values().cloned().collect()
    }

    /// The robot that is found under this id, or by its stream's name.
    pub fn find(&self, id: &str) -> Option<Arc<RobotRecord>> {
        let by_id = self.by_id();
        let by_stream = || by_id.values().find(|record| record.stream() == Some(id));
        by_id.get(id).or_else(by_stream).cloned()
    }

    /// A robot as it is now.
    pub fn state(&self, record: &RobotRecord) -> RobotState {
        RobotState { frame: self.frames.number_of(&record.last_frame), ..record.state() }
    }

    /// All that is told of a robot.
    pub fn info(&self, record: &RobotRecord) -> RobotInfo {
        let mut info = record.info();
        info.state.frame = self.frames.number_of(&record.last_frame);
        info
    }

    /// Lets a robot be found under its name, where it goes on from whoever had it and is gone.
    fn place(&self, by_id: &mut BTreeMap<String, Arc<RobotRecord>>, record: &Arc<RobotRecord>) {
        let before = record.id();
        if is_at(by_id, &before, record) {
            by_id.remove(&before);
        }
        let id = record.robot().or_else(|| record.stream().map(str::to_owned)).unwrap_or_default();
        if let Some(other) = by_id.remove(&id) {
            match other.stream().filter(|_| other.streams()) {
                Some(stream) => {
                    other.set_id(stream);
                    by_id.insert(stream.to_owned(), other.clone());
                }
                None => record.goes_on_from(&other),
            }
        }
        record.set_id(&id);
        by_id.insert(id, record.clone());
    }

    /// Forgets those without a stream of whom nothing was heard for long, or who are too many.
    fn prune(&self, by_id: &mut BTreeMap<String, Arc<RobotRecord>>) {
        let now = Instant::now();
        let mut without_stream: Vec<(Instant, String)> = by_id
            .iter()
            .filter(|(_, record)| !record.streams())
            .map(|(id, record)| (record.last_seen(), id.clone()))
            .collect();
        without_stream.sort();
        let n_too_many = without_stream.len().saturating_sub(MAX_WITHOUT_STREAM);
        for (idx, (last_seen, id)) in without_stream.into_iter().enumerate() {
            let is_over = idx < n_too_many || now.saturating_duration_since(last_seen) > REMEMBERED;
            if is_over && let Some(record) = by_id.remove(&id) {
                self.frames.forget(&record.last_frame);
            }
        }
    }

    fn by_id(&self) -> MutexGuard<'_, BTreeMap<String, Arc<RobotRecord>>> {
        self.by_id.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn is_at(by_id: &BTreeMap<String, Arc<RobotRecord>>, id: &str, record: &Arc<RobotRecord>) -> bool {
    by_id.get(id).is_some_and(|other| Arc::ptr_eq(other, record))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robots() -> Robots {
        Robots::new(&Settings::default(), Events::default())
    }

    fn stream(robots: &Robots, stream: &str, robot: Option<&str>) -> Arc<RobotRecord> {
        let record = Arc::new(RobotRecord::of_stream(stream.to_owned(), None));
        record.configured(robot, Mode::Latest);
        record.connected(true);
        robots.enter(&record);
        record
    }

    fn ids(robots: &Robots) -> Vec<String> {
        robots.all().iter().map(|record| record.id()).collect()
    }

    #[test]
    fn of_streams_with_one_name_the_last_one_has_it() {
        let robots = robots();
        let first = stream(&robots, "s1", Some("eve"));
        let second = stream(&robots, "s2", Some("eve"));
        assert_eq!(ids(&robots), ["eve", "s1"]);
        assert!(Arc::ptr_eq(&robots.find("eve").unwrap(), &second));
        assert!(Arc::ptr_eq(&robots.find("s1").unwrap(), &first));
        assert!(Arc::ptr_eq(&robots.find("s2").unwrap(), &second), "a stream's name always leads to it");
        robots.configured(&second, Some("wall-e"), Mode::Latest);
        assert_eq!(ids(&robots), ["s1", "wall-e"]);
        robots.configured(&first, None, Mode::Latest);
        assert_eq!(ids(&robots), ["s1", "wall-e"]);
    }

    #[test]
    fn a_robot_that_comes_back_goes_on_where_it_was() {
        let robots = robots();
        let first = stream(&robots, "s1", Some("eve"));
        robots.keep(&first, robots.frame_number(), || vec![1].into());
        robots.left(&first);
        assert_eq!(ids(&robots), ["eve"], "it is told of after it left");
        let by_request = robots.named("eve", None);
        assert!(Arc::ptr_eq(&by_request, &robots.named("eve", None)) && !Arc::ptr_eq(&by_request, &first));
        assert_eq!(robots.frame(&by_request).unwrap().1, vec![1]);
        let second = stream(&robots, "s2", Some("eve"));
        assert_eq!((ids(&robots).len(), robots.frame(&second).is_some()), (1, true));
        assert!(
            Arc::ptr_eq(&robots.named("eve", None), &second),
            "its requests count for it while it streams"
        );
    }

    #[test]
    fn names_that_callers_make_up_are_bounded() {
        let robots = robots();
        let kept = stream(&robots, "s", Some("kept"));
        for idx in 0..MAX_WITHOUT_STREAM + 50 {
            let record = robots.named(&format!("robot {idx}"), None);
            robots.keep(&record, robots.frame_number(), || vec![0; 10].into());
        }
        assert_eq!(robots.all().len(), MAX_WITHOUT_STREAM + 1);
        assert_eq!(robots.frames().n_bytes(), MAX_WITHOUT_STREAM * 10);
        assert!(robots.find("robot 0").is_none() && robots.find("kept").is_some());
        drop(kept);
    }
}
