//! What belongs to a picture by its time.

use crate::cold_layout::tdf::Timed;

/// How far what belongs together may be apart, in seconds.
pub const MAX_APART: f64 = 0.25;

/// What was when.
#[derive(Clone, Debug)]
pub(super) struct ByTime<T> {
    moments: Vec<Timed<T>>,
}

impl<T> ByTime<T> {
    /// In any order.
    pub(super) fn new(mut moments: Vec<Timed<T>>) -> Self {
        moments.sort_by(|one, other| one.time.total_cmp(&other.time));
        Self { moments }
    }

    /// What was nearest to a time in seconds, if it was near.
    pub(super) fn at(&self, time: f64) -> Option<&T> {
        let after = self.moments.partition_point(|moment| moment.time < time);
        let beside = [after.checked_sub(1), Some(after)].into_iter().flatten();
        let distance = |moment: &&Timed<T>| (moment.time - time).abs();
        let nearest = beside
            .filter_map(|idx| self.moments.get(idx))
            .min_by(|one, other| distance(one).total_cmp(&distance(other)));
        nearest.filter(|moment| distance(moment) <= MAX_APART).map(|moment| &moment.what)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_nearest_in_time_belongs_together_unless_it_is_far() {
        let moment = |time| Timed { time, what: time };
        let by_time = ByTime::new([3.0, 1.0, 1.3].map(moment).to_vec());
        let found = [0.7, 0.8, 1.1, 1.16, 2.0, 3.2, 9.0].map(|time| by_time.at(time).copied());
        assert_eq!(found, [None, Some(1.0), Some(1.0), Some(1.3), None, Some(3.0), None]);
        assert_eq!(ByTime::<u8>::new(Vec::new()).at(1.0), None);
    }
}
