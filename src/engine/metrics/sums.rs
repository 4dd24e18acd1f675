//! What was counted of all frames together, for the service's own history.

use super::FrameOutcome;
use crate::engine::timings::Timings;
use std::array;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Buckets of durations, each a quarter longer in its bound than the one before: from a tenth of a millisecond to over a minute.
const N_BUCKETS: usize = 64;
const FIRST_BOUND_MS: f64 = 0.1;
const GROWTH: f64 = 1.25;

/// Sums that many threads add to. They are read one after the other, and so may differ by a frame.
pub struct Sums {
    answers: AtomicU64,
    unknown: AtomicU64,
    errors: AtomicU64,
    refused: AtomicU64,
    dropped: AtomicU64,
    /// Queue, decode, features, classify.
    stages_ns: [AtomicU64; 4],
    buckets: [AtomicU64; N_BUCKETS],
}

/// Sums at one moment, or what was added between two.
#[derive(Clone, Debug)]
pub struct SumsNow {
    pub answers: u64,
    pub unknown: u64,
    pub errors: u64,
    pub refused: u64,
    pub dropped: u64,
    stages_ns: [u64; 4],
    buckets: [u64; N_BUCKETS],
}

impl Default for Sums {
    fn default() -> Self {
        Self {
            answers: AtomicU64::default(),
            unknown: AtomicU64::default(),
            errors: AtomicU64::default(),
            refused: AtomicU64::default(),
            dropped: AtomicU64::default(),
            stages_ns: Default::default(),
            buckets: array::from_fn(|_| AtomicU64::default()),
        }
    }
}

impl Sums {
    /// A frame came to its end.
    pub fn frame(&self, outcome: FrameOutcome) {
        match outcome {
            FrameOutcome::Answered(timings) => self.answered(timings),
            FrameOutcome::Failed(_) => add(&self.errors, 1),
            FrameOutcome::CallerLeft => {}
        }
    }

    fn answered(&self, timings: Timings) {
        let Timings { queue, decode, features, classify } = timings;
        for (sum, took) in self.stages_ns.iter().zip([queue, decode, features, classify]) {
            add(sum, took.as_nanos() as u64);
        }
        add(&self.buckets[bucket_of(queue + decode + features + classify)], 1);
        add(&self.answers, 1);
    }

    /// An answer was not known.
    pub fn unknown(&self) {
        add(&self.unknown, 1);
    }

    /// A request was refused since the queue or the memory was full.
    pub fn refused(&self) {
        add(&self.refused, 1);
    }

    /// A frame of a stream was not looked at.
    pub fn dropped(&self) {
        add(&self.dropped, 1);
    }

    pub fn read(&self) -> SumsNow {
        let read = |sum: &AtomicU64| sum.load(Ordering::Relaxed);
        SumsNow {
            answers: read(&self.answers),
            unknown: read(&self.unknown),
            errors: read(&self.errors),
            refused: read(&self.refused),
            dropped: read(&self.dropped),
            stages_ns: self.stages_ns.each_ref().map(read),
            buckets: self.buckets.each_ref().map(read),
        }
    }
}

impl SumsNow {
    /// What was added since.
    pub fn since(&self, before: &Self) -> Self {
        Self {
            answers: self.answers - before.answers,
            unknown: self.unknown - before.unknown,
            errors: self.errors - before.errors,
            refused: self.refused - before.refused,
            dropped: self.dropped - before.dropped,
            stages_ns: array::from_fn(|idx| self.stages_ns[idx] - before.stages_ns[idx]),
            buckets: array::from_fn(|idx| self.buckets[idx] - before.buckets[idx]),
        }
    }

    /// Where the time of a frame went, on the average.
    pub fn mean_timings(&self) -> Timings {
        let mean = |idx: usize| Duration::from_nanos(self.stages_ns[idx] / self.answers.max(1));
        Timings { queue: mean(0), decode: mean(1), features: mean(2), classify: mean(3) }
    }

    /// How long this share of the frames took at most, in milliseconds, to a quarter of it; none of no frame.
    pub fn quantile_ms(&self, share: f64) -> Option<f64> {
        let n_frames: u64 = self.buckets.iter().sum();
        let wanted = ((n_frames as f64 * share).ceil() as u64).max(1);
        let mut n_below = 0;
        let bucket = self.buckets.iter().position(|&n| {
            n_below += n;
            n_below >= wanted
        })?;
        // The middle of the bucket.
        let bound = FIRST_BOUND_MS * GROWTH.powi(bucket as i32);
        Some((bound * (1.0 + 1.0 / GROWTH) / 2.0 * 1e3).round() / 1e3)
    }
}

fn bucket_of(took: Duration) -> usize {
    let ms = took.as_secs_f64() * 1e3;
    // Below the first bound this is negative, which becomes 0.
    ((ms / FIRST_BOUND_MS).log(GROWTH).ceil() as usize).min(N_BUCKETS - 1)
}

fn add(sum: &AtomicU64, n: u64) {
    sum.fetch_add(n, Ordering::Relaxed);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_added_between_two_moments_is_told() {
        let sums = Sums::default();
        let frame = |ms: u64| {
            let timings = Timings { decode: Duration::from_millis(ms), ..Timings::default() };
            sums.frame(FrameOutcome::Answered(timings));
        };
        frame(1000);
        let before = sums.read();
        (0..98).for_each(|_| frame(4));
        (0..2).for_each(|_| frame(200));
        sums.frame(FrameOutcome::Failed("not-an-image"));
        sums.unknown();
        let added = sums.read().since(&before);
        assert_eq!((added.answers, added.errors, added.unknown, added.refused), (100, 1, 1, 0));
        let mean_ms = added.mean_timings().decode.as_secs_f64() * 1e3;
        assert!((7.9..8.0).contains(&mean_ms), "{mean_ms}");
        let (p50, p99) = (added.quantile_ms(0.5).unwrap(), added.quantile_ms(0.99).unwrap());
        assert!((3.2..4.8).contains(&p50) && (160.0..240.0).contains(&p99), "{p50} {p99}");
        assert_eq!(before.since(&before).quantile_ms(0.5), None);
        assert_eq!([bucket_of(Duration::ZERO), bucket_of(Duration::MAX)], [0, N_BUCKETS - 1]);
    }
}
