//! Milliseconds a 640 x 480 frame takes to find and describe keypoints, one thread, each method; with a Python
//! that has OpenCV beside it, in turn, round after round.
//!
//! `cargo bench --bench features` takes from the environment: `PYTHON`, a Python with OpenCV; `ROUNDS`, of
//! which the medians are printed [5].

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first surprise")]

mod lab;

use image::GrayImage;
use roomsight_lab::simulate::CameraKind;
use roomsight_recognition::model::{Config, Extractor, MachinesConfig, Scratch};
use roomsight_vision::camera::{Camera, Projection};
use roomsight_vision::describe::{Descriptor, SiftDescriptor, SurfDescriptor};
use roomsight_vision::detect::{Detector, HarrisLaplace, Sift, Surf};
use roomsight_vision::image::Image;
use std::collections::BTreeMap;
use std::env;
use std::hint::black_box;
use std::path::PathBuf;
use std::process::Command;
use std::time::Instant;

const N_FRAMES: usize = 10;

fn main() {
    let frames = frames();
    let folder = tempfile::tempdir().unwrap();
    let write = |(idx, frame): (usize, &GrayImage)| {
        let path = folder.path().join(format!("{idx}.png"));
        frame.save(&path).unwrap();
        path
    };
    let paths: Vec<PathBuf> = frames.iter().enumerate().map(write).collect();
    let images: Vec<Image> =
        frames.iter().map(|frame| Image::from_pixels(640, 480, frame.as_raw().clone()).unwrap()).collect();
    let n_rounds = env::var("ROUNDS").map_or(5, |rounds| rounds.parse().unwrap());
    let mut measured: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for _ in 0..n_rounds {
        for (name, detector, descriptor) in methods() {
            let machines = MachinesConfig { detector, descriptor, ..MachinesConfig::default() };
            let config = Config::of_machines(machines);
            measured.entry(format!("{name}, roomsight")).or_default().push(milliseconds(&config, &images));
        }
        for (name, milliseconds) in opencv(&paths) {
            measured.entry(format!("{name}, OpenCV")).or_default().push(milliseconds);
        }
    }
    println!("medians of {n_rounds} rounds over {N_FRAMES} simulated frames, at most 300 keypoints");
    for (name, rounds) in &mut measured {
        println!("{name:28} {:7.2} ms", median(rounds));
    }
}

fn methods() -> [(&'static str, Detector, Descriptor); 4] {
    let sift = || Descriptor::Sift(SiftDescriptor::default());
    [
        ("fast, cs_lbp", Detector::default(), Descriptor::default()),
        ("sift", Detector::Sift(Sift::default()), sift()),
        ("surf", Detector::Surf(Surf::default()), Descriptor::Surf(SurfDescriptor::default())),
        ("harris_laplace", Detector::HarrisLaplace(HarrisLaplace::default()), sift()),
    ]
}

/// Simulated frames of the perspective camera, evenly spread along a drive.
fn frames() -> Vec<GrayImage> {
    let simulation = lab::drive(0.2);
    let stride = simulation.n_frames() / N_FRAMES;
    let render =
        |idx: usize| image::DynamicImage::from(simulation.render(idx * stride, CameraKind::Perspective));
    (0..N_FRAMES).map(|idx| render(idx).into_luma8()).collect()
}

/// The median over the frames.
fn milliseconds(config: &Config, images: &[Image]) -> f64 {
    let extractor = Extractor::new(config, Camera::new(Projection::Perspective));
    let mut scratch = Scratch::default();
    let mut times: Vec<f64> = images
        .iter()
        .map(|image| {
            let start = Instant::now();
            black_box(extractor.extract(image, &mut scratch));
            start.elapsed().as_secs_f64() * 1000.0
        })
        .collect();
    median(&mut times)
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn opencv(paths: &[PathBuf]) -> BTreeMap<String, f64> {
    let Ok(python) = env::var("PYTHON") else { return BTreeMap::new() };
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/opencv.py");
    let output = Command::new(python).arg(script).args(paths).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}
