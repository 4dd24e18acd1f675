//! How far off estimated poses are.

use roomsight_recognition::model::{Pose, PoseEstimate};
use serde::Serialize;
use std::f64::consts::{PI, TAU};

/// How far off estimated poses are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PoseErrors {
    /// The frames whose pose was estimated and is known.
    pub n_frames: usize,
    /// The middle error, in meters.
    pub median: f64,
    /// The error that nine of ten frames stay below, in meters.
    pub percentile_90: f64,
    /// The middle error of the heading, in degrees.
    pub median_heading: f64,
    /// The share of frames that were taken within twice the stated radius.
    pub within_two_radii: f64,
}

impl PoseErrors {
    /// Of estimates, each beside the pose that is true; `None` without any.
    pub fn new(poses: &[(PoseEstimate, Pose)]) -> Option<Self> {
        let sorted = |error: fn(&(PoseEstimate, Pose)) -> f64| {
            let mut errors: Vec<f64> = poses.iter().map(error).collect();
            errors.sort_by(f64::total_cmp);
            errors
        };
        let distances = sorted(|(estimate, pose)| estimate.pose.distance(pose));
        let turns = sorted(|(estimate, pose)| turn(estimate.pose.angle - pose.angle).to_degrees());
        let is_within =
            |(estimate, pose): &&(PoseEstimate, Pose)| estimate.pose.distance(pose) <= 2.0 * estimate.radius;
        let n_frames = poses.len();
        let at = |errors: &[f64], share: usize| errors.get(n_frames * share / 100).copied();
        Some(Self {
            n_frames,
            median: at(&distances, 50)?,
            percentile_90: at(&distances, 90)?,
            median_heading: at(&turns, 50)?,
            within_two_radii: poses.iter().filter(is_within).count() as f64 / n_frames as f64,
        })
    }
}

/// The smaller turn, from 0 to half a circle.
fn turn(angle: f64) -> f64 {
    let angle = angle.rem_euclid(TAU);
    if angle > PI { TAU - angle } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_the_middle_and_the_far_ones() {
        let at = |x: f64, angle: f64| Pose { x, y: 1.0, angle };
        let estimate = |x: f64, angle: f64| PoseEstimate { pose: at(x, angle), radius: 0.25 };
        let poses: Vec<(PoseEstimate, Pose)> =
            (0..10).map(|idx| (estimate(f64::from(idx) / 10.0, 3.1), at(0.0, -3.1))).collect();
        let errors = PoseErrors::new(&poses).unwrap();
        assert_eq!((errors.n_frames, errors.median, errors.percentile_90), (10, 0.5, 0.9));
        assert!((errors.within_two_radii - 0.6).abs() < 1e-9);
        assert!((errors.median_heading - (TAU - 6.2).to_degrees()).abs() < 1e-9);
        assert_eq!(PoseErrors::new(&[]), None);
    }
}
