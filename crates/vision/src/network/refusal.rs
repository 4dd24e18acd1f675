//! What is wrong with a network, and how deep its tensors may be.

use super::wire::Malformed;

/// The most dimensions of a tensor.
pub(super) const MAX_RANK: usize = 8;

pub(super) enum Problem {
    Malformed,
    Refused(String),
}

impl From<Malformed> for Problem {
    fn from(_: Malformed) -> Self {
        Self::Malformed
    }
}

pub(super) fn refused<T>(why: impl Into<String>) -> Result<T, Problem> {
    Err(Problem::Refused(why.into()))
}
