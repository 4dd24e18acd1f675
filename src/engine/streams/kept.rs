//! What a stream has said, for a robot that comes back.

use crate::settings::Settings;
use std::collections::VecDeque;
use tokio_tungstenite::tungstenite::Utf8Bytes;

/// The most frames without a told answer where frames supersede each other: one is in work or waits, and
/// those it superseded are told after it.
pub const MAX_UNTOLD: usize = 256;

/// A message up to this length says little, and costs little to keep: it tells that a frame was dropped.
const SHORT_BYTES: usize = 64;

/// The last messages about frames: all that are told after a connection breaks, and as many as the window from
/// before, which may not have arrived.
pub struct Kept {
    told: VecDeque<Told>,
    n_long: usize,
    max_told: usize,
    max_long: usize,
}

struct Told {
    seq: u64,
    message: Utf8Bytes,
}

impl Kept {
    /// For streams of this service.
    pub fn new(settings: &Settings) -> Self {
        let before = settings.stream_window;
        Self {
            told: VecDeque::new(),
            n_long: 0,
            max_told: before + before.max(MAX_UNTOLD),
            // Where frames supersede each other one waits and few are in work: hardly more are answered.
            max_long: before + before.max(settings.n_threads() + 8),
        }
    }

    /// Keeps a message about a frame.
    pub fn keep(&mut self, seq: u64, message: &Utf8Bytes) {
        self.n_long += usize::from(is_long(message));
        // Without what the text was allocated with.
        let message = Utf8Bytes::from(message.as_str());
        self.told.push_back(Told { seq, message });
        while (self.told.len() > self.max_told || self.n_long > self.max_long)
            && let Some(told) = self.told.pop_front()
        {
            self.n_long -= usize::from(is_long(&told.message));
        }
    }

    /// The kept messages about frames after this one, or all of them.
    pub fn after(&self, last_seq: Option<u64>) -> Vec<Utf8Bytes> {
        let is_missed = |told: &&Told| last_seq.is_none_or(|last_seq| told.seq > last_seq);
        self.told.iter().filter(is_missed).map(|told| told.message.clone()).collect()
    }
}

fn is_long(message: &Utf8Bytes) -> bool {
    message.len() > SHORT_BYTES
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(stream_window: usize) -> Kept {
        Kept::new(&Settings { stream_window, threads: 2, ..Settings::default() })
    }

    #[test]
    fn what_is_kept_covers_the_window() {
        for window in [1, 16, 1024] {
            let mut kept = kept(window);
            (0..5000).for_each(|seq| kept.keep(seq, &"x".repeat(100).into()));
            assert!(kept.after(None).len() >= 2 * window, "{window}");
            assert_eq!(kept.after(Some(4990)).len(), 9);
            assert_eq!(kept.n_long, kept.told.len());
        }
    }

    #[test]
    fn frames_that_were_dropped_take_no_place_of_answers() {
        let mut kept = kept(16);
        (0..16).for_each(|seq| kept.keep(seq, &"x".repeat(100).into()));
        (16..16 + MAX_UNTOLD as u64).for_each(|seq| kept.keep(seq, &"dropped".into()));
        assert_eq!(kept.after(None).len(), 16 + MAX_UNTOLD);
        (300..2000).for_each(|seq| kept.keep(seq, &"dropped".into()));
        assert_eq!((kept.told.len(), kept.n_long), (16 + MAX_UNTOLD, 0));
    }
}
