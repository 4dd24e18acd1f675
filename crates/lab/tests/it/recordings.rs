//! Recordings as data sets: which pictures are taken, and what tells their rooms.

use mcap::records::MessageHeader;
use roomsight_lab::dataset::{self, Clock, Dataset, Format, Taking};
use roomsight_recognition::model::{Config, Extractor};
use roomsight_vision::camera::{Camera, CameraKind, Projection};
use roomsight_vision::image::Limits;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{BufWriter, Cursor};
use std::path::Path;
use tempfile::TempDir;

/// When the first picture is recorded; its stamp is of a clock that began with the robot.
const FIRST_NS: u64 = 1_700_000_000_000_000_000;
const FIRST_STAMP_NS: u64 = 40_000_000_000;
const SECOND_NS: u64 = 1_000_000_000;
const N_PICTURES: u64 = 12;

/// A picture with something to see.
fn png(number: u64) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let pixel = |x, y| image::Luma([((x * x * (number as u32 + 3) + y * y * 7) % 251) as u8]);
    image::GrayImage::from_fn(96, 64, pixel).write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// Fields of CDR, aligned.
#[derive(Default)]
struct Cdr(Vec<u8>);

impl Cdr {
    fn number<const N: usize>(&mut self, bytes: [u8; N]) {
        self.0.resize(self.0.len().next_multiple_of(N), 0);
        self.0.extend(bytes);
    }

    fn bytes(&mut self, bytes: &[u8]) {
        self.number((bytes.len() as u32).to_le_bytes());
        self.0.extend(bytes);
    }

    fn text(&mut self, text: &str) {
        self.bytes(&[text.as_bytes(), &[0]].concat());
    }

    fn header(&mut self, stamp_ns: u64, frame: &str) {
        self.number(((stamp_ns / SECOND_NS) as u32).to_le_bytes());
        self.number(((stamp_ns % SECOND_NS) as u32).to_le_bytes());
        self.text(frame);
    }

    fn message(self) -> Vec<u8> {
        [&[0, 1, 0, 0][..], &self.0].concat()
    }
}

fn compressed(number: u64, stamp_ns: u64) -> Vec<u8> {
    let mut cdr = Cdr::default();
    cdr.header(stamp_ns, "camera");
    cdr.text("png");
    cdr.bytes(&png(number));
    cdr.message()
}

fn pose(x: f64, stamp_ns: u64) -> Vec<u8> {
    let mut cdr = Cdr::default();
    cdr.header(stamp_ns, "map");
    [x, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0].iter().for_each(|number: &f64| cdr.number(number.to_le_bytes()));
    cdr.message()
}

/// A scan of as many degrees, everything so far away.
fn scan(range: f32, n_degrees: usize) -> Vec<u8> {
    let mut cdr = Cdr::default();
    cdr.header(0, "laser");
    let half = (n_degrees as f32).to_radians() / 2.0;
    let numbers = [-half, half, 1_f32.to_radians(), 0.0, 0.1, 0.1, 20.0];
    numbers.iter().for_each(|number| cdr.number(number.to_le_bytes()));
    for n_numbers in [n_degrees + 1, 0] {
        cdr.number((n_numbers as u32).to_le_bytes());
        (0..n_numbers).for_each(|_| cdr.number(range.to_le_bytes()));
    }
    cdr.message()
}

/// Where the wheels say that the robot is.
fn odometry(x: f64) -> Vec<u8> {
    let mut cdr = Cdr::default();
    cdr.header(0, "odom");
    cdr.text("base_link");
    [x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0].iter().for_each(|number: &f64| cdr.number(number.to_le_bytes()));
    cdr.message()
}

/// A picture a second, a pose every half, scans and odometry beside, and the room each time it changes: the hall, from the fifth
/// picture on the kitchen.
fn record(path: &Path, topics_of_pictures: &[&str]) {
    let mut writer = mcap::Writer::new(BufWriter::new(File::create(path).unwrap())).unwrap();
    let mut write = |topic: &str, type_name: &str, time_ns: u64, message: &[u8]| {
        let schema = writer.add_schema(type_name, "ros2msg", b"-").unwrap();
        let channel_id = writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap();
        let header = MessageHeader { channel_id, sequence: 0, log_time: time_ns, publish_time: time_ns };
        writer.write_to_known_channel(&header, message).unwrap();
    };
    for number in 0..N_PICTURES {
        let (time_ns, stamp_ns) = (FIRST_NS + number * SECOND_NS, FIRST_STAMP_NS + number * SECOND_NS);
        for half in 0..2 {
            let x = number as f64 + f64::from(half) / 2.0 - 0.1;
            let at = time_ns + u64::from(half as u8) * SECOND_NS / 2 - SECOND_NS / 10;
            write("/pose", "geometry_msgs/msg/PoseStamped", at, &pose(x, stamp_ns));
        }
        write(
            "/scan",
            "sensor_msgs/msg/LaserScan",
            time_ns + SECOND_NS / 10,
            &scan(1.0 + number as f32, 270),
        );
        for at in [time_ns - SECOND_NS / 5, time_ns + SECOND_NS / 5] {
            let x = (at as i128 - i128::from(FIRST_NS)) as f64 / 1e9;
            write("/odom", "nav_msgs/msg/Odometry", at, &odometry(0.5 * x));
        }
        if let Some(room) = [(0, "hall"), (5, "kitchen")].iter().find(|(first, _)| *first == number) {
            let mut cdr = Cdr::default();
            cdr.text(room.1);
            write("/room", "std_msgs/msg/String", time_ns, &cdr.message());
        }
        for topic in topics_of_pictures {
            write(topic, "sensor_msgs/msg/CompressedImage", time_ns, &compressed(number, stamp_ns));
        }
    }
    writer.finish().unwrap();
}

