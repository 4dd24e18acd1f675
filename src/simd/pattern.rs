//! Binary patterns: regions turned upright, neighbors compared, codes counted.

use super::dispatch;

/// Columns that [`count_codes`] works on at once.
pub const COUNT_BLOCK: usize = 32;

/// Positions that [`interpolate_line`] works on at once.
const LINE_BLOCK: usize = 64;

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

impl Taps<'_> {
    /// Those of the first `n` neighbors.
    #[inline(always)]
    fn first(self, n: usize) -> Self {
        Self { above: &self.above[..=n], below: &self.below[..=n], ..self }
    }

    /// The neighbor is neither between two columns nor beside any pixel's own.
    #[inline(always)]
    fn is_on_column(&self) -> bool {
        self.weights[1] == 0 && self.weights[3] == 0
    }

    /// The gray value in 1/256.
    #[inline(always)]
    fn value<const ON_COLUMN: bool>(&self, x: usize) -> u16 {
        let sum = self.weights[0] * u16::from(self.above[x]) + self.weights[2] * u16::from(self.below[x]);
        if ON_COLUMN {
            return sum;
        }
        sum + self.weights[1] * u16::from(self.above[x + 1]) + self.weights[3] * u16::from(self.below[x + 1])
    }
}

dispatch! {
    /// Sets `bit` in `codes[x]` where the neighbor at `a` is brighter than that at `b` by more than
    /// `threshold`, in 1/256 of a gray value.
    mark_brighter, mark_brighter_kernel,
    (a: Taps<'_>, b: Taps<'_>, threshold: u16, bit: u8, codes: &mut [u8])
}

#[inline(always)]
fn mark_brighter_kernel(a: Taps<'_>, b: Taps<'_>, threshold: u16, bit: u8, codes: &mut [u8]) {
    match (a.is_on_column(), b.is_on_column()) {
        (true, true) => mark_brighter_taps::<true, true>(a, b, threshold, bit, codes),
        (true, false) => mark_brighter_taps::<true, false>(a, b, threshold, bit, codes),
        (false, true) => mark_brighter_taps::<false, true>(a, b, threshold, bit, codes),
        (false, false) => mark_brighter_taps::<false, false>(a, b, threshold, bit, codes),
    }
}

#[inline(always)]
fn mark_brighter_taps<const A_ON_COLUMN: bool, const B_ON_COLUMN: bool>(
    a: Taps<'_>,
    b: Taps<'_>,
    threshold: u16,
    bit: u8,
    codes: &mut [u8],
) {
    let n = codes.len();
    let (a, b) = (a.first(n), b.first(n));
    for (x, code) in codes.iter_mut().enumerate() {
        let exceeds = a.value::<A_ON_COLUMN>(x) > b.value::<B_ON_COLUMN>(x).saturating_add(threshold);
        *code |= if exceeds { bit } else { 0 };
    }
}

dispatch! {
    /// Bilinear interpolation along a line of an image `width` pixels wide: `line[i]` is the value at the
    /// position `start + i step`, (x, y) in 1/65536 of a pixel. Shares are 1/256 of a pixel.
    ///
    /// # Panics
    ///
    /// When a position is not between four pixels of the image.
    interpolate_line, interpolate_line_kernel,
    (pixels: &[u8], width: usize, start: (i32, i32), step: (i32, i32), line: &mut [u8])
}

#[inline(always)]
fn interpolate_line_kernel(
    pixels: &[u8],
    width: usize,
    start: (i32, i32),
    step: (i32, i32),
    line: &mut [u8],
) {
    let at = |i: usize| (start.0 + i as i32 * step.0, start.1 + i as i32 * step.1);
    for end in [at(0), at(line.len().max(1) - 1)] {
        let (column, row) = (end.0 >> 16, end.1 >> 16);
        // Between the ends, columns and rows are between theirs.
        assert!(column >= 0 && row >= 0 && (column as usize) + 1 < width);
        assert!((row as usize + 1) * width + column as usize + 1 < pixels.len());
    }
    for (block_idx, line) in line.chunks_mut(LINE_BLOCK).enumerate() {
        interpolate_block(pixels, width, at(block_idx * LINE_BLOCK), step, line);
    }
}

