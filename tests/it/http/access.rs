//! Who may call: pages of other sites, names, keys and robots, sessions, and keys that come and go.

use crate::http::robot::{Heard, Robot};
use crate::http::service::{Server, client, frame, problem, read_raw, success};
use reqwest::header::{HeaderMap, SET_COOKIE};
use reqwest::{Method, RequestBuilder};
use roomsight::access::{Key, Role};
use roomsight::settings::Settings;
use roomsight_protocol::stream::{Configure, ServerMessage};
use serde_json::Value;
use tokio_tungstenite::tungstenite::Error;

const UNLOAD: &str = "/v2/repository/models/lab/unload";
const ACTIVATE: &str = "/v1/models/lab/versions/1/activate";

/// A key of this role and name, bound to these robots, and its secret.
fn key(role: Role, name: &str, robots: &[&str]) -> (String, Key) {
    let random = <[u8; 32]>::try_from(format!("{name:*<32}").as_bytes()).unwrap();
    let (secret, key) = Key::new(role, name, &random).unwrap();
    (secret, key.bound_to(robots.iter().copied()).unwrap())
}

async fn serving(keys: &[&Key]) -> Server {
    let keys = keys.iter().map(|&key| key.clone()).collect();
    Server::start(Settings { keys, ..Settings::default() }).await
}

fn call(server: &Server, method: Method, path: &str) -> RequestBuilder {
    client().request(method, format!("{}{path}", server.url))
}

/// The kind of a refusal that has this status.
async fn refusal(call: RequestBuilder, status: u16) -> String {
    let response = call.send().await.unwrap();
    let told = response.status();
    let text = response.text().await.unwrap();
    assert_eq!(told, status, "{text}");
    let body: Value = serde_json::from_str(&text).unwrap();
    body["type"].as_str().or(body["error"].as_str()).unwrap().trim_start_matches("/problems/").to_owned()
}

