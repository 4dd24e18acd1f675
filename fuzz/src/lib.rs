//! What the fuzz targets do with their bytes: everything that somebody else sends is read here, by the same
//! functions as in the program.
//!
//! Each target holds what its reader promises and panics where that is broken. `tests/it/fuzzing.rs` runs the same
//! functions over seeds and over inputs that once broke something.

mod service;

pub use service::{exchange, robots_key, service, start_service};

use roomsight::repository::package;
use roomsight::settings::Settings;
use roomsight_lab::dataset::{self, Clock, Taking};
use roomsight_protocol::header::{Header, HeaderError};
use roomsight_protocol::oip::request::Inference;
use roomsight_protocol::oip::{IndexRequest, LoadRequest};
use roomsight_protocol::rest::FrameJson;
use roomsight_protocol::scan::LaserScan;
use roomsight_protocol::stream::{ClientMessage, StreamQuery};
use roomsight_recognition::filter::{Observation, RoomFilter, Step, Transitions, Trust};
use roomsight_recognition::model::{
    self, Config, Extractor, LaserShape, Model, NetworkStore, OpinionConfig, PatternsConfig, Scan, Scratch,
    features_from_bytes, features_to_bytes, try_model,
};
use roomsight_recording::Recording;
use roomsight_recording::message::{Picture, located, stamp_ns, sweep, text};
use roomsight_vision::camera::{Camera, Projection};
use roomsight_vision::image::{Image, Limits};
use roomsight_vision::network::{Description, Network, NetworkError};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Small, so that an input that asks for much is told from one that is slow.
fn limits() -> Limits {
    Limits { max_side: 2048, max_pixels: 1 << 20, max_memory: 64 << 20, ..Limits::default() }
}

/// A frame of any format: an image within the limits, or a refusal.
pub fn pictures(bytes: &[u8]) {
    let colored = Image::decode_with_colors(bytes, &limits());
    let plain = Image::decode(bytes, &limits());
    assert_eq!(colored.as_ref().err(), plain.as_ref().err(), "colors decide nothing");
    let (Ok(image), Ok(colored)) = (plain, colored) else { return };
    assert!(image.colors().is_none());
    assert_eq!(image.pixels(), colored.pixels());
    assert_eq!((image.width(), image.reduction()), (colored.width(), colored.reduction()));
    assert_eq!((image.damaged_rows(), image.visible()), (colored.damaged_rows(), colored.visible()));
    assert!(colored.colors().is_none_or(|colors| colors.len() == 3 * image.pixels().len()));
    assert!(image.width() <= 2048 && image.height() <= 2048);
    assert_eq!(image.pixels().len(), image.width() * image.height());
    assert!(image.pixels().len() <= 1 << 20);
    if let Some(shrunk) = image.shrink_to(64) {
        assert!(shrunk.width().max(shrunk.height()) <= 64);
    }
}

/// A model file, as it is and put together from its parts: the description of the arrays, the text about the
/// model, the arrays. What loads recognizes, and is written as it was read.
pub fn model(bytes: &[u8]) {
    check_model(bytes);
    let [arrays, about, data] = parts(bytes);
    check_model(&model_file(arrays, about, data));
}

/// The bytes of a model file with this JSON object of arrays, this text about the model and these values.
pub fn model_file(arrays: &[u8], about: &[u8], data: &[u8]) -> Vec<u8> {
    let arrays = String::from_utf8_lossy(arrays);
    let about = serde_json::Value::from(String::from_utf8_lossy(about));
    let header = format!("{{\"__metadata__\":{{\"roomsight\":{about}}},{}", arrays.trim_start_matches('{'));
    [&(header.len() as u64).to_le_bytes(), header.as_bytes(), data].concat()
}

fn check_model(bytes: &[u8]) {
    let Ok(model) = Model::from_bytes(bytes) else { return };
    check_answer(&model);
    let written = model.to_bytes().expect("a model that was read can be written");
    let again = Model::from_bytes(&written).expect("a model that was written can be read");
    assert_eq!(again.to_bytes().expect("it can be written again"), written);
}

fn check_answer(model: &Model) {
    let pixels = (0..96 * 72).map(|idx| (idx * idx % 251) as u8).collect();
    let frame = Image::from_pixels(96, 72, pixels).expect("as many pixels as there are");
    let answer = model.recognize(&frame, &mut Scratch::default());
    assert_eq!(answer.probabilities.len(), model.rooms().len());
    assert!(answer.probabilities.iter().all(|share| (0.0..=1.0).contains(share)), "{answer:?}");
    assert!((answer.probabilities.iter().sum::<f32>() - 1.0).abs() < 1e-3, "{answer:?}");
}

