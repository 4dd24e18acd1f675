//! The same in vectors of AVX2, which hold a row of two blocks.

use super::{Block, COSINE_BITS, SHIFTS, SIDE, plain_inverse_dct};
use crate::simd::cpu::Avx2;
use std::arch::x86_64::{
    __m128i, __m256i, _mm256_add_epi16, _mm256_add_epi32, _mm256_broadcastsi128_si256,
    _mm256_castsi128_si256, _mm256_inserti128_si256, _mm256_madd_epi16, _mm256_mullo_epi16,
    _mm256_packs_epi16, _mm256_packs_epi32, _mm256_permute4x64_epi64, _mm256_set1_epi8, _mm256_set1_epi32,
    _mm256_setzero_si256, _mm256_srai_epi32, _mm256_sub_epi16, _mm256_sub_epi32, _mm256_unpackhi_epi8,
    _mm256_unpackhi_epi16, _mm256_unpackhi_epi32, _mm256_unpackhi_epi64, _mm256_unpacklo_epi8,
    _mm256_unpacklo_epi16, _mm256_unpacklo_epi32, _mm256_unpacklo_epi64, _mm256_xor_si256,
};
use std::mem::transmute;

/// The same row of two blocks, or the same column.
type Rows = [__m256i; SIDE];

/// [`super::inverse_dct`].
pub fn inverse_dct(_: Avx2, blocks: &[Block], quantization: &[u16; 64], samples: &mut [u8]) {
    // SAFETY: there is a value of `Avx2`, so the CPU has it.
    unsafe { with_avx2(blocks, quantization, samples) }
}

#[target_feature(enable = "avx2")]
fn with_avx2(blocks: &[Block], quantization: &[u16; 64], samples: &mut [u8]) {
    let stride = blocks.len() * SIDE;
    let (pairs, last) = blocks.as_chunks::<2>();
    let mut rows = samples[..SIDE * stride].chunks_exact_mut(stride.max(1));
    let rows: [&mut [[u8; 2 * SIDE]]; SIDE] =
        std::array::from_fn(|_| rows.next().map_or(&mut [][..], |row| row.as_chunks_mut().0));
    let steps: [__m256i; SIDE] = std::array::from_fn(|y| twice(&quantization.map(u16::cast_signed), y));
    for (pair_idx, [first, second]) in pairs.iter().enumerate() {
        let mut values: Rows = std::array::from_fn(|y| {
            let row = _mm256_inserti128_si256(_mm256_castsi128_si256(row(first, y)), row(second, y), 1);
            _mm256_mullo_epi16(row, steps[y])
        });
        pass::<{ SHIFTS[0] as i32 }>(&mut values);
        turn(&mut values);
        pass::<{ SHIFTS[1] as i32 }>(&mut values);
        for (y, samples) in sample_rows(&values).into_iter().enumerate() {
            rows[y][pair_idx] = samples;
        }
    }
    if let [block] = last {
        let mut lone = [0; SIDE * SIDE];
        plain_inverse_dct(&[*block], quantization, &mut lone);
        for (row, lone) in samples.chunks_exact_mut(stride).zip(lone.as_chunks::<SIDE>().0) {
            row[stride - SIDE..].copy_from_slice(lone);
        }
    }
}

#[target_feature(enable = "avx2")]
fn row(block: &Block, y: usize) -> __m128i {
    // SAFETY: whole numbers of the same size.
    unsafe { transmute::<[i16; SIDE], __m128i>(block.as_chunks::<SIDE>().0[y]) }
}

#[target_feature(enable = "avx2")]
fn twice(block: &Block, y: usize) -> __m256i {
    _mm256_broadcastsi128_si256(row(block, y))
}

/// Two factors for numbers that lie side by side.
#[target_feature(enable = "avx2")]
fn factors(first: i16, second: i16) -> __m256i {
    _mm256_set1_epi32(i32::from(first) & 0xFFFF | i32::from(second) << 16)
}

