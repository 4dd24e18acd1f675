use super::*;
use crate::classify::boost;
use crate::classify::svm::KernelConfig;
use crate::model::config::Config;
use crate::model::extractor::Scratch;
use crate::model::held_out::HeldOutFrames;
use crate::model::tests::{config, frame, samples};
use crate::opinions::{Classifier, MemoryConfig, OpinionConfig, PatternsConfig};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use roomsight_vision::camera::{Camera, Projection};

fn kernel_svm() -> Config {
    config().with_bag(|machines| machines.classifier = Classifier::KernelSvm(KernelConfig::default()))
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
    let is_right = |sample: &&Sample| model.rooms()[model.classify(&sample.features).room_idx] == sample.room;
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
    assert_eq!((card.n_frames, card.additions.len()), (72, 3), "the first drive is the command's to note");
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
        drives(&config, &["a", "b"]).into_iter().partition(|sample| sample.room == "dots");
    let first = train(&rest, &config);
    let mut with_dots = [&dots[..], &rest[..4]].concat();
    with_dots.iter_mut().for_each(|sample| sample.sequence = "c".to_owned());
    let Training { model, held_out, .. } = add(&first, &with_dots, 0.05).unwrap();
    assert_eq!(model.rooms(), ["bars", "dots", "stripes"]);
    assert_eq!(held_out.len(), 4, "frames of a room unknown before cannot be held out");
    let is_right =
        |answer: &HeldOut| model.rooms()[answer.recognition.room_idx] == with_dots[answer.sample_idx].room;
    assert!(held_out.iter().all(is_right));
    assert!(n_right(&model, &samples(&config, 60, 99)) > 50);
    let bytes = model.to_bytes().unwrap();
    let back = Model::from_bytes(&bytes).unwrap();
    assert_eq!(back.to_bytes().unwrap(), bytes);
    add(&back, &drives(&config, &["d"]), 0.0).unwrap();
}

fn with_patterns() -> Config {
    let mut config = config().with_patterns(0.5, PatternsConfig::default());
    config.weights.clear();
    config
}

#[test]
fn linear_machines_learn_drive_by_drive_what_they_learn_at_once() {
    let config = with_patterns();
    let all = drives(&config, &["a", "b", "c"]);
    let unseen = samples(&config, 60, 99);
    let grown = add(&train(&all[..24], &config), &all[24..], 0.0).unwrap().model;
    let at_once = train(&all, &config);
    let (grown_right, at_once_right) = (n_right(&grown, &unseen), n_right(&at_once, &unseen));
    assert!(
        grown_right + 2 >= at_once_right && at_once_right > 50,
        "{grown_right} and {at_once_right} of 60"
    );
    assert_eq!(n_kept(&grown), 2 * 72, "a row a frame of both opinions");
    let back = Model::from_bytes(&grown.to_bytes().unwrap()).unwrap();
    assert_eq!(back.to_bytes().unwrap(), grown.to_bytes().unwrap());
}

#[test]
fn a_memory_learns_forgets_and_comes_back_from_its_file() {
    let mut config = config();
    config.opinions.clear();
    config.opinions.insert("memory".to_owned(), OpinionConfig::Memory(MemoryConfig::default()));
    let all = drives(&config, &["a", "b", "c"]);
    let unseen = samples(&config, 60, 99);
    let grown = add(&train(&all[..24], &config), &all[24..], 0.0).unwrap().model;
    assert!(n_right(&grown, &unseen) > 55);
    let back = Model::from_bytes(&grown.to_bytes().unwrap()).unwrap();
    assert_eq!(back.to_bytes().unwrap(), grown.to_bytes().unwrap());
    assert_eq!(n_right(&back, &unseen), n_right(&grown, &unseen));
    let room_idx = index_of(back.rooms(), &unseen[0].room);
    let evidence = back.explain(&unseen[0].features, room_idx);
    let is_named = |frame: &Option<String>| frame.as_deref().is_some_and(|name| name.ends_with(".jpg"));
    assert!(!evidence.is_empty() && evidence.iter().all(|evidence| is_named(&evidence.frame)));

    let left = back.without(Forgotten::Drive("b")).unwrap();
    assert!(left.classification.n_kept() < back.classification.n_kept());
    assert!(n_right(&left, &unseen) > 50);
    let without_dots = left.without(Forgotten::Room("dots")).unwrap();
    assert_eq!(without_dots.rooms(), ["bars", "stripes"]);
    let bytes = without_dots.to_bytes().unwrap();
    assert_eq!(Model::from_bytes(&bytes).unwrap().to_bytes().unwrap(), bytes);
}

