//! The Open Inference Protocol, `/v2`: the service for clients that speak it already, such as Triton's.
//!
//! | file | what |
//! |---|---|
//! | `infer` | frames in, tensors out, by the same path as all frames |
//! | `repository` | what models there are, and which serve; all that touches the registry |
//! | `inspect` | how models are run, and what they have done, for Triton's tools |
//! | `problems` | what can go wrong, for the OpenAPI document |
//!
//! What travels is in `protocol::oip`.

mod infer;
mod inspect;
mod problems;
mod repository;

use crate::engine::registry::Choice;
use crate::http::App;
use crate::http::openapi::{NameParam, VersionParams};
use crate::problem::Problem;
use axum::Json;
use axum::extract::{FromRequestParts, Path, State};
use axum::http::request::Parts;
use problems::{AnyoneProblems, DrainProblems, ModelProblems, ServerProblems};
use roomsight_protocol::oip::{
    EXTENSIONS, ModelMetadata, ModelReady, ServerLive, ServerMetadata, ServerReady,
};
use roomsight_protocol::rest::version_from_text;
use serde::Deserialize;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// What takes the role robot.
pub fn robots() -> OpenApiRouter<App> {
    OpenApiRouter::new().routes(routes!(infer::infer)).routes(routes!(infer::infer_version))
}

/// What takes the role viewer.
pub fn viewers() -> OpenApiRouter<App> {
    OpenApiRouter::new().routes(routes!(repository::index))
}

/// What takes a key of any role: what clients ask before they send frames.
pub fn holders() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(show_server))
        .routes(routes!(model_metadata))
        .routes(routes!(version_metadata))
        .routes(routes!(model_ready))
        .routes(routes!(version_ready))
        .routes(routes!(inspect::model_config))
        .routes(routes!(inspect::version_config))
        .routes(routes!(inspect::all_statistics))
        .routes(routes!(inspect::model_statistics))
        .routes(routes!(inspect::version_statistics))
}

/// What takes the role admin.
pub fn admins() -> OpenApiRouter<App> {
    OpenApiRouter::new().routes(routes!(repository::load)).routes(routes!(repository::unload))
}

/// What anyone may ask.
pub fn anyone() -> OpenApiRouter<App> {
    OpenApiRouter::new().routes(routes!(server_live)).routes(routes!(server_ready))
}

/// The model that a path names, and the version if it does.
#[derive(Clone, Debug, Deserialize)]
pub struct ModelPath {
    /// The model's name.
    pub name: String,
    /// Its version; left out: the one that serves.
    #[serde(default, deserialize_with = "version_from_text")]
    pub version: Option<u64>,
}

impl FromRequestParts<App> for ModelPath {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Self, Problem> {
        let path = Path::from_request_parts(parts, app).await;
        let Path(path) = path.map_err(|error| Problem::query(error.body_text()))?;
        Ok(path)
    }
}

/// What serves
///
/// The service's name and version, and the protocol's extensions that it knows.
#[utoipa::path(
    get, path = "/v2", tag = "inference", security(("key" = [])),
    responses((status = OK, description = "The service", body = ServerMetadata), ServerProblems)
)]
async fn show_server() -> Json<ServerMetadata> {
    Json(ServerMetadata {
        name: env!("CARGO_PKG_NAME").to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        extensions: EXTENSIONS.map(str::to_owned).to_vec(),
    })
}

/// Whether the process lives
///
/// It does where it answers.
#[utoipa::path(
    get, path = "/v2/health/live", tag = "inference", security(),
    responses((status = OK, description = "It lives", body = ServerLive), AnyoneProblems)
)]
async fn server_live() -> Json<ServerLive> {
    Json(ServerLive { live: true })
}

/// Whether frames are answered
///
/// A model serves, a frame went through it, and the service is not stopping.
#[utoipa::path(
    get, path = "/v2/health/ready", tag = "inference", security(),
    responses((status = OK, description = "Frames are answered", body = ServerReady), DrainProblems)
)]
async fn server_ready(State(app): State<App>) -> Result<Json<ServerReady>, Problem> {
    if app.engine.is_draining() {
        return Err(Problem::draining());
    }
    app.engine.registry.choose(None, &Choice::Serving, None)?;
    Ok(Json(ServerReady { ready: true }))
}

/// What a model takes and gives
///
/// The tensors of the version that serves, and the versions that can be asked for.
#[utoipa::path(
    get, path = "/v2/models/{name}", tag = "inference", security(("key" = [])),
    params(NameParam),
    responses((status = OK, description = "Its tensors", body = ModelMetadata), ModelProblems)
)]
async fn model_metadata(State(app): State<App>, path: ModelPath) -> Result<Json<ModelMetadata>, Problem> {
    metadata(&app, &path)
}

/// What a version of a model takes and gives
///
/// Versions of one model may tell different rooms apart.
#[utoipa::path(
    get, path = "/v2/models/{name}/versions/{version}", tag = "inference", security(("key" = [])),
    params(VersionParams),
    responses((status = OK, description = "Its tensors", body = ModelMetadata), ModelProblems)
)]
async fn version_metadata(State(app): State<App>, path: ModelPath) -> Result<Json<ModelMetadata>, Problem> {
    metadata(&app, &path)
}

/// Whether a model answers
///
/// One of its versions serves; otherwise this is an error.
#[utoipa::path(
    get, path = "/v2/models/{name}/ready", tag = "inference", security(("key" = [])),
    params(NameParam),
    responses((status = OK, description = "It answers", body = ModelReady), ModelProblems)
)]
async fn model_ready(State(app): State<App>, path: ModelPath) -> Result<Json<ModelReady>, Problem> {
    readiness(&app, path)
}

/// Whether a version of a model answers
///
/// It is in memory and can be asked for; otherwise this is an error.
#[utoipa::path(
    get, path = "/v2/models/{name}/versions/{version}/ready", tag = "inference", security(("key" = [])),
    params(VersionParams),
    responses((status = OK, description = "It answers", body = ModelReady), ModelProblems)
)]
async fn version_ready(State(app): State<App>, path: ModelPath) -> Result<Json<ModelReady>, Problem> {
    readiness(&app, path)
}

fn metadata(app: &App, path: &ModelPath) -> Result<Json<ModelMetadata>, Problem> {
    Ok(Json(repository::metadata(app, path)?))
}

fn readiness(app: &App, path: ModelPath) -> Result<Json<ModelReady>, Problem> {
    repository::served(app, &path)?;
    Ok(Json(ModelReady { name: path.name, ready: true }))
}
