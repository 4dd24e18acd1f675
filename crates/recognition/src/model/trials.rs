//! Opinions tried on held-out frames, and the model that comes of it.

mod finish;

use crate::folds::{folds, spread_single_fold_labels};
use crate::look::sight::Seen;
use crate::model::config::Config;
use crate::model::held_out::{Answer, Decided, Fusion, TELLABLE, spread_out};
use crate::model::left_out::{ENOUGH_FRAMES, Round, RoundDecision, rounds};
use crate::model::sample::Sample;
use crate::model::training::{HeldOut, TrainingStep};
use crate::opinions::error::TrainError;
use crate::opinions::{Chosen, Learner, OpinionConfig, Said, Trained};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Opinions that were tried on held-out frames: what models of all of them, or of some, would answer.
pub struct Trials<'a> {
    /// All that were given.
    given: &'a [&'a Sample],
    /// Which of them show rooms. Samples are numbered among these from here on.
    sample_idxs: Vec<usize>,
    samples: Vec<&'a Sample>,
    rooms: Vec<String>,
    /// One class a sample.
    labels: Vec<usize>,
    folds: Vec<usize>,
    n_folds: usize,
    are_single_frames: bool,
    /// What is trained to tell places that were never trained.
    rounds: Vec<Round>,
    /// Of all opinions.
    config: &'a Config,
    opinions: Vec<Tried<'a>>,
    decisions: Vec<Decision>,
    /// Frames of elsewhere, as each was decided without one of the folds.
    elsewhere: Vec<RoundDecision>,
}

/// What is held out together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Whole drives, where there are several and each tells of the others.
    Drives,
    /// Single frames, also of drives.
    Frames,
}

/// An opinion, what it sees of all samples, and what its trainings have in common.
struct Tried<'a> {
    name: &'a str,
    config: &'a OpinionConfig,
    seen: Vec<&'a Seen>,
    /// What it sees of the frames of elsewhere.
    seen_elsewhere: Vec<&'a Seen>,
    learner: Learner<'a>,
    /// On all samples, once that was needed.
    trained: Option<Arc<Trained>>,
    /// What it says of the frames of all rounds, one after the other, once that was needed.
    of_rounds: Option<Vec<Option<Said>>>,
}

/// What was decided of a sample by opinions trained without its fold.
struct Decision {
    sample_idx: usize,
    decided: Decided,
}

/// What opinions that were trained without a fold say.
#[derive(Default)]
struct FoldDecisions {
    /// Of the frames of the fold.
    held_out: Vec<Decision>,
    /// Of some frames of elsewhere.
    elsewhere: Vec<RoundDecision>,
}

