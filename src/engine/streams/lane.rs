//! The frames of one stream that wait for a thread.
//!
//! A stream has at most one place in the queue of the threads, however many of its frames wait: when its
//! turn comes, a thread takes the frame that is first *then*, and the stream may queue again, behind all
//! others. Streams so take turns, frame by frame, and a frame can be superseded until the moment a thread
//! takes it.

use super::intake::{Share, Whole};
use crate::engine::spans::FrameSpans;
use std::collections::VecDeque;
use std::mem;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// A frame that waits.
pub struct Waiting {
    pub seq: u64,
    /// When it had arrived.
    pub arrived: Instant,
    /// When nobody wants its answer any more.
    pub deadline: Option<Instant>,
    /// Its bytes, with the header where there is one.
    pub frame: Whole,
    /// How long that is, in bytes.
    pub n_header_bytes: usize,
    /// Whether a scan lies between the header and the image.
    pub has_scan: bool,
    /// Its share of what frames in the mode `lossless` may have.
    pub share: Option<Share>,
    pub spans: FrameSpans,
}

impl Waiting {
    /// Whether it was accepted in the mode `lossless`, whatever the mode is now.
    fn is_lossless(&self) -> bool {
        self.share.is_some()
    }
}

/// What a thread takes when the stream's turn has come.
pub struct Taken<T> {
    /// The numbers of the frames before it whose deadline had passed, in order.
    pub expired: Vec<u64>,
    /// The first frame that is still in time, and what was chosen for it.
    pub frame: Option<(Waiting, T)>,
}

/// The frames of one stream that wait, shared between its task and the threads.
#[derive(Default)]
pub struct Lane(Mutex<State>);

#[derive(Default)]
struct State {
    waiting: VecDeque<Waiting>,
    has_turn: bool,
}

impl Lane {
    /// Adds a frame behind those that wait.
    pub fn push(&self, frame: Waiting) {
        self.state().waiting.push_back(frame);
    }

    /// Lets a frame take the place of those that wait, but for those of the mode `lossless`, which are never
    /// dropped; returns their numbers, in order.
    pub fn supersede(&self, frame: Waiting) -> Vec<u64> {
        let mut state = self.state();
        let (kept, superseded): (VecDeque<_>, VecDeque<_>) =
            mem::take(&mut state.waiting).into_iter().partition(Waiting::is_lossless);
        state.waiting = kept;
        state.waiting.push_back(frame);
        superseded.iter().map(|frame| frame.seq).collect()
    }

    /// Claims the stream's place in the queue. False where it is taken already, nothing waits, or it `is_early`
    /// for the first frame, which may rest.
    pub fn claim_turn(&self, is_early: bool) -> bool {
        let mut state = self.state();
        let is_claimed = state.wants_turn() && !(is_early && state.may_rest());
        state.has_turn |= is_claimed;
        is_claimed
    }

    /// Whether the place is not taken, and the first frame that waits may do so until it is looked at in the mode
    /// `sampled`.
    pub fn may_rest(&self) -> bool {
        self.state().may_rest()
    }

    /// Takes the first frame that is still in time `now`, when the stream's turn has come, and what `choose`
    /// chooses for it: what is chosen for a frame was never chosen before what is chosen for an earlier one.
    /// A turn takes once, so that a stream that queues again meanwhile has one place nevertheless.
    pub fn take<T>(&self, now: Instant, choose: impl FnOnce() -> T) -> Taken<T> {
        let mut state = self.state();
        state.has_turn = false;
        let is_late = |frame: &Waiting| frame.deadline.is_some_and(|deadline| deadline <= now);
        let mut expired = Vec::new();
        while state.waiting.front().is_some_and(is_late) {
            expired.extend(state.waiting.pop_front().map(|frame| frame.seq));
        }
        Taken { expired, frame: state.waiting.pop_front().map(|frame| (frame, choose())) }
    }

