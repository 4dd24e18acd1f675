//! The places for connections, and which connection gives way when all are taken.
//!
//! A place is never refused: who comes waits until one is free. Where all are taken, one that rests gives way:
//! of the address that has most, the one that has rested longest. A connection rests where it is the caller's
//! turn: between requests, in a head or a body that comes, and while what was answered is taken.

use crate::engine::caller::CallerId;
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{sleep, timeout};
use tokio_util::sync::CancellationToken;

/// How long a connection that gives way may take to end well.
const GRACE: Duration = Duration::from_secs(1);

/// All places.
pub struct Seats {
    permits: Arc<Semaphore>,
    taken: Mutex<Taken>,
}

#[derive(Default)]
struct Taken {
    lines: BTreeMap<u64, Arc<Line>>,
    n_begun: u64,
}

/// A connection's place, given back when dropped.
pub struct Seat {
    seats: Arc<Seats>,
    id: u64,
    line: Arc<Line>,
    _permit: OwnedSemaphorePermit,
}

/// What is known of a connection outside its task.
pub struct Line {
    address: CallerId,
    state: Mutex<State>,
    give_way: CancellationToken,
}

struct State {
    n_at_work: usize,
    rests_since: Instant,
}

/// The service is at work for a connection, or waits for its caller, until this is dropped.
pub struct Guard {
    line: Arc<Line>,
    change: isize,
}

impl Seats {
    /// This many.
    pub fn new(n_rooms: usize) -> Self {
        Self { permits: Arc::new(Semaphore::new(n_rooms)), taken: Mutex::default() }
    }

    /// A place for a connection from an address, once one is free. Dropped early it takes none.
    pub async fn take(self: &Arc<Self>, address: CallerId) -> Seat {
        loop {
            if let Ok(permit) = self.permits.clone().try_acquire_owned() {
                return self.seated(address, permit);
            }
            self.taken().ask();
            // Where nobody rests now somebody may soon.
            if let Ok(Ok(permit)) = timeout(2 * GRACE, self.permits.clone().acquire_owned()).await {
                return self.seated(address, permit);
            }
        }
    }

    fn seated(self: &Arc<Self>, address: CallerId, permit: OwnedSemaphorePermit) -> Seat {
        let state = State { n_at_work: 0, rests_since: Instant::now() };
        let line = Arc::new(Line { address, state: Mutex::new(state), give_way: CancellationToken::new() });
        let mut taken = self.taken();
        let id = taken.n_begun;
        taken.n_begun += 1;
        taken.lines.insert(id, line.clone());
        Seat { seats: self.clone(), id, line, _permit: permit }
    }

    fn taken(&self) -> MutexGuard<'_, Taken> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Taken {
    /// Asks a connection that rests to give way, if there is one.
    fn ask(&self) {
        let mut n_by_address = HashMap::<&CallerId, usize>::new();
        for line in self.lines.values() {
            *n_by_address.entry(&line.address).or_default() += 1;
        }
        let rests = |line: &&Arc<Line>| !line.give_way.is_cancelled() && line.rests_since().is_some();
        let rank = |line: &&Arc<Line>| {
            let rested = line.rests_since().map(|since| since.elapsed());
            (n_by_address.get(&line.address).copied(), rested)
        };
        if let Some(line) = self.lines.values().filter(rests).max_by_key(rank) {
            line.give_way.cancel();
        }
    }
}

impl Seat {
    /// What is known of its connection.
    pub fn line(&self) -> &Arc<Line> {
        &self.line
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.seats.taken().lines.remove(&self.id);
    }
}

impl Line {
    /// A request is at work, until the guard is dropped.
    pub fn works(self: &Arc<Self>) -> Guard {
        Guard::new(self, 1)
    }

    /// A request at work waits for its caller, until the guard is dropped.
    pub fn waits(self: &Arc<Self>) -> Guard {
        Guard::new(self, -1)
    }

    /// Ready when the connection must give way: it should end, and take no new request.
    pub async fn gives_way(&self) {
        self.give_way.cancelled().await;
    }

    /// Ready when a connection that gives way has had its time and nothing is at work for it.
    pub async fn is_given_up(&self) {
        loop {
            sleep(GRACE).await;
            if self.rests_since().is_some() {
                return;
            }
        }
    }

    fn rests_since(&self) -> Option<Instant> {
        let state = self.state();
        (state.n_at_work == 0).then_some(state.rests_since)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, by: isize) {
        let mut state = self.state();
        state.n_at_work = state.n_at_work.saturating_add_signed(by);
        state.rests_since = Instant::now();
    }
}

impl Guard {
    fn new(line: &Arc<Line>, change: isize) -> Self {
        line.change(change);
        Self { line: line.clone(), change }
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        self.line.change(-self.change);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn address(last: u8) -> CallerId {
        CallerId::at([10, 0, 0, last].into())
    }

    fn must_go(seat: &Seat) -> bool {
        seat.line.give_way.is_cancelled()
    }

    /// A place that is given back when its connection is asked for it.
    fn yielding(seat: Seat) -> tokio::task::JoinHandle<()> {
        tokio::spawn(async move { seat.line().gives_way().await })
    }

    #[tokio::test]
    async fn the_longest_resting_of_whoever_has_most_gives_way() {
        let seats = Arc::new(Seats::new(3));
        let other = seats.take(address(2)).await;
        let (oldest, newest) = (seats.take(address(1)).await, seats.take(address(1)).await);
        let gone = yielding(oldest);
        let third = seats.take(address(3)).await;
        gone.await.unwrap();
        assert!(!must_go(&other) && !must_go(&newest) && !must_go(&third));
        let gone = yielding(other);
        let _fourth = seats.take(address(3)).await;
        gone.await.unwrap();
        assert!(!must_go(&newest), "all have one: the oldest gave way");
    }

    #[tokio::test]
    async fn a_connection_that_is_served_does_not_give_way_but_one_that_is_waited_for_does() {
        let seats = Arc::new(Seats::new(1));
        let seat = seats.take(address(1)).await;
        let works = seat.line().works();
        seats.taken().ask();
        assert!(!must_go(&seat));
        let waits = seat.line().waits();
        seats.taken().ask();
        assert!(must_go(&seat));
        drop((waits, works));
        assert!(seat.line().rests_since().is_some());
        drop(seat);
        assert_eq!((seats.permits.available_permits(), seats.taken().lines.len()), (1, 0));
    }
}
