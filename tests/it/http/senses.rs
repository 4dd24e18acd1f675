//! What robots sense beside pictures: the scan of a laser, and how far they went.

use crate::http::robot::{Robot, result};
use crate::http::service::{FORM, Server, room, train_beside, with_words};
use crate::http::stream::error;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use roomsight::settings::Settings;
use roomsight_protocol::header::{Beside, Odometry};
use roomsight_protocol::rest::Answer;
use roomsight_protocol::scan::LaserScan;
use roomsight_protocol::stream::{ServerMessage, StreamResult};
use roomsight_recognition::model::{LaserConfig, OpinionConfig, Scan};
use serde_json::{Value, json};
use std::f32::consts::PI;
use tempfile::TempDir;

const ROOMS: [&str; 3] = ["stripes", "bars", "dots"];

/// In the middle of a square room, larger from room to room.
fn scan(room_idx: u32, n_degrees: usize) -> LaserScan {
    let start = -(n_degrees as f32).to_radians() / 2.0;
    let range = |beam: usize| {
        let (sin, cos) = (start + (beam as f32).to_radians()).sin_cos();
        (1.0 + 1.5 * room_idx as f32) / sin.abs().max(cos.abs())
    };
    LaserScan {
        angle_min: start,
        angle_increment: PI / 180.0,
        range_max: 20.0,
        ranges: (0..=n_degrees).map(|beam| Some(range(beam))).collect(),
    }
}

/// A service whose model looks at scans.
async fn server() -> (Server, TempDir) {
    let mut config = with_words();
    config.opinions.insert("laser".to_owned(), OpinionConfig::Laser(LaserConfig::default()));
    let core = |room_idx| {
        let LaserScan { angle_min, angle_increment, range_max, ranges } = scan(room_idx, 180);
        Scan::new(angle_min, angle_increment, range_max, ranges.into_iter().flatten().collect()).ok()
    };
    let models = TempDir::new().unwrap();
    train_beside(&config, ROOMS, core).save(&models.path().join("lab/1"), &[]).unwrap();
    let settings = Settings { models: models.path().to_owned(), ..Settings::default() };
    (Server::of(settings).await, models)
}

/// A PGM too dark to see anything.
fn dark() -> Vec<u8> {
    [b"P5\n96 72\n255\n".to_vec(), vec![0; 96 * 72]].concat()
}

fn form(frame: &[u8], scan: &str) -> Vec<u8> {
    let mut body = Vec::new();
    for (name, bytes) in [("frame", frame), ("scan", scan.as_bytes())] {
        body.extend(format!("--edge\r\ncontent-disposition: form-data; name=\"{name}\"\r\n\r\n").bytes());
        body.extend(bytes);
        body.extend(b"\r\n");
    }
    body.extend(b"--edge--\r\n");
    body
}

async fn read<T: serde::de::DeserializeOwned>(call: reqwest::RequestBuilder, status: u16) -> T {
    let response = call.send().await.unwrap();
    let (found, text) = (response.status().as_u16(), response.text().await.unwrap());
    assert_eq!(found, status, "{text}");
    serde_json::from_str(&text).unwrap()
}

#[tokio::test]
async fn a_dark_frame_is_answered_by_the_scan_beside_it_in_a_form_and_in_json() {
    let (server, _models) = server().await;
    let alone: Answer = read(server.post("/v1/recognize", dark()), 200).await;
    assert!(!alone.known && alone.unknown.is_some());
    for (room_idx, room) in ROOMS.iter().enumerate() {
        let scan = scan(room_idx as u32, 180);
        let text = serde_json::to_string(&scan).unwrap();
        let in_form: Answer = read(server.post_as("/v1/recognize", FORM, form(&dark(), &text)), 200).await;
        assert_eq!(in_form.room, *room);
        let body = json!({"frame": BASE64_STANDARD.encode(dark()), "scan": scan}).to_string();
        let in_json: Answer =
            read(server.post_as("/v1/recognize", "application/json", body.into()), 200).await;
        assert_eq!(in_json.probabilities, in_form.probabilities);
        let client = roomsight_client::Client::new(&server.url, None).unwrap();
        let by_client = client.recognize_with_scan(dark(), &scan, &Default::default()).await.unwrap();
        assert_eq!(by_client.probabilities, in_form.probabilities);
    }
}

