//! All metrics by name: the one source of what a scrape says of them, and of `docs/METRICS.md`.

/// A metric, and what its series differ in.
pub struct Metric {
    /// Its name, with its unit, as Prometheus asks.
    pub name: &'static str,
    /// What kind of number it is.
    pub kind: MetricKind,
    /// The names of its labels.
    pub labels: &'static [&'static str],
    /// What it tells.
    pub help: &'static str,
}

/// What kind of number a metric is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MetricKind {
    /// Only grows.
    Counter,
    /// What is so now.
    Gauge,
    /// How often which value occurred; the upper bounds of its buckets.
    Histogram(&'static [f64]),
}

/// From a quarter of a millisecond to ten seconds: doubled where frames are answered, coarser above.
const SECONDS: &[f64] =
    &[0.000_25, 0.000_5, 0.001, 0.002, 0.004, 0.008, 0.016, 0.032, 0.064, 0.125, 0.25, 0.5, 1.0, 2.5, 10.0];

/// From 0 to 1, finer at both ends.
const SHARES: &[f64] = &[0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0];

impl MetricKind {
    /// Its name for Prometheus.
    pub fn name(self) -> &'static str {
        match self {
            Self::Counter => "counter",
            Self::Gauge => "gauge",
            Self::Histogram(_) => "histogram",
        }
    }
}

