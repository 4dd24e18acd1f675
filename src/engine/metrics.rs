//! What the service counts and measures, for Prometheus.
//!
//! | file | what |
//! |---|---|
//! | `catalog` | all metrics by name |
//! | `recorder` | the counters and histograms of one service, and their text form |
//! | `labels` | the closed sets of what labels say |
//! | `kept` | handles that are found again without allocating |
//! | `totals`, `sums` | what was counted of the frames of one version, and of all |
//! | `beside` | what is set by what works beside frames |
//! | `process` | what Linux tells of the process |
//!
//! No label has a value that a caller chose, so that nobody can make series without end: routes are matched
//! patterns, models those of the registry, everything else a closed set.

mod beside;
pub mod catalog;
mod kept;
mod labels;
pub mod process;
mod recorder;
mod sums;
mod totals;

pub use labels::{
    FrameOutcome, SwapKind, SwapOutcome, TakeoverOutcome, TrainingOutcome, Transport, WebhookOutcome,
};
pub use recorder::Readings;
pub use sums::SumsNow;

use beside::Beside;
use kept::Kept;
use labels::{DROP_REASONS, drop_name, known_name};
use metrics::{Counter, Histogram};
use metrics_exporter_prometheus::BuildError;
use recorder::Recorder;
use roomsight_protocol::oip::statistics::FrameTotals;
use roomsight_protocol::stream::DropReason;
use roomsight_recognition::model::Recognition;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::{Duration, Instant};
use sums::Sums;
use tokio::time::interval;
use totals::Totals;

/// How often recorded durations are sorted into buckets while nobody scrapes.
const SORT_INTERVAL: Duration = Duration::from_secs(5);

/// The status of requests that are refused since the queue or the memory is full.
const TOO_MANY_REQUESTS: u16 = 429;

/// What one service has counted and measured.
pub struct Metrics {
    recorder: Recorder,
    started: Instant,
    routes: Kept<String, Arc<Route>>,
    models: Kept<String, Arc<ModelFrames>>,
    drops: Kept<DropReason, Counter>,
    events_lost: Counter,
    sums: Sums,
    beside: Beside,
}

/// Requests of one route.
struct Route {
    duration: Histogram,
    /// By method and status.
    answered: Kept<(&'static str, u16), Counter>,
}

/// Frames of one model.
struct ModelFrames {
    queue: Histogram,
    decode: Histogram,
    features: Histogram,
    classify: Histogram,
    probability: Histogram,
    novelty: Histogram,
    /// By room and why it is not known.
    answers: Kept<String, Arc<Kept<&'static str, Counter>>>,
    early: Counter,
    /// By version, transport and outcome.
    told: Kept<(u64, Transport, &'static str), Counter>,
    totals: Kept<u64, Arc<Totals>>,
}

/// A request that was answered.
pub struct Answered<'a> {
    /// The pattern of its path.
    pub pattern: &'a str,
    /// Its method, of a closed set.
    pub method: &'static str,
    /// The status of HTTP.
    pub status: u16,
    /// How long it took.
    pub took: Duration,
}

impl Metrics {
    /// Nothing is counted yet.
    pub fn new() -> Result<Self, BuildError> {
        let recorder = Recorder::new()?;
        let metrics = Self {
            events_lost: recorder.counter(&catalog::EVENTS_LOST, &[]),
            started: Instant::now(),
            sums: Sums::default(),
            beside: Beside::default(),
            routes: Kept::default(),
            models: Kept::default(),
            drops: Kept::default(),
            recorder,
        };
        // A series that begins with its first event hides that event from rates.
        for reason in DROP_REASONS {
            metrics.drops(reason).increment(0);
        }
        for kind in SwapKind::ALL {
            for outcome in SwapOutcome::ALL {
                metrics.swaps(kind, outcome).increment(0);
            }
        }
        TrainingOutcome::ALL.into_iter().for_each(|outcome| metrics.trainings(outcome).increment(0));
        TakeoverOutcome::ALL.into_iter().for_each(|outcome| metrics.takeovers(outcome).increment(0));
        WebhookOutcome::ALL.into_iter().for_each(|outcome| metrics.webhooks(outcome).increment(0));
        Ok(metrics)
    }

    /// A request was answered: of which route, with which status and after how long.
    pub fn answered(&self, Answered { pattern, method, status, took }: Answered) {
        let route = self.routes.get(pattern, || {
            let duration = self.recorder.histogram(&catalog::REQUEST_DURATION, &[pattern]);
            Arc::new(Route { duration, answered: Kept::default() })
        });
        let answered = route.answered.get(&(method, status), || {
            self.recorder.counter(&catalog::REQUESTS, &[pattern, method, &status.to_string()])
        });
        answered.increment(1);
        route.duration.record(took);
        if status == TOO_MANY_REQUESTS {
            self.sums.refused();
        }
    }