impl<'a> Trials<'a> {
    /// Trains every opinion of `config` without each fold, and lets it decide the frames of the fold.
    ///
    /// # Errors
    /// Parameters that make no sense, fewer than two rooms, what no opinion can learn.
    pub fn run(
        given: &'a [&'a Sample],
        config: &'a Config,
        unit: Unit,
        mut progress: impl FnMut(TrainingStep),
    ) -> Result<Self, TrainError> {
        config.check().map_err(TrainError::Config)?;
        let (elsewhere, sample_idxs): (Vec<usize>, Vec<usize>) =
            (0..given.len()).partition(|&idx| given[idx].is_elsewhere());
        let samples: Vec<&Sample> = sample_idxs.iter().map(|&idx| given[idx]).collect();
        let elsewhere: Vec<&Sample> = spread(&elsewhere, ENOUGH_FRAMES).map(|&idx| given[idx]).collect();
        let names: BTreeSet<&str> = samples.iter().map(|sample| sample.room.as_str()).collect();
        let rooms: Vec<String> = names.into_iter().map(str::to_owned).collect();
        if rooms.len() < 2 {
            return Err(TrainError::TooFewRooms(rooms.len()));
        }
        let labels: Vec<usize> =
            samples.iter().map(|sample| rooms.binary_search(&sample.room).unwrap_or_default()).collect();
        let tried = |(name, opinion): (&'a String, &'a OpinionConfig)| {
            let sight = opinion.sight();
            let see = |samples: &[&'a Sample]| {
                let seen = samples.iter().map(|sample| sample.features.of(&sight));
                seen.collect::<Option<Vec<&Seen>>>().ok_or(TrainError::OtherSights)
            };
            let (seen, seen_elsewhere) = (see(&samples)?, see(&elsewhere)?);
            let learner = opinion.learner(&seen, config.seed).map_err(|error| error.of(name))?;
            let (trained, of_rounds) = (None, None);
            Ok(Tried { name, config: opinion, seen, seen_elsewhere, learner, trained, of_rounds })
        };
        let opinions = config.opinions.iter().map(tried).collect::<Result<_, TrainError>>()?;
        let sequence = |sample: &&'a Sample| if unit == Unit::Drives { sample.sequence.as_str() } else { "" };
        let sequences: Vec<&str> = samples.iter().map(sequence).collect();
        let mut trials = Self {
            given,
            sample_idxs,
            samples,
            rooms,
            labels,
            folds: Vec::new(),
            n_folds: 0,
            are_single_frames: false,
            rounds: Vec::new(),
            config,
            opinions,
            decisions: Vec::new(),
            elsewhere: Vec::new(),
        };
        trials.decide(&sequences, &mut progress)?;
        let has_sequences = sequences.iter().any(|sequence| *sequence != sequences[0]);
        if has_sequences && !trials.can_tell()? {
            trials.are_single_frames = true;
            trials.decide(&vec![""; sequences.len()], &mut progress)?;
        }
        Ok(trials)
    }

    /// Deals the samples into folds, whole sequences where there are several, and lets every opinion decide each fold.
    fn decide(
        &mut self,
        sequences: &[&str],
        mut progress: impl FnMut(TrainingStep),
    ) -> Result<(), TrainError> {
        self.folds = self.deal(sequences);
        self.n_folds = self.folds.iter().max().map_or(0, |last| last + 1);
        self.rounds = rounds(&self.folds, &self.labels, self.config.seed);
        self.decisions.clear();
        self.elsewhere.clear();
        for fold in 0..self.n_folds {
            progress(self.step(fold));
            let FoldDecisions { held_out, elsewhere } = self.decide_without(fold)?;
            self.decisions.extend(held_out);
            self.elsewhere.extend(elsewhere);
        }
        Ok(())
    }

    /// Whether held-out sequences tell how well rooms are told apart: below half of the frames right, they show other parts of
    /// the rooms than the others.
    fn can_tell(&self) -> Result<bool, TrainError> {
        let decisions = self.decisions_of(self.config);
        let answers = self.answers(self.config, &decisions)?;
        let is_right = |(_, answer): &(&usize, &Answer)| answer.outcome(None).is_right;
        let n_right = answers.iter().filter(is_right).count();
        Ok(n_right as f64 >= TELLABLE * answers.len() as f64)
    }

    fn step(&self, n_done: usize) -> TrainingStep {
        TrainingStep { n_done, n_steps: self.n_folds + self.rounds.len() + 1 }
    }

    /// The rooms, sorted.
    pub fn rooms(&self) -> &[String] {
        &self.rooms
    }

    /// Whether each sample that was given was answered, and with its room.
    pub(crate) fn is_right(&self, held_out: &[HeldOut]) -> Vec<bool> {
        let mut is_right = vec![false; self.given.len()];
        for HeldOut { sample_idx, recognition } in held_out {
            is_right[*sample_idx] = self.given[*sample_idx].room == self.rooms[recognition.room_idx];
        }
        is_right
    }

    /// What a model of some of the opinions would answer to the samples: each fold's answers, calibrated on the other folds;
    /// on all where there is only one. None is known. `config` is that of the trials with fewer opinions.
    ///
    /// # Errors
    /// No calibration.
    pub fn held_out(&self, config: &Config) -> Result<Vec<HeldOut>, TrainError> {
        let answers = self.answers(config, &self.decisions_of(config))?;
        let held_out =
            |(sample_idx, answer): (usize, Answer)| self.told(config, sample_idx, answer, None, None);
        Ok(answers.into_iter().map(held_out).collect())
    }

    /// The answers to decided samples, by sample.
    fn answers(
        &self,
        config: &Config,
        decisions: &[Decision],
    ) -> Result<BTreeMap<usize, Answer>, TrainError> {
        let answered: BTreeSet<usize> =
            decisions.iter().map(|decision| self.folds[decision.sample_idx]).collect();
        let all: Vec<&Decided> = decisions.iter().map(|decision| &decision.decided).collect();
        let mut answers = BTreeMap::new();
        for &fold in &answered {
            let is_other = |decision: &&Decision| self.folds[decision.sample_idx] != fold;
            let others: Vec<&Decided> =
                decisions.iter().filter(is_other).map(|decision| &decision.decided).collect();
            let others = if others.is_empty() { &all } else { &others };
            let fusion = Fusion::fit(config, self.rooms.len(), others, &all)?;
            for decision in decisions.iter().filter(|decision| !is_other(decision)) {
                let answer = fusion.answer(config, &decision.decided, self.rooms.len());
                answers.insert(decision.sample_idx, answer);
            }
        }
        Ok(answers)
    }

    fn deal(&self, sequences: &[&str]) -> Vec<usize> {
        let n_folds = self.config.calibration.n_folds;
        let mut folds = folds(sequences, &self.labels, n_folds, self.config.seed);
        spread_single_fold_labels(&mut folds, &self.labels, n_folds);
        folds
    }

    /// Lets opinions that are trained without a fold decide its samples, and its share of those of elsewhere. Samples of rooms
    /// that occur in no other fold cannot be answered, and samples in which no opinion sees anything say nothing: both are
    /// left out.
    fn decide_without(&self, fold: usize) -> Result<FoldDecisions, TrainError> {
        let (held_out, training): (Vec<usize>, Vec<usize>) =
            (0..self.folds.len()).partition(|&sample_idx| self.folds[sample_idx] == fold);
        let known: BTreeSet<usize> = training.iter().map(|&idx| self.labels[idx]).collect();
        let held_out: Vec<usize> =
            held_out.into_iter().filter(|&idx| known.contains(&self.labels[idx])).collect();
        if held_out.is_empty() || known.len() < 2 {
            return Ok(FoldDecisions::default());
        }
        let fitted: Vec<Fitted> = self
            .opinions
            .iter()
            .map(|tried| tried.train(&training, &self.labels))
            .collect::<Result<_, _>>()?;
        let decide = |&sample_idx: &usize| {
            let said = self.opinions.iter().zip(&fitted);
            let said = said.map(|(tried, fitted)| tried.answer(fitted, sample_idx, self.rooms.len()));
            let decided = Decided { label: self.labels[sample_idx], said: said.collect() };
            Decision { sample_idx, decided }
        };
        let n_rooms = self.rooms.len();
        let decide_elsewhere = |&idx: &usize| {
            let said = self.opinions.iter().zip(&fitted);
            let says = |(tried, fitted): (&Tried, &Fitted)| {
                fitted.says(tried, fitted.trained.answer(tried.seen_elsewhere[idx]), n_rooms)
            };
            let said = said.map(says);
            // It shows no room: any will do, and all in turn, so that forgetting one forgets few of these.
            let decided = Decided { label: idx % n_rooms, said: said.collect() };
            RoundDecision { number: idx, fold, decided, is_new: true }
        };
        let n_elsewhere = self.opinions.first().map_or(0, |tried| tried.seen_elsewhere.len());
        let elsewhere: Vec<usize> = (fold..n_elsewhere).step_by(self.n_folds).collect();
        Ok(FoldDecisions {
            held_out: held_out.par_iter().map(decide).collect(),
            elsewhere: elsewhere.par_iter().map(decide_elsewhere).collect(),
        })
    }

    /// The decisions of the opinions of `config` in which one of them saw something.
    fn decisions_of(&self, config: &Config) -> Vec<Decision> {
        let of_wanted = |Decision { sample_idx, decided }: &Decision| {
            Some(Decision { sample_idx: *sample_idx, decided: self.said_by(config, decided)? })
        };
        self.decisions.iter().filter_map(of_wanted).collect()
    }

    /// The same of frames of elsewhere, which are numbered on from those of the rounds.
    fn elsewhere_of(&self, config: &Config) -> Vec<RoundDecision> {
        let n_before: usize = self.rounds.iter().map(|round| round.frames.len()).sum();
        let of_wanted = |decision: &RoundDecision| {
            let decided = self.said_by(config, &decision.decided)?;
            Some(RoundDecision { number: n_before + decision.number, decided, ..*decision })
        };
        self.elsewhere.iter().filter_map(of_wanted).collect()
    }

    /// What the opinions of `config` say, if one of them saw something.
    fn said_by(&self, config: &Config, decided: &Decided) -> Option<Decided> {
        let said = decided.said.iter().zip(self.config.opinions.keys());
        let said = said.filter(|(_, name)| config.opinions.contains_key(*name)).map(|(said, _)| said.clone());
        let said: Vec<Option<Said>> = said.collect();
        said.iter().any(Option::is_some).then_some(Decided { label: decided.label, said })
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

    /// What it says of a sample, among all rooms, when it was trained so.
    fn answer(&self, fitted: &Fitted, sample_idx: usize, n_rooms: usize) -> Option<Said> {
        fitted.says(self, self.learner.answer(&fitted.trained, &self.seen, sample_idx), n_rooms)
    }
}

/// What was trained, and the classes that it was trained on.
struct Fitted {
    trained: Trained,
    /// Sorted.
    present: Vec<usize>,
}

impl Fitted {
    /// What an opinion that was trained so said, among all rooms.
    fn says(&self, tried: &Tried, said: Option<Said>, n_rooms: usize) -> Option<Said> {
        let said = said?;
        let values = spread_out(tried.config.way(), &self.present, n_rooms, &said.values);
        Some(said.with_values(values))
    }
}

/// At most so many of them, evenly spread.
fn spread<T>(all: &[T], n_most: usize) -> impl Iterator<Item = &T> {
    all.iter().step_by(all.len().div_ceil(n_most).max(1))
}
