//! What to train: every parameter of a model.

use crate::file::names::{BAG, PATTERNS};
use crate::file::networks::Networks;
use crate::look::sight::Sight;
use crate::opinions::calibration::CalibrationConfig;
use crate::opinions::{Classifier, MachinesConfig, OpinionConfig, PatternsConfig, Representation};
use roomsight_vision::describe::Descriptor;
use roomsight_vision::detect::Detector;
use roomsight_vision::network::NetworkError;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The longest name of an opinion, in bytes.
const MAX_NAME_LENGTH: usize = 32;

/// The most opinions of a model.
const MAX_OPINIONS: usize = 16;

/// Every parameter of a model. What a file leaves out has its default. A file that names `detector`, `descriptor`,
/// `representation`, `classifier` or `cue` beside `longest_side` means a model of the opinion [`BAG`] alone, and
/// of [`PATTERNS`] where it has a cue: files of before are read so, and the papers' methods written shortly.
///
/// ```
/// let config: roomsight_recognition::model::Config = toml::from_str(
///     "[opinions.bag]
///      kind = 'machines'
///      representation = { kind = 'bag', n_words = 1000 }
///      [opinions.bag.detector]
///      kind = 'fast'
///      threshold = { fixed = 20 }",
/// ).unwrap();
/// assert_eq!(config.check(), Ok(()));
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written")]
pub struct Config {
    /// Frames whose longest side exceeds this are shrunk to it before keypoints are looked for, in pixels.
    pub longest_side: usize,
    /// Seeds everything random: the same frames, configuration and seed give the same model.
    pub seed: u64,
    /// How often answers are to be right that cheap opinions give alone, from 0 to 1: those that look through a network, or at
    /// a scale space, are asked only where the others are not so sure. At 1 all are always asked, and also where too few
    /// frames were held out to show it.
    #[serde(skip_serializing_if = "asks_all")]
    pub early_precision: f64,
    /// How decision values become probabilities.
    pub calibration: CalibrationConfig,
    /// How much opinions count whose weight is given. Where one is not, all are fitted on held-out frames.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub weights: BTreeMap<String, f64>,
    /// The ways to tell rooms apart, by name; at least one.
    pub opinions: BTreeMap<String, OpinionConfig>,
}

/// The [`Config::early_precision`] at which all opinions are always asked.
pub(crate) const ALWAYS_ALL: f64 = 1.0;

/// So that files of models that were configured before stay as they are.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks by reference")]
fn asks_all(early_precision: &f64) -> bool {
    *early_precision >= ALWAYS_ALL
}

/// A configuration as it is read.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    longest_side: Option<usize>,
    seed: Option<u64>,
    early_precision: Option<f64>,
    #[serde(default)]
    calibration: CalibrationConfig,
    weights: Option<BTreeMap<String, f64>>,
    opinions: Option<BTreeMap<String, OpinionConfig>>,
    // Of the bag alone.
    detector: Option<Detector>,
    descriptor: Option<Descriptor>,
    representation: Option<Representation>,
    classifier: Option<Classifier>,
    cue: Option<WrittenCue>,
}

/// What files of before call a cue: an opinion on the frame's patterns, with its weight.
#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum WrittenCue {
    FrameLbp(WeightedPatterns),
}

#[derive(Deserialize)]
struct WeightedPatterns {
    #[serde(default = "half")]
    weight: f64,
    #[serde(flatten)]
    patterns: PatternsConfig,
}

fn half() -> f64 {
    0.5
}

impl TryFrom<Written> for Config {
    type Error = String;

    fn try_from(written: Written) -> Result<Self, String> {
        let defaults = Self::default();
        let mut config = Self {
            longest_side: written.longest_side.unwrap_or(defaults.longest_side),
            seed: written.seed.unwrap_or(defaults.seed),
            early_precision: written.early_precision.unwrap_or(defaults.early_precision),
            calibration: written.calibration,
            weights: written.weights.unwrap_or_default(),
            opinions: defaults.opinions,
        };
        let Written { detector, descriptor, representation, classifier, cue, opinions, .. } = written;
        let is_short = detector.is_some()
            || descriptor.is_some()
            || representation.is_some()
            || classifier.is_some()
            || cue.is_some();
        match opinions {
            Some(_) if is_short => {
                return Err(
                    "detector, descriptor, representation, classifier and cue are short for those of one \
                            opinion: beside opinions, write them there"
                        .to_owned(),
                );
            }
            Some(opinions) => config.opinions = opinions,
            None => {
                let bag = MachinesConfig {
                    detector: detector.unwrap_or_default(),
                    descriptor: descriptor.unwrap_or_default(),
                    representation: representation.unwrap_or_default(),
                    classifier: classifier.unwrap_or_default(),
                };
                config.opinions = BTreeMap::from([(BAG.to_owned(), OpinionConfig::Machines(bag))]);
            }
        }
        if let Some(WrittenCue::FrameLbp(WeightedPatterns { weight, patterns })) = cue {
            config = config.with_patterns(weight, patterns);
        }
        Ok(config)
    }
}

impl Default for Config {
    fn default() -> Self {
        Self::of_machines(MachinesConfig::default())
    }
}

impl Config {
    /// A model of machines over local features alone, as in the papers.
    pub fn of_machines(machines: MachinesConfig) -> Self {
        Self {
            longest_side: 640,
            seed: 0,
            early_precision: ALWAYS_ALL,
            calibration: CalibrationConfig::default(),
            weights: BTreeMap::new(),
            opinions: BTreeMap::from([(BAG.to_owned(), OpinionConfig::Machines(machines))]),
        }
    }

