//! The threads that recognize, and the bounded queue before them.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};

/// What a job is thought to take before the first was measured.
const FIRST_GUESS: Duration = Duration::from_millis(10);
/// The share of the newest job in the measured service time.
const NEWEST_SHARE: f64 = 0.1;
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// A fixed number of threads with a bounded queue. A job is admitted by a [`Slot`], before its
/// work exists; jobs run in the order in which they were given.
pub struct Pool {
    threads: rayon::ThreadPool,
    slots: Arc<Semaphore>,
    n_slots: usize,
    service_time: Arc<ServiceTime>,
    jobs: Arc<Jobs>,
}

/// How much a pool has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Load {
    /// Its threads.
    pub n_threads: usize,
    /// Jobs that run.
    pub n_running: usize,
    /// Jobs that wait for a thread.
    pub n_waiting: usize,
    /// All slots.
    pub n_slots: usize,
    /// Those that are taken.
    pub n_slots_in_use: usize,
}

/// The right to one place in the queue, given back when the job ends or the slot is dropped.
pub struct Slot {
    _permit: OwnedSemaphorePermit,
}

/// All slots are taken.
#[derive(Clone, Copy, Debug, thiserror::Error, PartialEq, Eq)]
#[error("the queue is full; try again after the time in Retry-After")]
pub struct QueueFull {
    /// When a slot is likely to be free.
    pub retry_after: Duration,
}

/// The job died; the reason is in the log, the pool lives.
#[derive(Clone, Copy, Debug, thiserror::Error, PartialEq, Eq)]
#[error("a job panicked")]
pub struct Panicked;

impl Pool {
    /// Starts `n_threads` threads; up to `n_waiting` jobs wait for them.
    pub fn new(n_threads: usize, n_waiting: usize) -> Result<Self, rayon::ThreadPoolBuildError> {
        let threads = rayon::ThreadPoolBuilder::new()
            .num_threads(n_threads)
            .thread_name(|thread_idx| format!("recognize-{thread_idx}"))
            // The panic hook has told what happened. Without a handler rayon ends the process.
            .panic_handler(|_| tracing::error!("a recognition panicked; its frame is answered with 500"))
            .build()?;
        let n_slots = n_threads + n_waiting;
        Ok(Self {
            threads,
            slots: Arc::new(Semaphore::new(n_slots)),
            n_slots,
            service_time: Arc::new(ServiceTime(AtomicU64::new(FIRST_GUESS.as_nanos() as u64))),
            jobs: Arc::default(),
        })
    }

    /// How much there is to do right now.
    pub fn load(&self) -> Load {
        Load {
            n_threads: self.threads.current_num_threads(),
            n_running: self.jobs.n_running.load(Ordering::Relaxed),
            n_waiting: self.jobs.n_waiting.load(Ordering::Relaxed),
            n_slots: self.n_slots,
            n_slots_in_use: self.n_slots_in_use(),
        }
    }

    /// Takes a slot for each of `n_jobs`, or none.
    pub fn admit(&self, n_jobs: usize) -> Result<Vec<Slot>, QueueFull> {
        let n_permits = u32::try_from(n_jobs).map_err(|_| self.full())?;
        let mut permits = self.slots.clone().try_acquire_many_owned(n_permits).map_err(|_| self.full())?;
        Ok((0..n_jobs).filter_map(|_| Some(Slot { _permit: permits.split(1)? })).collect())
    }

    /// Whether a slot is free right now; takes none.
    pub fn has_room(&self) -> Result<(), QueueFull> {
        if self.slots.available_permits() > 0 { Ok(()) } else { Err(self.full()) }
    }

