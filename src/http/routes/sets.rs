//! The calls about data sets.

use crate::http::App;
use crate::http::blocking::blocking;
use crate::http::body::{BodyError, NamedFrame, NamedFrames, read_json_list};
use crate::http::by::By;
use crate::http::openapi::{AddProblems, BatchForm, ImageBytes, TeachingProblems};
use crate::http::picture;
use crate::problem::Problem;
use crate::teaching::{NewFrame, Place};
use axum::Json;
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{Path, Query, Request, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use roomsight_protocol::audit::Deed;
use roomsight_protocol::event::Event;
use roomsight_protocol::sets::{
    AddQuery, AddedFrames, ChangeJson, FrameList, FramesQuery, SetChange, SetCheck, SetInfo, SetList,
    SetPictureQuery, SetSummary,
};

/// The data sets there are
///
/// Each is a folder `SET/ROOM/DRIVE/FRAME` in the data directory, as `roomsight train` reads it.
#[utoipa::path(
    get, path = "/v1/sets", tag = "teaching", security(("key" = [])),
    responses((status = OK, description = "All data sets", body = SetList), TeachingProblems)
)]
pub async fn list_sets(State(app): State<App>) -> Result<Json<SetList>, Problem> {
    Ok(Json(blocking(&app, |app| app.teaching()?.sets.list()).await?))
}

/// Makes a data set
///
/// One that is there stays as it is.
#[utoipa::path(
    put, path = "/v1/sets/{set}", tag = "teaching", security(("key" = [])),
    params(("set" = String, Path, description = "Its name: letters, digits, `-`, `_` and dots inside")),
    responses(
        (status = CREATED, description = "The new data set", body = SetSummary),
        (status = OK, description = "It was there", body = SetSummary),
        TeachingProblems
    )
)]
pub async fn create_set(
    State(app): State<App>,
    by: By,
    Path(set): Path<String>,
) -> Result<(StatusCode, Json<SetSummary>), Problem> {
    blocking(&app, move |app| {
        let sets = &app.teaching()?.sets;
        let is_new = sets.create(&set)?;
        if is_new {
            by.did(app, Deed::SetCreated, &set, "");
        }
        let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
        Ok::<_, Problem>((status, Json(sets.summary(&set)?)))
    })
    .await
}

/// Takes a data set away
///
/// Its folder is kept for 30 days in the folder `removed` of the data directory.
#[utoipa::path(
    delete, path = "/v1/sets/{set}", tag = "teaching", security(("key" = [])),
    params(("set" = String, Path, description = "Its name")),
    responses((status = NO_CONTENT, description = "It is gone"), TeachingProblems)
)]
pub async fn remove_set(
    State(app): State<App>,
    by: By,
    Path(set): Path<String>,
) -> Result<StatusCode, Problem> {
    blocking(&app, move |app| {
        app.teaching()?.sets.remove(&set)?;
        by.did(app, Deed::SetRemoved, &set, "");
        Ok::<_, Problem>(StatusCode::NO_CONTENT)
    })
    .await
}

/// A data set
///
/// Its rooms and drives, what is missing for a good training, and its last changes.
#[utoipa::path(
    get, path = "/v1/sets/{set}", tag = "teaching", security(("key" = [])),
    params(("set" = String, Path, description = "Its name")),
    responses((status = OK, description = "The data set", body = SetInfo), TeachingProblems)
)]
pub async fn show_set(State(app): State<App>, Path(set): Path<String>) -> Result<Json<SetInfo>, Problem> {
    Ok(Json(blocking(&app, move |app| app.teaching()?.sets.show(&set)).await?))
}

/// The frames of a data set
///
/// By path, in portions.
#[utoipa::path(
    get, path = "/v1/sets/{set}/frames", tag = "teaching", security(("key" = [])),
    params(("set" = String, Path, description = "Its name"), FramesQuery),
    responses((status = OK, description = "Some of its frames", body = FrameList), TeachingProblems)
)]
pub async fn list_frames(
    State(app): State<App>,
    Path(set): Path<String>,
    query: Result<Query<FramesQuery>, QueryRejection>,
) -> Result<Json<FrameList>, Problem> {
    let Query(query) = query.map_err(|error| Problem::query(error.body_text()))?;
    Ok(Json(blocking(&app, move |app| app.teaching()?.sets.frames(&set, &query)).await?))
}

/// The picture of a frame
///
/// The file as it is, or a JPEG that is at most so many pixels wide.
#[utoipa::path(
    get, path = "/v1/sets/{set}/picture", tag = "teaching", security(("key" = [])),
    params(("set" = String, Path, description = "The data set's name"), SetPictureQuery),
    responses(
        (status = OK, description = "The picture", body = ImageBytes, content_type = "image/jpeg",
            headers(("ETag" = String, description = "For `If-None-Match`"))),
        (status = NOT_MODIFIED, description = "It is as it was"),
        TeachingProblems
    )
)]
pub async fn show_picture(
    State(app): State<App>,
    Path(set): Path<String>,
    query: Result<Query<SetPictureQuery>, QueryRejection>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let Query(SetPictureQuery { path, width }) = query.map_err(|error| Problem::query(error.body_text()))?;
    picture::answer(&app, &headers, width, move |app| Ok(app.teaching()?.sets.picture(&set, &path)?)).await
}

