//! Frames in the order they were taken: what they tell of how robots move.

use super::{Dataset, Format, Frame};
use roomsight_recognition::filter::{Step, Transitions};

/// The time from frame to frame where a drive does not say it, in seconds: that of the COLD database.
const FRAME_INTERVAL: f64 = 0.2;

impl Frame {
    /// The time to `next`, the frame after this one, in seconds; none when it is of another drive or of none
    /// known. Frames without a time, or not later than the one before, are 0.2 seconds apart.
    pub fn seconds_to(&self, next: &Self) -> Option<f64> {
        if self.sequence.is_empty() || self.sequence != next.sequence {
            return None;
        }
        let seconds = next.time.zip(self.time).map(|(next, this)| next - this);
        Some(seconds.filter(|seconds| seconds.is_finite() && *seconds > 0.0).unwrap_or(FRAME_INTERVAL))
    }
}

impl Dataset {
    /// Whether the frames of a sequence are in the order they were taken. In a folder a room they are not:
    /// there they are by room.
    pub fn is_in_order(&self) -> bool {
        self.format != Format::Folder
    }

    /// What the drives tell of how robots move between `rooms`, which are sorted.
    pub fn transitions(&self, rooms: &[String]) -> Transitions {
        let room_idx = |frame: &Frame| rooms.binary_search(&frame.room).ok();
        let step = |pair: &[Frame]| {
            let seconds = pair[0].seconds_to(&pair[1])?;
            let meters = pair[0].meters_to(&pair[1]);
            Some(Step { from: room_idx(&pair[0])?, to: room_idx(&pair[1])?, seconds, meters })
        };
        let pairs = self.frames.windows(2).filter(|_| self.is_in_order());
        Transitions::learn(rooms.len(), pairs.filter_map(step))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use roomsight_vision::camera::CameraKind;
    use std::path::Path;

    fn frame(sequence: &str, time: Option<f64>, room: &str) -> Frame {
        Frame {
            path: "frame.jpg".into(),
            room: room.to_owned(),
            sequence: sequence.to_owned(),
            camera: CameraKind::Perspective,
            split: String::new(),
            time,
            pose: None,
            odometry: None,
            scan: None,
            recorded: None,
        }
    }

    fn dataset(frames: Vec<Frame>) -> Dataset {
        Dataset { frames, ..Dataset::new(Path::new(""), Format::Manifest) }
    }

    fn rooms() -> [String; 3] {
        ["bath", "hall", "kitchen"].map(str::to_owned)
    }

    #[test]
    fn times_say_how_far_frames_are_apart_and_an_interval_where_there_are_none() {
        let first = frame("a", Some(3.0), "hall");
        assert_eq!(first.seconds_to(&frame("a", Some(4.5), "hall")), Some(1.5));
        for time in [None, Some(3.0), Some(2.0), Some(f64::NAN), Some(f64::INFINITY)] {
            assert_eq!(first.seconds_to(&frame("a", time, "hall")), Some(FRAME_INTERVAL), "{time:?}");
        }
        assert_eq!(first.seconds_to(&frame("b", Some(4.5), "hall")), None);
        assert_eq!(frame("", Some(3.0), "hall").seconds_to(&frame("", Some(4.5), "hall")), None);
    }

    #[test]
    fn a_drive_tells_where_robots_stay_and_go() {
        let frames = [(0.0, "hall"), (8.0, "hall"), (10.0, "bath"), (14.0, "hall"), (20.0, "hall")];
        let frames = frames.map(|(time, room)| frame("a", Some(time), room));
        let transitions = dataset(frames.to_vec()).transitions(&rooms());
        assert_eq!(transitions.dwells(), [7.0, 13.0, 10.0]);
        assert_eq!(transitions.next().row(1), [0.75, 0.0, 0.25]);
    }

    #[test]
    fn nothing_is_learned_across_drives_or_from_frames_in_no_order() {
        let unlearned = Transitions::unlearned(3);
        let across = vec![frame("a", None, "hall"), frame("b", None, "bath"), frame("", None, "hall")];
        assert_eq!(dataset(across).transitions(&rooms()), unlearned);
        let unnamed = vec![frame("", None, "hall"), frame("", None, "bath")];
        assert_eq!(dataset(unnamed).transitions(&rooms()), unlearned);
        let mut folder = dataset(vec![frame("a", None, "bath"), frame("a", None, "hall")]);
        assert_ne!(folder.transitions(&rooms()), unlearned);
        folder.format = Format::Folder;
        assert_eq!(folder.transitions(&rooms()), unlearned);
    }
}
