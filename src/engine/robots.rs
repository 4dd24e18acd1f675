//! Who streams, for dashboards.

use crate::access::Key;
use roomsight_protocol::event::{FrameCounts, PastAnswer, RobotInfo, RobotName};
use roomsight_protocol::rest::TimingsMs;
use roomsight_protocol::stream::{DropReason, Filtered, Mode, StreamResult};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// The last answers that are kept of a stream.
const N_ANSWERS: usize = 16;

/// What dashboards may know of one stream; written by its task, read by anyone.
pub struct RobotRecord {
    /// Its public name: nobody can resume the stream by it.
    stream: String,
    /// What opened it.
    key: Option<Arc<Key>>,
    began: Instant,
    known: Mutex<Known>,
}

#[derive(Default)]
struct Known {
    robot: Option<String>,
    connected: bool,
    /// Since when its connection is broken.
    broke: Option<Instant>,
    mode: Mode,
    room: Option<(String, Instant)>,
    frames: FrameCounts,
    answers: VecDeque<Told>,
}

/// An answer that was told.
struct Told {
    seq: u64,
    room: String,
    known: bool,
    novelty: Option<f32>,
    probability: f32,
    timings_ms: TimingsMs,
    at: Instant,
}

impl RobotRecord {
    /// Of a stream that begins, opened with a key where there are keys.
    pub fn new(stream: String, key: Option<Arc<Key>>) -> Self {
        Self { stream, key, began: Instant::now(), known: Mutex::default() }
    }

    /// When it began.
    pub fn began(&self) -> Instant {
        self.began
    }

    /// The stream is configured so.
    pub fn configured(&self, robot: Option<&str>, mode: Mode) {
        let mut known = self.known();
        known.robot = robot.map(str::to_owned);
        known.mode = mode;
    }

    /// Its connection stands, or does not.
    pub fn connected(&self, connected: bool) {
        let mut known = self.known();
        known.connected = connected;
        known.broke = (!connected).then(Instant::now);
    }

    /// When its connection broke, where it has none since.
    pub fn broke(&self) -> Option<Instant> {
        self.known().broke
    }

    /// Whether its connection stands.
    pub fn is_connected(&self) -> bool {
        self.known().connected
    }

    /// It took a frame in.
    pub fn accepted(&self) {
        self.known().frames.accepted += 1;
    }

    /// It told a room.
    pub fn answered(&self, result: &StreamResult) {
        let StreamResult { seq, answer, filtered, .. } = result;
        let at = Instant::now();
        let (seq, timings_ms) = (*seq, answer.timings_ms);
        let told = match filtered {
            Some(Filtered { room, known, novelty, probability, .. }) => Told {
                seq,
                room: room.clone(),
                known: *known,
                novelty: *novelty,
                probability: *probability,
                timings_ms,
                at,
            },
            None => Told {
                seq,
                room: answer.room.clone(),
                known: answer.known,
                novelty: answer.novelty,
                probability: answer.probability,
                timings_ms,
                at,
            },
        };
        let mut known = self.known();
        known.frames.results += 1;
        if known.room.as_ref().is_none_or(|(room, _)| *room != told.room) {
            known.room = Some((told.room.clone(), at));
        }
        known.answers.truncate(N_ANSWERS - 1);
        known.answers.push_front(told);
    }

    /// It told that a frame cannot be recognized.
    pub fn failed(&self) {
        self.known().frames.errors += 1;
    }

    /// It told that a frame was not looked at.
    pub fn dropped(&self, reason: DropReason) {
        *self.known().frames.dropped.entry(reason).or_default() += 1;
    }

    /// What opened it.
    pub fn key(&self) -> Option<&Key> {
        self.key.as_deref()
    }

    /// Whose stream it is.
    pub fn name(&self) -> RobotName {
        RobotName { stream: self.stream.clone(), robot: self.known().robot.clone() }
    }

    pub fn info(&self) -> RobotInfo {
        let name = self.name();
        let known = self.known();
        let past = |told: &Told| PastAnswer {
            seq: told.seq,
            room: told.room.clone(),
            known: told.known,
            probability: told.probability,
            timings_ms: told.timings_ms,
            ago_s: told.at.elapsed().as_secs_f64(),
        };
        RobotInfo {
            name,
            key: self.key().map(|key| key.name().to_owned()),
            connected: known.connected,
            streaming_s: self.began.elapsed().as_secs_f64(),
            mode: known.mode,
            room: known.room.as_ref().map(|(room, _)| room.clone()),
            known: known.answers.front().is_some_and(|last| last.known),
            novelty: known.answers.front().and_then(|last| last.novelty),
            in_room_s: known.room.as_ref().map(|(_, since)| since.elapsed().as_secs_f64()),
            frames: known.frames.clone(),
            answers: known.answers.iter().map(past).collect(),
        }
    }

    fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
