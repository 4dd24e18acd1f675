//! A frame as a whole: how often each local binary pattern occurs in its parts, as in CENTRIST (Wu and Rehg,
//! "CENTRIST: A Visual Descriptor for Scene Categorization", PAMI 33(8), 2011).
//!
//! The parts, and the direction that patterns are read in, make the histograms of a frame of a mirror stay the
//! same when the robot turns on the spot: the parts are rings, and the first neighbor is the one away from the
//! mirror's center. Those of a panorama are bands, those of other frames cells.

use crate::camera::{CameraKind, View};
use crate::image::Image;
use serde::{Deserialize, Serialize};
use std::f32::consts::FRAC_PI_4;

/// Patterns of eight neighbors.
const N_CODES: usize = 256;

/// The directions that patterns are read in.
const N_DIRECTIONS: usize = 8;

/// The histograms of local binary patterns of a whole frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FrameLbp {
    /// Frames are shrunk to this longest side before, so that noise averages out, in pixels, from 16 to 1024.
    pub longest_side: usize,
    /// The number of rings or bands, or of cells a side, from 1 to 4.
    pub n_parts: usize,
    /// How much brighter than a pixel a neighbor must be to count, in gray levels.
    pub threshold: u8,
}

impl Default for FrameLbp {
    fn default() -> Self {
        Self { longest_side: 160, n_parts: 3, threshold: 3 }
    }
}

impl FrameLbp {
    /// What is wrong with the parameters, if anything.
    pub fn check(&self) -> Result<(), String> {
        if !(16..=1024).contains(&self.longest_side) {
            return Err(format!(
                "frames are shrunk to 16 to 1024 pixels for a cue, not {}",
                self.longest_side
            ));
        }
        if !(1..=4).contains(&self.n_parts) {
            return Err(format!("a cue has 1 to 4 parts a frame or side, not {}", self.n_parts));
        }
        Ok(())
    }

    /// The length of a description.
    pub fn n_dimensions(&self, camera: CameraKind) -> usize {
        N_CODES * self.n_histograms(camera)
    }

    fn n_histograms(&self, camera: CameraKind) -> usize {
        match camera {
            CameraKind::Perspective => self.n_parts * self.n_parts,
            CameraKind::Equirectangular | CameraKind::Omnidirectional => self.n_parts,
        }
    }

    /// Where the pixels of frames of `view` count.
    pub fn sections(&self, view: &View) -> Sections {
        let n_histograms = self.n_histograms(view.kind());
        // One more, that is left out, for the pixels that are not valid.
        let outside = n_histograms * N_DIRECTIONS;
        let part = |share: f32| ((share * self.n_parts as f32) as usize).min(self.n_parts - 1);
        let section = |x: usize, y: usize| {
            let (column, row) = (x as f32, y as f32);
            if !view.contains(column, row, 1.0) {
                return outside;
            }
            let down = part(row / view.height() as f32);
            match (view.kind(), view.radial_direction(column, row)) {
                (CameraKind::Perspective, _) => {
                    (down * self.n_parts + part(column / view.width() as f32)) * N_DIRECTIONS
                }
                (CameraKind::Omnidirectional, Some((dx, dy))) => {
                    let direction = (dy.atan2(dx) / FRAC_PI_4).round().rem_euclid(N_DIRECTIONS as f32);
                    part(view.ring_share(column, row)) * N_DIRECTIONS + direction as usize
                }
                _ => down * N_DIRECTIONS,
            }
        };
        let rows = (0..view.height()).flat_map(|y| (0..view.width()).map(move |x| (x, y)));
        // At most 16 histograms: 129 sections.
        Sections { n_histograms, of_pixels: rows.map(|(x, y)| section(x, y) as u8).collect() }
    }

    /// The square roots of the shares of the patterns, one histogram after the other: of unit L2 length, zero
    /// where no pixel is valid. `image` has the size that `sections` was made for.
    pub fn describe(&self, image: &Image, sections: &Sections) -> Vec<f32> {
        let width = image.width();
        let mut counts = vec![[0_u32; N_CODES]; sections.n_histograms * N_DIRECTIONS + 1];
        let mut codes = vec![0; width.saturating_sub(2)];
        for y in 1..image.height().saturating_sub(1) {
            self.codes([y - 1, y, y + 1].map(|y| image.row(y)), &mut codes);
            let sections = &sections.of_pixels[y * width + 1..];
            for (&section, &code) in sections.iter().zip(&codes) {
                counts[usize::from(section)][usize::from(code)] += 1;
            }
        }
        let mut histograms = vec![0; sections.n_histograms * N_CODES];
        let by_direction = counts.chunks_exact(N_DIRECTIONS).zip(histograms.chunks_exact_mut(N_CODES));
        for (of_directions, histogram) in by_direction {
            for (direction, counts) in (0..).zip(of_directions) {
                for (code, count) in (0..=u8::MAX).zip(counts) {
                    histogram[usize::from(code.rotate_right(direction))] += count;
                }
            }
        }
        let n_pixels = histograms.iter().sum::<u32>().max(1);
        histograms.into_iter().map(|count| (count as f32 / n_pixels as f32).sqrt()).collect()
    }

