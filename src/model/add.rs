//! More frames for a trained model, in bounded memory: of the frames learned before only the support vectors
//! are kept (Luo, Pronobis, Caputo and Jensfelt, "Incremental Learning for Place Recognition in Dynamic
//! Environments", IROS 2007; Pronobis, Jie and Caputo, "The More You Learn, the Less You Store", Image and
//! Vision Computing 2010).
//!
//! Probabilities are calibrated on answers that a model gave to frames before it learned them. Each new
//! sequence is therefore answered first and learned then, and its decision values join those that the model
//! has kept from before: the sigmoids rest on every drive so far, not on the last one's light alone. As with
//! held-out folds, they are the values of machines that had learned less, so the new model is rather better
//! than they say.

use super::cue::Opinion;
use super::held_out::HeldOutDecisions;
use super::machines::{self, Machines};
use super::{
    Addition, Card, Classification, Classifier, Features, HeldOut, Model, Recognition, Sample, TrainError,
    Training, TrainingStep,
};
use crate::filter::Transitions;
use crate::matrix::Matrix;
use crate::svm::{Config, IncrementalSvm, KernelConfig, KernelSvm, SvmError};
use crate::vocabulary::Vocabulary;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Why nothing was added to a model.
#[derive(Debug, thiserror::Error)]
pub enum AddError {
    /// A classifier without support vectors to go on from.
    #[error(
        "a model with the classifier {classifier} does not keep what training needs to go on: train one with \
         classifier.kind = kernel_svm"
    )]
    Classifier {
        /// Its name in a configuration.
        classifier: &'static str,
    },
    /// A cue, whose machines keep no support vectors.
    #[error("a model with a cue does not keep what training needs to go on: train one without cue")]
    Cue,
    /// A model file of an earlier version.
    #[error(
        "the version of roomsight that trained this model did not keep what training needs to go on: train \
         it again"
    )]
    NothingKept,
    /// Frames that the model knows say nothing of how well it does.
    #[error(
        "the model has learned the sequence {sequence} before, so it cannot be answered as new: leave it out, \
         or give new frames another name"
    )]
    KnownSequence {
        /// Its name.
        sequence: String,
    },
    /// Every support vector of a room was dropped.
    #[error("the model has forgotten {place}: add frames of it, or forget less")]
    ForgottenPlace {
        /// The room.
        place: String,
    },
    /// No calibration.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// No support vector machine.
    #[error(transparent)]
    Svm(#[from] SvmError),
}

impl Model {
    /// Learns more samples, which were described for this model's configuration and camera, sequence by
    /// sequence. Rooms that are new to the model join the others.
    ///
    /// `forget`, from 0 to below 1, is the trade between accuracy and memory: support vectors are dropped of
    /// which the others make up all but this share. At 0 nothing is lost. See [`IncrementalSvm::reduced`].
    ///
    /// The held-out answers are those to each sequence before it was learned; frames of rooms that were new
    /// then, or without a keypoint, have none. The card says what was added. `progress` is called before each
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
        for (sample_idx, sample) in samples.iter().enumerate() {
            match sequences.iter_mut().find(|(name, _)| *name == sample.sequence) {
                Some((_, sample_idxs)) => sample_idxs.push(sample_idx),
                None => sequences.push((&sample.sequence, vec![sample_idx])),
            }
        }
        self.check_addition(sequences.iter().map(|(name, _)| *name))?;
        let mut training = Training { model: self.clone(), held_out: Vec::new() };
        for (n_done, (_, sample_idxs)) in sequences.iter().enumerate() {
            progress(TrainingStep { n_done, n_steps: sequences.len() });
            training = Drive { samples, sample_idxs, forget }.learned_by(training)?;
        }
        progress(TrainingStep { n_done: sequences.len(), n_steps: sequences.len() });
        Ok(training)
    }

    /// Whether [`Model::add`] can go on from this model with frames of these sequences.
    ///
    /// # Errors
    /// A classifier other than kernel SVMs, a model file of a version before this was possible, a sequence
    /// that the card names already.
    pub fn check_addition<'a>(&self, sequences: impl IntoIterator<Item = &'a str>) -> Result<(), AddError> {
        self.continuation()?;
        let known = |name: &&str| !name.is_empty() && self.card.sequences.iter().any(|known| known == name);
        match sequences.into_iter().find(known) {
            Some(sequence) => Err(AddError::KnownSequence { sequence: sequence.to_owned() }),
            None => Ok(()),
        }
    }

    /// What training goes on from.
    fn continuation(&self) -> Result<Continuation<'_>, AddError> {
        let refused = |classifier| Err(AddError::Classifier { classifier });
        let config = match &self.config.classifier {
            Classifier::KernelSvm(config) => config,
            Classifier::LinearSvm(_) => return refused("linear_svm"),
            Classifier::MatchSvm(_) => return refused("match_svm"),
            Classifier::Boost(_) => return refused("boost"),
        };
        if self.config.cue.is_some() {
            return Err(AddError::Cue);
        }
        match (self.machines(), &self.held_out) {
            (Machines::Kernel(vocabulary, svm, support_labels), Some(decisions))
                if !support_labels.is_empty() =>
            {
                Ok(Continuation { config, vocabulary, svm, support_labels, decisions })
            }
            _ => Err(AddError::NothingKept),
        }
    }
}

