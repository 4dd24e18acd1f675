//! Where the time of a frame goes.

use roomsight_protocol::rest::TimingsMs;
use std::time::Duration;

/// Where the time of one frame went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timings {
    /// Waiting for a thread.
    pub queue: Duration,
    /// Bytes to pixels.
    pub decode: Duration,
    /// Pixels to described keypoints.
    pub features: Duration,
    /// Keypoints to probabilities.
    pub classify: Duration,
}

impl From<Timings> for TimingsMs {
    fn from(timings: Timings) -> Self {
        Self {
            queue: ms(timings.queue),
            decode: ms(timings.decode),
            features: ms(timings.features),
            classify: ms(timings.classify),
        }
    }
}

/// Milliseconds, to the microsecond.
pub fn ms(duration: Duration) -> f64 {
    (duration.as_secs_f64() * 1e6).round() / 1e3
}
