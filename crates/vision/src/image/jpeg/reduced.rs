//! Inverse cosine transforms to fewer samples, for frames that are read smaller.

use crate::simd::Block;

/// Bits of the fixed-point waves.
const WAVE_BITS: u32 = 12;

const ONE: i32 = 1 << WAVE_BITS;
/// sqrt(2) cos(pi / 8).
const LARGE: i32 = 5352;
/// sqrt(2) cos(3 pi / 8).
const SMALL: i32 = 2217;

/// For each sample, what the coefficients count for.
const FOUR: [[i32; 4]; 4] = [
    [ONE, LARGE, ONE, SMALL],
    [ONE, SMALL, -ONE, -LARGE],
    [ONE, -SMALL, -ONE, LARGE],
    [ONE, -LARGE, ONE, -SMALL],
];
const TWO: [[i32; 2]; 2] = [[ONE, ONE], [ONE, -ONE]];
const SINGLE: [[i32; 1]; 1] = [[ONE]];

/// Turns a row of blocks into `side` rows of samples (1, 2 or 4), of the lowest frequencies alone. A row of
/// samples is as long as all blocks are wide.
pub(super) fn inverse_dct(blocks: &[Block], quantization: &[u16; 64], samples: &mut [u8], side: usize) {
    match side {
        1 => inverse_dct_to(blocks, quantization, samples, &SINGLE),
        2 => inverse_dct_to(blocks, quantization, samples, &TWO),
        _ => inverse_dct_to(blocks, quantization, samples, &FOUR),
    }
}

fn inverse_dct_to<const SIDE: usize>(
    blocks: &[Block],
    quantization: &[u16; 64],
    samples: &mut [u8],
    waves: &[[i32; SIDE]; SIDE],
) {
    let stride = blocks.len() * SIDE;
    for (block_idx, block) in blocks.iter().enumerate() {
        // Large coefficients of damaged streams must not leave the range of numbers.
        let coefficient = |idx: usize| {
            i32::from(block[idx]).saturating_mul(quantization[idx].into()).clamp(-32_768, 32_767)
        };
        // Columns first: what is kept are whole numbers times 2^WAVE_BITS.
        let mut columns = [[0i64; SIDE]; SIDE];
        for (y, row) in columns.iter_mut().enumerate() {
            for (u, value) in row.iter_mut().enumerate() {
                *value = (0..SIDE).map(|v| i64::from(waves[y][v] * coefficient(v * 8 + u) / 8)).sum();
            }
        }
        for (y, row) in columns.iter().enumerate() {
            for x in 0..SIDE {
                let sum: i64 = (0..SIDE).map(|u| i64::from(waves[x][u]) * row[u]).sum();
                let value = (sum + (1 << (2 * WAVE_BITS - 1))) >> (2 * WAVE_BITS);
                samples[y * stride + block_idx * SIDE + x] = (value + 128).clamp(0, 255) as u8;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The samples of the second of two blocks.
    fn transformed(coefficients: &[(usize, i16)], quantization: u16, side: usize) -> Vec<u8> {
        let mut blocks = [[0; 64]; 2];
        for &(position, coefficient) in coefficients {
            blocks[1][position] = coefficient;
        }
        let mut samples = vec![0; side * side * 2];
        inverse_dct(&blocks, &[quantization; 64], &mut samples, side);
        samples.chunks(side * 2).flat_map(|row| &row[side..2 * side]).copied().collect()
    }

    #[test]
    fn one_sample_is_the_mean() {
        assert_eq!(transformed(&[(0, 100), (1, 77)], 2, 1), [153]);
    }

    #[test]
    fn waves_rise_and_fall() {
        let samples = transformed(&[(1, 400)], 1, 4);
        assert_eq!(samples[..4], [193, 155, 101, 63]);
        assert_eq!(samples[..4], samples[12..]);
        assert_eq!(transformed(&[(1, 400)], 1, 2), [178, 78, 178, 78]);
    }
}
