//! Pauses between tries, each twice as long as the one before.

use std::time::Duration;

const FIRST: Duration = Duration::from_secs(1);
const LONGEST: Duration = Duration::from_secs(60);

/// How often something was tried in vain.
#[derive(Default)]
pub struct Patience {
    n_failed: u32,
}

impl Patience {
    /// It failed once more; so long to wait before the next try.
    pub fn pause(&mut self) -> Duration {
        let pause = FIRST.saturating_mul(2_u32.saturating_pow(self.n_failed)).min(LONGEST);
        self.n_failed = self.n_failed.saturating_add(1);
        pause
    }

    /// How often it failed since it last worked.
    pub fn n_failed(&self) -> u32 {
        self.n_failed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_grow_and_end_growing() {
        let mut patience = Patience::default();
        let pauses: Vec<u64> = (0..8).map(|_| patience.pause().as_secs()).collect();
        assert_eq!(pauses, [1, 2, 4, 8, 16, 32, 60, 60]);
        assert_eq!(Patience { n_failed: u32::MAX }.pause(), LONGEST);
    }
}
