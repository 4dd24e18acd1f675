//! What COLD's robots sensed beside pictures: `odom_scans/odom.tdf` and `scans.tdf`.

use crate::cold_layout::tdf::{self, Timed};
use crate::cold_layout::{ODOMETRY_FILE, SCAN_FILE, SENSES_FOLDER};
use crate::dataset::by_time::ByTime;
use crate::dataset::senses::ScanSource;
use crate::dataset::{Dataset, Pose, Taking, files};
use std::path::Path;
use std::sync::Arc;

/// The longest file that is read, in bytes: an hour of scans of 361 ranges, ten a second.
const MAX_BYTES: u64 = 128 << 20;

/// The senses of a sequence; empty where they are not wanted, or not there.
pub(super) struct Senses {
    scans: ByTime<ScanSource>,
    odometry: ByTime<Pose>,
}

impl Senses {
    /// Those that are wanted of a sequence. What cannot be read is a problem; that a file is not there is noted.
    pub(super) fn read(dataset: &mut Dataset, sequence: &Path, taking: &Taking) -> Self {
        let folder = sequence.join(SENSES_FOLDER);
        let of_scan = |line: &str| {
            let Timed { time, what } = tdf::read_scan(line)?;
            Ok(Timed { time, what: ScanSource::Read(Arc::new(what)) })
        };
        let scans = folder.join(SCAN_FILE);
        dataset.has_other_scans |= !taking.laser && scans.is_file();
        Self {
            scans: lines(dataset, &scans, taking.laser, of_scan),
            odometry: lines(dataset, &folder.join(ODOMETRY_FILE), taking.odometry, tdf::read_odometry),
        }
    }

    /// The scan beside a frame of a time in seconds.
    pub(super) fn scan_at(&self, time: f64) -> Option<ScanSource> {
        self.scans.at(time).cloned()
    }

    /// Where the robot was at a time, by its wheels.
    pub(super) fn odometry_at(&self, time: f64) -> Option<Pose> {
        self.odometry.at(time).copied()
    }
}

fn lines<T>(
    dataset: &mut Dataset,
    path: &Path,
    is_wanted: bool,
    read: impl Fn(&str) -> Result<Timed<T>, String>,
) -> ByTime<T> {
    let mut moments = Vec::new();
    if !is_wanted {
        return ByTime::new(moments);
    }
    if !path.is_file() {
        dataset.note(path, "no such file: the frames of this sequence are taken without it");
        return ByTime::new(moments);
    }
    match files::read_bounded(path, MAX_BYTES) {
        Ok(bytes) => {
            let text = String::from_utf8_lossy(&bytes);
            for line in text.lines().filter(|line| !line.trim().is_empty()) {
                match read(line) {
                    Ok(moment) => moments.push(moment),
                    Err(reason) => dataset.report(path, format!("a line is left out: {reason}")),
                }
            }
        }
        Err(error) => dataset.report(path, error.to_string()),
    }
    ByTime::new(moments)
}
