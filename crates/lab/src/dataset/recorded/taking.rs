//! What is taken of recordings.

use std::path::PathBuf;

/// Which pictures of recordings are taken, and what tells their rooms; and what is taken beside pictures. Other formats have
/// none of these but the last.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Taking {
    /// The topic of the pictures; the only one where none is given.
    pub topic: Option<String>,
    /// A list of times and rooms; the one beside a recording where nothing is given.
    pub labels: Option<PathBuf>,
    /// A topic of texts that name the room.
    pub room_topic: Option<String>,
    /// A map of rooms, which poses are looked up in.
    pub map: Option<PathBuf>,
    /// The topic of the poses; the only one where none is given.
    pub pose_topic: Option<String>,
    /// The name of the frame of coordinates that moves with the robot, in transforms.
    pub base_frame: Option<String>,
    /// Whether the scans of the robot's laser are taken, also of COLD sequences.
    pub laser: bool,
    /// The topic of the scans; the only one where none is given.
    pub scan_topic: Option<String>,
    /// Whether it is taken how far the robot went by its odometry, also of COLD sequences.
    pub odometry: bool,
    /// The topic of the odometry; the only one where none is given.
    pub odometry_topic: Option<String>,
    /// The clock that times are of.
    pub clock: Clock,
    /// From so many seconds after the first picture on.
    pub from: Option<f64>,
    /// Up to so many seconds after the first picture.
    pub to: Option<f64>,
    /// At most so many pictures a second.
    pub rate: Option<f64>,
}

/// A clock of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Clock {
    /// That of the recorder, when it wrote the message.
    #[default]
    Recorder,
    /// That of the stamps in the messages, when the picture was taken. All messages are read to know them.
    Stamps,
}

impl Taking {
    /// Whether a picture is taken that was taken at a time, after the last one that is.
    pub(super) fn wants(&self, time_ns: u64, first_ns: u64, last_ns: Option<u64>) -> bool {
        /// What clocks of cameras are off, of the time between two pictures.
        const EARLY: f64 = 0.02;
        let since = |from_ns: u64| (time_ns as i128 - i128::from(from_ns)) as f64 / super::SECOND;
        let at = since(first_ns);
        let is_due =
            self.rate.is_none_or(|rate| last_ns.is_none_or(|last_ns| since(last_ns) >= (1.0 - EARLY) / rate));
        self.from.is_none_or(|from| at >= from) && self.to.is_none_or(|to| at <= to) && is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_and_a_rate_are_kept_to() {
        let taking = Taking { from: Some(1.0), to: Some(3.0), rate: Some(2.0), ..Taking::default() };
        let (mut last_ns, mut taken) = (None, Vec::new());
        for tenth in 0..50_u64 {
            let time_ns = 7_000_000_000 + tenth * 100_000_000;
            if taking.wants(time_ns, 7_000_000_000, last_ns) {
                last_ns = Some(time_ns);
                taken.push(tenth);
            }
        }
        assert_eq!(taken, [10, 15, 20, 25, 30]);
    }
}
