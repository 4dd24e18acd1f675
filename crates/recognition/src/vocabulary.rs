//! A vocabulary of visual words: the centers that descriptors cluster round. A frame is represented by its
//! bag of words, how often each occurs (Csurka et al., "Visual categorization with bags of keypoints", 2004).

mod kmeans;
mod pca;
mod pooling;
mod turn;
mod vlad;

pub(crate) use kmeans::cluster;
pub(crate) use pca::PrincipalComponents;
use pooling::Parts;
pub use pooling::Pooling;

use rand::SeedableRng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;
use roomsight_vision::camera::Spot;
use roomsight_vision::matrix::Matrix;
use roomsight_vision::simd::{UnitColumns, UnitRows, nearest_columns};
use roomsight_vision::sketch::Sketched;
use serde::{Deserialize, Serialize};

/// The most words of a vocabulary, and the most numbers of a frame's row.
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
    /// What is kept of a frame's descriptors beside their words.
    #[serde(skip_serializing_if = "Encoding::is_counts")]
    pub encoding: Encoding,
    /// The parts of a frame that have counts of their own.
    #[serde(skip_serializing_if = "Pooling::is_whole")]
    pub pooling: Pooling,
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
            encoding: Encoding::Counts,
            pooling: Pooling::Whole {},
            max_descriptors: 100_000,
            max_rounds: 25,
        }
    }
}

impl Config {
    /// What is wrong with the parameters, if anything, for descriptors of `n_dimensions` numbers.
    pub fn check(&self, n_dimensions: usize) -> Result<(), String> {
        self.pooling.check()?;
        if !(1..=MAX_WORDS).contains(&self.n_words) {
            return Err(format!("a vocabulary has 1 to {MAX_WORDS} words, not {}", self.n_words));
        }
        if self.max_descriptors < self.n_words || self.max_rounds == 0 {
            return Err("max_descriptors must be at least n_words, and max_rounds at least 1".to_owned());
        }
        // No camera has more parts.
        let n_parts = self.pooling.parts(false).n_parts();
        let n_columns = n_parts * self.n_words * self.encoding.n_columns_a_word(n_dimensions);
        if n_columns > MAX_WORDS {
            return Err(format!(
                "{} words in {n_parts} parts of a frame are a row of {n_columns} numbers, at most {MAX_WORDS} are \
                 allowed: lower n_words or the levels of pooling",
                self.n_words
            ));
        }
        Ok(())
    }
}

/// What is kept of a frame's descriptors beside their words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Encoding {
    /// Nothing: words are counted.
    #[default]
    Counts,
    /// How they differ from their words, as [`vlad`] has it: a few words (16 to 64) are enough. The normalization of
    /// counts does not matter then.
    Vlad,
}

impl Encoding {
    /// How many numbers of a row belong to a word of a part.
    fn n_columns_a_word(self, n_dimensions: usize) -> usize {
        match self {
            Self::Counts => 1,
            Self::Vlad => n_dimensions,
        }
    }

    fn is_counts(&self) -> bool {
        *self == Self::Counts
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

/// The centers of the words, and how a frame's words become a row of numbers.
#[derive(Clone, Debug)]
pub struct Vocabulary {
    centers: Matrix,
    words: Words,
    normalization: Normalization,
    encoding: Encoding,
    parts: Parts,
}

/// The centers, as the nearest is found.
#[derive(Clone, Debug)]
enum Words {
    Few(UnitColumns),
    Many(Box<Sketched>),
}

impl Words {
    fn new(centers: &Matrix) -> Self {
        match Sketched::new(centers) {
            Some(sketched) => Self::Many(Box::new(sketched)),
            None => Self::Few(UnitColumns::new(centers)),
        }
    }
}

/// What is seen of one frame's keypoints.
#[derive(Clone, Copy, Debug)]
pub struct Described<'a> {
    /// One row a keypoint, none of which is longer than 1.
    pub descriptors: &'a Matrix,
    /// Where the keypoints lie, as many.
    pub spots: &'a [Spot],
}

impl Vocabulary {
    /// Clusters descriptors of frames by k-means, seeded by k-means++. The result depends on the seed alone, not on the
    /// number of threads.
    pub fn train(frames: &[Described], config: &Config, seed: u64) -> Result<Self, VocabularyError> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let descriptors: Vec<&Matrix> = frames.iter().map(|frame| frame.descriptors).collect();
        let sample = draw(&descriptors, config.max_descriptors, &mut random);
        let centers = cluster(&sample, config.n_words, config.max_rounds, &mut random)?;
        let sees_all_around = frames.iter().flat_map(|frame| frame.spots).any(|spot| spot.across.is_none());
        Ok(Self::new(centers, config, sees_all_around))
    }

