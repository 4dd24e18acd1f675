//! The model that comes of trials.

use super::{Trials, Tried};
use crate::filter::Transitions;
use crate::model::card::{Card, EarlyAnswers};
use crate::model::cascade::{Chosen, Early, choose, parts};
use crate::model::config::Config;
use crate::model::extractor::Extractor;
use crate::model::held_out::{Answer, Decided, Fusion, HeldOutFrames};
use crate::model::known::{Known, Outcomes};
use crate::model::learned::LearnedFrames;
use crate::model::left_out::{Judged, Round, RoundDecision, RoundFrame, judge};
use crate::model::training::{HeldOut, Training, TrainingStep};
use crate::model::{Classification, Model, Recognition};
use crate::opinions::error::TrainError;
use crate::opinions::{Opinion, Said};
use rayon::prelude::*;
use roomsight_vision::camera::Camera;
use std::collections::BTreeMap;
use std::sync::Arc;

/// What is fitted to held-out frames for some of the opinions.
struct Fit {
    fusion: Fusion,
    /// By sample.
    answers: BTreeMap<usize, Answer>,
    /// Of frames of left-out rooms and of others beside.
    rounds: Vec<RoundDecision>,
    judged: Judged,
}

/// Opinions that answer early, and what was fitted for them.
struct EarlyFit {
    early: Early,
    fit: Fit,
}

