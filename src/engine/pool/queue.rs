//! Whose turn it is: jobs of many callers, taken so that each caller gets an equal share of the work.
//!
//! This is start-time fair queueing. Each caller has a virtual time, the work that was done for it; the caller
//! with the least is served next, its jobs in the order given. What a job costs is known only when it is
//! done: until then the caller is charged what its jobs cost lately, or what one in work has cost already. A
//! caller that comes or comes back begins at the virtual time of those who were there, so that nobody saves up
//! turns.
//!
//! Nothing here knows a thread, or a clock: times of day are given, as durations since any one moment.

use crate::engine::caller::CallerId;
use std::collections::{BTreeSet, HashMap, VecDeque};
use std::time::Duration;

/// What a job is thought to cost before the first was measured.
const FIRST_GUESS: Duration = Duration::from_millis(10);
/// The share of the newest job in the mean cost of all jobs.
const NEWEST_OF_ALL: f64 = 0.1;
/// The same for the jobs of one caller, of which there are fewer.
const NEWEST_OF_CALLER: f64 = 0.3;
/// The part of a mean job by which a caller that comes is behind those who are there. Without it callers that
/// come under ever new names would hold back those who wait.
const ENTRY: f64 = 0.25;
/// The fewest accounts at which idle ones are closed that owe others a little.
const MIN_ACCOUNTS: usize = 1024;

/// Jobs that wait, by caller.
pub struct FairQueue<J> {
    bounds: Bounds,
    accounts: HashMap<CallerId, Account<J>>,
    /// As many may be kept before idle ones are closed: who calls under ever new names fills no memory.
    max_accounts: usize,
    /// The callers with jobs that wait, the one that is served next first.
    ready: BTreeSet<Turn>,
    n_placed: u64,
    /// The virtual time of the caller that was served last.
    now: Duration,
    mean_cost: Duration,
    n_slots_in_use: usize,
    n_turns: usize,
    n_waiting: usize,
}

/// How much may wait and run.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Jobs of all callers.
    pub n_slots: usize,
    /// Jobs of one caller.
    pub n_slots_a_caller: usize,
}

/// What is known of one caller that is served, or was a moment ago.
struct Account<J> {
    waiting: VecDeque<Waiting<J>>,
    n_slots: usize,
    n_turns: usize,
    /// When each of its jobs in work was taken.
    running: Vec<Duration>,
    /// Its virtual time.
    served: Duration,
    mean_cost: Duration,
    turn: Option<Turn>,
}

struct Waiting<J> {
    job: J,
    /// A turn holds no slot, and cannot be pushed out.
    is_turn: bool,
}

/// A caller's place among those that wait.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Turn {
    served: Duration,
    /// Among those of one time who came first goes first.
    order: u64,
    caller: CallerId,
}

/// A job whose turn has come. It must be handed back to [`FairQueue::finish`].
pub struct Taken<J> {
    pub job: J,
    /// What it is charged to.
    pub charge: Charge,
}

/// What a caller was charged for a job that is not done yet.
#[derive(Debug)]
pub struct Charge {
    caller: CallerId,
    amount: Duration,
    taken_at: Duration,
    is_turn: bool,
}

/// Why a job may not wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The caller has its share of the queue.
    Share,
    /// Nobody has more in the queue than the caller would have.
    Full,
}

impl<J> FairQueue<J> {
    /// An empty queue.
    pub fn new(bounds: Bounds) -> Self {
        Self {
            bounds,
            accounts: HashMap::new(),
            max_accounts: MIN_ACCOUNTS,
            ready: BTreeSet::new(),
            n_placed: 0,
            now: Duration::ZERO,
            mean_cost: FIRST_GUESS,
            n_slots_in_use: 0,
            n_turns: 0,
            n_waiting: 0,
        }
    }

    pub fn n_waiting(&self) -> usize {
        self.n_waiting
    }

    /// Slots that are held.
    pub fn n_slots_in_use(&self) -> usize {
        self.n_slots_in_use
    }

    /// Whether the caller would get `n_jobs` slots now; takes none.
    pub fn has_room(&self, caller: &CallerId, n_jobs: usize) -> Result<(), Refusal> {
        self.to_push_out(caller, n_jobs).map(drop)
    }

