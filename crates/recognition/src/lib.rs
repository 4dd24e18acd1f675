//! Tells which room a frame shows, or that it shows none.
//!
//! | module | what |
//! |---|---|
//! | [`labeled`], [`folds`] | rows with the class of each; what is held out of training |
//! | [`vocabulary`] | descriptors to bags of words |
//! | [`classify`] | support vector machines, boosting, the memory of descriptors |
//! | [`filter`] | probabilities of frames to the room of a stream |
//! | `file` | what models are kept in |
//! | `look` | how frames are looked at |
//! | `opinions` | what tells rooms apart by what is seen, calibrated and pooled |
//! | [`model`] | the whole: train, add, recognize, save, load |
//!
//! Each uses those before it. They know no async, no HTTP, no clock and no hidden randomness: seeds are arguments.

pub mod labeled;

pub mod folds;
pub mod vocabulary;

pub mod classify;

pub mod filter;

mod file;
mod look;
mod opinions;

pub mod model;
