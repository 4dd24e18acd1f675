//! The inverse cosine transform of JPEG.

#[cfg(target_arch = "x86_64")]
mod x86;

/// Side of a block of coefficients.
const SIDE: usize = 8;

/// The coefficients of a block, in reading order.
pub type Block = [i16; SIDE * SIDE];

/// Bits of the fixed-point cosines.
const COSINE_BITS: u32 = 13;

/// Bits kept beyond whole numbers between the two passes.
const KEPT_BITS: u32 = 2;

/// Bits that a pass rounds away: down the columns, and along the rows.
const SHIFTS: [u32; 2] = [COSINE_BITS - KEPT_BITS, COSINE_BITS + KEPT_BITS + 3];

/// The same number of each column or row.
type Lanes = [i16; SIDE];

/// Turns a row of blocks into 8 rows of samples, each 8 for every block. Coefficients are multiplied by
/// `quantization`, in reading order. The numbers are those of libjpeg-turbo's accurate whole-number transform: between
/// the steps they have 16 bits, which is enough for what an encoder makes of samples; products and sums that are
/// larger wrap, and what the columns give is kept in range.
///
/// # Panics
///
/// When `samples` is too short.
pub fn inverse_dct(blocks: &[Block], quantization: &[u16; 64], samples: &mut [u8]) {
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = super::cpu::Avx2::detected() {
        return x86::inverse_dct(avx2, blocks, quantization, samples);
    }
    plain_inverse_dct(blocks, quantization, samples);
}

fn plain_inverse_dct(blocks: &[Block], quantization: &[u16; 64], samples: &mut [u8]) {
    let stride = blocks.len() * SIDE;
    for (block_idx, block) in blocks.iter().enumerate() {
        let mut rows = [[0; SIDE]; SIDE];
        for ((value, &coefficient), &step) in rows.as_flattened_mut().iter_mut().zip(block).zip(quantization)
        {
            *value = coefficient.wrapping_mul(step.cast_signed());
        }
        let columns = turned(&pass::<{ SHIFTS[0] }>(&rows));
        let rows = turned(&pass::<{ SHIFTS[1] }>(&columns));
        for (y, row) in rows.iter().enumerate() {
            let samples = &mut samples[y * stride + block_idx * SIDE..][..SIDE];
            for (sample, &value) in samples.iter_mut().zip(row) {
                *sample = (value.clamp(-128, 127) + 128) as u8;
            }
        }
    }
}

/// Columns to rows and back.
#[inline(always)]
fn turned(values: &[Lanes; SIDE]) -> [Lanes; SIDE] {
    std::array::from_fn(|x| values.map(|row| row[x]))
}

