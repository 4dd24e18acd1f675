//! Frames to samples: each is read once, described, and its pixels dropped.

use super::{Dataset, Look, Problem, near_pairs};
use rayon::prelude::*;
use roomsight_recognition::model::{self, Extractor, Sample, Scratch};
use roomsight_vision::camera::Mirror;
use roomsight_vision::image::{Image, Limits};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// Frames that the mirror is searched in.
const N_MIRROR_FRAMES: usize = 40;

/// The frames of a data set, described.
#[derive(Debug, Default)]
pub struct Described {
    /// In the order of the frames.
    pub samples: Vec<Sample>,
    /// Which frame each sample is.
    pub frame_idxs: Vec<usize>,
    /// What tells the bytes of each sample's picture from others.
    pub(super) digests: Vec<blake3::Hash>,
    /// What each sample's picture looks like.
    pub looks: Vec<Look>,
    /// The frames that could not be read.
    pub problems: Vec<Problem>,
    /// The frames of which only a part could be read.
    pub notes: Vec<Problem>,
}

/// What is kept of a frame that was read.
pub(super) struct Read {
    pub sample: Sample,
    pub digest: blake3::Hash,
    pub look: Look,
    pub is_damaged: bool,
}

/// A sample whose picture has the same bytes as another's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Copied {
    /// Which sample.
    pub sample_idx: usize,
    /// The sample that it is a copy of, of these or of those that trained.
    pub of_idx: usize,
    /// Its picture, and what it is a copy of.
    pub problem: Problem,
}

impl Dataset {
    /// Describes all frames in parallel, in a fixed order; what was seen before is not looked at again. `on_frame` is called after each.
    pub fn describe(&self, extractor: &Extractor, limits: &Limits, on_frame: impl Fn() + Sync) -> Described {
        let describe =
            |scratch: &mut Scratch, (frame, before): (&super::Frame, Option<Result<Read, Problem>>)| {
                if let Some(before) = before {
                    on_frame();
                    return before;
                }
                let described = frame.read_encoded(limits).and_then(|bytes| {
                    let image = extractor.decode(&bytes, limits).map_err(|error| frame.undecoded(&error))?;
                    let scan = frame.read_scan_for(extractor)?;
                    let seen = model::Frame { image: &image, scan: scan.as_deref() };
                    let features = extractor.extract(seen, scratch);
                    let (room, sequence) = (frame.room.clone(), frame.sequence.clone());
                    let (digest, look) = (blake3::hash(&bytes), Look::of(&image));
                    let (name, pose) = (self.name_of(&frame.path), frame.pose);
                    let sample =
                        Sample { room, sequence, name, pose, picture: Some(short(&digest)), features };
                    Ok(Read { sample, digest, look, is_damaged: image.damaged_rows() > 0 })
                });
                on_frame();
                described
            };
        let results: Vec<Result<_, Problem>> = self
            .frames
            .par_iter()
            .zip(self.seen_before(extractor))
            .map_init(Scratch::default, describe)
            .collect();
        let mut described = Described::default();
        for (frame_idx, result) in results.into_iter().enumerate() {
            match result {
                Ok(read) => {
                    described.samples.push(read.sample);
                    described.digests.push(read.digest);
                    described.looks.push(read.look);
                    described.frame_idxs.push(frame_idx);
                    if read.is_damaged {
                        let reason = "rows of it are damaged or missing: the others are taken";
                        described.notes.push(Problem::new(&self.frames[frame_idx].path, reason));
                    }
                }
                Err(problem) => described.problems.push(problem),
            }
        }
        described
    }

    /// The folder of the data set, which may be known by a list in it.
    pub fn folder(&self) -> &Path {
        if self.root.is_dir() { &self.root } else { self.root.parent().unwrap_or(&self.root) }
    }

    /// What a picture is called: its path within the data set.
    pub fn name_of(&self, picture: &Path) -> String {
        picture.strip_prefix(self.folder()).unwrap_or(picture).display().to_string()
    }

    /// Finds the mirror of the camera in frames spread evenly over the data set. Frames that cannot be read
    /// are left to [`Dataset::describe`] to report.
    pub fn find_mirror(&self, limits: &Limits) -> Option<Mirror> {
        let n_frames = self.frames.len().min(N_MIRROR_FRAMES);
        let spread: Vec<usize> = (0..n_frames).map(|idx| idx * self.frames.len() / n_frames).collect();
        let images: Vec<Image> =
            spread.par_iter().filter_map(|&idx| self.frames[idx].read(limits).ok()).collect();
        Mirror::estimate(&images)
    }
}

