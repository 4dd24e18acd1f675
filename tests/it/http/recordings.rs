//! Robots that are recorded on request.

use crate::http::robot::{Robot, result};
use crate::http::service::{FORM, Server, form, pgm, problem, room, success};
use roomsight::settings::Settings;
use roomsight_protocol::recording::{RecordingInfo, RecordingList};
use roomsight_recording::message::Picture;
use roomsight_recording::{Kind, Recording};
use serde_json::Value;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

fn settings(folder: &Path, max_bytes: u64) -> Settings {
    Settings { record_folder: folder.to_owned(), record_max_bytes: max_bytes, ..Settings::default() }
}

async fn begin(server: &Server, robot: &str, body: &str) -> reqwest::Response {
    let path = format!("/v1/robots/{robot}/recording");
    server.post_as(&path, "application/json", body.into()).send().await.unwrap()
}

async fn delete(server: &Server, path: &str) -> reqwest::Response {
    crate::http::service::client().delete(format!("{}{path}", server.url)).send().await.unwrap()
}

async fn list(server: &Server) -> RecordingList {
    let list = success(server.get("/v1/recordings").send().await.unwrap()).await;
    serde_json::from_value(list).unwrap()
}

fn info(value: Value) -> RecordingInfo {
    serde_json::from_value(value).unwrap()
}

