//! Determinants of box-filtered Hessians, and which of them are peaks, for a row of pixels at once.

use super::dispatch;

/// Columns that [`mark_peaks`] works on at once.
pub const PEAK_BLOCK: usize = 16;

/// How much smaller the mixed derivative of the box filters counts, squared: what makes up for boxes instead
/// of Gaussians.
const MIXED_WEIGHT: f32 = 0.9 * 0.9;

/// The row of an image that [`hessian_row`] filters, and the filter.
#[derive(Clone, Copy, Debug)]
pub struct FilterRow<'a> {
    /// The summed-area table of the image: row after row, the first row and column zero, wrapping round.
    pub sums: &'a [u32],
    /// Numbers a row of the table: one more than pixels.
    pub stride: usize,
    /// The row of pixels.
    pub y: usize,
    /// An odd number of pixels: a third of the filter's side.
    pub lobe: usize,
}

dispatch! {
    /// The determinant of the Hessian at each pixel of a row whose filter lies in the image, in squared gray
    /// values: the filters' sums are divided by their area. The first of `responses` belongs to the column
    /// half a filter from the edge. `differences` is memory for three rows of the table.
    ///
    /// # Panics
    ///
    /// When a filter reaches beyond the image, or `differences` is too short.
    hessian_row, hessian_row_kernel,
    (row: FilterRow<'_>, differences: &mut [u32], responses: &mut [f32])
}

#[inline(always)]
fn hessian_row_kernel(row: FilterRow<'_>, differences: &mut [u32], responses: &mut [f32]) {
    let FilterRow { sums, stride, y, lobe } = row;
    let (half, half_lobe) = (3 * lobe / 2, lobe / 2);
    let table = |y: usize| &sums[y * stride..][..stride];
    // What each filter sums down the columns, then the difference of these along the row.
    let (across, rest) = differences.split_at_mut(stride);
    let (down, rest) = rest.split_at_mut(stride);
    let mixed = &mut rest[..stride];
    let (top, bottom) = (table(y + 1 - lobe), table(y + lobe));
    for x in 0..stride {
        across[x] = bottom[x].wrapping_sub(top[x]);
    }
    let (top, bottom) = (table(y - half), table(y + half + 1));
    let (upper, lower) = (table(y - half_lobe), table(y + half_lobe + 1));
    for x in 0..stride {
        down[x] = curvature([top[x], upper[x], lower[x], bottom[x]]);
    }
    let (top, bottom) = (table(y - lobe), table(y + lobe + 1));
    let (upper, lower) = (table(y), table(y + 1));
    for x in 0..stride {
        mixed[x] = twist([top[x], upper[x], lower[x], bottom[x]]);
    }

    let n = responses.len();
    // Columns relative to the pixel whose filter begins at column 0.
    let across = [0, half - half_lobe, half + half_lobe + 1, 2 * half + 1].map(|x| &across[x..][..n]);
    let mixed = [half - lobe, half, half + 1, half + lobe + 1].map(|x| &mixed[x..][..n]);
    let down = [half + 1 - lobe, half + lobe].map(|x| &down[x..][..n]);
    let per_area = 1.0 / (9 * lobe * lobe) as f32;
    for (x, response) in responses.iter_mut().enumerate() {
        let scaled = |sum: u32| sum.cast_signed() as f32 * per_area;
        let dxx = scaled(curvature(across.map(|row| row[x])));
        let dyy = scaled(down[1][x].wrapping_sub(down[0][x]));
        let dxy = scaled(twist(mixed.map(|row| row[x])));
        *response = dxx * dyy - MIXED_WEIGHT * (dxy * dxy);
    }
}

/// Of running sums: the whole minus three times what lies in the middle.
#[inline(always)]
fn curvature([first, second, third, last]: [u32; 4]) -> u32 {
    last.wrapping_sub(first).wrapping_sub(third.wrapping_sub(second).wrapping_mul(3))
}

/// Of running sums: the first part minus the last.
#[inline(always)]
fn twist([first, second, third, last]: [u32; 4]) -> u32 {
    second.wrapping_sub(first).wrapping_sub(last.wrapping_sub(third))
}

dispatch! {
    /// Sets `peaks[x]` to 1 where a response exceeds `threshold` and its 26 neighbors in three layers of
    /// three rows, else to 0. Neighboring columns are `step` apart; the peaks begin at column `step`.
    ///
    /// # Panics
    ///
    /// When a row is not longer than the peaks by twice the step.
    mark_peaks, mark_peaks_kernel,
    (layers: &[[&[f32]; 3]; 3], step: usize, threshold: f32, peaks: &mut [[u8; PEAK_BLOCK]])
}

#[inline(always)]
fn mark_peaks_kernel(layers: &[[&[f32]; 3]; 3], step: usize, threshold: f32, peaks: &mut [[u8; PEAK_BLOCK]]) {
    'blocks: for (block_idx, peaks) in peaks.iter_mut().enumerate() {
        let block = |layer: usize, row: usize, column: usize| -> [f32; PEAK_BLOCK] {
            let start = block_idx * PEAK_BLOCK + column * step;
            let mut block = [0.0; PEAK_BLOCK];
            block.copy_from_slice(&layers[layer][row][start..start + PEAK_BLOCK]);
            block
        };
        let own = block(1, 1, 1);
        let mut highest = [threshold; PEAK_BLOCK];
        *peaks = [0; PEAK_BLOCK];
        if !exceeds_any(&own, &highest) {
            continue;
        }
        // Where nothing stands out in its own layer, the others need not be looked at.
        for layer in [1, 0, 2] {
            for neighbor in 0..9 {
                if (layer, neighbor) == (1, 4) {
                    continue;
                }
                let responses = block(layer, neighbor / 3, neighbor % 3);
                for x in 0..PEAK_BLOCK {
                    highest[x] = if responses[x] > highest[x] { responses[x] } else { highest[x] };
                }
            }
            if !exceeds_any(&own, &highest) {
                continue 'blocks;
            }
        }
        for x in 0..PEAK_BLOCK {
            peaks[x] = u8::from(own[x] > highest[x]);
        }
    }
}

