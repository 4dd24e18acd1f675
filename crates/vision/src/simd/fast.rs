//! The FAST-9 segment test and score of many pixels at once.

use super::dispatch;

/// Pixels that are worked on at once.
const BLOCK: usize = 32;

/// The circle of radius 3, clockwise from the top: rows and columns counted from the upper left of the
/// square round it.
const CIRCLE: [(usize, usize); 16] = [
    (0, 3),
    (0, 4),
    (1, 5),
    (2, 6),
    (3, 6),
    (4, 6),
    (5, 5),
    (6, 4),
    (6, 3),
    (6, 2),
    (5, 1),
    (4, 0),
    (3, 0),
    (2, 0),
    (1, 1),
    (0, 2),
];

/// The side of the square round the circle.
const SIDE: usize = 7;

/// What a block's circles reach.
const BLOCK_COLUMNS: usize = BLOCK + SIDE - 1;

dispatch! {
    /// By how much the best arc of each pixel of a row differs from it: `strengths[x]` is the largest d so
    /// that 9 contiguous pixels of the circle round the pixel are all at least d brighter or all at least d
    /// darker; 0 where it does not exceed `threshold`.
    ///
    /// `rows` are those from three above the pixels to three below. They begin three columns before the
    /// first of the pixels and are six longer than `strengths`.
    fast_strengths, fast_strengths_kernel,
    (rows: &[&[u8]; SIDE], threshold: u8, strengths: &mut [u8])
}

#[inline(always)]
fn fast_strengths_kernel(rows: &[&[u8]; SIDE], threshold: u8, strengths: &mut [u8]) {
    let n = strengths.len();
    let mut start = 0;
    while start < n {
        let mut block = [0; BLOCK];
        if n < BLOCK {
            // Too short for a block: continued with zeros.
            let padded: [[u8; BLOCK_COLUMNS]; SIDE] = std::array::from_fn(|row| {
                std::array::from_fn(|column| rows[row].get(column).copied().unwrap_or(0))
            });
            strengths_of_block(&padded.each_ref(), threshold, &mut block);
            strengths.copy_from_slice(&block[..n]);
            return;
        }
        // The last block begins earlier instead of being shorter.
        let first = start.min(n - BLOCK);
        let mut columns = [&[0; BLOCK_COLUMNS]; SIDE];
        for (columns, row) in columns.iter_mut().zip(rows) {
            *columns = row[first..].first_chunk().expect("rows are longer than the strengths");
        }
        strengths_of_block(&columns, threshold, &mut block);
        strengths[first..first + BLOCK].copy_from_slice(&block);
        start += BLOCK;
    }
}

/// Opposite pairs of the circle's pixels are tested first: an arc of 9 holds at least one of each. Most
/// blocks have no pixel that passes.
#[inline(always)]
fn strengths_of_block(rows: &[&[u8; BLOCK_COLUMNS]; SIDE], threshold: u8, strengths: &mut [u8; BLOCK]) {
    const N: usize = BLOCK;
    let block = |row: usize, column: usize| -> [u8; N] {
        let mut block = [0; N];
        block.copy_from_slice(&rows[row][column..column + N]);
        block
    };
    let center = block(SIDE / 2, SIDE / 2);
    let (mut brighter, mut darker) = ([u8::MAX; N], [u8::MAX; N]);
    for pair in 0..8 {
        let a = block(CIRCLE[pair].0, CIRCLE[pair].1);
        let b = block(CIRCLE[pair + 8].0, CIRCLE[pair + 8].1);
        for x in 0..N {
            brighter[x] = brighter[x].min(a[x].max(b[x]).saturating_sub(center[x]));
            darker[x] = darker[x].min(center[x].saturating_sub(a[x].min(b[x])));
        }
    }
    let mut any = 0;
    for x in 0..N {
        any |= brighter[x].max(darker[x]).saturating_sub(threshold);
    }
    if any == 0 {
        return;
    }
    let (mut above, mut below) = ([[0; N]; 16], [[0; N]; 16]);
    for (idx, &(row, column)) in CIRCLE.iter().enumerate() {
        let pixels = block(row, column);
        for x in 0..N {
            above[idx][x] = pixels[x].saturating_sub(center[x]);
            below[idx][x] = center[x].saturating_sub(pixels[x]);
        }
    }
    let (above, below) = (best_arc(&above), best_arc(&below));
    for x in 0..N {
        let strength = above[x].max(below[x]);
        strengths[x] = if strength > threshold { strength } else { 0 };
    }
}

/// The largest minimum over all arcs of 9, by doubling the arcs' length: 1, 2, 4, 8, 9.
#[inline(always)]
fn best_arc(one: &[[u8; BLOCK]; 16]) -> [u8; BLOCK] {
    const N: usize = BLOCK;
    let (mut two, mut four) = ([[0; N]; 16], [[0; N]; 16]);
    for start in 0..16 {
        for x in 0..N {
            two[start][x] = one[start][x].min(one[(start + 1) % 16][x]);
        }
    }
    for start in 0..16 {
        for x in 0..N {
            four[start][x] = two[start][x].min(two[(start + 2) % 16][x]);
        }
    }
    let mut best = [0; N];
    for start in 0..16 {
        for x in 0..N {
            let eight = four[start][x].min(four[(start + 4) % 16][x]);
            best[x] = best[x].max(eight.min(one[(start + 8) % 16][x]));
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn strengths_are_those_of_the_best_arc(
            threshold in 0u8..=255, length in 1usize..70, contrast in 1u16..=256,
            random in prop::collection::vec(any::<u8>(), 7 * 76),
        ) {
            // With low contrast arcs are common.
            let pixels: Vec<u8> = random.iter().map(|&value| (u16::from(value) * contrast / 256) as u8).collect();
            let rows = std::array::from_fn(|row| &pixels[row * 76..][..length + 6]);
            let (mut strengths, mut plain) = (vec![7; length], vec![7; length]);
            fast_strengths(&rows, threshold, &mut strengths);
            fast_strengths_kernel(&rows, threshold, &mut plain);
            prop_assert_eq!(&strengths, &plain);
            for x in 0..length {
                let difference = |idx: usize| {
                    let (row, column) = CIRCLE[idx % 16];
                    i32::from(rows[row][x + column]) - i32::from(rows[3][x + 3])
                };
                let arcs = (0..16).map(|start| (start..start + 9).map(difference));
                let brightest = arcs.clone().map(|arc| arc.min().unwrap()).max().unwrap();
                let darkest = arcs.map(|arc| -arc.max().unwrap()).max().unwrap();
                let strength = brightest.max(darkest);
                let expected = if strength > i32::from(threshold) { strength } else { 0 };
                prop_assert_eq!(i32::from(strengths[x]), expected);
            }
        }
    }
}
