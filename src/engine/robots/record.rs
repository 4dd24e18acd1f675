//! What is known of one robot; written by whoever answers it, read by anyone.

use super::frames::LastFrame;
use super::rate::Rate;
use super::ribbon::{PastStay, Ribbon};
use crate::access::Key;
use roomsight_protocol::event::{
    FrameCounts, PastAnswer, RobotId, RobotInfo, RobotLost, RobotName, RobotState, Stay, Via,
};
use roomsight_protocol::rest::{Answer, ModelName, RoomProbability, TimingsMs, Unknown};
use roomsight_protocol::stream::{DropReason, Mode, StreamResult};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};

/// The last answers that are kept of a robot.
const N_ANSWERS: usize = 16;
/// The most rooms that are told with its last answer.
const N_PROBABILITIES: usize = 5;
/// A robot that sends requests counts as connected for so long after one.
const REQUEST_COUNTS: Duration = Duration::from_secs(30);
/// A robot of which nothing came for so long sends nothing right now.
const QUIET: Duration = Duration::from_secs(3);

/// One robot: a stream, or all requests that name it.
pub struct RobotRecord {
    /// The stream's public name: nobody can resume it by this. None where it sends requests.
    stream: Option<String>,
    /// What opened it.
    key: Option<Arc<Key>>,
    began: Instant,
    pub(super) last_frame: LastFrame,
    known: Mutex<Known>,
}

struct Known {
    /// What it is found under.
    id: String,
    robot: Option<String>,
    connected: bool,
    /// Since when its connection is broken.
    broke: Option<Instant>,
    /// Its stream is over.
    has_left: bool,
    last_seen: Instant,
    mode: Mode,
    rate: Rate,
    frames: FrameCounts,
    answers: VecDeque<PastTold>,
    place: Place,
    /// Grows with every change.
    revision: u64,
}

/// Where it is, which goes on when its robot comes back with another stream.
#[derive(Clone, Default)]
struct Place {
    /// What its last answer says.
    last: Option<LastAnswer>,
    /// Since when its answers have named this room.
    in_room_since: Option<Instant>,
    /// The room of its last known answer.
    known_room: Option<Arc<str>>,
    /// Since when its answers are unknown.
    unknown_since: Option<Instant>,
    is_lost: bool,
    ribbon: Ribbon,
}

/// An answer as it was told.
#[derive(Clone)]
pub struct LastAnswer {
    /// Which of its frames.
    seq: u64,
    /// The room: of the stream's filter where there is one.
    room: Arc<str>,
    known: bool,
    unknown: Option<Unknown>,
    novelty: Option<f32>,
    probability: f32,
    probabilities: Vec<RoomProbability>,
    age_ms: Option<f64>,
    latency_ms: f64,
    timings_ms: TimingsMs,
    model: ModelName,
}

/// An answer of a while ago.
struct PastTold {
    seq: u64,
    room: Arc<str>,
    known: bool,
    probability: f32,
    timings_ms: TimingsMs,
    at: Instant,
}

/// What an answer changes that others hear of.
#[derive(Debug, PartialEq)]
pub enum Turn {
    /// Its answers have been unknown for too long, since then.
    Lost(Instant),
    /// It was lost for so long and is somewhere again.
    Found { room: Arc<str>, lost: Duration },
    /// It came to another room.
    Room { from: Option<Arc<str>>, to: Arc<str> },
}

/// What tells whether anything of a robot is to be told again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Revision {
    n_changes: u64,
    connected: bool,
    is_quiet: bool,
}

impl LastAnswer {
    /// Of a request, which was answered so long after it arrived.
    pub fn of_frame(answer: &Answer, latency_ms: f64) -> Self {
        Self {
            seq: 0,
            room: answer.room.as_str().into(),
            known: answer.known,
            unknown: answer.unknown,
            novelty: answer.novelty,
            probability: answer.probability,
            probabilities: answer.probabilities.iter().take(N_PROBABILITIES).cloned().collect(),
            age_ms: None,
            latency_ms,
            timings_ms: answer.timings_ms,
            model: answer.model.clone(),
        }
    }

