//! SURF's detector: Bay, Ess, Tuytelaars, Van Gool, "Speeded-up robust features (SURF)", CVIU 110, 2008.
//!
//! Keypoints are maxima, over the image and over scale, of the determinant of a Hessian whose second
//! derivatives are box filters L pixels wide, L = 9 standing for a Gaussian of sigma 1.2 (section 3):
//!
//! det = Dxx Dyy - (0.9 Dxy)^2
//!
//! A keypoint of scale s points where the Haar responses of side 4s within 6s of it sum to the longest
//! vector in any window of 60 degrees (section 4.1). Here the window moves in steps of 5 degrees.

mod hessian;

use super::haar::HaarSampler;
use super::{Keypoint, check_target, in_reading_order, keep_strongest};
use crate::camera::View;
use crate::image::{Image, Integral};
use hessian::Octave;
use serde::{Deserialize, Serialize};
use std::f32::consts::TAU;

/// What the corners of the largest box filter reach, in scales: it is 7.5 scales long and 5 wide.
const REACH: f32 = 4.5;

/// Steps of the window that sums directions, and the width of the window.
const N_ANGLES: usize = 72;
const WINDOW: usize = N_ANGLES / 6;

/// Within this many scales directions are summed, weighted by a Gaussian of sigma [`DIRECTION_SIGMA`].
const DIRECTION_RADIUS: i32 = 6;
const DIRECTION_SIGMA: f32 = 2.0;

/// The fast-Hessian detector of SURF.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Surf {
    /// The lowest determinant, in squared gray values; from 0. Below it there is only noise.
    pub threshold: f32,
    /// How many keypoints to keep, the strongest ones.
    pub target: usize,
    /// How many times the filters double, from 1 to 5.
    pub n_octaves: usize,
    /// Filters an octave, from 3 to 6: 9, 15, 21, 27 pixels wide for the 4 layers of the first.
    pub n_layers: usize,
    /// Whether to leave out the keypoints' directions: what is described then lies upright, or along the
    /// radial direction of a mirror.
    pub upright: bool,
}

impl Default for Surf {
    fn default() -> Self {
        Self { threshold: 5.0, target: 300, n_octaves: 4, n_layers: 4, upright: false }
    }
}

impl Surf {
    /// What is wrong with the parameters, if anything.
    pub(super) fn check(&self) -> Result<(), String> {
        if !(self.threshold.is_finite() && self.threshold >= 0.0) {
            return Err(format!("the SURF threshold must be 0 or more, not {}", self.threshold));
        }
        if !(1..=5).contains(&self.n_octaves) {
            return Err(format!("SURF takes 1 to 5 octaves, not {}", self.n_octaves));
        }
        if !(3..=6).contains(&self.n_layers) {
            return Err(format!("a SURF octave has 3 to 6 layers, not {}", self.n_layers));
        }
        check_target(self.target)
    }

    /// See [`super::Detector::detect`]. The response is the determinant.
    pub(super) fn detect(&self, image: &Image, view: &View) -> Vec<Keypoint> {
        let octaves = || (0..self.n_octaves).map(|octave_idx| Octave::new(octave_idx, self.n_layers));
        let seam = match octaves().map(|octave| octave.reach()).max() {
            Some(reach) if view.wraps() => reach.min(image.width()),
            _ => 0,
        };
        let integral = Integral::new(image, seam);
        let mut keypoints = Vec::new();
        for octave in octaves() {
            octave.detect(&integral, self.threshold, |mut keypoint| {
                keypoint.x -= seam as f32;
                if (0.0..image.width() as f32).contains(&keypoint.x)
                    && view.contains(keypoint.x, keypoint.y, REACH * keypoint.scale)
                {
                    keypoints.push(keypoint);
                }
            });
        }
        keep_strongest(&mut keypoints, self.target);
        keypoints.sort_by(in_reading_order);
        if !self.upright {
            direct(&mut keypoints, image, view);
        }
        keypoints
    }
}

