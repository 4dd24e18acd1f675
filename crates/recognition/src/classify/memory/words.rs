//! The words that lists of an inverted index are kept under.

use super::{Config, MemoryError};
use crate::vocabulary::{VocabularyError, cluster};
use rand::SeedableRng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use roomsight_vision::matrix::Matrix;
use roomsight_vision::simd::{ByteColumns, ByteRows, Nearest};

/// Descriptors that a list should hold: with fewer, looking for the nearest words costs more than reading lists.
pub(super) const LIST_LENGTH: usize = 512;

/// So few descriptors are all looked at.
const N_EXACT: usize = 8192;

/// Descriptors a word, drawn at random, that are clustered.
const N_SAMPLED: usize = 32;

/// Rounds of clustering. More make hardly better words for this.
const MAX_ROUNDS: usize = 8;

/// Descriptors whose words one thread looks for at a time.
const CHUNK: usize = 1024;

/// The centers that codes cluster round, rounded as the codes are.
#[derive(Clone, Debug)]
pub(super) struct Words {
    centers: Vec<i8>,
    columns: ByteColumns,
    width: usize,
}

impl Words {
    /// As many words as suit a memory of these codes, by k-means on a sample: one alone for few.
    pub(super) fn fit(codes: &[i8], width: usize, config: &Config, seed: u64) -> Self {
        let n_rows = codes.len() / width;
        let n_words = Self::wanted(n_rows, config);
        if n_words == 1 {
            return Self::new(vec![0; width], width);
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut sample = Matrix::new(width);
        let mut chosen = index::sample(&mut random, n_rows, n_rows.min(n_words * N_SAMPLED)).into_vec();
        chosen.sort_unstable();
        // No row may be longer than 1.
        let longest = codes.chunks_exact(width).map(squared_length).max().unwrap_or(0).max(1);
        let one = (f64::from(longest)).sqrt() as f32 * 1.001;
        for row_idx in chosen {
            let code = &codes[row_idx * width..][..width];
            sample.push_row(&code.iter().map(|&number| f32::from(number) / one).collect::<Vec<_>>());
        }
        let centers = match cluster(&sample, n_words, MAX_ROUNDS, &mut random) {
            // Most are the same; as many words as there are different ones.
            Err(VocabularyError::TooFewDescriptors { found, .. }) => {
                cluster(&sample, found.max(1), MAX_ROUNDS, &mut random)
            }
            centers => centers,
        };
        let round = |&value: &f32| (value * one + 0.5f32.copysign(value)) as i8;
        match centers {
            Ok(centers) => Self::new(centers.as_slice().iter().map(round).collect(), width),
            Err(VocabularyError::TooFewDescriptors { .. }) => Self::new(vec![0; width], width),
        }
    }

    /// How many words suit so many descriptors.
    fn wanted(n_rows: usize, config: &Config) -> usize {
        if n_rows <= N_EXACT { 1 } else { (n_rows / LIST_LENGTH).clamp(1, config.n_lists) }
    }

    /// Whether a memory has outgrown its words so far that it is searched too slowly.
    pub(super) fn are_outgrown(&self, n_rows: usize, config: &Config) -> bool {
        Self::wanted(n_rows, config) > 4 * self.n_words()
    }

    fn new(centers: Vec<i8>, width: usize) -> Self {
        let columns = ByteColumns::new(&centers, width);
        Self { centers, columns, width }
    }

    /// The words with these [`Words::centers`].
    pub(super) fn from_parts(centers: Vec<i8>, width: usize) -> Result<Self, MemoryError> {
        let n_words = centers.len() / width;
        if !centers.len().is_multiple_of(width) || !(1..=super::MAX_LISTS).contains(&n_words) {
            return Err(MemoryError::damaged("its words have another width, or there are too many or none"));
        }
        Ok(Self::new(centers, width))
    }

    pub(super) fn n_words(&self) -> usize {
        self.centers.len() / self.width
    }

    /// Word after word.
    pub(super) fn centers(&self) -> &[i8] {
        &self.centers
    }

    /// The nearest word of each code, ties to the first.
    pub(super) fn assign(&self, codes: &[i8]) -> Vec<u32> {
        let of_chunk = |codes: &[i8]| {
            let rows = ByteRows::new(codes, self.width);
            let nearest = self.nearest(&rows, 1);
            (0..rows.n_rows())
                .map(|idx| nearest.of(idx).next().map_or(0, |(_, word)| word))
                .collect::<Vec<_>>()
        };
        codes.par_chunks(CHUNK * self.width).flat_map_iter(of_chunk).collect()
    }

    /// The nearest `n_words` words of each row.
    pub(super) fn nearest(&self, rows: &ByteRows, n_words: usize) -> Nearest {
        let mut nearest = Nearest::new(rows.n_rows(), n_words);
        let row_idxs: Vec<u32> = (0..rows.n_rows() as u32).collect();
        nearest.look(rows, &row_idxs, &self.columns, 0..self.columns.n_blocks());
        nearest
    }
}

fn squared_length(code: &[i8]) -> i32 {
    code.iter().map(|&number| i32::from(number).pow(2)).sum()
}
