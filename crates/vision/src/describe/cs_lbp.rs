//! Center-symmetric local binary patterns: Heikkila, Pietikainen, Schmid, "Description of interest regions
//! with local binary patterns", Pattern Recognition 42, 2009, equation 2:
//!
//! CS-LBP = sum over i < N/2 of s(n_i - n_{i + N/2}) 2^i, s(d) = 1 for d > T, else 0,
//!
//! with neighbors n_0 .. n_{N-1} evenly spread on a circle of radius R round the pixel. The place
//! recognition paper uses N = 6 and 3 x 3 cells: 8 bins a cell, 72 dimensions; R and T are not published.

use super::cells::Cells;
use super::circle::{self, NeighborCircle};
use super::code_sums::{CellEdges, CodeSums, MAX_PIXELS, N_CODES, PIXELS_A_SQUARE_PIXEL};
use super::codes::Codes;
use super::region::{Region, Weighting, Window};
use crate::camera::{CameraKind, View};
use crate::detect::Keypoint;
use crate::image::Image;
use crate::matrix::Matrix;
use serde::{Deserialize, Serialize};

/// The CS-LBP descriptor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CsLbp {
    /// Neighbors on the circle: an even number from 2 to 16; a cell has 2^(N/2) bins.
    pub n_neighbors: usize,
    /// The circle's radius in pixels, from 1 to 8.
    pub radius: f32,
    /// How much opposite neighbors must differ, as a fraction of the gray range.
    pub threshold: f32,
    /// Cells a side of the region.
    pub n_cells: usize,
    /// The square that is described.
    pub region: Region,
}

impl Default for CsLbp {
    fn default() -> Self {
        Self { n_neighbors: 6, radius: 2.0, threshold: 0.01, n_cells: 3, region: Region::default() }
    }
}

impl CsLbp {
    pub(super) fn n_dimensions(&self) -> usize {
        (self.n_cells * self.n_cells) << (self.n_neighbors / 2)
    }

    pub(super) fn check(&self) -> Result<(), String> {
        if !self.n_neighbors.is_multiple_of(2) || !(2..=16).contains(&self.n_neighbors) {
            return Err(format!(
                "CS-LBP takes an even number of 2 to 16 neighbors, not {}",
                self.n_neighbors
            ));
        }
        if !(0.0..1.0).contains(&self.threshold) {
            return Err(format!("the CS-LBP threshold must be from 0 to 1, not {}", self.threshold));
        }
        super::check_circle(self.radius, self.n_cells, &self.region)
    }

    pub(super) fn describe(&self, image: &Image, keypoints: &[Keypoint], view: &View) -> Matrix {
        let mut descriptors = Matrix::zeros(keypoints.len(), self.n_dimensions());
        let codes = self.codes();
        let sums =
            self.is_faster_by_tables(image, keypoints, view).then(|| CodeSums::new(&codes, image, view));
        for (region, keypoints) in self.region.by_side(keypoints, self.n_cells) {
            match &sums {
                Some(sums) => {
                    let edges = CellEdges::new(region.side, self.n_cells);
                    for (row_idx, keypoint) in keypoints {
                        sums.describe(keypoint, &edges, 1 << codes.n_pairs, descriptors.row_mut(row_idx));
                    }
                }
                None => self.describe_each(&codes, &region, (image, view), &keypoints, &mut descriptors),
            }
        }
        descriptors
    }

    /// Whether tables ([`CodeSums`]) can describe these keypoints, and cost less than looking at each by itself.
    pub(super) fn is_faster_by_tables(&self, image: &Image, keypoints: &[Keypoint], view: &View) -> bool {
        let n_pixels = image.width() * image.height();
        let is_whole = |position: f32| position.fract() == 0.0;
        let n_in_squares =
            || keypoints.iter().map(|found| self.region.side_at(found, self.n_cells).pow(2)).sum::<usize>();
        self.n_dimensions() <= N_CODES * self.n_cells.pow(2)
            && self.region.weighting == Weighting::Uniform
            && view.kind() != CameraKind::Omnidirectional
            && n_pixels <= MAX_PIXELS
            && keypoints.iter().all(|found| is_whole(found.x) && is_whole(found.y))
            && n_in_squares() > PIXELS_A_SQUARE_PIXEL * n_pixels
    }

