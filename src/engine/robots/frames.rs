//! The last frame of each robot, as it was sent, within a budget of bytes.

use bytes::Bytes;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

/// The last frames of all robots; the oldest give way where bytes are short.
pub struct LastFrames {
    max_bytes: usize,
    next_number: AtomicU64,
    kept: Mutex<Kept>,
}

#[derive(Default)]
struct Kept {
    by_number: BTreeMap<u64, Bytes>,
    n_bytes: usize,
}

/// Which of the frames is a robot's last one; 0: none.
#[derive(Default)]
pub struct LastFrame(AtomicU64);

impl LastFrame {
    /// Its number.
    pub fn number(&self) -> Option<u64> {
        Some(self.0.load(Ordering::Relaxed)).filter(|&number| number > 0)
    }

    /// Takes over the frame of another.
    pub fn take_over(&self, other: &Self) {
        self.0.store(other.0.swap(0, Ordering::Relaxed), Ordering::Relaxed);
    }
}

impl LastFrames {
    /// At most so many bytes of them; 0: none are kept.
    pub fn new(max_bytes: usize) -> Self {
        // Browsers keep pictures by these numbers: those of a service that was started again are others.
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let next_number = AtomicU64::new(1 + now.as_millis() as u64);
        Self { max_bytes, next_number, kept: Mutex::default() }
    }

    /// Whether any are kept.
    pub fn are_kept(&self) -> bool {
        self.max_bytes > 0
    }

    /// A number for a frame, larger than those before.
    pub fn number(&self) -> u64 {
        self.next_number.fetch_add(1, Ordering::Relaxed)
    }

    /// Keeps a frame in the place of the one before, if it is the younger one. One that fits nowhere only takes the old
    /// one away.
    pub fn keep(&self, last: &LastFrame, number: u64, bytes: impl FnOnce() -> Bytes) {
        if !self.are_kept() {
            return;
        }
        let bytes = bytes();
        let mut kept = self.kept();
        let before = last.0.load(Ordering::Relaxed);
        if before >= number {
            return;
        }
        kept.remove(before);
        last.0.store(0, Ordering::Relaxed);
        if bytes.len() > self.max_bytes {
            return;
        }
        last.0.store(number, Ordering::Relaxed);
        kept.n_bytes += bytes.len();
        kept.by_number.insert(number, bytes);
        while kept.n_bytes > self.max_bytes
            && let Some((_, oldest)) = kept.by_number.pop_first()
        {
            kept.n_bytes -= oldest.len();
        }
    }

    /// A robot's last frame with its number, if it did not give way to others.
    pub fn get(&self, last: &LastFrame) -> Option<(u64, Bytes)> {
        let number = last.number()?;
        self.kept().by_number.get(&number).map(|bytes| (number, bytes.clone()))
    }

    /// The number of a robot's last frame, if it did not give way to others.
    pub fn number_of(&self, last: &LastFrame) -> Option<u64> {
        last.number().filter(|number| self.kept().by_number.contains_key(number))
    }

    /// Gives a robot's last frame up.
    pub fn forget(&self, last: &LastFrame) {
        self.kept().remove(last.0.swap(0, Ordering::Relaxed));
    }

    /// How many bytes are kept.
    pub fn n_bytes(&self) -> usize {
        self.kept().n_bytes
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Kept {
    fn remove(&mut self, number: u64) {
        if let Some(bytes) = self.by_number.remove(&number) {
            self.n_bytes -= bytes.len();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keep(frames: &LastFrames, last: &LastFrame, n_bytes: usize) {
        frames.keep(last, frames.number(), || vec![7; n_bytes].into());
    }

    fn n_bytes(frames: &LastFrames, last: &LastFrame) -> Option<usize> {
        frames.get(last).map(|(_, bytes)| bytes.len())
    }

    #[test]
    fn one_frame_a_robot_is_kept_and_the_oldest_give_way() {
        let frames = LastFrames::new(100);
        let [one, two, three] = [(); 3].map(|()| LastFrame::default());
        keep(&frames, &one, 30);
        keep(&frames, &one, 40);
        assert_eq!((n_bytes(&frames, &one), frames.n_bytes()), (Some(40), 40));
        keep(&frames, &two, 60);
        keep(&frames, &three, 30);
        assert_eq!([&one, &two, &three].map(|last| n_bytes(&frames, last)), [None, Some(60), Some(30)]);
        keep(&frames, &three, 101);
        assert_eq!(
            (n_bytes(&frames, &three), frames.n_bytes()),
            (None, 60),
            "none is better than an old one"
        );
        frames.forget(&two);
        assert_eq!((frames.number_of(&two), frames.n_bytes()), (None, 0));
    }

    #[test]
    fn a_frame_that_was_overtaken_is_not_kept() {
        let (frames, last) = (LastFrames::new(100), LastFrame::default());
        let [early, late] = [(); 2].map(|()| frames.number());
        frames.keep(&last, late, || vec![1; 10].into());
        frames.keep(&last, early, || vec![2; 20].into());
        assert_eq!(frames.get(&last), Some((late, vec![1; 10].into())));
    }

    #[test]
    fn where_none_are_kept_nothing_is_done() {
        let (frames, last) = (LastFrames::new(0), LastFrame::default());
        frames.keep(&last, frames.number(), || panic!("nobody wants it"));
        assert_eq!(frames.get(&last), None);
    }
}
