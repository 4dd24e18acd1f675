use super::*;
use crate::look::sight::LookCost;
use crate::model::add::Forgotten;
use crate::model::extractor::Scratch;
use crate::model::held_out::HeldOutFrames;
use crate::model::sample::Sample;
use crate::model::tests::{frame, train};
use crate::model::training::Training;
use crate::model::{Extractor, FORMAT_VERSION, Model};
use crate::opinions::{MemoryConfig, OpinionConfig, Remembered};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use roomsight_vision::camera::{Camera, Projection};
use roomsight_vision::describe::{Descriptor, SiftDescriptor};
use roomsight_vision::detect::{Detector, Sift};
use roomsight_vision::image::Image;
use std::sync::LazyLock;

/// As many answers of this probability, novelty and truth.
fn outcomes(all: &[(usize, f32, f32, bool)]) -> BTreeMap<usize, Outcome> {
    let outcomes = all.iter().flat_map(|&(n, probability, novelty, is_right)| {
        std::iter::repeat_n(Outcome { probability, novelty, is_right }, n)
    });
    outcomes.enumerate().collect()
}

const ANY: Known = Known { least_probability: 0.0, most_novelty: 1.0 };

fn answers(held_out: &[(usize, f32, f32, bool)], left_out: &[(usize, f32, f32, bool)]) -> Outcomes {
    Outcomes { held_out: outcomes(held_out), left_out: outcomes(left_out), known: Some(ANY) }
}

fn sure(all: &Outcomes, parts: &[&Outcomes], precision: f64) -> Vec<Option<f32>> {
    let sure = choose(all, parts, precision).sure.into_iter();
    sure.map(|sure| sure.map(|sure| sure.least_probability)).collect()
}

#[test]
fn few_frames_show_little() {
    let least = |n, precision| {
        let answers = answers(&[(n, 0.9, 0.1, true)], &[]);
        sure(&answers, &[&answers], precision)[0]
    };
    // Of n right answers all of n: n / (n + 1.645^2).
    assert_eq!([least(267, 0.99), least(268, 0.99)], [None, Some(0.9)]);
    assert_eq!([least(538, 0.995), least(539, 0.995)], [None, Some(0.9)]);
    assert_eq!(least(100_000, 1.0), None);
    assert!((lower_bound(90.0, 100.0) - 0.8396).abs() < 1e-4, "{}", lower_bound(90.0, 100.0));
    assert_eq!(lower_bound(0.0, 0.0), 0.0);
}

#[test]
fn answers_are_sure_down_to_where_they_are_as_precise_as_those_of_all() {
    let cheap = answers(&[(400, 0.9, 0.1, true), (9, 0.7, 0.1, false), (400, 0.7, 0.1, true)], &[]);
    let right = answers(&[(809, 0.9, 0.1, true)], &[]);
    assert_eq!(sure(&right, &[&cheap], 0.97), [Some(0.9)], "all are right where it is not");
    assert_eq!(sure(&cheap, &[&cheap], 0.97), [Some(0.7)], "all are as wrong");
    assert_eq!(sure(&cheap, &[&cheap], 0.99), [Some(0.9)]);
    assert_eq!(choose(&right, &[&cheap], 1.0).answers, None);
    let told = choose(&right, &[&cheap], 0.97).answers.unwrap();
    assert_eq!([told.n_held_out, told.n_frames, told.n_right, told.n_right_by_all], [809, 400, 400, 400]);
}

#[test]
fn what_is_not_known_is_never_sure_nor_are_new_places() {
    let all = answers(&[(400, 0.9, 0.1, true), (400, 0.8, 0.5, true)], &[(100, 0.8, 0.5, false)]);
    let chosen = choose(&Outcomes { known: None, ..all.clone() }, &[&all], 0.97).sure[0].unwrap();
    assert!(chosen.holds(0.9, Some(0.1)) && !chosen.holds(0.8, Some(0.5)), "{chosen:?}");
    let unknown = Outcomes { known: None, ..all.clone() };
    assert_eq!(sure(&all, &[&unknown], 0.9), [None]);
}