/// A one-dimensional transform of every lane: [`super::pass`].
#[target_feature(enable = "avx2")]
fn pass<const SHIFT: i32>(values: &mut Rows) {
    let [v0, v1, v2, v3, v4, v5, v6, v7] = *values;
    let half = _mm256_set1_epi32(1 << (SHIFT - 1));
    // With 16 bits of zeros below, shifted back all but the cosines' bits.
    let zero = _mm256_setzero_si256();
    let wide = |value: __m256i| {
        [_mm256_unpacklo_epi16(zero, value), _mm256_unpackhi_epi16(zero, value)]
            .map(|wide| _mm256_add_epi32(_mm256_srai_epi32(wide, 16 - COSINE_BITS as i32), half))
    };
    let side_by_side = |first: __m256i, second: __m256i| {
        [_mm256_unpacklo_epi16(first, second), _mm256_unpackhi_epi16(first, second)]
    };
    let times = |pairs: [__m256i; 2], first: i16, second: i16| {
        pairs.map(|pairs| _mm256_madd_epi16(pairs, factors(first, second)))
    };
    let plus =
        |a: [__m256i; 2], b: [__m256i; 2]| [_mm256_add_epi32(a[0], b[0]), _mm256_add_epi32(a[1], b[1])];
    let minus =
        |a: [__m256i; 2], b: [__m256i; 2]| [_mm256_sub_epi32(a[0], b[0]), _mm256_sub_epi32(a[1], b[1])];

    let outer = side_by_side(v2, v6);
    let low = times(outer, 4_433, 4_433 - 15_137);
    let high = times(outer, 4_433 + 6_270, 4_433);
    let (sum, difference) = (wide(_mm256_add_epi16(v0, v4)), wide(_mm256_sub_epi16(v0, v4)));
    let even = [plus(sum, high), plus(difference, low), minus(difference, low), minus(sum, high)];

    let both = side_by_side(_mm256_add_epi16(v7, v3), _mm256_add_epi16(v5, v1));
    let (ac, bd) = (times(both, 9_633 - 16_069, 9_633), times(both, 9_633, 9_633 - 3_196));
    let (ad, bc) = (side_by_side(v7, v1), side_by_side(v5, v3));
    let odd = [
        plus(times(ad, -7_373, 12_299 - 7_373), bd),
        plus(times(bc, -20_995, 25_172 - 20_995), ac),
        plus(times(bc, 16_819 - 20_995, -20_995), bd),
        plus(times(ad, 2_446 - 7_373, -7_373), ac),
    ];

    let rounded = |[low, high]: [__m256i; 2]| {
        _mm256_packs_epi32(_mm256_srai_epi32(low, SHIFT), _mm256_srai_epi32(high, SHIFT))
    };
    for idx in 0..SIDE / 2 {
        values[idx] = rounded(plus(even[idx], odd[idx]));
        values[SIDE - 1 - idx] = rounded(minus(even[idx], odd[idx]));
    }
}

/// Columns to rows and back, in both blocks.
#[target_feature(enable = "avx2")]
fn turn(values: &mut Rows) {
    let [v0, v1, v2, v3, v4, v5, v6, v7] = *values;
    let pairs = [(v0, v1), (v2, v3), (v4, v5), (v6, v7)];
    let [a0, a1, a2, a3] = pairs.map(|(a, b)| _mm256_unpacklo_epi16(a, b));
    let [b0, b1, b2, b3] = pairs.map(|(a, b)| _mm256_unpackhi_epi16(a, b));
    let quads = [(a0, a1), (a2, a3), (b0, b1), (b2, b3)];
    let [c0, c1, c2, c3] = quads.map(|(a, b)| _mm256_unpacklo_epi32(a, b));
    let [d0, d1, d2, d3] = quads.map(|(a, b)| _mm256_unpackhi_epi32(a, b));
    let halves = [(c0, c1), (d0, d1), (c2, c3), (d2, d3)];
    for (idx, (a, b)) in halves.into_iter().enumerate() {
        values[2 * idx] = _mm256_unpacklo_epi64(a, b);
        values[2 * idx + 1] = _mm256_unpackhi_epi64(a, b);
    }
}

/// From columns around 0 to rows of samples, those of both blocks side by side.
#[target_feature(enable = "avx2")]
fn sample_rows(columns: &Rows) -> [[u8; 2 * SIDE]; SIDE] {
    let [v0, v1, v2, v3, v4, v5, v6, v7] = *columns;
    let middle = _mm256_set1_epi8(i8::MIN);
    let [a, b, c, d] = [(v0, v2), (v1, v3), (v4, v6), (v5, v7)]
        .map(|(a, b)| _mm256_xor_si256(_mm256_packs_epi16(a, b), middle));
    let pairs = [(a, b), (c, d)];
    let [a, c] = pairs.map(|(a, b)| _mm256_unpacklo_epi8(a, b));
    let [b, d] = pairs.map(|(a, b)| _mm256_unpackhi_epi8(a, b));
    let quads = [(a, b), (c, d)];
    let [a, c] = quads.map(|(a, b)| _mm256_unpacklo_epi16(a, b));
    let [b, d] = quads.map(|(a, b)| _mm256_unpackhi_epi16(a, b));
    let rows = [
        _mm256_unpacklo_epi32(a, c),
        _mm256_unpackhi_epi32(a, c),
        _mm256_unpacklo_epi32(b, d),
        _mm256_unpackhi_epi32(b, d),
    ]
    // Two rows of the first block, then two of the second.
    .map(|rows| _mm256_permute4x64_epi64(rows, 0b11_01_10_00));
    // SAFETY: whole numbers of the same size.
    unsafe { transmute(rows) }
}