/// Described frames, as what was seen and as the list of a part. What is read is written as it was read; a part that is read names frames.
pub fn described(bytes: &[u8]) {
    let extractor = described_by();
    if let Ok(features) = features_from_bytes(bytes, &extractor) {
        let written = features_to_bytes(&features.iter().collect::<Vec<_>>(), &extractor);
        let again = features_from_bytes(&written.expect("they can be written"), &extractor);
        assert_eq!(again.expect("they can be read"), features);
    }
    let folder = TempDir::new().expect("a temporary folder");
    fs::write(folder.path().join("part-1-of-1.frames.json"), bytes).expect("room for a small file");
    if let Ok(parts) = dataset::open(folder.path()) {
        let described = parts.describe(&extractor, &limits(), || ());
        assert!(described.samples.is_empty(), "what was seen of them is not there");
    }
}

/// How the frames of [`described`] were looked at.
pub fn described_by() -> Extractor {
    let patterns = OpinionConfig::Patterns(PatternsConfig::default());
    let mut config = Config { longest_side: 96, ..Config::default() };
    config.opinions.insert("patterns".to_owned(), patterns);
    Extractor::new(&config, Camera::new(Projection::Perspective))
}

/// The upload of a version: as it is, and as a tar whose checksums and end are right. Nothing is written beside
/// the folder, and nothing but a version into it. The digest is made right, so that what is behind it is read.
pub fn archive(bytes: &[u8]) {
    check_upload(bytes);
    check_upload(&mended_tar(bytes));
}

