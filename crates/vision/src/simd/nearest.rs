//! The nearest of many vectors, and the largest products with many, in fixed point.

mod among;

pub use among::{MeasuredRows, Nearness};

use super::rows::{UnitRows, product};
use super::with_instructions;
use crate::matrix::Matrix;

/// Stands for the squared length of padding: so large that it is never nearest.
pub(super) const PADDING: i32 = i32::MAX / 2;

/// Columns that are worked on at once.
pub(super) const COLUMN_BLOCK: usize = 16;

/// Rows that are worked on at once.
const ROW_BLOCK: usize = 4;

/// The rows of a matrix laid out as columns, for [`nearest_columns`] and [`largest_products`].
#[derive(Clone, Debug)]
pub struct UnitColumns {
    /// Blocks of [`COLUMN_BLOCK`] columns; within a block, pair after pair.
    blocks: Vec<[[i16; 2]; COLUMN_BLOCK]>,
    /// The squared length of each column, [`PADDING`] after the last.
    squared_lengths: Vec<[i32; COLUMN_BLOCK]>,
    n_pairs: usize,
}

impl UnitColumns {
    /// Lays out the rows of `matrix`, none of which is longer than 1, as columns.
    pub fn new(matrix: &Matrix) -> Self {
        let rows = UnitRows::new(matrix);
        let of_rows = rows.squared_lengths();
        let n_pairs = rows.n_pairs_a_row;
        let n_blocks = matrix.n_rows().div_ceil(COLUMN_BLOCK);
        let mut blocks = vec![[[0; 2]; COLUMN_BLOCK]; n_blocks * n_pairs];
        let mut squared_lengths = vec![[PADDING; COLUMN_BLOCK]; n_blocks];
        for (column_idx, row) in rows.pairs.chunks_exact(n_pairs.max(1)).enumerate() {
            let (block_idx, lane) = (column_idx / COLUMN_BLOCK, column_idx % COLUMN_BLOCK);
            let block = &mut blocks[block_idx * n_pairs..][..n_pairs];
            block.iter_mut().zip(row).for_each(|(lanes, &pair)| lanes[lane] = pair);
            squared_lengths[block_idx][lane] = of_rows[column_idx];
        }
        Self { blocks, squared_lengths, n_pairs }
    }
}

/// The nearest column of each row, by the distance of the fixed-point vectors, ties to the first, into
/// `nearest`; `rows` holds as many.
///
/// # Panics
///
/// When there are fewer rows.
pub fn nearest_columns(rows: &UnitRows, columns: &UnitColumns, nearest: &mut [u32]) {
    with_instructions!(
        nearest_columns_kernel, Avx512: "avx512f,avx512bw,avx512vl",
        (rows: &UnitRows, columns: &UnitColumns, nearest: &mut [u32])
    );
}

/// The largest product of each row with any column into `of_rows`, and of each column with any row into
/// `of_columns`, in fixed point; both hold as many as there are. Without any it is `i32::MIN`.
///
/// # Panics
///
/// When there are fewer rows.
pub fn largest_products(rows: &UnitRows, columns: &UnitColumns, of_rows: &mut [i32], of_columns: &mut [i32]) {
    with_instructions!(
        largest_products_kernel, Avx512: "avx512f,avx512bw,avx512vl",
        (rows: &UnitRows, columns: &UnitColumns, of_rows: &mut [i32], of_columns: &mut [i32])
    );
}

/// Instructions that multiply pairs and add the products. Who has a value may execute them.
pub(super) trait Instructions: Copy {
    /// Running products of one row with [`COLUMN_BLOCK`] columns.
    type Sums: Copy;

    const ZERO: Self::Sums;

    /// Adds the products of the next pair.
    fn add(self, sums: Self::Sums, pair: [i16; 2], lanes: &[[i16; 2]; COLUMN_BLOCK]) -> Self::Sums;

    fn into_lanes(sums: Self::Sums) -> [i32; COLUMN_BLOCK];
}

/// Those that every CPU has.
#[derive(Clone, Copy)]
pub(super) struct Plain;

impl Instructions for Plain {
    type Sums = [i32; COLUMN_BLOCK];

    const ZERO: Self::Sums = [0; COLUMN_BLOCK];

    #[inline(always)]
    fn add(self, mut sums: Self::Sums, pair: [i16; 2], lanes: &[[i16; 2]; COLUMN_BLOCK]) -> Self::Sums {
        sums.iter_mut().zip(lanes).for_each(|(sum, &lane)| *sum = sum.wrapping_add(product(pair, lane)));
        sums
    }

    #[inline(always)]
    fn into_lanes(sums: Self::Sums) -> [i32; COLUMN_BLOCK] {
        sums
    }
}

