//! The arrays of machines: what a model file holds of them, and machines of unknown origin.

use super::{Kind, mismatch};
use crate::classify::boost::{Boost, Stump};
use crate::classify::svm::{DualSvm, KernelFunction, KernelSvm, LinearSvm, MatchSvm, Scheme};
use crate::file::arrays::{Array, Arrays, require};
use crate::file::error::FormatError;
use crate::opinions::Shape;
use crate::opinions::kept::KeptRows;
use crate::opinions::machines::{Classifier, MachinesConfig, Representation};
use crate::vocabulary::Vocabulary;
use roomsight_vision::matrix::Matrix;

impl Kind {
    /// All that [`Kind::read`] needs beside the configuration.
    pub(crate) fn to_arrays(&self) -> Vec<Array> {
        let mut arrays = Vec::new();
        if let Some(vocabulary) = self.vocabulary() {
            arrays.push(Array::matrix("vocabulary.centers", vocabulary.centers()));
        }
        match self {
            Self::Linear(_, svm) => arrays.extend(LinearArrays::write(svm)),
            Self::Kernel(_, svm, support_labels) => {
                if !support_labels.is_empty() {
                    arrays.push(Array::counts("kernel.labels", support_labels.iter().copied()));
                }
                arrays.push(Array::matrix("kernel.support_vectors", svm.support_vectors()));
                arrays.push(Array::doubles("kernel.parameters", &parameters(svm.kernel())));
                push_dual(&mut arrays, svm.machines());
            }
            Self::Boost(_, boost) => {
                let stumps = || boost.ensembles().iter().flatten();
                let n_stumps = boost.ensembles().iter().map(Vec::len);
                let features: Vec<usize> = stumps().map(|stump| stump.feature_idx).collect();
                arrays.push(Array::counts("boost.n_stumps", n_stumps));
                arrays.push(Array::counts("boost.features", features.into_iter()));
                let thresholds: Vec<f32> = stumps().map(|stump| stump.threshold).collect();
                arrays.push(Array::vector("boost.thresholds", &thresholds));
                let weights: Vec<f32> = stumps().map(|stump| stump.weight).collect();
                arrays.push(Array::vector("boost.weights", &weights));
            }
            Self::Match(svm, _) => {
                let frames = svm.support_frames();
                let mut descriptors = Matrix::new(frames.first().map_or(0, Matrix::n_cols));
                frames.iter().flat_map(Matrix::rows).for_each(|row| descriptors.push_row(row));
                arrays.push(Array::matrix("match.descriptors", &descriptors));
                arrays.push(Array::counts("match.n_descriptors", frames.iter().map(Matrix::n_rows)));
                push_dual(&mut arrays, svm.machines());
            }
        }
        arrays
    }

    /// A classifier of unknown origin, and the rows it was trained on.
    pub(crate) fn read(
        config: &MachinesConfig,
        shape: Shape,
        file: &Arrays,
    ) -> Result<(Self, KeptRows), FormatError> {
        let Shape { n_rooms, n_dimensions, .. } = shape;
        let Representation::Bag(bag) = &config.representation else {
            let Classifier::MatchSvm(config) = &config.classifier else { return Err(damaged(&mismatch())) };
            let descriptors = file.matrix("match.descriptors")?;
            require(descriptors.n_cols() == n_dimensions, "its descriptors are of another length")?;
            require(are_units(&descriptors), "a descriptor is longer than 1")?;
            let frames = split_rows(&descriptors, &file.counts("match.n_descriptors")?)?;
            let machines = read_dual(config.machines.scheme, n_rooms, file)?;
            let svm =
                MatchSvm::from_parts(config.inner, frames, machines).map_err(|error| damaged(&error))?;
            return Ok((Self::Match(svm, Vec::new()), KeptRows::default()));
        };
        let centers = file.matrix("vocabulary.centers")?;
        require(centers.n_cols() == n_dimensions, "its words fit no descriptor")?;
        require(centers.n_rows() == bag.n_words, "its vocabulary has another number of words than it says")?;
        require(are_units(&centers), "a word is no mean of descriptors")?;
        let vocabulary = Vocabulary::new(centers, bag, shape.camera.sees_all_around());
        let n_columns = vocabulary.n_columns();
        let kind = match &config.classifier {
            Classifier::LinearSvm(config) => {
                let svm = LinearArrays { scheme: config.scheme, n_features: n_columns }.read(shape, file)?;
                let kept = KeptRows::from_arrays(n_columns, shape, file)?;
                return Ok((Self::Linear(vocabulary, svm), kept));
            }
            Classifier::KernelSvm(config) => {
                let support_vectors = file.matrix("kernel.support_vectors")?;
                require(support_vectors.n_cols() == n_columns, "its machines fit no vocabulary")?;
                let kernel = with_parameters(config.kernel, &file.doubles("kernel.parameters")?)?;
                let machines = read_dual(config.machines.scheme, n_rooms, file)?;
                let labels = file.counts_if_any("kernel.labels")?;
                let fit = labels.is_empty() || labels.len() == support_vectors.n_rows();
                require(fit, "its support vectors and their rooms are not as many")?;
                require(labels.iter().all(|&label| label < n_rooms), "a support vector is of no room")?;
                let svm = KernelSvm::from_parts(kernel, support_vectors, machines);
                svm.map(|svm| Self::Kernel(vocabulary, svm, labels)).map_err(|error| damaged(&error))?
            }
            Classifier::Boost(_) => {
                let ensembles = read_ensembles(file)?;
                require(ensembles.len() == n_rooms, "it has another number of ensembles than of rooms")?;
                let boost = Boost::from_parts(n_columns, ensembles);
                boost.map(|boost| Self::Boost(vocabulary, boost)).map_err(|error| damaged(&error))?
            }
            Classifier::MatchSvm(_) => return Err(damaged(&mismatch())),
        };
        Ok((kind, KeptRows::default()))
    }
}

