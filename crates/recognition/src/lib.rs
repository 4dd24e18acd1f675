//! Tells which room a frame shows, or that it shows none, within a program of your own: no service, no async.
//!
//! ```
//! use roomsight_recognition::Recognizer;
//! use std::{fs, path::Path};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut recognizer = Recognizer::open(Path::new("../../models/simulated-lab/1"))?;
//! let frame = fs::read("../../models/simulated-lab/1/golden/corridor.jpeg")?;
//! let answer = recognizer.recognize(&frame)?;
//! if answer.known {
//!     println!("{} with probability {:.2}", recognizer.room(&answer), answer.probability());
//! }
//! # assert_eq!(recognizer.room(&answer), "corridor");
//! # Ok(()) }
//! ```
//!
//! Models are trained by `roomsight train`, or by [`model::Model::train`] from frames that a [`model::Extractor`] described.
//! Probabilities are from 0 to 1 and sum to 1 over the rooms; `known` says that the room is one to act on.
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
//! | `recognizer` | a model with its working memory |
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

mod recognizer;

pub use recognizer::Recognizer;
