//! k-means: Lloyd, "Least squares quantization in PCM", 1982, seeded as in Arthur and Vassilvitskii,
//! "k-means++: the advantages of careful seeding", 2007.
//!
//! Rows are rounded to fixed point once, and all that follows is computed in whole numbers: the result is the same
//! for any number of threads, and comparisons that cannot change it are left out.

use super::VocabularyError;
use super::turn::Turn;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use roomsight_vision::matrix::Matrix;
use roomsight_vision::simd::{self, Assignment, GROUP, GroupedRows, MeasuredPoints, UnitRows};

/// Rows that are worked on by one thread at a time.
const BLOCK_ROWS: usize = 2048;

/// Rows a cluster among which the first centers are drawn, where there are so many.
const N_DRAWN_AMONG: usize = 16;

/// Centers rest where at most one point in so many found another one nearer: of 100,000 descriptors, further rounds lower the
/// inertia by less than a thousandth.
const FEW: usize = 100;

/// `n_clusters` centers of the rows, none of which is longer than 1, after at most `max_rounds` rounds.
pub(crate) fn cluster(
    rows: &Matrix,
    n_clusters: usize,
    max_rounds: usize,
    random: &mut ChaCha8Rng,
) -> Result<Matrix, VocabularyError> {
    if rows.n_rows() == 0 {
        return Err(VocabularyError::TooFewDescriptors { found: 0, wanted: n_clusters });
    }
    let turn = Turn::of(rows);
    let points = turn.there(rows);
    let some = every(&points, points.n_rows() / (N_DRAWN_AMONG * n_clusters));
    let seeds = match spread_out_rows(some.clone(), n_clusters, random) {
        // Too many of them are the same.
        Err(_) => spread_out_rows(points.clone(), n_clusters, random)?,
        Ok(seeds) => seeds,
    };
    let centers = settled(&MeasuredPoints::new(some), in_groups(&seeds), max_rounds);
    Ok(turn.back(&settled(&MeasuredPoints::new(points), centers, max_rounds)))
}

/// Every so many of the rows.
fn every(rows: &UnitRows, stride: usize) -> UnitRows {
    let mut some = rows.none();
    rows.rows().step_by(stride.max(1)).for_each(|row| some.push(row));
    some
}

/// k-means++: each next center is a row drawn with probability proportional to its squared distance to the
/// nearest center so far.
fn spread_out_rows(
    rows: UnitRows,
    n_clusters: usize,
    random: &mut ChaCha8Rng,
) -> Result<UnitRows, VocabularyError> {
    let n_rows = rows.n_rows();
    let mut centers = rows.none();
    let points = GroupedRows::new(rows);
    let mut distances = vec![i32::MAX; points.n_groups() * GROUP];
    // Padding is never drawn.
    distances[n_rows..].fill(0);
    let mut chosen = random.random_range(0..n_rows);
    for n_chosen in 1..=n_clusters {
        let center = points.rows().row(chosen);
        centers.push(center);
        if n_chosen == n_clusters {
            break;
        }
        simd::approach(&points, center, &mut distances);
        let total: u64 = distances.iter().map(|&distance| distance as u64).sum();
        if total == 0 {
            return Err(VocabularyError::TooFewDescriptors { found: n_chosen, wanted: n_clusters });
        }
        chosen = row_at(&distances, random.random_range(0..total));
    }
    Ok(centers)
}

/// The row at which the running sum of the weights passes `target`, which is less than the sum of all.
fn row_at(weights: &[i32], mut target: u64) -> usize {
    let is_passed = |&weight: &i32| {
        let is_passed = weight as u64 > target;
        target = target.saturating_sub(weight as u64);
        is_passed
    };
    weights.iter().position(is_passed).unwrap_or(0)
}

