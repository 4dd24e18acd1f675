//! Training that goes on as rows arrive, in bounded memory.
//!
//! Of the rows seen so far only the support vectors are kept, and trained on again together with new rows
//! (Luo, Pronobis, Caputo and Jensfelt, "Incremental Learning for Place Recognition in Dynamic
//! Environments", IROS 2007; Pronobis, Jie and Caputo, "The More You Learn, the Less You Store", Image and
//! Vision Computing 2010). Support vectors that are nearly linear combinations of others in feature space
//! are dropped, their coefficients going to the others (Downs, Gates and Masters, "Exact Simplification of
//! Support Vector Solutions", JMLR 2001).
//!
//! Where the papers look for dependent vectors in any order, here the vector farthest from the span of
//! those chosen so far is chosen next, as in a Cholesky decomposition with pivots: a larger threshold then
//! keeps a part of what a smaller one keeps.

use super::{Config, DualSvm, KernelConfig, KernelFunction, KernelSvm, SvmError, check_shape, to_f32};
use roomsight_vision::matrix::Matrix;

/// The share of the largest k(x, x) below which a squared distance is rounding.
const ROUNDING: f64 = 1e-12;

/// An SVM that learns more rows without the earlier ones but its support vectors.
#[derive(Clone, Debug, PartialEq)]
pub struct IncrementalSvm {
    svm: KernelSvm,
    /// The class of each support vector.
    labels: Vec<usize>,
    config: KernelConfig,
}

impl IncrementalSvm {
    /// Trains on the first rows, as [`KernelSvm::train`]. A gamma taken from them stays.
    ///
    /// # Errors
    /// Those of [`KernelSvm::train`].
    pub fn train(
        rows: &Matrix,
        labels: &[usize],
        n_classes: usize,
        config: &KernelConfig,
    ) -> Result<Self, SvmError> {
        let (svm, support_idxs) = KernelSvm::train_and_locate(rows, labels, n_classes, config)?;
        let labels = support_idxs.into_iter().map(|row_idx| labels[row_idx]).collect();
        Self::from_parts(svm, labels, &config.machines)
    }

    /// An SVM to go on with. Support vector i is of class `labels[i]`, as [`IncrementalSvm::updated`] will
    /// number them: where it brings new classes, the old ones may have other numbers than before.
    ///
    /// # Errors
    /// More or fewer labels than support vectors.
    pub fn from_parts(svm: KernelSvm, labels: Vec<usize>, machines: &Config) -> Result<Self, SvmError> {
        check_shape("labels of support vectors", labels.len(), svm.support_vectors().n_rows())?;
        let config = KernelConfig { kernel: svm.kernel().into(), machines: machines.clone() };
        Ok(Self { svm, labels, config })
    }

    /// Trains on the support vectors and new rows, row i of class `labels[i]` < `n_classes`.
    ///
    /// # Errors
    /// Those of [`KernelSvm::train`]; rows of another width.
    pub fn updated(&self, rows: &Matrix, labels: &[usize], n_classes: usize) -> Result<Self, SvmError> {
        check_shape("features of a row", rows.n_cols(), self.svm.n_features())?;
        let mut all_rows = self.svm.support_vectors().clone();
        rows.rows().for_each(|row| all_rows.push_row(row));
        Self::train(&all_rows, &[&self.labels, labels].concat(), n_classes, &self.config)
    }

    /// Drops support vectors whose squared distance in feature space from the span of the others is at most
    /// `threshold` times the largest k(s, s) of a support vector s. With r that product, a decision value at x
    /// changes by at most sqrt(r k(x, x)) times the sum of the dropped coefficients of its machine; at
    /// threshold 0, but for rounding, not at all.
    ///
    /// A threshold near 1 may drop whole classes; [`IncrementalSvm::updated`] then needs new rows of them.
    ///
    /// # Errors
    /// A threshold that is negative, not finite, or so large that no support vector is left.
    pub fn reduced(&self, threshold: f64) -> Result<Self, SvmError> {
        let refused = SvmError::Threshold { value: threshold };
        if !(threshold >= 0.0 && threshold.is_finite()) {
            return Err(refused);
        }
        let (support_vectors, machines) = (self.svm.support_vectors(), self.svm.machines());
        let basis = Basis::choose(support_vectors, self.svm.kernel(), threshold);
        if basis.chosen.is_empty() {
            return Err(refused);
        }
        let mut kept = Matrix::new(support_vectors.n_cols());
        basis.chosen.iter().for_each(|&support_idx| kept.push_row(support_vectors.row(support_idx)));
        let mut coefficients = Matrix::new(basis.chosen.len());
        for of_machine in machines.coefficients().rows() {
            coefficients.push_row(&basis.projected(of_machine));
        }
        let rho = machines.rho().to_vec();
        let machines = DualSvm::from_parts(machines.scheme(), machines.n_classes(), coefficients, rho)?;
        let svm = KernelSvm::from_parts(self.svm.kernel(), kept, machines)?;
        let labels = basis.chosen.iter().map(|&support_idx| self.labels[support_idx]).collect();
        Ok(Self { svm, labels, config: self.config.clone() })
    }

