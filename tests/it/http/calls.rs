//! What the service answers, and what it says to bad requests.

use crate::http::service::{
    FORM, Server, client, form, frame, models, pgm, problem, read_exactly, read_raw, success,
    write_damaged_model,
};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use image::{GrayImage, ImageFormat, Luma};
use roomsight::access::{Key, Role};
use roomsight::http::{App, has_page};
use roomsight::settings::Settings;
use serde_json::{Value, json};
use std::io::{Cursor, Write};

fn encoded(image: &GrayImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn jpeg() -> Vec<u8> {
    encoded(
        &GrayImage::from_fn(160, 120, |x, y| Luma([(x / 10 * 89 + y / 10 * 151) as u8])),
        ImageFormat::Jpeg,
    )
}

/// A small PNG whose head claims to be this large.
fn png_claiming(width: u32, height: u32) -> Vec<u8> {
    let crc32 = |bytes: &[u8]| {
        !bytes.iter().fold(!0_u32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xEDB8_8320 * (crc & 1)))
        })
    };
    let mut bytes = encoded(&GrayImage::new(1, 1), ImageFormat::Png);
    bytes[16..20].copy_from_slice(&width.to_be_bytes());
    bytes[20..24].copy_from_slice(&height.to_be_bytes());
    let checksum = crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
    bytes
}

#[tokio::test]
async fn a_frame_gets_the_same_answer_as_itself_in_a_form_and_in_json() {
    let server = Server::start(Settings::default()).await;
    let raw = success(server.post("/v1/recognize", jpeg()).send().await.unwrap()).await;
    let in_form = server.post_as("/v1/recognize", FORM, form(&[&jpeg()]));
    let text = json!({"frame": BASE64_STANDARD.encode(jpeg())}).to_string();
    let in_json = server.post_as("/v1/recognize", "application/json", text.into_bytes());
    for other in [in_form, in_json] {
        let other = success(other.send().await.unwrap()).await;
        for field in ["room", "known", "probability", "probabilities", "model", "keypoints"] {
            assert_eq!(other[field], raw[field], "{field}");
        }
    }
}

#[tokio::test]
async fn a_frame_is_read_whatever_its_sender_calls_it() {
    let server = Server::start(Settings::default()).await;
    let answer = success(server.post("/v1/recognize", jpeg()).send().await.unwrap()).await;
    let base64 = BASE64_STANDARD.encode(jpeg());
    let in_lines: Vec<&str> =
        base64.as_bytes().chunks(76).map(|line| std::str::from_utf8(line).unwrap()).collect();
    let json = |text: &str| json!({"frame": text}).to_string().into_bytes();
    let types = [
        "image/jpg",
        "image/pjpeg",
        "image/x-ms-bmp",
        "image/*",
        "binary/octet-stream",
        "application/x-www-form-urlencoded",
        "application/json",
    ];
    let mut bodies: Vec<(&str, Vec<u8>)> = types.into_iter().map(|name| (name, jpeg())).collect();
    for text in [
        in_lines.join("\r\n"),
        base64.trim_end_matches('=').replace('+', "-").replace('/', "_"),
        format!("data:image/jpeg;base64,{base64}"),
    ] {
        bodies.push(("application/json", json(&text)));
    }
    bodies.push(("application/x-www-form-urlencoded", json(&base64)));
    for (media_type, body) in bodies {
        println!("{media_type}, {} bytes", body.len());
        let other = success(server.post_as("/v1/recognize", media_type, body).send().await.unwrap()).await;
        assert_eq!(other["probabilities"], answer["probabilities"]);
    }
}

