//! What measures: data sets, a simulated lab, and the experiments of the papers.

pub mod dataset;
pub mod evaluate;
pub mod simulate;

pub mod check;
pub mod page;
pub mod validate;

pub mod experiment;
