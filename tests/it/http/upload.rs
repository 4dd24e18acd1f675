//! Versions that are uploaded: what is looked at before their bodies, and how long these may take.

use crate::http::models::{manual, other_packed, packed, until};
use crate::http::service::{CONTINUE, OTHER_MODEL, SOON, Server, models, problem, read_exactly, read_raw};
use flate2::Compression;
use flate2::write::GzEncoder;
use rawzip::ZipArchiveWriter;
use roomsight::settings::Settings;
use roomsight_recognition::model::{CarriedNetwork, Digest, Model, NETWORKS_FOLDER, Networks};
use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::task::spawn_blocking;

/// The head of an upload whose body does not come before it is asked for.
fn head(path: &str, more: &str) -> String {
    format!(
        "PUT {path} HTTP/1.1\r\nhost: localhost\r\ncontent-length: 1000000\r\nexpect: 100-continue\r\n{more}\r\n"
    )
}

fn gzipped(body: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(body).unwrap();
    encoder.finish().unwrap()
}

/// A folder `home` in a zip, as desktops make it.
fn zipped(folder: &Path) -> Vec<u8> {
    let mut body = Vec::new();
    let mut archive = ZipArchiveWriter::new(&mut body);
    archive.new_dir("home/").create().unwrap();
    for name in ["model.json", "model.safetensors"] {
        let (mut entry, config) = archive.new_file(format!("home/{name}")).start().unwrap();
        let mut writer = config.wrap(&mut entry);
        writer.write_all(&fs::read(folder.join(name)).unwrap()).unwrap();
        let (_, descriptor) = writer.finish().unwrap();
        entry.finish(descriptor).unwrap();
    }
    archive.finish().unwrap();
    body
}