    /// The patterns of the middle row, its first and last pixel left out. Bit i is the neighbor at i times 45
    /// degrees from the right, clockwise.
    fn codes(&self, [above, here, below]: [&[u8]; 3], codes: &mut [u8]) {
        let n = codes.len();
        let neighbors = [
            &here[2..],
            &below[2..],
            &below[1..],
            &below[..n],
            &here[..n],
            &above[..n],
            &above[1..],
            &above[2..],
        ];
        codes.fill(0);
        for (bit, neighbors) in neighbors.into_iter().enumerate() {
            let mask = 1 << bit;
            for ((code, &center), &neighbor) in codes.iter_mut().zip(&here[1..]).zip(neighbors) {
                *code |= if neighbor > center.saturating_add(self.threshold) { mask } else { 0 };
            }
        }
    }
}

/// Which histogram each pixel of frames of one size counts in, and in which direction its pattern is read.
#[derive(Clone, Debug)]
pub struct Sections {
    n_histograms: usize,
    /// Row after row: histogram times [`N_DIRECTIONS`], plus the direction.
    of_pixels: Vec<u8>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Mask, Mirror, Projection};
    use crate::describe::testing::noise;

    fn describe(image: &Image, camera: &Camera, n_parts: usize) -> Vec<f32> {
        let cue = FrameLbp { n_parts, threshold: 0, ..FrameLbp::default() };
        let view = camera.view(image.width(), image.height());
        let described = cue.describe(image, &cue.sections(&view));
        assert_eq!(described.len(), cue.n_dimensions(view.kind()));
        described
    }

    fn difference(a: &[f32], b: &[f32]) -> f32 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum()
    }

    #[test]
    fn follows_its_definition() {
        let image = noise(40, 30);
        let mut counts = vec![0.0_f32; 4 * 256];
        for (x, y) in (1..39_usize).flat_map(|x| (1..29_usize).map(move |y| (x, y))) {
            let at = |dx: isize, dy: isize| {
                image.row(y.checked_add_signed(dy).unwrap())[x.checked_add_signed(dx).unwrap()]
            };
            let circle = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];
            let is_brighter = |&(_, (dx, dy)): &(usize, (isize, isize))| at(dx, dy) > at(0, 0);
            let code: usize =
                circle.into_iter().enumerate().filter(is_brighter).map(|(bit, _)| 1 << bit).sum();
            counts[(2 * (y / 15) + x / 20) * 256 + code] += 1.0;
        }
        let expected: Vec<f32> = counts.iter().map(|count| (count / (38.0 * 28.0)).sqrt()).collect();
        let described = describe(&image, &Camera::new(Projection::Perspective), 2);
        assert!(difference(&described, &expected) < 1e-4);
    }

    #[test]
    fn what_the_mask_hides_does_not_count() {
        let mask = Image::from_pixels(2, 1, vec![255, 0]).unwrap();
        let camera = Camera { projection: Projection::Perspective, mask: Some(Mask::new(mask)) };
        let image = noise(60, 40);
        let mut pixels = image.pixels().to_vec();
        (0..60 * 40).filter(|idx| idx % 60 >= 30).for_each(|idx| pixels[idx] = 77);
        let changed = Image::from_pixels(60, 40, pixels).unwrap();
        assert_eq!(describe(&image, &camera, 1), describe(&changed, &camera, 1));
        let all_dark = Mask::new(Image::from_pixels(1, 1, vec![0]).unwrap());
        let blind = Camera { projection: Projection::Perspective, mask: Some(all_dark) };
        assert!(describe(&image, &blind, 1).iter().all(|&value| value == 0.0));
    }

    #[test]
    fn a_turn_of_the_robot_changes_little() {
        let mirror = Mirror { center_x: 0.5, center_y: 0.5, inner_radius: 0.1, outer_radius: 0.45 };
        let camera = Camera::new(Projection::Omnidirectional(mirror));
        // Rings to one side only: without turning the patterns, quarter turns change the sum by 4.6 and an
        // eighth of a turn by 3.3.
        let seen = |eighths: f32| {
            let pixels = (0..121 * 121).map(|idx| {
                let (x, y) = ((idx % 121) as f32 - 60.5, (idx / 121) as f32 - 60.5);
                let contrast = (y.atan2(x) - eighths * FRAC_PI_4).cos().max(0.0).powi(2);
                (127.0 + 100.0 * contrast * (0.7 * x.hypot(y)).sin()) as u8
            });
            describe(&Image::from_pixels(121, 121, pixels.collect()).unwrap(), &camera, 2)
        };
        let still = seen(0.0);
        for (eighths, limit) in [(1.0, 2.5), (2.0, 0.5), (4.0, 0.5), (7.0, 2.5)] {
            let turned = difference(&still, &seen(eighths));
            assert!(turned < limit, "{eighths}: {turned}");
        }
    }

    #[test]
    fn the_smallest_frames_have_a_description() {
        for (width, height) in [(1, 1), (2, 5), (3, 3), (9, 1)] {
            let described = describe(&noise(width, height), &Camera::new(Projection::Equirectangular), 3);
            let length: f32 = described.iter().map(|value| value * value).sum();
            assert!(length == 0.0 || (length - 1.0).abs() < 1e-5);
        }
    }
}
