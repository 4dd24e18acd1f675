//! SIFT keypoints: Lowe, "Distinctive image features from scale-invariant keypoints", IJCV 60(2), 2004,
//! sections 3 to 5.
//!
//! Extrema of the differences of Gaussians in place and scale, refined to a fraction of a pixel and level
//! (equation 3), without those of low contrast and on edges (section 4.1), each with the peaks of a histogram
//! of the gradients round it as directions (section 5). Gray values run from 0 to 1.

use super::{Keypoint, for_each_marked, in_reading_order, keep_strongest};
use crate::camera::View;
use crate::image::Image;
use crate::plane::{Extent, Gradients, Grown, Levels, Location, Octave, Plane, ScaleSpace, gaussian_at};
use crate::simd::{self, N_DIRECTIONS};
use serde::{Deserialize, Serialize};

/// The surroundings that must be valid, in sigmas.
const REACH: f32 = 2.0;

/// An extremum is given up when it has not come to rest after so many steps.
const MAX_STEPS: usize = 5;

/// Peaks at least this high, compared with the highest, are directions too.
const PEAK_SHARE: f32 = 0.8;

/// The sigma of the window of that histogram, in sigmas of the keypoint.
const DIRECTION_SIGMA: f32 = 1.5;

/// The SIFT detector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Sift {
    /// How many of highest response to keep.
    pub target: usize,
    /// Levels an octave that extrema are looked for in, from 1 to 8.
    pub n_layers: usize,
    /// The sigma of the first level of each octave in its pixels, from 1 to 4.
    pub sigma: f32,
    /// The least contrast, as a share of the gray range; divided by the number of layers.
    pub contrast_threshold: f32,
    /// The most that one principal curvature may be of the other, at least 1.
    pub edge_threshold: f32,
    /// Whether small features are looked for in an image of twice the size: about four times the keypoints
    /// for four times the time.
    pub doubled: bool,
}

impl Default for Sift {
    fn default() -> Self {
        Self {
            target: 300,
            n_layers: 3,
            sigma: 1.6,
            contrast_threshold: 0.04,
            edge_threshold: 10.0,
            doubled: true,
        }
    }
}

impl Sift {
    pub(super) fn check(&self) -> Result<(), String> {
        super::check_target(self.target)?;
        if !(1..=8).contains(&self.n_layers) {
            return Err(format!("SIFT takes 1 to 8 layers an octave, not {}", self.n_layers));
        }
        if !(1.0..=4.0).contains(&self.sigma) {
            return Err(format!("the sigma of SIFT must be from 1 to 4 pixels, not {}", self.sigma));
        }
        if !(0.0..1.0).contains(&self.contrast_threshold) {
            return Err(format!(
                "the contrast_threshold of SIFT must be from 0 to 1, not {}",
                self.contrast_threshold
            ));
        }
        if !(1.0..=1000.0).contains(&self.edge_threshold) {
            return Err(format!(
                "the edge_threshold of SIFT must be from 1 to 1000, not {}",
                self.edge_threshold
            ));
        }
        Ok(())
    }

    /// See [`super::Detector::levels`].
    pub(super) fn levels(&self) -> Levels {
        Levels { sigma: self.sigma, n_layers: self.n_layers, doubled: self.doubled }
    }

    /// See [`super::Detector::detect_with`]. The response is the contrast.
    pub(super) fn detect(&self, image: &Image, view: &View, space: &mut ScaleSpace) -> Vec<Keypoint> {
        let candidates = self.candidates(&Plane::new(image, view.wraps()), space);
        let octaves = space.octaves();
        let mut extrema: Vec<Keypoint> = candidates
            .iter()
            .filter(|candidate| candidate.is_extremum(&octaves[candidate.octave_idx]))
            .filter_map(|candidate| {
                let refined = self.refine(&octaves[candidate.octave_idx], candidate.place)?;
                Some(refined.keypoint(self.levels(), candidate.octave_idx))
            })
            .collect();
        extrema.iter_mut().for_each(|extremum| extremum.x = view.column(extremum.x));
        extrema.retain(|extremum| view.contains(extremum.x, extremum.y, REACH * extremum.scale));
        keep_strongest(&mut extrema, self.target);
        // Neighbors may have come to rest at the same place; they have the same response.
        extrema.dedup();
        let mut gradients = Gradients::default();
        let mut keypoints = Vec::with_capacity(self.target);
        for extremum in extrema {
            let location = space.locate((extremum.x, extremum.y), extremum.scale);
            let histogram = direction_histogram(&location, &mut gradients);
            keypoints
                .extend(peaks(&histogram).map(|direction| Keypoint { angle: Some(direction), ..extremum }));
        }
        keypoints.truncate(self.target);
        keypoints.sort_by(in_reading_order);
        keypoints
    }

