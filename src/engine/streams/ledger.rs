//! What becomes of the frames of one stream, told in their order.

use crate::engine::recognize::Seen;
use crate::problem::Problem;
use roomsight_protocol::header::Odometry;
use roomsight_protocol::stream::DropReason;
use std::collections::VecDeque;
use std::time::Instant;

/// The accepted frames without a told answer. An answer waits for those before it.
#[derive(Default)]
pub struct Ledger {
    entries: VecDeque<LedgerEntry>,
    unsettled_bytes: usize,
}

/// An accepted frame.
pub struct Accepted {
    pub seq: u64,
    /// When it had arrived.
    pub arrived: Instant,
    /// When it was captured, in nanoseconds since 1970.
    pub captured_at_ns: Option<u64>,
    /// Where the robot was then.
    pub odometry: Option<Odometry>,
    /// How long its message is.
    pub n_bytes: usize,
}

/// What became of a frame.
pub enum Outcome {
    /// It was recognized.
    Seen(Box<Seen>),
    /// It cannot be.
    Failed(Problem),
    /// It was not looked at.
    Dropped(DropReason),
}

struct LedgerEntry {
    frame: Accepted,
    outcome: Option<Outcome>,
}

impl Ledger {
    /// Opens an entry for a frame whose number is larger than those before.
    pub fn accept(&mut self, frame: Accepted) {
        self.unsettled_bytes += frame.n_bytes;
        self.entries.push_back(LedgerEntry { frame, outcome: None });
    }

    /// Settles what became of a frame; the first word counts.
    pub fn settle(&mut self, seq: u64, outcome: Outcome) {
        let Ok(entry_idx) = self.entries.binary_search_by_key(&seq, |entry| entry.frame.seq) else { return };
        let entry = &mut self.entries[entry_idx];
        if entry.outcome.is_none() {
            self.unsettled_bytes -= entry.frame.n_bytes;
            entry.outcome = Some(outcome);
        }
    }

    /// The first frame, once it is settled.
    pub fn next(&mut self) -> Option<(Accepted, Outcome)> {
        let LedgerEntry { frame, outcome } = self.entries.pop_front()?;
        match outcome {
            Some(outcome) => Some((frame, outcome)),
            None => {
                self.entries.push_front(LedgerEntry { frame, outcome });
                None
            }
        }
    }

    /// The frames without a told answer, ascending.
    pub fn untold(&self) -> impl Iterator<Item = u64> {
        self.entries.iter().map(|entry| entry.frame.seq)
    }

    /// How many frames are without a told answer.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// How many bytes the frames have together of which nothing is settled yet.
    pub fn unsettled_bytes(&self) -> usize {
        self.unsettled_bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn each_frame_is_told_once_and_in_order(n_frames in 1_u64..40, swaps: Vec<(u8, u8)>) {
            let mut order: Vec<u64> = (0..n_frames).map(|seq| seq * 3).collect();
            let mut ledger = Ledger::default();
            for &seq in &order {
                ledger.accept(Accepted { seq, arrived: Instant::now(), captured_at_ns: None, odometry: None, n_bytes: 5 });
            }
            for (a, b) in swaps {
                order.swap(usize::from(a) % n_frames as usize, usize::from(b) % n_frames as usize);
            }
            let mut told = Vec::new();
            for seq in order {
                ledger.settle(seq, Outcome::Dropped(DropReason::Superseded));
                ledger.settle(seq, Outcome::Dropped(DropReason::Draining));
                while let Some((frame, outcome)) = ledger.next() {
                    prop_assert!(matches!(outcome, Outcome::Dropped(DropReason::Superseded)));
                    told.push(frame.seq);
                }
            }
            prop_assert_eq!(told, (0..n_frames).map(|seq| seq * 3).collect::<Vec<_>>());
            prop_assert_eq!((ledger.len(), ledger.unsettled_bytes()), (0, 0));
        }
    }

    #[test]
    fn an_unknown_frame_settles_nothing() {
        let mut ledger = Ledger::default();
        ledger.accept(Accepted {
            seq: 4,
            arrived: Instant::now(),
            captured_at_ns: None,
            odometry: None,
            n_bytes: 5,
        });
        ledger.settle(3, Outcome::Dropped(DropReason::Overload));
        assert!(ledger.next().is_none());
        assert_eq!((ledger.len(), ledger.unsettled_bytes()), (1, 5));
    }
}
