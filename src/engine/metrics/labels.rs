//! What labels say: closed sets, so that callers cannot add to them.

use crate::engine::timings::Timings;
use crate::engine::told;
use roomsight_protocol::stream::DropReason;
use roomsight_recognition::model::Unknown;

/// Why frames of streams are not looked at.
pub const DROP_REASONS: [DropReason; 5] = [
    DropReason::Superseded,
    DropReason::Deadline,
    DropReason::Overload,
    DropReason::Draining,
    DropReason::Lost,
];

/// What brought a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Transport {
    /// A request.
    Rest,
    /// A WebSocket.
    Stream,
    /// A request of the Open Inference Protocol.
    Oip,
}

/// What became of a frame that was not dropped.
#[derive(Clone, Copy, Debug)]
pub enum FrameOutcome {
    /// It was answered, after this.
    Answered(Timings),
    /// Its caller got a problem.
    Failed(&'static str),
    /// Nobody waited any more.
    CallerLeft,
}

/// What changed what serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SwapKind {
    /// A version was activated.
    Activate,
    /// The version before serves again.
    Rollback,
    /// A new version came.
    Latest,
    /// A label was set or taken away.
    Label,
    /// A model was unloaded.
    Unload,
}

/// How a change of what serves ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SwapOutcome {
    /// As wanted.
    Done,
    /// What served serves on.
    Failed,
    /// A newer change was there first.
    Lost,
}

/// How a training ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrainingOutcome {
    /// There is a model.
    Done,
    /// There is none.
    Failed,
    /// Somebody ended it.
    Cancelled,
}

/// Whether a stream goes on that was elsewhere before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TakeoverOutcome {
    /// It does.
    Done,
    /// What its robot brought cannot be used: it begins anew.
    Refused,
}

/// What became of an event for a webhook.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WebhookOutcome {
    /// It was taken.
    Delivered,
    /// It was not, and is tried once more.
    Retried,
    /// The address does not take it.
    Refused,
    /// It was not taken at the last try either.
    Failed,
    /// Too many waited before it.
    Dropped,
}

impl TrainingOutcome {
    pub const ALL: [Self; 3] = [Self::Done, Self::Failed, Self::Cancelled];

    pub fn name(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }
}

impl TakeoverOutcome {
    pub const ALL: [Self; 2] = [Self::Done, Self::Refused];

    pub fn name(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Refused => "refused",
        }
    }
}

impl WebhookOutcome {
    pub const ALL: [Self; 5] = [Self::Delivered, Self::Retried, Self::Refused, Self::Failed, Self::Dropped];

    pub fn name(self) -> &'static str {
        match self {
            Self::Delivered => "delivered",
            Self::Retried => "retried",
            Self::Refused => "refused",
            Self::Failed => "failed",
            Self::Dropped => "dropped",
        }
    }
}

impl Transport {
    pub fn name(self) -> &'static str {
        match self {
            Self::Rest => "rest",
            Self::Stream => "stream",
            Self::Oip => "oip",
        }
    }
}

impl FrameOutcome {
    pub fn name(self) -> &'static str {
        match self {
            Self::Answered(_) => "answered",
            Self::Failed(kind) => kind,
            Self::CallerLeft => "caller-left",
        }
    }
}

impl SwapKind {
    pub const ALL: [Self; 5] = [Self::Activate, Self::Rollback, Self::Latest, Self::Label, Self::Unload];

    pub fn name(self) -> &'static str {
        match self {
            Self::Activate => "activate",
            Self::Rollback => "rollback",
            Self::Latest => "latest",
            Self::Label => "label",
            Self::Unload => "unload",
        }
    }
}

impl SwapOutcome {
    pub const ALL: [Self; 3] = [Self::Done, Self::Failed, Self::Lost];

    pub fn name(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Lost => "lost",
        }
    }
}

/// Whether an answer is known, and why not.
pub fn known_name(unknown: Option<Unknown>) -> &'static str {
    unknown.map_or("yes", |why| told::unknown(why).name())
}

/// The name of a reason.
pub fn drop_name(reason: DropReason) -> &'static str {
    match reason {
        DropReason::Superseded => "superseded",
        DropReason::Deadline => "deadline",
        DropReason::Overload => "overload",
        DropReason::Draining => "draining",
        DropReason::Lost => "lost",
    }
}
