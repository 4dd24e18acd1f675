//! The messages of a stream: `roomsight.v1`, one WebSocket a robot.
//!
//! Text messages are JSON objects that name their `type`; a binary message is a frame, with or without a
//! [header](super::header). Every accepted frame gets exactly one of `result`, `dropped` or `error` with its
//! `seq`, in increasing order of `seq`.

use super::rest::{Answer, ModelName, ProblemBody, RoomProbability};
use serde::{Deserialize, Serialize};
#[cfg(feature = "schema")]
use utoipa::{IntoParams, ToSchema};

/// The subprotocol that both sides name.
pub const SUBPROTOCOL: &str = "roomsight.v1";

/// What begins the subprotocol that carries a key, for browsers, which cannot set `Authorization`.
pub const KEY_SUBPROTOCOL_PREFIX: &str = "key.";

/// How a stream begins, or goes on.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", into_params(parameter_in = Query))]
pub struct StreamQuery {
    /// The `session` of the stream to resume, as `hello` told it; with the key that opened the stream, where keys
    /// are asked for. Where it is over, a new one begins.
    pub session: Option<String>,
    /// The last frame whose answer arrived, left out where none did; the answers after it that are still kept
    /// are sent again.
    pub last_seq: Option<u64>,
    /// The last `resume` that arrived. With it the stream goes on, filter and all, also on a service that never had it, or has
    /// forgotten it; with the key that opened the stream, where keys are asked for.
    pub resume: Option<String>,
    /// With `resume`: the last frame that was sent. Frames that no answer came to are told as lost up to this one.
    pub sent_seq: Option<u64>,
    /// Who streams.
    #[cfg_attr(feature = "schema", param(example = "wall-e", max_length = 64))]
    pub robot: Option<String>,
    /// The name of the model that answers; left out: the default one.
    pub model: Option<String>,
    /// What happens to frames that come faster than they are answered.
    #[cfg_attr(feature = "schema", param(inline))]
    pub mode: Option<Mode>,
    /// With the mode `sampled`: the least time between two frames that are looked at.
    pub interval_ms: Option<u64>,
    /// With the mode `sampled`: the same while the filter is sure of the room, and the frames are, too.
    pub sure_interval_ms: Option<u64>,
    /// Whether to filter the rooms over time; left out: yes.
    pub filter: Option<bool>,
    /// How long a frame may wait before it is looked at.
    pub deadline_ms: Option<u64>,
    /// How many of the most probable rooms to name; left out: all.
    pub top: Option<usize>,
    /// Whether to tell why a room was answered, which takes longer; left out: no.
    pub explain: Option<bool>,
}

impl StreamQuery {
    /// What it configures.
    pub fn change(&self) -> Configure {
        Configure {
            robot: self.robot.clone(),
            model: self.model.clone(),
            mode: self.mode,
            interval_ms: self.interval_ms,
            sure_interval_ms: self.sure_interval_ms,
            filter: self.filter.map(FilterChoice::Switch),
            deadline_ms: self.deadline_ms,
            top: self.top,
            explain: self.explain,
        }
    }
}

/// What a robot sends as text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ClientMessage {
    /// Changes the stream.
    Configure(Configure),
}

/// How the stream shall go on. What is left out stays as it is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Configure {
    /// Who streams.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(max_length = 64))]
    pub robot: Option<String>,
    /// The name of the model that answers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// What happens to frames that come faster than they are answered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mode: Option<Mode>,
    /// With the mode `sampled`: the least time between two frames that are looked at.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 3_600_000))]
    pub interval_ms: Option<u64>,
    /// With the mode `sampled`: the least time between two frames that are looked at while the filter's room and that of the last frame
    /// are known, and the same; not below `interval_ms`. 0: the same as always. It takes the filter.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(maximum = 3_600_000))]
    pub sure_interval_ms: Option<u64>,
    /// The filter over the rooms: whether there is one, or how it weighs frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub filter: Option<FilterChoice>,
    /// How long a frame may wait before it is looked at; 0: for ever.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deadline_ms: Option<u64>,
    /// How many of the most probable rooms to name; 0: all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub top: Option<usize>,
    /// Whether to tell why a room was answered: the keypoints that spoke for it, the training frames that are most like the frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub explain: Option<bool>,
}

