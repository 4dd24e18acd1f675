//! Machines over the local features of a frame: its bag of words, or its descriptors themselves.

use super::super::arrays::{Array, Arrays, require};
use super::super::calibration::Way;
use super::super::format::FormatError;
use super::super::lens::Lens;
use super::super::sight::{LocalFeatures, Seen, Sight};
use super::super::{AddError, TrainError};
use super::kept::KeptRows;
use super::{Added, Chosen, Clue, Left, Likeness, Recognizer, Shape, Size};
use crate::boost::{self, Boost, Stump};
use crate::describe::Descriptor;
use crate::detect::Detector;
use crate::labeled::LabeledError;
use crate::matrix::Matrix;
use crate::svm::{
    self, DualSvm, IncrementalSvm, KernelFunction, KernelSvm, LinearSvm, MatchSvm, Scheme, SvmError,
};
use crate::vocabulary::{self, Described, Vocabulary};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Which local features, how frames are represented by them, and what tells these apart.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MachinesConfig {
    /// How keypoints are found.
    pub detector: Detector,
    /// How they are described.
    pub descriptor: Descriptor,
    /// What the classifier sees of a frame's descriptors.
    pub representation: Representation,
    /// How rooms are told apart by it.
    pub classifier: Classifier,
}

/// What a classifier sees of a frame's descriptors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Representation {
    /// How often each word of a vocabulary occurs.
    Bag(vocabulary::Config),
    /// The descriptors themselves, for classifiers that compare sets of them.
    // With braces, serde refuses the parameters of a bag beside it.
    Descriptors {},
}

impl Default for Representation {
    fn default() -> Self {
        Self::Bag(vocabulary::Config::default())
    }
}

/// How rooms are told apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Classifier {
    /// Support vector machines with the linear kernel, over bags.
    LinearSvm(svm::Config),
    /// Support vector machines with any kernel, over bags.
    KernelSvm(svm::KernelConfig),
    /// Support vector machines with the match kernel, over the descriptors themselves.
    MatchSvm(svm::MatchConfig),
    /// AdaBoost on stumps, over bags.
    Boost(boost::Config),
}

impl Default for Classifier {
    fn default() -> Self {
        Self::LinearSvm(svm::Config::default())
    }
}

impl Classifier {
    /// How its machines are put together.
    pub fn scheme(&self) -> Scheme {
        match self {
            Self::LinearSvm(config) => config.scheme,
            Self::KernelSvm(config) => config.machines.scheme,
            Self::MatchSvm(config) => config.machines.scheme,
            Self::Boost(_) => Scheme::OneVsAll,
        }
    }

    fn check(&self) -> Result<(), String> {
        match self {
            Self::LinearSvm(config) => config.check().map_err(|error| error.to_string()),
            Self::KernelSvm(config) => config.check().map_err(|error| error.to_string()),
            Self::MatchSvm(config) => config.check().map_err(|error| error.to_string()),
            Self::Boost(config) => config.check().map_err(|error| error.to_string()),
        }
    }
}

impl MachinesConfig {
    pub(super) fn sight(&self) -> Sight {
        Sight::Keypoints { detector: self.detector.clone(), descriptor: self.descriptor.clone() }
    }

    pub(super) fn lens_mut(&mut self) -> Option<&mut Lens> {
        None
    }

    pub(super) fn check(&self) -> Result<(), String> {
        self.classifier.check()?;
        let sees_descriptors = matches!(self.classifier, Classifier::MatchSvm(_));
        match &self.representation {
            Representation::Bag(_) if sees_descriptors => {
                Err("match_svm compares descriptors: set representation.kind to descriptors".to_owned())
            }
            Representation::Bag(vocabulary) => vocabulary.check(self.descriptor.n_dimensions()),
            Representation::Descriptors {} if sees_descriptors => Ok(()),
            Representation::Descriptors {} => {
                Err("only match_svm sees descriptors: set representation.kind to bag".to_owned())
            }
        }
    }

    /// Words are drawn.
    pub(super) fn is_random(&self) -> bool {
        matches!(self.representation, Representation::Bag(_))
    }

    pub(super) fn way(&self) -> Way {
        Way::Sigmoids(self.classifier.scheme())
    }

