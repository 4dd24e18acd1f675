use super::*;
use proptest::prelude::*;

/// `n_rows` rows, none longer than 1, of few distinct values: ties are common.
fn rows(values: &[i8], n_rows: usize, width: usize) -> UnitRows {
    let scale = 1.0 / (4.0 * (width as f32).sqrt());
    let values: Vec<f32> =
        (0..n_rows * width).map(|idx| f32::from(values[idx % values.len()]) * scale).collect();
    UnitRows::from_slice(&values, width)
}

fn naive_distance(a: &[[i16; 2]], b: &[[i16; 2]]) -> i32 {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.map(|(&a, &b)| (i32::from(a) - i32::from(b)).pow(2)).sum()
}

/// What [`Assignment`] lends.
#[derive(Clone, Debug, PartialEq)]
struct Owned {
    nearest: Vec<u32>,
    distances: Vec<i32>,
    bounds: Vec<u16>,
}

impl Owned {
    fn lend(&mut self) -> Assignment<'_> {
        Assignment { nearest: &mut self.nearest, distances: &mut self.distances, bounds: &mut self.bounds }
    }
}

proptest! {
    #[test]
    fn assignments_are_the_naive_ones_and_bounds_hold(
        n_points in 1usize..12, n_centers in 1usize..60, width in 1usize..40,
        values in prop::collection::vec(-4i8..=4, 1400), n_moves in 1usize..4,
    ) {
        let points = MeasuredPoints::new(rows(&values, n_points, width));
        let n_groups = n_centers.div_ceil(GROUP);
        let mut fast = Owned {
            nearest: vec![0; n_points], distances: vec![0; n_points], bounds: vec![0; n_points * n_groups],
        };
        let mut drifts = vec![0; n_groups];
        let mut before: Option<UnitRows> = None;
        for move_idx in 0..n_moves {
            let centers = GroupedRows::new(rows(&values[100 * move_idx + 7..], n_centers, width));
            if let Some(before) = &before {
                drifts = centers.drifts(before);
            }
            let mut plain = fast.clone();
            reassign(&points, 0, &centers, &drifts, fast.lend());
            let round = Round { points: &points, first_row: 0, centers: &centers, drifts: &drifts };
            reassign_kernel(Plain, round, plain.lend());
            prop_assert_eq!(&fast, &plain);
            for (point_idx, point) in points.rows().rows().enumerate() {
                let distance = |idx: &usize| naive_distance(point, centers.rows().row(*idx));
                let nearest = (0..n_centers).min_by_key(distance).unwrap();
                prop_assert_eq!(fast.nearest[point_idx] as usize, nearest);
                prop_assert_eq!(fast.distances[point_idx], distance(&nearest));
                for other in (0..n_centers).filter(|other| *other != nearest) {
                    let bound = i32::from(fast.bounds[point_idx * n_groups + other / GROUP]);
                    prop_assert!(bound.pow(2) <= distance(&other));
                }
            }
            before = Some(centers.rows().clone());
        }
    }

    #[test]
    fn points_approach_as_naively(
        n_points in 1usize..50, width in 1usize..40, values in prop::collection::vec(-4i8..=4, 1400),
    ) {
        let points = GroupedRows::new(rows(&values, n_points, width));
        let centers = rows(&values[50..], 5, width);
        let mut fast = vec![i32::MAX; points.n_groups() * GROUP];
        let mut plain = fast.clone();
        for (n_before, center) in centers.rows().enumerate() {
            approach(&points, center, &mut fast);
            approach_kernel(Plain, &points, center, &mut plain);
            prop_assert_eq!(&fast, &plain);
            for (point, &distance) in points.rows().rows().zip(&fast) {
                let so_far = centers.rows().take(n_before + 1);
                prop_assert_eq!(distance, so_far.map(|center| naive_distance(point, center)).min().unwrap());
            }
        }
    }
}
