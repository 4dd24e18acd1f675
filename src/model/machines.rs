//! What tells rooms apart by the descriptors of a frame, of every kind that can be configured.

use super::arrays::{self, Array, require};
use super::format::FormatError;
use super::{Classifier, Config, Representation, TrainError};
use crate::boost::{Boost, Stump};
use crate::matrix::Matrix;
use crate::svm::{DualSvm, KernelFunction, KernelSvm, LinearSvm, MatchSvm, Scheme};
use crate::vocabulary::Vocabulary;
use rayon::prelude::*;
use safetensors::SafeTensors;

/// A trained classifier, with its vocabulary if it sees bags of words.
#[derive(Clone, Debug)]
pub(super) enum Machines {
    Linear(Vocabulary, LinearSvm),
    Kernel(Vocabulary, KernelSvm),
    Boost(Vocabulary, Boost),
    /// Sees the descriptors themselves.
    Match(MatchSvm),
}

/// The descriptors of frames that are trained on again and again: without each fold, and all together.
pub(super) struct TrainingSet<'a> {
    frames: Vec<&'a Matrix>,
    config: &'a Config,
    /// How alike all pairs of frames are, where that is what machines see: the same for all folds.
    gram: Option<Matrix>,
}

impl<'a> TrainingSet<'a> {
    pub(super) fn new(frames: Vec<&'a Matrix>, config: &'a Config) -> Result<Self, TrainError> {
        let gram = match &config.classifier {
            Classifier::MatchSvm(config) => Some(MatchSvm::gram(&frames, config)?),
            _ => None,
        };
        Ok(Self { frames, config, gram })
    }
}

impl Machines {
    /// Trains on frames of a set, where frame i is of class `labels[i]` < `n_classes`, and no class is without a
    /// frame.
    pub(super) fn train(
        set: &TrainingSet,
        frame_idxs: &[usize],
        labels: &[usize],
        n_classes: usize,
    ) -> Result<Self, TrainError> {
        let config = set.config;
        let frames: Vec<&Matrix> = frame_idxs.iter().map(|&idx| set.frames[idx]).collect();
        let Representation::Bag(bag) = &config.representation else {
            let (Classifier::MatchSvm(config), Some(gram)) = (&config.classifier, &set.gram) else {
                return Err(mismatch());
            };
            let gram = among(gram, frame_idxs);
            return Ok(Self::Match(MatchSvm::train_over((&frames, &gram), labels, n_classes, config)?));
        };
        let vocabulary = Vocabulary::train(&frames, bag, config.seed)?;
        let bags: Vec<Vec<f32>> =
            frames.par_iter().map(|descriptors| vocabulary.bag_of(descriptors)).collect();
        let mut rows = Matrix::new(vocabulary.n_words());
        bags.iter().for_each(|bag| rows.push_row(bag));
        match &config.classifier {
            Classifier::LinearSvm(config) => {
                let svm = LinearSvm::train(&rows, labels, n_classes, config)?;
                Ok(Self::Linear(vocabulary, svm))
            }
            Classifier::KernelSvm(config) => {
                let svm = KernelSvm::train(&rows, labels, n_classes, config)?;
                Ok(Self::Kernel(vocabulary, svm))
            }
            Classifier::Boost(config) => {
                let boost = Boost::train(&rows, labels, n_classes, config)?;
                Ok(Self::Boost(vocabulary, boost))
            }
            Classifier::MatchSvm(_) => Err(mismatch()),
        }
    }

    /// One decision value a machine.
    pub(super) fn decision_values(&self, descriptors: &Matrix) -> Vec<f32> {
        match self {
            Self::Linear(vocabulary, svm) => svm.decision_values(&vocabulary.bag_of(descriptors)),
            Self::Kernel(vocabulary, svm) => svm.decision_values(&vocabulary.bag_of(descriptors)),
            Self::Boost(vocabulary, boost) => boost.decision_values(&vocabulary.bag_of(descriptors)),
            Self::Match(svm) => svm.decision_values(descriptors),
        }
    }

