//! More frames for a trained model, and less: drives are learned in addition without the frames of before, and drives or
//! rooms are forgotten.
//!
//! Opinions keep what they need for it: a memory all descriptors, linear machines the row of each frame, kernel
//! machines the support vectors alone, in bounded memory (Luo, Pronobis, Caputo and Jensfelt, "Incremental Learning for
//! Place Recognition in Dynamic Environments", IROS 2007; Pronobis, Jie and Caputo, "The More You Learn, the Less
//! You Store", Image and Vision Computing 2010).
//!
//! Probabilities and weights are fitted on answers that a model gave to frames before it learned them. Each new
//! sequence is therefore answered first and learned then, and its decision values join those that the model
//! has kept from before: the calibration rests on every drive so far, not on the last one's light alone. As with
//! held-out folds, they are the values of opinions that had learned less, so the new model is rather better
//! than they say.

mod refit;

use super::Classification;
use crate::filter::Transitions;
use crate::look::sight::Seen;
use crate::model::card::{Addition, Card};
use crate::model::held_out::Decided;
use crate::model::learned::LearnedFrames;
use crate::model::sample::Sample;
use crate::model::training::{HeldOut, Training, TrainingStep};
use crate::model::{Model, Recognition};
use crate::opinions::error::{AddError, TrainError};
use crate::opinions::{Added, Left, Opinion};
use rayon::prelude::*;
use refit::Refitted;
use std::collections::BTreeSet;
use std::sync::Arc;

