//! A bucket of an S3-compatible store, as a folder `NAME/VERSION/` under a prefix.
//!
//! A version is there when its `model.json` and its `model.safetensors` are. The first is uploaded before all else, as
//! something new: of two who upload the same version one does, and the other writes nothing. The second is
//! uploaded last. `model.json` is removed first.
//!
//! Networks lie once for all versions under `.networks/`, named by their digests; they are used by the versions whose
//! `model.json` names them. Since that is uploaded first, whoever deletes another version meanwhile leaves them there;
//! whether they are there is looked at last, before `model.safetensors`. A version that was copied into the bucket by
//! hand may have its networks in its own folder.
//!
//! A version is downloaded once, into a cache on the disk. Its folder there is named by a digest of what the bucket says
//! of its files, their ETags, so that it is taken for no other. It enters the cache only when its model has
//! the digest that its `model.json` says.
//!
//! What the bucket had is kept in the cache as well: a service that starts while the bucket cannot be
//! reached serves what it served before.

mod networks;
mod remote;
#[cfg(test)]
mod tests;

use super::package::{self, PackageLimits, is_file_of_version, is_network};
use super::record::{MAX_RECORD_BYTES, RECORD_FILE};
use super::{
    DefaultModel, Fingerprint, Folder, Listing, RepositoryError, Scan, ServingRecord, check_default_later,
    check_later, io_error,
};
use object_store::PutMode;
use object_store::aws::AmazonS3Builder;
use remote::{Object, Remote};
use roomsight_protocol::version_id::{DEFAULT_FILE, VersionId, check_name, is_name, version_number};
use roomsight_recognition::model::{self, ABOUT_FILE, MAX_SIDE_FILE_BYTES, MODEL_FILE, VerifiedFile};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use tempfile::{NamedTempFile, TempDir};

/// What locations in buckets begin with.
pub(super) const SCHEME: &str = "s3://";

/// How long a bucket may be silent before it counts as gone.
const PATIENCE: Duration = Duration::from_secs(20);

/// What the bucket had when it was last seen, in the cache.
const KEPT_FILE: &str = "listing.json";

/// The most digits of a digest in the name of a bucket's cache.
const CACHE_NAME_DIGITS: usize = 16;

/// A repository in a bucket.
#[derive(Debug)]
pub struct Bucket {
    remote: Remote,
    /// Holds a folder for each version that was downloaded, named by its fingerprint.
    cache: Folder,
    seen: Mutex<Seen>,
}

/// What is known of the bucket.
#[derive(Debug, Default)]
struct Seen {
    kept: Kept,
    /// Whether it was seen since it was opened, not before.
    is_current: bool,
}

/// What a start without the bucket needs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
struct Kept {
    models: BTreeMap<String, Listing>,
    default: Option<DefaultModel>,
}

/// The objects of one version.
type Files = Vec<Object>;

impl Bucket {
    /// The bucket at `s3://bucket/prefix`. Who may see it, and where it is, is told by the `AWS_...` of the
    /// environment. It need not be reachable yet.
    pub(super) fn open(location: &str, cache: &Path) -> Result<Self, RepositoryError> {
        Self::connect(AmazonS3Builder::from_env(), location, cache, PATIENCE)
    }

    fn connect(
        builder: AmazonS3Builder,
        location: &str,
        cache: &Path,
        patience: Duration,
    ) -> Result<Self, RepositoryError> {
        roomsight_client::install_provider();
        let remote = Remote::new(builder, location, patience)?;
        let digest = blake3::hash(location.trim_end_matches('/').as_bytes()).to_hex();
        let folder = cache.join(&digest[..CACHE_NAME_DIGITS]);
        let made = fs::create_dir_all(&folder).and_then(|()| folder.canonicalize());
        let cache = Folder::open(made.map_err(io_error(&folder))?)?;
        let kept = kept(&cache.root().join(KEPT_FILE));
        Ok(Self { remote, cache, seen: Mutex::new(Seen { kept, is_current: false }) })
    }

