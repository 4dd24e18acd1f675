//! The match kernel: how alike two frames are by their local descriptors, without a vocabulary.
//!
//! Wallraven, Caputo and Graf, "Recognition with Local Features: the Kernel Recipe", ICCV 2003, as Ullah et
//! al., "Towards Robust Place Recognition for Robot Localization", ICRA 2008, use it for places:
//!
//! ```text
//! K(A, B) = 1/2 (mean over a in A of max over b in B of k(a, b) + mean over b in B of max over a in A of k(a, b))
//! ```
//!
//! Every inner kernel k here grows with the product of its descriptors, so that the maximum is where the
//! product is largest. Products are computed in fixed point, exactly the same on every CPU.

use super::kernel::symmetric;
use super::{Config, DualSvm, SvmError, check_n_classes, check_positive, check_shape};
use roomsight_vision::matrix::Matrix;
use roomsight_vision::simd::{ONE_PRODUCT, UnitColumns, UnitRows, largest_products};
use serde::{Deserialize, Serialize};

/// The kernel k of two descriptors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum InnerKernel {
    /// a . b
    Linear,
    /// exp(-2 gamma (1 - a . b)), which is exp(-gamma |a - b|^2) for descriptors of unit length.
    Rbf {
        /// How fast it falls; positive.
        gamma: f64,
    },
    /// exp(-gamma (1 - r)), where r is the correlation coefficient of the numbers of a and b: the kernel of
    /// Wallraven et al.
    Correlation {
        /// How fast it falls; positive.
        gamma: f64,
    },
}

impl Default for InnerKernel {
    /// A larger gamma does a little better where frames lie close together, but takes frames that lie apart for
    /// strangers (docs/RESULTS.md).
    fn default() -> Self {
        Self::Rbf { gamma: 4.0 }
    }
}

impl InnerKernel {
    /// That gamma is in range.
    fn check(self) -> Result<(), SvmError> {
        match self {
            Self::Linear => Ok(()),
            Self::Rbf { gamma } | Self::Correlation { gamma } => check_positive("gamma", gamma),
        }
    }

    /// The kernel of two descriptors of this product.
    fn of_product(self, product: i32) -> f64 {
        let product = f64::from(product) / f64::from(ONE_PRODUCT);
        match self {
            Self::Linear => product,
            Self::Rbf { gamma } => (-2.0 * gamma * (1.0 - product)).exp(),
            Self::Correlation { gamma } => (-gamma * (1.0 - product)).exp(),
        }
    }

    /// The mean kernel of these products, summed in order.
    fn mean(self, products: &[i32]) -> f64 {
        products.iter().map(|&product| self.of_product(product)).sum::<f64>() / products.len() as f64
    }
}

/// The local descriptors of a frame, made ready for comparing.
#[derive(Clone, Debug)]
pub struct DescriptorSet {
    rows: UnitRows,
    columns: UnitColumns,
}

impl DescriptorSet {
    /// The rows of `descriptors`, none of which is longer than 1, for `inner`. Any number of rows, also none.
    pub fn new(descriptors: &Matrix, inner: InnerKernel) -> Self {
        match inner {
            InnerKernel::Correlation { .. } => Self::of(&centered(descriptors)),
            InnerKernel::Linear | InnerKernel::Rbf { .. } => Self::of(descriptors),
        }
    }

    fn of(descriptors: &Matrix) -> Self {
        Self { rows: UnitRows::new(descriptors), columns: UnitColumns::new(descriptors) }
    }

    /// The match kernel of two sets that were made for `inner`, of descriptors of the same length. The same
    /// with the sets exchanged. 0 when either is empty.
    pub fn match_kernel(&self, other: &Self, inner: InnerKernel) -> f32 {
        let mut of_rows = vec![0; self.rows.n_rows()];
        let mut of_columns = vec![0; other.rows.n_rows()];
        if of_rows.is_empty() || of_columns.is_empty() {
            return 0.0;
        }
        largest_products(&self.rows, &other.columns, &mut of_rows, &mut of_columns);
        (0.5 * (inner.mean(&of_rows) + inner.mean(&of_columns))) as f32
    }
}