/// A folder with one recording in it.
fn one() -> TempDir {
    let folder = TempDir::new().unwrap();
    record(&folder.path().join("run.mcap"), &["/camera"]);
    folder
}

fn open(folder: &TempDir, taking: &Taking) -> Result<Dataset, String> {
    dataset::open_for(&folder.path().join("run.mcap"), &[], taking).map_err(|error| error.to_string())
}

/// The rooms of the pictures by their seconds; a dash where there is none.
fn rooms(dataset: Dataset) -> String {
    let letter = |room: &str| room.chars().next().unwrap_or('-');
    dataset.with_unlabeled().frames.iter().map(|frame| letter(&frame.room)).collect()
}

fn reason(folder: &TempDir, taking: &Taking) -> String {
    open(folder, taking).unwrap_err()
}

#[test]
fn a_list_beside_a_recording_tells_the_rooms() {
    let folder = one();
    fs::write(folder.path().join("run.rooms.csv"), "time,room\n1,hall\n3.5,\n0:06,kitchen\n").unwrap();
    let dataset = open(&folder, &Taking::default()).unwrap();
    assert_eq!((dataset.format, dataset.frames.len(), dataset.unlabeled.len()), (Format::Recording, 9, 3));
    assert_eq!(dataset.frames[0].sequence, "run");
    assert_eq!(dataset.frames[0].time, Some(1_700_000_001.0));
    assert_eq!(dataset.name_of(&dataset.frames[0].path), "run.mcap/1700000001.000000000");
    assert_eq!(dataset.frames[2].read_encoded(&Limits::default()).unwrap(), png(3));
    assert_eq!(dataset.clone().with_unlabeled().rooms(), ["hall", "kitchen"]);
    assert_eq!(rooms(dataset), "-hhh--kkkkkk");
}

#[test]
fn a_topic_or_a_map_tells_the_rooms() {
    let folder = one();
    let topic = Taking { room_topic: Some("/room".to_owned()), ..Taking::default() };
    assert_eq!(rooms(open(&folder, &topic).unwrap()), "hhhhhkkkkkkk");
    let map = folder.path().join("rooms.yaml");
    fs::write(&map, "rooms:\n- {name: hall, polygon: [[-1,0],[3.5,0],[3.5,1],[-1,1]]}\n- {name: bath, polygon: [[6,0],[8.5,0],[8.5,1],[6,1]]}\n").unwrap();
    let map = Taking { map: Some(map), pose_topic: Some("/pose".to_owned()), ..Taking::default() };
    let dataset = open(&folder, &map).unwrap();
    let pose = dataset.frames[1].pose.unwrap();
    assert!((pose.x - 1.0).abs() < 1e-9 && pose.y == 0.5, "between those before and after: {pose:?}");
    assert_eq!(rooms(dataset), "hhhh--bbb---");
}

#[test]
fn a_range_a_rate_and_the_clock_of_stamps_are_kept_to() {
    let folder = one();
    let room_topic = Some("/room".to_owned());
    let some = Taking { from: Some(3.0), to: Some(9.0), rate: Some(0.5), room_topic, ..Taking::default() };
    assert_eq!(rooms(open(&folder, &some).unwrap()), "hkkk");
    let labels = folder.path().join("labels.csv");
    fs::write(&labels, "start,end,room\n0,4,hall\n").unwrap();
    let stamps = Taking { clock: Clock::Stamps, labels: Some(labels), ..Taking::default() };
    let dataset = open(&folder, &stamps).unwrap();
    assert_eq!(dataset.frames[0].time, Some(40.0));
    assert_eq!(rooms(dataset), "hhhh--------");
}

