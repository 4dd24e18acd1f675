//! Which versions of which models there are, and which are to serve.
//!
//! A repository is a folder `NAME/VERSION/`, each version as [`roomsight_recognition::model`] writes it, with a record
//! `NAME/serving.json` of what is to serve. It may also lie in a bucket of an S3-compatible store, or be one
//! model's own folder, which is only read.
//!
//! A version never changes: it is put together in a staged folder and renamed when it is whole. So whoever
//! looks sees all of a version or nothing, whenever the power goes.
//!
//! | file | what |
//! |---|---|
//! | `record`, `change` | what is to serve, and what may be wanted instead |
//! | `default` | which model answers requests that name none |
//! | `folder`, `bucket`, `single` | the kinds of repositories |
//! | `networks` | networks that several versions use, kept once |
//! | `fingerprint` | whether files are those that they were |
//! | `package` | a version as one body, to be uploaded; see there |

mod bucket;
mod change;
mod default;
mod fingerprint;
mod folder;
mod networks;
pub mod package;
mod record;
mod single;

pub use bucket::Bucket;
pub use change::{Change, Role};
pub use default::DefaultModel;
pub use fingerprint::Fingerprint;
pub use folder::Folder;
pub use record::{Canary, RecordError, ServingRecord};
pub use single::Single;

use roomsight_protocol::version_id::{VersionId, VersionIdError};
use roomsight_recognition::model::MODEL_FILE;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Where models come from. All calls wait for the disk or the network.
#[derive(Debug)]
pub enum Repository {
    /// One model's own folder.
    Single(Single),
    /// A folder of many.
    Folder(Folder),
    /// A bucket, or a part of it.
    Bucket(Box<Bucket>),
}

/// What there is in a repository at one time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scan {
    /// The models by name; each has a version at least.
    pub models: BTreeMap<String, Listing>,
    /// What lies there and is no version, each with the reason.
    pub foreign: BTreeSet<String>,
    /// The model of requests that name none, where that was said.
    pub default: Option<DefaultModel>,
}

/// What there is of one model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Listing {
    /// Its versions by number.
    pub versions: BTreeMap<u64, Fingerprint>,
    /// What is to serve.
    pub record: ServingRecord,
}

/// Why a repository does not do what was asked.
#[derive(Debug, thiserror::Error)]
pub enum RepositoryError {
    /// Nothing can be seen.
    #[error("the models at {location} cannot be read: {source}")]
    Unreadable { location: PathBuf, source: io::Error },
    /// What was asked for is called as nothing can be.
    #[error(transparent)]
    Id(#[from] VersionIdError),
    /// It is not there.
    #[error("there is no version {0}")]
    NoVersion(VersionId),
    /// A version never changes.
    #[error("{0} exists already; a version never changes: choose another number")]
    Exists(VersionId),
    /// A model's own folder is no repository.
    #[error(
        "{0} is one model's own folder, in which nothing is changed: give the folder that has it as NAME/VERSION"
    )]
    ReadOnly(PathBuf),
    /// A record that says nothing sensible.
    #[error("the record of what serves, {path}, cannot be read: {reason}; correct or remove it")]
    ServingRecord { path: PathBuf, reason: String },
    /// Somebody else has said what is to serve since it was read.
    #[error("what serves of {name} was changed meanwhile, its epoch is {epoch}: look again, then decide")]
    Overtaken { name: String, epoch: u64 },
    /// Somebody else has said which model is the default.
    #[error("{0} was made the default model meanwhile: look again, then decide")]
    DefaultOvertaken(String),
    /// Somebody else uploads it, or an upload of it broke off.
    #[error(
        "an upload of {0} to the bucket has begun and not ended: wait for it, choose another number, or remove \
         what there is of it with `roomsight models delete {0}`"
    )]
    HalfUploaded(VersionId),
    /// A bucket that cannot be reached, or says no.
    #[error(
        "the bucket {location}: {reason}; AWS_ENDPOINT_URL, AWS_REGION and AWS_ACCESS_KEY_ID tell where it is and who asks"
    )]
    Bucket { location: String, reason: String },
    /// What was downloaded is not what was uploaded.
    #[error("{id} is damaged in the bucket: {reason}; delete it and push it again")]
    Damaged { id: VersionId, reason: String },
    /// A network that a version uses is not there.
    #[error(
        "{id} uses the network {network}, which is not in the bucket: put its file there as {path}, or delete {id} and \
         push it again from its whole folder"
    )]
    NoNetwork {
        id: VersionId,
        /// What the model calls the network.
        network: String,
        /// Where the file belongs.
        path: String,
    },
    /// The disk said no.
    #[error("{path}: {source}")]
    Io {
        /// What was read or written.
        path: PathBuf,
        source: io::Error,
    },
}

impl RepositoryError {
    /// What the disk has said, in words that name no path, where it was the disk and callers may know.
    pub fn disk_error(&self) -> Option<&'static str> {
        match self {
            Self::Io { source, .. } => disk_error(source),
            _ => None,
        }
    }
}

/// What a disk says of a folder of models, in words that name no path; none where callers need not know.
pub fn disk_error(error: &io::Error) -> Option<&'static str> {
    match error.kind() {
        ErrorKind::ReadOnlyFilesystem => Some("the folder of models can only be read"),
        ErrorKind::PermissionDenied => Some("the service may not write into the folder of models"),
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Some("no room is left in the folder of models"),
        ErrorKind::NotFound => Some("the folder of models is not there"),
        _ => None,
    }
}

