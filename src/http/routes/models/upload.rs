//! A version comes in: its body into a staged folder, tried, published.

use crate::engine::registry::{ChangeError, repository_kind};
use crate::http::App;
use crate::http::blocking::blocking;
use crate::http::by::By;
use crate::problem::{Kind, Problem};
use crate::repository::package::{PackageError, PackageLimits, unpack};
use crate::repository::{RepositoryError, disk_error};
use axum::body::{Body, Bytes, HttpBody};
use axum::extract::Request;
use axum::http::HeaderMap;
use axum::http::header::{CONTENT_ENCODING, CONTENT_TYPE};
use http_body_util::BodyExt;
use roomsight_protocol::audit::Deed;
use roomsight_protocol::version_id::VersionId;
use std::fs::File;
use std::io::{self, Write};
use std::time::Duration;
use tempfile::TempDir;
use tokio::sync::mpsc::{Receiver, channel};
use tokio::task::spawn_blocking;
use tokio::time::{Instant, timeout_at};

/// Pieces of a body between the network and the disk.
const N_PIECES: usize = 4;
/// The body's file in its staged folder.
const BODY_FILE: &str = "body";
/// An upload of which fewer bytes a second come has stalled: it takes a place from others.
const SLOWEST: u64 = 16 << 10;
/// When to come back where others upload.
const UPLOAD_WAIT: Duration = Duration::from_secs(5);
/// What is sent as a version, for messages.
const TYPES: &str = "application/x-tar, application/gzip, application/zip or application/octet-stream";

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
    /// Too little came for too long.
    #[error("fewer than {} bytes came within {} ms; use a faster connection", least_of(*.0), .0.as_millis())]
    Slow(Duration),
    /// A type that no version has.
    #[error(
        "the type {0:?} is not read here; send a tar, a tar.gz, a zip or a model.safetensors, as {TYPES}"
    )]
    UnsupportedType(String),
    /// Compressed on the way.
    #[error(
        "a body with the Content-Encoding {0:?} is not read here; send it as it is: a tar.gz needs no encoding"
    )]
    Encoded(String),
    /// Others upload.
    #[error("{limit} uploads are under way already; try again after the time in Retry-After")]
    TooMany {
        /// The most uploads at one time.
        limit: usize,
    },
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
    fn kind(&self) -> Kind {
        match self {
            Self::Empty | Self::Broken(_) => Kind::BadRequest,
            Self::TooLarge { .. } => Kind::TooLarge,
            Self::Slow(_) => Kind::SlowBody,
            Self::UnsupportedType(_) | Self::Encoded(_) => Kind::UnsupportedType,
            Self::TooMany { .. } => Kind::QueueFull,
            Self::Package(PackageError::TooLarge(_)) => Kind::TooLarge,
            Self::Package(PackageError::Io { .. }) | Self::Disk(_) => Kind::NoRepository,
            Self::Package(_) | Self::Refused(ChangeError::Failed(_)) => Kind::NotAModel,
            Self::Repository(error) => repository_kind(error),
            Self::Refused(error) => error.kind(),
        }
    }

    fn retry_after(&self) -> Option<Duration> {
        matches!(self, Self::TooMany { .. }).then_some(UPLOAD_WAIT)
    }

    /// What the disk has said, where it was the disk and callers may know.
    fn disk_error(&self) -> Option<&'static str> {
        match self {
            Self::Package(PackageError::Io { source, .. }) | Self::Disk(source) => disk_error(source),
            Self::Repository(error) => error.disk_error(),
            Self::Refused(error) => error.disk_error(),
            _ => None,
        }
    }
}

impl From<UploadError> for Problem {
    fn from(error: UploadError) -> Self {
        let (hint, retry_after) = (error.disk_error(), error.retry_after());
        Self::new(error.kind(), error).with_hint(hint).with_retry_after(retry_after)
    }
}

/// Takes a version in: tried, published, and found by the registry. What can be known of it before its body is
/// looked at first.
pub async fn upload(app: &App, by: &By, id: &VersionId, request: Request) -> Result<(), Problem> {
    check_head(request.headers())?;
    if app.engine.is_draining() {
        return Err(Problem::draining());
    }
    let limit = app.engine.settings.max_model_bytes;
    let body = request.into_body();
    if body.size_hint().lower() > limit {
        return Err(UploadError::TooLarge { limit }.into());
    }
    let full = |_| UploadError::TooMany { limit: app.engine.settings.max_uploads };
    let _place = app.uploads.try_acquire().map_err(full)?;
    let received = blocking(app, |app| app.engine.registry.stage().map_err(UploadError::from)).await?;
    receive(body, &received, limit, app.engine.settings.body_timeout()).await?;
    let (by, id) = (by.clone(), id.clone());
    blocking(app, move |app| {
        publish(app, &id, &received)?;
        by.did(app, Deed::Upload, &id.to_string(), "");
        Ok::<_, UploadError>(())
    })
    .await
}

/// Refuses what cannot be a version. What it is otherwise is told by its bytes: people's programs call archives by
/// many names, and curl calls everything a form.
fn check_head(headers: &HeaderMap) -> Result<(), UploadError> {
    let text = |name| headers.get(name).map(|value| String::from_utf8_lossy(value.as_bytes()).into_owned());
    if let Some(encoding) = text(CONTENT_ENCODING).filter(|encoding| encoding != "identity") {
        return Err(UploadError::Encoded(encoding));
    }
    let media_type = text(CONTENT_TYPE).unwrap_or_default();
    let essence = media_type.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    match essence.as_str() {
        "" | "application/octet-stream" | "binary/octet-stream" | "application/x-www-form-urlencoded" => {
            Ok(())
        }
        "application/x-tar" | "application/tar" | "application/x-gtar" | "application/x-ustar" => Ok(()),
        "application/gzip" | "application/x-gzip" | "application/x-tgz" | "application/x-compressed-tar" => {
            Ok(())
        }
        "application/zip" | "application/x-zip" | "application/x-zip-compressed" => Ok(()),
        _ => Err(UploadError::UnsupportedType(media_type)),
    }
}

fn publish(app: &App, id: &VersionId, received: &TempDir) -> Result<(), UploadError> {
    let staged = app.engine.registry.stage()?;
    let max_bytes = app.engine.settings.max_model_bytes;
    let limits = PackageLimits { max_model_bytes: max_bytes, max_bytes, ..PackageLimits::default() };
    unpack(&received.path().join(BODY_FILE), staged.path(), &limits)?;
    app.engine.registry.publish(id, staged)?;
    Ok(app.engine.registry.found(id)?)
}

/// Writes a body into a file as it comes; no more than a few pieces of it are in memory. In each stretch of time as
/// long as `patience` some of it must come.
async fn receive(mut body: Body, into: &TempDir, limit: u64, patience: Duration) -> Result<(), UploadError> {
    let path = into.path().join(BODY_FILE);
    let (sender, pieces) = channel(N_PIECES);
    let writing = spawn_blocking(move || write(File::create_new(path)?, pieces));
    let mut n_bytes = 0;
    let (mut n_due, mut deadline) = (least_of(patience), Instant::now() + patience);
    loop {
        let Ok(piece) = timeout_at(deadline, body.frame()).await else {
            if n_bytes < n_due {
                return Err(UploadError::Slow(patience));
            }
            (n_due, deadline) = (n_bytes + least_of(patience), Instant::now() + patience);
            continue;
        };
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

/// The bytes that must come within a time, one at least.
fn least_of(time: Duration) -> u64 {
    (SLOWEST as f64 * time.as_secs_f64()).max(1.0) as u64
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
