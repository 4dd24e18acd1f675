//! What tells rooms apart by the descriptors of a frame, of every kind that can be configured.

use super::arrays::{self, Array, require};
use super::cue::Sight;
use super::format::FormatError;
use super::{Classifier, Config, Cue, Features, Representation, TrainError};
use crate::boost::{Boost, Stump};
use crate::camera::CameraKind;
use crate::matrix::Matrix;
use crate::svm::{DualSvm, IncrementalSvm, KernelFunction, KernelSvm, LinearSvm, MatchSvm, Scheme};
use crate::vocabulary::Vocabulary;
use rayon::prelude::*;
use safetensors::SafeTensors;

/// A trained classifier, with its vocabulary if it sees bags of words.
#[derive(Clone, Debug)]
pub(super) enum Machines {
    Linear(Vocabulary, LinearSvm),
    /// With the class of each support vector, without which training cannot go on; empty where a file does
    /// not hold it.
    Kernel(Vocabulary, KernelSvm, Vec<usize>),
    Boost(Vocabulary, Boost),
    /// Sees the descriptors themselves.
    Match(MatchSvm),
    /// Sees what a cue sees of the whole frame.
    Frame(LinearSvm),
}

/// Frames that are trained on again and again: without each fold, and all together.
pub(super) struct TrainingSet<'a> {
    frames: Vec<&'a Features>,
    config: &'a Config,
    camera: CameraKind,
    /// How alike all pairs of frames are, where that is what machines see: the same for all folds.
    gram: Option<Matrix>,
}

impl<'a> TrainingSet<'a> {
    pub(super) fn new(
        frames: Vec<&'a Features>,
        config: &'a Config,
        camera: CameraKind,
    ) -> Result<Self, TrainError> {
        let gram = match &config.classifier {
            Classifier::MatchSvm(config) => {
                let descriptors: Vec<&Matrix> = frames.iter().map(|frame| &frame.descriptors).collect();
                Some(MatchSvm::gram(&descriptors, config)?)
            }
            _ => None,
        };
        Ok(Self { frames, config, camera, gram })
    }
}

impl Machines {
    /// Trains on what is seen of frames of a set, where frame i is of class `labels[i]` < `n_classes`, and no
    /// class is without a frame.
    pub(super) fn train(
        sight: Sight,
        set: &TrainingSet,
        frame_idxs: &[usize],
        (labels, n_classes): (&[usize], usize),
    ) -> Result<Self, TrainError> {
        let frames = frame_idxs.iter().map(|&idx| set.frames[idx]);
        match sight {
            Sight::Keypoints => {
                let gram = set.gram.as_ref().map(|gram| among(gram, frame_idxs));
                let frames: Vec<&Features> = frames.collect();
                let camera = set.camera;
                Self::train_on_keypoints((&frames, gram.as_ref()), (labels, n_classes), (set.config, camera))
            }
            Sight::Frame(Cue::FrameLbp(cue)) => {
                let mut rows = Matrix::new(set.frames.first().map_or(0, |frame| frame.frame.len()));
                frames.for_each(|frame| rows.push_row(&frame.frame));
                Ok(Self::Frame(LinearSvm::train(&rows, labels, n_classes, &cue.machines())?))
            }
        }
    }

    fn train_on_keypoints(
        (frames, gram): (&[&Features], Option<&Matrix>),
        (labels, n_classes): (&[usize], usize),
        (config, camera): (&Config, CameraKind),
    ) -> Result<Self, TrainError> {
        let descriptors: Vec<&Matrix> = frames.iter().map(|frame| &frame.descriptors).collect();
        let Representation::Bag(bag) = &config.representation else {
            let (Classifier::MatchSvm(config), Some(gram)) = (&config.classifier, gram) else {
                return Err(mismatch());
            };
            return Ok(Self::Match(MatchSvm::train_over((&descriptors, gram), labels, n_classes, config)?));
        };
        let vocabulary = Vocabulary::train(&descriptors, bag, camera, config.seed)?;
        let rows = bags(&vocabulary, frames);
        match &config.classifier {
            Classifier::LinearSvm(config) => {
                let svm = LinearSvm::train(&rows, labels, n_classes, config)?;
                Ok(Self::Linear(vocabulary, svm))
            }
            Classifier::KernelSvm(config) => {
                let svm = IncrementalSvm::train(&rows, labels, n_classes, config)?;
                let (svm, support_labels) = svm.into_parts();
                Ok(Self::Kernel(vocabulary, svm, support_labels))
            }
            Classifier::Boost(config) => {
                let boost = Boost::train(&rows, labels, n_classes, config)?;
                Ok(Self::Boost(vocabulary, boost))
            }
            Classifier::MatchSvm(_) => Err(mismatch()),
        }
    }

    /// One decision value a machine; `None` of a frame that shows them nothing, as one without keypoints
    /// shows nothing to those that see keypoints.
    pub(super) fn decision_values(&self, features: &Features) -> Option<Vec<f32>> {
        let descriptors = &features.descriptors;
        if descriptors.n_rows() == 0 && !matches!(self, Self::Frame(_)) {
            return None;
        }
        Some(match self {
            Self::Linear(vocabulary, svm) => svm.decision_values(&vocabulary.row(features.described())),
            Self::Kernel(vocabulary, svm, _) => svm.decision_values(&vocabulary.row(features.described())),
            Self::Boost(vocabulary, boost) => boost.decision_values(&vocabulary.row(features.described())),
            Self::Match(svm) => svm.decision_values(descriptors),
            Self::Frame(svm) => svm.decision_values(&features.frame),
        })
    }

