//! How well a configuration does on a data set: trained on some frames, measured on others, over several
//! splits and seeds.

mod cost;
mod early;
mod teams;

pub use cost::{Cost, median, timed};
pub use early::EarlyWorth;
pub use teams::{Method, Team, Trained, teams};

use crate::dataset::{Dataset, Described};
use crate::evaluate::{
    self, Answer, Changes, Evaluation, Knowledge, PoseErrors, Sighting, StreamAnswer, Trusted,
};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use roomsight_recognition::filter::{Interval, RoomFilter, Trust};
use roomsight_recognition::folds::folds;
use roomsight_recognition::model::{Choice, Config, Model, Recognition, Sample, TrainError, Unknown};
use roomsight_vision::camera::Camera;
use std::collections::{BTreeMap, BTreeSet};

/// What is trained on and what is measured.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// Every sequence is answered by models trained without it, in this many folds at most. A room that
    /// occurs in one sequence only cannot be answered and is left out.
    Sequences(usize),
    /// Every frame is answered by a model trained on all others.
    LeaveOneOut,
    /// This many frames of each room, drawn anew for each seed, train; the others are answered.
    Random(usize),
}

/// One training and what is measured with it: indices of samples.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Round {
    /// Trained on.
    pub train: Vec<usize>,
    /// Answered.
    pub test: Vec<usize>,
}

/// The rounds of a protocol. Frames of rooms that a round does not train are not in its test.
pub fn rounds(samples: &[Sample], protocol: &Protocol, seed: u64) -> Vec<Round> {
    let names: BTreeSet<&str> = samples.iter().map(|sample| sample.room.as_str()).collect();
    let label: BTreeMap<&str, usize> = names.into_iter().zip(0..).collect();
    let labels: Vec<usize> = samples.iter().map(|sample| label[sample.room.as_str()]).collect();
    let rounds = match *protocol {
        Protocol::Sequences(n_folds) => {
            let sequences: Vec<&str> = samples.iter().map(|sample| sample.sequence.as_str()).collect();
            let fold_of = folds(&sequences, &labels, n_folds, seed);
            (0..n_folds).map(|fold| Round::new(samples.len(), |idx| fold_of[idx] == fold)).collect()
        }
        Protocol::LeaveOneOut => {
            (0..samples.len()).map(|left_out| Round::new(samples.len(), |idx| idx == left_out)).collect()
        }
        Protocol::Random(n_train) => {
            let drawn: BTreeSet<usize> = draw(samples, n_train, seed).into_iter().collect();
            vec![Round::new(samples.len(), |idx| !drawn.contains(&idx))]
        }
    };
    rounds
        .into_iter()
        .map(|round: Round| round.answerable(&labels))
        .filter(|round| !round.test.is_empty())
        .collect()
}

/// This many samples of each room, or all where there are fewer, drawn anew for each seed; in their order.
pub fn draw(samples: &[Sample], n_of_room: usize, seed: u64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..samples.len()).collect();
    order.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    let mut n_drawn: BTreeMap<&str, usize> = BTreeMap::new();
    order.retain(|&idx| {
        let n_drawn = n_drawn.entry(&samples[idx].room).or_default();
        *n_drawn += 1;
        *n_drawn <= n_of_room
    });
    order.sort_unstable();
    order
}

impl Round {
    fn new(n_samples: usize, is_test: impl Fn(usize) -> bool) -> Self {
        let (test, train) = (0..n_samples).partition(|&idx| is_test(idx));
        Self { train, test }
    }

    fn answerable(mut self, labels: &[usize]) -> Self {
        let trained: BTreeSet<usize> = self.train.iter().map(|&idx| labels[idx]).collect();
        self.test.retain(|&idx| trained.contains(&labels[idx]));
        self
    }
}

/// `n_rooms` rooms that are left out of training, others for each seed: all have had their turn when there have been seeds enough.
pub fn left_out_rooms(rooms: &BTreeSet<String>, n_rooms: usize, seed: u64) -> BTreeSet<String> {
    let mut rooms: Vec<&String> = rooms.iter().collect();
    rooms.shuffle(&mut ChaCha8Rng::seed_from_u64(0));
    let first = seed as usize * n_rooms;
    (first..first + n_rooms).map(|turn| rooms[turn % rooms.len()].clone()).collect()
}

impl Round {
    /// The same without training on frames of some rooms.
    pub fn without(&self, samples: &[Sample], rooms: &BTreeSet<String>) -> Self {
        let is_left = |idx: &usize| !rooms.contains(&samples[*idx].room);
        Self { train: self.train.iter().copied().filter(is_left).collect(), test: self.test.clone() }
    }
}

