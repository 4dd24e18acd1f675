//! What became of the frames of all robots.

use hdrhistogram::{CreationError, Histogram};
use roomsight_lab::evaluate::Rate;
use roomsight_protocol::rest::Answer;
use roomsight_protocol::stream::{DropReason, Filtered};
use serde::Serialize;
use std::collections::BTreeMap;
use std::time::Duration;

/// A frame that leaves later than this after its time is a late one.
const LATE: Duration = Duration::from_millis(10);
/// An hour, in microseconds: what takes longer counts as this.
const LONGEST_US: u64 = 3_600_000_000;
/// The most points of a course over time; where there would be more, two become one.
const MAX_WINDOWS: usize = 400;
/// Digits of the latencies of one of them.
const WINDOW_DIGITS: u8 = 2;
/// The most changes of room that are kept.
const MAX_STAYS: usize = 5_000;

/// Counts and distributions, as they grow.
pub struct Tally {
    /// Frames sent.
    pub n_sent: u64,
    /// Of these, sent late.
    pub n_late: u64,
    /// How late the latest one was.
    pub most_late: Duration,
    /// Frames answered with a room.
    pub n_results: u64,
    /// Frames answered with an error, or whose call failed.
    pub n_failed: u64,
    /// Frames that were not looked at.
    pub dropped: BTreeMap<DropReason, u64>,
    /// What went wrong, frames and connections, by kind.
    pub errors: BTreeMap<String, u64>,
    /// From when a frame was due to its room, in microseconds.
    pub latency: Histogram<u64>,
    /// From capture to answer as the service tells it, in microseconds.
    pub age: Histogram<u64>,
    /// How often the frame's own answer was right.
    pub raw: Score,
    /// How often the filter's was; without frames where there is no filter.
    pub filtered: Score,
    /// The same over time.
    pub course: Course,
    /// The rooms of the first robot over time.
    pub stays: Stays,
}

/// A room told for a frame, and what is known of the frame.
pub struct Told<'a> {
    /// When the frame was due, counted from the start.
    pub at: Duration,
    /// From then to the answer.
    pub latency: Duration,
    /// The room that it shows, where that is known.
    pub room: Option<&'a str>,
    /// What it says by itself.
    pub answer: &'a Answer,
    /// What the stream says.
    pub filtered: Option<&'a Filtered>,
    /// From capture to answer, in milliseconds, as the service tells it.
    pub age_ms: Option<f64>,
}

impl Tally {
    /// Nothing yet.
    pub fn new() -> Result<Self, CreationError> {
        Ok(Self {
            n_sent: 0,
            n_late: 0,
            most_late: Duration::ZERO,
            n_results: 0,
            n_failed: 0,
            dropped: BTreeMap::new(),
            errors: BTreeMap::new(),
            latency: Histogram::new_with_max(LONGEST_US, 3)?,
            age: Histogram::new_with_max(LONGEST_US, 3)?,
            raw: Score::default(),
            filtered: Score::default(),
            course: Course::default(),
            stays: Stays::default(),
        })
    }

    /// A frame leaves, so long after its time.
    pub fn sent(&mut self, lateness: Duration) {
        self.n_sent += 1;
        self.n_late += u64::from(lateness > LATE);
        self.most_late = self.most_late.max(lateness);
    }

    /// A frame has got its room.
    pub fn told(&mut self, told: &Told) {
        self.n_results += 1;
        self.latency.saturating_record(told.latency.as_micros() as u64);
        if let Some(age_ms) = told.age_ms {
            // Clocks that differ may make a frame younger than it can be.
            self.age.saturating_record((age_ms.max(0.0) * 1000.0) as u64);
        }
        let raw = told.room.map(|room| told.answer.room == room);
        if let Some(raw) = raw {
            self.raw.add(raw);
        }
        let filtered = told.filtered.zip(told.room).map(|(filtered, room)| filtered.room == room);
        if let Some(filtered) = filtered {
            self.filtered.add(filtered);
        }
        self.course.add(told.at, told.latency, raw, filtered);
    }

    /// A frame was not looked at.
    pub fn lose(&mut self, reason: DropReason) {
        *self.dropped.entry(reason).or_default() += 1;
    }

    /// A frame was answered with an error.
    pub fn fail(&mut self, kind: String) {
        self.n_failed += 1;
        self.err(kind);
    }

