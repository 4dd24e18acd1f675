use super::*;
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Numbers of which many are the same, and some the largest: ties are common, and sums large.
fn numbers(n: usize, random: &mut ChaCha8Rng) -> Vec<i8> {
    let number = |_| [-3, -2, -1, 0, 1, 2, 127, -127, -128][random.random_range(0..9usize)];
    (0..n).map(number).collect()
}

fn nearest_by(
    instructions: impl Instructions,
    (rows, columns): (&ByteRows, &ByteColumns),
    n_kept: usize,
) -> Nearest {
    let mut nearest = Nearest::new(rows.n_rows(), n_kept);
    let row_idxs: Vec<u32> = (0..rows.n_rows() as u32).collect();
    look_kernel(
        instructions,
        &mut nearest,
        &Look { rows, row_idxs: &row_idxs, columns, blocks: 0..columns.n_blocks() },
    );
    nearest
}

proptest! {
    #[test]
    fn the_nearest_are_the_naive_ones(
        n_rows in 0usize..10, n_columns in 0usize..200, width in 1usize..20, n_kept in 1usize..13,
        seed in any::<u64>(),
    ) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let of_rows = numbers(n_rows * width, &mut random);
        let of_columns = numbers(n_columns * width, &mut random);
        let (rows, columns) = (ByteRows::new(&of_rows, width), ByteColumns::new(&of_columns, width));
        let plain = nearest_by(Plain, (&rows, &columns), n_kept);
        let mut at_once = Nearest::new(n_rows, n_kept);
        at_once.look(&rows, &(0..n_rows as u32).collect::<Vec<_>>(), &columns, 0..columns.n_blocks());
        let mut looked = Nearest::new(n_rows, n_kept);
        let row_idxs: Vec<u32> = (0..n_rows as u32).collect();
        // The last blocks first: their order does not matter.
        for block_idx in (0..columns.n_blocks()).rev() {
            looked.look(&rows, &row_idxs, &columns, block_idx..block_idx + 1);
        }
        let number = |value: i8| i32::from(value.max(-127));
        for row_idx in 0..n_rows {
            let row = &of_rows[row_idx * width..][..width];
            let distance = |column: &[i8]| -> u32 {
                row.iter().zip(column).map(|(&a, &b)| (number(a) - number(b)).pow(2) as u32).sum()
            };
            let mut expected: Vec<(u32, u32)> =
                of_columns.chunks_exact(width).map(distance).zip(0..).collect();
            expected.sort_unstable();
            expected.truncate(n_kept);
            prop_assert_eq!(plain.of(row_idx).collect::<Vec<_>>(), expected.clone());
            prop_assert_eq!(looked.of(row_idx).collect::<Vec<_>>(), expected.clone());
            prop_assert_eq!(at_once.of(row_idx).collect::<Vec<_>>(), expected.clone());
            #[cfg(target_arch = "x86_64")]
            if let Some(avx2) = crate::simd::cpu::Avx2::detected() {
                let found = nearest_by(avx2, (&rows, &columns), n_kept);
                prop_assert_eq!(found.of(row_idx).collect::<Vec<_>>(), expected);
            }
        }
    }

    #[test]
    fn columns_come_back(width in 1usize..20, values in prop::collection::vec(-127i8..=127, 400)) {
        let columns = ByteColumns::new(&values, width);
        let mut column = vec![0; width];
        for (column_idx, expected) in values.chunks_exact(width).enumerate() {
            columns.get(column_idx, &mut column);
            prop_assert_eq!(&column, expected);
        }
    }
}
