//! Names of opinions that files of version 1 and short configurations imply.

/// The name of the opinion that parameters are of which name none: `classifier.c` is short for
/// `opinions.bag.classifier.c`.
pub const BAG: &str = "bag";

/// The name of the opinion that files of before call the cue.
pub const PATTERNS: &str = "patterns";