    pub(super) fn n_classes(&self) -> usize {
        match self {
            Self::Linear(_, svm) | Self::Frame(svm) => svm.n_classes(),
            Self::Kernel(_, svm, _) => svm.machines().n_classes(),
            Self::Boost(_, boost) => boost.n_classes(),
            Self::Match(svm) => svm.machines().n_classes(),
        }
    }

    /// `None` for machines that see no words.
    pub(super) fn vocabulary(&self) -> Option<&Vocabulary> {
        match self {
            Self::Linear(vocabulary, _) | Self::Kernel(vocabulary, ..) | Self::Boost(vocabulary, _) => {
                Some(vocabulary)
            }
            Self::Match(_) | Self::Frame(_) => None,
        }
    }

    /// The training frames that each machine rests on; empty for machines that rest on none.
    pub(super) fn n_support_vectors(&self) -> Vec<usize> {
        let of_dual = |machines: &DualSvm| {
            let n_used = |row: &[f32]| row.iter().filter(|&&coefficient| coefficient != 0.0).count();
            machines.coefficients().rows().map(n_used).collect()
        };
        match self {
            Self::Linear(_, svm) | Self::Frame(svm) => svm.n_support_vectors().to_vec(),
            Self::Kernel(_, svm, _) => of_dual(svm.machines()),
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
            Self::Linear(_, svm) => arrays.extend(linear_arrays(&KEYPOINT_NAMES, svm)),
            Self::Frame(svm) => arrays.extend(linear_arrays(&CUE_NAMES, svm)),
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
        sight: Sight,
        config: &Config,
        (n_places, camera): (usize, CameraKind),
        file: &SafeTensors,
    ) -> Result<Self, FormatError> {
        match sight {
            Sight::Keypoints => Self::read_for_keypoints(config, (n_places, camera), file),
            Sight::Frame(cue) => {
                let shape = (n_places, cue.n_dimensions(camera));
                Ok(Self::Frame(read_linear(&CUE_NAMES, config.scheme(sight), shape, file)?))
            }
        }
    }

    fn read_for_keypoints(
        config: &Config,
        (n_places, camera): (usize, CameraKind),
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
        let vocabulary = Vocabulary::new(centers, bag, camera);
        let n_columns = vocabulary.n_columns();
        match &config.classifier {
            Classifier::LinearSvm(config) => {
                let svm = read_linear(&KEYPOINT_NAMES, config.scheme, (n_places, n_columns), file)?;
                Ok(Self::Linear(vocabulary, svm))
            }
            Classifier::KernelSvm(config) => {
                let support_vectors = arrays::read_matrix(file, "kernel.support_vectors")?;
                require(support_vectors.n_cols() == n_columns, "its machines fit no vocabulary")?;
                let kernel =
                    with_parameters(config.kernel, &arrays::read_doubles(file, "kernel.parameters")?)?;
                let machines = read_dual(config.machines.scheme, n_places, file)?;
                let labels = arrays::read_counts_if_any(file, "kernel.labels")?;
                let fit = labels.is_empty() || labels.len() == support_vectors.n_rows();
                require(fit, "its support vectors and their rooms are not as many")?;
                require(labels.iter().all(|&label| label < n_places), "a support vector is of no room")?;
                let svm = KernelSvm::from_parts(kernel, support_vectors, machines);
                svm.map(|svm| Self::Kernel(vocabulary, svm, labels)).map_err(|error| damaged(&error))
            }
            Classifier::Boost(_) => {
                let ensembles = read_ensembles(file)?;
                require(ensembles.len() == n_places, "it has another number of ensembles than of rooms")?;
                let boost = Boost::from_parts(n_columns, ensembles);
                boost.map(|boost| Self::Boost(vocabulary, boost)).map_err(|error| damaged(&error))
            }
            Classifier::MatchSvm(_) => Err(damaged(&mismatch())),
        }
    }
}

/// The bag of each frame: one row a frame.
pub(super) fn bags(vocabulary: &Vocabulary, frames: &[&Features]) -> Matrix {
    let bags: Vec<Vec<f32>> = frames.par_iter().map(|frame| vocabulary.row(frame.described())).collect();
    let mut rows = Matrix::new(vocabulary.n_columns());
    bags.iter().for_each(|bag| rows.push_row(bag));
    rows
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

/// The names of the arrays of a linear SVM: weights, thresholds, numbers of support vectors.
type LinearNames = [&'static str; 3];

const KEYPOINT_NAMES: LinearNames = ["svm.weights", "svm.rho", "svm.n_support_vectors"];
const CUE_NAMES: LinearNames = ["cue.weights", "cue.rho", "cue.n_support_vectors"];

fn linear_arrays([weights, rho, n_support_vectors]: &LinearNames, svm: &LinearSvm) -> [Array; 3] {
    [
        Array::matrix(weights, svm.weights()),
        Array::vector(rho, svm.rho()),
        Array::counts(n_support_vectors, svm.n_support_vectors().iter().copied()),
    ]
}

fn read_linear(
    [weights, rho, n_support_vectors]: &LinearNames,
    scheme: Scheme,
    (n_places, n_features): (usize, usize),
    file: &SafeTensors,
) -> Result<LinearSvm, FormatError> {
    let weights = arrays::read_matrix(file, weights)?;
    require(weights.n_cols() == n_features, "its machines do not fit what they see")?;
    let rho = arrays::read_vector(file, rho)?;
    let n_support_vectors = arrays::read_counts(file, n_support_vectors)?;
    LinearSvm::from_parts(scheme, n_places, weights, rho, n_support_vectors).map_err(|error| damaged(&error))
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
