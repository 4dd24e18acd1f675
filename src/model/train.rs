//! Labeled frames to a model.

use super::held_out::{self, Decided, Fusion, HeldOutFrames, Outcome, spread_out};
use super::learned::LearnedFrames;
use super::opinion::{Chosen, Learner, Opinion, OpinionConfig, Trained};
use super::sight::Seen;
use super::{Card, Classification, Config, Extractor, Features, Model, Recognition, is_known};
use crate::boost::BoostError;
use crate::camera::Camera;
use crate::filter::Transitions;
use crate::folds::{folds, spread_single_fold_labels};
use crate::memory::MemoryError;
use crate::svm::{self, SvmError};
use crate::vocabulary::VocabularyError;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::sync::Arc;

/// One labeled frame, described.
#[derive(Clone, Debug)]
pub struct Sample {
    /// The room that it shows.
    pub place: String,
    /// The drive that it comes from; empty when unknown.
    pub sequence: String,
    /// What it is called, such as its path in the data set; may be empty.
    pub name: String,
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
    /// What one of several opinions cannot learn.
    #[error("of the opinion {name}: {error}")]
    Opinion {
        /// Its name.
        name: String,
        /// Why not.
        error: Box<Self>,
    },
    /// Samples of an extractor of another configuration.
    #[error("the frames were described for another configuration: describe them for this one")]
    OtherSights,
    /// Fewer than two rooms.
    #[error("a model needs frames of at least two rooms; these show {0}")]
    TooFewPlaces(usize),
    /// No vocabulary.
    #[error(transparent)]
    Vocabulary(#[from] VocabularyError),
    /// No support vector machine.
    #[error(transparent)]
    Svm(#[from] SvmError),
    /// No memory.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// No ensembles.
    #[error(transparent)]
    Boost(#[from] BoostError),
}

impl TrainError {
    /// The same of an opinion.
    fn of(self, name: &str) -> Self {
        Self::Opinion { name: name.to_owned(), error: Box::new(self) }
    }
}

impl Model {
    /// Trains on samples that were described by `extractor`, which was made from the same `config`.
    ///
    /// Probabilities and weights of opinions are fitted on held-out folds; see [`crate::folds`]. Where no room has two
    /// frames nothing can be held out: they are those that are taken where nothing is known, and no answer is known.
    /// The result depends on the arguments alone. Samples do not say when they were taken: transitions between rooms are left to
    /// [`Model::with_transitions`]. `progress` is called before each step.
    pub fn train(
        samples: &[&Sample],
        config: &Config,
        camera: Camera,
        progress: impl FnMut(TrainingStep),
    ) -> Result<Training, TrainError> {
        Trials::run(samples, config, progress)?.finish(config, camera)
    }
}

/// Opinions that were tried on held-out frames: what models of all of them, or of some, would answer.
pub struct Trials<'a> {
    samples: &'a [&'a Sample],
    places: Vec<String>,
    /// One class a sample.
    labels: Vec<usize>,
    folds: Vec<usize>,
    /// Of all opinions.
    config: &'a Config,
    opinions: Vec<Tried<'a>>,
    decisions: Vec<Decision>,
}

/// An opinion, what it sees of all samples, and what its trainings have in common.
struct Tried<'a> {
    name: &'a str,
    config: &'a OpinionConfig,
    seen: Vec<&'a Seen>,
    learner: Learner<'a>,
    /// On all samples, once that was needed.
    trained: Option<Arc<Trained>>,
}

/// What was decided of a sample by opinions trained without its fold.
struct Decision {
    sample_idx: usize,
    decided: Decided,
}

