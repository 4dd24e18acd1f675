//! What dashboards are told of the service itself.

use super::rest::TimingsMs;
use serde::{Deserialize, Serialize};
#[cfg(feature = "schema")]
use utoipa::ToSchema;

/// The service and how it is set up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct ServiceInfo {
    /// The program's version.
    pub version: String,
    /// When it started.
    pub started_at: String,
    /// How long ago that was, in seconds.
    pub uptime_s: f64,
    /// Whether it has a folder for data, so that rooms can be taught here.
    pub data: bool,
    /// Whether callers need keys.
    pub keys: bool,
    /// How many threads recognize.
    pub threads: usize,
    /// Whether the robots' last frames are kept.
    pub frames_kept: bool,
    /// How long a robot's answers may be unknown before it counts as lost, in seconds.
    pub lost_after_s: f64,
    /// Where models are.
    pub models_folder: String,
    /// How many webhooks are told what happens.
    pub webhooks: usize,
    /// Whether a broker of MQTT is told where robots are.
    pub mqtt: bool,
}

/// The last hour of the service, from its own counters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct ServiceHistory {
    /// How much time a point is about, in seconds.
    pub interval_s: u64,
    /// At most 360, the oldest first.
    pub points: Vec<HistoryPoint>,
}

/// What was so in one interval.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct HistoryPoint {
    /// When it ended.
    pub at: String,
    /// Frames that were answered in it.
    pub answers: u64,
    /// Frames that could not be answered.
    pub errors: u64,
    /// Requests that were refused since the queue or the memory was full.
    pub refused: u64,
    /// Frames of streams that were not looked at.
    pub dropped: u64,
    /// Answers that were not known.
    pub unknown: u64,
    /// The most that waited for a thread.
    pub queue: usize,
    /// Threads that recognized, on the average.
    pub busy: f64,
    /// Memory of the process at the end; left out where the system does not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory_bytes: Option<u64>,
    /// Processor time that the process took; left out where the system does not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cpu_s: Option<f64>,
    /// Where the time of answered frames went, on the average.
    pub latency_ms: TimingsMs,
    /// Half of the answered frames took at most so long, all stages together; left out where none was answered.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p50_ms: Option<f64>,
    /// All but one in a hundred took at most so long.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p99_ms: Option<f64>,
    /// Streams that were connected at the end.
    pub streams: usize,
    /// Robots that were, or sent requests.
    pub robots: usize,
    /// Those among them that were lost.
    pub lost: usize,
}
