//! Descriptors: what the surroundings of a keypoint look like, as a row of numbers.

mod cells;
mod circle;
mod cs_lbp;
mod lbp;
mod region;

pub use cs_lbp::CsLbp;
pub use lbp::Lbp;
pub use region::{Region, Weighting};

use crate::camera::View;
use crate::detect::Keypoint;
use crate::image::Image;
use crate::matrix::Matrix;
use serde::{Deserialize, Serialize};

/// A descriptor with its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Descriptor {
    /// Uniform local binary patterns.
    Lbp(Lbp),
    /// Center-symmetric local binary patterns.
    CsLbp(CsLbp),
}

impl Default for Descriptor {
    fn default() -> Self {
        Self::CsLbp(CsLbp::default())
    }
}

impl Descriptor {
    /// One row of unit L2 length a keypoint, in their order.
    ///
    /// Regions lie along the radial direction in frames of a mirror, upright in others. What lies outside
    /// the valid region of `view` does not count.
    pub fn describe(&self, image: &Image, keypoints: &[Keypoint], view: &View) -> Matrix {
        match self {
            Self::Lbp(lbp) => lbp.describe(image, keypoints, view),
            Self::CsLbp(cs_lbp) => cs_lbp.describe(image, keypoints, view),
        }
    }

    /// The length of a row.
    pub fn n_dimensions(&self) -> usize {
        match self {
            Self::Lbp(lbp) => lbp.n_dimensions(),
            Self::CsLbp(cs_lbp) => cs_lbp.n_dimensions(),
        }
    }

    /// What is wrong with the parameters, if anything.
    pub fn check(&self) -> Result<(), String> {
        match self {
            Self::Lbp(lbp) => lbp.check(),
            Self::CsLbp(cs_lbp) => cs_lbp.check(),
        }
    }
}

/// What is wrong with parameters that all descriptors over circles and cells have, if anything.
fn check_circle(radius: f32, n_cells: usize, region: &Region) -> Result<(), String> {
    if !(1.0..=8.0).contains(&radius) {
        return Err(format!("the radius of a descriptor's circle must be from 1 to 8 pixels, not {radius}"));
    }
    if !(1..=8).contains(&n_cells) {
        return Err(format!("a descriptor's region has 1 to 8 cells a side, not {n_cells}"));
    }
    region.check(n_cells)
}

#[cfg(test)]
mod testing {
    use super::*;
    use crate::camera::{Camera, Projection};
    use rand::{Rng, SeedableRng};

    /// Pixels without any structure.
    pub fn noise(width: usize, height: usize) -> Image {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let pixels = (0..width * height).map(|_| random.random()).collect();
        Image::from_pixels(width, height, pixels).unwrap()
    }

    /// A view in which every pixel is valid.
    pub fn whole(image: &Image) -> View {
        Camera::new(Projection::Perspective).view(image.width(), image.height())
    }

    /// Bilinear interpolation as in a textbook.
    pub fn smooth_at(image: &Image, x: f32, y: f32) -> f32 {
        let at = |x: f32, y: f32| f32::from(image.row(y as usize)[x as usize]);
        let (left, top) = ((x + 1e-4).floor(), (y + 1e-4).floor());
        let (right, bottom) = ((x - left).max(0.0), (y - top).max(0.0));
        let row = |y: f32| at(left, y) * (1.0 - right) + at(left + 1.0, y) * right;
        row(top) * (1.0 - bottom) + row(top + 1.0) * bottom
    }
}
