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
    /// darker, where it exceeds `threshold`. Only those are written, and their columns added to `marked`, from left
    /// to right.
    ///
    /// `rows` are those from three above the pixels to three below. They begin three columns before the
    /// first of the pixels and are six longer than `strengths`.
    fast_strengths, fast_strengths_kernel,
    (rows: &[&[u8]; SIDE], threshold: u8, strengths: &mut [u8], marked: &mut Vec<u32>)
}

#[inline(always)]
fn fast_strengths_kernel(rows: &[&[u8]; SIDE], threshold: u8, strengths: &mut [u8], marked: &mut Vec<u32>) {
    let n = strengths.len();
    let mut block = [0; BLOCK];
    if n < BLOCK {
        // Too short for a block: continued with zeros.
        let padded: [[u8; BLOCK_COLUMNS]; SIDE] = std::array::from_fn(|row| {
            std::array::from_fn(|column| rows[row].get(column).copied().unwrap_or(0))
        });
        if strengths_of_block(&padded.each_ref(), threshold, &mut block) {
            mark(&block[..n], 0, strengths, marked);
        }
        return;
    }
    for start in (0..n).step_by(BLOCK) {
        // The last block begins earlier instead of being shorter.
        let first = start.min(n - BLOCK);
        let mut columns = [&[0; BLOCK_COLUMNS]; SIDE];
        for (columns, row) in columns.iter_mut().zip(rows) {
            *columns = row[first..].first_chunk().expect("rows are longer than the strengths");
        }
        if strengths_of_block(&columns, threshold, &mut block) {
            mark(&block[start - first..], start, strengths, marked);
        }
    }
}

/// Writes the strengths of a block, the first of which is that of column `start`.
#[inline(always)]
fn mark(block: &[u8], start: usize, strengths: &mut [u8], marked: &mut Vec<u32>) {
    const WORD: usize = size_of::<u64>();
    for (word_idx, bytes) in block.chunks(WORD).enumerate() {
        let mut padded = [0; WORD];
        padded[..bytes.len()].copy_from_slice(bytes);
        let mut word = u64::from_le_bytes(padded);
        while word != 0 {
            let lane = word.trailing_zeros() as usize / 8;
            let column = start + word_idx * WORD + lane;
            strengths[column] = padded[lane];
            marked.push(column as u32);
            word &= !(0xFF << (8 * lane));
        }
    }
}

/// The pairs of the circle that are tested at once: most blocks do not pass the first two.
const PAIRS: [&[usize]; 3] = [&[0, 4], &[2, 6], &[1, 3, 5, 7]];

/// The strengths of a block, 0 where they do not exceed the threshold. Returns whether any does; where not, as in most
/// blocks, they are left as they are.
///
/// Opposite pairs of the circle's pixels are tested first, as an arc of 9 holds at least one of each.
//
// Loops and no closures: what is not inlined is not compiled for wide vectors.
#[inline(always)]
fn strengths_of_block(
    rows: &[&[u8; BLOCK_COLUMNS]; SIDE],
    threshold: u8,
    strengths: &mut [u8; BLOCK],
) -> bool {
    const N: usize = BLOCK;
    let center = block(rows, (SIDE / 2, SIDE / 2));
    // The brightest and the darkest that arcs of the tested pairs can be.
    let (mut brightest, mut darkest) = ([u8::MAX; N], [0; N]);
    for pairs in PAIRS {
        for &pair in pairs {
            let (a, b) = (block(rows, CIRCLE[pair]), block(rows, CIRCLE[pair + 8]));
            for x in 0..N {
                brightest[x] = brightest[x].min(a[x].max(b[x]));
                darkest[x] = darkest[x].max(a[x].min(b[x]));
            }
        }
        let mut any = 0;
        for x in 0..N {
            let most = brightest[x].saturating_sub(center[x]).max(center[x].saturating_sub(darkest[x]));
            any |= most.saturating_sub(threshold);
        }
        if any == 0 {
            return false;
        }
    }
    let mut circle = [[0; N]; 16];
    for (pixels, &place) in circle.iter_mut().zip(&CIRCLE) {
        *pixels = block(rows, place);
    }
    let brightest = best_arc(&circle);
    // The darkest is the brightest of the negative.
    circle.as_flattened_mut().iter_mut().for_each(|pixel| *pixel = !*pixel);
    let darkest = best_arc(&circle);
    let mut any = 0;
    for x in 0..N {
        let strength = brightest[x].saturating_sub(center[x]).max(darkest[x].saturating_sub(!center[x]));
        strengths[x] = if strength > threshold { strength } else { 0 };
        any |= strengths[x];
    }
    any != 0
}

/// The pixels of a block's circles at one place of the square.
#[inline(always)]
fn block(rows: &[&[u8; BLOCK_COLUMNS]; SIDE], (row, column): (usize, usize)) -> [u8; BLOCK] {
    let mut block = [0; BLOCK];
    block.copy_from_slice(&rows[row][column..column + BLOCK]);
    block
}

/// The largest minimum over all arcs of 9. The arcs from `2 k` and from `2 k + 1` on share eight pixels, to which one of
/// their ends is added.
#[inline(always)]
fn best_arc(circle: &[[u8; BLOCK]; 16]) -> [u8; BLOCK] {
    const N: usize = BLOCK;
    let (mut two, mut four) = ([[0; N]; 8], [[0; N]; 8]);
    for k in 0..8 {
        for x in 0..N {
            two[k][x] = circle[2 * k + 1][x].min(circle[(2 * k + 2) % 16][x]);
        }
    }
    for k in 0..8 {
        for x in 0..N {
            four[k][x] = two[k][x].min(two[(k + 1) % 8][x]);
        }
    }
    let mut best = [0; N];
    for k in 0..8 {
        for x in 0..N {
            let eight = four[k][x].min(four[(k + 2) % 8][x]);
            let end = circle[2 * k][x].max(circle[(2 * k + 9) % 16][x]);
            best[x] = best[x].max(eight.min(end));
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
            let (mut strengths, mut plain) = (vec![0; length], vec![0; length]);
            let (mut marked, mut plain_marked) = (Vec::new(), Vec::new());
            fast_strengths(&rows, threshold, &mut strengths, &mut marked);
            fast_strengths_kernel(&rows, threshold, &mut plain, &mut plain_marked);
            prop_assert_eq!((&strengths, &marked), (&plain, &plain_marked));
            let columns: Vec<u32> = (0..length as u32).filter(|&x| strengths[x as usize] > 0).collect();
            prop_assert_eq!(marked, columns);
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