    /// Of a stream's frame.
    pub fn of_stream(result: &StreamResult, latency_ms: f64) -> Self {
        let StreamResult { seq, answer, filtered, age_ms, .. } = result;
        let of_frame = Self::of_frame(answer, latency_ms);
        let of_frame = Self { seq: *seq, age_ms: *age_ms, ..of_frame };
        let Some(filtered) = filtered else { return of_frame };
        Self {
            room: filtered.room.as_str().into(),
            known: filtered.known,
            unknown: answer.unknown.filter(|_| !filtered.known),
            novelty: filtered.novelty,
            probability: filtered.probability,
            probabilities: filtered.probabilities.iter().take(N_PROBABILITIES).cloned().collect(),
            ..of_frame
        }
    }
}

impl RobotRecord {
    /// Of a stream that begins, opened with a key where there are keys.
    pub fn of_stream(stream: String, key: Option<Arc<Key>>) -> Self {
        Self::new(stream.clone(), Some(stream), None, key)
    }

    /// Of a robot of this name that sends requests.
    pub fn of_requests(robot: &str, key: Option<Arc<Key>>) -> Self {
        Self::new(robot.to_owned(), None, Some(robot.to_owned()), key)
    }

    fn new(id: String, stream: Option<String>, robot: Option<String>, key: Option<Arc<Key>>) -> Self {
        let began = Instant::now();
        let known = Known {
            id,
            robot,
            connected: false,
            broke: None,
            has_left: false,
            last_seen: began,
            mode: Mode::default(),
            rate: Rate::default(),
            frames: FrameCounts::default(),
            answers: VecDeque::new(),
            place: Place::default(),
            revision: 0,
        };
        Self { stream, key, began, last_frame: LastFrame::default(), known: Mutex::new(known) }
    }

    /// When it began.
    pub fn began(&self) -> Instant {
        self.began
    }

    /// The stream is configured so.
    pub fn configured(&self, robot: Option<&str>, mode: Mode) {
        let mut known = self.changed();
        known.robot = robot.map(str::to_owned);
        known.mode = mode;
    }

    /// Its connection stands, or does not.
    pub fn connected(&self, connected: bool) {
        let mut known = self.changed();
        known.connected = connected;
        known.broke = (!connected).then(Instant::now);
        known.last_seen = Instant::now();
        if !known.place.is_lost {
            known.place.unknown_since = None;
        }
    }

    /// Its stream is over.
    pub fn left(&self) {
        let mut known = self.changed();
        known.has_left = true;
        known.connected = false;
    }

    /// When its connection broke, where it has none since.
    pub fn broke(&self) -> Option<Instant> {
        self.known().broke
    }

    /// Whether it has a stream that is not over, connected or not.
    pub fn streams(&self) -> bool {
        self.stream.is_some() && !self.known().has_left
    }

    /// Whether its connection stands, or it has sent a request lately.
    pub fn is_connected(&self) -> bool {
        let known = self.known();
        self.is_connected_by(&known, Instant::now())
    }

    /// Whether its connection stands, or it has sent a request lately, and it does not know where it is.
    pub fn is_lost(&self) -> bool {
        let known = self.known();
        known.place.is_lost && self.is_connected_by(&known, Instant::now())
    }

    /// When something was last heard of it.
    pub fn last_seen(&self) -> Instant {
        self.known().last_seen
    }

    /// It sent a frame.
    pub fn accepted(&self) {
        let (mut known, now) = (self.changed(), Instant::now());
        known.frames.accepted += 1;
        known.rate.count(now);
        known.last_seen = now;
    }

    /// It was told a room; tells what of that others hear of. Answers that are unknown for longer than `lost_after` make
    /// it lost.
    pub fn answered(&self, answer: LastAnswer, lost_after: Duration) -> Vec<Turn> {
        let now = Instant::now();
        let mut known = self.changed();
        known.frames.results += 1;
        known.answers.truncate(N_ANSWERS - 1);
        known.answers.push_front(PastTold {
            seq: answer.seq,
            room: answer.room.clone(),
            known: answer.known,
            probability: answer.probability,
            timings_ms: answer.timings_ms,
            at: now,
        });
        known.place.answered(answer, lost_after, now)
    }

