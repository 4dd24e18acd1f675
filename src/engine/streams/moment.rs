//! When a frame was taken, by the robot's clock or by ours.

use super::ledger::Accepted;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// How far a robot's clock may be from ours, or leap beyond it from frame to frame, and still mean something.
const MAX_LEAP: Duration = Duration::from_secs(3600);

/// When a frame was taken.
#[derive(Clone, Copy)]
pub struct Moment {
    captured_at_ns: Option<u64>,
    arrived: Instant,
}

/// A moment as another process understands it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SealedMoment {
    captured_at_ns: Option<u64>,
    /// In milliseconds since 1970.
    arrived_ms: u64,
}

/// The time between two frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Elapsed {
    /// By the robot's clock, where both frames have a time that can be, else by ours.
    pub time: Duration,
    /// Both frames have a time, but it stands still, runs backwards, or leaps.
    pub is_doubtful: bool,
}

impl Moment {
    /// When this frame was taken.
    pub fn of(frame: &Accepted) -> Self {
        Self { captured_at_ns: frame.captured_at_ns, arrived: frame.arrived }
    }

    /// For another process.
    pub fn sealed(self) -> SealedMoment {
        let arrived_ms = now_ms().saturating_sub(self.arrived.elapsed().as_millis() as u64);
        SealedMoment { captured_at_ns: self.captured_at_ns, arrived_ms }
    }

    /// Of another process.
    pub fn opened(SealedMoment { captured_at_ns, arrived_ms }: SealedMoment) -> Self {
        let now = Instant::now();
        Self { captured_at_ns, arrived: now.checked_sub(since(arrived_ms)).unwrap_or(now) }
    }

    /// The time since an earlier frame; never negative.
    pub fn since(self, earlier: Self) -> Elapsed {
        let by_us = self.arrived.saturating_duration_since(earlier.arrived);
        let by_robot = self.captured_at_ns.zip(earlier.captured_at_ns).map(|(now, before)| {
            let time = Duration::from_nanos(now.saturating_sub(before));
            (!time.is_zero() && time <= by_us + MAX_LEAP).then_some(time)
        });
        match by_robot {
            Some(Some(time)) => Elapsed { time, is_doubtful: false },
            doubted => Elapsed { time: by_us, is_doubtful: doubted.is_some() },
        }
    }

    /// How long ago, by our clock, in milliseconds; negative where the robot's clock is ahead. None where the
    /// frame has no time, or one of a clock that is not set as ours is.
    pub fn age_ms(self) -> Option<f64> {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos() as f64;
        let age_ms = ((now - self.captured_at_ns? as f64) / 1e3).round() / 1e3;
        (age_ms.abs() <= MAX_LEAP.as_millis() as f64).then_some(age_ms)
    }
}

/// The time since 1970, in milliseconds.
pub fn now_ms() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_millis() as u64
}

/// How long ago that was; none where another's clock is ahead.
pub fn since(at_ms: u64) -> Duration {
    Duration::from_millis(now_ms().saturating_sub(at_ms))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn elapsed(stamps: [Option<u64>; 2]) -> Elapsed {
        let arrived = Instant::now();
        let [earlier, later] = stamps;
        let earlier = Moment { captured_at_ns: earlier, arrived };
        let later = Moment { captured_at_ns: later, arrived: arrived + Duration::from_millis(250) };
        later.since(earlier)
    }

    #[test]
    fn stamps_that_advance_count_and_all_others_give_way_to_arrivals() {
        let millis = Duration::from_millis;
        let now = 1_800_000_000_000 * MS;
        for (stamps, time, is_doubtful) in [
            ([Some(now), Some(now + 200 * MS)], millis(200), false),
            ([Some(0), Some(1)], Duration::from_nanos(1), false),
            ([Some(now), Some(now + 3_600_000 * MS)], millis(3_600_000), false),
            ([Some(now), Some(now + 3_601_000 * MS)], millis(250), true),
            ([Some(0), Some(u64::MAX)], millis(250), true),
            ([Some(0), Some(0)], millis(250), true),
            ([Some(now), Some(now)], millis(250), true),
            ([Some(now), Some(now - 1)], millis(250), true),
            ([None, Some(now)], millis(250), false),
            ([Some(now), None], millis(250), false),
            ([None, None], millis(250), false),
        ] {
            assert_eq!(elapsed(stamps), Elapsed { time, is_doubtful }, "{stamps:?}");
        }
    }

    #[test]
    fn an_age_is_told_where_the_clocks_agree() {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
        let age = |captured_at_ns| Moment { captured_at_ns, arrived: Instant::now() }.age_ms();
        assert!(age(Some(now - 2000 * MS)).is_some_and(|age| age >= 2000.0));
        assert!(age(Some(now + 60_000 * MS)).is_some_and(|age| age < 0.0));
        for other in [None, Some(0), Some(1), Some(now / 1000), Some(now - 4_000_000 * MS), Some(u64::MAX)] {
            assert_eq!(age(other), None, "{other:?}");
        }
    }
}
