//! One step of a frame, to be run and measured.

use crate::drive::decode;
use crate::prepared::Prepared;
use roomsight_recognition::classify::memory::Memory;
use roomsight_recognition::model::{Config, Extractor, MachinesConfig, Scratch, Seen};
use roomsight_vision::describe::{Descriptor, SiftDescriptor, SurfDescriptor};
use roomsight_vision::detect::{Detector, Fast, FastThreshold, HarrisLaplace, Keypoint, Sift, Surf};
use roomsight_vision::matrix::Matrix;
use roomsight_vision::simd::{UnitColumns, UnitRows, nearest_columns};
use std::hint::black_box;

/// The steps of a frame: a JPEG to luma, luma to probabilities in four parts, these together (`core`), and all (`whole`).
pub const OF_A_FRAME: [&str; 7] = ["decode", "detect", "describe", "bag", "classify", "core", "whole"];

/// The words of a frame's descriptors, as `bag` finds them and by comparing each descriptor with all of them.
pub const WORDS: [&str; 2] = ["words", "words_of_all"];

/// What was found, to be held against what others find.
#[derive(Clone, Copy, Debug, Default)]
pub struct Found {
    /// How many: corners, keypoints.
    pub n: usize,
    /// The sum of where they are.
    pub places: f64,
}

/// A step over frames, which it takes by their number.
pub struct Step<'a> {
    n_frames: usize,
    run: Box<dyn FnMut(usize) -> Found + 'a>,
}

impl<'a> Step<'a> {
    /// One of [`OF_A_FRAME`] or [`WORDS`], or a detector with its descriptor (`sift`, `surf`, `harris_laplace`), or corners at a threshold
    /// (`fast_20`, `fast_8`).
    ///
    /// # Panics
    /// When there is none of this name.
    pub fn new(name: &str, prepared: &'a Prepared) -> Self {
        let Prepared { jpegs, images, features, model, parts } = prepared;
        let camera = model.camera();
        let view = camera.view(images[0].width(), images[0].height());
        let machines = model.config().machines().unwrap();
        let local: Vec<_> =
            features.iter().flat_map(|features| &features.seen).filter_map(Seen::local).collect();
        let n_frames = jpegs.len();
        let mut scratch = Scratch::default();
        match name {
            "decode" => Self::silent(n_frames, move |idx| decode(&jpegs[idx])),
            "detect" => Self::finding(n_frames, move |idx| machines.detector.detect(&images[idx], &view)),
            "describe" => Self::silent(n_frames, move |idx| {
                machines.descriptor.describe(&images[idx], &local[idx].keypoints, &view)
            }),
            "bag" => Self::silent(n_frames, move |idx| parts.vocabulary.row(local[idx].described())),
            "words" => Self::silent(n_frames, move |idx| parts.vocabulary.quantize(&local[idx].descriptors)),
            "words_of_all" => {
                let columns = UnitColumns::new(parts.vocabulary.centers());
                Self::silent(n_frames, move |idx| {
                    let mut words = vec![0; local[idx].descriptors.n_rows()];
                    nearest_columns(&UnitRows::new(&local[idx].descriptors), &columns, &mut words);
                    words
                })
            }
            "classify" => {
                let bags: Vec<_> =
                    local.iter().map(|local| parts.vocabulary.row(local.described())).collect();
                Self::silent(n_frames, move |idx| {
                    parts.calibration.probabilities(&parts.svm.decision_values(&bags[idx]))
                })
            }
            "core" => Self::silent(n_frames, move |idx| model.recognize(&images[idx], &mut scratch)),
            "whole" => Self::silent(n_frames, move |idx| model.recognize(&decode(&jpegs[idx]), &mut scratch)),
            "fast_20" | "fast_8" => {
                let threshold = if name == "fast_20" { 20 } else { 8 };
                let fast = Detector::Fast(Fast { threshold: FastThreshold::Fixed(threshold) });
                Self::finding(n_frames, move |idx| fast.detect(&images[idx], &view))
            }
            _ => {
                let (detector, descriptor) = method(name);
                let config =
                    Config::of_machines(MachinesConfig { detector, descriptor, ..MachinesConfig::default() });
                let extractor = Extractor::new(&config, camera.clone());
                Self::finding(n_frames, move |idx| {
                    extractor.extract(&images[idx], &mut scratch).keypoints().copied().collect()
                })
            }
        }
    }

    /// What a memory says of frames.
    pub fn recall(memory: &'a Memory, frames: &'a [Matrix]) -> Self {
        Self::silent(frames.len(), |idx| memory.recall(&frames[idx]))
    }

    fn silent<Out>(n_frames: usize, mut run: impl FnMut(usize) -> Out + 'a) -> Self {
        let run = move |idx| {
            black_box(run(black_box(idx)));
            Found::default()
        };
        Self { n_frames, run: Box::new(run) }
    }

    fn finding(n_frames: usize, mut run: impl FnMut(usize) -> Vec<Keypoint> + 'a) -> Self {
        let run = move |idx| {
            let keypoints = black_box(run(black_box(idx)));
            let places =
                keypoints.iter().map(|keypoint| f64::from(keypoint.x) + 1000.0 * f64::from(keypoint.y));
            Found { n: keypoints.len(), places: places.sum() }
        };
        Self { n_frames, run: Box::new(run) }
    }

    /// The number of frames.
    pub fn n_frames(&self) -> usize {
        self.n_frames
    }

    /// Takes the first frame, which is not counted.
    pub fn warm_up(&mut self) {
        (self.run)(0);
    }

    /// Takes one frame. Callgrind counts what happens in here: it is never a part of its caller.
    #[inline(never)]
    pub fn take_frame(&mut self, frame_idx: usize) -> Found {
        (self.run)(frame_idx)
    }
}

fn method(name: &str) -> (Detector, Descriptor) {
    let sift = || Descriptor::Sift(SiftDescriptor::default());
    match name {
        "sift" => (Detector::Sift(Sift::default()), sift()),
        "surf" => (Detector::Surf(Surf::default()), Descriptor::Surf(SurfDescriptor::default())),
        "harris_laplace" => (Detector::HarrisLaplace(HarrisLaplace::default()), sift()),
        _ => panic!("there is no step {name}"),
    }
}
