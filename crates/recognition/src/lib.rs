//! Tells which room a frame shows, or that it shows none.

pub mod labeled;

pub mod boost;
pub mod folds;
pub mod svm;
pub mod vocabulary;

pub mod memory;

pub mod filter;

pub mod model;
