//! Who may have a stream: the places for streams, and who gives way when they are short.

use super::Arrival;
use crate::access::Key;
use crate::engine::caller::CallerId;
use crate::engine::robots::RobotRecord;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::mpsc;
use tokio_util::sync::CancellationToken;

/// The places for streams.
pub struct Permits {
    taken: Mutex<BTreeMap<String, Permit>>,
    max_streams: usize,
    max_of_one: usize,
}

/// What is known of one stream outside its task.
pub struct Permit {
    /// How to reach its task. In boxes, since a channel keeps room for 32.
    pub arrivals: mpsc::Sender<Box<Arrival>>,
    /// Whose it is.
    pub holder: CallerId,
    /// What dashboards may know, and the key that opened it, which alone can resume it.
    pub record: Arc<RobotRecord>,
    /// Cancelled when the stream gives way to another.
    pub given_up: CancellationToken,
}

/// Why there is no place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoPermit {
    /// All are taken.
    Full,
    /// This caller has as many as one may have.
    Share,
}

impl Permits {
    /// For so many streams, so many of which may be of one holder.
    pub fn new(max_streams: usize, max_of_one: usize) -> Self {
        Self { taken: Mutex::default(), max_streams, max_of_one }
    }

    /// Takes a place for a stream. Where places are short, the stream whose connection broke first gives way: one
    /// of the same holder where that one has too many, else anyone's.
    ///
    /// # Errors
    /// No place is free, and none gives way.
    pub fn take(&self, session: String, permit: Permit) -> Result<(), NoPermit> {
        let mut taken = self.taken();
        let is_own = |other: &Permit| other.holder == permit.holder;
        let n_own = taken.values().filter(|other| is_own(other)).count();
        if n_own >= self.max_of_one {
            // Whose share is all of them need not hear of shares.
            let has_all = self.max_of_one >= self.max_streams;
            let why = if has_all { NoPermit::Full } else { NoPermit::Share };
            give_up_first(&mut taken, is_own).ok_or(why)?;
        } else if taken.len() >= self.max_streams {
            give_up_first(&mut taken, |_| true).ok_or(NoPermit::Full)?;
        }
        taken.insert(session, permit);
        Ok(())
    }

    /// The stream has ended.
    pub fn leave(&self, session: &str) {
        self.taken().remove(session);
    }

    /// How to reach the stream that was opened with the same key; without keys who knows the session may resume it.
    pub fn arrivals(&self, session: &str, key: Option<&Key>) -> Option<mpsc::Sender<Box<Arrival>>> {
        let taken = self.taken();
        let permit = taken.get(session).filter(|permit| permit.record.key() == key)?;
        Some(permit.arrivals.clone())
    }

    /// What dashboards may know, the stream that began first first.
    pub fn records(&self) -> Vec<Arc<RobotRecord>> {
        let mut records: Vec<_> = self.taken().values().map(|permit| permit.record.clone()).collect();
        records.sort_by_key(|record| record.began());
        records
    }

    fn taken(&self) -> MutexGuard<'_, BTreeMap<String, Permit>> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Gives up the stream whose connection broke first, of those that may be given up.
fn give_up_first(taken: &mut BTreeMap<String, Permit>, may_be: impl Fn(&Permit) -> bool) -> Option<()> {
    let broken = taken.iter().filter(|(_, permit)| may_be(permit));
    let broken = broken.filter_map(|(session, permit)| Some((permit.record.broke()?, session)));
    let (_, first) = broken.min()?;
    let first = first.clone();
    taken.remove(&first)?.given_up.cancel();
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::Role;

    fn permit(holder: &str) -> Permit {
        Permit {
            arrivals: mpsc::channel(1).0,
            holder: CallerId::Robot(holder.into()),
            record: Arc::new(RobotRecord::of_stream("public".into(), None)),
            given_up: CancellationToken::new(),
        }
    }

    /// Takes a place whose connection stands.
    fn take(
        permits: &Permits,
        session: &str,
        holder: &str,
    ) -> Result<(Arc<RobotRecord>, CancellationToken), NoPermit> {
        let permit = permit(holder);
        let taken = (permit.record.clone(), permit.given_up.clone());
        taken.0.connected(true);
        permits.take(session.into(), permit).map(|()| taken)
    }

    #[test]
    fn the_stream_that_broke_first_gives_way_and_one_that_stands_never_does() {
        let permits = Permits::new(3, 3);
        let streams = ["a", "b", "c"].map(|name| take(&permits, name, name).unwrap());
        assert_eq!(take(&permits, "d", "d").err(), Some(NoPermit::Full));
        streams[1].0.connected(false);
        streams[0].0.connected(false);
        take(&permits, "d", "d").unwrap();
        assert_eq!(streams.each_ref().map(|(_, given_up)| given_up.is_cancelled()), [false, true, false]);
        streams[0].0.connected(true);
        assert_eq!(take(&permits, "e", "e").err(), Some(NoPermit::Full), "the other has come back");
        permits.leave("c");
        take(&permits, "e", "e").unwrap();
    }

    #[test]
    fn one_holder_has_a_share_and_its_own_streams_give_way_to_it() {
        let permits = Permits::new(4, 2);
        let (first, given_up) = take(&permits, "1", "eve").unwrap();
        take(&permits, "2", "eve").unwrap();
        let (other, _) = take(&permits, "3", "wall-e").unwrap();
        other.connected(false);
        assert_eq!(take(&permits, "4", "eve").err(), Some(NoPermit::Share));
        first.connected(false);
        take(&permits, "4", "eve").unwrap();
        assert!(given_up.is_cancelled());
        assert_eq!(permits.records().len(), 3);
    }

    #[test]
    fn who_may_have_all_places_hears_that_they_are_taken() {
        for n_permits in 0..2 {
            let permits = Permits::new(n_permits, n_permits);
            (0..n_permits).for_each(|_| drop(take(&permits, "1", "eve").unwrap()));
            assert_eq!(take(&permits, "2", "eve").err(), Some(NoPermit::Full));
        }
    }

    #[test]
    fn a_stream_is_resumed_with_what_opened_it() {
        let permits = Permits::new(4, 4);
        let key = |role, secret: u8| Arc::new(Key::new(role, "boss", &[secret; 32]).unwrap().1);
        let boss = key(Role::Admin, 1);
        let record = Arc::new(RobotRecord::of_stream("public".into(), Some(boss.clone())));
        permits.take("secret".into(), Permit { record, ..permit("boss") }).unwrap();
        assert!(permits.arrivals("secret", Some(&boss)).is_some());
        for other in [Some(key(Role::Admin, 2)), Some(key(Role::Robot, 1)), None] {
            assert!(permits.arrivals("secret", other.as_deref()).is_none());
        }
        assert!(permits.arrivals("guessed", Some(&boss)).is_none());
    }
}
