//! Planes of `f32`: weighted sums of neighbors, extrema among differences, gradients.

use super::dispatch;

dispatch! {
    /// Blurs down the columns: `blurred[y][x]` is the sum of `rows[y + radius + i][x] * weights[|i|]` over i from
    /// `-radius` to `radius`. Several rows at once read each of `rows` from the nearest cache but once.
    ///
    /// # Panics
    ///
    /// When there are fewer than `2 * radius` rows more than `blurred` has, or one is shorter than these.
    blur_columns, blur_columns_kernel,
    (rows: &[&[f32]], weights: &[f32], blurred: &mut [&mut [f32]])
}

#[inline(always)]
fn blur_columns_kernel(rows: &[&[f32]], weights: &[f32], blurred: &mut [&mut [f32]]) {
    match blurred.first().map_or(0, |row| row.len()) {
        WIDE.. => blur_down_blocks::<WIDE>(rows, weights, blurred),
        NARROW.. => blur_down_blocks::<NARROW>(rows, weights, blurred),
        _ => blur_down_blocks::<1>(rows, weights, blurred),
    }
}

#[inline(always)]
fn blur_down_blocks<const N: usize>(rows: &[&[f32]], weights: &[f32], blurred: &mut [&mut [f32]]) {
    let radius = weights.len() - 1;
    let mut taps = Vec::with_capacity(rows.len());
    for start in block_starts::<N>(blurred.first().map_or(0, |row| row.len())) {
        taps.clear();
        taps.extend(rows.iter().map(|row| block::<N>(row, start)));
        for (y, blurred) in blurred.iter_mut().enumerate() {
            let (above, rest) = taps[y..].split_at(radius);
            let pairs = above.iter().rev().copied().zip(rest[1..].iter().copied());
            blurred[start..start + N].copy_from_slice(&weighted_sums(rest[0], pairs, weights));
        }
    }
}

dispatch! {
    /// Blurs along a row: `blurred[x]` is the sum of `row[x + radius + i] * weights[|i|]` over i from
    /// `-radius` to `radius`.
    ///
    /// # Panics
    ///
    /// When `row` is not `2 * radius` longer than `blurred`.
    blur_row, blur_row_kernel,
    (row: &[f32], weights: &[f32], blurred: &mut [f32])
}

#[inline(always)]
fn blur_row_kernel(row: &[f32], weights: &[f32], blurred: &mut [f32]) {
    match blurred.len() {
        WIDE.. => blur_along_blocks::<WIDE>(row, weights, blurred),
        NARROW.. => blur_along_blocks::<NARROW>(row, weights, blurred),
        _ => blur_along_blocks::<1>(row, weights, blurred),
    }
}

#[inline(always)]
fn blur_along_blocks<const N: usize>(row: &[f32], weights: &[f32], blurred: &mut [f32]) {
    let radius = weights.len() - 1;
    for start in block_starts::<N>(blurred.len()) {
        let taps = &row[start..start + N + 2 * radius];
        let [before, after] = [0, radius + 1].map(|first| taps[first..first + radius + N - 1].windows(N));
        let pairs =
            before.rev().zip(after).map(|(before, after)| (block::<N>(before, 0), block::<N>(after, 0)));
        let sums = weighted_sums(block::<N>(taps, radius), pairs, weights);
        blurred[start..start + N].copy_from_slice(&sums);
    }
}

/// Columns that are blurred at once, and where there are fewer.
const WIDE: usize = 80;
const NARROW: usize = 8;

/// The first columns of blocks that cover `n`; the last block begins earlier instead of being shorter.
#[inline(always)]
fn block_starts<const N: usize>(n: usize) -> impl Iterator<Item = usize> {
    (0..n).step_by(N).map(move |start| start.min(n - N))
}

/// Sums begin with the center and go outward.
#[inline(always)]
fn weighted_sums<'a, const N: usize>(
    center: &[f32; N],
    pairs: impl Iterator<Item = (&'a [f32; N], &'a [f32; N])>,
    weights: &[f32],
) -> [f32; N] {
    let mut sums = [0.0; N];
    for x in 0..N {
        sums[x] = center[x] * weights[0];
    }
    for ((a, b), &weight) in pairs.zip(&weights[1..]) {
        for x in 0..N {
            sums[x] += (a[x] + b[x]) * weight;
        }
    }
    sums
}

#[inline(always)]
fn block<const N: usize>(values: &[f32], start: usize) -> &[f32; N] {
    values[start..].first_chunk().expect("rows are as long as their blocks")
}

/// Positions that [`mark_extrema`] looks at at once.
const EXTREMA_BLOCK: usize = 32;

dispatch! {
    /// Marks with 1 where the difference of the two upper layers exceeds `threshold` in magnitude and none
    /// of the 17 differences round it, in place and the layer below, lies further on the same side; with 0 elsewhere.
    ///
    /// `layers` holds, of three layers, the row of the positions between the rows above and below it. They
    /// begin one column before the first position and are two longer than `marks`.
    mark_extrema, mark_extrema_kernel,
    (layers: &[[&[f32]; 3]; 3], threshold: f32, marks: &mut [u8])
}

