//! What the robot's laser measures.

use super::vector::vec3;
use super::{Simulation, seeded};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Beams of half a circle ahead, from right to left, as of the scanner of COLD's robots.
const N_BEAMS: usize = 181;

/// Where it sits: ahead of the middle of the robot, and above the floor, in meters.
const AHEAD: f32 = 0.15;
const HEIGHT: f32 = 0.33;

/// The farthest that it measures, in meters.
const MAX_RANGE: f32 = 30.0;

/// The deviation of its ranges, in meters, and the share of beams that come back from nowhere.
const NOISE: f32 = 0.012;
const LOST: f64 = 0.004;

/// Tells its noise from that of the cameras.
const NOISE_KEY: u64 = 101;

impl Simulation {
    /// How far each beam of the laser reaches when a frame is taken, in meters; none where nothing comes back.
    pub fn scan(&self, frame_idx: usize) -> Vec<Option<f32>> {
        let distance = self.distance(frame_idx);
        let pose = self.trajectory.pose_at(distance);
        let person = self.person(distance);
        let (sin, cos) = pose.heading.sin_cos();
        let origin = vec3(pose.x + cos * AHEAD, pose.y + sin * AHEAD, HEIGHT);
        let mut noise = seeded(&[&self.spec.run_key()[..], &[NOISE_KEY, frame_idx as u64]].concat());
        let beam = |beam: usize| {
            let angle = pose.heading + (beam as f32).to_radians() - std::f32::consts::FRAC_PI_2;
            let direction = vec3(angle.cos(), angle.sin(), 0.0);
            let range = self.scene.reach(origin, direction, MAX_RANGE, person.as_ref());
            let is_lost = noise.random_bool(LOST);
            let measured = range.map(|range| (range + NOISE * normal(&mut noise)).max(0.02));
            measured.filter(|_| !is_lost)
        };
        (0..N_BEAMS).map(beam).collect()
    }
}

/// A number of the standard normal distribution, by Box and Muller (1958).
pub(super) fn normal(rng: &mut ChaCha8Rng) -> f32 {
    let [radius, angle] =
        [rng.random_range(f32::MIN_POSITIVE..1.0), rng.random_range(0.0..std::f32::consts::TAU)];
    (-2.0 * radius.ln()).sqrt() * angle.cos()
}