/// The pictures and the answers of a recording.
fn read(path: &Path) -> (Vec<Vec<u8>>, Vec<Value>) {
    let recording = Recording::open(path).unwrap();
    assert_eq!(recording.problems().len(), 0, "{:?}", recording.problems());
    let topics: Vec<usize> = (0..recording.topics().len()).collect();
    let (mut pictures, mut answers) = (Vec::new(), Vec::new());
    for message in recording.messages(&topics).unwrap().0 {
        let (topic, bytes) = (&recording.topics()[message.topic_idx], recording.read(&message).unwrap());
        if topic.kind() == Kind::FoxgloveCompressedImage {
            pictures.push(Picture::read(topic, &bytes).unwrap().encoded);
        } else {
            answers.push(serde_json::from_slice(&bytes).unwrap());
        }
    }
    (pictures, answers)
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_robot_sends_and_is_told_from_then_on_lies_in_the_file() {
    let folder = TempDir::new().unwrap();
    let server = Server::start(settings(folder.path(), 1 << 30)).await;
    let mut robot = Robot::connect(&server, "?mode=lossless&robot=wall-e").await;
    let mut other = Robot::connect(&server, "?mode=lossless&robot=eve").await;
    robot.send(room(2, 0)).await;
    result(robot.next().await);
    let began = begin(&server, "wall-e", r#"{"seconds": 600}"#).await;
    assert_eq!(began.status(), 201);
    let began = info(began.json().await.unwrap());
    assert_eq!((began.robot.as_str(), began.pictures), ("wall-e", 0));
    for shift in 0..4 {
        robot.send(room(1, shift)).await;
        result(robot.next().await);
        other.send(room(0, shift)).await;
        result(other.next().await);
    }
    problem(begin(&server, "wall-e", "").await, 409, "conflict").await;
    assert_eq!(list(&server).await.running[0].file, began.file);
    problem(server.get(&format!("/v1/recordings/{}", began.file)).send().await.unwrap(), 404, "not-found")
        .await;
    let ended = info(success(delete(&server, "/v1/robots/wall-e/recording").await).await);
    assert_eq!((ended.pictures, ended.answers, ended.lost), (4, 4, 0));
    problem(delete(&server, "/v1/robots/wall-e/recording").await, 404, "not-found").await;
    // Downloaded, it is the file.
    let response = server.get(&format!("/v1/recordings/{}", began.file)).send().await.unwrap();
    let bytes = response.bytes().await.unwrap();
    let path = folder.path().join(&began.file);
    assert_eq!(bytes, std::fs::read(&path).unwrap());
    let (pictures, answers) = read(&path);
    assert_eq!(pictures.len(), 4);
    // A PGM is shown as a JPEG.
    assert!(pictures.iter().all(|picture| picture.starts_with(b"\xff\xd8\xff")));
    assert!(answers.iter().all(|answer| answer["room"] == "bars" && answer["filtered_room"].is_string()));
    let files = list(&server).await.files;
    assert_eq!((files.len(), files[0].bytes), (1, bytes.len() as u64));
    assert_eq!(delete(&server, &format!("/v1/recordings/{}", began.file)).await.status(), 204);
    assert!(list(&server).await.files.is_empty() && !path.exists());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recording_ends_when_its_time_is_up_and_with_the_service() {
    let folder = TempDir::new().unwrap();
    let mut server = Server::start(settings(folder.path(), 1 << 20)).await;
    let recognize = async |robot: &str, frame: Vec<u8>| {
        success(server.post(&format!("/v1/recognize?robot={robot}"), frame).send().await.unwrap()).await;
    };
    recognize("brief", room(0, 0)).await;
    assert_eq!(begin(&server, "brief", r#"{"seconds": 1}"#).await.status(), 201);
    recognize("brief", room(0, 0)).await;
    let is_over = async || list(&server).await.running.is_empty();
    tokio::time::timeout(Duration::from_secs(30), async {
        while !is_over().await {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    })
    .await
    .expect("its time is up");
    let files = list(&server).await.files;
    assert_eq!(read(&folder.path().join(&files[0].file)).0.len(), 1);
    // One that the service ends is whole too.
    assert_eq!(begin(&server, "brief", "").await.status(), 201);
    recognize("brief", room(1, 0)).await;
    let file = list(&server).await.running[0].file.clone();
    server.stop();
    server.stopped().await;
    assert_eq!(read(&folder.path().join(&file)).0.len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn of_a_batch_every_picture_lies_beside_its_answer() {
    let folder = TempDir::new().unwrap();
    let server = Server::start(settings(folder.path(), 1 << 20)).await;
    success(server.post("/v1/recognize?robot=r", room(0, 0)).send().await.unwrap()).await;
    assert_eq!(begin(&server, "r", "").await.status(), 201);
    let batch = form(&[&room(0, 0), &room(1, 0)]);
    success(server.post_as("/v1/recognize/batch?robot=r", FORM, batch).send().await.unwrap()).await;
    let ended = info(success(delete(&server, "/v1/robots/r/recording").await).await);
    assert_eq!((ended.pictures, ended.answers), (2, 2));
}

#[tokio::test(flavor = "multi_thread")]
async fn no_more_is_recorded_than_the_operator_allows() {
    let (folder, noise) =
        (TempDir::new().unwrap(), |x: u32, y: u32| (x * 7919 + y * 104_729 + x * y * 31) as u8);
    let server = Server::start(settings(folder.path(), 20_000)).await;
    let frame = pgm(640, 480, noise);
    let recognize = async || {
        success(server.post("/v1/recognize?robot=r", frame.clone()).send().await.unwrap()).await;
    };
    recognize().await;
    assert_eq!(begin(&server, "r", "").await.status(), 201);
    tokio::time::timeout(Duration::from_secs(60), async {
        while !list(&server).await.running.is_empty() {
            recognize().await;
        }
    })
    .await
    .expect("its room is used up");
    let refused = problem(begin(&server, "r", "").await, 507, "disk-full").await;
    assert!(refused["detail"].as_str().unwrap().contains("record_max_bytes"), "{refused}");
}

#[tokio::test]
async fn nothing_is_recorded_unless_the_operator_gave_a_folder_and_no_name_leads_elsewhere() {
    let off = Server::start(Settings::default()).await;
    success(off.post("/v1/recognize?robot=r", room(0, 0)).send().await.unwrap()).await;
    let told = problem(begin(&off, "r", "").await, 503, "no-data-directory").await;
    assert!(told["detail"].as_str().unwrap().contains("record_folder"), "{told}");
    problem(off.get("/v1/recordings").send().await.unwrap(), 503, "no-data-directory").await;
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("secret.txt"), "x").unwrap();
    let inner = folder.path().join("recordings");
    let server = Server::start(settings(&inner, 1 << 30)).await;
    for name in ["..%2Fsecret.txt", "%2Fetc%2Fpasswd", "secret.txt", "..%2Fsecret.mcap"] {
        let path = format!("/v1/recordings/{name}");
        problem(server.get(&path).send().await.unwrap(), 404, "not-found").await;
        problem(delete(&server, &path).await, 404, "not-found").await;
    }
    problem(begin(&server, "nobody", "").await, 404, "not-found").await;
    success(server.post("/v1/recognize?robot=r", room(0, 0)).send().await.unwrap()).await;
    problem(begin(&server, "r", r#"{"seconds": 0}"#).await, 400, "bad-request").await;
    problem(begin(&server, "r", r#"{"minutes": 1}"#).await, 400, "bad-request").await;
}
