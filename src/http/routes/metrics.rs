//! `GET /metrics`.

use crate::engine::scrape;
use crate::http::App;
use crate::http::openapi::ViewerProblems;
use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;

/// Prometheus's text form.
const MEDIA_TYPE: &str = "text/plain; version=0.0.4; charset=utf-8";

/// What is counted and measured, for Prometheus
///
/// Where the service has keys, give Prometheus one with the role `viewer`: `authorization: {credentials_file:
/// FILE}` in its scrape configuration sends it as `Authorization: Bearer KEY`.
#[utoipa::path(
    get, path = "/metrics", tag = "dashboards", security(("key" = [])),
    responses(
        (status = OK, description = "All metrics in Prometheus's text form", body = String,
            content_type = "text/plain"),
        ViewerProblems
    )
)]
pub async fn scrape(State(app): State<App>) -> impl IntoResponse {
    ([(header::CONTENT_TYPE, MEDIA_TYPE)], scrape::scrape(&app.engine))
}