#[test]
fn new_places_are_known_no_more_often_than_to_all() {
    let known_to_all =
        |novelty| answers(&[(2000, 0.9, 0.1, true)], &[(295, 0.1, 0.9, false), (5, 0.9, novelty, false)]);
    let known = Some(Known { least_probability: 0.5, most_novelty: 0.5 });
    let of_all = |novelty| Outcomes { known, ..known_to_all(novelty) };
    let cheap = answers(
        &[(1000, 0.95, 0.1, true), (1000, 0.9, 0.1, true)],
        &[(295, 0.1, 0.9, false), (5, 0.9, 0.1, false)],
    );
    // Five frames of 2300 would cost next to no precision.
    assert_eq!(sure(&of_all(0.9), &[&cheap], 0.95), [Some(0.95)]);
    assert_eq!(sure(&of_all(0.1), &[&cheap], 0.95), [Some(0.9)], "all know them too");
}

#[test]
fn half_of_the_early_answers_are_enough_if_they_look_less_new() {
    let most_novelty = |n_near: usize| {
        let all = answers(&[(n_near, 0.9, 0.004, true), (2000 - n_near, 0.9, 0.25, true)], &[]);
        choose(&all, &[&all], 0.95).sure[0].unwrap().most_novelty
    };
    assert_eq!([most_novelty(1000), most_novelty(999)], [0.005, 0.3]);
}

#[test]
fn who_is_asked_next_is_judged_with_those_before() {
    let all = answers(&[(600, 0.9, 0.1, true)], &[]);
    let first = answers(&[(400, 0.9, 0.1, true), (200, 0.2, 0.1, false)], &[]);
    let second = answers(&[(400, 0.1, 0.1, false), (150, 0.9, 0.1, true), (50, 0.3, 0.1, false)], &[]);
    assert_eq!(sure(&all, &[&first, &second], 0.99), [Some(0.9), Some(0.9)], "150 alone would not show it");
    let told = choose(&all, &[&first, &second], 0.99).answers.unwrap();
    assert_eq!([told.n_frames, told.n_right], [550, 550]);
}

fn config() -> Config {
    let sift = Remembered::Keypoints {
        detector: Detector::Sift(Sift { target: 60, ..Sift::default() }),
        descriptor: Descriptor::Sift(SiftDescriptor::default()),
    };
    let memory = |features| OpinionConfig::Memory(MemoryConfig { features, ..MemoryConfig::default() });
    let opinions = [("corners", memory(Remembered::default())), ("sift", memory(sift))];
    let opinions = opinions.map(|(name, opinion)| (name.to_owned(), opinion)).into();
    Config { opinions, early_precision: 0.85, ..Config::default() }
}

/// A frame of a room that shows as much noise, from 0 to 1.
fn noisy(room: usize, noise: f32, random: &mut ChaCha8Rng) -> Image {
    let frame = frame(room, random);
    let mut mixed = |&pixel: &u8| {
        let other: f32 = random.random_range(0.0..255.0);
        (f32::from(pixel) * (1.0 - noise) + other * noise) as u8
    };
    let pixels = frame.pixels().iter().map(&mut mixed).collect();
    Image::from_pixels(frame.width(), frame.height(), pixels).unwrap()
}

fn samples(config: &Config, n_frames: usize, seed: u64) -> Vec<Sample> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let extractor = Extractor::new(config, Camera::new(Projection::Perspective));
    let mut sample = |idx: usize| {
        let noise = if idx.is_multiple_of(4) { 0.8 } else { 0.1 };
        let image = noisy(idx % 3, noise, &mut random);
        Sample {
            room: ["stripes", "bars", "dots"][idx % 3].to_owned(),
            sequence: format!("drive {seed}.{}", idx / 3 % 4),
            name: format!("{seed}.{idx}"),
            pose: None,
            picture: None,
            features: extractor.extract(&image, &mut Scratch::default()),
        }
    };
    (0..n_frames).map(&mut sample).collect()
}

fn trained(config: &Config) -> Training {
    train(&samples(config, 96, 1), config, Camera::new(Projection::Perspective)).unwrap()
}

/// One that answers early, one that never does, and one of the cheap opinion alone.
static MODELS: LazyLock<[Model; 3]> = LazyLock::new(|| {
    let config = config();
    let alone = config.with_opinions(|name| name == "corners");
    [config.clone(), Config { early_precision: 1.0, ..config }, alone].map(|config| trained(&config).model)
});

