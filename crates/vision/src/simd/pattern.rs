//! Binary patterns: regions turned upright, neighbors compared, codes counted.

use super::dispatch;

/// Columns that [`count_codes`] works on at once.
pub const COUNT_BLOCK: usize = 32;

/// Codes that [`mark_brighter`] works on at once.
pub const CODE_BLOCK: usize = 64;

/// Positions of a row that [`interpolate_grid`] works on at once.
pub const GRID_BLOCK: usize = 16;

/// Where one neighbor of each pixel of a row lies, between four pixels.
#[derive(Clone, Copy)]
pub struct Taps<'a> {
    /// The row above the neighbors, from the pixel to the left of the first one; one longer than the row.
    pub above: &'a [u8],
    /// The row below.
    pub below: &'a [u8],
    /// Of the pixels to the upper left, upper right, lower left and lower right; they sum to 256.
    pub weights: [u16; 4],
}

/// Where neighbors lie, from what is looked up fastest.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    OnPixels,
    OnColumns,
    BetweenColumns,
}

impl<'a> Taps<'a> {
    #[inline(always)]
    fn place(&self) -> Place {
        match self.weights {
            [_, 0, 0, 0] => Place::OnPixels,
            [_, 0, _, 0] => Place::OnColumns,
            _ => Place::BetweenColumns,
        }
    }

    #[inline(always)]
    fn block(&self, block_idx: usize) -> Option<BlockTaps<'a>> {
        let start = block_idx * CODE_BLOCK;
        let (above, below) =
            (self.above.get(start..)?.first_chunk()?, self.below.get(start..)?.first_chunk()?);
        Some(BlockTaps { above, below, weights: self.weights })
    }
}

/// What [`CODE_BLOCK`] neighbors lie between.
struct BlockTaps<'a> {
    above: &'a [u8; CODE_BLOCK + 1],
    below: &'a [u8; CODE_BLOCK + 1],
    weights: [u16; 4],
}

impl BlockTaps<'_> {
    /// A gray value in 1/256.
    #[inline(always)]
    fn value<const BETWEEN_COLUMNS: bool>(&self, x: usize) -> u16 {
        let value = self.weights[0] * u16::from(self.above[x]) + self.weights[2] * u16::from(self.below[x]);
        if !BETWEEN_COLUMNS {
            return value;
        }
        value
            + self.weights[1] * u16::from(self.above[x + 1])
            + self.weights[3] * u16::from(self.below[x + 1])
    }
}

dispatch! {
    /// Sets `bit` in `codes[x]` where the neighbor at `a` is brighter than that at `b` by more than
    /// `threshold`, in 1/256 of a gray value.
    ///
    /// # Panics
    ///
    /// When there are fewer neighbors than codes.
    mark_brighter, mark_brighter_kernel,
    (a: Taps<'_>, b: Taps<'_>, threshold: u16, bit: u8, codes: &mut [[u8; CODE_BLOCK]])
}

#[inline(always)]
fn mark_brighter_kernel(a: Taps<'_>, b: Taps<'_>, threshold: u16, bit: u8, codes: &mut [[u8; CODE_BLOCK]]) {
    let place = a.place().max(b.place());
    for (block_idx, codes) in codes.iter_mut().enumerate() {
        let (Some(a), Some(b)) = (a.block(block_idx), b.block(block_idx)) else {
            panic!("fewer neighbors than codes");
        };
        // Not 0 where the neighbor is brighter.
        let mut by = [0; CODE_BLOCK];
        match place {
            Place::OnPixels => by_how_much_on_pixels(&a, &b, threshold, &mut by),
            Place::OnColumns => by_how_much::<false>(&a, &b, threshold, &mut by),
            Place::BetweenColumns => by_how_much::<true>(&a, &b, threshold, &mut by),
        }
        for x in 0..CODE_BLOCK {
            codes[x] |= if by[x] != 0 { bit } else { 0 };
        }
    }
}

#[inline(always)]
fn by_how_much_on_pixels(a: &BlockTaps, b: &BlockTaps, threshold: u16, by: &mut [u8; CODE_BLOCK]) {
    // Whole gray values exceed it by a part of one as by none.
    let threshold = (threshold >> 8) as u8;
    for (x, by) in by.iter_mut().enumerate() {
        *by = a.above[x].saturating_sub(b.above[x].saturating_add(threshold));
    }
}

