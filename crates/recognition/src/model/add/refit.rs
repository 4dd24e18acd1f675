//! Opinions calibrated, weighed and judged anew on the held-out frames that a model keeps.

use crate::model::card::{Card, EarlyAnswers};
use crate::model::cascade::{Chosen, Early, choose};
use crate::model::config::Config;
use crate::model::held_out::{Decided, Fusion, HeldOutFrames};
use crate::model::known::{Outcome, Outcomes};
use crate::model::{Classification, Model};
use crate::opinions::Opinion;
use crate::opinions::error::TrainError;
use std::collections::BTreeMap;

/// What a model becomes.
pub(super) struct Refitted {
    pub(super) classification: Classification,
    /// Those who answered early before, as far as held-out frames still show that they may.
    early: Vec<Early>,
    answers: Option<EarlyAnswers>,
}

impl Refitted {
    /// With these opinions, which take the place of the model's, and frames among so many rooms.
    pub(super) fn of(
        model: &Model,
        opinions: Vec<Opinion>,
        frames: [&HeldOutFrames; 2],
        n_rooms: usize,
    ) -> Result<Self, TrainError> {
        let all: Vec<usize> = (0..opinions.len()).collect();
        let before = Classification { n_rooms, opinions, ..model.classification.clone() };
        let (classification, outcomes) = before.refitted(&model.config, frames.map(|kept| kept.by(&all)))?;
        let mut parts = Vec::new();
        for Early { config, opinion_idxs, classification: before, .. } in &model.early {
            let opinions = opinion_idxs.iter().map(|&idx| classification.opinions[idx].clone()).collect();
            let before = Classification { n_rooms, opinions, ..before.clone() };
            let frames = frames.map(|kept| kept.by(opinion_idxs));
            parts.push((config, before.refitted(config, frames)?));
        }
        let of_parts: Vec<&Outcomes> = parts.iter().map(|(_, (_, outcomes))| outcomes).collect();
        let Chosen { sure, answers } = choose(&outcomes, &of_parts, model.config.early_precision);
        let early = parts.into_iter().zip(sure).filter_map(|((config, (classification, _)), sure)| {
            Some(Early::new(config.clone(), &model.config, classification, sure?))
        });
        Ok(Self { classification, early: early.collect(), answers })
    }

    pub(super) fn taken_by(self, model: Model) -> Model {
        let Self { classification, early, answers } = self;
        Model { classification, early, card: Card { early: answers, ..model.card }, ..model }
    }
}

impl Classification {
    /// The same opinions, calibrated and weighed by frames that were held out and of rooms that were left out, and how they answer
    /// these; all are numbered.
    fn refitted(
        mut self,
        config: &Config,
        [held_out, left_out]: [Vec<(usize, Decided)>; 2],
    ) -> Result<(Self, Outcomes), TrainError> {
        let decided: Vec<&Decided> = held_out.iter().map(|(_, decided)| decided).collect();
        let fusion = Fusion::fit(config, self.n_rooms, &decided, &decided)?;
        // What tells new places was fitted to all rooms of before, and stays.
        let outcomes = [held_out, left_out].map(|frames| {
            let outcome = |(number, decided): (usize, Decided)| {
                let answer = fusion.answer(config, &decided, self.n_rooms);
                let novelty = self.novelty.as_ref().map(|novelty| novelty.of(&answer.signs));
                (number, answer.outcome(novelty))
            };
            frames.into_iter().map(outcome).collect::<BTreeMap<usize, Outcome>>()
        });
        let outcomes = Outcomes::new(outcomes, &config.calibration);
        self.known = outcomes.known;
        self.doubt = fusion.doubt;
        let fitted = fusion.calibrations.into_iter().zip(fusion.weights);
        for (opinion, (calibration, weight)) in self.opinions.iter_mut().zip(fitted) {
            (opinion.calibration, opinion.weight) = (calibration, weight);
        }
        Ok((self, outcomes))
    }
}
