//! Labeled frames to a model.

use super::cue::{Opinion, Sight, pooled};
use super::held_out::{self, HeldOutDecisions, spread_out};
use super::machines::{Machines, TrainingSet};
use super::{Card, Classification, Classifier, Config, Extractor, Features, Model, Recognition, is_known};
use crate::boost::BoostError;
use crate::camera::Camera;
use crate::filter::Transitions;
use crate::folds::{folds, spread_single_fold_labels};
use crate::svm::{self, Calibration, SvmError};
use crate::vocabulary::VocabularyError;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// One labeled frame, described.
#[derive(Clone, Debug)]
pub struct Sample {
    /// The room that it shows.
    pub place: String,
    /// The drive that it comes from; empty when unknown.
    pub sequence: String,
    /// What an [`Extractor`] of the model's configuration and camera found.
    pub features: Features,
}

/// A model and how it did on frames it had not seen.
#[derive(Debug)]
pub struct Training {
    /// The model, trained on all samples.
    pub model: Model,
    /// Answers to samples by models trained without the sample's fold.
    pub held_out: Vec<HeldOut>,
}

/// The answer to a sample by a model trained and calibrated without it.
#[derive(Clone, Debug)]
pub struct HeldOut {
    /// Which sample.
    pub sample_idx: usize,
    /// The answer; its places are [`Model::places`].
    pub recognition: Recognition,
}

/// What training is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrainingStep {
    /// Steps done.
    pub n_done: usize,
    /// All steps.
    pub n_steps: usize,
}

/// Why no model was made.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// A parameter makes no sense.
    #[error("the configuration is wrong: {0}")]
    Config(String),
    /// Fewer than two rooms.
    #[error("a model needs frames of at least two rooms; these show {0}")]
    TooFewPlaces(usize),
    /// No fold could be held out.
    #[error(
        "no room has two frames, so none can be held out to measure probabilities: take more frames a room"
    )]
    NothingHeldOut,
    /// No vocabulary.
    #[error(transparent)]
    Vocabulary(#[from] VocabularyError),
    /// No support vector machine.
    #[error(transparent)]
    Svm(#[from] SvmError),
    /// No ensembles.
    #[error(transparent)]
    Boost(#[from] BoostError),
}

impl Model {
    /// Trains on samples that were described by `extractor`, which was made from the same `config`.
    ///
    /// Probabilities are calibrated on held-out folds; see [`crate::folds`]. The result depends on the
    /// arguments alone. Samples do not say when they were taken: transitions between rooms are left to
    /// [`Model::with_transitions`]. `progress` is called before each step.
    pub fn train(
        samples: &[&Sample],
        config: &Config,
        camera: Camera,
        mut progress: impl FnMut(TrainingStep),
    ) -> Result<Training, TrainError> {
        config.check().map_err(TrainError::Config)?;
        let names: BTreeSet<&str> = samples.iter().map(|sample| sample.place.as_str()).collect();
        let places: Vec<String> = names.into_iter().map(str::to_owned).collect();
        if places.len() < 2 {
            return Err(TrainError::TooFewPlaces(places.len()));
        }
        let labels: Vec<usize> =
            samples.iter().map(|sample| places.binary_search(&sample.place).unwrap_or_default()).collect();
        let set = TrainingSet::new(
            samples.iter().map(|sample| &sample.features).collect(),
            config,
            camera.projection.kind(),
        )?;
        let trainer = Trainer { samples, labels: &labels, n_places: places.len(), config, set };

        let folds = trainer.folds();
        let n_folds = folds.iter().max().map_or(0, |last| last + 1);
        let n_steps = n_folds + 1;
        let mut decisions = Vec::new();
        for fold in 0..n_folds {
            progress(TrainingStep { n_done: fold, n_steps });
            decisions.extend(trainer.decide_held_out(&folds, fold)?);
        }
        let held_out = trainer.recognize_held_out(&folds, &decisions)?;
        progress(TrainingStep { n_done: n_folds, n_steps });

        let machines = trainer.fit(&(0..samples.len()).collect::<Vec<_>>())?.machines;
        let calibrations = trainer.calibrate(&decisions, |_| true)?;
        let weights = config.sights().map(|sight| config.weight(sight));
        let opinions = machines.into_iter().zip(calibrations).zip(weights);
        let opinions = opinions
            .map(|((machines, calibration), weight)| Opinion { machines, calibration, weight })
            .collect();
        let known_probability = trainer.known_probability(&held_out);
        let classification = Classification { opinions, known_probability };
        let held_out = held_out.into_iter().map(|mut answer| {
            answer.recognition.known = is_known(answer.recognition.probability(), known_probability);
            answer
        });
        let held_out: Vec<HeldOut> = held_out.collect();
        let model = Self {
            config: config.clone(),
            transitions: Transitions::unlearned(places.len()),
            places,
            extractor: Extractor::new(config, camera),
            classification,
            held_out: matches!(config.classifier, Classifier::KernelSvm(_))
                .then(|| trainer.gathered((0, Sight::Keypoints), decisions.iter()).thinned()),
            card: Card::default(),
        };
        progress(TrainingStep { n_done: n_steps, n_steps });
        Ok(Training { model, held_out })
    }
}

struct Trainer<'a> {
    samples: &'a [&'a Sample],
    /// One class a sample.
    labels: &'a [usize],
    n_places: usize,
    config: &'a Config,
    set: TrainingSet<'a>,
}

/// The decision values for a sample by machines trained without its fold: a list for each sight, of which at
/// least one saw something.
struct Decision {
    sample_idx: usize,
    values: Vec<Option<Vec<f32>>>,
}

