//! The mirror of an omnidirectional camera, and finding it in frames.
//!
//! No data set publishes where its mirror lies. But what the mirror shows changes from frame to frame while
//! the robot drives, and what surrounds it, as well as the robot's own reflection in its middle, stays. So
//! the mirror is the ring of pixels that change.

use crate::image::Image;
use serde::{Deserialize, Serialize};

/// The longest side of the frames that the mirror is searched in.
const SEARCH_SIZE: usize = 160;

/// The ring of an omnidirectional frame that shows the world. All numbers are fractions of the frame's
/// width, so that they hold at any resolution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mirror {
    /// Column of the center.
    pub center_x: f32,
    /// Row of the center.
    pub center_y: f32,
    /// Where the robot's own reflection ends.
    pub inner_radius: f32,
    /// Where the mirror ends.
    pub outer_radius: f32,
}

impl Mirror {
    /// Offset of (x, y) from the center and its length, in pixels of a frame `width` pixels wide.
    pub fn polar(&self, x: f32, y: f32, width: usize) -> (f32, f32, f32) {
        let (dx, dy) = (x - self.center_x * width as f32, y - self.center_y * width as f32);
        (dx, dy, (dx * dx + dy * dy).sqrt())
    }

    /// Whether all numbers are finite and describe a ring with its center in the frame.
    pub fn is_valid(&self) -> bool {
        let in_frame = |position: f32| (0.0..=4.0).contains(&position);
        in_frame(self.center_x)
            && in_frame(self.center_y)
            && self.inner_radius >= 0.0
            && self.inner_radius < self.outer_radius
            && self.outer_radius <= 4.0
    }

    /// Finds the mirror in frames of one camera; some thirty from along a path are enough.
    ///
    /// `None` for fewer than two frames, frames of different sizes, or when no ring of changing pixels
    /// stands out.
    pub fn estimate(frames: &[Image]) -> Option<Self> {
        let activity = Activity::of(frames)?;
        let (width, height) = (activity.width as f32, activity.height as f32);
        let mut best = Circle { x: width / 2.0, y: height / 2.0, radius: 0.0, contrast: 0.0 };
        // Coarse to fine: the whole plausible range first, then finer steps round the best.
        for (reach, step) in [(0.2 * height, 4.0), (4.0, 1.0), (1.0, 0.25)] {
            best = activity.best_rim(&best, reach, step);
        }
        let noticeable = 0.25 * activity.mean();
        if best.contrast <= noticeable {
            return None;
        }
        let inner_radius = activity.own_reflection(&best, noticeable);
        Some(Self {
            center_x: best.x / width,
            center_y: best.y / width,
            inner_radius: inner_radius / width,
            // A pixel of the search is several of the frame: stay clear of the rim itself.
            outer_radius: (best.radius - 1.0) / width,
        })
    }
}

struct Circle {
    x: f32,
    y: f32,
    radius: f32,
    /// How much more changes just inside than just outside.
    contrast: f32,
}

/// The standard deviation of every pixel over time.
struct Activity {
    width: usize,
    height: usize,
    deviation: Vec<f32>,
}

impl Activity {
    fn of(frames: &[Image]) -> Option<Self> {
        let small: Vec<Image> = frames
            .iter()
            .map(|frame| frame.shrink_to(SEARCH_SIZE).unwrap_or_else(|| frame.clone()))
            .collect();
        let (first, rest) = small.split_first()?;
        let (width, height) = (first.width(), first.height());
        if rest.is_empty() || rest.iter().any(|frame| (frame.width(), frame.height()) != (width, height)) {
            return None;
        }
        let count = small.len() as f32;
        let deviation = (0..width * height).map(|pixel_idx| {
            let values = small.iter().map(|frame| f32::from(frame.pixels()[pixel_idx]));
            let mean = values.clone().sum::<f32>() / count;
            (values.map(|value| (value - mean) * (value - mean)).sum::<f32>() / count).sqrt()
        });
        Some(Self { width, height, deviation: deviation.collect() })
    }

    fn mean(&self) -> f32 {
        self.deviation.iter().sum::<f32>() / self.deviation.len() as f32
    }

    /// The strongest outer rim with its center within `reach` of `start`'s.
    fn best_rim(&self, start: &Circle, reach: f32, step: f32) -> Circle {
        let n_steps = (reach / step).ceil() as i32;
        let mut best = Circle { ..*start };
        for step_y in -n_steps..=n_steps {
            for step_x in -n_steps..=n_steps {
                let (x, y) = (start.x + step_x as f32 * step, start.y + step_y as f32 * step);
                let profile = self.radial_profile(x, y);
                for radius in self.height / 5..profile.len().saturating_sub(3) {
                    let band = |range: std::ops::Range<usize>| profile[range].iter().sum::<f32>() / 3.0;
                    let contrast = band(radius - 3..radius) - band(radius..radius + 3);
                    if contrast > best.contrast {
                        best = Circle { x, y, radius: radius as f32, contrast };
                    }
                }
            }
        }
        best
    }