    /// It was told that a frame cannot be recognized.
    pub fn failed(&self) {
        self.changed().frames.errors += 1;
    }

    /// It was told that a frame was not looked at.
    pub fn dropped(&self, reason: DropReason) {
        *self.changed().frames.dropped.entry(reason).or_default() += 1;
    }

    /// Goes on where another one was, which is of the same robot.
    pub(super) fn goes_on_from(&self, other: &Self) {
        let place = other.known().place.clone();
        self.changed().place = place;
        self.last_frame.take_over(&other.last_frame);
    }

    /// What opened it.
    pub fn key(&self) -> Option<&Key> {
        self.key.as_deref()
    }

    /// The stream's public name.
    pub fn stream(&self) -> Option<&str> {
        self.stream.as_deref()
    }

    /// The robot, where it has said so.
    pub fn robot(&self) -> Option<String> {
        self.known().robot.clone()
    }

    /// What it is found under.
    pub fn id(&self) -> String {
        self.known().id.clone()
    }

    /// It is found under another id.
    pub(super) fn set_id(&self, id: &str) {
        self.changed().id = id.to_owned();
    }

    /// Whose stream it is.
    pub fn name(&self) -> RobotName {
        RobotName { stream: self.stream.clone().unwrap_or_default(), robot: self.robot() }
    }

    /// Which robot it is.
    pub fn who(&self) -> RobotId {
        self.who_by(&self.known())
    }

    /// What changes whenever there is something new to tell.
    pub fn revision(&self, now: Instant) -> Revision {
        let known = self.known();
        Revision {
            n_changes: known.revision,
            connected: self.is_connected_by(&known, now),
            is_quiet: now.saturating_duration_since(known.last_seen) > QUIET,
        }
    }

    /// As it is now, but for its frame.
    pub fn state(&self) -> RobotState {
        self.state_by(&self.known(), Instant::now())
    }

    /// All that is told of it, but for its frame.
    pub fn info(&self) -> RobotInfo {
        let (known, now) = (self.known(), Instant::now());
        let past = |told: &PastTold| PastAnswer {
            seq: told.seq,
            room: told.room.to_string(),
            known: told.known,
            probability: told.probability,
            timings_ms: told.timings_ms,
            ago_s: seconds_since(told.at, now),
        };
        let stay = |stay: &PastStay| Stay {
            room: stay.room.to_string(),
            known: stay.known,
            from: text_of(stay.from, now),
            until: text_of(stay.until, now),
        };
        let streams = self.stream.is_some();
        RobotInfo {
            state: self.state_by(&known, now),
            mode: streams.then_some(known.mode),
            streaming_s: streams.then(|| seconds_since(self.began, now)),
            answers: known.answers.iter().map(past).collect(),
            ribbon: known.place.ribbon.stays(now).map(stay).collect(),
        }
    }

    /// When its answers began to be unknown, for those who are told that it is lost.
    pub(super) fn lost(&self, since: Instant) -> RobotLost {
        RobotLost { who: self.who(), since: text_of(since, Instant::now()) }
    }

    fn state_by(&self, known: &Known, now: Instant) -> RobotState {
        let place = &known.place;
        let last = place.last.as_ref();
        let lost_since = place.unknown_since.filter(|_| place.is_lost);
        RobotState {
            service: None,
            who: self.who_by(known),
            via: if self.stream.is_some() { Via::Stream } else { Via::Rest },
            key: self.key().map(|key| key.name().to_owned()),
            connected: self.is_connected_by(known, now),
            last_seen_s: seconds_since(known.last_seen, now),
            room: last.map(|last| last.room.to_string()),
            known: last.is_some_and(|last| last.known),
            unknown: last.and_then(|last| last.unknown),
            novelty: last.and_then(|last| last.novelty),
            probability: last.map(|last| last.probability),
            probabilities: last.map_or_else(Vec::new, |last| last.probabilities.clone()),
            in_room_s: place.in_room_since.map(|since| seconds_since(since, now)),
            lost: place.is_lost,
            lost_s: lost_since.map(|since| seconds_since(since, now)),
            frames_per_s: (known.rate.per_second(now) * 100.0).round() / 100.0,
            age_ms: last.and_then(|last| last.age_ms),
            latency_ms: last.map(|last| last.latency_ms),
            frames: known.frames.clone(),
            frame: None,
            model: last.map(|last| last.model.clone()),
        }
    }

