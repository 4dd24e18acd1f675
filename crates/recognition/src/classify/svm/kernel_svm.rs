//! SVMs with any kernel function over rows of numbers.

use super::kernel::Kernel;
use super::{Config, DualSvm, KernelFunction, SvmError, check_finite_rows, check_rows, check_shape};
use roomsight_vision::matrix::Matrix;
use serde::{Deserialize, Serialize};

/// What to train.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct KernelConfig {
    /// The kernel; a gamma left out is taken from the training rows.
    pub kernel: KernelFunction<Option<f64>>,
    /// How the machines are trained.
    pub machines: Config,
}

impl Default for KernelConfig {
    fn default() -> Self {
        Self { kernel: KernelFunction::Rbf { gamma: None }, machines: Config::default() }
    }
}

impl KernelConfig {
    /// That the numbers are in range.
    pub fn check(&self) -> Result<(), SvmError> {
        self.kernel.check_given()?;
        self.machines.check()
    }
}

/// A trained multi-class SVM with a kernel function.
#[derive(Clone, Debug, PartialEq)]
pub struct KernelSvm {
    kernel: KernelFunction,
    support_vectors: Matrix,
    machines: DualSvm,
}

impl KernelSvm {
    /// Trains on `rows` (n x n_features), where row i is of class `labels[i]` < `n_classes`.
    ///
    /// The result depends on the arguments only, not on the number of threads. It takes as much memory as
    /// [`super::LinearSvm::train`].
    ///
    /// # Errors
    /// Those of [`super::LinearSvm::train`] and of [`KernelFunction::resolve`].
    pub fn train(
        rows: &Matrix,
        labels: &[usize],
        n_classes: usize,
        config: &KernelConfig,
    ) -> Result<Self, SvmError> {
        Self::train_and_locate(rows, labels, n_classes, config).map(|(svm, _)| svm)
    }

    /// As [`KernelSvm::train`]; also gives the rows that became support vectors, ascending.
    pub(super) fn train_and_locate(
        rows: &Matrix,
        labels: &[usize],
        n_classes: usize,
        config: &KernelConfig,
    ) -> Result<(Self, Vec<usize>), SvmError> {
        check_rows(rows, labels, n_classes)?;
        config.check()?;
        let function = config.kernel.resolve(rows)?;
        let kernel = Kernel::new(rows, function)?;
        let (machines, support_idxs) = DualSvm::train_over(&kernel, labels, n_classes, &config.machines)?;
        let mut support_vectors = Matrix::new(rows.n_cols());
        support_idxs.iter().for_each(|&row_idx| support_vectors.push_row(rows.row(row_idx)));
        Ok((Self { kernel: function, support_vectors, machines }, support_idxs))
    }

    /// Puts an SVM together from its parts, as the methods of the same names gave them.
    ///
    /// # Errors
    /// Support vectors that are more or fewer than those of the machines, or that the kernel is not made
    /// for; parameters of the kernel that are out of range.
    pub fn from_parts(
        kernel: KernelFunction,
        support_vectors: Matrix,
        machines: DualSvm,
    ) -> Result<Self, SvmError> {
        check_shape("support vectors", support_vectors.n_rows(), machines.n_support_vectors())?;
        check_finite_rows(&support_vectors)?;
        kernel.check(&support_vectors)?;
        Ok(Self { kernel, support_vectors, machines })
    }

    /// One decision value a machine, finite for finite features, positive for the machine's positive
    /// class. Panics when `row` has not [`KernelSvm::n_features`] numbers.
    pub fn decision_values(&self, row: &[f32]) -> Vec<f32> {
        assert_eq!(row.len(), self.n_features(), "a row of another width");
        let kernel_values = self.support_vectors.rows().map(|support| self.kernel.value(support, row));
        self.machines.decision_values(&Vec::from_iter(kernel_values))
    }

    /// The number of features of a row.
    pub fn n_features(&self) -> usize {
        self.support_vectors.n_cols()
    }

    /// The kernel, its gamma given.
    pub fn kernel(&self) -> KernelFunction {
        self.kernel
    }

    /// The support vectors of all machines: n_support_vectors x n_features.
    pub fn support_vectors(&self) -> &Matrix {
        &self.support_vectors
    }

