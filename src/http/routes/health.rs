//! Whether the service works, and what its errors mean.

use crate::engine::registry::Choice;
use crate::http::App;
use crate::http::openapi::{LiveProblems, PathProblems, ReadyProblems};
use crate::problem::{Kind, Problem};
use axum::Json;
use axum::extract::{Path, State};
use roomsight_protocol::rest::{Health, KindInfo};

/// Whether the process lives
///
/// It does where it answers.
#[utoipa::path(
    get, path = "/livez", tag = "health", security(),
    responses((status = OK, description = "It lives", body = Health), LiveProblems)
)]
pub async fn live() -> Json<Health> {
    Json(Health { status: "live".to_owned() })
}

/// Whether frames are answered
///
/// A model serves, a frame went through it, and the service is not stopping.
#[utoipa::path(
    get, path = "/readyz", tag = "health", security(),
    responses((status = OK, description = "Frames are answered", body = Health), ReadyProblems)
)]
pub async fn ready(State(app): State<App>) -> Result<Json<Health>, Problem> {
    if app.engine.is_draining() {
        return Err(Problem::draining());
    }
    app.engine.registry.choose(None, &Choice::Serving, None)?;
    Ok(Json(Health { status: "ready".to_owned() }))
}

/// What a kind of problem means
///
/// The `type` of a problem leads here.
#[utoipa::path(
    get, path = "/problems/{name}", tag = "health", security(),
    params(("name" = String, Path, description = "The last part of a problem's `type`", example = "queue-full")),
    responses((status = OK, description = "The kind", body = KindInfo), PathProblems)
)]
pub async fn show_problem(Path(name): Path<String>) -> Result<Json<KindInfo>, Problem> {
    let kind = Kind::all().find(|kind| kind.name() == name);
    kind.map(|kind| Json(KindInfo::from(kind))).ok_or(Kind::NotFound.into())
}
