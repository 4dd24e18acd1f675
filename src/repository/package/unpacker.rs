//! Which entries of an archive are taken, whatever its form, and how much of them.

use super::{PackageError, PackageLimits, copy_error, io_error, is_file_of_version};
use roomsight_recognition::model::{GOLDEN_FOLDER, NETWORKS_FOLDER};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// The longest name of a file that common systems take.
const MAX_NAME_BYTES: usize = 255;

/// What an entry is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Folder,
    File,
    /// A link, a device and the like.
    Other,
}

/// Takes the entries of one archive into a folder.
pub(super) struct Unpacker<'a> {
    into: &'a Path,
    limits: &'a PackageLimits,
    n_entries: usize,
    /// The bytes that may still be written.
    n_bytes_left: u64,
    seen: BTreeSet<String>,
    /// The folder in which the archive has the version; not known before the first entry.
    wrapper: Option<Option<String>>,
}

impl<'a> Unpacker<'a> {
    pub fn new(into: &'a Path, limits: &'a PackageLimits) -> Self {
        Self {
            into,
            limits,
            n_entries: 0,
            n_bytes_left: limits.max_bytes,
            seen: BTreeSet::new(),
            wrapper: None,
        }
    }

    /// Counts an entry.
    pub fn count(&mut self) -> Result<(), PackageError> {
        if self.n_entries == self.limits.max_entries {
            return Err(PackageError::TooMany(self.limits.max_entries));
        }
        self.n_entries += 1;
        Ok(())
    }

    /// The path of an entry in the version's folder; none where it needs no file: folders, and what systems
    /// put into archives unasked.
    pub fn place(&mut self, name: Vec<u8>, kind: Kind) -> Result<Option<String>, PackageError> {
        let name = String::from_utf8(name)
            .map_err(|error| wrong(&String::from_utf8_lossy(error.as_bytes()), "its name is no Unicode"))?;
        let path = name.strip_prefix("./").unwrap_or(&name);
        let path = if kind == Kind::Folder { path.trim_end_matches('/') } else { path };
        if is_litter(path) {
            return Ok(None);
        }
        let path = self.unwrapped(path, kind);
        match kind {
            Kind::Folder if ["", ".", GOLDEN_FOLDER, NETWORKS_FOLDER].contains(&path) => Ok(None),
            Kind::Folder => Err(wrong(&name, "no such folder is needed")),
            Kind::Other => Err(wrong(&name, "only plain files are taken, no links, devices or sparse files")),
            Kind::File if path.split('/').any(|part| part.len() > MAX_NAME_BYTES) => {
                Err(wrong(&name, &format!("its name has more than {MAX_NAME_BYTES} bytes")))
            }
            Kind::File if !is_file_of_version(path) => Err(wrong(&name, "unknown name")),
            Kind::File if !self.seen.insert(path.to_owned()) => Err(wrong(&name, "it is there twice")),
            Kind::File => Ok(Some(path.to_owned())),
        }
    }

    /// Writes the file at a path of [`Unpacker::place`], within the limits; returns its number of bytes.
    pub fn write(&mut self, path: &str, from: &mut impl Read) -> Result<u64, PackageError> {
        let limit = self.limits.of(path);
        let file_path = self.into.join(path);
        if let Some(folder) = file_path.parent() {
            fs::create_dir_all(folder).map_err(io_error(folder))?;
        }
        let mut file = File::create_new(&file_path).map_err(io_error(&file_path))?;
        let mut from = from.take(limit.min(self.n_bytes_left) + 1);
        let n_bytes = io::copy(&mut from, &mut file).map_err(copy_error(&file_path))?;
        if n_bytes > limit {
            return Err(wrong(path, &format!("it has more than {limit} bytes")));
        }
        self.n_bytes_left =
            self.n_bytes_left.checked_sub(n_bytes).ok_or(PackageError::TooLarge(self.limits.max_bytes))?;
        Ok(n_bytes)
    }

    /// A path without the folder in which all of the archive lies: many make archives of the version's folder
    /// itself. Whether there is one is told by the first entry.
    fn unwrapped<'p>(&mut self, path: &'p str, kind: Kind) -> &'p str {
        let wrapper = self.wrapper.get_or_insert_with(|| {
            let (first, rest) = path.split_once('/').unwrap_or((path, ""));
            let wraps = kind == Kind::Folder || !rest.is_empty();
            (wraps && !["", ".", "..", GOLDEN_FOLDER, NETWORKS_FOLDER].contains(&first))
                .then(|| first.to_owned())
        });
        match wrapper.as_deref().and_then(|wrapper| path.strip_prefix(wrapper)) {
            Some("") => "",
            Some(rest) => rest.strip_prefix('/').unwrap_or(path),
            None => path,
        }
    }
}

/// What macOS puts into archives: properties of files, and how folders are shown.
fn is_litter(path: &str) -> bool {
    path.split('/').any(|part| part.starts_with("._") || part == ".DS_Store" || part == "__MACOSX")
}

pub(super) fn wrong(entry: &str, reason: &str) -> PackageError {
    PackageError::Entry { entry: entry.to_owned(), reason: reason.to_owned() }
}
