//! `roomsight replay` against a service.

use crate::http::service::{Server, room};
use roomsight::settings::Settings;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;
use tokio::task::spawn_blocking;

const FAILED: i32 = 1;
const GATE_FAILED: i32 = 3;
const ROOMS: [&str; 3] = ["stripes", "bars", "dots"];
const N_FRAMES_A_ROOM: u32 = 4;
const N_FRAMES: u32 = 3 * N_FRAMES_A_ROOM;

/// A folder a room.
fn rooms() -> TempDir {
    let folder = TempDir::new().unwrap();
    for (room_idx, name) in (0..).zip(ROOMS) {
        for shift in 0..N_FRAMES_A_ROOM {
            write(&folder.path().join(name).join(format!("{shift}.pgm")), &room(room_idx, shift * 5));
        }
    }
    folder
}

fn write(path: &Path, bytes: &[u8]) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

/// Replays these frames to this address.
async fn replay(data: &TempDir, url: &str, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_roomsight"));
    command.arg("replay").arg(data.path()).args(["--url", url]).args(arguments).stdin(Stdio::null());
    spawn_blocking(move || command.output().unwrap()).await.unwrap()
}

/// The figures of a replay that must succeed.
async fn figures(data: &TempDir, url: &str, arguments: &[&str]) -> Value {
    let output = replay(data, url, &[arguments, &["--json"]].concat()).await;
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn every_frame_of_a_replay_by_rest_is_counted() {
    let (server, data) = (Server::start(Settings::default()).await, rooms());
    let told =
        figures(&data, &server.url, &["--transport=rest", "--rate=100", "--robots=3", "--limit=10"]).await;
    assert_eq!(told["frames"]["sent"], 30, "{told}");
    assert_eq!(told["frames"]["results"], 30, "{told}");
    assert_eq!(told["frames"]["unaccounted"], 0, "{told}");
    assert_eq!(told["model"], "lab/1", "{told}");
    assert!(told["accuracy_raw"]["rate"].as_f64().unwrap() > 0.9, "{told}");
    assert!(told["latency_ms"]["p99_9"].as_f64().unwrap() > 0.0, "{told}");
    assert!(told["duration_s"].as_f64().unwrap() >= 0.09, "{told}");
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_frames_and_unknown_rooms_are_told() {
    let (server, data) = (Server::start(Settings::default()).await, rooms());
    write(&data.path().join("attic/0.pgm"), &room(0, 0));
    write(&data.path().join("attic/1.pgm"), b"no image");
    let arguments = ["--transport=rest", "--rate=max"];
    let told = figures(&data, &server.url, &arguments).await;
    assert_eq!(told["unknown_rooms"], serde_json::json!(["attic"]), "{told}");
    assert_eq!(told["errors"], serde_json::json!({"not-an-image": 1}), "{told}");
    assert_eq!(told["frames"]["failed"], 1, "{told}");
    assert_eq!(told["accuracy_raw"]["n_frames"], N_FRAMES + 1, "{told}");
    let table = text(&replay(&data, &server.url, &arguments).await.stdout);
    for said in ["p99.9", "not-an-image", "attic", "without any answer"] {
        assert!(table.contains(said), "{said}: {table}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_gate_that_fails_is_named_and_has_a_code_of_its_own() {
    let (server, data) = (Server::start(Settings::default()).await, rooms());
    let page = data.path().with_extension("html");
    let arguments = ["--transport=rest", "--rate=max", "--html", page.to_str().unwrap()];
    let gates = ["--max-p99=60000", "--max-errors=0", "--max-drops=0", "--min-accuracy=0.5"];
    let output = replay(&data, &server.url, &[&arguments[..], &gates].concat()).await;
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
    let html = fs::read_to_string(&page).unwrap();
    fs::remove_file(&page).unwrap();
    assert!(html.contains("<svg") && html.contains("Latency") && html.contains("holds"), "{html}");

    let gates = ["--max-p99=0.001", "--max-errors=0"];
    let output = replay(&data, &server.url, &[&arguments[..2], &gates].concat()).await;
    assert_eq!(output.status.code(), Some(GATE_FAILED), "{}", text(&output.stderr));
    let said = text(&output.stderr);
    assert!(said.contains("--max-p99") && !said.contains("--max-errors"), "{said}");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_replayed_is_refused_with_a_reason() {
    let (server, data) = (Server::start(Settings::default()).await, rooms());
    let nowhere = "http://127.0.0.1:1";
    for (url, arguments, reason) in [
        (server.url.as_str(), &["--transport=rest"][..], "--rate"),
        (&server.url, &["--transport=rest", "--rate=5", "--mode=latest"], "--mode"),
        (&server.url, &["--rate=5", "--camera=omnidirectional", "--split=x"], "split"),
        (nowhere, &["--transport=rest", "--rate=5"], nowhere),
        (nowhere, &["--rate=5"], nowhere),
        ("https://lab", &["--rate=5"], "https"),
    ] {
        let output = replay(&data, url, arguments).await;
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(FAILED), "{arguments:?}: {said}");
        assert!(said.contains(reason), "{arguments:?}: {said}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_frame_of_a_replay_by_stream_has_its_answer() {
    let (server, data) = (Server::start(Settings::default()).await, rooms());
    let arguments = ["--rate=100", "--robots=3", "--limit=10", "--mode=lossless", "--filter"];
    let told = figures(&data, &server.url, &arguments).await;
    assert_eq!(told["frames"]["sent"], 30, "{told}");
    assert_eq!(told["frames"]["results"], 30, "{told}");
    assert_eq!(told["errors"], serde_json::json!({}), "{told}");
    assert_eq!(told["accuracy_filtered"]["n_frames"], 30, "{told}");
    let course = told["course"].as_array().unwrap();
    let over_time: u64 = course.iter().map(|interval| interval["results"].as_u64().unwrap()).sum();
    assert_eq!(over_time, told["frames"]["results"].as_u64().unwrap(), "{told}");
    assert!(told["accuracy_raw"]["rate"].as_f64().unwrap() > 0.9, "{told}");
    assert!(told["age_ms"]["p50"].as_f64().unwrap() > 0.0, "{told}");
}

#[tokio::test(flavor = "multi_thread")]
async fn at_full_speed_a_lossless_stream_loses_nothing_and_another_says_what_it_drops() {
    let (server, data) = (Server::start(Settings::default()).await, rooms());
    let full_speed = ["--rate=max", "--loop", "--duration=0.3", "--robots=2", "--no-filter"];
    let lossless = figures(&data, &server.url, &[&full_speed[..], &["--mode=lossless"]].concat()).await;
    let sent = lossless["frames"]["sent"].as_u64().unwrap();
    assert!(sent > 2, "{lossless}");
    assert_eq!(lossless["frames"]["results"], sent, "{lossless}");
    assert_eq!(lossless["accuracy_filtered"], Value::Null, "{lossless}");
    let latest = figures(&data, &server.url, &full_speed).await;
    let count = |name: &str| latest["frames"][name].as_u64().unwrap();
    assert!(count("results") >= 2 && count("dropped") > 0, "{latest}");
    assert_eq!(count("sent"), count("results") + count("dropped"), "{latest}");
    assert_eq!(latest["dropped"]["superseded"], count("dropped"), "{latest}");
}