    /// Builds the scale space and looks for extrema in each layer and the one below as soon as there are enough
    /// rows, while these are in the cache.
    fn candidates(&self, image: &Plane, space: &mut ScaleSpace) -> Vec<Candidate> {
        // Refining adds contrast; half the threshold misses nothing that matters.
        let threshold = 0.5 * self.contrast_threshold / self.n_layers as f32;
        let mut found = Vec::new();
        let mut marks = Vec::new();
        // The last plane would be needed at few places.
        let extent = Extent { coarsest: f32::INFINITY, n_more: 1 };
        space.build(image, self.levels(), extent, |Grown { octave_idx, layer, rows, planes }| {
            if !(2..self.n_layers + 2).contains(&layer) {
                return;
            }
            let layer = layer - 1;
            let layers = &planes[layer - 1..=layer + 1];
            let width = layers[0].width();
            let (last, [before_last, ..], [.., after_first]) =
                (width - 1, layers[0].around(width - 1), layers[0].around(0));
            marks.resize(width.saturating_sub(2), 0);
            // Those that have the rows above and below since now.
            for y in rows.start.max(2) - 1..rows.end - 1 {
                let rows = [0, 1, 2].map(|layer| [y - 1, y, y + 1].map(|y| layers[layer].row(y)));
                let mut visit = |x: usize| found.push(Candidate { octave_idx, place: [x, y, layer] });
                simd::mark_extrema(&rows, threshold, &mut marks);
                for_each_marked(&marks, |x| visit(x + 1));
                if layers[0].wraps() {
                    let seam = [before_last, last, 0, after_first];
                    let rows = rows.map(|rows| rows.map(|row| seam.map(|x| row[x])));
                    let rows = rows.each_ref().map(|rows| rows.each_ref().map(|row| &row[..]));
                    let mut marks = [0; 2];
                    simd::mark_extrema(&rows, threshold, &mut marks);
                    for_each_marked(&marks, |x| visit([last, 0][x]));
                }
            }
        });
        found
    }

    /// Follows the parabola through an extremum at a pixel and layer of an octave to its vertex; `None` when
    /// it has too little contrast, is on an edge or does not come to rest.
    fn refine(&self, octave: &Octave, mut at: [usize; 3]) -> Option<Refined> {
        let plane = &octave.planes()[0];
        let sizes = [plane.width(), plane.height(), self.n_layers + 2];
        for _ in 0..MAX_STEPS {
            let parabola = Parabola::new(octave, at);
            let offset = parabola.vertex()?;
            if offset.iter().all(|offset| offset.abs() < 0.5) {
                let contrast = parabola.value_at(offset).abs();
                let keep = contrast * self.n_layers as f32 >= self.contrast_threshold
                    && !parabola.is_on_edge(self.edge_threshold);
                let [x, y, layer] = std::array::from_fn(|axis| at[axis] as f32 + offset[axis]);
                return keep.then_some(Refined { x, y, layer, contrast });
            }
            for (axis, size) in sizes.into_iter().enumerate() {
                let moved = at[axis] as f32 + offset[axis].round();
                at[axis] = if axis == 0 && plane.wraps() {
                    moved.rem_euclid(size as f32) as usize
                } else if (1.0..=size as f32 - 2.0).contains(&moved) {
                    moved as usize
                } else {
                    return None;
                };
            }
        }
        None
    }
}

/// A pixel whose difference of Gaussians stands out in its layer and from the one below.
struct Candidate {
    octave_idx: usize,
    /// Column, row and layer.
    place: [usize; 3],
}

impl Candidate {
    /// Whether it stands out from the layer above too.
    fn is_extremum(&self, octave: &Octave) -> bool {
        let [x, y, layer] = self.place;
        let [lower, upper] = [layer, layer + 1].map(|layer| octave.planes()[layer].row(y)[x]);
        let center = upper - lower;
        let [lower, upper] = [layer + 1, layer + 2].map(|layer| octave.around(layer, x, y));
        let above = differences(&lower, &upper);
        let mut above = above.as_flattened().iter();
        if center > 0.0 { above.all(|&other| other <= center) } else { above.all(|&other| other >= center) }
    }
}

/// What the pixels of an upper layer exceed those of a lower one by.
fn differences(lower: &[[f32; 3]; 3], upper: &[[f32; 3]; 3]) -> [[f32; 3]; 3] {
    std::array::from_fn(|row| std::array::from_fn(|column| upper[row][column] - lower[row][column]))
}

