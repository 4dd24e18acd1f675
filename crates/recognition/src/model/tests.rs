use super::*;
use crate::classify::svm;
use crate::classify::svm::Scheme;
use crate::opinions::calibration::Calibration;
use crate::vocabulary;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use roomsight_vision::camera::{Mask, Mirror, Projection};

/// Random frames of three rooms: vertical stripes, horizontal stripes, dots, with noise.
pub(crate) fn frame(room_idx: usize, random: &mut ChaCha8Rng) -> Image {
    let (width, height) = (96, 72);
    let (shift_x, shift_y) = (random.random_range(0..24), random.random_range(0..24));
    let pixels = (0..width * height).map(|idx| {
        let (x, y) = ((idx % width) + shift_x, (idx / width) + shift_y);
        let bright = match room_idx {
            0 => x % 24 < 6 && y % 12 < 9,
            1 => y % 24 < 6 && x % 12 < 9,
            _ => x % 12 < 4 && y % 12 < 4,
        };
        random.random_range(0..6) + if bright { 200 } else { 40 }
    });
    Image::from_pixels(width, height, pixels.collect()).unwrap()
}

pub(crate) fn config() -> Config {
    let bag = vocabulary::Config { n_words: 40, ..vocabulary::Config::default() };
    Config::default().with_bag(|machines| machines.representation = Representation::Bag(bag))
}

pub(crate) fn samples(config: &Config, n_frames: usize, seed: u64) -> Vec<Sample> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let extractor = Extractor::new(config, Camera::new(Projection::Perspective));
    (0..n_frames)
        .map(|idx| Sample {
            room: ["stripes", "bars", "dots"][idx % 3].to_owned(),
            sequence: format!("drive {}", idx % 4),
            name: format!("{idx}.jpg"),
            pose: None,
            picture: None,
            features: extractor.extract(&frame(idx % 3, &mut random), &mut Scratch::default()),
        })
        .collect()
}

fn with_classifier(classifier: Classifier) -> Config {
    config().with_bag(|machines| machines.classifier = classifier)
}

pub(crate) fn train(samples: &[Sample], config: &Config, camera: Camera) -> Result<Training, TrainError> {
    Model::train(&samples.iter().collect::<Vec<_>>(), config, camera, |_| ())
}

pub(crate) fn trained(config: &Config) -> Training {
    let camera = Camera::new(Projection::Perspective);
    train(&samples(config, 48, 1), config, camera).unwrap()
}

