//! `GET /metrics`, and the metrics that are read only at that moment.

use super::super::api;
use super::catalog::{self, Metric};
use super::process;
use super::recorder::Readings;
use crate::server::App;
use crate::server::openapi::ViewerProblems;
use crate::server::registry::Tally;
use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;
use roomsight_protocol::rest::{VersionInfo, VersionState};
use std::collections::{BTreeMap, BTreeSet};

/// Prometheus's text form.
const MEDIA_TYPE: &str = "text/plain; version=0.0.4; charset=utf-8";
/// How much of a model's digest is shown.
const DIGEST_PREFIX: usize = 16;

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
    ([(header::CONTENT_TYPE, MEDIA_TYPE)], app.metrics.render() + &read(&app))
}

/// What is so now.
fn read(app: &App) -> String {
    let mut readings = Readings::default();
    let load = app.pool.load();
    let body_bytes = app.settings.max_buffered_bytes - app.body_memory.available_permits();
    for (metric, value) in [
        (&catalog::QUEUE_DEPTH, load.n_waiting),
        (&catalog::SLOTS, load.n_slots),
        (&catalog::SLOTS_IN_USE, load.n_slots_in_use),
        (&catalog::THREADS, load.n_threads),
        (&catalog::THREADS_BUSY, load.n_running),
        (&catalog::BODY_BYTES, body_bytes),
        (&catalog::EVENT_READERS, app.events.n_readers()),
        (&catalog::DRAINING, usize::from(app.is_draining())),
    ] {
        readings.add(metric, value as f64);
    }
    read_streams(app, &mut readings);
    read_models(app, &mut readings);
    readings.add_series(&catalog::BUILD_INFO, [([env!("CARGO_PKG_VERSION")], 1.0)]);
    readings.add(&catalog::UPTIME, app.metrics.uptime().as_secs_f64());
    let of_process: [(&Metric, Option<f64>); 2] =
        [(&catalog::RESIDENT_MEMORY, process::resident_bytes()), (&catalog::CPU, process::cpu_seconds())];
    for (metric, value) in of_process {
        if let Some(value) = value {
            readings.add(metric, value);
        }
    }
    readings.into_text()
}

fn read_streams(app: &App, readings: &mut Readings) {
    let records = app.streams.records();
    let (connected, resumable): (Vec<_>, Vec<_>) = records.iter().partition(|record| record.is_connected());
    let robots: BTreeSet<String> = connected.iter().filter_map(|record| record.name().robot).collect();
    let counted = [(["connected"], connected.len() as f64), (["resumable"], resumable.len() as f64)];
    readings.add_series(&catalog::STREAMS, counted);
    readings.add(&catalog::ROBOTS, robots.len() as f64);
}

fn read_models(app: &App, readings: &mut Readings) {
    let mut n_by_state = BTreeMap::<String, usize>::new();
    let mut labeled = Vec::new();
    let (mut shadowed, mut distances) = (Vec::new(), Vec::new());
    for (name, entry) in &app.registry.entries() {
        let serving = app.registry.serving(name);
        for version in api::model_info(name, entry, &app.registry).versions {
            *n_by_state.entry(state_name(version.state)).or_default() += 1;
            labeled.extend(version.labels.iter().map(|label| (info(name, &version, label), 1.0)));
        }
        if let Some(shadow) = &serving.shadow {
            let Tally { n_compared, n_agreed, n_skipped, total_distance } = shadow.tally();
            let outcomes =
                [("agreed", n_agreed), ("differed", n_compared - n_agreed), ("skipped", n_skipped)];
            shadowed.extend(outcomes.map(|(outcome, n)| ([name.clone(), outcome.to_owned()], n as f64)));
            distances.push(([name.clone()], total_distance));
        }
    }
    let counted = n_by_state.into_iter().map(|(state, n_versions)| ([state], n_versions as f64));
    readings.add_series(&catalog::MODEL_VERSIONS, counted);
    readings.add_series(&catalog::MODEL_INFO, labeled);
    readings.add_series(&catalog::SHADOW_FRAMES, shadowed);
    readings.add_series(&catalog::SHADOW_DISTANCE, distances);
}

/// As it travels.
fn state_name(state: VersionState) -> String {
    serde_json::to_value(state).ok().and_then(|name| name.as_str().map(str::to_owned)).unwrap_or_default()
}

/// The values of the labels of a version that carries a label.
fn info(model: &str, version: &VersionInfo, label: &str) -> [String; 5] {
    let digest = version.digest.as_deref().unwrap_or_default().chars().take(DIGEST_PREFIX).collect();
    let epoch = version.epoch.unwrap_or_default().to_string();
    [model.to_owned(), version.version.to_string(), label.to_owned(), epoch, digest]
}