const fn counter(name: &'static str, labels: &'static [&'static str], help: &'static str) -> Metric {
    Metric { name, kind: MetricKind::Counter, labels, help }
}

const fn gauge(name: &'static str, labels: &'static [&'static str], help: &'static str) -> Metric {
    Metric { name, kind: MetricKind::Gauge, labels, help }
}

const fn seconds(name: &'static str, labels: &'static [&'static str], help: &'static str) -> Metric {
    Metric { name, kind: MetricKind::Histogram(SECONDS), labels, help }
}

const fn shares(name: &'static str, labels: &'static [&'static str], help: &'static str) -> Metric {
    Metric { name, kind: MetricKind::Histogram(SHARES), labels, help }
}

/// Requests that were answered.
pub const REQUESTS: Metric = counter(
    "roomsight_requests_total",
    &["route", "method", "status"],
    "Requests that were answered. The route is a path of the API, or (none); the beginning of a stream counts \
     as one.",
);
/// How long requests took.
pub const REQUEST_DURATION: Metric = seconds(
    "roomsight_request_duration_seconds",
    &["route"],
    "From the head of a request to the head of its answer.",
);
/// Frames with an answer or an error.
pub const FRAMES: Metric = counter(
    "roomsight_frames_total",
    &["model", "version", "transport", "outcome"],
    "Frames by what became of them: answered, a kind of problem, or caller-left. Transports are rest, \
     stream and oip.",
);
/// Frames of streams without either.
pub const DROPS: Metric = counter(
    "roomsight_frames_dropped_total",
    &["reason"],
    "Frames of streams that were not looked at: superseded, deadline, overload, draining, or lost with the service \
     that had accepted them.",
);
/// Where the time of frames goes.
pub const STAGE_DURATION: Metric = seconds(
    "roomsight_frame_stage_duration_seconds",
    &["model", "stage"],
    "Where the time of answered frames went: queue, decode, features, classify.",
);
/// Streams that were elsewhere before.
pub const TAKEOVERS: Metric = counter(
    "roomsight_stream_takeovers_total",
    &["outcome"],
    "Streams that robots brought from a service that is gone: done, or refused, when they began anew.",
);
/// Rooms that were answered.
pub const ANSWERS: Metric = counter(
    "roomsight_answers_total",
    &["model", "room", "known"],
    "Answered frames by the room that was answered and why it is not known: yes, or unsure, new_place, no_detail, \
     dark, covered.",
);
/// Rooms that cheap opinions answered alone.
pub const EARLY_ANSWERS: Metric = counter(
    "roomsight_early_answers_total",
    &["model"],
    "Answered frames of which the cheap opinions of a model were so sure that the costly ones were not asked.",
);
/// How sure answers are.
pub const ANSWER_PROBABILITY: Metric =
    shares("roomsight_answer_probability_ratio", &["model"], "Probability of the answered room.");
/// How new frames look.
pub const ANSWER_NOVELTY: Metric = shares(
    "roomsight_answer_novelty_ratio",
    &["model"],
    "Novelty of answered frames, of models that can tell: the probability of a place that was never trained.",
);
/// What waits for a thread.
pub const QUEUE_DEPTH: Metric = gauge(
    "roomsight_queue_depth",
    &[],
    "What waits for a thread: frames of requests, and one place for each stream whose frames wait.",
);
/// Places for frames of requests.
pub const SLOTS: Metric =
    gauge("roomsight_slots", &[], "Frames of requests that may wait or be in work at one time.");
/// Those that are taken.
pub const SLOTS_IN_USE: Metric =
    gauge("roomsight_slots_in_use", &[], "Frames of requests that wait or are in work.");
/// Recognizing threads.
pub const THREADS: Metric = gauge("roomsight_threads", &[], "Threads that recognize.");
/// Those at work.
pub const THREADS_BUSY: Metric = gauge("roomsight_threads_busy", &[], "Threads that recognize right now.");
/// Memory that callers hold.
pub const BODY_BYTES: Metric =
    gauge("roomsight_body_bytes", &[], "Bytes of bodies and of streamed frames that are held.");
/// Streams.
pub const STREAMS: Metric = gauge(
    "roomsight_streams",
    &["state"],
    "Streams: connected, or resumable, that is, waiting for a robot whose connection broke.",
);
/// Robots.
pub const ROBOTS: Metric =
    gauge("roomsight_robots", &[], "Names of robots that are connected by streams, each counted once.");
/// Robots that do not know where they are.
pub const ROBOTS_LOST: Metric = gauge(
    "roomsight_robots_lost",
    &[],
    "Robots whose answers have been unknown for longer than `lost_after_ms`, that stream or have sent a request in the \
     last half a minute.",
);
/// Their last frames.
pub const LIVE_FRAME_BYTES: Metric = gauge(
    "roomsight_live_frame_bytes",
    &[],
    "Bytes of the robots' last frames that are kept for dashboards.",
);
/// Dashboards.
pub const EVENT_READERS: Metric =
    gauge("roomsight_event_readers", &[], "Callers that read events, or robots as that changes.");
/// What dashboards missed.
pub const EVENTS_LOST: Metric =
    counter("roomsight_events_lost_total", &[], "Events that readers lost because they were slow.");
/// Which versions have a label.
pub const MODEL_INFO: Metric = gauge(
    "roomsight_model_info",
    &["model", "version", "label", "epoch", "digest"],
    "1 for each version with a label; the digest is the beginning of the model file's.",
);
/// How many answers training lets expect to be known.
pub const EXPECTED_KNOWN: Metric = gauge(
    "roomsight_model_expected_known_ratio",
    &["model", "version"],
    "Of each stable version: the share of the answers to held-out training frames that were known. Where much less is \
     known, frames have changed since training.",
);
/// How new frames look by training.
pub const EXPECTED_NOVELTY: Metric = gauge(
    "roomsight_model_expected_novelty_ratio",
    &["model", "version"],
    "Of each stable version that can tell: the mean novelty of held-out training frames.",
);
/// States of versions.
pub const MODEL_VERSIONS: Metric =
    gauge("roomsight_model_versions", &["state"], "Versions of all models by state.");
/// How far a shadow agrees.
pub const SHADOW_FRAMES: Metric = gauge(
    "roomsight_shadow_frames",
    &["model", "outcome"],
    "Frames that a shadow compared with the stable version since it became one: agreed, differed, or skipped \
     since robots were waiting.",
);
/// How far its probabilities are.
pub const SHADOW_DISTANCE: Metric = gauge(
    "roomsight_shadow_distance",
    &["model"],
    "The sum over the compared frames of the total variation distances of the probabilities, each from 0 to 1.",
);
/// Changes of what serves.
pub const SWAPS: Metric = counter(
    "roomsight_swaps_total",
    &["kind", "outcome"],
    "Changes of what serves: activate, rollback, latest (a new version came), label, unload; done, failed, or \
     lost to a newer change.",
);
/// How long they took.
pub const SWAP_DURATION: Metric = seconds(
    "roomsight_swap_duration_seconds",
    &["kind"],
    "How long changes of what serves took, loading and warming included; frames are answered meanwhile.",
);
/// What waits for a label.
pub const INBOX_FRAMES: Metric =
    gauge("roomsight_inbox_frames", &[], "Doubted frames that are kept to be labeled.");
/// How much that is.
pub const INBOX_BYTES: Metric = gauge("roomsight_inbox_bytes", &[], "Bytes of these frames.");
/// Trainings that ended.
pub const TRAININGS: Metric = counter(
    "roomsight_trainings_total",
    &["outcome"],
    "Trainings that the service ran, by how they ended: done, failed, cancelled.",
);
/// One that runs.
pub const TRAINING_RUNNING: Metric =
    gauge("roomsight_training_running", &[], "1 while a training runs, else 0.");
/// What webhooks were told.
pub const WEBHOOKS: Metric = counter(
    "roomsight_webhook_deliveries_total",
    &["outcome"],
    "Events for webhooks: delivered, refused by the address, failed after the last try, or dropped since too many \
     waited; and retried, for each try after the first.",
);
/// Whether the broker hears.
pub const MQTT_CONNECTED: Metric = gauge(
    "roomsight_mqtt_connected",
    &[],
    "1 while the broker of MQTT is connected, else 0. Only where there is one.",
);
/// Whether services hear each other.
pub const NATS_CONNECTED: Metric = gauge(
    "roomsight_nats_connected",
    &[],
    "1 while the server of NATS is connected, over which services tell each other of their robots, else 0. Only where there is one.",
);
/// The program.
pub const BUILD_INFO: Metric = gauge("roomsight_build_info", &["version"], "1 for the program's version.");
/// How long it has run.
pub const UPTIME: Metric = gauge("roomsight_uptime_seconds", &[], "Since the service started.");
/// Whether it stops.
pub const DRAINING: Metric = gauge("roomsight_draining", &[], "1 while the service is stopping, else 0.");
/// Memory.
pub const RESIDENT_MEMORY: Metric =
    gauge("process_resident_memory_bytes", &[], "Memory of the process. Only on Linux.");
/// Processors.
pub const CPU: Metric =
    counter("process_cpu_seconds_total", &[], "Processor time of the process. Only on Linux.");

pub const ALL: [&Metric; 42] = [
    &REQUESTS,
    &REQUEST_DURATION,
    &FRAMES,
    &DROPS,
    &TAKEOVERS,
    &STAGE_DURATION,
    &ANSWERS,
    &EARLY_ANSWERS,
    &ANSWER_PROBABILITY,
    &ANSWER_NOVELTY,
    &QUEUE_DEPTH,
    &SLOTS,
    &SLOTS_IN_USE,
    &THREADS,
    &THREADS_BUSY,
    &BODY_BYTES,
    &STREAMS,
    &ROBOTS,
    &ROBOTS_LOST,
    &LIVE_FRAME_BYTES,
    &EVENT_READERS,
    &EVENTS_LOST,
    &MODEL_INFO,
    &EXPECTED_KNOWN,
    &EXPECTED_NOVELTY,
    &MODEL_VERSIONS,
    &SHADOW_FRAMES,
    &SHADOW_DISTANCE,
    &SWAPS,
    &SWAP_DURATION,
    &INBOX_FRAMES,
    &INBOX_BYTES,
    &TRAININGS,
    &TRAINING_RUNNING,
    &WEBHOOKS,
    &MQTT_CONNECTED,
    &NATS_CONNECTED,
    &BUILD_INFO,
    &UPTIME,
    &DRAINING,
    &RESIDENT_MEMORY,
    &CPU,
];