    /// Takes a slot for each of `n_jobs`, or none. Where the queue is full, jobs of callers that have more in
    /// it than this one would have are pushed out, the youngest of whoever has most first. These are
    /// returned, and hold their slots until they give them back.
    pub fn admit(&mut self, caller: &CallerId, n_jobs: usize) -> Result<Vec<J>, Refusal> {
        let victims = self.to_push_out(caller, n_jobs)?;
        self.account(caller).n_slots += n_jobs;
        self.n_slots_in_use += n_jobs;
        Ok(victims.into_iter().filter_map(|victim| self.push_out(&victim)).collect())
    }

    /// Gives back a slot.
    pub fn release(&mut self, caller: &CallerId) {
        self.n_slots_in_use -= 1;
        self.account(caller).n_slots -= 1;
        self.forget(caller);
    }

    /// Lets a job wait that has a slot.
    pub fn push(&mut self, caller: &CallerId, job: J) {
        self.wait(caller, Waiting { job, is_turn: false });
    }

    /// Lets a job wait that has none: a turn. It is never refused and never pushed out, so that whoever calls
    /// this sees to it that few of theirs wait.
    pub fn push_turn(&mut self, caller: &CallerId, job: J) {
        self.n_turns += 1;
        self.account(caller).n_turns += 1;
        self.wait(caller, Waiting { job, is_turn: true });
    }

    /// The job that is next, if any waits.
    pub fn take(&mut self, now: Duration) -> Option<Taken<J>> {
        let Turn { served, caller, .. } = self.ready.pop_first()?;
        self.now = self.now.max(served);
        let account = self.accounts.get_mut(&caller)?;
        account.turn = None;
        let Waiting { job, is_turn } = account.waiting.pop_front()?;
        self.n_waiting -= 1;
        let amount = account.cost(now);
        account.served += amount;
        account.running.push(now);
        self.line_up(&caller);
        Some(Taken { job, charge: Charge { caller, amount, taken_at: now, is_turn } })
    }

    /// A job is done, and cost so much; none where nothing had to be done.
    pub fn finish(&mut self, Charge { caller, amount, taken_at, is_turn }: Charge, cost: Option<Duration>) {
        if let Some(cost) = cost {
            self.mean_cost = mean(self.mean_cost, cost, NEWEST_OF_ALL);
        }
        let account = self.account(&caller);
        if let Some(cost) = cost {
            account.mean_cost = mean(account.mean_cost, cost, NEWEST_OF_CALLER);
        }
        account.served = (account.served + cost.unwrap_or_default()).saturating_sub(amount);
        if let Some(idx) = account.running.iter().position(|other| *other == taken_at) {
            account.running.swap_remove(idx);
        }
        account.n_turns -= usize::from(is_turn);
        self.n_turns -= usize::from(is_turn);
        self.line_up(&caller);
        self.forget(&caller);
    }

    /// The work to be done before a slot is likely to be had by a caller that was refused.
    pub fn work_ahead(&self, caller: &CallerId, refusal: Refusal, now: Duration) -> Duration {
        match (refusal, self.accounts.get(caller)) {
            // While its own work is done, as much is done for each of the others that wait.
            (Refusal::Share, Some(account)) => account.work(now) * self.ready.len().max(1) as u32,
            _ => self.accounts.values().map(|account| account.work(now)).sum(),
        }
    }

    /// Whose jobs must be pushed out, one for each entry, for the caller to get `n_jobs` slots.
    fn to_push_out(&self, caller: &CallerId, n_jobs: usize) -> Result<Vec<CallerId>, Refusal> {
        let n_held = self.accounts.get(caller).map_or(0, Account::n_held) + n_jobs;
        if n_held > self.bounds.n_slots_a_caller {
            // Whose share is all of it need not hear of shares.
            let has_all = self.bounds.n_slots_a_caller >= self.bounds.n_slots;
            return Err(if has_all { Refusal::Full } else { Refusal::Share });
        }
        let n_slots_over = (self.n_slots_in_use + n_jobs).saturating_sub(self.bounds.n_slots);
        let n_over = (self.n_slots_in_use + self.n_turns + n_jobs).saturating_sub(self.bounds.n_slots);
        let mut victims = Vec::new();
        if n_over == 0 {
            return Ok(victims);
        }
        let mut holders: Vec<Holder> = self.accounts.iter().map(Holder::from).collect();
        while victims.len() < n_over {
            let must_push_out = victims.len() < n_slots_over;
            let with_most = holders
                .iter_mut()
                .filter(|it| it.n_held > n_held && (it.n_frames > 0 || !must_push_out))
                .max_by_key(|it| it.n_held);
            match with_most {
                // Turns are never refused, so that they can fill the queue by themselves: there are still slots, and
                // who has nothing in the queue gets one as a stream gets its turn.
                None if !must_push_out && n_held == 1 => break,
                None => return Err(Refusal::Full),
                Some(holder) if holder.n_frames > 0 => {
                    holder.n_held -= 1;
                    holder.n_frames -= 1;
                    victims.push(holder.caller.clone());
                }
                // Turns stay, but whose turns fill the queue keeps nobody out who has less in it.
                Some(_) => break,
            }
        }
        Ok(victims)
    }