#[test]
fn what_is_not_there_is_named() {
    let folder = one();
    let topic = |topic: &str| Taking { topic: Some(topic.to_owned()), ..Taking::default() };
    assert!(reason(&folder, &topic("/cam")).contains("/camera (sensor_msgs/msg/CompressedImage)"));
    assert!(reason(&folder, &topic("/pose")).contains("no pictures"));
    let texts = Taking { room_topic: Some("/pose".to_owned()), ..Taking::default() };
    assert!(reason(&folder, &texts).contains("/room (std_msgs/msg/String)"));
    let labels = folder.path().join("labels.csv");
    fs::write(&labels, "start,end,room\n1600000000,1600000100,hall\n").unwrap();
    let labels = Taking { labels: Some(labels), ..Taking::default() };
    assert!(reason(&folder, &labels).contains("labels from 1600000000.000"), "{}", reason(&folder, &labels));
    let map = folder.path().join("far.geojson");
    fs::write(
        &map,
        r#"{"type":"FeatureCollection","features":[{"type":"Feature","properties":{"name":"a"},
        "geometry":{"type":"Polygon","coordinates":[[[90,0],[91,0],[91,1],[90,0]]]}}]}"#,
    )
    .unwrap();
    let map = Taking { map: Some(map), pose_topic: Some("/pose".to_owned()), ..Taking::default() };
    assert!(reason(&folder, &map).contains("other coordinates"));
    let unlabeled = open(&folder, &Taking::default()).unwrap();
    assert!(unlabeled.check().unwrap_err().to_string().contains("NAME.rooms.csv"));
    record(&folder.path().join("two.mcap"), &["/left", "/right"]);
    let two = dataset::open(&folder.path().join("two.mcap")).unwrap_err().to_string();
    assert!(two.contains("--topic") && two.contains("/left") && two.contains("/right"), "{two}");
}

#[test]
fn scans_and_odometry_lie_beside_pictures_whatever_clock_dates_these() {
    let folder = one();
    for clock in [Clock::Recorder, Clock::Stamps] {
        let room_topic = Some("/room".to_owned());
        let taking = Taking { laser: true, odometry: true, clock, room_topic, ..Taking::default() };
        let dataset = open(&folder, &taking).unwrap().with_unlabeled();
        assert_eq!(dataset.laser().map(|shape| shape.field_degrees), Some(270.0));
        assert!(!dataset.has_other_scans);
        for (number, frame) in dataset.frames.iter().enumerate() {
            assert_eq!(frame.read_scan().unwrap().unwrap().ranges()[7], 1.0 + number as f32);
            assert!((frame.odometry.unwrap().x - 0.5 * number as f64).abs() < 1e-6);
        }
        let since = dataset.frames[2].interval_to(&dataset.frames[3]).unwrap();
        assert!((since.motion.unwrap().meters - 0.5).abs() < 1e-6);
    }
    let plain = open(&folder, &Taking::default()).unwrap().with_unlabeled();
    assert!(plain.frames.iter().all(|frame| frame.scan.is_none() && frame.odometry.is_none()));
    assert!(plain.has_other_scans);
    let other = |scan_topic: &str| Taking {
        laser: true,
        scan_topic: Some(scan_topic.to_owned()),
        ..Taking::default()
    };
    assert!(reason(&folder, &other("/lidar")).contains("/scan (sensor_msgs/msg/LaserScan)"));
    let other = Taking { odometry: true, odometry_topic: Some("/pose".to_owned()), ..Taking::default() };
    assert!(reason(&folder, &other).contains("/odom (nav_msgs/msg/Odometry)"));
}

#[test]
fn a_folder_of_recordings_is_described_as_its_pictures_are() {
    let folder = one();
    fs::create_dir(folder.path().join("monday")).unwrap();
    record(&folder.path().join("monday/run.mcap"), &["/camera"]);
    fs::write(folder.path().join("notes.mcap"), "no recording").unwrap();
    let taking = Taking { room_topic: Some("/room".to_owned()), ..Taking::default() };
    let recorded = dataset::open_for(folder.path(), &[], &taking).unwrap();
    assert_eq!(recorded.problems.len(), 1, "{:?}", recorded.problems);
    let drives: BTreeSet<&str> = recorded.frames.iter().map(|frame| frame.sequence.as_str()).collect();
    assert_eq!(drives.into_iter().collect::<Vec<_>>(), ["monday/run", "run"]);
    let recorded = recorded.with_camera(CameraKind::Perspective).unwrap().with_sequences("run").unwrap();
    let pictures = TempDir::new().unwrap();
    for (number, frame) in (0..).zip(&recorded.frames) {
        let room = pictures.path().join(&frame.room).join("run");
        fs::create_dir_all(&room).unwrap();
        fs::write(room.join(format!("{number}.png")), png(number)).unwrap();
    }
    let extractor = Extractor::new(&Config::default(), Camera::new(Projection::Perspective));
    let describe = |dataset: &Dataset| {
        let described = dataset.describe(&extractor, &Limits::default(), || ());
        assert_eq!(described.problems, []);
        let features =
            described.samples.into_iter().map(|sample| (sample.room, sample.picture, sample.features));
        features.collect::<Vec<_>>()
    };
    let expected = describe(&dataset::open(pictures.path()).unwrap());
    assert_eq!(describe(&recorded), expected);
    assert_eq!(expected.len(), N_PICTURES as usize);
}
