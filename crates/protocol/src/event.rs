//! What dashboards are told: events as they happen, and who streams.

use super::rest::{Answer, ModelName, RoomProbability, TimingsMs, Unknown};
use super::stream::{DropReason, Mode, StreamResult};
use super::training::TrainingState;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
#[cfg(feature = "schema")]
use utoipa::ToSchema;

/// Something that happened, as the data of a server-sent event; the event's name is `type`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Event {
    /// A frame was answered.
    Answer(Box<AnswerEvent>),
    /// A robot's stream began, or was resumed.
    RobotJoined(RobotName),
    /// A robot's connection ended; its stream can be resumed for a while.
    RobotLeft(RobotName),
    /// Another version of a model serves.
    ModelChanged {
        /// What serves from now on.
        to: ModelName,
    },
    /// Another version of a model was to serve, and does not: what served serves on.
    SwapFailed {
        /// The model's name.
        model: String,
        /// What was to be done: activate, rollback, latest (a new version came), label or unload.
        change: String,
        /// Why it was not.
        reason: String,
    },
    /// A robot's answers have been unknown for longer than the setting `lost_after_ms`.
    RobotLost(RobotLost),
    /// A robot that was lost is in a room again.
    RobotFound(RobotFound),
    /// A robot's known answers name another room than before.
    RoomChanged(RoomChange),
    /// A training began or ended.
    Training {
        /// Its number.
        id: i64,
        /// The model's name.
        model: String,
        /// How far it has come.
        state: TrainingState,
    },
    /// Frames came into the inbox, got labels, or went.
    InboxChanged {
        /// How many have no label now.
        open: u64,
    },
    /// A data set was changed.
    SetChanged {
        /// Its name.
        set: String,
    },
    /// This reader was too slow: the oldest events that it had not read are gone.
    Lost {
        /// How many.
        events: u64,
    },
}

/// Whose stream.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RobotName {
    /// The stream, by its public name.
    pub stream: String,
    /// The robot, where it has said so, else the name of its key.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
}

/// A frame that was answered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct AnswerEvent {
    /// The robot, where known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
    /// The stream, by its public name; left out for a single request.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stream: Option<String>,
    /// The room: of the stream's filter where there is one.
    pub room: String,
    /// Its probability.
    pub probability: f32,
    /// The rooms with their probabilities, the most probable first.
    pub probabilities: Vec<RoomProbability>,
    /// Whether the room is one to act on, for the stream's filter where there is one.
    pub known: bool,
    /// How probable it is that the place was never trained, 0 to 1; left out where the model cannot tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub novelty: Option<f32>,
    /// From the frame's arrival to its answer, in milliseconds.
    pub latency_ms: f64,
}

impl AnswerEvent {
    /// Of a frame that was answered by itself, `latency_ms` after it arrived.
    pub fn of_frame(answer: &Answer, latency_ms: f64) -> Self {
        Self {
            robot: answer.robot.clone(),
            stream: None,
            room: answer.room.clone(),
            probability: answer.probability,
            probabilities: answer.probabilities.clone(),
            known: answer.known,
            novelty: answer.novelty,
            latency_ms,
        }
    }

    /// Of a frame of a stream.
    pub fn of_stream(stream: &str, result: &StreamResult, latency_ms: f64) -> Self {
        let of_frame = Self::of_frame(&result.answer, latency_ms);
        let stream = Some(stream.to_owned());
        match &result.filtered {
            None => Self { stream, ..of_frame },
            Some(filtered) => Self {
                stream,
                room: filtered.room.clone(),
                known: filtered.known,
                novelty: filtered.novelty,
                probability: filtered.probability,
                probabilities: filtered.probabilities.clone(),
                ..of_frame
            },
        }
    }
}

/// A robot that does not know where it is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RobotLost {
    /// Which robot.
    #[serde(flatten)]
    pub who: RobotId,
    /// When its answers began to be unknown.
    pub since: String,
}

/// A robot that knows again where it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RobotFound {
    /// Which robot.
    #[serde(flatten)]
    pub who: RobotId,
    /// Where it is.
    pub room: String,
    /// For how long its answers were unknown, in seconds.
    pub lost_s: f64,
}

/// A robot that came to another room.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RoomChange {
    /// Which robot.
    #[serde(flatten)]
    pub who: RobotId,
    /// The room that its known answers named before; left out where there was none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
    /// The room that they name now.
    pub to: String,
}

