//! What never becomes a request is told why, as everything else is.

use crate::http::service::{Server, read_raw};
use roomsight::settings::Settings;
use serde_json::Value;

/// Reads an answer that must be a problem of this status and kind, and its id.
fn problem(response: &str, status: u16, kind: &str) {
    let (head, body) = response.split_once("\r\n\r\n").unwrap_or((response, ""));
    let head = head.to_ascii_lowercase();
    assert!(head.starts_with(&format!("http/1.1 {status} ")), "{response}");
    assert!(head.contains("\r\ncontent-type: application/problem+json"), "{response}");
    assert!(head.contains(&format!("\r\ncontent-length: {}", body.len())), "{response}");
    assert!(head.contains("\r\nconnection: close"), "{response}");
    let body: Value = serde_json::from_str(body).unwrap();
    assert_eq!((&body["type"], &body["status"]), (&format!("/problems/{kind}").into(), &status.into()));
    let id = body["request_id"].as_str().unwrap();
    assert!(head.contains(&format!("\r\nx-request-id: {id}")), "{response}");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_no_http_is_told_so() {
    let server = Server::start(Settings::default()).await;
    let hello_of_tls = b"\x16\x03\x01\x02\x00\x01\x00\x01\xFC\x03\x03";
    for bytes in [&hello_of_tls[..], b"nonsense\r\n\r\n", b"GET /livez HTTP/1.1\r\nho st: x\r\n\r\n"] {
        problem(&read_raw(server.send_raw(bytes)).await, 400, "not-http");
    }
    let after_another = b"GET /livez HTTP/1.1\r\nhost: x\r\n\r\nnonsense\r\n\r\n";
    let stream = server.send_raw(after_another);
    let first = read_raw(stream.try_clone().unwrap()).await;
    assert!(first.starts_with("HTTP/1.1 200 "), "{first}");
    let second = match first.split_once("HTTP/1.1 400 ") {
        Some((_, rest)) => format!("HTTP/1.1 400 {rest}"),
        None => read_raw(stream).await,
    };
    problem(&second, 400, "not-http");
}

#[tokio::test(flavor = "multi_thread")]
async fn heads_that_are_too_long_are_told_so_and_can_be_sent_to_their_end() {
    let server = Server::start(Settings::default()).await;
    let headers = format!("GET /livez HTTP/1.1\r\nhost: x\r\n{}\r\n", "a: b\r\n".repeat(101));
    let much = format!("GET /livez HTTP/1.1\r\nhost: x\r\na: {}\r\n\r\n", "x".repeat(4 << 20));
    for bytes in [headers, much] {
        problem(&read_raw(server.send_raw(bytes.as_bytes())).await, 431, "head-too-long");
    }
    // Whether the path or the head is found too long first depends on how the bytes arrive.
    let path = format!("GET /{} HTTP/1.1\r\nhost: x\r\n\r\n", "x".repeat(1 << 20));
    let response = read_raw(server.send_raw(path.as_bytes())).await;
    match response.contains(" 414 ") {
        true => problem(&response, 414, "path-too-long"),
        false => problem(&response, 431, "head-too-long"),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_names_one_host() {
    let server = Server::start(Settings::default()).await;
    for (head, status) in [
        ("GET /livez HTTP/1.1\r\nhost: x\r\n", 200),
        ("GET /livez HTTP/1.0\r\n", 200),
        ("GET /livez HTTP/1.1\r\n", 400),
        ("GET /livez HTTP/1.1\r\nhost: x\r\nhost: y\r\n", 400),
        ("GET /livez HTTP/1.0\r\nhost: x\r\nhost: x\r\n", 400),
    ] {
        let response = read_raw(server.send_raw(format!("{head}\r\n").as_bytes())).await;
        assert_eq!(response.get(9..12), Some(&*status.to_string()), "{head:?}: {response}");
    }
}
