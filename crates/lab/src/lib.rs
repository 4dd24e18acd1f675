//! What measures: data sets, a simulated lab, and the experiments of the papers.
//!
//! | module | what |
//! |---|---|
//! | [`part`] | a work in parts, which several machines share |
//! | [`dataset`], [`evaluate`] | labeled frames from disk; rates of a model on them |
//! | [`simulate`] | the simulated lab, which uses nothing else |
//! | [`check`], [`validate`], [`page`] | what is odd about labeled frames; rates of a configuration over splits and seeds; HTML pages with charts |
//! | [`experiment`] | the experiments of the papers |

mod cold_layout;

pub mod part;
mod whole_file;

pub mod dataset;
pub mod evaluate;
pub mod simulate;

pub mod check;
pub mod page;
pub mod validate;

pub mod experiment;