#[test]
fn a_drive_or_a_room_is_forgotten() {
    let config = with_patterns();
    let all = drives(&config, &["a", "b", "c"]);
    let unseen = samples(&config, 60, 99);
    let model = train(&all, &config);
    let without_drive = model.without(Forgotten::Drive("b")).unwrap();
    assert_eq!((without_drive.card().n_frames, without_drive.learned.n_frames()), (48, 48));
    assert!(n_right(&without_drive, &unseen) > 50);
    // Learned again it is the same but for the order.
    let again = add(&without_drive, &all[24..48], 0.0).unwrap().model;
    assert_eq!(n_right(&again, &unseen), n_right(&model, &unseen));

    let without_dots = model.without(Forgotten::Room("dots")).unwrap();
    assert_eq!(without_dots.rooms(), ["bars", "stripes"]);
    let others: Vec<Sample> = unseen.iter().filter(|sample| sample.room != "dots").cloned().collect();
    assert!(n_right(&without_dots, &others) > 35);
    let back = Model::from_bytes(&without_dots.to_bytes().unwrap()).unwrap();
    assert_eq!(back.to_bytes().unwrap(), without_dots.to_bytes().unwrap());

    let refusal = |model: &Model, forgotten| model.without(forgotten).unwrap_err().to_string();
    assert!(refusal(&model, Forgotten::Drive("z")).contains("it has learned a, b, c"));
    assert!(refusal(&model, Forgotten::Room("attic")).contains("bars, dots, stripes"));
    assert!(refusal(&without_dots, Forgotten::Room("bars")).contains("1 rooms only"));
    let kernel = train(&all, &kernel_svm());
    assert!(refusal(&kernel, Forgotten::Drive("a")).contains("kernel_svm"));
}

#[test]
fn what_cannot_go_on_is_refused_by_name() {
    let config = config();
    let first = drives(&config, &["a"]);
    let more = drives(&config, &["b"]);
    let refusal = |model: &Model, forget| add(model, &more, forget).unwrap_err().to_string();
    let boost = Classifier::Boost(boost::Config { n_rounds: 5 });
    let boosted = train(&first, &config.with_bag(|machines| machines.classifier = boost));
    let told = refusal(&boosted, 0.0);
    assert!(told.contains("boost") && told.contains("classifier.kind = linear_svm"), "{told}");
    let model = train(&first, &kernel_svm());
    assert!(refusal(&model, -1.0).contains("threshold"));
    let twice = add(&model, &more, 0.0).unwrap().model;
    assert!(refusal(&twice, 0.0).contains("the sequence b before"));
    // With a threshold near 1 a single support vector is left.
    let forgetful = add(&model, &more, 0.999).unwrap().model;
    assert_eq!(n_kept(&forgetful), 1);
    let only_bars: Vec<Sample> =
        drives(&config, &["c"]).into_iter().filter(|sample| sample.room == "bars").collect();
    assert!(matches!(add(&forgetful, &only_bars, 0.0), Err(AddError::ForgottenRoom { .. })));
}

#[test]
fn files_of_older_versions_answer_the_same_but_cannot_go_on() {
    let config = kernel_svm();
    let mut old = train(&drives(&config, &["a"]), &config);
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let frame = frame(1, &mut random);
    let expected = old.recognize(&frame, &mut Scratch::default());
    old.held_out = HeldOutFrames::default();
    Arc::make_mut(&mut old.classification.opinions[0].trained).forget_support_labels();
    let back = Model::from_bytes(&old.to_bytes().unwrap()).unwrap();
    assert_eq!(back.recognize(&frame, &mut Scratch::default()), expected);
    assert!(matches!(add(&back, &drives(&config, &["b"]), 0.0), Err(AddError::NothingKept)));
}