#[tokio::test(flavor = "multi_thread")]
async fn archives_are_taken_as_people_make_and_call_them() {
    let folder = models();
    let server = Server::of(manual(&folder)).await;
    let (tar, zip) = (other_packed(&[]), zipped(&folder.path().join("lab/1")));
    let tar_gz = gzipped(&tar);
    for (version, (media_type, body)) in [
        ("application/gzip", &tar_gz),
        ("application/x-tar", &tar_gz),
        ("application/zip", &zip),
        ("application/x-www-form-urlencoded", &zip),
        ("APPLICATION/X-TAR; charset=binary", &tar),
    ]
    .into_iter()
    .enumerate()
    {
        let put = server.put(&format!("/v1/models/lab/versions/{}", version + 2), body.clone());
        let answer = put.header("content-type", media_type).send().await.unwrap();
        assert_eq!(answer.status(), 201, "{media_type}: {}", answer.text().await.unwrap());
    }
    let seven =
        server.put("/v1/models/lab/versions/9", &b"7z\xbc\xaf\x27\x1c and more"[..]).send().await.unwrap();
    let told = problem(seven, 422, "not-a-model").await;
    assert!(told["detail"].as_str().unwrap().contains("tar.gz"), "{told}");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_a_version_is_refused_before_its_body_comes() {
    let server = Server::start(Settings::default()).await;
    let two = "/v1/models/lab/versions/2";
    for (path, more, status, reason) in [
        ("/v1/models/..%2fetc/versions/2", "", 400, "letters"),
        ("/v1/models/.hidden/versions/2", "", 400, "letters"),
        ("/v1/models/lab/versions/007", "", 400, "such as 7"),
        ("/v1/models/lab/versions/+7", "", 400, "such as 7"),
        ("/v1/models/lab/versions/-7", "", 400, "such as 7"),
        ("/v1/models/lab/versions/18446744073709551615", "", 400, "18446744073709551614"),
        ("/v1/models/lab/versions/1", "", 409, "never changes"),
        (two, "content-type: image/jpeg\r\n", 415, "application/x-tar"),
        (two, "content-type: application/json\r\n", 415, "application/zip"),
        (two, "content-encoding: gzip\r\n", 415, "tar.gz needs no encoding"),
    ] {
        let answer = read_raw(server.send_raw(head(path, more).as_bytes())).await;
        assert!(answer.starts_with(&format!("HTTP/1.1 {status} ")), "{path} {more}: {answer}");
        assert!(answer.contains(reason), "{path} {more}: {answer}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_that_comes_a_byte_at_a_time_is_cut_off() {
    let folder = models();
    let server = Server::of(Settings { body_timeout_ms: 300, ..manual(&folder) }).await;
    let mut stream = server.send_raw(head("/v1/models/lab/versions/2", "").as_bytes());
    read_exactly(&mut stream, CONTINUE);
    let answer = spawn_blocking(move || {
        stream.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
        let (began, mut answer) = (Instant::now(), [0; 512]);
        while began.elapsed() < SOON {
            let _ = stream.write_all(&[7]);
            match stream.read(&mut answer) {
                Ok(n_bytes) => return String::from_utf8_lossy(&answer[..n_bytes]).into_owned(),
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(error) => return error.to_string(),
            }
        }
        "it is still open".to_owned()
    });
    let answer = answer.await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 408 "), "{answer}");
    until(async || staged(&folder) == 0).await;
}

/// The folders of uploads under way.
fn staged(folder: &TempDir) -> usize {
    let names = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name());
    names.filter(|name| name.to_string_lossy().starts_with(".staged-")).count()
}

#[tokio::test(flavor = "multi_thread")]
async fn no_more_uploads_are_taken_at_one_time_than_are_set() {
    let folder = models();
    let server = Server::of(Settings { max_uploads: 1, ..manual(&folder) }).await;
    let mut first = server.send_raw(head("/v1/models/lab/versions/2", "").as_bytes());
    read_exactly(&mut first, CONTINUE);
    let put = async || server.put("/v1/models/lab/versions/3", other_packed(&[])).send().await.unwrap();
    let refused = put().await;
    assert!(refused.headers()["retry-after"].to_str().unwrap().parse::<u64>().is_ok());
    problem(refused, 429, "queue-full").await;
    drop(first);
    until(async || put().await.status() == 201).await;
}

const ONNX: &[u8] = b"passes for a network";

/// The folder of a model that says that it uses a network.
fn with_network(room: &TempDir) -> PathBuf {
    let network = CarriedNetwork::new(ONNX.to_vec(), b"size = [224, 224]".to_vec());
    let networks = Networks::from([("lite0".to_owned(), Arc::new(network))]);
    let folder = room.path().join("1");
    OTHER_MODEL.clone().with_networks(networks).save(&folder, &[]).unwrap();
    folder
}

#[tokio::test(flavor = "multi_thread")]
async fn a_version_brings_its_network_or_uses_the_one_that_is_there() {
    let (models, room) = (models(), TempDir::new().unwrap());
    let server = Server::of(manual(&models)).await;
    let folder = with_network(&room);
    let onnx = format!("{NETWORKS_FOLDER}/{}.onnx", Digest::of(ONNX));
    let bare = fs::read(folder.join("model.safetensors")).unwrap();
    let put = async |version: u64, body: Vec<u8>| {
        server.put(&format!("/v1/models/lab/versions/{version}"), body).send().await.unwrap()
    };
    let refused = problem(put(2, bare.clone()).await, 422, "not-a-model").await;
    let told = refused["detail"].as_str().unwrap();
    assert!(told.contains("its network lite0") && told.contains("networks/"), "{told}");
    assert!(!told.contains(models.path().to_str().unwrap()), "{told}");

    let answer = put(2, packed(&folder)).await;
    assert_eq!(answer.status(), 201, "{}", answer.text().await.unwrap());
    let answer = put(3, bare).await;
    assert_eq!(answer.status(), 201, "{}", answer.text().await.unwrap());
    let [second, third] = [2, 3].map(|version| models.path().join(format!("lab/{version}")));
    #[cfg(unix)]
    for version in [&second, &third] {
        let n_links = std::os::unix::fs::MetadataExt::nlink(&fs::metadata(version.join(&onnx)).unwrap());
        assert_eq!(n_links, 2, "it is kept once");
    }
    for version in [2, 3] {
        assert_eq!(server.activate(version).await.status(), 200);
    }
    server.activate(1).await;
    let deleted = server.delete("/v1/models/lab/versions/2").send().await.unwrap();
    assert!(deleted.status().is_success(), "{}", deleted.text().await.unwrap());
    assert!(!second.exists());
    Model::load(&third).unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_network_that_is_not_the_models_is_refused_and_nothing_is_left() {
    let (models, room) = (models(), TempDir::new().unwrap());
    let server = Server::of(manual(&models)).await;
    let folder = with_network(&room);
    let network = folder.join(format!("{NETWORKS_FOLDER}/{}.onnx", Digest::of(ONNX)));
    let stray = folder.join(format!("{NETWORKS_FOLDER}/{}.onnx", Digest::of(b"another")));
    for (path, content, reason) in [
        (&network, b"PASSES for a network".as_slice(), "digest"),
        (&network, &ONNX[..9], "9 bytes"),
        (&stray, b"another", "names no such network"),
    ] {
        fs::write(path, content).unwrap();
        let put = server.put("/v1/models/lab/versions/2", packed(&folder)).send().await.unwrap();
        let refused = problem(put, 422, "not-a-model").await;
        assert!(refused["detail"].as_str().unwrap().contains(reason), "{reason}: {refused}");
        fs::write(&network, ONNX).unwrap();
    }
    assert!(!models.path().join("lab/2").exists());
    until(async || staged(&models) == 0).await;
}
