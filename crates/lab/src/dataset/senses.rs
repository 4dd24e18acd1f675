//! What a robot senses beside pictures: the scans of its laser and its odometry, paired with pictures by time.

use super::{Dataset, Frame, Pose, RecordedMessage};
use crate::cold_layout::tdf::Timed;
use roomsight_recognition::filter::{Interval, Motion};
use roomsight_recognition::model::{LaserShape, Scan};
use std::sync::Arc;

/// How far what belongs together may be apart, in seconds.
pub(super) const MAX_APART: f64 = 0.25;

/// Scans that are read to know how much of the surroundings the laser shows.
const N_LOOKED_AT: usize = 20;

/// How much may be shown, in degrees, as scanners do.
const FIELDS: [f32; 6] = [360.0, 270.0, 240.0, 180.0, 120.0, 90.0];

/// Where the scan of a frame is.
#[derive(Clone, Debug, PartialEq)]
pub enum ScanSource {
    /// It was read with the list of frames.
    Read(Arc<Scan>),
    /// In a recording.
    Recorded(RecordedMessage),
}

impl ScanSource {
    /// The scan.
    ///
    /// # Errors
    /// Why it cannot be read.
    pub fn read(&self) -> Result<Arc<Scan>, String> {
        match self {
            Self::Read(scan) => Ok(Arc::clone(scan)),
            Self::Recorded(message) => message.scan().map(Arc::new),
        }
    }
}

impl Frame {
    /// What lies between this frame and `next`, the frame after it: the time, as [`Frame::seconds_to`] says, and the way where both
    /// tell their odometry. None where `next` is of another drive or of none known.
    pub fn interval_to(&self, next: &Self) -> Option<Interval> {
        let motion = self.odometry.zip(next.odometry).and_then(|(from, to)| Motion::between(&from, &to));
        Some(Interval { seconds: self.seconds_to(next)?, motion })
    }

    /// The way to `next` in meters, by odometry or else by where the frames were taken; `None` where neither tells it.
    pub(super) fn meters_to(&self, next: &Self) -> Option<f64> {
        let way = |from: Option<Pose>, to: Option<Pose>| Some(Motion::between(&from?, &to?)?.meters);
        way(self.odometry, next.odometry).or_else(|| way(self.pose, next.pose))
    }
}

impl Dataset {
    /// How scans can be looked at that the frames have: as much of the surroundings as all show. `None` where none has one.
    pub fn laser(&self) -> Option<LaserShape> {
        if self.described_projection().is_some() {
            return self.described_laser();
        }
        let with_scan: Vec<&ScanSource> =
            self.frames.iter().filter_map(|frame| frame.scan.as_ref()).collect();
        let step = with_scan.len().div_ceil(N_LOOKED_AT).max(1);
        let scans: Vec<Arc<Scan>> =
            with_scan.into_iter().step_by(step).filter_map(|source| source.read().ok()).collect();
        let shape = |field_degrees| LaserShape { field_degrees, ..LaserShape::default() };
        let is_shown = |shape: &LaserShape| scans.iter().all(|scan| shape.is_covered_by(scan));
        FIELDS.map(shape).into_iter().find(|shape| !scans.is_empty() && is_shown(shape))
    }
}

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
