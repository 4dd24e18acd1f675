use super::*;
use crate::simd::rows::fixed;
use proptest::prelude::*;

/// `n_rows` rows, none longer than 1, of few distinct values: ties are common.
fn rows(values: &[i8], n_rows: usize, n_cols: usize) -> Matrix {
    let scale = 1.0 / (4.0 * (n_cols as f32).sqrt());
    let values = (0..n_rows * n_cols).map(|idx| f32::from(values[idx % values.len()]) * scale).collect();
    Matrix::from_vec(values, n_cols).unwrap()
}

proptest! {
    #[test]
    fn the_nearest_column_is_the_naive_one(
        n_rows in 1usize..10, n_columns in 1usize..50, width in 1usize..20,
        values in prop::collection::vec(-4i8..=4, 1400),
    ) {
        let (rows, centers) = (rows(&values, n_rows, width), rows(&values[200..], n_columns, width));
        let (fixed_rows, columns) = (UnitRows::new(&rows), UnitColumns::new(&centers));
        let (mut nearest, mut plain) = (vec![0; n_rows], vec![0; n_rows]);
        nearest_columns(&fixed_rows, &columns, &mut nearest);
        nearest_columns_kernel(Plain, &fixed_rows, &columns, &mut plain);
        prop_assert_eq!(&nearest, &plain);
        for (row_idx, row) in rows.rows().enumerate() {
            let distance = |center: &[f32]| -> i64 {
                row.iter().zip(center).map(|(&a, &b)| (i64::from(fixed(a)) - i64::from(fixed(b))).pow(2)).sum()
            };
            // The first of several that are as near.
            let expected = (0..n_columns).min_by_key(|&idx| distance(centers.row(idx))).unwrap();
            prop_assert_eq!(nearest[row_idx] as usize, expected);
        }
    }

    #[test]
    fn the_nearest_of_a_few_is_that_of_columns(
        n_columns in 1usize..50, width in 1usize..20, values in prop::collection::vec(-4i8..=4, 1400),
    ) {
        let (rows, centers) = (rows(&values, 3, width), rows(&values[200..], n_columns, width));
        let fixed_rows = UnitRows::new(&rows);
        let measured = MeasuredRows::new(UnitRows::new(&centers));
        let mut expected = [0; 3];
        nearest_columns(&fixed_rows, &UnitColumns::new(&centers), &mut expected);
        // In no order.
        let all: Vec<u32> = (0..n_columns as u32).rev().collect();
        for (row_idx, expected) in expected.into_iter().enumerate() {
            prop_assert_eq!(measured.nearest_among(&fixed_rows, row_idx, &all).idx, expected);
        }
        prop_assert_eq!(measured.nearest_among(&fixed_rows, 0, &[]).idx, u32::MAX);
    }

    #[test]
    fn the_largest_products_are_the_naive_ones(
        n_rows in 0usize..10, n_columns in 0usize..50, width in 1usize..20,
        values in prop::collection::vec(-4i8..=4, 1400),
    ) {
        let (rows, others) = (rows(&values, n_rows, width), rows(&values[200..], n_columns, width));
        let (fixed_rows, columns) = (UnitRows::new(&rows), UnitColumns::new(&others));
        let found = |kernel: fn(&UnitRows, &UnitColumns, &mut [i32], &mut [i32])| {
            let (mut of_rows, mut of_columns) = (vec![0; n_rows], vec![0; n_columns]);
            kernel(&fixed_rows, &columns, &mut of_rows, &mut of_columns);
            (of_rows, of_columns)
        };
        let product = |row: &[f32], other: &[f32]| -> i32 {
            row.iter().zip(other).map(|(&a, &b)| i32::from(fixed(a)) * i32::from(fixed(b))).sum()
        };
        let largest = |from: &Matrix, to: &Matrix| -> Vec<i32> {
            let of = |row| to.rows().map(|other| product(row, other)).max().unwrap_or(i32::MIN);
            from.rows().map(of).collect()
        };
        let expected = (largest(&rows, &others), largest(&others, &rows));
        prop_assert_eq!(found(largest_products), expected.clone());
        let plain = |rows: &_, columns: &_, of_rows: &mut _, of_columns: &mut _| {
            largest_products_kernel(Plain, rows, columns, of_rows, of_columns);
        };
        prop_assert_eq!(found(plain), expected);
    }
}
