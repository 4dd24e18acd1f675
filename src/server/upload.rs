//! A version comes in: its body into a staged folder, tried, published.

use super::App;
use super::models::blocking;
use super::problem::{Kind, Problem, change_kind, repository_kind};
use super::registry::ChangeError;
use crate::repository::package::{Limits, PackageError, unpack};
use crate::repository::{RepositoryError, VersionId};
use axum::body::{Body, Bytes, HttpBody};
use http_body_util::BodyExt;
use std::fs::File;
use std::io::{self, Write};
use std::time::Duration;
use tempfile::TempDir;
use tokio::sync::mpsc::{Receiver, channel};
use tokio::task::spawn_blocking;
use tokio::time::timeout;

/// Pieces of a body between the network and the disk.
const N_PIECES: usize = 4;
/// The body's file in its staged folder.
const BODY_FILE: &str = "body";

/// Why a version does not come in.
#[derive(Debug, thiserror::Error)]
pub enum UploadError {
    /// Nothing in it.
    #[error("the body is empty; send the folder of a version as a tar, or its model.safetensors")]
    Empty,
    /// Too many bytes.
    #[error("the body has more than {limit} bytes; an operator may raise `max_model_bytes`")]
    TooLarge {
        /// The most bytes.
        limit: u64,
    },
    /// Nothing came for too long.
    #[error("nothing came for {} ms; use a faster connection", .0.as_millis())]
    Slow(Duration),
    /// The connection broke.
    #[error("the body broke off: {0}")]
    Broken(String),
    /// Not a version.
    #[error("{}", without_path(.0))]
    Package(#[from] PackageError),
    /// The disk said no.
    #[error("the body cannot be written: {0}")]
    Disk(#[from] io::Error),
    /// No place for it.
    #[error(transparent)]
    Repository(#[from] RepositoryError),
    /// It does not work, or is there already.
    #[error("{}", explained(.0))]
    Refused(#[from] ChangeError),
}

impl UploadError {
    /// What callers know it as.
    pub fn kind(&self) -> Kind {
        match self {
            Self::Empty | Self::Broken(_) => Kind::BadRequest,
            Self::TooLarge { .. } => Kind::TooLarge,
            Self::Slow(_) => Kind::SlowBody,
            Self::Package(PackageError::Io { .. }) | Self::Disk(_) => Kind::NoRepository,
            Self::Package(_) | Self::Refused(ChangeError::Failed(_)) => Kind::NotAModel,
            Self::Repository(error) => repository_kind(error),
            Self::Refused(error) => change_kind(error),
        }
    }
}

/// Takes a version in: tried, published, and found by the registry.
pub async fn upload(app: &App, id: &VersionId, body: Body) -> Result<(), Problem> {
    let limit = app.settings.max_model_bytes;
    if body.size_hint().lower() > limit {
        return Err(UploadError::TooLarge { limit }.into());
    }
    let received = blocking(app, |app| app.registry.stage().map_err(UploadError::from)).await?;
    receive(body, &received, (limit, app.settings.body_timeout())).await?;
    let id = id.clone();
    blocking(app, move |app| publish(app, &id, &received)).await
}

fn publish(app: &App, id: &VersionId, received: &TempDir) -> Result<(), UploadError> {
    let staged = app.registry.stage()?;
    let limits = Limits { max_model_bytes: app.settings.max_model_bytes, ..Limits::default() };
    unpack(&received.path().join(BODY_FILE), staged.path(), &limits)?;
    app.registry.publish(id, staged)?;
    Ok(app.registry.found(id)?)
}

/// Writes a body into a file as it comes; no more than a few pieces of it are in memory.
async fn receive(
    mut body: Body,
    into: &TempDir,
    (limit, patience): (u64, Duration),
) -> Result<(), UploadError> {
    let path = into.path().join(BODY_FILE);
    let (sender, pieces) = channel(N_PIECES);
    let writing = spawn_blocking(move || write(File::create_new(path)?, pieces));
    let mut n_bytes = 0;
    loop {
        let piece = timeout(patience, body.frame()).await.map_err(|_| UploadError::Slow(patience))?;
        let Some(piece) = piece else { break };
        let piece = piece.map_err(|error| UploadError::Broken(error.to_string()))?;
        let Ok(piece) = piece.into_data() else { continue };
        n_bytes += piece.len() as u64;
        if n_bytes > limit {
            return Err(UploadError::TooLarge { limit });
        }
        // Whoever does not take it has met an error, which is told below.
        if sender.send(piece).await.is_err() {
            break;
        }
    }
    drop(sender);
    writing.await.map_err(io::Error::other)??;
    if n_bytes == 0 { Err(UploadError::Empty) } else { Ok(()) }
}

fn write(mut file: File, mut pieces: Receiver<Bytes>) -> io::Result<()> {
    while let Some(piece) = pieces.blocking_recv() {
        file.write_all(&piece)?;
    }
    Ok(())
}

/// Callers may read what is wrong with a file, not where it lies.
fn without_path(error: &PackageError) -> String {
    match error {
        PackageError::Model(error) => error.reason.clone(),
        error => error.to_string(),
    }
}

/// A version that is not taken has never served.
fn explained(error: &ChangeError) -> String {
    match error {
        ChangeError::Failed(failure) => format!("the version is not taken: {failure}"),
        error => error.to_string(),
    }
}
