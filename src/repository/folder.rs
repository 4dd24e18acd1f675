//! A folder `NAME/VERSION/` of models.
//!
//! What is unfinished lies in hidden folders, on the file system of what it is to become, so that one rename makes it
//! a version. Whoever has the repository open holds a lock: the first to open it, and only that one, removes what a
//! killed process left.
//!
//! Operators put folders together as they like: the root, models, versions and files may be links or mounted, lead
//! anywhere, and be exchanged for others while a service runs. So no path is resolved once and for all. Links come
//! from operators alone: nobody uploads one.

use super::record::{MAX_RECORD_BYTES, RECORD_FILE};
use super::{
    DefaultModel, Fingerprint, Listing, RepositoryError, Scan, ServingRecord, check_default_later,
    check_later, io_error, networks, package,
};
use roomsight_protocol::version_id::{DEFAULT_FILE, VersionId, check_name, is_name, version_number};
use roomsight_recognition::model::{self, MODEL_FILE};
use serde::Serialize;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use tempfile::TempDir;

/// What the names of unfinished folders begin with.
const STAGED_PREFIX: &str = ".staged-";

const LOCK_FILE: &str = ".lock";

/// Held while the default model is read and written; [`LOCK_FILE`] is held for as long as the repository is open.
const DEFAULT_LOCK_FILE: &str = ".default.lock";

/// A repository of many models.
#[derive(Debug)]
pub struct Folder {
    root: PathBuf,
    /// Held while the repository is open; none where nothing can be written.
    lock: Mutex<Option<File>>,
}

/// What lies in a folder, by file name.
struct Entry {
    name: String,
    path: PathBuf,
}

impl Folder {
    /// The repository at an absolute path.
    pub(super) fn open(root: PathBuf) -> Result<Self, RepositoryError> {
        let lock = lock(&root).map_err(io_error(&root))?;
        Ok(Self { root, lock: Mutex::new(lock) })
    }

    pub(super) fn root(&self) -> &Path {
        &self.root
    }

    pub(super) fn scan(&self) -> Result<Scan, RepositoryError> {
        let unreadable = |source| RepositoryError::Unreadable { location: self.root.clone(), source };
        let mut scan = Scan::default();
        for Entry { name, path } in visible(&self.root).map_err(unreadable)? {
            if name == DEFAULT_FILE {
                match read_default(&path) {
                    Ok(default) => scan.default = default,
                    Err(error) => drop(scan.foreign.insert(format!("{name}: {error}"))),
                }
                continue;
            }
            match self.listing(&name, &path, &mut scan.foreign) {
                Ok(listing) if listing.versions.is_empty() => {}
                Ok(listing) => {
                    scan.models.insert(name, listing);
                }
                Err(reason) => {
                    scan.foreign.insert(format!("{name}: {reason}"));
                }
            }
        }
        Ok(scan)
    }

    pub(super) fn fetch(&self, id: &VersionId) -> Result<PathBuf, RepositoryError> {
        let path = self.path(id)?;
        if path.join(MODEL_FILE).is_file() { Ok(path) } else { Err(RepositoryError::NoVersion(id.clone())) }
    }

    pub(super) fn stage(&self) -> Result<TempDir, RepositoryError> {
        // The folder may be another one than that which was opened.
        let shared = open_lock(&self.root.join(LOCK_FILE)).ok();
        if let Some(shared) = shared.filter(|file| file.lock_shared().is_ok()) {
            *self.lock.lock().unwrap_or_else(PoisonError::into_inner) = Some(shared);
        }
        stage_in(&self.root)
    }

    pub(super) fn complete(&self, staged: &Path) -> Result<(), RepositoryError> {
        networks::complete(staged, &self.version_folders()).map_err(io_error(staged))
    }

    pub(super) fn publish(&self, id: &VersionId, staged: TempDir) -> Result<(), RepositoryError> {
        let path = self.path(id)?;
        if path.symlink_metadata().is_ok() {
            return Err(RepositoryError::Exists(id.clone()));
        }
        let staged = bring(staged, &self.make_folder(&id.name)?)?;
        networks::share(staged.path(), &self.version_folders());
        model::move_into_place(staged, &path).map_err(|source| match source.kind() {
            // Another process was quicker.
            ErrorKind::AlreadyExists | ErrorKind::DirectoryNotEmpty | ErrorKind::NotADirectory => {
                RepositoryError::Exists(id.clone())
            }
            _ => RepositoryError::Io { path, source },
        })
    }