    /// Queues `job` at once; the future waits for its answer. The job gets a question it may ask: has
    /// the caller left? It is not started for a caller that left while it waited, that is, who dropped
    /// the future.
    pub fn run<T: Send + 'static, J>(
        &self,
        slot: Slot,
        job: J,
    ) -> impl Future<Output = Result<T, Panicked>> + use<T, J>
    where
        J: FnOnce(&dyn Fn() -> bool) -> T + Send + 'static,
    {
        let (sender, receiver) = oneshot::channel();
        let service_time = self.service_time.clone();
        self.spawn(move || {
            if sender.is_closed() {
                return;
            }
            let started = Instant::now();
            let answer = job(&|| sender.is_closed());
            service_time.record(started.elapsed());
            // The slot is free before the caller can know, so that its next frame finds it free.
            drop(slot);
            let _ = sender.send(answer);
        });
        async { receiver.await.map_err(|_| Panicked) }
    }

    /// Queues a job that takes no slot, behind all that wait. Whoever calls this sees to it that few of
    /// theirs wait.
    pub fn queue(&self, job: impl FnOnce() + Send + 'static) {
        let service_time = self.service_time.clone();
        self.spawn(move || {
            let started = Instant::now();
            job();
            service_time.record(started.elapsed());
        });
    }

    fn spawn(&self, job: impl FnOnce() + Send + 'static) {
        let jobs = self.jobs.clone();
        jobs.n_waiting.fetch_add(1, Ordering::Relaxed);
        self.threads.spawn_fifo(move || {
            let _running = Running::begin(&jobs);
            job();
        });
    }

    fn full(&self) -> QueueFull {
        let n_threads = self.threads.current_num_threads();
        QueueFull { retry_after: expected_wait(self.n_slots_in_use(), self.service_time.get(), n_threads) }
    }

    fn n_slots_in_use(&self) -> usize {
        self.n_slots - self.slots.available_permits()
    }
}

/// The jobs that were given and have not ended.
#[derive(Default)]
struct Jobs {
    n_waiting: AtomicUsize,
    n_running: AtomicUsize,
}

/// A job that runs, until it ends or panics.
struct Running<'a>(&'a Jobs);

impl<'a> Running<'a> {
    fn begin(jobs: &'a Jobs) -> Self {
        jobs.n_waiting.fetch_sub(1, Ordering::Relaxed);
        jobs.n_running.fetch_add(1, Ordering::Relaxed);
        Self(jobs)
    }
}

impl Drop for Running<'_> {
    fn drop(&mut self) {
        self.0.n_running.fetch_sub(1, Ordering::Relaxed);
    }
}

/// How long `n_ahead` jobs of `service_time` keep `n_threads` threads busy.
fn expected_wait(n_ahead: usize, service_time: Duration, n_threads: usize) -> Duration {
    service_time.mul_f64(n_ahead as f64 / n_threads.max(1) as f64).min(LONGEST_WAIT)
}

/// A moving average, in nanoseconds.
struct ServiceTime(AtomicU64);

impl ServiceTime {
    fn get(&self) -> Duration {
        Duration::from_nanos(self.0.load(Ordering::Relaxed))
    }

