use super::*;
use proptest::prelude::*;

const BOUNDS: Bounds = Bounds { n_slots: 1000, n_slots_a_caller: 1000 };

fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

fn robot(name: &str) -> CallerId {
    CallerId::Robot(name.into())
}

/// Threads that take from a queue, on a clock of their own. A job is what it costs.
struct Simulation {
    queue: FairQueue<Duration>,
    clock: Duration,
    threads: Vec<Option<Busy>>,
    done: HashMap<CallerId, Duration>,
}

struct Busy {
    until: Duration,
    cost: Duration,
    charge: Charge,
}

impl Simulation {
    fn new(n_threads: usize, bounds: Bounds) -> Self {
        let threads = (0..n_threads).map(|_| None).collect();
        Self { queue: FairQueue::new(bounds), clock: Duration::ZERO, threads, done: HashMap::new() }
    }

    fn push(&mut self, caller: &CallerId, cost: Duration) {
        assert!(self.queue.admit(caller, 1).unwrap().is_empty());
        self.queue.push(caller, cost);
        self.start();
    }

    /// Lets idle threads take what waits.
    fn start(&mut self) {
        for thread in self.threads.iter_mut().filter(|thread| thread.is_none()) {
            let Some(Taken { job: cost, charge }) = self.queue.take(self.clock) else { return };
            *thread = Some(Busy { until: self.clock + cost, cost, charge });
        }
    }

    /// Goes on to the end of the job that ends first; returns whose it was.
    fn step(&mut self) -> Option<CallerId> {
        let ends = |thread: &&mut Option<Busy>| thread.as_ref().map(|busy| busy.until);
        let first = self.threads.iter_mut().filter(|thread| thread.is_some()).min_by_key(ends)?;
        let Busy { until, cost, charge } = first.take()?;
        self.clock = until;
        let caller = charge.caller.clone();
        self.queue.release(&caller);
        self.queue.finish(charge, Some(cost));
        *self.done.entry(caller.clone()).or_default() += cost;
        self.start();
        Some(caller)
    }

    fn done(&self, caller: &CallerId) -> Duration {
        self.done.get(caller).copied().unwrap_or_default()
    }

    /// Goes on until a job of this caller ends; returns how many others ended before.
    fn until_done(&mut self, caller: &CallerId) -> usize {
        let mut n_before = 0;
        while self.step().expect("it is in the queue") != *caller {
            n_before += 1;
        }
        n_before
    }
}

fn filled(bounds: Bounds, jobs: &[(&str, usize)]) -> FairQueue<usize> {
    let mut queue = FairQueue::new(bounds);
    for (name, n_jobs) in jobs {
        for job in 0..*n_jobs {
            queue.admit(&robot(name), 1).unwrap();
            queue.push(&robot(name), job);
        }
    }
    queue
}

/// The callers of the jobs in the order in which one thread takes them, where all cost the same.
fn order(mut queue: FairQueue<usize>) -> String {
    let mut names = String::new();
    while let Some(Taken { charge, .. }) = queue.take(Duration::ZERO) {
        let CallerId::Robot(name) = &charge.caller else { panic!("a robot") };
        names.push_str(name);
        queue.finish(charge, Some(FIRST_GUESS));
    }
    names
}

#[test]
fn callers_take_turns_and_each_ones_jobs_stay_in_order() {
    assert_eq!(order(filled(BOUNDS, &[("a", 3), ("b", 1), ("c", 2)])), "abcaca");
    let mut queue = filled(BOUNDS, &[("a", 3)]);
    for expected in 0..3 {
        assert_eq!(queue.take(Duration::ZERO).unwrap().job, expected);
    }
    assert!(queue.take(Duration::ZERO).is_none());
}

#[test]
fn a_caller_has_its_share_of_the_queue_and_no_more() {
    let bounds = Bounds { n_slots: 8, n_slots_a_caller: 4 };
    let mut queue = filled(bounds, &[("a", 3)]);
    assert_eq!(queue.admit(&robot("a"), 2), Err(Refusal::Share), "all or nothing");
    assert_eq!(queue.admit(&robot("a"), 1), Ok(vec![]));
    assert_eq!(queue.has_room(&robot("a"), 1), Err(Refusal::Share));
    assert_eq!(queue.has_room(&robot("b"), 4), Ok(()));
    queue.release(&robot("a"));
    assert_eq!(queue.has_room(&robot("a"), 1), Ok(()));
}