    /// The machines: the coefficients of the support vectors, and the thresholds.
    pub fn machines(&self) -> &DualSvm {
        &self.machines
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::classify::svm::Scheme;
    use crate::classify::svm::tests::{Set, bags, libsvm_decision_values, libsvm_nodes, with_duplicates};
    use crate::labeled::LabeledError;
    use libsvm_rs::{KernelType, SvmModel, SvmNode, SvmParameter, SvmProblem};

    const KERNELS: [KernelFunction; 5] = [
        KernelFunction::Linear,
        KernelFunction::Rbf { gamma: 2.0 },
        KernelFunction::Sigmoid { gamma: 0.5, coef0: -0.3 },
        KernelFunction::ChiSquared { gamma: 1.5 },
        KernelFunction::HistogramIntersection,
    ];

    fn config(kernel: KernelFunction, scheme: Scheme, c: f64) -> KernelConfig {
        KernelConfig {
            kernel: kernel.into(),
            machines: Config { scheme, c, tolerance: 1e-6, ..Config::default() },
        }
    }

    /// A row as LIBSVM's port takes it: as it is for LIBSVM's own kernels; its kernel values with all
    /// training rows for others.
    fn nodes(kernel: KernelFunction, training_rows: &Matrix, row_idx: usize) -> Vec<SvmNode> {
        let row = training_rows.row(row_idx);
        match kernel {
            KernelFunction::ChiSquared { .. } | KernelFunction::HistogramIntersection => {
                let number = SvmNode { index: 0, value: (row_idx + 1) as f64 };
                let values = training_rows.rows().map(|other| f64::from(kernel.value(row, other)));
                let values = (1..).zip(values).map(|(index, value)| SvmNode { index, value });
                std::iter::once(number).chain(values).collect()
            }
            _ => libsvm_nodes(row),
        }
    }

    fn libsvm(kernel: KernelFunction, rows: &Matrix, labels: &[f64], c: f64) -> SvmModel {
        libsvm_rs::set_quiet(true);
        let instances = (0..rows.n_rows()).map(|row_idx| nodes(kernel, rows, row_idx)).collect();
        let problem = SvmProblem { labels: labels.to_vec(), instances };
        let (kernel_type, gamma, coef0) = match kernel {
            KernelFunction::Linear => (KernelType::Linear, 1.0, 0.0),
            KernelFunction::Rbf { gamma } => (KernelType::Rbf, gamma, 0.0),
            KernelFunction::Sigmoid { gamma, coef0 } => (KernelType::Sigmoid, gamma, coef0),
            _ => (KernelType::Precomputed, 1.0, 0.0),
        };
        let parameter = SvmParameter { kernel_type, gamma, coef0, c, eps: 1e-6, ..SvmParameter::default() };
        libsvm_rs::train::svm_train(&problem, &parameter)
    }

    fn assert_near(value: f32, expected: f64, kernel: KernelFunction) {
        assert!((f64::from(value) - expected).abs() < 1e-3, "{kernel:?}: {value} and {expected}");
    }

    #[test]
    fn one_vs_one_decision_values_equal_those_of_libsvm() {
        for kernel in KERNELS {
            for (seed, c) in [(21, 0.5), (22, 20.0)] {
                let Set { rows, labels, n_classes } = with_duplicates(bags(seed, 90, 4, 1.5));
                let svm = KernelSvm::train(&rows, &labels, n_classes, &config(kernel, Scheme::OneVsOne, c))
                    .unwrap();
                let targets: Vec<f64> = labels.iter().map(|&label| label as f64).collect();
                let model = libsvm(kernel, &rows, &targets, c);
                assert_eq!(model.label, [0, 1, 2, 3]);
                for (row_idx, row) in rows.rows().enumerate() {
                    let expected = libsvm_decision_values(&model, &nodes(kernel, &rows, row_idx));
                    for (value, expected) in svm.decision_values(row).into_iter().zip(expected) {
                        assert_near(value, expected, kernel);
                    }
                }
            }
        }
    }

    #[test]
    fn one_vs_all_decision_values_equal_those_of_libsvm() {
        for kernel in KERNELS {
            let Set { rows, labels, n_classes } = with_duplicates(bags(23, 90, 3, 1.5));
            let svm =
                KernelSvm::train(&rows, &labels, n_classes, &config(kernel, Scheme::OneVsAll, 5.0)).unwrap();
            for class_idx in 0..n_classes {
                let targets: Vec<f64> =
                    labels.iter().map(|&label| if label == class_idx { 1.0 } else { -1.0 }).collect();
                let model = libsvm(kernel, &rows, &targets, 5.0);
                let sign = f64::from(model.label[0]);
                for (row_idx, row) in rows.rows().enumerate() {
                    let expected = sign * libsvm_decision_values(&model, &nodes(kernel, &rows, row_idx))[0];
                    assert_near(svm.decision_values(row)[class_idx], expected, kernel);
                }
            }
        }
    }

    #[test]
    fn the_linear_kernel_gives_the_decision_values_of_the_collapsed_machine() {
        let Set { rows, labels, n_classes } = bags(24, 80, 4, 1.5);
        let config = config(KernelFunction::Linear, Scheme::OneVsAll, 10.0);
        let svm = KernelSvm::train(&rows, &labels, n_classes, &config).unwrap();
        let linear =
            crate::classify::svm::LinearSvm::train(&rows, &labels, n_classes, &config.machines).unwrap();
        for row in rows.rows() {
            for (value, expected) in svm.decision_values(row).into_iter().zip(linear.decision_values(row)) {
                assert_near(value, f64::from(expected), KernelFunction::Linear);
            }
        }
    }

    #[test]
    fn gamma_left_out_is_taken_from_the_rows() {
        let rows = Matrix::from_vec(vec![0.0, 2.0, 2.0, 0.0], 2).unwrap();
        let rbf = KernelFunction::Rbf { gamma: None }.resolve(&rows).unwrap();
        assert_eq!(rbf, KernelFunction::Rbf { gamma: 0.5 }, "two features of variance 1");
        let chi_squared = KernelFunction::ChiSquared { gamma: None }.resolve(&rows).unwrap();
        assert_eq!(chi_squared, KernelFunction::ChiSquared { gamma: 0.5 }, "one pair at distance 2");
        let equal = Matrix::from_vec(vec![1.0; 8], 4).unwrap();
        for kernel in [KernelFunction::Rbf { gamma: None }, KernelFunction::ChiSquared { gamma: None }] {
            let value = kernel.resolve(&equal).unwrap().value(equal.row(0), &[0.0; 4]);
            assert!(value > 0.0 && value < 1.0, "{kernel:?}: {value}");
        }
    }

    #[test]
    fn bad_parameters_and_rows_are_refused_before_work_starts() {
        let Set { rows, labels, n_classes } = bags(25, 12, 3, 1.0);
        let train = |rows: &Matrix, kernel| {
            let config = KernelConfig { kernel, ..KernelConfig::default() };
            KernelSvm::train(rows, &labels, n_classes, &config).unwrap_err()
        };
        for gamma in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            for kernel in [
                KernelFunction::Rbf { gamma: Some(gamma) },
                KernelFunction::Sigmoid { gamma: Some(gamma), coef0: 0.0 },
                KernelFunction::ChiSquared { gamma: Some(gamma) },
            ] {
                assert!(matches!(train(&rows, kernel), SvmError::NotPositive { name: "gamma", .. }));
            }
        }
        let sigmoid = KernelFunction::Sigmoid { gamma: None, coef0: f64::INFINITY };
        assert_eq!(train(&rows, sigmoid), SvmError::Coef0 { value: f64::INFINITY });
        let mut negative = rows.clone();
        negative.row_mut(5)[0] = -0.1;
        for kernel in [KernelFunction::ChiSquared { gamma: None }, KernelFunction::HistogramIntersection] {
            assert_eq!(train(&negative, kernel), SvmError::Negative { row_idx: 5 });
        }
    }

