//! Keypoints, descriptors and pictures beside OpenCV, scikit-image and Pillow; ONNX Runtime.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod opencv_fast;
mod opencv_keypoints;
mod pictures;
mod repeatability;
mod runtime;
mod skimage_lbp;