impl<'a> Trials<'a> {
    /// Trains every opinion of `config` without each fold, and lets it decide the frames of the fold.
    ///
    /// # Errors
    /// Parameters that make no sense, fewer than two rooms, what no opinion can learn.
    pub fn run(
        samples: &'a [&'a Sample],
        config: &'a Config,
        mut progress: impl FnMut(TrainingStep),
    ) -> Result<Self, TrainError> {
        config.check().map_err(TrainError::Config)?;
        let names: BTreeSet<&str> = samples.iter().map(|sample| sample.place.as_str()).collect();
        let places: Vec<String> = names.into_iter().map(str::to_owned).collect();
        if places.len() < 2 {
            return Err(TrainError::TooFewPlaces(places.len()));
        }
        let labels: Vec<usize> =
            samples.iter().map(|sample| places.binary_search(&sample.place).unwrap_or_default()).collect();
        let tried = |(name, opinion): (&'a String, &'a OpinionConfig)| {
            let sight = opinion.sight();
            let seen = samples.iter().map(|sample| sample.features.of(&sight));
            let seen: Vec<&Seen> = seen.collect::<Option<_>>().ok_or(TrainError::OtherSights)?;
            let learner = opinion.learner(&seen, config.seed).map_err(|error| error.of(name))?;
            Ok(Tried { name, config: opinion, seen, learner, trained: None })
        };
        let opinions = config.opinions.iter().map(tried).collect::<Result<_, TrainError>>()?;
        let mut trials =
            Self { samples, places, labels, folds: Vec::new(), config, opinions, decisions: Vec::new() };
        trials.folds = trials.deal();
        let n_folds = trials.folds.iter().max().map_or(0, |last| last + 1);
        for fold in 0..n_folds {
            progress(TrainingStep { n_done: fold, n_steps: n_folds + 1 });
            let decisions = trials.decide_held_out(fold)?;
            trials.decisions.extend(decisions);
        }
        progress(TrainingStep { n_done: n_folds, n_steps: n_folds + 1 });
        Ok(trials)
    }

    /// The rooms, sorted.
    pub fn places(&self) -> &[String] {
        &self.places
    }

    pub(super) fn n_samples(&self) -> usize {
        self.samples.len()
    }

    /// Whether a sample shows a room.
    pub(super) fn shows(&self, sample_idx: usize, place_idx: usize) -> bool {
        self.labels[sample_idx] == place_idx
    }

    /// What a model of some of the opinions would answer to the samples: each fold's answers, calibrated on the other folds;
    /// on all where there is only one. `config` is that of the trials with fewer opinions.
    ///
    /// # Errors
    /// No calibration.
    pub fn held_out(&self, config: &Config) -> Result<Vec<HeldOut>, TrainError> {
        let decisions = self.decisions_of(config);
        let answered: BTreeSet<usize> =
            decisions.iter().map(|decision| self.folds[decision.sample_idx]).collect();
        let all: Vec<&Decided> = decisions.iter().map(|decision| &decision.decided).collect();
        let mut held_out = Vec::with_capacity(decisions.len());
        for &fold in &answered {
            let is_other = |decision: &&Decision| self.folds[decision.sample_idx] != fold;
            let others: Vec<&Decided> =
                decisions.iter().filter(is_other).map(|decision| &decision.decided).collect();
            let others = if others.is_empty() { &all } else { &others };
            let fusion = Fusion::fit(config, self.places.len(), others, &all)?;
            for decision in decisions.iter().filter(|decision| !is_other(decision)) {
                let probabilities = fusion.probabilities(&decision.decided, self.places.len());
                let recognition = Recognition {
                    place_idx: svm::most_probable(&probabilities),
                    known: false,
                    probabilities,
                    n_keypoints: self.samples[decision.sample_idx].features.n_keypoints(),
                };
                held_out.push(HeldOut { sample_idx: decision.sample_idx, recognition });
            }
        }
        held_out.sort_by_key(|answer| answer.sample_idx);
        Ok(held_out)
    }

    /// Trains a model of some of the opinions on all samples. `config` is as for [`Trials::held_out`]. Models of the
    /// same trials share their opinions.
    ///
    /// # Errors
    /// What an opinion cannot learn; no calibration.
    pub fn finish(&mut self, config: &Config, camera: Camera) -> Result<Training, TrainError> {
        let held_out = self.held_out(config)?;
        let decisions = self.decisions_of(config);
        let decided: Vec<&Decided> = decisions.iter().map(|decision| &decision.decided).collect();
        let fusion = Fusion::fit(config, self.places.len(), &decided, &decided)?;
        let all: Vec<usize> = (0..self.samples.len()).collect();
        let mut opinions = Vec::new();
        let wanted = self.opinions.iter_mut().zip(self.config.opinions.keys());
        let wanted = wanted.filter(|(_, name)| config.opinions.contains_key(*name));
        for ((tried, _), (calibration, weight)) in
            wanted.zip(fusion.calibrations.into_iter().zip(fusion.weights))
        {
            let trained = match &tried.trained {
                Some(trained) => Arc::clone(trained),
                None => {
                    let trained = Arc::new(tried.train(&all, &self.labels)?.trained);
                    Arc::clone(tried.trained.insert(trained))
                }
            };
            opinions.push(Opinion { sight: tried.config.sight(), trained, calibration, weight });
        }
        let known_probability = self.known_probability(&held_out);
        let held_out = held_out.into_iter().map(|mut answer| {
            answer.recognition.known = is_known(answer.recognition.probability(), known_probability);
            answer
        });
        let model = Model {
            config: config.clone(),
            transitions: Transitions::unlearned(self.places.len()),
            extractor: Extractor::new(config, camera),
            classification: Classification {
                n_places: self.places.len(),
                opinions,
                doubt: fusion.doubt,
                known_probability,
            },
            learned: LearnedFrames::new(self.samples, &self.labels),
            held_out: HeldOutFrames::new(decided.into_iter().cloned().collect()).thinned(),
            places: self.places.clone(),
            networks: config.networks(),
            card: Card::default(),
        };
        Ok(Training { model, held_out: held_out.collect() })
    }

    fn deal(&self) -> Vec<usize> {
        let sequences: Vec<&str> = self.samples.iter().map(|sample| sample.sequence.as_str()).collect();
        let n_folds = self.config.calibration.n_folds;
        let mut folds = folds(&sequences, &self.labels, n_folds, self.config.seed);
        spread_single_fold_labels(&mut folds, &self.labels, n_folds);
        folds
    }

    /// Samples of rooms that occur in no other fold cannot be answered, and samples in which no opinion sees
    /// anything say nothing: both are left out.
    fn decide_held_out(&self, fold: usize) -> Result<Vec<Decision>, TrainError> {
        let (held_out, training): (Vec<usize>, Vec<usize>) =
            (0..self.folds.len()).partition(|&sample_idx| self.folds[sample_idx] == fold);
        let known: BTreeSet<usize> = training.iter().map(|&idx| self.labels[idx]).collect();
        let held_out: Vec<usize> =
            held_out.into_iter().filter(|&idx| known.contains(&self.labels[idx])).collect();
        if held_out.is_empty() || known.len() < 2 {
            return Ok(Vec::new());
        }
        let fitted: Vec<Fitted> = self
            .opinions
            .iter()
            .map(|tried| tried.train(&training, &self.labels))
            .collect::<Result<_, _>>()?;
        let decide = |&sample_idx: &usize| {
            let by = |(tried, fitted): (&Tried, &Fitted)| {
                let values = fitted.trained.decision_values(tried.seen[sample_idx])?;
                Some(spread_out(tried.config.way(), &fitted.present, self.places.len(), &values))
            };
            let values: Vec<_> = self.opinions.iter().zip(&fitted).map(by).collect();
            let decided = Decided { label: self.labels[sample_idx], values };
            Decision { sample_idx, decided }
        };
        Ok(held_out.par_iter().map(decide).collect())
    }

    /// The decisions of the opinions of `config` in which one of them saw something.
    fn decisions_of(&self, config: &Config) -> Vec<Decision> {
        let is_wanted: Vec<bool> =
            self.config.opinions.keys().map(|name| config.opinions.contains_key(name)).collect();
        let of_wanted = |Decision { sample_idx, decided }: &Decision| {
            let values = decided.values.iter().zip(&is_wanted).filter(|(_, is_wanted)| **is_wanted);
            let values: Vec<_> = values.map(|(values, _)| values.clone()).collect();
            let decided = Decided { label: decided.label, values };
            let is_seen = decided.values.iter().any(Option::is_some);
            is_seen.then_some(Decision { sample_idx: *sample_idx, decided })
        };
        self.decisions.iter().filter_map(of_wanted).collect()
    }

    fn known_probability(&self, held_out: &[HeldOut]) -> Option<f32> {
        let outcome = |answer: &HeldOut| Outcome {
            probability: answer.recognition.probability(),
            is_right: answer.recognition.place_idx == self.labels[answer.sample_idx],
        };
        held_out::known_probability(held_out.iter().map(outcome).collect(), &self.config.calibration)
    }
}

impl Tried<'_> {
    /// Trains on the samples of these indices.
    fn train(&self, sample_idxs: &[usize], labels: &[usize]) -> Result<Fitted, TrainError> {
        let labels: Vec<usize> = sample_idxs.iter().map(|&idx| labels[idx]).collect();
        let present: Vec<usize> = labels.iter().copied().collect::<BTreeSet<_>>().into_iter().collect();
        let dense: Vec<usize> =
            labels.iter().map(|label| present.binary_search(label).unwrap_or_default()).collect();
        let chosen = Chosen { frame_idxs: sample_idxs, labels: &dense, n_classes: present.len() };
        let trained = self.learner.train(&self.seen, &chosen).map_err(|error| error.of(self.name))?;
        Ok(Fitted { trained, present })
    }
}

/// What was trained, and the classes that it was trained on.
struct Fitted {
    trained: Trained,
    /// Sorted.
    present: Vec<usize>,
}
