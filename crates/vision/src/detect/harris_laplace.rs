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

use super::{Keypoint, in_reading_order, keep_strongest};
use crate::camera::View;
use crate::plane::{Levels, Plane, ScaleSpace};
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

    /// See [`super::Detector::detect`], in the scale space of an image with
    /// [`HarrisLaplace::levels`]. The response is det M - alpha trace^2 M, the scale s_I.
    pub(super) fn detect(&self, space: &ScaleSpace, view: &View) -> Vec<Keypoint> {
        let levels = self.levels();
        let mut keypoints = Vec::new();
        let mut harris = Harris::default();
        for (octave_idx, planes) in space.octaves().iter().enumerate() {
            let pixel = levels.pixel(octave_idx);
            for (layer, planes) in (1..).zip(planes.windows(3)).take(levels.n_layers) {
                let [derivative, integration] = [layer - 1, layer].map(|layer| levels.sigma(layer as f32));
                harris.measure(&planes[0], derivative, integration);
                harris.for_each_corner(self.threshold, |corner| {
                    let place = [corner.column, corner.row];
                    let laplacians: [f32; 3] = std::array::from_fn(|idx| {
                        let sigma = levels.sigma((layer - 1 + idx) as f32);
                        sigma * sigma * laplacian(&planes[idx], place).abs()
                    });
                    let [below, here, above] = laplacians;
                    if here > self.laplacian_threshold && here > below && here > above {
                        let layer = layer as f32 + vertex(laplacians);
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
    /// Lx^2, Lx Ly and Ly^2, without and with the average over s_I.
    products: [Plane; 3],
    averages: [Plane; 3],
    measure: Plane,
}

impl Harris {
    fn measure(&mut self, plane: &Plane, derivative_sigma: f32, integration_sigma: f32) {
        let (width, height, wraps) = (plane.width(), plane.height(), plane.wraps());
        self.products
            .iter_mut()
            .chain([&mut self.measure])
            .for_each(|plane| plane.resize((width, height), wraps));
        let [xx, xy, yy] = &mut self.products;
        for y in 0..height {
            let [above, row, below] =
                [y.saturating_sub(1), y, (y + 1).min(height - 1)].map(|y| &plane.row(y)[..width]);
            let (xx, xy, yy) = (xx.row_mut(y), xy.row_mut(y), yy.row_mut(y));
            // Central differences are of two pixels.
            let factor = 0.5 * derivative_sigma;
            let mut multiply = |[left, x, right]: [usize; 3]| {
                let (dx, dy) = (factor * (row[right] - row[left]), factor * (below[x] - above[x]));
                (xx[x], xy[x], yy[x]) = (dx * dx, dx * dy, dy * dy);
            };
            (1..width.saturating_sub(1)).for_each(|x| multiply([x - 1, x, x + 1]));
            if wraps {
                [0, width - 1].into_iter().for_each(|x| multiply(plane.around(x)));
            } else {
                // They have a neighbor on one side only; what stood there was of another plane.
                for x in [0, width - 1] {
                    (xx[x], xy[x], yy[x]) = (0.0, 0.0, 0.0);
                }
            }
        }
        for (product, average) in self.products.iter().zip(&mut self.averages) {
            product.blur_into(integration_sigma, average);
        }
        let [xx, xy, yy] = &self.averages;
        for y in 0..height {
            let products = xx.row(y).iter().zip(xy.row(y)).zip(yy.row(y));
            for (measure, ((xx, xy), yy)) in self.measure.row_mut(y).iter_mut().zip(products) {
                let trace = xx + yy;
                *measure = xx * yy - xy * xy - ALPHA * trace * trace;
            }
        }
    }

    /// Calls `visit` for each pixel above `threshold` whose measure exceeds that of its eight neighbors.
    fn for_each_corner(&self, threshold: f32, mut visit: impl FnMut(&Corner)) {
        for row in 1..self.measure.height().saturating_sub(1) {
            let rows = [row - 1, row, row + 1].map(|row| self.measure.row(row));
            for column in self.measure.inner_columns() {
                let response = rows[1][column];
                if response <= threshold {
                    continue;
                }
                let columns = self.measure.around(column);
                let around = rows.iter().flat_map(|row| columns.map(|column| row[column]));
                // One is the pixel itself.
                if around.filter(|&other| other >= response).count() == 1 {
                    let across = columns.map(|column| rows[1][column]);
                    let x = column as f32 + vertex(across);
                    let y = row as f32 + vertex(rows.map(|row| row[column]));
                    visit(&Corner { column, row, x, y, response });
                }
            }
        }
    }
}

/// Lxx + Lyy at a pixel inside the border.
fn laplacian(plane: &Plane, [x, y]: [usize; 2]) -> f32 {
    let row = plane.row(y);
    let [left, _, right] = plane.around(x);
    row[left] + row[right] + plane.row(y - 1)[x] + plane.row(y + 1)[x] - 4.0 * row[x]
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
    use crate::image::Image;
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
