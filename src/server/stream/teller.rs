//! What a stream says of the frames that were recognized: the frame's own answer, the filter's, and that the
//! model changed. And what it has said, for a robot that comes back.

use super::ledger::Accepted;
use super::session::text;
use crate::filter::{RoomFilter, Trust};
use crate::protocol::event::{AnswerEvent, Event};
use crate::protocol::rest::{Answer, ModelName, RecognizeQuery};
use crate::protocol::stream::{
    FilterChange, FilterSettings, Filtered, ModelChanged, ServerMessage, StreamResult, StreamSettings,
};
use crate::server::api;
use crate::server::events::Events;
use crate::server::recognize::Seen;
use crate::server::registry::ServedModel;
use crate::server::robots::Record;
use std::collections::VecDeque;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tokio_tungstenite::tungstenite::Utf8Bytes;

/// The messages that are kept for a robot that comes back.
const N_KEPT: usize = 64;

/// What a stream says, and has said.
pub struct Teller {
    session: String,
    /// The model of the last answer. Only its name is kept, so that a stream that rests does not keep a model
    /// in memory.
    model: ModelName,
    rooms: Vec<String>,
    filter: Option<Belief>,
    /// The last messages, the oldest first, and the frames they are about.
    told: VecDeque<(u64, Utf8Bytes)>,
}

/// A filter, and the frame it last took in.
struct Belief {
    filter: RoomFilter,
    settings: FilterSettings,
    at: Moment,
}

/// When a frame was taken, by the robot's clock or by ours.
#[derive(Clone, Copy)]
struct Moment {
    captured_at_ns: Option<u64>,
    arrived: Instant,
}

impl Teller {
    /// Of a stream whose frames this model will answer.
    pub fn new(session: String, served: &ServedModel) -> Self {
        let (model, rooms) = (ModelName::from(served), served.model.places().to_vec());
        Self { session, model, rooms, filter: None, told: VecDeque::new() }
    }

    /// The model of the last answer.
    pub fn model(&self) -> &ModelName {
        &self.model
    }

    /// The rooms that it tells apart.
    pub fn rooms(&self) -> &[String] {
        &self.rooms
    }

    /// What is said of a frame that was recognized; dashboards hear it too.
    pub fn result(
        &mut self,
        frame: &Accepted,
        seen: Seen,
        (settings, events, record): (&StreamSettings, &Events, &Record),
    ) -> Vec<Utf8Bytes> {
        let mut said: Vec<Utf8Bytes> = self.changed_model(frame.seq, &seen.served).into_iter().collect();
        let filtered = self.filtered(frame, &seen, settings);
        let query =
            RecognizeQuery { robot: settings.robot.clone(), top: settings.top, ..RecognizeQuery::default() };
        let answer = Answer::new(seen, &query, &self.session);
        let age_ms = frame.captured_at_ns.map(age_ms);
        let result = StreamResult { seq: frame.seq, answer, filtered, age_ms };
        let latency_ms = api::ms(frame.arrived.elapsed());
        record.answered(&result);
        events.tell(|| Event::Answer(Box::new(AnswerEvent::of_stream(&self.session, &result, latency_ms))));
        said.push(text(&ServerMessage::Result(Box::new(result))));
        said
    }

    /// Keeps a message about a frame for a robot that comes back.
    pub fn keep(&mut self, seq: u64, message: Utf8Bytes) {
        if self.told.len() == N_KEPT {
            self.told.pop_front();
        }
        self.told.push_back((seq, message));
    }

    /// The kept messages about frames after this one, or all of them.
    pub fn told_after(&self, last_seq: Option<u64>) -> Vec<Utf8Bytes> {
        let is_missed = |seq: u64| last_seq.is_none_or(|last_seq| seq > last_seq);
        self.told.iter().filter(|(seq, _)| is_missed(*seq)).map(|(_, message)| message.clone()).collect()
    }

    /// Says that another model answers from this frame on, if it does.
    fn changed_model(&mut self, first_seq: u64, served: &ServedModel) -> Option<Utf8Bytes> {
        let ModelName { name, version, epoch, .. } = &self.model;
        if (name, *version, *epoch) == (&served.name, served.version, served.epoch) {
            return None;
        }
        let from = std::mem::replace(&mut self.model, ModelName::from(served));
        let is_kept = self.rooms == served.model.places();
        if !is_kept {
            self.filter = None;
            self.rooms = served.model.places().to_vec();
        }
        let changed = ModelChanged {
            from,
            to: self.model.clone(),
            epoch: served.epoch,
            first_seq,
            filter: if is_kept { FilterChange::Kept } else { FilterChange::Reset },
            rooms: self.rooms.clone(),
        };
        Some(text(&ServerMessage::ModelChanged(Box::new(changed))))
    }

    fn filtered(&mut self, frame: &Accepted, seen: &Seen, settings: &StreamSettings) -> Option<Filtered> {
        let Some(wanted) = settings.filter else {
            self.filter = None;
            return None;
        };
        let model = &seen.served.model;
        let at = Moment { captured_at_ns: frame.captured_at_ns, arrived: frame.arrived };
        let same = self.filter.take().filter(|belief| belief.settings == wanted);
        let mut belief = same.unwrap_or_else(|| Belief {
            // What is no trust was refused when the stream was configured.
            filter: RoomFilter::new(model.places().len(), Trust::try_from(wanted.trust).unwrap_or_default()),
            settings: wanted,
            at,
        });
        let elapsed = at.since(belief.at).as_secs_f64();
        belief.at = at;
        belief.filter.update(model.transitions(), elapsed, &seen.recognition.probabilities);
        let place_idx = belief.filter.place_idx();
        let filtered = Filtered {
            room: model.places()[place_idx].clone(),
            probability: belief.filter.belief()[place_idx],
            probabilities: api::rooms(model.places(), belief.filter.belief(), settings.top),
        };
        self.filter = Some(belief);
        Some(filtered)
    }
}

impl Moment {
    /// The time from an earlier moment, by the robot's clock where both have it; never negative.
    fn since(self, earlier: Self) -> Duration {
        match (earlier.captured_at_ns, self.captured_at_ns) {
            (Some(earlier), Some(now)) => Duration::from_nanos(now.saturating_sub(earlier)),
            _ => self.arrived.saturating_duration_since(earlier.arrived),
        }
    }
}

/// How long ago, by our clock; negative where the robot's clock is ahead.
fn age_ms(captured_at_ns: u64) -> f64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos() as f64;
    ((now - captured_at_ns as f64) / 1e3).round() / 1e3
}