/// Centers in an order in which those of a group lie close together: halved again and again across the number in
/// which they differ most.
fn in_groups(centers: &UnitRows) -> UnitRows {
    let mut order: Vec<usize> = (0..centers.n_rows()).collect();
    halve(centers, &mut order);
    let mut ordered = centers.none();
    order.into_iter().for_each(|idx| ordered.push(centers.row(idx)));
    ordered
}

fn halve(centers: &UnitRows, idxs: &mut [usize]) {
    if idxs.len() <= GROUP {
        return;
    }
    let number = |idx: usize, axis: usize| i64::from(centers.row(idx)[axis / 2][axis % 2]);
    let spread = |axis: &usize| {
        let numbers = || idxs.iter().map(|&idx| number(idx, *axis));
        let (sum, squares) = (numbers().sum::<i64>(), numbers().map(|number| number * number).sum::<i64>());
        squares - sum * sum / idxs.len() as i64
    };
    let axis = (0..2 * centers.row(0).len()).max_by_key(spread).unwrap_or(0);
    idxs.sort_by_key(|&idx| number(idx, axis));
    let (left, right) = idxs.split_at_mut((idxs.len() / 2).next_multiple_of(GROUP).min(idxs.len()));
    halve(centers, left);
    halve(centers, right);
}

/// Where these centers come to lie after at most so many rounds, of which each moves them to the means of the points that they are nearest
/// to; after fewer where few points change theirs.
fn settled(points: &MeasuredPoints, centers: UnitRows, max_rounds: usize) -> UnitRows {
    let mut centers = GroupedRows::new(centers);
    let (n_points, n_groups) = (points.rows().n_rows(), centers.n_groups());
    let (mut nearest, mut distances) = (vec![0; n_points], vec![0; n_points]);
    let mut bounds = vec![0; n_points * n_groups];
    let mut drifts = vec![0; n_groups];
    let mut clusters = Clusters::none(centers.rows());
    for round in 0..max_rounds {
        let before = nearest.clone();
        nearest
            .par_chunks_mut(BLOCK_ROWS)
            .zip(distances.par_chunks_mut(BLOCK_ROWS))
            .zip(bounds.par_chunks_mut(BLOCK_ROWS * n_groups))
            .enumerate()
            .for_each(|(block, ((nearest, distances), bounds))| {
                let assignment = Assignment { nearest, distances, bounds };
                simd::reassign(points, block * BLOCK_ROWS, &centers, &drifts, assignment);
            });
        let mut n_changed = 0;
        for (idx, (&now, &before)) in nearest.iter().zip(&before).enumerate() {
            if round == 0 {
                clusters.join(now, points.rows().row(idx));
            } else if now != before {
                clusters.leave(before, points.rows().row(idx));
                clusters.join(now, points.rows().row(idx));
                n_changed += 1;
            }
        }
        if round > 0 && n_changed <= n_points / FEW {
            break;
        }
        let farthest = farthest_points(&distances, clusters.n_empty());
        let moved = clusters.means(farthest.into_iter().map(|idx| points.rows().row(idx)), centers.rows());
        let before = std::mem::replace(&mut centers, GroupedRows::new(moved));
        drifts = centers.drifts(before.rows());
    }
    centers.rows().clone()
}

/// The points that are farthest from their centers, the farthest first.
fn farthest_points(distances: &[i32], n_wanted: usize) -> Vec<usize> {
    if n_wanted == 0 {
        return Vec::new();
    }
    let mut by_distance: Vec<usize> = (0..distances.len()).collect();
    by_distance.sort_by_key(|&idx| std::cmp::Reverse(distances[idx]));
    by_distance.truncate(n_wanted);
    by_distance
}

/// The sums of the points of each cluster.
struct Clusters {
    sums: Vec<i64>,
    counts: Vec<i64>,
    width: usize,
}

impl Clusters {
    /// As many as there are centers, all empty.
    fn none(centers: &UnitRows) -> Self {
        let width = centers.row(0).len() * 2;
        Self { sums: vec![0; centers.n_rows() * width], counts: vec![0; centers.n_rows()], width }
    }

