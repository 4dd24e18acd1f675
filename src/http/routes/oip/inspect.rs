//! How models are run, and what they have done: what Triton's own tools ask for beside frames.

use super::problems::{ModelProblems, ServerProblems};
use super::{ModelPath, repository};
use crate::http::App;
use crate::http::openapi::{NameParam, VersionParams};
use crate::problem::Problem;
use axum::Json;
use axum::extract::State;
use roomsight_protocol::oip::model_config::ModelConfig;
use roomsight_protocol::oip::statistics::{ModelStatistics, StatisticsList};
use roomsight_recognition::model::MODEL_FILE;

/// How a model is run
///
/// Triton's extension `model_configuration`.
#[utoipa::path(
    get, path = "/v2/models/{name}/config", tag = "inference", security(("key" = [])),
    params(NameParam),
    responses((status = OK, description = "Its configuration", body = ModelConfig), ModelProblems)
)]
pub async fn model_config(State(app): State<App>, path: ModelPath) -> Result<Json<ModelConfig>, Problem> {
    config(&app, &path)
}

/// How a version of a model is run
///
/// Triton's extension `model_configuration`.
#[utoipa::path(
    get, path = "/v2/models/{name}/versions/{version}/config", tag = "inference", security(("key" = [])),
    params(VersionParams),
    responses((status = OK, description = "Its configuration", body = ModelConfig), ModelProblems)
)]
pub async fn version_config(State(app): State<App>, path: ModelPath) -> Result<Json<ModelConfig>, Problem> {
    config(&app, &path)
}

/// What all models have done
///
/// Triton's extension `statistics`: frames since the service started, whatever brought them, and how long they
/// took.
#[utoipa::path(
    get, path = "/v2/models/stats", tag = "inference", security(("key" = [])),
    responses((status = OK, description = "All versions that can answer", body = StatisticsList), ServerProblems)
)]
pub async fn all_statistics(State(app): State<App>) -> Json<StatisticsList> {
    let models = app.engine.registry.entries();
    let versions = models.iter().flat_map(|(name, entry)| {
        let loaded = repository::loaded(entry);
        loaded.map(|version| statistics_of(&app, name, version)).collect::<Vec<_>>()
    });
    Json(StatisticsList { model_stats: versions.collect() })
}

/// What a model has done
///
/// All of its versions that can answer. Triton's extension `statistics`.
#[utoipa::path(
    get, path = "/v2/models/{name}/stats", tag = "inference", security(("key" = [])),
    params(NameParam),
    responses((status = OK, description = "Its versions that can answer", body = StatisticsList), ModelProblems)
)]
pub async fn model_statistics(
    State(app): State<App>,
    path: ModelPath,
) -> Result<Json<StatisticsList>, Problem> {
    statistics(&app, &path)
}

/// What a version of a model has done
///
/// Triton's extension `statistics`.
#[utoipa::path(
    get, path = "/v2/models/{name}/versions/{version}/stats", tag = "inference", security(("key" = [])),
    params(VersionParams),
    responses((status = OK, description = "This version", body = StatisticsList), ModelProblems)
)]
pub async fn version_statistics(
    State(app): State<App>,
    path: ModelPath,
) -> Result<Json<StatisticsList>, Problem> {
    statistics(&app, &path)
}

fn config(app: &App, path: &ModelPath) -> Result<Json<ModelConfig>, Problem> {
    let metadata = repository::metadata(app, path)?;
    let versions = repository::ready_versions(app, &path.name)?;
    Ok(Json(ModelConfig::new(metadata, versions, app.engine.pool.load().n_threads, MODEL_FILE)))
}

fn statistics(app: &App, path: &ModelPath) -> Result<Json<StatisticsList>, Problem> {
    repository::served(app, path)?;
    let versions = match path.version {
        Some(version) => vec![version],
        None => repository::ready_versions(app, &path.name)?,
    };
    let versions = versions.into_iter().map(|version| statistics_of(app, &path.name, version));
    Ok(Json(StatisticsList { model_stats: versions.collect() }))
}

fn statistics_of(app: &App, name: &str, version: u64) -> ModelStatistics {
    ModelStatistics::new(name, version, app.engine.metrics.totals(name, version))
}