#[test]
fn a_full_queue_gives_places_of_those_who_have_more_to_those_who_have_less() {
    let bounds = Bounds { n_slots: 8, n_slots_a_caller: 6 };
    let mut queue = filled(bounds, &[("a", 5), ("b", 3)]);
    assert_eq!(queue.admit(&robot("c"), 1), Ok(vec![4]), "the youngest of whoever has most");
    queue.push(&robot("c"), 0);
    queue.release(&robot("a"));
    assert_eq!(queue.admit(&robot("c"), 1), Ok(vec![3]));
    queue.push(&robot("c"), 1);
    queue.release(&robot("a"));
    assert_eq!(queue.admit(&robot("c"), 2), Err(Refusal::Full), "nobody has more than four");
    assert_eq!(queue.n_slots_in_use(), 8);
    assert_eq!(order(queue), "abcabcab", "a refusal pushes nobody out");
}

#[test]
fn a_turn_counts_but_cannot_be_pushed_out() {
    let bounds = Bounds { n_slots: 4, n_slots_a_caller: 4 };
    let mut queue = FairQueue::new(bounds);
    for stream in ["a", "b", "c", "d", "d"] {
        queue.push_turn(&robot(stream), 0);
    }
    assert_eq!(queue.has_room(&robot("e"), 1), Ok(()), "two turns are more than one frame");
    assert_eq!(queue.has_room(&robot("e"), 2), Err(Refusal::Full));
    assert_eq!(queue.take(Duration::ZERO).map(|taken| queue.finish(taken.charge, None)), Some(()));
    assert_eq!(queue.has_room(&robot("d"), 3), Err(Refusal::Full));
    let mut one_each = FairQueue::new(bounds);
    for stream in ["a", "b", "c", "d"] {
        one_each.push_turn(&robot(stream), 0);
    }
    assert_eq!(one_each.has_room(&robot("e"), 1), Ok(()), "a frame is as good as a turn");
    assert_eq!(one_each.has_room(&robot("e"), 2), Err(Refusal::Full), "all have less than it would have");
    for caller in ["e", "f", "g", "h"] {
        assert_eq!(one_each.admit(&robot(caller), 1), Ok(Vec::new()));
    }
    assert_eq!(one_each.has_room(&robot("i"), 1), Err(Refusal::Full), "no slot is left");
}

#[test]
fn turns_do_not_let_frames_take_more_places_than_there_are() {
    let bounds = Bounds { n_slots: 4, n_slots_a_caller: 4 };
    let mut queue = filled(bounds, &[("a", 3), ("b", 1)]);
    (0..9).for_each(|turn| queue.push_turn(&robot("fleet"), turn));
    assert_eq!(queue.admit(&robot("c"), 1), Ok(vec![2]));
    queue.release(&robot("a"));
    assert_eq!(queue.n_slots_in_use(), 4);
}

#[test]
fn the_work_ahead_is_what_waits_times_what_it_costs() {
    let mut queue = filled(BOUNDS, &[("a", 6)]);
    for _ in 0..100 {
        let Some(Taken { charge, .. }) = queue.take(Duration::ZERO) else { break };
        queue.finish(charge, Some(ms(600)));
        queue.push(&robot("a"), 0);
    }
    let work = queue.work_ahead(&robot("a"), Refusal::Share, Duration::ZERO);
    assert!((ms(3500)..=ms(3600)).contains(&work), "{work:?}");
    assert_eq!(queue.work_ahead(&robot("b"), Refusal::Full, Duration::ZERO), work);
}

#[test]
fn a_job_in_work_tells_what_those_that_wait_may_cost() {
    let mut queue = filled(BOUNDS, &[("a", 5)]);
    let Taken { charge, .. } = queue.take(ms(1000)).unwrap();
    assert_eq!(queue.work_ahead(&robot("a"), Refusal::Share, ms(1600)), 5 * ms(600));
    assert_eq!(queue.take(ms(1600)).unwrap().charge.amount, ms(600));
    queue.finish(charge, Some(ms(700)));
}

#[test]
fn a_caller_with_little_to_do_waits_for_the_frame_in_work_and_no_longer() {
    for n_greedy in [8, 64, 400] {
        let (greedy, polite) = (robot("greedy"), robot("polite"));
        let mut simulation = Simulation::new(1, BOUNDS);
        (0..n_greedy).for_each(|_| simulation.push(&greedy, ms(600)));
        for _ in 0..50 {
            simulation.push(&polite, ms(5));
            assert!(simulation.until_done(&polite) <= 1);
            for _ in 0..3 {
                simulation.push(&greedy, ms(600));
                simulation.step();
            }
        }
    }
}