    pub(super) fn delete(&self, id: &VersionId) -> Result<(), RepositoryError> {
        let path = self.fetch(id)?;
        let folder = self.root.join(&id.name);
        let grave = stage_in(&folder)?;
        let lock = wait_for_lock(&folder.join(LOCK_FILE))?;
        // Another process may have given it a label since its caller looked.
        let record = read_record(&folder.join(RECORD_FILE))?;
        if record.without(id.version).is_err() {
            return Err(RepositoryError::Overtaken { name: id.name.clone(), epoch: record.epoch });
        }
        // Of a link, the link alone.
        fs::rename(&path, grave.path().join(&id.name)).map_err(io_error(&path))?;
        drop(lock);
        sync(&folder)?;
        if let Err(error) = grave.close() {
            tracing::warn!(version = %id, %error, "is deleted, but takes room until the next start");
        }
        Ok(())
    }

    pub(super) fn record(&self, name: &str) -> Result<ServingRecord, RepositoryError> {
        check_name(name)?;
        read_record(&self.root.join(name).join(RECORD_FILE))
    }

    pub(super) fn write_record(&self, name: &str, record: &ServingRecord) -> Result<(), RepositoryError> {
        check_name(name)?;
        let folder = self.make_folder(name)?;
        let path = folder.join(RECORD_FILE);
        let _lock = wait_for_lock(&folder.join(LOCK_FILE))?;
        check_later(name, record, &read_record(&path)?)?;
        replace(&folder, RECORD_FILE, record)
    }

    pub(super) fn default_model(&self) -> Result<Option<DefaultModel>, RepositoryError> {
        read_default(&self.root.join(DEFAULT_FILE))
    }

    pub(super) fn write_default(&self, default: &DefaultModel) -> Result<(), RepositoryError> {
        let path = self.root.join(DEFAULT_FILE);
        let _lock = wait_for_lock(&self.root.join(DEFAULT_LOCK_FILE))?;
        check_default_later(default, read_default(&path)?.as_ref())?;
        replace(&self.root, DEFAULT_FILE, default)
    }

    /// Where a version lies.
    fn path(&self, id: &VersionId) -> Result<PathBuf, RepositoryError> {
        check_name(&id.name)?;
        Ok(self.root.join(&id.name).join(id.version.to_string()))
    }

    /// The folders of all versions, and of what else lies there.
    fn version_folders(&self) -> Vec<PathBuf> {
        let inside = |folder: &Path| visible(folder).unwrap_or_default().into_iter().map(|entry| entry.path);
        inside(&self.root).flat_map(|model| inside(&model)).collect()
    }

    /// The folder of a model, made where it is not there yet.
    fn make_folder(&self, name: &str) -> Result<PathBuf, RepositoryError> {
        let folder = self.root.join(name);
        match fs::create_dir(&folder) {
            Ok(()) => sync(&self.root)?,
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(io_error(&folder)(error)),
        }
        Ok(folder)
    }

    /// What there is of one model. What is no version of it goes to `foreign`.
    fn listing(&self, name: &str, path: &Path, foreign: &mut BTreeSet<String>) -> Result<Listing, String> {
        if !is_name(name) {
            return Err("no name of a model".to_owned());
        }
        if !path.is_dir() {
            return Err("no folder of a model".to_owned());
        }
        let mut listing = Listing::default();
        for Entry { name: entry, path } in visible(path).map_err(|error| error.to_string())? {
            let found = if entry == RECORD_FILE {
                read_record(&path).map(|record| listing.record = record).map_err(|error| error.to_string())
            } else {
                version(&entry, &path).map(|(number, fingerprint)| {
                    listing.versions.insert(number, fingerprint);
                })
            };
            if let Err(reason) = found {
                foreign.insert(format!("{name}/{entry}: {reason}"));
            }
        }
        Ok(listing)
    }
}

/// The version in a folder, or why it is none.
fn version(name: &str, path: &Path) -> Result<(u64, Fingerprint), String> {
    let number = version_number(name);
    let number =
        number.ok_or("no number of a version: name it by a whole number without sign and leading zeros")?;
    if !path.join(MODEL_FILE).is_file() {
        return Err(format!("no version of a model: there is no {MODEL_FILE} in it"));
    }
    Ok((number, Fingerprint::of_folder(path).map_err(|error| error.to_string())?))
}

