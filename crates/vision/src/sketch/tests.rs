use super::*;
use crate::simd::{UnitColumns, nearest_columns};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Rows of at most unit length that differ in a few directions more than in others.
fn rows(random: &mut ChaCha8Rng, n_rows: usize, spread: &[f32], sharpness: i32) -> Matrix {
    let mut rows = Matrix::new(spread.len());
    for _ in 0..n_rows {
        let row: Vec<f32> =
            spread.iter().map(|spread| spread * random.random_range(0.0..1.0f32).powi(sharpness)).collect();
        let length = row.iter().map(|value| value * value).sum::<f32>().sqrt().max(1.0);
        rows.push_row(&row.iter().map(|value| value / length).collect::<Vec<_>>());
    }
    rows
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn the_nearest_are_those_of_the_full_search(
        seed in any::<u64>(), n_vectors in FEWEST..400, width in 2 * SKETCH..140, decay in 0.7f32..1.0,
        size in 0.02f32..3.0, sharpness in 1i32..6,
    ) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let spread: Vec<f32> = (0..width).map(|idx| size * decay.powi(idx as i32)).collect();
        let vectors = rows(&mut random, n_vectors, &spread, sharpness);
        let mut asked = rows(&mut random, 20, &spread, sharpness);
        // Some are among the many, and some twice.
        vectors.rows().step_by(50).for_each(|vector| asked.push_row(vector));
        let mut vectors = vectors;
        let again = vectors.row(3).to_vec();
        vectors.push_row(&again);
        let sketched = Sketched::new(&vectors).expect("many vectors that are wide");
        let (mut nearest, mut expected) = (vec![0; asked.n_rows()], vec![0; asked.n_rows()]);
        sketched.nearest(&asked, &mut nearest);
        nearest_columns(&UnitRows::new(&asked), &UnitColumns::new(&vectors), &mut expected);
        prop_assert_eq!(nearest, expected);
    }
}

#[test]
fn vectors_of_another_kind_find_theirs_too() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let small: Vec<f32> = vec![0.01; 72];
    let vectors = rows(&mut random, 300, &small, 1);
    let sketched = Sketched::new(&vectors).unwrap();
    let asked = rows(&mut random, 50, &[1.0; 72], 2);
    let (mut nearest, mut expected) = (vec![0; 50], vec![0; 50]);
    sketched.nearest(&asked, &mut nearest);
    nearest_columns(&UnitRows::new(&asked), &UnitColumns::new(&vectors), &mut expected);
    assert_eq!(nearest, expected);
}

#[test]
fn few_vectors_are_compared_in_full() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let spread: Vec<f32> = (0..72).map(|idx| 0.9f32.powi(idx)).collect();
    let vectors = rows(&mut random, 1000, &spread, 4);
    let sketched = Sketched::new(&vectors).unwrap();
    let asked = rows(&mut random, 100, &spread, 4);
    let (rows, onto) = (UnitRows::new(&asked), sketched.onto.apply(asked.as_slice()));
    let of_rows = asked.rows().zip(onto.chunks_exact(N_DIRECTIONS)).zip(rows.squared_lengths());
    let mut scratch = Scratch { scores: vec![0; sketched.columns.n_scores()], candidates: Vec::new() };
    let mut n_compared = 0;
    for (row_idx, ((vector, onto), squared_length)) in of_rows.enumerate() {
        let coordinates = sketched.coordinates(vector, onto);
        sketched.choose(&Asked { coordinates, squared_length, rows: &rows, row_idx }, &mut scratch);
        n_compared += scratch.candidates.len();
    }
    assert!(n_compared < 100 * 100, "{n_compared} of {}", 100 * 1000);
}

#[test]
fn there_are_no_sketches_of_what_is_small() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    assert!(Sketched::new(&rows(&mut random, FEWEST - 1, &[0.1; 72], 1)).is_none());
    assert!(Sketched::new(&rows(&mut random, FEWEST, &[0.1; SKETCH], 1)).is_none());
}