/// Those of wider vectors. They are fast in functions compiled for them, into which they are inlined.
#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{COLUMN_BLOCK, Instructions};
    use crate::simd::cpu::{Avx2, Avx512};
    use std::arch::x86_64::{
        __m256i, __m512i, _mm256_add_epi32, _mm256_madd_epi16, _mm256_set1_epi32, _mm512_add_epi32,
        _mm512_madd_epi16, _mm512_set1_epi32,
    };
    use std::mem::transmute;

    type Lanes = [[i16; 2]; COLUMN_BLOCK];

    impl Instructions for Avx2 {
        type Sums = [__m256i; 2];

        // SAFETY: whole numbers of the same size.
        const ZERO: Self::Sums = unsafe { transmute::<Lanes, [__m256i; 2]>([[0; 2]; COLUMN_BLOCK]) };

        #[inline(always)]
        fn add(self, sums: Self::Sums, pair: [i16; 2], lanes: &Lanes) -> Self::Sums {
            // SAFETY: whole numbers of the same size; `self` was made where the CPU has AVX2.
            unsafe {
                let pairs = _mm256_set1_epi32(transmute::<[i16; 2], i32>(pair));
                let lanes = transmute::<Lanes, [__m256i; 2]>(*lanes);
                [
                    _mm256_add_epi32(sums[0], _mm256_madd_epi16(pairs, lanes[0])),
                    _mm256_add_epi32(sums[1], _mm256_madd_epi16(pairs, lanes[1])),
                ]
            }
        }

        #[inline(always)]
        fn into_lanes(sums: Self::Sums) -> [i32; COLUMN_BLOCK] {
            // SAFETY: whole numbers of the same size.
            unsafe { transmute(sums) }
        }
    }

    impl Instructions for Avx512 {
        type Sums = __m512i;

        // SAFETY: whole numbers of the same size.
        const ZERO: Self::Sums = unsafe { transmute::<Lanes, __m512i>([[0; 2]; COLUMN_BLOCK]) };

        #[inline(always)]
        fn add(self, sums: Self::Sums, pair: [i16; 2], lanes: &Lanes) -> Self::Sums {
            // SAFETY: whole numbers of the same size; `self` was made where the CPU has AVX-512.
            unsafe {
                let pairs = _mm512_set1_epi32(transmute::<[i16; 2], i32>(pair));
                let lanes = transmute::<Lanes, __m512i>(*lanes);
                _mm512_add_epi32(sums, _mm512_madd_epi16(pairs, lanes))
            }
        }

        #[inline(always)]
        fn into_lanes(sums: Self::Sums) -> [i32; COLUMN_BLOCK] {
            // SAFETY: whole numbers of the same size.
            unsafe { transmute(sums) }
        }
    }
}

#[inline(always)]
fn nearest_columns_kernel<I: Instructions>(
    instructions: I,
    rows: &UnitRows,
    columns: &UnitColumns,
    nearest: &mut [u32],
) {
    let n = columns.n_pairs;
    let mut row_idx = 0;
    while row_idx < nearest.len() {
        let n_block = ROW_BLOCK.min(nearest.len() - row_idx);
        let block = &rows.pairs[row_idx * n..(row_idx + n_block) * n];
        let nearest = &mut nearest[row_idx..][..n_block];
        if n_block == ROW_BLOCK {
            nearest_of_block::<I, ROW_BLOCK>(instructions, block, columns, nearest);
        } else {
            for i in 0..n_block {
                nearest_of_block::<I, 1>(instructions, &block[i * n..][..n], columns, &mut nearest[i..=i]);
            }
        }
        row_idx += n_block;
    }
}

/// `R` rows against all columns, [`COLUMN_BLOCK`] at a time; a lane is a column. The nearest column has the
/// largest 2 row . column - |column|^2.
#[inline(always)]
fn nearest_of_block<I: Instructions, const R: usize>(
    instructions: I,
    rows: &[[i16; 2]],
    columns: &UnitColumns,
    nearest: &mut [u32],
) {
    let n = columns.n_pairs;
    let row: [&[[i16; 2]]; R] = std::array::from_fn(|r| &rows[r * n..][..n]);
    let mut best_score = [[i32::MIN; COLUMN_BLOCK]; R];
    let mut best_block = [[0u32; COLUMN_BLOCK]; R];
    for (block_idx, squared_lengths) in columns.squared_lengths.iter().enumerate() {
        let products = products_of_block(instructions, &row, &columns.blocks[block_idx * n..][..n]);
        for r in 0..R {
            keep_larger(&products[r], squared_lengths, block_idx, &mut best_score[r], &mut best_block[r]);
        }
    }
    for r in 0..R {
        let column = |lane: usize| best_block[r][lane] * COLUMN_BLOCK as u32 + lane as u32;
        let mut best = 0;
        for lane in 1..COLUMN_BLOCK {
            let (score, best_so_far) = (best_score[r][lane], best_score[r][best]);
            if score > best_so_far || (score == best_so_far && column(lane) < column(best)) {
                best = lane;
            }
        }
        nearest[r] = column(best);
    }
}

