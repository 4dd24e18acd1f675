//! A stream that passes from one process to another, by what its robot keeps of it.

use super::{Identity, Session};
use crate::engine::Engine;
use crate::engine::registry::Choice;
use crate::engine::robots::RobotRecord;
use crate::engine::streams::ledger::{Accepted, Outcome};
use crate::engine::streams::moment::now_ms;
use crate::engine::streams::teller::Teller;
use crate::engine::streams::token::{Standing, runs};
use crate::problem::Problem;
use roomsight_protocol::header::MAX_SEQ;
use roomsight_protocol::stream::{DropReason, FilterChange};
use std::sync::Arc;
use std::time::Instant;

/// A stream that was elsewhere before.
pub struct TakenOver {
    pub standing: Standing,
    /// The last frame whose answer the robot has.
    pub last_seq: Option<u64>,
    /// The last frame that it has sent.
    pub sent_seq: Option<u64>,
}

impl Session {
    /// Goes on as a stream stood elsewhere. Its frames without an answer are lost.
    ///
    /// # Errors
    /// No model serves.
    pub fn take_over(
        engine: Engine,
        identity: Identity,
        TakenOver { standing, last_seq, sent_seq }: TakenOver,
        record: Arc<RobotRecord>,
    ) -> Result<Self, Problem> {
        let lost = standing.lost(last_seq, sent_seq);
        let Standing { settings, next_seq, told, .. } = standing;
        let served =
            engine.registry.choose(Some(&settings.model), &Choice::Serving, settings.robot.as_deref())?;
        let had_filter = told.believes();
        let teller = Teller::restored(identity.stream.clone(), &served, &engine.settings, told);
        let mut session = Self::with(teller, engine, identity, settings, record);
        let is_kept = session.teller.believes() || !had_filter;
        session.taken_over = Some(if is_kept { FilterChange::Kept } else { FilterChange::Reset });
        let last = [last_seq, sent_seq].into_iter().flatten().max().map_or(0, |last| last.min(MAX_SEQ) + 1);
        session.next_seq = next_seq.max(last);
        for seq in lost {
            session.record.accepted();
            session.ledger.accept(Accepted {
                seq,
                arrived: Instant::now(),
                captured_at_ns: None,
                odometry: None,
                n_bytes: 0,
            });
            session.ledger.settle(seq, Outcome::Dropped(DropReason::Lost));
        }
        Ok(session)
    }

    /// How it stands.
    pub(super) fn standing(&self) -> Standing {
        Standing {
            at_ms: now_ms(),
            stream: self.identity.stream.clone(),
            settings: self.settings.clone(),
            next_seq: self.next_seq,
            untold: runs(self.ledger.untold()),
            told: self.teller.told(),
        }
    }

    /// The same, sealed for its robot, where that is wanted.
    pub(super) fn token(&self) -> Option<String> {
        let tokens = &self.engine.streams.tokens;
        if tokens.are_told() { tokens.seal(&self.standing(), self.record.key()) } else { None }
    }
}
