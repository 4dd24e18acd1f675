//! Points on a grid: every part of a frame is described, flat ones too, at several sizes. Tells kinds of rooms
//! and scenes apart better than corners do (Fei-Fei and Perona, "A Bayesian hierarchical model for learning natural
//! scene categories", 2005; Lazebnik, Schmid, Ponce, "Beyond bags of features", 2006).

use super::{Keypoint, in_reading_order};
use crate::camera::View;
use crate::image::Image;
use serde::{Deserialize, Serialize};

/// The most keypoints that a frame may have.
const MAX_KEYPOINTS: usize = 100_000;

/// The most scales of a grid.
const MAX_SCALES: usize = 16;

/// A grid of points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Dense {
    /// Frames whose longest side exceeds this are shrunk to it before the grid is laid over them, in pixels: what is
    /// everywhere need not be seen closely.
    pub longest_side: usize,
    /// From one point to the next, along rows and columns, in pixels.
    pub step: usize,
    /// Each point is described at each of these scales, from 0.5 to 32; see [`Keypoint::scale`].
    pub scales: Vec<f32>,
    /// How far points stay from the border of the valid region, in pixels at scale 1, at most 128: half the side
    /// of what is described.
    pub margin: f32,
}

impl Default for Dense {
    fn default() -> Self {
        Self { longest_side: 256, step: 8, scales: vec![1.0, 1.5, 2.0, 3.0], margin: 8.0 }
    }
}

impl Dense {
    pub(super) fn check(&self) -> Result<(), String> {
        if !(16..=8192).contains(&self.longest_side) {
            return Err(format!(
                "the longest_side of a grid must be from 16 to 8192 pixels, not {}",
                self.longest_side
            ));
        }
        if !(1..=256).contains(&self.step) {
            return Err(format!("the step of a grid must be from 1 to 256 pixels, not {}", self.step));
        }
        if !(1..=MAX_SCALES).contains(&self.scales.len()) {
            return Err(format!("a grid has 1 to {MAX_SCALES} scales, not {}", self.scales.len()));
        }
        if let Some(scale) = self.scales.iter().find(|scale| !(0.5..=32.0).contains(*scale)) {
            return Err(format!("a scale of a grid must be from 0.5 to 32, not {scale}"));
        }
        if !(0.0..=128.0).contains(&self.margin) {
            return Err(format!("the margin of a grid must be from 0 to 128 pixels, not {}", self.margin));
        }
        self.check_number()
    }

    /// That frames do not have too many points.
    fn check_number(&self) -> Result<(), String> {
        let longest_side = self.longest_side;
        let n_keypoints = longest_side.div_ceil(self.step).pow(2) * self.scales.len();
        if n_keypoints > MAX_KEYPOINTS {
            return Err(format!(
                "a grid of step {} with {} scales has up to {n_keypoints} points in frames of {longest_side} pixels \
                 a side, at most {MAX_KEYPOINTS} are allowed: raise the step, or lower longest_side",
                self.step,
                self.scales.len()
            ));
        }
        Ok(())
    }

    /// The grid lies in the middle of the frame. Where the edges of frames meet, it starts at the first column:
    /// turning by whole steps then turns the points as well, if the width is a multiple of the step.
    pub(super) fn detect(&self, image: &Image, view: &View) -> Vec<Keypoint> {
        let first = |size: usize| (size - 1) % self.step / 2;
        let first_column = if view.wraps() { 0 } else { first(image.width()) };
        let mut keypoints = Vec::new();
        for y in (first(image.height())..image.height()).step_by(self.step) {
            for x in (first_column..image.width()).step_by(self.step) {
                let (x, y) = (x as f32, y as f32);
                let margin = |scale: f32| f32::max(self.margin, 1.0) * scale;
                let scales = self.scales.iter().filter(|&&scale| view.contains(x, y, margin(scale)));
                keypoints.extend(scales.map(|&scale| Keypoint { scale, ..Keypoint::new(x, y, 1.0) }));
            }
        }
        keypoints.sort_by(in_reading_order);
        keypoints
    }
}

#[cfg(test)]
mod tests {
    use super::super::Detector;
    use super::super::testing::{assert_keypoints_are_valid, assert_keypoints_turn_with_a_panorama, detect};
    use super::*;
    use crate::camera::{Camera, Mirror, Projection};
    use proptest::prelude::*;

    fn flat(width: usize, height: usize) -> Image {
        Image::from_pixels(width, height, vec![9; width * height]).unwrap()
    }

    #[test]
    fn the_grid_is_in_the_middle_and_stays_off_the_border_by_scale() {
        let dense = Dense { step: 10, scales: vec![1.0, 2.0], ..Dense::default() };
        let found = detect(&Detector::Dense(dense), &flat(44, 31));
        let at = |wanted: f32| -> Vec<(f32, f32)> {
            found.iter().filter(|found| found.scale == wanted).map(|found| (found.x, found.y)).collect()
        };
        assert_eq!(
            at(1.0),
            [(11.0, 10.0), (21.0, 10.0), (31.0, 10.0), (11.0, 20.0), (21.0, 20.0), (31.0, 20.0)]
        );
        assert_eq!(at(2.0), []);
        let larger = detect(
            &Detector::Dense(Dense { step: 10, scales: vec![2.0], ..Dense::default() }),
            &flat(44, 44),
        );
        assert_eq!(larger.iter().map(|found| (found.x, found.y)).collect::<Vec<_>>(), [(21.0, 21.0)]);
    }

    #[test]
    fn what_no_mirror_shows_is_left_out() {
        let mirror = Mirror { center_x: 0.5, center_y: 0.5, inner_radius: 0.1, outer_radius: 0.45 };
        let view = Camera::new(Projection::Omnidirectional(mirror)).view(200, 200);
        let found = Dense::default().detect(&flat(200, 200), &view);
        assert!(found.len() > 400, "{}", found.len());
        for found in found {
            let radius = (found.x - 100.0).hypot(found.y - 100.0);
            assert!(radius >= 20.0 + 8.0 * found.scale && radius <= 90.0 - 8.0 * found.scale, "{found:?}");
        }
    }

    #[test]
    fn a_panorama_has_points_at_its_seam_and_turns() {
        assert_keypoints_turn_with_a_panorama(&Detector::Dense(Dense { step: 4, ..Dense::default() }));
    }

    #[test]
    fn absurd_parameters_are_refused() {
        let defaults = Dense::default;
        for dense in [
            Dense { step: 0, ..defaults() },
            Dense { scales: Vec::new(), ..defaults() },
            Dense { scales: vec![1.0; 17], ..defaults() },
            Dense { scales: vec![f32::NAN], ..defaults() },
            Dense { scales: vec![1.0, 0.1], ..defaults() },
            Dense { margin: -1.0, ..defaults() },
            Dense { margin: f32::NAN, ..defaults() },
        ] {
            assert!(dense.check().is_err(), "{dense:?}");
        }
        assert_eq!(defaults().check(), Ok(()));
        assert_eq!(Dense { longest_side: 640, ..defaults() }.check(), Ok(()));
        assert!(Dense { longest_side: 8193, ..defaults() }.check().is_err());
        let error = Dense { longest_side: 8192, ..defaults() }.check().unwrap_err();
        assert!(error.contains("raise the step"), "{error}");
    }

    proptest! {
        #[test]
        fn images_of_any_size_have_only_valid_keypoints(size in (1usize..60, 1usize..60), seed: u64, step in 1usize..9) {
            let dense = Dense { step, margin: 2.0, ..Dense::default() };
            assert_keypoints_are_valid(&Detector::Dense(dense), size, seed);
        }
    }
}
