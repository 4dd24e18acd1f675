//! Wider vectors. They are fast in functions compiled for them, into which they are inlined.

use super::{COLUMN_BLOCK, Instructions};
use crate::simd::cpu::{Avx2, Avx512Vnni};
use std::arch::x86_64::{
    __m256i, __m512i, _mm256_abs_epi8, _mm256_add_epi32, _mm256_castsi256_ps, _mm256_cmpgt_epi32,
    _mm256_madd_epi16, _mm256_maddubs_epi16, _mm256_min_epi32, _mm256_movemask_ps, _mm256_set1_epi16,
    _mm256_set1_epi32, _mm256_setzero_si256, _mm256_sign_epi8, _mm256_slli_epi32, _mm256_sub_epi32,
    _mm512_cmple_epi32_mask, _mm512_dpbusd_epi32, _mm512_min_epi32, _mm512_set1_epi8, _mm512_set1_epi32,
    _mm512_slli_epi32, _mm512_sub_epi32, _mm512_xor_si512,
};
use std::mem::transmute;

type Quads = [[i8; 4]; COLUMN_BLOCK];
type Numbers = [i32; COLUMN_BLOCK];

impl Instructions for Avx2 {
    type Lanes = [__m256i; 2];

    #[inline(always)]
    fn start(self, _row_sum: i32) -> Self::Lanes {
        // SAFETY: `self` was made where the CPU has AVX2.
        unsafe { [_mm256_setzero_si256(); 2] }
    }

    #[inline(always)]
    fn add(self, products: Self::Lanes, quad: [i8; 4], columns: &Quads) -> Self::Lanes {
        // SAFETY: whole numbers of the same size; `self` was made where the CPU has AVX2.
        unsafe {
            let quads = _mm256_set1_epi32(transmute::<[i8; 4], i32>(quad));
            let columns = transmute::<Quads, [__m256i; 2]>(*columns);
            let ones = _mm256_set1_epi16(1);
            let add = |products: __m256i, columns: __m256i| {
                // One factor must be positive. Two products are at most 2 * 127 * 127, which fits 16 bits.
                let pairs = _mm256_maddubs_epi16(_mm256_abs_epi8(columns), _mm256_sign_epi8(quads, columns));
                _mm256_add_epi32(products, _mm256_madd_epi16(pairs, ones))
            };
            [add(products[0], columns[0]), add(products[1], columns[1])]
        }
    }

    #[inline(always)]
    fn values(self, products: Self::Lanes, squared_lengths: &Numbers) -> Self::Lanes {
        // SAFETY: as above.
        unsafe {
            let lengths = transmute::<Numbers, [__m256i; 2]>(*squared_lengths);
            [
                _mm256_sub_epi32(lengths[0], _mm256_slli_epi32::<1>(products[0])),
                _mm256_sub_epi32(lengths[1], _mm256_slli_epi32::<1>(products[1])),
            ]
        }
    }

    #[inline(always)]
    fn smaller(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
        // SAFETY: as above.
        unsafe { [_mm256_min_epi32(a[0], b[0]), _mm256_min_epi32(a[1], b[1])] }
    }

    #[inline(always)]
    fn at_most(self, values: Self::Lanes, limit: i32) -> u16 {
        // SAFETY: as above.
        unsafe {
            let limit = _mm256_set1_epi32(limit);
            let above = values.map(|values| {
                _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(values, limit))) as u16
            });
            !(above[0] | above[1] << 8)
        }
    }

    #[inline(always)]
    fn into_array(lanes: Self::Lanes) -> Numbers {
        // SAFETY: whole numbers of the same size.
        unsafe { transmute(lanes) }
    }
}

impl Instructions for Avx512Vnni {
    type Lanes = __m512i;

    #[inline(always)]
    fn start(self, row_sum: i32) -> Self::Lanes {
        // SAFETY: `self` was made where the CPU has AVX-512.
        // One factor must be positive: 128 is added to the numbers of columns, hence taken away here.
        unsafe { _mm512_set1_epi32(-128 * row_sum) }
    }

    #[inline(always)]
    fn add(self, products: Self::Lanes, quad: [i8; 4], columns: &Quads) -> Self::Lanes {
        // SAFETY: whole numbers of the same size; `self` was made where the CPU has AVX-512 VNNI.
        unsafe {
            let quads = _mm512_set1_epi32(transmute::<[i8; 4], i32>(quad));
            let columns = transmute::<Quads, __m512i>(*columns);
            let raised = _mm512_xor_si512(columns, _mm512_set1_epi8(-128));
            _mm512_dpbusd_epi32(products, raised, quads)
        }
    }

    #[inline(always)]
    fn values(self, products: Self::Lanes, squared_lengths: &Numbers) -> Self::Lanes {
        // SAFETY: as above.
        unsafe {
            let lengths = transmute::<Numbers, __m512i>(*squared_lengths);
            _mm512_sub_epi32(lengths, _mm512_slli_epi32::<1>(products))
        }
    }

    #[inline(always)]
    fn smaller(self, a: Self::Lanes, b: Self::Lanes) -> Self::Lanes {
        // SAFETY: as above.
        unsafe { _mm512_min_epi32(a, b) }
    }

    #[inline(always)]
    fn at_most(self, values: Self::Lanes, limit: i32) -> u16 {
        // SAFETY: as above.
        unsafe { _mm512_cmple_epi32_mask(values, _mm512_set1_epi32(limit)) }
    }

    #[inline(always)]
    fn into_array(lanes: Self::Lanes) -> Numbers {
        // SAFETY: whole numbers of the same size.
        unsafe { transmute(lanes) }
    }
}