    pub(super) fn scan(&self) -> Result<Scan, RepositoryError> {
        match self.look() {
            Ok(scan) => {
                let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
                if !seen.is_current {
                    self.remove_unlisted(&scan.models);
                }
                let kept = Kept { models: scan.models.clone(), default: scan.default.clone() };
                if seen.kept != kept {
                    self.keep(&kept)?;
                }
                *seen = Seen { kept, is_current: true };
                Ok(scan)
            }
            Err(error) => {
                let seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
                if seen.is_current || seen.kept.models.is_empty() {
                    return Err(error);
                }
                tracing::warn!(%error, "the models that it had when it was last seen are used");
                let Kept { models, default } = seen.kept.clone();
                Ok(Scan { models, default, ..Scan::default() })
            }
        }
    }

    pub(super) fn fetch(&self, id: &VersionId) -> Result<PathBuf, RepositoryError> {
        let seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let listing = seen.kept.models.get(&id.name);
        let known = listing.and_then(|listing| listing.versions.get(&id.version)).cloned();
        drop(seen);
        if let Some(cached) = known.and_then(|fingerprint| self.cached(&fingerprint)) {
            return Ok(cached);
        }
        let files = self.files(id)?;
        let fingerprint = fingerprint(&files).map_err(|_| RepositoryError::NoVersion(id.clone()))?;
        if let Some(cached) = self.cached(&fingerprint) {
            return Ok(cached);
        }
        let staged = self.stage()?;
        self.download(id, &files, staged.path())?;
        super::networks::share(staged.path(), &self.cached_versions());
        let folder = self.cache.root().join(&fingerprint.0);
        match model::move_into_place(staged, &folder) {
            Err(error) if !folder.is_dir() => Err(io_error(&folder)(error)),
            // Or another call was quicker.
            _ => Ok(folder),
        }
    }

    pub(super) fn stage(&self) -> Result<TempDir, RepositoryError> {
        self.cache.stage()
    }

    pub(super) fn publish(&self, id: &VersionId, staged: &TempDir) -> Result<(), RepositoryError> {
        let path = |name: &str| format!("{id}/{name}");
        let bytes_of = |name: &str| {
            let file = staged.path().join(name);
            fs::read(&file).map_err(io_error(&file))
        };
        let about = bytes_of(ABOUT_FILE)?;
        if !self.remote.write(&path(ABOUT_FILE), about.clone(), PutMode::Create)? {
            let is_whole = self.files(id)?.iter().any(|object| object.path == MODEL_FILE);
            let begun = self.remote.read(&path(ABOUT_FILE), MAX_SIDE_FILE_BYTES)?;
            match begun {
                // The upload of the same model broke off, or goes on: both write the same.
                Some((begun, _)) if !is_whole && begun == about => {}
                _ if is_whole => return Err(RepositoryError::Exists(id.clone())),
                _ => return Err(RepositoryError::HalfUploaded(id.clone())),
            }
        }
        let mut left = self.files(id)?;
        left.retain(|object| object.path != ABOUT_FILE);
        self.remove_all(id, &left)?;
        let names = package::names(staged.path()).map_err(io_error(staged.path()))?;
        for name in names.iter().filter(|name| ![ABOUT_FILE, MODEL_FILE].contains(&name.as_str())) {
            if !is_network(name) {
                self.remote.write(&path(name), bytes_of(name)?, PutMode::Overwrite)?;
            }
        }
        self.upload_networks(staged.path(), &names)?;
        self.remote.write(&path(MODEL_FILE), bytes_of(MODEL_FILE)?, PutMode::Overwrite)?;
        Ok(())
    }

    pub(super) fn delete(&self, id: &VersionId) -> Result<(), RepositoryError> {
        let files = self.files(id)?;
        if !files.iter().any(|object| object.path == ABOUT_FILE) {
            return Err(RepositoryError::NoVersion(id.clone()));
        }
        self.remote.remove(&format!("{id}/{ABOUT_FILE}"))?;
        self.remove_all(id, &files)?;
        if let Err(error) = self.remove_unused_networks() {
            tracing::warn!(version = %id, %error, "is deleted, but its networks take room");
        }
        Ok(())
    }

    pub(super) fn record(&self, name: &str) -> Result<ServingRecord, RepositoryError> {
        Ok(self.read_record(name)?.0)
    }

    /// The record, and how another one takes its place as long as nobody else's has.
    fn read_record(&self, name: &str) -> Result<(ServingRecord, PutMode), RepositoryError> {
        check_name(name)?;
        let (record, mode) = self.read(&format!("{name}/{RECORD_FILE}"), ServingRecord::from_json)?;
        Ok((record.unwrap_or_default(), mode))
    }

