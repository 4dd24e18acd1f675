//! What an operator may want of a model, as a step from one record to the next.

use super::record::{Canary, RecordError, ServingRecord};

/// What is to serve instead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// This version as stable.
    Activate(u64),
    /// The version that was stable before.
    Rollback,
    /// This version for a share of the robots, or none.
    Canary(Option<Canary>),
    /// This version beside the stable one, or none.
    Shadow(Option<u64>),
    /// Nothing.
    Unload,
}

/// What a version can be to callers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// It answers.
    Stable,
    /// It answers a share of the robots.
    Canary,
    /// It answers nobody.
    Shadow,
}

impl Change {
    /// The roles that it decides about: a later change of one of them takes its place.
    pub fn roles(self) -> &'static [Role] {
        match self {
            Self::Activate(_) | Self::Rollback => &[Role::Stable],
            Self::Canary(_) => &[Role::Canary],
            Self::Shadow(_) => &[Role::Shadow],
            Self::Unload => &[Role::Stable, Role::Canary, Role::Shadow],
        }
    }

    /// The record after the change.
    ///
    /// # Errors
    /// A rollback to nothing, a share out of range, a second label for the stable version.
    pub fn of(self, record: &ServingRecord) -> Result<ServingRecord, RecordError> {
        match self {
            Self::Activate(version) => Ok(record.activated(version)),
            Self::Rollback => record.rolled_back(),
            Self::Canary(Some(canary)) => record.with_canary(canary),
            Self::Canary(None) => Ok(record.without_canary()),
            Self::Shadow(Some(version)) => record.with_shadow(version),
            Self::Shadow(None) => Ok(record.without_shadow()),
            Self::Unload => Ok(record.unloaded()),
        }
    }

    /// The version that must work for the change to take effect, by the changed record.
    pub fn wants(self, record: &ServingRecord) -> Option<u64> {
        match self {
            Self::Activate(_) | Self::Rollback => record.stable,
            Self::Canary(canary) => canary.map(|canary| canary.version),
            Self::Shadow(version) => version,
            Self::Unload => None,
        }
    }
}
