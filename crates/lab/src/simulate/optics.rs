//! The robot's two cameras: which way each pixel looks.
//!
//! The perspective camera is a pinhole. The omnidirectional one is a pinhole that looks up into a
//! hyperbolic mirror. A hyperboloid of two sheets with the pinhole in one focus reflects every ray that
//! aims for the other focus F into the pinhole, so that all pixels see the world from the single point F
//! (Baker and Nayar, *A Theory of Single-Viewpoint Catadioptric Image Formation*, IJCV 1999). With F as
//! the origin, z up and e = sqrt(a^2 + b^2), the mirror is
//!
//! ```text
//! (z + e)^2 / a^2 - (x^2 + y^2) / b^2 = 1,   z > -e,
//! ```
//!
//! the pinhole is C = (0, 0, -2e), and the line of sight w = (u, v, f) from C meets it at C + lambda w with
//! lambda = b^2 (e f + a |w|) / (b^2 f^2 - a^2 (u^2 + v^2)) (Svoboda, Pajdla and Hlavac, *Epipolar
//! Geometry for Panoramic Cameras*, ECCV 1998).

use super::CameraKind;
use super::vector::{Color, Vec3, gray, vec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// What a pixel sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sight {
    /// Nothing: outside of the mirror.
    Dark,
    /// The robot or the rim of the mirror: a surface of this albedo.
    Robot(Color),
    /// The world in this direction: x ahead, y to the left, z up.
    World(Vec3),
}

/// A camera on the robot.
pub(super) struct Optics {
    pub kind: CameraKind,
    pub width: usize,
    pub height: usize,
    /// Row by row.
    pub sights: Vec<Sight>,
    /// Where the single viewpoint is: ahead of the robot's center and above the floor, in meters.
    pub mount: [f32; 2],
    /// The angle that a pixel covers, in radians.
    pub spread: f32,
    /// The point that vignetting and motion blur go round, in pixels.
    pub center: [f32; 2],
    /// The focal length in pixels.
    focal: f32,
}

/// The longer half axis a and the other b of the mirror, in millimeters.
const MIRROR: [f32; 2] = [28.0, 23.0];
/// The radius of the mirror, in millimeters.
const RIM: f32 = 30.0;

impl Optics {
    /// A camera with frames of this size; the mirror's center is a little off, as mounted in this lab.
    pub fn new(kind: CameraKind, [width, height]: [usize; 2], rng: &mut ChaCha8Rng) -> Self {
        match kind {
            CameraKind::Perspective => Self::perspective([width, height], rng),
            CameraKind::Omnidirectional => Self::omnidirectional([width, height], rng),
        }
    }

    /// 84.9 degrees across and 68.9 from top to bottom at an aspect of 4 : 3, looking ahead.
    fn perspective([width, height]: [usize; 2], rng: &mut ChaCha8Rng) -> Self {
        let focal = width as f32 / 2.0 / (84.9_f32.to_radians() / 2.0).tan();
        let tilt = rng.random_range(-0.04_f32..0.02);
        let center = [width as f32 / 2.0, height as f32 / 2.0];
        let sight = |u: f32, v: f32| {
            let (x, z) = (focal, -v);
            Sight::World(
                vec3(x * tilt.cos() - z * tilt.sin(), -u, x * tilt.sin() + z * tilt.cos()).normalized(),
            )
        };
        let mount = [0.15, rng.random_range(1.1..1.3)];
        let sights = sights([width, height], center, sight);
        let kind = CameraKind::Perspective;
        Self { kind, width, height, sights, mount, spread: 1.0 / focal, center, focal }
    }

    /// Looks straight up, the top of the frame ahead: the world is mirrored, as in all such cameras.
    fn omnidirectional([width, height]: [usize; 2], rng: &mut ChaCha8Rng) -> Self {
        let radius = 0.465 * height as f32;
        let [a, b] = MIRROR;
        let e = a.hypot(b);
        let rim_height = -e + a * (1.0 + (RIM / b).powi(2)).sqrt();
        let focal = radius * (rim_height + 2.0 * e) / RIM;
        let off = height as f32 * 0.016;
        let center = [
            width as f32 / 2.0 + rng.random_range(-off..off),
            height as f32 / 2.0 + rng.random_range(-off..off),
        ];
        let deck = Deck::draw(rng);
        let sight = |u: f32, v: f32| {
            let from_center = u.hypot(v);
            if from_center > radius * 1.018 {
                return Sight::Dark;
            }
            if from_center > radius {
                return Sight::Robot(gray(0.25));
            }
            let direction = mirror_point(vec3(-v, u, focal)).normalized();
            deck.albedo(direction).map_or(Sight::World(direction), Sight::Robot)
        };
        let mount = [-0.05, rng.random_range(1.05..1.2)];
        let sights = sights([width, height], center, sight);
        // From the middle to the rim the mirror shows about 1.9 radians.
        let spread = 1.9 / radius;
        let kind = CameraKind::Omnidirectional;
        Self { kind, width, height, sights, mount, spread, center, focal }
    }

    /// The pixel that saw, before the robot turned left by `angle`, what pixel (x, y) sees now.
    pub fn before_turn(&self, [x, y]: [f32; 2], angle: f32) -> [f32; 2] {
        match self.kind {
            // Exact in the middle, and near enough beside it for the small angles of one exposure.
            CameraKind::Perspective => [x - self.focal * angle, y],
            CameraKind::Omnidirectional => {
                let [u, v] = [x - self.center[0], y - self.center[1]];
                let (sin, cos) = angle.sin_cos();
                [self.center[0] + cos * u - sin * v, self.center[1] + sin * u + cos * v]
            }
        }
    }
}

