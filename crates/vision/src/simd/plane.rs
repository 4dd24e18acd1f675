//! Planes of `f32`: weighted sums of neighbors, extrema among differences, gradients.

use super::dispatch;

/// Values that are worked on at once.
const BLOCK: usize = 64;

dispatch! {
    /// Blurs down the columns: `blurred[x]` is the sum of `rows[radius + i][x] * weights[|i|]` over i from
    /// `-radius` to `radius`.
    ///
    /// # Panics
    ///
    /// When there are fewer than `2 * weights.len() - 1` rows or one is shorter than `blurred`.
    blur_columns, blur_columns_kernel,
    (rows: &[&[f32]], weights: &[f32], blurred: &mut [f32])
}

#[inline(always)]
fn blur_columns_kernel(rows: &[&[f32]], weights: &[f32], blurred: &mut [f32]) {
    blur_kernel(weights, blurred, |tap| rows[tap]);
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
    blur_kernel(weights, blurred, |tap| &row[tap..]);
}

/// `tap(i)` is what `weights[|i - radius|]` belongs to. Sums begin with the center and go outward.
#[inline(always)]
fn blur_kernel<'a>(weights: &[f32], blurred: &mut [f32], tap: impl Fn(usize) -> &'a [f32]) {
    let Some((&center_weight, weights)) = weights.split_first() else { return };
    let radius = weights.len();
    let n = blurred.len();
    if n < BLOCK {
        for (x, blurred) in blurred.iter_mut().enumerate() {
            *blurred = tap(radius)[x] * center_weight;
            for (i, &weight) in (1..).zip(weights) {
                *blurred += (tap(radius - i)[x] + tap(radius + i)[x]) * weight;
            }
        }
        return;
    }
    for start in (0..n).step_by(BLOCK) {
        // The last block begins earlier instead of being shorter.
        let start = start.min(n - BLOCK);
        let mut sums = block::<BLOCK>(tap(radius), start).map(|value| value * center_weight);
        for (i, &weight) in (1..).zip(weights) {
            let (a, b) = (block::<BLOCK>(tap(radius - i), start), block::<BLOCK>(tap(radius + i), start));
            for x in 0..BLOCK {
                sums[x] += (a[x] + b[x]) * weight;
            }
        }
        blurred[start..start + BLOCK].copy_from_slice(&sums);
    }
}

#[inline(always)]
fn block<const N: usize>(values: &[f32], start: usize) -> &[f32; N] {
    values[start..].first_chunk().expect("rows are as long as their blocks")
}

/// Positions that [`mark_extrema`] looks at at once.
const EXTREMA_BLOCK: usize = 32;

dispatch! {
    /// Marks with 1 where the difference of the two middle layers exceeds `threshold` in magnitude and none
    /// of the 26 differences round it, in place and layer, lies further on the same side; with 0 elsewhere.
    ///
    /// `layers` holds, of four layers, the row of the positions between the rows above and below it. They
    /// begin one column before the first position and are two longer than `marks`.
    mark_extrema, mark_extrema_kernel,
    (layers: &[[&[f32]; 3]; 4], threshold: f32, marks: &mut [u8])
}

#[inline(always)]
fn mark_extrema_kernel(layers: &[[&[f32]; 3]; 4], threshold: f32, marks: &mut [u8]) {
    let n = marks.len();
    if n < EXTREMA_BLOCK {
        for (x, mark) in marks.iter_mut().enumerate() {
            let mut single = [0];
            mark_block::<1, 3>(layers, x, threshold, &mut single);
            *mark = single[0];
        }
        return;
    }
    for start in (0..n).step_by(EXTREMA_BLOCK) {
        let start = start.min(n - EXTREMA_BLOCK);
        let mut block = [0; EXTREMA_BLOCK];
        mark_block::<EXTREMA_BLOCK, { EXTREMA_BLOCK + 2 }>(layers, start, threshold, &mut block);
        marks[start..start + EXTREMA_BLOCK].copy_from_slice(&block);
    }
}

/// Most blocks have no difference that is large enough, and are left at once.
#[inline(always)]
fn mark_block<const N: usize, const N_COLUMNS: usize>(
    layers: &[[&[f32]; 3]; 4],
    start: usize,
    threshold: f32,
    marks: &mut [u8; N],
) {
    let (lower, upper) = (block::<N>(layers[1][1], start + 1), block::<N>(layers[2][1], start + 1));
    let mut center = [0.0; N];
    let mut any = false;
    for x in 0..N {
        center[x] = upper[x] - lower[x];
        any |= center[x].abs() > threshold;
    }
    if !any {
        return;
    }
    let (mut smallest, mut largest) = ([f32::INFINITY; N_COLUMNS], [f32::NEG_INFINITY; N_COLUMNS]);
    for pair in layers.windows(2) {
        for (lower, upper) in pair[0].iter().zip(&pair[1]) {
            let (lower, upper) = (block::<N_COLUMNS>(lower, start), block::<N_COLUMNS>(upper, start));
            for x in 0..N_COLUMNS {
                let difference = upper[x] - lower[x];
                smallest[x] = if difference < smallest[x] { difference } else { smallest[x] };
                largest[x] = if difference > largest[x] { difference } else { largest[x] };
            }
        }
    }
    for x in 0..N {
        let is_largest = (center[x] > threshold)
            & (center[x] >= largest[x])
            & (center[x] >= largest[x + 1])
            & (center[x] >= largest[x + 2]);
        let is_smallest = (center[x] < -threshold)
            & (center[x] <= smallest[x])
            & (center[x] <= smallest[x + 1])
            & (center[x] <= smallest[x + 2]);
        marks[x] = u8::from(is_largest | is_smallest);
    }
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
    let n = lengths.len();
    let (above, middle, below) = (&above[..n + 2], &middle[..n + 2], &below[..n + 2]);
    let turns = &mut turns[..n];
    for x in 0..n {
        let (dx, dy) = (middle[x + 2] - middle[x], below[x + 1] - above[x + 1]);
        lengths[x] = (dx * dx + dy * dy).sqrt();
        turns[x] = turn(dx, dy);
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
            pixels in values(9 * 150), weights in prop::collection::vec(0.0f32..1.0, 1..=5), length in 1usize..140,
        ) {
            let radius = weights.len() - 1;
            let rows: Vec<&[f32]> = pixels.chunks(150).take(2 * radius + 1).collect();
            let naive = |at: &dyn Fn(usize) -> f32| {
                (1..=radius).fold(at(radius) * weights[0], |sum, i| {
                    sum + (at(radius - i) + at(radius + i)) * weights[i]
                })
            };
            let (mut down, mut along) = (vec![7.0; length], vec![7.0; length]);
            blur_columns(&rows, &weights, &mut down);
            blur_row(&pixels, &weights, &mut along);
            for x in 0..length {
                // The same bits: no version may sum in another order.
                prop_assert_eq!(down[x], naive(&|tap| rows[tap][x]));
                prop_assert_eq!(along[x], naive(&|tap| pixels[x + tap]));
            }
        }

        #[test]
        fn extrema_are_the_outermost_of_27_differences(
            pixels in prop::collection::vec(0u8..12, 12 * 72), length in 1usize..70, threshold in 0.0f32..9.0,
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
                let mut all = (0..27).map(|idx| difference(idx / 9, idx / 3 % 3, x + idx % 3));
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