/// What a model is to forget.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Forgotten<'a> {
    /// All frames of a drive.
    Drive(&'a str),
    /// All frames of a room, and the room.
    Room(&'a str),
}

impl Model {
    /// Learns more samples, which were described for this model's configuration and camera, sequence by
    /// sequence. Rooms that are new to the model join the others.
    ///
    /// `forget`, from 0 to below 1, is the trade between accuracy and memory of kernel machines: support vectors are
    /// dropped of which the others make up all but this share. At 0 nothing is lost. See
    /// [`crate::classify::svm::IncrementalSvm::reduced`].
    ///
    /// The held-out answers are those to each sequence before it was learned; frames of rooms that were new
    /// then, or in which nothing was seen, have none. The card says what was added. `progress` is called before each
    /// step.
    ///
    /// # Errors
    /// Those of [`Model::check_addition`]; a room that is left without any frame; a threshold that is negative
    /// or leaves nothing.
    pub fn add(
        &self,
        samples: &[&Sample],
        forget: f64,
        mut progress: impl FnMut(TrainingStep),
    ) -> Result<Training, AddError> {
        let mut sequences: Vec<(&str, Vec<usize>)> = Vec::new();
        let of_rooms = samples.iter().enumerate().filter(|(_, sample)| !sample.is_elsewhere());
        for (sample_idx, sample) in of_rooms {
            match sequences.iter_mut().find(|(name, _)| *name == sample.sequence) {
                Some((_, sample_idxs)) => sample_idxs.push(sample_idx),
                None => sequences.push((&sample.sequence, vec![sample_idx])),
            }
        }
        self.check_addition(sequences.iter().map(|(name, _)| *name))?;
        let mut training = Training { model: self.clone(), held_out: Vec::new(), are_single_frames: false };
        for (n_done, (_, sample_idxs)) in sequences.iter().enumerate() {
            progress(TrainingStep { n_done, n_steps: sequences.len() });
            training = Drive { samples, sample_idxs, forget }.learned_by(training)?;
        }
        progress(TrainingStep { n_done: sequences.len(), n_steps: sequences.len() });
        let elsewhere = samples.iter().copied().filter(|sample| sample.is_elsewhere());
        let model = training.model.beside(elsewhere)?;
        Ok(Training { model, ..training })
    }

    /// The same model, which answers are known judged by frames of elsewhere too.
    fn beside<'a>(self, elsewhere: impl Iterator<Item = &'a Sample>) -> Result<Self, TrainError> {
        let n_rooms = self.rooms.len();
        let mut left_out = self.left_out.clone();
        for (idx, sample) in elsewhere.enumerate() {
            let said = self.classification.said(&sample.features);
            if said.iter().any(Option::is_some) {
                left_out.push(Decided { label: idx % n_rooms, said });
            }
        }
        let left_out = left_out.thinned();
        let opinions = self.classification.opinions.clone();
        let refitted = Refitted::of(&self, opinions, [&self.held_out, &left_out], n_rooms)?;
        Ok(Self { left_out, ..refitted.taken_by(self) })
    }

    /// Whether [`Model::add`] can go on from this model with frames of these sequences.
    ///
    /// # Errors
    /// A classifier that keeps nothing, a model file of a version before this was possible, a sequence
    /// that the card names already.
    pub fn check_addition<'a>(&self, sequences: impl IntoIterator<Item = &'a str>) -> Result<(), AddError> {
        self.classification.opinions.iter().try_for_each(|opinion| opinion.trained.check_addition())?;
        let known = |name: &&str| !name.is_empty() && self.card.sequences.iter().any(|known| known == name);
        match sequences.into_iter().find(known) {
            Some(sequence) => Err(AddError::KnownSequence { sequence: sequence.to_owned() }),
            None => Ok(()),
        }
    }

    /// The same model as if it had never seen some of its frames, but for words and the like, which stay. What robots'
    /// moves between rooms were like is forgotten where a room is.
    ///
    /// # Errors
    /// A drive or room that was never learned; a classifier that cannot forget; fewer than two rooms left.
    pub fn without(&self, forgotten: Forgotten) -> Result<Self, AddError> {
        if self.learned.n_frames() == 0 {
            return Err(AddError::NothingKept);
        }
        let goes = |frame_idx: usize| match forgotten {
            Forgotten::Drive(drive) => self.learned.drive(frame_idx) == drive,
            Forgotten::Room(room) => self.rooms[self.learned.labels[frame_idx]] == room,
        };
        let is_left: Vec<bool> = (0..self.learned.n_frames()).map(|frame_idx| !goes(frame_idx)).collect();
        if is_left.iter().all(|&is_left| is_left) {
            return Err(self.never_learned(forgotten));
        }
        let left_frames = is_left.iter().zip(&self.learned.labels).filter(|(is_left, _)| **is_left);
        let left_rooms: BTreeSet<usize> = left_frames.map(|(_, &label)| label).collect();
        let left_rooms: Vec<usize> = left_rooms.into_iter().collect();
        if left_rooms.len() < 2 {
            return Err(AddError::TooFewLeft(left_rooms.len()));
        }
        let learned = self.learned.left(&is_left, &left_rooms);
        let rooms: Vec<String> = left_rooms.iter().map(|&idx| self.rooms[idx].clone()).collect();
        let left = Left { is_left: &is_left, labels: &learned.labels, n_rooms: rooms.len() };
        let [held_out, left_out] =
            [&self.held_out, &self.left_out].map(|frames| frames.narrowed(&self.config, &left_rooms));
        let trained = self.classification.opinions.iter().map(|opinion| opinion.trained.without(&left));
        let trained = trained.collect::<Result<Vec<_>, _>>()?;
        let opinions = self.classification.opinions.iter().zip(trained);
        let opinions = opinions
            .map(|(opinion, trained)| Opinion { trained: Arc::new(trained), ..opinion.clone() })
            .collect();
        let is_same = rooms == self.rooms;
        let transitions =
            if is_same { self.transitions.clone() } else { Transitions::unlearned(rooms.len()) };
        let mut card = self.card.clone();
        card.n_frames = learned.n_frames();
        if let Forgotten::Drive(drive) = forgotten {
            card.sequences.retain(|sequence| sequence != drive);
        }
        let refitted = Refitted::of(self, opinions, [&held_out, &left_out], rooms.len())?;
        let model = refitted.taken_by(Self { card, ..self.clone() });
        Ok(Self { rooms, learned, held_out, left_out, transitions, ..model })
    }

    fn never_learned(&self, forgotten: Forgotten) -> AddError {
        let (what, name, known) = match forgotten {
            Forgotten::Drive(drive) => {
                let drives: BTreeSet<&str> =
                    (0..self.learned.n_frames()).map(|frame_idx| self.learned.drive(frame_idx)).collect();
                ("drive", drive, Vec::from_iter(drives))
            }
            Forgotten::Room(room) => ("room", room, self.rooms.iter().map(String::as_str).collect()),
        };
        let learned = if known == [""] {
            "its frames came without the names of their drives".to_owned()
        } else {
            format!("it has learned {}", known.join(", "))
        };
        AddError::NeverLearned { what, name: name.to_owned(), learned }
    }
}

/// The new frames of one sequence.
struct Drive<'a> {
    /// Of all sequences.
    samples: &'a [&'a Sample],
    sample_idxs: &'a [usize],
    forget: f64,
}

