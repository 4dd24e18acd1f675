//! Wider vectors, for CPUs that are known to have their instructions.

use super::{COLUMN_BLOCK, Instructions, N_PAIRS, Pairs, Scores, SketchRow};
use crate::simd::cpu::{Avx2, Avx512};
use std::arch::x86_64::{
    __m256i, __m512i, _mm256_add_epi16, _mm256_cmpgt_epi16, _mm256_maddubs_epi16, _mm256_max_epi16,
    _mm256_movemask_epi8, _mm256_packs_epi16, _mm256_permute4x64_epi64, _mm256_set1_epi16, _mm512_add_epi16,
    _mm512_cmpge_epi16_mask, _mm512_maddubs_epi16, _mm512_max_epi16, _mm512_set1_epi16,
};
use std::mem::transmute;

/// The pair of bytes as a number, as its register has it.
fn as_number(row: &SketchRow, pair_idx: usize) -> i16 {
    i16::from_le_bytes([row.0[2 * pair_idx], row.0[2 * pair_idx + 1]])
}

impl Instructions for Avx2 {
    type Row = [__m256i; N_PAIRS];
    type Lanes = [__m256i; 2];

    #[inline(always)]
    fn row(self, row: &SketchRow) -> Self::Row {
        // SAFETY: `self` was made where the CPU has AVX2.
        std::array::from_fn(|pair_idx| unsafe { _mm256_set1_epi16(as_number(row, pair_idx)) })
    }

    #[inline(always)]
    fn scores(self, row: &Self::Row, block: &[Pairs; N_PAIRS], starts: &Scores) -> Self::Lanes {
        // SAFETY: whole numbers of the same size; `self` was made where the CPU has AVX2.
        unsafe {
            let mut scores = transmute::<Scores, [__m256i; 2]>(*starts);
            for (&pair, lanes) in row.iter().zip(block) {
                let lanes = transmute::<Pairs, [__m256i; 2]>(*lanes);
                // Two products are at most 2 * 255 * 64, which fits 16 bits.
                scores = [
                    _mm256_add_epi16(scores[0], _mm256_maddubs_epi16(pair, lanes[0])),
                    _mm256_add_epi16(scores[1], _mm256_maddubs_epi16(pair, lanes[1])),
                ];
            }
            scores
        }
    }

    #[inline(always)]
    fn larger(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
        // SAFETY: as above.
        unsafe { [_mm256_max_epi16(a[0], b[0]), _mm256_max_epi16(a[1], b[1])] }
    }

    #[inline(always)]
    fn at_least(self, scores: &Scores, least: i16) -> u32 {
        // SAFETY: as above.
        unsafe {
            let scores = transmute::<Scores, [__m256i; 2]>(*scores);
            let least = _mm256_set1_epi16(least);
            let below = scores.map(|scores| _mm256_cmpgt_epi16(least, scores));
            // Two by two, each half of a register beside that of the other.
            let below = _mm256_packs_epi16(below[0], below[1]);
            !(_mm256_movemask_epi8(_mm256_permute4x64_epi64::<0b11_01_10_00>(below)) as u32)
        }
    }

    #[inline(always)]
    fn of(scores: Scores) -> Self::Lanes {
        // SAFETY: whole numbers of the same size.
        unsafe { transmute(scores) }
    }

    #[inline(always)]
    fn into_scores(lanes: Self::Lanes) -> Scores {
        // SAFETY: whole numbers of the same size.
        unsafe { transmute(lanes) }
    }
}

impl Instructions for Avx512 {
    type Row = [__m512i; N_PAIRS];
    type Lanes = __m512i;

    #[inline(always)]
    fn row(self, row: &SketchRow) -> Self::Row {
        // SAFETY: `self` was made where the CPU has AVX-512.
        std::array::from_fn(|pair_idx| unsafe { _mm512_set1_epi16(as_number(row, pair_idx)) })
    }

    #[inline(always)]
    fn scores(self, row: &Self::Row, block: &[Pairs; N_PAIRS], starts: &Scores) -> Self::Lanes {
        // SAFETY: whole numbers of the same size; `self` was made where the CPU has AVX-512.
        unsafe {
            let mut scores = transmute::<Scores, __m512i>(*starts);
            for (&pair, lanes) in row.iter().zip(block) {
                let lanes = transmute::<Pairs, __m512i>(*lanes);
                // As above.
                scores = _mm512_add_epi16(scores, _mm512_maddubs_epi16(pair, lanes));
            }
            scores
        }
    }

    #[inline(always)]
    fn larger(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
        // SAFETY: as above.
        unsafe { _mm512_max_epi16(a, b) }
    }

    #[inline(always)]
    fn at_least(self, scores: &Scores, least: i16) -> u32 {
        // SAFETY: as above.
        unsafe { _mm512_cmpge_epi16_mask(transmute::<Scores, __m512i>(*scores), _mm512_set1_epi16(least)) }
    }

    #[inline(always)]
    fn of(scores: Scores) -> Self::Lanes {
        // SAFETY: whole numbers of the same size.
        unsafe { transmute::<[i16; COLUMN_BLOCK], __m512i>(scores) }
    }

    #[inline(always)]
    fn into_scores(lanes: Self::Lanes) -> Scores {
        // SAFETY: whole numbers of the same size.
        unsafe { transmute(lanes) }
    }
}
