//! How many frames come a second, over the last ones.

use std::time::Instant;

/// Over about so many seconds.
const SECONDS: f64 = 4.0;

/// A count of which each event fades with time, so that nothing but two numbers is kept.
#[derive(Default)]
pub struct Rate {
    /// Since when events are counted, and when the last one came.
    times: Option<[Instant; 2]>,
    /// The events up to the last one, faded.
    n_events: f64,
}

impl Rate {
    /// Something came.
    pub fn count(&mut self, now: Instant) {
        self.n_events = self.faded(now) + 1.0;
        let began = self.times.map_or(now, |[began, _]| began);
        self.times = Some([began, now]);
    }

    /// How much comes a second, as seen now.
    pub fn per_second(&self, now: Instant) -> f64 {
        let Some([began, _]) = self.times else { return 0.0 };
        // At first there was no time yet for events to fade in; one alone says nothing.
        let share = 1.0 - (-seconds(began, now) / SECONDS).exp();
        if share < 0.05 { 0.0 } else { self.faded(now) / (SECONDS * share) }
    }

    fn faded(&self, now: Instant) -> f64 {
        self.times.map_or(0.0, |[_, last]| self.n_events * (-seconds(last, now) / SECONDS).exp())
    }
}

fn seconds(from: Instant, to: Instant) -> f64 {
    to.saturating_duration_since(from).as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_rate_is_told_soon_and_fades() {
        let (began, mut rate) = (Instant::now(), Rate::default());
        let at = |ms| began + Duration::from_millis(ms);
        assert_eq!(rate.per_second(began), 0.0);
        for idx in 0..=10 {
            rate.count(at(idx * 200));
        }
        let after_two_seconds = rate.per_second(at(2000));
        assert!((4.5..7.0).contains(&after_two_seconds), "{after_two_seconds}");
        for idx in 11..=100 {
            rate.count(at(idx * 200));
        }
        let steady = rate.per_second(at(20_000));
        assert!((4.8..5.3).contains(&steady), "{steady}");
        assert!(rate.per_second(at(60_000)) < 0.01);
    }
}
