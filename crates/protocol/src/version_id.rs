//! How models and versions are called.

use std::fmt;
use std::str::FromStr;

const MAX_NAME_BYTES: usize = 64;

/// The one file beside the models, which is no model: it names the one that answers requests that name none.
pub const DEFAULT_FILE: &str = "default.json";

/// The highest number of a version. The one above it would have no next one.
pub const MAX_VERSION: u64 = u64::MAX - 1;

/// Why something is no version of a model.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum VersionIdError {
    /// A name that could lead elsewhere.
    #[error(
        "{0:?} is no name of a model or version: names have letters, digits, - _ and dots inside, versions \
         are whole numbers of at most {MAX_VERSION} without sign and leading zeros, such as 7"
    )]
    Name(String),
    /// All numbers are used up.
    #[error("no number is left above the highest version; give an unused one, as NAME/VERSION")]
    NoNumber,
}

/// Which version of which model. Displays as `lab/3`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct VersionId {
    /// The model's name.
    pub name: String,
    /// The version's number.
    pub version: u64,
}

impl VersionId {
    /// This version of this model.
    pub fn new(name: impl Into<String>, version: u64) -> Self {
        Self { name: name.into(), version }
    }

    /// The version of this model that comes after all others, the highest of which is given.
    ///
    /// # Errors
    /// There is no higher number.
    pub fn after(name: &str, highest: u64) -> Result<Self, VersionIdError> {
        let version = highest.checked_add(1).filter(|version| *version <= MAX_VERSION);
        version.map(|version| Self::new(name, version)).ok_or(VersionIdError::NoNumber)
    }
}

impl fmt::Display for VersionId {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}/{}", self.name, self.version)
    }
}

/// Reads `lab/3`.
impl FromStr for VersionId {
    type Err = VersionIdError;

    fn from_str(text: &str) -> Result<Self, VersionIdError> {
        let parts = text.split_once('/').filter(|(name, _)| is_name(name));
        let id = parts.and_then(|(name, number)| Some(Self::new(name, version_number(number)?)));
        id.ok_or_else(|| VersionIdError::Name(text.to_owned()))
    }
}

/// Whether a name can stand in a path, a query and a log as it is. [`DEFAULT_FILE`] is none.
pub fn is_name(name: &str) -> bool {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    let fits = !name.is_empty() && name.len() <= MAX_NAME_BYTES && name != DEFAULT_FILE;
    fits && !name.starts_with('.') && name.chars().all(is_plain)
}

/// The number of a version, from 0 to [`MAX_VERSION`], in its one notation: `007` and `+7` are none.
pub fn version_number(text: &str) -> Option<u64> {
    text.parse().ok().filter(|number: &u64| *number <= MAX_VERSION && number.to_string() == text)
}

/// Refuses names that could lead elsewhere.
///
/// # Errors
/// [`VersionIdError::Name`].
pub fn check_name(name: &str) -> Result<(), VersionIdError> {
    if is_name(name) { Ok(()) } else { Err(VersionIdError::Name(name.to_owned())) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_plain_names_are_taken() {
        for name in ["lab", "Lab_2.b-c", "x"] {
            assert!(is_name(name), "{name}");
        }
        for name in ["", ".lab", "..", "a b", "a/b", "a\\b", "caf\u{e9}", "default.json", &"x".repeat(65)] {
            assert!(!is_name(name), "{name}");
        }
    }

    #[test]
    fn a_version_has_one_notation() {
        let id: VersionId = "lab/18446744073709551614".parse().unwrap();
        assert_eq!((id.to_string().as_str(), id.version), ("lab/18446744073709551614", MAX_VERSION));
        for text in
            ["lab", "lab/", "lab/07", "lab/+7", "lab/7/", "../7", "lab/-1", "lab/18446744073709551615"]
        {
            let error = text.parse::<VersionId>().unwrap_err().to_string();
            assert!(error.contains(text) && error.contains("such as 7"), "{error}");
        }
    }

    #[test]
    fn a_version_has_a_next_one_until_the_numbers_end() {
        assert_eq!(VersionId::after("lab", 0).unwrap(), VersionId::new("lab", 1));
        assert_eq!(VersionId::after("lab", MAX_VERSION - 1).unwrap().version, MAX_VERSION);
        for highest in [MAX_VERSION, u64::MAX] {
            assert!(matches!(VersionId::after("lab", highest), Err(VersionIdError::NoNumber)));
        }
    }
}
