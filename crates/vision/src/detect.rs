//! Keypoints: where a frame is described.

mod dense;
mod fast;
pub(crate) mod haar;
mod harris_laplace;
mod sift;
mod surf;

pub use dense::Dense;
pub use fast::{Fast, FastThreshold};
pub use harris_laplace::HarrisLaplace;
pub use sift::Sift;
pub use surf::Surf;

use crate::camera::View;
use crate::image::Image;
use crate::plane::{Levels, ScaleSpace};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// A point of a frame that is described.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keypoint {
    /// Column, in pixels of the image it was detected in.
    pub x: f32,
    /// Row, in pixels of the image it was detected in.
    pub y: f32,
    /// How much it stands out; detectors measure it differently.
    pub response: f32,
    /// The sigma of the Gaussian at which it stands out, in pixels; 1 where the detector looks at pixels.
    pub scale: f32,
    /// Which way its surroundings point, in radians from the x axis toward the y axis, from 0 to 2 pi;
    /// `None` where the detector does not say.
    pub angle: Option<f32>,
}

impl Keypoint {
    /// One of a detector that knows neither scale nor direction.
    pub fn new(x: f32, y: f32, response: f32) -> Self {
        Self { x, y, response, scale: 1.0, angle: None }
    }
}

/// A keypoint detector with its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Detector {
    /// FAST-9 corners.
    Fast(Fast),
    /// Blobs by the fast Hessian of SURF.
    Surf(Surf),
    /// Extrema of differences of Gaussians.
    Sift(Sift),
    /// Corners at their own scale.
    HarrisLaplace(HarrisLaplace),
    /// Points on a grid.
    Dense(Dense),
}

impl Default for Detector {
    fn default() -> Self {
        Self::Fast(Fast::default())
    }
}

impl Detector {
    /// The keypoints of `image` whose surroundings lie in the valid region of `view`, which was made for
    /// frames of this size. Row by row, from left to right.
    pub fn detect(&self, image: &Image, view: &View) -> Vec<Keypoint> {
        self.detect_with(image, view, &mut ScaleSpace::default())
    }

    /// The same; `space` becomes the scale space that keypoints were looked for in, if there are
    /// [`Detector::levels`], and is left alone otherwise.
    pub fn detect_with(&self, image: &Image, view: &View, space: &mut ScaleSpace) -> Vec<Keypoint> {
        match self {
            Self::Fast(fast) => fast.detect(image, view),
            Self::Surf(surf) => surf.detect(image, view),
            Self::Sift(sift) => sift.detect(image, view, space),
            Self::HarrisLaplace(harris) => harris.detect(image, view, space),
            Self::Dense(dense) => dense.detect(image, view),
        }
    }

    /// Of the scale space that keypoints are looked for in; `None` where it is the image alone.
    pub fn levels(&self) -> Option<Levels> {
        match self {
            Self::Fast(_) | Self::Surf(_) | Self::Dense(_) => None,
            Self::Sift(sift) => Some(sift.levels()),
            Self::HarrisLaplace(harris) => Some(harris.levels()),
        }
    }

    /// Whether it finds each point at several scales, as only descriptors tell apart that grow with these.
    pub fn repeats_points(&self) -> bool {
        matches!(self, Self::Dense(dense) if dense.scales.len() > 1)
    }

    /// The longest side of the frames that it looks at, where it has one of its own.
    pub fn longest_side(&self) -> Option<usize> {
        if let Self::Dense(dense) = self { Some(dense.longest_side) } else { None }
    }

    /// What is wrong with the parameters, if anything.
    pub fn check(&self) -> Result<(), String> {
        match self {
            Self::Fast(_) => Ok(()),
            Self::Surf(surf) => surf.check(),
            Self::Sift(sift) => sift.check(),
            Self::HarrisLaplace(harris) => harris.check(),
            Self::Dense(dense) => dense.check(),
        }
    }
}

/// What is wrong with a number of keypoints to keep, if anything.
fn check_target(target: usize) -> Result<(), String> {
    if !(1..=100_000).contains(&target) {
        return Err(format!("a detector's target must be from 1 to 100000 keypoints, not {target}"));
    }
    Ok(())
}

