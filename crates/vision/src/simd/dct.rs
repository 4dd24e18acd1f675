//! The inverse cosine transform of JPEG.

use super::dispatch;

/// Side of a block of coefficients.
const SIDE: usize = 8;

/// Blocks that are transformed at once.
pub const BLOCKS: usize = 8;

/// Neighboring blocks of coefficients: for each coefficient in reading order, that of every block.
pub type BlockGroup = [[i16; BLOCKS]; SIDE * SIDE];

/// Bits of the fixed-point cosines.
const COSINE_BITS: u32 = 13;

/// Bits kept beyond whole numbers between the two passes.
const KEPT_BITS: u32 = 2;

/// The same number of each block.
type Lanes = [i32; BLOCKS];

dispatch! {
    /// Turns a row of blocks into 8 rows of samples, each 64 for every group of blocks. Coefficients are
    /// multiplied by `quantization`, in reading order. The numbers are those of libjpeg's accurate
    /// whole-number transform. Panics when `samples` is too short.
    inverse_dct, inverse_dct_of, (groups: &[BlockGroup], quantization: &[i32; 64], samples: &mut [u8])
}

#[inline(always)]
fn inverse_dct_of(groups: &[BlockGroup], quantization: &[i32; 64], samples: &mut [u8]) {
    let stride = groups.len() * SIDE * BLOCKS;
    for (group_idx, group) in groups.iter().enumerate() {
        let mut rows = [[[0; BLOCKS]; SIDE]; SIDE];
        for x in 0..SIDE {
            let mut column = [[0; BLOCKS]; SIDE];
            let mut any = [0; BLOCKS];
            for (y, values) in column.iter_mut().enumerate() {
                let step = quantization[y * SIDE + x];
                for lane in 0..BLOCKS {
                    let coefficient = group[y * SIDE + x][lane];
                    values[lane] = i32::from(coefficient).wrapping_mul(step);
                    any[lane] |= if y == 0 { 0 } else { coefficient };
                }
            }
            if any == [0; BLOCKS] {
                // What the transform gives too, only later.
                for row in &mut rows {
                    for (value, &first) in row[x].iter_mut().zip(&column[0]) {
                        *value = first << KEPT_BITS;
                    }
                }
            } else {
                for (row, values) in rows.iter_mut().zip(pass::<{ COSINE_BITS - KEPT_BITS }>(&column)) {
                    row[x] = values;
                }
            }
        }
        for (y, row) in rows.iter().enumerate() {
            let values = pass::<{ COSINE_BITS + KEPT_BITS + 3 }>(row);
            let mut columns = [0; SIDE];
            for (column, values) in columns.iter_mut().zip(&values) {
                *column = samples_of(values);
            }
            let start = y * stride + group_idx * SIDE * BLOCKS;
            let (blocks, _) = samples[start..start + SIDE * BLOCKS].as_chunks_mut::<SIDE>();
            for (block, row) in blocks.iter_mut().zip(turned(columns)) {
                *block = row.to_le_bytes();
            }
        }
    }
}

/// From the middle of the range to a sample of each block, the first block lowest.
#[inline(always)]
fn samples_of(values: &Lanes) -> u64 {
    let mut samples = [0; BLOCKS];
    // No `map`: it is not compiled for the wide instructions.
    for (sample, &value) in samples.iter_mut().zip(values) {
        *sample = (value.clamp(-128, 127) + 128) as u8;
    }
    u64::from_le_bytes(samples)
}

/// Eight columns of eight bytes to eight rows.
#[inline(always)]
fn turned(mut bytes: [u64; SIDE]) -> [u64; SIDE] {
    // Quarters of 4 x 4 bytes change places, then those of each quarter, then single bytes.
    exchange::<4, 0x0000_0000_FFFF_FFFF>(&mut bytes);
    exchange::<2, 0x0000_FFFF_0000_FFFF>(&mut bytes);
    exchange::<1, 0x00FF_00FF_00FF_00FF>(&mut bytes);
    bytes
}

/// Exchanges the upper parts of numbers with the lower parts of those `DISTANCE` later; `LOWER` tells the lower
/// parts, each of `DISTANCE` bytes.
#[inline(always)]
fn exchange<const DISTANCE: usize, const LOWER: u64>(bytes: &mut [u64; SIDE]) {
    for first in 0..SIDE {
        if first & DISTANCE == 0 {
            let difference = (bytes[first] >> (8 * DISTANCE) ^ bytes[first + DISTANCE]) & LOWER;
            bytes[first + DISTANCE] ^= difference;
            bytes[first] ^= difference << (8 * DISTANCE);
        }
    }
}

