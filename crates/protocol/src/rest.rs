//! What travels over REST, as JSON.

use crate::scan::LaserScan;
use crate::version_id::version_number;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use std::borrow::Cow;
#[cfg(feature = "schema")]
use utoipa::{IntoParams, ToSchema};

/// A frame for examples: a checkerboard of 16 x 16 pixels, a PNG in base64.
pub const EXAMPLE_FRAME: &str = "iVBORw0KGgoAAAANSUhEUgAAABAAAAAQCAAAAAA6mKC9AAAAG0lEQVR42mOwAYITQACjGcgQQOaAaHIEBok7ABUbgg\
    Gc36zkAAAAAElFTkSuQmCC";

/// What a caller may ask about a frame.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", into_params(parameter_in = Query))]
pub struct RecognizeQuery {
    /// The model that answers; left out: the default one.
    pub model: Option<String>,
    /// Its version, a whole number without sign and leading zeros; left out: the one that serves.
    #[serde(default, deserialize_with = "version_from_text")]
    pub version: Option<u64>,
    /// The label its version carries, instead of `version`.
    #[cfg_attr(feature = "schema", param(example = "stable"))]
    pub label: Option<String>,
    /// Who asks. Sent back, and in the log.
    #[cfg_attr(feature = "schema", param(example = "wall-e", max_length = 64))]
    pub robot: Option<String>,
    /// When the frame was taken: a date and a time (RFC 3339, or ISO 8601 without an offset), or a number
    /// since 1970, in seconds or parts of them. Sent back as it came.
    #[cfg_attr(feature = "schema", param(example = "2030-01-31T12:00:00.250Z", max_length = 64))]
    pub captured_at: Option<String>,
    /// How long after the arrival of the request the frame may wait before it is looked at.
    #[cfg_attr(feature = "schema", param(example = 200))]
    pub deadline_ms: Option<u64>,
    /// How many of the most probable rooms to name; left out: all.
    #[cfg_attr(feature = "schema", param(minimum = 1, example = 3))]
    pub top: Option<usize>,
    /// Whether to tell why: which keypoints spoke for and against the room, and which training frames are most like the
    /// frame.
    #[serde(default)]
    pub explain: bool,
}

/// A frame as JSON.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", schema(example = json!({"frame": EXAMPLE_FRAME})))]
pub struct FrameJson<'a> {
    /// The image in base64, in any of the usual ways of writing it: in lines or not, with or without `=` at its
    /// end, in the alphabet for addresses, with a `data:image/...;base64,` before it.
    #[serde(borrow)]
    #[cfg_attr(feature = "schema", schema(min_length = 2))]
    pub frame: Cow<'a, str>,
    /// What the robot's laser measured beside it, for models that look at that.
    #[serde(default)]
    pub scan: Option<LaserScan>,
}

/// Which room a frame shows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({
    "room": "kitchen", "known": true, "novelty": 0.07, "probability": 0.83,
    "probabilities": [{"room": "kitchen", "probability": 0.83}, {"room": "corridor", "probability": 0.17}],
    "model": {"name": "lab", "version": 1, "epoch": 1, "digest": "5f0c2a9be1d34c77"},
    "keypoints": 182,
    "timings_ms": {"queue": 0.05, "decode": 1.9, "features": 2.4, "classify": 0.3},
    "request_id": "7d1f3c0a9b2e4d58", "robot": "wall-e"
})))]
pub struct Answer {
    /// The most probable room.
    pub room: String,
    /// Whether the answer is trusted and the place is one of those trained: such answers were right as often as the model
    /// promises when it was validated. Do not act on the room where false.
    pub known: bool,
    /// Why it is not known; left out where it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unknown: Option<Unknown>,
    /// How probable it is that the frame shows a place that was never trained, 0 to 1, as if every other frame did; left
    /// out where the model cannot tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub novelty: Option<f32>,
    /// The room's probability, 0 to 1, if the place is one of those trained.
    pub probability: f32,
    /// The rooms with their probabilities, the most probable first; all of them sum to 1.
    pub probabilities: Vec<RoomProbability>,
    /// The model that answered.
    pub model: ModelName,
    /// The number of keypoints the answer rests on; few say little.
    pub keypoints: usize,
    /// Rows of the frame that did not arrive, or not whole: they were taken to be gray. Left out where all
    /// did.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub damaged_rows: usize,
    /// Where the time went.
    pub timings_ms: TimingsMs,
    /// The request, as in the header `X-Request-Id` and the log.
    pub request_id: String,
    /// The robot, as sent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
    /// When the frame was taken, as sent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub captured_at: Option<String>,
    /// Where asked for: the keypoints that spoke for and against the room, strongest first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evidence: Option<Vec<KeypointEvidence>>,
    /// Where asked for: the training frames that are most like it, as each opinion of the model sees them, the nearest first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nearest: Option<Vec<NearestFrame>>,
    /// Where asked for, of models whose training frames came with poses: where the frame was taken, more or less.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<FramePose>,
}