/// The `target` keypoints of highest response, highest first, ties in reading order.
pub(crate) fn keep_strongest(keypoints: &mut Vec<Keypoint>, target: usize) {
    keypoints.sort_by(|a, b| b.response.total_cmp(&a.response).then_with(|| in_reading_order(a, b)));
    keypoints.truncate(target);
}

/// Row by row, from left to right, from fine to coarse.
pub(crate) fn in_reading_order(a: &Keypoint, b: &Keypoint) -> Ordering {
    let angle = |keypoint: &Keypoint| keypoint.angle.unwrap_or(0.0);
    let place = a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x));
    place.then(a.scale.total_cmp(&b.scale)).then(angle(a).total_cmp(&angle(b)))
}

/// Calls `visit(x)` for each mark of a row that is not 0, from left to right.
fn for_each_marked(marks: &[u8], mut visit: impl FnMut(usize)) {
    // Most are 0: sixteen at a time are looked at first.
    const BLOCK: usize = 16;
    for (block_idx, block) in marks.chunks(BLOCK).enumerate() {
        if <[u8; BLOCK]>::try_from(block).is_ok_and(|block| u128::from_ne_bytes(block) == 0) {
            continue;
        }
        for (offset, _) in block.iter().enumerate().filter(|&(_, &mark)| mark != 0) {
            visit(block_idx * BLOCK + offset);
        }
    }
}

#[cfg(test)]
pub(crate) mod testing {
    use super::*;
    use crate::camera::{Camera, Projection};
    use rand::{Rng, SeedableRng};

    /// The side of [`blobs`].
    pub const SIDE: usize = 200;

    /// Dark and bright ellipses and half planes near them, turned by `angle` and scaled by `factor` round the
    /// middle; gray values are scaled by `light`.
    pub fn blobs(angle: f32, factor: f32, light: f32) -> Image {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let blobs: [[f32; 6]; 60] = std::array::from_fn(|_| {
            let mut between = |low: f32, high: f32| random.random_range(low..high);
            [
                between(-70.0, 70.0),
                between(-70.0, 70.0),
                between(2.0, 7.0),
                between(1.0, 1.6),
                between(-1.0, 1.0),
                between(0.0, 6.0),
            ]
        });
        let middle = SIDE as f32 / 2.0;
        let pixel = |idx: usize| {
            let (dx, dy) = ((idx % SIDE) as f32 - middle, (idx / SIDE) as f32 - middle);
            let x = (dx * angle.cos() + dy * angle.sin()) / factor;
            let y = (dy * angle.cos() - dx * angle.sin()) / factor;
            let mut gray = 0.0;
            for [center_x, center_y, size, stretch, sign, cut] in blobs {
                let (dx, dy) = ((x - center_x) / size, (y - center_y) / (size * stretch));
                // Cut off by a line, smoothly: corners and a direction.
                let side = 1.0 / (1.0 + (-size * 2.0 * (dx * cut.cos() + dy * cut.sin() + 0.3)).exp());
                gray += sign * side * (-(dx * dx + dy * dy)).exp();
            }
            (light * (128.0 + 110.0 * gray)).clamp(0.0, 255.0).round() as u8
        };
        Image::from_pixels(SIDE, SIDE, (0..SIDE * SIDE).map(pixel).collect()).unwrap()
    }

    /// In a view in which every pixel is valid.
    pub fn detect(detector: &Detector, image: &Image) -> Vec<Keypoint> {
        detector.detect(image, &Camera::new(Projection::Perspective).view(image.width(), image.height()))
    }

