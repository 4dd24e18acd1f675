//! What dashboards are told of the service itself.

use crate::http::App;
use crate::http::openapi::ViewerProblems;
use axum::Json;
use axum::extract::State;
use roomsight_protocol::service::{ServiceHistory, ServiceInfo};
use std::time::SystemTime;

/// The service
///
/// What it is and how it is set up.
#[utoipa::path(
    get, path = "/v1/service", tag = "dashboards", security(("key" = [])),
    responses((status = OK, description = "The service", body = ServiceInfo), ViewerProblems)
)]
pub async fn show_service(State(app): State<App>) -> Json<ServiceInfo> {
    let (engine, settings) = (&app.engine, &app.engine.settings);
    let uptime = engine.metrics.uptime();
    let started = SystemTime::now().checked_sub(uptime).unwrap_or(SystemTime::UNIX_EPOCH);
    Json(ServiceInfo {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        started_at: humantime::format_rfc3339_seconds(started).to_string(),
        uptime_s: uptime.as_secs_f64(),
        data: app.teaching.is_some(),
        keys: !engine.keyring.is_open(),
        threads: settings.n_threads(),
        frames_kept: engine.robots.frames().are_kept(),
        lost_after_s: settings.lost_after().as_secs_f64(),
        models_folder: settings.models.display().to_string(),
        webhooks: settings.webhooks.len(),
        mqtt: settings.mqtt.is_set(),
    })
}

/// The last hour
///
/// In points of ten seconds, from the service's own counters.
#[utoipa::path(
    get, path = "/v1/service/history", tag = "dashboards", security(("key" = [])),
    responses((status = OK, description = "The points there are", body = ServiceHistory), ViewerProblems)
)]
pub async fn show_history(State(app): State<App>) -> Json<ServiceHistory> {
    Json(app.engine.history.read())
}