/// What happens to frames that come faster than they are answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// One frame waits; a newer one takes its place before it is decoded.
    #[default]
    Latest,
    /// None is replaced. Beyond the window the service stops reading, so that TCP holds the sender back.
    Lossless,
    /// As `latest`, and at most one frame an interval is looked at.
    Sampled,
}

/// The filter of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(untagged)]
pub enum FilterChoice {
    /// Whether there is one.
    Switch(bool),
    /// There is one.
    With(FilterSettings),
}

/// How the filter weighs frames.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(deny_unknown_fields)]
pub struct FilterSettings {
    /// How much one frame counts, above 0 to 10: lower is steadier and later to notice a change of room. Streams
    /// that say nothing of the filter have the default.
    #[cfg_attr(feature = "schema", schema(default = default_trust, exclusive_minimum = 0, maximum = 10))]
    pub trust: f32,
}

impl Default for FilterSettings {
    fn default() -> Self {
        Self { trust: default_trust() }
    }
}

/// What the filter of the recognition core believes a frame by default.
fn default_trust() -> f32 {
    2.0
}

/// How a stream is configured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct StreamSettings {
    /// Who streams.
    pub robot: Option<String>,
    /// The name of the model that answers.
    pub model: String,
    /// What happens to frames that come faster than they are answered.
    pub mode: Mode,
    /// With the mode `sampled`: the least time between two frames that are looked at.
    pub interval_ms: Option<u64>,
    /// The same while the filter and the last frame are sure of one room.
    #[serde(default)]
    pub sure_interval_ms: Option<u64>,
    /// The filter, if there is one.
    pub filter: Option<FilterSettings>,
    /// How long a frame may wait before it is looked at.
    pub deadline_ms: Option<u64>,
    /// How many of the most probable rooms are named.
    pub top: Option<usize>,
    /// Whether it is told why a room was answered.
    #[serde(default)]
    pub explain: bool,
}

/// What the service sends, always as text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ServerMessage {
    /// The stream begins, or goes on.
    Hello(Box<Hello>),
    /// The stream is configured so from the next frame on.
    Configured {
        /// All of it.
        settings: StreamSettings,
    },
    /// Which room a frame shows.
    Result(Box<StreamResult>),
    /// A frame was not looked at.
    Dropped {
        /// Which frame.
        seq: u64,
        /// Why.
        reason: DropReason,
    },
    /// A frame, or a text message, could not be used. The stream lives on.
    Error {
        /// Which frame; left out where it is no accepted frame.
        #[serde(skip_serializing_if = "Option::is_none")]
        seq: Option<u64>,
        /// What is wrong.
        problem: ProblemBody,
    },
    /// From a frame on, another model answers.
    ModelChanged(Box<ModelChanged>),
    /// The service stops: frames are no longer read, and the stream closes when all are answered.
    Draining,
}

/// The first message of a connection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct Hello {
    /// `roomsight.v1`.
    pub protocol: String,
    /// Keep it secret: who has it can go on with the stream. A connection that breaks is resumed with
    /// `?session=SESSION&last_seq=SEQ`, SEQ being the last frame whose answer arrived.
    pub session: String,
    /// The stream's public name, as dashboards and log lines have it; nobody can resume the stream by it.
    pub stream: String,
    /// Whether this is a stream that goes on. Answers after `last_seq` follow at once: all that were told since
    /// the connection broke, and of those before at least the last `limits.window`. From a `resume` there are none: frames
    /// without an answer are told as lost.
    pub resumed: bool,
    /// What became of the filter, where the stream goes on from a `resume`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filter: Option<FilterChange>,
    /// As in results: what the stream goes on from before the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resume: Option<String>,
    /// The number of the next frame that brings none.
    pub next_seq: u64,
    /// How the stream is configured.
    pub settings: StreamSettings,
    /// What it is limited to.
    pub limits: StreamLimits,
    /// The modes there are.
    pub modes: Vec<Mode>,
    /// The model that answers now.
    pub model: ModelName,
    /// The rooms it tells apart.
    pub rooms: Vec<String>,
}

