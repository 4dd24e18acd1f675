//! Machines over the local features of a frame: its bag of words, or its descriptors themselves.

mod clues;
mod file;

use clues::keypoint_weights;
pub(crate) use file::LinearArrays;

use crate::classify::boost::Boost;
use crate::classify::svm::{
    DualSvm, IncrementalSvm, InnerKernel, KernelConfig, KernelFunction, KernelSvm, LinearSvm, MatchConfig,
    MatchSvm, Scheme, SvmError,
};
use crate::classify::{boost, svm};
use crate::file::arrays::{Array, Arrays};
use crate::file::error::FormatError;
use crate::labeled::LabeledError;
use crate::look::lens::Lens;
use crate::look::local::LocalFeatures;
use crate::look::sight::{Seen, Sight};
use crate::opinions::calibration::Way;
use crate::opinions::error::{AddError, TrainError};
use crate::opinions::kept::KeptRows;
use crate::opinions::{
    Added, Chosen, Clue, Left, Likeness, Near, Recognizer, Said, Shape, Sign, Size, Tries,
};
use crate::vocabulary;
use crate::vocabulary::{Described, Vocabulary};
use rayon::prelude::*;
use roomsight_vision::describe::Descriptor;
use roomsight_vision::detect::Detector;
use roomsight_vision::matrix::Matrix;
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
    KernelSvm(KernelConfig),
    /// Support vector machines with the match kernel, over the descriptors themselves.
    MatchSvm(MatchConfig),
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

    fn tries(&self) -> Vec<Tries> {
        let of = |parameter, values| Tries { parameter, values };
        match self {
            Self::LinearSvm(_) => vec![of("classifier.c", &["0.1", "1", "10"])],
            Self::KernelSvm(KernelConfig {
                kernel: KernelFunction::Linear | KernelFunction::HistogramIntersection,
                ..
            })
            | Self::MatchSvm(MatchConfig { inner: InnerKernel::Linear, .. }) => {
                vec![of("classifier.machines.c", &["0.1", "1", "10"])]
            }
            Self::KernelSvm(_) => vec![
                of("classifier.machines.c", &["1", "10"]),
                of("classifier.kernel.gamma", &["0.5", "2", "8"]),
            ],
            Self::MatchSvm(_) => vec![
                of("classifier.machines.c", &["1", "10"]),
                of("classifier.inner.gamma", &["2", "4", "8"]),
            ],
            Self::Boost(_) => vec![of("classifier.n_rounds", &["50", "200", "800"])],
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
    pub(crate) fn sight(&self) -> Sight {
        Sight::Keypoints { detector: self.detector.clone(), descriptor: self.descriptor.clone() }
    }

    pub(crate) fn lens_mut(&mut self) -> Option<&mut Lens> {
        None
    }

    pub(crate) fn check(&self) -> Result<(), String> {
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
    pub(crate) fn is_random(&self) -> bool {
        matches!(self.representation, Representation::Bag(_))
    }

    pub(crate) fn tries(&self) -> Vec<Tries> {
        let mut tries = self.classifier.tries();
        if let Representation::Bag(_) = self.representation {
            tries.push(Tries { parameter: "representation.n_words", values: &["300", "1000"] });
        }
        tries
    }

    pub(crate) fn way(&self) -> Way {
        Way::Sigmoids(self.classifier.scheme())
    }

    pub(crate) fn prior_weight(&self) -> f64 {
        0.5
    }

    pub(crate) fn signs(&self) -> &'static [Sign] {
        &MACHINE_SIGNS
    }
}

/// What decision values of machines tell of how familiar a frame is; see [`signs_of`].
pub(crate) const MACHINE_SIGNS: [Sign; 2] =
    [Sign { name: "value", prior_weight: 0.3 }, Sign { name: "gap", prior_weight: 0.3 }];

/// The largest decision value, and how far it is above the second.
pub(crate) fn signs_of(values: &[f32]) -> [f32; 2] {
    let (mut first, mut second) = (f32::MIN, f32::MIN);
    for &value in values {
        second = second.max(value.min(first));
        first = first.max(value);
    }
    // Two rooms have one machine.
    if values.len() < 2 { [first.abs(); 2] } else { [first, first - second] }
}

/// What was trained.
#[derive(Clone, Debug)]
pub(crate) struct Machines {
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
    /// Sees the descriptors themselves. With the training frame that each support frame was; empty where a file was read.
    Match(MatchSvm, Vec<usize>),
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
            let (svm, support_idxs) = MatchSvm::train_over(&descriptors, &gram, labels, n_classes, config)?;
            let support_idxs = support_idxs.into_iter().map(|idx| chosen.frame_idxs[idx]).collect();
            return with(Kind::Match(svm, support_idxs), KeptRows::default());
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

    fn answer(&self, seen: &Seen) -> Option<Said> {
        let local = seen.local().filter(|local| !local.keypoints.is_empty())?;
        let values = match &self.kind {
            Kind::Linear(vocabulary, svm) => svm.decision_values(&vocabulary.row(local.described())),
            Kind::Kernel(vocabulary, svm, _) => svm.decision_values(&vocabulary.row(local.described())),
            Kind::Boost(vocabulary, boost) => boost.decision_values(&vocabulary.row(local.described())),
            Kind::Match(svm, _) => svm.decision_values(&local.descriptors),
        };
        Some(said(values))
    }

    fn nearest(&self, seen: &Seen, n_frames: usize) -> Vec<Near> {
        let local = seen.local().filter(|local| !local.keypoints.is_empty());
        match (&self.kind, local) {
            (Kind::Linear(vocabulary, _), Some(local)) => {
                self.kept.nearest(&vocabulary.row(local.described()), n_frames)
            }
            _ => Vec::new(),
        }
    }

    fn check_addition(&self) -> Result<(), AddError> {
        match &self.kind {
            Kind::Linear(..) => self.kept.check(),
            Kind::Kernel(_, _, support_labels) if support_labels.is_empty() => Err(AddError::NothingKept),
            Kind::Kernel(..) => Ok(()),
            Kind::Boost(..) => Err(AddError::Classifier { classifier: "boost" }),
            Kind::Match(..) => Err(AddError::Classifier { classifier: "match_svm" }),
        }
    }

    fn add(&self, added: &Added) -> Result<Self, AddError> {
        self.check_addition()?;
        let bags = |vocabulary| bags(vocabulary, &local_of(added.frames.iter().copied()));
        match (&self.kind, &self.config.classifier) {
            (Kind::Linear(vocabulary, _), Classifier::LinearSvm(config)) => {
                let kept = self.kept.with(&bags(vocabulary), added).ok_or(AddError::NothingKept)?;
                let svm = LinearSvm::train(&kept.rows(), added.labels, added.n_rooms, config)?;
                Ok(Self { kind: Kind::Linear(vocabulary.clone(), svm), kept, ..self.clone() })
            }
            (Kind::Kernel(vocabulary, svm, support_labels), Classifier::KernelSvm(config)) => {
                let support_labels = support_labels.iter().map(|&label| added.of_earlier[label]).collect();
                let before = IncrementalSvm::from_parts(svm.clone(), support_labels, &config.machines)?;
                let labels = &added.labels[added.labels.len() - added.frames.len()..];
                let learned = before.updated(&bags(vocabulary), labels, added.n_rooms);
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
                let svm = LinearSvm::train(&kept.rows(), left.labels, left.n_rooms, config)?;
                Ok(Self { kind: Kind::Linear(vocabulary.clone(), svm), kept, ..self.clone() })
            }
            (Kind::Kernel(..), _) => Err(AddError::Unforgettable { classifier: "kernel_svm" }),
            (Kind::Boost(..), _) => Err(AddError::Unforgettable { classifier: "boost" }),
            _ => Err(AddError::Unforgettable { classifier: "match_svm" }),
        }
    }

    /// What each keypoint said. With one machine a pair of rooms, the sum over the machines that the room takes part
    /// in. Only linear machines can be taken apart like this; for others there is nothing.
    fn clues(&self, seen: &Seen, room_idx: usize) -> Vec<Clue> {
        let (Kind::Linear(vocabulary, svm), Some(local)) = (&self.kind, seen.local()) else {
            return Vec::new();
        };
        let words = vocabulary.quantize(&local.descriptors);
        let weights = keypoint_weights(vocabulary, svm, local, &words, room_idx);
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
        arrays.extend(self.kind.to_arrays());
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
            Kind::Match(svm, _) => of_dual(svm.machines()),
        };
        let n_kept = match &self.kind {
            Kind::Linear(..) => self.kept.n_rows(),
            Kind::Kernel(_, svm, _) => svm.support_vectors().n_rows(),
            Kind::Boost(..) | Kind::Match(..) => 0,
        };
        Size { n_words: self.kind.vocabulary().map(Vocabulary::n_words), n_support_vectors, n_kept }
    }
}

