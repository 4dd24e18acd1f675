//! The call about who changed what.

use crate::http::App;
use crate::http::blocking::blocking;
use crate::http::openapi::TeachingProblems;
use crate::problem::Problem;
use axum::Json;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Query, State};
use roomsight_protocol::audit::{AuditList, AuditQuery};

/// Who changed what
///
/// What serves, data sets, keys, rules: everything that was done by a call or by the policy. It only grows.
#[utoipa::path(
    get, path = "/v1/audit", tag = "teaching", security(("key" = [])), params(AuditQuery),
    responses((status = OK, description = "The newest first", body = AuditList), TeachingProblems)
)]
pub async fn list_audit(
    State(app): State<App>,
    query: Result<Query<AuditQuery>, QueryRejection>,
) -> Result<Json<AuditList>, Problem> {
    let Query(query) = query.map_err(|error| Problem::query(error.body_text()))?;
    Ok(Json(blocking(&app, move |app| app.teaching()?.audit.list(&query)).await?))
}