fn check_upload(body: &[u8]) {
    let room = TempDir::new().expect("a temporary folder");
    let (file, into) = (room.path().join("body"), room.path().join("into"));
    fs::write(&file, body).expect("room for a small file");
    fs::create_dir(&into).expect("room for a folder");
    let limits = package::PackageLimits {
        max_entries: 16,
        max_bytes: 4 << 20,
        max_model_bytes: 1 << 20,
        max_network_bytes: 1 << 20,
        max_side_file_bytes: 1 << 18,
    };
    let unpacked = package::unpack(&file, &into, &limits);
    assert_eq!(names(room.path()), ["body", "into"]);
    for name in names(&into) {
        let parts = [model::MODEL_FILE, model::ABOUT_FILE, model::GOLDEN_FOLDER, model::NETWORKS_FOLDER];
        assert!(parts.contains(&&*name), "{name}");
    }
    if unpacked.is_ok() {
        make_digest_right(&into);
        if let Ok(tried) = try_model(&into, &NetworkStore::default(), |_| ()) {
            check_answer(&tried.loaded.model);
        }
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder of ours").flatten();
    let mut names: Vec<String> =
        entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Checksums of all headers, and the zeros at the end.
fn mended_tar(bytes: &[u8]) -> Vec<u8> {
    const BLOCK: usize = 512;
    const CHECKSUM: std::ops::Range<usize> = 148..156;
    let mut tar = bytes.to_vec();
    for header in tar.chunks_exact_mut(BLOCK).filter(|block| block[257..].starts_with(b"ustar")) {
        header[CHECKSUM].fill(b' ');
        let sum: u32 = header.iter().map(|&byte| u32::from(byte)).sum();
        header[CHECKSUM].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
    }
    tar.resize(tar.len().next_multiple_of(BLOCK) + 2 * BLOCK, 0);
    tar
}

/// Otherwise every change of the model file ends at the digest.
fn make_digest_right(folder: &Path) {
    let about_file = folder.join(model::ABOUT_FILE);
    let (Ok(model), Ok(about)) = (fs::read(folder.join(model::MODEL_FILE)), fs::read(&about_file)) else {
        return;
    };
    let Ok(serde_json::Value::Object(mut about)) = serde_json::from_slice(&about) else { return };
    about.insert("blake3".to_owned(), blake3::hash(&model).to_hex().to_string().into());
    about.insert("n_bytes".to_owned(), model.len().into());
    let about = serde_json::to_vec(&about).expect("JSON that was read can be written");
    fs::write(about_file, about).expect("room for a small file");
}

/// A message of a stream: a frame's header, a text of a client, the URL's query as JSON, the times of frames.
pub fn stream(bytes: &[u8]) {
    if let Ok(Some(header)) = Header::split(bytes) {
        let image = &bytes[header.n_bytes()..];
        let back = Header::split(&header.join(image));
        // As text, since odometry may be no number.
        assert_eq!(format!("{back:?}"), format!("{:?}", Ok::<_, HeaderError>(Some(header))));
        if let Ok(scan) = LaserScan::read(image) {
            let LaserScan { angle_min, angle_increment, range_max, ranges } = scan;
            let ranges = ranges.into_iter().map(|range| range.unwrap_or(f32::INFINITY)).collect();
            if let Ok(scan) = Scan::new(angle_min, angle_increment, range_max, ranges) {
                assert!(LaserShape::default().describe(&scan).iter().all(|number| number.is_finite()));
            }
        }
    }
    if let Ok(message) = serde_json::from_slice::<ClientMessage>(bytes) {
        let text = serde_json::to_string(&message).expect("a message can be written");
        assert_eq!(serde_json::from_str::<ClientMessage>(&text).expect("and read"), message);
        let ClientMessage::Configure(change) = message;
        if let Some(roomsight_protocol::stream::FilterChoice::With(filter)) = change.filter {
            let _refusal = Trust::try_from(filter.trust);
        }
    }
    if let Ok(query) = serde_json::from_slice::<StreamQuery>(bytes) {
        let _change = query.change();
    }
    filter(bytes);
}

/// A belief stays one whatever the frames say, and whenever they come.
fn filter(bytes: &[u8]) {
    let (numbers, _) = bytes.as_chunks::<8>();
    let mut numbers = numbers.iter().map(|number| f64::from_le_bytes(*number));
    let mut next = || numbers.next();
    let transitions = Transitions::learn(
        3,
        (0..4).filter_map(|idx| Some(Step { from: idx % 3, to: 2, seconds: next()?, meters: next() })),
    );
    let mut filter = RoomFilter::new(3, Trust::default());
    while let (Some(elapsed), Some(a), Some(b)) = (next(), next(), next()) {
        let belief = filter.update(
            &transitions,
            elapsed,
            Observation { probabilities: &[a as f32, b as f32, 0.5], novelty: Some(b as f32) },
        );
        assert!((belief.iter().sum::<f32>() - 1.0).abs() < 1e-3, "{belief:?}");
    }
}

/// A request of the Open Inference Protocol, the length of whose JSON the first two bytes say, and JSON of the
/// other calls.
pub fn oip(bytes: &[u8]) {
    const MAX_FRAMES: usize = 8;
    let Some((length, body)) = bytes.split_first_chunk::<2>() else { return };
    let length = u16::from_le_bytes(*length);
    for json_length in [None, Some(usize::from(length))] {
        if let Ok(inference) = Inference::read(body, json_length, MAX_FRAMES) {
            assert!((1..=MAX_FRAMES).contains(&inference.frames.len()));
            let n_bytes: usize = inference.frames.iter().map(|frame| frame.len()).sum();
            assert!(n_bytes <= body.len());
        }
    }
    let _refusals = (
        serde_json::from_slice::<IndexRequest>(body).is_err(),
        serde_json::from_slice::<LoadRequest>(body).is_err(),
        serde_json::from_slice::<FrameJson>(body).is_err(),
    );
}

/// A manifest, the labels of a sequence of COLD, and what was sensed beside its frames. Every frame lies in the data set.
pub fn lists(bytes: &[u8]) {
    let [manifest, labels, senses] = parts(bytes);
    let room = TempDir::new().expect("a temporary folder");
    let [listed, cold] = ["listed", "cold/seq1_cloudy1"].map(|name| room.path().join(name));
    let pictures =
        [listed.join("a"), cold.join("std_cam"), cold.join("localization"), cold.join("odom_scans")];
    for folder in &pictures {
        fs::create_dir_all(folder).expect("room for a folder");
    }
    for file in [listed.join("a/1.jpg"), cold.join("std_cam/t1_x1_y1_a1.jpeg")] {
        fs::write(file, b"").expect("room for a small file");
    }
    fs::write(listed.join("frames.csv"), manifest).expect("room for a small file");
    fs::write(cold.join("localization/places.lst"), labels).expect("room for a small file");
    for file in ["scans.tdf", "odom.tdf"] {
        fs::write(cold.join("odom_scans").join(file), senses).expect("room for a small file");
    }
    let taking = Taking { laser: true, odometry: true, ..Taking::default() };
    for set in [listed, room.path().join("cold")] {
        let Ok(dataset) = dataset::open_for(&set, &[], &taking) else { continue };
        let root = fs::canonicalize(&set).expect("a folder of ours");
        for frame in &dataset.frames {
            let path = fs::canonicalize(&frame.path).expect("only files that are there are listed");
            assert!(path.starts_with(&root), "{}", path.display());
            assert!(!frame.room.is_empty());
        }
    }
}

/// A recording with a list and a map of its rooms: every message is read, or refused, and taken as a data set in each way.
pub fn recordings(bytes: &[u8]) {
    let [labels, map, recording] = parts(bytes);
    let room = TempDir::new().expect("a temporary folder");
    let [labels_file, map_file, run] =
        ["labels.csv", "rooms.yaml", "run.mcap"].map(|name| room.path().join(name));
    let as_json = map_file.with_extension("geojson");
    for (file, bytes) in [(&labels_file, labels), (&map_file, map), (&as_json, map), (&run, recording)] {
        fs::write(file, bytes).expect("room for a small file");
    }
    if let Ok(recording) = Recording::open(&run) {
        let all: Vec<usize> = (0..recording.topics().len()).collect();
        let (messages, _) = recording.messages(&all).unwrap_or_default();
        assert!(messages.is_sorted_by_key(|message| message.time_ns));
        for message in &messages {
            let Ok(bytes) = recording.read(message) else { continue };
            let topic = &recording.topics()[message.topic_idx];
            let _ =
                (stamp_ns(topic, &bytes), text(topic, &bytes), located(topic, &bytes), sweep(topic, &bytes));
            if let Ok(picture) = Picture::read(topic, &bytes) {
                assert!(topic.kind().is_picture());
                let _ = Image::decode(&picture.encoded, &limits());
            }
        }
    }
    let room_topic = Some("/room".to_owned());
    for taking in [
        Taking { labels: Some(labels_file), clock: Clock::Stamps, ..Taking::default() },
        Taking { room_topic, rate: Some(1.0), ..Taking::default() },
        Taking { map: Some(map_file), laser: true, ..Taking::default() },
        Taking { odometry: true, ..Taking::default() },
        Taking { map: Some(as_json), pose_topic: Some("/tf".to_owned()), ..Taking::default() },
    ] {
        if let Ok(dataset) = dataset::open_for(&run, &[], &taking) {
            assert!(dataset.frames.iter().all(|frame| !frame.room.is_empty()));
            assert!(dataset.unlabeled.iter().all(|frame| frame.room.is_empty()));
        }
    }
}

/// A network's description and its ONNX file, as far as they are read without ONNX Runtime. The digest is made right, so
/// that what is behind it is read. A description that is taken is written as it was read, and the text to start from,
/// where there is none, is TOML.
pub fn networks(bytes: &[u8]) {
    let [description, onnx] = parts(bytes);
    let text = String::from_utf8_lossy(description);
    if let Ok(description) = Description::read(&text) {
        let written = toml::to_string(&description).expect("a description can be written");
        assert_eq!(Description::read(&written), Ok(description));
    }
    if let Ok(mut table) = text.parse::<toml::Table>() {
        let digest = blake3::hash(onnx).to_hex().to_string();
        table.insert("digest".to_owned(), digest.clone().into());
        if let Ok(network) = Network::new("network", onnx.into(), &table.to_string()) {
            assert_eq!((network.onnx(), &network.description().digest), (onnx, &digest));
        }
    }
    let room = TempDir::new().expect("a temporary folder");
    let file = room.path().join("network.onnx");
    fs::write(&file, onnx).expect("room for a small file");
    if let Err(NetworkError::NoDescription { text, .. }) = Network::open(&file) {
        assert!(text.parse::<toml::Table>().is_ok(), "{text}");
    }
}

/// The configuration of a model, which is taken or refused by a sentence, and the settings of a service.
pub fn settings(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    if let Ok(config) = toml::from_str::<Config>(&text)
        && config.check().is_ok()
    {
        let written = toml::to_string(&config).expect("a configuration can be written");
        assert_eq!(toml::from_str::<Config>(&written).expect("and read"), config);
        let _extractor = Extractor::new(&config, Camera::new(Projection::Perspective));
    }
    if let Ok(settings) = toml::from_str::<Settings>(&text) {
        settings.to_toml().expect("settings can be written");
    }
}

/// As many parts as asked for: each begins with its length in two bytes, but the last, which is what is left.
pub fn parts<const N: usize>(bytes: &[u8]) -> [&[u8]; N] {
    let mut left = bytes;
    std::array::from_fn(|idx| {
        let (length, rest) = match left.split_first_chunk::<2>() {
            Some((length, rest)) if idx + 1 < N => (usize::from(u16::from_le_bytes(*length)), rest),
            _ => (left.len(), left),
        };
        let (part, rest) = rest.split_at(length.min(rest.len()));
        left = rest;
        part
    })
}
