//! Where a robot was in the last minutes.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What is older is forgotten.
const REMEMBERED: Duration = Duration::from_secs(600);
/// The most stays; where there are more the oldest are forgotten.
const MAX_STAYS: usize = 120;
/// Answers that are farther apart are no one stay.
const LONGEST_PAUSE: Duration = Duration::from_secs(10);

/// Stays in rooms, the oldest first.
#[derive(Clone, Default)]
pub struct Ribbon(VecDeque<PastStay>);

/// A time in which all answers named one room.
#[derive(Clone, Debug, PartialEq)]
pub struct PastStay {
    pub room: Arc<str>,
    pub known: bool,
    pub from: Instant,
    pub until: Instant,
}

impl Ribbon {
    /// An answer named this room.
    pub fn answered(&mut self, room: &str, known: bool, now: Instant) {
        let Self(stays) = self;
        let goes_on = |last: &&mut PastStay| {
            *last.room == *room && last.known == known && now.duration_since(last.until) <= LONGEST_PAUSE
        };
        match stays.back_mut().filter(goes_on) {
            Some(last) => last.until = now,
            None => {
                // A name that repeats is kept once.
                let room = match stays.back() {
                    Some(last) if *last.room == *room => last.room.clone(),
                    _ => room.into(),
                };
                stays.push_back(PastStay { room, known, from: now, until: now });
            }
        }
        while stays.len() > MAX_STAYS || stays.front().is_some_and(|stay| is_over(stay, now)) {
            stays.pop_front();
        }
    }

    /// The stays that are not forgotten, the oldest first.
    pub fn stays(&self, now: Instant) -> impl Iterator<Item = &PastStay> {
        self.0.iter().filter(move |stay| !is_over(stay, now))
    }
}

fn is_over(stay: &PastStay, now: Instant) -> bool {
    now.saturating_duration_since(stay.until) > REMEMBERED
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_become_stays_that_end_and_are_forgotten() {
        let (began, mut ribbon) = (Instant::now(), Ribbon::default());
        let at = |seconds| began + Duration::from_secs(seconds);
        let told = |ribbon: &Ribbon, now| {
            let stays = ribbon.stays(at(now));
            stays.map(|stay| (stay.room.to_string(), stay.known)).collect::<Vec<_>>()
        };
        for (seconds, room, known) in
            [(0, "hall", true), (1, "hall", true), (2, "hall", false), (3, "bath", true), (60, "bath", true)]
        {
            ribbon.answered(room, known, at(seconds));
        }
        let all = [("hall", true), ("hall", false), ("bath", true), ("bath", true)];
        assert_eq!(told(&ribbon, 60), all.map(|(room, known)| (room.to_owned(), known)));
        assert_eq!(ribbon.stays(at(60)).next().unwrap().until, at(1));
        assert_eq!(told(&ribbon, 650), [("bath".to_owned(), true)]);
        for seconds in 0..1000 {
            ribbon.answered(if seconds % 2 == 0 { "hall" } else { "bath" }, true, at(100 + seconds / 10));
        }
        assert_eq!(ribbon.0.len(), MAX_STAYS);
    }
}
