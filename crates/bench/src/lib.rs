//! What the steps of a frame cost, for `make bench` and `make bench-instructions`.
//!
//! | module | what |
//! |---|---|
//! | [`drive`] | frames of the simulated lab |
//! | [`world`] | descriptors that cluster, as many as one likes |
//! | [`raw`] | numbers in files |
//! | [`prepared`] | a folder of frames and models, written once and read by those that measure |
//! | [`step`] | one step of a frame, to be run and measured |
//! | [`training`] | what training does beside others |
//!
//! Nothing here is part of the program: a surprise stops it.

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first surprise")]

pub mod drive;
pub mod prepared;
pub mod raw;
pub mod step;
pub mod training;
pub mod world;