/// The parts of a model that training goes on from.
struct Continuation<'a> {
    config: &'a KernelConfig,
    vocabulary: &'a Vocabulary,
    svm: &'a KernelSvm,
    /// The room of each support vector.
    support_labels: &'a [usize],
    decisions: &'a HeldOutDecisions,
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

    fn learned_by(&self, Training { model, mut held_out }: Training) -> Result<Training, AddError> {
        let before = model.continuation()?;
        let KernelConfig { machines: Config { scheme, .. }, .. } = *before.config;
        let bags = self.bags(before.vocabulary);
        let mut decisions = before.decisions.clone();
        for (answer, values) in self.answers(&model, (before.svm, &bags)) {
            decisions.push(&values, index_of(&model.places, &self.samples[answer.sample_idx].place));
            held_out.push(answer);
        }

        let places = self.places_with(&model);
        // The places are sorted before and now: this is ascending.
        let of_earlier: Vec<usize> = model.places.iter().map(|place| index_of(&places, place)).collect();
        held_out.iter_mut().for_each(|answer| answer.renumber(&of_earlier, places.len()));
        let decisions = decisions.renumbered(scheme, &of_earlier, places.len());
        let support_labels = before.support_labels.iter().map(|&label| of_earlier[label]).collect();
        let learned = self.learn(&before, (&bags, support_labels), &places)?;
        let (svm, support_labels) = learned.reduced(self.forget)?.into_parts();

        let calibration = decisions.calibration(scheme, places.len(), model.config.calibration.sigmoids)?;
        let known_probability = decisions.known_probability(&calibration, &model.config.calibration);
        let card = self.on_card(&model.card, [before.svm, learned.svm(), &svm]);
        let machines = Machines::Kernel(before.vocabulary.clone(), svm, support_labels);
        let opinions = vec![Opinion { machines, calibration, weight: 1.0 }];
        let classification = Classification { opinions, known_probability };
        // What was learned of the earlier rooms says nothing of how robots move to a new one.
        let is_same = places == model.places;
        let transitions =
            if is_same { model.transitions.clone() } else { Transitions::unlearned(places.len()) };
        let held_out_decisions = Some(decisions.thinned());
        let earlier = model.clone();
        let model =
            Model { places, classification, held_out: held_out_decisions, transitions, card, ..earlier };
        Ok(Training { model, held_out })
    }

    /// What the model says of the frames that it can be right about and that show something, and the decision
    /// values behind it.
    fn answers(&self, model: &Model, (svm, bags): (&KernelSvm, &Matrix)) -> Vec<(HeldOut, Vec<f32>)> {
        let answer = |(position, &sample_idx): (usize, &usize)| {
            let Sample { place, features, .. } = self.samples[sample_idx];
            let is_answerable = model.places.contains(place) && !features.keypoints.is_empty();
            is_answerable.then(|| {
                let answer = HeldOut { sample_idx, recognition: model.classify(features) };
                (answer, svm.decision_values(bags.row(position)))
            })
        };
        self.sample_idxs.par_iter().enumerate().filter_map(answer).collect()
    }

    fn places_with(&self, model: &Model) -> Vec<String> {
        let new = self.samples().map(|sample| &sample.place);
        let names: BTreeSet<&String> = model.places.iter().chain(new).collect();
        names.into_iter().cloned().collect()
    }

    fn bags(&self, vocabulary: &Vocabulary) -> Matrix {
        let frames: Vec<&Features> = self.samples().map(|sample| &sample.features).collect();
        machines::bags(vocabulary, &frames)
    }

    fn learn(
        &self,
        before: &Continuation,
        (bags, support_labels): (&Matrix, Vec<usize>),
        places: &[String],
    ) -> Result<IncrementalSvm, AddError> {
        let labels: Vec<usize> = self.samples().map(|sample| index_of(places, &sample.place)).collect();
        let is_forgotten = |label: &usize| !labels.contains(label) && !support_labels.contains(label);
        if let Some(label) = (0..places.len()).find(is_forgotten) {
            return Err(AddError::ForgottenPlace { place: places[label].clone() });
        }
        let svm = IncrementalSvm::from_parts(before.svm.clone(), support_labels, &before.config.machines)?;
        Ok(svm.updated(bags, &labels, places.len())?)
    }

    /// The card of a model that has learned this, whose SVM went through these stages.
    fn on_card(&self, card: &Card, stages: [&KernelSvm; 3]) -> Card {
        let sequence = self.samples().next().map(|sample| sample.sequence.clone()).unwrap_or_default();
        let n_frames = self.sample_idxs.len();
        let [n_before, n_learned, n_left] = stages.map(|svm| svm.support_vectors().n_rows());
        let mut card = card.clone();
        card.n_frames += n_frames;
        card.sequences.push(sequence.clone());
        let forget = self.forget;
        card.additions.push(Addition { sequence, n_frames, forget, n_before, n_learned, n_left });
        card
    }
}

