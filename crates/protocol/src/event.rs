//! What dashboards are told: events as they happen, and who streams.

use super::rest::{Answer, ModelName, RoomProbability, TimingsMs};
use super::stream::{DropReason, Mode, StreamResult};
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

/// All robots that stream.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RobotList {
    /// The stream that began first comes first.
    pub robots: Vec<RobotInfo>,
}

/// A robot that streams.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RobotInfo {
    /// Its stream and its name.
    #[serde(flatten)]
    pub name: RobotName,
    /// The name of the key that opened it, where the service has keys.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub key: Option<String>,
    /// Whether its connection stands; a stream without one can be resumed for a while.
    pub connected: bool,
    /// For how long it has been streaming, in seconds.
    pub streaming_s: f64,
    /// How it streams.
    pub mode: Mode,
    /// Its room: of the stream's filter where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub room: Option<String>,
    /// Whether that room is one to act on.
    #[serde(default)]
    pub known: bool,
    /// How probable it is that the robot is in a place that was never trained, 0 to 1; left out where the model cannot tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub novelty: Option<f32>,
    /// For how long it has been in the room, in seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_room_s: Option<f64>,
    /// What became of its frames.
    pub frames: FrameCounts,
    /// Its last answers, the newest first.
    pub answers: Vec<PastAnswer>,
}

/// What became of a stream's frames.
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