/// An extremum in pixels and layers of its octave.
struct Refined {
    x: f32,
    y: f32,
    layer: f32,
    contrast: f32,
}

impl Refined {
    fn keypoint(&self, levels: Levels, octave_idx: usize) -> Keypoint {
        let pixel = levels.pixel(octave_idx);
        Keypoint {
            x: self.x * pixel,
            y: self.y * pixel,
            response: self.contrast,
            scale: levels.sigma(self.layer) * pixel,
            angle: None,
        }
    }
}

/// The differences of Gaussians near a pixel of a layer, to the second order in x, y and layer: equation 2.
struct Parabola {
    value: f32,
    gradient: [f32; 3],
    /// Symmetric.
    hessian: [[f32; 3]; 3],
}

impl Parabola {
    fn new(octave: &Octave, [x, y, layer]: [usize; 3]) -> Self {
        let grays = [layer - 1, layer, layer + 1, layer + 2].map(|layer| octave.around(layer, x, y));
        // Differences by layer, row and column.
        let cube = [0, 1, 2].map(|l| differences(&grays[l], &grays[l + 1]));
        // At a whole step along each axis.
        let at =
            |x: isize, y: isize, layer: isize| cube[(1 + layer) as usize][(1 + y) as usize][(1 + x) as usize];
        let value = at(0, 0, 0);
        let slope = |below: f32, above: f32| (above - below) / 2.0;
        let curvature = |below: f32, above: f32| below + above - 2.0 * value;
        let x_slope = |y, layer| slope(at(-1, y, layer), at(1, y, layer));
        let y_slope = |layer| slope(at(0, -1, layer), at(0, 1, layer));
        let xx = curvature(at(-1, 0, 0), at(1, 0, 0));
        let yy = curvature(at(0, -1, 0), at(0, 1, 0));
        let ll = curvature(at(0, 0, -1), at(0, 0, 1));
        let xy = slope(x_slope(-1, 0), x_slope(1, 0));
        let xl = slope(x_slope(0, -1), x_slope(0, 1));
        let yl = slope(y_slope(-1), y_slope(1));
        Self {
            value,
            gradient: [x_slope(0, 0), y_slope(0), slope(at(0, 0, -1), at(0, 0, 1))],
            hessian: [[xx, xy, xl], [xy, yy, yl], [xl, yl, ll]],
        }
    }

    /// Where the gradient vanishes: equation 3, by Cramer's rule. `None` when that is nowhere.
    fn vertex(&self) -> Option<[f32; 3]> {
        let [a, b, c] = self.hessian;
        let downhill = self.gradient.map(|slope| -slope);
        let determinant = dot(a, cross(b, c));
        // The hessian is symmetric: its rows are its columns.
        let offset = [dot(downhill, cross(b, c)), dot(a, cross(downhill, c)), dot(a, cross(b, downhill))];
        let offset = offset.map(|numerator| numerator / determinant);
        offset.iter().all(|offset| offset.is_finite()).then_some(offset)
    }

    fn value_at(&self, vertex: [f32; 3]) -> f32 {
        self.value + 0.5 * dot(self.gradient, vertex)
    }