/// A one-dimensional transform of every lane (Loeffler, Ligtenberg and Moschytz, with 12 multiplications),
/// rounded to `SHIFT` bits less.
#[inline(always)]
fn pass<const SHIFT: u32>(input: &[Lanes; SIDE]) -> [Lanes; SIDE] {
    let mut output = [[0; SIDE]; SIDE];
    for lane in 0..SIDE {
        let at = |idx: usize| input[idx][lane];
        let times = |value: i16, factor: i32| i32::from(value) * factor;

        let low = times(at(2), 4_433).wrapping_add(times(at(6), 4_433 - 15_137));
        let high = times(at(2), 4_433 + 6_270).wrapping_add(times(at(6), 4_433));
        let sum = i32::from(at(0).wrapping_add(at(4))) << COSINE_BITS;
        let difference = i32::from(at(0).wrapping_sub(at(4))) << COSINE_BITS;
        let even = [
            sum.wrapping_add(high),
            difference.wrapping_add(low),
            difference.wrapping_sub(low),
            sum.wrapping_sub(high),
        ];

        let [a, b, c, d] = [at(7), at(5), at(3), at(1)];
        let (ac, bd) = (a.wrapping_add(c), b.wrapping_add(d));
        let (ad, bc) = (times(a, -7_373) + times(d, -7_373), times(b, -20_995) + times(c, -20_995));
        let (ac, bd) = (
            times(ac, 9_633 - 16_069).wrapping_add(times(bd, 9_633)),
            times(ac, 9_633).wrapping_add(times(bd, 9_633 - 3_196)),
        );
        let odd = [
            times(d, 12_299).wrapping_add(ad).wrapping_add(bd),
            times(c, 25_172).wrapping_add(bc).wrapping_add(ac),
            times(b, 16_819).wrapping_add(bc).wrapping_add(bd),
            times(a, 2_446).wrapping_add(ad).wrapping_add(ac),
        ];

        let half = 1 << (SHIFT - 1);
        let rounded = |sum: i32| {
            (sum.wrapping_add(half) >> SHIFT).clamp(i32::from(i16::MIN), i32::from(i16::MAX)) as i16
        };
        for idx in 0..SIDE / 2 {
            output[idx][lane] = rounded(even[idx].wrapping_add(odd[idx]));
            output[SIDE - 1 - idx][lane] = rounded(even[idx].wrapping_sub(odd[idx]));
        }
    }
    output
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_1_SQRT_2, PI};

    /// Blocks of which some have low frequencies alone, and numbers from small ones to all that there are.
    fn blocks(n_blocks: std::ops::Range<usize>) -> impl Strategy<Value = Vec<Block>> {
        let value = (0..16u32, any::<i16>()).prop_map(|(shift, value)| value >> shift);
        let block = (prop::collection::vec(value, 64), 0..4usize, 0..9usize, 0..9usize).prop_map(
            |(values, kind, width, height)| {
                let mut block: Block = values.try_into().unwrap();
                let [width, height] = if kind == 0 { [width, height] } else { [8 >> kind, 8 >> kind] };
                for (idx, value) in block.iter_mut().enumerate() {
                    *value *= i16::from(idx == 0 || idx % 8 < width && idx / 8 < height);
                }
                block
            },
        );
        prop::collection::vec(block, n_blocks)
    }

    proptest! {
        #[test]
        fn it_is_the_transform_of_the_standard(
            coefficients in prop::collection::vec(-60i16..60, 64), kept in 0usize..64, step in 1u16..8,
        ) {
            let mut block = [0i16; 64];
            block[..=kept].copy_from_slice(&coefficients[..=kept]);
            // The block is one of three that have other means.
            let mut blocks = [block; 3];
            blocks[0][0] += 9;
            blocks[2][0] -= 9;
            let mut samples = [0; 8 * 8 * 3];
            inverse_dct(&blocks, &[step; 64], &mut samples);
            for idx in 0..64 {
                let (x, y) = (idx % 8, idx / 8);
                let sample = samples[y * 24 + 8 + x];
                let wave = |at: usize, k: usize| {
                    let scale = if k == 0 { FRAC_1_SQRT_2 } else { 1.0 };
                    scale * ((2 * at + 1) as f64 * k as f64 * PI / 16.0).cos()
                };
                let sum: f64 = (0..64)
                    .map(|k| f64::from(i32::from(block[k]) * i32::from(step)) * wave(x, k % 8) * wave(y, k / 8))
                    .sum();
                let expected = (sum / 4.0 + 128.0).clamp(0.0, 255.0);
                prop_assert!((expected - f64::from(sample)).abs() <= 1.0, "{expected} {sample}");
            }
        }

        #[test]
        fn it_is_the_same_on_every_cpu(
            blocks in blocks(0..6), steps in prop::collection::vec((0..16u32, any::<u16>()), 64),
        ) {
            let steps: Vec<u16> = steps.into_iter().map(|(shift, step)| step >> shift).collect();
            let steps = steps.try_into().unwrap();
            let (mut samples, mut plain) = (vec![0; 64 * blocks.len()], vec![0; 64 * blocks.len()]);
            inverse_dct(&blocks, &steps, &mut samples);
            plain_inverse_dct(&blocks, &steps, &mut plain);
            prop_assert_eq!(samples, plain);
        }
    }
}
