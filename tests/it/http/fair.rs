//! What one caller can take from others: turns, places in the queue, memory, connections.

use crate::http::load::very_slow_frame;
use crate::http::robot::Robot;
use crate::http::service::{
    FORM, SOON, Server, client, form, frame, problem, read_exactly, read_raw, success,
};
use roomsight::settings::Settings;
use roomsight_protocol::stream::ServerMessage;
use serde_json::Value;
use std::io::Write;
use std::net::TcpStream;
use tokio::net::TcpSocket;
use tokio::task::JoinSet;
use tokio::time::timeout;

type Answers = JoinSet<reqwest::Result<reqwest::Response>>;

async fn one_thread(settings: Settings) -> Server {
    Server::start(Settings { threads: 1, ..settings }).await
}

/// Posts as many frames that take long at once in the name of a robot.
fn flood(server: &Server, robot: &str, n_frames: usize) -> Answers {
    let (client, url) = (client(), format!("{}/v1/recognize?robot={robot}", server.url));
    (0..n_frames).map(|_| client.post(&url).body(very_slow_frame()).send()).collect()
}

/// Waits until so many frames of requests wait or are in work.
async fn until_held(server: &Server, n_slots: usize) {
    let wanted = format!("roomsight_slots_in_use {n_slots}");
    let has_come = async || {
        let metrics = server.get("/metrics").send().await.unwrap().text().await.unwrap();
        metrics.lines().any(|line| line == wanted)
    };
    timeout(SOON, async { while !has_come().await {} }).await.expect("they come");
}

/// The statuses of all that are still to come, and what the last refusal said.
async fn rest(answers: &mut Answers) -> (Vec<u16>, Option<Value>) {
    let (mut statuses, mut refusal) = (Vec::new(), None);
    while let Some(answer) = answers.join_next().await {
        let response = answer.unwrap().unwrap();
        statuses.push(response.status().as_u16());
        if response.status() != 200 {
            refusal = Some(problem(response, 429, "queue-full").await);
        }
    }
    (statuses, refusal)
}

