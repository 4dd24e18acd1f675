use super::*;
use crate::look::features::Features;
use crate::look::sight::{Seen, Sight};
use crate::model::Model;
use crate::model::add::Forgotten;
use crate::model::config::Config;
use crate::model::extractor::{Extractor, Scratch};
use crate::model::sample::Sample;
use crate::model::training::Training;
use crate::opinions::{OpinionConfig, VectorConfig};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use roomsight_vision::camera::{Camera, Projection};
use roomsight_vision::network::testing::{convolution, described, runtime};
use std::collections::BTreeMap;
use std::sync::Arc;
use tempfile::TempDir;

const ROOMS: [&str; 3] = ["red", "green", "blue"];

/// A network whose vector is the mean color.
fn networks() -> Networks {
    let model = convolution();
    let toml = described(&model, "[vector]\noutput = \"embedding\"\n[grids.all]\noutput = \"map\"\n");
    Networks::from([("made".to_owned(), Arc::new(CarriedNetwork::new(model.bytes(), toml.into())))])
}

fn lens() -> Lens {
    let mut lens = Lens::default();
    "made".clone_into(&mut lens.network);
    lens
}

/// One opinion on the mean color, not linked.
fn config() -> Config {
    let vector = OpinionConfig::Vector(VectorConfig { lens: lens(), ..VectorConfig::default() });
    Config {
        longest_side: 32,
        opinions: BTreeMap::from([("vector".to_owned(), vector)]),
        ..Config::default()
    }
}

/// One that is linked; none where there is no ONNX Runtime.
fn linked(what: &str) -> Option<Config> {
    runtime(what)?;
    let mut config = config();
    config.link(&networks()).unwrap();
    Some(config)
}

/// A frame of twice the working size in which the color of the room prevails.
fn frame(room: usize, random: &mut ChaCha8Rng) -> Image {
    let mut colors = Vec::new();
    for _ in 0..64 * 32 {
        let mut color = [0; 3].map(|_: u8| random.random_range(0..120));
        color[room] = random.random_range(90..200);
        colors.extend(color);
    }
    Image::from_pixels(64, 32, vec![100; 64 * 32]).unwrap().with_colors(colors).unwrap()
}

fn samples(config: &Config, rooms: &[usize], seed: u64) -> Vec<Sample> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let extractor = Extractor::new(config, Camera::new(Projection::Perspective));
    let sample = |idx: usize| {
        let room = rooms[idx % rooms.len()];
        let features = extractor.extract(&frame(room, &mut random), &mut Scratch::default());
        let (room, sequence) = (ROOMS[room].to_owned(), format!("drive {seed}.{}", idx % 4));
        Sample { room, sequence, name: format!("{seed}.{idx}"), pose: None, picture: None, features }
    };
    (0..24).map(sample).collect()
}

fn train(config: &Config, samples: &[Sample]) -> Training {
    let samples: Vec<&Sample> = samples.iter().collect();
    Model::train(&samples, config, Camera::new(Projection::Perspective), |_| ()).unwrap()
}

fn answer(model: &Model, room: usize, seed: u64) -> (String, Vec<f32>) {
    let frame = frame(room, &mut ChaCha8Rng::seed_from_u64(seed));
    let answer = model.recognize(&frame, &mut Scratch::default());
    (model.rooms()[answer.room_idx].clone(), answer.probabilities)
}

#[test]
fn rooms_are_told_apart_by_a_vector_and_the_model_carries_the_network() {
    let Some(config) = linked("a model that looks through a network") else { return };
    let Training { model, held_out, .. } = train(&config, &samples(&config, &[0, 1, 2], 1));
    assert_eq!(held_out.len(), 24);
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("model");
    model.save(&path, &[]).unwrap();
    let loaded = Model::load(&path).unwrap().model;
    assert_eq!(loaded.networks(), &networks());
    assert_eq!(loaded.config(), model.config());
    for (room, name) in ROOMS.iter().enumerate() {
        let answers = answer(&model, room, 9);
        assert_eq!(&answers.0, name);
        assert_eq!(answer(&loaded, room, 9), answers);
    }
}

#[test]
fn it_learns_more_rooms_and_forgets_them() {
    let Some(config) = linked("a vector that learns more") else { return };
    let Training { model, .. } = train(&config, &samples(&config, &[0, 1], 1));
    let more = samples(&config, &[2], 2);
    let more: Vec<&Sample> = more.iter().collect();
    let Training { model: larger, .. } = model.add(&more, 0.0, |_| ()).unwrap();
    for (room, name) in ROOMS.iter().enumerate() {
        assert_eq!(&answer(&larger, room, 9).0, name);
    }
    let smaller = larger.without(Forgotten::Room("green")).unwrap();
    assert_eq!(smaller.rooms(), ["blue", "red"]);
    assert_eq!([0, 2].map(|room| answer(&smaller, room, 9).0), ["red", "blue"]);
}

#[test]
fn a_lens_without_its_network_is_refused_with_what_to_do() {
    let said = config().check().unwrap_err();
    assert!(said.contains("the network made is not there"), "{said}");
    let said = config().link(&Networks::new()).unwrap_err().to_string();
    assert!(said.contains("make networks"), "{said}");
    let text = toml::to_string(&config()).unwrap();
    assert_eq!(toml::from_str::<Config>(&text).unwrap(), config(), "{text}");
    let frame = frame(0, &mut ChaCha8Rng::seed_from_u64(1));
    let extractor = Extractor::new(&config(), Camera::new(Projection::Perspective));
    assert!(extractor.extract(&frame, &mut Scratch::default()).seen[0].is_nothing());
}

#[test]
fn what_the_network_does_not_have_is_refused() {
    let Some(config) = linked("refusing what a network does not have") else { return };
    let Some(OpinionConfig::Vector(VectorConfig { lens, .. })) = config.opinions.get("vector") else {
        panic!("there is one")
    };
    let of = |sight: Sight| sight.check(640).unwrap_err();
    assert!(Sight::Grid { lens: lens.clone(), grid: "all".to_owned() }.check(640).is_ok());
    let said = of(Sight::Grid { lens: lens.clone(), grid: "none".to_owned() });
    assert_eq!(said, "the network made has no grid none");
    let said = of(Sight::XFeat { lens: lens.clone(), target: 10 });
    assert_eq!(said, "the network made finds no keypoints");
}

#[test]
fn a_grid_lies_in_the_frame_at_working_size() {
    let Some(config) = linked("a grid of cells") else { return };
    let Some(Sight::Vector(lens)) = config.sights().pop() else { panic!("there is one") };
    let frame = frame(1, &mut ChaCha8Rng::seed_from_u64(3));
    let view = Camera::new(Projection::Perspective).view(64, 32);
    let look = lens.look(&frame, &view).unwrap();
    let grid = look.grid("all", lens.grid_len("all"));
    assert_eq!((grid.keypoints.len(), grid.descriptors.n_cols()), (8 * 4, 4));
    // Cells of 2 x 2 pixels of an input of 16 x 8, each pixel 4 x 4 of the frame.
    let (first, last) = (grid.keypoints[0], grid.keypoints[31]);
    assert_eq!(((first.x, first.y), (last.x, last.y)), ((3.5, 3.5), (59.5, 27.5)));
    let vector = look.vector();
    assert!((vector.iter().map(|value| value * value).sum::<f32>() - 1.0).abs() < 1e-5);
    let extractor = Extractor::new(&config, Camera::new(Projection::Perspective));
    let Features { seen, .. } = extractor.extract(&frame, &mut Scratch::default());
    assert_eq!(seen, [Seen::Whole(vector)]);
}