/// The answer to one sample.
#[derive(Clone, Debug)]
pub struct Answered {
    /// Which sample.
    pub sample_idx: usize,
    /// The room answered.
    pub room: String,
    /// The whole answer.
    pub recognition: Recognition,
    /// Whether the sample shows a room that the model was not trained on.
    pub is_new: bool,
}

/// Trains and answers each round in turn: the answers of each team of `method`. `on_round` is called after each, with why
/// something was preferred, if something was.
///
/// # Errors
/// What cannot be trained.
pub fn run(
    samples: &[Sample],
    rounds: &[Round],
    method: &Method,
    config: &Config,
    camera: &Camera,
    mut on_round: impl FnMut(Option<Choice>),
) -> Result<Vec<Vec<Answered>>, TrainError> {
    let mut answers = vec![Vec::new(); method.names().len()];
    for round in rounds {
        let training: Vec<&Sample> = round.train.iter().map(|&idx| &samples[idx]).collect();
        let mut choice = None;
        for trained in method.train(&training, config, camera)? {
            let of_team = round.test.iter().map(|&sample_idx| answer(&trained.model, samples, sample_idx));
            answers[trained.team_idx].extend(of_team);
            choice = choice.or(trained.choice);
        }
        on_round(choice);
    }
    Ok(answers)
}

/// The answer of `model` to a sample.
pub fn answer(model: &Model, samples: &[Sample], sample_idx: usize) -> Answered {
    let Sample { room, features, .. } = &samples[sample_idx];
    let recognition = model.classify(features);
    let is_new = model.rooms().binary_search(room).is_err();
    Answered { sample_idx, room: model.rooms()[recognition.room_idx].clone(), recognition, is_new }
}

/// The same answers, each room the one that a filter took the robot to be in after that frame, with the
/// filter's probabilities. Every drive begins without any belief.
pub fn filtered(
    model: &Model,
    dataset: &Dataset,
    described: &Described,
    answers: &[Answered],
    trust: Trust,
) -> Vec<Answered> {
    let mut filter = RoomFilter::new(model.rooms().len(), trust);
    let filter_answer = |(since, answered): (Option<Interval>, &Answered)| {
        if since.is_none() {
            filter = RoomFilter::new(model.rooms().len(), trust);
        }
        let raw = &answered.recognition;
        let probabilities =
            filter.update(model.transitions(), since.unwrap_or(0.0.into()), raw.observation()).to_vec();
        let (known, novelty) = (model.knows(&filter), filter.novelty());
        let unknown = if known { None } else { raw.unknown.or(Some(Unknown::Unsure)) };
        let room_idx = filter.room_idx();
        let recognition = Recognition { room_idx, known, novelty, unknown, probabilities, ..raw.clone() };
        Answered { room: model.rooms()[recognition.room_idx].clone(), recognition, ..*answered }
    };
    intervals(dataset, described, answers).into_iter().zip(answers).map(filter_answer).collect()
}

/// How answers to drives, in their order, follow the robot from room to room.
pub fn changes(dataset: &Dataset, described: &Described, answers: &[Answered]) -> Changes {
    let intervals = intervals(dataset, described, answers);
    let stream = answers.iter().zip(intervals).map(|(answered, since)| StreamAnswer {
        room: &described.samples[answered.sample_idx].room,
        answered: &answered.room,
        elapsed: since.map(|since| since.seconds),
    });
    Changes::new(&stream.collect::<Vec<_>>())
}

/// What lies between each answer and the one before; none where a drive begins, or a room of one whose order of rooms is not
/// known.
fn intervals(dataset: &Dataset, described: &Described, answers: &[Answered]) -> Vec<Option<Interval>> {
    let frame = |answered: &Answered| &dataset.frames[described.frame_idxs[answered.sample_idx]];
    let between = |pair: &[Answered]| {
        let [before, after] = [&pair[0], &pair[1]].map(frame);
        let is_followed = dataset.is_in_order() || before.room == after.room;
        is_followed.then(|| before.interval_to(after)).flatten()
    };
    let following = answers.windows(2).map(between);
    std::iter::once(None).chain(following).take(answers.len()).collect()
}

/// Whether each frame of a data set is near a border of rooms; see [`evaluate::near_borders`].
pub fn near_borders(dataset: &Dataset) -> Vec<Option<bool>> {
    let sightings: Vec<Sighting> = dataset
        .frames
        .iter()
        .map(|frame| Sighting {
            sequence: &frame.sequence,
            room: &frame.room,
            position: frame.pose.map(|pose| [pose.x, pose.y]),
        })
        .collect();
    evaluate::near_borders(&sightings, evaluate::BORDER_DISTANCE)
}

