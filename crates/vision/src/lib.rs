//! Frames of cameras to local features and the outputs of neural networks.

pub mod matrix;

pub mod simd;

pub mod image;

pub mod camera;
pub mod plane;

pub mod detect;

pub mod describe;
pub mod network;