#[inline(always)]
fn by_how_much<const BETWEEN_COLUMNS: bool>(
    a: &BlockTaps,
    b: &BlockTaps,
    threshold: u16,
    by: &mut [u8; CODE_BLOCK],
) {
    for (x, by) in by.iter_mut().enumerate() {
        let least = b.value::<BETWEEN_COLUMNS>(x).saturating_add(threshold);
        *by = a.value::<BETWEEN_COLUMNS>(x).saturating_sub(least).min(u16::from(u8::MAX)) as u8;
    }
}

/// A grid of `side` x `side` positions in an image, (x, y) in 1/65536 of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// The first position.
    pub start: (i32, i32),
    /// From one position of a row to the next.
    pub right: (i32, i32),
    /// From one row to the next.
    pub down: (i32, i32),
    /// Positions a row, and rows.
    pub side: usize,
}

impl Grid {
    /// The memory that [`interpolate_grid`] needs for what lies round the positions, in numbers.
    pub fn n_quads(&self) -> usize {
        self.side * self.stride()
    }

    /// Positions a row, rounded up to whole blocks.
    #[inline(always)]
    fn stride(&self) -> usize {
        self.side.next_multiple_of(GRID_BLOCK)
    }

    /// A position. Those that fill up the last block of a row may wrap round; nothing is read there.
    #[inline(always)]
    fn at(&self, row: usize, column: usize) -> (i32, i32) {
        let (row, column) = (row as i32, column as i32);
        let sum = |start: i32, down: i32, right: i32| {
            start.wrapping_add(row.wrapping_mul(down)).wrapping_add(column.wrapping_mul(right))
        };
        (sum(self.start.0, self.down.0, self.right.0), sum(self.start.1, self.down.1, self.right.1))
    }

    /// Whether all positions lie between four pixels of an image, and none wraps round.
    fn is_inside(&self, width: usize, height: usize) -> bool {
        // Sums of products of 32 bits fit 64, and columns and rows lie between those of the corners.
        let Ok(last) = i32::try_from(self.side.saturating_sub(1)) else { return false };
        let is_inside = |start: i32, steps: [(i32, i32); 2], size: usize| {
            let offset = |(count, step): (i32, i32)| i64::from(count) * i64::from(step);
            let position = i64::from(start) + steps.map(offset).iter().sum::<i64>();
            i32::try_from(position)
                .is_ok_and(|position| position >= 0 && (position as usize >> 16) + 1 < size)
        };
        [(0, 0), (0, last), (last, 0), (last, last)].into_iter().all(|(row, column)| {
            is_inside(self.start.0, [(row, self.down.0), (column, self.right.0)], width)
                && is_inside(self.start.1, [(row, self.down.1), (column, self.right.1)], height)
        })
    }
}

dispatch! {
    /// Bilinear interpolation at the positions of a grid in an image `width` pixels wide; shares are 1/256
    /// of a pixel. `values` gets row after row, and up to [`GRID_BLOCK`] numbers without meaning after the
    /// last one; `quads` is memory for [`Grid::n_quads`] numbers.
    ///
    /// # Panics
    ///
    /// When a position is not between four pixels of the image, the image has 2^31 pixels or more, or
    /// `quads` or `values` is too short.
    interpolate_grid, interpolate_grid_kernel,
    (pixels: &[u8], width: usize, grid: Grid, quads: &mut [u32], values: &mut [u8])
}

#[inline(always)]
fn interpolate_grid_kernel(pixels: &[u8], width: usize, grid: Grid, quads: &mut [u32], values: &mut [u8]) {
    let (side, stride) = (grid.side, grid.stride());
    if side == 0 {
        return;
    }
    let height = pixels.len().checked_div(width).unwrap_or(0);
    // All that is read below rests on this.
    assert!(grid.is_inside(width, height) && i32::try_from(pixels.len()).is_ok(), "{grid:?} is outside");
    // Where the pixels lie and what they amount to is computed for many positions at once; between the two
    // they are read.
    for (row, indices) in quads[..side * stride].chunks_exact_mut(stride).enumerate() {
        for (block_idx, indices) in indices.as_chunks_mut::<GRID_BLOCK>().0.iter_mut().enumerate() {
            for (lane, idx) in indices.iter_mut().enumerate() {
                let (x, y) = grid.at(row, block_idx * GRID_BLOCK + lane);
                *idx = (y >> 16).wrapping_mul(width as i32).wrapping_add(x >> 16) as u32;
            }
        }
    }
    let pair = |idx: usize| {
        // SAFETY: `idx` and `idx + 1` are in `pixels`: they are the left and right pixel that a position of
        // the grid lies between, above or below it, and all positions are inside the image.
        u16::from_le_bytes(unsafe { pixels.as_ptr().add(idx).cast::<[u8; 2]>().read() })
    };
    for quads in quads[..side * stride].chunks_exact_mut(stride) {
        for quad in &mut quads[..side] {
            let top = *quad as usize;
            *quad = u32::from(pair(top)) | u32::from(pair(top + width)) << 16;
        }
    }
    for (row, quads) in quads[..side * stride].chunks_exact(stride).enumerate() {
        for (block_idx, quads) in quads.as_chunks::<GRID_BLOCK>().0.iter().enumerate() {
            // What exceeds the row is overwritten by the next one.
            let values = &mut values[row * side + block_idx * GRID_BLOCK..][..GRID_BLOCK];
            for lane in 0..GRID_BLOCK {
                let (x, y) = grid.at(row, block_idx * GRID_BLOCK + lane);
                let (right, below) = ((x >> 8) as u32 & 255, (y >> 8) as u32 & 255);
                let quad = quads[lane];
                // The upper and the lower row are interpolated at once, in the halves of one number.
                let rows = (quad & 0x00FF_00FF) * (256 - right) + (quad >> 8 & 0x00FF_00FF) * right;
                let sum = (rows & 0xFFFF) * (256 - below) + (rows >> 16) * below;
                values[lane] = ((sum + 32_768) >> 16) as u8;
            }
        }
    }
}

