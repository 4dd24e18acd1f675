//! Keypoints: where a frame is described.

mod fast;

pub use fast::{Fast, FastThreshold};

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
    /// How much it stands out; the scale differs between detectors.
    pub response: f32,
}

/// A keypoint detector with its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Detector {
    /// FAST-9 corners.
    Fast(Fast),
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
        }
    }
}
