//! The service under pressure: full queues, slow and absent callers, and a stop in the middle.

use crate::http::service::{CONTINUE, SOON, Server, frame, problem, read_exactly, read_raw, success};
use image::{GrayImage, ImageFormat};
use roomsight::settings::Settings;
use std::io::{Cursor, Write};
use std::sync::LazyLock;
use std::time::{Duration, Instant};
use tokio::task::{JoinHandle, JoinSet};
use tokio::time::{sleep, timeout};

const SLOW_HEAD: &str =
    "POST /v1/recognize HTTP/1.1\r\nhost: localhost\r\ncontent-length: 1000\r\n\r\nonly this";
/// The service asks for this body when it has admitted the request.
const ASKED_HEAD: &str =
    "POST /v1/recognize HTTP/1.1\r\nhost: localhost\r\nexpect: 100-continue\r\ncontent-length: 1000\r\n\r\n";

/// A service of one thread with a queue of this length.
pub async fn one_thread(queue: usize) -> Server {
    Server::start(Settings {
        threads: 1,
        queue,
        caller_share: 1.0,
        max_batch_frames: 1,
        drain_timeout_ms: 60_000,
        ..Settings::default()
    })
    .await
}

/// Fills all slots of a service with frames that take long enough to look at what happens then.
pub async fn fill(server: &Server, n_slots: usize) -> Vec<JoinHandle<reqwest::Result<reqwest::Response>>> {
    let callers: Vec<_> =
        (0..n_slots).map(|_| tokio::spawn(server.post("/v1/recognize", very_slow_frame()).send())).collect();
    // An empty body takes no slot, but is refused for want of one before it is found to be empty.
    while server.post("/v1/recognize", vec![]).send().await.unwrap().status() != 429 {
        sleep(Duration::from_millis(1)).await;
    }
    callers
}

/// A small file that takes long to decode: 4 megapixels.
pub fn slow_frame() -> Vec<u8> {
    static FRAME: LazyLock<Vec<u8>> = LazyLock::new(|| black(2000));
    FRAME.clone()
}

/// One that takes ten times as long.
pub fn very_slow_frame() -> Vec<u8> {
    static FRAME: LazyLock<Vec<u8>> = LazyLock::new(|| black(6300));
    FRAME.clone()
}