    /// Whether the ratio of the principal curvatures in the plane exceeds `threshold`: section 4.1.
    fn is_on_edge(&self, threshold: f32) -> bool {
        let [[xx, xy, _], [_, yy, _], _] = self.hessian;
        let (trace, determinant) = (xx + yy, xx * yy - xy * xy);
        determinant <= 0.0 || trace * trace * threshold >= (threshold + 1.0).powi(2) * determinant
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// How long the gradients round a point are in each direction, smoothed.
fn direction_histogram(location: &Location, gradients: &mut Gradients) -> [f32; N_DIRECTIONS] {
    let sigma = DIRECTION_SIGMA * location.scale;
    let (columns, rows) = location.window((3.0 * sigma).round());
    let column_weights = gaussian_at(location.x, columns.clone(), sigma);
    let row_weights = gaussian_at(location.y, rows.clone(), sigma);
    let mut raw = [0.0; N_DIRECTIONS];
    for (y, row_weight) in rows.zip(row_weights) {
        gradients.take(location.plane, y, &columns);
        simd::count_directions(&gradients.lengths, &gradients.turns, &column_weights, row_weight, &mut raw);
    }
    std::array::from_fn(|bin| {
        let at = |ahead: usize| raw[(bin + ahead) % N_DIRECTIONS];
        let (near, far) = (at(1) + at(N_DIRECTIONS - 1), at(2) + at(N_DIRECTIONS - 2));
        (6.0 * at(0) + 4.0 * near + far) / 16.0
    })
}

/// The directions of the peaks that are high enough, in radians from 0 to 2 pi.
fn peaks(histogram: &[f32; N_DIRECTIONS]) -> impl Iterator<Item = f32> {
    let highest = histogram.iter().fold(0.0, |highest: f32, &height| highest.max(height));
    (0..N_DIRECTIONS).filter_map(move |bin| {
        let [before, height, after] =
            [N_DIRECTIONS - 1, 0, 1].map(|ahead| histogram[(bin + ahead) % N_DIRECTIONS]);
        let is_peak = height > before && height > after && height >= PEAK_SHARE * highest;
        // The vertex of the parabola through the three.
        let offset = 0.5 * (before - after) / (before - 2.0 * height + after);
        let turn = (bin as f32 + offset) / N_DIRECTIONS as f32;
        is_peak.then(|| turn.rem_euclid(1.0) * std::f32::consts::TAU)
    })
}

#[cfg(test)]
mod tests {
    use super::super::Detector;
    use super::super::testing::*;
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn keypoints_follow_turns_scales_and_light() {
        let detector = Detector::Sift(Sift::default());
        assert_eq!(repeatability(&detector, (0.0, 1.0, 1.0)), 1.0);
        for change in [(0.7, 1.0, 1.0), (4.0, 1.0, 1.0), (0.0, 0.8, 1.0), (2.0, 1.3, 1.0), (0.0, 1.0, 0.8)] {
            let share = repeatability(&detector, change);
            assert!(share >= 0.65, "{change:?}: {share}");
        }
    }

    #[test]
    fn a_blob_is_found_in_its_middle_at_its_size() {
        // s^2 / (s^2 + t^2) is what is left of a Gaussian of sigma s in its middle after a blur of sigma t; the
        // difference between the blurs of t and k t is largest at t = s / sqrt(k).
        let sigma = 6.0f32;
        let pixel = |idx: usize| {
            let (dx, dy) = ((idx % SIDE) as f32 - 90.25, (idx / SIDE) as f32 - 110.5);
            (200.0 * (-(dx * dx + dy * dy) / (2.0 * sigma * sigma)).exp()).round() as u8
        };
        let image = Image::from_pixels(SIDE, SIDE, (0..SIDE * SIDE).map(pixel).collect()).unwrap();
        let mut keypoints = detect(&Detector::Sift(Sift::default()), &image);
        // All directions are as good.
        keypoints.dedup_by_key(|keypoint| keypoint.scale);
        let [blob] = keypoints[..] else { panic!("{keypoints:?}") };
        assert!((blob.x - 90.25).abs() < 0.05 && (blob.y - 110.5).abs() < 0.05, "{blob:?}");
        let expected = sigma * (-0.5f32 / 3.0).exp2();
        assert!((blob.scale / expected - 1.0).abs() < 0.03, "{blob:?}, {expected}");
    }

    #[test]
    fn the_strongest_are_kept() {
        let image = blobs(0.0, 1.0, 1.0);
        let all = detect(&Detector::Sift(Sift::default()), &image);
        let few = detect(&Detector::Sift(Sift { target: 20, ..Sift::default() }), &image);
        let weakest = few.iter().map(|keypoint| keypoint.response).fold(f32::INFINITY, f32::min);
        assert_eq!(few.len(), 20);
        assert!(few.iter().all(|keypoint| all.contains(keypoint)));
        assert!(all.iter().filter(|keypoint| keypoint.response > weakest).all(|strong| few.contains(strong)));
    }

    #[test]
    fn a_turned_panorama_has_the_same_keypoints() {
        assert_keypoints_turn_with_a_panorama(&Detector::Sift(Sift { target: 10_000, ..Sift::default() }));
    }

    #[test]
    fn absurd_parameters_are_refused() {
        let defaults = Sift::default;
        for sift in [
            Sift { target: 0, ..defaults() },
            Sift { n_layers: 0, ..defaults() },
            Sift { n_layers: 100, ..defaults() },
            Sift { sigma: f32::NAN, ..defaults() },
            Sift { sigma: 100.0, ..defaults() },
            Sift { contrast_threshold: -0.1, ..defaults() },
            Sift { edge_threshold: 0.5, ..defaults() },
        ] {
            assert!(sift.check().is_err(), "{sift:?}");
        }
        assert_eq!(defaults().check(), Ok(()));
    }

    proptest! {
        #[test]
        fn small_images_have_valid_keypoints(
            size in (1usize..50, 1usize..50), seed: u64, doubled: bool, n_layers in 1usize..5,
        ) {
            let sift = Sift { doubled, n_layers, ..Sift::default() };
            assert_keypoints_are_valid(&Detector::Sift(sift), size, seed);
        }
    }
}