impl Trainer<'_> {
    fn folds(&self) -> Vec<usize> {
        let sequences: Vec<&str> = self.samples.iter().map(|sample| sample.sequence.as_str()).collect();
        let n_folds = self.config.calibration.n_folds;
        let mut folds = folds(&sequences, self.labels, n_folds, self.config.seed);
        spread_single_fold_labels(&mut folds, self.labels, n_folds);
        folds
    }

    /// Machines trained on the samples of these indices.
    fn fit(&self, sample_idxs: &[usize]) -> Result<Fitted, TrainError> {
        let labels: Vec<usize> = sample_idxs.iter().map(|&idx| self.labels[idx]).collect();
        let present: Vec<usize> = labels.iter().copied().collect::<BTreeSet<_>>().into_iter().collect();
        let dense: Vec<usize> =
            labels.iter().map(|label| present.binary_search(label).unwrap_or_default()).collect();
        let train = |sight| Machines::train(sight, &self.set, sample_idxs, (&dense, present.len()));
        let machines = self.config.sights().map(train).collect::<Result<_, _>>()?;
        Ok(Fitted { machines, present })
    }

    /// Samples of rooms that occur in no other fold cannot be answered, and samples in which no sight sees
    /// anything say nothing of the machines: both are left out.
    fn decide_held_out(&self, folds: &[usize], fold: usize) -> Result<Vec<Decision>, TrainError> {
        let (held_out, training): (Vec<usize>, Vec<usize>) =
            (0..folds.len()).partition(|&sample_idx| folds[sample_idx] == fold);
        let known: BTreeSet<usize> = training.iter().map(|&idx| self.labels[idx]).collect();
        let held_out: Vec<usize> =
            held_out.into_iter().filter(|&idx| known.contains(&self.labels[idx])).collect();
        if held_out.is_empty() || known.len() < 2 {
            return Ok(Vec::new());
        }
        let fitted = self.fit(&training)?;
        let decide = |&sample_idx: &usize| {
            let features = &self.samples[sample_idx].features;
            let by = |(machines, sight): (&Machines, Sight)| {
                let values = machines.decision_values(features)?;
                Some(spread_out(self.config.scheme(sight), &fitted.present, self.n_places, &values))
            };
            let values: Vec<_> = fitted.machines.iter().zip(self.config.sights()).map(by).collect();
            values.iter().any(Option::is_some).then_some(Decision { sample_idx, values })
        };
        Ok(held_out.par_iter().filter_map(decide).collect())
    }

    /// The decisions of one sight, where it saw something.
    fn gathered<'a>(
        &self,
        (sight_idx, sight): (usize, Sight),
        decisions: impl Iterator<Item = &'a Decision>,
    ) -> HeldOutDecisions {
        let mut gathered = HeldOutDecisions::new(self.config.scheme(sight).n_machines(self.n_places));
        for decision in decisions {
            if let Some(values) = &decision.values[sight_idx] {
                gathered.push(values, self.labels[decision.sample_idx]);
            }
        }
        gathered
    }

    /// One calibration a sight, on the decisions that are wanted; on all where it saw something in none of those.
    fn calibrate(
        &self,
        decisions: &[Decision],
        is_wanted: impl Fn(&Decision) -> bool,
    ) -> Result<Vec<Calibration>, TrainError> {
        let calibrate = |(sight_idx, sight)| {
            let wanted = decisions.iter().filter(|decision| is_wanted(decision));
            let mut gathered = self.gathered((sight_idx, sight), wanted);
            if gathered.is_empty() {
                gathered = self.gathered((sight_idx, sight), decisions.iter());
            }
            gathered.calibration(self.config.scheme(sight), self.n_places, self.config.calibration.sigmoids)
        };
        self.config.sights().enumerate().map(calibrate).collect()
    }

    /// Each fold's answers, calibrated on the other folds; on all where there is only one.
    fn recognize_held_out(
        &self,
        folds: &[usize],
        decisions: &[Decision],
    ) -> Result<Vec<HeldOut>, TrainError> {
        let fold_of = |decision: &Decision| folds[decision.sample_idx];
        let answered: BTreeSet<usize> = decisions.iter().map(fold_of).collect();
        let mut held_out = Vec::with_capacity(decisions.len());
        for &fold in &answered {
            let calibrations = self.calibrate(decisions, |decision| fold_of(decision) != fold)?;
            for decision in decisions.iter().filter(|decision| fold_of(decision) == fold) {
                let of_sights = self.config.sights().zip(calibrations.iter().zip(&decision.values));
                let probabilities = pooled(of_sights.filter_map(|(sight, (calibration, values))| {
                    Some((self.config.weight(sight), calibration.probabilities(values.as_ref()?)))
                }));
                let place_idx = svm::most_probable(&probabilities);
                let n_keypoints = self.samples[decision.sample_idx].features.keypoints.len();
                let recognition = Recognition { place_idx, known: false, probabilities, n_keypoints };
                held_out.push(HeldOut { sample_idx: decision.sample_idx, recognition });
            }
        }
        held_out.sort_by_key(|answer| answer.sample_idx);
        Ok(held_out)
    }

    fn known_probability(&self, held_out: &[HeldOut]) -> Option<f32> {
        let is_right = |answer: &HeldOut| {
            let is_right = answer.recognition.place_idx == self.labels[answer.sample_idx];
            (answer.recognition.probability(), is_right)
        };
        held_out::known_probability(held_out.iter().map(is_right).collect(), &self.config.calibration)
    }
}

/// Machines, and the classes that they were trained on.
struct Fitted {
    /// One for each sight.
    machines: Vec<Machines>,
    /// Sorted.
    present: Vec<usize>,
}
