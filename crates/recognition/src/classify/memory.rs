//! A memory of places: every descriptor of every frame, kept in bytes, and frames answered by the descriptors that
//! are nearest to theirs.
//!
//! Rooms are told by local naive Bayes nearest neighbors (Boiman, Shechtman and Irani, "In Defense of
//! Nearest-Neighbor Based Image Classification", CVPR 2008; McCann and Lowe, "Local Naive Bayes Nearest Neighbor for
//! Image Classification", CVPR 2012). For each descriptor of a frame the nearest `n_neighbors` + 1 of all remembered
//! ones are found. The distance of the last is the background; each room among the others gets the margin of its
//! nearest one below the background, once. The margins are added up over the frame.
//!
//! The search is an inverted index (Sivic and Zisserman, "Video Google", ICCV 2003; Jégou, Douze and Schmid, "Product
//! Quantization for Nearest Neighbor Search", PAMI 2011, section IV, here without the product quantizer): descriptors
//! lie under words, and a descriptor visits the lists of the few words nearest to it. A small memory is
//! searched through.

mod coding;
mod lists;
mod recall;
mod thin;
mod words;

pub use coding::Coding;
pub use recall::{FrameVotes, Match, Recall};

use lists::{Lists, Rows};
use rayon::prelude::*;
use roomsight_vision::matrix::Matrix;
use roomsight_vision::simd::ByteRows;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use words::Words;

/// The most numbers that a descriptor may have.
const MAX_INPUTS: usize = 4096;

/// The most bytes that are kept of a descriptor.
const MAX_DIMENSIONS: usize = 256;

/// The most neighbors that are asked.
const MAX_NEIGHBORS: usize = 100;

/// The most lists.
const MAX_LISTS: usize = 65_536;

/// The most descriptors: their columns are counted in 32 bits, padding included.
const MAX_DESCRIPTORS: usize = 100_000_000;

/// How a memory keeps and finds descriptors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The principal components that are kept of a descriptor, a byte each, from 1 to 256; all where there are
    /// fewer.
    pub n_dimensions: usize,
    /// The nearest descriptors that are asked for their rooms, k, from 1 to 100. The paper takes 10.
    pub n_neighbors: usize,
    /// The most lists of the inverted index, from 1 to 65,536. There are fewer while they would be short: a list
    /// for 512 descriptors.
    pub n_lists: usize,
    /// The lists that a descriptor visits, at least 1. As many as there are make the search exact.
    pub n_visited: usize,
    /// The most descriptors that are kept, up to a hundred million; see [`Memory::learn`].
    pub max_descriptors: usize,
}

impl Default for Config {
    fn default() -> Self {
        Self { n_dimensions: 32, n_neighbors: 10, n_lists: 4096, n_visited: 8, max_descriptors: 2_000_000 }
    }
}

impl Config {
    /// What is wrong with the parameters, if anything.
    pub fn check(&self) -> Result<(), String> {
        let ranges = [
            ("n_dimensions", self.n_dimensions, MAX_DIMENSIONS),
            ("n_neighbors", self.n_neighbors, MAX_NEIGHBORS),
            ("n_lists", self.n_lists, MAX_LISTS),
            ("n_visited", self.n_visited, MAX_LISTS),
            ("max_descriptors", self.max_descriptors, MAX_DESCRIPTORS),
        ];
        match ranges.iter().find(|(_, value, most)| !(1..=*most).contains(value)) {
            Some((name, value, most)) => Err(format!("{name} must be from 1 to {most}, not {value}")),
            None => Ok(()),
        }
    }
}

/// Why there is no memory.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum MemoryError {
    /// No descriptors, or all the same.
    #[error(
        "the frames have no two different descriptors to remember: take more frames, or ones with something to see"
    )]
    NothingToTell,
    /// Parts that do not fit together.
    #[error("the memory is damaged: {0}")]
    Damaged(String),
}

impl MemoryError {
    fn damaged(what: &str) -> Self {
        Self::Damaged(what.to_owned())
    }
}

/// Where a remembered frame is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Its room.
    pub room_idx: usize,
    /// The caller's number for the frame, which stays when other frames are forgotten.
    pub frame_idx: usize,
}

/// Frames as memories keep them, made once for all memories of some of these frames.
#[derive(Clone, Debug)]
pub struct Prepared {
    config: Config,
    coding: Arc<Coding>,
    words: Arc<Words>,
    frames: Vec<Coded>,
}

/// The descriptors of a frame, and their words.
#[derive(Clone, Debug)]
struct Coded {
    codes: Vec<i8>,
    words: Vec<u32>,
}