    pub(super) fn write_record(&self, name: &str, record: &ServingRecord) -> Result<(), RepositoryError> {
        let (current, mode) = self.read_record(name)?;
        check_later(name, record, &current)?;
        let path = format!("{name}/{RECORD_FILE}");
        let json = serde_json::to_vec_pretty(record).map_err(json_error(&path))?;
        if self.remote.write(&path, json, mode)? {
            return Ok(());
        }
        check_later(name, record, &self.record(name)?)
    }

    pub(super) fn default_model(&self) -> Result<Option<DefaultModel>, RepositoryError> {
        Ok(self.read(DEFAULT_FILE, DefaultModel::from_json)?.0)
    }

    pub(super) fn write_default(&self, default: &DefaultModel) -> Result<(), RepositoryError> {
        let (current, mode) = self.read(DEFAULT_FILE, DefaultModel::from_json)?;
        check_default_later(default, current.as_ref())?;
        let json = serde_json::to_vec_pretty(default).map_err(json_error(DEFAULT_FILE))?;
        if self.remote.write(DEFAULT_FILE, json, mode)? {
            return Ok(());
        }
        check_default_later(default, self.default_model()?.as_ref())
    }

    /// A small object, and how another one takes its place as long as nobody else's has.
    fn read<T>(
        &self,
        path: &str,
        parse: impl FnOnce(&[u8]) -> Result<T, String>,
    ) -> Result<(Option<T>, PutMode), RepositoryError> {
        let Some((json, version)) = self.remote.read(path, MAX_RECORD_BYTES)? else {
            return Ok((None, PutMode::Create));
        };
        let parsed =
            parse(&json).map_err(|reason| RepositoryError::ServingRecord { path: path.into(), reason })?;
        Ok((Some(parsed), PutMode::Update(version)))
    }

    /// What the bucket has now.
    fn look(&self) -> Result<Scan, RepositoryError> {
        let mut scan = Scan::default();
        let mut records = Vec::new();
        let mut names_default = false;
        let mut found: BTreeMap<(String, u64), Files> = BTreeMap::new();
        for object in self.remote.list("")? {
            let parts: Vec<&str> = object.path.splitn(3, '/').collect();
            // Empty objects stand for folders.
            if object.n_bytes == 0 || parts.iter().any(|part| part.starts_with('.')) {
                continue;
            }
            match parts[..] {
                [DEFAULT_FILE] => names_default = true,
                [name, RECORD_FILE] if is_name(name) => records.push(name.to_owned()),
                [name, version, path] if is_name(name) && version_number(version).is_some() => {
                    let id = (name.to_owned(), version_number(version).unwrap_or_default());
                    let path = path.to_owned();
                    found.entry(id).or_default().push(Object { path, ..object });
                }
                [name, entry, _] => {
                    scan.foreign.insert(format!("{name}/{entry}: no version of a model"));
                }
                _ => {
                    scan.foreign.insert(format!("{}: no version of a model", object.path));
                }
            }
        }
        for ((name, version), files) in found {
            match fingerprint(&files) {
                Ok(fingerprint) => {
                    scan.models.entry(name).or_default().versions.insert(version, fingerprint);
                }
                Err(missing) => {
                    let reason = "no version of a model, or its upload has not ended";
                    scan.foreign.insert(format!("{name}/{version}: {reason}: there is no {missing} in it"));
                }
            }
        }
        for name in records {
            let Some(listing) = scan.models.get_mut(&name) else { continue };
            match self.record(&name) {
                Ok(record) => listing.record = record,
                Err(error @ RepositoryError::ServingRecord { .. }) => {
                    scan.foreign.insert(format!("{name}/{RECORD_FILE}: {error}"));
                }
                Err(error) => return Err(error),
            }
        }
        if names_default {
            match self.default_model() {
                Ok(default) => scan.default = default,
                Err(error @ RepositoryError::ServingRecord { .. }) => {
                    scan.foreign.insert(format!("{DEFAULT_FILE}: {error}"));
                }
                Err(error) => return Err(error),
            }
        }
        Ok(scan)
    }

