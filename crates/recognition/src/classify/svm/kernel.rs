//! Rows of a kernel matrix K over training rows x: K_ij = k(x_i, x_j).
//!
//! The solver sees rows only. A matrix that fits the memory budget is computed once and shared by
//! all machines; of a larger one the rows are computed when asked for, and the last used are kept.
//! Both ways give the same numbers, bit for bit. A matrix may also be given as a whole.

use super::{KernelFunction, SvmError};
use rayon::prelude::*;
use roomsight_vision::matrix::Matrix;
use std::borrow::Cow;
use std::ops::Deref;
use std::sync::{Arc, Mutex, PoisonError};

/// What one kernel matrix may take, in bytes: the whole of it up to 16,384 rows.
const MEMORY_BUDGET: usize = 1 << 30;

/// Rows computed side by side, so that each training row is read from memory once for all of them.
const BLOCK: usize = 16;

/// A kernel matrix (n x n, symmetric), of which rows can be read by several threads at once.
pub(super) struct Kernel<'a> {
    diagonal: Vec<f32>,
    storage: Storage<'a>,
}

enum Storage<'a> {
    Whole(Cow<'a, Matrix>),
    OnDemand { rows: Cow<'a, Matrix>, function: KernelFunction, cache: Mutex<Cache> },
}

/// One row of a kernel matrix.
pub(super) enum Row<'k> {
    /// A row of a matrix held as a whole.
    Borrowed(&'k [f32]),
    /// A row computed when asked for.
    Shared(Arc<[f32]>),
}

impl Deref for Row<'_> {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        match self {
            Self::Borrowed(row) => row,
            Self::Shared(row) => row,
        }
    }
}

impl<'a> Kernel<'a> {
    /// The kernel `function` over `rows`.
    ///
    /// # Errors
    /// A row whose kernel with itself is beyond `f32`.
    pub(super) fn new(rows: &'a Matrix, function: KernelFunction) -> Result<Self, SvmError> {
        let kernel = Self::with_budget(Cow::Borrowed(rows), function, MEMORY_BUDGET);
        // By Cauchy and Schwarz no product of two rows is above the largest on the diagonal.
        match kernel.diagonal.iter().position(|value| *value > f32::MAX / 4.0) {
            Some(row_idx) => Err(SvmError::TooLarge { row_idx }),
            None => Ok(kernel),
        }
    }

    /// A kernel matrix computed elsewhere: n x n, symmetric.
    pub(super) fn precomputed(gram: &'a Matrix) -> Self {
        let diagonal = gram.rows().enumerate().map(|(row_idx, row)| row[row_idx]).collect();
        Self { diagonal, storage: Storage::Whole(Cow::Borrowed(gram)) }
    }

    fn with_budget(rows: Cow<'a, Matrix>, function: KernelFunction, budget: usize) -> Self {
        let diagonal: Vec<f32> = rows.rows().map(|row| function.value(row, row)).collect();
        let n = diagonal.len();
        let row_bytes = n * size_of::<f32>();
        let storage = if n.saturating_mul(row_bytes) <= budget {
            Storage::Whole(Cow::Owned(symmetric(n, |i, j| function.value(rows.row(i), rows.row(j)))))
        } else {
            let cache = Mutex::new(Cache::new(n, (budget / row_bytes).max(2)));
            Storage::OnDemand { rows, function, cache }
        };
        Self { diagonal, storage }
    }