    pub(super) fn n_classes(&self) -> usize {
        match self {
            Self::Linear(_, svm) => svm.n_classes(),
            Self::Kernel(_, svm) => svm.machines().n_classes(),
            Self::Boost(_, boost) => boost.n_classes(),
            Self::Match(svm) => svm.machines().n_classes(),
        }
    }

    /// `None` for machines that see no words.
    pub(super) fn vocabulary(&self) -> Option<&Vocabulary> {
        match self {
            Self::Linear(vocabulary, _) | Self::Kernel(vocabulary, _) | Self::Boost(vocabulary, _) => {
                Some(vocabulary)
            }
            Self::Match(_) => None,
        }
    }

    /// The training frames that each machine rests on; empty for machines that rest on none.
    pub(super) fn n_support_vectors(&self) -> Vec<usize> {
        let of_dual = |machines: &DualSvm| {
            let n_used = |row: &[f32]| row.iter().filter(|&&coefficient| coefficient != 0.0).count();
            machines.coefficients().rows().map(n_used).collect()
        };
        match self {
            Self::Linear(_, svm) => svm.n_support_vectors().to_vec(),
            Self::Kernel(_, svm) => of_dual(svm.machines()),
            Self::Boost(..) => Vec::new(),
            Self::Match(svm) => of_dual(svm.machines()),
        }
    }