/// Each row less its mean, at unit length; a row of equal numbers becomes zeros.
fn centered(descriptors: &Matrix) -> Matrix {
    let mut centered = descriptors.clone();
    for row_idx in 0..centered.n_rows() {
        let row = centered.row_mut(row_idx);
        let mean = row.iter().sum::<f32>() / row.len() as f32;
        row.iter_mut().for_each(|value| *value -= mean);
        let length = row.iter().map(|value| value * value).sum::<f32>().sqrt();
        // Below this only rounding is left of equal numbers.
        let scale = if length > 1e-6 { 1.0 / length } else { 0.0 };
        row.iter_mut().for_each(|value| *value *= scale);
    }
    centered
}

/// The match kernel of all pairs of `sets`: n x n, symmetric, for [`DualSvm::train`]. Takes 4 n^2 bytes; the
/// same for any number of threads.
pub fn match_gram(sets: &[DescriptorSet], inner: InnerKernel) -> Matrix {
    symmetric(sets.len(), |i, j| sets[i].match_kernel(&sets[j], inner))
}

/// What to train.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MatchConfig {
    /// The kernel of two descriptors.
    pub inner: InnerKernel,
    /// How the machines are trained.
    pub machines: Config,
}

impl Default for MatchConfig {
    /// Frames are all alike to this kernel but for a little: a C of 1 leaves most machines at the commonest room.
    fn default() -> Self {
        Self { inner: InnerKernel::default(), machines: Config { c: 10.0, ..Config::default() } }
    }
}

impl MatchConfig {
    /// That the numbers are in range.
    pub fn check(&self) -> Result<(), SvmError> {
        self.inner.check()?;
        self.machines.check()
    }
}

/// A trained multi-class SVM with the match kernel. It keeps the descriptors of its support frames.
#[derive(Clone, Debug)]
pub struct MatchSvm {
    inner: InnerKernel,
    support_frames: Vec<Matrix>,
    sets: Vec<DescriptorSet>,
    machines: DualSvm,
}

impl MatchSvm {
    /// The match kernel of all pairs of `frames`, the descriptors of each (n_keypoints x n_dimensions, at most of
    /// unit length): n x n, for [`DualSvm::train`] on all of them or on parts.
    ///
    /// # Errors
    /// Numbers of the configuration that are out of range, descriptors of different lengths.
    pub fn gram(frames: &[&Matrix], config: &MatchConfig) -> Result<Matrix, SvmError> {
        // Checked before the kernel matrix, which may take long.
        config.check()?;
        check_widths(frames.iter().copied())?;
        let sets: Vec<DescriptorSet> =
            frames.iter().map(|descriptors| DescriptorSet::new(descriptors, config.inner)).collect();
        Ok(match_gram(&sets, config.inner))
    }

    /// Trains on `frames`, as [`MatchSvm::gram`] takes them, where frame i is of class `labels[i]` <
    /// `n_classes`.
    ///
    /// # Errors
    /// Those of [`DualSvm::train`] and of [`MatchSvm::gram`].
    pub fn train(
        frames: &[&Matrix],
        labels: &[usize],
        n_classes: usize,
        config: &MatchConfig,
    ) -> Result<Self, SvmError> {
        check_n_classes(n_classes)?;
        let gram = Self::gram(frames, config)?;
        Self::train_over(frames, &gram, labels, n_classes, config).map(|(svm, _)| svm)
    }

    /// As [`MatchSvm::train`], on frames whose [`MatchSvm::gram`] is known; with the indices of the support frames, whose
    /// kernel values [`MatchSvm::machines`] take.
    ///
    /// # Errors
    /// Those of [`DualSvm::train`]; a matrix of other frames.
    pub fn train_over(
        frames: &[&Matrix],
        gram: &Matrix,
        labels: &[usize],
        n_classes: usize,
        config: &MatchConfig,
    ) -> Result<(Self, Vec<usize>), SvmError> {
        check_shape("rows of the kernel matrix", gram.n_rows(), frames.len())?;
        let (machines, support_idxs) = DualSvm::train(gram, labels, n_classes, &config.machines)?;
        let support_frames = support_idxs.iter().map(|&frame_idx| frames[frame_idx].clone()).collect();
        Ok((Self::from_parts(config.inner, support_frames, machines)?, support_idxs))
    }

