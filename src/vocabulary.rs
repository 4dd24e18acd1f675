//! A vocabulary of visual words: the centers that descriptors cluster round. A frame is represented by its
//! bag of words, how often each occurs (Csurka et al., "Visual categorization with bags of keypoints", 2004).

mod kmeans;

pub(crate) use kmeans::cluster;

use crate::matrix::Matrix;
use crate::simd::{self, UnitColumns, UnitRows};
use rand::SeedableRng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// The most words of a vocabulary.
const MAX_WORDS: usize = 65_536;

/// How a vocabulary is made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The number of words, k. The paper tries 50 to 400 and takes 300; more tell more rooms apart
    /// (docs/RESULTS.md).
    pub n_words: usize,
    /// How a bag is scaled.
    pub normalization: Normalization,
    /// At most this many descriptors, drawn at random, are clustered.
    pub max_descriptors: usize,
    /// At most this many rounds of Lloyd's algorithm.
    pub max_rounds: usize,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            n_words: 1000,
            normalization: Normalization::SquareRoot,
            max_descriptors: 100_000,
            max_rounds: 25,
        }
    }
}

impl Config {
    /// What is wrong with the parameters, if anything.
    pub fn check(&self) -> Result<(), String> {
        if !(1..=MAX_WORDS).contains(&self.n_words) {
            return Err(format!("a vocabulary has 1 to {MAX_WORDS} words, not {}", self.n_words));
        }
        if self.max_descriptors < self.n_words || self.max_rounds == 0 {
            return Err("max_descriptors must be at least n_words, and max_rounds at least 1".to_owned());
        }
        Ok(())
    }
}

/// How the word counts of a bag are scaled. A bag without words is all zeros.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Normalization {
    /// To sum 1.
    L1,
    /// To unit Euclidean length.
    L2,
    /// The square roots of the counts, to unit Euclidean length: a linear kernel then compares as the
    /// Hellinger kernel does.
    SquareRoot,
}

/// Why no vocabulary was made.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum VocabularyError {
    /// Fewer distinct descriptors than words.
    #[error(
        "{found} distinct descriptors are too few for a vocabulary of {wanted} words: \
         take more frames, a lower detection threshold, or fewer words (representation.n_words)"
    )]
    TooFewDescriptors {
        /// Distinct descriptors at hand.
        found: usize,
        /// Words asked for.
        wanted: usize,
    },
}

/// The centers of the words.
#[derive(Clone, Debug)]
pub struct Vocabulary {
    centers: Matrix,
    columns: UnitColumns,
    normalization: Normalization,
}

impl Vocabulary {
    /// Clusters descriptors by k-means, seeded by k-means++. The result depends on the seed alone, not on the
    /// number of threads.
    pub fn train(descriptors: &[&Matrix], config: &Config, seed: u64) -> Result<Self, VocabularyError> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let sample = draw(descriptors, config.max_descriptors, &mut random);
        let centers = cluster(&sample, config.n_words, config.max_rounds, &mut random)?;
        Ok(Self::new(centers, config.normalization))
    }

    /// A vocabulary of these centers, one a row. As means of descriptors, none is longer than 1.
    pub fn new(centers: Matrix, normalization: Normalization) -> Self {
        let columns = UnitColumns::new(&centers);
        Self { centers, columns, normalization }
    }

    /// The centers, one a row.
    pub fn centers(&self) -> &Matrix {
        &self.centers
    }

    /// The number of words.
    pub fn n_words(&self) -> usize {
        self.centers.n_rows()
    }

    /// The word of each descriptor, none of which is longer than 1: the index of the nearest center, in
    /// fixed point, ties to the first.
    pub fn quantize(&self, descriptors: &Matrix) -> Vec<u32> {
        let mut words = vec![0; descriptors.n_rows()];
        simd::nearest_columns(&UnitRows::new(descriptors), &self.columns, &mut words);
        words
    }

    /// The bag of the words of these descriptors: [`Vocabulary::quantize`] and [`Vocabulary::bag`].
    pub fn bag_of(&self, descriptors: &Matrix) -> Vec<f32> {
        self.bag(&self.quantize(descriptors))
    }

    /// The bag of these words: [`Vocabulary::n_words`] numbers, scaled as configured.
    pub fn bag(&self, words: &[u32]) -> Vec<f32> {
        let mut bag = vec![0.0; self.n_words()];
        words.iter().for_each(|&word| bag[word as usize] += 1.0);
        let total = words.len().max(1) as f32;
        match self.normalization {
            Normalization::L1 => bag.iter_mut().for_each(|value| *value /= total),
            Normalization::L2 => {
                let length = bag.iter().map(|value| value * value).sum::<f32>().sqrt().max(1.0);
                bag.iter_mut().for_each(|value| *value /= length);
            }
            Normalization::SquareRoot => bag.iter_mut().for_each(|value| *value = (*value / total).sqrt()),
        }
        bag
    }
}

/// At most `n_wanted` rows of all matrices, drawn without replacement, in their order.
fn draw(descriptors: &[&Matrix], n_wanted: usize, random: &mut ChaCha8Rng) -> Matrix {
    let rows: Vec<&[f32]> = descriptors.iter().flat_map(|matrix| matrix.rows()).collect();
    let mut chosen = index::sample(random, rows.len(), n_wanted.min(rows.len())).into_vec();
    chosen.sort_unstable();
    let mut sample = Matrix::new(descriptors.first().map_or(0, |matrix| matrix.n_cols()));
    chosen.iter().for_each(|&row_idx| sample.push_row(rows[row_idx]));
    sample
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vocabulary(normalization: Normalization) -> Vocabulary {
        let centers = Matrix::from_vec(vec![0.0, 0.0, 1.0, 0.0, 0.0, 1.0], 2).unwrap();
        Vocabulary::new(centers, normalization)
    }

    #[test]
    fn bags_count_words_and_are_scaled() {
        let descriptors = Matrix::from_vec(vec![0.1, 0.0, 0.9, 0.1, 0.8, 0.0, 0.9, 0.2], 2).unwrap();
        let words = vocabulary(Normalization::L1).quantize(&descriptors);
        assert_eq!(words, [0, 1, 1, 1]);
        assert_eq!(vocabulary(Normalization::L1).bag(&words), [0.25, 0.75, 0.0]);
        let root = vocabulary(Normalization::SquareRoot).bag(&words);
        assert_eq!(root, [0.5, 0.75f32.sqrt(), 0.0]);
        let unit = vocabulary(Normalization::L2).bag(&words);
        assert_eq!(unit, [1.0 / 10f32.sqrt(), 3.0 / 10f32.sqrt(), 0.0]);
    }

    #[test]
    fn no_keypoint_gives_an_empty_bag() {
        for normalization in [Normalization::L1, Normalization::L2, Normalization::SquareRoot] {
            assert_eq!(vocabulary(normalization).bag(&[]), [0.0; 3]);
        }
    }
}