    /// The kernel over some of the rows.
    pub(super) fn subset(&self, row_idxs: &[usize]) -> Kernel<'static> {
        match &self.storage {
            Storage::Whole(gram) => Kernel {
                diagonal: row_idxs.iter().map(|&row_idx| self.diagonal[row_idx]).collect(),
                storage: Storage::Whole(Cow::Owned(gathered(row_idxs, row_idxs.len(), |row_idx, out| {
                    let row = gram.row(row_idx);
                    out.extend(row_idxs.iter().map(|&col_idx| row[col_idx]));
                }))),
            },
            Storage::OnDemand { rows, function, .. } => {
                let subset = gathered(row_idxs, rows.n_cols(), |row_idx, out| {
                    out.extend_from_slice(rows.row(row_idx));
                });
                // As many subsets are alive at once as there are threads.
                let budget = MEMORY_BUDGET / rayon::current_num_threads().max(1);
                Kernel::with_budget(Cow::Owned(subset), *function, budget)
            }
        }
    }

    /// K_ii for all i.
    pub(super) fn diagonal(&self) -> &[f32] {
        &self.diagonal
    }

    /// K_ij for all j, where i is `row_idx`.
    pub(super) fn row(&self, row_idx: usize) -> Row<'_> {
        match &self.storage {
            Storage::Whole(gram) => Row::Borrowed(gram.row(row_idx)),
            Storage::OnDemand { rows, function, cache } => {
                // A thread that panicked leaves the cache whole: every row in it is complete.
                let lock = || cache.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(row) = lock().get(row_idx) {
                    return Row::Shared(row);
                }
                let this = rows.row(row_idx);
                let row: Arc<[f32]> = rows.rows().map(|other| function.value(this, other)).collect();
                lock().insert(row_idx, Arc::clone(&row));
                Row::Shared(row)
            }
        }
    }
}

/// The symmetric n x n matrix of the values of each pair (i, j); each is computed once, by some thread.
pub(super) fn symmetric(n: usize, value: impl Fn(usize, usize) -> f32 + Sync) -> Matrix {
    let mut matrix = Matrix::zeros(n, n);
    let values = matrix.as_mut_slice();
    values.par_chunks_mut(BLOCK * n.max(1)).enumerate().for_each(|(block_idx, block)| {
        let first = block_idx * BLOCK;
        for col_idx in 0..n.min(first + BLOCK) {
            for (row_idx, row) in (first..).zip(block.chunks_exact_mut(n)) {
                if col_idx <= row_idx {
                    row[col_idx] = value(row_idx, col_idx);
                }
            }
        }
    });
    for row_idx in 0..n {
        for col_idx in row_idx + 1..n {
            values[row_idx * n + col_idx] = values[col_idx * n + row_idx];
        }
    }
    matrix
}

/// A matrix with one row for each of `row_idxs`, appended by `push`.
fn gathered(row_idxs: &[usize], n_cols: usize, push: impl Fn(usize, &mut Vec<f32>)) -> Matrix {
    let mut data = Vec::with_capacity(row_idxs.len() * n_cols);
    row_idxs.iter().for_each(|&row_idx| push(row_idx, &mut data));
    Matrix::from_vec(data, n_cols).unwrap_or_default()
}

/// The most recently used rows.
struct Cache {
    slots: Vec<Option<Slot>>,
    capacity: usize,
    n_rows: usize,
    now: u64,
}

struct Slot {
    row: Arc<[f32]>,
    last_used: u64,
}

impl Cache {
    fn new(n: usize, capacity: usize) -> Self {
        Self { slots: (0..n).map(|_| None).collect(), capacity, n_rows: 0, now: 0 }
    }

    fn get(&mut self, row_idx: usize) -> Option<Arc<[f32]>> {
        self.now += 1;
        let slot = self.slots[row_idx].as_mut()?;
        slot.last_used = self.now;
        Some(Arc::clone(&slot.row))
    }

