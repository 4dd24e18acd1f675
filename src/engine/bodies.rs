//! The memory for bodies under way: what each caller holds of it, and whose body gives way when it is short.
//!
//! A caller holds at most its share. Where bytes are short, the share's or all, a body that is not complete
//! gives way: one that has not moved for a while; of the same caller one that is larger than the body that
//! needs them would be; of another caller one where that caller holds more than this one would.

use crate::engine::caller::CallerId;
use crate::engine::pool::{QueueFull, Whose};
use crate::settings::Settings;
use std::collections::{BTreeMap, HashMap};
use std::pin::pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{Notify, OwnedSemaphorePermit, Semaphore};
use tokio::time::timeout_at;
use tokio_util::sync::CancellationToken;

const STALLED: Duration = Duration::from_secs(1);
/// How long the bytes of a body that gives way may take to be free.
const PATIENCE: Duration = Duration::from_secs(1);
/// When to come back where no memory is left.
const COME_BACK: Duration = Duration::from_secs(1);

/// Too many bytes are held, by the caller or by all.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error(
    "too many bytes are being received, from this caller or from all; try again after the time in Retry-After"
)]
pub struct NoMemory(pub QueueFull);

/// All bodies that are held.
pub struct Bodies {
    /// One permit for each byte.
    memory: Arc<Semaphore>,
    limits: BodyLimits,
    /// How long a body must not have moved before any other may have its bytes.
    stalled_after: Duration,
    state: Mutex<State>,
    /// Told when a body gives its bytes back.
    freed: Notify,
}

/// How many bytes may be held.
#[derive(Clone, Copy, Debug)]
pub struct BodyLimits {
    /// By all bodies; what is left of the memory is for frames of streams.
    pub all: usize,
    /// By the bodies of one caller.
    pub one_caller: usize,
}

#[derive(Default)]
struct State {
    n_bytes: usize,
    bytes_by_caller: HashMap<CallerId, usize>,
    under_way: BTreeMap<u64, UnderWay>,
    n_begun: u64,
}

/// A body that is not complete.
struct UnderWay {
    caller: CallerId,
    n_bytes: usize,
    moved: Instant,
    give_way: CancellationToken,
}

/// The bytes of one body; given back when dropped.
pub struct Held {
    bodies: Arc<Bodies>,
    id: u64,
    caller: CallerId,
    bytes: OwnedSemaphorePermit,
    give_way: CancellationToken,
}

/// Which bytes are short.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Short {
    Share,
    All,
}

impl BodyLimits {
    /// Three quarters of all bytes, so that frames of streams, unfinished ones of which have a quarter, are not
    /// stopped by requests. The longest body always fits.
    pub fn of(settings: &Settings) -> Self {
        let all = (settings.max_buffered_bytes / 4 * 3).max(settings.largest_body());
        let of_share = (settings.max_buffered_bytes as f64 * settings.caller_share) as usize;
        Self { all, one_caller: of_share.max(settings.largest_body()).min(all) }
    }
}

impl Bodies {
    /// Bodies in this memory, which has a permit for each byte.
    pub fn new(memory: Arc<Semaphore>, limits: BodyLimits) -> Self {
        Self { memory, limits, stalled_after: STALLED, state: Mutex::default(), freed: Notify::new() }
    }

    /// A body of this caller begins; it holds nothing yet.
    ///
    /// # Errors
    /// The service ends.
    pub fn begin(self: &Arc<Self>, caller: CallerId) -> Result<Held, NoMemory> {
        let bytes = self.memory.clone().try_acquire_many_owned(0).map_err(|_| no_memory(Short::All))?;
        let give_way = CancellationToken::new();
        let mut state = self.state();
        let id = state.n_begun;
        state.n_begun += 1;
        let body = UnderWay {
            caller: caller.clone(),
            n_bytes: 0,
            moved: Instant::now(),
            give_way: give_way.clone(),
        };
        state.under_way.insert(id, body);
        drop(state);
        Ok(Held { bodies: self.clone(), id, caller, bytes, give_way })
    }

