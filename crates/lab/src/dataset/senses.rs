//! What a robot senses beside pictures: the scans of its laser and its odometry.

use super::{Dataset, Frame, Pose, Problem, RecordedMessage};
use roomsight_recognition::filter::{Interval, Motion};
use roomsight_recognition::model::{Extractor, LaserShape, Scan};
use std::sync::Arc;

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

impl From<RecordedMessage> for ScanSource {
    fn from(message: RecordedMessage) -> Self {
        Self::Recorded(message)
    }
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
        Some(Interval::between(self.seconds_to(next)?, self.odometry, next.odometry))
    }

    /// Reads what the laser measured beside it, for an extractor that may look at that; none where there is none, or it is not
    /// taken.
    pub fn read_scan_for(&self, extractor: &Extractor) -> Result<Option<Arc<Scan>>, Problem> {
        let scan = self.read_scan()?;
        match scan.as_ref().map(|scan| extractor.check_scan(scan)) {
            Some(Err(error)) => Err(Problem::new(&self.path, error.to_string())),
            _ => Ok(scan),
        }
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
