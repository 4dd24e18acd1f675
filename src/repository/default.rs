//! Which model answers requests that name none. It is kept in the repository, so that it stays over a restart, is the
//! same for all services of one repository, and no other model takes its place by coming first in the alphabet.

use super::record::MAX_EPOCH;
use roomsight_protocol::version_id::is_name;
use serde::{Deserialize, Serialize};

/// What somebody has said about the default model.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DefaultModel {
    /// Counts how often it was said, from 1.
    pub epoch: u64,
    /// The model's name.
    pub model: String,
}

impl DefaultModel {
    /// What is said of `model` after what is there; none where nothing is.
    pub fn after(current: Option<&Self>, model: &str) -> Self {
        Self { epoch: current.map_or(0, |current| current.epoch) + 1, model: model.to_owned() }
    }

    /// Reads what anybody may have written.
    pub(super) fn from_json(json: &[u8]) -> Result<Self, String> {
        let read: Self = serde_json::from_slice(json).map_err(|error| error.to_string())?;
        if !is_name(&read.model) {
            return Err(format!("{:?} is no name of a model", read.model));
        }
        if read.epoch > MAX_EPOCH {
            return Err(format!("the epoch {} is no count of changes", read.epoch));
        }
        Ok(read)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_comes_back_and_nonsense_does_not() {
        let first = DefaultModel::after(None, "lab");
        let second = DefaultModel::after(Some(&first), "attic");
        assert_eq!((first.epoch, second.epoch, second.model.as_str()), (1, 2, "attic"));
        assert_eq!(DefaultModel::from_json(&serde_json::to_vec(&second).unwrap()), Ok(second));
        for text in [
            "",
            "{}",
            r#"{"epoch":1,"model":"../lab"}"#,
            r#"{"epoch":-1,"model":"lab"}"#,
            r#"{"epoch":18446744073709551615,"model":"lab"}"#,
        ] {
            assert!(DefaultModel::from_json(text.as_bytes()).is_err(), "{text}");
        }
    }
}