#[inline(always)]
fn mark_extrema_kernel(layers: &[[&[f32]; 3]; 3], threshold: f32, marks: &mut [u8]) {
    let n = marks.len();
    if n < EXTREMA_BLOCK {
        for (x, mark) in marks.iter_mut().enumerate() {
            [*mark] = mark_block::<1, 3>(layers, x, threshold);
        }
        return;
    }
    for start in block_starts::<EXTREMA_BLOCK>(n) {
        let block = mark_block::<EXTREMA_BLOCK, { EXTREMA_BLOCK + 2 }>(layers, start, threshold);
        marks[start..start + EXTREMA_BLOCK].copy_from_slice(&block);
    }
}

/// Most blocks have no difference that is large enough, or none that stands out in its layer, and are left early.
#[inline(always)]
fn mark_block<const N: usize, const N_COLUMNS: usize>(
    [below, lower, upper]: &[[&[f32]; 3]; 3],
    start: usize,
    threshold: f32,
) -> [u8; N] {
    let mut marks = [0; N];
    let center: [f32; N] = difference(block(lower[1], start + 1), block(upper[1], start + 1));
    let (mut any_above, mut any_below) = (false, false);
    for value in center {
        any_above |= value > threshold;
        any_below |= value < -threshold;
    }
    if any_above {
        mark_largest::<N, N_COLUMNS>([lower, upper], [below, lower], start, threshold, &mut marks);
    }
    if any_below {
        // The smallest are the largest where layers are exchanged, which only changes signs.
        mark_largest::<N, N_COLUMNS>([upper, lower], [lower, below], start, threshold, &mut marks);
    }
    marks
}

/// Marks where the difference of the first two layers exceeds `threshold`, and none round it is larger, nor any of the
/// difference of the other two.
#[inline(always)]
fn mark_largest<const N: usize, const N_COLUMNS: usize>(
    own: [&[&[f32]; 3]; 2],
    beyond: [&[&[f32]; 3]; 2],
    start: usize,
    threshold: f32,
    marks: &mut [u8; N],
) {
    let center: [f32; N] = difference(block(own[0][1], start + 1), block(own[1][1], start + 1));
    let mut largest = largest_around::<N, N_COLUMNS>(own, start);
    let mut any = false;
    for x in 0..N {
        // No difference is as large as infinity.
        largest[x] = if center[x] > threshold { largest[x] } else { f32::INFINITY };
        any |= center[x] >= largest[x];
    }
    if !any {
        return;
    }
    let beyond = largest_around::<N, N_COLUMNS>(beyond, start);
    for x in 0..N {
        marks[x] |= u8::from((center[x] >= largest[x]) & (center[x] >= beyond[x]));
    }
}

/// The largest of the nine differences of two layers round each position.
#[inline(always)]
fn largest_around<const N: usize, const N_COLUMNS: usize>(
    [lower, upper]: [&[&[f32]; 3]; 2],
    start: usize,
) -> [f32; N] {
    let mut columns = [f32::NEG_INFINITY; N_COLUMNS];
    for y in 0..3 {
        let row: [f32; N_COLUMNS] = difference(block(lower[y], start), block(upper[y], start));
        for x in 0..N_COLUMNS {
            columns[x] = if row[x] > columns[x] { row[x] } else { columns[x] };
        }
    }
    let mut largest = [0.0; N];
    for x in 0..N {
        let of_two = if columns[x] > columns[x + 1] { columns[x] } else { columns[x + 1] };
        largest[x] = if of_two > columns[x + 2] { of_two } else { columns[x + 2] };
    }
    largest
}

#[inline(always)]
fn difference<const N: usize>(from: &[f32; N], to: &[f32; N]) -> [f32; N] {
    let mut difference = [0.0; N];
    for x in 0..N {
        difference[x] = to[x] - from[x];
    }
    difference
}

/// Of atan(a) / 2 pi for a from 0 to 1: the factors of a, a^3, a^5, a^7, a^9. The error is below 2e-6.
const TURN: [f32; 5] = [0.159_133_67, -0.052_569_635, 0.028_673_218, -0.013_553_016, 0.003_317_583];

dispatch! {
    /// The gradients of a row by central differences: their lengths in values per two pixels, and their
    /// directions in turns from the x axis toward the y axis, from 0 to 1.
    ///
    /// `rows` are the row between those above and below it. They begin one column before the first gradient
    /// and are two longer than `lengths` and `turns`.
    gradients, gradients_kernel,
    (rows: [&[f32]; 3], lengths: &mut [f32], turns: &mut [f32])
}

#[inline(always)]
fn gradients_kernel([above, middle, below]: [&[f32]; 3], lengths: &mut [f32], turns: &mut [f32]) {
    if lengths.len() < NARROW {
        gradient_blocks::<1>([above, middle, below], lengths, turns);
    } else {
        gradient_blocks::<NARROW>([above, middle, below], lengths, turns);
    }
}

