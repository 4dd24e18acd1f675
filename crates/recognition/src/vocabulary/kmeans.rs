//! k-means: Lloyd, "Least squares quantization in PCM", 1982, seeded as in Arthur and Vassilvitskii,
//! "k-means++: the advantages of careful seeding", 2007.
//!
//! Work is split into blocks of a fixed number of rows whose sums are added in order, so that the result is
//! the same for any number of threads.

use super::VocabularyError;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use roomsight_vision::matrix::Matrix;
use roomsight_vision::simd::{self, UnitColumns, UnitRows};

/// Rows that are worked on by one thread at a time.
const BLOCK_ROWS: usize = 2048;

/// `n_clusters` centers of the rows, none of which is longer than 1, after at most `max_rounds` rounds.
pub(crate) fn cluster(
    rows: &Matrix,
    n_clusters: usize,
    max_rounds: usize,
    random: &mut ChaCha8Rng,
) -> Result<Matrix, VocabularyError> {
    let mut centers = spread_out_rows(rows, n_clusters, random)?;
    let mut nearest = vec![u32::MAX; rows.n_rows()];
    for _ in 0..max_rounds {
        let before = nearest.clone();
        assign(rows, &centers, &mut nearest);
        if nearest == before {
            break;
        }
        let farthest_first = empty_clusters_rows(rows, &centers, &nearest);
        centers = means(rows, &nearest, &centers, &farthest_first);
    }
    Ok(centers)
}

/// k-means++: each next center is a row drawn with probability proportional to its squared distance to the
/// nearest center so far.
fn spread_out_rows(
    rows: &Matrix,
    n_clusters: usize,
    random: &mut ChaCha8Rng,
) -> Result<Matrix, VocabularyError> {
    let too_few = |found| VocabularyError::TooFewDescriptors { found, wanted: n_clusters };
    if rows.n_rows() == 0 {
        return Err(too_few(0));
    }
    let mut centers = Matrix::new(rows.n_cols());
    let mut distances = vec![f32::INFINITY; rows.n_rows()];
    let mut chosen = random.random_range(0..rows.n_rows());
    for n_chosen in 1..=n_clusters {
        let center = rows.row(chosen).to_vec();
        centers.push_row(&center);
        if n_chosen == n_clusters {
            break;
        }
        let block_sums: Vec<f64> = distances
            .par_chunks_mut(BLOCK_ROWS)
            .enumerate()
            .map(|(block_idx, block)| {
                for (offset, distance) in block.iter_mut().enumerate() {
                    let row = rows.row(block_idx * BLOCK_ROWS + offset);
                    *distance = distance.min(squared_distance(row, &center));
                }
                block.iter().map(|&distance| f64::from(distance)).sum()
            })
            .collect();
        let total: f64 = block_sums.iter().sum();
        if total <= 0.0 {
            return Err(too_few(n_chosen));
        }
        chosen = row_at(&distances, random.random::<f64>() * total);
    }
    Ok(centers)
}

/// The row at which the running sum of the weights passes `target`; never one without weight.
fn row_at(weights: &[f32], mut target: f64) -> usize {
    let mut last_with_weight = 0;
    for (row_idx, &weight) in weights.iter().enumerate().filter(|&(_, &weight)| weight > 0.0) {
        last_with_weight = row_idx;
        target -= f64::from(weight);
        if target <= 0.0 {
            break;
        }
    }
    last_with_weight
}

fn squared_distance(a: &[f32], b: &[f32]) -> f32 {
    // Eight running sums, which the compiler turns into vector instructions.
    let mut sums = [0.0f32; 8];
    let (a_blocks, a_rest) = a.as_chunks::<8>();
    let (b_blocks, b_rest) = b.as_chunks::<8>();
    for (a, b) in a_blocks.iter().zip(b_blocks) {
        for lane in 0..8 {
            sums[lane] += (a[lane] - b[lane]) * (a[lane] - b[lane]);
        }
    }
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(a, b)| (a - b) * (a - b)).sum();
    sums.iter().sum::<f32>() + rest
}

