//! Keypoints and what describes them.

use crate::vocabulary::Described;
use roomsight_vision::camera::Spot;
use roomsight_vision::detect::Keypoint;
use roomsight_vision::matrix::Matrix;

/// Keypoints and their descriptors.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalFeatures {
    /// In pixels of the frame at working size.
    pub keypoints: Vec<Keypoint>,
    /// One row a keypoint, of unit length or zero.
    pub descriptors: Matrix,
    /// Where the keypoints lie in what the camera sees.
    pub spots: Vec<Spot>,
}

impl LocalFeatures {
    /// None at all, of so many numbers each.
    pub(crate) fn nothing(n_dimensions: usize) -> Self {
        Self { keypoints: Vec::new(), descriptors: Matrix::new(n_dimensions), spots: Vec::new() }
    }

    /// What a vocabulary sees.
    pub fn described(&self) -> Described<'_> {
        Described { descriptors: &self.descriptors, spots: &self.spots }
    }
}
