//! Who is there, for dashboards.

use crate::engine::fleet::{Everybody, Other};
use crate::engine::recognize::RecognizeError;
use crate::engine::robots::RobotRecord;
use crate::engine::thumbnails::{Thumbnail, ThumbnailKey};
use crate::http::App;
use crate::http::blocking::blocking;
use crate::http::openapi::{FramePictureProblems, ImageBytes, RobotProblems, ViewerProblems};
use crate::http::picture::check_width;
use crate::problem::{Kind, Problem};
use crate::teaching::type_of;
use axum::Json;
use axum::body::Bytes;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Path, Query, State};
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE, ETAG, IF_NONE_MATCH};
use axum::http::{HeaderMap, HeaderName, StatusCode};
use axum::response::{IntoResponse, Response};
use roomsight_protocol::event::{RobotInfo, RobotList};
use roomsight_protocol::fleet::{Scope, ScopeQuery};
use roomsight_protocol::inbox::WidthQuery;
use std::sync::Arc;
use std::time::Instant;

/// The number of the frame that a picture shows.
const X_FRAME: HeaderName = HeaderName::from_static("x-frame");
/// Who is there
///
/// All robots that stream or send requests under a name, those included whose connection broke, and for an hour those
/// that left. With `scope=fleet` also those of other services (the setting `nats`), as these last told of them, without their
/// answers; a robot that several know is told of where it is connected.
#[utoipa::path(
    get, path = "/v1/robots", tag = "dashboards", security(("key" = [])), params(ScopeQuery),
    responses((status = OK, description = "All robots", body = RobotList), ViewerProblems)
)]
pub async fn list_robots(
    State(app): State<App>,
    query: Result<Query<ScopeQuery>, QueryRejection>,
) -> Result<Json<RobotList>, Problem> {
    let Query(ScopeQuery { scope }) = query.map_err(|error| Problem::query(error.body_text()))?;
    let engine = &app.engine;
    let Everybody { own, others } = engine.view(scope).everybody(Instant::now());
    let elsewhere = |other: Other| RobotInfo {
        state: (*other.state).clone(),
        mode: None,
        streaming_s: None,
        answers: Vec::new(),
        ribbon: Vec::new(),
    };
    let mut robots: Vec<RobotInfo> = own.iter().map(|record| engine.robots.info(record)).collect();
    robots.extend(others.into_values().map(elsewhere));
    robots.sort_by(|one, other| one.state.who.id.cmp(&other.state.who.id));
    Ok(Json(RobotList { robots }))
}

/// One robot
///
/// By its name or its stream's; of several streams with one name, the one that began last.
#[utoipa::path(
    get, path = "/v1/robots/{id}", tag = "dashboards", security(("key" = [])),
    params(("id" = String, Path, description = "The robot's name, or its stream's")),
    responses((status = OK, description = "The robot", body = RobotInfo), RobotProblems)
)]
pub async fn show_robot(State(app): State<App>, Path(id): Path<String>) -> Result<Json<RobotInfo>, Problem> {
    Ok(Json(app.engine.robots.info(&*found(&app, &id)?)))
}

/// The robot that is found under this id.
pub(super) fn found(app: &App, id: &str) -> Result<Arc<RobotRecord>, Problem> {
    let engine = &app.engine;
    engine.robots.find(id).ok_or_else(|| {
        let others = engine.view(Scope::Fleet).everybody(Instant::now()).others;
        let service = others.get(id).and_then(|other| other.state.service.as_deref());
        let why = match service {
            Some(service) => format!("the robot {id:?} is at the service {service}, which tells more of it"),
            None => format!("no robot {id:?} is known; GET /v1/robots lists those that are"),
        };
        Problem::new(Kind::NotFound, why)
    })
}

/// A robot's last frame
///
/// As the robot sent it, or as a JPEG that is at most so wide, which may be of a frame that came up to a second before. `ETag` and `X-Frame` are its number, which is also the
/// robot's `frame`. Frames are kept in memory within the setting `live_frames_bytes`: those that came first give way.
#[utoipa::path(
    get, path = "/v1/robots/{id}/frame", tag = "dashboards", security(("key" = [])),
    params(("id" = String, Path, description = "The robot's name, or its stream's"), WidthQuery),
    responses(
        (status = OK, description = "The picture",
            content((ImageBytes = "image/jpeg"), (ImageBytes = "application/octet-stream")),
            headers(
                ("ETag" = String, description = "The frame's number, for `If-None-Match`"),
                ("X-Frame" = u64, description = "The same")
            )),
        (status = NOT_MODIFIED, description = "It is still the frame of `If-None-Match`"),
        FramePictureProblems
    )
)]
pub async fn show_frame(
    State(app): State<App>,
    Path(id): Path<String>,
    query: Result<Query<WidthQuery>, QueryRejection>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let Query(WidthQuery { width }) = query.map_err(|error| Problem::query(error.body_text()))?;
    check_width(width)?;
    let record = found(&app, &id)?;
    let no_frame = || Problem::new(Kind::NotFound, format_args!("no frame of {id:?} is kept"));
    let (number, frame) = app.engine.robots.frame(&record).ok_or_else(no_frame)?;
    let (media_type, Thumbnail { frame: number, jpeg: picture }) = match width {
        None => (type_of(&frame).media_type, Thumbnail { frame: number, jpeg: frame }),
        Some(width) => {
            let key = ThumbnailKey { robot: record.id(), width };
            ("image/jpeg", thumbnail(&app, key, number, frame).await?)
        }
    };
    let etag = format!("\"{number}\"");
    let is_known = headers.get(IF_NONE_MATCH).is_some_and(|known| known == etag.as_str());
    // Pictures may be kept, but it is asked each time whether they are still the last.
    let told = [(ETAG, etag), (X_FRAME, number.to_string()), (CACHE_CONTROL, "no-cache".to_owned())];
    if is_known {
        return Ok((StatusCode::NOT_MODIFIED, told).into_response());
    }
    Ok((told, [(CONTENT_TYPE, media_type)], picture).into_response())
}

async fn thumbnail(app: &App, key: ThumbnailKey, number: u64, frame: Bytes) -> Result<Thumbnail, Problem> {
    if let Some(made) = app.engine.thumbnails.find(&key, number) {
        return Ok(made);
    }
    let _turn = app.engine.thumbnails.turn().await;
    if let Some(made) = app.engine.thumbnails.find(&key, number) {
        return Ok(made);
    }
    let make = move |app: &App| {
        let limits = app.engine.settings.frame_limits();
        app.engine.thumbnails.make(key, number, &frame, limits).map_err(RecognizeError::from)
    };
    blocking(app, make).await
}
