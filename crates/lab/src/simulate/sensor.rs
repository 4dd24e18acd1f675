//! From light to pixels: motion blur, the lens, exposure, noise.

use super::optics::{Optics, Sight};
use super::vector::{Color, gray};
use image::RgbImage;
use rand::RngCore;
use rand_chacha::ChaCha8Rng;

/// How a camera is set in one kind of light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exposure {
    /// For how long the shutter is open, in seconds.
    pub time: f32,
    /// The standard deviation of the noise, in gray levels.
    pub noise: f32,
    /// The most that the automatic gain gives.
    pub max_gain: f32,
    /// The white balance.
    pub balance: Color,
}

/// Makes a frame of the light on the sensor, row by row, while the robot turns at `turn_rate` radians a
/// second.
pub(super) fn develop(
    optics: &Optics,
    light: Vec<Color>,
    exposure: &Exposure,
    turn_rate: f32,
    rng: &mut ChaCha8Rng,
) -> RgbImage {
    let light = motion_blurred(optics, light, turn_rate * exposure.time);
    let light = softened(optics, &light);
    let gain = gain(optics, &light).min(exposure.max_gain);
    let mut noise = vec![0; 4 * light.len()];
    rng.fill_bytes(&mut noise);
    let half_diagonal = (optics.width as f32).hypot(optics.height as f32) / 2.0;
    let mut pixels = Vec::with_capacity(3 * light.len());
    for (idx, (&light, noise)) in light.iter().zip(noise.chunks_exact(4)).enumerate() {
        let [x, y] = [idx % optics.width, idx / optics.width].map(|at| at as f32 + 0.5);
        let squared =
            ((x - optics.center[0]).powi(2) + (y - optics.center[1]).powi(2)) / half_diagonal.powi(2);
        let exposed = light * exposure.balance * (gain * (1.0 - 0.35 * squared));
        // The sum of four bytes is about normal with a deviation of 148. The square root below makes
        // shot noise equal at all levels.
        let sum: f32 = noise.iter().map(|&byte| f32::from(byte)).sum();
        let shared = (sum - 510.0) / 148.0 * exposure.noise;
        let tinted = (f32::from(noise[0]) - f32::from(noise[1])) / 104.0 * exposure.noise * 0.5;
        let encode = |value: f32, noise: f32| (255.0 * tone(value).sqrt() + noise + 0.5) as u8;
        pixels.extend([
            encode(exposed.x, shared + tinted),
            encode(exposed.y, shared),
            encode(exposed.z, shared - tinted),
        ]);
    }
    RgbImage::from_raw(optics.width as u32, optics.height as u32, pixels).unwrap_or_default()
}

/// Linear up to two thirds, then ever flatter toward white.
fn tone(value: f32) -> f32 {
    const KNEE: f32 = 0.65;
    if value <= KNEE {
        value
    } else {
        let over = (value - KNEE) / (1.0 - KNEE);
        KNEE + (1.0 - KNEE) * over / (0.75 + over).max(1.0)
    }
}

/// Averages what the pixels saw while the robot turned by `angle`.
fn motion_blurred(optics: &Optics, light: Vec<Color>, angle: f32) -> Vec<Color> {
    let reach = 0.5 * optics.width as f32 * angle.abs();
    let n_taps = (reach.round() as usize).min(6) + 1;
    if n_taps == 1 {
        return light;
    }
    let seen = |idx: usize, share: f32| {
        let from =
            optics.before_turn([(idx % optics.width) as f32, (idx / optics.width) as f32], angle * share);
        let column = (from[0] + 0.5).clamp(0.0, (optics.width - 1) as f32) as usize;
        let row = (from[1] + 0.5).clamp(0.0, (optics.height - 1) as f32) as usize;
        light[row * optics.width + column]
    };
    let shares: Vec<f32> = (0..n_taps).map(|tap| tap as f32 / (n_taps - 1) as f32 - 0.5).collect();
    let blurred = |(idx, sight): (usize, &Sight)| match sight {
        Sight::World(_) => {
            shares.iter().fold(gray(0.0), |sum, &share| sum + seen(idx, share)) * (1.0 / n_taps as f32)
        }
        _ => light[idx],
    };
    optics.sights.iter().enumerate().map(blurred).collect()
}

/// What the lens spreads over neighboring pixels: a binomial filter of 3 x 3, one row after the other.
fn softened(optics: &Optics, light: &[Color]) -> Vec<Color> {
    let (width, height) = (optics.width, optics.height);
    let mix = |before: Color, here: Color, after: Color| before * 0.25 + here * 0.5 + after * 0.25;
    let mut across = Vec::with_capacity(light.len());
    for row in light.chunks_exact(width) {
        let at = |x: usize| mix(row[x.saturating_sub(1)], row[x], row[(x + 1).min(width - 1)]);
        across.extend((0..width).map(at));
    }
    let mut soft = Vec::with_capacity(light.len());
    for y in 0..height {
        let row = |y: usize| &across[y * width..][..width];
        let [above, here, below] = [row(y.saturating_sub(1)), row(y), row((y + 1).min(height - 1))];
        soft.extend((0..width).map(|x| mix(above[x], here[x], below[x])));
    }
    soft
}

/// The automatic gain: it brings the logarithmic mean of what is seen most of the way to a middle gray.
fn gain(optics: &Optics, light: &[Color]) -> f32 {
    const MIDDLE_GRAY: f32 = 0.2;
    const STRENGTH: f32 = 0.85;
    let (mut sum, mut n) = (0.0, 0.0);
    for (light, sight) in light.iter().zip(&optics.sights).step_by(7) {
        if *sight != Sight::Dark {
            sum += (light.mean() + 1e-3).ln();
            n += 1.0;
        }
    }
    let mean = (sum / f32::max(n, 1.0)).exp();
    (MIDDLE_GRAY / mean).powf(STRENGTH)
}
