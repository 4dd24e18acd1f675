//! Harris-Laplace keypoints: Mikolajczyk and Schmid, "Scale & affine invariant interest point detectors",
//! IJCV 60(1), 2004, section 3, in the simplified form of its section 3.1.3.
//!
//! At each scale, corners are the maxima in place of det M - alpha trace^2 M, where
//!
//! M(x, s_I, s_D) = s_D^2 g(s_I) * \[Lx^2, Lx Ly; Lx Ly, Ly^2\](x, s_D)
//!
//! is built from derivatives at s_D and averaged over s_I (equations 3 and 4). Those are kept at which
//! s^2 |Lxx + Lyy| (equation 5) is larger at s_I than at the scales below and above. Scales grow by the
//! square root of 2, so that s_D is the scale below s_I; the paper takes factors of 1.4 and 0.7.

use super::{Keypoint, for_each_marked, in_reading_order, keep_strongest};
use crate::camera::View;
use crate::image::Image;
use crate::plane::{Blur, Extent, Levels, Plane, ScaleSpace};
use crate::simd;
use serde::{Deserialize, Serialize};

/// How much a large trace, as of edges, counts against a corner.
const ALPHA: f32 = 0.04;

/// The surroundings that must be valid, in scales.
const REACH: f32 = 2.0;

/// The Harris-Laplace detector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HarrisLaplace {
    /// How many of highest response to keep.
    pub target: usize,
    /// The smallest scale that derivatives are taken at, in pixels, from 0.7 to 4.
    pub sigma: f32,
    /// The least response, for gray values from 0 to 1. It grows with the fourth power of the contrast.
    pub threshold: f32,
    /// The least magnitude of the scaled Laplacian, for gray values from 0 to 1.
    pub laplacian_threshold: f32,
}

impl Default for HarrisLaplace {
    fn default() -> Self {
        Self { target: 300, sigma: 1.0, threshold: 1e-8, laplacian_threshold: 0.01 }
    }
}

impl HarrisLaplace {
    pub(super) fn check(&self) -> Result<(), String> {
        super::check_target(self.target)?;
        if !(0.7..=4.0).contains(&self.sigma) {
            return Err(format!(
                "the sigma of Harris-Laplace must be from 0.7 to 4 pixels, not {}",
                self.sigma
            ));
        }
        for (name, threshold) in
            [("threshold", self.threshold), ("laplacian_threshold", self.laplacian_threshold)]
        {
            if !(0.0..1.0).contains(&threshold) {
                return Err(format!("the {name} of Harris-Laplace must be from 0 to 1, not {threshold}"));
            }
        }
        Ok(())
    }

    /// See [`super::Detector::levels`].
    pub(super) fn levels(&self) -> Levels {
        Levels { sigma: self.sigma, n_layers: 2, doubled: false }
    }

    /// See [`super::Detector::detect_with`]. The response is det M - alpha trace^2 M, the scale s_I.
    pub(super) fn detect(&self, image: &Image, view: &View, space: &mut ScaleSpace) -> Vec<Keypoint> {
        let levels = self.levels();
        // The plane after those that points are described in is needed at few places.
        let extent = Extent { coarsest: f32::INFINITY, n_more: 0 };
        space.build(&Plane::new(image, view.wraps()), levels, extent, |_| ());
        let mut keypoints = Vec::new();
        let mut harris = Harris::default();
        for (octave_idx, octave) in space.octaves().iter().enumerate() {
            let pixel = levels.pixel(octave_idx);
            for layer in 1..=levels.n_layers {
                let [derivative, integration] = [layer - 1, layer].map(|layer| levels.sigma(layer as f32));
                harris.measure(&octave.planes()[layer - 1], derivative, integration);
                harris.for_each_corner(self.threshold, |corner| {
                    let laplacian = |layer: usize| {
                        let sigma = levels.sigma(layer as f32);
                        sigma * sigma * laplacian(&octave.around(layer, corner.column, corner.row)).abs()
                    };
                    let [below, here] = [layer - 1, layer].map(laplacian);
                    if here <= self.laplacian_threshold || here <= below {
                        return;
                    }
                    let above = laplacian(layer + 1);
                    if here > above {
                        let layer = layer as f32 + vertex([below, here, above]);
                        keypoints.push(Keypoint {
                            scale: levels.sigma(layer) * pixel,
                            ..Keypoint::new(corner.x * pixel, corner.y * pixel, corner.response)
                        });
                    }
                });
            }
        }
        keypoints.iter_mut().for_each(|found| found.x = view.column(found.x));
        keypoints.retain(|found| view.contains(found.x, found.y, REACH * found.scale));
        keep_strongest(&mut keypoints, self.target);
        keypoints.sort_by(in_reading_order);
        keypoints
    }
}

