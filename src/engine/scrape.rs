//! All metrics as text, those among them that are read only at that moment too.

use super::Engine;
use super::metrics::catalog::{self, Metric};
use super::metrics::{Readings, process};
use super::registry::{Tally, model_info, short_digest};
use roomsight_protocol::rest::{VersionInfo, VersionState};
use std::collections::{BTreeMap, BTreeSet};

/// What is counted and measured, in Prometheus's text form.
pub fn scrape(engine: &Engine) -> String {
    engine.metrics.render() + &read(engine)
}

/// What is so now.
fn read(engine: &Engine) -> String {
    let mut readings = Readings::default();
    let load = engine.pool.load();
    let body_bytes = engine.settings.max_buffered_bytes - engine.body_memory.available_permits();
    let n_event_readers = engine.events.n_readers()
        + engine.live.n_readers()
        + engine.fleet.events.n_readers()
        + engine.fleet_live.n_readers();
    for (metric, value) in [
        (&catalog::QUEUE_DEPTH, load.n_waiting),
        (&catalog::SLOTS, load.n_slots),
        (&catalog::SLOTS_IN_USE, load.n_slots_in_use),
        (&catalog::THREADS, load.n_threads),
        (&catalog::THREADS_BUSY, load.n_running),
        (&catalog::BODY_BYTES, body_bytes),
        (&catalog::EVENT_READERS, n_event_readers),
        (&catalog::LIVE_FRAME_BYTES, engine.robots.frames().n_bytes()),
        (&catalog::TRAINING_RUNNING, usize::from(engine.metrics.beside().is_training())),
        (&catalog::DRAINING, usize::from(engine.is_draining())),
    ] {
        readings.add(metric, value as f64);
    }
    readings.add(&catalog::INBOX_FRAMES, engine.metrics.beside().inbox_frames() as f64);
    readings.add(&catalog::INBOX_BYTES, engine.metrics.beside().inbox_bytes() as f64);
    let is_connected = f64::from(engine.metrics.beside().is_broker_connected());
    let broker = engine.settings.mqtt.is_set().then_some(([""; 0], is_connected));
    readings.add_series(&catalog::MQTT_CONNECTED, broker);
    let is_connected = f64::from(engine.metrics.beside().is_fleet_connected());
    let fleet = engine.settings.nats.is_set().then_some(([""; 0], is_connected));
    readings.add_series(&catalog::NATS_CONNECTED, fleet);
    read_streams(engine, &mut readings);
    read_models(engine, &mut readings);
    readings.add_series(&catalog::BUILD_INFO, [([env!("CARGO_PKG_VERSION")], 1.0)]);
    readings.add(&catalog::UPTIME, engine.metrics.uptime().as_secs_f64());
    let of_process: [(&Metric, Option<f64>); 2] =
        [(&catalog::RESIDENT_MEMORY, process::resident_bytes()), (&catalog::CPU, process::cpu_seconds())];
    for (metric, value) in of_process {
        if let Some(value) = value {
            readings.add(metric, value);
        }
    }
    readings.into_text()
}

fn read_streams(engine: &Engine, readings: &mut Readings) {
    let records = engine.streams.records();
    let (connected, resumable): (Vec<_>, Vec<_>) = records.iter().partition(|record| record.is_connected());
    let robots: BTreeSet<String> = connected.iter().filter_map(|record| record.robot()).collect();
    let counted = [(["connected"], connected.len() as f64), (["resumable"], resumable.len() as f64)];
    readings.add_series(&catalog::STREAMS, counted);
    readings.add(&catalog::ROBOTS, robots.len() as f64);
    let n_lost = engine.robots.all().iter().filter(|record| record.is_lost()).count();
    readings.add(&catalog::ROBOTS_LOST, n_lost as f64);
}

fn read_models(engine: &Engine, readings: &mut Readings) {
    let mut n_by_state = BTreeMap::<String, usize>::new();
    let mut labeled = Vec::new();
    let (mut shadowed, mut distances) = (Vec::new(), Vec::new());
    let (mut known, mut novelties) = (Vec::new(), Vec::new());
    for (name, entry) in &engine.registry.entries() {
        let serving = engine.registry.serving(name);
        for version in model_info(name, entry, &engine.registry).versions {
            *n_by_state.entry(state_name(version.state)).or_default() += 1;
            labeled.extend(version.labels.iter().map(|label| (info(name, &version, label), 1.0)));
        }
        if let Some(stable) = &serving.stable
            && let Some(expected) = stable.expected()
        {
            let labels = || [name.clone(), stable.version.to_string()];
            known.push((labels(), expected.known));
            novelties.extend(expected.novelty.map(|novelty| (labels(), novelty)));
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
    readings.add_series(&catalog::EXPECTED_KNOWN, known);
    readings.add_series(&catalog::EXPECTED_NOVELTY, novelties);
    readings.add_series(&catalog::SHADOW_FRAMES, shadowed);
    readings.add_series(&catalog::SHADOW_DISTANCE, distances);
}

/// As it travels.
fn state_name(state: VersionState) -> String {
    serde_json::to_value(state).ok().and_then(|name| name.as_str().map(str::to_owned)).unwrap_or_default()
}

/// The values of the labels of a version that carries a label.
fn info(model: &str, version: &VersionInfo, label: &str) -> [String; 5] {
    let digest = short_digest(version.digest.as_deref().unwrap_or_default());
    let epoch = version.epoch.unwrap_or_default().to_string();
    [model.to_owned(), version.version.to_string(), label.to_owned(), epoch, digest]
}