/// The products of `R` rows with a block of columns.
#[inline(always)]
fn products_of_block<I: Instructions, const R: usize>(
    instructions: I,
    rows: &[&[[i16; 2]]; R],
    block: &[[[i16; 2]; COLUMN_BLOCK]],
) -> [[i32; COLUMN_BLOCK]; R] {
    let mut products = [I::ZERO; R];
    for (i, lanes) in block.iter().enumerate() {
        for r in 0..R {
            products[r] = instructions.add(products[r], rows[r][i], lanes);
        }
    }
    products.map(I::into_lanes)
}

/// Keeps in each lane the larger score, and the block that it is from.
#[inline(always)]
fn keep_larger(
    products: &[i32; COLUMN_BLOCK],
    squared_lengths: &[i32; COLUMN_BLOCK],
    block_idx: usize,
    best_score: &mut [i32; COLUMN_BLOCK],
    best_block: &mut [u32; COLUMN_BLOCK],
) {
    let mut scores = [0; COLUMN_BLOCK];
    for lane in 0..COLUMN_BLOCK {
        scores[lane] = products[lane].wrapping_mul(2).wrapping_sub(squared_lengths[lane]);
    }
    // Masks, since the compiler makes a branch for each lane of a choice.
    for lane in 0..COLUMN_BLOCK {
        let is_larger = u32::from(scores[lane] > best_score[lane]).wrapping_neg();
        best_block[lane] = (block_idx as u32 & is_larger) | (best_block[lane] & !is_larger);
    }
    for lane in 0..COLUMN_BLOCK {
        best_score[lane] = best_score[lane].max(scores[lane]);
    }
}

#[inline(always)]
fn largest_products_kernel<I: Instructions>(
    instructions: I,
    rows: &UnitRows,
    columns: &UnitColumns,
    of_rows: &mut [i32],
    of_columns: &mut [i32],
) {
    of_columns.fill(i32::MIN);
    let n = columns.n_pairs;
    let (blocks, rest) = of_rows.as_chunks_mut::<ROW_BLOCK>();
    let (of_blocks, of_rest) = rows.pairs.split_at(blocks.len() * ROW_BLOCK * n);
    for (block_idx, of_rows) in blocks.iter_mut().enumerate() {
        let rows = &of_blocks[block_idx * ROW_BLOCK * n..][..ROW_BLOCK * n];
        largest_of_block::<I, ROW_BLOCK>(instructions, rows, columns, of_rows, of_columns);
    }
    for (row_idx, of_row) in rest.iter_mut().enumerate() {
        largest_of_block::<I, 1>(
            instructions,
            &of_rest[row_idx * n..][..n],
            columns,
            std::array::from_mut(of_row),
            of_columns,
        );
    }
}

/// `R` rows against all columns, [`COLUMN_BLOCK`] at a time; a lane is a column.
#[inline(always)]
fn largest_of_block<I: Instructions, const R: usize>(
    instructions: I,
    rows: &[[i16; 2]],
    columns: &UnitColumns,
    of_rows: &mut [i32; R],
    of_columns: &mut [i32],
) {
    let n = columns.n_pairs;
    let row: [&[[i16; 2]]; R] = std::array::from_fn(|r| &rows[r * n..][..n]);
    let mut best = [[i32::MIN; COLUMN_BLOCK]; R];
    let of_blocks = of_columns.chunks_mut(COLUMN_BLOCK);
    for (block_idx, (squared_lengths, of_block)) in columns.squared_lengths.iter().zip(of_blocks).enumerate()
    {
        let products = products_of_block(instructions, &row, &columns.blocks[block_idx * n..][..n]);
        let mut largest = [i32::MIN; COLUMN_BLOCK];
        for r in 0..R {
            let products = without_padding(&products[r], squared_lengths);
            raise(&mut best[r], &products);
            raise(&mut largest, &products);
        }
        match of_block.try_into() {
            Ok(of_block) => raise(of_block, &largest),
            Err(_) => of_block.iter_mut().zip(largest).for_each(|(best, product)| *best = product.max(*best)),
        }
    }
    *of_rows = best.map(|lanes| lanes.into_iter().fold(i32::MIN, i32::max));
}

/// The products, the smallest number in place of those with padding.
#[inline(always)]
fn without_padding(
    products: &[i32; COLUMN_BLOCK],
    squared_lengths: &[i32; COLUMN_BLOCK],
) -> [i32; COLUMN_BLOCK] {
    // Masks, as above.
    std::array::from_fn(|lane| {
        let is_padding = i32::from(squared_lengths[lane] == PADDING).wrapping_neg();
        (i32::MIN & is_padding) | (products[lane] & !is_padding)
    })
}

/// Raises the best of each lane to the product.
#[inline(always)]
fn raise(best: &mut [i32; COLUMN_BLOCK], products: &[i32; COLUMN_BLOCK]) {
    for lane in 0..COLUMN_BLOCK {
        best[lane] = best[lane].max(products[lane]);
    }
}

#[cfg(test)]
mod tests;