impl Prepared {
    /// Learns from frames how to keep them, and codes them. The result depends on the seed alone, not on the number
    /// of threads.
    ///
    /// # Errors
    /// No two different descriptors.
    ///
    /// # Panics
    /// When [`Config::check`] finds something, or descriptors are of different widths.
    pub fn new(frames: &[&Matrix], config: &Config, seed: u64) -> Result<Self, MemoryError> {
        config.check().unwrap_or_else(|wrong| panic!("{wrong}"));
        let frames_with_any: Vec<&Matrix> =
            frames.iter().copied().filter(|frame| frame.n_rows() > 0).collect();
        let coding = Arc::new(Coding::fit(&frames_with_any, config.n_dimensions, seed)?);
        let codes: Vec<Vec<i8>> = frames.par_iter().map(|frame| coding.code(frame)).collect();
        let words = Arc::new(Words::fit(&codes.concat(), coding.n_dimensions(), config, seed));
        let coded = |codes: Vec<i8>| Coded { words: words.assign(&codes), codes };
        let frames = codes.into_par_iter().map(coded).collect();
        Ok(Self { config: config.clone(), coding, words, frames })
    }

    /// A memory of some of the frames, in the order of `chosen`: the index of each with its origin. The places are
    /// below `n_rooms`. More descriptors than are to be kept are thinned out as by [`Memory::learn`].
    ///
    /// # Panics
    /// When there is no such frame or place.
    pub fn memory(&self, chosen: &[(usize, Origin)], n_rooms: usize) -> Memory {
        let mut rows = Rows::default();
        for (remembered_idx, &(frame_idx, _)) in chosen.iter().enumerate() {
            let Coded { codes, words } = &self.frames[frame_idx];
            rows.extend(codes, words, remembered_idx as u32);
        }
        let origins: Vec<Origin> = chosen.iter().map(|&(_, origin)| origin).collect();
        assert!(origins.iter().all(|origin| origin.room_idx < n_rooms), "a place that there is not");
        let mut memory = Memory {
            config: self.config.clone(),
            lists: Lists::new(&rows, self.words.n_words(), self.coding.n_dimensions()),
            coding: Arc::clone(&self.coding),
            words: Arc::clone(&self.words),
            origins,
            n_rooms,
        };
        memory.thin();
        memory
    }
}

/// What is remembered of frames.
#[derive(Clone, Debug)]
pub struct Memory {
    config: Config,
    coding: Arc<Coding>,
    words: Arc<Words>,
    lists: Lists,
    /// Of each remembered frame.
    origins: Vec<Origin>,
    n_rooms: usize,
}

/// What a memory is made of, to be written and read.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// [`Coding::components`].
    pub components: Matrix,
    /// [`Coding::offsets`].
    pub offsets: Vec<f32>,
    /// [`Coding::scale`].
    pub scale: f32,
    /// The centers of the words, one after the other.
    pub words: Vec<i8>,
    /// The codes of the descriptors, list after list.
    pub codes: Vec<i8>,
    /// How many descriptors lie under each word.
    pub list_lengths: Vec<usize>,
    /// The frame of each descriptor, as an index into `origins`.
    pub frame_idxs: Vec<u32>,
    /// Where each frame is from.
    pub origins: Vec<Origin>,
}

impl Memory {
    /// Where each remembered frame is from.
    pub fn origins(&self) -> &[Origin] {
        &self.origins
    }

    /// The number of remembered descriptors.
    pub fn n_descriptors(&self) -> usize {
        self.lists.n_rows()
    }

    /// The number of lists that they lie in.
    pub fn n_lists(&self) -> usize {
        self.words.n_words()
    }

    /// The number of places that frames may be of.
    pub fn n_rooms(&self) -> usize {
        self.n_rooms
    }

    /// How descriptors are kept.
    pub fn coding(&self) -> &Coding {
        &self.coding
    }

    /// Remembers more frames beside those before, by the same components and words. Once there are so many
    /// descriptors that their lists are four times as long as they should be, new words are made of what is
    /// remembered, from `seed`.
    ///
    /// Where more than `max_descriptors` would be kept, frames are forgotten, one after the other: of the room with
    /// most descriptors, of the two frames that are most alike, the earlier. Alike are frames whose descriptors
    /// have most words in common, measured by the frame with fewer. The last frame of a room always stays, so a
    /// memory of a frame a room may remain above its bound.
    ///
    /// # Panics
    /// When descriptors are of another width, or a room is not below [`Memory::n_rooms`].
    pub fn learn(&mut self, frames: &[(&Matrix, Origin)], seed: u64) {
        let mut rows = self.lists.rows();
        for &(descriptors, origin) in frames {
            assert!(origin.room_idx < self.n_rooms, "a place that there is not");
            let codes = self.coding.code(descriptors);
            rows.extend(&codes, &self.words.assign(&codes), self.origins.len() as u32);
            self.origins.push(origin);
        }
        let width = self.coding.n_dimensions();
        if self.words.are_outgrown(rows.words.len(), &self.config) {
            self.words = Arc::new(Words::fit(&rows.codes, width, &self.config, seed));
            rows.words = self.words.assign(&rows.codes);
        }
        self.lists = Lists::new(&rows, self.words.n_words(), width);
        self.thin();
    }

    /// Forgets all frames but those whose origin is to be kept, as those of a drive or of a room.
    pub fn retain(&mut self, keep: impl Fn(&Origin) -> bool) {
        let kept: Vec<bool> = self.origins.iter().map(keep).collect();
        self.keep(&kept);
    }