/// Gives each keypoint the direction of its surroundings.
fn direct(keypoints: &mut [Keypoint], image: &Image, view: &View) {
    let half_of = |keypoint: &Keypoint| ((2.0 * keypoint.scale).round() as usize).max(1);
    let sampler = HaarSampler::new(image, view, keypoints.iter().map(half_of).max().unwrap_or_default());
    let disk = disk();
    for keypoint in keypoints {
        let half = half_of(keypoint);
        let radius = DIRECTION_RADIUS as f32 * keypoint.scale;
        let is_inside = sampler.contains_all(keypoint.x, keypoint.y, radius, half);
        let responses = disk.iter().map(|&(dx, dy, weight)| {
            let (x, y) = (keypoint.x + dx * keypoint.scale, keypoint.y + dy * keypoint.scale);
            let (right, down) =
                if is_inside { sampler.response_inside(x, y, half) } else { sampler.response(x, y, half) };
            (weight * right, weight * down)
        });
        keypoint.angle = dominant_angle(responses);
    }
}

/// Where directions are sampled round a keypoint, in scales, and their weights.
fn disk() -> Vec<(f32, f32, f32)> {
    let side = -DIRECTION_RADIUS..=DIRECTION_RADIUS;
    let square = side.clone().flat_map(|dy| side.clone().map(move |dx| (dx, dy)));
    let disk = square.filter(|(dx, dy)| dx * dx + dy * dy <= DIRECTION_RADIUS * DIRECTION_RADIUS);
    disk.map(|(dx, dy)| {
        let (dx, dy) = (dx as f32, dy as f32);
        (dx, dy, (-(dx * dx + dy * dy) / (2.0 * DIRECTION_SIGMA * DIRECTION_SIGMA)).exp())
    })
    .collect()
}

/// The direction of the longest sum of the vectors in any window of 60 degrees; `None` when all are zero.
fn dominant_angle(vectors: impl Iterator<Item = (f32, f32)>) -> Option<f32> {
    let mut bins = [(0.0, 0.0); N_ANGLES];
    for (x, y) in vectors {
        let bin = (angle_of(x, y) / TAU * N_ANGLES as f32) as usize % N_ANGLES;
        bins[bin].0 += x;
        bins[bin].1 += y;
    }
    let (mut longest, mut angle) = (0.0, None);
    for first in 0..N_ANGLES {
        let window = (first..first + WINDOW).map(|bin| bins[bin % N_ANGLES]);
        let (x, y) = window.fold((0.0, 0.0), |sum: (f32, f32), bin| (sum.0 + bin.0, sum.1 + bin.1));
        let squared = x * x + y * y;
        if squared > longest {
            (longest, angle) = (squared, Some(angle_of(x, y)));
        }
    }
    angle
}

