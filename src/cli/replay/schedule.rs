//! When which frame is due.

use roomsight_lab::dataset::Frame;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

/// The most frames a second that one robot may send.
const MAX_RATE: f64 = 100_000.0;

/// How fast a robot sends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rate {
    /// With the times between frames that were recorded.
    Recorded,
    /// So many frames a second.
    PerSecond(f64),
    /// Each frame when the one before has gone.
    Max,
}

impl FromStr for Rate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.parse()) {
            ("recorded", _) => Ok(Self::Recorded),
            ("max", _) => Ok(Self::Max),
            (_, Ok(rate)) if rate > 0.0 && rate <= MAX_RATE => Ok(Self::PerSecond(rate)),
            _ => Err("give recorded, max, or frames a second, such as 5".to_owned()),
        }
    }
}

/// A frame and when it is due, counted from the robot's start. At [`Rate::Max`] all are due at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Due {
    /// Which frame of the data set.
    pub frame_idx: usize,
    /// When.
    pub at: Duration,
}

/// The sequences of a data set, one behind the other, as a circle.
#[derive(Clone, Debug)]
pub struct Track {
    /// From each frame to the next, the first behind the last.
    gaps: Arc<[Duration]>,
    /// The first frame of each sequence.
    starts: Vec<usize>,
}

impl Track {
    /// The track of frames that are sorted by sequence and time; none where the frames have no times, but
    /// are to be sent as recorded. Sequences follow each other with the gap before the last frame.
    pub fn new(frames: &[Frame], rate: Rate) -> Option<Self> {
        let is_start = |&idx: &usize| idx == 0 || frames[idx].sequence != frames[idx - 1].sequence;
        let starts: Vec<usize> = (0..frames.len()).filter(is_start).collect();
        let mut gap = Duration::ZERO;
        let mut gaps = Vec::with_capacity(frames.len());
        for idx in 0..frames.len() {
            gap = match rate {
                Rate::Max => Duration::ZERO,
                Rate::PerSecond(rate) => Duration::from_secs_f64(1.0 / rate),
                Rate::Recorded => match frames.get(idx + 1) {
                    Some(next) if next.sequence == frames[idx].sequence => {
                        Duration::try_from_secs_f64(next.time? - frames[idx].time?).unwrap_or_default()
                    }
                    _ => frames[idx].time.map(|_| gap)?,
                },
            };
            gaps.push(gap);
        }
        Some(Self { gaps: gaps.into(), starts })
    }

    /// How many frames one round has.
    pub fn n_frames(&self) -> usize {
        self.gaps.len()
    }

    /// The mean time between two frames.
    pub fn mean_gap(&self) -> Duration {
        self.gaps.iter().sum::<Duration>() / self.gaps.len().max(1) as u32
    }

    /// What a robot sends: `n_frames`, beginning with the first sequence, the second robot's with the second,
    /// and so on; none of them after `end`.
    pub fn schedule(&self, robot_idx: usize, n_frames: usize, end: Duration) -> Schedule {
        let next_idx = self.starts.get(robot_idx % self.starts.len().max(1)).copied().unwrap_or(0);
        Schedule { gaps: self.gaps.clone(), next_idx, at: Duration::ZERO, n_left: n_frames, end }
    }
}

/// What one robot sends, in order.
#[derive(Clone, Debug)]
pub struct Schedule {
    gaps: Arc<[Duration]>,
    next_idx: usize,
    at: Duration,
    n_left: usize,
    end: Duration,
}

impl Iterator for Schedule {
    type Item = Due;

    fn next(&mut self) -> Option<Due> {
        self.n_left = self.n_left.checked_sub(1)?;
        let gap = *self.gaps.get(self.next_idx)?;
        let due = Due { frame_idx: self.next_idx, at: self.at };
        self.at += gap;
        self.next_idx = (self.next_idx + 1) % self.gaps.len();
        (due.at <= self.end).then_some(due)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use roomsight_vision::camera::CameraKind;

    /// Frames of these sequences and times.
    fn frames(of: &[(&str, Option<f64>)]) -> Vec<Frame> {
        let frame = |&(sequence, time): &(&str, Option<f64>)| Frame {
            path: "frame.jpg".into(),
            room: "lab".to_owned(),
            sequence: sequence.to_owned(),
            camera: CameraKind::Perspective,
            split: String::new(),
            time,
            pose: None,
            odometry: None,
            scan: None,
            recorded: None,
        };
        of.iter().map(frame).collect()
    }

    const TWO_DRIVES: [(&str, Option<f64>); 5] =
        [("a", Some(10.0)), ("a", Some(10.5)), ("a", Some(11.5)), ("b", Some(3.0)), ("b", Some(3.2))];

    fn sent(rate: Rate, robot_idx: usize, n_frames: usize, end_ms: u64) -> Vec<(usize, u128)> {
        let track = Track::new(&frames(&TWO_DRIVES), rate).unwrap();
        let schedule = track.schedule(robot_idx, n_frames, Duration::from_millis(end_ms));
        schedule.map(|due| (due.frame_idx, due.at.as_millis())).collect()
    }

    #[test]
    fn recorded_times_are_kept_and_sequences_follow_each_other() {
        let first = [(0, 0), (1, 500), (2, 1500), (3, 2500), (4, 2700)];
        assert_eq!(sent(Rate::Recorded, 0, 5, 10_000), first);
        assert_eq!(sent(Rate::Recorded, 2, 6, 10_000), [&first[..], &[(0, 2900)]].concat());
        assert_eq!(sent(Rate::Recorded, 1, 3, 10_000), [(3, 0), (4, 200), (0, 400)]);
    }

    #[test]
    fn a_rate_spaces_frames_evenly_until_the_end() {
        assert_eq!(sent(Rate::PerSecond(4.0), 0, 100, 600), [(0, 0), (1, 250), (2, 500)]);
        assert_eq!(sent(Rate::Max, 1, 3, 0), [(3, 0), (4, 0), (0, 0)]);
    }

    #[test]
    fn frames_without_times_cannot_be_sent_as_recorded() {
        let untimed = frames(&[("a", None), ("a", None)]);
        assert!(Track::new(&untimed, Rate::Recorded).is_none());
        assert!(Track::new(&untimed, Rate::Max).is_some());
    }

    #[test]
    fn rates_are_read_or_refused() {
        assert_eq!("recorded".parse(), Ok(Rate::Recorded));
        assert_eq!("2.5".parse(), Ok(Rate::PerSecond(2.5)));
        for wrong in ["", "0", "-1", "nan", "inf", "fast"] {
            assert!(wrong.parse::<Rate>().is_err(), "{wrong}");
        }
    }
}
