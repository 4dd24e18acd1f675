//! The codes of a whole frame, counted once for all squares that are described: summed-area tables, one a code
//! (Crow, "Summed-area tables for texture mapping", 1984; Porikli, "Integral histogram", 2005).
//!
//! Gives the same descriptors as looking at each square by itself, bit for bit.

use super::codes::Codes;
use super::region::{MAX_SIDE, copy_rows};
use crate::camera::View;
use crate::detect::Keypoint;
use crate::image::Image;
use crate::simd;

/// Codes that are counted apart, as many as fit one vector register.
pub(super) const N_CODES: usize = 8;

/// The most pixels of a frame that tables are made for: 64 MiB of them.
pub(super) const MAX_PIXELS: usize = 1 << 22;

/// What tables of a pixel cost less than one pixel in this many of the squares, looked at one by one.
pub(super) const PIXELS_A_SQUARE_PIXEL: usize = 2;

/// How often each code occurs. Counts are whole numbers modulo 2^16; no cell has as many pixels.
type Counts = [u16; N_CODES];

/// The counts of the pixels above and to the left of each pixel of a frame.
pub(super) struct CodeSums {
    /// A row more than pixels, and a column more: the first ones are zero.
    sums: Vec<Counts>,
    n_columns: usize,
    n_rows: usize,
    /// Columns before the first of the frame, where its edges meet.
    pad: usize,
}

/// Where the cells of a square begin and end along its sides, from its first pixel on.
pub(super) struct CellEdges {
    side: usize,
    edges: Vec<usize>,
}

impl CellEdges {
    /// Of `n_cells` x `n_cells` cells: pixel `p` is in cell `p * n_cells / side`.
    pub(super) fn new(side: usize, n_cells: usize) -> Self {
        Self { side, edges: (0..=n_cells).map(|cell| (cell * side).div_ceil(n_cells)).collect() }
    }
}

impl CodeSums {
    /// Counts the codes of all pixels of `image` that lie, with the margin of the codes, in the valid region of
    /// `view`. There are at most [`N_CODES`] codes.
    pub(super) fn new(codes_of: &Codes, image: &Image, view: &View) -> Self {
        let margin = codes_of.margin;
        let pad = if view.wraps() { MAX_SIDE / 2 + 1 } else { 0 };
        let (n_columns, n_rows) = (image.width() + 2 * pad, image.height());
        let stride = n_columns + 2 * margin;
        // As many more pixels as are read beyond the last row.
        let mut pixels = vec![0; stride * (n_rows + 2 * margin + 1) + 2 * simd::CODE_BLOCK];
        let corner = (-((pad + margin) as isize), -(margin as isize));
        copy_rows(image, corner, stride, view.wraps(), &mut pixels[..stride * (n_rows + 2 * margin)]);
        let mut codes = vec![[0; simd::CODE_BLOCK]; (stride * n_rows).div_ceil(simd::CODE_BLOCK)];
        codes_of.write(&pixels, stride, &mut codes);

        let one_of: [Counts; 256] =
            std::array::from_fn(|code| std::array::from_fn(|counted| u16::from(counted == code)));
        let mut sums = vec![Counts::default(); (n_columns + 1) * (n_rows + 1)];
        let mut outside = vec![0; n_columns];
        for (y, codes) in codes.as_flattened().chunks(stride).take(n_rows).enumerate() {
            view.mark_outside((-(pad as f32), y as f32), (1.0, 0.0), margin as f32, &mut outside);
            let (above, row) = sums[y * (n_columns + 1)..].split_at_mut(n_columns + 1);
            let mut of_row = Counts::default();
            for (x, (&code, &outside)) in codes.iter().zip(&outside).enumerate() {
                // What is outside has the code 255, which is not counted.
                of_row = added(of_row, one_of[usize::from(code | outside)]);
                row[x + 1] = added(above[x + 1], of_row);
            }
        }
        Self { sums, n_columns, n_rows, pad }
    }

