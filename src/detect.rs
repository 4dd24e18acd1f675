//! Keypoints: where a frame is described.

mod fast;
pub(crate) mod haar;
mod harris_laplace;
mod sift;
mod surf;

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
        match self {
            Self::Fast(fast) => fast.detect(image, view),
            Self::Surf(surf) => surf.detect(image, view),
            Self::Sift(sift) => sift.detect(&scale_space(image, sift.levels()), view),
            Self::HarrisLaplace(harris) => harris.detect(&scale_space(image, harris.levels()), view),
        }
    }

    /// What is wrong with the parameters, if anything.
    pub fn check(&self) -> Result<(), String> {
        match self {
            Self::Fast(_) => Ok(()),
            Self::Surf(surf) => surf.check(),
            Self::Sift(sift) => sift.check(),
            Self::HarrisLaplace(harris) => harris.check(),
        }
    }
}

fn scale_space(image: &Image, levels: Levels) -> ScaleSpace {
    let mut space = ScaleSpace::default();
    space.build(image, levels, f32::INFINITY);
    space
}

/// What is wrong with a number of keypoints to keep, if anything.
fn check_target(target: usize) -> Result<(), String> {
    if !(1..=100_000).contains(&target) {
        return Err(format!("a detector's target must be from 1 to 100000 keypoints, not {target}"));
    }
    Ok(())
}

/// The `target` keypoints of highest response, highest first, ties in reading order.
fn keep_strongest(keypoints: &mut Vec<Keypoint>, target: usize) {
    keypoints.sort_by(|a, b| b.response.total_cmp(&a.response).then_with(|| in_reading_order(a, b)));
    keypoints.truncate(target);
}

/// Row by row, from left to right, from fine to coarse.
fn in_reading_order(a: &Keypoint, b: &Keypoint) -> Ordering {
    let angle = |keypoint: &Keypoint| keypoint.angle.unwrap_or(0.0);
    let place = a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x));
    place.then(a.scale.total_cmp(&b.scale)).then(angle(a).total_cmp(&angle(b)))
}

/// Calls `visit(x, mark)` for each mark of a row that is not 0, from left to right.
fn for_each_marked(marks: &[u8], mut visit: impl FnMut(usize, u8)) {
    // Most are 0: sixteen at a time are looked at first.
    const BLOCK: usize = 16;
    for (block_idx, block) in marks.chunks(BLOCK).enumerate() {
        if <[u8; BLOCK]>::try_from(block).is_ok_and(|block| u128::from_ne_bytes(block) == 0) {
            continue;
        }
        for (offset, &mark) in block.iter().enumerate().filter(|&(_, &mark)| mark != 0) {
            visit(block_idx * BLOCK + offset, mark);
        }
    }
}