    /// Two threads that record at once may lose one of the two: it is an estimate.
    fn record(&self, newest: Duration) {
        let average = self.get().mul_f64(1.0 - NEWEST_SHARE) + newest.mul_f64(NEWEST_SHARE);
        self.0.store(average.as_nanos() as u64, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;
    use std::sync::mpsc;

    fn slot(pool: &Pool) -> Slot {
        pool.admit(1).unwrap().remove(0)
    }

    /// A pool of one thread that is busy until the sender is dropped.
    async fn busy_pool(n_waiting: usize) -> (Arc<Pool>, mpsc::Sender<()>, tokio::task::JoinHandle<()>) {
        let pool = Arc::new(Pool::new(1, n_waiting).unwrap());
        let (release, released) = mpsc::channel::<()>();
        let (started, has_started) = oneshot::channel();
        let held = slot(&pool);
        let task = tokio::spawn({
            let pool = pool.clone();
            async move {
                let job = move |_: &dyn Fn() -> bool| {
                    let _ = started.send(());
                    let _ = released.recv();
                };
                pool.run(held, job).await.unwrap();
            }
        });
        has_started.await.unwrap();
        (pool, release, task)
    }

    #[tokio::test]
    async fn a_full_queue_refuses_and_a_batch_gets_all_or_nothing() {
        let (pool, release, task) = busy_pool(2).await;
        assert!(pool.admit(3).is_err(), "two slots are free");
        let waiting = pool.admit(2).unwrap();
        assert!(pool.has_room().is_err());
        assert!(pool.admit(1).is_err());
        drop(waiting);
        assert!(pool.has_room().is_ok());
        drop(release);
        task.await.unwrap();
        assert_eq!(pool.admit(3).unwrap().len(), 3);
    }

    #[tokio::test]
    async fn the_load_tells_what_waits_and_what_runs() {
        let (pool, release, task) = busy_pool(2).await;
        let waiting = pool.run(slot(&pool), |_| ());
        let load = pool.load();
        assert_eq!((load.n_threads, load.n_running, load.n_waiting), (1, 1, 1));
        assert_eq!((load.n_slots, load.n_slots_in_use), (3, 2));
        drop(release);
        task.await.unwrap();
        waiting.await.unwrap();
        let result: Result<(), _> = pool.run(slot(&pool), |_| panic!("broken on purpose")).await;
        assert_eq!(result, Err(Panicked));
        // One thread runs one job after the other: the one that panicked has ended when this one runs.
        let (tell, told) = oneshot::channel();
        let (release, released) = mpsc::channel::<()>();
        pool.queue(move || {
            let _ = tell.send(());
            let _ = released.recv();
        });
        told.await.unwrap();
        assert_eq!((pool.load().n_running, pool.load().n_waiting), (1, 0));
        drop(release);
    }

    #[tokio::test]
    async fn a_panic_is_an_error_of_its_job_and_frees_the_slot() {
        let pool = Pool::new(1, 0).unwrap();
        let result: Result<(), _> = pool.run(slot(&pool), |_| panic!("broken on purpose")).await;
        assert_eq!(result, Err(Panicked));
        tokio::time::timeout(Duration::from_secs(5), async {
            while pool.has_room().is_err() {
                tokio::task::yield_now().await;
            }
        })
        .await
        .unwrap();
        assert_eq!(pool.run(slot(&pool), |_| 7).await, Ok(7));
    }

    #[tokio::test]
    async fn the_slot_is_free_when_the_answer_arrives() {
        let pool = Pool::new(1, 0).unwrap();
        for _ in 0..200 {
            let slot = slot(&pool);
            pool.run(slot, |_| ()).await.unwrap();
        }
    }

    #[tokio::test]
    async fn nothing_is_done_for_a_caller_that_left_while_waiting() {
        let (pool, release, task) = busy_pool(2).await;
        let (ran, has_run) = mpsc::channel();
        let waiting = pool.run(slot(&pool), move |_| ran.send(()));
        assert!(tokio::time::timeout(Duration::from_millis(20), waiting).await.is_err());
        drop(release);
        task.await.unwrap();
        pool.run(slot(&pool), |_| ()).await.unwrap();
        assert!(has_run.try_recv().is_err());
    }

    #[tokio::test]
    async fn a_running_job_hears_that_its_caller_left() {
        let pool = Pool::new(1, 0).unwrap();
        let (tell, told) = mpsc::channel();
        let running = pool.run(slot(&pool), move |has_left| {
            while !has_left() {
                std::thread::yield_now();
            }
            let _ = tell.send(());
        });
        assert!(tokio::time::timeout(Duration::from_millis(20), running).await.is_err());
        told.recv_timeout(Duration::from_secs(5)).unwrap();
    }

    #[tokio::test]
    async fn jobs_run_in_the_order_given() {
        let (pool, release, task) = busy_pool(20).await;
        let order = Arc::new(Mutex::new(Vec::new()));
        let mut waiting = tokio::task::JoinSet::new();
        for job_idx in 0..20 {
            let (pool, order) = (pool.clone(), order.clone());
            let slot = slot(&pool);
            waiting.spawn(async move { pool.run(slot, move |_| order.lock().unwrap().push(job_idx)).await });
            tokio::task::yield_now().await;
        }
        drop(release);
        task.await.unwrap();
        waiting.join_all().await;
        assert_eq!(*order.lock().unwrap(), (0..20).collect::<Vec<_>>());
    }

    #[test]
    fn the_wait_grows_with_the_queue_and_shrinks_with_threads() {
        let ms = Duration::from_millis;
        assert_eq!(expected_wait(10, ms(100), 1), ms(1000));
        assert_eq!(expected_wait(10, ms(100), 4), ms(250));
        assert_eq!(expected_wait(0, ms(100), 1), ms(0));
        assert_eq!(expected_wait(1_000_000, ms(100), 1), LONGEST_WAIT);
    }

    #[test]
    fn the_service_time_follows_what_is_measured() {
        let service_time = ServiceTime(AtomicU64::new(0));
        for _ in 0..100 {
            service_time.record(Duration::from_millis(50));
        }
        assert!((49..=50).contains(&service_time.get().as_millis()), "{:?}", service_time.get());
    }
}
