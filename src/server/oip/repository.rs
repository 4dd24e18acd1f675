//! What models there are, and which serve: the protocol's view of the registry.

use super::ModelPath;
use super::problems::{IndexProblems, LoadProblems};
use crate::protocol::event::Event;
use crate::protocol::oip::{IndexEntry, IndexRequest, IndexState, LoadRequest};
use crate::protocol::rest::ModelName;
use crate::server::pool::Panicked;
use crate::server::problem::Problem;
use crate::server::recognize::{self, RecognizeError};
use crate::server::registry::{Choice, LookupError, ServedModel, State as VersionState};
use crate::server::{App, body};
use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use std::sync::Arc;
use tokio::task::spawn_blocking;

/// The model that answers at a path.
pub fn served(app: &App, path: &ModelPath) -> Result<Arc<ServedModel>, LookupError> {
    app.registry.choose(Some(&path.name), &path.version.map_or(Choice::Serving, Choice::Version))
}

/// The versions of a model that can be asked for.
pub fn ready_versions(app: &App, name: &str) -> Result<Vec<String>, LookupError> {
    let versions = app.registry.versions(name)?;
    let ready = versions.states.iter().filter(|(_, state)| matches!(state, VersionState::Ready(_)));
    Ok(ready.map(|(version, _)| version.to_string()).collect())
}

/// Lists the models and their versions
#[utoipa::path(
    post, path = "/v2/repository/index", tag = "inference", security(("key" = [])),
    request_body = Option<IndexRequest>,
    responses((status = OK, description = "All versions of all models", body = Vec<IndexEntry>), IndexProblems)
)]
pub async fn index(State(app): State<App>, request: Request) -> Result<Json<Vec<IndexEntry>>, Problem> {
    let IndexRequest { ready } = body::read_json(&app, request).await?;
    let models = app.registry.models();
    let entries = models.iter().flat_map(|(name, versions)| {
        versions.states.iter().map(|(version, state)| {
            let (state, reason) = match state {
                VersionState::Ready(_) => (IndexState::Ready, String::new()),
                VersionState::Discovered(_) => (IndexState::Unavailable, "not loaded".to_owned()),
                VersionState::Failed(failure) => (IndexState::Unavailable, failure.to_string()),
            };
            IndexEntry { name: name.clone(), version: version.to_string(), state, reason }
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
    params(("name" = String, Path, description = "The model's name")),
    request_body = Option<LoadRequest>,
    responses((status = OK, description = "It serves"), LoadProblems)
)]
pub async fn load(State(app): State<App>, path: ModelPath, request: Request) -> Result<StatusCode, Problem> {
    let LoadRequest { parameters } = body::read_json(&app, request).await?;
    if !parameters.is_empty() {
        return Err(Problem::Query("a model is loaded as it is; leave `parameters` out".into()));
    }
    let versions = app.registry.versions(&path.name)?;
    let (&highest, _) = versions.states.last_key_value().ok_or(LookupError::NoModel(path.name.clone()))?;
    let loading = app.clone();
    let work = move || loading.registry.activate(&path.name, highest, recognize::warm);
    // A panic on the way is a defect of ours.
    let served = spawn_blocking(work).await.map_err(|_| Problem::from(RecognizeError::from(Panicked)))??;
    app.events.tell(|| Event::ModelChanged { to: ModelName::from(&*served) });
    Ok(StatusCode::OK)
}

/// Lets a model serve no longer
#[utoipa::path(
    post, path = "/v2/repository/models/{name}/unload", tag = "inference", security(("key" = [])),
    params(("name" = String, Path, description = "The model's name")),
    responses((status = OK, description = "It serves no longer"), LoadProblems)
)]
pub async fn unload(State(app): State<App>, path: ModelPath) -> Result<StatusCode, Problem> {
    app.registry.versions(&path.name)?;
    Err(Problem::Query("a model that serves is not unloaded here; load or activate another version".into()))
}
