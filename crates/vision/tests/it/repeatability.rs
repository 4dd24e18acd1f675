//! How well keypoints are found again, and matched by their descriptors, when a frame is turned, scaled and
//! lit otherwise.
//!
//! Mikolajczyk and Schmid, "A performance evaluation of local descriptors", PAMI 27, 2005, call the first
//! rate repeatability and the second recall. [`rates`] measures any detector and descriptor.

use roomsight_vision::camera::{Camera, Projection};
use roomsight_vision::describe::{Descriptor, SurfDescriptor};
use roomsight_vision::detect::{Detector, Surf};
use roomsight_vision::image::{Image, Limits};
use std::fs;
use std::path::Path;

const FRAMES: [&str; 3] = ["perspective_cloudy", "perspective_night", "omnidirectional_cloudy"];

/// A keypoint is found again within so many pixels, times how much the frame is enlarged.
const NEAR: f32 = 2.0;

/// What is done to a frame.
#[derive(Clone, Copy, Debug)]
struct Change {
    /// Radians, about the frame's center.
    turn: f32,
    /// How much larger it becomes.
    zoom: f32,
    gain: f32,
    gamma: f32,
}

const NONE: Change = Change { turn: 0.0, zoom: 1.0, gain: 1.0, gamma: 1.0 };

/// Shares of the keypoints whose place is in the changed frame.
#[derive(Debug)]
struct Rates {
    /// Those that are found there again.
    repeated: f32,
    /// Those whose nearest descriptor of the changed frame belongs to that place.
    matched: f32,
}

impl Change {
    /// Where a place of the frame comes to lie.
    fn place(&self, image: &Image, (x, y): (f32, f32)) -> (f32, f32) {
        let center = ((image.width() - 1) as f32 / 2.0, (image.height() - 1) as f32 / 2.0);
        let (dx, dy) = (self.zoom * (x - center.0), self.zoom * (y - center.1));
        let (sine, cosine) = self.turn.sin_cos();
        (center.0 + cosine * dx - sine * dy, center.1 + sine * dx + cosine * dy)
    }

    /// The changed frame, as large as the frame; beyond it the border is repeated.
    fn of(&self, image: &Image) -> Image {
        let back = Change { turn: -self.turn, zoom: 1.0 / self.zoom, ..*self };
        let light = |value: f32| 255.0 * (self.gain * value / 255.0).clamp(0.0, 1.0).powf(self.gamma);
        let pixels = (0..image.width() * image.height()).map(|idx| {
            let (x, y) = back.place(image, ((idx % image.width()) as f32, (idx / image.width()) as f32));
            light(interpolated(image, x, y)).round() as u8
        });
        Image::from_pixels(image.width(), image.height(), pixels.collect()).unwrap()
    }
}

fn interpolated(image: &Image, x: f32, y: f32) -> f32 {
    let x = x.clamp(0.0, (image.width() - 1) as f32);
    let y = y.clamp(0.0, (image.height() - 1) as f32);
    let at = |x: f32, y: f32| {
        let (x, y) = ((x as usize).min(image.width() - 1), (y as usize).min(image.height() - 1));
        f32::from(image.row(y)[x])
    };
    let (right, down) = (x.fract(), y.fract());
    let row = |y: f32| at(x, y) * (1.0 - right) + at(x + 1.0, y) * right;
    row(y) * (1.0 - down) + row(y + 1.0) * down
}

/// The rates over all golden frames.
fn rates(detector: &Detector, descriptor: &Descriptor, change: &Change) -> Rates {
    let (mut n_visible, mut n_repeated, mut n_matched) = (0, 0, 0);
    for name in FRAMES {
        let file =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name).with_extension("png");
        let image = Image::decode(&fs::read(file).unwrap(), &Limits::default()).unwrap();
        let changed = change.of(&image);
        let view = Camera::new(Projection::Perspective).view(image.width(), image.height());
        let found = [&image, &changed].map(|image| detector.detect(image, &view));
        let rows = [0, 1].map(|idx| descriptor.describe([&image, &changed][idx], &found[idx], &view));
        for (keypoint, row) in found[0].iter().zip(rows[0].rows()) {
            let (x, y) = change.place(&image, (keypoint.x, keypoint.y));
            let scale = keypoint.scale * change.zoom;
            // With room for what its descriptor looks at.
            if !view.contains(x, y, 15.0 * scale)
                || !view.contains(keypoint.x, keypoint.y, 15.0 * keypoint.scale)
            {
                continue;
            }
            let is_there = |idx: usize| {
                let other = &found[1][idx];
                (other.x - x).hypot(other.y - y) <= NEAR * change.zoom.max(1.0)
                    && (0.67..1.5).contains(&(other.scale / scale))
            };
            let similarity =
                |idx: usize| -> f32 { rows[1].row(idx).iter().zip(row).map(|(a, b)| a * b).sum() };
            let nearest = (0..found[1].len()).max_by(|&a, &b| similarity(a).total_cmp(&similarity(b)));
            n_visible += 1;
            n_repeated += usize::from((0..found[1].len()).any(is_there));
            n_matched += usize::from(nearest.is_some_and(is_there));
        }
    }
    assert!(n_visible > 50, "{n_visible} keypoints are too few to tell");
    let share = |n: usize| n as f32 / n_visible as f32;
    Rates { repeated: share(n_repeated), matched: share(n_matched) }
}

/// Asserts that SURF's rates are at least `repeated` and `matched`.
fn assert_surf(change: Change, repeated: f32, matched: f32) {
    // Half the light leaves a quarter of the determinant.
    let detector = Detector::Surf(Surf { threshold: 1.0, target: 150, ..Surf::default() });
    for extended in [false, true] {
        let descriptor = Descriptor::Surf(SurfDescriptor { extended });
        let rates = rates(&detector, &descriptor, &change);
        assert!(rates.repeated >= repeated && rates.matched >= matched, "{change:?} {extended}: {rates:?}");
    }
}

#[test]
fn surf_sees_the_same_in_the_same_frame() {
    assert_surf(NONE, 1.0, 1.0);
}

#[test]
fn surf_stands_rotation() {
    // Box filters stand upright: they stand quarters of a turn better than others.
    for (degrees, repeated, matched) in
        [(10.0f32, 0.6, 0.42), (45.0, 0.52, 0.38), (90.0, 0.88, 0.85), (200.0, 0.52, 0.35)]
    {
        assert_surf(Change { turn: degrees.to_radians(), ..NONE }, repeated, matched);
    }
}

#[test]
fn surf_stands_scale() {
    for (zoom, repeated, matched) in [(0.7, 0.45, 0.36), (1.25, 0.8, 0.7), (1.4, 0.7, 0.6)] {
        assert_surf(Change { zoom, ..NONE }, repeated, matched);
    }
}

#[test]
fn surf_stands_light() {
    for (gain, gamma) in [(0.5, 1.0), (1.0, 1.5), (0.8, 0.7)] {
        assert_surf(Change { gain, gamma, ..NONE }, 0.8, 0.65);
    }
}