    /// Numbers the rooms, of which there are `n_rooms` from now on, and the frames anew.
    ///
    /// # Panics
    /// When a room is not below `n_rooms`.
    pub fn renumber(&mut self, n_rooms: usize, renumbered: impl Fn(&Origin) -> Origin) {
        for origin in &mut self.origins {
            *origin = renumbered(origin);
            assert!(origin.room_idx < n_rooms, "a place that there is not");
        }
        self.n_rooms = n_rooms;
    }

    /// What the memory says of a frame with these descriptors.
    ///
    /// Fewer descriptors than the neighbors asked for and the background are all asked but the farthest, which is the
    /// background. A memory without any, and a frame without any, give no room anything.
    ///
    /// # Panics
    /// When descriptors are of another width.
    pub fn recall(&self, descriptors: &Matrix) -> Recall {
        self.recall_visiting(descriptors, self.config.n_visited)
    }

    /// As [`Memory::recall`], each descriptor visiting so many lists, at least 1: [`Memory::n_lists`] find the
    /// nearest for certain.
    ///
    /// # Panics
    /// As before.
    pub fn recall_visiting(&self, descriptors: &Matrix, n_visited: usize) -> Recall {
        let rows = ByteRows::new(&self.coding.code(descriptors), self.coding.n_dimensions());
        let nearest = self.lists.search(&self.words, &rows, n_visited.max(1), self.config.n_neighbors + 1);
        Recall::new(self, &nearest, rows.n_rows())
    }

    /// What the memory is made of.
    pub fn to_parts(&self) -> Parts {
        let Rows { codes, frame_idxs, .. } = self.lists.rows();
        Parts {
            components: self.coding.components().clone(),
            offsets: self.coding.offsets().to_vec(),
            scale: self.coding.scale(),
            words: self.words.centers().to_vec(),
            codes,
            list_lengths: self.lists.lengths().to_vec(),
            frame_idxs,
            origins: self.origins.clone(),
        }
    }

    /// A memory of parts of unknown origin.
    ///
    /// # Errors
    /// Parts that do not fit together, parameters out of range.
    pub fn from_parts(parts: Parts, config: &Config, n_rooms: usize) -> Result<Self, MemoryError> {
        config.check().map_err(MemoryError::Damaged)?;
        let require = |holds: bool, otherwise: &str| match holds {
            true => Ok(()),
            false => Err(MemoryError::damaged(otherwise)),
        };
        let coding = Coding::from_parts(parts.components, parts.offsets, parts.scale)?;
        let width = coding.n_dimensions();
        let words = Words::from_parts(parts.words, width)?;
        require(parts.list_lengths.len() == words.n_words(), "it has not as many lists as words")?;
        let n_rows = parts.frame_idxs.len();
        let n_listed = parts.list_lengths.iter().try_fold(0, |sum: usize, &length| sum.checked_add(length));
        require(
            n_listed == Some(n_rows) && n_rows <= MAX_DESCRIPTORS && parts.codes.len() == n_rows * width,
            "its descriptors are not as many as its lists say",
        )?;
        let n_frames = parts.origins.len();
        require(
            parts.frame_idxs.iter().all(|&frame_idx| (frame_idx as usize) < n_frames),
            "a descriptor is of a frame that there is not",
        )?;
        require(
            parts.origins.iter().all(|origin| origin.room_idx < n_rooms),
            "a frame is of a place that there is not",
        )?;
        let lists = (0u32..).zip(&parts.list_lengths);
        let words_of_rows = lists.flat_map(|(word, &length)| std::iter::repeat_n(word, length)).collect();
        let rows = Rows { codes: parts.codes, words: words_of_rows, frame_idxs: parts.frame_idxs };
        Ok(Self {
            config: config.clone(),
            lists: Lists::new(&rows, words.n_words(), width),
            coding: Arc::new(coding),
            words: Arc::new(words),
            origins: parts.origins,
            n_rooms,
        })
    }

    /// Forgets frames until few enough descriptors are left.
    fn thin(&mut self) {
        if self.n_descriptors() > self.config.max_descriptors {
            let kept = thin::kept(&self.lists, &self.origins, self.n_rooms, self.config.max_descriptors);
            self.keep(&kept);
        }
    }

    /// Forgets the frames that are not kept.
    fn keep(&mut self, kept: &[bool]) {
        let mut n_kept = 0;
        let number = |&is_kept: &bool| {
            n_kept += u32::from(is_kept);
            is_kept.then(|| n_kept - 1)
        };
        let new_frame_idxs: Vec<Option<u32>> = kept.iter().map(number).collect();
        let width = self.coding.n_dimensions();
        let rows = self.lists.rows().renumbered(width, &new_frame_idxs);
        self.lists = Lists::new(&rows, self.words.n_words(), width);
        let mut kept = kept.iter();
        self.origins.retain(|_| kept.next().is_some_and(|&is_kept| is_kept));
    }
}

#[cfg(test)]
mod tests;