/// Why an answer is not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Unknown {
    /// No room is probable enough.
    Unsure,
    /// It looks like no place that was trained.
    NewPlace,
    /// There is nothing to see in the frame.
    NoDetail,
    /// The frame is too dark to see anything.
    Dark,
    /// Something is before the lens.
    Covered,
}

impl Unknown {
    /// As JSON has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Unsure => "unsure",
            Self::NewPlace => "new_place",
            Self::NoDetail => "no_detail",
            Self::Dark => "dark",
            Self::Covered => "covered",
        }
    }
}

fn is_zero(number: &usize) -> bool {
    *number == 0
}

/// A room and its probability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RoomProbability {
    /// The room.
    pub room: String,
    /// Its probability, 0 to 1.
    pub probability: f32,
}

/// The model that answered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct ModelName {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: u64,
    /// The model's epoch when this version came to serve: it grows with every change of what serves.
    pub epoch: u64,
    /// The first 16 digits of its BLAKE3 digest.
    pub digest: String,
}

/// Where the time of one frame went, in milliseconds. Also in the header `Server-Timing`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct TimingsMs {
    /// Waiting for a thread.
    pub queue: f64,
    /// Bytes to pixels.
    pub decode: f64,
    /// Pixels to described keypoints.
    pub features: f64,
    /// Keypoints to probabilities.
    pub classify: f64,
}

/// One keypoint's share in an answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct KeypointEvidence {
    /// Column in the frame as sent, in pixels.
    pub x: f32,
    /// Row in the frame as sent, in pixels.
    pub y: f32,
    /// The opinion of the model that saw it.
    #[serde(default)]
    pub opinion: String,
    /// The word of the opinion's vocabulary that it was assigned to; left out where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub word: Option<usize>,
    /// The training frame that has something like it, by its path among those; left out where that is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<String>,
    /// Its contribution to the opinion's decision value of the room; negative speaks against it.
    pub weight: f32,
}

/// A training frame that is like the frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct NearestFrame {
    /// The opinion of the model that finds it so.
    pub opinion: String,
    /// The training frame, by its path among those; empty where that is not known.
    pub frame: String,
    /// The drive that it comes from; empty where that is not known.
    pub drive: String,
    /// The room that it shows.
    pub room: String,
    /// How near it is, 1 being the same: the share of the frame's keypoints that found it, or the cosine between what the
    /// opinion sees of both.
    pub nearness: f32,
    /// The keypoints that found it, as column and row in the frame as sent, in pixels.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<[f32; 2]>,
}

/// Where a frame was taken, more or less, in the coordinates of the training drives.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct FramePose {
    /// Meters.
    pub x: f64,
    /// Meters.
    pub y: f64,
    /// Heading in radians, counterclockwise from the x axis.
    pub angle: f64,
    /// How far apart the frames lie that say so, in meters; the larger, the less sure.
    pub radius: f64,
}

/// The answers to a batch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct BatchAnswer {
    /// One for each frame, in the order sent.
    pub results: Vec<BatchResult>,
    /// The request, as in the header `X-Request-Id` and the log.
    pub request_id: String,
}

/// What became of one frame of a batch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum BatchResult {
    /// It was recognized.
    Answer(Box<Answer>),
    /// It was not.
    Error(ProblemBody),
}

/// The models there are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct ModelList {
    /// The model of requests that name none; left out before one serves or is named. It stays until another is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub default: Option<String>,
    /// All of them, by name.
    pub models: Vec<ModelInfo>,
}

/// One model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct ModelInfo {
    /// Its name.
    pub name: String,
    /// Whether it answers requests that name no model.
    #[serde(default)]
    pub default: bool,
    /// The version that serves, as `stable`.
    pub serving: Option<u64>,
    /// How often what serves was changed; also the `ETag`, which `If-Match` is compared with.
    pub epoch: u64,
    /// The highest version that ever had a label; it may be gone.
    #[serde(default)]
    pub settled: u64,
    /// Its versions, the highest first.
    pub versions: Vec<VersionInfo>,
}

