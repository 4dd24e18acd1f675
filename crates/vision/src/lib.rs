//! Frames of cameras to local features and the outputs of neural networks.
//!
//! ```no_run
//! use roomsight_vision::camera::{Camera, Projection};
//! use roomsight_vision::detect::{Detector, Fast};
//! use roomsight_vision::image::{Image, Limits};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let image = Image::decode(&std::fs::read("frame.jpg")?, &Limits::default())?;
//! let view = Camera::new(Projection::Perspective).view(image.width(), image.height());
//! let keypoints = Detector::Fast(Fast::default()).detect(&image, &view);
//! # drop(keypoints);
//! # Ok(()) }
//! ```
//!
//! | module | what |
//! |---|---|
//! | [`matrix`] | rows of numbers |
//! | [`simd`] | fast loops over numbers and pixels, the same numbers on every CPU |
//! | [`sketch`] | the nearest of many vectors |
//! | [`image`] | encoded frames to pixels |
//! | [`camera`], [`plane`] | where pixels are valid; gray values at many scales |
//! | [`detect`] | keypoints |
//! | [`describe`], [`network`] | keypoints to descriptors; neural networks as a source of features |
//!
//! Each uses those before it. They know no async, no HTTP, no clock and no hidden randomness.

pub mod matrix;

pub mod simd;

pub mod sketch;

pub mod image;

pub mod camera;
pub mod plane;

pub mod detect;

pub mod describe;
pub mod network;
