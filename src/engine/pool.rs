//! The threads that recognize, and the bounded queue before them, which callers share.

mod queue;

use crate::engine::caller::CallerId;
use crate::problem::{Kind, Problem};
use crate::settings::Settings;
use queue::{Bounds, Charge, FairQueue, Refusal, Taken};
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use std::{io, thread};
use tokio::sync::oneshot;

const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// A fixed number of threads with a bounded queue. Callers get equal shares of the threads' time: see
/// [`FairQueue`]. A job is admitted by a [`Slot`], before its work exists.
pub struct Pool {
    shared: Arc<Shared>,
}

/// How large a pool is.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    pub n_threads: usize,
    /// Jobs that may wait for them.
    pub n_waiting: usize,
    /// Those of one caller among them.
    pub n_waiting_a_caller: usize,
}

/// How much a pool has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Load {
    pub n_threads: usize,
    pub n_running: usize,
    /// Jobs that wait for a thread, those for shadows left out.
    pub n_waiting: usize,
    /// All slots.
    pub n_slots: usize,
    /// Those that are taken.
    pub n_slots_in_use: usize,
}

/// The right to one place in the queue, given back when the job ends or the slot is dropped.
pub struct Slot {
    shared: Arc<Shared>,
    caller: CallerId,
}

/// A caller gets no slot, or lost it to one that had fewer.
#[derive(Clone, Copy, Debug, thiserror::Error, PartialEq, Eq)]
#[error("{whose}; try again after the time in Retry-After")]
pub struct QueueFull {
    /// Whose places are all taken.
    pub whose: Whose,
    /// When a slot is likely to be free.
    pub retry_after: Duration,
}

impl From<QueueFull> for Problem {
    fn from(full: QueueFull) -> Self {
        Self::new(Kind::QueueFull, full).with_retry_after(Some(full.retry_after))
    }
}

/// Whose places are all taken.
#[derive(Clone, Copy, Debug, thiserror::Error, PartialEq, Eq)]
pub enum Whose {
    /// The caller's own.
    #[error("this caller's share of the queue is used up")]
    Caller,
    #[error("the queue is full")]
    All,
}

/// The job died; the reason is in the log, the pool lives.
#[derive(Clone, Copy, Debug, thiserror::Error, PartialEq, Eq)]
#[error("a job panicked")]
pub struct Panicked;