    pub(super) fn prior_weight(&self) -> f64 {
        0.5
    }
}

/// What was trained.
#[derive(Clone, Debug)]
pub(in crate::model) struct Machines {
    config: MachinesConfig,
    kind: Kind,
    /// The bags that linear machines were trained on; none of others.
    kept: KeptRows,
}

/// A trained classifier, with its vocabulary if it sees bags of words.
#[derive(Clone, Debug)]
enum Kind {
    Linear(Vocabulary, LinearSvm),
    /// With the class of each support vector, without which training cannot go on; empty where a file does
    /// not hold it.
    Kernel(Vocabulary, KernelSvm, Vec<usize>),
    Boost(Vocabulary, Boost),
    /// Sees the descriptors themselves.
    Match(MatchSvm),
}

impl Recognizer for Machines {
    type Config = MachinesConfig;
    /// What is random, and how alike all pairs of frames are, where that is what machines see: the same for all folds.
    type Prepared = Prepared;

    fn prepare(config: &MachinesConfig, frames: &[&Seen], seed: u64) -> Result<Prepared, TrainError> {
        let gram = match &config.classifier {
            Classifier::MatchSvm(config) => {
                let local = local_of(frames.iter().copied());
                let descriptors: Vec<&Matrix> = local.iter().map(|local| &local.descriptors).collect();
                Some(MatchSvm::gram(&descriptors, config)?)
            }
            _ => None,
        };
        Ok(Prepared { seed, gram })
    }

    fn train(
        config: &MachinesConfig,
        prepared: &Prepared,
        frames: &[&Seen],
        chosen: &Chosen,
    ) -> Result<Self, TrainError> {
        let local = local_of(chosen.frame_idxs.iter().map(|&idx| frames[idx]));
        let descriptors: Vec<&Matrix> = local.iter().map(|local| &local.descriptors).collect();
        let (labels, n_classes) = (chosen.labels, chosen.n_classes);
        let with = |kind, kept| Ok(Self { config: config.clone(), kind, kept });
        let Representation::Bag(bag) = &config.representation else {
            let (Classifier::MatchSvm(config), Some(gram)) = (&config.classifier, &prepared.gram) else {
                return Err(mismatch());
            };
            let gram = among(gram, chosen.frame_idxs);
            let svm = MatchSvm::train_over((&descriptors, &gram), labels, n_classes, config)?;
            return with(Kind::Match(svm), KeptRows::default());
        };
        let frames: Vec<Described> = local.iter().map(|local| local.described()).collect();
        let vocabulary = Vocabulary::train(&frames, bag, prepared.seed)?;
        let rows = bags(&vocabulary, &local);
        match &config.classifier {
            Classifier::LinearSvm(config) => {
                let svm = LinearSvm::train(&rows, labels, n_classes, config)?;
                with(Kind::Linear(vocabulary, svm), KeptRows::new(&rows))
            }
            Classifier::KernelSvm(config) => {
                let svm = IncrementalSvm::train(&rows, labels, n_classes, config)?;
                let (svm, support_labels) = svm.into_parts();
                with(Kind::Kernel(vocabulary, svm, support_labels), KeptRows::default())
            }
            Classifier::Boost(config) => {
                let boost = Boost::train(&rows, labels, n_classes, config)?;
                with(Kind::Boost(vocabulary, boost), KeptRows::default())
            }
            Classifier::MatchSvm(_) => Err(mismatch()),
        }
    }

    fn decision_values(&self, seen: &Seen) -> Option<Vec<f32>> {
        let local = seen.local().filter(|local| !local.keypoints.is_empty())?;
        Some(match &self.kind {
            Kind::Linear(vocabulary, svm) => svm.decision_values(&vocabulary.row(local.described())),
            Kind::Kernel(vocabulary, svm, _) => svm.decision_values(&vocabulary.row(local.described())),
            Kind::Boost(vocabulary, boost) => boost.decision_values(&vocabulary.row(local.described())),
            Kind::Match(svm) => svm.decision_values(&local.descriptors),
        })
    }