/// A maximum of the Harris measure.
struct Corner {
    column: usize,
    row: usize,
    /// Its column and row to a fraction of a pixel.
    x: f32,
    y: f32,
    response: f32,
}

/// The Harris measure of a plane; the memory is used again and again.
#[derive(Default)]
struct Harris {
    /// Lx^2, Lx Ly and Ly^2.
    products: [Plane; 3],
    /// Some of their rows, averaged over s_I.
    averages: [Vec<f32>; 3],
    measure: Plane,
    marks: Vec<u8>,
}

impl Harris {
    fn measure(&mut self, plane: &Plane, derivative_sigma: f32, integration_sigma: f32) {
        let (width, height, wraps) = (plane.width(), plane.height(), plane.wraps());
        self.products
            .iter_mut()
            .chain([&mut self.measure])
            .for_each(|plane| plane.resize((width, height), wraps));
        let mut blur = Blur::new(integration_sigma);
        let (mut n_multiplied, mut n_measured) = (0, 0);
        // Products are averaged while they are in the cache.
        while n_measured < height {
            let multiplied = n_multiplied..(n_multiplied + Blur::STRIP).min(height);
            n_multiplied = multiplied.end;
            multiplied.for_each(|y| self.multiply(plane, y, derivative_sigma));
            let rows = n_measured..blur.n_ready(height, n_multiplied);
            n_measured = rows.end;
            for (product, averages) in self.products.iter().zip(&mut self.averages) {
                averages.resize(rows.len() * width, 0.0);
                blur.blur_rows(product, rows.start, averages);
            }
            let averages = self.averages.each_ref().map(Vec::as_slice);
            simd::harris_measure(averages, ALPHA, self.measure.rows_mut(rows));
        }
    }

    /// The products of the derivatives of row `y`.
    fn multiply(&mut self, plane: &Plane, y: usize, derivative_sigma: f32) {
        let (width, height) = (plane.width(), plane.height());
        let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)].map(|y| plane.row(y));
        let mut products = self.products.each_mut().map(|plane| plane.row_mut(y));
        // Central differences are of two pixels.
        let factor = 0.5 * derivative_sigma;
        for x in [0, width - 1] {
            if plane.wraps() {
                let rows = rows.map(|row| plane.around(x).map(|x| row[x]));
                let mut single = [[0.0]; 3];
                let rows = rows.each_ref().map(|row| &row[..]);
                simd::derivative_products(rows, factor, single.each_mut().map(|product| &mut product[..]));
                products.iter_mut().zip(single).for_each(|(products, [product])| products[x] = product);
            } else {
                // It has a neighbor on one side only; what stood there was of another plane.
                products.iter_mut().for_each(|products| products[x] = 0.0);
            }
        }
        if width > 2 {
            simd::derivative_products(rows, factor, products.map(|products| &mut products[1..width - 1]));
        }
    }

    /// Calls `visit` for each pixel above `threshold` whose measure exceeds that of its eight neighbors.
    fn for_each_corner(&mut self, threshold: f32, mut visit: impl FnMut(&Corner)) {
        let measure = &self.measure;
        let seam = [0, measure.width() - 1];
        let seam = if measure.wraps() { &seam[..] } else { &[] };
        self.marks.resize(measure.width().saturating_sub(2), 0);
        for row in 1..measure.height().saturating_sub(1) {
            let rows = [row - 1, row, row + 1].map(|row| measure.row(row));
            let mut visit = |column: usize| {
                let across = measure.around(column).map(|column| rows[1][column]);
                let x = column as f32 + vertex(across);
                let y = row as f32 + vertex(rows.map(|row| row[column]));
                visit(&Corner { column, row, x, y, response: rows[1][column] });
            };
            simd::mark_maxima(rows, threshold, &mut self.marks);
            for_each_marked(&self.marks, |x| visit(x + 1));
            for &column in seam {
                let around = rows.map(|row| measure.around(column).map(|column| row[column]));
                let mut mark = [0];
                simd::mark_maxima(around.each_ref().map(|row| &row[..]), threshold, &mut mark);
                if mark != [0] {
                    visit(column);
                }
            }
        }
    }
}