    /// The radius up to which the middle of the mirror stays still; 0 when it does not.
    fn own_reflection(&self, rim: &Circle, noticeable: f32) -> f32 {
        let profile = self.radial_profile(rim.x, rim.y);
        let steps = 2..(rim.radius as usize / 2).min(profile.len().saturating_sub(2));
        let rise =
            |radius: usize| profile[radius] + profile[radius + 1] - profile[radius - 1] - profile[radius - 2];
        let mean = |rings: &[f32]| rings.iter().sum::<f32>() / rings.len().max(1) as f32;
        let is_still = |radius: usize| {
            rise(radius) / 2.0 > noticeable
                && mean(&profile[..radius]) < 0.5 * mean(&profile[radius..rim.radius as usize])
        };
        let strongest = steps.max_by(|&a, &b| rise(a).total_cmp(&rise(b)));
        // The last still ring, and one more for the blur of the boundary.
        strongest.filter(|&radius| is_still(radius)).map_or(0.0, |radius| radius as f32 + 1.0)
    }

    /// Mean activity at each whole radius round (x, y). Beyond the frame nothing changes.
    fn radial_profile(&self, x: f32, y: f32) -> Vec<f32> {
        const N_DIRECTIONS: usize = 72;
        let longest = self.width.max(self.height) / 2 + 4;
        let mut profile = vec![0.0; longest];
        for direction in 0..N_DIRECTIONS {
            let (sin, cos) = (direction as f32 * std::f32::consts::TAU / N_DIRECTIONS as f32).sin_cos();
            for (radius, sum) in profile.iter_mut().enumerate() {
                let column = (x + cos * radius as f32).round();
                let row = (y + sin * radius as f32).round();
                if column >= 0.0 && row >= 0.0 && column < self.width as f32 && row < self.height as f32 {
                    *sum += self.deviation[row as usize * self.width + column as usize];
                }
            }
        }
        profile.iter_mut().for_each(|sum| *sum /= N_DIRECTIONS as f32);
        profile
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Random blocks in a ring, still gray elsewhere.
    fn frames(mirror: &Mirror, n_frames: usize) -> Vec<Image> {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let (width, height) = (320, 240);
        let frame = |_| {
            let blocks: Vec<u8> = (0..40 * 30).map(|_| random.random()).collect();
            let pixel = |idx: usize| {
                let (x, y) = (idx % width, idx / width);
                let (_, _, radius) = mirror.polar(x as f32, y as f32, width);
                let radius = radius / width as f32;
                let moving = radius > mirror.inner_radius && radius < mirror.outer_radius;
                if moving { blocks[(y / 8) * 40 + x / 8] } else { 90 }
            };
            Image::from_pixels(width, height, (0..width * height).map(pixel).collect()).unwrap()
        };
        (0..n_frames).map(frame).collect()
    }

    #[test]
    fn finds_the_ring_of_changing_pixels() {
        for (center_x, center_y, inner_radius, outer_radius) in
            [(0.5, 0.375, 0.08, 0.33), (0.47, 0.4, 0.0, 0.3), (0.55, 0.36, 0.1, 0.34)]
        {
            let truth = Mirror { center_x, center_y, inner_radius, outer_radius };
            let found = Mirror::estimate(&frames(&truth, 24)).unwrap();
            let error = |a: f32, b: f32| (a - b).abs() * 640.0;
            assert!(error(found.center_x, center_x) < 6.0, "{found:?} for {truth:?}");
            assert!(error(found.center_y, center_y) < 6.0, "{found:?} for {truth:?}");
            assert!(error(found.outer_radius, outer_radius) < 12.0, "{found:?} for {truth:?}");
            assert!(error(found.inner_radius, inner_radius) < 14.0, "{found:?} for {truth:?}");
        }
    }

    #[test]
    fn still_or_missing_frames_have_no_mirror() {
        let still = Image::from_pixels(64, 48, vec![90; 64 * 48]).unwrap();
        assert_eq!(Mirror::estimate(&[still.clone(), still.clone(), still.clone()]), None);
        assert_eq!(Mirror::estimate(&[still]), None);
        assert_eq!(Mirror::estimate(&[]), None);
    }
}
