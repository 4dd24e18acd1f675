//! Streams where memory is short: unfinished messages, and more frames than the service may hold.

use crate::http::load::{one_thread, slow_frame};
use crate::http::robot::{Heard, Robot, in_parts, raw};
use crate::http::service::{SOON, Server, frame, pgm, success};
use roomsight::settings::Settings;
use roomsight_protocol::stream::{DropReason, ServerMessage};
use tokio::task::JoinSet;
use tokio::time::timeout;

const MAX_FRAME_BYTES: usize = 40_000;

/// A service that may hold the bytes of so many frames of the longest kind.
async fn holding(n_frames: usize) -> Server {
    Server::start(Settings {
        max_frame_bytes: MAX_FRAME_BYTES,
        max_batch_bytes: MAX_FRAME_BYTES,
        max_buffered_bytes: n_frames * MAX_FRAME_BYTES,
        ..Settings::default()
    })
    .await
}

/// How many bytes the service says that it holds.
async fn body_bytes(server: &Server) -> usize {
    let text = server.get("/metrics").send().await.unwrap().text().await.unwrap();
    let line = text.lines().find(|line| line.starts_with("roomsight_body_bytes ")).unwrap();
    line.rsplit(' ').next().unwrap().parse::<f64>().unwrap() as usize
}

/// A frame of 30 KB.
fn large_frame(shift: u32) -> Vec<u8> {
    pgm(200, 150, |column, row| ((column + shift) / 9 * 57 + row / 7 * 91) as u8)
}

#[tokio::test(flavor = "multi_thread")]
async fn unfinished_messages_are_counted_and_give_way_to_others() {
    let server = holding(10).await;
    let mut stalled = Vec::new();
    for robot_idx in 0..30 {
        let mut robot = Robot::connect(&server, &format!("?robot=stalled-{robot_idx}")).await;
        robot.send_raw(&raw(0x82, MAX_FRAME_BYTES, &[1; MAX_FRAME_BYTES - 1])).await;
        stalled.push(robot);
    }
    timeout(SOON, async { while body_bytes(&server).await < MAX_FRAME_BYTES {} })
        .await
        .expect("they are counted");
    let mut robot = Robot::connect(&server, "?robot=polite").await;
    for seq in 0..10 {
        robot.send(frame()).await;
        let told = robot.next().await;
        assert!(matches!(&told, ServerMessage::Result(result) if result.seq == seq), "{told:?}");
        success(server.post("/v1/recognize", frame()).send().await.unwrap()).await;
        assert!(body_bytes(&server).await <= 10 * MAX_FRAME_BYTES);
    }
    // Each is told what became of its frame when that is whole.
    let mut n_given_up = 0;
    for mut robot in stalled {
        robot.send_raw(&[1]).await;
        match robot.next().await {
            ServerMessage::Dropped { seq: 0, reason: DropReason::Overload } => n_given_up += 1,
            ServerMessage::Error { seq: Some(0), problem } => {
                assert_eq!(problem.r#type, "/problems/not-an-image");
            }
            other => panic!("{other:?}"),
        }
    }
    assert!(n_given_up >= 20, "{n_given_up}");
    timeout(SOON, async { while body_bytes(&server).await > 0 {} }).await.expect("all is given back");
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_that_wait_for_their_time_give_way_to_others() {
    const N_STREAMS: usize = 8;
    let server = holding(8).await;
    let mut sampled = Vec::new();
    for _ in 0..N_STREAMS {
        let mut robot = Robot::connect(&server, "?robot=eve&mode=sampled&interval_ms=3600000").await;
        robot.send(frame()).await;
        assert!(matches!(robot.next().await, ServerMessage::Result(_)));
        // Whole, and not looked at for an hour.
        robot.send(vec![7; MAX_FRAME_BYTES]).await;
        robot.say("no message, so that all before it has been read when this is answered").await;
        while !matches!(robot.next().await, ServerMessage::Error { seq: None, .. }) {}
        sampled.push(robot);
    }
    assert!(body_bytes(&server).await <= 2 * MAX_FRAME_BYTES, "all of them have a quarter");
    for mode in ["latest", "lossless"] {
        let mut polite = Robot::connect(&server, &format!("?robot=polite&mode={mode}")).await;
        polite.send(large_frame(0)).await;
        assert!(matches!(polite.next().await, ServerMessage::Result(_)));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn lossless_streams_drop_nothing_where_more_comes_than_can_be_held() {
    const N_FRAMES: u64 = 12;
    // There is room for one frame at a time.
    let server = holding(2).await;
    let mut robots = JoinSet::new();
    for robot_idx in 0..8 {
        let mut robot = Robot::connect(&server, &format!("?mode=lossless&robot={robot_idx}")).await;
        robots.spawn(async move {
            for seq in 0..N_FRAMES {
                let frame = large_frame(seq as u32);
                if robot_idx % 2 == 0 {
                    robot.send(frame).await;
                } else {
                    robot.send_raw(&in_parts(&frame)).await;
                }
            }
            for seq in 0..N_FRAMES {
                let told = robot.next().await;
                assert!(matches!(&told, ServerMessage::Result(result) if result.seq == seq), "{told:?}");
            }
        });
    }
    timeout(SOON, robots.join_all()).await.expect("all go on");
    assert_eq!(body_bytes(&server).await, 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_accepted_as_lossless_is_answered_in_another_mode() {
    for change in [r#""mode": "latest""#, r#""mode": "sampled", "interval_ms": 3600000"#] {
        let server = one_thread(4).await;
        let mut robot = Robot::connect(&server, "?mode=lossless").await;
        robot.send(slow_frame()).await;
        for _ in 1..4 {
            robot.send(frame()).await;
        }
        robot.say(&format!(r#"{{"type": "configure", {change}}}"#)).await;
        robot.send(frame()).await;
        let mut answered = Vec::new();
        while answered.len() < 4 {
            match robot.next().await {
                ServerMessage::Result(result) => answered.push(result.seq),
                ServerMessage::Configured { .. } => {}
                other => panic!("{other:?}"),
            }
        }
        assert_eq!(answered, [0, 1, 2, 3]);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_message_that_takes_too_long_costs_its_connection_and_not_the_stream() {
    let settings = Settings { stream_message_timeout_ms: 200, ..Settings::default() };
    let server = Server::start(settings).await;
    for mode in ["latest", "lossless"] {
        let mut robot = Robot::connect(&server, &format!("?mode={mode}")).await;
        robot.send_raw(&raw(0x82, 1000, b"only this")).await;
        assert!(matches!(robot.heard().await, Heard::Closed(Some(1008))));
        let query = format!("?session={}", robot.hello.session);
        let mut robot = Robot::connect(&server, &query).await;
        assert!(robot.hello.resumed);
        robot.send(frame()).await;
        assert!(matches!(robot.next().await, ServerMessage::Result(result) if result.seq == 0));
    }
}