#[test]
fn new_frames_of_known_rooms_are_recognized() {
    for scheme in [Scheme::OneVsAll, Scheme::OneVsOne] {
        let svm = svm::Config { scheme, ..svm::Config::default() };
        let config = with_classifier(Classifier::LinearSvm(svm));
        let Training { model, held_out, .. } = trained(&config);
        assert_eq!(model.rooms(), ["bars", "dots", "stripes"]);
        assert_eq!(held_out.len(), 48);
        let mut random = ChaCha8Rng::seed_from_u64(99);
        for (room_idx, room) in ["stripes", "bars", "dots"].iter().enumerate() {
            let answer = model.recognize(&frame(room_idx, &mut random), &mut Scratch::default());
            assert_eq!(&model.rooms()[answer.room_idx], room, "{answer:?}");
            assert!((answer.probabilities.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        }
        let known = held_out.iter().filter(|answer| answer.recognition.known);
        let labels = ["stripes", "bars", "dots"];
        let is_right =
            |answer: &&HeldOut| model.rooms()[answer.recognition.room_idx] == labels[answer.sample_idx % 3];
        let (n_known, n_right) = (known.clone().count(), known.filter(is_right).count());
        assert!(n_known > 24 && n_right * 10 >= n_known * 9, "{n_right} of {n_known} known");
    }
}

#[test]
fn every_classifier_recognizes_and_comes_back_from_its_file_the_same() {
    use crate::classify::svm::{InnerKernel, KernelConfig, KernelFunction, MatchConfig};
    let kernels = [
        KernelFunction::Rbf { gamma: None },
        KernelFunction::Sigmoid { gamma: None, coef0: 0.1 },
        KernelFunction::ChiSquared { gamma: Some(0.7) },
        KernelFunction::HistogramIntersection,
        KernelFunction::Linear,
    ];
    let over_kernel = |kernel| Classifier::KernelSvm(KernelConfig { kernel, ..KernelConfig::default() });
    let matches = |inner| Classifier::MatchSvm(MatchConfig { inner, ..MatchConfig::default() });
    let mut classifiers: Vec<Classifier> = kernels.map(over_kernel).into();
    classifiers.push(Classifier::Boost(crate::classify::boost::Config { n_rounds: 20 }));
    classifiers.push(matches(InnerKernel::Rbf { gamma: 3.0 }));
    classifiers.push(matches(InnerKernel::Correlation { gamma: 1.0 }));
    for classifier in classifiers {
        let config = config().with_bag(|machines| {
            machines.classifier = classifier;
            if matches!(machines.classifier, Classifier::MatchSvm(_)) {
                machines.representation = Representation::Descriptors {};
            }
        });
        let model = trained(&config).model;
        let bytes = model.to_bytes().unwrap();
        let back = Model::from_bytes(&bytes).unwrap();
        assert_eq!(back.to_bytes().unwrap(), bytes);
        let mut random = ChaCha8Rng::seed_from_u64(7);
        for (room_idx, room) in ["stripes", "bars", "dots"].iter().enumerate() {
            let frame = frame(room_idx, &mut random);
            let answer = model.recognize(&frame, &mut Scratch::default());
            assert_eq!(&model.rooms()[answer.room_idx], room, "{config:?} {answer:?}");
            assert_eq!(back.recognize(&frame, &mut Scratch::default()), answer);
        }
    }
}

#[test]
fn patterns_take_part_in_every_answer_and_come_back_from_the_file() {
    // Machines of another scheme than those of the patterns.
    let svm = svm::Config { scheme: Scheme::OneVsOne, ..svm::Config::default() };
    let one_vs_one = with_classifier(Classifier::LinearSvm(svm));
    let weighing = |weight| one_vs_one.clone().with_patterns(weight, PatternsConfig::default());
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let frame = frame(1, &mut random);
    let answer = |model: &Model| model.recognize(&frame, &mut Scratch::default());
    let without = answer(&trained(&one_vs_one).model);
    let unheard = answer(&trained(&weighing(0.0)).model);
    for (a, b) in without.probabilities.iter().zip(&unheard.probabilities) {
        assert!((a - b).abs() < 1e-5, "{without:?} {unheard:?}");
    }
    let Training { model, held_out, .. } = trained(&weighing(0.7));
    assert_ne!(answer(&model).probabilities, without.probabilities);
    let rooms = ["stripes", "bars", "dots"];
    let is_right =
        |answer: &&HeldOut| model.rooms()[answer.recognition.room_idx] == rooms[answer.sample_idx % 3];
    assert!(held_out.iter().filter(is_right).count() > 44);
    let bytes = model.to_bytes().unwrap();
    let back = Model::from_bytes(&bytes).unwrap();
    assert_eq!((back.to_bytes().unwrap(), answer(&back)), (bytes, answer(&model)));
}

#[test]
fn a_frame_without_keypoints_is_answered_without_knowledge() {
    let black = Image::from_pixels(96, 72, vec![0; 96 * 72]).unwrap();
    let answer = trained(&config()).model.recognize(&black, &mut Scratch::default());
    assert_eq!((answer.n_keypoints, answer.known), (0, false));
    assert_eq!(answer.probabilities, [1.0 / 3.0; 3]);
}

#[test]
fn a_memory_of_frames_without_keypoints_knows_nothing() {
    let black = Image::from_pixels(96, 72, vec![0; 96 * 72]).unwrap();
    let mut config = config();
    config.opinions = BTreeMap::from([("memory".to_owned(), OpinionConfig::Memory(MemoryConfig::default()))]);
    let full = samples(&config, 24, 1);
    let empty = Extractor::new(&config, Camera::new(Projection::Perspective))
        .extract(&black, &mut Scratch::default());
    for n_empty in [0, 4] {
        let mut samples = full.clone();
        samples[..n_empty].iter_mut().for_each(|sample| sample.features = empty.clone());
        let Training { model, held_out, .. } =
            train(&samples, &config, Camera::new(Projection::Perspective)).unwrap();
        assert_eq!(held_out.len(), 24 - n_empty);
        let answer = model.recognize(&black, &mut Scratch::default());
        assert_eq!((answer.n_keypoints, answer.known), (0, false));
        assert_eq!(answer.probabilities, [1.0 / 3.0; 3]);
    }
    let mut samples = full;
    samples.iter_mut().for_each(|sample| sample.features = empty.clone());
    let error = train(&samples, &config, Camera::new(Projection::Perspective)).unwrap_err().to_string();
    assert!(error.contains("of the opinion memory") && error.contains("take more frames"), "{error}");
}

#[test]
fn patterns_answer_frames_without_keypoints() {
    // Too faint for corners; told apart by the patterns.
    let smooth = |room_idx: usize, random: &mut ChaCha8Rng| {
        let base = random.random_range(90..110);
        let shift = random.random_range(0..8);
        let pixels = (0..96 * 72).map(|idx| {
            let (x, y) = (idx % 96, idx / 96);
            base + 6 * (([x, y, x + y][room_idx] + shift) / 4 % 2) as u8
        });
        Image::from_pixels(96, 72, pixels.collect()).unwrap()
    };
    let config = config().with_patterns(0.5, PatternsConfig::default());
    let extractor = Extractor::new(&config, Camera::new(Projection::Perspective));
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut all = samples(&config, 48, 1);
    for idx in 0..48 {
        let features = extractor.extract(&smooth(idx % 3, &mut random), &mut Scratch::default());
        assert_eq!(features.n_keypoints(), 0);
        all.push(Sample { features, ..all[idx].clone() });
    }
    let Training { model, held_out, .. } =
        train(&all, &config, Camera::new(Projection::Perspective)).unwrap();
    assert_eq!(held_out.len(), all.len(), "all frames are held out once");
    for (room_idx, room) in ["stripes", "bars", "dots"].iter().enumerate() {
        let answer = model.recognize(&smooth(room_idx, &mut random), &mut Scratch::default());
        assert_eq!((answer.n_keypoints, &model.rooms()[answer.room_idx]), (0, &(*room).to_owned()));
        assert!(answer.probability() > 0.5, "{answer:?}");
    }
}

#[test]
fn the_nearest_frames_tell_where_a_frame_was_taken() {
    let mut config = config().with_patterns(0.5, PatternsConfig::default());
    config.opinions.insert("memory".to_owned(), OpinionConfig::Memory(MemoryConfig::default()));
    let mut samples = samples(&config, 48, 1);
    let unposed = train(&samples, &config, Camera::new(Projection::Perspective)).unwrap().model;
    assert_eq!(unposed.pose(&samples[0].features), None);
    for (idx, sample) in samples.iter_mut().enumerate() {
        // A room has a corner of its own.
        sample.pose = Some(Pose { x: 10.0 * (idx % 3) as f64, y: 0.01 * idx as f64, angle: 1.0 });
    }
    samples[5].pose = None;
    let model = train(&samples, &config, Camera::new(Projection::Perspective)).unwrap().model;
    let back = Model::from_bytes(&model.to_bytes().unwrap()).unwrap();
    let nearest = back.nearest(&samples[7].features, 2);
    assert_eq!(nearest.len(), 6, "two of each opinion: {nearest:?}");
    for near in nearest.iter().step_by(2) {
        assert_eq!((near.name.as_str(), near.pose), ("7.jpg", samples[7].pose), "{nearest:?}");
        assert_eq!(back.rooms()[near.room_idx], samples[7].room);
    }
    assert!(nearest.iter().any(|near| near.opinion == "memory" && !near.points.is_empty()), "{nearest:?}");
    let unseen = Sample::clone(&self::samples(&config, 1, 77)[0]);
    for estimate in [model.pose(&unseen.features), back.pose(&unseen.features)] {
        let PoseEstimate { pose, radius } = estimate.unwrap();
        assert!(pose.x.abs() < 1.0 && (pose.angle - 1.0).abs() < 1e-6 && radius < 15.0, "{pose:?} {radius}");
    }
    let left = model.without(Forgotten::Room("bars")).unwrap();
    assert!((left.pose(&unseen.features).unwrap().pose.x).abs() < 1.0);
}

#[test]
fn a_scratch_of_another_model_changes_nothing() {
    let half = Mask::new(Image::from_pixels(2, 1, vec![255, 0]).unwrap());
    let masked = Camera { projection: Projection::Perspective, mask: Some(half) };
    let config = config().with_patterns(0.5, PatternsConfig::default());
    let [whole, half] =
        [Camera::new(Projection::Perspective), masked].map(|camera| Extractor::new(&config, camera));
    let frame = frame(0, &mut ChaCha8Rng::seed_from_u64(1));
    let mut scratch = Scratch::default();
    whole.extract(&frame, &mut scratch);
    let (shared, own) = (half.extract(&frame, &mut scratch), half.extract(&frame, &mut Scratch::default()));
    assert_eq!(shared, own);
}

#[test]
fn without_a_probability_that_is_right_often_enough_nothing_is_known() {
    let mut training = trained(&config());
    assert!(training.held_out.iter().any(|answer| answer.recognition.known));
    let features = &samples(&config(), 1, 9)[0].features;
    training.model.classification.known = Some(Known { least_probability: 1.0, most_novelty: 1.0 });
    let sigmoids = svm::Calibration::from_parts(Scheme::OneVsAll, 3, vec![1e6; 3], vec![0.0; 3]).unwrap();
    training.model.classification.opinions[0].calibration = Calibration::Sigmoids(sigmoids);
    let sure = training.model.classify(features);
    assert_eq!((sure.probability(), sure.known), (1.0, true));
    training.model.classification.known = None;
    let back = Model::from_bytes(&training.model.to_bytes().unwrap()).unwrap();
    for model in [training.model, back] {
        assert_eq!(model.known_probability(), None);
        assert!(!model.classify(features).known);
    }
}

fn assert_evidence_sums_to_the_decision_value(model: &Model) {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let features = model.features(&frame(2, &mut random), &mut Scratch::default());
    let evidence = model.explain(&features, 1);
    assert_eq!(evidence.len(), features.n_keypoints());
    assert!(evidence.iter().all(|evidence| evidence.opinion == BAG && evidence.word_idx.is_some()));
    let bag = &model.classification.opinions[0];
    // Of a frame that shows nothing a machine says minus its threshold.
    let nothing = Seen::Local(LocalFeatures {
        keypoints: vec![roomsight_vision::detect::Keypoint::new(0.0, 0.0, 1.0)],
        descriptors: roomsight_vision::matrix::Matrix::zeros(1, 72),
        spots: vec![roomsight_vision::camera::Spot { across: Some(0.0), down: 0.0 }],
    });
    let sum: f32 = evidence.iter().map(|evidence| evidence.weight).sum();
    let values = bag.answer(&features).unwrap().values;
    let nothing = Features { seen: vec![nothing], ..features.clone() };
    let of_word = bag.answer(&nothing).unwrap().values[1];
    let weight = model.explain(&nothing, 1)[0].weight;
    assert!((sum - (weight - of_word) - values[1]).abs() < 1e-3);
}

#[test]
fn evidence_sums_to_the_decision_value() {
    assert_evidence_sums_to_the_decision_value(&trained(&config()).model);
}

/// A grid of points at two scales, counted by their parts of the frame.
fn dense(bag: vocabulary::Config) -> Config {
    use roomsight_vision::describe::{CsLbp, Descriptor, Region};
    use roomsight_vision::detect::{Dense, Detector};
    let region = Region { side: 12, scaled: true, ..Region::default() };
    let grid = Dense { longest_side: 64, scales: vec![1.0, 1.5], margin: 6.0, ..Dense::default() };
    Config::default().with_bag(|machines| {
        machines.detector = Detector::Dense(grid);
        machines.descriptor = Descriptor::CsLbp(CsLbp { region, ..CsLbp::default() });
        machines.representation = Representation::Bag(bag);
    })
}

#[test]
fn what_is_counted_by_parts_of_a_grid_recognizes_explains_and_comes_back_the_same() {
    use crate::vocabulary::{Encoding, Pooling};
    let counts = vocabulary::Config {
        n_words: 20,
        pooling: Pooling::Pyramid { levels: 2 },
        ..vocabulary::Config::default()
    };
    let vlad = vocabulary::Config { n_words: 4, encoding: Encoding::Vlad, ..counts.clone() };
    for bag in [counts, vlad] {
        let config = dense(bag);
        assert_eq!(config.check(), Ok(()));
        let mirror = Mirror { center_x: 0.5, center_y: 0.375, inner_radius: 0.02, outer_radius: 0.37 };
        for projection in
            [Projection::Perspective, Projection::Equirectangular, Projection::Omnidirectional(mirror)]
        {
            let camera = Camera::new(projection);
            let extractor = Extractor::new(&config, camera.clone());
            let mut random = ChaCha8Rng::seed_from_u64(2);
            let mut describe = |idx: usize| Sample {
                room: ["stripes", "bars", "dots"][idx % 3].to_owned(),
                sequence: format!("drive {}", idx % 4),
                name: String::new(),
                pose: None,
                picture: None,
                features: extractor.extract(&frame(idx % 3, &mut random), &mut Scratch::default()),
            };
            let samples: Vec<Sample> = (0..36).map(&mut describe).collect();
            let model = train(&samples, &config, camera).unwrap().model;
            let back = Model::from_bytes(&model.to_bytes().unwrap()).unwrap();
            for sample in (0..12).map(&mut describe) {
                let answer = model.classify(&sample.features);
                // Round the middle of a mirror stripes and bars are the same, turned.
                if !matches!(projection, Projection::Omnidirectional(_)) {
                    assert_eq!(model.rooms()[answer.room_idx], sample.room, "{projection:?}");
                }
                assert_eq!(back.classify(&sample.features), answer);
            }
            if projection == Projection::Perspective {
                assert_evidence_sums_to_the_decision_value(&model);
            }
        }
    }
}

#[test]
fn points_that_are_repeated_at_several_scales_need_descriptors_that_grow() {
    let config = dense(vocabulary::Config::default());
    let fixed =
        config.with_bag(|machines| machines.descriptor = roomsight_vision::describe::Descriptor::default());
    assert!(fixed.check().unwrap_err().contains("descriptor.region.scaled"));
    let points = |longest_side| {
        let grid =
            roomsight_vision::detect::Dense { longest_side, ..roomsight_vision::detect::Dense::default() };
        config
            .with_bag(|machines| machines.detector = roomsight_vision::detect::Detector::Dense(grid))
            .check()
    };
    assert_eq!(points(256), Ok(()));
    assert!(points(8192).unwrap_err().contains("raise the step"));
}

#[test]
fn a_room_of_a_single_frame_can_be_answered_but_not_held_out() {
    let config = config();
    let mut samples = samples(&config, 48, 1);
    samples[0].room = "attic".to_owned();
    let training = train(&samples, &config, Camera::new(Projection::Perspective)).unwrap();
    assert_eq!(training.model.rooms().len(), 4);
    assert!(training.held_out.iter().all(|answer| answer.sample_idx != 0));
    assert_eq!(training.held_out.len(), 47);
}

#[test]
fn training_refuses_what_makes_no_model() {
    let camera = || Camera::new(Projection::Perspective);
    let error = |samples: &[Sample], config: &Config| train(samples, config, camera()).err();
    let config = config();
    assert!(matches!(error(&[], &config), Some(TrainError::TooFewRooms(0))));
    let mut one_room = samples(&config, 9, 1);
    one_room.iter_mut().for_each(|sample| sample.room = "hall".to_owned());
    assert!(matches!(error(&one_room, &config), Some(TrainError::TooFewRooms(1))));
    let lonely = &samples(&config, 3, 1);
    let absurd = Config { longest_side: 0, ..config };
    assert!(matches!(error(lonely, &absurd), Some(TrainError::Config(_))));
}

#[test]
fn where_nothing_can_be_held_out_nothing_is_known() {
    let config = config().with_patterns(0.5, PatternsConfig::default());
    let Training { model, held_out, .. } =
        train(&samples(&config, 3, 1), &config, Camera::new(Projection::Perspective)).unwrap();
    assert!(held_out.is_empty() && model.known_probability().is_none());
    let answer = model.classify(&samples(&config, 3, 1)[0].features);
    assert_eq!(model.rooms()[answer.room_idx], "stripes");
}

#[test]
fn weights_are_fitted_where_none_are_given() {
    let mut config = config().with_patterns(0.5, PatternsConfig::default());
    config.weights.clear();
    let model = trained(&config).model;
    let weights = model.weights();
    assert!(
        weights.values().all(|weight| (0.0..=10.0).contains(weight)) && weights[BAG] != 0.5,
        "{weights:?}"
    );
    let back = Model::from_bytes(&model.to_bytes().unwrap()).unwrap();
    assert_eq!(back.weights(), weights);
}

#[test]
fn pictures_of_elsewhere_sharpen_novelty_and_are_never_a_room() {
    let (config, camera) = (config(), Camera::new(Projection::Perspective));
    // Two rooms, of which none can be left out, and others that are like the third.
    let mut of_two = samples(&config, 96, 1);
    of_two
        .iter_mut()
        .filter(|sample| sample.room == "dots")
        .for_each(|sample| sample.room = ELSEWHERE.into());
    let rooms: Vec<Sample> = of_two.iter().filter(|sample| !sample.is_elsewhere()).cloned().collect();
    let beside = train(&of_two, &config, camera.clone()).unwrap();
    let without = train(&rooms, &config, camera).unwrap();
    assert_eq!(beside.model.rooms(), ["bars", "stripes"]);
    assert_eq!(beside.model.left_out.iter().count(), 32);
    let room_of = |answer: &HeldOut| of_two[answer.sample_idx].room.clone();
    assert!(beside.held_out.iter().all(|answer| room_of(answer) != ELSEWHERE) && beside.held_out.len() == 64);
    let novelty = |model: &Model, room_idx: usize| {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let answers =
            (0..20).map(|_| model.recognize(&frame(room_idx, &mut random), &mut Scratch::default()));
        answers.map(|answer| answer.novelty.unwrap() / 20.0).sum::<f32>()
    };
    let told_apart = |model: &Model| novelty(model, 2) - novelty(model, 0).max(novelty(model, 1));
    assert!(told_apart(&beside.model) > told_apart(&without.model) + 0.05);
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let image = frame(1, &mut random);
    let [a, b] =
        [&beside, &without].map(|training| training.model.recognize(&image, &mut Scratch::default()));
    assert_eq!(a.probabilities, b.probabilities, "what is no room costs the rooms nothing");
    // What is added counts too, and learns no room.
    let elsewhere: Vec<&Sample> = of_two.iter().filter(|sample| sample.is_elsewhere()).collect();
    let added = without.model.add(&elsewhere, 0.0, |_| ()).unwrap().model;
    assert_eq!((added.rooms(), added.left_out.iter().count()), (without.model.rooms(), 32));
}