    fn who_by(&self, known: &Known) -> RobotId {
        RobotId { id: known.id.clone(), robot: known.robot.clone(), stream: self.stream.clone() }
    }

    fn is_connected_by(&self, known: &Known, now: Instant) -> bool {
        match self.stream {
            Some(_) => known.connected,
            None => now.saturating_duration_since(known.last_seen) < REQUEST_COUNTS,
        }
    }

    fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// To change something of it.
    fn changed(&self) -> MutexGuard<'_, Known> {
        let mut known = self.known();
        known.revision += 1;
        known
    }
}

impl Place {
    fn answered(&mut self, answer: LastAnswer, lost_after: Duration, now: Instant) -> Vec<Turn> {
        let mut turns = Vec::new();
        let (room, known) = (answer.room.clone(), answer.known);
        if self.last.as_ref().is_none_or(|last| last.room != room) {
            self.in_room_since = Some(now);
        }
        self.ribbon.answered(&room, known, now);
        self.last = Some(answer);
        if known {
            let since = self.unknown_since.take();
            if std::mem::take(&mut self.is_lost) {
                let lost = since.map_or(Duration::ZERO, |since| now.duration_since(since));
                turns.push(Turn::Found { room: room.clone(), lost });
            }
            if self.known_room.as_ref() != Some(&room) {
                let from = self.known_room.replace(room.clone());
                turns.push(Turn::Room { from, to: room });
            }
        } else {
            let since = *self.unknown_since.get_or_insert(now);
            if !self.is_lost && now.duration_since(since) > lost_after {
                self.is_lost = true;
                turns.push(Turn::Lost(since));
            }
        }
        turns
    }
}

fn seconds_since(then: Instant, now: Instant) -> f64 {
    (now.saturating_duration_since(then).as_secs_f64() * 1e3).round() / 1e3
}

/// When that was, by the clock as it is set now.
fn text_of(then: Instant, now: Instant) -> String {
    let ago = now.saturating_duration_since(then);
    let at = SystemTime::now().checked_sub(ago).unwrap_or(SystemTime::UNIX_EPOCH);
    humantime::format_rfc3339_millis(at).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(room: &str, known: bool) -> LastAnswer {
        LastAnswer {
            seq: 0,
            room: room.into(),
            known,
            unknown: None,
            novelty: None,
            probability: 0.5,
            probabilities: Vec::new(),
            age_ms: None,
            latency_ms: 1.0,
            timings_ms: TimingsMs { queue: 0.0, decode: 0.0, features: 0.0, classify: 0.0 },
            model: ModelName { name: "lab".into(), version: 1, epoch: 1, digest: String::new() },
        }
    }

    #[test]
    fn a_robot_is_lost_when_it_was_unknown_for_too_long_and_found_when_it_is_known() {
        let (began, mut place) = (Instant::now(), Place::default());
        let at = |seconds| began + Duration::from_secs(seconds);
        let mut say = |seconds, room: &str, known| {
            place.answered(answer(room, known), Duration::from_secs(10), at(seconds))
        };
        assert_eq!(say(0, "hall", true), [Turn::Room { from: None, to: "hall".into() }]);
        for seconds in [1, 5, 11] {
            assert_eq!(say(seconds, "bath", false), []);
        }
        assert_eq!(say(12, "bath", false), [Turn::Lost(at(1))]);
        assert_eq!(say(30, "bath", false), [], "it is told once");
        assert_eq!(
            say(31, "hall", true),
            [Turn::Found { room: "hall".into(), lost: Duration::from_secs(30) }],
            "it is where it was before"
        );
        assert_eq!(say(32, "bath", false), []);
        assert_eq!(say(41, "bath", true), [Turn::Room { from: Some("hall".into()), to: "bath".into() }]);
        assert_eq!(say(60, "bath", false), [], "it was known meanwhile");
    }
}