impl HeldOut {
    /// The same answer among more places, where place i of before has the index `of_earlier[i]`.
    fn renumber(&mut self, of_earlier: &[usize], n_places: usize) {
        let Recognition { place_idx, probabilities, .. } = &mut self.recognition;
        let mut among_all = vec![0.0; n_places];
        for (&place_idx, &probability) in of_earlier.iter().zip(probabilities.iter()) {
            among_all[place_idx] = probability;
        }
        *place_idx = of_earlier[*place_idx];
        *probabilities = among_all;
    }
}

/// The index of a place that is among the sorted `places`.
fn index_of(places: &[String], place: &String) -> usize {
    places.binary_search(place).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::super::tests::{config, frame, samples};
    use super::*;
    use crate::boost;
    use crate::camera::{Camera, Projection};
    use crate::model::{Config, Scratch};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn kernel_svm() -> Config {
        Config { classifier: Classifier::KernelSvm(KernelConfig::default()), ..config() }
    }

    /// Frames of three rooms, in as many drives as named.
    fn drives(config: &Config, names: &[&str]) -> Vec<Sample> {
        let all: Vec<Sample> = names
            .iter()
            .zip(1..)
            .flat_map(|(&name, seed)| {
                let drive = samples(config, 24, seed);
                drive.into_iter().map(|sample| Sample { sequence: name.to_owned(), ..sample })
            })
            .collect();
        all
    }

    fn train(samples: &[Sample], config: &Config) -> Model {
        let samples: Vec<&Sample> = samples.iter().collect();
        Model::train(&samples, config, Camera::new(Projection::Perspective), |_| ()).unwrap().model
    }

    fn add(model: &Model, samples: &[Sample], forget: f64) -> Result<Training, AddError> {
        model.add(&samples.iter().collect::<Vec<_>>(), forget, |_| ())
    }

    fn n_right(model: &Model, samples: &[Sample]) -> usize {
        let is_right =
            |sample: &&Sample| model.places()[model.classify(&sample.features).place_idx] == sample.place;
        samples.iter().filter(is_right).count()
    }

    fn n_kept(model: &Model) -> usize {
        model.card().additions.last().unwrap().n_left
    }

    #[test]
    fn learning_drive_by_drive_comes_near_to_learning_all_at_once() {
        let config = kernel_svm();
        let all = drives(&config, &["a", "b", "c", "d"]);
        let unseen = samples(&config, 60, 99);
        let mut model = train(&all[..24], &config);
        for drive in all[24..].chunks(24) {
            let training = add(&model, drive, 0.0).unwrap();
            assert_eq!(training.held_out.len(), 24);
            // Answered before it was learned.
            for HeldOut { sample_idx, recognition } in &training.held_out {
                let before = model.classify(&drive[*sample_idx].features);
                assert_eq!(recognition.probabilities, before.probabilities);
            }
            model = training.model;
        }
        let at_once = train(&all, &config);
        let (by_drive, at_once) = (n_right(&model, &unseen), n_right(&at_once, &unseen));
        assert!(by_drive + 2 >= at_once && at_once > 50, "{by_drive} and {at_once} of 60");
        let card = model.card();
        assert_eq!(
            (card.n_frames, card.additions.len()),
            (72, 3),
            "the first drive is the command's to note"
        );
        assert_eq!(card.sequences, ["b", "c", "d"]);
    }

    #[test]
    fn forgetting_bounds_what_is_kept_and_still_answers() {
        let config = kernel_svm();
        let all = drives(&config, &["a", "b", "c", "d", "e", "f"]);
        let first = train(&all[..24], &config);
        let unseen = samples(&config, 60, 99);
        let grown = |forget| add(&first, &all[24..], forget).unwrap().model;
        let models = [0.0, 0.2, 0.5].map(grown);
        let kept = models.each_ref().map(n_kept);
        assert!(kept[0] > kept[1] && kept[1] > kept[2], "{kept:?}");
        let at_half: Vec<usize> = models[2].card().additions.iter().map(|addition| addition.n_left).collect();
        assert!(at_half.iter().all(|&kept| kept < 20), "no growth with each drive: {at_half:?}");
        let right = models.each_ref().map(|model| n_right(model, &unseen));
        assert!(right.iter().all(|&right| right > 55), "{right:?} of 60");
    }

    #[test]
    fn a_new_room_joins_the_others_in_order() {
        let config = kernel_svm();
        let (dots, rest): (Vec<Sample>, Vec<Sample>) =
            drives(&config, &["a", "b"]).into_iter().partition(|sample| sample.place == "dots");
        let first = train(&rest, &config);
        let mut with_dots = [&dots[..], &rest[..4]].concat();
        with_dots.iter_mut().for_each(|sample| sample.sequence = "c".to_owned());
        let Training { model, held_out } = add(&first, &with_dots, 0.05).unwrap();
        assert_eq!(model.places(), ["bars", "dots", "stripes"]);
        assert_eq!(held_out.len(), 4, "frames of a room unknown before cannot be held out");
        let is_right = |answer: &HeldOut| {
            model.places()[answer.recognition.place_idx] == with_dots[answer.sample_idx].place
        };
        assert!(held_out.iter().all(is_right));
        assert!(n_right(&model, &samples(&config, 60, 99)) > 50);
        let bytes = model.to_bytes().unwrap();
        let back = Model::from_bytes(&bytes).unwrap();
        assert_eq!(back.to_bytes().unwrap(), bytes);
        add(&back, &drives(&config, &["d"]), 0.0).unwrap();
    }

    #[test]
    fn what_cannot_go_on_is_refused_by_name() {
        let config = config();
        let first = drives(&config, &["a"]);
        let more = drives(&config, &["b"]);
        let refusal = |model: &Model, forget| add(model, &more, forget).unwrap_err().to_string();
        let boost = Classifier::Boost(boost::Config { n_rounds: 5 });
        for (config, name) in
            [(config.clone(), "linear_svm"), (Config { classifier: boost, ..config.clone() }, "boost")]
        {
            let refusal = refusal(&train(&first, &config), 0.0);
            assert!(refusal.contains(name) && refusal.contains("classifier.kind = kernel_svm"), "{refusal}");
        }
        let model = train(&first, &kernel_svm());
        assert!(refusal(&model, -1.0).contains("threshold"));
        let twice = add(&model, &more, 0.0).unwrap().model;
        assert!(refusal(&twice, 0.0).contains("the sequence b before"));
        // With a threshold near 1 a single support vector is left.
        let forgetful = add(&model, &more, 0.999).unwrap().model;
        assert_eq!(n_kept(&forgetful), 1);
        let only_bars: Vec<Sample> =
            drives(&config, &["c"]).into_iter().filter(|sample| sample.place == "bars").collect();
        assert!(matches!(add(&forgetful, &only_bars, 0.0), Err(AddError::ForgottenPlace { .. })));
    }

    #[test]
    fn files_of_older_versions_answer_the_same_but_cannot_go_on() {
        let config = kernel_svm();
        let mut old = train(&drives(&config, &["a"]), &config);
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let frame = frame(1, &mut random);
        let expected = old.recognize(&frame, &mut Scratch::default());
        old.held_out = None;
        let Machines::Kernel(_, _, support_labels) = &mut old.classification.opinions[0].machines else {
            panic!("no kernel SVM")
        };
        support_labels.clear();
        let back = Model::from_bytes(&old.to_bytes().unwrap()).unwrap();
        assert_eq!(back.recognize(&frame, &mut Scratch::default()), expected);
        assert!(matches!(add(&back, &drives(&config, &["b"]), 0.0), Err(AddError::NothingKept)));
    }
}
