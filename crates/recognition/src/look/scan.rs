//! What a laser measures beside a picture.

use roomsight_vision::image::Image;
use serde::{Deserialize, Serialize};
use std::f32::consts::TAU;

/// One sweep of a laser scanner in a plane. In files it has the fields of a `sensor_msgs/LaserScan` that it needs; ranges that
/// met nothing are null.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "Written", try_from = "Written")]
pub struct Scan {
    start: f32,
    step: f32,
    max_range: f32,
    /// Infinite where nothing was met.
    ranges: Vec<f32>,
}

/// A scan in a file.
#[derive(Serialize, Deserialize)]
struct Written {
    angle_min: f32,
    angle_increment: f32,
    range_max: f32,
    ranges: Vec<Option<f32>>,
}

impl From<Scan> for Written {
    fn from(Scan { start, step, max_range, ranges }: Scan) -> Self {
        let ranges = ranges.into_iter().map(|range| range.is_finite().then_some(range)).collect();
        Self { angle_min: start, angle_increment: step, range_max: max_range, ranges }
    }
}

impl TryFrom<Written> for Scan {
    type Error = ScanError;

    fn try_from(written: Written) -> Result<Self, ScanError> {
        let Written { angle_min, angle_increment, range_max, ranges } = written;
        let ranges = ranges.into_iter().map(|range| range.unwrap_or(f32::INFINITY)).collect();
        Self::new(angle_min, angle_increment, range_max, ranges)
    }
}

/// Why numbers are no scan.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ScanError {
    /// Too few or too many beams.
    #[error("a scan has from {min} to {max} ranges, not {0}", min = Scan::MIN_BEAMS, max = Scan::MAX_BEAMS)]
    Beams(usize),
    /// The beams go nowhere, or around more than once.
    #[error(
        "the angles of a scan are radians: {n_beams} beams from {start} in steps of {step} are no sweep of at most a circle"
    )]
    Angles {
        /// Beams of the scan.
        n_beams: usize,
        /// The angle of the first.
        start: f32,
        /// From one to the next.
        step: f32,
    },
    /// No length that a laser measures.
    #[error("the longest range of a scan is from 0.1 to 1000 meters, not {0}")]
    MaxRange(f32),
}

impl Scan {
    /// The fewest beams.
    pub const MIN_BEAMS: usize = 16;
    /// The most beams.
    pub const MAX_BEAMS: usize = 16_384;

    /// Ranges in meters, of beams from the angle `start` on in steps of `step`, in radians counterclockwise from ahead, as in
    /// ROS. A range that is no number, not above 0 or not below `max_range` met nothing.
    ///
    /// # Errors
    /// Numbers that no laser gives: see [`ScanError`].
    pub fn new(start: f32, step: f32, max_range: f32, mut ranges: Vec<f32>) -> Result<Self, ScanError> {
        let n_beams = ranges.len();
        if !(Self::MIN_BEAMS..=Self::MAX_BEAMS).contains(&n_beams) {
            return Err(ScanError::Beams(n_beams));
        }
        let field = step.abs() * (n_beams - 1) as f32;
        // A step of slack: some lasers measure the last direction twice.
        let is_sweep = field > 0.0 && field < TAU + 1.5 * step.abs() && start.abs() <= 2.0 * TAU;
        if !is_sweep {
            return Err(ScanError::Angles { n_beams, start, step });
        }
        if !(0.1..=1000.0).contains(&max_range) {
            return Err(ScanError::MaxRange(max_range));
        }
        let met_nothing = |range: &&mut f32| !(**range > 0.0 && **range < max_range);
        ranges.iter_mut().filter(met_nothing).for_each(|range| *range = f32::INFINITY);
        Ok(Self { start, step, max_range, ranges })
    }

    /// The angle from the first beam to the last, in degrees.
    pub fn field_degrees(&self) -> f32 {
        (self.step.abs() * (self.ranges.len() - 1) as f32).to_degrees()
    }

    /// The angle of the first beam, in radians.
    pub fn start(&self) -> f32 {
        self.start
    }

    /// From one beam to the next, in radians.
    pub fn step(&self) -> f32 {
        self.step
    }

    /// The longest range that is measured, in meters.
    pub fn max_range(&self) -> f32 {
        self.max_range
    }

    /// In meters, infinite where nothing was met.
    pub fn ranges(&self) -> &[f32] {
        &self.ranges
    }

