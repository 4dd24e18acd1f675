//! What to train: every parameter of a model.

use super::Cue;
use crate::describe::{Descriptor, FrameLbp, SiftDescriptor};
use crate::detect::Detector;
use crate::svm::Scheme;
use crate::{boost, svm, vocabulary};
use serde::{Deserialize, Serialize};

/// The most memory that the scale space of one frame may take.
const MAX_SCALE_SPACE_BYTES: u64 = 1 << 30;

/// Every parameter of a model. What a file leaves out has its default.
///
/// ```
/// let config: roomsight::model::Config = toml::from_str(
///     "representation = { kind = 'bag', n_words = 1000 }
///      [detector]
///      kind = 'fast'
///      threshold = { fixed = 20 }",
/// ).unwrap();
/// assert_eq!(config.check(), Ok(()));
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Frames whose longest side exceeds this are shrunk to it, in pixels.
    pub longest_side: usize,
    /// Seeds everything random: the same frames, configuration and seed give the same model.
    pub seed: u64,
    /// How keypoints are found.
    pub detector: Detector,
    /// How they are described.
    pub descriptor: Descriptor,
    /// What the classifier sees of a frame's descriptors.
    pub representation: Representation,
    /// How rooms are told apart by it.
    pub classifier: Classifier,
    /// How decision values become probabilities.
    pub calibration: CalibrationConfig,
    /// What is seen of a frame beside its keypoints, if anything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cue: Option<Cue>,
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

/// How decision values become probabilities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CalibrationConfig {
    /// Training frames are dealt into this many folds, whole sequences where there are several; each fold
    /// is answered by a model that was trained without it. At least 2.
    pub n_folds: usize,
    /// Whether each machine has its own sigmoid.
    pub sigmoids: Sigmoids,
    /// An answer counts as known when held-out answers at least as probable were right this often, from 0
    /// to 1.
    pub known_precision: f32,
}

/// The sigmoids that turn decision values into probabilities.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sigmoids {
    /// One a machine, as in LIBSVM. Needs held-out frames that are like those to come.
    PerMachine,
    /// The same for all machines: held-out frames decide how sure the answers are, but not which they are.
    Shared,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            longest_side: 640,
            seed: 0,
            detector: Detector::default(),
            descriptor: Descriptor::default(),
            representation: Representation::Bag(vocabulary::Config::default()),
            classifier: Classifier::LinearSvm(svm::Config::default()),
            calibration: CalibrationConfig::default(),
            cue: None,
        }
    }
}

impl Default for CalibrationConfig {
    fn default() -> Self {
        Self { n_folds: 5, sigmoids: Sigmoids::Shared, known_precision: 0.9 }
    }
}

impl Config {
    /// All that decides what an [`super::Extractor`] finds in a frame: with the same, frames need not be
    /// described again.
    pub fn extraction(&self) -> (usize, &Detector, &Descriptor, Option<&FrameLbp>) {
        let histograms = self.cue.as_ref().map(|Cue::FrameLbp(cue)| &cue.histograms);
        (self.longest_side, &self.detector, &self.descriptor, histograms)
    }

    /// What is wrong with the parameters, if anything.
    pub fn check(&self) -> Result<(), String> {
        if !(16..=8192).contains(&self.longest_side) {
            return Err(format!("longest_side must be from 16 to 8192 pixels, not {}", self.longest_side));
        }
        if !(2..=100).contains(&self.calibration.n_folds) {
            return Err(format!("n_folds must be from 2 to 100, not {}", self.calibration.n_folds));
        }
        if !(0.0..=1.0).contains(&self.calibration.known_precision) {
            return Err("known_precision must be from 0 to 1".to_owned());
        }
        self.detector.check()?;
        self.detector.check_size(self.longest_side)?;
        self.descriptor.check()?;
        if self.detector.repeats_points() && !self.descriptor.is_scaled() {
            return Err("a grid of several scales needs a descriptor that grows with them: set \
                        descriptor.region.scaled to true, or give detector.scales one number"
                .to_owned());
        }
        self.check_scale_space()?;
        self.classifier.check()?;
        self.cue.as_ref().map_or(Ok(()), Cue::check)?;
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

    /// Refuses frames whose blurred copies would fill the memory of the machine.
    fn check_scale_space(&self) -> Result<(), String> {
        let levels = match (self.detector.levels(), &self.descriptor) {
            (Some(levels), _) => levels,
            (None, Descriptor::Sift(_)) => SiftDescriptor::LEVELS,
            _ => return Ok(()),
        };
        let n_bytes = levels.max_bytes(self.longest_side);
        if n_bytes > MAX_SCALE_SPACE_BYTES {
            return Err(format!(
                "the scale space of a frame of {} pixels a side takes up to {:.1} GiB a thread, at most 1 is \
                 allowed: lower longest_side, or look for features at fewer levels",
                self.longest_side,
                n_bytes as f64 / (1_u64 << 30) as f64
            ));
        }
        Ok(())
    }
}