/// [`interpolate_line`] for at most [`LINE_BLOCK`] positions, all known to be between four pixels. Where the
/// pixels lie and what they amount to is computed for many positions at once, between the two they are read.
#[inline(always)]
fn interpolate_block(pixels: &[u8], width: usize, start: (i32, i32), step: (i32, i32), line: &mut [u8]) {
    let n = line.len();
    let at = |i: usize| (start.0 + i as i32 * step.0, start.1 + i as i32 * step.1);
    let mut indices = [0; LINE_BLOCK];
    for (i, idx) in indices.iter_mut().enumerate() {
        let (x, y) = at(i);
        *idx = (y >> 16) * width as i32 + (x >> 16);
    }
    let pair = |idx: usize| {
        // SAFETY: `idx` and `idx + 1` are in `pixels`: the ends of the line are between four pixels, hence
        // all of it.
        unsafe { pixels.as_ptr().add(idx).cast::<[u8; 2]>().read() }
    };
    let (mut tops, mut bottoms) = ([[0; 2]; LINE_BLOCK], [[0; 2]; LINE_BLOCK]);
    for ((&idx, top), bottom) in indices[..n].iter().zip(&mut tops).zip(&mut bottoms) {
        *top = pair(idx as usize);
        *bottom = pair(idx as usize + width);
    }
    for (i, value) in line.iter_mut().enumerate() {
        let (x, y) = at(i);
        let (right, below) = ((x >> 8) as u32 & 255, (y >> 8) as u32 & 255);
        // The left and the right column are interpolated at once, in the halves of one number.
        let columns = |[left, right]: [u8; 2]| u32::from(left) | u32::from(right) << 16;
        let columns = columns(tops[i]) * (256 - below) + columns(bottoms[i]) * below;
        let sum = (columns & 0xFFFF) * (256 - right) + (columns >> 16) * right;
        *value = ((sum + 32_768) >> 16) as u8;
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
            pixels in prop::collection::vec(any::<u8>(), 4 * 60), length in 1usize..59,
            right in prop::array::uniform2(prop::sample::select(vec![0u16, 0, 3, 16])),
            bottom in prop::array::uniform2(0u16..=16), threshold in 0u16..2000,
        ) {
            let a = taps(&pixels[..120], right[0], bottom[0]);
            let b = taps(&pixels[120..], right[1], bottom[1]);
            let (mut codes, mut plain) = (vec![1; length], vec![1; length]);
            mark_brighter(a, b, threshold, 4, &mut codes);
            mark_brighter_kernel(a, b, threshold, 4, &mut plain);
            prop_assert_eq!(&codes, &plain);
            for (x, &code) in codes.iter().enumerate() {
                // What is beyond the range of 16 bits is never exceeded.
                let exceeds = value(&a, x) > value(&b, x) + u32::from(threshold);
                prop_assert_eq!(code, 1 | if exceeds { 4 } else { 0 });
            }
        }

        #[test]
        fn a_line_is_interpolated_as_in_a_textbook(
            pixels in prop::collection::vec(any::<u8>(), 40 * 40), length in 1usize..28,
            start in (0i32..10 << 16, 0i32..10 << 16), step in (0i32..=65_536, 0i32..=65_536),
        ) {
            let (mut line, mut plain) = (vec![0; length], vec![0; length]);
            interpolate_line(&pixels, 40, start, step, &mut line);
            interpolate_line_kernel(&pixels, 40, start, step, &mut plain);
            prop_assert_eq!(&line, &plain);
            for (i, &found) in line.iter().enumerate() {
                let (x, y) = (start.0 + i as i32 * step.0, start.1 + i as i32 * step.1);
                let pixel = |dx: i32, dy: i32| i64::from(pixels[((y >> 16) + dy) as usize * 40 + ((x >> 16) + dx) as usize]);
                let (right, below) = (i64::from(x >> 8 & 255), i64::from(y >> 8 & 255));
                let row = |dy: i32| pixel(0, dy) * (256 - right) + pixel(1, dy) * right;
                let sum = row(0) * (256 - below) + row(1) * below;
                prop_assert_eq!(i64::from(found), (sum + 32_768) >> 16);
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
    #[should_panic(expected = "assertion failed")]
    fn a_line_that_leaves_the_image_is_refused() {
        interpolate_line(&[0; 100], 10, (8 << 16, 0), (65_536, 0), &mut [0; 2]);
    }
}
