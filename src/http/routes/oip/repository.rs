//! What models there are, and which serve: the protocol's view of the registry.

use super::ModelPath;
use super::problems::{IndexProblems, LoadProblems};
use crate::engine::registry::{Choice, LookupError, RegisteredModel, ServedModel};
use crate::http::by::By;
use crate::http::openapi::NameParam;
use crate::http::routes::models;
use crate::http::{App, body};
use crate::problem::Problem;
use crate::repository::Change;
use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use roomsight_protocol::oip::{IndexEntry, IndexRequest, IndexState, LoadRequest, ModelMetadata};
use std::sync::Arc;

/// The model that answers at a path.
pub fn served(app: &App, path: &ModelPath) -> Result<Arc<ServedModel>, LookupError> {
    app.engine.registry.choose(Some(&path.name), &path.version.map_or(Choice::Serving, Choice::Version), None)
}

/// The versions of a model that can be asked for.
pub fn ready_versions(app: &App, name: &str) -> Result<Vec<u64>, LookupError> {
    Ok(loaded(&app.engine.registry.entry(name)?).collect())
}

/// The versions that are in memory.
pub fn loaded(entry: &RegisteredModel) -> impl Iterator<Item = u64> {
    entry.versions.iter().filter(|(_, version)| version.loaded().is_some()).map(|(&number, _)| number)
}

/// What the model at a path takes and gives.
pub fn metadata(app: &App, path: &ModelPath) -> Result<ModelMetadata, LookupError> {
    let served = served(app, path)?;
    let versions = ready_versions(app, &path.name)?.iter().map(u64::to_string).collect();
    Ok(ModelMetadata::new(&path.name, versions, served.model.rooms().len()))
}

/// Lists the models and their versions
///
/// Triton's extension `model_repository`; without a body all versions are listed, ready or not.
#[utoipa::path(
    post, path = "/v2/repository/index", tag = "inference", security(("key" = [])),
    request_body = Option<IndexRequest>,
    responses((status = OK, description = "All versions of all models", body = Vec<IndexEntry>), IndexProblems)
)]
pub async fn index(State(app): State<App>, request: Request) -> Result<Json<Vec<IndexEntry>>, Problem> {
    let IndexRequest { ready } = body::read_json(&app, request).await?.unwrap_or_default();
    let models = app.engine.registry.entries();
    let entries = models.iter().flat_map(|(name, entry)| {
        entry.versions.iter().map(|(number, version)| {
            let (state, reason) = match version.failure() {
                _ if version.loaded().is_some() => (IndexState::Ready, String::new()),
                Some(failure) => (IndexState::Unavailable, failure.to_string()),
                None => (IndexState::Unavailable, "not loaded".to_owned()),
            };
            IndexEntry { name: name.clone(), version: number.to_string(), state, reason }
        })
    });
    Ok(Json(entries.filter(|entry| !ready || entry.state == IndexState::Ready).collect()))
}

/// Lets the highest version of a model serve
///
/// It is loaded and tried first; until then, and where it does not work, what served serves on. Another
/// version is chosen by `POST /v1/models/{name}/versions/{version}/activate`.
#[utoipa::path(
    post, path = "/v2/repository/models/{name}/load", tag = "inference", security(("key" = [])),
    params(NameParam),
    request_body = Option<LoadRequest>,
    responses((status = OK, description = "It serves"), LoadProblems)
)]
pub async fn load(
    State(app): State<App>,
    by: By,
    path: ModelPath,
    request: Request,
) -> Result<StatusCode, Problem> {
    let LoadRequest { parameters } = body::read_json(&app, request).await?.unwrap_or_default();
    if !parameters.is_empty() {
        return Err(Problem::query("a model is loaded as it is; leave `parameters` out"));
    }
    let entry = app.engine.registry.entry(&path.name)?;
    let (&highest, _) = entry.versions.last_key_value().ok_or(LookupError::NoModel(path.name.clone()))?;
    models::change(&app, by, &path.name, Change::Activate(highest), None).await?;
    Ok(StatusCode::OK)
}

/// Lets a model serve no longer
///
/// None of its versions answers until one is loaded or activated. A body is not looked at.
#[utoipa::path(
    post, path = "/v2/repository/models/{name}/unload", tag = "inference", security(("key" = [])),
    params(NameParam),
    responses((status = OK, description = "It serves no longer"), LoadProblems)
)]
pub async fn unload(State(app): State<App>, by: By, path: ModelPath) -> Result<StatusCode, Problem> {
    models::change(&app, by, &path.name, Change::Unload, None).await?;
    Ok(StatusCode::OK)
}