/// What trainings on parts of the same frames have in common.
pub(crate) struct Prepared {
    seed: u64,
    gram: Option<Matrix>,
}

#[cfg(test)]
impl Machines {
    /// As in files of versions that did not keep the rooms of support vectors.
    pub(crate) fn forget_support_labels(&mut self) {
        if let Kind::Kernel(_, _, support_labels) = &mut self.kind {
            support_labels.clear();
        }
    }
}

impl Machines {
    /// What they say of frame `frame_idx` of those that they were prepared with. How alike sets of descriptors are was
    /// computed for all pairs of these, which takes most of the time of training.
    pub(crate) fn answer_prepared(
        &self,
        prepared: &Prepared,
        frames: &[&Seen],
        frame_idx: usize,
    ) -> Option<Said> {
        let (Kind::Match(svm, support_idxs), Some(gram)) = (&self.kind, &prepared.gram) else {
            return self.answer(frames[frame_idx]);
        };
        frames[frame_idx].descriptors()?;
        let row = gram.row(frame_idx);
        let kernel_values: Vec<f32> = support_idxs.iter().map(|&idx| row[idx]).collect();
        Some(said(svm.machines().decision_values(&kernel_values)))
    }
}

impl Kind {
    /// `None` for machines that see no words.
    fn vocabulary(&self) -> Option<&Vocabulary> {
        match self {
            Self::Linear(vocabulary, _) | Self::Kernel(vocabulary, ..) | Self::Boost(vocabulary, _) => {
                Some(vocabulary)
            }
            Self::Match(..) => None,
        }
    }
}

/// What decision values say.
fn said(values: Vec<f32>) -> Said {
    let signs = signs_of(&values).to_vec();
    Said { values, signs }
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

/// What [`MachinesConfig::check`] has refused before.
fn mismatch() -> TrainError {
    TrainError::Config("this classifier does not see this representation".to_owned())
}

#[cfg(test)]
mod tests;
