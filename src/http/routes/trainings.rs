//! The calls about trainings.

use crate::http::App;
use crate::http::blocking::blocking;
use crate::http::body::{BodyError, read_json};
use crate::http::by::By;
use crate::http::openapi::{AddProblems, TeachingProblems};
use crate::problem::Problem;
use axum::Json;
use axum::extract::rejection::PathRejection;
use axum::extract::{Path, Request, State};
use axum::http::StatusCode;
use roomsight_protocol::audit::Deed;
use roomsight_protocol::training::{PublishJson, PublishedVersion, TrainingInfo, TrainingJson, TrainingList};

/// Begins a training
///
/// On a data set, in a process of its own that stands aside for frames; one at a time. Its model serves nobody until
/// somebody publishes it and gives it a label.
#[utoipa::path(
    post, path = "/v1/trainings", tag = "teaching", security(("key" = [])),
    request_body(content = TrainingJson),
    responses((status = ACCEPTED, description = "The training", body = TrainingInfo), AddProblems)
)]
pub async fn begin_training(
    State(app): State<App>,
    by: By,
    request: Request,
) -> Result<(StatusCode, Json<TrainingInfo>), Problem> {
    let empty = || BodyError::Malformed("send the data set and the model's name as JSON".to_owned());
    let wanted = read_json::<TrainingJson>(&app, request).await?.ok_or_else(empty)?;
    let info = blocking(&app, move |app| {
        let info = app.trainer()?.begin(by.who(), &wanted)?;
        by.did(app, Deed::Train, &wanted.model, &format!("training {} on {}", info.id, wanted.set));
        Ok::<_, Problem>(info)
    })
    .await?;
    Ok((StatusCode::ACCEPTED, Json(info)))
}

/// The trainings there were
///
/// With the one that runs.
#[utoipa::path(
    get, path = "/v1/trainings", tag = "teaching", security(("key" = [])),
    responses((status = OK, description = "The newest first", body = TrainingList), TeachingProblems)
)]
pub async fn list_trainings(State(app): State<App>) -> Result<Json<TrainingList>, Problem> {
    Ok(Json(blocking(&app, |app| app.teaching()?.trainings.list()).await?))
}

/// A training
///
/// With what it said and, when it is done, what `roomsight train --json` printed.
#[utoipa::path(
    get, path = "/v1/trainings/{id}", tag = "teaching", security(("key" = [])),
    params(("id" = i64, Path, description = "Its number")),
    responses((status = OK, description = "The training", body = TrainingInfo), TeachingProblems)
)]
pub async fn show_training(
    State(app): State<App>,
    path: Result<Path<i64>, PathRejection>,
) -> Result<Json<TrainingInfo>, Problem> {
    let id = numbered(path)?;
    Ok(Json(blocking(&app, move |app| app.teaching()?.trainings.show(id)).await?))
}

/// Ends a training
///
/// There is no model then.
#[utoipa::path(
    post, path = "/v1/trainings/{id}/cancel", tag = "teaching", security(("key" = [])),
    params(("id" = i64, Path, description = "Its number")),
    responses((status = OK, description = "The training, which ends", body = TrainingInfo), TeachingProblems)
)]
pub async fn cancel_training(
    State(app): State<App>,
    by: By,
    path: Result<Path<i64>, PathRejection>,
) -> Result<Json<TrainingInfo>, Problem> {
    let id = numbered(path)?;
    blocking(&app, move |app| {
        let info = app.teaching()?.trainings.cancel(id)?;
        by.did(app, Deed::Cancel, &info.model, &format!("training {id}"));
        Ok::<_, Problem>(Json(info))
    })
    .await
}

/// Makes the model of a training a version
///
/// The next one of its name, which serves nobody until it gets a label or is activated, whatever the policy. A model that is
/// worse than what served when it was trained is refused, unless `even_if_worse` is said.
#[utoipa::path(
    post, path = "/v1/trainings/{id}/publish", tag = "teaching", security(("key" = [])),
    params(("id" = i64, Path, description = "Its number")),
    request_body(content = Option<PublishJson>),
    responses((status = CREATED, description = "The version", body = PublishedVersion), AddProblems)
)]
pub async fn publish_training(
    State(app): State<App>,
    by: By,
    path: Result<Path<i64>, PathRejection>,
    request: Request,
) -> Result<(StatusCode, Json<PublishedVersion>), Problem> {
    let id = numbered(path)?;
    let PublishJson { even_if_worse } = read_json(&app, request).await?.unwrap_or_default();
    let version = blocking(&app, move |app| {
        let version = app.trainer()?.publish(id, even_if_worse)?;
        let target = format!("{}/{}", version.name, version.version);
        by.did(app, Deed::Publish, &target, &format!("training {id}"));
        Ok::<_, Problem>(version)
    })
    .await?;
    Ok((StatusCode::CREATED, Json(version)))
}

fn numbered(path: Result<Path<i64>, PathRejection>) -> Result<i64, Problem> {
    path.map(|Path(id)| id).map_err(|error| Problem::query(error.body_text()))
}