    /// Puts an SVM together from its parts, as the methods of the same names gave them.
    ///
    /// # Errors
    /// Frames that are more or fewer than the support vectors of the machines, descriptors of different
    /// lengths, a gamma that is not positive and finite.
    pub fn from_parts(
        inner: InnerKernel,
        support_frames: Vec<Matrix>,
        machines: DualSvm,
    ) -> Result<Self, SvmError> {
        inner.check()?;
        check_shape("support frames", support_frames.len(), machines.n_support_vectors())?;
        check_widths(&support_frames)?;
        let sets = support_frames.iter().map(|descriptors| DescriptorSet::new(descriptors, inner)).collect();
        Ok(Self { inner, support_frames, sets, machines })
    }

    /// One decision value a machine for a frame of these descriptors, none of which is longer than 1.
    /// Panics when they have not as many dimensions as those of the support frames.
    pub fn decision_values(&self, descriptors: &Matrix) -> Vec<f32> {
        let set = DescriptorSet::new(descriptors, self.inner);
        let kernel_values = self.sets.iter().map(|support| support.match_kernel(&set, self.inner));
        self.machines.decision_values(&Vec::from_iter(kernel_values))
    }

    /// The kernel of two descriptors.
    pub fn inner(&self) -> InnerKernel {
        self.inner
    }

    /// The descriptors of each support frame.
    pub fn support_frames(&self) -> &[Matrix] {
        &self.support_frames
    }

    /// The machines: the coefficients of the support frames, and the thresholds.
    pub fn machines(&self) -> &DualSvm {
        &self.machines
    }
}