    /// The histograms of the first `n_bins` codes over the cells of the square round `keypoint`, scaled to unit L2
    /// length, into `row`.
    pub(super) fn describe(&self, keypoint: &Keypoint, edges: &CellEdges, n_bins: usize, row: &mut [f32]) {
        let first = |position: f32| position as isize - (edges.side / 2) as isize;
        let (left, top) = (first(keypoint.x) + self.pad as isize, first(keypoint.y));
        let clamped =
            |start: isize, edge: usize, end: usize| (start + edge as isize).clamp(0, end as isize) as usize;
        let n_cells = edges.edges.len() - 1;
        let mut length = 0u64;
        let mut counts = [Counts::default(); 64];
        for (cell_row, rows) in edges.edges.windows(2).enumerate() {
            let [above, below] =
                [rows[0], rows[1]].map(|edge| clamped(top, edge, self.n_rows) * (self.n_columns + 1));
            for (cell_column, columns) in edges.edges.windows(2).enumerate() {
                let [before, behind] =
                    [columns[0], columns[1]].map(|edge| clamped(left, edge, self.n_columns));
                let sum = |at: usize| self.sums[at];
                let upper = subtracted(sum(above + behind), sum(above + before));
                let both = subtracted(sum(below + behind), sum(below + before));
                let of_cell = subtracted(both, upper);
                length +=
                    of_cell[..n_bins].iter().map(|&count| u64::from(count) * u64::from(count)).sum::<u64>();
                counts[cell_row * n_cells + cell_column] = of_cell;
            }
        }
        let scale = if length > 0 { 1.0 / (length as f64).sqrt() } else { 0.0 };
        for (values, counts) in row.chunks_exact_mut(n_bins).zip(&counts) {
            for (value, &count) in values.iter_mut().zip(counts) {
                *value = (f64::from(count) * scale) as f32;
            }
        }
    }
}

#[inline(always)]
fn added(a: Counts, b: Counts) -> Counts {
    std::array::from_fn(|code| a[code].wrapping_add(b[code]))
}

#[inline(always)]
fn subtracted(a: Counts, b: Counts) -> Counts {
    std::array::from_fn(|code| a[code].wrapping_sub(b[code]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Mask, Projection};
    use crate::describe::region::Weighting;
    use crate::describe::testing::noise;
    use crate::describe::{CsLbp, Region};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn counting_once_for_all_equals_counting_square_by_square(
            (width, height) in (1usize..90, 1usize..70), n_pairs in 1usize..=3, radius in 1f32..4.0,
            n_cells in 1usize..=8, side in 8usize..70, wraps: bool, is_masked: bool,
            places in prop::collection::vec((0.0f32..1.0, 0.0f32..1.0, 0.5f32..4.0), 1..8),
        ) {
            let image = noise(width, height);
            let projection = if wraps { Projection::Equirectangular } else { Projection::Perspective };
            let mask = Image::from_pixels(3, 2, vec![255, 255, 0, 255, 255, 255]).unwrap();
            let view = Camera { projection, mask: is_masked.then(|| Mask::new(mask)) }.view(width, height);
            let region = Region { side, scaled: true, ..Region::default() };
            let config = CsLbp { n_neighbors: 2 * n_pairs, radius, n_cells, region, ..CsLbp::default() };
            let keypoint = |&(x, y, scale): &(f32, f32, f32)| {
                let (x, y) = ((x * width as f32).floor(), (y * height as f32).floor());
                Keypoint { scale, ..Keypoint::new(x, y, 1.0) }
            };
            let keypoints: Vec<Keypoint> = places.iter().map(keypoint).collect();
            let codes = config.codes();
            let sums = CodeSums::new(&codes, &image, &view);
            for (region, keypoints) in config.region.by_side(&keypoints, n_cells) {
                let mut expected = crate::matrix::Matrix::zeros(places.len(), config.n_dimensions());
                config.describe_each(&codes, &region, (&image, &view), &keypoints, &mut expected);
                let edges = CellEdges::new(region.side, n_cells);
                for (row_idx, keypoint) in keypoints {
                    let mut row = vec![7.0; config.n_dimensions()];
                    sums.describe(keypoint, &edges, 1 << n_pairs, &mut row);
                    prop_assert_eq!(&row[..], expected.row(row_idx));
                }
            }
        }
    }

    #[test]
    fn tables_are_made_where_they_describe_the_same_for_less() {
        let image = noise(100, 100);
        let region = Region { side: 20, ..Region::default() };
        let config = CsLbp { region, ..CsLbp::default() };
        let keypoints = vec![Keypoint::new(50.0, 50.0, 1.0); 80];
        let view = |projection| Camera::new(projection).view(100, 100);
        let perspective = view(Projection::Perspective);
        assert!(config.is_faster_by_tables(&image, &keypoints, &perspective));
        assert!(!config.is_faster_by_tables(&image, &keypoints[..40], &perspective));
        let between = [&keypoints[..], &[Keypoint::new(50.5, 50.0, 1.0)]].concat();
        assert!(!config.is_faster_by_tables(&image, &between, &perspective));
        let more_codes = CsLbp { n_neighbors: 8, ..config.clone() };
        assert!(!more_codes.is_faster_by_tables(&image, &keypoints, &perspective));
        let gaussian = Region { weighting: Weighting::Gaussian, ..region };
        let weighted = CsLbp { region: gaussian, ..config.clone() };
        assert!(!weighted.is_faster_by_tables(&image, &keypoints, &perspective));
        let mirror =
            crate::camera::Mirror { center_x: 0.5, center_y: 0.5, inner_radius: 0.1, outer_radius: 0.5 };
        assert!(!config.is_faster_by_tables(&image, &keypoints, &view(Projection::Omnidirectional(mirror))));
    }
}