#[inline(always)]
fn exceeds_any(own: &[f32; PEAK_BLOCK], highest: &[f32; PEAK_BLOCK]) -> bool {
    let mut any = false;
    for x in 0..PEAK_BLOCK {
        any |= own[x] > highest[x];
    }
    any
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The sum of pixels (x, y) with |x - center x| < half width and so on: (offset, half width) each.
    fn box_sum(pixels: &[u8], width: usize, (x, half_x): (isize, isize), (y, half_y): (isize, isize)) -> i32 {
        let columns = || x - half_x..=x + half_x;
        let rows = y - half_y..=y + half_y;
        rows.flat_map(|row| {
            columns().map(move |column| i32::from(pixels[row as usize * width + column as usize]))
        })
        .sum()
    }

    fn naive_determinant(pixels: &[u8], width: usize, (x, y): (usize, usize), lobe: usize) -> f32 {
        let (x, y, lobe) = (x as isize, y as isize, lobe as isize);
        let (half, wide) = (lobe / 2, lobe - 1);
        let sum = |columns, rows| box_sum(pixels, width, columns, rows);
        let dxx = sum((x, 3 * lobe / 2), (y, wide)) - 3 * sum((x, half), (y, wide));
        let dyy = sum((x, wide), (y, 3 * lobe / 2)) - 3 * sum((x, wide), (y, half));
        let off = half + 1;
        let quarter = |right: isize, down: isize| sum((x + right * off, half), (y + down * off, half));
        let dxy = quarter(-1, -1) + quarter(1, 1) - quarter(1, -1) - quarter(-1, 1);
        let [dxx, dyy, dxy] = [dxx, dyy, dxy].map(|sum| sum as f32 * (1.0 / (9 * lobe * lobe) as f32));
        dxx * dyy - 0.9 * 0.9 * (dxy * dxy)
    }

    proptest! {
        #[test]
        fn determinants_are_those_of_the_boxes(
            lobe in (1usize..4).prop_map(|half| 2 * half + 1), extra in (1usize..40, 1usize..4),
            random in prop::collection::vec(any::<u8>(), 61 * 25), offset in any::<u32>(),
        ) {
            let (width, height) = (3 * lobe + extra.0 - 1, 3 * lobe + extra.1 - 1);
            let pixels = &random[..width * height];
            // Sums may wrap round.
            let mut sums = vec![offset; (width + 1) * (height + 1)];
            for (x, y) in (0..width * height).map(|idx| (idx % width, idx / width)) {
                let at = |x: usize, y: usize| sums[y * (width + 1) + x];
                let sum = at(x + 1, y).wrapping_add(at(x, y + 1)).wrapping_sub(at(x, y));
                sums[(y + 1) * (width + 1) + x + 1] = sum.wrapping_add(u32::from(pixels[y * width + x]));
            }
            let half = 3 * lobe / 2;
            let y = half + extra.1 - 1;
            let row = FilterRow { sums: &sums, stride: width + 1, y, lobe };
            let (mut responses, mut plain) = (vec![0.0; extra.0], vec![0.0; extra.0]);
            hessian_row(row, &mut vec![0; 3 * (width + 1)], &mut responses);
            hessian_row_kernel(row, &mut vec![0; 3 * (width + 1)], &mut plain);
            prop_assert_eq!(&responses, &plain);
            for (idx, &response) in responses.iter().enumerate() {
                prop_assert_eq!(response, naive_determinant(pixels, width, (half + idx, y), lobe));
            }
        }

        #[test]
        fn peaks_exceed_all_neighbors(
            step in 1usize..5, levels in prop::collection::vec(0u8..12, 9 * 42), threshold in 0f32..12.0,
        ) {
            let responses: Vec<f32> = levels.iter().map(|&level| f32::from(level)).collect();
            let row = |layer: usize, row: usize| &responses[(3 * layer + row) * 42..][..32 + 2 * step];
            let layers = [0, 1, 2].map(|layer| [0, 1, 2].map(|y| row(layer, y)));
            let mut peaks = [[7; PEAK_BLOCK]; 2];
            mark_peaks(&layers, step, threshold, &mut peaks);
            for (x, &peak) in peaks.as_flattened().iter().enumerate() {
                let own = layers[1][1][x + step];
                let columns = [x, x + step, x + 2 * step];
                let cube = layers.as_flattened().iter().flat_map(|row| columns.map(|column| row[column]));
                let is_peak = own > threshold && cube.filter(|&response| response >= own).count() == 1;
                prop_assert_eq!(peak, u8::from(is_peak));
            }
        }
    }
}
