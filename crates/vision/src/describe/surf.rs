//! SURF's descriptor: Bay, Ess, Tuytelaars, Van Gool, "Speeded-up robust features (SURF)", CVIU 110, 2008,
//! section 4.2.
//!
//! Round a keypoint of scale s lies a square of side 20s, along its direction. In each of 4 x 4 cells, Haar
//! responses of side 2s along and across the direction, dx and dy, are taken at 5 x 5 places and weighted
//! by a Gaussian of sigma 3.3s. A cell has four numbers: the sums of dx, |dx|, dy and |dy|. Extended, it has
//! eight: dx and |dx| are summed apart where dy < 0 and elsewhere, dy and |dy| where dx < 0 and elsewhere.

use crate::camera::View;
use crate::detect::Keypoint;
use crate::detect::haar::HaarSampler;
use crate::image::Image;
use crate::matrix::Matrix;
use serde::{Deserialize, Serialize};

/// Cells a side of the square.
const N_CELLS: usize = 4;

/// Places a side of the square, one a scale.
const SIDE: usize = 20;

/// Where the keypoint lies between the places, in scales from the first.
const CENTER: f32 = (SIDE as f32 - 1.0) / 2.0;

/// Of the weights, in scales.
const SIGMA: f32 = 3.3;

/// The SURF descriptor. It takes the keypoints of any detector: those without a direction are described
/// along the radial direction of a mirror, in other frames upright.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SurfDescriptor {
    /// Whether a cell has eight numbers instead of four: 128 dimensions instead of 64.
    pub extended: bool,
}

impl SurfDescriptor {
    pub(super) fn n_dimensions(&self) -> usize {
        N_CELLS * N_CELLS * self.n_sums()
    }

    fn n_sums(&self) -> usize {
        if self.extended { 8 } else { 4 }
    }

    /// Half the side of the square that is described, in pixels, and the direction of its upper edge.
    pub(super) fn square(keypoint: &Keypoint, view: &View) -> (f32, (f32, f32)) {
        let right = match keypoint.angle {
            Some(angle) => (angle.cos(), angle.sin()),
            None => super::right_of(keypoint, view),
        };
        (SIDE as f32 / 2.0 * keypoint.scale, right)
    }

    pub(super) fn describe(&self, image: &Image, keypoints: &[Keypoint], view: &View) -> Matrix {
        let sampler = HaarSampler::new(image, view, keypoints.iter().map(half_of).max().unwrap_or_default());
        let weights = weights();
        let mut descriptors = Matrix::zeros(keypoints.len(), self.n_dimensions());
        for (row_idx, keypoint) in keypoints.iter().enumerate() {
            let row = descriptors.row_mut(row_idx);
            let (half_side, right) = Self::square(keypoint, view);
            let half = half_of(keypoint);
            let radius = half_side * std::f32::consts::SQRT_2;
            let is_inside = sampler.contains_all(keypoint.x, keypoint.y, radius, half);
            for (line_idx, weights) in weights.chunks_exact(SIDE).enumerate() {
                let across = (line_idx as f32 - CENTER) * keypoint.scale;
                let cells = &mut row[line_idx * N_CELLS / SIDE * N_CELLS * self.n_sums()..];
                let cells = cells.chunks_exact_mut(self.n_sums()).zip(weights.chunks_exact(SIDE / N_CELLS));
                for (cell_idx, (sums, weights)) in cells.enumerate() {
                    for (column, &weight) in (cell_idx * SIDE / N_CELLS..).zip(weights) {
                        let along = (column as f32 - CENTER) * keypoint.scale;
                        let x = keypoint.x + along * right.0 - across * right.1;
                        let y = keypoint.y + along * right.1 + across * right.0;
                        let (dx, dy) = if is_inside {
                            sampler.response_inside(x, y, half)
                        } else {
                            sampler.response(x, y, half)
                        };
                        let turned = (dx * right.0 + dy * right.1, dy * right.0 - dx * right.1);
                        self.add((weight * turned.0, weight * turned.1), sums);
                    }
                }
            }
            normalize(row);
        }
        descriptors
    }

    /// Adds a response to the sums of its cell.
    fn add(&self, (dx, dy): (f32, f32), sums: &mut [f32]) {
        let (of_dx, of_dy) = match self.extended {
            false => (0, 2),
            true => (2 * usize::from(dy < 0.0), 4 + 2 * usize::from(dx < 0.0)),
        };
        sums[of_dx] += dx;
        sums[of_dx + 1] += dx.abs();
        sums[of_dy] += dy;
        sums[of_dy + 1] += dy.abs();
    }
}

/// Half the side of the wavelets, in whole pixels.
fn half_of(keypoint: &Keypoint) -> usize {
    (keypoint.scale.round() as usize).max(1)
}

