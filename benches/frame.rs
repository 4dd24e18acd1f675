//! Milliseconds a 640 x 480 JPEG frame takes on one thread, step by step and as a whole.
//!
//! The frames show the simulated lab and are rendered at the start; the model is trained on them. Each
//! measured call takes the next frame.

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first surprise")]

mod lab;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion};
use image::codecs::jpeg::JpegEncoder;
use roomsight_lab::simulate::CameraKind;
use roomsight_recognition::classify::svm::{self, Calibration, LinearSvm};
use roomsight_recognition::model::{
    Config, Extractor, Features, LocalFeatures, Model, Representation, Sample, Scratch, Seen,
};
use roomsight_recognition::vocabulary::{Described, Vocabulary};
use roomsight_vision::camera::{Camera, Mirror, Projection};
use roomsight_vision::image::{Image, Limits};
use roomsight_vision::matrix::Matrix;
use roomsight_vision::simd::{UnitColumns, UnitRows, nearest_columns};
use std::hint::black_box;
use std::time::Duration;

/// As the simulated sequences are written.
const JPEG_QUALITY: u8 = 88;

fn main() {
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_secs(1))
        .measurement_time(Duration::from_secs(4))
        .configure_from_args();
    for &camera in CameraKind::ALL {
        let mut group = criterion.benchmark_group(format!("{camera:?}").to_lowercase());
        measure(&mut group, &Drive::render(camera));
        group.finish();
    }
    criterion.final_summary();
}

/// Frames of one camera along one drive.
struct Drive {
    jpegs: Vec<Vec<u8>>,
    images: Vec<Image>,
    rooms: Vec<String>,
    camera: Camera,
}

impl Drive {
    fn render(kind: CameraKind) -> Self {
        let simulation = lab::drive(0.2);
        let encode = |frame_idx| {
            let mut bytes = Vec::new();
            let mut encoder = JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY);
            encoder.encode_image(&simulation.render(frame_idx, kind)).unwrap();
            bytes
        };
        let jpegs: Vec<Vec<u8>> = (0..simulation.n_frames()).map(encode).collect();
        let images: Vec<Image> = jpegs.iter().map(|jpeg| decode(jpeg)).collect();
        let rooms = (0..images.len()).map(|frame_idx| simulation.place(frame_idx).to_owned()).collect();
        let projection = match kind {
            CameraKind::Perspective => Projection::Perspective,
            CameraKind::Omnidirectional => Projection::Omnidirectional(Mirror::estimate(&images).unwrap()),
        };
        Self { jpegs, images, rooms, camera: Camera::new(projection) }
    }

    fn describe(&self, config: &Config) -> Vec<Features> {
        let extractor = Extractor::new(config, self.camera.clone());
        let mut scratch = Scratch::default();
        self.images.iter().map(|image| extractor.extract(image, &mut scratch)).collect()
    }
}

/// What a model does after describing, in its parts.
struct Classification {
    vocabulary: Vocabulary,
    bags: Matrix,
    svm: LinearSvm,
    calibration: Calibration,
}

impl Classification {
    fn train(features: &[Features], rooms: &[String], config: &Config) -> Self {
        let Representation::Bag(vocabulary) = &config.machines().unwrap().representation else {
            panic!("no bag by default")
        };
        let local = features.iter().flat_map(|features| &features.seen).filter_map(Seen::local);
        let frames: Vec<Described> = local.map(LocalFeatures::described).collect();
        let vocabulary = Vocabulary::train(&frames, vocabulary, config.seed).unwrap();
        let mut bags = Matrix::new(vocabulary.n_columns());
        frames.iter().for_each(|&frame| bags.push_row(&vocabulary.row(frame)));

        let mut names = rooms.to_vec();
        names.sort();
        names.dedup();
        let labels: Vec<usize> = rooms.iter().map(|room| names.binary_search(room).unwrap()).collect();
        let svm = LinearSvm::train(&bags, &labels, names.len(), &svm::Config::default()).unwrap();
        // Fitted on what the machines were trained on: good for nothing but its cost.
        let mut decisions = Matrix::new(svm.scheme().n_machines(names.len()));
        bags.rows().for_each(|bag| decisions.push_row(&svm.decision_values(bag)));
        let calibration = Calibration::fit_shared(svm.scheme(), &decisions, &labels, names.len()).unwrap();
        Self { vocabulary, bags, svm, calibration }
    }
}

fn measure(group: &mut BenchmarkGroup<WallTime>, drive: &Drive) {
    let config = Config::default();
    let features = drive.describe(&config);
    let parts = Classification::train(&features, &drive.rooms, &config);
    let view = drive.camera.view(drive.images[0].width(), drive.images[0].height());
    let bags: Vec<&[f32]> = parts.bags.rows().collect();

    each(group, "decode", &drive.jpegs, |jpeg| decode(jpeg));
    let machines = config.machines().unwrap();
    each(group, "detect", &drive.images, |image| machines.detector.detect(image, &view));
    let local = features.iter().filter_map(|features| features.seen[0].local());
    let described: Vec<(&Image, &LocalFeatures)> = drive.images.iter().zip(local).collect();
    each(group, "describe", &described, |(image, local)| {
        machines.descriptor.describe(image, &local.keypoints, &view)
    });
    each(group, "bag", &described, |(_, local)| parts.vocabulary.row(local.described()));
    each(group, "words", &described, |(_, local)| parts.vocabulary.quantize(&local.descriptors));
    let columns = UnitColumns::new(parts.vocabulary.centers());
    each(group, "words, each compared with all", &described, |(_, local)| {
        let mut words = vec![0; local.descriptors.n_rows()];
        nearest_columns(&UnitRows::new(&local.descriptors), &columns, &mut words);
        words
    });
    each(group, "classify", &bags, |bag| parts.calibration.probabilities(&parts.svm.decision_values(bag)));

    let model = train_model(drive, features, &config);
    let mut scratch = Scratch::default();
    each(group, "whole", &drive.jpegs, |jpeg| model.recognize(&decode(jpeg), &mut scratch));
}

fn train_model(drive: &Drive, features: Vec<Features>, config: &Config) -> Model {
    let sample = |(features, room): (Features, &String)| Sample {
        room: room.clone(),
        sequence: String::new(),
        name: String::new(),
        pose: None,
        picture: None,
        features,
    };
    let samples: Vec<Sample> = features.into_iter().zip(&drive.rooms).map(sample).collect();
    let samples: Vec<&Sample> = samples.iter().collect();
    Model::train(&samples, config, drive.camera.clone(), |_| ()).unwrap().model
}

fn decode(jpeg: &[u8]) -> Image {
    Image::decode(jpeg, &Limits::default()).unwrap()
}

/// Measures `step` on one input after the other, round and round.
fn each<T, R>(group: &mut BenchmarkGroup<WallTime>, name: &str, inputs: &[T], mut step: impl FnMut(&T) -> R) {
    let mut next = inputs.iter().cycle();
    group.bench_function(name, |bencher| {
        bencher.iter(|| next.next().map(|input| step(black_box(input))));
    });
}