impl Repository {
    /// Whether a location is one of a bucket.
    pub fn is_bucket(location: &str) -> bool {
        location.starts_with(bucket::SCHEME)
    }

    /// The repository at `location`: a folder `NAME/VERSION/`, one model's own folder, or a bucket
    /// `s3://bucket/prefix`, whose versions are kept in the folder `cache`. What an interrupted upload left in
    /// a folder is removed.
    pub fn open(location: &str, cache: &Path) -> Result<Self, RepositoryError> {
        if Self::is_bucket(location) {
            return Ok(Self::Bucket(Box::new(Bucket::open(location, cache)?)));
        }
        let unreadable = |source| RepositoryError::Unreadable { location: location.into(), source };
        // Links in it are followed anew each time: they may lead elsewhere then.
        let folder = std::path::absolute(location).map_err(unreadable)?;
        let real = folder.canonicalize().map_err(unreadable)?;
        if folder.join(MODEL_FILE).is_file() {
            return Ok(Self::Single(Single::new(folder, &real)));
        }
        Ok(Self::Folder(Folder::open(folder)?))
    }

    /// What there is now.
    pub fn scan(&self) -> Result<Scan, RepositoryError> {
        match self {
            Self::Single(single) => single.scan(),
            Self::Folder(folder) => folder.scan(),
            Self::Bucket(bucket) => bucket.scan(),
        }
    }

    /// The local folder of a version, with all of its files. A bucket's is downloaded first.
    pub fn fetch(&self, id: &VersionId) -> Result<PathBuf, RepositoryError> {
        match self {
            Self::Single(single) => single.fetch(id),
            Self::Folder(folder) => folder.fetch(id),
            Self::Bucket(bucket) => bucket.fetch(id),
        }
    }

    /// A new folder in which a version is put together. Nobody takes it for a version; it is removed when it
    /// is dropped or, where the process was killed, when the repository is opened again.
    pub fn stage(&self) -> Result<TempDir, RepositoryError> {
        match self {
            Self::Single(single) => Err(single.read_only()),
            Self::Folder(folder) => folder.stage(),
            Self::Bucket(bucket) => bucket.stage(),
        }
    }

    /// Gives the version in a staged folder those of its networks that it came without and the repository has.
    pub fn complete(&self, staged: &Path) -> Result<(), RepositoryError> {
        match self {
            Self::Single(single) => Err(single.read_only()),
            Self::Folder(folder) => folder.complete(staged),
            Self::Bucket(bucket) => bucket.complete(staged),
        }
    }

    /// Makes a staged folder a version. When this returns it is on the disk.
    pub fn publish(&self, id: &VersionId, staged: TempDir) -> Result<(), RepositoryError> {
        match self {
            Self::Single(single) => Err(single.read_only()),
            Self::Folder(folder) => folder.publish(id, staged),
            Self::Bucket(bucket) => bucket.publish(id, &staged),
        }
    }

    /// Removes a version, all of it at once.
    pub fn delete(&self, id: &VersionId) -> Result<(), RepositoryError> {
        match self {
            Self::Single(single) => Err(single.read_only()),
            Self::Folder(folder) => folder.delete(id),
            Self::Bucket(bucket) => bucket.delete(id),
        }
    }

    /// What is to serve of a model; the default where nothing was said yet.
    pub fn record(&self, name: &str) -> Result<ServingRecord, RepositoryError> {
        match self {
            Self::Single(_) => Ok(ServingRecord::default()),
            Self::Folder(folder) => folder.record(name),
            Self::Bucket(bucket) => bucket.record(name),
        }
    }

    /// Says what is to serve of a model: a record one or more epochs later than the one that is there. When
    /// this returns it is on the disk.
    pub fn write_record(&self, name: &str, record: &ServingRecord) -> Result<(), RepositoryError> {
        match self {
            Self::Single(single) => Err(single.read_only()),
            Self::Folder(folder) => folder.write_record(name, record),
            Self::Bucket(bucket) => bucket.write_record(name, record),
        }
    }

    /// The model of requests that name none, where that was said.
    pub fn default_model(&self) -> Result<Option<DefaultModel>, RepositoryError> {
        match self {
            Self::Single(_) => Ok(None),
            Self::Folder(folder) => folder.default_model(),
            Self::Bucket(bucket) => bucket.default_model(),
        }
    }

    /// Says which model answers requests that name none, one or more epochs later than what was said. When this
    /// returns it is on the disk.
    pub fn write_default(&self, default: &DefaultModel) -> Result<(), RepositoryError> {
        match self {
            Self::Single(single) => Err(single.read_only()),
            Self::Folder(folder) => folder.write_default(default),
            Self::Bucket(bucket) => bucket.write_default(default),
        }
    }
}

/// Whether a record may take the place of the one that is there.
fn check_later(name: &str, record: &ServingRecord, current: &ServingRecord) -> Result<(), RepositoryError> {
    if record.epoch > current.epoch {
        return Ok(());
    }
    Err(RepositoryError::Overtaken { name: name.to_owned(), epoch: current.epoch })
}

/// Whether a default may take the place of the one that is there.
fn check_default_later(
    default: &DefaultModel,
    current: Option<&DefaultModel>,
) -> Result<(), RepositoryError> {
    match current.filter(|current| current.epoch >= default.epoch) {
        Some(current) => Err(RepositoryError::DefaultOvertaken(current.model.clone())),
        None => Ok(()),
    }
}

fn io_error(path: &Path) -> impl Fn(io::Error) -> RepositoryError {
    move |source| RepositoryError::Io { path: path.to_owned(), source }
}
