use super::*;
use proptest::prelude::*;

/// As the language rounds.
fn plainly_fixed(value: f32) -> i16 {
    (value * ONE + 0.5f32.copysign(value)) as i16
}

proptest! {
    #[test]
    fn rows_are_rounded_number_by_number(
        width in 1usize..40, bits in prop::collection::vec(any::<u32>(), 0..400), small in prop::collection::vec(-1.1f32..1.1, 400),
    ) {
        // All that a float can be, and what is rounded.
        for values in [bits.into_iter().map(f32::from_bits).collect(), small] {
            let rows = UnitRows::from_slice(&values, width);
            let mut plain = vec![0; rows.pairs.len() * 2];
            round_rows_kernel(&values, width, &mut plain);
            prop_assert_eq!(rows.pairs.as_flattened(), plain);
            prop_assert_eq!(rows.n_rows(), values.len() / width);
            for (row_idx, values) in values.chunks_exact(width).enumerate() {
                let expected: Vec<i16> = values.iter().map(|&value| plainly_fixed(value)).collect();
                let numbers = rows.row(row_idx).as_flattened();
                prop_assert_eq!(&numbers[..width], expected);
                prop_assert!(numbers[width..].iter().all(|&number| number == 0));
            }
        }
    }
}