/// That all descriptors are of the same length.
fn check_widths<'a>(frames: impl IntoIterator<Item = &'a Matrix>) -> Result<(), SvmError> {
    let mut widths = frames.into_iter().map(Matrix::n_cols);
    let Some(expected) = widths.next() else { return Ok(()) };
    widths.try_for_each(|width| check_shape("dimensions of a descriptor", width, expected))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::labeled::LabeledError;
    use proptest::prelude::*;

    const INNERS: [InnerKernel; 3] =
        [InnerKernel::Linear, InnerKernel::Rbf { gamma: 1.5 }, InnerKernel::Correlation { gamma: 2.0 }];

    /// Up to `max_rows` rows of unit length.
    fn descriptors(max_rows: usize, n_cols: usize) -> impl Strategy<Value = Matrix> {
        prop::collection::vec(prop::collection::vec(0.01_f32..1.0, n_cols), 0..=max_rows).prop_map(
            move |rows| {
                let mut matrix = Matrix::new(n_cols);
                for mut row in rows {
                    let length = row.iter().map(|value| value * value).sum::<f32>().sqrt();
                    row.iter_mut().for_each(|value| *value /= length);
                    matrix.push_row(&row);
                }
                matrix
            },
        )
    }

    fn naive_inner(inner: InnerKernel, a: &[f32], b: &[f32]) -> f64 {
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let wide = |row: &[f32]| row.iter().map(|&value| f64::from(value)).collect::<Vec<f64>>();
        let (a, b) = (wide(a), wide(b));
        match inner {
            InnerKernel::Linear => product(&a, &b),
            InnerKernel::Rbf { gamma } => {
                (-gamma * a.iter().zip(&b).map(|(x, y)| (x - y).powi(2)).sum::<f64>()).exp()
            }
            InnerKernel::Correlation { gamma } => {
                let centered = |row: &[f64]| {
                    let mean = row.iter().sum::<f64>() / row.len() as f64;
                    row.iter().map(|value| value - mean).collect::<Vec<f64>>()
                };
                let (a, b) = (centered(&a), centered(&b));
                (-gamma * (1.0 - product(&a, &b) / (product(&a, &a) * product(&b, &b)).sqrt())).exp()
            }
        }
    }

    fn naive(inner: InnerKernel, left: &Matrix, right: &Matrix) -> f64 {
        let one_way = |from: &Matrix, to: &Matrix| {
            let best = |a| to.rows().map(|b| naive_inner(inner, a, b)).fold(f64::NEG_INFINITY, f64::max);
            from.rows().map(best).sum::<f64>() / from.n_rows() as f64
        };
        if left.n_rows() == 0 || right.n_rows() == 0 {
            return 0.0;
        }
        0.5 * (one_way(left, right) + one_way(right, left))
    }

    proptest! {
        #[test]
        fn the_match_kernel_is_the_naive_one(left in descriptors(9, 13), right in descriptors(40, 13)) {
            for inner in INNERS {
                let sets = [&left, &right].map(|descriptors| DescriptorSet::new(descriptors, inner));
                let expected = naive(inner, &left, &right);
                let exchanged = sets[1].match_kernel(&sets[0], inner);
                prop_assert_eq!(sets[0].match_kernel(&sets[1], inner).to_bits(), exchanged.to_bits());
                for value in [sets[0].match_kernel(&sets[1], inner), sets[1].match_kernel(&sets[0], inner)] {
                    let error = (f64::from(value) - expected).abs();
                    prop_assert!(error < 2e-3, "{:?}: {} and {}", inner, value, expected);
                }
            }
        }
    }

    /// Frames of 3 to 7 descriptors; those of each class lie round directions of its own.
    fn frames(n_frames: usize) -> (Vec<Matrix>, Vec<usize>) {
        let labels: Vec<usize> = (0..n_frames).map(|frame_idx| frame_idx % 3).collect();
        let frame = |(frame_idx, &label): (usize, &usize)| {
            let mut matrix = Matrix::new(6);
            for row_idx in 0..3 + frame_idx % 5 {
                let mut row = [0.1_f32; 6];
                row[2 * label + row_idx % 2] = 0.9;
                row[(frame_idx + row_idx) % 6] += 0.2;
                let length = row.iter().map(|value| value * value).sum::<f32>().sqrt();
                matrix.push_row(&row.map(|value| value / length));
            }
            matrix
        };
        (labels.iter().enumerate().map(frame).collect(), labels)
    }

    #[test]
    fn a_trained_machine_tells_its_frames_apart() {
        let (frames, labels) = frames(24);
        let frames: Vec<&Matrix> = frames.iter().collect();
        for inner in INNERS {
            let config = MatchConfig { inner, machines: Config { c: 100.0, ..Config::default() } };
            let svm = MatchSvm::train(&frames, &labels, 3, &config).unwrap();
            for (frame, &label) in frames.iter().zip(&labels) {
                for (class_idx, value) in svm.decision_values(frame).into_iter().enumerate() {
                    assert_eq!(value > 0.0, class_idx == label, "{inner:?}");
                }
            }
            let parts = MatchSvm::from_parts(inner, svm.support_frames().to_vec(), svm.machines().clone());
            assert_eq!(parts.unwrap().decision_values(frames[5]), svm.decision_values(frames[5]));
        }
    }

    #[test]
    fn a_frame_without_keypoints_is_answered_by_the_thresholds() {
        let (mut frames, labels) = frames(12);
        frames[3] = Matrix::new(6);
        let frames: Vec<&Matrix> = frames.iter().collect();
        let svm = MatchSvm::train(&frames, &labels, 3, &MatchConfig::default()).unwrap();
        let expected: Vec<f32> = svm.machines().rho().iter().map(|rho| -rho).collect();
        assert_eq!(svm.decision_values(&Matrix::new(6)), expected);
    }

    #[test]
    fn any_number_of_threads_gives_the_same_matrix() {
        let (frames, _) = frames(50);
        for inner in INNERS {
            let sets: Vec<DescriptorSet> =
                frames.iter().map(|frame| DescriptorSet::new(frame, inner)).collect();
            let gram = |n_threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
                pool.install(|| match_gram(&sets, inner))
            };
            let found = gram(1);
            assert_eq!(found, gram(3));
            for (i, j) in [(0, 49), (17, 16), (31, 3)] {
                assert_eq!(found.row(i)[j], found.row(j)[i]);
                let expected = naive(inner, &frames[i], &frames[j]);
                assert!((f64::from(found.row(i)[j]) - expected).abs() < 2e-3);
            }
        }
    }

    #[test]
    fn bad_training_sets_are_refused() {
        let (frames, labels) = frames(12);
        let narrow = Matrix::new(5);
        let train = |frames: &[&Matrix], inner| {
            let config = MatchConfig { inner, ..MatchConfig::default() };
            MatchSvm::train(frames, &labels, 3, &config).unwrap_err()
        };
        let mut frames: Vec<&Matrix> = frames.iter().collect();
        for gamma in [0.0, f64::NAN, f64::INFINITY] {
            let error = train(&frames, InnerKernel::Rbf { gamma });
            assert!(matches!(error, SvmError::NotPositive { name: "gamma", .. }));
        }
        assert!(matches!(
            train(&frames[1..], InnerKernel::Linear),
            SvmError::Labeled(LabeledError::LabelCount { .. })
        ));
        frames[7] = &narrow;
        assert!(matches!(train(&frames, InnerKernel::Linear), SvmError::WrongShape { .. }));
    }
}