    /// Describes keypoints with a region of the same side one by one.
    pub(super) fn describe_each(
        &self,
        codes_of: &Codes,
        region: &Region,
        (image, view): (&Image, &View),
        keypoints: &[(usize, &Keypoint)],
        descriptors: &mut Matrix,
    ) {
        let mut window = Window::new(region, codes_of.margin);
        let mut cells = Cells::new(region, self.n_cells, 1 << codes_of.n_pairs);
        let mut codes = window.new_codes();
        let bins = std::array::from_fn(|code| code as u8);
        for &(row_idx, keypoint) in keypoints {
            window.take(image, keypoint, view);
            codes_of.write(window.pixels(), window.side(), &mut codes);
            cells.describe(codes.as_flattened_mut(), &bins, &window, descriptors.row_mut(row_idx));
        }
    }

    pub(super) fn codes(&self) -> Codes {
        Codes {
            n_pairs: self.n_neighbors / 2,
            threshold: (self.threshold * 255.0 * 256.0).round() as u16,
            circle: NeighborCircle::new(self.n_neighbors, self.radius),
            margin: circle::margin(self.radius),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::describe::testing::{noise, smooth_at, whole};

    /// The definition, pixel by pixel, in floating point.
    fn naive(config: &CsLbp, image: &Image, keypoint: &Keypoint) -> Vec<f32> {
        let side = config.region.side;
        let n_bins = 1 << (config.n_neighbors / 2);
        let mut histogram = vec![0.0; config.n_dimensions()];
        for y in 0..side {
            for x in 0..side {
                let center_x = keypoint.x + x as f32 - (side / 2) as f32;
                let center_y = keypoint.y + y as f32 - (side / 2) as f32;
                let neighbor = |i: usize| {
                    let angle = std::f32::consts::TAU * i as f32 / config.n_neighbors as f32;
                    let dx = config.radius * angle.cos();
                    smooth_at(image, center_x + dx, center_y - config.radius * angle.sin())
                };
                let code: usize = (0..config.n_neighbors / 2)
                    .filter(|&i| {
                        neighbor(i) - neighbor(i + config.n_neighbors / 2) > config.threshold * 255.0
                    })
                    .map(|i| 1 << i)
                    .sum();
                let cell = (y * config.n_cells / side) * config.n_cells + x * config.n_cells / side;
                histogram[cell * n_bins + code] += 1.0;
            }
        }
        let length = histogram.iter().map(|count: &f32| count * count).sum::<f32>().sqrt();
        histogram.iter().map(|count| count / length).collect()
    }

    #[test]
    fn follows_its_definition() {
        let image = noise(90, 80);
        for config in [
            CsLbp::default(),
            CsLbp { n_neighbors: 8, radius: 1.5, n_cells: 4, ..CsLbp::default() },
            CsLbp { threshold: 0.1, region: Region { side: 25, ..Region::default() }, ..CsLbp::default() },
        ] {
            let keypoint = Keypoint::new(45.0, 38.0, 0.0);
            let described = config.describe(&image, &[keypoint], &whole(&image));
            assert_eq!(described.row(0).len(), config.n_dimensions());
            for (value, expected) in described.row(0).iter().zip(naive(&config, &image, &keypoint)) {
                // Fixed point may decide a tie otherwise: a pixel or two of a cell.
                assert!((value - expected).abs() < 0.02, "{value} {expected}");
            }
        }
        assert_eq!(CsLbp::default().n_dimensions(), 72);
    }

    #[test]
    fn absurd_parameters_are_refused() {
        let defaults = CsLbp::default;
        for config in [
            CsLbp { n_neighbors: 7, ..defaults() },
            CsLbp { n_neighbors: 18, ..defaults() },
            CsLbp { radius: f32::NAN, ..defaults() },
            CsLbp { radius: 100.0, ..defaults() },
            CsLbp { threshold: -0.1, ..defaults() },
            CsLbp { n_cells: 0, ..defaults() },
            CsLbp { region: Region { side: 100_000, ..Region::default() }, ..defaults() },
        ] {
            assert!(config.check().is_err(), "{config:?}");
        }
        assert_eq!(defaults().check(), Ok(()));
    }
}