#[test]
fn nobody_saves_up_turns() {
    let (idle, busy) = (robot("idle"), robot("busy"));
    let mut simulation = Simulation::new(1, BOUNDS);
    simulation.push(&idle, ms(5));
    (0..300).for_each(|_| simulation.push(&busy, ms(5)));
    (0..200).for_each(|_| drop(simulation.step()));
    let before = (simulation.done(&idle), simulation.done(&busy));
    (0..50).for_each(|_| simulation.push(&idle, ms(5)));
    (0..40).for_each(|_| drop(simulation.step()));
    let (idle, busy) = (simulation.done(&idle) - before.0, simulation.done(&busy) - before.1);
    assert!(idle.abs_diff(busy) <= ms(10), "{idle:?} {busy:?}");
}

#[test]
fn ever_new_names_do_not_starve_who_waits() {
    let honest = robot("honest");
    let mut simulation = Simulation::new(1, BOUNDS);
    let mut n_named = 0;
    let mut come = |simulation: &mut Simulation| {
        n_named += 1;
        simulation.push(&robot(&n_named.to_string()), ms(5));
    };
    (0..20).for_each(|_| come(&mut simulation));
    for _ in 0..20 {
        simulation.push(&honest, ms(5));
        let mut n_before = 0;
        while simulation.step() != Some(honest.clone()) {
            come(&mut simulation);
            n_before += 1;
            assert!(n_before < 200, "it is never its turn");
        }
        come(&mut simulation);
    }
    let n_accounts = simulation.queue.accounts.len();
    assert!(n_accounts <= MIN_ACCOUNTS && n_named > MIN_ACCOUNTS, "{n_accounts} accounts of {n_named}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Of callers who always want more, each gets the same work, whatever its frames cost.
    #[test]
    fn work_is_shared_and_not_frames(
        n_threads in 1_usize..4,
        costs in prop::collection::vec(prop::collection::vec(1_u64..300, 1..6), 2..6),
    ) {
        let mut simulation = Simulation::new(n_threads, BOUNDS);
        let callers: Vec<_> = (0..costs.len()).map(|idx| robot(&idx.to_string())).collect();
        let mut n_pushed = vec![0; callers.len()];
        let mut push = |simulation: &mut Simulation, idx: usize| {
            let costs = &costs[idx];
            simulation.push(&callers[idx], ms(costs[n_pushed[idx] % costs.len()]));
            n_pushed[idx] += 1;
        };
        for idx in 0..callers.len() {
            // One more than there are threads, so that one waits always.
            (0..=n_threads).for_each(|_| push(&mut simulation, idx));
        }
        for _ in 0..600 {
            let caller = simulation.step().unwrap();
            push(&mut simulation, callers.iter().position(|other| *other == caller).unwrap());
        }
        let done = callers.iter().map(|caller| simulation.done(caller));
        let (least, most) = (done.clone().min().unwrap(), done.max().unwrap());
        // Apart by what is in work, and by what it was thought to cost.
        let slack = ms(300) * (2 * n_threads as u32 + 2);
        prop_assert!(most - least <= slack, "{least:?} {most:?}");
    }

    /// Whatever comes and goes, what is counted is what is there.
    #[test]
    fn the_books_are_right(steps in prop::collection::vec((0_u8..4, 0_usize..5, 1_usize..4), 0..200)) {
        let bounds = Bounds { n_slots: 8, n_slots_a_caller: 5 };
        let mut queue = FairQueue::new(bounds);
        let (mut waiting, mut running) = (Vec::new(), Vec::<Taken<(CallerId, bool)>>::new());
        let mut n_turns = 0;
        for (action, caller, n_jobs) in steps {
            let caller = robot(&caller.to_string());
            match action {
                0 => if let Ok(pushed_out) = queue.admit(&caller, n_jobs) {
                    (0..n_jobs).for_each(|_| queue.push(&caller, (caller.clone(), false)));
                    waiting.extend((0..n_jobs).map(|_| caller.clone()));
                    for (victim, is_turn) in pushed_out {
                        prop_assert!(!is_turn && victim != caller);
                        waiting.remove(waiting.iter().position(|other| *other == victim).unwrap());
                        queue.release(&victim);
                    }
                }
                1 => {
                    queue.push_turn(&caller, (caller.clone(), true));
                    n_turns += 1;
                }
                2 => running.extend(queue.take(Duration::ZERO)),
                _ => if let Some(Taken { job: (caller, is_turn), charge }) = running.pop() {
                    if is_turn {
                        n_turns -= 1;
                    } else {
                        waiting.remove(waiting.iter().position(|other| *other == caller).unwrap());
                        queue.release(&caller);
                    }
                    queue.finish(charge, (n_jobs > 1).then_some(ms(n_jobs as u64)));
                }
            }
            prop_assert_eq!(queue.n_slots_in_use(), waiting.len());
            prop_assert_eq!(queue.n_turns, n_turns);
            prop_assert_eq!(queue.n_waiting() + running.len(), waiting.len() + n_turns);
            prop_assert!(waiting.len() <= bounds.n_slots);
        }
    }
}