/// Why a job that was admitted has no answer.
#[derive(Clone, Copy, Debug, thiserror::Error, PartialEq, Eq)]
pub enum Undone {
    /// It was pushed out of the queue for a caller with fewer jobs in it.
    #[error(transparent)]
    PushedOut(#[from] QueueFull),
    /// It died.
    #[error(transparent)]
    Panicked(#[from] Panicked),
}

/// What the threads and the pool share.
struct Shared {
    state: Mutex<State>,
    has_work: Condvar,
    size: Size,
    began: Instant,
}

struct State {
    jobs: FairQueue<Job>,
    /// What is done when nobody waits.
    shadows: VecDeque<Work>,
    n_running: usize,
    is_closed: bool,
}

/// What a job hears: its turn has come, or it is pushed out. It tells whether it has worked.
type Job = Box<dyn FnOnce(Result<(), QueueFull>) -> bool + Send>;
type Work = Box<dyn FnOnce() + Send>;

/// What a thread does next.
enum Next {
    Job(Taken<Job>),
    Shadow(Work),
}

impl Size {
    /// What the settings say.
    pub fn of(settings: &Settings) -> Self {
        let n_of_share = (settings.queue as f64 * settings.caller_share).ceil() as usize;
        Self {
            n_threads: settings.n_threads(),
            n_waiting: settings.queue,
            n_waiting_a_caller: n_of_share.max(settings.max_batch_frames).min(settings.queue),
        }
    }
}

impl Pool {
    pub fn new(size: Size) -> io::Result<Self> {
        let bounds = Bounds {
            n_slots: size.n_threads + size.n_waiting,
            n_slots_a_caller: size.n_threads + size.n_waiting_a_caller,
        };
        let state =
            State { jobs: FairQueue::new(bounds), shadows: VecDeque::new(), n_running: 0, is_closed: false };
        let shared = Arc::new(Shared {
            state: Mutex::new(state),
            has_work: Condvar::new(),
            size,
            began: Instant::now(),
        });
        let pool = Self { shared };
        for thread_idx in 0..size.n_threads {
            let shared = pool.shared.clone();
            thread::Builder::new().name(format!("recognize-{thread_idx}")).spawn(move || shared.work())?;
        }
        Ok(pool)
    }

    /// How much there is to do right now.
    pub fn load(&self) -> Load {
        let Size { n_threads, n_waiting, .. } = self.shared.size;
        let state = self.shared.state();
        Load {
            n_threads,
            n_running: state.n_running,
            n_waiting: state.jobs.n_waiting(),
            n_slots: n_threads + n_waiting,
            n_slots_in_use: state.jobs.n_slots_in_use(),
        }
    }

    /// Takes a slot of this caller for each of `n_jobs`, or none. Where the queue is full, jobs of callers
    /// that have more in it than this one would have are pushed out.
    pub fn admit(&self, caller: &CallerId, n_jobs: usize) -> Result<Vec<Slot>, QueueFull> {
        let mut state = self.shared.state();
        let pushed_out = state
            .jobs
            .admit(caller, n_jobs)
            .map_err(|refusal| self.shared.full(&state.jobs, caller, refusal))?;
        if !pushed_out.is_empty() {
            let full = self.shared.full(&state.jobs, caller, Refusal::Full);
            // They give their slots back, for which they need the state.
            drop(state);
            for job in pushed_out {
                job(Err(QueueFull { whose: Whose::Caller, ..full }));
            }
        }
        Ok((0..n_jobs).map(|_| Slot { shared: self.shared.clone(), caller: caller.clone() }).collect())
    }

    /// Takes one slot of this caller.
    pub fn admit_one(&self, caller: &CallerId) -> Result<Slot, QueueFull> {
        Ok(self.admit(caller, 1)?.remove(0))
    }

    /// Whether a slot can be had right now; takes none.
    pub fn has_room(&self, caller: &CallerId) -> Result<(), QueueFull> {
        let state = self.shared.state();
        state.jobs.has_room(caller, 1).map_err(|refusal| self.shared.full(&state.jobs, caller, refusal))
    }

    /// Queues `job` at once; the future waits for its answer. The job gets a question it may ask: has
    /// the caller left? It is not started for a caller that left while it waited, that is, who dropped
    /// the future.
    pub fn run<T: Send + 'static, J>(
        &self,
        slot: Slot,
        job: J,
    ) -> impl Future<Output = Result<T, Undone>> + use<T, J>
    where
        J: FnOnce(&dyn Fn() -> bool) -> T + Send + 'static,
    {
        let (sender, receiver) = oneshot::channel();
        let caller = slot.caller.clone();
        let job: Job = Box::new(move |turn| {
            if sender.is_closed() {
                return false;
            }
            let answer = turn.map(|()| job(&|| sender.is_closed()));
            let has_worked = answer.is_ok();
            // The slot is free before the caller can know, so that its next frame finds it free.
            drop(slot);
            let _ = sender.send(answer);
            has_worked
        });
        self.shared.queue(|state| state.jobs.push(&caller, job));
        async { Ok(receiver.await.map_err(|_| Panicked)??) }
    }

    /// Queues a job of this caller that takes no slot. Whoever calls this sees to it that few of theirs wait.
    pub fn queue(&self, caller: &CallerId, job: impl FnOnce() + Send + 'static) {
        let job: Job = Box::new(|turn| {
            if turn.is_ok() {
                job();
            }
            turn.is_ok()
        });
        self.shared.queue(|state| state.jobs.push_turn(caller, job));
    }

    /// Queues work that nobody waits for, behind all that somebody waits for.
    pub fn queue_shadow(&self, work: impl FnOnce() + Send + 'static) {
        self.shared.queue(|state| state.shadows.push_back(Box::new(work)));
    }
}

impl Drop for Pool {
    /// The threads end when they have done what they are at. The last of them may be the one that drops the
    /// pool, so that nobody waits for them.
    fn drop(&mut self) {
        self.shared.state().is_closed = true;
        self.shared.has_work.notify_all();
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        self.shared.state().jobs.release(&self.caller);
    }
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn queue(&self, push: impl FnOnce(&mut State)) {
        push(&mut self.state());
        self.has_work.notify_one();
    }

    /// What a thread does all its life.
    fn work(&self) {
        while let Some(next) = self.next() {
            match next {
                Next::Job(Taken { job, charge }) => {
                    let started = Instant::now();
                    let has_worked = caught(|| job(Ok(()))).unwrap_or(true);
                    self.finish(Some(charge), has_worked.then(|| started.elapsed()));
                }
                Next::Shadow(work) => {
                    let _ = caught(work);
                    self.finish(None, None);
                }
            }
        }
    }

    /// Waits for something to do; none when the pool is gone.
    fn next(&self) -> Option<Next> {
        let mut state = self.state();
        while !state.is_closed {
            let job = state.jobs.take(self.began.elapsed()).map(Next::Job);
            if let Some(next) = job.or_else(|| state.shadows.pop_front().map(Next::Shadow)) {
                state.n_running += 1;
                return Some(next);
            }
            state = self.has_work.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        None
    }

    fn finish(&self, charge: Option<Charge>, cost: Option<Duration>) {
        let mut state = self.state();
        state.n_running -= 1;
        if let Some(charge) = charge {
            state.jobs.finish(charge, cost);
        }
    }

    fn full(&self, jobs: &FairQueue<Job>, caller: &CallerId, refusal: Refusal) -> QueueFull {
        let whose = match refusal {
            Refusal::Share => Whose::Caller,
            Refusal::Full => Whose::All,
        };
        let work = jobs.work_ahead(caller, refusal, self.began.elapsed());
        let retry_after = (work / self.size.n_threads.max(1) as u32).min(LONGEST_WAIT);
        QueueFull { whose, retry_after }
    }
}

/// Does some work, and lives on when it panics.
fn caught<T>(work: impl FnOnce() -> T) -> Option<T> {
    // The panic hook has told what happened. What the work owned is dropped with it.
    catch_unwind(AssertUnwindSafe(work))
        .map_err(|_| tracing::error!("a recognition panicked; its frame is answered with 500"))
        .ok()
}

#[cfg(test)]
mod tests;
