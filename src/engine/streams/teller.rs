//! What a stream says of the frames that were recognized: the frame's own answer, the filter's, and that the
//! model changed. And what it has said, for a robot that comes back.

use super::belief::Belief;
use super::kept::Kept;
use super::ledger::Accepted;
use super::message::text;
use super::moment::{Elapsed, Moment};
use super::token::{Standing, Told, digest_of};
use crate::engine::Engine;
use crate::engine::answer::answer;
use crate::engine::doubts::OtherRooms;
use crate::engine::recognize::Seen;
use crate::engine::registry::ServedModel;
use crate::engine::robots::RobotRecord;
use crate::engine::timings::ms;
use crate::engine::told::by_probability;
use crate::settings::Settings;
use roomsight_protocol::event::AnswerEvent;
use roomsight_protocol::header::Odometry;
use roomsight_protocol::rest::{ModelName, RecognizeQuery};
use roomsight_protocol::stream::{
    FilterChange, Filtered, ModelChanged, Notice, NoticeKind, ServerMessage, StreamResult, StreamSettings,
};
use roomsight_recognition::filter::{Interval, RoomFilter, Trust};
use roomsight_recognition::model::Pose;
use tokio_tungstenite::tungstenite::Utf8Bytes;

/// What a stream says, and has said.
pub struct Teller {
    /// The stream's public name.
    stream: String,
    /// The model of the last answer. Only its name is kept, so that a stream that rests does not keep a model
    /// in memory.
    model: ModelName,
    rooms: Vec<String>,
    filter: Option<Belief>,
    /// The room of the last frame and the filter's were known, and the same.
    is_sure: bool,
    /// The frames' stamps were found to be doubtful, and that was told.
    doubts_stamps: bool,
    kept: Kept,
}

/// A frame that the filter took in.
struct Step {
    told: Filtered,
    /// Since the frame before it.
    elapsed: Elapsed,
}

impl Teller {
    /// Of a stream whose frames this model will answer.
    pub fn new(stream: String, served: &ServedModel, settings: &Settings) -> Self {
        let (model, rooms) = (ModelName::from(served), served.model.rooms().to_vec());
        let kept = Kept::new(settings);
        Self { stream, model, rooms, filter: None, is_sure: false, doubts_stamps: false, kept }
    }

    /// Of a stream that has told so much elsewhere.
    pub fn restored(stream: String, served: &ServedModel, settings: &Settings, told: Told) -> Self {
        let new = Self::new(stream, served, settings);
        if told.rooms_digest != digest_of(&new.rooms) {
            return Self { doubts_stamps: told.doubts_stamps, ..new };
        }
        let is_same_model = (&told.model.name, told.model.version) == (&served.name, served.version);
        Self {
            // An epoch is the process's own.
            model: if is_same_model { new.model } else { told.model },
            filter: told.belief.and_then(|belief| belief.opened(new.rooms.len())),
            is_sure: told.is_sure,
            doubts_stamps: told.doubts_stamps,
            ..new
        }
    }

    /// What it has told, for another process.
    pub fn told(&self) -> Told {
        Told {
            model: self.model.clone(),
            rooms_digest: digest_of(&self.rooms),
            belief: self.filter.as_ref().map(Belief::sealed),
            is_sure: self.is_sure,
            doubts_stamps: self.doubts_stamps,
        }
    }

    /// Whether its filter has taken in a frame.
    pub fn believes(&self) -> bool {
        self.filter.is_some()
    }

    /// The model of the last answer.
    pub fn model(&self) -> &ModelName {
        &self.model
    }

    /// The rooms that it tells apart.
    pub fn rooms(&self) -> &[String] {
        &self.rooms
    }

    /// Whether the room of the last frame and the filter's were known, and the same.
    pub fn is_sure(&self) -> bool {
        self.is_sure
    }