    /// The share of the keypoints of the upright blobs that are found again, at the right place and scale and,
    /// if they have one, with the right angle, when the blobs are turned and scaled and the light changes.
    pub fn repeatability(detector: &Detector, (angle, factor, light): (f32, f32, f32)) -> f32 {
        let keypoints = detect(detector, &blobs(0.0, 1.0, 1.0));
        let again = detect(detector, &blobs(angle, factor, light));
        let middle = SIDE as f32 / 2.0;
        let is_again = |keypoint: &&Keypoint| {
            let (dx, dy) = ((keypoint.x - middle) * factor, (keypoint.y - middle) * factor);
            let x = middle + dx * angle.cos() - dy * angle.sin();
            let y = middle + dy * angle.cos() + dx * angle.sin();
            again.iter().any(|found| {
                let turn = found.angle.unwrap_or(0.0) - keypoint.angle.map_or(0.0, |old| old + angle);
                (found.x - x).hypot(found.y - y) < 0.5 * found.scale
                    && (found.scale / (keypoint.scale * factor)).log2().abs() < 0.33
                    && turn.cos() > 0.95
            })
        };
        assert!(keypoints.len() >= 40, "{} keypoints", keypoints.len());
        keypoints.iter().filter(is_again).count() as f32 / keypoints.len() as f32
    }

    /// Smooth noise whose left and right edges meet, turned to the left by so many columns.
    pub fn panorama(width: usize, height: usize, turn: usize) -> Image {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let noise: Vec<u32> = (0..width * height).map(|_| random.random_range(0..256)).collect();
        let pixel = |idx: usize| {
            let (x, y) = (idx % width + turn, idx / width);
            let around = (0..16).map(|near| noise[(y + near / 4) % height * width + (x + near % 4) % width]);
            // More contrast than the mean of sixteen has.
            (4 * around.sum::<u32>() / 16).saturating_sub(384).min(255) as u8
        };
        Image::from_pixels(width, height, (0..width * height).map(pixel).collect()).unwrap()
    }

    /// Turning a panorama by whole pixels of all octaves turns the keypoints with it.
    pub fn assert_keypoints_turn_with_a_panorama(detector: &Detector) {
        const WIDTH: usize = 256;
        let view = Camera::new(Projection::Equirectangular).view(WIDTH, 128);
        let expected = detector.detect(&panorama(WIDTH, 128, 0), &view);
        for edge in [0.0..4.0, 252.0..256.0] {
            assert!(expected.iter().any(|found| edge.contains(&found.x)), "none at the edge {edge:?}");
        }
        for turn in [16, 64, 208] {
            let turned = detector.detect(&panorama(WIDTH, 128, turn), &view);
            assert_eq!(turned.len(), expected.len(), "turned by {turn}");
            for found in turned {
                assert!((0.0..=WIDTH as f32).contains(&found.x), "{found:?}");
                let is_it = |other: &&Keypoint| {
                    let columns = (other.x - found.x - turn as f32).rem_euclid(WIDTH as f32);
                    let angle = found.angle.unwrap_or(0.0) - other.angle.unwrap_or(0.0);
                    columns.min(WIDTH as f32 - columns) < 1e-3
                        && (other.y - found.y).abs() < 1e-3
                        && (other.scale - found.scale).abs() < 1e-3
                        && angle.cos() > 0.9999
                };
                assert!(expected.iter().any(|other| is_it(&other)), "turned by {turn}: {found:?}");
            }
        }
    }

    /// Images of any small size, with any kind of view, have only valid keypoints.
    pub fn assert_keypoints_are_valid(detector: &Detector, (width, height): (usize, usize), seed: u64) {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let pixels = (0..width * height).map(|_| 255 * random.random_range(0..2u8)).collect();
        let image = Image::from_pixels(width, height, pixels).unwrap();
        let mirror =
            crate::camera::Mirror { center_x: 0.5, center_y: 0.4, inner_radius: 0.1, outer_radius: 0.45 };
        for projection in
            [Projection::Perspective, Projection::Equirectangular, Projection::Omnidirectional(mirror)]
        {
            let view = Camera::new(projection).view(width, height);
            let keypoints = detector.detect(&image, &view);
            assert!(keypoints.iter().all(|found| view.contains(found.x, found.y, found.scale)));
            assert!(keypoints.is_sorted_by(|a, b| in_reading_order(a, b) != Ordering::Greater));
        }
    }
}