    fn check_addition(&self) -> Result<(), AddError> {
        match &self.kind {
            Kind::Linear(..) => self.kept.check(),
            Kind::Kernel(_, _, support_labels) if support_labels.is_empty() => Err(AddError::NothingKept),
            Kind::Kernel(..) => Ok(()),
            Kind::Boost(..) => Err(AddError::Classifier { classifier: "boost" }),
            Kind::Match(_) => Err(AddError::Classifier { classifier: "match_svm" }),
        }
    }

    fn add(&self, added: &Added) -> Result<Self, AddError> {
        self.check_addition()?;
        let bags = |vocabulary| bags(vocabulary, &local_of(added.frames.iter().copied()));
        match (&self.kind, &self.config.classifier) {
            (Kind::Linear(vocabulary, _), Classifier::LinearSvm(config)) => {
                let kept = self.kept.with(&bags(vocabulary), added).ok_or(AddError::NothingKept)?;
                let svm = LinearSvm::train(&kept.rows(), added.labels, added.n_places, config)?;
                Ok(Self { kind: Kind::Linear(vocabulary.clone(), svm), kept, ..self.clone() })
            }
            (Kind::Kernel(vocabulary, svm, support_labels), Classifier::KernelSvm(config)) => {
                let support_labels = support_labels.iter().map(|&label| added.of_earlier[label]).collect();
                let before = IncrementalSvm::from_parts(svm.clone(), support_labels, &config.machines)?;
                let labels = &added.labels[added.labels.len() - added.frames.len()..];
                let learned = before.updated(&bags(vocabulary), labels, added.n_places);
                let (svm, support_labels) = learned.map_err(forgotten)?.reduced(added.forget)?.into_parts();
                let kind = Kind::Kernel(vocabulary.clone(), svm, support_labels);
                Ok(Self { kind, ..self.clone() })
            }
            _ => Err(AddError::NothingKept),
        }
    }

    fn without(&self, left: &Left) -> Result<Self, AddError> {
        match (&self.kind, &self.config.classifier) {
            (Kind::Linear(vocabulary, _), Classifier::LinearSvm(config)) => {
                let kept = self.kept.left(left).ok_or(AddError::NothingKept)?;
                let svm = LinearSvm::train(&kept.rows(), left.labels, left.n_places, config)?;
                Ok(Self { kind: Kind::Linear(vocabulary.clone(), svm), kept, ..self.clone() })
            }
            (Kind::Kernel(..), _) => Err(AddError::Unforgettable { classifier: "kernel_svm" }),
            (Kind::Boost(..), _) => Err(AddError::Unforgettable { classifier: "boost" }),
            _ => Err(AddError::Unforgettable { classifier: "match_svm" }),
        }
    }

    /// What each keypoint said. With one machine a pair of rooms, the sum over the machines that the room takes part
    /// in. Only linear machines can be taken apart like this; for others there is nothing.
    fn clues(&self, seen: &Seen, place_idx: usize) -> Vec<Clue> {
        let (Kind::Linear(vocabulary, svm), Some(local)) = (&self.kind, seen.local()) else {
            return Vec::new();
        };
        let words = vocabulary.quantize(&local.descriptors);
        let weights = keypoint_weights((vocabulary, svm), (local, &words), place_idx);
        let clues = words.iter().zip(&local.keypoints).zip(weights).map(|((&word, keypoint), weight)| Clue {
            x: keypoint.x,
            y: keypoint.y,
            likeness: Likeness::Word(word as usize),
            weight,
        });
        clues.collect()
    }