    /// Something went wrong that is no frame's answer.
    pub fn err(&mut self, kind: String) {
        *self.errors.entry(kind).or_default() += 1;
    }

    /// Frames that were not looked at.
    pub fn n_dropped(&self) -> u64 {
        self.dropped.values().sum()
    }

    /// Frames that have had no answer of any kind.
    pub fn n_unaccounted(&self) -> u64 {
        self.n_sent.saturating_sub(self.n_results + self.n_failed + self.n_dropped())
    }
}

/// Right answers among answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Score {
    n_correct: usize,
    n_frames: usize,
}

impl Score {
    pub fn add(&mut self, is_correct: bool) {
        self.n_correct += usize::from(is_correct);
        self.n_frames += 1;
    }

    fn merge(self, other: Self) -> Self {
        Self { n_correct: self.n_correct + other.n_correct, n_frames: self.n_frames + other.n_frames }
    }

    /// As a rate; none without frames.
    pub fn rate(self) -> Option<Rate> {
        (self.n_frames > 0).then(|| Rate::new(self.n_correct, self.n_frames))
    }
}

/// Scores and latencies over time, in windows of equal width that grow with the time.
pub struct Course {
    /// How wide each is, in seconds.
    pub width_s: f64,
    /// By when frames were due.
    pub windows: Vec<Window>,
}

/// The frames of some time that got a room.
#[derive(Default)]
pub struct Window {
    /// How often a frame's own answer was right.
    pub raw: Score,
    /// How often the filter's was.
    pub filtered: Score,
    /// In microseconds; none before the first frame.
    pub latency: Option<Histogram<u64>>,
}

impl Default for Course {
    fn default() -> Self {
        Self { width_s: 1.0, windows: Vec::new() }
    }
}

impl Course {
    fn add(&mut self, at: Duration, latency: Duration, raw: Option<bool>, filtered: Option<bool>) {
        while at.as_secs_f64() / self.width_s >= MAX_WINDOWS as f64 {
            let mut windows = std::mem::take(&mut self.windows).into_iter();
            while let Some(first) = windows.next() {
                self.windows.push(match windows.next() {
                    Some(second) => first.merge(second),
                    None => first,
                });
            }
            self.width_s *= 2.0;
        }
        let window_idx = (at.as_secs_f64() / self.width_s) as usize;
        self.windows.resize_with(self.windows.len().max(window_idx + 1), Default::default);
        let window = &mut self.windows[window_idx];
        if let Some(raw) = raw {
            window.raw.add(raw);
        }
        if let Some(filtered) = filtered {
            window.filtered.add(filtered);
        }
        if window.latency.is_none() {
            window.latency = Histogram::new_with_max(LONGEST_US, WINDOW_DIGITS).ok();
        }
        if let Some(latencies) = &mut window.latency {
            latencies.saturating_record(latency.as_micros() as u64);
        }
    }
}

impl Window {
    fn merge(self, other: Self) -> Self {
        let latency = match (self.latency, other.latency) {
            (Some(mut own), Some(others)) => {
                // Both have the same bounds.
                let _ = own.add(others);
                Some(own)
            }
            (own, others) => own.or(others),
        };
        let (raw, filtered) = (self.raw.merge(other.raw), self.filtered.merge(other.filtered));
        Self { raw, filtered, latency }
    }

    /// The latencies in a few figures; none without frames.
    pub fn percentiles(&self) -> Option<Percentiles> {
        Percentiles::of(self.latency.as_ref()?)
    }
}

/// Where a robot was and where it was told to be: stays of some time in a room.
#[derive(Default)]
pub struct Stays {
    /// The rooms of the labels.
    pub shown: Vec<Stay>,
    /// Of the frames' own answers.
    pub raw: Vec<Stay>,
    /// Of the filter's.
    pub filtered: Vec<Stay>,
}

/// Some time in one room.
#[derive(Clone, Debug, PartialEq)]
pub struct Stay {
    /// The room.
    pub room: String,
    /// Its first frame, in seconds from the start.
    pub from_s: f64,
    /// Its last frame.
    pub to_s: f64,
}