/// Adds frames to a data set
///
/// The picture as the body, or several as a form. What is there already, and what is no picture, is named; all others
/// are added by one change, which can be undone.
#[utoipa::path(
    post, path = "/v1/sets/{set}/frames", tag = "teaching", security(("key" = [])),
    params(("set" = String, Path, description = "The data set's name"), AddQuery),
    request_body(content(
        (ImageBytes = "image/jpeg"), (ImageBytes = "image/png"), (ImageBytes = "image/webp"),
        (ImageBytes = "image/bmp"), (ImageBytes = "image/x-portable-graymap"),
        (ImageBytes = "application/octet-stream"), (BatchForm = "multipart/form-data")
    )),
    responses((status = OK, description = "What became of each", body = AddedFrames), AddProblems)
)]
pub async fn add_frames(
    State(app): State<App>,
    by: By,
    Path(set): Path<String>,
    query: Result<Query<AddQuery>, QueryRejection>,
    NamedFrames(frames): NamedFrames,
) -> Result<Json<AddedFrames>, Problem> {
    let Query(AddQuery { room, drive, name }) = query.map_err(|error| Problem::query(error.body_text()))?;
    let place = Place::new(&room, drive.as_deref())?;
    blocking(&app, move |app| {
        let new = |NamedFrame { name: own, frame }: &NamedFrame| NewFrame {
            name: if own.is_empty() { name.clone().unwrap_or_default() } else { own.clone() },
            bytes: frame.bytes.clone(),
        };
        let pictures: Vec<NewFrame> = frames.iter().map(new).collect();
        let added = app.teaching()?.sets.add(&set, by.who(), &place, &pictures)?;
        app.engine.events.tell(Event::SetChanged { set });
        Ok::<_, Problem>(added)
    })
    .await
    .map(Json)
}

/// Changes a data set
///
/// Frames move or go, rooms and drives get other names. All of it is done, or nothing.
#[utoipa::path(
    post, path = "/v1/sets/{set}/changes", tag = "teaching", security(("key" = [])),
    params(("set" = String, Path, description = "The data set's name")),
    request_body(content = ChangeJson),
    responses((status = OK, description = "What was changed", body = SetChange), AddProblems)
)]
pub async fn change_set(
    State(app): State<App>,
    by: By,
    Path(set): Path<String>,
    request: Request,
) -> Result<Json<SetChange>, Problem> {
    let empty = || BodyError::Malformed("send what is to be changed, as JSON".to_owned());
    let change = read_json_list::<ChangeJson>(&app, request).await?.ok_or_else(empty)?;
    blocking(&app, move |app| {
        let change = app.teaching()?.sets.change(&set, by.who(), change)?;
        app.engine.events.tell(Event::SetChanged { set: set.clone() });
        by.did(app, Deed::Change, &set, &format!("{}: {}", change.action, change.text));
        Ok::<_, Problem>(Json(change))
    })
    .await
}

/// Undoes a change of a data set
///
/// Where later changes have moved the same frames, they are to be undone first.
#[utoipa::path(
    post, path = "/v1/sets/{set}/changes/{change}/undo", tag = "teaching", security(("key" = [])),
    params(
        ("set" = String, Path, description = "The data set's name"),
        ("change" = i64, Path, description = "The change's number")
    ),
    responses((status = OK, description = "The change that was undone", body = SetChange), TeachingProblems)
)]
pub async fn undo_change(
    State(app): State<App>,
    by: By,
    path: Result<Path<(String, i64)>, PathRejection>,
) -> Result<Json<SetChange>, Problem> {
    let Path((set, id)) = path.map_err(|error| Problem::query(error.body_text()))?;
    blocking(&app, move |app| {
        let change = app.teaching()?.undo(&set, id)?;
        app.engine.events.tell(Event::SetChanged { set: set.clone() });
        app.teaching()?.tell_inbox(&app.engine)?;
        by.did(app, Deed::Undo, &set, &format!("{}: {}", change.action, change.text));
        Ok::<_, Problem>(Json(change))
    })
    .await
}

/// Looks for what is odd in a data set
///
/// Copies, blurred pictures, labels that the other pictures contradict. It takes about as long as a training, aside of
/// all else; `GET` tells how far it has come.
#[utoipa::path(
    post, path = "/v1/sets/{set}/check", tag = "teaching", security(("key" = [])),
    params(("set" = String, Path, description = "The data set's name")),
    responses((status = ACCEPTED, description = "It is under way", body = SetCheck), TeachingProblems)
)]
pub async fn begin_check(
    State(app): State<App>,
    Path(set): Path<String>,
) -> Result<(StatusCode, Json<SetCheck>), Problem> {
    let check = blocking(&app, move |app| app.teaching()?.sets.begin_check(&set)).await?;
    Ok((StatusCode::ACCEPTED, Json(check)))
}

/// What is odd in a data set
///
/// As the last look found it, since the service started.
#[utoipa::path(
    get, path = "/v1/sets/{set}/check", tag = "teaching", security(("key" = [])),
    params(("set" = String, Path, description = "The data set's name")),
    responses((status = OK, description = "How far it has come, and what was found", body = SetCheck), TeachingProblems)
)]
pub async fn show_check(State(app): State<App>, Path(set): Path<String>) -> Result<Json<SetCheck>, Problem> {
    Ok(Json(blocking(&app, move |app| app.teaching()?.sets.last_check(&set)).await?))
}
