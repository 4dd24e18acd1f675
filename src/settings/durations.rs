//! Settings in milliseconds as durations.

use super::Settings;
use std::time::Duration;

impl Settings {
    /// [`Settings::models_poll_ms`] as a duration; none where it is 0.
    pub fn models_poll(&self) -> Option<Duration> {
        (self.models_poll_ms > 0).then_some(Duration::from_millis(self.models_poll_ms))
    }

    /// [`Settings::session_ms`] as a duration.
    pub fn session(&self) -> Duration {
        Duration::from_millis(self.session_ms)
    }

    /// [`Settings::header_timeout_ms`] as a duration.
    pub fn header_timeout(&self) -> Duration {
        Duration::from_millis(self.header_timeout_ms)
    }

    /// [`Settings::body_timeout_ms`] as a duration.
    pub fn body_timeout(&self) -> Duration {
        Duration::from_millis(self.body_timeout_ms)
    }

    /// [`Settings::write_timeout_ms`] as a duration.
    pub fn write_timeout(&self) -> Duration {
        Duration::from_millis(self.write_timeout_ms)
    }

    /// [`Settings::drain_timeout_ms`] as a duration.
    pub fn drain_timeout(&self) -> Duration {
        Duration::from_millis(self.drain_timeout_ms)
    }

    /// The most streams of one caller.
    pub fn max_streams_of_one(&self) -> usize {
        match self.max_streams_per_caller {
            0 => self.max_streams.div_ceil(2),
            n => n,
        }
    }

    /// [`Settings::stream_message_timeout_ms`] as a duration.
    pub fn stream_message_timeout(&self) -> Duration {
        Duration::from_millis(self.stream_message_timeout_ms)
    }

    /// How long what was sent over a connection may stay unacknowledged before it counts as broken.
    pub fn unacknowledged_timeout(&self) -> Duration {
        Duration::from_millis(self.stream_ping_ms.saturating_mul(3))
    }

    /// [`Settings::stream_ping_ms`] as a duration.
    pub fn stream_ping(&self) -> Duration {
        Duration::from_millis(self.stream_ping_ms)
    }

    /// [`Settings::stream_idle_timeout_ms`] as a duration.
    pub fn stream_idle_timeout(&self) -> Duration {
        Duration::from_millis(self.stream_idle_timeout_ms)
    }

    /// [`Settings::stream_write_timeout_ms`] as a duration.
    pub fn stream_write_timeout(&self) -> Duration {
        Duration::from_millis(self.stream_write_timeout_ms)
    }

    /// [`Settings::resume_token_ms`] as a duration.
    pub fn resume_token(&self) -> Duration {
        Duration::from_millis(self.resume_token_ms)
    }

    /// [`Settings::stream_resume_ms`] as a duration.
    pub fn stream_resume(&self) -> Duration {
        Duration::from_millis(self.stream_resume_ms)
    }

    /// [`Settings::lost_after_ms`] as a duration.
    pub fn lost_after(&self) -> Duration {
        Duration::from_millis(self.lost_after_ms)
    }
}
