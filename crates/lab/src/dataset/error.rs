//! What is wrong with a data set: as a whole ([`DatasetError`]) or in one place ([`Problem`]).

use std::collections::hash_map::Entry;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::{fmt, io};

/// One thing that was left out of a data set or looks wrong in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// The file or folder concerned.
    pub path: PathBuf,
    /// Its line, counted from 1, where it is one line of a list.
    pub line: Option<u64>,
    /// What is wrong with it, the same for all that it is wrong with.
    pub reason: String,
    /// What is particular to this one; may be empty.
    pub detail: String,
}

impl Problem {
    /// What is wrong with a whole file or folder.
    pub fn new(path: &Path, reason: impl Into<String>) -> Self {
        // Some decoders end their sentences with an empty line.
        let reason = reason.into().trim_end().to_owned();
        Self { path: path.to_owned(), line: None, reason, detail: String::new() }
    }

    pub(super) fn at(self, line: u64) -> Self {
        Self { line: Some(line), ..self }
    }

    pub(super) fn with(self, detail: impl Into<String>) -> Self {
        Self { detail: detail.into(), ..self }
    }

    /// The reason without its numbers: two pictures that are too large are one kind of problem.
    fn kind(&self) -> String {
        self.reason.replace(|character: char| character.is_ascii_digit(), "")
    }

    fn told(&self, n_more: usize) -> String {
        let mut text = printable(&self.path);
        if let Some(line) = self.line {
            text.push_str(&format!(", line {line}"));
        }
        if n_more > 0 {
            text.push_str(&format!(" and {n_more} more"));
        }
        text.push_str(&format!(": {}", self.reason));
        if !self.detail.is_empty() {
            text.push_str(&format!(" ({})", self.detail));
        }
        text
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(&self.told(0))
    }
}

/// Problems of one kind: the first of them, and how many there are. Displayed as one line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProblemKind<'a> {
    /// The first in the order given.
    pub first: &'a Problem,
    /// At least 1.
    pub n_problems: usize,
}

impl fmt::Display for ProblemKind<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(&self.first.told(self.n_problems - 1))
    }
}

/// Problems by kind, in the order in which the kinds occur first.
pub fn by_kind(problems: &[Problem]) -> Vec<ProblemKind<'_>> {
    let mut kinds: Vec<ProblemKind> = Vec::new();
    let mut idx_of: HashMap<String, usize> = HashMap::new();
    for problem in problems {
        match idx_of.entry(problem.kind()) {
            Entry::Occupied(idx) => kinds[*idx.get()].n_problems += 1,
            Entry::Vacant(idx) => {
                idx.insert(kinds.len());
                kinds.push(ProblemKind { first: problem, n_problems: 1 });
            }
        }
    }
    kinds
}

/// A path on a terminal: control characters, which names may hold, are written as codes.
fn printable(path: &Path) -> String {
    let write = |character: char| match character.is_control() {
        true => character.escape_default().to_string(),
        false => character.to_string(),
    };
    path.to_string_lossy().chars().map(write).collect()
}

/// Why a data set, or a selection from it, cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// There is nothing at the path.
    #[error("{}: no such file or folder", .0.display())]
    NotFound(PathBuf),
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// What was being read.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Nothing there looks like one of the formats.
    #[error(
        "{}: not a data set ({why}); what can be read: a folder a room with its frames (kitchen/*.jpg or \
         kitchen/SEQUENCE/*.jpg), a frames.csv with the columns file and place, COLD sequences \
         (seq1_cloudy1/std_cam with seq1_cloudy1/localization/places.lst), or recordings (MCAP, rosbag2, ROS 1 bags)",
        path.display()
    )]
    UnknownLayout {
        /// What was opened.
        path: PathBuf,
        /// What lies there instead.
        why: String,
    },
    /// Folders named as splits where the rooms should be.
    #[error("{}: {reason}", path.display())]
    Splits {
        /// The folder that they lie in.
        path: PathBuf,
        /// Why they cannot be read, and what to do.
        reason: String,
    },
    /// A manifest cannot be read as one.
    #[error("{0}")]
    Manifest(Problem),
    /// A recording does not give what is asked of it.
    #[error("{}: {reason}", path.display())]
    Recording {
        /// The file or folder.
        path: PathBuf,
        /// What it lacks, and what there is.
        reason: String,
    },
    /// A manifest lacks a column, or has it twice.
    #[error(
        "{}, line {line}: {fault}; this line must name the columns, at least file and place, separated by commas, \
         semicolons or tabs",
        path.display()
    )]
    Columns {
        /// The manifest.
        path: PathBuf,
        /// The line of the headings, counted from 1.
        line: u64,
        /// Which column, and those that are there.
        fault: String,
    },
    /// A manifest names a camera that does not exist.
    #[error("{}, line {line}: no camera `{name}`; write perspective, equirectangular or omnidirectional", path.display())]
    UnknownCamera {
        /// The manifest.
        path: PathBuf,
        /// Its line, counted from 1.
        line: u64,
        /// What it says.
        name: String,
    },
    /// A manifest names a file outside of its own folder.
    #[error("{}, line {line}: `{file}` leads out of the folder; name files relative to it, without `..`", path.display())]
    Escape {
        /// The manifest.
        path: PathBuf,
        /// Its line, counted from 1.
        line: u64,
        /// What it names.
        file: String,
    },
    /// Not one usable frame.
    #[error("{}: no usable frame ({hint})", root.display())]
    NoFrames {
        /// The data set.
        root: PathBuf,
        /// What became of those that were met.
        hint: String,
    },
    /// Every frame shows the same room.
    #[error("every frame shows `{room}`: add frames of at least one other room")]
    OneRoom {
        /// That room.
        room: String,
    },
    /// Rooms that people, and systems that ignore case, take for one.
    #[error(
        "{left} and {right} are the name of one room for people and for systems that ignore case: \
         give the room one name, or the two rooms names that differ more ({left_origin}; {right_origin})"
    )]
    LookAlike {
        /// A room.
        left: String,
        /// Another.
        right: String,
        /// Where the first is named, such as a frame of it.
        left_origin: String,
        /// Where the second is.
        right_origin: String,
    },
    /// Frames of several kinds of camera together.
    #[error("frames of several cameras ({cameras}): choose one of them, a model knows one camera")]
    MixedCameras {
        /// Their names.
        cameras: String,
    },
    /// A selection that nothing matches.
    #[error("no frame has the {what} `{wanted}`; there are: {present}")]
    NoMatch {
        /// The property selected by.
        what: &'static str,
        /// The value or pattern asked for.
        wanted: String,
        /// The values that occur.
        present: String,
    },
}

impl DatasetError {
    pub(super) fn io(path: &Path, source: io::Error) -> Self {
        match source.kind() {
            io::ErrorKind::NotFound => Self::NotFound(path.to_owned()),
            _ => Self::Io { path: path.to_owned(), source },
        }
    }
}

/// The names in one line, for an error text; the first few when there are many.
pub(super) fn enumerate(names: &BTreeSet<&str>) -> String {
    const MAX_NAMES: usize = 12;
    let shown: Vec<&str> = names.iter().copied().take(MAX_NAMES).collect();
    match names.len().saturating_sub(MAX_NAMES) {
        _ if names.is_empty() => "none".to_owned(),
        0 => shown.join(", "),
        n_more => format!("{} and {n_more} more", shown.join(", ")),
    }
}