impl Described {
    /// The samples that say nothing beside others, in order: of pictures with the same bytes all but the first
    /// where they show one room, and all where they are said to show several, since one of these is wrong.
    pub fn copies(&self, dataset: &Dataset) -> Vec<Copied> {
        let mut same: HashMap<&[u8], Vec<usize>> = HashMap::new();
        for (sample_idx, digest) in self.digests.iter().enumerate() {
            same.entry(digest.as_bytes()).or_default().push(sample_idx);
        }
        let path = |sample_idx: usize| &dataset.frames[self.frame_idxs[sample_idx]].path;
        let copied = |sample_idx: usize, other_idx: usize, reason: &str| {
            let problem = Problem::new(path(sample_idx), reason).with(path(other_idx).display().to_string());
            Copied { sample_idx, of_idx: other_idx, problem }
        };
        let mut copies = Vec::new();
        for same in same.into_values() {
            let (first, others) = (same[0], &same[1..]);
            let is_elsewhere = |other: &&usize| self.samples[**other].room != self.samples[first].room;
            if let Some(&elsewhere) = others.iter().find(is_elsewhere) {
                let reason = "the same picture, byte for byte, lies in another room too: keep it in one";
                copies.push(copied(first, elsewhere, reason));
                copies.extend(others.iter().map(|&other| copied(other, first, reason)));
            } else {
                let reason = "a copy of another picture of its room, byte for byte";
                copies.extend(others.iter().map(|&other| copied(other, first, reason)));
            }
        }
        copies.sort_by_key(|copied| copied.sample_idx);
        copies
    }

    /// Where there are no drives: the samples whose pictures are nearly those of others of their room, all but the first.
    fn near_copies(&self, dataset: &Dataset) -> Vec<Copied> {
        let is_lone = |idx: usize| self.samples[idx].sequence.is_empty();
        let mut copies: BTreeMap<usize, Copied> = BTreeMap::new();
        for [of_idx, sample_idx] in near_pairs(&self.looks.iter().collect::<Vec<_>>()) {
            let is_same_room = self.samples[of_idx].room == self.samples[sample_idx].room;
            if is_lone(of_idx) && is_lone(sample_idx) && is_same_room && !copies.contains_key(&of_idx) {
                let path = |idx: usize| &dataset.frames[self.frame_idxs[idx]].path;
                let reason = "nearly another picture of its room";
                let problem = Problem::new(path(sample_idx), reason).with(path(of_idx).display().to_string());
                copies.entry(sample_idx).or_insert(Copied { sample_idx, of_idx, problem });
            }
        }
        copies.into_values().collect()
    }

    /// What training takes: no picture twice, nor nearly, so that none is on both sides of a fold. Copies become problems.
    pub fn without_copies(self, dataset: &Dataset) -> Self {
        let copies = self.copies(dataset);
        let others = self.without(copies);
        let near_copies = others.near_copies(dataset);
        others.without(near_copies)
    }

    /// What can be measured with a model that was trained on `trained`: other pictures. Those that trained, be
    /// it as another file, become problems.
    pub fn without_trained(self, dataset: &Dataset, trained: &Self) -> Self {
        let digests = trained.digests.iter().enumerate();
        let trained: HashMap<&[u8], usize> =
            digests.map(|(idx, digest)| (digest.as_bytes().as_slice(), idx)).collect();
        let copied = |sample_idx: usize| {
            let of_idx = *trained.get(self.digests[sample_idx].as_bytes().as_slice())?;
            let path = &dataset.frames[self.frame_idxs[sample_idx]].path;
            let reason = "the same picture, byte for byte, is among those that train: not answered";
            Some(Copied { sample_idx, of_idx, problem: Problem::new(path, reason) })
        };
        let copies = (0..self.samples.len()).filter_map(copied).collect();
        self.without(copies)
    }

    /// Leaves out these samples, given in order.
    fn without(mut self, left_out: Vec<Copied>) -> Self {
        let mut idxs = left_out.iter().map(|copied| copied.sample_idx).peekable();
        let keeps: Vec<bool> = (0..self.samples.len()).map(|idx| idxs.next_if_eq(&idx).is_none()).collect();
        keep(&mut self.samples, &keeps);
        keep(&mut self.frame_idxs, &keeps);
        keep(&mut self.digests, &keeps);
        keep(&mut self.looks, &keeps);
        self.problems.extend(left_out.into_iter().map(|copied| copied.problem));
        self
    }
}

/// The first bytes of a digest.
pub(super) fn short(digest: &blake3::Hash) -> u64 {
    digest.as_bytes().first_chunk().map_or(0, |first| u64::from_le_bytes(*first))
}

/// Keeps the items that are marked.
fn keep<T>(items: &mut Vec<T>, keeps: &[bool]) {
    let mut keeps = keeps.iter();
    items.retain(|_| keeps.next() == Some(&true));
}
