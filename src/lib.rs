//! roomsight tells a robot which room it is in.
//!
//! # Map
//!
//! A module imports only from the groups before its own; `tests/architecture.rs` holds that.
//!
//! | group | modules | what |
//! |---|---|---|
//! | 1 | [`matrix`] | rows of numbers |
//! | 2 | [`simd`], [`labeled`] | fast loops over numbers and pixels; rows with the class of each |
//! | 3 | [`image`] | encoded frames to pixels |
//! | 4 | [`camera`], [`plane`] | where pixels are valid; gray values at many scales |
//! | 5 | [`detect`] | keypoints |
//! | 6 | [`describe`], [`network`] | keypoints to descriptors; neural networks as a source of features |
//! | 7 | [`vocabulary`], [`svm`], [`boost`], [`folds`] | descriptors to bags of words, bags to probabilities |
//! | 8 | [`memory`] | every descriptor remembered, frames answered by the nearest |
//! | 9 | [`filter`] | probabilities of frames to the room of a stream |
//! | 10 | [`model`] | the whole pipeline: train, recognize, the file |
//! | 11 | [`repository`] | which versions of which models there are, on a disk or in a bucket |
//! | 12 | [`dataset`], [`evaluate`], [`simulate`] | labeled frames from disk, rates, the simulated lab |
//! | 13 | [`check`], [`validate`], [`page`] | what is odd about labeled frames; rates of a configuration over splits and seeds; HTML pages with charts |
//! | 14 | [`experiment`] | the experiments of the papers |
//! | 15 | [`protocol`] | what travels between robots and the service |
//! | 16 | [`client`], [`server`] | a client of the HTTP service, the service |
//! | 17 | [`cli`] | the commands |
//!
//! Groups 1 to 10 are the recognition core. They know no async, no HTTP, no clock and no hidden
//! randomness: seeds are arguments.

pub mod matrix;

pub mod labeled;
pub mod simd;

pub mod image;

pub mod camera;
pub mod plane;

pub mod detect;

pub mod describe;
pub mod network;

pub mod boost;
pub mod folds;
pub mod svm;
pub mod vocabulary;

pub mod memory;

pub mod filter;

pub mod model;

pub mod repository;

pub mod dataset;
pub mod evaluate;
pub mod simulate;

pub mod check;
pub mod page;
pub mod validate;

pub mod experiment;

pub mod protocol;

pub mod client;
pub mod server;

pub mod cli;