    /// The SVM as it is now.
    pub fn svm(&self) -> &KernelSvm {
        &self.svm
    }

    /// The SVM as it is now, and the class of each of its support vectors.
    pub fn into_parts(self) -> (KernelSvm, Vec<usize>) {
        (self.svm, self.labels)
    }
}

/// Vectors that nearly span all of them in feature space.
struct Basis {
    /// In the order they were chosen.
    chosen: Vec<usize>,
    /// Column c of the Cholesky factor, for all vectors: their part along the direction that the c-th
    /// chosen one added.
    columns: Vec<Vec<f64>>,
}

impl Basis {
    fn choose(vectors: &Matrix, kernel: KernelFunction, threshold: f64) -> Self {
        let mut distances: Vec<f64> = vectors.rows().map(|row| kernel.exact_value(row, row)).collect();
        let limit = threshold.max(ROUNDING) * distances.iter().copied().fold(0.0, f64::max);
        let mut basis = Self { chosen: Vec::new(), columns: Vec::new() };
        // At most as many rounds as vectors: the distance of a chosen one is set to zero.
        while let Some((pivot_idx, &distance)) =
            distances.iter().enumerate().max_by(|left, right| left.1.total_cmp(right.1))
            && distance > limit
        {
            let pivot = vectors.row(pivot_idx);
            let mut column: Vec<f64> = vectors.rows().map(|row| kernel.exact_value(pivot, row)).collect();
            for earlier in &basis.columns {
                column.iter_mut().zip(earlier).for_each(|(value, part)| *value -= earlier[pivot_idx] * part);
            }
            let scale = 1.0 / distance.sqrt();
            for (value, distance) in column.iter_mut().zip(&mut distances) {
                *value *= scale;
                *distance -= *value * *value;
            }
            distances[pivot_idx] = 0.0;
            basis.chosen.push(pivot_idx);
            basis.columns.push(column);
        }
        basis
    }

