//! What an operator sees of a running service: its log, and what becomes of SIGHUP.

use crate::http::command::Running;
use crate::http::service::{SOON, client, frame, models, success, write_model_with_network};
use reqwest::StatusCode;
use roomsight::access::{Key, Role};
use roomsight_recognition::model::DEFAULT_NETWORK;
use serde_json::Value;
use std::fs;
use std::time::{Duration, Instant};

fn key(name: &str, byte: u8) -> (String, String) {
    let (secret, key) = Key::new(Role::Robot, name, &[byte; 32]).unwrap();
    (secret, key.to_line())
}

async fn status(running: &Running, secret: &str) -> StatusCode {
    let call = client().post(format!("{}/v1/recognize", running.url)).bearer_auth(secret).body(frame());
    call.header("content-type", "application/octet-stream").send().await.unwrap().status()
}

async fn until(running: &Running, secret: &str, expected: StatusCode) {
    let started = Instant::now();
    while status(running, secret).await != expected {
        assert!(started.elapsed() < SOON, "the key is still not answered with {expected}");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
}

#[tokio::test]
async fn sighup_reads_the_keys_again_and_says_what_takes_a_restart() {
    let (models, folder) = (models(), tempfile::tempdir().unwrap());
    let ((old, old_line), (new, new_line)) = (key("mo", 1), key("eve", 2));
    let path = folder.path().join("roomsight.toml");
    let set = |line: &str, more: &str| fs::write(&path, format!("keys = [\"{line}\"]\n{more}")).unwrap();
    set(&old_line, "");
    let arguments = ["--models", models.path().to_str().unwrap(), "--config", path.to_str().unwrap()];
    let mut running = Running::start(&arguments);
    assert_eq!(status(&running, &old).await, 200);
    set(&new_line, "queue = 99\n");
    running.signal("HUP");
    until(&running, &old, StatusCode::UNAUTHORIZED).await;
    assert_eq!(status(&running, &new).await, 200);
    fs::write(&path, "keys = [\"nonsense\"]").unwrap();
    running.signal("HUP");
    fs::write(&path, "").unwrap();
    running.signal("HUP");
    assert_eq!(status(&running, &new).await, 200);
    let log = running.stop();
    for words in ["the keys are reloaded", "takes a restart: queue", "nothing is reloaded"] {
        assert!(log.contains(words), "{log}");
    }
}

#[tokio::test]
async fn sighup_without_a_file_of_settings_changes_nothing() {
    let models = models();
    let mut running = Running::start(&["--models", models.path().to_str().unwrap()]);
    running.signal("HUP");
    assert_eq!(status(&running, "any").await, 200);
    let log = running.stop();
    assert!(log.contains("--config"), "{log}");
}

#[tokio::test]
async fn a_line_of_the_log_tells_who_called_and_cannot_be_forged() {
    let models = models();
    let (secret, line) = key("mo", 1);
    let keys = format!("keys={line}");
    let arguments = ["--models", models.path().to_str().unwrap(), "--set", &keys];
    let forged = r#"a}:key="boss",status=200"#;
    for format in ["human", "json"] {
        let mut running = Running::start(&[&arguments[..], &["--log-format", format]].concat());
        let call = client().post(format!("{}/v1/recognize?robot=a%20b", running.url)).bearer_auth(&secret);
        let call = call.header("x-request-id", forged).header("content-type", "image/jpeg").body(frame());
        assert_eq!(call.send().await.unwrap().status(), 200);
        for _ in 0..200 {
            assert_eq!(status(&running, "rs_wrong").await, 401);
        }
        let log = running.stop();
        let told = log.lines().find(|line| line.contains("boss")).expect("the call is logged");
        if format == "human" {
            assert!(told.contains(r#"request_id="a}:key=\"boss\",status=200""#), "{told}");
            assert!(told.contains(r#"robot="a b""#) && told.contains(r#"key="mo""#), "{told}");
            assert!(told.contains("peer=127.0.0.1:"), "{told}");
        } else {
            let told: Value = serde_json::from_str(told).unwrap();
            let span = &told["span"];
            assert_eq!((&span["request_id"], &span["key"]), (&forged.into(), &"mo".into()), "{told}");
            assert!(span["peer"].as_str().unwrap().starts_with("127.0.0.1:"), "{told}");
        }
        let n_lines = log.lines().filter(|line| line.contains("401")).count();
        assert!(n_lines < 100, "200 refusals take {n_lines} lines:\n{log}");
        assert!(!log.contains("/readyz"), "{log}");
    }
}

#[tokio::test]
async fn a_model_whose_onnx_runtime_is_installed_later_comes_to_serve_then_and_tells_its_networks() {
    let (models, folder) = (models(), tempfile::tempdir().unwrap());
    let what = "installing ONNX Runtime while the service runs";
    let Some(library) = write_model_with_network(&models.path().join("lab/2"), what) else { return };
    let named = folder.path().join("libonnxruntime.so");
    let arguments = ["--models", models.path().to_str().unwrap(), "--onnx-runtime", named.to_str().unwrap()];
    let running = Running::start(&[&arguments[..], &["--set", "models_poll_ms=50"]].concat());
    let version = async || {
        let url = format!("{}/v1/models/lab/versions/2", running.url);
        success(client().get(url).send().await.unwrap()).await
    };
    // It is tried again and again: while it is, no failure is told.
    let until = async |is_so: &dyn Fn(&Value) -> bool| {
        let started = Instant::now();
        loop {
            let version = version().await;
            if is_so(&version) {
                return;
            }
            assert!(started.elapsed() < SOON, "{version}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    let is_refused = |version: &Value| {
        let reason = version["failure"]["reason"].as_str().unwrap_or_default();
        reason.contains("there is no ONNX Runtime at ")
    };
    until(&is_refused).await;
    // Under its name at once, as an installer does it.
    fs::copy(library, folder.path().join("unfinished")).unwrap();
    fs::rename(folder.path().join("unfinished"), &named).unwrap();
    until(&|version| version["state"] == "ready").await;
    let network = &version().await["networks"][0];
    assert_eq!(network["name"], DEFAULT_NETWORK);
    let onnx = format!("networks/{}.onnx", network["blake3"].as_str().unwrap());
    let n_bytes = fs::metadata(models.path().join("lab/2").join(onnx)).unwrap().len();
    assert_eq!(network["bytes"], n_bytes);
}
