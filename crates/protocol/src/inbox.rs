//! The inbox: frames that robots sent and the model doubted, for people to label.

use crate::rest::{RoomProbability, Unknown};
use crate::training::PublishedVersion;
use serde::{Deserialize, Serialize};
#[cfg(feature = "schema")]
use utoipa::{IntoParams, ToSchema};

/// Which frames are kept, and how many.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(deny_unknown_fields, default)]
pub struct InboxRule {
    /// Those of all callers.
    pub all: bool,
    /// Those of these robots.
    pub robots: Vec<String>,
    /// Those that came with these keys.
    pub keys: Vec<String>,
    /// At most one frame of a robot in so many seconds.
    #[cfg_attr(feature = "schema", schema(minimum = 0))]
    pub every_s: f64,
    /// A known answer is doubted too where its probability is below this, 0 to 1.
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 1))]
    pub probability: f32,
    /// At most so many frames; the oldest that nobody labelled go first.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 100_000))]
    pub max_frames: u64,
    /// At most so many bytes of frames.
    #[cfg_attr(feature = "schema", schema(minimum = 1_000_000))]
    pub max_bytes: u64,
    /// Frames are deleted after so many days, labels or not; what was labelled stays in its data set.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 3650))]
    pub max_days: u32,
}

impl Default for InboxRule {
    fn default() -> Self {
        Self {
            all: false,
            robots: Vec::new(),
            keys: Vec::new(),
            every_s: 5.0,
            probability: 0.5,
            max_frames: 2000,
            max_bytes: 500_000_000,
            max_days: 30,
        }
    }
}

/// The rule, and what it has kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct InboxState {
    /// Which frames are kept.
    #[serde(flatten)]
    pub rule: InboxRule,
    /// How many there are.
    pub frames: u64,
    /// How many bytes they take.
    pub bytes: u64,
    /// Frames that were not kept since the service started, because too many came at once.
    pub missed: u64,
}

/// Which frames are asked for.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(IntoParams))]
#[serde(deny_unknown_fields, default)]
#[cfg_attr(feature = "schema", into_params(parameter_in = Query))]
pub struct InboxQuery {
    /// Those without a label, those with one, or all; left out: those without.
    #[cfg_attr(feature = "schema", param(inline))]
    pub state: InboxFilter,
    /// Those that were kept for this reason.
    #[cfg_attr(feature = "schema", param(inline))]
    pub reason: Option<Doubt>,
    /// Those of this robot.
    pub robot: Option<String>,
    /// Those that were answered with this room.
    pub room: Option<String>,
    /// In which order; left out: what teaches most first.
    #[cfg_attr(feature = "schema", param(inline))]
    pub sort: InboxOrder,
    /// How many to pass over, which the last answer told as `next`.
    pub after: Option<u64>,
    /// At most so many; left out: 100.
    #[cfg_attr(feature = "schema", param(minimum = 1, maximum = 500))]
    pub limit: Option<u64>,
}

/// Which frames of the inbox.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum InboxFilter {
    /// Without a label.
    #[default]
    Open,
    /// With a label.
    Labeled,
    /// All.
    All,
}

/// In which order frames come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum InboxOrder {
    /// What teaches most first.
    #[default]
    Value,
    /// The newest first.
    Newest,
}

/// Why a frame was kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Doubt {
    /// Its answer was not known.
    Unknown,
    /// Its answer was hardly probable.
    Low,
    /// Two rooms were nearly as probable.
    Torn,
    /// The frames before it say another room.
    FilterApart,
    /// The shadow says another room.
    ShadowApart,
    /// A person says that it is wrong.
    Wrong,
}

/// Frames of the inbox.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct InboxList {
    /// How many there are of those that were asked for.
    pub total: u64,
    /// How many have no label.
    pub open: u64,
    /// Some of those that were asked for.
    pub frames: Vec<InboxFrame>,
    /// How many to pass over for the next ones; left out where these are the last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next: Option<u64>,
}

