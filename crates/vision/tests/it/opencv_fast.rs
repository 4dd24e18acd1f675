//! FAST-9 against OpenCV's on golden frames: the same corners with the same scores. `tests/golden/fast.py`
//! made the frames and the corners.

use roomsight_vision::camera::{Camera, Projection};
use roomsight_vision::detect::{Detector, Fast, FastThreshold};
use roomsight_vision::image::{Image, Limits};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// x, y, score.
type Corner = [u32; 3];

/// A golden frame and OpenCV's corners in it by threshold, row by row.
fn golden(name: &str) -> (Image, BTreeMap<u8, Vec<Corner>>) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    let frame = fs::read(folder.join(name).with_extension("png")).unwrap();
    let text = fs::read_to_string(folder.join(name).with_extension("txt")).unwrap();
    let mut corners: BTreeMap<u8, Vec<Corner>> = BTreeMap::new();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let numbers: Vec<u32> = line.split(' ').map(|number| number.parse().unwrap()).collect();
        let [threshold, corner @ ..]: [u32; 4] = numbers.try_into().unwrap();
        corners.entry(threshold as u8).or_default().push(corner);
    }
    (Image::decode(&frame, &Limits::default()).unwrap(), corners)
}

/// Nothing is masked: OpenCV knows no mirror.
fn detect(image: &Image, threshold: u8) -> Vec<Corner> {
    let view = Camera::new(Projection::Perspective).view(image.width(), image.height());
    let detector = Detector::Fast(Fast { threshold: FastThreshold::Fixed(threshold) });
    let keypoints = detector.detect(image, &view);
    keypoints.iter().map(|found| [found.x, found.y, found.response].map(|value| value as u32)).collect()
}

fn assert_same_as_opencv(name: &str) {
    let (image, expected) = golden(name);
    assert_eq!(Vec::from_iter(expected.keys().copied()), [10, 20, 40]);
    for (threshold, corners) in expected {
        assert_eq!(detect(&image, threshold), corners, "threshold {threshold}");
    }
}

#[test]
fn a_perspective_frame_has_the_corners_and_scores_of_opencv() {
    assert_same_as_opencv("perspective_cloudy");
}

#[test]
fn a_noisy_frame_of_odd_size_has_the_corners_and_scores_of_opencv() {
    assert_same_as_opencv("perspective_night");
}

#[test]
fn an_omnidirectional_frame_has_the_corners_and_scores_of_opencv() {
    assert_same_as_opencv("omnidirectional_cloudy");
}
