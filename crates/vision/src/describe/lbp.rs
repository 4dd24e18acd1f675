//! Uniform local binary patterns: Ojala, Pietikainen, Maenpaa, "Multiresolution gray-scale and rotation
//! invariant texture classification with local binary patterns", PAMI 24, 2002:
//!
//! LBP = sum over i < 8 of s(n_i - c) 2^i, s(d) = 1 for d >= 0, else 0,
//!
//! with eight neighbors n_i on a circle round the pixel c. The 58 codes with at most two changes between 0
//! and 1 round the circle have a bin each, all others share one: 59 bins; with 2 x 2 cells 236 dimensions.

use super::cells::Cells;
use super::circle::{self, NeighborCircle};
use super::region::{Region, Window};
use crate::camera::View;
use crate::detect::Keypoint;
use crate::image::Image;
use crate::matrix::Matrix;
use crate::simd;
use serde::{Deserialize, Serialize};

const N_NEIGHBORS: usize = 8;

/// Uniform patterns and the bin of all others.
const N_BINS: usize = 59;

/// The LBP descriptor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Lbp {
    /// The circle's radius in pixels, from 1 to 8.
    pub radius: f32,
    /// Cells a side of the region.
    pub n_cells: usize,
    /// The square that is described.
    pub region: Region,
}

impl Default for Lbp {
    fn default() -> Self {
        Self { radius: 1.0, n_cells: 2, region: Region::default() }
    }
}

impl Lbp {
    pub(super) fn n_dimensions(&self) -> usize {
        self.n_cells * self.n_cells * N_BINS
    }

    pub(super) fn check(&self) -> Result<(), String> {
        super::check_circle(self.radius, self.n_cells, &self.region)
    }

    pub(super) fn describe(&self, image: &Image, keypoints: &[Keypoint], view: &View) -> Matrix {
        let circle = NeighborCircle::new(N_NEIGHBORS, self.radius);
        // What is computed are the neighbors darker than the center: the complement of the code.
        let bins = uniform_bins();
        let bins_of_darker = std::array::from_fn(|darker| bins[usize::from(!(darker as u8))]);
        let mut descriptors = Matrix::zeros(keypoints.len(), self.n_dimensions());
        for (region, keypoints) in self.region.by_side(keypoints, self.n_cells) {
            let mut window = Window::new(&region, circle::margin(self.radius));
            let mut cells = Cells::new(&region, self.n_cells, N_BINS);
            let mut darker = window.new_codes();
            for (row_idx, keypoint) in keypoints {
                window.take(image, keypoint, view);
                darker.as_flattened_mut().fill(0);
                let centers = circle.centers(&window);
                for neighbor_idx in 0..N_NEIGHBORS {
                    let neighbors = circle.neighbors(neighbor_idx, &window);
                    simd::mark_brighter(centers, neighbors, 0, 1 << neighbor_idx, &mut darker);
                }
                let row = descriptors.row_mut(row_idx);
                cells.describe(darker.as_flattened_mut(), &bins_of_darker, &window, row);
            }
        }
        descriptors
    }
}

/// The bin of each code: uniform ones in ascending order, then the common bin of the others.
fn uniform_bins() -> [u8; 256] {
    let mut n_uniform = 0;
    std::array::from_fn(|code| {
        let code = code as u8;
        let n_changes = (code ^ code.rotate_left(1)).count_ones();
        if n_changes > 2 {
            return N_BINS as u8 - 1;
        }
        n_uniform += 1;
        n_uniform - 1
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::describe::testing::{noise, smooth_at, whole};

    #[test]
    fn there_are_58_uniform_patterns() {
        let bins = uniform_bins();
        assert_eq!(bins.iter().filter(|&&bin| bin < 58).count(), 58);
        assert_eq!((bins[0], bins[1], bins[0b0101], bins[255]), (0, 1, 58, 57));
    }

    #[test]
    fn flat_regions_have_all_neighbors_as_bright_as_the_center() {
        let image = Image::from_pixels(80, 80, vec![99; 6400]).unwrap();
        let keypoint = Keypoint::new(40.0, 40.0, 0.0);
        let described = Lbp::default().describe(&image, &[keypoint], &whole(&image));
        for (idx, &value) in described.row(0).iter().enumerate() {
            assert_eq!(value, if idx % 59 == 57 { 0.5 } else { 0.0 });
        }
    }

    #[test]
    fn follows_its_definition() {
        let image = noise(90, 80);
        let config = Lbp::default();
        let side = config.region.side;
        let bins = uniform_bins();
        let mut expected = vec![0.0f32; 236];
        for (x, y) in (0..side * side).map(|idx| (idx % side, idx / side)) {
            let center_x = 45.0 + x as f32 - (side / 2) as f32;
            let center_y = 38.0 + y as f32 - (side / 2) as f32;
            let is_bright = |i: &usize| {
                let angle = std::f32::consts::TAU * *i as f32 / 8.0;
                smooth_at(&image, center_x + angle.cos(), center_y - angle.sin())
                    >= smooth_at(&image, center_x, center_y)
            };
            let code: usize = (0..8).filter(is_bright).map(|i| 1 << i).sum();
            expected[(2 * (2 * y / side) + 2 * x / side) * 59 + usize::from(bins[code])] += 1.0;
        }
        let length = expected.iter().map(|count| count * count).sum::<f32>().sqrt();
        let keypoint = Keypoint::new(45.0, 38.0, 0.0);
        let described = config.describe(&image, &[keypoint], &whole(&image));
        assert_eq!(described.row(0).len(), 236);
        for (value, expected) in described.row(0).iter().zip(&expected) {
            assert!((value - expected / length).abs() < 0.04, "{value} {}", expected / length);
        }
    }
}
