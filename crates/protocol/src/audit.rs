//! Who changed what of the service.

use serde::{Deserialize, Serialize};
#[cfg(feature = "schema")]
use utoipa::{IntoParams, ToSchema};

/// Which entries are asked for.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", into_params(parameter_in = Query))]
pub struct AuditQuery {
    /// Those before this one, which the last answer told as `next`.
    pub before: Option<i64>,
    /// At most so many; left out: 100.
    #[cfg_attr(feature = "schema", param(minimum = 1, maximum = 1000))]
    pub limit: Option<u64>,
}

/// What was changed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct AuditList {
    /// The newest first.
    pub entries: Vec<AuditEntry>,
    /// Where the older ones begin; left out where there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next: Option<i64>,
}

/// A change.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct AuditEntry {
    /// Its number.
    pub id: i64,
    /// When, by RFC 3339.
    pub at: String,
    /// Who: the name of a key, an address, or `policy`.
    pub who: String,
    /// What was done.
    pub what: Deed,
    /// To what: a model, a data set, a key.
    pub target: String,
    /// More about it; may be empty.
    pub detail: String,
}

/// What was done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Deed {
    /// A version came to serve.
    Activate,
    /// The version before came back.
    Rollback,
    /// A version became canary or shadow.
    Label,
    /// A version is canary or shadow no more.
    Unlabel,
    /// A model answers requests that name none.
    Default,
    /// A version was added.
    Upload,
    /// A version was removed.
    DeleteVersion,
    /// A training became a version.
    Publish,
    /// A training began.
    Train,
    /// A training was cancelled.
    Cancel,
    /// A key was made.
    KeyMade,
    /// A key was revoked.
    KeyRevoked,
    /// The inbox keeps other frames.
    InboxRule,
    /// A data set was made.
    SetCreated,
    /// A data set was removed.
    SetRemoved,
    /// A data set was changed.
    Change,
    /// A change of a data set was undone.
    Undo,
    /// A frame was called answered wrong.
    Wrong,
    /// Frames of the inbox were labelled.
    LabelFrames,
    /// Frames of the inbox were thrown away.
    DiscardFrames,
    /// A robot was recorded.
    Record,
    /// Other things follow from labels by themselves.
    Policy,
}