/// One version of a model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct VersionInfo {
    /// Its number.
    pub version: u64,
    /// What is true of it.
    pub state: VersionState,
    /// What it serves as.
    pub labels: Vec<String>,
    /// Why it does not serve.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<FailureInfo>,
    /// The model's epoch when this version came to serve.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub epoch: Option<u64>,
    /// Of a canary: the share of the robots that it answers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub share: Option<f64>,
    /// Of a shadow: how it compares with the stable version.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shadow: Option<ShadowInfo>,
    /// The BLAKE3 digest of the model file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub digest: Option<String>,
    /// The rooms it tells apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rooms: Option<Vec<String>>,
    /// The networks that it looks through; left out where there are none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub networks: Vec<NetworkInfo>,
    /// How it was trained and how well it did; asked for by version only.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Option<Object>))]
    pub card: Option<serde_json::Value>,
    /// Its last states, the oldest first.
    pub history: Vec<StateChange>,
}

/// A network that a model looks through.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct NetworkInfo {
    /// What the model calls it.
    pub name: String,
    /// The BLAKE3 digest of its ONNX file.
    pub blake3: String,
    /// The bytes of its ONNX file.
    pub bytes: u64,
}

/// How a shadow compares with the stable version, frame by frame, since it became one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct ShadowInfo {
    /// Frames that both recognized.
    pub compared: u64,
    /// Frames in which both saw the same room.
    pub agreed: u64,
    /// Frames that were not compared, since robots were waiting.
    pub skipped: u64,
    /// The mean total variation distance of the probabilities, from 0 (equal) to 1; left out before the first frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_distance: Option<f64>,
}

/// When another state came to be true of a version.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct StateChange {
    /// The state.
    pub state: VersionState,
    /// When, by RFC 3339.
    pub at: String,
}

/// What is to carry a label.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LabelJson {
    /// The version.
    pub version: u64,
    /// Of a canary: the share of the robots that it answers, above 0 and below 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub share: Option<f64>,
}

/// What is true of a version.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "lowercase")]
pub enum VersionState {
    /// It is there, and not in memory.
    Discovered,
    /// Its files are fetched and their digest is checked.
    Verifying,
    /// It becomes a model.
    Loading,
    /// It answers its golden frames.
    Warming,
    /// It can answer.
    Ready,
    /// It gets no further frames; some are in work.
    Quiescing,
    /// It is no longer in memory.
    Unloaded,
    /// It was tried and will not serve.
    Failed,
}

/// Why a version does not serve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct FailureInfo {
    /// `verifying`, `loading` or `warming`.
    pub stage: String,
    /// What was wrong.
    pub reason: String,
}

/// How the service is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct Health {
    /// `live` or `ready`.
    pub status: String,
}

/// A kind of problem.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct KindInfo {
    /// Its name, a path.
    pub r#type: String,
    /// What it is.
    pub title: String,
    /// The HTTP status it comes with.
    pub status: u16,
    /// What to do about it.
    pub advice: String,
}

/// An error, RFC 9457.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({
    "type": "/problems/queue-full", "title": "The queue is full", "status": 429,
    "detail": "the queue is full; try again after the time in Retry-After",
    "request_id": "7d1f3c0a9b2e4d58"
})))]
pub struct ProblemBody {
    /// The kind of problem, a path that can be read and never changes.
    pub r#type: String,
    /// The kind in a few words.
    pub title: String,
    /// The HTTP status.
    pub status: u16,
    /// What is wrong with this request and what to do about it.
    pub detail: String,
    /// The request, as in the header `X-Request-Id` and the log.
    pub request_id: String,
}

/// Reads a version from a query or a path. One number has one notation there.
pub fn version_from_text<'de, D: Deserializer<'de>>(text: D) -> Result<Option<u64>, D::Error> {
    let text = Cow::<str>::deserialize(text)?;
    let wrong = || {
        D::Error::custom(format!(
            "{text:?} is no version: give a whole number without sign and leading zeros, such as 7"
        ))
    };
    version_number(&text).map(Some).ok_or_else(wrong)
}

impl TimingsMs {
    /// As the value of the header `Server-Timing`.
    pub fn header(&self) -> String {
        let Self { queue, decode, features, classify } = self;
        format!("queue;dur={queue}, decode;dur={decode}, features;dur={features}, classify;dur={classify}")
    }
}
