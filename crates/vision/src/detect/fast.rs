//! FAST-9 corners: Rosten and Drummond, "Machine learning for high-speed corner detection", ECCV 2006.
//!
//! A pixel p is a corner at threshold t when 9 contiguous of the 16 pixels on the circle of radius 3 round
//! it are all brighter than I(p) + t or all darker than I(p) - t. Its score is the largest t at which it
//! still is one. A corner is kept when its score is above that of all eight neighbors.
//!
//! Instead of the paper's decision tree, opposite pairs of circle pixels are tested for many pixels at once
//! (an arc of 9 holds at least one of each pair); the few that pass get the full test.

use super::Keypoint;
use crate::camera::View;
use crate::image::Image;
use crate::simd;
use serde::{Deserialize, Serialize};

/// Of the circle.
const RADIUS: usize = 3;

/// The FAST-9 detector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Fast {
    /// How far an arc must differ from the center.
    pub threshold: FastThreshold,
}

impl Default for Fast {
    fn default() -> Self {
        Self { threshold: FastThreshold::Adaptive { target: 300, lowest: 8 } }
    }
}

/// How the threshold of [`Fast`] is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum FastThreshold {
    /// The same gray value difference for every frame, as in the paper.
    Fixed(u8),
    /// As high as leaves `target` corners, so that light does not change their number: the `target` corners
    /// of highest score. (A corner's score is the highest threshold at which it is one, and what suppresses
    /// it at one threshold does so at every lower one.)
    Adaptive {
        /// How many corners to keep.
        target: usize,
        /// The lowest threshold in gray values. Below it there is only noise; frames without enough
        /// contrast get fewer corners.
        lowest: u8,
    },
}

impl Fast {
    /// See [`super::Detector::detect`]. The response is the score.
    pub fn detect(&self, image: &Image, view: &View) -> Vec<Keypoint> {
        let is_seen = |corner: &Keypoint| view.contains(corner.x, corner.y, RADIUS as f32);
        if view.wraps() {
            return self.detect_wrapped(image, is_seen);
        }
        if view.is_whole_frame() {
            return self.corners(image, |_| true);
        }
        self.corners(image, is_seen)
    }

    /// Continues the image beyond the seam, so that corners on it are found.
    fn detect_wrapped(&self, image: &Image, is_seen: impl Fn(&Keypoint) -> bool) -> Vec<Keypoint> {
        // The circle and one neighbor.
        const SEAM: usize = RADIUS + 1;
        let width = image.width();
        let wrapped_width = width + 2 * SEAM;
        let mut pixels = Vec::with_capacity(wrapped_width * image.height());
        for y in 0..image.height() {
            let row = image.row(y);
            pixels.extend((0..wrapped_width).map(|x| row[(x + width * SEAM - SEAM) % width]));
        }
        let Some(wrapped) = Image::from_pixels(wrapped_width, image.height(), pixels) else {
            return Vec::new();
        };
        let unwrapped = |corner: &Keypoint| Keypoint { x: corner.x - SEAM as f32, ..*corner };
        let mut found = self.corners(&wrapped, |corner| {
            let corner = unwrapped(corner);
            (0.0..width as f32).contains(&corner.x) && is_seen(&corner)
        });
        found.iter_mut().for_each(|corner| *corner = unwrapped(corner));
        found
    }

    /// The corners of an image whose score exceeds that of their neighbors, with it as response.
    fn corners(&self, image: &Image, is_seen: impl Fn(&Keypoint) -> bool) -> Vec<Keypoint> {
        let (width, height) = (image.width(), image.height());
        if width <= 2 * RADIUS || height <= 2 * RADIUS {
            return Vec::new();
        }
        let mut found = Vec::with_capacity(width);
        let mut choice = Choice::new(self.threshold);
        // Three rows, turned round.
        let mut rows =
            [(); 3].map(|()| Strengths { of_pixels: vec![0; width], marked: Vec::with_capacity(width) });
        for y in RADIUS..=height - RADIUS {
            let current = &mut rows[y % 3];
            current.clear();
            if y < height - RADIUS {
                let rows = std::array::from_fn(|row| image.row(y - RADIUS + row));
                let of_pixels = &mut current.of_pixels[RADIUS..width - RADIUS];
                simd::fast_strengths(&rows, choice.threshold, of_pixels, &mut current.marked);
            }
            let [above, middle, below] = [y - 2, y - 1, y].map(|y| &rows[y % 3].of_pixels[..]);
            for &column in &rows[(y - 1) % 3].marked {
                let x = column as usize + RADIUS;
                let strength = middle[x];
                let is_largest =
                    [above, below].iter().all(|row| row[x - 1..=x + 1].iter().all(|&s| s < strength))
                        && middle[x - 1] < strength
                        && middle[x + 1] < strength;
                let corner = Keypoint::new(x as f32, (y - 1) as f32, f32::from(strength - 1));
                if is_largest && is_seen(&corner) {
                    choice.count(&corner);
                    found.push(corner);
                }
            }
            choice.raise_threshold();
        }
        choice.keep_strongest(&mut found);
        found
    }
}