/// A frame that was kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct InboxFrame {
    /// Its number.
    pub id: i64,
    /// When it came, by RFC 3339.
    pub at: String,
    /// The robot that sent it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
    /// The key that it came with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub key: Option<String>,
    /// The room that was answered.
    pub room: String,
    /// Whether it was to be acted on.
    pub known: bool,
    /// Why not: as answers say it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unknown: Option<Unknown>,
    /// The room's probability, 0 to 1.
    pub probability: f32,
    /// The most probable rooms.
    pub probabilities: Vec<RoomProbability>,
    /// How probable a new place was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub novelty: Option<f32>,
    /// The room that the frames so far showed together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filtered_room: Option<String>,
    /// The room that the shadow answered.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shadow_room: Option<String>,
    /// Why it was kept.
    pub reasons: Vec<Doubt>,
    /// How much it would teach, 0 to 1.
    pub value: f64,
    /// The model that answered.
    pub model: PublishedVersion,
    /// Counts its changes: a label is given to the frame as it was seen.
    pub revision: u64,
    /// What it shows, as a person has labelled it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub label: Option<InboxLabel>,
    /// What it shows, as a person has said that found its answer wrong.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub said: Option<String>,
}

/// What a frame shows, and who said so.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct InboxLabel {
    /// The data set that it was put into.
    pub set: String,
    /// The room.
    pub room: String,
    /// Its path in the data set.
    pub path: String,
    /// Who: the name of a key, or an address.
    pub by: String,
    /// When, by RFC 3339.
    pub at: String,
}

/// A frame that was answered wrong.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", into_params(parameter_in = Query))]
pub struct WrongQuery {
    /// The robot that sent it.
    #[cfg_attr(feature = "schema", param(max_length = 64))]
    pub robot: Option<String>,
    /// The room that it shows, where that is known; `elsewhere`: none.
    pub right: Option<String>,
    /// The model that answered; left out: the default one.
    pub model: Option<String>,
}

/// How wide a picture is to be.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", into_params(parameter_in = Query))]
pub struct WidthQuery {
    /// At most so many pixels wide; left out: the picture as it came.
    #[cfg_attr(feature = "schema", param(minimum = 16, maximum = 1920))]
    pub width: Option<u32>,
}

/// Frames of the inbox, as they were seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(deny_unknown_fields)]
pub struct SeenFrame {
    /// Its number.
    pub id: i64,
    /// Its revision when it was seen.
    pub revision: u64,
}

/// What frames show.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LabelsJson {
    /// The data set that they are put into, made where it is not there.
    pub set: String,
    /// The room; `elsewhere`: none.
    pub room: String,
    /// The drive; left out: one of the inbox and the day.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive: Option<String>,
    /// The frames.
    #[cfg_attr(feature = "schema", schema(min_items = 1, max_items = 1000))]
    pub frames: Vec<SeenFrame>,
}

/// What became of labels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct LabeledFrames {
    /// The frames that have them.
    pub labeled: Vec<InboxFrame>,
    /// The frames that somebody else has labelled meanwhile, or that are gone.
    pub conflicts: Vec<LabelConflict>,
    /// The change of the data set, which can be undone; left out where nothing was labelled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub change: Option<i64>,
}

/// A frame that was not labelled.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct LabelConflict {
    /// Its number.
    pub id: i64,
    /// The label that it has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub label: Option<InboxLabel>,
    /// Why it got none.
    pub reason: String,
}

/// Frames that teach nothing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(deny_unknown_fields)]
pub struct DiscardJson {
    /// The frames.
    #[cfg_attr(feature = "schema", schema(min_items = 1, max_items = 1000))]
    pub frames: Vec<SeenFrame>,
}

/// How many frames were thrown away.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct Discarded {
    /// So many.
    pub discarded: usize,
}
