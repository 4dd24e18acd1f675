//! Recordings of what robots send.

use serde::{Deserialize, Serialize};
#[cfg(feature = "schema")]
use utoipa::ToSchema;

/// How a robot is to be recorded.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(deny_unknown_fields)]
pub struct RecordJson {
    /// For how long, in seconds; left out: 60.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 86_400))]
    pub seconds: Option<u64>,
}

/// A recording that runs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RecordingInfo {
    /// What its file is called.
    pub file: String,
    /// Which robot is recorded.
    pub robot: String,
    /// When it began, by RFC 3339.
    pub began_at: String,
    /// When it ends by itself, by RFC 3339.
    pub ends_at: String,
    /// The pictures in it.
    pub pictures: u64,
    /// The answers in it.
    pub answers: u64,
    /// Pictures and answers that came faster than they could be written.
    pub lost: u64,
}

/// A recording that is over.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RecordingFile {
    /// What its file is called.
    pub file: String,
    /// Its length.
    pub bytes: u64,
}

/// The recordings there are.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RecordingList {
    /// Those that run, by robot.
    pub running: Vec<RecordingInfo>,
    /// Those that are over, by file.
    pub files: Vec<RecordingFile>,
    /// How many bytes all may take together, the setting `record_max_bytes`.
    pub max_bytes: u64,
}
