//! A folder `NAME/VERSION/` of models.
//!
//! What is unfinished lies in hidden folders of the repository's root, on the same file system, so that one
//! rename makes it a version. Whoever has the repository open holds a lock: the first to open it, and only
//! that one, removes what a killed process left.

use super::name::{check_name, version_number};
use super::record::{MAX_RECORD_BYTES, RECORD_FILE};
use super::{Fingerprint, Listing, Record, RepositoryError, Scan, VersionId, check_later, io_error, is_name};
use crate::model::{self, MODEL_FILE};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// What the names of unfinished folders begin with.
const STAGED_PREFIX: &str = ".staged-";

const LOCK_FILE: &str = ".lock";

/// A repository of many models.
#[derive(Debug)]
pub struct Folder {
    root: PathBuf,
    /// Held while the repository is open; none where nothing can be written.
    _lock: Option<File>,
}

/// What lies in a folder, by file name.
struct Entry {
    name: String,
    path: PathBuf,
}

impl Folder {
    /// The repository in a canonical path.
    pub(super) fn open(root: PathBuf) -> Result<Self, RepositoryError> {
        let lock = lock(&root).map_err(io_error(&root))?;
        Ok(Self { root, _lock: lock })
    }

    pub(super) fn root(&self) -> &Path {
        &self.root
    }

    pub(super) fn scan(&self) -> Result<Scan, RepositoryError> {
        let unreadable = |source| RepositoryError::Unreadable { location: self.root.clone(), source };
        let mut scan = Scan::default();
        for Entry { name, path } in visible(&self.root).map_err(unreadable)? {
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
        let staged = tempfile::Builder::new().prefix(STAGED_PREFIX).tempdir_in(&self.root);
        staged.map_err(io_error(&self.root))
    }

    pub(super) fn publish(&self, id: &VersionId, staged: TempDir) -> Result<(), RepositoryError> {
        let path = self.path(id)?;
        if path.symlink_metadata().is_ok() {
            return Err(RepositoryError::Exists(id.clone()));
        }
        self.make_folder(&id.name)?;
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
        let grave = self.stage()?;
        fs::rename(&path, grave.path().join(&id.name)).map_err(io_error(&path))?;
        sync(&self.root.join(&id.name))?;
        grave.close().map_err(io_error(&path))
    }

    pub(super) fn record(&self, name: &str) -> Result<Record, RepositoryError> {
        check_name(name)?;
        read_record(&self.root.join(name).join(RECORD_FILE))
    }

    pub(super) fn write_record(&self, name: &str, record: &Record) -> Result<(), RepositoryError> {
        check_name(name)?;
        self.make_folder(name)?;
        let folder = self.root.join(name);
        let path = folder.join(RECORD_FILE);
        let _lock = lock_record(&folder).map_err(io_error(&folder))?;
        check_later(name, record, &read_record(&path)?)?;
        let staged = self.stage()?;
        let unfinished = staged.path().join(RECORD_FILE);
        let write = || -> io::Result<()> {
            let mut file = File::create_new(&unfinished)?;
            file.write_all(&serde_json::to_vec_pretty(record)?)?;
            file.sync_all()?;
            fs::rename(&unfinished, &path)
        };
        write().map_err(io_error(&path))?;
        sync(&folder)
    }

    /// Where a version lies.
    fn path(&self, id: &VersionId) -> Result<PathBuf, RepositoryError> {
        check_name(&id.name)?;
        Ok(self.root.join(&id.name).join(id.version.to_string()))
    }

    /// The folder of a model, made where it is not there yet.
    fn make_folder(&self, name: &str) -> Result<(), RepositoryError> {
        let folder = self.root.join(name);
        match fs::create_dir(&folder) {
            Ok(()) => sync(&self.root),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(()),
            Err(error) => Err(io_error(&folder)(error)),
        }
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
                self.version(&entry, &path).map(|(number, fingerprint)| {
                    listing.versions.insert(number, fingerprint);
                })
            };
            if let Err(reason) = found {
                foreign.insert(format!("{name}/{entry}: {reason}"));
            }
        }
        Ok(listing)
    }

    /// The version in a folder, or why it is none.
    fn version(&self, name: &str, path: &Path) -> Result<(u64, Fingerprint), String> {
        let number = version_number(name).ok_or("no number of a version")?;
        if !path.join(MODEL_FILE).is_file() {
            return Err(format!("no version of a model: there is no {MODEL_FILE} in it"));
        }
        let fingerprint = self.check_links(path).and_then(|()| Fingerprint::of_folder(path));
        Ok((number, fingerprint.map_err(|error| error.to_string())?))
    }

    /// Refuses what leads out of the repository: a folder, or a file in it.
    fn check_links(&self, folder: &Path) -> io::Result<()> {
        if !folder.canonicalize()?.starts_with(&self.root) {
            return Err(io::Error::other("it leads out of the repository"));
        }
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            if path.is_dir() {
                self.check_links(&path)?;
            } else if !path.canonicalize()?.starts_with(&self.root) {
                return Err(io::Error::other(format!("{} leads out of the repository", path.display())));
            }
        }
        Ok(())
    }
}

