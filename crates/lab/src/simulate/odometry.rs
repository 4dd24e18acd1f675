//! Where the robot's wheels say that it is: right from step to step, and farther off with each.

use super::laser::normal;
use super::{Pose, Simulation, seeded, wrapped};

/// By how much the wheels are larger or smaller than they are taken for, as a share: the deviation from drive to drive.
const SCALE: f32 = 0.015;

/// How much the heading is off after a meter and after a radian, in radians: the deviation.
const TURN_A_METER: f32 = 0.02;
const TURN_A_RADIAN: f32 = 0.03;

/// Tells its errors from the noise of the other sensors.
const ERROR_KEY: u64 = 102;

impl Simulation {
    /// The pose by odometry at each frame, in coordinates that begin with the drive.
    pub fn odometry(&self) -> Vec<Pose> {
        let mut errors = seeded(&[&self.spec.run_key()[..], &[ERROR_KEY]].concat());
        let scale = 1.0 + SCALE * normal(&mut errors);
        let mut poses = vec![Pose { x: 0.0, y: 0.0, heading: 0.0 }];
        for frame_idx in 1..self.n_frames() {
            let [before, after] = [frame_idx - 1, frame_idx].map(|idx| self.pose(idx));
            let way = (after.x - before.x).hypot(after.y - before.y);
            let turn = wrapped(after.heading - before.heading);
            let error = normal(&mut errors) * (TURN_A_METER * way.sqrt() + TURN_A_RADIAN * turn.abs());
            let last = poses[frame_idx - 1];
            // Half of the turn comes before the way, as on an arc.
            let (sin, cos) = (last.heading + (turn + error) / 2.0).sin_cos();
            let (x, y) = (last.x + scale * way * cos, last.y + scale * way * sin);
            poses.push(Pose { x, y, heading: wrapped(last.heading + turn + error) });
        }
        poses
    }
}
