//! Descriptors: what the surroundings of a keypoint look like, as a row of numbers; [`FrameLbp`]: what a whole
//! frame looks like.

mod cells;
mod circle;
mod code_sums;
mod codes;
mod cs_lbp;
mod frame_lbp;
mod lbp;
mod region;
mod sift;
mod surf;

pub use cs_lbp::CsLbp;
pub use frame_lbp::{FrameLbp, Sections};
pub use lbp::Lbp;
pub use region::{Region, Weighting};
pub use sift::SiftDescriptor;
pub use surf::SurfDescriptor;

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
    /// Histograms of gradients.
    Sift(SiftDescriptor),
    /// Sums of Haar responses, as in SURF.
    Surf(SurfDescriptor),
}

impl Default for Descriptor {
    fn default() -> Self {
        Self::CsLbp(CsLbp::default())
    }
}

impl Descriptor {
    /// One row of unit L2 length a keypoint, in their order.
    ///
    /// Regions lie along the radial direction in frames of a mirror, upright in others; those of SIFT and SURF
    /// along the direction of their keypoint, if it has one. What lies outside the valid region of `view`
    /// does not count. A row without anything that counts is zero.
    pub fn describe(&self, image: &Image, keypoints: &[Keypoint], view: &View) -> Matrix {
        match self {
            Self::Lbp(lbp) => lbp.describe(image, keypoints, view),
            Self::CsLbp(cs_lbp) => cs_lbp.describe(image, keypoints, view),
            Self::Sift(sift) => sift.describe(image, keypoints, view),
            Self::Surf(surf) => surf.describe(image, keypoints, view),
        }
    }

    /// The corners of the square round `keypoint` that is described, in order.
    pub fn square(&self, keypoint: &Keypoint, view: &View) -> [(f32, f32); 4] {
        let (half, right) = match self {
            Self::Lbp(lbp) => {
                (lbp.region.side_at(keypoint, lbp.n_cells) as f32 / 2.0, right_of(keypoint, view))
            }
            Self::CsLbp(cs_lbp) => {
                (cs_lbp.region.side_at(keypoint, cs_lbp.n_cells) as f32 / 2.0, right_of(keypoint, view))
            }
            Self::Sift(sift) => sift.square(keypoint, view),
            Self::Surf(_) => SurfDescriptor::square(keypoint, view),
        };
        [(-half, -half), (half, -half), (half, half), (-half, half)].map(|(along, across)| {
            (keypoint.x + along * right.0 - across * right.1, keypoint.y + along * right.1 + across * right.0)
        })
    }

    /// The length of a row.
    pub fn n_dimensions(&self) -> usize {
        match self {
            Self::Lbp(lbp) => lbp.n_dimensions(),
            Self::CsLbp(cs_lbp) => cs_lbp.n_dimensions(),
            Self::Sift(_) => SiftDescriptor::n_dimensions(),
            Self::Surf(surf) => surf.n_dimensions(),
        }
    }

    /// Whether what is described grows with the scale of a keypoint.
    pub fn is_scaled(&self) -> bool {
        match self {
            Self::Lbp(lbp) => lbp.region.scaled,
            Self::CsLbp(cs_lbp) => cs_lbp.region.scaled,
            Self::Sift(_) | Self::Surf(_) => true,
        }
    }

    /// What is wrong with the parameters, if anything.
    pub fn check(&self) -> Result<(), String> {
        match self {
            Self::Lbp(lbp) => lbp.check(),
            Self::CsLbp(cs_lbp) => cs_lbp.check(),
            Self::Sift(sift) => sift.check(),
            Self::Surf(_) => Ok(()),
        }
    }
}

/// Which way the rows of a region run round a keypoint without a direction: upright, or so that its columns
/// lie along the radial direction.
fn right_of(keypoint: &Keypoint, view: &View) -> (f32, f32) {
    view.radial_direction(keypoint.x, keypoint.y).map_or((1.0, 0.0), |(down_x, down_y)| (down_y, -down_x))
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
