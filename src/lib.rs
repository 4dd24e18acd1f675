//! roomsight tells a robot which room it is in.
//!
//! # Map
//!
//! A module imports only from the groups before its own; `tests/architecture.rs` holds that.
//!
//! | group | modules | what |
//! |---|---|---|
//! | 1 | [`matrix`], [`image`] | rows of numbers, pixels |
//! | 2 | [`simd`], [`labeled`] | fast loops over them; rows with the class of each |
//! | 3 | [`camera`], [`plane`] | where pixels are valid; gray values at many scales |
//! | 4 | [`detect`] | keypoints |
//! | 5 | [`describe`] | keypoints to descriptors |
//! | 6 | [`vocabulary`], [`svm`], [`boost`], [`folds`] | descriptors to bags of words, bags to probabilities |
//! | 7 | [`filter`] | probabilities of frames to the room of a stream |
//! | 8 | [`model`] | the whole pipeline: train, recognize, the file |
//! | 9 | [`repository`] | which versions of which models there are, on a disk or in a bucket |
//! | 10 | [`dataset`], [`evaluate`], [`simulate`] | labeled frames from disk, rates, the simulated lab |
//! | 11 | [`validate`], [`page`] | rates of a configuration over splits and seeds; HTML pages with charts |
//! | 12 | [`experiment`] | the experiments of the papers |
//! | 13 | [`protocol`] | what travels between robots and the service |
//! | 14 | [`client`], [`server`] | a client of the HTTP service, the service |
//! | 15 | [`cli`] | the commands |
//!
//! Groups 1 to 8 are the recognition core. They know no async, no HTTP, no clock and no hidden
//! randomness: seeds are arguments.

pub mod image;
pub mod matrix;

pub mod labeled;
pub mod simd;

pub mod camera;
pub mod plane;

pub mod detect;

pub mod describe;

pub mod boost;
pub mod folds;
pub mod svm;
pub mod vocabulary;

pub mod filter;

pub mod model;

pub mod repository;

pub mod dataset;
pub mod evaluate;
pub mod simulate;

pub mod page;
pub mod validate;

pub mod experiment;

pub mod protocol;

pub mod client;
pub mod server;

pub mod cli;
