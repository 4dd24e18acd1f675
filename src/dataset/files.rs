//! What all readers need from the file system: sorted listings, bounded reads, names in order.

use super::DatasetError;
use std::cmp::Ordering;
use std::fs::{self, DirEntry, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// The longest label file or manifest that is read, in bytes: a line for each of a million frames.
pub const MAX_LABEL_BYTES: u64 = 64 << 20;

/// What lies directly in a folder, sorted, hidden names left out.
#[derive(Default)]
pub struct Listing {
    /// Folders, and links to folders that do not lead back up.
    pub folders: Vec<PathBuf>,
    /// Everything else.
    pub files: Vec<PathBuf>,
}

impl Listing {
    /// The files that have the extension of an image.
    pub fn images(&self) -> impl Iterator<Item = &PathBuf> {
        self.files.iter().filter(|path| is_image(path))
    }
}

/// Lists a folder.
pub fn list(folder: &Path) -> Result<Listing, DatasetError> {
    let fail = |error| DatasetError::io(folder, error);
    let mut listing = Listing::default();
    for entry in fs::read_dir(folder).map_err(fail)? {
        let entry = entry.map_err(fail)?;
        let path = entry.path();
        if is_hidden(&entry) || leads_back_up(&entry, folder) {
            continue;
        }
        if path.is_dir() { listing.folders.push(path) } else { listing.files.push(path) }
    }
    listing.folders.sort();
    listing.files.sort();
    Ok(listing)
}

/// Reads a regular file of at most `max_bytes`; its size is checked first.
pub fn read_bounded(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    // Before opening: opening a pipe would wait for its writer.
    let metadata = fs::metadata(path)?;
    if !metadata.is_file() {
        return Err(io::Error::other("not a regular file"));
    }
    if metadata.len() > max_bytes {
        let reason = format!("{} bytes long, at most {max_bytes} are read", metadata.len());
        return Err(io::Error::other(reason));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(max_bytes).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads a label file or manifest: UTF-8 text, bounded, not empty.
pub fn read_labels(path: &Path) -> Result<String, DatasetError> {
    let fail = |reason: String| DatasetError::Labels { path: path.to_owned(), reason };
    let bytes = read_bounded(path, MAX_LABEL_BYTES).map_err(|error| fail(error.to_string()))?;
    let text = String::from_utf8(bytes).map_err(|_| fail("not UTF-8 text".to_owned()))?;
    if text.trim().is_empty() { Err(fail("empty: it labels no frame".to_owned())) } else { Ok(text) }
}

/// The last part of a path, as text.
pub fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Orders names as people do: numbers by value, so that `frame_9` comes before `frame_10`.
pub fn natural_order(left: &str, right: &str) -> Ordering {
    runs(left).cmp(runs(right)).then_with(|| left.cmp(right))
}

/// Runs of digits, leading zeros stripped, with their length, and of other characters, with 0.
fn runs(name: &str) -> impl Iterator<Item = (usize, &[u8])> {
    name.as_bytes().chunk_by(|a, b| a.is_ascii_digit() == b.is_ascii_digit()).map(|run| {
        if run.iter().all(u8::is_ascii_digit) {
            let n_zeros = run.iter().take_while(|&&digit| digit == b'0').count();
            (1 + run.len() - n_zeros, &run[n_zeros..])
        } else {
            (0, run)
        }
    })
}

fn is_image(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default();
    ["jpg", "jpeg", "png", "webp", "bmp", "pgm"].iter().any(|known| extension.eq_ignore_ascii_case(known))
}

fn is_hidden(entry: &DirEntry) -> bool {
    entry.file_name().as_encoded_bytes().starts_with(b".")
}

/// Whether an entry is a link to the folder that it lies in, or to one above: walking it would loop.
fn leads_back_up(entry: &DirEntry, folder: &Path) -> bool {
    entry.file_type().is_ok_and(|kind| kind.is_symlink())
        && match (fs::canonicalize(entry.path()), fs::canonicalize(folder)) {
            (Ok(target), Ok(folder)) => folder.starts_with(target),
            _ => false,
        }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_in_names_count_by_value() {
        let mut names = ["f10", "f9", "f009b", "e", "f", "f1.5", "f1.10"];
        names.sort_by(|left, right| natural_order(left, right));
        assert_eq!(names, ["e", "f", "f1.5", "f1.10", "f9", "f009b", "f10"]);
    }

    proptest! {
        #[test]
        fn natural_order_is_numeric_on_numbers(left: u32, right: u32) {
            prop_assert_eq!(natural_order(&left.to_string(), &right.to_string()), left.cmp(&right));
        }
    }
}
