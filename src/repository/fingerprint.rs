//! Tells whether the files of a version are those that they were.

use roomsight_recognition::model::NETWORKS_FOLDER;
use serde::{Deserialize, Serialize};
use std::fs::{self, Metadata};
use std::io;
use std::path::Path;
use std::time::UNIX_EPOCH;

/// Folders in a version's folder are looked into this deep; more are not its own.
const MAX_DEPTH: usize = 2;

/// Changes when the files of a version do: made of their names, sizes and times, or of a bucket's ETags. Hidden
/// files are none of a version's: they are what tools leave, and what they have not finished.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Fingerprint(pub String);

impl Fingerprint {
    /// Of all files in a folder.
    pub(super) fn of_folder(folder: &Path) -> io::Result<Self> {
        let mut lines = Vec::new();
        collect(folder, MAX_DEPTH, &mut lines)?;
        Ok(Self::of_lines(lines))
    }

    /// Of lines that say what there is, in any order.
    pub(super) fn of_lines(mut lines: Vec<String>) -> Self {
        lines.sort();
        Self(blake3::hash(lines.join("\n").as_bytes()).to_hex().to_string())
    }
}

fn collect(folder: &Path, depth: usize, lines: &mut Vec<String>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_name().as_encoded_bytes().starts_with(b".") {
            continue;
        }
        let path = entry.path();
        let metadata = fs::metadata(&path)?;
        if !metadata.is_dir() {
            // A network's file changes, to the system, whenever another version begins or ends to use it.
            let is_network = folder.file_name().is_some_and(|name| name == NETWORKS_FOLDER);
            let changed = if is_network { 0 } else { changed(&metadata) };
            let modified = modified(&metadata);
            lines.push(format!("{path:?} {} {modified} {changed}", metadata.len()));
        } else if depth > 1 {
            collect(&path, depth - 1, lines)?;
        }
    }
    Ok(())
}

/// In nanoseconds; 0 where the system does not know.
fn modified(metadata: &Metadata) -> u128 {
    let since = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
    since.map_or(0, |duration| duration.as_nanos())
}

/// When the system saw the file change, in nanoseconds. Tools that copy a file with its time of modification
/// cannot set that.
#[cfg(unix)]
fn changed(metadata: &Metadata) -> i128 {
    use std::os::unix::fs::MetadataExt;
    i128::from(metadata.ctime()) * 1_000_000_000 + i128::from(metadata.ctime_nsec())
}

/// Not known.
#[cfg(not(unix))]
fn changed(_: &Metadata) -> i128 {
    0
}
