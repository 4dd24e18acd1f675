//! Where a robot was when, as a recording tells it.

use super::{DatasetError, Taking, Wanted, unusable};
use crate::dataset::Pose;
use roomsight_recording::message::{Located, located};
use roomsight_recording::{Kind, Recording};
use std::collections::HashMap;

/// Between two poses farther apart than this nothing is known of where the robot was, in nanoseconds.
const MAX_GAP_NS: u64 = 1_000_000_000;

/// The frames of coordinates that usually move with a robot.
const BASE_FRAMES: [&str; 2] = ["base_link", "base_footprint"];

/// The topic of transforms that do not change.
const STATIC_TOPIC: &str = "/tf_static";

/// The most frames of coordinates between the map and the robot.
const MAX_CHAIN: usize = 32;

/// A pose and when it was.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Moment {
    time_ns: u64,
    pose: Pose,
}

/// A pose, and the frame of coordinates that it is in.
#[derive(Clone, Debug, PartialEq)]
struct Placed {
    frame_id: String,
    pose: Pose,
}

/// Poses by time.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct PoseTrack {
    moments: Vec<Moment>,
}

impl PoseTrack {
    /// Those of a recording: of the topic that is wanted, or, where a map wants poses, of the only one.
    pub(super) fn of(recording: &Recording, taking: &Taking) -> Result<Option<Self>, DatasetError> {
        if taking.pose_topic.is_none() && taking.map.is_none() {
            return Ok(None);
        }
        let wanted = Wanted {
            what: "poses of the robot, which a map needs",
            option: "--pose-topic",
            name: taking.pose_topic.as_deref(),
            is_wanted: |topic| topic.kind().is_pose() && topic.name != STATIC_TOPIC,
        };
        Self::of_topic(recording, wanted.topic_of(recording)?, taking).map(Some)
    }

    /// Where the robot was by its wheels; none where that is not wanted.
    pub(super) fn of_odometry(recording: &Recording, taking: &Taking) -> Result<Option<Self>, DatasetError> {
        if !taking.odometry {
            return Ok(None);
        }
        let wanted = Wanted {
            what: "odometry",
            option: "--odometry-topic",
            name: taking.odometry_topic.as_deref(),
            is_wanted: |topic| topic.kind() == Kind::Odometry,
        };
        Self::of_topic(recording, wanted.topic_of(recording)?, taking).map(Some)
    }

    fn of_topic(recording: &Recording, chosen: usize, taking: &Taking) -> Result<Self, DatasetError> {
        let topics = recording.topics();
        let fixed =
            topics.iter().position(|topic| topic.name == STATIC_TOPIC && topic.kind() == Kind::Transforms);
        let mut tree = TransformTree { base: taking.base_frame.clone(), ..TransformTree::default() };
        let (mut track, mut frame_id) = (Self::default(), String::new());
        let wanted: Vec<usize> = match topics[chosen].kind() {
            Kind::Transforms => fixed.into_iter().chain([chosen]).collect(),
            _ => vec![chosen],
        };
        let failed = |error: &dyn std::fmt::Display| unusable(recording, error.to_string());
        let (messages, _) = recording.messages(&wanted).map_err(|error| failed(&error))?;
        for message in &messages {
            let topic = &topics[message.topic_idx];
            let bytes = recording.read(message).map_err(|error| failed(&error))?;
            let located = located(topic, &bytes).map_err(|error| failed(&error))?;
            let placed = match topic.kind() {
                Kind::Transforms => tree.with(located),
                _ => located.into_iter().next().map(Placed::of),
            };
            let Some(placed) = placed.filter(|placed| placed.pose.is_finite()) else { continue };
            if placed.frame_id != frame_id {
                // A robot that finds itself on the map goes on in other coordinates.
                track.moments.clear();
                frame_id = placed.frame_id;
            }
            track.moments.push(Moment { time_ns: message.time_ns, pose: placed.pose });
        }
        if track.moments.is_empty() {
            let name = &topics[chosen].name;
            let why = format!(
                "no pose of the robot is recorded under {name}; of transforms, --base-frame names what moves"
            );
            return Err(unusable(recording, why));
        }
        Ok(track)
    }