/// Of the places of the square, row after row.
fn weights() -> [f32; SIDE * SIDE] {
    std::array::from_fn(|place_idx| {
        let (dx, dy) = ((place_idx % SIDE) as f32 - CENTER, (place_idx / SIDE) as f32 - CENTER);
        (-(dx * dx + dy * dy) / (2.0 * SIGMA * SIGMA)).exp()
    })
}

/// Scales to unit L2 length; what has none stays zero.
fn normalize(row: &mut [f32]) {
    let squared: f64 = row.iter().map(|&value| f64::from(value) * f64::from(value)).sum();
    if squared > 0.0 {
        let factor = 1.0 / squared.sqrt();
        row.iter_mut().for_each(|value| *value = (f64::from(*value) * factor) as f32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Mirror, Projection};
    use crate::describe::testing::{noise, whole};
    use proptest::prelude::*;

    const PLAIN: SurfDescriptor = SurfDescriptor { extended: false };
    const EXTENDED: SurfDescriptor = SurfDescriptor { extended: true };

    fn keypoint(x: f32, y: f32, scale: f32, angle: Option<f32>) -> Keypoint {
        Keypoint { scale, angle, ..Keypoint::new(x, y, 1.0) }
    }

    /// The definition, with wavelets summed pixel by pixel.
    fn naive(image: &Image, keypoint: &Keypoint, extended: bool) -> Vec<f32> {
        let angle = keypoint.angle.unwrap_or_default();
        let half = keypoint.scale.round().max(1.0) as isize;
        let wavelet = |x: f32, y: f32| {
            let (column, row) = ((x + 1.0).floor() as isize, (y + 1.0).floor() as isize);
            let (mut dx, mut dy) = (0.0, 0.0);
            for (right, down) in (-half..half).flat_map(|down| (-half..half).map(move |right| (right, down)))
            {
                let pixel = f32::from(image.row((row + down) as usize)[(column + right) as usize]);
                dx += if right < 0 { -pixel } else { pixel };
                dy += if down < 0 { -pixel } else { pixel };
            }
            (dx, dy)
        };
        let mut cells = vec![[0.0f32; 8]; 16];
        for (u, v) in (0..400).map(|idx| (idx % 20, idx / 20)) {
            let (along, across) = ((u as f32 - 9.5) * keypoint.scale, (v as f32 - 9.5) * keypoint.scale);
            let x = keypoint.x + along * angle.cos() - across * angle.sin();
            let y = keypoint.y + along * angle.sin() + across * angle.cos();
            let (right, down) = wavelet(x, y);
            let weight = (-((u as f32 - 9.5).powi(2) + (v as f32 - 9.5).powi(2)) / (2.0 * 3.3 * 3.3)).exp();
            let dx = weight * (right * angle.cos() + down * angle.sin());
            let dy = weight * (down * angle.cos() - right * angle.sin());
            let cell = &mut cells[v / 5 * 4 + u / 5];
            let (first, second) = if dy < 0.0 { (2, 3) } else { (0, 1) };
            cell[first] += dx;
            cell[second] += dx.abs();
            let (first, second) = if dx < 0.0 { (6, 7) } else { (4, 5) };
            cell[first] += dy;
            cell[second] += dy.abs();
        }
        let plain = |cell: &[f32; 8]| {
            vec![cell[0] + cell[2], cell[1] + cell[3], cell[4] + cell[6], cell[5] + cell[7]]
        };
        let numbers: Vec<f32> =
            cells.iter().flat_map(|cell| if extended { cell.to_vec() } else { plain(cell) }).collect();
        let length = numbers.iter().map(|number| number * number).sum::<f32>().sqrt();
        numbers.iter().map(|number| number / length).collect()
    }

    #[test]
    fn follows_its_definition() {
        let image = noise(120, 110);
        for keypoint in [
            keypoint(60.0, 55.0, 1.0, None),
            keypoint(58.3, 50.7, 1.6, Some(0.7)),
            keypoint(61.2, 56.4, 2.9, Some(4.0)),
        ] {
            for descriptor in [PLAIN, EXTENDED] {
                let described = descriptor.describe(&image, &[keypoint], &whole(&image));
                let expected = naive(&image, &keypoint, descriptor.extended);
                assert_eq!(described.n_cols(), expected.len());
                for (value, expected) in described.row(0).iter().zip(expected) {
                    assert!((value - expected).abs() < 1e-4, "{keypoint:?}: {value} {expected}");
                }
            }
        }
        assert_eq!((PLAIN.n_dimensions(), EXTENDED.n_dimensions()), (64, 128));
    }

    #[test]
    fn gain_and_offset_of_light_do_not_matter() {
        let image = noise(100, 100);
        let darker = image.pixels().iter().map(|&pixel| pixel / 4 + 30).collect();
        let darker = Image::from_pixels(100, 100, darker).unwrap();
        let keypoint = keypoint(50.0, 50.0, 2.0, None);
        let rows = [&image, &darker].map(|image| PLAIN.describe(image, &[keypoint], &whole(image)));
        let similarity: f32 = rows[0].row(0).iter().zip(rows[1].row(0)).map(|(a, b)| a * b).sum();
        assert!(similarity > 0.999, "{similarity}");
    }

    #[test]
    fn flat_surroundings_have_no_description() {
        let image = Image::from_pixels(50, 50, vec![77; 2500]).unwrap();
        let described = EXTENDED.describe(&image, &[keypoint(25.0, 25.0, 1.5, None)], &whole(&image));
        assert_eq!(described.row(0), [0.0; 128]);
    }

    #[test]
    fn without_a_direction_regions_lie_along_the_radius_of_a_mirror() {
        let mirror = Mirror { center_x: 0.5, center_y: 0.5, inner_radius: 0.05, outer_radius: 0.5 };
        let view = Camera::new(Projection::Omnidirectional(mirror)).view(240, 240);
        // Rings: brightness changes along the radius only.
        let ring = |idx: usize| {
            let (dx, dy) = ((idx % 240) as f32 - 120.0, (idx / 240) as f32 - 120.0);
            (127.0 + 100.0 * (dx.hypot(dy) / 6.0).sin()) as u8
        };
        let image = Image::from_pixels(240, 240, (0..240 * 240).map(ring).collect()).unwrap();
        for angle in [0.0f32, 0.7, 2.0, 4.4] {
            let (x, y) = (120.0 + 60.0 * angle.cos(), 120.0 + 60.0 * angle.sin());
            let described = PLAIN.describe(&image, &[keypoint(x, y, 1.0, None)], &view);
            let [mut across, mut along] = [0.0, 0.0];
            for sums in described.row(0).chunks(4) {
                across += sums[1];
                along += sums[3];
            }
            assert!(along > 4.0 * across, "{angle}: {along} {across}");
        }
    }

    #[test]
    fn what_lies_outside_does_not_count() {
        let image = noise(100, 80);
        let mut altered = image.pixels().to_vec();
        altered.chunks_mut(100).for_each(|row| row[50..].fill(0));
        let altered = Image::from_pixels(100, 80, altered).unwrap();
        let hidden = Image::from_pixels(2, 1, vec![255, 0]).unwrap();
        let camera =
            Camera { projection: Projection::Perspective, mask: Some(crate::camera::Mask::new(hidden)) };
        let view = camera.view(100, 80);
        let keypoints = [keypoint(45.0, 40.0, 1.0, Some(0.3)), keypoint(40.0, 4.0, 2.0, None)];
        let described = PLAIN.describe(&image, &keypoints, &view);
        assert_eq!(described, PLAIN.describe(&altered, &keypoints, &view));
        assert!(described.rows().all(|row| row.iter().any(|&value| value != 0.0)));
    }

    #[test]
    fn panoramas_continue_beyond_their_edge() {
        let image = noise(120, 80);
        let turned = (0..120 * 80).map(|idx| image.row(idx / 120)[(idx % 120 + 60) % 120]).collect();
        let turned = Image::from_pixels(120, 80, turned).unwrap();
        let view = Camera::new(Projection::Equirectangular).view(120, 80);
        let on_seam = PLAIN.describe(&image, &[keypoint(2.0, 40.0, 1.5, Some(1.0))], &view);
        assert_eq!(on_seam, PLAIN.describe(&turned, &[keypoint(62.0, 40.0, 1.5, Some(1.0))], &view));
    }

    proptest! {
        #[test]
        fn keypoints_of_any_kind_have_at_most_unit_length(
            (width, height) in (1usize..30, 1usize..30), (x, y) in (-50f32..100.0, -50f32..100.0),
            scale in prop_oneof![0f32..10.0, Just(f32::MAX), Just(f32::INFINITY), Just(f32::NAN)],
            angle in prop::option::of(0f32..6.3), extended in any::<bool>(),
        ) {
            let image = noise(width, height);
            let mirror = Mirror { center_x: 0.5, center_y: 0.5, inner_radius: 0.0, outer_radius: 4.0 };
            for projection in
                [Projection::Perspective, Projection::Equirectangular, Projection::Omnidirectional(mirror)]
            {
                let view = Camera::new(projection).view(width, height);
                let described =
                    SurfDescriptor { extended }.describe(&image, &[keypoint(x, y, scale, angle)], &view);
                let squared: f32 = described.row(0).iter().map(|value| value * value).sum();
                prop_assert!(squared == 0.0 || (squared - 1.0).abs() < 1e-5, "{squared}");
            }
        }
    }
}
