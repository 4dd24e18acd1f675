//! Models come and go while the service answers.

use crate::http::command::Running;
use crate::http::robot::Robot;
use crate::http::service::{
    OTHER_MODEL, SOON, Server, client, frame, models, problem, room, success, write_damaged_model,
    write_model, write_other_model,
};
use axum::body::Bytes;
use futures_util::StreamExt;
use http_body_util::StreamBody;
use hyper::body::Frame;
use roomsight::repository::package::pack;
use roomsight::settings::{Policy, Settings};
use roomsight_protocol::stream::{FilterChange, ServerMessage};
use roomsight_recognition::model::GoldenFrame;
use safetensors::SafeTensors;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

pub fn settings(folder: &TempDir) -> Settings {
    Settings { models: folder.path().to_owned(), models_poll_ms: 20, ..Settings::default() }
}

pub fn manual(folder: &TempDir) -> Settings {
    Settings { policy: Policy::Manual, ..settings(folder) }
}

/// A version's folder as it is uploaded.
pub fn packed(folder: &Path) -> Vec<u8> {
    let mut body = Vec::new();
    pack(folder, &mut body).unwrap();
    body
}

/// The other model with golden frames, as it is uploaded.
pub fn other_packed(golden_frames: &[GoldenFrame]) -> Vec<u8> {
    let folder = TempDir::new().unwrap();
    OTHER_MODEL.save(&folder.path().join("1"), golden_frames).unwrap();
    packed(&folder.path().join("1"))
}

fn golden(named: &str) -> GoldenFrame {
    let probability = answer_to_stripes();
    GoldenFrame { name: "stripes.pgm".into(), bytes: room(0, 0), scan: None, room: named.into(), probability }
}

/// How sure both models are of a frame of stripes.
fn answer_to_stripes() -> f32 {
    let image = roomsight_vision::image::Image::decode(&room(0, 0), &Default::default()).unwrap();
    OTHER_MODEL.recognize(&image, &mut Default::default()).probability()
}

