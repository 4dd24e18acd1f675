//! The robots as they are now, for pages that show them: what changed, made once for all readers.

use crate::engine::fleet::{Everybody, Fleet};
use crate::engine::robots::{Revision, Robots};
use bytes::Bytes;
use roomsight_protocol::event::{LiveUpdate, RobotState};
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::broadcast::{self, Receiver};
use tokio::sync::watch;
use tokio::time::{MissedTickBehavior, interval};

/// How often readers hear what changed.
pub const INTERVAL: Duration = Duration::from_millis(500);
/// How many updates a reader may be behind before it loses the oldest.
const N_KEPT: usize = 8;

/// Whose robots are told of.
#[derive(Clone, Copy)]
pub struct View<'a> {
    pub robots: &'a Robots,
    /// Those of other services too.
    pub fleet: Option<&'a Fleet>,
}

impl View<'_> {
    /// Everybody that it shows.
    pub fn everybody(&self, now: Instant) -> Everybody {
        match self.fleet {
            Some(fleet) => fleet.everybody(self.robots, now),
            None => Everybody { own: self.robots.all(), others: BTreeMap::new() },
        }
    }
}

/// Where updates are told, and who reads them.
pub struct Live {
    updates: broadcast::Sender<Bytes>,
    /// How many readers there were so far, for the maker, which rests while there are none.
    n_came: watch::Sender<u64>,
}

/// One who reads updates.
pub struct LiveReader {
    updates: Receiver<Bytes>,
    /// The next update is of all robots; so many were lost before it.
    n_lost: Option<u64>,
}

impl Default for Live {
    fn default() -> Self {
        Self { updates: broadcast::Sender::new(N_KEPT), n_came: watch::Sender::default() }
    }
}

impl Live {
    /// A reader of all robots, and then of what changes.
    pub fn subscribe(&self) -> LiveReader {
        let reader = LiveReader { updates: self.updates.subscribe(), n_lost: Some(0) };
        self.n_came.send_modify(|n_came| *n_came += 1);
        reader
    }

    /// How many read.
    pub fn n_readers(&self) -> usize {
        self.updates.receiver_count()
    }

    /// Tells what changes for ever, while anybody reads.
    pub async fn make(&self, view: View<'_>) -> Infallible {
        let mut n_came = self.n_came.subscribe();
        loop {
            // The sender is ours, so that this only waits.
            let _ = n_came.wait_for(|_| self.n_readers() > 0).await;
            let mut told = Told::default();
            let mut ticks = interval(INTERVAL);
            ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
            ticks.tick().await;
            while self.n_readers() > 0 {
                ticks.tick().await;
                if let Some(update) = told.update(view) {
                    let _ = self.updates.send(as_event(&update));
                }
            }
        }
    }
}

impl LiveReader {
    /// The next update as a server-sent event; none when the service ends. One that was too slow hears all robots again.
    pub async fn next(&mut self, view: View<'_>) -> Option<LiveEvent> {
        if let Some(n_lost) = self.n_lost.take() {
            let update = Told::default().update(view).unwrap_or_else(|| update(Vec::new(), Vec::new()));
            let bytes = as_event(&LiveUpdate { lost_events: n_lost, ..update });
            return Some(LiveEvent { bytes, n_lost });
        }
        match self.updates.recv().await {
            Ok(bytes) => Some(LiveEvent { bytes, n_lost: 0 }),
            Err(RecvError::Lagged(n_lost)) => {
                // Those that are still kept are older than what is told now.
                self.updates = self.updates.resubscribe();
                self.n_lost = Some(n_lost);
                Box::pin(self.next(view)).await
            }
            Err(RecvError::Closed) => None,
        }
    }
}

/// An update as it is sent.
pub struct LiveEvent {
    pub bytes: Bytes,
    /// How many were lost before it.
    pub n_lost: u64,
}

/// What readers know of each robot, by its id.
#[derive(Default)]
pub struct Told(BTreeMap<String, Known>);

/// How a robot was when it was told of.
enum Known {
    Own(Revision),
    Other(Arc<RobotState>),
}

impl Told {
    /// What they do not know yet, if there is anything.
    pub fn update(&mut self, view: View<'_>) -> Option<LiveUpdate> {
        let now = Instant::now();
        let Everybody { own, others } = view.everybody(now);
        let mut known = BTreeMap::new();
        let mut changed = Vec::new();
        for record in own {
            // Before the state, so that what changes between is told twice and not never.
            let revision = record.revision(now);
            let state = || view.robots.state(&record);
            let id = record.id();
            if !matches!(self.0.get(&id), Some(Known::Own(told)) if *told == revision) {
                changed.push(state());
            }
            known.insert(id, Known::Own(revision));
        }
        for (id, other) in others {
            if !matches!(self.0.get(&id), Some(Known::Other(told)) if Arc::ptr_eq(told, &other.state)) {
                changed.push((*other.state).clone());
            }
            known.insert(id, Known::Other(other.state));
        }
        let gone: Vec<String> = self.0.keys().filter(|id| !known.contains_key(*id)).cloned().collect();
        self.0 = known;
        (!changed.is_empty() || !gone.is_empty()).then(|| update(changed, gone))
    }
}

