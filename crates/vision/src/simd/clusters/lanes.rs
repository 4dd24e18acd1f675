//! What is done with the squared distances of a point to the centers of a group.

use super::GROUP;
use crate::simd::nearest::{Instructions, Plain};

type Numbers = [i32; GROUP];

/// Instructions over a number a center. Who has a value may execute them.
pub(super) trait Distances: Instructions {
    /// Squared distances of a vector of this squared length, from products with columns of these.
    fn distances(self, products: Self::Sums, lengths: &Numbers, of_row: i32) -> Self::Sums;

    /// The smallest number.
    fn smallest(self, numbers: Self::Sums) -> i32;

    /// Where `least` is first, which must be there, and the smallest of the others. No number is negative.
    fn first_and_others(self, numbers: Self::Sums, least: i32) -> (usize, i32);

    /// The smaller number of each lane into `numbers`; whether any is smaller than it was.
    fn lower(self, numbers: &mut Numbers, others: Self::Sums) -> bool;
}

impl Distances for Plain {
    #[inline(always)]
    fn distances(self, products: Self::Sums, lengths: &Numbers, of_row: i32) -> Self::Sums {
        std::array::from_fn(|lane| {
            lengths[lane].wrapping_sub(products[lane].wrapping_mul(2)).wrapping_add(of_row)
        })
    }

    #[inline(always)]
    fn smallest(self, numbers: Self::Sums) -> i32 {
        numbers.into_iter().fold(i32::MAX, i32::min)
    }

    #[inline(always)]
    fn first_and_others(self, numbers: Self::Sums, least: i32) -> (usize, i32) {
        let first = numbers.iter().position(|&number| number == least).unwrap_or(0);
        let others = numbers.iter().enumerate().filter(|&(lane, _)| lane != first);
        (first, others.fold(i32::MAX, |least, (_, &number)| least.min(number)))
    }

    #[inline(always)]
    fn lower(self, numbers: &mut Numbers, others: Self::Sums) -> bool {
        let mut any = false;
        for (number, other) in numbers.iter_mut().zip(others) {
            any |= other < *number;
            *number = other.min(*number);
        }
        any
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Distances, GROUP, Numbers};
    use crate::simd::cpu::{Avx2, Avx512};
    use std::arch::x86_64::{
        __m256i, __m512i, _mm_cvtsi128_si32, _mm_min_epi32, _mm_shuffle_epi32, _mm256_add_epi32,
        _mm256_and_si256, _mm256_castsi256_ps, _mm256_castsi256_si128, _mm256_cmpeq_epi32,
        _mm256_cmpgt_epi32, _mm256_extracti128_si256, _mm256_max_epi32, _mm256_min_epi32, _mm256_movemask_ps,
        _mm256_or_si256, _mm256_set1_epi32, _mm256_slli_epi32, _mm256_sub_epi32, _mm256_testz_si256,
        _mm512_add_epi32, _mm512_cmpeq_epi32_mask, _mm512_cmplt_epi32_mask, _mm512_mask_mov_epi32,
        _mm512_min_epi32, _mm512_reduce_min_epi32, _mm512_set1_epi32, _mm512_slli_epi32, _mm512_sub_epi32,
    };
    use std::mem::transmute;

    const LANES: Numbers = {
        let mut lanes = [0; GROUP];
        let mut lane = 0;
        while lane < GROUP {
            lanes[lane] = lane as i32;
            lane += 1;
        }
        lanes
    };

    impl Distances for Avx2 {
        #[inline(always)]
        fn distances(self, products: Self::Sums, lengths: &Numbers, of_row: i32) -> Self::Sums {
            // SAFETY: whole numbers of the same size; `self` was made where the CPU has AVX2.
            unsafe {
                let lengths = transmute::<Numbers, [__m256i; 2]>(*lengths);
                let of_row = _mm256_set1_epi32(of_row);
                let of = |lengths, products| {
                    _mm256_sub_epi32(_mm256_add_epi32(lengths, of_row), _mm256_slli_epi32::<1>(products))
                };
                [of(lengths[0], products[0]), of(lengths[1], products[1])]
            }
        }