fn black(side: u32) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    GrayImage::new(side, side).write_to(&mut bytes, ImageFormat::Png).unwrap();
    bytes.into_inner()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_queue_is_told_with_a_time_to_come_back() {
    let server = one_thread(1).await;
    let accepted = fill(&server, 2).await;
    let response = server.post("/v1/recognize", frame()).send().await.unwrap();
    let wait: u64 = response.headers()["retry-after"].to_str().unwrap().parse().unwrap();
    assert!((1..=60).contains(&wait), "{wait}");
    problem(response, 429, "queue-full").await;
    // It is told before the body is read, so that this one need not be sent.
    let response = read_raw(server.send_raw(SLOW_HEAD.as_bytes())).await;
    assert!(response.starts_with("HTTP/1.1 429 "), "{response}");
    for response in accepted {
        success(response.await.unwrap().unwrap()).await;
    }
    success(server.post("/v1/recognize", frame()).send().await.unwrap()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn slow_bodies_are_ended_and_hold_nobody_back() {
    let settings =
        Settings { threads: 1, queue: 0, max_batch_frames: 1, body_timeout_ms: 500, ..Settings::default() };
    let server = Server::start(settings).await;
    let mut slow = Vec::new();
    for _ in 0..5 {
        let mut stream = server.send_raw(ASKED_HEAD.as_bytes());
        read_exactly(&mut stream, CONTINUE);
        slow.push(stream);
    }
    success(server.post("/v1/recognize", frame()).send().await.unwrap()).await;
    for stream in slow {
        let response = read_raw(stream).await;
        assert!(response.starts_with("HTTP/1.1 408 "), "{response}");
        assert!(response.contains("/problems/slow-body"), "{response}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_head_that_never_ends_is_cut_off() {
    let server = Server::start(Settings { header_timeout_ms: 200, ..Settings::default() }).await;
    let stream = server.send_raw(b"POST /v1/recognize HTTP/1.1\r\nhost:");
    let started = Instant::now();
    read_raw(stream).await;
    assert!(started.elapsed() < SOON, "the connection is closed");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_head_that_is_too_long_is_refused() {
    let server = Server::start(Settings::default()).await;
    let head = format!("GET /livez HTTP/1.1\r\nhost: localhost\r\nx-long: {}", "x".repeat(100_000));
    let response = read_raw(server.send_raw(head.as_bytes())).await;
    assert!(response.starts_with("HTTP/1.1 431 "), "{response}");
}

#[tokio::test(flavor = "multi_thread")]
async fn memory_for_bodies_is_bounded_for_all_callers_together() {
    let settings = Settings {
        max_frame_bytes: 40_000,
        max_batch_bytes: 40_000,
        max_buffered_bytes: 60_000,
        ..Settings::default()
    };
    let server = Server::start(settings).await;
    let head = "POST /v1/recognize HTTP/1.1\r\nhost: localhost\r\ncontent-length: 40000\r\n\r\n";
    let unfinished = format!("{head}{}", "x".repeat(39_000));
    let (held, refused) = timeout(SOON, async {
        loop {
            // Whichever of the two comes late is refused; try until it is the second.
            let held = server.send_raw(unfinished.as_bytes());
            sleep(Duration::from_millis(20)).await;
            let response = server.post("/v1/recognize", vec![b'x'; 39_000]).send().await.unwrap();
            if response.status() == 429 {
                return (held, response);
            }
        }
    })
    .await
    .unwrap();
    problem(refused, 429, "queue-full").await;
    drop(held);
    timeout(SOON, async {
        while server.post("/v1/recognize", vec![b'x'; 39_000]).send().await.unwrap().status() == 429 {
            sleep(Duration::from_millis(10)).await;
        }
    })
    .await
    .expect("the memory is given back when the caller leaves");
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_of_callers_that_left_are_not_worked_on() {
    const N_LEAVING: u32 = 20;
    let server = one_thread(64).await;
    let one = server.post("/v1/recognize", slow_frame());
    let started = Instant::now();
    success(one.send().await.unwrap()).await;
    let one_takes = started.elapsed();
    let mut leaving = JoinSet::new();
    for _ in 0..N_LEAVING {
        leaving.spawn(server.post("/v1/recognize", slow_frame()).send());
    }
    sleep(one_takes.mul_f64(1.5)).await;
    leaving.shutdown().await;
    let started = Instant::now();
    success(server.post("/v1/recognize", frame()).send().await.unwrap()).await;
    let waited = started.elapsed();
    assert!(waited < one_takes * (N_LEAVING / 2), "{waited:?} where one frame takes {one_takes:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_deadline_that_passes_in_the_queue_is_told() {
    let server = one_thread(4).await;
    let ahead: Vec<_> =
        (0..4).map(|_| tokio::spawn(server.post("/v1/recognize", slow_frame()).send())).collect();
    let late = timeout(SOON, async {
        loop {
            // Until the slow frames have arrived, this one is in time.
            let response = server.post("/v1/recognize?deadline_ms=5", frame()).send().await.unwrap();
            if response.status() != 200 {
                return response;
            }
        }
    });
    problem(late.await.unwrap(), 504, "deadline-passed").await;
    for response in ahead {
        success(response.await.unwrap().unwrap()).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_answers_what_was_accepted_and_refuses_the_rest() {
    let mut server = one_thread(3).await;
    // A request that never ends keeps the service here until all has been asked of it.
    let mut unfinished = server.send_raw(ASKED_HEAD.as_bytes());
    read_exactly(&mut unfinished, CONTINUE);
    let accepted = fill(&server, 4).await;
    server.stop();
    let ready = async || server.get("/readyz").send().await.unwrap().status() == 200;
    timeout(SOON, async { while ready().await {} }).await.unwrap();
    problem(server.get("/readyz").send().await.unwrap(), 503, "draining").await;
    problem(server.post("/v1/recognize", frame()).send().await.unwrap(), 503, "draining").await;
    let upload = server.put("/v1/models/lab/versions/2", "a model").send().await.unwrap();
    problem(upload, 503, "draining").await;
    success(server.get("/livez").send().await.unwrap()).await;
    for response in accepted {
        success(response.await.unwrap().unwrap()).await;
    }
    drop(unfinished);
    timeout(SOON, server.stopped()).await.expect("it ends when all are answered");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_on_its_way_when_the_service_stops_is_answered_as_the_last_of_its_connection() {
    const LIVEZ: &[u8] = b"GET /livez HTTP/1.1\r\nhost: localhost\r\n\r\n";
    let mut server = Server::start(Settings::default()).await;
    let mut fresh = server.send_raw(b"");
    let mut kept = server.send_raw(LIVEZ);
    let answer = read_raw(kept.try_clone().unwrap()).await;
    assert!(!answer.contains("connection: close"), "{answer}");
    server.stop();
    sleep(Duration::from_millis(20)).await;
    for connection in [&mut fresh, &mut kept] {
        connection.write_all(LIVEZ).unwrap();
        let answer = read_raw(connection.try_clone().unwrap()).await;
        assert!(answer.starts_with("HTTP/1.1 200 ") && answer.contains("connection: close"), "{answer}");
    }
    timeout(SOON, server.stopped()).await.expect("it ends when all are answered");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_waits_for_nobody_who_asks_nothing_and_not_for_ever() {
    let mut server = Server::start(Settings::default()).await;
    let _idle = server.send_raw(b"");
    let kept = server.send_raw(b"GET /livez HTTP/1.1\r\nhost: localhost\r\n\r\n");
    let answer = read_raw(kept.try_clone().unwrap()).await;
    assert!(answer.starts_with("HTTP/1.1 200 "), "{answer}");
    server.stop();
    timeout(SOON, server.stopped()).await.expect("idle connections are closed");

    let mut server = Server::start(Settings { drain_timeout_ms: 300, ..Settings::default() }).await;
    let _slow = server.send_raw(SLOW_HEAD.as_bytes());
    sleep(Duration::from_millis(50)).await;
    server.stop();
    timeout(SOON, server.stopped()).await.expect("the drain is bounded");
}
