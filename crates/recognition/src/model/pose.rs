//! Where a frame was taken, told by where the frames were taken that are most like it.

use crate::filter::{Interval, Motion};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Where a robot stood, in the coordinates that all drives of a model share.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Meters.
    pub x: f64,
    /// Meters.
    pub y: f64,
    /// Heading in radians, counterclockwise from the x axis.
    pub angle: f64,
}

impl Pose {
    /// Whether all of it is a number.
    pub fn is_finite(&self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.angle.is_finite()
    }

    /// In meters.
    pub fn distance(&self, other: &Self) -> f64 {
        (self.x - other.x).hypot(self.y - other.y)
    }
}

impl Motion {
    /// From one pose to another, in the same coordinates. `None` where one is no number.
    pub fn between(from: &Pose, to: &Pose) -> Option<Self> {
        let turn = (to.angle - from.angle).rem_euclid(TAU);
        let is_known = from.is_finite() && to.is_finite();
        is_known.then(|| Self { meters: from.distance(to), radians: turn.min(TAU - turn) })
    }
}

impl Interval {
    /// So many seconds, and the way from one pose to another where both are known.
    pub fn between(seconds: f64, from: Option<Pose>, to: Option<Pose>) -> Self {
        let motion = from.zip(to).and_then(|(from, to)| Motion::between(&from, &to));
        Self { seconds, motion }
    }
}

/// Where a frame was taken, more or less.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseEstimate {
    /// The best guess.
    pub pose: Pose,
    /// How far off the frames that are most like it lie, in meters: the mean of their distances, weighed by how alike they are.
    pub radius: f64,
}

/// A place to vote for, and how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Vote {
    pub(crate) pose: Pose,
    /// Not negative.
    pub(crate) weight: f64,
}

/// Steps to the geometric median.
const N_STEPS: usize = 30;

/// Meters below which a step no longer counts a vote more for being nearer.
const NEAREST: f64 = 0.05;

impl PoseEstimate {
    /// The weighted geometric median of votes by Weiszfeld's method ("Sur le point pour lequel la somme des distances de n
    /// points donnés est minimum", Tohoku Mathematical Journal 1937), so that single votes for far places count little. The
    /// heading is the mean direction of the votes near it. `None` without weight.
    pub(crate) fn of(votes: &[Vote]) -> Option<Self> {
        let weight: f64 = votes.iter().map(|vote| vote.weight).sum();
        if !(weight > 0.0 && weight.is_finite()) {
            return None;
        }
        let mean = |weight_of: &dyn Fn(&Vote) -> f64| {
            let sum = votes.iter().map(weight_of).sum::<f64>();
            let of = |part: fn(&Pose) -> f64| {
                votes.iter().map(|vote| weight_of(vote) * part(&vote.pose)).sum::<f64>() / sum
            };
            Pose {
                x: of(|pose| pose.x),
                y: of(|pose| pose.y),
                angle: of(|pose| pose.angle.sin()).atan2(of(|pose| pose.angle.cos())),
            }
        };
        let mut pose = mean(&|vote| vote.weight);
        for _ in 0..N_STEPS {
            let from = pose;
            pose = mean(&|vote| vote.weight / vote.pose.distance(&from).max(NEAREST));
        }
        let off: f64 = votes.iter().map(|vote| vote.weight * vote.pose.distance(&pose)).sum();
        Some(Self { pose, radius: off / weight })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn vote(x: f64, y: f64, angle: f64, weight: f64) -> Vote {
        Vote { pose: Pose { x, y, angle }, weight }
    }

    #[test]
    fn votes_near_each_other_win_over_far_ones() {
        let near = [vote(1.0, 1.0, 3.1, 1.0), vote(1.2, 1.0, -3.1, 1.0), vote(1.1, 1.2, PI, 1.0)];
        let far = vote(9.0, 1.0, 0.0, 1.0);
        let PoseEstimate { pose, radius } = PoseEstimate::of(&[&near[..], &[far]].concat()).unwrap();
        assert!((pose.x - 1.1).abs() < 0.1 && (pose.y - 1.05).abs() < 0.1, "{pose:?}");
        assert!(pose.angle.abs() > 3.0, "headings meet at the half turn: {pose:?}");
        assert!((1.5..2.5).contains(&radius), "{radius}");
        let sure = PoseEstimate::of(&near[..1]).unwrap();
        assert!(sure.pose.distance(&near[0].pose) < 1e-9 && sure.radius < 1e-9);
    }

    #[test]
    fn without_votes_nothing_is_said() {
        assert_eq!(PoseEstimate::of(&[]), None);
        assert_eq!(PoseEstimate::of(&[vote(1.0, 1.0, 0.0, 0.0)]), None);
    }
}