        #[inline(always)]
        fn smallest(self, numbers: Self::Sums) -> i32 {
            // SAFETY: `self` was made where the CPU has AVX2.
            unsafe {
                let eight = _mm256_min_epi32(numbers[0], numbers[1]);
                let four = _mm_min_epi32(_mm256_castsi256_si128(eight), _mm256_extracti128_si256::<1>(eight));
                let two = _mm_min_epi32(four, _mm_shuffle_epi32::<0b_01_00_11_10>(four));
                _mm_cvtsi128_si32(_mm_min_epi32(two, _mm_shuffle_epi32::<0b_10_11_00_01>(two)))
            }
        }

        #[inline(always)]
        fn first_and_others(self, numbers: Self::Sums, least: i32) -> (usize, i32) {
            // SAFETY: whole numbers of the same size; `self` was made where the CPU has AVX2.
            unsafe {
                let least = _mm256_set1_epi32(least);
                let is_least =
                    |numbers| _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpeq_epi32(numbers, least)));
                let first =
                    (is_least(numbers[0]) | is_least(numbers[1]) << 8).trailing_zeros() as usize % GROUP;
                let lanes = transmute::<Numbers, [__m256i; 2]>(LANES);
                let without = |numbers, lanes| {
                    let is_first = _mm256_cmpeq_epi32(lanes, _mm256_set1_epi32(first as i32));
                    _mm256_max_epi32(numbers, _mm256_and_si256(is_first, _mm256_set1_epi32(i32::MAX)))
                };
                (first, self.smallest([without(numbers[0], lanes[0]), without(numbers[1], lanes[1])]))
            }
        }

        #[inline(always)]
        fn lower(self, numbers: &mut Numbers, others: Self::Sums) -> bool {
            // SAFETY: whole numbers of the same size; `self` was made where the CPU has AVX2.
            unsafe {
                let before = transmute::<Numbers, [__m256i; 2]>(*numbers);
                let lowered =
                    [_mm256_min_epi32(before[0], others[0]), _mm256_min_epi32(before[1], others[1])];
                *numbers = transmute::<[__m256i; 2], Numbers>(lowered);
                let is_lower = _mm256_or_si256(
                    _mm256_cmpgt_epi32(before[0], others[0]),
                    _mm256_cmpgt_epi32(before[1], others[1]),
                );
                _mm256_testz_si256(is_lower, is_lower) == 0
            }
        }
    }

    impl Distances for Avx512 {
        #[inline(always)]
        fn distances(self, products: Self::Sums, lengths: &Numbers, of_row: i32) -> Self::Sums {
            // SAFETY: whole numbers of the same size; `self` was made where the CPU has AVX-512.
            unsafe {
                let lengths = transmute::<Numbers, __m512i>(*lengths);
                let lengths = _mm512_add_epi32(lengths, _mm512_set1_epi32(of_row));
                _mm512_sub_epi32(lengths, _mm512_slli_epi32::<1>(products))
            }
        }

        #[inline(always)]
        fn smallest(self, numbers: Self::Sums) -> i32 {
            // SAFETY: `self` was made where the CPU has AVX-512.
            unsafe { _mm512_reduce_min_epi32(numbers) }
        }

        #[inline(always)]
        fn first_and_others(self, numbers: Self::Sums, least: i32) -> (usize, i32) {
            // SAFETY: as above.
            unsafe {
                let is_least = _mm512_cmpeq_epi32_mask(numbers, _mm512_set1_epi32(least));
                let first = is_least.trailing_zeros() as usize % GROUP;
                let others = _mm512_mask_mov_epi32(numbers, 1 << first, _mm512_set1_epi32(i32::MAX));
                (first, self.smallest(others))
            }
        }

        #[inline(always)]
        fn lower(self, numbers: &mut Numbers, others: Self::Sums) -> bool {
            // SAFETY: whole numbers of the same size; `self` was made where the CPU has AVX-512.
            unsafe {
                let before = transmute::<Numbers, __m512i>(*numbers);
                *numbers = transmute::<__m512i, Numbers>(_mm512_min_epi32(before, others));
                _mm512_cmplt_epi32_mask(others, before) != 0
            }
        }
    }
}
