//! What `train` chooses among where nothing is asked for.

use super::{Candidate, Config};

/// How much may be spent on a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// A few milliseconds.
    Fast,
    /// Some ten milliseconds.
    #[default]
    Balanced,
    /// What answers best.
    Best,
}

impl Effort {
    /// The candidates, in the order of preference: cheaper ones first.
    pub fn candidates(self, seed: u64) -> Vec<Candidate> {
        let config = Config { seed, ..Config::default() };
        vec![Candidate { name: "bag of words".to_owned(), config }]
    }
}
