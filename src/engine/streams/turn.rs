//! A stream's turn on a thread: its first frame is taken and recognized, and its task hears what became of it.

use super::lane::{Lane, Taken, Waiting};
use super::ledger::Outcome;
use crate::engine::Engine;
use crate::engine::doubts::Sender;
use crate::engine::frame::Frame;
use crate::engine::metrics::Transport;
use crate::engine::pool::Panicked;
use crate::engine::recognize::{RecognizeError, Shown, Task, look};
use crate::engine::registry::Choice;
use crate::engine::robots::RobotRecord;
use crate::problem::Problem;
use roomsight_protocol::scan::LaserScan;
use roomsight_protocol::stream::DropReason;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::mpsc::UnboundedSender;

/// What a thread tells the stream's task.
pub enum News {
    /// It took a frame, so that the stream may queue again.
    Took,
    /// A frame is settled.
    Settled(u64, Outcome),
}

/// A stream's turn on a thread.
pub struct Turn {
    pub engine: Engine,
    /// The stream's frames that wait.
    pub lane: Arc<Lane>,
    /// The model that is asked for.
    pub model: String,
    /// Who asks, for the choice of a version; robots without a name take no part in a canary.
    pub robot: Option<String>,
    /// Whether it is told why a room was answered.
    pub explain: bool,
    /// Whose frames they are.
    pub record: Arc<RobotRecord>,
    /// The stream's task.
    pub newsroom: UnboundedSender<News>,
}

impl Turn {
    /// Takes the stream's first frame that is still in time, and recognizes it.
    pub fn run(self) {
        let robot = self.robot.as_deref();
        let choose = || self.engine.registry.choose(Some(&self.model), &Choice::Serving, robot);
        // Numbers of a stream's frames grow as these are taken.
        let choose = || (choose(), self.engine.robots.frame_number());
        let Taken { expired, frame } = self.lane.take(Instant::now(), choose);
        let _ = self.newsroom.send(News::Took);
        for seq in expired {
            let _ = self.newsroom.send(News::Settled(seq, Outcome::Dropped(DropReason::Deadline)));
        }
        let Some((waiting, (served, number))) = frame else { return };
        let Waiting { seq, arrived, deadline, frame, n_header_bytes, has_scan, share, spans } = waiting;
        let span = spans.taken();
        let queue = arrived.elapsed();
        let mut verdict = Verdict { newsroom: &self.newsroom, seq, outcome: None };
        verdict.outcome = Some(match (served, frame.take()) {
            (_, None) => Outcome::Dropped(DropReason::Overload),
            (Err(error), _) => Outcome::Failed(error.into()),
            (Ok(served), Some(frame)) => {
                let shown_for = Some(Shown { robot: self.record.clone(), number: Some(number) });
                let (explain, transport) = (self.explain, Transport::Stream);
                let key = self.record.key().map(|key| key.name().into());
                let sender = Some(Sender { robot: self.robot.as_deref().map(Into::into), key });
                let task = Task { served, deadline, explain, transport, shown_for, sender };
                let frame = frame.after(n_header_bytes);
                match if has_scan { with_scan(&frame) } else { Ok(frame) } {
                    Ok(frame) => span.in_scope(|| see(&self.engine, frame, task, queue)),
                    Err(problem) => Outcome::Failed(problem),
                }
            }
        });
        // Others have its room before its robot hears.
        drop(share);
    }
}

/// The frame behind the scan that it begins with, and the scan.
fn with_scan(frame: &Frame) -> Result<Frame, Problem> {
    let scan = LaserScan::read(&frame.bytes).map_err(|error| Problem::query(error.to_string()))?;
    frame.after(scan.n_bytes()).with_scan(scan)
}

fn see(engine: &Engine, frame: Frame, task: Task, queue: Duration) -> Outcome {
    match look(engine, frame, task, &|| false) {
        Ok(mut seen) => {
            seen.timings.queue = queue;
            Outcome::Seen(Box::new(seen))
        }
        Err(error) => Outcome::Failed(error.into()),
    }
}

/// What becomes of a frame that a thread took: a panic on the way is an outcome too.
struct Verdict<'a> {
    newsroom: &'a UnboundedSender<News>,
    seq: u64,
    outcome: Option<Outcome>,
}

impl Drop for Verdict<'_> {
    fn drop(&mut self) {
        let outcome = self.outcome.take();
        let panicked = || Outcome::Failed(RecognizeError::from(Panicked).into());
        let _ = self.newsroom.send(News::Settled(self.seq, outcome.unwrap_or_else(panicked)));
    }
}
