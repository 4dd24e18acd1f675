//! What was counted of the frames of one version of a model, to be read at any time.

use crate::engine::timings::Timings;
use roomsight_protocol::oip::statistics::FrameTotals;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Sums that many threads add to. They are read one after the other, and so may differ by a frame.
#[derive(Default)]
pub struct Totals {
    n_answered: AtomicU64,
    n_failed: AtomicU64,
    last_ms: AtomicU64,
    queue_ns: AtomicU64,
    decode_ns: AtomicU64,
    recognize_ns: AtomicU64,
}

impl Totals {
    /// A frame was answered.
    pub fn answered(&self, timings: Timings) {
        add(&self.queue_ns, timings.queue);
        add(&self.decode_ns, timings.decode);
        add(&self.recognize_ns, timings.features + timings.classify);
        // A clock before 1970 tells nothing.
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        self.last_ms.fetch_max(now.as_millis() as u64, Ordering::Relaxed);
        self.n_answered.fetch_add(1, Ordering::Relaxed);
    }

    /// A frame's caller got an error.
    pub fn failed(&self) {
        self.n_failed.fetch_add(1, Ordering::Relaxed);
    }

    pub fn read(&self) -> FrameTotals {
        let time = |sum: &AtomicU64| Duration::from_nanos(sum.load(Ordering::Relaxed));
        FrameTotals {
            n_answered: self.n_answered.load(Ordering::Relaxed),
            n_failed: self.n_failed.load(Ordering::Relaxed),
            last_ms: self.last_ms.load(Ordering::Relaxed),
            queue: time(&self.queue_ns),
            decode: time(&self.decode_ns),
            recognize: time(&self.recognize_ns),
        }
    }
}

fn add(sum: &AtomicU64, took: Duration) {
    sum.fetch_add(took.as_nanos() as u64, Ordering::Relaxed);
}
