//! Keypoints and descriptors from the maps of XFeat.
//!
//! Potje, Cadar, Araujo, Martins and Nascimento, "XFeat: Accelerated Features for Lightweight Image Matching", CVPR
//! 2024, section 3.2, in the sparse form: a network says of each pixel whether it is a keypoint, and of each cell
//! of 8 x 8 pixels how it looks and how far that can be relied on.

use super::XFeatMaps;
use crate::detect::{Keypoint, in_reading_order, keep_strongest};
use crate::matrix::Matrix;

/// Pixels along the side of a cell.
const CELL: usize = 8;

/// Pixels of a cell.
const N_PIXELS: usize = CELL * CELL;

/// Numbers of a descriptor.
const N_CHANNELS: usize = 64;

/// A keypoint is a larger one than all of the 5 x 5 pixels round it.
const REACH: usize = 2;

/// Chances of being a keypoint that are worth a look, as the authors have it.
const THRESHOLD: f32 = 0.05;

/// How many keypoints are taken of the maps of XFeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct XFeat {
    /// The most keypoints of a frame.
    pub target: usize,
}

impl XFeat {
    /// Numbers of a descriptor.
    pub const N_DIMENSIONS: usize = N_CHANNELS;

    /// The strongest keypoints, row by row, in pixels of the network's input, and their descriptors: 64 numbers of
    /// length 1 each. A keypoint is strong where it is likely one and its descriptor can be relied on: the response
    /// is the product of both, from 0 to 1.
    ///
    /// Descriptors are interpolated linearly between the middles of cells, where the authors do it by cubes.
    /// Panics where a map has not as many numbers as cells and channels.
    pub fn keypoints(&self, maps: &XFeatMaps) -> (Vec<Keypoint>, Matrix) {
        let n_cells = maps.n_columns * maps.n_rows;
        assert_eq!(maps.features.len(), N_CHANNELS * n_cells, "features of other cells");
        assert_eq!(maps.keypoints.len(), (N_PIXELS + 1) * n_cells, "keypoints of other cells");
        assert_eq!(maps.reliability.len(), n_cells, "reliabilities of other cells");
        let chances = chances(maps);
        let mut keypoints = peaks(&chances, CELL * maps.n_columns);
        for keypoint in &mut keypoints {
            let corners = corners(maps, keypoint);
            keypoint.response *=
                corners.iter().map(|&(cell, weight)| weight * maps.reliability[cell]).sum::<f32>();
        }
        keypoints.retain(|keypoint| keypoint.response > 0.0);
        keep_strongest(&mut keypoints, self.target);
        keypoints.sort_by(in_reading_order);
        let unit = unit_features(maps);
        let mut descriptors = Matrix::zeros(keypoints.len(), N_CHANNELS);
        for (idx, keypoint) in keypoints.iter().enumerate() {
            let descriptor = descriptors.row_mut(idx);
            for (cell, weight) in corners(maps, keypoint) {
                descriptor.iter_mut().zip(unit.row(cell)).for_each(|(sum, value)| *sum += weight * value);
            }
            make_unit(descriptor);
        }
        (keypoints, descriptors)
    }
}

/// Of each pixel the chance that it is a keypoint: a softmax over the pixels of its cell and none of them.
fn chances(maps: &XFeatMaps) -> Vec<f32> {
    let (n_cells, width) = (maps.n_columns * maps.n_rows, CELL * maps.n_columns);
    let mut chances = vec![0.0; N_PIXELS * n_cells];
    for cell in 0..n_cells {
        let scores: [f32; N_PIXELS + 1] = std::array::from_fn(|pixel| maps.keypoints[pixel * n_cells + cell]);
        let largest = scores.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let powers = scores.map(|score| (score - largest).exp());
        let sum = powers.iter().sum::<f32>();
        let corner = cell / maps.n_columns * CELL * width + cell % maps.n_columns * CELL;
        for (row, powers) in powers.chunks_exact(CELL).enumerate() {
            for (chance, power) in chances[corner + row * width..].iter_mut().zip(powers) {
                *chance = power / sum;
            }
        }
    }
    chances
}

/// The pixels of `width` a row that are above the threshold and not below any other nearby, row by row.
fn peaks(chances: &[f32], width: usize) -> Vec<Keypoint> {
    if width == 0 {
        return Vec::new();
    }
    let height = chances.len() / width;
    let around = |middle: usize, end: usize| middle.saturating_sub(REACH)..(middle + REACH + 1).min(end);
    let is_peak = |x: usize, y: usize, chance: f32| {
        around(y, height).all(|y| chances[y * width..][around(x, width)].iter().all(|&other| other <= chance))
    };
    let likely = chances.iter().enumerate().filter(|&(_, &chance)| chance > THRESHOLD);
    let keypoint = |(idx, &chance): (usize, &f32)| {
        let (x, y) = (idx % width, idx / width);
        is_peak(x, y, chance).then(|| Keypoint::new(x as f32, y as f32, chance))
    };
    likely.filter_map(keypoint).collect()
}