/// A one-dimensional transform of every block (Loeffler, Ligtenberg and Moschytz, with 12 multiplications),
/// rounded to `SHIFT` bits less.
#[inline(always)]
fn pass<const SHIFT: u32>(input: &[Lanes; SIDE]) -> [Lanes; SIDE] {
    let mut output = [[0; BLOCKS]; SIDE];
    for lane in 0..BLOCKS {
        let at = |idx: usize| input[idx][lane];
        let times = |value: i32, factor: i32| value.wrapping_mul(factor);

        let common = times(at(2).wrapping_add(at(6)), 4_433);
        let low = common.wrapping_sub(times(at(6), 15_137));
        let high = common.wrapping_add(times(at(2), 6_270));
        let sum = at(0).wrapping_add(at(4)) << COSINE_BITS;
        let difference = at(0).wrapping_sub(at(4)) << COSINE_BITS;
        let even = [
            sum.wrapping_add(high),
            difference.wrapping_add(low),
            difference.wrapping_sub(low),
            sum.wrapping_sub(high),
        ];

        let [a, b, c, d] = [at(7), at(5), at(3), at(1)];
        let (ac, bd) = (a.wrapping_add(c), b.wrapping_add(d));
        let all = times(ac.wrapping_add(bd), 9_633);
        let ad = times(a.wrapping_add(d), -7_373);
        let bc = times(b.wrapping_add(c), -20_995);
        let ac = times(ac, -16_069).wrapping_add(all);
        let bd = times(bd, -3_196).wrapping_add(all);
        let odd = [
            times(d, 12_299).wrapping_add(ad).wrapping_add(bd),
            times(c, 25_172).wrapping_add(bc).wrapping_add(ac),
            times(b, 16_819).wrapping_add(bc).wrapping_add(bd),
            times(a, 2_446).wrapping_add(ad).wrapping_add(ac),
        ];

        let half = 1 << (SHIFT - 1);
        for idx in 0..SIDE / 2 {
            output[idx][lane] = even[idx].wrapping_add(odd[idx]).wrapping_add(half) >> SHIFT;
            output[SIDE - 1 - idx][lane] = even[idx].wrapping_sub(odd[idx]).wrapping_add(half) >> SHIFT;
        }
    }
    output
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_1_SQRT_2, PI};

    proptest! {
        #[test]
        fn it_is_the_transform_of_the_standard(
            coefficients in prop::collection::vec(-60i16..60, 64), kept in 0usize..64, step in 1i32..8,
        ) {
            let mut block = [0i16; 64];
            block[..=kept].copy_from_slice(&coefficients[..=kept]);
            // The block is one of eight that have other means.
            let mut group = block.map(|coefficient| [coefficient; BLOCKS]);
            group[0] = std::array::from_fn(|lane| block[0] + if lane == 5 { 0 } else { 9 });
            let mut samples = [0; 8 * 64];
            inverse_dct(&[group], &[step; 64], &mut samples);
            for idx in 0..64 {
                let (x, y) = (idx % 8, idx / 8);
                let sample = samples[y * 64 + 5 * 8 + x];
                let wave = |at: usize, k: usize| {
                    let scale = if k == 0 { FRAC_1_SQRT_2 } else { 1.0 };
                    scale * ((2 * at + 1) as f64 * k as f64 * PI / 16.0).cos()
                };
                let sum: f64 = (0..64)
                    .map(|k| f64::from(i32::from(block[k]) * step) * wave(x, k % 8) * wave(y, k / 8))
                    .sum();
                let expected = (sum / 4.0 + 128.0).clamp(0.0, 255.0);
                prop_assert!((expected - f64::from(sample)).abs() <= 1.0, "{expected} {sample}");
            }
        }

        #[test]
        fn any_numbers_are_taken(
            block in prop::collection::vec(any::<i16>(), 64), steps in prop::collection::vec(0i32..65_536, 64),
        ) {
            let group: Vec<[i16; BLOCKS]> = block.into_iter().map(|coefficient| [coefficient; BLOCKS]).collect();
            let mut samples = [0; 8 * 64];
            inverse_dct(&[group.try_into().unwrap()], &steps.try_into().unwrap(), &mut samples);
        }
    }
}