/// Which robot something is about.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RobotId {
    /// What it is found under: its name, or its stream's where it has none or another stream has taken the name.
    pub id: String,
    /// The robot, where it has said so, else the name of its key.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
    /// Its stream, by its public name; left out where it sends requests.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stream: Option<String>,
}

/// What brings a robot's frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "lowercase")]
pub enum Via {
    /// A stream.
    Stream,
    /// Requests that name the robot.
    Rest,
}

/// All robots.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RobotList {
    /// In the order of their ids.
    pub robots: Vec<RobotInfo>,
}

/// What changed since the update before, as the data of a server-sent event `live`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct LiveUpdate {
    /// When this was so.
    pub at: String,
    /// The robots that changed; all of them in the first update and in one that makes up for lost ones.
    pub robots: Vec<RobotState>,
    /// The ids under which no robot is found any more.
    pub gone: Vec<String>,
    /// How many updates this reader lost before this one, since it was slow.
    pub lost_events: u64,
}

/// A robot as it is now.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RobotState {
    /// Its name and its stream.
    #[serde(flatten)]
    pub who: RobotId,
    /// The service that it is connected to, where those of several are told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub service: Option<String>,
    /// What brings its frames.
    pub via: Via,
    /// The name of its key, where the service has keys.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub key: Option<String>,
    /// Whether its connection stands, or it has sent a request lately.
    pub connected: bool,
    /// How long ago something was heard of it, in seconds.
    pub last_seen_s: f64,
    /// Its room: of the stream's filter where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub room: Option<String>,
    /// Whether that room is one to act on.
    #[serde(default)]
    pub known: bool,
    /// Why it is not, where the last frame says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unknown: Option<Unknown>,
    /// How probable it is that the robot is in a place that was never trained, 0 to 1; left out where the model cannot tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub novelty: Option<f32>,
    /// The room's probability.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probability: Option<f32>,
    /// The most probable rooms, at most five, the most probable first.
    #[serde(default)]
    pub probabilities: Vec<RoomProbability>,
    /// For how long the answers have named this room, in seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub in_room_s: Option<f64>,
    /// Whether it does not know where it is.
    pub lost: bool,
    /// For how long its answers have been unknown, in seconds; left out where it is not lost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lost_s: Option<f64>,
    /// Frames that it sends, a second, over the last ones.
    pub frames_per_s: f64,
    /// How old the last frame was when it was answered, by the robot's clock, in milliseconds; left out where that is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub age_ms: Option<f64>,
    /// From the last frame's arrival to its answer, in milliseconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency_ms: Option<f64>,
    /// What became of its frames.
    pub frames: FrameCounts,
    /// The number of its last frame, where that is kept: `/v1/robots/{id}/frame`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<u64>,
    /// The model of its last answer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<ModelName>,
}

/// All that is told of one robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RobotInfo {
    /// As it is now.
    #[serde(flatten)]
    pub state: RobotState,
    /// How it streams; left out where it sends requests.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mode: Option<Mode>,
    /// For how long it has been streaming, in seconds; left out where it sends requests.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub streaming_s: Option<f64>,
    /// Its last answers, the newest first.
    pub answers: Vec<PastAnswer>,
    /// Where it was in the last ten minutes, the oldest first.
    #[serde(default)]
    pub ribbon: Vec<Stay>,
}

/// A time in which a robot's answers named one room.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct Stay {
    /// The room.
    pub room: String,
    /// Whether it was one to act on.
    pub known: bool,
    /// When the first of these answers was given.
    pub from: String,
    /// When the last of them was.
    pub until: String,
}

/// What became of a robot's frames.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct FrameCounts {
    /// Taken in.
    pub accepted: u64,
    /// Answered with a room.
    pub results: u64,
    /// Answered with an error.
    pub errors: u64,
    /// Not looked at, by reason.
    #[cfg_attr(feature = "schema", schema(value_type = std::collections::HashMap<String, u64>))]
    pub dropped: BTreeMap<DropReason, u64>,
}

/// An answer of a while ago.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct PastAnswer {
    /// Which frame.
    pub seq: u64,
    /// The room: of the stream's filter where there is one.
    pub room: String,
    /// Whether it was one to act on.
    #[serde(default)]
    pub known: bool,
    /// Its probability.
    pub probability: f32,
    /// Where the time went.
    pub timings_ms: TimingsMs,
    /// How long ago, in seconds.
    pub ago_s: f64,
}