    /// The same with the machines of the opinion [`BAG`] changed, or with some where there are none.
    pub fn with_bag(&self, change: impl FnOnce(&mut MachinesConfig)) -> Self {
        let mut machines = self.machines().cloned().unwrap_or_default();
        change(&mut machines);
        let mut config = self.clone();
        config.opinions.insert(BAG.to_owned(), OpinionConfig::Machines(machines));
        config
    }

    /// The same with an opinion [`PATTERNS`] on whole frames, which counts `weight`, from 0 to 1; the opinion [`BAG`]
    /// counts the rest.
    pub fn with_patterns(mut self, weight: f64, patterns: PatternsConfig) -> Self {
        self.opinions.insert(PATTERNS.to_owned(), OpinionConfig::Patterns(patterns));
        self.weights = BTreeMap::from([(BAG.to_owned(), 1.0 - weight), (PATTERNS.to_owned(), weight)]);
        self
    }

    /// The machines over local features of the opinion [`BAG`], if there are.
    pub fn machines(&self) -> Option<&MachinesConfig> {
        match self.opinions.get(BAG) {
            Some(OpinionConfig::Machines(machines)) => Some(machines),
            _ => None,
        }
    }

    /// The same model without the opinions that `is_wanted` does not want.
    pub fn with_opinions(&self, is_wanted: impl Fn(&str) -> bool) -> Self {
        let mut config = self.clone();
        config.opinions.retain(|name, _| is_wanted(name));
        config.weights.retain(|name, _| is_wanted(name));
        config
    }

    /// Everything that is seen of a frame, once each. All that decides what an [`super::Extractor`] finds in a frame is
    /// here and in [`Config::longest_side`].
    pub fn sights(&self) -> Vec<Sight> {
        let mut sights: Vec<Sight> = Vec::new();
        for sight in self.opinions.values().map(OpinionConfig::sight) {
            if !sights.contains(&sight) {
                sights.push(sight);
            }
        }
        sights
    }

    /// The names of the networks that are looked through.
    pub fn network_names(&self) -> BTreeSet<String> {
        self.sights().iter().filter_map(Sight::lens).map(|lens| lens.network.clone()).collect()
    }

    /// Gives the opinions that look through networks these; each is tried. Without that the configuration is not
    /// complete. The error says what to do.
    pub fn link(&mut self, networks: &Networks) -> Result<(), NetworkError> {
        self.opinions
            .values_mut()
            .filter_map(OpinionConfig::lens_mut)
            .try_for_each(|lens| lens.link(networks))
    }

    /// The networks that it was linked to.
    pub fn networks(&self) -> Networks {
        let sights = self.sights();
        let lenses = sights.iter().filter_map(Sight::lens);
        lenses.filter_map(|lens| Some((lens.network.clone(), Arc::clone(lens.carried()?)))).collect()
    }

    /// With the same, frames need not be described again.
    pub fn extraction(&self) -> (usize, Vec<Sight>) {
        (self.longest_side, self.sights())
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
        if !(0.0..=1.0).contains(&self.early_precision) {
            return Err("early_precision must be from 0 to 1".to_owned());
        }
        if !(1..=MAX_OPINIONS).contains(&self.opinions.len()) {
            let n_opinions = self.opinions.len();
            return Err(format!("a model has 1 to {MAX_OPINIONS} opinions, not {n_opinions}"));
        }
        for (name, opinion) in &self.opinions {
            check_name(name)?;
            let of_opinion = |error: String| match name.as_str() {
                BAG => error,
                _ => format!("of the opinion {name}, {error}"),
            };
            opinion.check().map_err(of_opinion)?;
            opinion.sight().check(self.longest_side).map_err(of_opinion)?;
        }
        self.check_weights()
    }

    fn check_weights(&self) -> Result<(), String> {
        if let Some(name) = self.weights.keys().find(|name| !self.opinions.contains_key(*name)) {
            return Err(format!("weights.{name} is the weight of an opinion that there is not"));
        }
        match self.weights.iter().find(|(_, weight)| !(0.0..=10.0).contains(*weight)) {
            Some((name, weight)) => {
                Err(format!("the weight of an opinion must be from 0 to 10, not {weight} as of {name}"))
            }
            None => Ok(()),
        }
    }

    /// The weights of all opinions, in their order, where all are given.
    pub(crate) fn given_weights(&self) -> Option<Vec<f64>> {
        match self.opinions.len() {
            1 => Some(vec![1.0]),
            _ => self.opinions.keys().map(|name| self.weights.get(name).copied()).collect(),
        }
    }

    /// How much each opinion counts where nothing is known of how well they do, in their order.
    pub(crate) fn prior_weights(&self) -> Vec<f64> {
        self.opinions.values().map(OpinionConfig::prior_weight).collect()
    }
}

/// Names of opinions are names of tables and of arrays.
fn check_name(name: &str) -> Result<(), String> {
    let is_plain = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_';
    if name.is_empty() || name.len() > MAX_NAME_LENGTH || !name.bytes().all(is_plain) {
        return Err(format!(
            "an opinion is named by 1 to {MAX_NAME_LENGTH} small letters, digits and underscores, not {name:?}"
        ));
    }
    Ok(())
}