/// What the segment test says of a row's pixels.
struct Strengths {
    /// One more than the score of each, 0 where it is no corner.
    of_pixels: Vec<u8>,
    /// The columns of the others, less [`RADIUS`].
    marked: Vec<u32>,
}

impl Strengths {
    fn clear(&mut self) {
        self.marked.drain(..).for_each(|column| self.of_pixels[column as usize + RADIUS] = 0);
    }
}

/// Chooses the corners of highest score. Once there are enough of them the threshold rises, which spares the rest of the frame:
/// a lower score is none of them any more. (Of two neighbors below it both may be found then; neither is chosen.)
struct Choice {
    target: usize,
    /// The lowest score that may be chosen.
    threshold: u8,
    /// The corners of each score.
    counts: [usize; 256],
    /// Corners that reach the threshold.
    n_above: usize,
}

impl Choice {
    fn new(threshold: FastThreshold) -> Self {
        let (threshold, target) = match threshold {
            FastThreshold::Fixed(threshold) => (threshold, usize::MAX),
            FastThreshold::Adaptive { target, lowest } => (lowest, target),
        };
        Self { target, threshold, counts: [0; 256], n_above: 0 }
    }

    fn count(&mut self, corner: &Keypoint) {
        let score = corner.response as u8;
        self.counts[usize::from(score)] += 1;
        self.n_above += usize::from(score >= self.threshold);
    }

    /// To the highest that leaves the target.
    fn raise_threshold(&mut self) {
        while self.threshold < u8::MAX && self.n_above - self.n_ties() >= self.target {
            self.n_above -= self.n_ties();
            self.threshold += 1;
        }
    }

    /// Corners that just reach the threshold.
    fn n_ties(&self) -> usize {
        self.counts[usize::from(self.threshold)]
    }