    fn insert(&mut self, row_idx: usize, row: Arc<[f32]>) {
        if self.slots[row_idx].is_none() {
            // Looking through all slots is nothing beside the row that was just computed.
            if self.n_rows == self.capacity
                && let Some(oldest) = self
                    .slots
                    .iter_mut()
                    .filter(|slot| slot.is_some())
                    .min_by_key(|slot| slot.as_ref().map(|slot| slot.last_used))
            {
                *oldest = None;
                self.n_rows -= 1;
            }
            self.n_rows += 1;
        }
        self.slots[row_idx] = Some(Slot { row, last_used: self.now });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rows(n_cols: usize) -> impl Strategy<Value = Matrix> {
        (1_usize..40).prop_flat_map(move |n_rows| {
            proptest::collection::vec(-2.0_f32..2.0, n_rows * n_cols)
                .prop_map(move |data| Matrix::from_vec(data, n_cols).unwrap())
        })
    }

    fn kernel_functions() -> impl Strategy<Value = KernelFunction> {
        prop_oneof![
            Just(KernelFunction::Linear),
            Just(KernelFunction::Rbf { gamma: 0.3 }),
            Just(KernelFunction::Sigmoid { gamma: 0.1, coef0: -0.2 }),
            Just(KernelFunction::ChiSquared { gamma: 0.7 }),
            Just(KernelFunction::HistogramIntersection),
        ]
    }

    proptest! {
        #[test]
        fn rows_are_values_of_the_kernel_function(rows in rows(11), function in kernel_functions()) {
            let kernel = Kernel::new(&rows, function).unwrap();
            for i in 0..rows.n_rows() {
                let expected: Vec<f32> =
                    rows.rows().map(|other| function.value(rows.row(i), other)).collect();
                prop_assert_eq!(&*kernel.row(i), &expected[..]);
                prop_assert_eq!(kernel.diagonal()[i], expected[i]);
            }
        }

        #[test]
        fn rows_on_demand_equal_those_of_the_whole_matrix(
            rows in rows(19),
            function in kernel_functions(),
            asked in proptest::collection::vec(0_usize..40, 1..60),
        ) {
            let n = rows.n_rows();
            let whole = Kernel::new(&rows, function).unwrap();
            for budget in [0, 3 * 4 * n] {
                let on_demand = Kernel::with_budget(Cow::Borrowed(&rows), function, budget);
                for row_idx in asked.iter().map(|row_idx| row_idx % n) {
                    prop_assert_eq!(&*on_demand.row(row_idx), &*whole.row(row_idx));
                }
                if let Storage::OnDemand { cache, .. } = &on_demand.storage {
                    let cache = cache.lock().unwrap();
                    prop_assert!(cache.slots.iter().flatten().count() <= 3);
                }
            }
        }

        #[test]
        fn a_subset_holds_the_chosen_rows_and_columns(
            rows in rows(5),
            function in kernel_functions(),
            chosen in proptest::collection::vec(0_usize..40, 1..20),
        ) {
            let n = rows.n_rows();
            let chosen: Vec<usize> = chosen.into_iter().map(|row_idx| row_idx % n).collect();
            let whole = Kernel::new(&rows, function).unwrap();
            for kernel in [&whole, &Kernel::with_budget(Cow::Borrowed(&rows), function, 0)] {
                let subset = kernel.subset(&chosen);
                for (i, &row_idx) in chosen.iter().enumerate() {
                    let expected: Vec<f32> = chosen.iter().map(|&col_idx| whole.row(row_idx)[col_idx]).collect();
                    prop_assert_eq!(&*subset.row(i), &expected[..]);
                    prop_assert_eq!(subset.diagonal()[i], whole.diagonal()[row_idx]);
                }
            }
        }
    }

    #[test]
    fn the_least_recently_used_row_makes_room() {
        let mut cache = Cache::new(4, 2);
        for row_idx in [0, 1] {
            cache.insert(row_idx, Arc::from([row_idx as f32]));
        }
        assert!(cache.get(0).is_some());
        cache.insert(2, Arc::from([2.0]));
        assert_eq!(cache.get(1), None);
        assert_eq!(cache.get(0).as_deref(), Some(&[0.0][..]));
        assert_eq!(cache.get(2).as_deref(), Some(&[2.0][..]));
    }
}
