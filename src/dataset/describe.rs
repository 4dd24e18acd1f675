//! Frames to samples: each is read once, described, and its pixels dropped.

use super::{Dataset, Problem};
use crate::camera::Mirror;
use crate::image::{Image, Limits};
use crate::model::{Extractor, Sample, Scratch};
use rayon::prelude::*;

/// Frames that the mirror is searched in.
const N_MIRROR_FRAMES: usize = 40;

/// The frames of a data set, described.
#[derive(Debug, Default)]
pub struct Described {
    /// In the order of the frames.
    pub samples: Vec<Sample>,
    /// Which frame each sample is.
    pub frame_idxs: Vec<usize>,
    /// The frames that could not be read.
    pub problems: Vec<Problem>,
}

impl Dataset {
    /// Describes all frames in parallel, in a fixed order. `on_frame` is called after each.
    pub fn describe(&self, extractor: &Extractor, limits: &Limits, on_frame: impl Fn() + Sync) -> Described {
        let limits = &limits.enough_for(extractor.longest_side());
        let describe = |scratch: &mut Scratch, frame: &super::Frame| {
            let features = frame.read(limits).map(|image| extractor.extract(&image, scratch));
            on_frame();
            features.map(|features| Sample {
                place: frame.place.clone(),
                sequence: frame.sequence.clone(),
                features,
            })
        };
        let results: Vec<Result<Sample, Problem>> =
            self.frames.par_iter().map_init(Scratch::default, describe).collect();
        let mut described = Described::default();
        for (frame_idx, result) in results.into_iter().enumerate() {
            match result {
                Ok(sample) => {
                    described.samples.push(sample);
                    described.frame_idxs.push(frame_idx);
                }
                Err(problem) => described.problems.push(problem),
            }
        }
        described
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
