//! SIFT and Harris-Laplace against OpenCV's on golden frames: the strong keypoints, and SIFT's descriptors.
//! `tests/golden/sift.py` and `tests/golden/harris_laplace.py` made them.

use roomsight_vision::camera::{Camera, Projection, View};
use roomsight_vision::describe::{Descriptor, SiftDescriptor};
use roomsight_vision::detect::{Detector, HarrisLaplace, Keypoint, Sift};
use roomsight_vision::image::{Image, Limits};
use std::fs;
use std::path::{Path, PathBuf};

const FRAMES: [&str; 3] = ["perspective_cloudy", "perspective_night", "omnidirectional_cloudy"];

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name)
}

/// A golden frame, in which nothing is masked: OpenCV knows no mirror.
fn frame(name: &str) -> (Image, View) {
    let bytes = fs::read(golden(&format!("{name}.png"))).unwrap();
    let image = Image::decode(&bytes, &Limits::default()).unwrap();
    let view = Camera::new(Projection::Perspective).view(image.width(), image.height());
    (image, view)
}

/// OpenCV's keypoints in a golden frame, each with the numbers that follow it.
fn expected(name: &str) -> Vec<(Keypoint, Vec<f32>)> {
    let text = fs::read_to_string(golden(&format!("{name}.txt"))).unwrap();
    let read = |line: &str| {
        let numbers: Vec<f32> = line.split(' ').map(|number| number.parse().unwrap()).collect();
        let [x, y, response, scale, rest @ ..] = &numbers[..] else { panic!("{line}") };
        (Keypoint { scale: *scale, ..Keypoint::new(*x, *y, *response) }, rest.to_vec())
    };
    text.lines().filter(|line| !line.starts_with('#')).map(read).collect()
}

/// Within `distance` pixels and a share of the scale.
fn is_near(a: &Keypoint, b: &Keypoint, distance: f32, share: f32) -> bool {
    (a.x - b.x).hypot(a.y - b.y) <= distance && (a.scale / b.scale - 1.0).abs() <= share
}

/// In degrees.
fn turn_between(a: f32, b: f32) -> f32 {
    ((a - b + 180.0).rem_euclid(360.0) - 180.0).abs()
}

fn distance(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f32>().sqrt()
}

#[test]
fn strong_sift_keypoints_of_opencv_are_found_and_described_alike() {
    for name in FRAMES {
        let (image, view) = frame(name);
        let found = Detector::Sift(Sift { target: 10_000, ..Sift::default() }).detect(&image, &view);
        let descriptors = Descriptor::Sift(SiftDescriptor::default()).describe(&image, &found, &view);
        let expected = expected(&format!("{name}_sift"));
        let mut n_found = 0;
        let mut distances = Vec::new();
        for (keypoint, rest) in &expected {
            let (angle, numbers) = rest.split_first().unwrap();
            let length = distance(numbers, &[0.0; 128]);
            let unit: Vec<f32> = numbers.iter().map(|number| number / length).collect();
            let is_near = |idx: &usize| is_near(&found[*idx], keypoint, 1.5, 0.2);
            let near: Vec<usize> = (0..found.len()).filter(is_near).collect();
            n_found += usize::from(!near.is_empty());
            let turn = |idx: usize| turn_between(found[idx].angle.unwrap().to_degrees(), *angle);
            let same_turn = near.into_iter().filter(|&idx| turn(idx) < 5.0);
            distances
                .extend(same_turn.map(|idx| distance(descriptors.row(idx), &unit)).min_by(f32::total_cmp));
        }
        distances.sort_by(f32::total_cmp);
        let (median, mean) =
            (distances[distances.len() / 2], distances.iter().sum::<f32>() / distances.len() as f32);
        let n = expected.len();
        println!(
            "{name}: {n_found} of {n}, {} of the same angle, distances {median} {mean}",
            distances.len()
        );
        assert!(n >= 40 && 10 * n_found >= 9 * n, "{name}: {n_found} of {n} are found");
        assert!(10 * distances.len() >= 9 * n_found, "{name}: {} have the same angle", distances.len());
        assert!(median < 0.08 && mean < 0.08, "{name}: {median} {mean}");
    }
}

/// OpenCV looks at four scales an octave where there are two here, and takes differences of Gaussians for the
/// Laplacian: places and scales agree less closely than SIFT's.
#[test]
fn strong_harris_laplace_keypoints_of_opencv_are_found() {
    for (name, least) in FRAMES.into_iter().zip([0.75, 0.75, 0.5]) {
        let (image, view) = frame(name);
        let all = HarrisLaplace { target: 10_000, ..HarrisLaplace::default() };
        let found = Detector::HarrisLaplace(all).detect(&image, &view);
        let expected = expected(&format!("{name}_harris_laplace"));
        let is_found = |keypoint: &Keypoint| {
            found.iter().any(|found| is_near(found, keypoint, 1.5_f32.max(0.75 * keypoint.scale), 0.42))
        };
        let n_found = expected.iter().filter(|(keypoint, _)| is_found(keypoint)).count();
        println!("{name}: {n_found} of {}, of {}", expected.len(), found.len());
        assert!(n_found as f32 >= least * expected.len() as f32, "{name}: {n_found} of {}", expected.len());
    }
}
