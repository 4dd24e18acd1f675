//! How often recognition asks for memory after the first frame: as often for each, whatever it shows, and seldom.
//!
//! An allocator that counts is one for a whole program, so that these tests are a program of their own.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use allocation_counter::measure;
use roomsight_recognition::Recognizer;
use roomsight_recognition::model::{Config, Extractor, Model, Sample, Scratch};
use roomsight_vision::camera::{Camera, Mirror, Projection};
use roomsight_vision::image::{Image, Limits};
use std::fs;

/// Of simulated rooms, 640 x 480, with a mirror.
fn jpegs() -> Vec<Vec<u8>> {
    let rooms = ["bathroom", "corridor", "one_person_office", "printer_area"];
    let path = |room| format!("../../models/simulated-lab/1/golden/{room}.jpeg");
    rooms.map(|room| fs::read(path(room)).unwrap()).to_vec()
}

fn decode(jpeg: &[u8]) -> Image {
    Image::decode(jpeg, &Limits::default()).unwrap()
}

/// The default model, of frames that show a room each.
fn model(projection: Projection) -> Model {
    let camera = Camera::new(projection);
    let extractor = Extractor::new(&Config::default(), camera.clone());
    let sample = |(idx, jpeg): (usize, &Vec<u8>)| Sample {
        room: format!("room {idx}"),
        sequence: String::new(),
        name: String::new(),
        pose: None,
        picture: None,
        features: extractor.extract(&decode(jpeg), &mut Scratch::default()),
    };
    let samples: Vec<Sample> = jpegs().iter().enumerate().map(sample).collect();
    let samples: Vec<&Sample> = samples.iter().collect();
    Model::train(&samples, &Config::default(), camera, |_| ()).unwrap().model
}

fn models() -> [Model; 2] {
    let mirror = Mirror { center_x: 0.4953125, center_y: 0.375, inner_radius: 0.0375, outer_radius: 0.35 };
    [Projection::Perspective, Projection::Omnidirectional(mirror)].map(model)
}

/// What a frame may ask for: features, the answer, and what detecting and describing fill anew.
const OF_THE_CORE: u64 = 52;

/// And a picture: its parts, rows of blocks and luma.
const OF_DECODING: u64 = 20;

#[test]
fn luma_to_an_answer() {
    for model in models() {
        let images: Vec<Image> = jpegs().iter().map(|jpeg| decode(jpeg)).collect();
        let mut scratch = Scratch::default();
        let mut recognize = |image: &Image| drop(model.recognize(image, &mut scratch));
        images.iter().for_each(&mut recognize);
        for image in &images {
            let asked = measure(|| recognize(image)).count_total;
            assert!(asked <= OF_THE_CORE, "{asked}");
        }
    }
}

#[test]
fn a_jpeg_to_an_answer() {
    for model in models() {
        let mut recognizer = Recognizer::new(model);
        let mut recognize = |jpeg: &Vec<u8>| drop(recognizer.recognize(jpeg).unwrap());
        jpegs().iter().for_each(&mut recognize);
        for jpeg in &jpegs() {
            let asked = measure(|| recognize(jpeg)).count_total;
            assert!(asked <= OF_THE_CORE + OF_DECODING, "{asked}");
        }
    }
}