impl Trials<'_> {
    /// Trains a model of some of the opinions on all samples. `config` is as for [`Trials::held_out`]. Models of the
    /// same trials share their opinions. `progress` is called before each step.
    ///
    /// # Errors
    /// What an opinion cannot learn; no calibration.
    pub fn finish(
        &mut self,
        config: &Config,
        camera: Camera,
        mut progress: impl FnMut(TrainingStep),
    ) -> Result<Training, TrainError> {
        let fit = self.fit(config, &mut progress)?;
        progress(self.step(self.n_folds + self.rounds.len()));
        let classification = self.classification(config, &fit)?;
        let (early, answers) = self.early(config, &fit)?;
        let held_out = self.answered(config, &fit, &early);
        let decided = self.decisions_of(config).into_iter().map(|decision| decision.decided);
        let new = fit.rounds.into_iter().filter(|decision| decision.is_new).map(|decision| decision.decided);
        let model = Model {
            config: config.clone(),
            transitions: Transitions::unlearned(self.rooms.len()),
            extractor: Extractor::new(config, camera),
            classification,
            early: early.into_iter().map(|fit| fit.early).collect(),
            learned: LearnedFrames::new(&self.samples, &self.labels),
            held_out: HeldOutFrames::new(decided.collect()).thinned(),
            left_out: HeldOutFrames::new(new.collect()).thinned(),
            rooms: self.rooms.clone(),
            networks: config.networks(),
            card: Card { early: answers, ..Card::default() },
        };
        Ok(Training { model, held_out, are_single_frames: self.are_single_frames })
    }

    fn fit(&mut self, config: &Config, progress: &mut dyn FnMut(TrainingStep)) -> Result<Fit, TrainError> {
        let n_rooms = self.rooms.len();
        let decisions = self.decisions_of(config);
        let decided: Vec<&Decided> = decisions.iter().map(|decision| &decision.decided).collect();
        let fusion = Fusion::fit(config, n_rooms, &decided, &decided)?;
        let mut rounds = self.decide_rounds(config, progress)?;
        rounds.extend(self.elsewhere_of(config));
        let answers = self.answers(config, &decisions)?;
        let judged = judge(config, &fusion, &answers, &self.folds, &rounds, n_rooms);
        Ok(Fit { fusion, answers, rounds, judged })
    }

    /// Opinions that are trained on all samples, and what was fitted for them.
    fn classification(&mut self, config: &Config, fit: &Fit) -> Result<Classification, TrainError> {
        let Fit { fusion: Fusion { calibrations, weights, doubt }, judged, .. } = fit;
        let all: Vec<usize> = (0..self.samples.len()).collect();
        let mut opinions = Vec::new();
        let wanted = self.opinions.iter_mut().filter(|tried| config.opinions.contains_key(tried.name));
        for (tried, (calibration, &weight)) in wanted.zip(calibrations.iter().zip(weights)) {
            let trained = match &tried.trained {
                Some(trained) => Arc::clone(trained),
                None => {
                    let trained = Arc::new(tried.train(&all, &self.labels)?.trained);
                    Arc::clone(tried.trained.insert(trained))
                }
            };
            let calibration = calibration.clone();
            opinions.push(Opinion { sight: tried.config.sight(), trained, calibration, weight });
        }
        let (novelty, known) = (judged.novelty.clone(), judged.outcomes.known);
        Ok(Classification { n_rooms: self.rooms.len(), opinions, doubt: *doubt, novelty, known })
    }

    /// Those who answer early, and how held-out frames were answered so; none where that is not as precise as is configured.
    fn early(
        &mut self,
        config: &Config,
        all: &Fit,
    ) -> Result<(Vec<EarlyFit>, Option<EarlyAnswers>), TrainError> {
        let mut fits = Vec::new();
        for config in parts(config) {
            let fit = self.fit(&config, &mut |_| ())?;
            fits.push((config, fit));
        }
        let outcomes: Vec<&Outcomes> = fits.iter().map(|(_, fit)| &fit.judged.outcomes).collect();
        let Chosen { sure, answers } = choose(&all.judged.outcomes, &outcomes, config.early_precision);
        let mut early = Vec::new();
        for ((part, fit), sure) in fits.into_iter().zip(sure) {
            if let Some(sure) = sure {
                let classification = self.classification(&part, &fit)?;
                early.push(EarlyFit { early: Early::new(part, config, classification, sure), fit });
            }
        }
        Ok((early, answers))
    }

    /// The answers to held-out samples, by the first who are sure, or by all.
    fn answered(&self, config: &Config, all: &Fit, early: &[EarlyFit]) -> Vec<HeldOut> {
        let told = |(&sample_idx, answer): (&usize, &Answer)| {
            let by = |config: &Config, fit: &Fit, answer: &Answer| {
                let novelty = fit.judged.novelties.get(&sample_idx).copied();
                self.told(config, sample_idx, answer.clone(), novelty, fit.judged.outcomes.known)
            };
            let early = early.iter().find_map(|EarlyFit { early, fit }| {
                let HeldOut { sample_idx: idx, recognition } =
                    by(&early.config, fit, fit.answers.get(&sample_idx)?);
                let recognition = early.sure_answer(recognition)?;
                Some(HeldOut { sample_idx: idx, recognition })
            });
            early.unwrap_or_else(|| by(config, all, answer))
        };
        all.answers.iter().map(told).collect()
    }

    /// The answer of opinions of `config` to a sample.
    pub(super) fn told(
        &self,
        config: &Config,
        sample_idx: usize,
        answer: Answer,
        novelty: Option<f32>,
        known: Option<Known>,
    ) -> HeldOut {
        let features = &self.samples[sample_idx].features;
        let seen = features.through(&config.sights());
        let recognition = Recognition::new(answer.probabilities, novelty, known, &seen, features.flaw);
        HeldOut { sample_idx: self.sample_idxs[sample_idx], recognition }
    }

    /// What the opinions of `config` say of the frames of all rounds.
    fn decide_rounds(
        &mut self,
        config: &Config,
        progress: &mut dyn FnMut(TrainingStep),
    ) -> Result<Vec<RoundDecision>, TrainError> {
        let is_wanted = |tried: &Tried| config.opinions.contains_key(tried.name);
        let missing: Vec<usize> = (0..self.opinions.len())
            .filter(|&idx| is_wanted(&self.opinions[idx]) && self.opinions[idx].of_rounds.is_none())
            .collect();
        let mut said: Vec<Vec<Option<Said>>> = vec![Vec::new(); missing.len()];
        for (round_idx, round) in self.rounds.iter().enumerate() {
            progress(self.step(self.n_folds + round_idx));
            for (&opinion_idx, said) in missing.iter().zip(&mut said) {
                let tried = &self.opinions[opinion_idx];
                // What cannot be learned without some of the rooms tells nothing of them.
                let fitted = tried.train(&round.training, &self.labels).ok();
                let answer =
                    |frame: &RoundFrame| tried.answer(fitted.as_ref()?, frame.sample_idx, self.rooms.len());
                said.par_extend(round.frames.par_iter().map(answer));
            }
        }
        for (opinion_idx, said) in missing.into_iter().zip(said) {
            self.opinions[opinion_idx].of_rounds = Some(said);
        }
        let by_opinion: Vec<&Vec<Option<Said>>> = self
            .opinions
            .iter()
            .filter(|tried| is_wanted(tried))
            .filter_map(|tried| tried.of_rounds.as_ref())
            .collect();
        let frames =
            self.rounds.iter().flat_map(|round| round.frames.iter().map(move |frame| (round, frame)));
        let decision = |(idx, (round, frame)): (usize, (&Round, &RoundFrame))| {
            let said: Vec<Option<Said>> = by_opinion.iter().map(|said| said[idx].clone()).collect();
            let decided = Decided { label: self.labels[frame.sample_idx], said };
            let is_seen = decided.said.iter().any(Option::is_some);
            let (number, fold, is_new) = (idx, round.fold, frame.is_new);
            is_seen.then_some(RoundDecision { number, fold, decided, is_new })
        };
        Ok(frames.enumerate().filter_map(decision).collect())
    }
}