    /// What is said of a frame that was recognized; dashboards hear it too. The stream stood so before, where
    /// its robot is to keep how it stands.
    pub fn result(
        &mut self,
        frame: &Accepted,
        seen: Seen,
        settings: &StreamSettings,
        engine: &Engine,
        record: &RobotRecord,
        standing: Option<Standing>,
    ) -> Vec<Utf8Bytes> {
        let mut said: Vec<Utf8Bytes> = self.changed_model(frame.seq, &seen.served).into_iter().collect();
        let filtered = self.filtered(frame, &seen, settings);
        let is_sure = |told: &Filtered| told.known && seen.recognition.known && told.room == seen.room();
        self.is_sure = filtered.as_ref().is_some_and(|filtered| is_sure(&filtered.told));
        let notice = filtered.as_ref().and_then(|filtered| self.notice(filtered.elapsed));
        let query =
            RecognizeQuery { robot: settings.robot.clone(), top: settings.top, ..RecognizeQuery::default() };
        if let Some(doubtable) = &seen.doubtable {
            let room = filtered.as_ref().map(|filtered| filtered.told.room.clone());
            let others = OtherRooms { filtered: room, ..OtherRooms::default() };
            engine.doubts.consider(doubtable, seen.doubted_answer(), others);
        }
        let answer = answer(seen, &query, &self.stream);
        let filtered = filtered.map(|filtered| filtered.told);
        let age_ms = Moment::of(frame).age_ms();
        let standing = standing.map(|standing| Standing { told: self.told(), ..standing });
        let resume = standing.and_then(|standing| engine.streams.tokens.seal(&standing, record.key()));
        let result = StreamResult { seq: frame.seq, answer, filtered, age_ms, notice, resume };
        let latency_ms = ms(frame.arrived.elapsed());
        engine.robots.answered_in_stream(record, &result, latency_ms);
        engine.recordings.answer(record, &result.answer, result.filtered.as_ref());
        engine.events.answered(|| AnswerEvent::of_stream(&self.stream, &result, latency_ms));
        said.push(text(&ServerMessage::Result(Box::new(result))));
        said
    }

    /// Keeps a message about a frame for a robot that comes back.
    pub fn keep(&mut self, seq: u64, message: &Utf8Bytes) {
        self.kept.keep(seq, message);
    }

    /// The kept messages about frames after this one, or all of them.
    pub fn told_after(&self, last_seq: Option<u64>) -> Vec<Utf8Bytes> {
        self.kept.after(last_seq)
    }

    /// Says that another model answers from this frame on, if it does.
    fn changed_model(&mut self, first_seq: u64, served: &ServedModel) -> Option<Utf8Bytes> {
        let ModelName { name, version, epoch, .. } = &self.model;
        if (name, *version, *epoch) == (&served.name, served.version, served.epoch) {
            return None;
        }
        let from = std::mem::replace(&mut self.model, ModelName::from(served));
        let is_kept = self.rooms == served.model.rooms();
        if !is_kept {
            self.filter = None;
            self.rooms = served.model.rooms().to_vec();
        } else if let Some(belief) = &mut self.filter
            && !served.model.tells_new_places()
        {
            belief.filter.forget_elsewhere();
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

    /// Says once that the filter does without the frames' stamps.
    fn notice(&mut self, elapsed: Elapsed) -> Option<Notice> {
        if self.doubts_stamps || !elapsed.is_doubtful {
            return None;
        }
        self.doubts_stamps = true;
        let detail = "the times of capture stand still, run backwards, are zero or leap by more than an hour: the \
            filter takes the times at which such frames arrive; send nanoseconds since 1970 that grow from frame \
            to frame, or no time";
        tracing::warn!(stream = self.stream, detail, "the stamps of a stream are doubtful");
        Some(Notice { kind: NoticeKind::Stamps, detail: detail.to_owned() })
    }

    fn filtered(&mut self, frame: &Accepted, seen: &Seen, settings: &StreamSettings) -> Option<Step> {
        let Some(wanted) = settings.filter else {
            self.filter = None;
            return None;
        };
        let model = &seen.served.model;
        let at = Moment::of(frame);
        let same = self.filter.take().filter(|belief| belief.settings == wanted);
        let elapsed = same.as_ref().map_or_else(Elapsed::default, |belief| at.since(belief.at));
        let mut belief = same.unwrap_or_else(|| Belief {
            // What is no trust was refused when the stream was configured.
            filter: RoomFilter::new(model.rooms().len(), Trust::try_from(wanted.trust).unwrap_or_default()),
            settings: wanted,
            at,
            odometry: None,
        });
        belief.at = at;
        let odometry = frame.odometry.map(|Odometry { x, y, heading }| Pose { x, y, angle: heading });
        let since = Interval::between(elapsed.time.as_secs_f64(), belief.odometry, odometry);
        belief.odometry = odometry;
        belief.filter.update(model.transitions(), since, seen.recognition.observation());
        let room_idx = belief.filter.room_idx();
        let told = Filtered {
            room: model.rooms()[room_idx].clone(),
            known: model.knows(&belief.filter),
            novelty: belief.filter.novelty(),
            probability: belief.filter.belief()[room_idx],
            probabilities: by_probability(model.rooms(), belief.filter.belief(), settings.top),
        };
        self.filter = Some(belief);
        Some(Step { told, elapsed })
    }
}