    fn join(&mut self, cluster: u32, point: &[[i16; 2]]) {
        self.counts[cluster as usize] += 1;
        let sums = &mut self.sums[cluster as usize * self.width..][..self.width];
        sums.iter_mut().zip(point.as_flattened()).for_each(|(sum, &number)| *sum += i64::from(number));
    }

    fn leave(&mut self, cluster: u32, point: &[[i16; 2]]) {
        self.counts[cluster as usize] -= 1;
        let sums = &mut self.sums[cluster as usize * self.width..][..self.width];
        sums.iter_mut().zip(point.as_flattened()).for_each(|(sum, &number)| *sum -= i64::from(number));
    }

    fn n_empty(&self) -> usize {
        self.counts.iter().filter(|&&count| count == 0).count()
    }

    /// The mean of each cluster; one without points moves to the next of `replacements`, or stays.
    fn means<'a>(
        &self,
        mut replacements: impl Iterator<Item = &'a [[i16; 2]]>,
        centers: &'a UnitRows,
    ) -> UnitRows {
        let mut means = centers.none();
        for (cluster, (sums, &count)) in self.sums.chunks_exact(self.width).zip(&self.counts).enumerate() {
            if count > 0 {
                let mean: Vec<[i16; 2]> = sums
                    .as_chunks::<2>()
                    .0
                    .iter()
                    .map(|pair| pair.map(|sum| (sum + count / 2).div_euclid(count) as i16))
                    .collect();
                means.push(&mean);
            } else {
                means.push(replacements.next().unwrap_or_else(|| centers.row(cluster)));
            }
        }
        means
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::{Rng, SeedableRng};

    fn random(seed: u64) -> ChaCha8Rng {
        ChaCha8Rng::seed_from_u64(seed)
    }

    fn blobs(n_rows: usize) -> Matrix {
        let mut random = random(1);
        let mut rows = Matrix::new(3);
        for row_idx in 0..n_rows {
            let center = (row_idx % 5) as f32 * 0.1;
            rows.push_row(&std::array::from_fn::<f32, 3, _>(|_| center + 0.01 * random.random::<f32>()));
        }
        rows
    }

    fn squared_distance(a: &[f32], b: &[f32]) -> f32 {
        a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
    }

    /// Sum of squared distances to the nearest center, naively.
    fn inertia(rows: &Matrix, centers: &Matrix) -> f32 {
        rows.rows()
            .map(|row| centers.rows().map(|c| squared_distance(row, c)).fold(f32::INFINITY, f32::min))
            .sum()
    }

    #[test]
    fn separate_blobs_get_a_center_each() {
        let rows = blobs(5000);
        let centers = cluster(&rows, 5, 30, &mut random(2)).unwrap();
        let mut found: Vec<f32> = centers.rows().map(|center| center[0]).collect();
        found.sort_by(f32::total_cmp);
        for (idx, center) in found.iter().enumerate() {
            assert!((center - (idx as f32 * 0.1 + 0.005)).abs() < 0.001, "{found:?}");
        }
    }

    #[test]
    fn each_round_lowers_the_inertia() {
        let rows = blobs(3000);
        let after = |n_rounds| inertia(&rows, &cluster(&rows, 40, n_rounds, &mut random(3)).unwrap());
        let rounds: Vec<f32> = (1..6).map(after).collect();
        assert!(rounds.windows(2).all(|pair| pair[1] <= pair[0] * 1.0001), "{rounds:?}");
    }

    #[test]
    fn threads_do_not_change_the_result() {
        let rows = blobs(9000);
        let with_threads = |n_threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            pool.install(|| cluster(&rows, 30, 10, &mut random(4)).unwrap())
        };
        assert_eq!(with_threads(1), with_threads(3));
    }

    #[test]
    fn too_few_distinct_rows_are_an_error() {
        let rows = Matrix::from_vec([[0.1f32, 0.2], [0.3, 0.4]].repeat(50).concat(), 2).unwrap();
        let error = cluster(&rows, 3, 10, &mut random(5)).unwrap_err();
        assert_eq!(error, VocabularyError::TooFewDescriptors { found: 2, wanted: 3 });
        assert!(cluster(&Matrix::new(2), 1, 10, &mut random(5)).is_err());
    }

    /// As [`settled`], by the book.
    fn plainly_settled(points: &UnitRows, mut centers: UnitRows, max_rounds: usize) -> UnitRows {
        let wide = |row: &[[i16; 2]]| row.as_flattened().iter().map(|&n| i64::from(n)).collect::<Vec<i64>>();
        let distance = |a: &[[i16; 2]], b: &[[i16; 2]]| -> i64 {
            wide(a).iter().zip(wide(b)).map(|(a, b)| (a - b) * (a - b)).sum()
        };
        let mut nearest = vec![usize::MAX; points.n_rows()];
        for _ in 0..max_rounds {
            let before = nearest.clone();
            for (nearest, point) in nearest.iter_mut().zip(points.rows()) {
                let of = |&idx: &usize| distance(point, centers.row(idx));
                *nearest = (0..centers.n_rows()).min_by_key(of).unwrap();
            }
            if nearest.iter().zip(&before).filter(|(now, before)| now != before).count()
                <= nearest.len() / FEW
            {
                break;
            }
            let mut far: Vec<usize> = (0..points.n_rows()).collect();
            far.sort_by_key(|&idx| -distance(points.row(idx), centers.row(nearest[idx])));
            let mut far = far.into_iter();
            let mut moved = centers.none();
            for cluster in 0..centers.n_rows() {
                let of: Vec<Vec<i64>> = (0..points.n_rows())
                    .filter(|&idx| nearest[idx] == cluster)
                    .map(|idx| wide(points.row(idx)))
                    .collect();
                if of.is_empty() {
                    moved.push(far.next().map_or(centers.row(cluster), |idx| points.row(idx)));
                    continue;
                }
                let mean = |axis: usize| {
                    let sum = of.iter().map(|row| row[axis]).sum::<i64>() as f64;
                    (sum / of.len() as f64 + 0.5).floor() as i16
                };
                let n_pairs = points.row(0).len();
                moved
                    .push(&(0..n_pairs).map(|pair| [mean(2 * pair), mean(2 * pair + 1)]).collect::<Vec<_>>());
            }
            centers = moved;
        }
        centers
    }

    proptest! {
        /// Points of few distinct values are as far from several centers, and leave others without any.
        #[test]
        fn centers_settle_as_without_bounds(
            n_points in 1usize..300, n_centers in 1usize..70, width in 1usize..30, n_values in 2i16..200,
            n_rounds in 1usize..12, seed in any::<u64>(),
        ) {
            let mut random = random(seed);
            let scale = 1.0 / (f32::from(n_values) * (width as f32).sqrt());
            let mut rows = |n: usize| {
                let values: Vec<f32> =
                    (0..n * width).map(|_| f32::from(random.random_range(-n_values..=n_values)) * scale).collect();
                UnitRows::from_slice(&values, width)
            };
            let (points, centers) = (rows(n_points), rows(n_centers));
            let expected = plainly_settled(&points, centers.clone(), n_rounds);
            prop_assert_eq!(settled(&MeasuredPoints::new(points), centers, n_rounds), expected);
        }
    }

    #[test]
    fn a_cluster_that_loses_its_rows_takes_a_far_one() {
        let fixed = |values: &[f32]| UnitRows::from_slice(values, 1);
        let moved = settled(&MeasuredPoints::new(fixed(&[0.0, 0.1, 0.2, 0.7])), fixed(&[0.1, -0.9]), 1);
        assert_eq!(moved.row(1), fixed(&[0.7]).row(0));
    }
}
