//! The match kernel: seconds to train on a sequence as long as those of COLD, on all threads, and milliseconds to
//! compare one frame with 700, on one thread. FAST, 300 corners, CS-LBP, the omnidirectional camera.
//!
//! `cargo bench -p roomsight-bench --bench match_kernel`

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first surprise")]

use image::DynamicImage;
use rayon::prelude::*;
use roomsight_bench::drive;
use roomsight_lab::simulate::CameraKind;
use roomsight_recognition::classify::svm::{DescriptorSet, MatchConfig, MatchSvm};
use roomsight_recognition::model::{Classifier, Config, Extractor, Model, Representation, Sample, Scratch};
use roomsight_vision::camera::{Camera, Mirror, Projection};
use roomsight_vision::image::Image;
use roomsight_vision::matrix::Matrix;
use std::hint::black_box;
use std::time::Instant;

/// As many as Lu et al. train on.
const N_FRAMES: usize = 754;
const N_COMPARED: usize = 700;
const N_ROUNDS: usize = 20;

fn main() {
    let matching = MatchConfig::default();
    let config = Config::default().with_bag(|machines| {
        machines.representation = Representation::Descriptors {};
        machines.classifier = Classifier::MatchSvm(matching.clone());
    });
    let (samples, camera) = described(&config);
    let samples: Vec<&Sample> = samples.iter().collect();
    let frames: Vec<&Matrix> = samples.iter().filter_map(|sample| sample.features.descriptors()).collect();

    let mut sets: Vec<DescriptorSet> =
        frames.iter().map(|descriptors| DescriptorSet::new(descriptors, matching.inner)).collect();
    let others = sets.split_off(N_COMPARED);
    let mut times: Vec<f64> =
        others.iter().take(N_ROUNDS).map(|frame| compare(&sets, frame, &matching)).collect();
    times.sort_by(f64::total_cmp);
    println!("one frame against {N_COMPARED}, median of {N_ROUNDS}: {:.1} ms", times[times.len() / 2]);

    let mut rooms: Vec<&str> = samples.iter().map(|sample| sample.room.as_str()).collect();
    rooms.sort_unstable();
    rooms.dedup();
    let label = |sample: &&Sample| rooms.binary_search(&sample.room.as_str()).unwrap();
    let labels: Vec<usize> = samples.iter().map(label).collect();
    let start = Instant::now();
    black_box(MatchSvm::train(&frames, &labels, rooms.len(), &matching).unwrap());
    println!("training on {N_FRAMES} frames: {:.1} s", start.elapsed().as_secs_f64());
    let start = Instant::now();
    black_box(Model::train(&samples, &config, camera, |_| ()).unwrap());
    println!("the same, and calibrated on held-out folds: {:.1} s", start.elapsed().as_secs_f64());
}

/// Frames of one drive.
fn described(config: &Config) -> (Vec<Sample>, Camera) {
    let simulation = drive::simulation(5.0);
    let render = |frame_idx: usize| {
        let frame =
            DynamicImage::from(simulation.render(frame_idx, CameraKind::Omnidirectional)).into_luma8();
        Image::from_pixels(640, 480, frame.into_raw()).unwrap()
    };
    let images: Vec<Image> = (0..N_FRAMES).into_par_iter().map(render).collect();
    let spread: Vec<Image> = images.iter().step_by(N_FRAMES / 40).cloned().collect();
    let camera = Camera::new(Projection::Omnidirectional(Mirror::estimate(&spread).unwrap()));
    let extractor = Extractor::new(config, camera.clone());
    let sample = |scratch: &mut Scratch, (frame_idx, image): (usize, &Image)| Sample {
        room: simulation.place(frame_idx).to_owned(),
        sequence: "drive".to_owned(),
        name: String::new(),
        pose: None,
        picture: None,
        features: extractor.extract(image, scratch),
    };
    (images.par_iter().enumerate().map_init(Scratch::default, sample).collect(), camera)
}

/// Milliseconds.
fn compare(sets: &[DescriptorSet], frame: &DescriptorSet, config: &MatchConfig) -> f64 {
    let start = Instant::now();
    sets.iter().for_each(|set| {
        black_box(set.match_kernel(frame, config.inner));
    });
    start.elapsed().as_secs_f64() * 1000.0
}
