//! The service over TLS, with the certificates of `tests/tls`.

use crate::http::command::{failure, output};
use crate::http::service::{Server, client, frame, read_raw};
use reqwest::{Certificate, Identity};
use roomsight::access::{Key, Role};
use roomsight::settings::Settings;
use roomsight_client::{Client, ClientError};
use roomsight_protocol::rest::RecognizeQuery;
use roomsight_protocol::stream::{Configure, ServerMessage};
use std::fs;
use std::path::{Path, PathBuf};

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/tls").join(name)
}

fn pem(name: &str) -> Vec<u8> {
    fs::read(path(name)).unwrap()
}

fn settings() -> Settings {
    Settings { tls_certificate: path("service.pem"), tls_key: path("service.key"), ..Settings::default() }
}

fn url(server: &Server) -> String {
    format!("https://{}", server.address)
}

fn builder() -> reqwest::ClientBuilder {
    let authority = Certificate::from_pem(&pem("ca.pem")).unwrap();
    reqwest::Client::builder().no_proxy().tls_certs_only([authority])
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_and_streams_go_over_tls() {
    let server = Server::start(settings()).await;
    let client = Client::believing(&url(&server), None, &pem("ca.pem")).unwrap();
    assert!(client.is_ready().await.unwrap());
    let answer = client.recognize(frame(), &RecognizeQuery::default()).await.unwrap();
    let mut stream = client.stream(&Configure::default()).await.unwrap();
    stream.send(frame()).await.unwrap();
    let ServerMessage::Result(result) = stream.receive().await.unwrap() else { panic!("no result") };
    assert_eq!(result.answer.room, answer.room);
}

#[tokio::test(flavor = "multi_thread")]
async fn who_does_not_believe_the_certificate_does_not_call() {
    let server = Server::start(settings()).await;
    let stranger = Client::believing(&url(&server), None, &pem("caller.pem"));
    let error = stranger.unwrap().is_ready().await.unwrap_err();
    assert!(matches!(error, ClientError::Call(_)), "{error}");
    let error = Client::believing(&url(&server), None, b"no certificate").unwrap_err();
    assert!(error.to_string().contains("no certificate"), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_commands_call_over_tls() {
    let server = Server::start(settings()).await;
    let (url, authority) = (url(&server), path("ca.pem"));
    let listed = output(&["models", "list", "--url", &url, "--ca", authority.to_str().unwrap()]);
    assert!(listed.status.success() && String::from_utf8_lossy(&listed.stdout).contains("lab"), "{listed:?}");
    let unbelieved = failure(&["models", "list", "--url", &url]);
    assert!(unbelieved.contains(&url), "{unbelieved}");
    assert!(output(&["health", &url]).status.success());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_over_tls_never_travels_without() {
    let (secret, key) = Key::new(Role::Viewer, "screen", &[1; 32]).unwrap();
    let server = Server::start(Settings { keys: vec![key], ..settings() }).await;
    let sign_in = builder().build().unwrap().post(format!("{}/v1/session", url(&server)));
    let answer = sign_in.bearer_auth(secret).send().await.unwrap();
    assert!(answer.headers()["set-cookie"].to_str().unwrap().ends_with("; Secure"), "{answer:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn plain_http_is_told_where_to_go_and_silence_stops_nobody() {
    let server = Server::start(settings()).await;
    let _silent: Vec<_> = (0..20).map(|_| server.send_raw(b"")).collect();
    let answer = read_raw(server.send_raw(b"GET /readyz HTTP/1.1\r\nhost: localhost\r\n\r\n")).await;
    assert!(answer.starts_with("HTTP/1.1 400 ") && answer.contains("https://"), "{answer}");
    let response = builder().build().unwrap().get(format!("{}/readyz", url(&server))).send().await.unwrap();
    assert!(response.status().is_success());
    assert!(client().get(format!("{}/readyz", url(&server))).send().await.is_err(), "an unknown authority");
}

#[tokio::test(flavor = "multi_thread")]
async fn callers_show_certificates_where_they_must() {
    let server = Server::start(Settings { tls_client_ca: path("ca.pem"), ..settings() }).await;
    let ask = |builder: reqwest::ClientBuilder| {
        builder.build().unwrap().get(format!("{}/readyz", url(&server))).send()
    };
    assert!(ask(builder()).await.is_err());
    let identity = Identity::from_pem(&[pem("caller.pem"), pem("caller.key")].concat()).unwrap();
    assert!(ask(builder().identity(identity)).await.unwrap().status().is_success());
    let wrong = Identity::from_pem(&[pem("service.pem"), pem("service.key")].concat()).unwrap();
    assert!(ask(builder().identity(wrong)).await.is_err(), "it is for a service, not for a caller");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reload_takes_another_certificate_over_and_keeps_connections() {
    let folder = tempfile::tempdir().unwrap();
    let lay = |name: &str| {
        fs::write(folder.path().join("a.pem"), pem(&format!("{name}.pem"))).unwrap();
        fs::write(folder.path().join("a.key"), pem(&format!("{name}.key"))).unwrap();
    };
    lay("service");
    let settings = Settings {
        tls_certificate: folder.path().join("a.pem"),
        tls_key: folder.path().join("a.key"),
        ..Settings::default()
    };
    let server = Server::start(settings.clone()).await;
    let seen = async || {
        let client = builder().tls_info(true).build().unwrap();
        let response = client.get(format!("{}/readyz", url(&server))).send().await.unwrap();
        let info = response.extensions().get::<reqwest::tls::TlsInfo>().unwrap();
        info.peer_certificate().unwrap().to_vec()
    };
    let client = Client::believing(&url(&server), None, &pem("ca.pem")).unwrap();
    let mut stream = client.stream(&Configure::default()).await.unwrap();
    let first = seen().await;
    lay("renewed");
    server.app.reload(&settings).unwrap();
    assert_ne!(seen().await, first);
    fs::write(folder.path().join("a.key"), "no key").unwrap();
    let _ = server.app.reload(&settings).unwrap();
    assert_ne!(seen().await, first, "a key that cannot be used changes nothing");
    stream.send(frame()).await.unwrap();
    assert!(matches!(stream.receive().await.unwrap(), ServerMessage::Result(_)));
}
