//! The last messages of a topic, found by their time.

use roomsight_lab::dataset::MAX_APART;
use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};

/// How far what belongs together may be apart, as in recordings.
const MAX_APART_NS: u64 = (MAX_APART * 1e9) as u64;

/// How many are kept: more than come while a picture is looked at.
const N_KEPT: usize = 64;

/// What was when, in nanoseconds.
#[derive(Debug)]
pub(super) struct Recent<T> {
    kept: Mutex<VecDeque<(u64, T)>>,
}

impl<T: Clone> Recent<T> {
    pub(super) fn new() -> Self {
        Self { kept: Mutex::new(VecDeque::with_capacity(N_KEPT)) }
    }

    /// Keeps one more; the oldest goes.
    pub(super) fn add(&self, at_ns: u64, what: T) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.len() == N_KEPT {
            kept.pop_front();
        }
        kept.push_back((at_ns, what));
    }

    /// The one nearest to a time, if it is near.
    pub(super) fn at(&self, at_ns: u64) -> Option<T> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let (kept_ns, what) = kept.iter().min_by_key(|(kept_ns, _)| kept_ns.abs_diff(at_ns))?;
        (kept_ns.abs_diff(at_ns) <= MAX_APART_NS).then(|| what.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_in_time_is_found_unless_it_is_far_or_long_gone() {
        let recent = Recent::new();
        assert_eq!(recent.at(0), None);
        let at = |idx: u64| 1_000_000_000 + idx * 100_000_000;
        (0..100).for_each(|idx| recent.add(at(idx), idx));
        assert_eq!(recent.at(at(90) + 40_000_000), Some(90));
        assert_eq!(recent.at(at(99) + 250_000_000), Some(99));
        assert_eq!(recent.at(at(99) + 250_000_001), None);
        assert_eq!(recent.at(at(10)), None);
    }
}
