//! How much a filter believes a single frame.

use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// The power that a frame's probabilities are raised to: above 0, where frames say nothing, up to 10. Each
/// counts as it says at 1. Less suits frames that are wrong together; more suits probabilities that are more
/// cautious than the answers deserve, and makes the filter quicker to change rooms.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(try_from = "f32", into = "f32")]
pub struct Trust(f32);

/// A number that is no trust.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("trust is a number above 0 and at most {max}, such as {default}", max = Trust::MAX, default = Trust::default().0)]
pub struct TrustError;

impl Trust {
    /// The most.
    pub const MAX: f32 = 10.0;

    pub(super) fn exponent(self) -> f64 {
        f64::from(self.0)
    }
}

impl Default for Trust {
    /// Chosen on simulated drives, at 1 and 5 frames a second, that no reported rate rests on.
    fn default() -> Self {
        Self(2.0)
    }
}

impl TryFrom<f32> for Trust {
    type Error = TrustError;

    fn try_from(trust: f32) -> Result<Self, TrustError> {
        if trust > 0.0 && trust <= Self::MAX { Ok(Self(trust)) } else { Err(TrustError) }
    }
}

impl From<Trust> for f32 {
    fn from(trust: Trust) -> Self {
        trust.0
    }
}

impl FromStr for Trust {
    type Err = TrustError;

    fn from_str(text: &str) -> Result<Self, TrustError> {
        text.parse::<f32>().map_err(|_| TrustError)?.try_into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_powers_above_0_up_to_10_are_trust() {
        for text in ["1", "0.05", "1e-3", "10"] {
            assert!(text.parse::<Trust>().is_ok(), "{text}");
        }
        for text in ["0", "-0.5", "10.01", "NaN", "inf", "", "much"] {
            assert_eq!(text.parse::<Trust>(), Err(TrustError), "{text}");
        }
        assert_eq!(serde_json::from_str::<Trust>("0.5").unwrap(), Trust(0.5));
        assert!(serde_json::from_str::<Trust>("20").unwrap_err().to_string().contains("at most 10"));
    }
}