    /// All that [`Machines::from_arrays`] needs beside the configuration.
    pub(super) fn to_arrays(&self) -> Vec<Array> {
        let mut arrays = Vec::new();
        if let Some(vocabulary) = self.vocabulary() {
            arrays.push(Array::matrix("vocabulary.centers", vocabulary.centers()));
        }
        match self {
            Self::Linear(_, svm) => {
                arrays.push(Array::matrix("svm.weights", svm.weights()));
                arrays.push(Array::vector("svm.rho", svm.rho()));
                arrays.push(Array::counts("svm.n_support_vectors", svm.n_support_vectors().iter().copied()));
            }
            Self::Kernel(_, svm) => {
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
            Self::Match(svm) => {
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

    /// Machines of unknown origin that fit `config`, which was checked, and each other.
    pub(super) fn from_arrays(
        config: &Config,
        n_places: usize,
        file: &SafeTensors,
    ) -> Result<Self, FormatError> {
        let n_dimensions = config.descriptor.n_dimensions();
        let Representation::Bag(bag) = &config.representation else {
            let Classifier::MatchSvm(config) = &config.classifier else { return Err(damaged(&mismatch())) };
            let descriptors = arrays::read_matrix(file, "match.descriptors")?;
            require(descriptors.n_cols() == n_dimensions, "its descriptors are of another length")?;
            require(are_units(&descriptors), "a descriptor is longer than 1")?;
            let frames = split_rows(&descriptors, &arrays::read_counts(file, "match.n_descriptors")?)?;
            let machines = read_dual(config.machines.scheme, n_places, file)?;
            return MatchSvm::from_parts(config.inner, frames, machines)
                .map(Self::Match)
                .map_err(|e| damaged(&e));
        };
        let centers = arrays::read_matrix(file, "vocabulary.centers")?;
        require(centers.n_cols() == n_dimensions, "its words fit no descriptor")?;
        require(centers.n_rows() == bag.n_words, "its vocabulary has another number of words than it says")?;
        require(are_units(&centers), "a word is no mean of descriptors")?;
        let vocabulary = Vocabulary::new(centers, bag.normalization);
        match &config.classifier {
            Classifier::LinearSvm(config) => {
                let weights = arrays::read_matrix(file, "svm.weights")?;
                require(weights.n_cols() == bag.n_words, "its machines fit no vocabulary")?;
                let rho = arrays::read_vector(file, "svm.rho")?;
                let n_support_vectors = arrays::read_counts(file, "svm.n_support_vectors")?;
                let svm = LinearSvm::from_parts(config.scheme, n_places, weights, rho, n_support_vectors);
                svm.map(|svm| Self::Linear(vocabulary, svm)).map_err(|error| damaged(&error))
            }
            Classifier::KernelSvm(config) => {
                let support_vectors = arrays::read_matrix(file, "kernel.support_vectors")?;
                require(support_vectors.n_cols() == bag.n_words, "its machines fit no vocabulary")?;
                let kernel =
                    with_parameters(config.kernel, &arrays::read_doubles(file, "kernel.parameters")?)?;
                let machines = read_dual(config.machines.scheme, n_places, file)?;
                let svm = KernelSvm::from_parts(kernel, support_vectors, machines);
                svm.map(|svm| Self::Kernel(vocabulary, svm)).map_err(|error| damaged(&error))
            }
            Classifier::Boost(_) => {
                let ensembles = read_ensembles(file)?;
                require(ensembles.len() == n_places, "it has another number of ensembles than of rooms")?;
                let boost = Boost::from_parts(bag.n_words, ensembles);
                boost.map(|boost| Self::Boost(vocabulary, boost)).map_err(|error| damaged(&error))
            }
            Classifier::MatchSvm(_) => Err(damaged(&mismatch())),
        }
    }
}

/// The rows and columns of some frames.
fn among(gram: &Matrix, frame_idxs: &[usize]) -> Matrix {
    let mut part = Matrix::new(frame_idxs.len());
    for &row_idx in frame_idxs {
        let row = gram.row(row_idx);
        part.push_row(&Vec::from_iter(frame_idxs.iter().map(|&idx| row[idx])));
    }
    part
}

/// What [`Config::check`] has refused before.
fn mismatch() -> TrainError {
    TrainError::Config("this classifier does not see this representation".to_owned())
}

fn damaged(error: &dyn std::fmt::Display) -> FormatError {
    FormatError::Damaged(error.to_string())
}

/// Whether no row is longer than 1, but for rounding, and all are numbers.
fn are_units(rows: &Matrix) -> bool {
    rows.rows().all(|row| row.iter().map(|value| value * value).sum::<f32>() < 1.001)
}

fn push_dual(arrays: &mut Vec<Array>, machines: &DualSvm) {
    arrays.push(Array::matrix("dual.coefficients", machines.coefficients()));
    arrays.push(Array::vector("dual.rho", machines.rho()));
}

fn read_dual(scheme: Scheme, n_places: usize, file: &SafeTensors) -> Result<DualSvm, FormatError> {
    let coefficients = arrays::read_matrix(file, "dual.coefficients")?;
    let rho = arrays::read_vector(file, "dual.rho")?;
    DualSvm::from_parts(scheme, n_places, coefficients, rho).map_err(|error| damaged(&error))
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

fn read_ensembles(file: &SafeTensors) -> Result<Vec<Vec<Stump>>, FormatError> {
    let features = arrays::read_counts(file, "boost.features")?;
    let thresholds = arrays::read_vector(file, "boost.thresholds")?;
    let weights = arrays::read_vector(file, "boost.weights")?;
    let n_stumps = arrays::read_counts(file, "boost.n_stumps")?;
    let n = n_stumps.iter().try_fold(0usize, |sum, &count| sum.checked_add(count));
    let same_length = (thresholds.len(), weights.len()) == (features.len(), features.len());
    require(same_length && n == Some(features.len()), "its stumps are not as many as it says")?;
    let mut stumps = features
        .into_iter()
        .zip(thresholds.into_iter().zip(weights))
        .map(|(feature_idx, (threshold, weight))| Stump { feature_idx, threshold, weight });
    Ok(n_stumps.iter().map(|&count| stumps.by_ref().take(count).collect()).collect())
}