    /// What a beam measured, in meters; `None` where it met nothing.
    pub(crate) fn range_of(&self, beam: usize) -> Option<f32> {
        Some(self.ranges[beam]).filter(|range| range.is_finite())
    }

    /// The beam nearest to an angle, if one is within a step of it.
    pub(crate) fn beam_at(&self, angle: f32) -> Option<usize> {
        let step = self.step.abs();
        let way = ((angle - self.start) * self.step.signum()).rem_euclid(TAU);
        let last = self.ranges.len() - 1;
        let beam = way / step;
        if beam <= last as f32 + 1.0 {
            return Some((beam.round() as usize).min(last));
        }
        // Just before the first.
        (TAU - way <= step).then_some(0)
    }
}

/// What a robot sees at one time: a picture, and what its laser measures, where it has one.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// The picture.
    pub image: &'a Image,
    /// The scan.
    pub scan: Option<&'a Scan>,
}

impl<'a> From<&'a Image> for Frame<'a> {
    /// A picture alone.
    fn from(image: &'a Image) -> Self {
        Self { image, scan: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::PI;

    fn degrees(scan: &Scan, angles: [f32; 3]) -> [Option<usize>; 3] {
        angles.map(|angle| scan.beam_at(angle.to_radians()))
    }

    #[test]
    fn beams_are_found_by_their_angle_however_a_laser_counts_them() {
        let ranges = |n: usize| (0..n).map(|idx| 1.0 + idx as f32 / 1000.0).collect::<Vec<f32>>();
        let step = 1_f32.to_radians();
        let ahead = Scan::new(-PI / 2.0, step, 8.0, ranges(181)).unwrap();
        assert_eq!(degrees(&ahead, [-90.0, 0.2, 90.0]), [Some(0), Some(90), Some(180)]);
        assert_eq!(degrees(&ahead, [-95.0, 95.0, 180.0]), [None; 3]);
        let around = Scan::new(0.0, step, 8.0, ranges(360)).unwrap();
        assert_eq!(degrees(&around, [0.0, -1.0, 180.0]), [Some(0), Some(359), Some(180)]);
        let upside_down = Scan::new(PI / 2.0, -step, 8.0, ranges(181)).unwrap();
        assert_eq!(degrees(&upside_down, [-90.0, 0.0, 90.0]), [Some(180), Some(90), Some(0)]);
        assert!((around.field_degrees() - 359.0).abs() < 0.01);
    }

    #[test]
    fn what_met_nothing_has_no_range() {
        let mut ranges = vec![2.0; 20];
        ranges[..5].copy_from_slice(&[f32::NAN, f32::INFINITY, 0.0, -1.0, 8.0]);
        let scan = Scan::new(0.0, 0.1, 8.0, ranges).unwrap();
        let found: Vec<Option<f32>> =
            (0..6).map(|idx| scan.range_of(scan.beam_at(idx as f32 * 0.1).unwrap())).collect();
        assert_eq!(found, [None, None, None, None, None, Some(2.0)]);
        let written = serde_json::to_string(&scan).unwrap();
        assert!(written.contains("null,2.0"), "{written}");
        assert_eq!(serde_json::from_str::<Scan>(&written).unwrap(), scan);
        assert!(serde_json::from_str::<Scan>(&written.replace("[null,", "[")).is_ok());
        assert!(serde_json::from_str::<Scan>(&written.replace("0.1", "9")).is_err());
    }

    #[test]
    fn numbers_that_no_laser_gives_are_refused() {
        let new = |step, max_range, n_beams| Scan::new(-1.0, step, max_range, vec![1.0; n_beams]).err();
        assert_eq!(new(0.01, 8.0, 3), Some(ScanError::Beams(3)));
        assert_eq!(new(0.0001, 8.0, 100_000), Some(ScanError::Beams(100_000)));
        for step in [0.0, f32::NAN, f32::INFINITY, 0.2] {
            assert!(matches!(new(step, 8.0, 100), Some(ScanError::Angles { .. })), "{step}");
        }
        for range in [0.0, f32::NAN, f32::INFINITY, -3.0] {
            assert!(matches!(new(0.01, range, 100), Some(ScanError::MaxRange(_))), "{range}");
        }
        assert!(Scan::new(f32::NAN, 0.01, 8.0, vec![1.0; 100]).is_err());
        assert_eq!(new(0.01, 8.0, 181), None);
    }
}