/// Locks the repository, and cleans it where nobody else has it open. A folder that cannot be written, or
/// lies where there are no locks, is not cleaned.
fn lock(root: &Path) -> io::Result<Option<File>> {
    let Ok(file) = open_lock(&root.join(LOCK_FILE)) else { return Ok(None) };
    if file.try_lock().is_ok() {
        let _ = clean(root);
        for Entry { path, .. } in visible(root)? {
            // What cannot be cleaned only takes room.
            let _ = clean(&path);
        }
        file.unlock()?;
    }
    Ok(file.lock_shared().is_ok().then_some(file))
}

/// The file of a lock. One that another user has made may only be read, which is enough to lock it.
fn open_lock(path: &Path) -> io::Result<File> {
    let writable = File::options().create(true).append(true).open(path);
    writable.or_else(|error| File::open(path).map_err(|_| error))
}

/// Removes the unfinished folders in a folder.
fn clean(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_name().to_string_lossy().starts_with(STAGED_PREFIX) && entry.file_type()?.is_dir() {
            fs::remove_dir_all(entry.path())?;
        }
    }
    Ok(())
}

/// Lets other processes wait until a small file is read and written, where there are locks.
fn wait_for_lock(path: &Path) -> Result<File, RepositoryError> {
    let file = open_lock(path).map_err(io_error(path))?;
    let _ = file.lock();
    Ok(file)
}

/// A new hidden folder.
fn stage_in(folder: &Path) -> Result<TempDir, RepositoryError> {
    tempfile::Builder::new().prefix(STAGED_PREFIX).tempdir_in(folder).map_err(io_error(folder))
}

/// Brings a staged version into the folder of its model, which may lie on another disk.
fn bring(staged: TempDir, folder: &Path) -> Result<TempDir, RepositoryError> {
    let near = stage_in(folder)?;
    match fs::rename(staged.path(), near.path()) {
        Ok(()) => drop(staged.keep()),
        Err(error) if error.kind() == ErrorKind::CrossesDevices => {
            package::copy(staged.path(), near.path()).map_err(io_error(folder))?;
        }
        Err(error) => return Err(io_error(folder)(error)),
    }
    Ok(near)
}

/// Puts a small file in the place of the one that is there.
fn replace(folder: &Path, name: &str, content: &impl Serialize) -> Result<(), RepositoryError> {
    let staged = stage_in(folder)?;
    let (unfinished, path) = (staged.path().join(name), folder.join(name));
    let write = || -> io::Result<()> {
        let mut file = File::create_new(&unfinished)?;
        file.write_all(&serde_json::to_vec_pretty(content)?)?;
        file.sync_all()?;
        fs::rename(&unfinished, &path)
    };
    write().map_err(io_error(&path))?;
    sync(folder)
}

/// What lies in a folder, hidden things left out.
fn visible(folder: &Path) -> io::Result<Vec<Entry>> {
    let mut entries = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if !name.starts_with('.') {
            entries.push(Entry { name, path });
        }
    }
    Ok(entries)
}

fn read_record(path: &Path) -> Result<ServingRecord, RepositoryError> {
    read(path, ServingRecord::from_json).map(Option::unwrap_or_default)
}

fn read_default(path: &Path) -> Result<Option<DefaultModel>, RepositoryError> {
    read(path, DefaultModel::from_json)
}

/// Reads a small file; none where there is no such thing.
fn read<T>(
    path: &Path,
    parse: impl FnOnce(&[u8]) -> Result<T, String>,
) -> Result<Option<T>, RepositoryError> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(io_error(path)(error)),
    };
    let mut json = Vec::new();
    file.take(MAX_RECORD_BYTES).read_to_end(&mut json).map_err(io_error(path))?;
    let parsed =
        parse(&json).map_err(|reason| RepositoryError::ServingRecord { path: path.to_owned(), reason })?;
    Ok(Some(parsed))
}

/// Waits until the names in a folder are on the disk.
fn sync(folder: &Path) -> Result<(), RepositoryError> {
    File::open(folder).and_then(|folder| folder.sync_all()).map_err(io_error(folder))
}

#[cfg(test)]
mod tests;
