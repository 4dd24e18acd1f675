//! The last hour of the service, from its own counters, for those who have no Prometheus.

use crate::engine::Engine;
use crate::engine::metrics::SumsNow;
use crate::engine::metrics::process;
use crate::engine::pool::Load;
use roomsight_protocol::rest::TimingsMs;
use roomsight_protocol::service::{HistoryPoint, ServiceHistory};
use std::collections::VecDeque;
use std::convert::Infallible;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};
use tokio::time::{MissedTickBehavior, interval};

/// How often it is looked at how much there is to do.
const LOOK: Duration = Duration::from_secs(1);
/// So many looks make a point.
const N_LOOKS: usize = 10;
/// An hour of points.
const MAX_POINTS: usize = 360;

/// Points of the last hour.
#[derive(Default)]
pub struct History(Mutex<VecDeque<HistoryPoint>>);

/// What was seen in one interval so far.
struct Seen {
    sums: SumsNow,
    cpu_s: Option<f64>,
    most_waiting: usize,
    n_running: usize,
    n_looks: usize,
}

impl History {
    /// All points.
    pub fn read(&self) -> ServiceHistory {
        let points = self.points().iter().cloned().collect();
        ServiceHistory { interval_s: (LOOK * N_LOOKS as u32).as_secs(), points }
    }

    fn push(&self, point: HistoryPoint) {
        let mut points = self.points();
        if points.len() == MAX_POINTS {
            points.pop_front();
        }
        points.push_back(point);
    }

    fn points(&self) -> MutexGuard<'_, VecDeque<HistoryPoint>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Writes the history for ever.
pub async fn keep(engine: Engine) -> Infallible {
    let mut looks = interval(LOOK);
    looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    looks.tick().await;
    let mut seen = Seen::begin(&engine);
    loop {
        looks.tick().await;
        seen.look(engine.pool.load());
        if seen.n_looks == N_LOOKS {
            let next = Seen::begin(&engine);
            engine.history.push(seen.point(&next, &engine));
            seen = next;
        }
    }
}

impl Seen {
    fn begin(engine: &Engine) -> Self {
        let (sums, cpu_s) = (engine.metrics.sums(), process::cpu_seconds());
        Self { sums, cpu_s, most_waiting: 0, n_running: 0, n_looks: 0 }
    }

    fn look(&mut self, load: Load) {
        self.most_waiting = self.most_waiting.max(load.n_waiting);
        self.n_running += load.n_running;
        self.n_looks += 1;
    }

    /// What was so from its beginning to that of the next.
    fn point(&self, next: &Self, engine: &Engine) -> HistoryPoint {
        let sums = next.sums.since(&self.sums);
        let robots: Vec<_> = engine.robots.all().into_iter().filter(|record| record.is_connected()).collect();
        let cpu_s = next.cpu_s.zip(self.cpu_s).map(|(now, before)| ((now - before) * 100.0).round() / 100.0);
        HistoryPoint {
            at: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
            answers: sums.answers,
            errors: sums.errors,
            refused: sums.refused,
            dropped: sums.dropped,
            unknown: sums.unknown,
            queue: self.most_waiting,
            busy: self.n_running as f64 / self.n_looks.max(1) as f64,
            memory_bytes: process::resident_bytes().map(|n_bytes| n_bytes as u64),
            cpu_s,
            latency_ms: TimingsMs::from(sums.mean_timings()),
            p50_ms: sums.quantile_ms(0.5),
            p99_ms: sums.quantile_ms(0.99),
            streams: robots.iter().filter(|record| record.streams()).count(),
            lost: robots.iter().filter(|record| record.is_lost()).count(),
            robots: robots.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_hour_is_kept() {
        let history = History::default();
        let timings = TimingsMs { queue: 0.0, decode: 0.0, features: 0.0, classify: 0.0 };
        for answers in 0..MAX_POINTS as u64 + 5 {
            history.push(HistoryPoint {
                at: String::new(),
                answers,
                errors: 0,
                refused: 0,
                dropped: 0,
                unknown: 0,
                queue: 0,
                busy: 0.0,
                memory_bytes: None,
                cpu_s: None,
                latency_ms: timings,
                p50_ms: None,
                p99_ms: None,
                streams: 0,
                robots: 0,
                lost: 0,
            });
        }
        let ServiceHistory { interval_s, points } = history.read();
        assert_eq!((interval_s, points.len(), points[0].answers), (10, MAX_POINTS, 5));
    }
}