    /// The coefficients of the chosen vectors that come nearest to what `coefficients` of all make up.
    ///
    /// With L the rows of the factor that belong to chosen vectors, and p the sum of coefficient times row
    /// over all vectors, these are the solution b of L'b = p.
    fn projected(&self, coefficients: &[f32]) -> Vec<f32> {
        let part = |column: &Vec<f64>| -> f64 {
            column.iter().zip(coefficients).map(|(part, &coefficient)| part * f64::from(coefficient)).sum()
        };
        let mut solution: Vec<f64> = self.columns.iter().map(part).collect();
        for idx in (0..solution.len()).rev() {
            let column = &self.columns[idx];
            let later = (idx + 1..solution.len()).map(|later| column[self.chosen[later]] * solution[later]);
            solution[idx] = (solution[idx] - later.sum::<f64>()) / column[self.chosen[idx]];
        }
        solution.into_iter().map(to_f32).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classify::svm::tests::{Set, bags, with_duplicates};
    use proptest::prelude::*;

    fn config(kernel: KernelFunction<Option<f64>>) -> KernelConfig {
        KernelConfig { kernel, ..KernelConfig::default() }
    }

    fn kernels() -> impl Strategy<Value = KernelFunction<Option<f64>>> {
        prop_oneof![
            Just(KernelFunction::Linear),
            Just(KernelFunction::Rbf { gamma: None }),
            Just(KernelFunction::ChiSquared { gamma: None }),
            Just(KernelFunction::HistogramIntersection),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        #[test]
        fn threshold_zero_keeps_decision_values(kernel in kernels(), seed in 0_u64..10_000, n_rows in 6_usize..80) {
            let Set { rows, labels, n_classes } = with_duplicates(bags(seed, n_rows, 3, 1.5));
            let full = IncrementalSvm::train(&rows, &labels, n_classes, &config(kernel)).unwrap();
            let reduced = full.reduced(0.0).unwrap();
            if kernel == KernelFunction::Linear {
                prop_assert!(reduced.svm().support_vectors().n_rows() <= rows.n_cols());
            }
            for row in rows.rows() {
                let expected = full.svm().decision_values(row);
                for (value, expected) in reduced.svm().decision_values(row).iter().zip(expected) {
                    prop_assert!((value - expected).abs() < 1e-3, "{} and {}", value, expected);
                }
            }
        }

        #[test]
        fn a_larger_threshold_keeps_a_part_of_what_a_smaller_one_keeps(
            kernel in kernels(), seed in 0_u64..10_000, smaller in 0.0_f64..0.035, more in 0.0_f64..0.035,
        ) {
            let Set { rows, labels, n_classes } = bags(seed, 60, 3, 1.5);
            let full = IncrementalSvm::train(&rows, &labels, n_classes, &config(kernel)).unwrap();
            let kept = |threshold| full.reduced(threshold).unwrap().svm().support_vectors().clone();
            let (small, large) = (kept(smaller), kept(smaller + more));
            prop_assert!(small.n_rows() <= full.svm().support_vectors().n_rows());
            prop_assert!(small.as_slice().starts_with(large.as_slice()));
        }
    }

    #[test]
    fn learning_in_parts_answers_as_learning_at_once() {
        let Set { rows, labels, n_classes } = bags(41, 150, 3, 0.5);
        let part = |range: std::ops::Range<usize>| {
            let numbers = rows.as_slice()[range.start * rows.n_cols()..range.end * rows.n_cols()].to_vec();
            (Matrix::from_vec(numbers, rows.n_cols()).unwrap(), &labels[range])
        };
        let (first, first_labels) = part(0..60);
        let mut svm =
            IncrementalSvm::train(&first, first_labels, n_classes, &KernelConfig::default()).unwrap();
        for range in [60..100, 100..150] {
            let (more, more_labels) = part(range);
            svm = svm.updated(&more, more_labels, n_classes).unwrap().reduced(1e-3).unwrap();
        }
        for (row, &label) in rows.rows().zip(&labels) {
            let values = svm.svm().decision_values(row);
            assert!((0..n_classes).all(|class| values[class] <= values[label]), "{values:?}, {label}");
        }
        assert!(svm.svm().support_vectors().n_rows() < 150);
    }

    #[test]
    fn a_new_class_may_come_between_the_old_ones() {
        let Set { rows, labels, n_classes } = bags(43, 90, 3, 0.5);
        let is_new = |idx: &usize| labels[*idx] == 1;
        let (later, earlier): (Vec<usize>, Vec<usize>) = (0..rows.n_rows()).partition(is_new);
        let part = |idxs: &[usize]| {
            let mut part = Matrix::new(rows.n_cols());
            idxs.iter().for_each(|&idx| part.push_row(rows.row(idx)));
            part
        };
        let two_classes: Vec<usize> = earlier.iter().map(|&idx| labels[idx] / 2).collect();
        let config = KernelConfig::default();
        let (svm, old_labels) =
            IncrementalSvm::train(&part(&earlier), &two_classes, 2, &config).unwrap().into_parts();
        let renumbered = old_labels.iter().map(|label| label * 2).collect();
        let svm = IncrementalSvm::from_parts(svm, renumbered, &config.machines).unwrap();
        let svm = svm.updated(&part(&later), &vec![1; later.len()], n_classes).unwrap();
        for (row, &label) in rows.rows().zip(&labels) {
            let values = svm.svm().decision_values(row);
            assert!((0..n_classes).all(|class| values[class] <= values[label]), "{values:?}, {label}");
        }
        let (svm, mut labels) = svm.into_parts();
        labels.pop();
        let cut = IncrementalSvm::from_parts(svm, labels, &config.machines);
        assert!(matches!(cut, Err(SvmError::WrongShape { .. })));
    }

    #[test]
    fn bad_thresholds_and_rows_are_refused() {
        let Set { rows, labels, n_classes } = bags(42, 30, 3, 1.0);
        let svm = IncrementalSvm::train(&rows, &labels, n_classes, &KernelConfig::default()).unwrap();
        for threshold in [-1.0, f64::NAN, f64::INFINITY, 1.1] {
            assert!(matches!(svm.reduced(threshold), Err(SvmError::Threshold { .. })));
        }
        assert!(matches!(svm.updated(&Matrix::new(5), &[], 3), Err(SvmError::WrongShape { .. })));
    }
}