    /// The pose at a time, between those before and after it; none where they are too far apart.
    pub(super) fn at(&self, time_ns: u64) -> Option<Pose> {
        let after = self.moments.partition_point(|moment| moment.time_ns < time_ns);
        let next = self.moments.get(after)?;
        if next.time_ns == time_ns {
            return Some(next.pose);
        }
        let last = &self.moments[after.checked_sub(1)?];
        let gap_ns = next.time_ns - last.time_ns;
        let share = (time_ns - last.time_ns) as f64 / gap_ns as f64;
        let between = |from: f64, to: f64| from + share * (to - from);
        let turn = (next.pose.angle - last.pose.angle).sin().atan2((next.pose.angle - last.pose.angle).cos());
        (gap_ns <= MAX_GAP_NS).then(|| Pose {
            x: between(last.pose.x, next.pose.x),
            y: between(last.pose.y, next.pose.y),
            angle: last.pose.angle + share * turn,
        })
    }
}

impl Placed {
    fn of(Located { frame_id, x, y, yaw, .. }: Located) -> Self {
        Self { frame_id, pose: Pose { x, y, angle: yaw } }
    }
}

/// Frames of coordinates, each in the one above it, as they are now.
#[derive(Default)]
struct TransformTree {
    above: HashMap<String, Located>,
    /// What moves with the robot; one of the usual where nothing is given.
    base: Option<String>,
}

impl TransformTree {
    /// Where the robot is after these are known, in the frame above all, if that can be told.
    fn with(&mut self, transforms: Vec<Located>) -> Option<Placed> {
        let short = |name: &str| name.trim_start_matches('/').to_owned();
        for mut transform in transforms {
            transform.frame_id = short(&transform.frame_id);
            self.above.insert(short(&transform.child_frame_id), transform);
        }
        let usual = BASE_FRAMES.into_iter().find(|name| self.above.contains_key(*name));
        let mut frame = self.base.as_deref().or(usual)?;
        let mut pose = Pose { x: 0.0, y: 0.0, angle: 0.0 };
        let mut n_above = 0;
        while let Some(above) = self.above.get(frame) {
            let (sin, cos) = above.yaw.sin_cos();
            pose = Pose {
                x: above.x + cos * pose.x - sin * pose.y,
                y: above.y + sin * pose.x + cos * pose.y,
                angle: above.yaw + pose.angle,
            };
            n_above += 1;
            if n_above > MAX_CHAIN {
                return None;
            }
            frame = &above.frame_id;
        }
        (n_above > 0).then(|| Placed { frame_id: frame.to_owned(), pose })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn transform(frame: &str, child: &str, x: f64, y: f64, yaw: f64) -> Located {
        Located { frame_id: frame.to_owned(), child_frame_id: child.to_owned(), x, y, yaw }
    }

    #[test]
    fn transforms_are_followed_up_to_the_map() {
        let mut tree = TransformTree::default();
        assert_eq!(tree.with(vec![transform("/map", "odom", 1.0, 2.0, FRAC_PI_2)]), None);
        let Placed { frame_id, pose } =
            tree.with(vec![transform("odom", "/base_link", 3.0, 0.0, 0.5)]).unwrap();
        assert_eq!(frame_id, "map");
        assert!((pose.x - 1.0).abs() < 1e-9 && (pose.y - 5.0).abs() < 1e-9, "{pose:?}");
        assert!((pose.angle - FRAC_PI_2 - 0.5).abs() < 1e-9);
        let circle =
            vec![transform("b", "base_link", 0.0, 0.0, 0.0), transform("base_link", "b", 0.0, 0.0, 0.0)];
        assert_eq!(tree.with(circle), None);
    }

    #[test]
    fn poses_lie_between_those_that_are_known() {
        let moment = |time_ns, x, angle| Moment { time_ns, pose: Pose { x, y: 0.0, angle } };
        let moments =
            vec![moment(0, 0.0, 3.0), moment(1_000_000_000, 2.0, -3.0), moment(9_000_000_000, 3.0, 0.0)];
        let track = PoseTrack { moments };
        let between = track.at(500_000_000).unwrap();
        assert!(
            (between.x - 1.0).abs() < 1e-9 && (between.angle - std::f64::consts::PI).abs() < 0.01,
            "{between:?}"
        );
        assert_eq!(track.at(1_000_000_000).unwrap().x, 2.0);
        assert_eq!((track.at(5_000_000_000), track.at(10_000_000_000)), (None, None));
    }
}