    /// Takes the youngest job that holds a slot out of the queue.
    fn push_out(&mut self, caller: &CallerId) -> Option<J> {
        let account = self.accounts.get_mut(caller)?;
        let idx = account.waiting.iter().rposition(|waiting| !waiting.is_turn)?;
        let Waiting { job, .. } = account.waiting.remove(idx)?;
        self.n_waiting -= 1;
        self.line_up(caller);
        Some(job)
    }

    fn wait(&mut self, caller: &CallerId, waiting: Waiting<J>) {
        let now = self.now;
        let account = self.account(caller);
        if account.waiting.is_empty() {
            account.served = account.served.max(now);
        }
        account.waiting.push_back(waiting);
        self.n_waiting += 1;
        self.line_up(caller);
    }

    /// Puts a caller where it belongs among those that wait.
    fn line_up(&mut self, caller: &CallerId) {
        let Some(account) = self.accounts.get_mut(caller) else { return };
        let order = match account.turn.take() {
            Some(turn) => {
                self.ready.remove(&turn);
                turn.order
            }
            None => {
                self.n_placed += 1;
                self.n_placed
            }
        };
        if !account.waiting.is_empty() {
            let turn = Turn { served: account.served, order, caller: caller.clone() };
            account.turn = Some(turn.clone());
            self.ready.insert(turn);
        }
    }

    /// The account of a caller, opened where there is none.
    fn account(&mut self, caller: &CallerId) -> &mut Account<J> {
        if self.accounts.len() >= self.max_accounts && !self.accounts.contains_key(caller) {
            self.accounts.retain(|_, account| !account.is_idle());
            self.max_accounts = MIN_ACCOUNTS.max(2 * self.accounts.len());
        }
        self.accounts.entry(caller.clone()).or_insert_with(|| Account {
            waiting: VecDeque::new(),
            n_slots: 0,
            n_turns: 0,
            running: Vec::new(),
            served: self.now + self.mean_cost.mul_f64(ENTRY),
            mean_cost: self.mean_cost,
            turn: None,
        })
    }

    /// Closes the account of a caller of which nothing need be remembered.
    fn forget(&mut self, caller: &CallerId) {
        if self.accounts.get(caller).is_some_and(|it| it.is_idle() && it.served <= self.now) {
            self.accounts.remove(caller);
        }
    }
}

impl<J> Account<J> {
    /// What it has in the queue and in work.
    fn n_held(&self) -> usize {
        self.n_slots + self.n_turns
    }

    fn is_idle(&self) -> bool {
        self.n_held() == 0 && self.running.is_empty()
    }

    /// What a job is likely to cost: what they cost lately, or what one in work has cost already.
    fn cost(&self, now: Duration) -> Duration {
        let longest = self.running.iter().map(|&taken_at| now.saturating_sub(taken_at)).max();
        self.mean_cost.max(longest.unwrap_or_default())
    }

    /// What all its jobs are likely to cost.
    fn work(&self, now: Duration) -> Duration {
        self.cost(now) * self.n_held() as u32
    }
}

/// What a caller has in the queue, for the choice of whose jobs are pushed out.
struct Holder<'a> {
    caller: &'a CallerId,
    n_held: usize,
    /// Those that can be pushed out.
    n_frames: usize,
}

impl<'a, J> From<(&'a CallerId, &Account<J>)> for Holder<'a> {
    fn from((caller, account): (&'a CallerId, &Account<J>)) -> Self {
        let n_frames = account.waiting.iter().filter(|waiting| !waiting.is_turn).count();
        Self { caller, n_held: account.n_held(), n_frames }
    }
}

fn mean(before: Duration, newest: Duration, share: f64) -> Duration {
    before.mul_f64(1.0 - share) + newest.mul_f64(share)
}

#[cfg(test)]
mod tests;
