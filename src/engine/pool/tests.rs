use super::*;
use std::sync::mpsc;

fn robot(name: &str) -> CallerId {
    CallerId::Robot(name.into())
}

fn pool(n_threads: usize, n_waiting: usize) -> Pool {
    Pool::new(Size { n_threads, n_waiting, n_waiting_a_caller: n_waiting }).unwrap()
}

fn slot(pool: &Pool) -> Slot {
    slot_of(pool, "wall-e")
}

fn slot_of(pool: &Pool, name: &str) -> Slot {
    pool.admit_one(&robot(name)).unwrap()
}

/// A pool of one thread that is busy until the sender is dropped.
async fn busy_pool(n_waiting: usize) -> (Arc<Pool>, mpsc::Sender<()>, tokio::task::JoinHandle<()>) {
    let pool = Arc::new(pool(1, n_waiting));
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
    let me = robot("wall-e");
    assert!(pool.admit(&me, 3).is_err(), "two slots are free");
    let waiting = pool.admit(&me, 2).unwrap();
    assert!(pool.has_room(&me).is_err());
    assert!(pool.admit(&me, 1).is_err());
    drop(waiting);
    assert!(pool.has_room(&me).is_ok());
    drop(release);
    task.await.unwrap();
    assert_eq!(pool.admit(&me, 3).unwrap().len(), 3);
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
    assert_eq!(result, Err(Undone::Panicked(Panicked)));
    // One thread runs one job after the other: the one that panicked has ended when this one runs.
    let (tell, told) = oneshot::channel();
    let (release, released) = mpsc::channel::<()>();
    pool.queue(&robot("wall-e"), move || {
        let _ = tell.send(());
        let _ = released.recv();
    });
    told.await.unwrap();
    assert_eq!((pool.load().n_running, pool.load().n_waiting), (1, 0));
    drop(release);
}

#[tokio::test]
async fn a_panic_is_an_error_of_its_job_and_frees_the_slot() {
    let pool = pool(1, 0);
    let result: Result<(), _> = pool.run(slot(&pool), |_| panic!("broken on purpose")).await;
    assert_eq!(result, Err(Undone::Panicked(Panicked)));
    tokio::time::timeout(Duration::from_secs(5), async {
        while pool.has_room(&robot("wall-e")).is_err() {
            tokio::task::yield_now().await;
        }
    })
    .await
    .unwrap();
    assert_eq!(pool.run(slot(&pool), |_| 7).await, Ok(7));
}

#[tokio::test]
async fn the_slot_is_free_when_the_answer_arrives() {
    let pool = pool(1, 0);
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
    let pool = pool(1, 0);
    let (tell, told) = mpsc::channel();
    let running = pool.run(slot(&pool), move |has_left| {
        while !has_left() {
            thread::yield_now();
        }
        let _ = tell.send(());
    });
    assert!(tokio::time::timeout(Duration::from_millis(20), running).await.is_err());
    told.recv_timeout(Duration::from_secs(5)).unwrap();
}

#[tokio::test]
async fn jobs_of_one_caller_run_in_the_order_given() {
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

/// A list that jobs write their names into.
#[derive(Clone, Default)]
struct Order(Arc<Mutex<Vec<&'static str>>>);

impl Order {
    fn note(&self, name: &'static str) -> impl FnOnce() + Send + use<> {
        let order = self.0.clone();
        move || order.lock().unwrap().push(name)
    }
}

#[tokio::test]
async fn a_shadow_waits_until_no_robot_waits() {
    let (pool, release, task) = busy_pool(4).await;
    let order = Order::default();
    let (a, b, c, d) = (order.note("A"), order.note("B"), order.note("C"), order.note("D"));
    let queues = pool.clone();
    let first = pool.run(slot(&pool), move |_| {
        a();
        queues.queue_shadow(b);
    });
    let second = pool.run(slot(&pool), move |_| c());
    pool.queue(&robot("eve"), d);
    drop(release);
    task.await.unwrap();
    first.await.unwrap();
    second.await.unwrap();
    while pool.load().n_running + pool.load().n_waiting > 0 || order.0.lock().unwrap().len() < 4 {
        tokio::task::yield_now().await;
    }
    assert_eq!(order.0.lock().unwrap().last(), Some(&"B"));
}

#[tokio::test]
async fn callers_take_turns() {
    let (pool, release, task) = busy_pool(8).await;
    let order = Order::default();
    let mut waiting = Vec::new();
    for (caller, name) in [("greedy", "g1"), ("greedy", "g2"), ("greedy", "g3"), ("polite", "p1")] {
        let note = order.note(name);
        waiting.push(pool.run(slot_of(&pool, caller), |_| note()));
    }
    drop(release);
    task.await.unwrap();
    for answer in waiting {
        answer.await.unwrap();
    }
    assert_eq!(*order.0.lock().unwrap(), ["g1", "p1", "g2", "g3"]);
}

#[tokio::test]
async fn a_full_queue_pushes_out_the_youngest_of_whoever_has_most() {
    let (pool, release, task) = busy_pool(3).await;
    let mut greedy: Vec<_> =
        (0..3).map(|job_idx| pool.run(slot_of(&pool, "greedy"), move |_| job_idx)).collect();
    let polite = pool.run(slot_of(&pool, "polite"), |_| 7);
    let Err(Undone::PushedOut(full)) = greedy.pop().unwrap().await else { panic!("it was the youngest") };
    assert_eq!(full.whose, Whose::Caller);
    assert_eq!(pool.load().n_slots_in_use, 4, "what is pushed out has given its slot back");
    assert!(pool.has_room(&robot("greedy")).is_err());
    drop(release);
    task.await.unwrap();
    assert_eq!(polite.await, Ok(7));
    assert_eq!((greedy.remove(0).await, greedy.remove(0).await), (Ok(0), Ok(1)));
}

#[tokio::test]
async fn the_time_to_come_back_follows_the_work_that_waits() {
    let (pool, release, task) = busy_pool(2).await;
    let held = (slot(&pool), slot(&pool));
    let full = pool.has_room(&robot("wall-e")).unwrap_err();
    // Three jobs of ten milliseconds, on one thread, or longer where the first has taken longer.
    assert!((Duration::from_millis(30)..LONGEST_WAIT).contains(&full.retry_after), "{full:?}");
    drop((release, held));
    task.await.unwrap();
}