/// Counts answers to the described frames of a data set; border frames are told apart where the data set
/// knows positions. Frames of elsewhere are not among them: no answer to them is right.
pub fn evaluate(dataset: &Dataset, described: &Described, answers: &[Answered]) -> Evaluation {
    let near_border = near_borders(dataset);
    let answers: Vec<Answer> = answers
        .iter()
        .filter(|answered| !described.samples[answered.sample_idx].is_elsewhere())
        .map(|answered| {
            let frame_idx = described.frame_idxs[answered.sample_idx];
            Answer {
                room: &dataset.frames[frame_idx].room,
                answered: &answered.room,
                near_border: near_border[frame_idx],
            }
        })
        .collect();
    Evaluation::new(&answers)
}

/// How far off the poses are that a model estimates of described frames; `None` where none is known.
pub fn poses(model: &Model, dataset: &Dataset, described: &Described) -> Option<PoseErrors> {
    let estimated = |(sample, &frame_idx): (&Sample, &usize)| {
        let pose = dataset.frames[frame_idx].pose?;
        Some((model.pose(&sample.features)?, pose))
    };
    let samples = described.samples.par_iter().zip(&described.frame_idxs);
    PoseErrors::new(&samples.filter_map(estimated).collect::<Vec<_>>())
}

/// What "known" is worth in answers to described frames.
pub fn knowledge<'a>(described: &Described, answers: impl IntoIterator<Item = &'a Answered>) -> Knowledge {
    let trusted = |answered: &Answered| Trusted {
        probability: answered.recognition.probability(),
        known: answered.recognition.known,
        novelty: answered.recognition.novelty,
        is_right: described.samples[answered.sample_idx].room == answered.room,
        is_new: answered.is_new,
    };
    Knowledge::new(&answers.into_iter().map(trusted).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use roomsight_recognition::model::Features;
    use std::sync::Arc;

    fn sample(room: &str, sequence: &str) -> Sample {
        let features = Features { sights: Arc::default(), seen: Vec::new(), scale: 1.0, flaw: None };
        Sample {
            room: room.to_owned(),
            sequence: sequence.to_owned(),
            name: String::new(),
            pose: None,
            picture: None,
            features,
        }
    }

    #[test]
    fn each_room_is_left_out_once_in_turn() {
        let rooms: BTreeSet<String> = ["a", "b", "c", "d", "e", "f"].map(str::to_owned).into();
        let left_out: Vec<String> = (0..3).flat_map(|seed| left_out_rooms(&rooms, 2, seed)).collect();
        assert_eq!(left_out.iter().collect::<BTreeSet<_>>().len(), 6, "{left_out:?}");
    }

    #[test]
    fn sequences_are_never_on_both_sides_and_lonely_rooms_are_left_out() {
        let samples = [
            sample("hall", "a"),
            sample("hall", "b"),
            sample("hall", "c"),
            sample("bath", "a"),
            sample("bath", "b"),
            sample("attic", "c"),
        ];
        let rounds = rounds(&samples, &Protocol::Sequences(3), 0);
        assert_eq!(rounds.len(), 3);
        for round in &rounds {
            let test: BTreeSet<&str> = round.test.iter().map(|&idx| samples[idx].sequence.as_str()).collect();
            assert!(round.train.iter().all(|&idx| !test.contains(samples[idx].sequence.as_str())));
        }
        let mut tested: Vec<usize> = rounds.iter().flat_map(|round| round.test.clone()).collect();
        tested.sort_unstable();
        assert_eq!(tested, [0, 1, 2, 3, 4]);
    }

    #[test]
    fn each_frame_is_left_out_once() {
        let samples = [sample("hall", ""), sample("hall", ""), sample("bath", ""), sample("bath", "")];
        let rounds = rounds(&samples, &Protocol::LeaveOneOut, 0);
        assert_eq!(rounds.iter().map(|round| round.test.clone()).collect::<Vec<_>>(), [[0], [1], [2], [3]]);
        assert_eq!(rounds[1].train, [0, 2, 3]);
    }

    #[test]
    fn random_splits_draw_the_same_number_a_room_and_differ_by_seed() {
        let samples: Vec<Sample> =
            (0..40).map(|idx| sample(if idx % 4 == 0 { "hall" } else { "bath" }, "")).collect();
        let split = |seed| rounds(&samples, &Protocol::Random(4), seed).remove(0);
        let is_hall = |idx: &&usize| idx.is_multiple_of(4);
        assert_eq!((split(1).train.len(), split(1).train.iter().filter(is_hall).count()), (8, 4));
        assert_eq!(split(1).test.len(), 32);
        assert_ne!(split(1), split(2));
    }
}
