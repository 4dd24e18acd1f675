//! The calls about recordings of what robots send.

use super::robots::found;
use crate::engine::recordings::RecordingError;
use crate::http::App;
use crate::http::blocking::blocking;
use crate::http::body::read_json;
use crate::http::by::By;
use crate::http::openapi::{AddProblems, TeachingProblems};
use crate::problem::Problem;
use axum::Json;
use axum::body::Body;
use axum::extract::{Path, Request, State};
use axum::http::StatusCode;
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_LENGTH, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use roomsight_protocol::audit::Deed;
use roomsight_protocol::recording::{RecordJson, RecordingInfo, RecordingList};
use std::time::Duration;
use tokio::fs::File;
use tokio_util::io::ReaderStream;

/// For how long is recorded where nothing is said, and at most, in seconds.
const DEFAULT_SECONDS: u64 = 60;
const MAX_SECONDS: u64 = 86_400;

/// Records a robot
///
/// What it sends from now on, and what it is told, into a file of MCAP in the folder of the setting `record_folder`, as
/// Foxglove and `roomsight train` read it. It ends by itself, by `DELETE`, when the service stops, and where all recordings together
/// reach `record_max_bytes`.
#[utoipa::path(
    post, path = "/v1/robots/{id}/recording", tag = "dashboards", security(("key" = [])),
    params(("id" = String, Path, description = "The robot's name, or its stream's")),
    request_body(content = Option<RecordJson>),
    responses((status = CREATED, description = "The recording", body = RecordingInfo), AddProblems)
)]
pub async fn begin_recording(
    State(app): State<App>,
    by: By,
    Path(id): Path<String>,
    request: Request,
) -> Result<(StatusCode, Json<RecordingInfo>), Problem> {
    let RecordJson { seconds } = read_json::<RecordJson>(&app, request).await?.unwrap_or_default();
    let seconds = seconds.unwrap_or(DEFAULT_SECONDS);
    if !(1..=MAX_SECONDS).contains(&seconds) {
        return Err(Problem::query(format_args!("seconds must be from 1 to {MAX_SECONDS}")));
    }
    let robot = found(&app, &id)?.id();
    let info = blocking(&app, move |app| {
        let info = app.engine.recordings.begin(&robot, Duration::from_secs(seconds))?;
        by.did(app, Deed::Record, &robot, &info.file);
        Ok::<_, Problem>(info)
    });
    Ok((StatusCode::CREATED, Json(info.await?)))
}

/// Ends a recording
///
/// Its file is whole when this is answered.
#[utoipa::path(
    delete, path = "/v1/robots/{id}/recording", tag = "dashboards", security(("key" = [])),
    params(("id" = String, Path, description = "The robot's name, or its stream's")),
    responses((status = OK, description = "What it became", body = RecordingInfo), TeachingProblems)
)]
pub async fn end_recording(
    State(app): State<App>,
    Path(id): Path<String>,
) -> Result<Json<RecordingInfo>, Problem> {
    // One that left is not known for ever, its recording is.
    let robot = app.engine.robots.find(&id).map_or(id, |record| record.id());
    Ok(Json(blocking(&app, move |app| app.engine.recordings.end(&robot)).await?))
}

/// The recordings there are
///
/// Those that run, and the files of those that are over.
#[utoipa::path(
    get, path = "/v1/recordings", tag = "dashboards", security(("key" = [])),
    responses((status = OK, description = "All recordings", body = RecordingList), TeachingProblems)
)]
pub async fn list_recordings(State(app): State<App>) -> Result<Json<RecordingList>, Problem> {
    Ok(Json(blocking(&app, |app| app.engine.recordings.list()).await?))
}

/// The file of a recording
///
/// Of one that is over.
#[utoipa::path(
    get, path = "/v1/recordings/{file}", tag = "dashboards", security(("key" = [])),
    params(("file" = String, Path, description = "What it is called")),
    responses((status = OK, description = "The file", content_type = "application/octet-stream", body = Vec<u8>), TeachingProblems)
)]
pub async fn show_recording(State(app): State<App>, Path(name): Path<String>) -> Result<Response, Problem> {
    let path = blocking(&app, {
        let name = name.clone();
        move |app| app.engine.recordings.path(&name)
    });
    let path = path.await?;
    let opened = async {
        let file = File::open(&path).await?;
        let n_bytes = file.metadata().await?.len();
        Ok((file, n_bytes))
    };
    let (file, n_bytes) = opened.await.map_err(|error| Problem::from(RecordingError::Folder(error)))?;
    let headers = [
        (CONTENT_TYPE, "application/octet-stream".to_owned()),
        (CONTENT_LENGTH, n_bytes.to_string()),
        (CONTENT_DISPOSITION, format!("attachment; filename=\"{name}\"")),
    ];
    Ok((headers, Body::from_stream(ReaderStream::new(file))).into_response())
}

/// Removes a recording
///
/// One that is over.
#[utoipa::path(
    delete, path = "/v1/recordings/{file}", tag = "dashboards", security(("key" = [])),
    params(("file" = String, Path, description = "What it is called")),
    responses((status = NO_CONTENT, description = "It is gone"), TeachingProblems)
)]
pub async fn remove_recording(
    State(app): State<App>,
    Path(name): Path<String>,
) -> Result<StatusCode, Problem> {
    blocking(&app, move |app| app.engine.recordings.remove(&name)).await?;
    Ok(StatusCode::NO_CONTENT)
}