/// Lxx + Lyy of the pixel in the middle.
fn laplacian([above, row, below]: &[[f32; 3]; 3]) -> f32 {
    row[0] + row[2] + above[1] + below[1] - 4.0 * row[1]
}

/// How far from the middle one the vertex of the parabola through three values is, of which the middle one is
/// largest.
fn vertex([before, middle, after]: [f32; 3]) -> f32 {
    0.5 * (before - after) / (before - 2.0 * middle + after)
}

#[cfg(test)]
mod tests {
    use super::super::Detector;
    use super::super::testing::*;
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn keypoints_follow_turns_scales_and_light() {
        let detector = Detector::HarrisLaplace(HarrisLaplace::default());
        assert_eq!(repeatability(&detector, (0.0, 1.0, 1.0)), 1.0);
        for change in [(0.7, 1.0, 1.0), (4.0, 1.0, 1.0), (0.0, 0.8, 1.0), (2.0, 1.3, 1.0), (0.0, 1.0, 0.8)] {
            let share = repeatability(&detector, change);
            assert!(share >= 0.65, "{change:?}: {share}");
        }
    }

    #[test]
    fn a_measure_is_of_its_plane_alone() {
        let plane = |side: usize| {
            let pixels = (0..side * side).map(|idx| (idx * 31 % 251) as u8).collect();
            Plane::new(&Image::from_pixels(side, side, pixels).unwrap(), false)
        };
        let (mut used, mut fresh) = (Harris::default(), Harris::default());
        used.measure(&plane(40), 1.0, 1.4);
        used.measure(&plane(20), 1.0, 1.4);
        fresh.measure(&plane(20), 1.0, 1.4);
        for y in 0..20 {
            assert_eq!(used.measure.row(y), fresh.measure.row(y), "{y}");
        }
    }

    #[test]
    fn the_corners_of_a_square_are_found() {
        let is_inside = |position: usize| (80..=119).contains(&position);
        let pixel = |idx: usize| if is_inside(idx % SIDE) && is_inside(idx / SIDE) { 200 } else { 50 };
        let image = Image::from_pixels(SIDE, SIDE, (0..SIDE * SIDE).map(pixel).collect()).unwrap();
        let keypoints = detect(&Detector::HarrisLaplace(HarrisLaplace::default()), &image);
        // Smoothing moves them inward.
        for (x, y) in [(79.5, 79.5), (119.5, 79.5), (79.5, 119.5), (119.5, 119.5)] {
            let is_near = |found: &&Keypoint| (found.x - x).hypot(found.y - y) < 2.0 * found.scale;
            assert!(keypoints.iter().any(|found| is_near(&found)), "{x} {y}: {keypoints:?}");
        }
        let is_on_side =
            |found: &Keypoint| (90.0..110.0).contains(&found.x) != (90.0..110.0).contains(&found.y);
        assert!(!keypoints.iter().any(is_on_side), "{keypoints:?}");
    }

    #[test]
    fn a_turned_panorama_has_the_same_keypoints() {
        assert_keypoints_turn_with_a_panorama(&Detector::HarrisLaplace(HarrisLaplace {
            target: 10_000,
            ..HarrisLaplace::default()
        }));
    }

    #[test]
    fn absurd_parameters_are_refused() {
        let defaults = HarrisLaplace::default;
        for harris in [
            HarrisLaplace { target: 0, ..defaults() },
            HarrisLaplace { sigma: f32::NAN, ..defaults() },
            HarrisLaplace { sigma: 100.0, ..defaults() },
            HarrisLaplace { threshold: -0.1, ..defaults() },
            HarrisLaplace { laplacian_threshold: 2.0, ..defaults() },
        ] {
            assert!(harris.check().is_err(), "{harris:?}");
        }
        assert_eq!(defaults().check(), Ok(()));
    }

    proptest! {
        #[test]
        fn small_images_have_valid_keypoints(size in (1usize..50, 1usize..50), seed: u64) {
            assert_keypoints_are_valid(&Detector::HarrisLaplace(HarrisLaplace::default()), size, seed);
        }
    }
}
