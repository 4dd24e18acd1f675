//! Refusals of one caller that repeat themselves are one line of the log a second, with their number: else
//! whoever has no key could fill the disk.

use std::collections::HashMap;
use std::convert::Infallible;
use std::net::IpAddr;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use tokio::time::{MissedTickBehavior, interval};

/// How long a refusal is no news.
const ROUND: Duration = Duration::from_secs(1);
/// The most kinds of refusals that are told apart in one round; those beyond are only counted.
const MAX_KINDS: usize = 1024;

/// What was refused since the last round.
#[derive(Default)]
pub struct Refusals(Mutex<Round>);

#[derive(Debug, Default, PartialEq, Eq)]
struct Round {
    /// How many were not told, by whom was refused and how.
    untold: HashMap<(IpAddr, u16), u64>,
    /// How many beyond.
    beyond: u64,
}

impl Refusals {
    /// Counts a refusal; whether it is the first of its kind in this round, and so told by itself.
    pub fn is_news(&self, address: IpAddr, status: u16) -> bool {
        let mut round = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let n_kinds = round.untold.len();
        match round.untold.get_mut(&(address, status)) {
            Some(n_untold) => *n_untold += 1,
            None if n_kinds < MAX_KINDS => {
                round.untold.insert((address, status), 0);
                return true;
            }
            None => round.beyond += 1,
        }
        false
    }

    /// Tells every second how many were not told.
    pub async fn tell(&self) -> Infallible {
        let mut rounds = interval(ROUND);
        rounds.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            rounds.tick().await;
            let round = self.end_round();
            for ((address, status), n_untold) in round.untold {
                if n_untold > 0 {
                    tracing::info!(%address, status, n_untold, "refused again");
                }
            }
            if round.beyond > 0 {
                tracing::info!(n_untold = round.beyond, "refused others");
            }
        }
    }

    fn end_round(&self) -> Round {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    fn address(number: u32) -> IpAddr {
        Ipv4Addr::from_bits(number).into()
    }

    #[test]
    fn the_first_is_told_and_the_others_are_counted_until_the_round_ends() {
        let refusals = Refusals::default();
        for _ in 0..2 {
            assert!(refusals.is_news(address(1), 401));
            assert!(!refusals.is_news(address(1), 401));
            assert!(!refusals.is_news(address(1), 401));
            assert!(refusals.is_news(address(1), 404));
            assert!(refusals.is_news(address(2), 401));
            let round = refusals.end_round();
            assert_eq!(round.untold[&(address(1), 401)], 2);
            assert_eq!(round.untold.len(), 3);
        }
    }

    #[test]
    fn many_callers_take_no_more_memory_and_no_more_lines() {
        let refusals = Refusals::default();
        let n_told =
            (0..3 * MAX_KINDS as u32).filter(|&number| refusals.is_news(address(number), 401)).count();
        let round = refusals.end_round();
        assert_eq!((n_told, round.untold.len(), round.beyond), (MAX_KINDS, MAX_KINDS, 2 * MAX_KINDS as u64));
    }
}