/// Evaluates `sight` at all pixel centers, relative to the optical center.
fn sights([width, height]: [usize; 2], center: [f32; 2], sight: impl Fn(f32, f32) -> Sight) -> Vec<Sight> {
    let at = |idx: usize| {
        let [x, y] = [idx % width, idx / width].map(|at| at as f32 + 0.5);
        sight(x - center[0], y - center[1])
    };
    (0..width * height).map(at).collect()
}

/// Where a line of sight from the pinhole meets the mirror, relative to the mirror's focus; also the
/// direction in which the mirror shows the world there.
fn mirror_point(w: Vec3) -> Vec3 {
    let [a, b] = MIRROR;
    let e = a.hypot(b);
    let lambda = b * b * (e * w.z + a * w.length()) / (b * b * w.z * w.z - a * a * (w.x * w.x + w.y * w.y));
    w * lambda + vec3(0.0, 0.0, -2.0 * e)
}

/// What of the robot is seen in the mirror: the camera below it and the top of the robot, in meters.
struct Deck {
    /// Least x and y, greatest x and y of a laptop.
    laptop: [f32; 4],
    radius: f32,
    depth: f32,
}

impl Deck {
    fn draw(rng: &mut ChaCha8Rng) -> Self {
        let [x, y] = [rng.random_range(-0.2..-0.05), rng.random_range(-0.12..0.0)];
        let laptop = [x, y, x + 0.22, y + 0.26];
        Self { laptop, radius: rng.random_range(0.22..0.27), depth: rng.random_range(0.42..0.55) }
    }

    /// The albedo of the robot in a direction from the mirror's focus.
    fn albedo(&self, direction: Vec3) -> Option<Color> {
        if direction.z >= -0.05 {
            return None;
        }
        let [x, y] = [direction.x, direction.y].map(|at| at / -direction.z);
        let camera = x.hypot(y) * 0.0725;
        if camera < 0.03 {
            let is_lens = camera < 0.016;
            let is_ring = (0.018..0.021).contains(&camera);
            return Some(gray(if is_lens {
                0.01
            } else if is_ring {
                0.3
            } else {
                0.06
            }));
        }
        let [x, y] = [x * self.depth, y * self.depth];
        let from_axis = x.hypot(y);
        if from_axis > self.radius {
            return None;
        }
        let [x0, y0, x1, y1] = self.laptop;
        if (x0..x1).contains(&x) && (y0..y1).contains(&y) {
            let is_edge = (x - x0).min(x1 - x).min(y - y0).min(y1 - y) < 0.012;
            let is_key = ((x - x0) * 55.0).fract() > 0.3 && ((y - y0) * 50.0).fract() > 0.25;
            return Some(gray(if is_edge {
                0.3
            } else if is_key {
                0.03
            } else {
                0.12
            }));
        }
        Some(if from_axis > self.radius - 0.02 { gray(0.08) } else { vec3(0.45, 0.12, 0.08) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::seeded;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_ray_that_aims_for_the_focus_is_reflected_into_the_pinhole(
            angle in 0.0_f32..std::f32::consts::TAU, from_axis in 0.01_f32..0.42,
        ) {
            let w = vec3(angle.cos() * from_axis, angle.sin() * from_axis, 1.0);
            let point = mirror_point(w);
            let [a, b] = MIRROR;
            let e = a.hypot(b);
            let on_mirror = ((point.z + e) / a).powi(2) - (point.x.hypot(point.y) / b).powi(2);
            prop_assert!((on_mirror - 1.0).abs() < 1e-3, "not on the mirror: {on_mirror}");
            prop_assert!(point.z > -e, "on the other sheet: {point:?}");
            // The gradient of the hyperboloid's equation.
            let normal = vec3(-point.x / (b * b), -point.y / (b * b), (point.z + e) / (a * a)).normalized();
            let incoming = -point.normalized();
            let reflected = incoming - normal * (2.0 * incoming.dot(normal));
            let to_pinhole = (vec3(0.0, 0.0, -2.0 * e) - point).normalized();
            prop_assert!((reflected - to_pinhole).length() < 1e-3, "{reflected:?} {to_pinhole:?}");
        }
    }

    #[test]
    fn the_perspective_camera_has_the_angles_of_the_robots() {
        let camera = Optics::new(CameraKind::Perspective, [640, 480], &mut seeded(&[1]));
        let direction = |idx: usize| match camera.sights[idx] {
            Sight::World(direction) => direction,
            other => panic!("{other:?}"),
        };
        let across = direction(240 * 640).dot(direction(240 * 640 + 639)).acos().to_degrees();
        let down = direction(320).dot(direction(479 * 640 + 320)).acos().to_degrees();
        assert!((across - 84.9).abs() < 0.3 && (down - 68.9).abs() < 0.3, "{across} {down}");
    }

    #[test]
    fn the_mirror_shows_itself_in_the_middle_the_world_round_it_and_nothing_outside() {
        let camera = Optics::new(CameraKind::Omnidirectional, [640, 480], &mut seeded(&[1]));
        let sight = |x: f32, y: f32| {
            let [column, row] = [camera.center[0] + x, camera.center[1] + y].map(|at| at as usize);
            camera.sights[row * 640 + column]
        };
        assert!(matches!(sight(0.0, 0.0), Sight::Robot(_)));
        assert!(matches!(sight(-300.0, 0.0), Sight::Dark));
        let Sight::World(above) = sight(0.0, -150.0) else { panic!("the world is shown round the middle") };
        assert!(above.x > 0.8, "the top of the frame is ahead of the robot: {above:?}");
        let Sight::World(rim) = sight(220.0, 0.0) else { panic!("the mirror reaches that far") };
        assert!(rim.z > 0.1 && rim.y > 0.8, "at the rim it shows what is above the horizon: {rim:?}");
    }
}
