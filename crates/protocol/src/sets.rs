//! Data sets that are kept by the service: what people teach it with.

use serde::{Deserialize, Serialize};
#[cfg(feature = "schema")]
use utoipa::{IntoParams, ToSchema};

/// The data sets there are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct SetList {
    /// By name.
    pub sets: Vec<SetSummary>,
}

/// A data set in a line.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct SetSummary {
    /// Its name.
    pub name: String,
    /// How many rooms it shows.
    pub rooms: usize,
    /// How many frames it has, those of no room included.
    pub frames: usize,
    /// How much room they take on the disk.
    pub bytes: u64,
    /// When it was last changed here, by RFC 3339.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub changed_at: Option<String>,
}

/// A data set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct SetInfo {
    /// Its name.
    pub name: String,
    /// How much room its frames take on the disk.
    pub bytes: u64,
    /// Its rooms by name; `elsewhere`, the pictures of no room, comes last.
    pub rooms: Vec<SetRoom>,
    /// What is missing for a good training, the gravest first.
    pub advice: Vec<String>,
    /// What lies in its folder and is no frame.
    pub left_out: Vec<LeftOutFile>,
    /// Its last changes, the newest first.
    pub changes: Vec<SetChange>,
}

/// A room of a data set.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct SetRoom {
    /// Its name.
    pub name: String,
    /// How many frames show it.
    pub frames: usize,
    /// Its drives by name; one without a name holds the frames that lie in the room's folder itself.
    pub drives: Vec<SetDrive>,
}

/// A drive through a room.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct SetDrive {
    /// Its name; may be empty.
    pub name: String,
    /// How many frames it has.
    pub frames: usize,
}

/// A file that is no frame.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct LeftOutFile {
    /// Its path in the data set.
    pub path: String,
    /// Why it is none.
    pub reason: String,
}

/// Which frames of a data set are asked for.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", into_params(parameter_in = Query))]
pub struct FramesQuery {
    /// Of this room; left out: of all.
    pub room: Option<String>,
    /// Of this drive; left out: of all.
    pub drive: Option<String>,
    /// Those that come after this path, which the last answer told as `next`.
    pub after: Option<String>,
    /// At most so many; left out: 200.
    #[cfg_attr(feature = "schema", param(minimum = 1, maximum = 1000))]
    pub limit: Option<usize>,
}

/// Frames of a data set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct FrameList {
    /// How many there are of those that were asked for.
    pub total: usize,
    /// Some of them, by path.
    pub frames: Vec<SetFrame>,
    /// Where the next ones begin; left out where these are the last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next: Option<String>,
}

/// A frame of a data set.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct SetFrame {
    /// Its path in the data set, which names it.
    pub path: String,
    /// The room that it shows.
    pub room: String,
    /// The drive that it comes from; may be empty.
    pub drive: String,
    /// How long its file is.
    pub bytes: u64,
}

/// Which picture is asked for, and how wide.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", into_params(parameter_in = Query))]
pub struct SetPictureQuery {
    /// The frame's path in the data set.
    pub path: String,
    /// At most so many pixels wide; left out: the file as it is.
    #[cfg_attr(feature = "schema", param(minimum = 16, maximum = 1920))]
    pub width: Option<u32>,
}

/// Where frames go that are sent.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", into_params(parameter_in = Query))]
pub struct AddQuery {
    /// The room that they show, made where it is not there; `elsewhere`: no room.
    #[cfg_attr(feature = "schema", param(example = "kitchen"))]
    pub room: String,
    /// The drive that they come from; left out: none.
    #[cfg_attr(feature = "schema", param(example = "monday"))]
    pub drive: Option<String>,
    /// What the picture is called, for messages; a form names its pictures itself.
    pub name: Option<String>,
}

/// What became of frames that were sent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct AddedFrames {
    /// The paths of those that were taken.
    pub added: Vec<String>,
    /// Those that are in the data set already.
    pub copies: Vec<CopiedFrame>,
    /// Those that are no pictures which can be read.
    pub refused: Vec<RefusedFrame>,
    /// The change that took them, which can be undone; left out where none was taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub change: Option<i64>,
}

/// A picture that is in the data set already.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct CopiedFrame {
    /// What it was called.
    pub name: String,
    /// Where it lies.
    pub path: String,
}

/// A picture that was not taken.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RefusedFrame {
    /// What it was called.
    pub name: String,
    /// Why.
    pub reason: String,
}

/// What is to be changed in a data set.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(tag = "action", rename_all = "snake_case", deny_unknown_fields)]
pub enum ChangeJson {
    /// Frames come to another room, or to another drive.
    Move {
        /// Their paths.
        frames: Vec<String>,
        /// The room, made where it is not there; `elsewhere`: no room.
        room: String,
        /// The drive; left out: each keeps its own.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        drive: Option<String>,
    },
    /// Frames go.
    Remove {
        /// Their paths.
        frames: Vec<String>,
    },
    /// A room gets another name; where there is a room of that name, both become one.
    RenameRoom {
        /// The room.
        room: String,
        /// Its new name.
        to: String,
    },
    /// A drive of a room gets another name; where there is a drive of that name, both become one.
    RenameDrive {
        /// The room.
        room: String,
        /// The drive.
        drive: String,
        /// Its new name.
        to: String,
    },
    /// All frames of a room go.
    RemoveRoom {
        /// The room.
        room: String,
    },
}

/// A change of a data set.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct SetChange {
    /// Its number.
    pub id: i64,
    /// When, by RFC 3339.
    pub at: String,
    /// Who: the name of a key, or an address.
    pub by: String,
    /// `add`, `label`, `move`, `remove`, `rename_room`, `rename_drive` or `remove_room`.
    pub action: String,
    /// What was done, in a few words.
    pub text: String,
    /// How many frames it touched.
    pub frames: usize,
    /// Whether it was undone.
    pub undone: bool,
}

/// What is odd about a data set, and how far the look has come.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct SetCheck {
    /// How far it has come.
    pub state: CheckState,
    /// When it began, by RFC 3339.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<String>,
    /// Why it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// How many frames were looked at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub n_frames: Option<usize>,
    /// What was found, the gravest first.
    #[serde(default)]
    pub findings: Vec<SetFinding>,
}

/// How far the look at a data set has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum CheckState {
    /// Nobody has asked for one since the service started.
    #[default]
    None,
    /// It is under way.
    Running,
    /// It is done.
    Done,
    /// It failed.
    Failed,
}

/// A frame that is odd.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct SetFinding {
    /// The kind, as `roomsight check --json` calls it.
    pub oddity: String,
    /// What that means and what to do.
    pub heading: String,
    /// The frame.
    pub path: String,
    /// The room that it is said to show.
    pub room: String,
    /// What says so, in a few words; may be empty.
    #[serde(default)]
    pub detail: String,
    /// The frame that it is a copy of, if it is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other: Option<String>,
    /// The room that it shows more likely.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub likely_room: Option<String>,
}