impl Drive<'_> {
    fn samples(&self) -> impl Iterator<Item = &Sample> {
        self.sample_idxs.iter().map(|&sample_idx| self.samples[sample_idx])
    }

    fn learned_by(
        &self,
        Training { model, mut held_out, are_single_frames }: Training,
    ) -> Result<Training, AddError> {
        let mut decisions = model.held_out.clone();
        for (answer, decided) in self.answers(&model) {
            decisions.push(decided);
            held_out.push(answer);
        }
        let rooms = self.rooms_with(&model);
        // The places are sorted before and now: this is ascending.
        let of_earlier: Vec<usize> = model.rooms.iter().map(|room| index_of(&rooms, room)).collect();
        held_out.iter_mut().for_each(|answer| answer.renumber(&of_earlier, rooms.len()));
        let [decisions, left_out] = [&decisions, &model.left_out]
            .map(|frames| frames.renumbered(&model.config, &of_earlier, rooms.len()));
        let mut learned = model.learned.renumbered(&of_earlier);
        learned.extend(self.samples().map(|sample| (sample, index_of(&rooms, &sample.room))));
        let opinions = self.learn(&model, &learned, &of_earlier, &rooms)?;
        let refitted = Refitted::of(&model, opinions, [&decisions, &left_out], rooms.len())?;
        let card = self.on_card(&model, &refitted.classification);
        // What was learned of the earlier rooms says nothing of how robots move to a new one.
        let is_same = rooms == model.rooms;
        let transitions =
            if is_same { model.transitions.clone() } else { Transitions::unlearned(rooms.len()) };
        let held_out_frames = decisions.thinned();
        let earlier = refitted.taken_by(Model { card, ..model });
        let model = Model { rooms, learned, held_out: held_out_frames, left_out, transitions, ..earlier };
        Ok(Training { model, held_out, are_single_frames })
    }

    /// What the model says of the frames that it can be right about and that show something, and the decision
    /// values behind it.
    fn answers(&self, model: &Model) -> Vec<(HeldOut, Decided)> {
        let answer = |&sample_idx: &usize| {
            let Sample { room, features, .. } = self.samples[sample_idx];
            let label = model.rooms.binary_search(room).ok()?;
            let said = model.classification.said(features);
            said.iter().any(Option::is_some).then(|| {
                let answer = HeldOut { sample_idx, recognition: model.classify(features) };
                (answer, Decided { label, said })
            })
        };
        self.sample_idxs.par_iter().filter_map(answer).collect()
    }

    fn rooms_with(&self, model: &Model) -> Vec<String> {
        let new = self.samples().map(|sample| &sample.room);
        let names: BTreeSet<&String> = model.rooms.iter().chain(new).collect();
        names.into_iter().cloned().collect()
    }

    fn learn(
        &self,
        model: &Model,
        learned: &LearnedFrames,
        of_earlier: &[usize],
        rooms: &[String],
    ) -> Result<Vec<Opinion>, AddError> {
        let learn = |opinion: &Opinion| {
            let frames = self.samples().map(|sample| sample.features.of(&opinion.sight));
            let frames: Vec<&Seen> = frames.collect::<Option<_>>().ok_or(TrainError::OtherSights)?;
            let added = Added {
                frames: &frames,
                labels: &learned.labels,
                n_rooms: rooms.len(),
                of_earlier,
                forget: self.forget,
            };
            let trained = opinion.trained.add(&added).map_err(|error| match error {
                AddError::ForgottenClass { class_idx } => {
                    AddError::ForgottenRoom { room: rooms[class_idx].clone() }
                }
                error => error,
            })?;
            Ok(Opinion { trained: Arc::new(trained), ..opinion.clone() })
        };
        model.classification.opinions.iter().map(learn).collect()
    }

    /// The card of a model that has learned this.
    fn on_card(&self, model: &Model, learned: &Classification) -> Card {
        let sequence = self.samples().next().map(|sample| sample.sequence.clone()).unwrap_or_default();
        let n_frames = self.sample_idxs.len();
        let mut card = model.card.clone();
        card.n_frames += n_frames;
        card.sequences.push(sequence.clone());
        let [n_before, n_left] = [&model.classification, learned].map(Classification::n_kept);
        card.additions.push(Addition { sequence, n_frames, forget: self.forget, n_before, n_left });
        card
    }
}

impl HeldOut {
    /// The same answer among more places, where place i of before has the index `of_earlier[i]`.
    fn renumber(&mut self, of_earlier: &[usize], n_rooms: usize) {
        let Recognition { room_idx, probabilities, .. } = &mut self.recognition;
        let mut among_all = vec![0.0; n_rooms];
        for (&room_idx, &probability) in of_earlier.iter().zip(probabilities.iter()) {
            among_all[room_idx] = probability;
        }
        *room_idx = of_earlier[*room_idx];
        *probabilities = among_all;
    }
}

/// The index of a place that is among the sorted `rooms`.
fn index_of(rooms: &[String], room: &String) -> usize {
    rooms.binary_search(room).unwrap_or_default()
}

#[cfg(test)]
mod tests;
