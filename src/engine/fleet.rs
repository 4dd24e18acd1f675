//! What other services tell of their robots. It is lossy: a robot of which nothing was heard for long is forgotten.

use crate::engine::events::Events;
use crate::engine::robots::{RobotRecord, Robots};
use roomsight_protocol::event::RobotState;
use roomsight_protocol::fleet::FleetRobots;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How often a service tells of each of its robots at least.
pub const TOLD_AGAIN: Duration = Duration::from_secs(10);
/// For how long a robot is believed in of which nothing more is heard: three times may be lost.
const BELIEVED: Duration = Duration::from_secs(35);
/// The most robots of others that are kept.
const MAX_OTHERS: usize = 200_000;

/// The robots of other services, and what happens at any of them.
#[derive(Default)]
pub struct Fleet {
    /// By service and id.
    others: Mutex<BTreeMap<(String, String), Other>>,
    /// Of all services, this one included, where there are others.
    pub events: Events,
}

/// A robot of another service.
#[derive(Clone)]
pub struct Other {
    pub state: Arc<RobotState>,
    heard: Instant,
}

/// The robots of a fleet by id: each where it is connected, or was last.
#[derive(Default)]
pub struct Everybody {
    /// Those of this service.
    pub own: Vec<Arc<RobotRecord>>,
    /// Those of others.
    pub others: BTreeMap<String, Other>,
}

impl Fleet {
    /// Takes what a service tells.
    pub fn hear(&self, service: &str, told: FleetRobots, now: Instant) {
        let mut others = self.others.lock().unwrap_or_else(PoisonError::into_inner);
        if told.stops {
            others.retain(|(of, _), _| of != service);
        }
        for id in told.gone {
            others.remove(&(service.to_owned(), id));
        }
        for mut state in told.robots {
            let key = (service.to_owned(), state.who.id.clone());
            if others.len() >= MAX_OTHERS && !others.contains_key(&key) {
                continue;
            }
            // Its picture is kept there alone.
            (state.frame, state.service) = (None, Some(service.to_owned()));
            others.insert(key, Other { state: Arc::new(state), heard: now });
        }
    }

    /// Everybody there is, with the robots of this service.
    pub fn everybody(&self, robots: &Robots, now: Instant) -> Everybody {
        let mut others: BTreeMap<String, Other> = BTreeMap::new();
        {
            let mut all = self.others.lock().unwrap_or_else(PoisonError::into_inner);
            all.retain(|_, other| now.saturating_duration_since(other.heard) <= BELIEVED);
            for ((_, id), other) in &*all {
                if others.get(id).is_none_or(|known| other.place(now) < known.place(now)) {
                    others.insert(id.clone(), other.clone());
                }
            }
        }
        let mut own = robots.all();
        let mut kept = BTreeSet::new();
        own.retain(|record| {
            let id = record.id();
            let last_seen = now.saturating_duration_since(record.last_seen()).as_secs_f64();
            let place = Place::new(record.is_connected(), last_seen);
            let is_here = others.get(&id).is_none_or(|other| place <= other.place(now));
            if is_here {
                kept.insert(id);
            }
            is_here
        });
        others.retain(|id, _| !kept.contains(id));
        Everybody { own, others }
    }
}

/// How likely a robot is at a service: the least is the likeliest.
#[derive(PartialEq, PartialOrd)]
struct Place {
    is_away: bool,
    last_seen_s: f64,
}

impl Place {
    fn new(is_connected: bool, last_seen_s: f64) -> Self {
        Self { is_away: !is_connected, last_seen_s }
    }
}

impl Other {
    fn place(&self, now: Instant) -> Place {
        let since = now.saturating_duration_since(self.heard).as_secs_f64();
        Place::new(self.state.connected, self.state.last_seen_s + since)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;

    fn state(id: &str, connected: bool, last_seen_s: f64) -> RobotState {
        let robots = robots();
        let state = robots.state(&robots.named(id, None));
        RobotState { connected, last_seen_s, frame: Some(3), ..state }
    }

    fn robots() -> Robots {
        Robots::new(&Settings::default(), Events::default())
    }

    fn told(robots: Vec<RobotState>) -> FleetRobots {
        FleetRobots { robots, gone: Vec::new(), stops: false }
    }

    /// `id@service` of the robots of others.
    fn others(everybody: &Everybody) -> Vec<String> {
        let told =
            |other: &Other| format!("{}@{}", other.state.who.id, other.state.service.as_deref().unwrap());
        everybody.others.values().map(told).collect()
    }

    #[test]
    fn a_robot_is_where_it_is_connected_or_was_last() {
        let (fleet, robots, now) = (Fleet::default(), robots(), Instant::now());
        fleet.hear("a", told(vec![state("eve", false, 5.0), state("walle", true, 0.0)]), now);
        fleet.hear("b", told(vec![state("eve", true, 9.0), state("walle", false, 0.0)]), now);
        let everybody = fleet.everybody(&robots, now);
        assert_eq!(others(&everybody), ["eve@b", "walle@a"]);
        assert_eq!(everybody.others["eve"].state.frame, None, "its picture is not here");
        // Here it is connected too, and was seen later.
        robots.named("eve", None).accepted();
        let everybody = fleet.everybody(&robots, now);
        assert_eq!((others(&everybody), everybody.own.len()), (vec!["walle@a".to_owned()], 1));
    }

    #[test]
    fn those_of_whom_nothing_is_heard_are_forgotten() {
        let (fleet, robots, now) = (Fleet::default(), robots(), Instant::now());
        fleet.hear(
            "a",
            told(vec![state("eve", true, 0.0), state("mo", true, 0.0), state("auto", true, 0.0)]),
            now,
        );
        fleet.hear("a", FleetRobots { gone: vec!["mo".into()], ..told(vec![]) }, now);
        assert_eq!(others(&fleet.everybody(&robots, now)), ["auto@a", "eve@a"]);
        let later = now + BELIEVED;
        fleet.hear("a", told(vec![state("eve", true, 0.0)]), later);
        assert_eq!(others(&fleet.everybody(&robots, later + Duration::from_secs(1))), ["eve@a"]);
        fleet.hear("a", FleetRobots { stops: true, ..told(vec![]) }, later);
        assert!(fleet.everybody(&robots, later).others.is_empty());
    }

    #[test]
    fn memory_is_bounded() {
        let (fleet, now) = (Fleet::default(), Instant::now());
        let state = state("eve", true, 0.0);
        let numbered = |number: usize| {
            let mut state = state.clone();
            state.who.id = number.to_string();
            state
        };
        fleet.hear("a", told((0..MAX_OTHERS + 5).map(numbered).collect()), now);
        assert_eq!(fleet.everybody(&robots(), now).others.len(), MAX_OTHERS);
    }
}