dispatch! {
    /// Adds to `counts[group * n_codes + code]` how many pixels of each group of columns have each code.
    ///
    /// `codes` holds `n_rows` rows, at most 255, `stride` apart. The mask `masks[block * n_groups + group]`
    /// is 255 for the columns, of the 32 from column 32 block on, that are of the group, else 0; `codes` goes
    /// on for as long as the last row's masks. Codes of `n_codes` and more are not counted.
    count_codes, count_codes_kernel,
    (codes: &[u8], stride: usize, n_rows: usize, masks: &[[u8; COUNT_BLOCK]], n_codes: usize, counts: &mut [u32])
}

#[inline(always)]
fn count_codes_kernel(
    codes: &[u8],
    stride: usize,
    n_rows: usize,
    masks: &[[u8; COUNT_BLOCK]],
    n_codes: usize,
    counts: &mut [u32],
) {
    /// Codes that are counted at once.
    const N_AT_ONCE: usize = 8;
    let n_groups = counts.len() / n_codes;
    for (block_idx, masks) in masks.chunks(n_groups).enumerate() {
        for first_code in (0..n_codes).step_by(N_AT_ONCE) {
            let mut column_counts = [[0u8; COUNT_BLOCK]; N_AT_ONCE];
            for row in 0..n_rows {
                let row = &codes[row * stride + block_idx * COUNT_BLOCK..][..COUNT_BLOCK];
                for (offset, counts) in column_counts.iter_mut().enumerate() {
                    for x in 0..COUNT_BLOCK {
                        counts[x] += u8::from(row[x] == (first_code + offset) as u8);
                    }
                }
            }
            for (code, column_counts) in (first_code..n_codes).zip(&column_counts) {
                for (group, mask) in masks.iter().enumerate() {
                    let of_group =
                        column_counts.iter().zip(mask).map(|(&count, &mask)| u32::from(count & mask));
                    counts[group * n_codes + code] += of_group.sum::<u32>();
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn taps(rows: &[u8], right: u16, bottom: u16) -> Taps<'_> {
        let (above, below) = rows.split_at(rows.len() / 2);
        let (left, top) = (16 - right, 16 - bottom);
        Taps { above, below, weights: [left * top, right * top, left * bottom, right * bottom] }
    }

    fn value(taps: &Taps<'_>, x: usize) -> u32 {
        let pixels = [taps.above[x], taps.above[x + 1], taps.below[x], taps.below[x + 1]];
        pixels.iter().zip(taps.weights).map(|(&pixel, weight)| u32::from(pixel) * u32::from(weight)).sum()
    }

    proptest! {
        #[test]
        fn comparing_neighbors_equals_its_definition(
            pixels in prop::collection::vec(any::<u8>(), 4 * 200), n_blocks in 0usize..=3,
            right in prop::array::uniform2(prop::sample::select(vec![0u16, 0, 3, 16])),
            bottom in prop::array::uniform2(prop_oneof![Just(0u16), 0u16..=16]), threshold in 0u16..2000,
        ) {
            let a = taps(&pixels[..400], right[0], bottom[0]);
            let b = taps(&pixels[400..], right[1], bottom[1]);
            let (mut codes, mut plain) = (vec![[1; CODE_BLOCK]; n_blocks], vec![[1; CODE_BLOCK]; n_blocks]);
            mark_brighter(a, b, threshold, 4, &mut codes);
            mark_brighter_kernel(a, b, threshold, 4, &mut plain);
            prop_assert_eq!(&codes, &plain);
            for (x, &code) in codes.as_flattened().iter().enumerate() {
                // What is beyond the range of 16 bits is never exceeded.
                let exceeds = value(&a, x) > value(&b, x) + u32::from(threshold);
                prop_assert_eq!(code, 1 | if exceeds { 4 } else { 0 });
            }
        }

        #[test]
        fn a_grid_is_interpolated_as_in_a_textbook(
            pixels in prop::collection::vec(any::<u8>(), 60 * 60), side in 1usize..20,
            start in (20i32 << 16..22 << 16, 20i32 << 16..22 << 16),
            right in (0i32..=65_536, -65_536i32..=65_536), down in (-65_536i32..=65_536, 0i32..=65_536),
        ) {
            let grid = Grid { start, right, down, side };
            let mut quads = vec![0; grid.n_quads()];
            let (mut values, mut plain) = (vec![0; side * side + GRID_BLOCK], vec![0; side * side + GRID_BLOCK]);
            interpolate_grid(&pixels, 60, grid, &mut quads, &mut values);
            interpolate_grid_kernel(&pixels, 60, grid, &mut quads, &mut plain);
            for (idx, (&value, &plain)) in values.iter().zip(&plain).enumerate().take(side * side) {
                prop_assert_eq!(value, plain);
                let (x, y) = grid.at(idx / side, idx % side);
                let pixel = |dx: i32, dy: i32| {
                    i64::from(pixels[((y >> 16) + dy) as usize * 60 + ((x >> 16) + dx) as usize])
                };
                let (right, below) = (i64::from(x >> 8 & 255), i64::from(y >> 8 & 255));
                let row = |dy: i32| pixel(0, dy) * (256 - right) + pixel(1, dy) * right;
                let sum = row(0) * (256 - below) + row(1) * below;
                prop_assert_eq!(i64::from(value), (sum + 32_768) >> 16);
            }
        }

        #[test]
        fn codes_are_counted_one_by_one(
            random in prop::collection::vec(any::<u8>(), 40 * 64), n_rows in 1usize..40,
            n_codes in 1usize..=16, borders in prop::collection::vec(0usize..=50, 2),
        ) {
            let codes: Vec<u8> = random.iter().map(|code| code % 18).collect();
            let first = *borders.iter().min().unwrap();
            let group_of = |x: usize| usize::from(x >= first) + usize::from(x >= 50);
            let mask = |block: usize, group: usize| {
                std::array::from_fn(|x| if group_of(32 * block + x) == group { 255 } else { 0 })
            };
            let masks = [mask(0, 0), mask(0, 1), mask(1, 0), mask(1, 1)];
            let (mut counts, mut plain) = (vec![0; 2 * n_codes], vec![0; 2 * n_codes]);
            count_codes(&codes, 64, n_rows, &masks, n_codes, &mut counts);
            count_codes_kernel(&codes, 64, n_rows, &masks, n_codes, &mut plain);
            prop_assert_eq!(&counts, &plain);
            let mut expected = vec![0; 2 * n_codes];
            for (idx, &code) in codes[..64 * n_rows].iter().enumerate() {
                if group_of(idx % 64) < 2 && usize::from(code) < n_codes {
                    expected[group_of(idx % 64) * n_codes + usize::from(code)] += 1;
                }
            }
            prop_assert_eq!(counts, expected);
        }
    }

    #[test]
    fn a_grid_whose_positions_fit_no_number_is_refused() {
        let upright = Grid { start: (65_536, 65_536), right: (0, 0), down: (0, 0), side: 3 };
        for grid in [
            // Twice the least number is 0 again: the last position lies inside, those between do not.
            Grid { right: (i32::MIN, 0), ..upright },
            Grid { down: (i32::MIN, 0), ..upright },
            Grid { right: (0, i32::MIN), ..upright },
            Grid { start: (i32::MAX, 0), right: (1, 0), ..upright },
        ] {
            let interpolate = || {
                interpolate_grid(&[7; 100], 10, grid, &mut [0; 48], &mut [0; 9 + GRID_BLOCK]);
            };
            assert!(std::panic::catch_unwind(interpolate).is_err(), "{grid:?}");
        }
    }

    #[test]
    #[should_panic(expected = "is outside")]
    fn a_grid_that_leaves_the_image_is_refused() {
        let grid = Grid { start: (8 << 16, 0), right: (65_536, 0), down: (0, 65_536), side: 2 };
        interpolate_grid(&[0; 100], 10, grid, &mut [0; 32], &mut [0; 20]);
    }
}