fn n_answered(statuses: &[u16]) -> usize {
    statuses.iter().filter(|&&status| status == 200).count()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_greedy_caller_has_its_share_of_the_queue_and_a_polite_one_is_next() {
    let server = one_thread(Settings { queue: 10, max_batch_frames: 4, ..Settings::default() }).await;
    let mut robot = Robot::connect(&server, "?mode=lossless&robot=polite-too").await;
    let batch = server.post_as("/v1/recognize/batch?robot=polite", FORM, form(&[frame().as_slice(); 4]));
    let mut greedy = flood(&server, "greedy", 15);
    // One in work, and half of the queue.
    until_held(&server, 6).await;
    robot.send(frame()).await;
    let batch = success(batch.send().await.unwrap()).await;
    assert_eq!(batch["results"].as_array().unwrap().len(), 4);
    assert!(matches!(robot.next().await, ServerMessage::Result(_)));
    // Each of the six takes far longer than all the frames of the others.
    let mut statuses = Vec::new();
    while let Some(answer) = greedy.try_join_next() {
        statuses.push(answer.unwrap().unwrap().status().as_u16());
    }
    assert!(n_answered(&statuses) < 6, "they went first: {statuses:?}");
    let (rest, refusal) = rest(&mut greedy).await;
    let n_answered = n_answered(&statuses) + n_answered(&rest);
    assert!((6..15).contains(&n_answered), "{n_answered}");
    if let Some(refusal) = refusal {
        assert!(refusal["detail"].as_str().unwrap().contains("this caller's share"), "{refusal}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_batch_gets_its_places_from_those_who_have_more() {
    let server = one_thread(Settings { queue: 40, max_batch_frames: 10, ..Settings::default() }).await;
    let mut floods = [flood(&server, "greedy", 30), flood(&server, "greedier", 30)];
    until_held(&server, 41).await;
    let batch = form(&[frame().as_slice(); 10]);
    let answer = server.post_as("/v1/recognize/batch?robot=polite", FORM, batch).send();
    let answer = success(answer.await.unwrap()).await;
    for result in answer["results"].as_array().unwrap() {
        assert!(result["answer"]["room"].is_string(), "{result}");
    }
    for greedy in &mut floods {
        greedy.shutdown().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_turns_of_streams_count_where_requests_are_admitted() {
    let server =
        one_thread(Settings { queue: 2, caller_share: 1.0, max_batch_frames: 1, ..Settings::default() })
            .await;
    let mut robots = Vec::new();
    for idx in 0..4 {
        let mut robot = Robot::connect(&server, &format!("?mode=lossless&robot=r{idx}")).await;
        robot.send(very_slow_frame()).await;
        robots.push(robot);
    }
    timeout(SOON, async {
        loop {
            let late = || server.post("/v1/recognize?robot=late", frame()).send();
            let (first, second) = tokio::join!(late(), late());
            let (first, second) = (first.unwrap(), second.unwrap());
            let (refused, other) = if first.status() == 429 { (first, second) } else { (second, first) };
            success(other).await;
            if refused.status() == 429 {
                return problem(refused, 429, "queue-full").await;
            }
        }
    })
    .await
    .expect("turns fill a queue of two, so that one frame is let in and no second");
}

/// Sends a body of a length, but for its last byte.
fn unfinished(server: &Server, query: &str, length: usize) -> TcpStream {
    let head =
        format!("POST /v1/recognize{query} HTTP/1.1\r\nhost: localhost\r\ncontent-length: {length}\r\n\r\n");
    let mut stream = server.send_raw(head.as_bytes());
    stream.write_all(&vec![b'x'; length - 1]).unwrap();
    stream
}

#[tokio::test(flavor = "multi_thread")]
async fn bodies_that_never_end_leave_memory_for_others() {
    let settings = Settings {
        max_frame_bytes: 40_000,
        max_batch_bytes: 40_000,
        max_buffered_bytes: 160_000,
        ..Settings::default()
    };
    let server = Server::start(settings).await;
    let mut held = Vec::new();
    for idx in 0..20 {
        held.push(unfinished(&server, &format!("?robot=r{}", idx % 4), 40_000));
        // Of the same caller as well as of another.
        held.push(unfinished(&server, "", 40_000));
        for query in ["", "?robot=polite"] {
            success(server.post(&format!("/v1/recognize{query}"), frame()).send().await.unwrap()).await;
        }
    }
    let mut robot = Robot::connect(&server, "?mode=lossless").await;
    robot.send(frame()).await;
    assert!(matches!(robot.next().await, ServerMessage::Result(_) | ServerMessage::Dropped { .. }));
}

#[tokio::test(flavor = "multi_thread")]
async fn who_reads_nothing_is_given_up() {
    let settings = Settings {
        max_connections: 1,
        write_timeout_ms: 300,
        header_timeout_ms: 600_000,
        drain_timeout_ms: 600_000,
        ..Settings::default()
    };
    let mut server = Server::start(settings).await;
    let socket = TcpSocket::new_v4().unwrap();
    socket.set_recv_buffer_size(2048).unwrap();
    let stream = socket.connect(server.address.parse().unwrap()).await.unwrap();
    let mut stream = stream.into_std().unwrap();
    stream.set_nonblocking(false).unwrap();
    // More than the buffers between take.
    stream.write_all("GET /openapi.json HTTP/1.1\r\nhost: localhost\r\n\r\n".repeat(100).as_bytes()).unwrap();
    let live = timeout(SOON, server.get("/livez").send()).await.expect("the only place is free again");
    success(live.unwrap()).await;
    server.stop();
    timeout(SOON, server.stopped()).await.expect("a stop does not wait for it");
}

#[tokio::test(flavor = "multi_thread")]
async fn connections_that_rest_give_way_where_places_are_short() {
    let settings = Settings { max_connections: 2, header_timeout_ms: 600_000, ..Settings::default() };
    let server = Server::start(settings).await;
    let silent = server.send_raw(b"");
    let mut kept = server.send_raw(b"GET /livez HTTP/1.1\r\nhost: localhost\r\n\r\n");
    read_exactly(&mut kept, "HTTP/1.1 200 ");
    for _ in 0..3 {
        let live = server.get("/livez").header("connection", "close").send();
        success(timeout(SOON, live).await.expect("a place is free soon").unwrap()).await;
    }
    assert_eq!(read_raw(silent).await, "", "it is closed");
}

#[tokio::test(flavor = "multi_thread")]
async fn long_bodies_are_taken_apart_as_their_callers_work() {
    let server = one_thread(Settings { queue: 8, max_batch_frames: 4, ..Settings::default() }).await;
    // Longer than what is taken apart at once.
    let padded = [frame(), vec![0; 1200 << 10]].concat();
    let batch = form(&[padded.as_slice(), frame().as_slice()]);
    let answer = success(server.post_as("/v1/recognize/batch", FORM, batch).send().await.unwrap()).await;
    assert_eq!(answer["results"].as_array().unwrap().len(), 2);
    let base64 = "A".repeat(1200 << 10);
    let json = format!(r#"{{"frame": "{base64}"}}"#).into_bytes();
    problem(
        server.post_as("/v1/recognize", "application/json", json).send().await.unwrap(),
        422,
        "not-an-image",
    )
    .await;
    let json = format!(r#"{{"frame": "{base64}!"}}"#).into_bytes();
    let malformed = server.post_as("/v1/recognize?robot=polite", "application/json", json).send();
    problem(malformed.await.unwrap(), 400, "bad-request").await;
}