/// From 0 up to 2 pi.
fn angle_of(x: f32, y: f32) -> f32 {
    let angle = y.atan2(x);
    if angle < 0.0 { angle + TAU } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Mask, Mirror, Projection};
    use proptest::prelude::*;
    use rand::{Rng, SeedableRng};

    /// Bright Gaussian blobs (x, y, sigma) on gray.
    fn blobs(width: usize, height: usize, blobs: &[(f32, f32, f32)]) -> Image {
        let value = |idx: usize| {
            let (x, y) = ((idx % width) as f32, (idx / width) as f32);
            let light = |&(center_x, center_y, sigma): &(f32, f32, f32)| {
                let squared = (x - center_x).powi(2) + (y - center_y).powi(2);
                150.0 * (-squared / (2.0 * sigma * sigma)).exp()
            };
            (50.0 + blobs.iter().map(light).sum::<f32>()).round() as u8
        };
        Image::from_pixels(width, height, (0..width * height).map(value).collect()).unwrap()
    }

    fn noise(width: usize, height: usize) -> Image {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let pixels = (0..width * height).map(|_| random.random()).collect();
        Image::from_pixels(width, height, pixels).unwrap()
    }

    /// Noise without what is smaller than a few pixels.
    fn smooth_noise(side: usize) -> Image {
        let rough = noise(side + 8, side + 8);
        let mean = |x: usize, y: usize| {
            let rows =
                (y..y + 8).map(|y| rough.row(y)[x..x + 8].iter().map(|&pixel| u32::from(pixel)).sum::<u32>());
            ((rows.sum::<u32>() / 64).saturating_sub(64) * 2).min(255) as u8
        };
        Image::from_pixels(side, side, (0..side * side).map(|idx| mean(idx % side, idx / side)).collect())
            .unwrap()
    }

    fn view_of(image: &Image, projection: Projection) -> View {
        Camera::new(projection).view(image.width(), image.height())
    }

    #[test]
    fn blobs_are_found_where_they_are_and_the_larger_the_larger_they_are() {
        let expected = [(60.3, 50.8, 2.5), (150.0, 60.0, 4.0), (80.5, 130.0, 7.0), (200.2, 140.7, 10.0)];
        let image = blobs(280, 220, &expected);
        let found =
            Surf { target: 4, ..Surf::default() }.detect(&image, &view_of(&image, Projection::Perspective));
        for (x, y, sigma) in expected {
            let is_it = |keypoint: &&Keypoint| (keypoint.x - x).hypot(keypoint.y - y) < 0.15 * sigma;
            let keypoint = found.iter().find(is_it).unwrap_or_else(|| panic!("none at {x} {y}: {found:?}"));
            // Boxes see Gaussian blobs a quarter smaller.
            assert!((0.68..0.83).contains(&(keypoint.scale / sigma)), "{sigma} {keypoint:?}");
        }
    }

    #[test]
    fn the_direction_is_where_most_vectors_of_60_degrees_point() {
        let vector = |angle: f32, length: f32| (length * angle.cos(), length * angle.sin());
        for expected in [0.05f32, 1.0, 2.2, 3.6, 6.2] {
            let near = [-0.3, -0.1, 0.1, 0.3].map(|offset| vector(expected + offset, 1.0));
            let others = [1.5, 2.5, 3.5, 4.5].map(|offset| vector(expected + offset, 2.0));
            let angle = dominant_angle(near.into_iter().chain(others)).unwrap();
            assert!((0.0..TAU).contains(&angle));
            assert!((angle - expected).abs() < 1e-3, "{angle} {expected}");
        }
        assert_eq!(dominant_angle([(0.0, 0.0)].into_iter()), None);
    }

    #[test]
    fn directions_turn_with_the_frame() {
        // By a quarter, which needs no interpolation.
        let image = smooth_noise(150);
        let pixels = (0..150 * 150).map(|idx| image.row(149 - idx % 150)[idx / 150]).collect();
        let turned = Image::from_pixels(150, 150, pixels).unwrap();
        let view = view_of(&image, Projection::Perspective);
        let surf = Surf { n_octaves: 1, ..Surf::default() };
        let (found, found_turned) = (surf.detect(&image, &view), surf.detect(&turned, &view));
        assert!(found.len() > 20 && found_turned.len() == found.len());
        let n_turned = found.iter().filter(|keypoint| {
            let (x, y) = (149.0 - keypoint.y, keypoint.x);
            let is_it = |other: &&Keypoint| (other.x - x).hypot(other.y - y) < 0.01;
            let angle = found_turned.iter().find(is_it).and_then(|other| other.angle).unwrap();
            (angle - keypoint.angle.unwrap() - TAU / 4.0).cos() > 0.99
        });
        assert!(n_turned.count() * 10 >= found.len() * 9);
        let upright = Surf { upright: true, ..surf }.detect(&image, &view);
        assert!(upright.iter().all(|keypoint| keypoint.angle.is_none()));
        assert_eq!(upright.len(), found.len());
    }

    #[test]
    fn the_strongest_are_kept_row_by_row() {
        let image = noise(150, 120);
        let view = view_of(&image, Projection::Perspective);
        let all = Surf { target: usize::MAX, ..Surf::default() }.detect(&image, &view);
        let mut expected = all.clone();
        expected.sort_by(|a, b| b.response.total_cmp(&a.response));
        let weakest = expected[19].response;
        let kept = Surf { target: 20, ..Surf::default() }.detect(&image, &view);
        assert!(all.len() > 40 && kept.len() == 20);
        assert!(kept.iter().all(|keypoint| keypoint.response >= weakest));
        assert!(kept.is_sorted_by(|a, b| (a.y, a.x) <= (b.y, b.x)));
    }

    #[test]
    fn no_filter_touches_what_is_hidden() {
        let image = noise(200, 150);
        let hidden = Image::from_pixels(2, 1, vec![255, 0]).unwrap();
        let masked = Camera { projection: Projection::Perspective, mask: Some(Mask::new(hidden)) };
        let found = Surf::default().detect(&image, &masked.view(200, 150));
        assert!(!found.is_empty());
        assert!(found.iter().all(|keypoint| keypoint.x + REACH * keypoint.scale <= 100.0));

        let mirror = Mirror { center_x: 0.5, center_y: 0.375, inner_radius: 0.1, outer_radius: 0.35 };
        let found = Surf::default().detect(&image, &view_of(&image, Projection::Omnidirectional(mirror)));
        assert!(!found.is_empty());
        for keypoint in found {
            let (radius, reach) = ((keypoint.x - 100.0).hypot(keypoint.y - 75.0), REACH * keypoint.scale);
            assert!(radius - reach >= 19.99 && radius + reach <= 70.01, "{keypoint:?}");
        }
    }

    #[test]
    fn a_turned_panorama_has_the_same_keypoints() {
        let image = noise(256, 128);
        let surf = Surf { target: usize::MAX, ..Surf::default() };
        let view = view_of(&image, Projection::Equirectangular);
        let expected = surf.detect(&image, &view);
        assert!(expected.iter().any(|keypoint| keypoint.x < 4.0));
        for turn in [8, 64, 200] {
            let pixels = (0..256 * 128).map(|idx| image.row(idx / 256)[(idx % 256 + turn) % 256]).collect();
            let turned = surf.detect(&Image::from_pixels(256, 128, pixels).unwrap(), &view);
            assert_eq!(turned.len(), expected.len());
            for keypoint in turned {
                let x = (keypoint.x + turn as f32) % 256.0;
                let is_it =
                    |other: &&Keypoint| (other.x - x).abs() < 1e-3 && (other.y - keypoint.y).abs() < 1e-3;
                assert!(expected.iter().any(|other| is_it(&other)), "{keypoint:?}");
            }
        }
    }

    #[test]
    fn absurd_parameters_are_refused() {
        for surf in [
            Surf { threshold: f32::NAN, ..Surf::default() },
            Surf { threshold: -1.0, ..Surf::default() },
            Surf { n_octaves: 0, ..Surf::default() },
            Surf { n_octaves: 60, ..Surf::default() },
            Surf { n_layers: 2, ..Surf::default() },
            Surf { n_layers: 7, ..Surf::default() },
        ] {
            assert!(surf.check().is_err(), "{surf:?}");
        }
        assert_eq!(Surf::default().check(), Ok(()));
    }

    proptest! {
        #[test]
        fn tiny_images_are_no_problem(
            (width, height) in (1usize..40, 1usize..40), (n_octaves, n_layers) in (1usize..=5, 3usize..=6),
            random in prop::collection::vec(any::<u8>(), 40 * 40),
        ) {
            let image = Image::from_pixels(width, height, random[..width * height].to_vec()).unwrap();
            let mirror = Mirror { center_x: 0.5, center_y: 0.5, inner_radius: 0.0, outer_radius: 4.0 };
            for projection in
                [Projection::Perspective, Projection::Equirectangular, Projection::Omnidirectional(mirror)]
            {
                let view = view_of(&image, projection);
                let surf = Surf { threshold: 0.0, target: 50, n_octaves, n_layers, upright: false };
                for keypoint in surf.detect(&image, &view) {
                    prop_assert!(view.contains(keypoint.x, keypoint.y, REACH * keypoint.scale));
                }
            }
        }
    }
}