#[test]
fn some_frames_are_answered_early_and_the_file_says_who_does() {
    let Training { model, held_out, .. } = trained(&config());
    let told = model.card().early.clone().unwrap();
    let n_early = held_out.iter().filter(|answer| answer.recognition.is_early).count();
    assert_eq!([told.n_held_out, told.n_frames], [held_out.len(), n_early]);
    assert!((30..held_out.len()).contains(&n_early), "{told:?}");
    assert!(held_out.iter().all(|answer| answer.recognition.known || !answer.recognition.is_early));
    let bytes = model.to_bytes().unwrap();
    let back = Model::from_bytes(&bytes).unwrap();
    assert_eq!(back.to_bytes().unwrap(), bytes);
    assert!(back.answers_early() && back.metadata().format_version == FORMAT_VERSION);
    assert_eq!(back.expected(), model.expected());
    let never = &MODELS[1];
    assert!(!never.answers_early() && never.metadata().format_version < FORMAT_VERSION);
    for sample in samples(&config(), 12, 5) {
        assert_eq!(back.classify(&sample.features), model.classify(&sample.features));
    }
}

#[test]
fn learning_more_and_forgetting_keeps_early_answers_while_frames_show_that_they_are_right() {
    let model = &MODELS[0];
    let more = samples(&config(), 24, 7);
    let more = model.add(&more.iter().collect::<Vec<_>>(), 0.0, |_| ()).unwrap().model;
    let told = more.card().early.clone().unwrap();
    assert!(more.answers_early() && told.n_held_out > model.card().early.as_ref().unwrap().n_held_out);
    let fewer = more.without(Forgotten::Room("bars")).unwrap();
    assert_eq!(fewer.answers_early(), fewer.card().early.is_some());
    let mut few = more;
    for drive in ["drive 1.0", "drive 1.1", "drive 1.2", "drive 1.3", "drive 7.0"] {
        few = few.without(Forgotten::Drive(drive)).unwrap();
    }
    few.held_out = HeldOutFrames::new(few.held_out.iter().take(9).cloned().collect());
    let few = few.without(Forgotten::Drive("drive 7.1")).unwrap();
    assert!(!few.answers_early() && few.card().early.is_none(), "nine frames show nothing");
}

#[test]
fn opinions_are_asked_in_the_order_of_their_cost() {
    let names = |config: &Config| -> Vec<Vec<String>> {
        parts(config).iter().map(|part| part.opinions.keys().cloned().collect()).collect()
    };
    assert_eq!(names(&config()), [["corners"]]);
    assert_eq!(names(&Config { early_precision: 1.0, ..config() }), Vec::<Vec<String>>::new());
    assert_eq!(names(&Config::default()), Vec::<Vec<String>>::new(), "one alone");
    assert!(LookCost::Cheap < LookCost::ScaleSpace && LookCost::ScaleSpace < LookCost::Network);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn a_sure_frame_is_answered_as_by_the_cheap_alone_and_any_other_as_by_all(
        room in 0..3_usize, noise in 0.0..0.9_f32, seed in any::<u64>(),
    ) {
        let image = noisy(room, noise, &mut ChaCha8Rng::seed_from_u64(seed));
        let [model, never, alone] = &*MODELS;
        let mut scratch = Scratch::default();
        let answer = model.recognize(&image, &mut scratch);
        prop_assert_eq!(&model.classify(&model.features(&image, &mut scratch)), &answer);
        let [by_all, by_cheap] = [never, alone].map(|model| model.recognize(&image, &mut Scratch::default()));
        prop_assert_eq!(&model.asking_all().recognize(&image, &mut scratch), &by_all);
        if answer.is_early {
            prop_assert_eq!(answer, Recognition { is_early: true, ..by_cheap });
        } else {
            prop_assert_eq!(&answer, &by_all);
        }
        let mut sure_of_none = model.clone();
        sure_of_none.early.iter_mut().for_each(|early| early.sure.least_probability = 1.5);
        prop_assert_eq!(sure_of_none.recognize(&image, &mut scratch), by_all);
    }
}