    #[test]
    fn parts_make_the_same_machine_and_damaged_ones_are_refused() {
        let Set { rows, labels, n_classes } = bags(26, 30, 3, 1.0);
        let svm = KernelSvm::train(&rows, &labels, n_classes, &KernelConfig::default()).unwrap();
        let from = |kernel, support_vectors: &Matrix| {
            KernelSvm::from_parts(kernel, support_vectors.clone(), svm.machines().clone())
        };
        assert_eq!(from(svm.kernel(), svm.support_vectors()).unwrap(), svm);
        let bad_kernel = KernelFunction::Rbf { gamma: f64::NAN };
        assert!(matches!(from(bad_kernel, svm.support_vectors()), Err(SvmError::NotPositive { .. })));
        assert!(matches!(from(svm.kernel(), &Matrix::new(13)), Err(SvmError::WrongShape { .. })));
        let mut damaged = svm.support_vectors().clone();
        damaged.row_mut(2)[1] = f32::NAN;
        assert_eq!(
            from(svm.kernel(), &damaged).unwrap_err(),
            SvmError::Labeled(LabeledError::NotFinite { row_idx: 2 })
        );
    }

    #[test]
    fn configuration_is_read_with_and_without_gamma() {
        let read = |text| serde_json::from_str::<KernelConfig>(text);
        assert_eq!(read("{}").unwrap(), KernelConfig::default());
        assert_eq!(read(r#"{"kernel": {"kind": "rbf"}}"#).unwrap(), KernelConfig::default());
        let sigmoid = read(r#"{"kernel": {"kind": "sigmoid", "gamma": 0.5}, "machines": {"c": 3}}"#).unwrap();
        assert_eq!(sigmoid.kernel, KernelFunction::Sigmoid { gamma: Some(0.5), coef0: 0.0 });
        assert_eq!(sigmoid.machines.c, 3.0);
        assert!(read(r#"{"kernel": {"kind": "rbf", "degree": 3}}"#).is_err());
        assert!(serde_json::from_str::<KernelFunction>(r#"{"kind": "rbf"}"#).is_err());
    }
}
