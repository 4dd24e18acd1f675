//! Why a recording, or a message in it, cannot be read.

use std::io;
use std::path::{Path, PathBuf};

/// Why a recording, or something in it, cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// What was being read.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Something else.
    #[error("{}: no recording: MCAP, a database of rosbag2 and bags of ROS 1 are read", .0.display())]
    NoRecording(PathBuf),
    /// A folder of rosbag2 without any.
    #[error("{}: a folder of rosbag2 without a recording in it", .0.display())]
    Empty(PathBuf),
    /// Not as it was written.
    #[error("{}: damaged: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

impl RecordingError {
    pub(crate) fn io(path: &Path) -> impl Fn(io::Error) -> Self + '_ {
        |source| Self::Io { path: path.to_owned(), source }
    }
}

/// Why a message tells nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MessageError {
    /// It ends too early.
    #[error("a message ends before what it should hold")]
    Short,
    /// Fields lie in a way that is not read.
    #[error("a message is written in a representation that is not read ({0:02x?}): plain CDR is")]
    Representation([u8; 2]),
    /// A message of another type is asked for a picture or the like.
    #[error("messages of the type {0} are not read")]
    Type(String),
    /// Pixels that are not read.
    #[error("pictures of the encoding `{0}` are not read: {1}")]
    Pixels(String, &'static str),
    /// Fewer pixels than the message says.
    #[error("a picture of {width} x {height} pixels, {step} bytes a row, has {n_bytes} bytes")]
    TooFewPixels {
        /// In pixels.
        width: u32,
        /// In pixels.
        height: u32,
        /// Bytes from a row to the next.
        step: u32,
        /// That are there.
        n_bytes: usize,
    },
    /// No protocol buffer, or no JSON.
    #[error("a message is damaged: {0}")]
    Damaged(String),
}