fn damaged(error: &dyn std::fmt::Display) -> FormatError {
    FormatError::Damaged(error.to_string())
}

/// Whether no row is longer than 1, but for rounding, and all are numbers.
fn are_units(rows: &Matrix) -> bool {
    rows.rows().all(|row| row.iter().map(|value| value * value).sum::<f32>() < 1.001)
}

/// What the arrays of a linear SVM must agree with.
pub(crate) struct LinearArrays {
    pub(crate) scheme: Scheme,
    pub(crate) n_features: usize,
}

impl LinearArrays {
    pub(crate) fn write(svm: &LinearSvm) -> Vec<Array> {
        vec![
            Array::matrix("svm.weights", svm.weights()),
            Array::vector("svm.rho", svm.rho()),
            Array::counts("svm.n_support_vectors", svm.n_support_vectors().iter().copied()),
        ]
    }

    /// One of unknown origin.
    pub(crate) fn read(&self, shape: Shape, file: &Arrays) -> Result<LinearSvm, FormatError> {
        let weights = file.matrix("svm.weights")?;
        require(weights.n_cols() == self.n_features, "its machines do not fit what they see")?;
        let rho = file.vector("svm.rho")?;
        let n_support_vectors = file.counts("svm.n_support_vectors")?;
        LinearSvm::from_parts(self.scheme, shape.n_rooms, weights, rho, n_support_vectors)
            .map_err(|error| damaged(&error))
    }
}

fn push_dual(arrays: &mut Vec<Array>, machines: &DualSvm) {
    arrays.push(Array::matrix("dual.coefficients", machines.coefficients()));
    arrays.push(Array::vector("dual.rho", machines.rho()));
}

fn read_dual(scheme: Scheme, n_rooms: usize, file: &Arrays) -> Result<DualSvm, FormatError> {
    let coefficients = file.matrix("dual.coefficients")?;
    let rho = file.vector("dual.rho")?;
    DualSvm::from_parts(scheme, n_rooms, coefficients, rho).map_err(|error| damaged(&error))
}

/// Gamma and coef0, as far as the kernel has them.
fn parameters(kernel: KernelFunction) -> Vec<f64> {
    match kernel {
        KernelFunction::Linear | KernelFunction::HistogramIntersection => Vec::new(),
        KernelFunction::Rbf { gamma } | KernelFunction::ChiSquared { gamma } => vec![gamma],
        KernelFunction::Sigmoid { gamma, coef0 } => vec![gamma, coef0],
    }
}

fn with_parameters(
    kernel: KernelFunction<Option<f64>>,
    parameters: &[f64],
) -> Result<KernelFunction, FormatError> {
    match (kernel, parameters) {
        (KernelFunction::Linear, []) => Ok(KernelFunction::Linear),
        (KernelFunction::HistogramIntersection, []) => Ok(KernelFunction::HistogramIntersection),
        (KernelFunction::Rbf { .. }, &[gamma]) => Ok(KernelFunction::Rbf { gamma }),
        (KernelFunction::ChiSquared { .. }, &[gamma]) => Ok(KernelFunction::ChiSquared { gamma }),
        (KernelFunction::Sigmoid { .. }, &[gamma, coef0]) => Ok(KernelFunction::Sigmoid { gamma, coef0 }),
        _ => Err(FormatError::Damaged("its kernel has other parameters than it says".to_owned())),
    }
}

/// As many rows for each frame as `counts` says.
fn split_rows(rows: &Matrix, counts: &[usize]) -> Result<Vec<Matrix>, FormatError> {
    let n_rows = counts.iter().try_fold(0usize, |sum, &count| sum.checked_add(count));
    require(n_rows == Some(rows.n_rows()), "its frames have other numbers of descriptors than it says")?;
    let mut rows_left = rows.rows();
    let frame = |&count: &usize| {
        let mut frame = Matrix::new(rows.n_cols());
        rows_left.by_ref().take(count).for_each(|row| frame.push_row(row));
        frame
    };
    Ok(counts.iter().map(frame).collect())
}

fn read_ensembles(file: &Arrays) -> Result<Vec<Vec<Stump>>, FormatError> {
    let features = file.counts("boost.features")?;
    let thresholds = file.vector("boost.thresholds")?;
    let weights = file.vector("boost.weights")?;
    let n_stumps = file.counts("boost.n_stumps")?;
    let n = n_stumps.iter().try_fold(0usize, |sum, &count| sum.checked_add(count));
    let same_length = (thresholds.len(), weights.len()) == (features.len(), features.len());
    require(same_length && n == Some(features.len()), "its stumps are not as many as it says")?;
    let mut stumps = features
        .into_iter()
        .zip(thresholds.into_iter().zip(weights))
        .map(|(feature_idx, (threshold, weight))| Stump { feature_idx, threshold, weight });
    Ok(n_stumps.iter().map(|&count| stumps.by_ref().take(count).collect()).collect())
}
