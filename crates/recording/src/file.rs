//! The files that recordings are in, each read at any place.
//!
//! | file | what |
//! |---|---|
//! | `mcap` | MCAP |
//! | `sqlite` | the databases of rosbag2 |
//! | `bag` | bags of ROS 1 |
//! | `blocks` | packed blocks of a file |

mod bag;
mod blocks;
mod mcap;
mod sqlite;

use crate::error::RecordingError;
use crate::topic::Topic;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use tempfile::NamedTempFile;

/// Where a message lies in its file, as the file has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    /// A block, a record or a row.
    at: u64,
    /// In an unpacked block; none in what is no block.
    within: Option<u32>,
}

/// A message of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Entry {
    /// Which topic of its file.
    pub(crate) topic_idx: usize,
    /// When it was recorded, in nanoseconds by the clock of the recorder.
    pub(crate) time_ns: u64,
    pub(crate) place: Place,
}

/// Messages, in the order of the file.
#[derive(Debug, Default)]
pub(crate) struct Index {
    pub(crate) entries: Vec<Entry>,
    /// What could not be read, and why.
    pub(crate) problems: Vec<String>,
}

/// When messages were recorded: the first and the last, in nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    pub(crate) first_ns: u64,
    pub(crate) last_ns: u64,
}

impl Span {
    /// Both and what lies between.
    pub(crate) fn with(this: Option<Self>, other: Self) -> Self {
        let Some(this) = this else { return other };
        Self { first_ns: this.first_ns.min(other.first_ns), last_ns: this.last_ns.max(other.last_ns) }
    }

    fn at(time_ns: u64) -> Self {
        Self { first_ns: time_ns, last_ns: time_ns }
    }
}

/// What is known of a file before its messages are read.
#[derive(Debug, Default)]
pub(crate) struct Contents {
    pub(crate) topics: Vec<Topic>,
    /// None without messages.
    pub(crate) span: Option<Span>,
    /// What is wrong with it.
    pub(crate) problems: Vec<String>,
}

/// A file of a recording.
#[derive(Debug)]
pub(crate) struct RecordedFile {
    layout: Layout,
    /// What it was unpacked into, if it was packed as a whole.
    _unpacked: Option<NamedTempFile>,
}

/// How a file is laid out.
#[derive(Debug)]
enum Layout {
    Mcap(mcap::McapFile),
    Sqlite(sqlite::SqliteFile),
    Bag(bag::BagFile),
}

/// What is told of a file without its end.
const NO_INDEX: &str = "it has no index, as where a recording was not ended: read from its beginning";
const ENDS_EARLY: &str = "it ends in the middle of a record: read up to there";

/// How files begin.
const MCAP_MAGIC: &[u8] = b"\x89MCAP0\r\n";
const SQLITE_MAGIC: &[u8] = b"SQLite format 3\0";
const BAG_MAGIC: &[u8] = b"#ROSBAG V2.0\n";
const ZSTD_MAGIC: &[u8] = b"\x28\xb5\x2f\xfd";

impl RecordedFile {
    /// Opens a file by what it begins with; one that is packed as a whole is unpacked into a temporary one.
    pub(crate) fn open(path: &Path) -> Result<(Self, Contents), RecordingError> {
        let begins = head(path)?;
        let unpacked = if begins.starts_with(ZSTD_MAGIC) { Some(unpack(path)?) } else { None };
        let (layout, contents) = match &unpacked {
            Some(unpacked) => Layout::open(unpacked.path(), &head(unpacked.path())?, path)?,
            None => Layout::open(path, &begins, path)?,
        };
        Ok((Self { layout, _unpacked: unpacked }, contents))
    }

    /// The messages of the topics that are wanted, one flag each.
    pub(crate) fn index(&self, wanted: &[bool]) -> Result<Index, RecordingError> {
        match &self.layout {
            Layout::Mcap(file) => file.index(wanted),
            Layout::Sqlite(file) => file.index(wanted),
            Layout::Bag(file) => file.index(wanted),
        }
    }

    /// A message, as it was written.
    pub(crate) fn message(&self, place: Place) -> Result<Vec<u8>, RecordingError> {
        match &self.layout {
            Layout::Mcap(file) => file.message(place),
            Layout::Sqlite(file) => file.message(place),
            Layout::Bag(file) => file.message(place),
        }
    }
}

impl Layout {
    /// Of a file that begins so; `named` is what people know it as.
    fn open(path: &Path, head: &[u8], named: &Path) -> Result<(Self, Contents), RecordingError> {
        if head.starts_with(MCAP_MAGIC) {
            let (file, contents) = mcap::McapFile::open(path)?;
            Ok((Self::Mcap(file), contents))
        } else if head.starts_with(SQLITE_MAGIC) {
            let (file, contents) = sqlite::SqliteFile::open(path)?;
            Ok((Self::Sqlite(file), contents))
        } else if head.starts_with(BAG_MAGIC) {
            let (file, contents) = bag::BagFile::open(path)?;
            Ok((Self::Bag(file), contents))
        } else {
            Err(RecordingError::NoRecording(named.to_owned()))
        }
    }
}

/// The number of a topic among those of a file. Nodes that were started again wrote to another connection of the same.
fn number_of(topics: &mut Vec<Topic>, topic: Topic) -> usize {
    let known = topics.iter().position(|other| *other == topic);
    known.unwrap_or_else(|| {
        topics.push(topic);
        topics.len() - 1
    })
}

/// The first bytes of a file.
fn head(path: &Path) -> Result<Vec<u8>, RecordingError> {
    let mut head = Vec::new();
    let file = File::open(path).map_err(RecordingError::io(path))?;
    file.take(SQLITE_MAGIC.len() as u64).read_to_end(&mut head).map_err(RecordingError::io(path))?;
    Ok(head)
}

fn unpack(path: &Path) -> Result<NamedTempFile, RecordingError> {
    let unpack = || {
        let mut unpacked = NamedTempFile::new()?;
        io::copy(&mut zstd::Decoder::new(File::open(path)?)?, &mut unpacked)?;
        Ok(unpacked)
    };
    unpack().map_err(RecordingError::io(path))
}