    /// A vocabulary of these centers, one a row. As means of descriptors, none is longer than 1. Frames are of a camera
    /// that does or does not see all around.
    pub fn new(centers: Matrix, config: &Config, sees_all_around: bool) -> Self {
        let words = Words::new(&centers);
        let Config { normalization, encoding, pooling, .. } = *config;
        Self { centers, words, normalization, encoding, parts: pooling.parts(sees_all_around) }
    }

    /// The centers, one a row.
    pub fn centers(&self) -> &Matrix {
        &self.centers
    }

    /// The number of words.
    pub fn n_words(&self) -> usize {
        self.centers.n_rows()
    }

    /// The numbers of a frame's row: blocks of as many a word of a part, part after part.
    pub fn n_columns(&self) -> usize {
        self.n_blocks() * self.block_width()
    }

    /// The numbers of a row that belong to one word of one part.
    pub fn block_width(&self) -> usize {
        self.encoding.n_columns_a_word(self.centers.n_cols())
    }

    fn n_blocks(&self) -> usize {
        self.parts.n_parts() * self.n_words()
    }

    /// The blocks of a row that a keypoint of this word counts in: one for each part that it lies in.
    pub fn blocks(&self, word: u32, spot: Spot) -> impl Iterator<Item = usize> + use<> {
        let n_words = self.n_words();
        self.parts.of(spot).map(move |part| part * n_words + word as usize)
    }

    /// The word of each descriptor, none of which is longer than 1: the index of the nearest center, in
    /// fixed point, ties to the first.
    pub fn quantize(&self, descriptors: &Matrix) -> Vec<u32> {
        let mut words = vec![0; descriptors.n_rows()];
        match &self.words {
            Words::Few(columns) => nearest_columns(&UnitRows::new(descriptors), columns, &mut words),
            Words::Many(sketched) => sketched.nearest(descriptors, &mut words),
        }
        words
    }

    /// The row of a frame: [`Vocabulary::quantize`] and [`Vocabulary::row_of_words`].
    pub fn row(&self, frame: Described) -> Vec<f32> {
        self.row_of_words(frame, &self.quantize(frame.descriptors))
    }

    /// The row of a frame whose descriptors have these words: [`Vocabulary::n_columns`] numbers, scaled as configured.
    pub fn row_of_words(&self, frame: Described, words: &[u32]) -> Vec<f32> {
        let blocks = |idx: usize| self.blocks(words[idx], frame.spots[idx]);
        match self.encoding {
            Encoding::Counts => self.bag(words.len(), blocks),
            Encoding::Vlad => vlad::vlad(frame.descriptors, words, &self.centers, self.n_blocks(), blocks),
        }
    }