    /// What the bucket has of one version, paths relative to it; what no version has is left out.
    fn files(&self, id: &VersionId) -> Result<Files, RepositoryError> {
        check_name(&id.name)?;
        let folder = format!("{id}/");
        let relative = |object: Object| {
            let path = object.path.strip_prefix(&folder)?.to_owned();
            Some(Object { path, ..object })
        };
        Ok(self.remote.list(&folder)?.into_iter().filter_map(relative).collect())
    }

    fn download(&self, id: &VersionId, files: &Files, into: &Path) -> Result<(), RepositoryError> {
        let damaged = |reason: String| RepositoryError::Damaged { id: id.clone(), reason };
        let limits = PackageLimits::default();
        let files: Files = files.iter().filter(|object| is_file_of_version(&object.path)).cloned().collect();
        if files.len() > limits.max_entries {
            return Err(damaged(format!("it has more than {} files", limits.max_entries)));
        }
        let receive = |object: &Object| {
            if object.n_bytes > limits.of(&object.path) {
                return Err(damaged(format!("{} has {} bytes, too many", object.path, object.n_bytes)));
            }
            let remote = Object { path: format!("{id}/{}", object.path), ..object.clone() };
            self.receive(&remote, &into.join(&object.path))
        };
        // First, since nothing else is of use where a network is missing.
        let (about, others): (Files, Files) = files.into_iter().partition(|object| object.path == ABOUT_FILE);
        about.iter().try_for_each(receive)?;
        let entries = model::networks_of(into).map_err(|error| damaged(error.reason))?;
        let shared = self.shared_networks(id, &entries, &others)?;
        others.iter().try_for_each(receive)?;
        shared.iter().try_for_each(|network| self.bring_network(id, network, into))?;
        VerifiedFile::read(into).map_err(|error| damaged(error.reason))?;
        Ok(())
    }

    fn remove_all(&self, id: &VersionId, files: &Files) -> Result<(), RepositoryError> {
        files.iter().try_for_each(|object| self.remote.remove(&format!("{id}/{}", object.path)))
    }

    fn cached(&self, fingerprint: &Fingerprint) -> Option<PathBuf> {
        let folder = self.cache.root().join(&fingerprint.0);
        folder.join(MODEL_FILE).is_file().then_some(folder)
    }

    /// Keeps what the bucket has for a start without it.
    fn keep(&self, kept: &Kept) -> Result<(), RepositoryError> {
        let path = self.cache.root().join(KEPT_FILE);
        let write = || -> io::Result<()> {
            let mut file = NamedTempFile::new_in(self.cache.root())?;
            file.write_all(&serde_json::to_vec(kept)?)?;
            file.as_file().sync_all()?;
            file.persist(&path)?;
            Ok(())
        };
        write().map_err(io_error(&path))
    }

    /// Removes downloaded versions that the bucket has no more. What cannot be removed only takes room.
    fn remove_unlisted(&self, models: &BTreeMap<String, Listing>) {
        let listed: Vec<&str> =
            models.values().flat_map(|listing| listing.versions.values()).map(|of| of.0.as_str()).collect();
        let Ok(entries) = fs::read_dir(self.cache.root()) else { return };
        for entry in entries.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            if !name.starts_with('.') && !listed.contains(&name.as_str()) && entry.path().is_dir() {
                let _ = fs::remove_dir_all(entry.path());
            }
        }
    }
}

/// Of the objects of a version that is complete; else the file that is missing.
fn fingerprint(files: &Files) -> Result<Fingerprint, &'static str> {
    for needed in [MODEL_FILE, ABOUT_FILE] {
        if !files.iter().any(|object| object.path == needed) {
            return Err(needed);
        }
    }
    let line = |object: &Object| format!("{} {} {}", object.path, object.n_bytes, object.tag);
    Ok(Fingerprint::of_lines(files.iter().map(line).collect()))
}

fn json_error(path: &str) -> impl Fn(serde_json::Error) -> RepositoryError {
    move |error| io_error(Path::new(path))(error.into())
}

/// What there was at an earlier time; nothing where nothing was kept, or what was kept is damaged.
fn kept(path: &Path) -> Kept {
    let json = fs::read(path).unwrap_or_default();
    serde_json::from_slice(&json).unwrap_or_default()
}