#[tokio::test]
async fn scans_that_are_none_or_of_another_laser_are_refused_with_the_reason() {
    let (server, _models) = server().await;
    let detail = async |scan: &str, path: &str| {
        let problem: Value = read(server.post_as(path, FORM, form(&dark(), scan)), 400).await;
        problem["detail"].as_str().unwrap().to_owned()
    };
    let text = |scan: &LaserScan| serde_json::to_string(scan).unwrap();
    let narrow = detail(&text(&scan(0, 90)), "/v1/recognize").await;
    assert!(narrow.contains("covers 90 degrees") && narrow.contains("trained on 180"), "{narrow}");
    let few = detail(&text(&LaserScan { ranges: vec![Some(1.0); 3], ..scan(0, 180) }), "/v1/recognize").await;
    assert!(few.contains("from 16 to"), "{few}");
    let turned = detail(&text(&LaserScan { angle_increment: 9.0, ..scan(0, 180) }), "/v1/recognize").await;
    assert!(turned.contains("radians"), "{turned}");
    assert!(detail("no scan", "/v1/recognize").await.contains("JSON"));
    assert!(detail(&text(&scan(0, 180)), "/v1/recognize/batch").await.contains("single frame"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_streamed_frame_brings_its_scan_before_the_image() {
    let (server, _models) = server().await;
    let mut robot = Robot::connect(&server, "?mode=lossless&filter=false").await;
    let mut ask = async |seq: u64, image: &[u8], scan: Option<&LaserScan>| {
        robot.send(Beside { scan, ..Beside::default() }.message(seq, image)).await;
        robot.next().await
    };
    for (room_idx, room) in (0..).zip(ROOMS) {
        let StreamResult { seq, answer, .. } =
            result(ask(u64::from(room_idx), &dark(), Some(&scan(room_idx, 180))).await);
        assert_eq!((seq, answer.room.as_str()), (u64::from(room_idx), room));
    }
    let narrow = ask(3, &dark(), Some(&scan(0, 90))).await;
    assert_eq!(error(&narrow), (Some(3), "bad-request"));
    let ServerMessage::Error { problem, .. } = narrow else { panic!("an error") };
    assert!(problem.detail.contains("covers 90 degrees"), "{}", problem.detail);
    assert_eq!(result(ask(4, &room(0, 0), None).await).seq, 4, "the stream lives on");
    // The scan ends within the message.
    let message = Beside { scan: Some(&scan(0, 180)), ..Beside::default() }.message(5, b"");
    robot.send(message[..message.len() - 1].to_vec()).await;
    assert_eq!(error(&robot.next().await), (Some(5), "bad-request"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_that_stands_is_believed_to_stay() {
    let (server, _models) = server().await;
    let certainty = async |odometry: fn(u64) -> Option<Odometry>| {
        let mut robot = Robot::connect(&server, "?mode=lossless").await;
        let mut belief = 0.0;
        for seq in 0..40 {
            // Ten frames of a room, then frames in which nothing is seen, a second apart.
            let image = if seq < 10 { room(0, seq as u32) } else { dark() };
            let captured_at_ns = Some(1_800_000_000_000_000_000 + seq * 1_000_000_000);
            let beside = Beside { captured_at_ns, odometry: odometry(seq), scan: None };
            robot.send(beside.message(seq, &image)).await;
            let filtered = result(robot.next().await).filtered.unwrap();
            belief = filtered.probabilities.iter().find(|p| p.room == "stripes").unwrap().probability;
        }
        belief
    };
    let by_time = certainty(|_| None).await;
    let standing = certainty(|_| Some(Odometry { x: 3.0, y: 1.0, heading: 0.5 })).await;
    let driving = certainty(|seq| Some(Odometry { x: 0.3 * seq as f64, y: 1.0, heading: 0.5 })).await;
    assert!(standing > 0.9 && by_time < 0.7, "{standing}, {by_time}");
    assert!((driving - by_time).abs() < 0.05, "{driving} at the usual speed, {by_time}");
    let carried =
        certainty(|seq| Some(Odometry { x: if seq < 39 { 0.0 } else { 50.0 }, y: 0.0, heading: 0.0 })).await;
    assert!(carried < 0.5, "{carried}");
}
