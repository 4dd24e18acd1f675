//! roomsight tells a robot which room it is in.
//!
//! # Map
//!
//! A module imports only from the groups before its own; `tests/architecture.rs` holds that.
//!
//! | group | modules | what |
//! |---|---|---|
//! | 1 | [`matrix`], [`image`], [`simd`], [`camera`] | rows of numbers, pixels, where pixels are valid |
//! | 2 | [`detect`] | keypoints |
//! | 3 | [`describe`] | keypoints to descriptors |
//! | 4 | [`vocabulary`], [`svm`] | descriptors to bags of words, bags to probabilities |
//! | 5 | [`model`] | the whole pipeline: train, recognize, the file |
//! | 6 | [`dataset`], [`evaluate`], [`simulate`] | labeled frames from disk, rates, the simulated lab |
//! | 7 | [`server`] | the HTTP service |
//! | 8 | [`cli`] | the commands |
//!
//! Groups 1 to 5 are the recognition core. They know no async, no HTTP, no clock and no hidden
//! randomness: seeds are arguments.

pub mod matrix;

pub mod camera;
pub mod image;

pub mod model;

pub mod simulate;

pub mod cli;