/// Locks the repository, and cleans it where nobody else has it open. A folder that cannot be written, or
/// lies where there are no locks, is not cleaned.
fn lock(root: &Path) -> io::Result<Option<File>> {
    let Ok(file) = File::options().create(true).append(true).open(root.join(LOCK_FILE)) else {
        return Ok(None);
    };
    if file.try_lock().is_ok() {
        for entry in fs::read_dir(root)? {
            let entry = entry?;
            if entry.file_name().to_string_lossy().starts_with(STAGED_PREFIX) && entry.file_type()?.is_dir() {
                fs::remove_dir_all(entry.path())?;
            }
        }
        file.unlock()?;
    }
    Ok(file.lock_shared().is_ok().then_some(file))
}

/// Lets other processes wait until a record is read and written, where there are locks.
fn lock_record(folder: &Path) -> io::Result<File> {
    let file = File::options().create(true).append(true).open(folder.join(LOCK_FILE))?;
    let _ = file.lock();
    Ok(file)
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

fn read_record(path: &Path) -> Result<Record, RepositoryError> {
    let mut json = Vec::new();
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Record::default()),
        Err(error) => return Err(io_error(path)(error)),
    };
    file.take(MAX_RECORD_BYTES).read_to_end(&mut json).map_err(io_error(path))?;
    Record::from_json(&json).map_err(|reason| RepositoryError::Record { path: path.to_owned(), reason })
}

