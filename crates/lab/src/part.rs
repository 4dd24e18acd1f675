//! A work in parts, which several machines share.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// One of several parts of a work, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "[usize; 2]", into = "[usize; 2]")]
pub struct Part {
    number: usize,
    of: usize,
}

/// Text or numbers that name no part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a part is NUMBER/OF, counted from 1, such as 2/8, of up to {}", Part::MAX)]
pub struct PartError;

impl Part {
    /// The most parts.
    pub const MAX: usize = 100_000;
    /// All of it.
    pub const WHOLE: Self = Self { number: 1, of: 1 };

    /// Which of so many items in a row belong to it: as many as to the others, or one more.
    pub fn range(self, n_items: usize) -> Range<usize> {
        let bound = |number: usize| number * n_items / self.of;
        bound(self.number - 1)..bound(self.number)
    }

    /// All parts of the same work, this one included.
    pub fn siblings(self) -> impl Iterator<Item = Self> {
        (1..=self.of).map(move |number| Self { number, of: self.of })
    }
}

impl TryFrom<[usize; 2]> for Part {
    type Error = PartError;

    fn try_from([number, of]: [usize; 2]) -> Result<Self, PartError> {
        if (1..=of).contains(&number) && of <= Self::MAX { Ok(Self { number, of }) } else { Err(PartError) }
    }
}

impl From<Part> for [usize; 2] {
    fn from(part: Part) -> Self {
        [part.number, part.of]
    }
}

impl FromStr for Part {
    type Err = PartError;

    fn from_str(text: &str) -> Result<Self, PartError> {
        let (number, of) = text.split_once('/').ok_or(PartError)?;
        let parse = |text: &str| text.trim().parse::<usize>().map_err(|_| PartError);
        [parse(number)?, parse(of)?].try_into()
    }
}

impl fmt::Display for Part {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        write!(formatter, "{}/{}", self.number, self.of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn parts_are_the_whole_each_item_once(of in 1_usize..50, n_items in 0_usize..300) {
            let parts: Vec<Part> = Part::try_from([1, of]).unwrap().siblings().collect();
            let items: Vec<usize> = parts.iter().flat_map(|part| part.range(n_items)).collect();
            prop_assert_eq!(items, (0..n_items).collect::<Vec<_>>());
            let sizes = parts.iter().map(|part| part.range(n_items).len());
            prop_assert!(sizes.clone().max().unwrap() - sizes.min().unwrap() <= 1);
        }
    }

    #[test]
    fn parts_have_numbers() {
        for wrong in ["", "1", "0/3", "4/3", "1/0", "-1/3", "1/2/3", "a/b", "1/100001"] {
            assert_eq!(wrong.parse::<Part>(), Err(PartError), "{wrong}");
        }
        assert_eq!("2/3".parse::<Part>().unwrap().to_string(), "2/3");
    }
}
