//! A version that sees what the stable one sees, and answers nobody: how often it agrees.

use super::ServedModel;
use roomsight_recognition::model::Recognition;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The most frames that wait for shadows at one time; what comes beyond is not compared.
pub const MAX_WAITING: usize = 2;

/// A version that is compared with the stable one.
#[derive(Debug)]
pub struct Shadow {
    /// What is compared.
    pub served: Arc<ServedModel>,
    waiting: AtomicUsize,
    tally: Mutex<Tally>,
}

/// A frame's place among those that wait for the shadow; given back when dropped.
pub struct ShadowPermit(Arc<Shadow>);

/// How a shadow did since it became one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    /// Frames that both recognized.
    pub n_compared: u64,
    /// Frames in which both saw the same room.
    pub n_agreed: u64,
    /// Frames that were not compared, since robots were waiting.
    pub n_skipped: u64,
    /// The sum over the compared frames of the distances of [`distance`].
    pub total_distance: f64,
}

impl Shadow {
    /// Of this version, nothing compared yet.
    pub fn new(served: Arc<ServedModel>) -> Self {
        Self { served, waiting: AtomicUsize::new(0), tally: Mutex::default() }
    }

    /// Takes a place for one frame; none where too many wait, which is noted.
    pub fn admit(self: &Arc<Self>) -> Option<ShadowPermit> {
        let n_waiting = self.waiting.fetch_add(1, Ordering::Relaxed);
        let permit = ShadowPermit(self.clone());
        if n_waiting < MAX_WAITING {
            return Some(permit);
        }
        self.count(|tally| tally.n_skipped += 1);
        None
    }

    /// How it did until now.
    pub fn tally(&self) -> Tally {
        *self.tally.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn count(&self, change: impl FnOnce(&mut Tally)) {
        change(&mut self.tally.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

impl ShadowPermit {
    /// What the frame is compared with.
    pub fn shadow(&self) -> &Shadow {
        &self.0
    }

    /// Notes what both versions saw in the frame.
    pub fn compared(self, agrees: bool, distance: f64) {
        self.0.count(|tally| {
            tally.n_compared += 1;
            tally.n_agreed += u64::from(agrees);
            tally.total_distance += distance;
        });
    }
}

impl Drop for ShadowPermit {
    fn drop(&mut self) {
        self.0.waiting.fetch_sub(1, Ordering::Relaxed);
    }
}

/// The total variation distance of two answers, from 0 (equal) to 1: half the sum over all rooms of either
/// model of the differences of their probabilities.
pub fn distance(one: (&[String], &Recognition), other: (&[String], &Recognition)) -> f64 {
    let probability = |(rooms, recognition): (&[String], &Recognition), room: &String| {
        let idx = rooms.iter().position(|other| other == room);
        idx.map_or(0.0, |idx| f64::from(recognition.probabilities[idx]))
    };
    let only_other = other.0.iter().filter(|room| !one.0.contains(room));
    let difference = |room| (probability(one, room) - probability(other, room)).abs();
    one.0.iter().chain(only_other).map(difference).sum::<f64>() / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_is_that_of_distributions_over_all_rooms_of_both() {
        let rooms = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        let answer = |probabilities: &[f32]| Recognition {
            room_idx: 0,
            known: true,
            novelty: None,
            unknown: None,
            probabilities: probabilities.to_vec(),
            n_keypoints: 9,
            is_early: false,
        };
        let (ab, bc) = (rooms(&["a", "b"]), rooms(&["b", "c"]));
        let (one, same, turned) = (answer(&[0.75, 0.25]), answer(&[0.25, 0.75]), answer(&[0.75, 0.25]));
        assert_eq!(distance((&ab, &one), (&ab, &one)), 0.0);
        assert_eq!(distance((&ab, &one), (&ab, &same)), 0.5);
        // a: 0.75 and 0, b: 0.25 and 0.75, c: 0 and 0.25.
        assert_eq!(distance((&ab, &one), (&bc, &turned)), 0.75);
        assert_eq!(distance((&ab, &answer(&[1.0, 0.0])), (&rooms(&["c"]), &answer(&[1.0]))), 1.0);
    }
}