    /// Gives up all that wait; returns their numbers, in order.
    pub fn clear(&self) -> Vec<u64> {
        self.state().waiting.drain(..).map(|frame| frame.seq).collect()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn wants_turn(&self) -> bool {
        !self.has_turn && !self.waiting.is_empty()
    }

    fn may_rest(&self) -> bool {
        !self.has_turn && self.waiting.front().is_some_and(|frame| !frame.is_lossless())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::caller::CallerId;
    use crate::engine::frame::Frame;
    use crate::engine::streams::intake::{Intake, Lossless};
    use futures_util::FutureExt;
    use std::sync::Arc;
    use tokio::sync::Semaphore;

    fn frame(seq: u64) -> Waiting {
        let held = Arc::new(Semaphore::new(1)).try_acquire_owned().unwrap();
        let frame = Whole::Kept(Frame::new(vec![0].into(), held));
        let (arrived, spans) = (Instant::now(), FrameSpans::begin(seq));
        Waiting {
            seq,
            arrived,
            deadline: None,
            frame,
            n_header_bytes: 0,
            has_scan: false,
            share: None,
            spans,
        }
    }

    fn taken(lane: &Lane) -> Option<u64> {
        lane.take(Instant::now(), || ()).frame.map(|(frame, ())| frame.seq)
    }

    #[test]
    fn a_turn_takes_once_also_where_deadlines_have_passed() {
        let (lane, now) = (Lane::default(), Instant::now());
        let late = |seq| Waiting { deadline: Some(now), ..frame(seq) };
        (0..2).for_each(|seq| lane.push(late(seq)));
        (2..4).for_each(|seq| lane.push(frame(seq)));
        assert!(lane.claim_turn(false));
        let Taken { expired, frame } = lane.take(now, || ());
        assert_eq!((expired, frame.map(|(frame, ())| frame.seq)), (vec![0, 1], Some(2)));
        assert!(lane.claim_turn(false));
        assert!(!lane.state().wants_turn(), "one turn is outstanding");
        lane.clear();
        lane.push(late(4));
        let taken = lane.take(now, || ());
        assert!((taken.expired, taken.frame.is_none()) == (vec![4], true), "all were late");
        assert!(!lane.claim_turn(false), "nothing waits");
    }

    #[test]
    fn a_stream_has_one_place_however_much_waits() {
        let lane = Lane::default();
        assert!(!lane.claim_turn(false), "nothing waits");
        (0..3).for_each(|seq| lane.push(frame(seq)));
        assert!(lane.claim_turn(false));
        assert!(!lane.claim_turn(false));
        assert_eq!(taken(&lane), Some(0));
        assert!(lane.claim_turn(false), "its turn came, so that it may queue again");
        assert_eq!((taken(&lane), taken(&lane), taken(&lane)), (Some(1), Some(2), None));
    }

    #[test]
    fn a_frame_is_superseded_until_a_thread_takes_it() {
        let lane = Lane::default();
        assert!(lane.supersede(frame(0)).is_empty());
        assert!(lane.claim_turn(false));
        assert_eq!(lane.supersede(frame(1)), [0]);
        assert_eq!(taken(&lane), Some(1));
        assert!(lane.supersede(frame(2)).is_empty());
        assert_eq!(lane.clear(), [2]);
        assert!(!lane.state().wants_turn());
    }

    #[test]
    fn a_lossless_frame_is_neither_superseded_nor_held_back() {
        let intake = Arc::new(Intake::new(Arc::new(Semaphore::new(9)), 9, 1));
        let mut lossless = Lossless::begin(&intake, intake.room_of(&CallerId::Robot("wall-e".into())), 1);
        lossless.let_in().now_or_never().unwrap();
        let (_, share) = lossless.finish().unwrap();
        let lane = Lane::default();
        lane.push(Waiting { share: Some(share), ..frame(0) });
        assert!(lane.supersede(frame(1)).is_empty());
        assert_eq!(lane.supersede(frame(2)), [1]);
        assert!(!lane.may_rest());
        assert!(lane.claim_turn(true));
        assert_eq!(taken(&lane), Some(0));
        assert!(lane.may_rest());
        assert!(!lane.claim_turn(true));
        assert!(lane.claim_turn(false));
    }
}
