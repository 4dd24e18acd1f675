//! The inverse cosine transform of JPEG.

use super::dispatch;

/// Side of a block of coefficients.
const SIDE: usize = 8;

/// Bits of the fixed-point cosines.
const COSINE_BITS: u32 = 13;

/// Bits kept beyond whole numbers between the two passes.
const KEPT_BITS: u32 = 2;

dispatch! {
    /// Turns a row of blocks into 8 rows of samples, `stride` apart. Coefficients are in reading order and
    /// multiplied by `quantization`. The numbers are those of libjpeg's accurate whole-number transform.
    /// Panics when `samples` is too short.
    inverse_dct, inverse_dct_of, (
        blocks: &[[i16; 64]], quantization: &[i32; 64], samples: &mut [u8], stride: usize,
    )
}

#[inline(always)]
fn inverse_dct_of(blocks: &[[i16; 64]], quantization: &[i32; 64], samples: &mut [u8], stride: usize) {
    for (block_idx, block) in blocks.iter().enumerate() {
        let samples = &mut samples[block_idx * SIDE..];
        let is_flat = block[1..].iter().fold(0, |any, &coefficient| any | coefficient) == 0;
        let sides = if is_flat {
            let mean = i32::from(block[0]).wrapping_mul(quantization[0]).wrapping_add(4) >> 3;
            [[sample(mean); SIDE]; SIDE]
        } else {
            transformed(block, quantization)
        };
        for (y, row) in sides.iter().enumerate() {
            samples[y * stride..][..SIDE].copy_from_slice(row);
        }
    }
}

#[inline(always)]
fn transformed(block: &[i16; 64], quantization: &[i32; 64]) -> [[u8; SIDE]; SIDE] {
    let mut columns = [[0i32; SIDE]; SIDE];
    for (y, row) in columns.iter_mut().enumerate() {
        for (x, value) in row.iter_mut().enumerate() {
            *value = i32::from(block[y * SIDE + x]).wrapping_mul(quantization[y * SIDE + x]);
        }
    }
    let rows = transposed(&pass(&columns, COSINE_BITS - KEPT_BITS));
    // Columns of the picture, each eight samples.
    let values = transposed(&pass(&rows, COSINE_BITS + KEPT_BITS + 3));
    values.map(|row| row.map(sample))
}

#[inline(always)]
fn transposed(values: &[[i32; SIDE]; SIDE]) -> [[i32; SIDE]; SIDE] {
    let mut turned = [[0; SIDE]; SIDE];
    for y in 0..SIDE {
        for x in 0..SIDE {
            turned[x][y] = values[y][x];
        }
    }
    turned
}

/// From the middle of the range to a sample.
#[inline(always)]
fn sample(value: i32) -> u8 {
    value.saturating_add(128).clamp(0, 255) as u8
}

/// One-dimensional transforms of eight columns at once (Loeffler, Ligtenberg and Moschytz, with 12
/// multiplications), rounded to `shift` bits less.
#[inline(always)]
fn pass(input: &[[i32; SIDE]; SIDE], shift: u32) -> [[i32; SIDE]; SIDE] {
    let mut output = [[0; SIDE]; SIDE];
    for lane in 0..SIDE {
        let at = |row: usize| input[row][lane];
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

        let half = 1 << (shift - 1);
        for row in 0..SIDE / 2 {
            output[row][lane] = even[row].wrapping_add(odd[row]).wrapping_add(half) >> shift;
            output[SIDE - 1 - row][lane] = even[row].wrapping_sub(odd[row]).wrapping_add(half) >> shift;
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
            let mut samples = [0; 64];
            inverse_dct(&[block], &[step; 64], &mut samples, 8);
            for (idx, &sample) in samples.iter().enumerate() {
                let (x, y) = (idx % 8, idx / 8);
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
            let mut samples = [0; 64];
            inverse_dct(&[block.try_into().unwrap()], &steps.try_into().unwrap(), &mut samples, 8);
        }
    }
}