    /// A frame came to its end with the model that answered it, or was to.
    pub fn frame(&self, name: &str, version: u64, transport: Transport, outcome: FrameOutcome) {
        self.sums.frame(outcome);
        let model = self.model(name);
        let told = model.told.get(&(version, transport, outcome.name()), || {
            let values = [name, &version.to_string(), transport.name(), outcome.name()];
            self.recorder.counter(&catalog::FRAMES, &values)
        });
        told.increment(1);
        let totals = model.totals.get(&version, Arc::default);
        match outcome {
            FrameOutcome::Answered(timings) => {
                totals.answered(timings);
                model.queue.record(timings.queue);
                model.decode.record(timings.decode);
                model.features.record(timings.features);
                model.classify.record(timings.classify);
            }
            FrameOutcome::Failed(_) => totals.failed(),
            FrameOutcome::CallerLeft => {}
        }
    }

    /// A frame was answered with a room.
    pub fn answer(&self, model_name: &str, room: &str, recognition: &Recognition) {
        let model = self.model(model_name);
        let known = known_name(recognition.unknown);
        let answers = model
            .answers
            .get(room, Arc::default)
            .get(&known, || self.recorder.counter(&catalog::ANSWERS, &[model_name, room, known]));
        answers.increment(1);
        model.early.increment(u64::from(recognition.is_early));
        if !recognition.known {
            self.sums.unknown();
        }
        model.probability.record(f64::from(recognition.probability()));
        if let Some(novelty) = recognition.novelty {
            model.novelty.record(f64::from(novelty));
        }
    }

    /// What was counted of the frames of one version of a model that the registry has.
    pub fn totals(&self, name: &str, version: u64) -> FrameTotals {
        self.model(name).totals.get(&version, Arc::default).read()
    }

    /// A frame of a stream was not looked at.
    pub fn dropped(&self, reason: DropReason) {
        self.drops(reason).increment(1);
        self.sums.dropped();
    }

    /// A robot brought a stream that was elsewhere before.
    pub fn taken_over(&self, outcome: TakeoverOutcome) {
        self.takeovers(outcome).increment(1);
    }

    /// What was counted of all frames together.
    pub fn sums(&self) -> SumsNow {
        self.sums.read()
    }

    /// A slow reader of events lost some.
    pub fn events_lost(&self, n_events: u64) {
        self.events_lost.increment(n_events);
    }

    /// What serves was changed, or was to be, which took this long.
    pub fn swapped(&self, kind: SwapKind, took: Duration, outcome: SwapOutcome) {
        self.swaps(kind, outcome).increment(1);
        self.recorder.histogram(&catalog::SWAP_DURATION, &[kind.name()]).record(took);
    }

    /// A training has ended.
    pub fn trained(&self, outcome: TrainingOutcome) {
        self.trainings(outcome).increment(1);
    }

    /// What became of an event for a webhook.
    pub fn webhook(&self, outcome: WebhookOutcome) {
        self.webhooks(outcome).increment(1);
    }

    /// What is set by what works beside frames.
    pub fn beside(&self) -> &Beside {
        &self.beside
    }

    /// Since the service started.
    pub fn uptime(&self) -> Duration {
        self.started.elapsed()
    }

    /// Keeps what is recorded small, for ever: without it durations pile up until the next scrape.
    pub async fn tidy(&self) -> Infallible {
        let mut ticks = interval(SORT_INTERVAL);
        loop {
            ticks.tick().await;
            self.recorder.sort();
        }
    }

    /// What was counted, in Prometheus's text form.
    pub fn render(&self) -> String {
        self.recorder.render()
    }

    fn model(&self, name: &str) -> Arc<ModelFrames> {
        self.models.get(name, || {
            let stage = |stage| self.recorder.histogram(&catalog::STAGE_DURATION, &[name, stage]);
            Arc::new(ModelFrames {
                queue: stage("queue"),
                decode: stage("decode"),
                features: stage("features"),
                classify: stage("classify"),
                probability: self.recorder.histogram(&catalog::ANSWER_PROBABILITY, &[name]),
                novelty: self.recorder.histogram(&catalog::ANSWER_NOVELTY, &[name]),
                answers: Kept::default(),
                early: self.recorder.counter(&catalog::EARLY_ANSWERS, &[name]),
                told: Kept::default(),
                totals: Kept::default(),
            })
        })
    }

    fn drops(&self, reason: DropReason) -> Counter {
        self.drops.get(&reason, || self.recorder.counter(&catalog::DROPS, &[drop_name(reason)]))
    }

    fn takeovers(&self, outcome: TakeoverOutcome) -> Counter {
        self.recorder.counter(&catalog::TAKEOVERS, &[outcome.name()])
    }

    fn trainings(&self, outcome: TrainingOutcome) -> Counter {
        self.recorder.counter(&catalog::TRAININGS, &[outcome.name()])
    }

    fn webhooks(&self, outcome: WebhookOutcome) -> Counter {
        self.recorder.counter(&catalog::WEBHOOKS, &[outcome.name()])
    }

    fn swaps(&self, kind: SwapKind, outcome: SwapOutcome) -> Counter {
        self.recorder.counter(&catalog::SWAPS, &[kind.name(), outcome.name()])
    }
}

#[cfg(test)]
mod tests;