#[tokio::test]
async fn an_answer_carries_all_that_is_promised() {
    let server = Server::start(Settings::default()).await;
    let path = "/v1/recognize?robot=wall-e&captured_at=1700000000.25&explain=true&model=lab&version=1";
    let response = server.post(path, jpeg()).header("x-request-id", "mine-1").send().await.unwrap();
    let headers = response.headers().clone();
    let answer = success(response).await;
    let rooms = answer["probabilities"].as_array().unwrap();
    let probabilities: Vec<f64> = rooms.iter().map(|room| room["probability"].as_f64().unwrap()).collect();
    assert_eq!(answer["room"], rooms[0]["room"]);
    assert_eq!(answer["probability"], rooms[0]["probability"]);
    assert!(probabilities.is_sorted_by(|a, b| a >= b), "{probabilities:?}");
    assert!((probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-3, "{probabilities:?}");
    assert!(answer["evidence"][0]["weight"].is_f64(), "{answer}");
    assert!(answer["known"].is_boolean() && answer["keypoints"].is_u64() && answer["evidence"].is_array());
    let nearest = &answer["nearest"][0];
    assert!(nearest["nearness"].as_f64().unwrap() > 0.0 && nearest["frame"].is_string(), "{answer}");
    assert_eq!(nearest["room"], answer["room"], "{answer}");
    assert_eq!(answer["model"]["name"], "lab");
    assert_eq!(answer["model"]["version"], 1);
    assert_eq!(answer["model"]["epoch"], 1);
    assert_eq!(answer["robot"], "wall-e");
    assert_eq!(answer["captured_at"], "1700000000.25");
    assert_eq!(answer["request_id"], "mine-1");
    assert_eq!(headers["x-request-id"], "mine-1");
    for stage in ["queue", "decode", "features", "classify"] {
        assert!(answer["timings_ms"][stage].as_f64().unwrap() >= 0.0, "{stage}");
        assert!(headers["server-timing"].to_str().unwrap().contains(&format!("{stage};dur=")), "{stage}");
    }
}

#[tokio::test]
async fn top_cuts_the_list_of_rooms_only() {
    let server = Server::start(Settings::default()).await;
    let all = success(server.post("/v1/recognize", frame()).send().await.unwrap()).await;
    let one = success(server.post("/v1/recognize?top=1", frame()).send().await.unwrap()).await;
    assert!(all["probabilities"].as_array().unwrap().len() > 1);
    assert_eq!(one["probabilities"].as_array().unwrap().len(), 1);
    assert_eq!(one["probability"], all["probability"]);
    problem(server.post("/v1/recognize?top=0", frame()).send().await.unwrap(), 400, "bad-request").await;
}

#[tokio::test]
async fn a_batch_is_answered_in_order_with_errors_in_their_places() {
    let server = Server::start(Settings { max_batch_frames: 4, ..Settings::default() }).await;
    let body = form(&[&frame(), b"no image", &jpeg()]);
    let answer = success(server.post_as("/v1/recognize/batch", FORM, body).send().await.unwrap()).await;
    let results = answer["results"].as_array().unwrap();
    let alone = success(server.post("/v1/recognize", jpeg()).send().await.unwrap()).await;
    assert_eq!(results.len(), 3);
    assert!(results[0]["answer"]["room"].is_string(), "{answer}");
    assert_eq!(results[1]["error"]["type"], "/problems/not-an-image", "{answer}");
    assert_eq!(results[1]["error"]["request_id"], answer["request_id"]);
    assert_eq!(results[2]["answer"]["probabilities"], alone["probabilities"], "{answer}");

    let frame = frame();
    let too_many = form(&[&frame[..]; 5]);
    let response = server.post_as("/v1/recognize/batch", FORM, too_many).send().await.unwrap();
    problem(response, 413, "too-large").await;
    let none = server.post_as("/v1/recognize/batch", FORM, form(&[])).send().await.unwrap();
    problem(none, 400, "bad-request").await;
    let response = server.post("/v1/recognize/batch", frame).send().await.unwrap();
    problem(response, 415, "unsupported-type").await;
}

#[tokio::test]
async fn a_frame_that_lacks_rows_is_answered_and_told() {
    let server = Server::start(Settings::default()).await;
    let ask = async |frame: Vec<u8>| success(server.post("/v1/recognize", frame).send().await.unwrap()).await;
    assert_eq!(ask(jpeg()).await.get("damaged_rows"), None);
    let cut = ask(jpeg()[..jpeg().len() * 9 / 10].to_vec()).await;
    assert!(cut["damaged_rows"].as_u64().unwrap() > 0, "{cut}");
}

#[tokio::test]
async fn a_format_that_is_not_read_is_named() {
    let server = Server::start(Settings::default()).await;
    let photo = b"\0\0\0\x18ftypheic\0\0\0\0mif1heic".to_vec();
    let refusal =
        problem(server.post("/v1/recognize", photo).send().await.unwrap(), 422, "not-an-image").await;
    assert!(refusal["detail"].as_str().unwrap().contains("HEIC"), "{refusal}");
}

#[tokio::test]
async fn bad_bodies_get_an_error_that_says_why() {
    let server = Server::start(Settings::default()).await;
    let truncated = jpeg()[..jpeg().len() / 3].to_vec();
    let cases: [(&str, Vec<u8>, u16, &str); 16] = [
        ("image/jpeg", vec![], 400, "bad-request"),
        ("image/jpeg", b"I am text".to_vec(), 422, "not-an-image"),
        ("image/jpeg", truncated, 422, "not-an-image"),
        ("image/png", png_claiming(60_000, 60_000), 413, "too-large"),
        ("image/jpeg", vec![0xFF; 50 << 20], 413, "too-large"),
        ("text/plain", frame(), 415, "unsupported-type"),
        ("video/mp4", frame(), 415, "unsupported-type"),
        ("application/x-www-form-urlencoded", vec![b'x'; 2000], 400, "bad-request"),
        ("application/json", br#"["AAAA"]"#.to_vec(), 400, "bad-request"),
        ("application/json", b"null".to_vec(), 400, "bad-request"),
        ("application/json", b"{".to_vec(), 400, "bad-request"),
        ("application/json", br#"{"frame":"***"}"#.to_vec(), 400, "bad-request"),
        ("application/json", br#"{"frame":"","top":3}"#.to_vec(), 400, "bad-request"),
        ("multipart/form-data", form(&[&frame()]), 400, "bad-request"),
        (FORM, form(&[]), 400, "bad-request"),
        (FORM, form(&[&frame(), &frame()]), 400, "bad-request"),
    ];
    for (media_type, body, status, kind) in cases {
        println!("{media_type}, {} bytes", body.len());
        problem(server.post_as("/v1/recognize", media_type, body).send().await.unwrap(), status, kind).await;
    }
    let zipped = server.post("/v1/recognize", frame()).header("content-encoding", "gzip");
    problem(zipped.send().await.unwrap(), 415, "unsupported-type").await;
    success(server.post("/v1/recognize", frame()).send().await.unwrap()).await;
}

#[tokio::test]
async fn frames_with_nothing_in_them_are_answered() {
    let server = Server::start(Settings::default()).await;
    for image in [pgm(1, 1, |_, _| 255), pgm(640, 480, |_, _| 0), pgm(640, 1, |_, _| 128)] {
        let answer = success(server.post("/v1/recognize", image).send().await.unwrap()).await;
        let n_rooms = answer["probabilities"].as_array().unwrap().len();
        assert_eq!(answer["keypoints"], 0, "{answer}");
        assert_eq!(answer["known"], false, "{answer}");
        assert!(answer["probability"].as_f64().unwrap() >= 1.0 / n_rooms as f64 - 1e-6, "{answer}");
    }
}

#[tokio::test]
async fn a_body_without_a_length_is_cut_off_at_the_limit() {
    let server = Server::start(Settings { max_frame_bytes: 1000, ..Settings::default() }).await;
    let head = "POST /v1/recognize HTTP/1.1\r\nhost: localhost\r\ncontent-type: image/jpeg\r\ntransfer-encoding: chunked\r\n\r\n";
    let chunk = format!("400\r\n{}\r\n", "x".repeat(0x400));
    let response = read_raw(server.send_raw(format!("{head}{chunk}").as_bytes())).await;
    assert!(response.starts_with("HTTP/1.1 413 "), "{response}");
    assert!(response.contains("application/problem+json"), "{response}");
}

#[tokio::test]
async fn wrong_paths_methods_and_queries_are_problems_too() {
    let server = Server::start(Settings::default()).await;
    problem(server.get("/no/such/path").send().await.unwrap(), 404, "not-found").await;
    problem(server.get("/docs/nothing.js").send().await.unwrap(), 404, "not-found").await;
    problem(server.get("/problems/nothing").send().await.unwrap(), 404, "not-found").await;
    let response = server.get("/v1/recognize").send().await.unwrap();
    assert_eq!(response.headers()["allow"], "POST");
    problem(response, 405, "method-not-allowed").await;
    let response = server.get("/v1/stream").send().await.unwrap();
    assert_eq!(response.headers()["upgrade"], "websocket");
    assert_eq!(response.headers()["connection"], "Upgrade");
    assert_eq!(response.headers()["sec-websocket-version"], "13");
    problem(response, 426, "no-websocket").await;
    problem(server.get("/v1/models/none").send().await.unwrap(), 404, "no-such-model").await;
    problem(server.get("/v1/models/lab/versions/9").send().await.unwrap(), 404, "no-such-model").await;
    problem(server.get("/v1/models/lab/versions/x").send().await.unwrap(), 400, "bad-request").await;
    let long = format!("robot={}", "x".repeat(65));
    for (query, status, kind) in [
        ("model=none", 404, "no-such-model"),
        ("version=9", 404, "no-such-model"),
        ("label=canary", 409, "version-not-ready"),
        ("version=1&label=stable", 400, "bad-request"),
        ("modle=lab", 400, "bad-request"),
        ("top=many", 400, "bad-request"),
        ("robot=a%0Ab", 400, "bad-request"),
        ("robot=", 400, "bad-request"),
        ("robot=a%E2%80%AEb", 400, "bad-request"),
        ("captured_at=garbage", 400, "bad-request"),
        ("captured_at=2030-01-31T12:00:00+01:00", 400, "bad-request"),
        (&long, 400, "bad-request"),
        ("deadline_ms=0", 504, "deadline-passed"),
    ] {
        println!("{query}");
        let response = server.post(&format!("/v1/recognize?{query}"), frame()).send().await.unwrap();
        problem(response, status, kind).await;
    }
}

#[tokio::test]
async fn models_tell_what_they_are() {
    let server = Server::start(Settings::default()).await;
    let all = success(server.get("/v1/models").send().await.unwrap()).await;
    let one = success(server.get("/v1/models/lab").send().await.unwrap()).await;
    let version = success(server.get("/v1/models/lab/versions/1").send().await.unwrap()).await;
    let answer = success(server.post("/v1/recognize", frame()).send().await.unwrap()).await;
    assert_eq!(all["default"], "lab");
    assert_eq!(all["models"], json!([one]));
    assert_eq!(one["serving"], 1);
    assert_eq!(version["state"], "ready");
    assert_eq!(version["labels"], json!(["stable"]));
    assert_eq!(version["rooms"].as_array().unwrap().len(), answer["probabilities"].as_array().unwrap().len());
    let digest = version["digest"].as_str().unwrap();
    assert_eq!(digest.len(), 64);
    assert!(digest.starts_with(answer["model"]["digest"].as_str().unwrap()));
    assert!(version["card"].is_object(), "{version}");
}

#[tokio::test]
async fn health_documentation_and_problems_are_open_to_anyone() {
    let (_, key) = Key::new(Role::Admin, "operator", &[1; 32]).unwrap();
    let server = Server::start(Settings { keys: vec![key], ..Settings::default() }).await;
    assert_eq!(success(server.get("/livez").send().await.unwrap()).await["status"], "live");
    assert_eq!(success(server.get("/readyz").send().await.unwrap()).await["status"], "ready");
    assert_eq!(success(server.get("/openapi.json").send().await.unwrap()).await["openapi"], "3.1.0");
    let kind = success(server.get("/problems/queue-full").send().await.unwrap()).await;
    assert_eq!(kind["status"], 429);
    // The page, or where the program was built without it the documentation.
    let page = server.get("/").send().await.unwrap();
    assert_eq!(page.url().path(), if has_page() { "/" } else { "/docs/" });
    let policy = page.headers()["content-security-policy"].to_str().unwrap();
    assert!(!policy.contains("unsafe") && policy.contains("frame-ancestors 'none'"), "{policy}");
    let page = server.get("/docs/").send().await.unwrap().text().await.unwrap();
    assert!(page.contains("swagger-ui") && !page.contains("https://"), "{page}");
}

#[tokio::test]
async fn a_key_opens_what_its_role_may_and_nothing_else() {
    let made = [Role::Robot, Role::Viewer, Role::Admin]
        .map(|role| Key::new(role, "someone", &[role as u8; 32]).unwrap());
    let keys = made.iter().map(|(_, key)| key.clone()).collect();
    let server = Server::start(Settings { keys, ..Settings::default() }).await;
    let [robot, viewer, admin] = made.map(|(secret, _)| secret);
    let post = |key: &str| server.post("/v1/recognize", frame()).bearer_auth(key).send();
    let read = |key: &str| server.get("/v1/models").header("x-api-key", key).send();
    for key in [&robot, &admin] {
        success(post(key).await.unwrap()).await;
    }
    for key in [&viewer, &admin] {
        success(read(key).await.unwrap()).await;
    }
    problem(post(&viewer).await.unwrap(), 403, "forbidden").await;
    problem(read(&robot).await.unwrap(), 403, "forbidden").await;
    problem(post("rs_wrong").await.unwrap(), 401, "unauthorized").await;
    let response = server.post("/v1/recognize", frame()).send().await.unwrap();
    assert_eq!(response.headers()["www-authenticate"], "Bearer");
    problem(response, 401, "unauthorized").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_caller_who_sends_too_much_can_send_it_all_and_then_reads_why() {
    let server = Server::start(Settings::default()).await;
    let head =
        format!("POST /v1/recognize HTTP/1.1\r\nhost: localhost\r\ncontent-length: {}\r\n\r\n", 50 << 20);
    let mut stream = server.send_raw(head.as_bytes());
    stream.write_all(&vec![0; 50 << 20]).expect("the connection stays open");
    let response = read_raw(stream).await;
    assert!(response.starts_with("HTTP/1.1 413 "), "{response}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_caller_who_asks_before_sending_is_told_without_sending() {
    let server = Server::start(Settings { max_frame_bytes: 1000, ..Settings::default() }).await;
    let head = |n_bytes| {
        format!(
            "POST /v1/recognize HTTP/1.1\r\nhost: localhost\r\nexpect: 100-continue\r\ncontent-length: {n_bytes}\r\n\r\n"
        )
    };
    let response = read_raw(server.send_raw(head(1001).as_bytes())).await;
    assert!(response.starts_with("HTTP/1.1 413 "), "{response}");
    read_exactly(&mut server.send_raw(head(1000).as_bytes()), "HTTP/1.1 100 ");
}

#[tokio::test]
async fn the_key_is_checked_before_the_body_is_read() {
    let (_, key) = Key::new(Role::Robot, "wall-e", &[1; 32]).unwrap();
    let server = Server::start(Settings { keys: vec![key], ..Settings::default() }).await;
    let head = "POST /v1/recognize HTTP/1.1\r\nhost: localhost\r\ncontent-length: 1000000\r\n\r\n";
    let response = read_raw(server.send_raw(head.as_bytes())).await;
    assert!(response.starts_with("HTTP/1.1 401 "), "{response}");
}

#[tokio::test]
async fn a_damaged_model_is_listed_as_failed_and_the_next_lower_version_serves() {
    let folder = models();
    write_damaged_model(&folder.path().join("lab/2"));
    write_damaged_model(&folder.path().join("attic/1"));
    let server = Server::of(Settings { models: folder.path().to_owned(), ..Settings::default() }).await;
    let lab = success(server.get("/v1/models/lab").send().await.unwrap()).await;
    assert_eq!(lab["serving"], 1);
    assert_eq!(lab["versions"][0]["state"], "failed", "{lab}");
    assert_eq!(lab["versions"][0]["failure"]["stage"], "verifying", "{lab}");
    let attic = success(server.get("/v1/models/attic").send().await.unwrap()).await;
    assert_eq!(attic["serving"], Value::Null);
    success(server.post("/v1/recognize", frame()).send().await.unwrap()).await;
    for (query, status, kind) in [("model=attic", 503, "no-model"), ("version=2", 409, "version-not-ready")] {
        let response = server.post(&format!("/v1/recognize?{query}"), frame()).send().await.unwrap();
        problem(response, status, kind).await;
    }
}

#[test]
fn without_a_model_that_works_the_service_does_not_start_and_says_why() {
    let folder = tempfile::TempDir::new().unwrap();
    let start = || App::start(Settings { models: folder.path().to_owned(), ..Settings::default() });
    let reason = start().err().unwrap().to_string();
    assert!(reason.contains("no model in"), "{reason}");
    write_damaged_model(&folder.path().join("lab/2"));
    let reason = start().err().unwrap().to_string();
    assert!(reason.contains("lab/2: verifying failed: "), "{reason}");
}

#[test]
fn a_folder_of_one_model_and_a_default_model_are_understood() {
    let folder = models();
    let start =
        |models, model: &str| App::start(Settings { models, model: model.into(), ..Settings::default() });
    assert!(start(folder.path().join("lab/1"), "lab").is_ok());
    let reason = start(folder.path().to_owned(), "cellar").err().unwrap().to_string();
    assert!(reason.contains("cellar") && reason.contains("lab"), "{reason}");
}

#[tokio::test]
async fn answers_tell_browsers_to_be_careful() {
    let server = Server::start(Settings::default()).await;
    for path in ["/livez", "/docs/", "/nothing"] {
        let response = client().get(format!("{}{path}", server.url)).send().await.unwrap();
        assert_eq!(response.headers()["x-content-type-options"], "nosniff", "{path}");
        assert!(response.headers().contains_key("content-security-policy"), "{path}");
        assert!(!response.headers().contains_key("access-control-allow-origin"), "{path}");
    }
}