    /// Asks a body to give way to the one with this number, which will be `n_whole` long; false where none
    /// has to.
    fn ask(&self, for_id: u64, n_whole: usize, short: Short) -> bool {
        let mut state = self.state();
        let State { bytes_by_caller, under_way, .. } = &mut *state;
        let Some(needy) = under_way.get(&for_id) else { return false };
        let held = |caller: &CallerId| bytes_by_caller.get(caller).copied().unwrap_or_default();
        let needy_would_hold = held(&needy.caller) + n_whole - needy.n_bytes;
        let must = |body: &UnderWay| {
            let is_own = body.caller == needy.caller;
            let has_more =
                if is_own { body.n_bytes > n_whole } else { held(&body.caller) > needy_would_hold };
            (is_own || short == Short::All) && (has_more || body.moved.elapsed() >= self.stalled_after)
        };
        let victim = under_way
            .iter()
            .filter(|(id, body)| **id != for_id && body.n_bytes > 0 && must(body))
            .max_by_key(|(_, body)| (held(&body.caller), body.n_bytes))
            .map(|(id, _)| *id);
        // It is asked once.
        let victim = victim.and_then(|id| under_way.remove(&id));
        victim.is_some_and(|body| {
            body.give_way.cancel();
            true
        })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Held {
    /// How many bytes are held.
    pub fn n_bytes(&self) -> usize {
        self.bytes.num_permits()
    }

    /// Ready when the body must give way to others.
    pub async fn gives_way(&self) -> NoMemory {
        self.give_way.cancelled().await;
        no_memory(Short::Share)
    }

    /// Takes bytes that have come; `n_whole` is how long the body will be, at least.
    ///
    /// # Errors
    /// None are left, and nobody gives way.
    pub async fn take(&mut self, n_bytes: usize, n_whole: usize) -> Result<(), NoMemory> {
        let n_whole = n_whole.max(self.n_bytes() + n_bytes);
        let bodies = self.bodies.clone();
        let deadline = Instant::now() + PATIENCE;
        loop {
            let mut freed = pin!(bodies.freed.notified());
            freed.as_mut().enable();
            let Err(short) = self.try_take(n_bytes) else { return Ok(()) };
            let is_asked = bodies.ask(self.id, n_whole, short);
            if !is_asked || timeout_at(deadline.into(), freed).await.is_err() {
                return Err(no_memory(short));
            }
        }
    }

    fn try_take(&mut self, n_bytes: usize) -> Result<(), Short> {
        let mut state = self.bodies.state();
        let held = state.bytes_by_caller.get(&self.caller).copied().unwrap_or_default();
        let BodyLimits { all, one_caller } = self.bodies.limits;
        if held + n_bytes > one_caller {
            return Err(Short::Share);
        }
        if state.n_bytes + n_bytes > all {
            return Err(Short::All);
        }
        let n_permits = u32::try_from(n_bytes).map_err(|_| Short::All)?;
        let taken = self.bodies.memory.clone().try_acquire_many_owned(n_permits).map_err(|_| Short::All)?;
        state.bytes_by_caller.insert(self.caller.clone(), held + n_bytes);
        state.n_bytes += n_bytes;
        if let Some(body) = state.under_way.get_mut(&self.id) {
            body.n_bytes += n_bytes;
            body.moved = Instant::now();
        }
        drop(state);
        self.bytes.merge(taken);
        Ok(())
    }

    /// The body is here, and gives way no more.
    pub fn complete(&self) {
        self.bodies.state().under_way.remove(&self.id);
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        let mut state = self.bodies.state();
        state.under_way.remove(&self.id);
        state.n_bytes -= self.bytes.num_permits();
        if let Some(held) = state.bytes_by_caller.get_mut(&self.caller) {
            *held -= self.bytes.num_permits();
            if *held == 0 {
                state.bytes_by_caller.remove(&self.caller);
            }
        }
        drop(state);
        drop(self.bytes.split(self.bytes.num_permits()));
        self.bodies.freed.notify_waiters();
    }
}

fn no_memory(short: Short) -> NoMemory {
    let whose = if short == Short::Share { Whose::Caller } else { Whose::All };
    NoMemory(QueueFull { whose, retry_after: COME_BACK })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(name: &str) -> CallerId {
        CallerId::Robot(name.into())
    }

    fn bodies(n_bytes: usize, one_caller: usize) -> Bodies {
        let memory = Arc::new(Semaphore::new(n_bytes));
        let limits = BodyLimits { all: n_bytes, one_caller };
        Bodies { stalled_after: Duration::MAX, ..Bodies::new(memory, limits) }
    }

    async fn body(bodies: &Arc<Bodies>, name: &str, n_bytes: usize) -> Held {
        let mut held = bodies.begin(robot(name)).unwrap();
        held.take(n_bytes, n_bytes).await.unwrap();
        held
    }

    /// Lets a body give way as soon as it is asked.
    fn yielding(held: Held) -> tokio::task::JoinHandle<()> {
        tokio::spawn(async move {
            let _gave_way = held.gives_way().await;
        })
    }

    #[tokio::test]
    async fn a_caller_holds_at_most_its_share() {
        let bodies = Arc::new(bodies(100, 50));
        let mut held = body(&bodies, "a", 40).await;
        assert_eq!(held.take(20, 60).await, Err(no_memory(Short::Share)));
        let _other = body(&bodies, "b", 50).await;
        held.take(10, 50).await.unwrap();
        drop(held);
        assert_eq!(bodies.memory.available_permits(), 50);
        assert_eq!(bodies.state().bytes_by_caller.len(), 1);
    }

    #[tokio::test]
    async fn the_bodies_of_whoever_holds_most_give_way_where_all_bytes_are_held() {
        let bodies = Arc::new(bodies(100, 60));
        let (large, small) = (body(&bodies, "a", 60).await, body(&bodies, "b", 40).await);
        let gone = yielding(large);
        let mut polite = bodies.begin(robot("c")).unwrap();
        polite.take(10, 10).await.unwrap();
        gone.await.unwrap();
        assert!(!small.give_way.is_cancelled());
    }

    #[tokio::test]
    async fn bodies_leave_memory_to_others() {
        let memory = Arc::new(Semaphore::new(100));
        let bodies = Arc::new(Bodies::new(memory.clone(), BodyLimits { all: 75, one_caller: 50 }));
        let (_one, mut other) = (body(&bodies, "a", 50).await, body(&bodies, "b", 20).await);
        assert_eq!(other.take(10, 30).await, Err(no_memory(Short::All)));
        assert_eq!(memory.available_permits(), 30);
        drop(other);
        body(&bodies, "c", 25).await;
    }

    #[tokio::test]
    async fn within_a_share_a_larger_body_gives_way_to_a_smaller_one() {
        let bodies = Arc::new(bodies(100, 50));
        let large = body(&bodies, "a", 50).await;
        let mut as_large = bodies.begin(robot("a")).unwrap();
        assert_eq!(as_large.take(10, 50).await, Err(no_memory(Short::Share)), "it will be no smaller");
        let gone = yielding(large);
        bodies.begin(robot("a")).unwrap().take(5, 5).await.unwrap();
        gone.await.unwrap();
    }

    #[tokio::test]
    async fn a_body_that_stalls_gives_way_to_any_but_not_to_those_who_have_bytes_left() {
        let bodies = Arc::new(Bodies { stalled_after: Duration::ZERO, ..bodies(100, 50) });
        let stalled = body(&bodies, "a", 50).await;
        let mut other = body(&bodies, "b", 40).await;
        assert!(!stalled.give_way.is_cancelled());
        let gone = yielding(stalled);
        body(&bodies, "a", 50).await;
        gone.await.unwrap();
        other.take(10, 50).await.unwrap();
    }

    #[tokio::test]
    async fn a_complete_body_never_gives_way() {
        let bodies = Arc::new(Bodies { stalled_after: Duration::ZERO, ..bodies(100, 100) });
        let held = body(&bodies, "a", 100).await;
        held.complete();
        let mut polite = bodies.begin(robot("b")).unwrap();
        assert_eq!(polite.take(1, 1).await, Err(no_memory(Short::All)));
        assert!(!held.give_way.is_cancelled());
    }
}
