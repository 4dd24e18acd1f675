//! Why something is not done that people asked for.

use crate::engine::registry::ChangeError;
use crate::problem::{Kind, Problem};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// What went wrong.
#[derive(Debug, thiserror::Error)]
pub enum TeachingError {
    /// The service keeps nothing.
    #[error("this service keeps nothing: start it with --data FOLDER to teach it")]
    NoData,
    /// Two services would write over each other.
    #[error("the data in {} are used by another service; stop it, or give another folder", .0.display())]
    InUse(PathBuf),
    /// What was asked for is not there.
    #[error("{0}")]
    Absent(String),
    /// Something stands in the way.
    #[error("{0}")]
    Conflict(String),
    /// It cannot be done as it was asked.
    #[error("{0}")]
    Invalid(String),
    /// What serves does not change so.
    #[error(transparent)]
    Change(#[from] ChangeError),
    /// The disk said no.
    #[error("{}: {source}", path.display())]
    Io {
        /// What was read or written.
        path: PathBuf,
        source: io::Error,
    },
    /// The database said no.
    #[error("the database of the data directory: {0}")]
    Sql(#[from] rusqlite::Error),
    /// The database cannot be brought up to date.
    #[error("the database of the data directory is of another version of roomsight: {0}")]
    Migration(#[from] rusqlite_migration::Error),
    /// What the database keeps cannot be read.
    #[error("what the database keeps cannot be read: {0}")]
    Json(#[from] serde_json::Error),
    /// The system gives no random numbers.
    #[error("the system gives no random numbers: {0}")]
    Random(#[from] getrandom::Error),
}

impl TeachingError {
    /// Of a file or folder.
    pub fn io(path: &Path) -> impl FnOnce(io::Error) -> Self + use<'_> {
        |source| Self::Io { path: path.to_owned(), source }
    }

    fn is_full(&self) -> bool {
        match self {
            Self::Io { source, .. } => {
                matches!(source.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded)
            }
            Self::Sql(error) => error.sqlite_error_code() == Some(rusqlite::ErrorCode::DiskFull),
            _ => false,
        }
    }

    fn kind(&self) -> Kind {
        match self {
            _ if self.is_full() => Kind::DiskFull,
            Self::NoData => Kind::NoData,
            Self::Absent(_) => Kind::NotFound,
            Self::Conflict(_) => Kind::Conflict,
            Self::Invalid(_) => Kind::BadRequest,
            Self::Change(error) => error.kind(),
            Self::InUse(_)
            | Self::Io { .. }
            | Self::Sql(_)
            | Self::Migration(_)
            | Self::Json(_)
            | Self::Random(_) => Kind::Internal,
        }
    }
}

impl From<TeachingError> for Problem {
    fn from(error: TeachingError) -> Self {
        match error {
            TeachingError::Change(error) => error.into(),
            error => Self::new(error.kind(), error),
        }
    }
}
