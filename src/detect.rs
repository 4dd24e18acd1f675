//! Keypoints: where a frame is described.

mod fast;
pub(crate) mod haar;
mod surf;

pub use fast::{Fast, FastThreshold};
pub use surf::Surf;

use crate::camera::View;
use crate::image::Image;
use serde::{Deserialize, Serialize};

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
        }
    }

    /// What is wrong with the parameters, if anything.
    pub fn check(&self) -> Result<(), String> {
        match self {
            Self::Fast(_) => Ok(()),
            Self::Surf(surf) => surf.check(),
        }
    }
}

/// The `target` keypoints of largest response, ties to the first, row by row and from left to right.
fn strongest(mut keypoints: Vec<Keypoint>, target: usize) -> Vec<Keypoint> {
    let by_place = |a: &Keypoint, b: &Keypoint| a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x));
    keypoints.sort_by(|a, b| b.response.total_cmp(&a.response).then_with(|| by_place(a, b)));
    keypoints.truncate(target);
    keypoints.sort_by(by_place);
    keypoints
}
