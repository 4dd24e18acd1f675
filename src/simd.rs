//! The inner loops, compiled once for any CPU and once for AVX2.
//!
//! Each kernel is written once, in plain Rust over fixed-width blocks that the compiler turns into vector
//! instructions. There is no fused multiply-add and no sum is reordered, so both versions give the same bits
//! and a model answers the same on every CPU. The only unsafe code of the project is here: calling the AVX2
//! version once the CPU is known to have it.

// Calling a function compiled for more than the baseline instruction set is unsafe; see above.
#![allow(unsafe_code)]

/// Pixels that a FAST test works on at once.
const PIXEL_BLOCK: usize = 32;

/// Columns that [`nearest_columns`] works on at once: [`TransposedMatrix`] is padded to a multiple of it.
const COLUMN_BLOCK: usize = 16;

/// Rows that [`nearest_columns`] works on at once.
const ROW_BLOCK: usize = 4;

/// Defines `$name` as `$kernel`, compiled for AVX2 where the CPU has it.
macro_rules! dispatch {
    ($(#[$doc:meta])* $name:ident, $avx2:ident, $kernel:ident, ($($arg:ident: $type:ty),*)) => {
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2")]
        fn $avx2($($arg: $type),*) {
            $kernel($($arg),*);
        }

        $(#[$doc])*
        pub fn $name($($arg: $type),*) {
            #[cfg(target_arch = "x86_64")]
            if std::arch::is_x86_feature_detected!("avx2") {
                // SAFETY: the CPU has AVX2, all that the function asks for.
                return unsafe { $avx2($($arg),*) };
            }
            $kernel($($arg),*);
        }
    };
}

dispatch! {
    /// Marks the pixels of a row that may be FAST-9 corners: of each of the eight pairs of opposite circle
    /// pixels at least one is brighter than the center by more than `threshold`, or at least one darker.
    ///
    /// `circle[i]` holds, for each pixel of `center`, the circle's pixel `i`. All slices have the length of
    /// `candidates`, which is set to nonzero where the test holds.
    mark_fast_candidates, mark_fast_candidates_avx2, mark_fast_candidates_kernel,
    (center: &[u8], circle: &[&[u8]; 16], threshold: u8, candidates: &mut [u8])
}

#[inline(always)]
fn mark_fast_candidates_kernel(center: &[u8], circle: &[&[u8]; 16], threshold: u8, candidates: &mut [u8]) {
    let n_pixels = candidates.len();
    let center = &center[..n_pixels];
    let circle = circle.map(|pixels| &pixels[..n_pixels]);
    let mut start = 0;
    while start < n_pixels {
        let end = (start + PIXEL_BLOCK).min(n_pixels);
        if end - start == PIXEL_BLOCK {
            mark_block::<PIXEL_BLOCK>(center, &circle, threshold, candidates, start);
        } else {
            for x in start..end {
                mark_block::<1>(center, &circle, threshold, candidates, x);
            }
        }
        start = end;
    }
}

#[inline(always)]
fn mark_block<const N: usize>(
    center: &[u8],
    circle: &[&[u8]; 16],
    threshold: u8,
    candidates: &mut [u8],
    start: usize,
) {
    let block = |pixels: &[u8]| -> [u8; N] { std::array::from_fn(|x| pixels[start..start + N][x]) };
    let center = block(center);
    let high = center.map(|value| value.saturating_add(threshold));
    let low = center.map(|value| value.saturating_sub(threshold));
    let (mut brighter, mut darker) = ([0xFFu8; N], [0xFFu8; N]);
    for pair in 0..8 {
        let (a, b) = (block(circle[pair]), block(circle[pair + 8]));
        for x in 0..N {
            // An unsigned excess is nonzero exactly where the pixel is beyond the threshold.
            let above = a[x].max(b[x]).saturating_sub(high[x]);
            let below = low[x].saturating_sub(a[x].min(b[x]));
            brighter[x] = brighter[x].min(above);
            darker[x] = darker[x].min(below);
        }
    }
    for x in 0..N {
        candidates[start + x] = brighter[x] | darker[x];
    }
}

dispatch! {
    /// `sums[x] = w[0] a[x] + w[1] a[x + 1] + w[2] b[x] + w[3] b[x + 1]`: bilinear interpolation at one
    /// offset between two rows of pixels. The weights sum to 256 at most; `a` and `b` are one longer than
    /// `sums`.
    interpolate_row, interpolate_row_avx2, interpolate_row_kernel,
    (a: &[u8], b: &[u8], weights: [u16; 4], sums: &mut [u16])
}

#[inline(always)]
fn interpolate_row_kernel(a: &[u8], b: &[u8], weights: [u16; 4], sums: &mut [u16]) {
    let n = sums.len();
    let (a0, a1, b0, b1) = (&a[..n], &a[1..=n], &b[..n], &b[1..=n]);
    for x in 0..n {
        let top = weights[0] * u16::from(a0[x]) + weights[1] * u16::from(a1[x]);
        sums[x] = top + weights[2] * u16::from(b0[x]) + weights[3] * u16::from(b1[x]);
    }
}

dispatch! {
    /// Bilinear interpolation along a line: `pixels[i]` is the value at the position `start + i step`, in
    /// 1/65536 of a pixel, between the four bytes of `quads[i]`: from the lowest the pixel to the upper left
    /// of the position, and those to the upper right, lower left and lower right. Shares are 1/256 of a pixel.
    interpolate_quads, interpolate_quads_avx2, interpolate_quads_kernel,
    (quads: &[u32], start: (i32, i32), step: (i32, i32), pixels: &mut [u8])
}

#[inline(always)]
fn interpolate_quads_kernel(quads: &[u32], start: (i32, i32), step: (i32, i32), pixels: &mut [u8]) {
    let n = pixels.len();
    let quads = &quads[..n];
    for i in 0..n {
        let right = ((start.0 + i as i32 * step.0) >> 8) as u32 & 255;
        let bottom = ((start.1 + i as i32 * step.1) >> 8) as u32 & 255;
        // The upper and the lower row are interpolated at once, in the halves of one number.
        let rows = (quads[i] & 0x00FF_00FF) * (256 - right) + ((quads[i] >> 8) & 0x00FF_00FF) * right;
        let value = (rows & 0xFFFF) * (256 - bottom) + (rows >> 16) * bottom;
        pixels[i] = ((value + 32_768) >> 16) as u8;
    }
}

dispatch! {
    /// Sets `bit` in `codes[x]` where `a[x]` exceeds `b[x]` by more than `threshold`.
    mark_greater, mark_greater_avx2, mark_greater_kernel,
    (a: &[u16], b: &[u16], threshold: u16, bit: u8, codes: &mut [u8])
}

#[inline(always)]
fn mark_greater_kernel(a: &[u16], b: &[u16], threshold: u16, bit: u8, codes: &mut [u8]) {
    let n = codes.len();
    let (a, b) = (&a[..n], &b[..n]);
    for x in 0..n {
        codes[x] |= if a[x] > b[x].saturating_add(threshold) { bit } else { 0 };
    }
}

dispatch! {
    /// Adds to `counts[x]` how many of the rows of `codes`, `stride` apart, have `code` in column x. The
    /// last row may end after the last column that is counted.
    count_equal, count_equal_avx2, count_equal_kernel,
    (codes: &[u8], stride: usize, code: u8, counts: &mut [u8])
}

#[inline(always)]
fn count_equal_kernel(codes: &[u8], stride: usize, code: u8, counts: &mut [u8]) {
    let n_columns = counts.len();
    for row in codes.chunks(stride) {
        let row = &row[..n_columns];
        for x in 0..n_columns {
            counts[x] += u8::from(row[x] == code);
        }
    }
}

/// The rows of a matrix laid out as columns, for [`nearest_columns`].
#[derive(Clone, Debug)]
pub struct TransposedMatrix {
    /// Blocks of [`COLUMN_BLOCK`] columns; within a block, row after row.
    blocks: Vec<[f32; COLUMN_BLOCK]>,
    /// Half the squared length of each column; infinite for padding, which is therefore never nearest.
    half_squared_lengths: Vec<[f32; COLUMN_BLOCK]>,
    n_rows: usize,
}

impl TransposedMatrix {
    /// Lays out `rows`, all of the same length, as columns.
    pub fn new<'a>(rows: impl Iterator<Item = &'a [f32]>, row_length: usize) -> Self {
        let mut transposed =
            Self { blocks: Vec::new(), half_squared_lengths: Vec::new(), n_rows: row_length };
        for (column_idx, row) in rows.enumerate() {
            let lane = column_idx % COLUMN_BLOCK;
            if lane == 0 {
                let n_rows_before = transposed.blocks.len();
                transposed.blocks.resize(n_rows_before + row_length, [0.0; COLUMN_BLOCK]);
                transposed.half_squared_lengths.push([f32::INFINITY; COLUMN_BLOCK]);
            }
            let block_start = column_idx / COLUMN_BLOCK * row_length;
            let block = &mut transposed.blocks[block_start..];
            row.iter().zip(block).for_each(|(&value, lanes)| lanes[lane] = value);
            let squared_length: f32 = row.iter().map(|value| value * value).sum();
            transposed.half_squared_lengths[column_idx / COLUMN_BLOCK][lane] = 0.5 * squared_length;
        }
        transposed
    }
}

dispatch! {
    /// The nearest column (squared Euclidean distance, ties to the first) of each of the `rows`, which lie
    /// one after the other, into `nearest`, and into `scores` the product of row and column less half the
    /// column's squared length: the larger, the nearer.
    nearest_columns, nearest_columns_avx2, nearest_columns_kernel,
    (rows: &[f32], columns: &TransposedMatrix, nearest: &mut [u32], scores: &mut [f32])
}

#[inline(always)]
fn nearest_columns_kernel(rows: &[f32], columns: &TransposedMatrix, nearest: &mut [u32], scores: &mut [f32]) {
    let n = columns.n_rows;
    let mut row_idx = 0;
    while row_idx < nearest.len() {
        let n_block = ROW_BLOCK.min(nearest.len() - row_idx);
        let block = &rows[row_idx * n..(row_idx + n_block) * n];
        let (nearest, scores) = (&mut nearest[row_idx..][..n_block], &mut scores[row_idx..][..n_block]);
        if n_block == ROW_BLOCK {
            nearest_block::<ROW_BLOCK>(block, columns, nearest, scores);
        } else {
            for i in 0..n_block {
                nearest_block::<1>(&block[i * n..][..n], columns, &mut nearest[i..=i], &mut scores[i..=i]);
            }
        }
        row_idx += n_block;
    }
}

/// `R` rows against all columns, [`COLUMN_BLOCK`] at a time. Each lane is one column's running product, in
/// the order of the naive sum.
#[inline(always)]
fn nearest_block<const R: usize>(
    rows: &[f32],
    columns: &TransposedMatrix,
    nearest: &mut [u32],
    scores: &mut [f32],
) {
    let n = columns.n_rows;
    let row: [&[f32]; R] = std::array::from_fn(|r| &rows[r * n..][..n]);
    let mut best_score = [[f32::NEG_INFINITY; COLUMN_BLOCK]; R];
    let mut best_block = [[0u32; COLUMN_BLOCK]; R];
    for (block_idx, half) in columns.half_squared_lengths.iter().enumerate() {
        let block = &columns.blocks[block_idx * n..][..n];
        let mut products = [[0f32; COLUMN_BLOCK]; R];
        for (i, lanes) in block.iter().enumerate() {
            for r in 0..R {
                let value = row[r][i];
                for lane in 0..COLUMN_BLOCK {
                    products[r][lane] += value * lanes[lane];
                }
            }
        }
        for r in 0..R {
            for lane in 0..COLUMN_BLOCK {
                let score = products[r][lane] - half[lane];
                let better = score > best_score[r][lane];
                best_score[r][lane] = if better { score } else { best_score[r][lane] };
                best_block[r][lane] = if better { block_idx as u32 } else { best_block[r][lane] };
            }
        }
    }
    for r in 0..R {
        let column = |lane: usize| best_block[r][lane] * COLUMN_BLOCK as u32 + lane as u32;
        let mut best = 0;
        for lane in 1..COLUMN_BLOCK {
            let (score, best_so_far) = (best_score[r][lane], best_score[r][best]);
            if score > best_so_far || (score == best_so_far && column(lane) < column(best)) {
                best = lane;
            }
        }
        nearest[r] = column(best);
        scores[r] = best_score[r][best];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn naive_nearest(row: &[f32], centers: &[Vec<f32>]) -> (u32, f32) {
        let mut best = (0, f32::NEG_INFINITY);
        for (idx, center) in centers.iter().enumerate() {
            let product = row.iter().zip(center).fold(0.0, |sum, (a, b)| sum + a * b);
            let score = product - 0.5 * center.iter().map(|value| value * value).sum::<f32>();
            if score > best.1 {
                best = (idx as u32, score);
            }
        }
        best
    }

    proptest! {
        #[test]
        fn nearest_column_is_the_naive_one_bit_for_bit(
            n_rows in 1usize..10, n_columns in 1usize..50, width in 1usize..20,
            values in prop::collection::vec(-4i8..4, 1400),
        ) {
            // Few distinct values: ties are common.
            let value = |idx: usize| f32::from(values[idx % values.len()]) * 0.37;
            let rows: Vec<f32> = (0..n_rows * width).map(value).collect();
            let centers: Vec<Vec<f32>> =
                (0..n_columns).map(|c| (0..width).map(|i| value(200 + c * width + i)).collect()).collect();
            let columns = TransposedMatrix::new(centers.iter().map(Vec::as_slice), width);
            let (mut nearest, mut scores) = (vec![0; n_rows], vec![0.0; n_rows]);
            let (mut plain_nearest, mut plain_scores) = (nearest.clone(), scores.clone());
            nearest_columns(&rows, &columns, &mut nearest, &mut scores);
            nearest_columns_kernel(&rows, &columns, &mut plain_nearest, &mut plain_scores);
            for (row_idx, row) in rows.chunks(width).enumerate() {
                let (expected, score) = naive_nearest(row, &centers);
                prop_assert_eq!((nearest[row_idx], scores[row_idx].to_bits()), (expected, score.to_bits()));
                prop_assert_eq!(plain_nearest[row_idx], expected);
            }
        }

        #[test]
        fn candidates_are_the_pixels_with_all_pairs_beyond_the_threshold(
            threshold in 0u8..=255, pixels in prop::collection::vec(any::<u8>(), 17 * 70), length in 1usize..70,
        ) {
            let row = |idx: usize| &pixels[idx * 70..][..length];
            let circle = std::array::from_fn(|idx| row(idx + 1));
            let mut candidates = vec![0; length];
            mark_fast_candidates(row(0), &circle, threshold, &mut candidates);
            for x in 0..length {
                let center = i32::from(row(0)[x]);
                let difference = |idx: usize| i32::from(circle[idx][x]) - center;
                let threshold = i32::from(threshold);
                let brighter = (0..8).all(|i| difference(i).max(difference(i + 8)) > threshold);
                let darker = (0..8).all(|i| difference(i).min(difference(i + 8)) < -threshold);
                prop_assert_eq!(candidates[x] != 0, brighter || darker);
            }
        }

        #[test]
        fn interpolating_two_rows_at_once_equals_the_sum_of_four(
            corners in prop::collection::vec(any::<[u8; 4]>(), 1..40),
            start in (0i32..1 << 25, 0i32..1 << 25), step in (-65_536i32..=65_536, -65_536i32..=65_536),
        ) {
            let quads: Vec<u32> = corners.iter().map(|&corners| u32::from_le_bytes(corners)).collect();
            let mut pixels = vec![0; quads.len()];
            interpolate_quads(&quads, start, step, &mut pixels);
            for (i, corners) in corners.iter().enumerate() {
                let share = |start: i32, step: i32| i64::from((start + i as i32 * step) >> 8 & 255);
                let (x, y) = (share(start.0, step.0), share(start.1, step.1));
                let weights = [(256 - x) * (256 - y), x * (256 - y), (256 - x) * y, x * y];
                let sum: i64 = corners.iter().zip(weights).map(|(&corner, weight)| i64::from(corner) * weight).sum();
                prop_assert_eq!(i64::from(pixels[i]), (sum + 32_768) >> 16);
            }
        }

        #[test]
        fn interpolation_and_comparison_equal_their_definitions(
            pixels in prop::collection::vec(any::<u8>(), 2 * 60), length in 1usize..59,
            fraction_x in 0u16..=16, fraction_y in 0u16..=16, threshold in 0u16..2000,
        ) {
            let (a, b) = pixels.split_at(60);
            let weights = [
                (16 - fraction_x) * (16 - fraction_y), fraction_x * (16 - fraction_y),
                (16 - fraction_x) * fraction_y, fraction_x * fraction_y,
            ];
            let (mut sums, mut center) = (vec![0; length], vec![0; length]);
            interpolate_row(a, b, weights, &mut sums);
            interpolate_row(a, b, [256, 0, 0, 0], &mut center);
            let mut codes = vec![1; length];
            mark_greater(&sums, &center, threshold, 4, &mut codes);
            for x in 0..length {
                let pixel = [a[x], a[x + 1], b[x], b[x + 1]].map(u32::from);
                let sum: u32 = pixel.iter().zip(weights).map(|(&p, w)| p * u32::from(w)).sum();
                prop_assert_eq!(u32::from(sums[x]), sum);
                let greater = sum > u32::from(a[x]) * 256 + u32::from(threshold);
                // A comparison value beyond the range of 16 bits saturates and is never exceeded.
                prop_assert_eq!(codes[x], 1 | if greater { 4 } else { 0 });
            }
        }
    }
}