/// A model file with a NaN in one of its arrays, for each array of floats.
fn not_a_number(model: &[u8]) -> Vec<(&'static str, Vec<u8>)> {
    let arrays = SafeTensors::deserialize(model).unwrap();
    let floats = [
        "bag/vocabulary.centers",
        "bag/svm.weights",
        "bag/svm.rho",
        "bag/calibration.slopes",
        "bag/calibration.offsets",
        "bag/kept.units",
        "transitions.dwells",
        "transitions.next",
    ];
    let with_nan = |array| {
        let data = arrays.tensor(array).unwrap().data();
        let at = data.as_ptr() as usize - model.as_ptr() as usize;
        let mut damaged = model.to_vec();
        damaged[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
        (array, damaged)
    };
    floats.map(with_nan).to_vec()
}

impl Server {
    async fn version(&self, version: u64) -> Value {
        success(self.get(&format!("/v1/models/lab/versions/{version}")).send().await.unwrap()).await
    }

    async fn lab(&self) -> Value {
        success(self.get("/v1/models/lab").send().await.unwrap()).await
    }

    pub fn put(&self, path: &str, body: impl Into<reqwest::Body>) -> reqwest::RequestBuilder {
        client().put(format!("{}{path}", self.url)).body(body)
    }

    pub fn delete(&self, path: &str) -> reqwest::RequestBuilder {
        client().delete(format!("{}{path}", self.url))
    }

    pub async fn activate(&self, version: u64) -> reqwest::Response {
        self.post(&format!("/v1/models/lab/versions/{version}/activate"), vec![]).send().await.unwrap()
    }

    /// The answer to a frame of stripes: version and room.
    async fn answer(&self, query: &str) -> (u64, String) {
        let path = format!("/v1/recognize{query}");
        let answer = success(self.post(&path, room(0, 0)).send().await.unwrap()).await;
        (answer["model"]["version"].as_u64().unwrap(), answer["room"].as_str().unwrap().to_owned())
    }
}

/// Asks again until the answer is as it must become.
pub async fn until(mut is_so: impl AsyncFnMut() -> bool) {
    let asking = async {
        while !is_so().await {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    tokio::time::timeout(SOON, asking).await.expect("it becomes so soon");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_version_is_uploaded_activated_rolled_back_and_deleted() {
    let folder = models();
    let server = Server::of(manual(&folder)).await;
    problem(server.post("/v1/recognize", frame()).send().await.unwrap(), 503, "no-model").await;
    problem(server.get("/readyz").send().await.unwrap(), 503, "no-model").await;
    success(server.activate(1).await).await;
    success(server.get("/readyz").send().await.unwrap()).await;

    let uploaded =
        server.put("/v1/models/lab/versions/2", other_packed(&[golden("x")])).send().await.unwrap();
    assert_eq!(uploaded.status(), 201);
    assert_eq!(server.answer("").await, (1, "stripes".into()), "nobody has activated it");
    let again = server.put("/v1/models/lab/versions/2", other_packed(&[])).send().await.unwrap();
    problem(again, 409, "conflict").await;

    let activated = server.activate(2).await;
    assert_eq!(activated.headers()["etag"], "\"2\"");
    assert_eq!(success(activated).await["labels"], json!(["stable"]));
    assert_eq!(server.answer("").await, (2, "x".into()));
    assert_eq!(server.answer("?version=1").await, (1, "stripes".into()), "it is kept for a rollback");
    assert_eq!(server.answer("?label=previous").await.0, 1);
    for path in
        ["/v1/recognize?version=01", "/v1/recognize?version=%2B1", "/v1/models/lab/versions/01/activate"]
    {
        let told = problem(server.post(path, room(0, 0)).send().await.unwrap(), 400, "bad-request").await;
        assert!(told["detail"].as_str().unwrap().contains("such as 7"), "{told}");
    }
    let of_v2 = server.get("/v2/models/lab/versions/01/ready").send().await.unwrap();
    assert_eq!(of_v2.status(), 400);
    problem(server.delete("/v1/models/lab/versions/2").send().await.unwrap(), 409, "conflict").await;

    let stale = server.post("/v1/models/lab/rollback", vec![]).header("if-match", "\"1\"");
    problem(stale.send().await.unwrap(), 412, "stale-epoch").await;
    let wrong = server.post("/v1/models/lab/rollback", vec![]).header("if-match", "yesterday");
    problem(wrong.send().await.unwrap(), 400, "bad-request").await;
    let fresh = server.post("/v1/models/lab/rollback", vec![]).header("if-match", "\"2\"");
    assert_eq!(success(fresh.send().await.unwrap()).await["serving"], 1);
    assert_eq!(server.answer("").await, (1, "stripes".into()));

    assert_eq!(server.delete("/v1/models/lab/versions/2").send().await.unwrap().status(), 204);
    problem(server.get("/v1/models/lab/versions/2").send().await.unwrap(), 404, "no-such-model").await;
    assert!(!folder.path().join("lab/2").exists());
    let nowhere = server.post("/v1/models/lab/rollback", vec![]).send().await.unwrap();
    problem(nowhere, 409, "conflict").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_new_version_in_the_folder_serves_and_what_is_half_written_does_not() {
    let folder = models();
    let server = Server::of(settings(&folder)).await;
    let path = folder.path().join("lab/2");
    write_damaged_model(&path);
    until(async || server.lab().await["versions"][0]["state"] == "failed").await;
    assert_eq!(server.answer("").await.0, 1);
    // The rest of it comes.
    let whole = TempDir::new().unwrap();
    write_other_model(&whole.path().join("2"));
    for file in ["model.json", "model.safetensors"] {
        fs::copy(whole.path().join("2").join(file), path.join(file)).unwrap();
    }
    until(async || server.answer("").await == (2, "x".into())).await;
    let states = server.version(2).await["history"].to_string();
    for state in ["discovered", "verifying", "loading", "warming", "ready", "failed"] {
        assert!(states.contains(state), "{states}");
    }
    // A lower number is not newer.
    write_model(&folder.path().join("lab/0"));
    until(async || server.lab().await["versions"].as_array().unwrap().len() == 3).await;
    assert_eq!(server.answer("").await.0, 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_does_not_work_is_refused_with_its_reason_and_the_old_version_serves_on() {
    let folder = models();
    let server = Server::of(settings(&folder)).await;
    let good = other_packed(&[]);
    let model = OTHER_MODEL.to_bytes().unwrap();
    let text = |old: &str, new: &str| {
        let at = model.windows(old.len()).position(|window| window == old.as_bytes()).unwrap();
        [&model[..at], new.as_bytes(), &model[at + old.len()..]].concat()
    };
    let header_of = |n_bytes: u64| [&n_bytes.to_le_bytes()[..], &model[8..]].concat();
    let tried = [
        ("nothing", vec![], "empty"),
        ("text", b"not a model".to_vec(), "not a roomsight model"),
        ("half a tar", good[..good.len() / 2].to_vec(), "damaged"),
        ("half a file", model[..model.len() / 2].to_vec(), "damaged"),
        ("a header of all memory", header_of(u64::MAX), "header"),
        ("a header beyond the file", header_of(1 << 30), "header"),
        ("other frames", other_packed(&[golden("y")]), "golden frame"),
        ("other rooms", other_packed(&[golden("stripes")]), "golden frame"),
        ("a newer format", text("\\\"format_version\\\":2", "\\\"format_version\\\":4"), "format version 4"),
        ("an older format", text("\\\"format_version\\\":2", "\\\"format_version\\\":0"), "format version 0"),
    ];
    let with_nan = |(array, body)| (array, body, "the model is damaged");
    for (what, body, reason) in tried.into_iter().chain(not_a_number(&model).into_iter().map(with_nan)) {
        let refused = server.put("/v1/models/lab/versions/2", body).send().await.unwrap();
        let status = refused.status().as_u16();
        let detail = refused.json::<Value>().await.unwrap()["detail"].to_string();
        assert!(status == 422 || (status == 400 && reason == "empty"), "{what}: {status} {detail}");
        assert!(detail.contains(reason), "{what}: {detail}");
        assert!(!detail.contains(folder.path().to_str().unwrap()), "{what}: {detail}");
    }
    for path in ["..%2fetc/versions/2", "two%20words/versions/2", ".hidden/versions/2"] {
        let refused = server.put(&format!("/v1/models/{path}"), good.clone()).send().await.unwrap();
        problem(refused, 400, "bad-request").await;
    }
    assert_eq!(server.answer("").await, (1, "stripes".into()));
    assert_eq!(server.lab().await["versions"].as_array().unwrap().len(), 1, "nothing of them is left");
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    let kept = ["lab", ".lock", "default.json", ".default.lock"];
    assert!(left.iter().all(|name| kept.iter().any(|kept| name == kept)), "{left:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_has_a_limit_however_it_comes() {
    let folder = models();
    let server = Server::of(Settings { max_model_bytes: 1000, ..settings(&folder) }).await;
    let whole = server.put("/v1/models/lab/versions/2", vec![1; 1001]).send().await.unwrap();
    problem(whole, 413, "too-large").await;
    let piece = || Ok::<_, std::io::Error>(Frame::data(Bytes::from(vec![1; 100])));
    let pieces = StreamBody::new(futures_util::stream::repeat_with(piece).take(20));
    let in_pieces = server.put("/v1/models/lab/versions/2", reqwest::Body::wrap(pieces));
    problem(in_pieces.send().await.unwrap(), 413, "too-large").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_serves_survives_a_restart_and_a_newer_version_is_still_newer() {
    let folder = models();
    write_other_model(&folder.path().join("lab/2"));
    let mut server = Server::of(settings(&folder)).await;
    assert_eq!(server.answer("").await.0, 2);
    success(server.activate(1).await).await;
    server.stop();
    server.stopped().await;
    let mut server = Server::of(settings(&folder)).await;
    assert_eq!(server.answer("").await.0, 1, "version 2 was left, and stays so");
    until(async || server.version(2).await["labels"] == json!(["previous"])).await;
    server.stop();
    server.stopped().await;
    write_model(&folder.path().join("lab/3"));
    let server = Server::of(settings(&folder)).await;
    assert_eq!(server.answer("").await.0, 3);
}

#[tokio::test(flavor = "multi_thread")]
async fn where_the_stable_version_broke_the_one_before_serves_until_it_is_whole_again() {
    let folder = models();
    write_other_model(&folder.path().join("lab/2"));
    let mut server = Server::of(manual(&folder)).await;
    success(server.activate(1).await).await;
    success(server.activate(2).await).await;
    server.stop();
    server.stopped().await;
    let file = folder.path().join("lab/2/model.safetensors");
    let whole = fs::read(&file).unwrap();
    fs::write(&file, &whole[..whole.len() / 2]).unwrap();
    let server = Server::of(manual(&folder)).await;
    assert_eq!(server.answer("").await, (1, "stripes".into()));
    assert_eq!(server.version(2).await["state"], "failed");
    fs::write(&file, whole).unwrap();
    until(async || server.answer("").await == (2, "x".into())).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_canary_answers_its_share_of_the_robots_and_each_stays_with_its_version() {
    let folder = models();
    write_other_model(&folder.path().join("lab/2"));
    let server = Server::of(manual(&folder)).await;
    success(server.activate(1).await).await;
    let label = |label: &str, body: Value| {
        server
            .put(&format!("/v1/models/lab/labels/{label}"), body.to_string())
            .header("content-type", "application/json")
    };
    for (name, body) in [
        ("canary", json!({"version": 2})),
        ("canary", json!({"version": 2, "share": 0.5, "room": 1})),
        ("shadow", json!({"version": 2, "share": 0.5})),
        ("best", json!({"version": 2})),
    ] {
        problem(label(name, body).send().await.unwrap(), 400, "bad-request").await;
    }
    problem(label("canary", json!({"version": 2, "share": 1.5})).send().await.unwrap(), 409, "conflict")
        .await;
    problem(label("canary", json!({"version": 7, "share": 0.5})).send().await.unwrap(), 404, "no-such-model")
        .await;
    success(label("canary", json!({"version": 2, "share": 0.5})).send().await.unwrap()).await;
    assert_eq!(server.version(2).await["share"], 0.5);

    let mut by_version = [0, 0];
    for robot in 0..40 {
        let query = format!("?robot=r{robot}");
        let first = server.answer(&query).await;
        assert_eq!(server.answer(&query).await, first, "a robot stays");
        by_version[first.0 as usize - 1] += 1;
    }
    assert!(by_version.iter().all(|&n| n >= 10), "{by_version:?}");
    assert_eq!(server.answer("").await.0, 1, "who has no name gets the stable version");
    for _ in 0..16 {
        let mut robot = Robot::connect(&server, "").await;
        assert_eq!(robot.hello.model.version, 1);
        robot.send(frame()).await;
        let told = robot.next().await;
        assert!(matches!(&told, ServerMessage::Result(told) if told.answer.model.version == 1), "{told:?}");
    }
    assert_eq!(server.answer("?label=canary").await.0, 2);
    success(server.delete("/v1/models/lab/labels/canary").send().await.unwrap()).await;
    for robot in 0..10 {
        assert_eq!(server.answer(&format!("?robot=r{robot}")).await.0, 1);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_shadow_answers_nobody_and_tells_how_far_it_agrees() {
    let folder = models();
    write_other_model(&folder.path().join("lab/2"));
    let server = Server::of(manual(&folder)).await;
    success(server.activate(1).await).await;
    let body = json!({"version": 2}).to_string();
    let labeled = server.put("/v1/models/lab/labels/shadow", body).header("content-type", "application/json");
    success(labeled.send().await.unwrap()).await;
    for _ in 0..5 {
        assert_eq!(server.answer("").await.0, 1);
    }
    until(async || {
        let shadow = server.version(2).await["shadow"].clone();
        shadow["compared"].as_u64().unwrap() + shadow["skipped"].as_u64().unwrap() == 5
    })
    .await;
    let shadow = server.version(2).await["shadow"].clone();
    // The two call all rooms by other names.
    assert_eq!(shadow["agreed"], 0, "{shadow}");
    assert!((shadow["mean_distance"].as_f64().unwrap() - 1.0).abs() < 1e-6, "{shadow}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_version_that_was_left_is_out_of_memory_though_a_stream_rests() {
    let folder = models();
    write_other_model(&folder.path().join("lab/2"));
    write_model(&folder.path().join("lab/3"));
    let server = Server::of(manual(&folder)).await;
    success(server.activate(1).await).await;
    let mut robot = Robot::connect(&server, "?mode=lossless").await;
    robot.send(frame()).await;
    robot.next().await;
    success(server.activate(2).await).await;
    success(server.activate(3).await).await;
    until(async || server.version(1).await["state"] == "unloaded").await;
    robot.send(frame()).await;
    let ServerMessage::ModelChanged(changed) = robot.next().await else { panic!() };
    assert_eq!((changed.from.version, changed.to.version, changed.filter), (1, 3, FilterChange::Kept));
    robot.next().await;
    success(server.activate(2).await).await;
    robot.send(frame()).await;
    let ServerMessage::ModelChanged(changed) = robot.next().await else { panic!() };
    assert_eq!((changed.to.version, changed.filter), (2, FilterChange::Reset), "it has other rooms");
}

#[tokio::test(flavor = "multi_thread")]
async fn concurrent_changes_leave_one_version_and_lose_no_frame() {
    let folder = models();
    for version in 2..=4 {
        write_model(&folder.path().join(format!("lab/{version}")));
    }
    let server = Server::of(manual(&folder)).await;
    success(server.activate(1).await).await;
    let changing = async {
        for round in 0..20_u64 {
            let changes = (1..=4).map(|idx| server.activate((round + idx) % 4 + 1));
            for answer in futures_util::future::join_all(changes).await {
                assert!([200, 409].contains(&answer.status().as_u16()), "{answer:?}");
            }
        }
    };
    let asking = async {
        for _ in 0..60 {
            let answer = success(server.post("/v1/recognize", room(0, 0)).send().await.unwrap()).await;
            assert_eq!(answer["room"], "stripes");
        }
    };
    tokio::join!(changing, asking);
    let lab = server.lab().await;
    let labels: Vec<&Value> =
        lab["versions"].as_array().unwrap().iter().map(|version| &version["labels"]).collect();
    assert_eq!(labels.iter().filter(|labels| labels.to_string().contains("stable")).count(), 1, "{labels:?}");
    let stable = lab["serving"].as_u64().unwrap();
    assert_eq!(server.answer("").await.0, stable);
}

#[tokio::test(flavor = "multi_thread")]
async fn of_many_changes_with_the_same_epoch_one_is_made() {
    let folder = models();
    write_model(&folder.path().join("lab/2"));
    write_other_model(&folder.path().join("lab/3"));
    let server = Server::of(manual(&folder)).await;
    success(server.activate(1).await).await;
    for epoch in 1..=10 {
        let stable = server.lab().await["serving"].as_u64().unwrap();
        let others = (1..=3).filter(|&version| version != stable).cycle().take(12);
        let changes = others.map(|version| {
            let path = format!("/v1/models/lab/versions/{version}/activate");
            server.post(&path, vec![]).header("if-match", format!("\"{epoch}\"")).send()
        });
        let answers = futures_util::future::join_all(changes).await;
        let statuses: Vec<u16> =
            answers.into_iter().map(|answer| answer.unwrap().status().as_u16()).collect();
        assert_eq!(statuses.iter().filter(|&&status| status == 200).count(), 1, "{statuses:?}");
        assert_eq!(statuses.iter().filter(|&&status| status == 412).count(), 11, "{statuses:?}");
        assert_eq!(server.lab().await["epoch"], epoch + 1);
    }
}

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread")]
async fn a_stop_does_not_wait_for_a_model_that_is_being_loaded() {
    let folder = models();
    let poll = "models_poll_ms=20";
    let mut running = Running::start(&["--models", folder.path().to_str().unwrap(), "--set", poll]);
    let version = folder.path().join("lab/2");
    fs::create_dir(&version).unwrap();
    // Whoever opens it waits for somebody to write.
    let made = std::process::Command::new("mkfifo").arg(version.join("model.json")).status().unwrap();
    assert!(made.success());
    fs::write(version.join("model.safetensors"), "never read").unwrap();
    let url = format!("{}/v1/models/lab", running.url);
    let lab = async || client().get(&url).send().await.unwrap().json::<Value>().await.unwrap();
    until(async || lab().await["versions"][0]["state"] == "verifying").await;
    let stopped = tokio::task::spawn_blocking(move || running.stop());
    tokio::time::timeout(SOON, stopped).await.expect("it stops soon").unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn what_others_decide_in_the_repository_is_followed() {
    let folder = models();
    write_other_model(&folder.path().join("lab/2"));
    let (one, other) = (Server::of(manual(&folder)).await, Server::of(manual(&folder)).await);
    success(one.activate(1).await).await;
    until(async || other.get("/readyz").send().await.unwrap().status() == 200).await;
    assert_eq!(other.answer("").await.0, 1);
    success(other.activate(2).await).await;
    until(async || one.answer("").await.0 == 2).await;
    assert_eq!(one.lab().await["epoch"], other.lab().await["epoch"]);
    // Both load the version that a rollback leads to.
    until(async || one.version(1).await["labels"] == json!(["previous"])).await;
}