/// What a stream is limited to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct StreamLimits {
    /// The longest message.
    pub max_frame_bytes: usize,
    /// The most pixels in a frame.
    pub max_frame_pixels: u64,
    /// The most frames without an answer in the mode `lossless`.
    pub window: usize,
    /// A connection over which no byte comes, not even an answer to a ping, is closed after this.
    pub idle_timeout_ms: u64,
    /// How long a message may take to come in, without the time in which the service does not read on.
    pub message_timeout_ms: u64,
    /// How long a stream without a connection can be resumed.
    pub resume_ms: u64,
}

/// Which room a frame shows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct StreamResult {
    /// Which frame.
    pub seq: u64,
    /// What the frame says by itself. Its `request_id` is the stream's public name.
    #[serde(flatten)]
    pub answer: Answer,
    /// What the frames so far say together, where there is a filter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub filtered: Option<Filtered>,
    /// From capture to answer, where the frame was dated; negative where the robot's clock is ahead. Left out
    /// where it would be more than an hour: then the robot has a clock of its own, and the age means nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub age_ms: Option<f64>,
    /// Something about the stream that its robot's developer should know; each is told once a stream.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub notice: Option<Notice>,
    /// How the stream stands after this answer, sealed. Keep the last one secret: with `?resume=RESUME&last_seq=SEQ&sent_seq=SEQ`
    /// any service with the same `resume_keys` goes on with the stream. Left out where there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resume: Option<String>,
}

/// Something about a stream that its robot's developer should know.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct Notice {
    /// Which, for programs.
    pub kind: NoticeKind,
    /// What it means and what to do about it, for people.
    pub detail: String,
}

/// What a notice is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum NoticeKind {
    /// The frames' times of capture stand still, run backwards, are zero or leap by more than an hour: the filter
    /// takes the times at which such frames arrived.
    Stamps,
}

/// The filter's answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct Filtered {
    /// The most probable room.
    pub room: String,
    /// Whether the frames up to now say clearly that the robot is in that room; do not act on the room where false.
    #[serde(default)]
    pub known: bool,
    /// The probability that the robot is in a place that the model was never trained on, 0 to 1; left out where the model
    /// cannot tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub novelty: Option<f32>,
    /// The room's probability, 0 to 1, if the robot is in one of the rooms.
    pub probability: f32,
    /// The rooms with their probabilities, the most probable first.
    pub probabilities: Vec<RoomProbability>,
}

/// Why a frame was not looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum DropReason {
    /// A newer frame took its place.
    Superseded,
    /// It waited longer than its deadline.
    Deadline,
    /// The service has no memory for it. Never in the mode `lossless`.
    Overload,
    /// The service stops.
    Draining,
    /// The service that had accepted it is gone; told by the one that goes on with the stream.
    Lost,
}

/// From a frame on, another model answers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct ModelChanged {
    /// What answered until now.
    pub from: ModelName,
    /// What answers from now on.
    pub to: ModelName,
    /// The epoch of `to`.
    pub epoch: u64,
    /// The first frame that it answers.
    pub first_seq: u64,
    /// What became of the filter.
    pub filter: FilterChange,
    /// The rooms that `to` tells apart.
    pub rooms: Vec<String>,
}

/// What became of the filter when the model changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum FilterChange {
    /// The rooms are the same: it goes on.
    Kept,
    /// The rooms differ: it knows nothing yet.
    Reset,
}
