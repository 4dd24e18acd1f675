//! What `train` chooses among where nothing is asked for.

use super::{Candidate, Config, OpinionConfig, VectorConfig};

/// What the opinion on a network's vector is called.
const VECTOR: &str = "vector";

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
    /// The candidates, in the order of preference: cheaper ones first. Those that look through
    /// [`super::DEFAULT_NETWORK`] are among them where it is there; they are not linked yet.
    pub fn candidates(self, seed: u64, has_network: bool) -> Vec<Candidate> {
        let config = Config { seed, ..Config::default() };
        let mut candidates = vec![Candidate { name: "bag of words".to_owned(), config: config.clone() }];
        if has_network && self.may_run_networks() {
            let mut config = config;
            config.opinions.insert(VECTOR.to_owned(), OpinionConfig::Vector(VectorConfig::default()));
            candidates.push(Candidate { name: "bag of words and network".to_owned(), config });
        }
        candidates
    }

    /// Whether a network may run on each frame.
    pub fn may_run_networks(self) -> bool {
        self != Self::Fast
    }
}
