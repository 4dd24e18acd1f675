//! Rows of numbers to rooms: support vector machines, boosting, and a memory of everything.

pub mod boost;
pub mod memory;
pub mod svm;