/// The kind of the problem with which a stream is refused.
async fn stream_refusal(server: &Server, query: &str, headers: &[(&'static str, &str)]) -> String {
    match Robot::try_connect(server, query, headers).await.map(drop) {
        Err(Error::Http(response)) => {
            let body: Value = serde_json::from_slice(response.body().as_deref().unwrap()).unwrap();
            body["type"].as_str().unwrap().trim_start_matches("/problems/").to_owned()
        }
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn without_keys_a_page_of_another_site_can_do_nothing() {
    let server = Server::start(Settings::default()).await;
    let foreign: [&[(&str, &str)]; 4] = [
        &[("origin", "http://evil.example")],
        &[("origin", "null")],
        &[("origin", "http://127.0.0.1:1")],
        &[("sec-fetch-site", "cross-site"), ("sec-fetch-mode", "no-cors")],
    ];
    for headers in foreign {
        let with = |mut call: RequestBuilder| {
            for (name, value) in headers {
                call = call.header(*name, *value);
            }
            call
        };
        assert_eq!(refusal(with(server.post("/v1/recognize", frame())), 403).await, "foreign-site");
        assert_eq!(refusal(with(call(&server, Method::POST, ACTIVATE)), 403).await, "foreign-site");
        assert_eq!(refusal(with(server.get("/v1/models")), 403).await, "foreign-site");
        let told = refusal(with(call(&server, Method::POST, UNLOAD)), 403).await;
        assert!(told.contains("`origins`") && told.contains("proxy"), "{told}");
    }
    assert_eq!(stream_refusal(&server, "", foreign[0]).await, "foreign-site");
    let own = server.post("/v1/recognize", frame()).header("origin", server.url.to_uppercase());
    success(own.send().await.unwrap()).await;
    Robot::try_connect(&server, "", &[("origin", "http://127.0.0.1")])
        .await
        .expect("no port is no other site");
    success(server.get("/readyz").send().await.unwrap()).await;
}

#[tokio::test]
async fn without_keys_the_service_answers_only_to_names_that_it_knows() {
    let settings = Settings { hosts: vec!["roomsight:8080".into()], ..Settings::default() };
    let server = Server::start(settings).await;
    let as_host = |call: RequestBuilder, host: &str| call.header("host", host);
    for path in ["/v1/models", "/v1/robots", "/metrics", "/v1/events"] {
        assert_eq!(
            refusal(as_host(server.get(path), "evil.example:8080"), 403).await,
            "unknown-host",
            "{path}"
        );
    }
    let told = refusal(as_host(call(&server, Method::POST, UNLOAD), "evil.example"), 403).await;
    assert!(told.contains("`hosts`") && told.contains("evil.example"), "{told}");
    assert_eq!(stream_refusal(&server, "", &[("host", "evil.example")]).await, "unknown-host");
    for host in ["RoomSight:8080", "localhost", "10.1.2.3:99"] {
        success(as_host(server.get("/v1/models"), host).send().await.unwrap()).await;
    }
    success(as_host(server.get("/readyz"), "probe.example").send().await.unwrap()).await;
}

#[tokio::test]
async fn a_key_is_enough_from_wherever() {
    let (secret, admin) = key(Role::Admin, "boss", &[]);
    let server = serving(&[&admin]).await;
    let far = server.get("/v1/models").header("host", "lab.example").header("origin", "http://x.example");
    success(far.bearer_auth(secret).send().await.unwrap()).await;
}

#[tokio::test]
async fn a_request_says_once_to_whom_it_speaks() {
    let server = Server::start(Settings::default()).await;
    for (head, status) in [
        ("GET /livez HTTP/1.1\r\n\r\n", 400),
        ("GET /livez HTTP/1.1\r\nhost: localhost\r\nhost: localhost\r\n\r\n", 400),
        ("GET /livez HTTP/1.1\r\nhost: localhost\r\n\r\n", 200),
        ("GET /livez HTTP/1.0\r\n\r\n", 200),
    ] {
        let answer = read_raw(server.send_raw(head.as_bytes())).await;
        assert!(answer.split(' ').nth(1) == Some(&status.to_string()), "{head}{answer}");
    }
}

#[tokio::test]
async fn pages_of_the_origins_that_are_set_may_call_and_read() {
    let (secret, viewer) = key(Role::Viewer, "screen", &[]);
    let origins = vec!["https://dash.example".to_owned()];
    let server = Server::start(Settings { keys: vec![viewer], origins, ..Settings::default() }).await;
    let preflight = |origin: &str| {
        let call = call(&server, Method::OPTIONS, "/v1/recognize").header("origin", origin);
        call.header("access-control-request-method", "POST")
            .header("access-control-request-headers", "authorization,content-type")
            .send()
    };
    let allowed = preflight("https://dash.example").await.unwrap();
    assert!(allowed.status().is_success(), "{allowed:?}");
    let headers = allowed.headers();
    assert_eq!(headers["access-control-allow-origin"], "https://dash.example");
    assert_eq!(headers["access-control-allow-credentials"], "true");
    let lists = |headers: &HeaderMap, name: &str, what: &str| {
        headers.get_all(name).iter().any(|list| list.to_str().unwrap().to_lowercase().contains(what))
    };
    assert!(lists(headers, "access-control-allow-headers", "authorization"), "{headers:?}");
    assert!(lists(headers, "access-control-allow-methods", "delete"), "{headers:?}");
    let refused = preflight("https://evil.example").await.unwrap();
    assert!(!refused.headers().contains_key("access-control-allow-origin"), "{refused:?}");

    for (secret, status) in [(secret.as_str(), 200), ("rs_wrong", 401)] {
        let read = server.get("/v1/models").bearer_auth(secret).header("origin", "https://dash.example");
        let answer = read.send().await.unwrap();
        assert_eq!(answer.status(), status);
        assert_eq!(answer.headers()["access-control-allow-origin"], "https://dash.example");
        assert!(lists(answer.headers(), "vary", "origin"), "{answer:?}");
        assert!(lists(answer.headers(), "access-control-expose-headers", "x-request-id"), "{answer:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_browser_that_signed_in_may_do_what_its_key_may() {
    let ((secret, viewer), (admin, _)) = (key(Role::Viewer, "screen", &[]), key(Role::Admin, "boss", &[]));
    let server = serving(&[&viewer]).await;
    let sign_in = |secret: &str| call(&server, Method::POST, "/v1/session").bearer_auth(secret);
    assert_eq!(refusal(sign_in(&admin), 401).await, "unauthorized");
    let answer = sign_in(&secret).send().await.unwrap();
    let cookie = answer.headers()[SET_COOKIE].to_str().unwrap().to_owned();
    for attribute in ["HttpOnly", "SameSite=Strict", "Path=/", "Max-Age=3600"] {
        assert!(cookie.contains(attribute), "{cookie}");
    }
    assert!(!cookie.contains("Secure") && !cookie.contains(&secret), "{cookie}");
    let told = success(answer).await;
    assert_eq!((&told["name"], &told["role"]), (&"screen".into(), &"viewer".into()));

    let cookie = cookie.split(';').next().unwrap();
    let with = |call: RequestBuilder| call.header("cookie", cookie);
    success(with(server.get("/v1/models")).send().await.unwrap()).await;
    let events = with(server.get("/v1/events")).send().await.unwrap();
    assert_eq!(events.headers()["content-type"], "text/event-stream");
    assert_eq!(refusal(with(server.post("/v1/recognize", frame())), 403).await, "forbidden");
    let foreign = with(server.get("/v1/models")).header("origin", "http://evil.example");
    assert_eq!(refusal(foreign, 403).await, "foreign-site");
    assert_eq!(refusal(with(call(&server, Method::POST, "/v1/session")), 401).await, "unauthorized");
    let forged = server.get("/v1/models").header("cookie", cookie.replace('=', "=9"));
    assert_eq!(refusal(forged, 401).await, "unauthorized");

    let encrypted = sign_in(&secret).header("origin", "https://dash.example").send().await.unwrap();
    assert!(encrypted.headers()[SET_COOKIE].to_str().unwrap().contains("Secure"));
    let out = with(call(&server, Method::DELETE, "/v1/session")).send().await.unwrap();
    assert_eq!(out.status(), 204);
    assert!(out.headers()[SET_COOKIE].to_str().unwrap().contains("Max-Age=0"));
}

#[tokio::test]
async fn without_keys_nobody_needs_to_sign_in() {
    let server = Server::start(Settings::default()).await;
    let answer = call(&server, Method::POST, "/v1/session").send().await.unwrap();
    assert!(!answer.headers().contains_key(SET_COOKIE));
    assert_eq!(success(answer).await, serde_json::json!({}));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_of_one_key_cannot_be_anothers() {
    let ((bound_secret, bound), (free_secret, free)) =
        (key(Role::Robot, "kitchen", &["wall-e", "eve"]), key(Role::Robot, "mo", &[]));
    let (screen, viewer) = key(Role::Viewer, "screen", &[]);
    let server = serving(&[&bound, &free, &viewer]).await;
    let post = |robot: &str, secret: &str| {
        server.post(&format!("/v1/recognize?robot={robot}"), frame()).bearer_auth(secret)
    };
    success(post("eve", &bound_secret).send().await.unwrap()).await;
    success(post("r2", &free_secret).send().await.unwrap()).await;
    assert_eq!(refusal(post("r2", &bound_secret), 403).await, "robot-of-another");
    assert_eq!(refusal(post("wall-e", &free_secret), 403).await, "robot-of-another");

    let bearer = format!("Bearer {free_secret}");
    let headers = [("authorization", bearer.as_str())];
    assert_eq!(stream_refusal(&server, "?robot=wall-e", &headers).await, "robot-of-another");
    let mut robot = Robot::try_connect(&server, "?robot=r2", &headers).await.unwrap();
    let change = Configure { robot: Some("wall-e".into()), ..Configure::default() };
    let ServerMessage::Error { problem, .. } = robot.configure(change).await else { panic!("no error") };
    assert_eq!(problem.r#type, "/problems/robot-of-another");
    let seen = success(server.get("/v1/robots/r2").bearer_auth(&screen).send().await.unwrap()).await;
    assert_eq!(seen["key"], "mo", "{seen}");
}

#[tokio::test]
async fn one_key_does_all_that_a_client_of_the_inference_protocol_does() {
    let ((secret, robot), (screen, viewer)) = (key(Role::Robot, "mo", &[]), key(Role::Viewer, "screen", &[]));
    let server = serving(&[&robot, &viewer]).await;
    for path in ["/v2", "/v2/models/lab", "/v2/models/lab/ready", "/v2/models/lab/versions/1/ready"] {
        for secret in [&secret, &screen] {
            success(server.get(path).bearer_auth(secret).send().await.unwrap()).await;
        }
        assert_eq!(server.get(path).send().await.unwrap().status(), 401, "{path}");
    }
    let told = refusal(call(&server, Method::POST, UNLOAD).bearer_auth(&secret), 403).await;
    assert!(told.contains("admin"), "{told}");
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_come_and_go_without_a_restart() {
    let ((secret, mo), (fresh_secret, fresh)) = (key(Role::Robot, "mo", &[]), key(Role::Robot, "r2", &[]));
    let (screen, viewer) = key(Role::Viewer, "screen", &[]);
    let server = serving(&[&mo, &viewer]).await;
    let bearer = format!("Bearer {secret}");
    let mut robot = Robot::try_connect(&server, "", &[("authorization", &bearer)]).await.unwrap();
    let mut events = server.get("/v1/events").bearer_auth(&screen).send().await.unwrap();

    let settings = Settings { keys: vec![fresh], queue: 7, ..Settings::default() };
    let reloaded = server.app.reload(&settings).unwrap();
    assert_eq!(reloaded.n_keys, 1);
    assert!(reloaded.waiting.contains(&"queue".to_owned()), "{reloaded:?}");
    assert!(matches!(robot.heard().await, Heard::Closed(Some(1008))));
    while let Some(_event) = events.chunk().await.unwrap() {}
    let post = |secret: &str| server.post("/v1/recognize", frame()).bearer_auth(secret);
    assert_eq!(refusal(post(&secret), 401).await, "unauthorized");
    success(post(&fresh_secret).send().await.unwrap()).await;

    let error = server.app.reload(&Settings::default()).unwrap_err();
    assert!(error.to_string().contains("keys stay"), "{error}");
    success(post(&fresh_secret).send().await.unwrap()).await;
}

#[tokio::test]
async fn a_robots_name_is_what_it_looks_like() {
    let server = Server::start(Settings::default()).await;
    for name in ["", "wall%E2%80%8B-e", "a%E2%80%AEb", "a%E2%80%A8b"] {
        let call = server.post(&format!("/v1/recognize?robot={name}"), frame());
        problem(call.send().await.unwrap(), 400, "bad-request").await;
        assert_eq!(stream_refusal(&server, &format!("?robot={name}"), &[]).await, "bad-request", "{name}");
    }
}
