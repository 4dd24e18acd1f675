//! What is wrong with a data set: as a whole ([`DatasetError`]) or in one place ([`Problem`]).

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};

/// One thing that was left out of a data set or looks wrong in it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}: {reason}", path.display())]
pub struct Problem {
    /// The file or folder concerned.
    pub path: PathBuf,
    /// What is wrong with it, with the line number where there is one.
    pub reason: String,
}

impl Problem {
    pub(super) fn new(path: &Path, reason: impl Into<String>) -> Self {
        Self { path: path.to_owned(), reason: reason.into() }
    }
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
        "{}: not a data set; what can be read: a folder a room with its frames (kitchen/*.jpg or \
         kitchen/SEQUENCE/*.jpg), a frames.csv with the columns file and place, or COLD sequences \
         (seq1_cloudy1/std_cam with seq1_cloudy1/localization/places.lst)",
        .0.display()
    )]
    UnknownLayout(PathBuf),
    /// A label file or manifest cannot be read as one.
    #[error("{}: {reason}", path.display())]
    Labels {
        /// The label file or manifest.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// A manifest lacks a column.
    #[error("{}: no column `{column}`; its first line must name the columns, at least file and place", path.display())]
    MissingColumn {
        /// The manifest.
        path: PathBuf,
        /// The column.
        column: &'static str,
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
    #[error("every frame shows `{place}`: add frames of at least one other room")]
    OnePlace {
        /// That room.
        place: String,
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
