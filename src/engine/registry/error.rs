//! Why a model is not there, or does not come to serve.

use crate::problem::{Kind, Problem};
use crate::repository::{RecordError, RepositoryError};
use roomsight_protocol::version_id::VersionIdError;
use roomsight_recognition::model::{LoadError, Stage, TrialError};

/// Why the repository gives nothing to serve.
#[derive(Debug, thiserror::Error)]
pub enum RegistryError {
    /// It cannot be read.
    #[error(transparent)]
    Repository(#[from] RepositoryError),
    /// No model in it.
    #[error(
        "no model in {0}: put one at NAME/VERSION/model.safetensors in it (VERSION is a whole number), \
         for example with `roomsight train`; with --policy manual the service starts without one"
    )]
    Empty(String),
    /// Models, but none that works.
    #[error("no model in {location} can serve:\n{}", failures.join("\n"))]
    AllFailed {
        location: String,
        /// A line for each version that was tried.
        failures: Vec<String>,
    },
    /// The default model is not among those that serve.
    #[error("the setting `model` names {wanted:?}, which does not serve; these do: {}", serving.join(", "))]
    NoDefault { wanted: String, serving: Vec<String> },
}

/// Why a request gets no model.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
pub enum LookupError {
    /// No model of this name.
    #[error("there is no model {0:?}; GET /v1/models lists those that are")]
    NoModel(String),
    /// No such version of it.
    #[error("the model {0:?} has no version {1}; GET /v1/models/{0} lists those it has")]
    NoVersion(String, u64),
    /// It is there, and does not serve.
    #[error("version {1} of the model {0:?} does not serve; GET /v1/models/{0} tells which does")]
    NotReady(String, u64),
    /// No version carries the label.
    #[error("no version of the model {0:?} serves as {1:?}; leave the label out for the one that serves")]
    NoLabel(String, String),
    /// No version of it serves.
    #[error("no version of the model {0:?} serves; an admin may activate one")]
    NothingServes(String),
    /// The model of requests that name none is not there.
    #[error("the default model {0:?} is not there; name a model, or let an admin make another the default")]
    NoDefault(String),
    /// Nothing serves at all.
    #[error("no model serves yet; an admin may upload or activate one")]
    Empty,
}

/// Why another version does not come to serve, or a version does not come or go.
#[derive(Debug, thiserror::Error)]
pub enum ChangeError {
    /// It is not there.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// It does not work.
    #[error("the version does not come to serve, what served serves on: {0}")]
    Failed(#[from] Failure),
    /// What is to serve was changed since the caller looked.
    #[error(
        "the model is at epoch {current}, If-Match says {expected}: look again at what serves, then decide"
    )]
    Stale {
        /// What the caller thinks.
        expected: u64,
        current: u64,
    },
    /// A younger change has taken effect while this one was loading.
    #[error("a later change took effect while the version was loading; what it chose serves")]
    Superseded,
    /// A model that nothing of serves cannot answer requests that name none.
    #[error("no version of the model {0:?} serves: activate one first, then make it the default")]
    NotServing(String),
    /// The default model is given by a setting.
    #[error(
        "the setting `model` says that {0:?} is the default: change it there, or leave it out and start again"
    )]
    DefaultIsSet(String),
    /// The change makes no sense.
    #[error(transparent)]
    ServingRecord(#[from] RecordError),
    /// It could not be written down, so that nothing was changed.
    #[error(transparent)]
    Repository(#[from] RepositoryError),
}

impl ChangeError {
    /// What kind of problem it is.
    pub fn kind(&self) -> Kind {
        match self {
            Self::Lookup(error) => lookup_kind(error),
            Self::Failed(_) | Self::NotServing(_) => Kind::NotReady,
            Self::Stale { .. } => Kind::StaleEpoch,
            Self::Superseded | Self::DefaultIsSet(_) | Self::ServingRecord(_) => Kind::Conflict,
            Self::Repository(error) => repository_kind(error),
        }
    }

    /// What the disk has said, where it was the disk and callers may know.
    pub fn disk_error(&self) -> Option<&'static str> {
        match self {
            Self::Repository(error) => error.disk_error(),
            _ => None,
        }
    }
}

impl From<LookupError> for Problem {
    fn from(error: LookupError) -> Self {
        Self::new(lookup_kind(&error), error)
    }
}

impl From<ChangeError> for Problem {
    fn from(error: ChangeError) -> Self {
        let hint = error.disk_error();
        Self::new(error.kind(), error).with_hint(hint)
    }
}

fn lookup_kind(error: &LookupError) -> Kind {
    match error {
        LookupError::NoModel(_) | LookupError::NoVersion(..) => Kind::NoSuchModel,
        LookupError::NotReady(..) | LookupError::NoLabel(..) => Kind::NotReady,
        LookupError::NothingServes(_) | LookupError::NoDefault(_) | LookupError::Empty => Kind::NoModel,
    }
}

/// The kind of problem of a repository that does not do what was asked.
pub fn repository_kind(error: &RepositoryError) -> Kind {
    match error {
        RepositoryError::Id(VersionIdError::Name(_)) => Kind::BadRequest,
        RepositoryError::NoVersion(_) => Kind::NoSuchModel,
        RepositoryError::Exists(_)
        | RepositoryError::HalfUploaded(_)
        | RepositoryError::Id(VersionIdError::NoNumber)
        | RepositoryError::ReadOnly(_)
        | RepositoryError::Overtaken { .. }
        | RepositoryError::DefaultOvertaken(_) => Kind::Conflict,
        _ => Kind::NoRepository,
    }
}

/// Why a version does not serve.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error("{stage} failed: {reason}")]
pub struct Failure {
    /// Where on its way it failed.
    pub stage: Stage,
    pub reason: String,
    /// The files could not be reached, or ONNX Runtime is missing: they may be there at the next look.
    pub may_pass: bool,
}

impl Failure {
    /// One that stays as long as the files are the same.
    pub fn new(stage: Stage, reason: String) -> Self {
        Self { stage, reason, may_pass: false }
    }
}

impl From<RepositoryError> for Failure {
    fn from(error: RepositoryError) -> Self {
        let stays = matches!(error, RepositoryError::Damaged { .. } | RepositoryError::NoVersion(_));
        Self { may_pass: !stays, ..Self::new(Stage::Verifying, error.to_string()) }
    }
}

/// Callers may read the reason: it names the file, not where it lies.
impl From<TrialError> for Failure {
    fn from(TrialError { stage, error: LoadError { path, reason, may_pass } }: TrialError) -> Self {
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        Self { may_pass, ..Self::new(stage, format!("{file}: {reason}")) }
    }
}