/// The four cells round a keypoint and what each counts; at the border some are the same.
fn corners(maps: &XFeatMaps, keypoint: &Keypoint) -> [(usize, f32); 4] {
    let axis = |position: f32, n_cells: usize| {
        // As the authors' code has it: the first and the last pixel are on the edges of the map.
        let position = position / (CELL * n_cells - 1) as f32 * n_cells as f32 - 0.5;
        let position = position.clamp(0.0, (n_cells - 1) as f32);
        let first = position as usize;
        [(first, 1.0 - position.fract()), ((first + 1).min(n_cells - 1), position.fract())]
    };
    let (columns, rows) = (axis(keypoint.x, maps.n_columns), axis(keypoint.y, maps.n_rows));
    std::array::from_fn(|idx| {
        let ((row, down), (column, across)) = (rows[idx / 2], columns[idx % 2]);
        (row * maps.n_columns + column, down * across)
    })
}

/// The features of each cell, made to length 1, a row each.
fn unit_features(maps: &XFeatMaps) -> Matrix {
    let n_cells = maps.n_columns * maps.n_rows;
    let mut unit = Matrix::zeros(n_cells, N_CHANNELS);
    for (channel, plane) in maps.features.chunks_exact(n_cells.max(1)).enumerate() {
        for (row, &value) in unit.as_mut_slice().chunks_exact_mut(N_CHANNELS).zip(plane) {
            row[channel] = value;
        }
    }
    unit.as_mut_slice().chunks_exact_mut(N_CHANNELS).for_each(make_unit);
    unit
}

/// Divides by the length, if there is any.
fn make_unit(row: &mut [f32]) {
    let length = row.iter().map(|value| value * value).sum::<f32>().sqrt();
    if length > 0.0 {
        row.iter_mut().for_each(|value| *value /= length);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    /// What `tests/golden/xfeat.py` writes.
    #[derive(Deserialize)]
    struct Golden {
        n_columns: usize,
        n_rows: usize,
        one: f32,
        features: Vec<i32>,
        keypoints: Vec<i32>,
        reliability: Vec<i32>,
        found: Vec<Found>,
    }

    #[derive(Clone, Deserialize)]
    struct Found {
        x: f32,
        y: f32,
        response: f32,
        descriptor: Vec<f32>,
    }

    fn golden() -> (Golden, [Vec<f32>; 3]) {
        let golden: Golden = serde_json::from_str(include_str!("../../tests/golden/xfeat.json")).unwrap();
        let floats = |whole: &[i32]| whole.iter().map(|&value| value as f32 / golden.one).collect();
        let maps = [floats(&golden.features), floats(&golden.keypoints), floats(&golden.reliability)];
        (golden, maps)
    }

    fn maps<'a>(golden: &Golden, [features, keypoints, reliability]: &'a [Vec<f32>; 3]) -> XFeatMaps<'a> {
        XFeatMaps { n_columns: golden.n_columns, n_rows: golden.n_rows, features, keypoints, reliability }
    }

    #[test]
    fn keypoints_and_descriptors_are_those_of_numpy() {
        let (golden, floats) = golden();
        let mut by_response = golden.found.clone();
        by_response.sort_by(|a, b| b.response.total_cmp(&a.response));
        for target in [1000, golden.found.len() / 2, 1] {
            let (keypoints, descriptors) = XFeat { target }.keypoints(&maps(&golden, &floats));
            let least = by_response[target.min(by_response.len()) - 1].response;
            let expected: Vec<&Found> = golden.found.iter().filter(|found| found.response >= least).collect();
            assert_eq!((keypoints.len(), descriptors.n_rows()), (expected.len(), expected.len()));
            for ((keypoint, row), found) in keypoints.iter().zip(descriptors.rows()).zip(expected) {
                assert_eq!((keypoint.x, keypoint.y), (found.x, found.y));
                assert!((keypoint.response - found.response).abs() < 1e-5, "{keypoint:?} {}", found.response);
                let differences = row.iter().zip(&found.descriptor).map(|(a, b)| (a - b).abs());
                assert!(differences.fold(0.0, f32::max) < 1e-3);
            }
        }
    }

    #[test]
    fn maps_that_are_no_numbers_show_nothing() {
        let (golden, mut floats) = golden();
        floats[1].fill(f32::NAN);
        let (keypoints, descriptors) = XFeat { target: 10 }.keypoints(&maps(&golden, &floats));
        assert!(keypoints.is_empty() && descriptors.n_rows() == 0);
        let none = XFeatMaps { n_columns: 0, n_rows: 0, features: &[], keypoints: &[], reliability: &[] };
        assert!(XFeat { target: 10 }.keypoints(&none).0.is_empty());
    }
}