#[inline(always)]
fn gradient_blocks<const N: usize>(
    [above, middle, below]: [&[f32]; 3],
    lengths: &mut [f32],
    turns: &mut [f32],
) {
    for start in block_starts::<N>(lengths.len()) {
        let dx: [f32; N] = difference(block(middle, start), block(middle, start + 2));
        let dy: [f32; N] = difference(block(above, start + 1), block(below, start + 1));
        let lengths = &mut lengths[start..start + N];
        let turns = &mut turns[start..start + N];
        for x in 0..N {
            lengths[x] = (dx[x] * dx[x] + dy[x] * dy[x]).sqrt();
            turns[x] = turn(dx[x], dy[x]);
        }
    }
}

/// Not the function of the C library, whose last bits differ from CPU to CPU.
#[inline(always)]
fn turn(dx: f32, dy: f32) -> f32 {
    let (width, height) = (dx.abs(), dy.abs());
    let is_steep = height > width;
    let (low, high) = if is_steep { (width, height) } else { (height, width) };
    let slope = low / if high > 0.0 { high } else { 1.0 };
    let squared = slope * slope;
    let sum = TURN.iter().rev().fold(0.0, |sum, factor| sum * squared + factor);
    let eighth = sum * slope;
    let quarter = if is_steep { 0.25 - eighth } else { eighth };
    let half = if dx < 0.0 { 0.5 - quarter } else { quarter };
    if dy < 0.0 { 1.0 - half } else { half }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn values(length: usize) -> impl Strategy<Value = Vec<f32>> {
        prop::collection::vec(0.0f32..1.0, length)
    }

    proptest! {
        #[test]
        fn blurring_sums_outward_from_the_center(
            pixels in values(12 * 150), weights in prop::collection::vec(0.0f32..1.0, 1..=5), length in 1usize..140,
            n_rows in 0usize..=4,
        ) {
            let radius = weights.len() - 1;
            let rows: Vec<&[f32]> = pixels.chunks(150).take(2 * radius + n_rows).collect();
            let naive = |at: &dyn Fn(usize) -> f32| {
                (1..=radius).fold(at(radius) * weights[0], |sum, i| {
                    sum + (at(radius - i) + at(radius + i)) * weights[i]
                })
            };
            let (mut down, mut along) = (vec![vec![7.0; length]; n_rows], vec![7.0; length]);
            blur_columns(&rows, &weights, &mut down.iter_mut().map(Vec::as_mut_slice).collect::<Vec<_>>());
            blur_row(&pixels, &weights, &mut along);
            for x in 0..length {
                // The same bits: no version may sum in another order.
                for (y, down) in down.iter().enumerate() {
                    prop_assert_eq!(down[x], naive(&|tap| rows[y + tap][x]));
                }
                prop_assert_eq!(along[x], naive(&|tap| pixels[x + tap]));
            }
        }

        #[test]
        fn extrema_are_the_outermost_of_18_differences(
            pixels in prop::collection::vec(0u8..12, 9 * 72), length in 1usize..70, threshold in 0.0f32..9.0,
        ) {
            // Few values, so that there are ties.
            let pixels: Vec<f32> = pixels.into_iter().map(f32::from).collect();
            let row = |layer: usize, row: usize| &pixels[(layer * 3 + row) * 72..][..length + 2];
            let layers = std::array::from_fn(|layer| std::array::from_fn(|y| row(layer, y)));
            let mut marks = vec![7; length];
            mark_extrema(&layers, threshold, &mut marks);
            let difference = |layer: usize, y: usize, x: usize| row(layer + 1, y)[x] - row(layer, y)[x];
            for (x, &mark) in marks.iter().enumerate() {
                let center = difference(1, 1, x + 1);
                let mut all = (0..18).map(|idx| difference(idx / 9, idx / 3 % 3, x + idx % 3));
                let side = center.signum();
                let expected = center.abs() > threshold && all.all(|other| other * side <= center * side);
                prop_assert_eq!(mark, u8::from(expected));
            }
        }

        #[test]
        fn gradients_have_the_length_and_direction_of_their_differences(
            pixels in values(3 * 50), length in 1usize..=48,
        ) {
            let rows = std::array::from_fn(|y| &pixels[y * 50..][..50]);
            let (mut lengths, mut turns) = (vec![7.0; length], vec![7.0; length]);
            gradients(rows, &mut lengths, &mut turns);
            for x in 0..length {
                let (dx, dy) = (rows[1][x + 2] - rows[1][x], rows[2][x + 1] - rows[0][x + 1]);
                prop_assert!((lengths[x] - dx.hypot(dy)).abs() < 1e-5);
                let expected = (dy.atan2(dx) / std::f32::consts::TAU).rem_euclid(1.0);
                let error = (turns[x] - expected).abs();
                prop_assert!((0.0..=1.0).contains(&turns[x]) && error.min(1.0 - error) < 1e-5);
            }
        }
    }
}