fn update(robots: Vec<RobotState>, gone: Vec<String>) -> LiveUpdate {
    let at = humantime::format_rfc3339_millis(SystemTime::now()).to_string();
    LiveUpdate { at, robots, gone, lost_events: 0 }
}

fn as_event(update: &LiveUpdate) -> Bytes {
    // Plain values always have a JSON form, in one line.
    let data = serde_json::to_string(update).unwrap_or_default();
    format!("event: live\ndata: {data}\n\n").into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::events::Events;
    use crate::settings::Settings;
    use roomsight_protocol::fleet::FleetRobots;

    fn told(event: Option<LiveEvent>) -> LiveUpdate {
        let bytes = event.unwrap().bytes;
        let text = std::str::from_utf8(&bytes).unwrap();
        let data = text.strip_prefix("event: live\ndata: ").unwrap().strip_suffix("\n\n").unwrap();
        serde_json::from_str(data).unwrap()
    }

    fn view(robots: &Robots) -> View<'_> {
        View { robots, fleet: None }
    }

    fn ids(update: &LiveUpdate) -> Vec<&str> {
        update.robots.iter().map(|robot| robot.who.id.as_str()).collect()
    }

    #[test]
    fn only_what_changed_is_told_again() {
        let robots = Robots::new(&Settings::default(), Events::default());
        let (one, _other) = (robots.named("one", None), robots.named("other", None));
        let mut told = Told::default();
        assert_eq!(ids(&told.update(view(&robots)).unwrap()), ["one", "other"]);
        assert!(told.update(view(&robots)).is_none());
        one.accepted();
        assert_eq!(ids(&told.update(view(&robots)).unwrap()), ["one"]);
        told.0.insert("gone".to_owned(), Known::Own(one.revision(Instant::now())));
        assert_eq!(told.update(view(&robots)).unwrap().gone, ["gone"]);
    }

    #[tokio::test]
    async fn a_slow_reader_hears_all_robots_again_and_how_much_it_lost() {
        let (robots, live) = (Robots::new(&Settings::default(), Events::default()), Live::default());
        let mut reader = live.subscribe();
        let first = told(reader.next(view(&robots)).await);
        assert!(first.robots.is_empty() && first.gone.is_empty());
        assert_eq!(first.lost_events, 0);
        robots.named("one", None);
        for _ in 0..N_KEPT + 3 {
            live.updates.send(Bytes::from_static(b"older")).unwrap();
        }
        let made_up = told(reader.next(view(&robots)).await);
        assert_eq!((ids(&made_up), made_up.lost_events), (vec!["one"], 3));
        live.updates.send(Bytes::from_static(b"newer")).unwrap();
        assert_eq!(reader.next(view(&robots)).await.unwrap().bytes, "newer");
    }

    #[tokio::test]
    async fn nothing_is_made_while_nobody_reads() {
        let (robots, live) = (Robots::new(&Settings::default(), Events::default()), Live::default());
        let record = robots.named("one", None);
        let reading = async {
            let mut reader = live.subscribe();
            reader.next(view(&robots)).await;
            record.accepted();
            let update = told(reader.next(view(&robots)).await);
            assert_eq!(update.robots[0].frames.accepted, 1);
        };
        tokio::select! {
            never = live.make(view(&robots)) => match never {},
            () = reading => {}
        }
        assert_eq!(live.n_readers(), 0);
    }

    #[test]
    fn robots_of_other_services_are_told_of_as_they_change() {
        let (robots, fleet) = (Robots::new(&Settings::default(), Events::default()), Fleet::default());
        robots.named("here", None);
        let there = robots.state(&Robots::new(&Settings::default(), Events::default()).named("there", None));
        let hear = |stops| {
            let robots = if stops { vec![] } else { vec![there.clone()] };
            fleet.hear("other", FleetRobots { robots, gone: vec![], stops }, Instant::now());
        };
        let view = View { robots: &robots, fleet: Some(&fleet) };
        let mut told = Told::default();
        hear(false);
        let update = told.update(view).unwrap();
        assert_eq!(ids(&update), ["here", "there"]);
        assert_eq!(update.robots[1].service.as_deref(), Some("other"));
        assert!(told.update(view).is_none());
        hear(false);
        assert_eq!(ids(&told.update(view).unwrap()), ["there"]);
        hear(true);
        assert_eq!(told.update(view).unwrap().gone, ["there"]);
        assert_eq!(ids(&Told::default().update(View { fleet: None, ..view }).unwrap()), ["here"]);
    }
}