    fn to_arrays(&self) -> Vec<Array> {
        let mut arrays = self.kept.to_arrays();
        if let Some(vocabulary) = self.vocabulary() {
            arrays.push(Array::matrix("vocabulary.centers", vocabulary.centers()));
        }
        match &self.kind {
            Kind::Linear(_, svm) => arrays.extend(LinearArrays::write(svm)),
            Kind::Kernel(_, svm, support_labels) => {
                if !support_labels.is_empty() {
                    arrays.push(Array::counts("kernel.labels", support_labels.iter().copied()));
                }
                arrays.push(Array::matrix("kernel.support_vectors", svm.support_vectors()));
                arrays.push(Array::doubles("kernel.parameters", &parameters(svm.kernel())));
                push_dual(&mut arrays, svm.machines());
            }
            Kind::Boost(_, boost) => {
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
            Kind::Match(svm) => {
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

    fn from_arrays(config: &MachinesConfig, shape: Shape, arrays: &Arrays) -> Result<Self, FormatError> {
        let (kind, kept) = Kind::read(config, shape, arrays)?;
        Ok(Self { config: config.clone(), kind, kept })
    }

    /// Machines of boosting rest on no training frames.
    fn size(&self) -> Size {
        let of_dual = |machines: &DualSvm| {
            let n_used = |row: &[f32]| row.iter().filter(|&&coefficient| coefficient != 0.0).count();
            machines.coefficients().rows().map(n_used).collect()
        };
        let n_support_vectors = match &self.kind {
            Kind::Linear(_, svm) => svm.n_support_vectors().to_vec(),
            Kind::Kernel(_, svm, _) => of_dual(svm.machines()),
            Kind::Boost(..) => Vec::new(),
            Kind::Match(svm) => of_dual(svm.machines()),
        };
        let n_kept = match &self.kind {
            Kind::Linear(..) => self.kept.n_rows(),
            Kind::Kernel(_, svm, _) => svm.support_vectors().n_rows(),
            Kind::Boost(..) | Kind::Match(_) => 0,
        };
        Size { n_words: self.vocabulary().map(Vocabulary::n_words), n_support_vectors, n_kept }
    }
}

/// What trainings on parts of the same frames have in common.
pub(in crate::model) struct Prepared {
    seed: u64,
    gram: Option<Matrix>,
}

#[cfg(test)]
impl Machines {
    /// As in files of versions that did not keep the rooms of support vectors.
    pub(super) fn forget_support_labels(&mut self) {
        if let Kind::Kernel(_, _, support_labels) = &mut self.kind {
            support_labels.clear();
        }
    }
}

impl Machines {
    /// `None` for machines that see no words.
    fn vocabulary(&self) -> Option<&Vocabulary> {
        match &self.kind {
            Kind::Linear(vocabulary, _) | Kind::Kernel(vocabulary, ..) | Kind::Boost(vocabulary, _) => {
                Some(vocabulary)
            }
            Kind::Match(_) => None,
        }
    }
}

impl Kind {
    /// A classifier of unknown origin, and the rows it was trained on.
    fn read(config: &MachinesConfig, shape: Shape, file: &Arrays) -> Result<(Self, KeptRows), FormatError> {
        let Shape { n_places, n_dimensions, .. } = shape;
        let Representation::Bag(bag) = &config.representation else {
            let Classifier::MatchSvm(config) = &config.classifier else { return Err(damaged(&mismatch())) };
            let descriptors = file.matrix("match.descriptors")?;
            require(descriptors.n_cols() == n_dimensions, "its descriptors are of another length")?;
            require(are_units(&descriptors), "a descriptor is longer than 1")?;
            let frames = split_rows(&descriptors, &file.counts("match.n_descriptors")?)?;
            let machines = read_dual(config.machines.scheme, n_places, file)?;
            let svm =
                MatchSvm::from_parts(config.inner, frames, machines).map_err(|error| damaged(&error))?;
            return Ok((Self::Match(svm), KeptRows::default()));
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
                let machines = read_dual(config.machines.scheme, n_places, file)?;
                let labels = file.counts_if_any("kernel.labels")?;
                let fit = labels.is_empty() || labels.len() == support_vectors.n_rows();
                require(fit, "its support vectors and their rooms are not as many")?;
                require(labels.iter().all(|&label| label < n_places), "a support vector is of no room")?;
                let svm = KernelSvm::from_parts(kernel, support_vectors, machines);
                svm.map(|svm| Self::Kernel(vocabulary, svm, labels)).map_err(|error| damaged(&error))?
            }
            Classifier::Boost(_) => {
                let ensembles = read_ensembles(file)?;
                require(ensembles.len() == n_places, "it has another number of ensembles than of rooms")?;
                let boost = Boost::from_parts(n_columns, ensembles);
                boost.map(|boost| Self::Boost(vocabulary, boost)).map_err(|error| damaged(&error))?
            }
            Classifier::MatchSvm(_) => return Err(damaged(&mismatch())),
        };
        Ok((kind, KeptRows::default()))
    }
}

/// The local features of each frame.
fn local_of<'a>(frames: impl Iterator<Item = &'a Seen>) -> Vec<&'a LocalFeatures> {
    frames.filter_map(Seen::local).collect()
}

/// A class that is left without any frame is a room whose support vectors were all dropped.
fn forgotten(error: SvmError) -> AddError {
    match error {
        SvmError::Labeled(LabeledError::EmptyClass { class_idx }) => AddError::ForgottenClass { class_idx },
        error => AddError::Svm(error),
    }
}

/// How much each keypoint of a frame with these words adds to the decision value of a room: an equal share of what
/// each block of the frame's row adds that it counts in.
fn keypoint_weights(
    (vocabulary, svm): (&Vocabulary, &LinearSvm),
    (frame, words): (&LocalFeatures, &[u32]),
    place_idx: usize,
) -> Vec<f32> {
    let row = vocabulary.row_of_words(frame.described(), words);
    let width = vocabulary.block_width();
    let blocks = || words.iter().zip(&frame.spots).map(|(&word, &spot)| vocabulary.blocks(word, spot));
    let mut counts = vec![0.0; row.len() / width];
    blocks().flatten().for_each(|block| counts[block] += 1.0);
    let share = |block: usize| {
        let added_by = |column: usize| {
            let signed = signed_machines(svm, place_idx);
            let sum: f32 = signed.map(|(machine, sign)| sign * svm.weights().row(machine)[column]).sum();
            sum * row[column]
        };
        (block * width..(block + 1) * width).map(added_by).sum::<f32>() / f32::max(counts[block], 1.0)
    };
    let shares: Vec<f32> = (0..counts.len()).map(share).collect();
    blocks().map(|blocks| blocks.map(|block| shares[block]).sum()).collect()
}

/// The machines that speak of a room, and whether their positive side is it.
fn signed_machines(svm: &LinearSvm, place_idx: usize) -> impl Iterator<Item = (usize, f32)> {
    let n_places = svm.n_classes();
    let one_vs_all = (svm.scheme() == Scheme::OneVsAll).then_some((place_idx, 1.0));
    let pairs = (0..n_places).flat_map(move |a| (a + 1..n_places).map(move |b| (a, b))).enumerate();
    let one_vs_one = pairs.filter_map(move |(machine, (a, b))| {
        let sign = if a == place_idx { 1.0 } else { -1.0 };
        (one_vs_all.is_none() && (a == place_idx || b == place_idx)).then_some((machine, sign))
    });
    one_vs_all.into_iter().chain(one_vs_one)
}

/// The bag of each frame: one row a frame.
fn bags(vocabulary: &Vocabulary, frames: &[&LocalFeatures]) -> Matrix {
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

/// What the arrays of a linear SVM must agree with.
pub(super) struct LinearArrays {
    pub(super) scheme: Scheme,
    pub(super) n_features: usize,
}

impl LinearArrays {
    pub(super) fn write(svm: &LinearSvm) -> Vec<Array> {
        vec![
            Array::matrix("svm.weights", svm.weights()),
            Array::vector("svm.rho", svm.rho()),
            Array::counts("svm.n_support_vectors", svm.n_support_vectors().iter().copied()),
        ]
    }

    /// One of unknown origin.
    pub(super) fn read(&self, shape: Shape, file: &Arrays) -> Result<LinearSvm, FormatError> {
        let weights = file.matrix("svm.weights")?;
        require(weights.n_cols() == self.n_features, "its machines do not fit what they see")?;
        let rho = file.vector("svm.rho")?;
        let n_support_vectors = file.counts("svm.n_support_vectors")?;
        LinearSvm::from_parts(self.scheme, shape.n_places, weights, rho, n_support_vectors)
            .map_err(|error| damaged(&error))
    }
}

fn push_dual(arrays: &mut Vec<Array>, machines: &DualSvm) {
    arrays.push(Array::matrix("dual.coefficients", machines.coefficients()));
    arrays.push(Array::vector("dual.rho", machines.rho()));
}

fn read_dual(scheme: Scheme, n_places: usize, file: &Arrays) -> Result<DualSvm, FormatError> {
    let coefficients = file.matrix("dual.coefficients")?;
    let rho = file.vector("dual.rho")?;
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