/// Finds the nearest center of each row.
fn assign(rows: &Matrix, centers: &Matrix, nearest: &mut [u32]) {
    let columns = UnitColumns::new(centers);
    let blocks = rows.as_slice().par_chunks(BLOCK_ROWS * rows.n_cols());
    nearest.par_chunks_mut(BLOCK_ROWS).zip(blocks).for_each(|(nearest, rows)| {
        simd::nearest_columns(&UnitRows::from_slice(rows, centers.n_cols()), &columns, nearest);
    });
}

/// For each cluster without rows one row far from its own center, the farthest first.
fn empty_clusters_rows(rows: &Matrix, centers: &Matrix, nearest: &[u32]) -> Vec<usize> {
    let mut occupied = vec![false; centers.n_rows()];
    nearest.iter().for_each(|&cluster| occupied[cluster as usize] = true);
    let n_empty = occupied.iter().filter(|&&occupied| !occupied).count();
    if n_empty == 0 {
        return Vec::new();
    }
    let distance =
        |row_idx: usize| squared_distance(rows.row(row_idx), centers.row(nearest[row_idx] as usize));
    let mut by_distance: Vec<usize> = (0..rows.n_rows()).collect();
    by_distance.sort_by_cached_key(|&row_idx| std::cmp::Reverse(distance(row_idx).to_bits()));
    by_distance.truncate(n_empty);
    by_distance
}

/// The mean of each cluster's rows; a cluster without any moves to the next of `replacements`.
fn means(rows: &Matrix, nearest: &[u32], centers: &Matrix, replacements: &[usize]) -> Matrix {
    let width = rows.n_cols();
    let (sums, counts) = nearest
        .par_chunks(BLOCK_ROWS * 8)
        .enumerate()
        .map(|(block_idx, block)| {
            let mut sums = vec![0.0f64; centers.n_rows() * width];
            let mut counts = vec![0usize; centers.n_rows()];
            for (offset, &cluster) in block.iter().enumerate() {
                let row = rows.row(block_idx * BLOCK_ROWS * 8 + offset);
                let sum = &mut sums[cluster as usize * width..][..width];
                sum.iter_mut().zip(row).for_each(|(sum, &value)| *sum += f64::from(value));
                counts[cluster as usize] += 1;
            }
            (sums, counts)
        })
        // Collected first, then added in the order of the blocks.
        .collect::<Vec<_>>()
        .into_iter()
        .reduce(|(mut sums, mut counts), (more_sums, more_counts)| {
            sums.iter_mut().zip(more_sums).for_each(|(sum, more)| *sum += more);
            counts.iter_mut().zip(more_counts).for_each(|(count, more)| *count += more);
            (sums, counts)
        })
        .unwrap_or_default();
    let mut replacements = replacements.iter();
    let mut moved = Matrix::new(width);
    for (cluster, &count) in counts.iter().enumerate() {
        if count > 0 {
            let mean = sums[cluster * width..][..width].iter().map(|sum| (sum / count as f64) as f32);
            moved.push_row(&mean.collect::<Vec<_>>());
        } else {
            let replacement = replacements.next().map_or(centers.row(cluster), |&row_idx| rows.row(row_idx));
            moved.push_row(replacement);
        }
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

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

    #[test]
    fn a_cluster_that_loses_its_rows_takes_a_far_one() {
        let rows = Matrix::from_vec(vec![0.0, 0.1, 0.2, 0.7], 1).unwrap();
        let centers = Matrix::from_vec(vec![0.1, -0.9], 1).unwrap();
        let mut nearest = [1; 4];
        assign(&rows, &centers, &mut nearest);
        assert_eq!(nearest, [0; 4]);
        let replacements = empty_clusters_rows(&rows, &centers, &nearest);
        assert_eq!(replacements, [3]);
        assert_eq!(means(&rows, &nearest, &centers, &replacements).row(1), [0.7]);
    }
}