/// Waits until the names in a folder are on the disk.
fn sync(folder: &Path) -> Result<(), RepositoryError> {
    File::open(folder).and_then(|folder| folder.sync_all()).map_err(io_error(folder))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repository::{Canary, Repository};

    fn repository() -> (TempDir, Repository) {
        let root = TempDir::new().unwrap();
        let repository = open(root.path());
        (root, repository)
    }

    fn open(root: &Path) -> Repository {
        Repository::open(root.to_str().unwrap(), Path::new("")).unwrap()
    }

    /// A folder with something that passes for a model.
    fn write_version(folder: &Path, content: &str) {
        fs::create_dir_all(folder).unwrap();
        fs::write(folder.join(MODEL_FILE), content).unwrap();
    }

    fn publish(repository: &Repository, id: &VersionId, content: &str) -> Result<(), RepositoryError> {
        let staged = repository.stage().unwrap();
        write_version(staged.path(), content);
        repository.publish(id, staged)
    }

    fn found(repository: &Repository) -> Vec<String> {
        let models = repository.scan().unwrap().models;
        let ids = |(name, listing): (String, Listing)| {
            listing.versions.into_keys().map(move |version| format!("{name}/{version}")).collect::<Vec<_>>()
        };
        models.into_iter().flat_map(ids).collect()
    }

    #[test]
    fn versions_are_ordered_as_numbers_and_foreign_things_named() {
        let (root, repository) = repository();
        for name in ["lab/9", "lab/10", "lab/latest", "lab/007", ".git/1", "two words/1", "lab/.hidden"] {
            write_version(&root.path().join(name), "");
        }
        fs::create_dir_all(root.path().join("lab/11")).unwrap();
        fs::create_dir_all(root.path().join("empty")).unwrap();
        fs::write(root.path().join("notes.txt"), "").unwrap();
        fs::write(root.path().join("lab/12"), "").unwrap();
        assert_eq!(found(&repository), ["lab/9", "lab/10"]);
        let foreign = repository.scan().unwrap().foreign;
        let named: Vec<&str> = foreign.iter().filter_map(|line| Some(line.split_once(": ")?.0)).collect();
        assert_eq!(named, ["lab/007", "lab/11", "lab/12", "lab/latest", "notes.txt", "two words"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_that_lead_out_are_foreign() {
        use std::os::unix::fs::symlink;
        let (root, repository) = repository();
        let outside = TempDir::new().unwrap();
        write_version(outside.path(), "");
        write_version(&root.path().join("lab/1"), "");
        symlink(outside.path(), root.path().join("lab/2")).unwrap();
        fs::create_dir(root.path().join("lab/3")).unwrap();
        symlink(outside.path().join(MODEL_FILE), root.path().join("lab/3").join(MODEL_FILE)).unwrap();
        symlink(root.path().join("lab/1"), root.path().join("lab/4")).unwrap();
        symlink("nowhere", root.path().join("lab/5")).unwrap();
        assert_eq!(found(&repository), ["lab/1", "lab/4"]);
        let foreign: Vec<String> = repository.scan().unwrap().foreign.into_iter().collect();
        assert_eq!(foreign.len(), 3, "{foreign:?}");
        assert!(foreign[0].starts_with("lab/2: it leads out"), "{foreign:?}");
        assert!(foreign[1].contains("lab/3") && foreign[1].contains("leads out"), "{foreign:?}");
    }

    #[test]
    fn names_lead_nowhere_else() {
        let (_root, repository) = repository();
        for name in ["..", "../lab", "/lab", "a/b", ""] {
            let id = VersionId::new(name, 1);
            assert!(matches!(repository.fetch(&id), Err(RepositoryError::Name(_))), "{name}");
            assert!(matches!(publish(&repository, &id, ""), Err(RepositoryError::Name(_))), "{name}");
            assert!(matches!(repository.delete(&id), Err(RepositoryError::Name(_))), "{name}");
            assert!(matches!(repository.record(name), Err(RepositoryError::Name(_))), "{name}");
            let written = repository.write_record(name, &Record::default());
            assert!(matches!(written, Err(RepositoryError::Name(_))), "{name}");
        }
    }

    #[test]
    fn a_version_is_published_once_and_deleted_once() {
        let (root, repository) = repository();
        let id = VersionId::new("lab", 3);
        assert!(matches!(repository.fetch(&id), Err(RepositoryError::NoVersion(_))));
        publish(&repository, &id, "first").unwrap();
        assert!(matches!(publish(&repository, &id, "second"), Err(RepositoryError::Exists(_))));
        let folder = repository.fetch(&id).unwrap();
        assert_eq!(fs::read_to_string(folder.join(MODEL_FILE)).unwrap(), "first");
        assert_eq!(found(&repository), ["lab/3"]);
        repository.delete(&id).unwrap();
        assert!(matches!(repository.delete(&id), Err(RepositoryError::NoVersion(_))));
        assert_eq!(found(&repository), [""; 0]);
        let left = fs::read_dir(root.path()).unwrap().map(|entry| entry.unwrap().file_name());
        assert_eq!(left.filter(|name| name != LOCK_FILE).collect::<Vec<_>>(), ["lab"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_published_version_can_be_read_by_others() {
        use std::os::unix::fs::PermissionsExt;
        let (_root, repository) = repository();
        let id = VersionId::new("lab", 1);
        publish(&repository, &id, "").unwrap();
        let mode = fs::metadata(repository.fetch(&id).unwrap()).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o755);
    }

    #[test]
    fn the_fingerprint_changes_with_any_file() {
        let (root, repository) = repository();
        let folder = root.path().join("lab/1");
        write_version(&folder, "first");
        let fingerprint = || repository.scan().unwrap().models["lab"].versions[&1].clone();
        let before = fingerprint();
        assert_eq!(fingerprint(), before);
        fs::create_dir(folder.join("golden")).unwrap();
        fs::write(folder.join("golden/kitchen.jpg"), "").unwrap();
        let with_golden = fingerprint();
        assert_ne!(with_golden, before);
        fs::write(folder.join(MODEL_FILE), "longer than before").unwrap();
        assert_ne!(fingerprint(), with_golden);
    }

    #[test]
    fn records_are_kept_and_a_broken_one_stops_nothing_else() {
        let (root, repository) = repository();
        assert_eq!(repository.record("lab").unwrap(), Record::default());
        let canary = Canary { version: 2, share: 0.25 };
        let record = Record::default().activated(1).with_canary(canary).unwrap();
        repository.write_record("lab", &record).unwrap();
        publish(&repository, &VersionId::new("lab", 1), "").unwrap();
        publish(&repository, &VersionId::new("attic", 1), "").unwrap();
        let repository = open(root.path());
        assert_eq!(repository.record("lab").unwrap(), record);
        assert_eq!(repository.scan().unwrap().models["lab"].record, record);
        let late = repository.write_record("lab", &Record::default().activated(2));
        assert!(matches!(late, Err(RepositoryError::Overtaken { epoch: 2, .. })));
        assert_eq!(repository.record("lab").unwrap(), record);
        fs::write(root.path().join("lab").join(RECORD_FILE), "{").unwrap();
        assert!(matches!(repository.record("lab"), Err(RepositoryError::Record { .. })));
        let scan = repository.scan().unwrap();
        assert_eq!(scan.models["lab"].record, Record::default());
        assert!(scan.foreign.iter().any(|line| line.contains(RECORD_FILE)), "{:?}", scan.foreign);
        assert!(scan.models.contains_key("attic"));
    }

    #[test]
    fn what_a_killed_process_left_is_removed_when_nobody_else_is_at_work() {
        let (root, repository) = repository();
        let left = repository.stage().unwrap().keep();
        let other = open(root.path());
        assert!(left.is_dir(), "the first may still be at work in it");
        assert_eq!(found(&other), [""; 0]);
        drop((repository, other));
        let repository = open(root.path());
        assert!(!left.exists());
        let staged = repository.stage().unwrap().path().to_owned();
        assert!(!staged.exists(), "it was dropped");
    }

    #[test]
    fn a_missing_folder_and_a_models_own_folder_say_what_they_are() {
        let root = TempDir::new().unwrap();
        let missing = root.path().join("missing");
        let error = Repository::open(missing.to_str().unwrap(), Path::new("")).unwrap_err().to_string();
        assert!(error.contains("missing"), "{error}");
        write_version(&root.path().join("lab/7"), "");
        let own = open(&root.path().join("lab/7"));
        assert_eq!(found(&own), ["lab/7"]);
        assert!(own.fetch(&VersionId::new("lab", 7)).is_ok());
        assert!(matches!(own.fetch(&VersionId::new("lab", 8)), Err(RepositoryError::NoVersion(_))));
        assert!(matches!(own.stage(), Err(RepositoryError::ReadOnly(_))));
        let written = own.write_record("lab", &Record::default());
        assert!(matches!(written, Err(RepositoryError::ReadOnly(_))));
    }
}
