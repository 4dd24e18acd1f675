//! Models that look at the scans of lasers beside pictures.

use super::tests::{frame, train};
use super::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use roomsight_vision::camera::Projection;
use std::f32::consts::PI;

const ROOMS: [&str; 3] = ["bath", "hall", "office"];

/// A scan from somewhere in a room of its own size.
fn scan(room_idx: usize, n_degrees: usize, random: &mut ChaCha8Rng) -> Scan {
    let [length, width] = [[2.0, 1.5], [9.0, 1.6], [4.0, 5.0]][room_idx];
    let [ahead, left] = [length, width].map(|side| side * random.random_range(0.35_f32..0.65));
    let start = -(n_degrees as f32).to_radians() / 2.0;
    let range = |beam: usize| {
        let (sin, cos) = (start + (beam as f32).to_radians()).sin_cos();
        let x = if cos > 0.0 { ahead / cos } else { (ahead - length) / cos };
        let y = if sin > 0.0 { left / sin } else { (left - width) / sin };
        x.min(y) + random.random_range(-0.02..0.02)
    };
    Scan::new(start, PI / 180.0, 30.0, (0..=n_degrees).map(range).collect()).unwrap()
}

fn config() -> Config {
    let mut config = tests::config();
    config.opinions.insert("laser".to_owned(), OpinionConfig::Laser(LaserConfig::default()));
    config
}

/// Pictures that are the same in two of the rooms, each with a scan.
fn samples(config: &Config) -> Vec<Sample> {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let extractor = Extractor::new(config, Camera::new(Projection::Perspective));
    let sample = |idx: usize| {
        let (image, scan) = (frame(idx % 3 / 2, &mut random), scan(idx % 3, 180, &mut random));
        let seen = Frame { image: &image, scan: Some(&scan) };
        Sample {
            room: ROOMS[idx % 3].to_owned(),
            sequence: format!("drive {}", idx % 4),
            name: format!("{idx}.jpg"),
            pose: None,
            picture: None,
            features: extractor.extract(seen, &mut Scratch::default()),
        }
    };
    (0..60).map(sample).collect()
}

fn model() -> Model {
    let config = config();
    train(&samples(&config), &config, Camera::new(Projection::Perspective)).unwrap().model
}

#[test]
fn rooms_that_look_the_same_are_told_apart_by_their_shape() {
    let (model, mut random) = (model(), ChaCha8Rng::seed_from_u64(9));
    for idx in 0..30 {
        let (image, scan) = (frame(idx % 3 / 2, &mut random), scan(idx % 3, 180, &mut random));
        let with = model.recognize(Frame { image: &image, scan: Some(&scan) }, &mut Scratch::default());
        assert_eq!(model.rooms()[with.room_idx], ROOMS[idx % 3], "{with:?}");
        let without = model.recognize(&image, &mut Scratch::default());
        if idx % 3 < 2 {
            assert!(without.probability() < with.probability(), "{without:?}");
        }
    }
}

#[test]
fn in_the_dark_the_laser_is_heard_alone() {
    let (model, mut random) = (model(), ChaCha8Rng::seed_from_u64(9));
    let dark = Image::from_pixels(96, 72, vec![0; 96 * 72]).unwrap();
    let alone = model.recognize(&dark, &mut Scratch::default());
    assert_eq!(alone.unknown, Some(Unknown::Dark));
    for (room_idx, room) in ROOMS.iter().enumerate() {
        let scan = scan(room_idx, 180, &mut random);
        let answer = model.recognize(Frame { image: &dark, scan: Some(&scan) }, &mut Scratch::default());
        assert_eq!(model.rooms()[answer.room_idx], *room);
        assert!(answer.unknown != Some(Unknown::Dark) && answer.probability() > 0.6, "{answer:?}");
        assert!(!answer.observation().probabilities.is_empty(), "a filter hears it");
    }
}

#[test]
fn scans_of_another_field_say_nothing_or_their_part() {
    let (model, mut random) = (model(), ChaCha8Rng::seed_from_u64(9));
    let image = frame(0, &mut random);
    let [narrow, wide] = [90, 270].map(|n_degrees| scan(1, n_degrees, &mut random));
    let error = model.extractor().check_scan(&narrow).unwrap_err().to_string();
    assert!(error.contains("covers 90 degrees") && error.contains("trained on 180"), "{error}");
    assert_eq!(model.extractor().check_scan(&wide), Ok(()));
    let answer = |scan| model.recognize(Frame { image: &image, scan }, &mut Scratch::default());
    assert_eq!(answer(Some(&narrow)), answer(None));
    assert_eq!(model.rooms()[answer(Some(&wide)).room_idx], "hall");
    assert_eq!(
        tests::trained(&tests::config()).model.extractor().check_scan(&narrow),
        Ok(()),
        "nobody looks"
    );
}

#[test]
fn a_model_with_a_laser_comes_back_from_its_file_and_its_features_from_theirs() {
    let (config, model) = (config(), model());
    let read = Model::from_bytes(&model.to_bytes().unwrap()).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let (image, scan) = (frame(0, &mut random), scan(0, 180, &mut random));
    let seen = Frame { image: &image, scan: Some(&scan) };
    let answer = |model: &Model| model.recognize(seen, &mut Scratch::default());
    assert_eq!(answer(&read), answer(&model));
    let extractor = Extractor::new(&config, Camera::new(Projection::Perspective));
    let features = [
        extractor.extract(seen, &mut Scratch::default()),
        extractor.extract(&image, &mut Scratch::default()),
    ];
    let bytes = features_to_bytes(&features.iter().collect::<Vec<_>>(), &extractor).unwrap();
    assert_eq!(features_from_bytes(&bytes, &extractor).unwrap(), features);
    assert_eq!(Looked::of(&extractor).laser(), Some(LaserShape::default()));
    assert_eq!(Looked::of(tests::trained(&tests::config()).model.extractor()).laser(), None);
}

#[test]
fn parameters_that_make_no_sense_are_refused() {
    for (field, value) in [("field_degrees", 30.0), ("field_degrees", 361.0), ("max_range", 0.0)] {
        let text = format!("[opinions.laser]\nkind = 'laser'\nshape.{field} = {value:?}");
        let config: Config = toml::from_str(&text).unwrap();
        let error = config.check().unwrap_err();
        assert!(error.contains("laser") && error.contains(field), "{error}");
    }
}