impl Stays {
    /// Takes a frame's rooms.
    pub fn add(&mut self, told: &Told) {
        let at_s = told.at.as_secs_f64();
        if let Some(room) = told.room {
            extend(&mut self.shown, room, at_s);
        }
        extend(&mut self.raw, &told.answer.room, at_s);
        if let Some(filtered) = told.filtered {
            extend(&mut self.filtered, &filtered.room, at_s);
        }
    }
}

fn extend(stays: &mut Vec<Stay>, room: &str, at_s: f64) {
    let n_stays = stays.len();
    if let Some(last) = stays.last_mut() {
        last.to_s = at_s;
        if last.room == room || n_stays == MAX_STAYS {
            return;
        }
    }
    stays.push(Stay { room: room.to_owned(), from_s: at_s, to_s: at_s });
}

/// A distribution in a few figures, in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Percentiles {
    /// Half are below.
    pub p50: f64,
    /// Nine of ten are below.
    pub p90: f64,
    /// 99 of 100 are below.
    pub p99: f64,
    /// 999 of 1000 are below.
    pub p99_9: f64,
    /// All are at most this.
    pub max: f64,
}

impl Percentiles {
    /// Of a distribution in microseconds; none where it is empty.
    pub fn of(histogram: &Histogram<u64>) -> Option<Self> {
        let at = |quantile| ms(histogram.value_at_quantile(quantile));
        (!histogram.is_empty()).then(|| Self {
            p50: at(0.5),
            p90: at(0.9),
            p99: at(0.99),
            p99_9: at(0.999),
            max: ms(histogram.max()),
        })
    }
}

/// Microseconds in milliseconds.
pub fn ms(us: u64) -> f64 {
    us as f64 / 1000.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_sent_and_not_answered_in_any_way_is_unaccounted() {
        let mut tally = Tally::new().unwrap();
        (0..4).for_each(|ms| tally.sent(Duration::from_millis(ms * 6)));
        tally.lose(DropReason::Superseded);
        tally.fail("queue-full".to_owned());
        tally.err("closed 1001".to_owned());
        assert_eq!((tally.n_unaccounted(), tally.n_late), (2, 2));
        assert_eq!(tally.most_late, Duration::from_millis(18));
        assert_eq!(tally.errors.values().sum::<u64>(), 2);
    }

    #[test]
    fn percentiles_are_of_all_values() {
        let mut histogram = Histogram::new(3).unwrap();
        assert_eq!(Percentiles::of(&histogram), None);
        (1..=1000).for_each(|ms| histogram.record(ms * 1000).unwrap());
        let of = Percentiles::of(&histogram).unwrap();
        for (measured, expected) in
            [(of.p50, 500.0), (of.p90, 900.0), (of.p99, 990.0), (of.p99_9, 999.0), (of.max, 1000.0)]
        {
            assert!((measured / expected - 1.0).abs() < 2e-3, "{measured} {expected}");
        }
    }

    #[test]
    fn a_long_course_keeps_its_sums_in_fewer_windows() {
        let mut course = Course::default();
        for second in 0..3000 {
            let latency = Duration::from_millis(second % 100);
            course.add(Duration::from_secs(second), latency, Some(second % 2 == 0), Some(true));
        }
        assert!(course.windows.len() <= MAX_WINDOWS, "{}", course.windows.len());
        assert_eq!(course.windows[0].raw.n_frames, course.width_s as usize);
        let all = course.windows.into_iter().reduce(Window::merge).unwrap();
        assert_eq!(all.raw, Score { n_correct: 1500, n_frames: 3000 });
        assert_eq!(all.filtered, Score { n_correct: 3000, n_frames: 3000 });
        let latency = all.percentiles().unwrap();
        assert!((latency.p50 - 49.0).abs() < 1.0 && (latency.max - 99.0).abs() < 1.0, "{latency:?}");
    }

    #[test]
    fn a_stay_lasts_until_the_room_changes() {
        let mut stays = Vec::new();
        for (at_s, room) in [(0.0, "a"), (1.0, "a"), (2.0, "b"), (3.0, "a")] {
            extend(&mut stays, room, at_s);
        }
        let stay = |room: &str, from_s, to_s| Stay { room: room.to_owned(), from_s, to_s };
        assert_eq!(stays, [stay("a", 0.0, 2.0), stay("b", 2.0, 3.0), stay("a", 3.0, 3.0)]);
    }
}
