//! The Harris measure, a row at once: products of derivatives, the measure from their averages, its maxima.

use super::dispatch;

dispatch! {
    /// The products of the derivatives of a row by central differences, `factor` times these: dx^2, dx dy, dy^2.
    ///
    /// `rows` are the row between those above and below it. They begin one column before the first product and are
    /// two longer than each of `products`.
    ///
    /// # Panics
    ///
    /// When the lengths do not fit.
    derivative_products, derivative_products_kernel,
    (rows: [&[f32]; 3], factor: f32, products: [&mut [f32]; 3])
}

#[inline(always)]
fn derivative_products_kernel(rows: [&[f32]; 3], factor: f32, products: [&mut [f32]; 3]) {
    let n = products[0].len();
    let [above, row, below] = rows;
    let (above, row, below) = (&above[..n + 2], &row[..n + 2], &below[..n + 2]);
    let [xx, xy, yy] = products;
    let (xx, xy, yy) = (&mut xx[..n], &mut xy[..n], &mut yy[..n]);
    for x in 0..n {
        let (dx, dy) = (factor * (row[x + 2] - row[x]), factor * (below[x + 1] - above[x + 1]));
        (xx[x], xy[x], yy[x]) = (dx * dx, dx * dy, dy * dy);
    }
}

dispatch! {
    /// det M - alpha trace^2 M of the matrices \[xx, xy; xy, yy\].
    ///
    /// # Panics
    ///
    /// When a row is shorter than `measure`.
    harris_measure, harris_measure_kernel,
    (averages: [&[f32]; 3], alpha: f32, measure: &mut [f32])
}

#[inline(always)]
fn harris_measure_kernel(averages: [&[f32]; 3], alpha: f32, measure: &mut [f32]) {
    let n = measure.len();
    let [xx, xy, yy] = averages;
    let (xx, xy, yy) = (&xx[..n], &xy[..n], &yy[..n]);
    for x in 0..n {
        let trace = xx[x] + yy[x];
        measure[x] = xx[x] * yy[x] - xy[x] * xy[x] - alpha * trace * trace;
    }
}

/// Positions that [`mark_maxima`] looks at at once.
const BLOCK: usize = 32;

dispatch! {
    /// Marks with 1 what exceeds `threshold` and its eight neighbors, with 0 the rest.
    ///
    /// `rows` are the row between those above and below it. They begin one column before the first position and
    /// are two longer than `marks`.
    ///
    /// # Panics
    ///
    /// When the lengths do not fit.
    mark_maxima, mark_maxima_kernel,
    (rows: [&[f32]; 3], threshold: f32, marks: &mut [u8])
}

#[inline(always)]
fn mark_maxima_kernel(rows: [&[f32]; 3], threshold: f32, marks: &mut [u8]) {
    let n = marks.len();
    let (blocks, rest) = marks.as_chunks_mut::<BLOCK>();
    for (start, marks) in (0..).step_by(BLOCK).zip(blocks) {
        *marks = mark_block(rows, start, threshold);
    }
    for (x, mark) in (n - rest.len()..).zip(rest) {
        [*mark] = mark_block(rows, x, threshold);
    }
}

/// Most blocks have nothing above the threshold and are left at once.
#[inline(always)]
fn mark_block<const N: usize>(rows: [&[f32]; 3], start: usize, threshold: f32) -> [u8; N] {
    let own: &[f32; N] = block(rows[1], start + 1);
    let (mut marks, mut any) = ([0; N], false);
    for &value in own {
        any |= value > threshold;
    }
    if !any {
        return marks;
    }
    let mut highest = [threshold; N];
    for neighbor in 0..9 {
        if neighbor == 4 {
            continue;
        }
        let values: &[f32; N] = block(rows[neighbor / 3], start + neighbor % 3);
        for x in 0..N {
            highest[x] = if values[x] > highest[x] { values[x] } else { highest[x] };
        }
    }
    for x in 0..N {
        marks[x] = u8::from(own[x] > highest[x]);
    }
    marks
}

#[inline(always)]
fn block<const N: usize>(row: &[f32], start: usize) -> &[f32; N] {
    row[start..].first_chunk().expect("rows are as long as their blocks")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn measures_are_those_of_each_pixel(
            pixels in prop::collection::vec(-1.0f32..1.0, 3 * 82), n in 0usize..=80, factor in 0.1f32..2.0,
        ) {
            let rows = [0, 1, 2].map(|y| &pixels[y * 82..][..82]);
            let mut products = [(); 3].map(|()| vec![7.0; n]);
            derivative_products(rows, factor, products.each_mut().map(Vec::as_mut_slice));
            let mut measure = vec![7.0; n];
            harris_measure(products.each_ref().map(Vec::as_slice), 0.04, &mut measure);
            for x in 0..n {
                let dx = factor * (rows[1][x + 2] - rows[1][x]);
                let dy = factor * (rows[2][x + 1] - rows[0][x + 1]);
                // The same bits.
                prop_assert_eq!(products.each_ref().map(|row| row[x]), [dx * dx, dx * dy, dy * dy]);
                let [xx, xy, yy] = products.each_ref().map(|row| row[x]);
                prop_assert_eq!(measure[x], xx * yy - xy * xy - 0.04 * (xx + yy) * (xx + yy));
            }
        }

        #[test]
        fn maxima_exceed_all_neighbors(
            levels in prop::collection::vec(0u8..12, 3 * 82), n in 0usize..=80, threshold in 0f32..12.0,
        ) {
            // Few values, so that there are ties.
            let levels: Vec<f32> = levels.into_iter().map(f32::from).collect();
            let rows = [0, 1, 2].map(|y| &levels[y * 82..][..82]);
            let mut marks = vec![7; n];
            mark_maxima(rows, threshold, &mut marks);
            for (x, &mark) in marks.iter().enumerate() {
                let own = rows[1][x + 1];
                let around = rows.iter().flat_map(|row| &row[x..x + 3]);
                let is_peak = own > threshold && around.filter(|&&other| other >= own).count() == 1;
                prop_assert_eq!(mark, u8::from(is_peak));
            }
        }
    }
}