    /// The `target` corners of highest score, ties to the first, in their old order.
    fn keep_strongest(&self, corners: &mut Vec<Keypoint>) {
        let threshold = f32::from(self.threshold);
        let mut n_ties_left = self.target.saturating_sub(self.n_above - self.n_ties());
        corners.retain(|corner| {
            let tie_fits = corner.response == threshold && n_ties_left > 0;
            n_ties_left -= usize::from(tie_fits);
            corner.response > threshold || tie_fits
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Mask, Mirror, Projection};
    use proptest::prelude::*;

    /// The circle of radius 3, clockwise from the top.
    const CIRCLE: [(isize, isize); 16] = [
        (0, -3),
        (1, -3),
        (2, -2),
        (3, -1),
        (3, 0),
        (3, 1),
        (2, 2),
        (1, 3),
        (0, 3),
        (-1, 3),
        (-2, 2),
        (-3, 1),
        (-3, 0),
        (-3, -1),
        (-2, -2),
        (-1, -3),
    ];

    /// The segment test as the paper words it.
    fn naive_is_corner(image: &Image, x: usize, y: usize, threshold: i32) -> bool {
        let at = |x: usize, y: usize| i32::from(image.row(y)[x]);
        let differences: Vec<i32> = (0..32)
            .map(|i| CIRCLE[i % 16])
            .map(|(dx, dy)| at(x.wrapping_add_signed(dx), y.wrapping_add_signed(dy)) - at(x, y))
            .collect();
        differences
            .windows(9)
            .any(|arc| arc.iter().all(|&d| d > threshold) || arc.iter().all(|&d| d < -threshold))
    }

    fn naive_corners(image: &Image, threshold: u8) -> Vec<(usize, usize, i32)> {
        let (width, height) = (image.width(), image.height());
        let score = |x: usize, y: usize| -> i32 {
            if x < 3 || y < 3 || x + 3 >= width || y + 3 >= height {
                return -1;
            }
            (i32::from(threshold)..256).take_while(|&t| naive_is_corner(image, x, y, t)).last().unwrap_or(-1)
        };
        let scores: Vec<i32> = (0..width * height).map(|idx| score(idx % width, idx / width)).collect();
        let mut found = Vec::new();
        for y in 3..height.saturating_sub(3) {
            for x in 3..width.saturating_sub(3) {
                let own = scores[y * width + x];
                let neighbors = (y - 1..=y + 1).flat_map(|y| (x - 1..=x + 1).map(move |x| (x, y)));
                let largest =
                    neighbors.filter(|&other| other != (x, y)).all(|(x, y)| scores[y * width + x] < own);
                if own >= 0 && largest {
                    found.push((x, y, own));
                }
            }
        }
        found
    }

    fn as_tuples(keypoints: &[Keypoint]) -> Vec<(usize, usize, i32)> {
        keypoints.iter().map(|k| (k.x as usize, k.y as usize, k.response as i32)).collect()
    }

    fn whole(image: &Image) -> View {
        Camera::new(Projection::Perspective).view(image.width(), image.height())
    }

    fn image_strategy() -> impl Strategy<Value = Image> {
        (1usize..48, 1usize..14, 1u8..80).prop_flat_map(|(width, height, step)| {
            // Few gray levels: arcs and equal scores are common.
            prop::collection::vec(0u8..4, width * height).prop_map(move |levels| {
                let pixels = levels.iter().map(|level| level.saturating_mul(step)).collect();
                Image::from_pixels(width, height, pixels).unwrap()
            })
        })
    }

    proptest! {
        #[test]
        fn equals_the_naive_segment_test(image in image_strategy(), threshold in 0u8..120) {
            let fast = Fast { threshold: FastThreshold::Fixed(threshold) };
            prop_assert_eq!(as_tuples(&fast.detect(&image, &whole(&image))), naive_corners(&image, threshold));
        }

        #[test]
        fn adaptive_keeps_the_strongest(image in image_strategy(), target in 0usize..6, lowest in 0u8..60) {
            let fast = Fast { threshold: FastThreshold::Adaptive { target, lowest } };
            let kept = as_tuples(&fast.detect(&image, &whole(&image)));
            let mut expected = naive_corners(&image, lowest);
            expected.sort_by_key(|&(x, y, score)| (-score, y, x));
            expected.truncate(target);
            expected.sort_by_key(|&(x, y, _)| (y, x));
            prop_assert_eq!(kept, expected);
        }

        #[test]
        fn a_turned_panorama_has_the_same_corners(image in image_strategy(), turn in 0usize..48) {
            prop_assume!(image.width() > 8);
            let width = image.width();
            let pixels =
                (0..width * image.height()).map(|i| image.row(i / width)[(i % width + turn) % width]).collect();
            let turned = Image::from_pixels(width, image.height(), pixels).unwrap();
            let view = Camera::new(Projection::Equirectangular).view(width, image.height());
            let fast = Fast { threshold: FastThreshold::Fixed(10) };
            let mut back: Vec<_> = as_tuples(&fast.detect(&turned, &view))
                .iter()
                .map(|&(x, y, score)| ((x + turn) % width, y, score))
                .collect();
            back.sort_by_key(|&(x, y, _)| (y, x));
            prop_assert_eq!(back, as_tuples(&fast.detect(&image, &view)));
        }
    }

    #[test]
    fn no_corner_touches_what_is_hidden() {
        // Dark squares, with noise that tells neighboring scores apart.
        let squares = |idx: usize| {
            let noise = (idx * 7919 % 31) as u8;
            noise + if idx % 120 % 10 < 5 && idx / 120 % 10 < 5 { 20 } else { 220 }
        };
        let image = Image::from_pixels(120, 90, (0..120 * 90).map(squares).collect()).unwrap();
        let hidden = Image::from_pixels(2, 1, vec![255, 0]).unwrap();
        let masked = Camera { projection: Projection::Perspective, mask: Some(Mask::new(hidden)) };
        let mirror = Mirror { center_x: 0.5, center_y: 0.375, inner_radius: 0.1, outer_radius: 0.3 };
        let fast = Fast { threshold: FastThreshold::Fixed(30) };

        let all = fast.detect(&image, &whole(&image));
        let left = fast.detect(&image, &masked.view(120, 90));
        assert!(!left.is_empty() && left.len() < all.len());
        assert!(left.iter().all(|corner| corner.x + 3.0 < 60.0));

        let ring = fast.detect(&image, &Camera::new(Projection::Omnidirectional(mirror)).view(120, 90));
        assert!(!ring.is_empty());
        for corner in ring {
            let radius = (corner.x - 60.0).hypot(corner.y - 45.0);
            assert!((15.0..=33.0).contains(&radius), "{corner:?}");
        }
    }
}