    /// The bag of so many words, counted in these blocks.
    fn bag<Blocks: Iterator<Item = usize>>(&self, n: usize, blocks: impl Fn(usize) -> Blocks) -> Vec<f32> {
        let mut bag = vec![0.0; self.n_blocks()];
        (0..n).flat_map(blocks).for_each(|block| bag[block] += 1.0);
        for (counts, weight) in bag.chunks_exact_mut(self.n_words()).zip(self.parts.weights()) {
            counts.iter_mut().for_each(|count| *count *= weight);
        }
        let total = n.max(1) as f32;
        match self.normalization {
            Normalization::L1 => bag.iter_mut().for_each(|value| *value /= total),
            Normalization::L2 => {
                let length = bag.iter().map(|value| value * value).sum::<f32>().sqrt();
                if length > 0.0 {
                    bag.iter_mut().for_each(|value| *value /= length);
                }
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

    fn vocabulary(config: &Config) -> Vocabulary {
        let centers = Matrix::from_vec(vec![0.0, 0.0, 1.0, 0.0, 0.0, 1.0], 2).unwrap();
        Vocabulary::new(centers, config, false)
    }

    fn of(normalization: Normalization) -> Vocabulary {
        vocabulary(&Config { normalization, ..Config::default() })
    }

    /// Words 0, 1, 1 and 1, the last of which lies elsewhere.
    fn descriptors() -> Matrix {
        Matrix::from_vec(vec![0.1, 0.0, 0.9, 0.1, 0.8, 0.0, 0.9, 0.2], 2).unwrap()
    }

    fn spots() -> [Spot; 4] {
        let spot = |across| Spot { across: Some(across), down: 0.2 };
        [spot(0.1), spot(0.2), spot(0.3), spot(0.9)]
    }

    #[test]
    fn bags_count_words_and_are_scaled() {
        let (descriptors, spots) = (descriptors(), spots());
        let frame = Described { descriptors: &descriptors, spots: &spots };
        assert_eq!(of(Normalization::L1).quantize(&descriptors), [0, 1, 1, 1]);
        assert_eq!(of(Normalization::L1).row(frame), [0.25, 0.75, 0.0]);
        assert_eq!(of(Normalization::SquareRoot).row(frame), [0.5, 0.75f32.sqrt(), 0.0]);
        assert_eq!(of(Normalization::L2).row(frame), [1.0 / 10f32.sqrt(), 3.0 / 10f32.sqrt(), 0.0]);
    }

    #[test]
    fn no_keypoint_gives_an_empty_bag() {
        let frame = Described { descriptors: &Matrix::new(2), spots: &[] };
        for normalization in [Normalization::L1, Normalization::L2, Normalization::SquareRoot] {
            assert_eq!(of(normalization).row(frame), [0.0; 3]);
        }
    }

    #[test]
    fn parts_have_their_own_counts() {
        let (descriptors, spots) = (descriptors(), spots());
        let frame = Described { descriptors: &descriptors, spots: &spots };
        let pooling = Pooling::Pyramid { levels: 2 };
        let l1 = Config { pooling, normalization: Normalization::L1, ..Config::default() };
        let expected = [[1.0, 3.0, 0.0], [1.0, 2.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3], [0.0; 3]];
        assert_eq!(
            vocabulary(&l1).row(frame),
            expected.as_flattened().iter().map(|n| n / 8.0).collect::<Vec<_>>()
        );
        for normalization in [Normalization::L2, Normalization::SquareRoot] {
            let row = vocabulary(&Config { normalization, ..l1.clone() }).row(frame);
            assert!((row.iter().map(|value| value * value).sum::<f32>() - 1.0).abs() < 1e-6, "{row:?}");
        }
    }

    #[test]
    fn vlad_sums_differences_in_each_part() {
        let (descriptors, spots) = (descriptors(), spots());
        let frame = Described { descriptors: &descriptors, spots: &spots };
        let config =
            Config { encoding: Encoding::Vlad, pooling: Pooling::Pyramid { levels: 2 }, ..Config::default() };
        let row = vocabulary(&config).row(frame);
        assert_eq!(row.len(), 5 * 3 * 2);
        // The second part holds what differs but for the last descriptor, the third that alone.
        let filled: Vec<bool> = row.chunks(6).map(|part| part.iter().any(|&value| value != 0.0)).collect();
        assert_eq!(filled, [true, true, true, false, false]);
        assert_eq!(row[12..14], [0.0; 2]);
        assert!((row[14] / row[15] + 0.5f32.sqrt()).abs() < 1e-5, "-0.1 and 0.2: {row:?}");
    }

    #[test]
    fn rows_that_are_too_long_are_refused() {
        let refused = |config: Config| config.check(72).unwrap_err();
        let pyramid = Config { pooling: Pooling::Pyramid { levels: 4 }, ..Config::default() };
        assert!(refused(pyramid.clone()).contains("lower n_words"));
        assert_eq!(Config { n_words: 400, ..pyramid }.check(72), Ok(()));
        let vlad = Config { encoding: Encoding::Vlad, ..Config::default() };
        assert!(refused(vlad.clone()).contains("72000"));
        assert_eq!(Config { n_words: 64, ..vlad }.check(72), Ok(()));
    }
}
