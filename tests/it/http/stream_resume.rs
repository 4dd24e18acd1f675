//! Streams that break off: who comes back, to what, and who gives way.

use crate::http::robot::{Heard, Robot, closed_at_the_door, result};
use crate::http::service::{SOON, Server, room, success};
use futures_util::StreamExt;
use roomsight::access::{Key, Role};
use roomsight::settings::Settings;
use roomsight_protocol::event::RobotInfo;
use roomsight_protocol::stream::Mode;
use serde_json::Value;
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::Message;

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_that_comes_back_gets_what_it_missed_and_keeps_its_filter() {
    let server = Server::start(Settings::default()).await;
    let mut robot = Robot::connect(&server, "?mode=lossless&robot=wall-e").await;
    for shift in 0..4 {
        robot.send(room(0, shift)).await;
    }
    let mut last = result(robot.next().await);
    while last.seq < 3 {
        last = result(robot.next().await);
    }
    let session = robot.hello.session.clone();
    // Without a close frame: the connection breaks.
    drop(robot);
    let mut robot = Robot::connect(&server, &format!("?session={session}&last_seq=1")).await;
    assert_eq!((robot.hello.resumed, robot.hello.next_seq, &robot.hello.session), (true, 4, &session));
    assert_eq!(robot.hello.settings.mode, Mode::Lossless, "the stream stays configured");
    assert_eq!(result(robot.next().await).seq, 2);
    assert_eq!(result(robot.next().await).seq, 3);
    robot.send(room(0, 4)).await;
    let next = result(robot.next().await);
    assert_eq!(next.seq, 4);
    assert!(next.filtered.unwrap().probability >= last.filtered.unwrap().probability - 0.05);
    // It comes back while the old connection still seems to stand.
    let again = Robot::connect(&server, &format!("?session={session}&last_seq=4")).await;
    assert!(again.hello.resumed);
    assert!(matches!(robot.heard().await, Heard::Closed(Some(1008))));
    // A stream that was closed is over.
    let mut again = again;
    again.socket.close(None).await.unwrap();
    let answered = again.socket.next().await.unwrap().unwrap();
    assert!(matches!(answered, Message::Close(_)), "{answered:?}");
    assert!(again.socket.next().await.is_none());
    let fresh = Robot::connect(&server, &format!("?session={session}")).await;
    assert!(!fresh.hello.resumed && fresh.hello.session != session);
}

/// Waits until the service has noticed that a robot's connection broke.
async fn broke(server: &Server, robot: &str) {
    let info = async || -> RobotInfo {
        let info = success(server.get(&format!("/v1/robots/{robot}")).send().await.unwrap()).await;
        serde_json::from_value(info).unwrap()
    };
    timeout(SOON, async { while info().await.state.connected {} }).await.expect("it is noticed");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_kept_covers_the_window() {
    const N_FRAMES: u64 = 300;
    let server = Server::start(Settings { stream_window: 1024, ..Settings::default() }).await;
    let mut robot = Robot::connect(&server, "?mode=lossless&robot=wall-e").await;
    for seq in 0..N_FRAMES {
        robot.send(room(0, seq as u32)).await;
    }
    // It breaks off without having read anything.
    let info = async || -> RobotInfo {
        let info = success(server.get("/v1/robots/wall-e").send().await.unwrap()).await;
        serde_json::from_value(info).unwrap()
    };
    timeout(SOON, async { while info().await.state.frames.results < N_FRAMES {} }).await.unwrap();
    let session = robot.hello.session.clone();
    drop(robot);
    let mut robot = Robot::connect(&server, &format!("?session={session}")).await;
    assert_eq!((robot.hello.resumed, robot.hello.next_seq), (true, N_FRAMES));
    for seq in 0..N_FRAMES {
        assert_eq!(result(robot.next().await).seq, seq);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_that_broke_off_give_way_and_come_back_only_as_new_ones() {
    let server = Server::start(Settings { max_streams: 3, ..Settings::default() }).await;
    let first = Robot::connect(&server, "?robot=first").await;
    let second = Robot::connect(&server, "?robot=second").await;
    let stays = Robot::connect(&server, "?robot=stays").await;
    assert_eq!(closed_at_the_door(&server, "?robot=late").await, 1013);
    let sessions = [&first, &second].map(|robot| robot.hello.session.clone());
    drop(second);
    broke(&server, "second").await;
    drop(first);
    broke(&server, "first").await;
    let _late = Robot::connect(&server, "?robot=late").await;
    // The one that broke first has given way.
    let back = Robot::connect(&server, &format!("?robot=first&session={}", sessions[0])).await;
    assert!(back.hello.resumed);
    assert_eq!(closed_at_the_door(&server, &format!("?robot=second&session={}", sessions[1])).await, 1013);
    drop(stays);
    broke(&server, "stays").await;
    let anew = Robot::connect(&server, &format!("?robot=second&session={}", sessions[1])).await;
    assert!(!anew.hello.resumed);
}

#[tokio::test(flavor = "multi_thread")]
async fn one_name_cannot_fill_the_places() {
    let settings = Settings { max_streams: 6, max_streams_per_caller: 2, ..Settings::default() };
    let server = Server::start(settings).await;
    let _one = Robot::connect(&server, "?robot=eve").await;
    let two = Robot::connect(&server, "?robot=eve").await;
    assert_eq!(closed_at_the_door(&server, "?robot=eve").await, 1013);
    let _other = Robot::connect(&server, "?robot=wall-e").await;
    let stream = two.hello.stream.clone();
    drop(two);
    broke(&server, &stream).await;
    let _three = Robot::connect(&server, "?robot=eve").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_is_resumed_with_what_opened_it_and_its_session_is_shown_to_nobody() {
    let keys: Vec<_> = [(Role::Robot, 1), (Role::Admin, 2)]
        .map(|(role, seed)| Key::new(role, "boss", &[seed; 32]).unwrap())
        .into();
    let [robots, admins] = [&keys[0].0, &keys[1].0].map(|secret| format!("Bearer {secret}"));
    let keys = keys.into_iter().map(|(_, key)| key).collect();
    let server = Server::start(Settings { keys, ..Settings::default() }).await;
    let connect = async |query: &str, bearer: &str| {
        Robot::try_connect(&server, query, &[("authorization", bearer)]).await.unwrap()
    };
    let robot = connect("?mode=lossless", &admins).await;
    let (session, stream) = (robot.hello.session.clone(), robot.hello.stream.clone());
    let list = server.get("/v1/robots").header("authorization", &admins).send().await.unwrap();
    let list: Value = success(list).await;
    assert_eq!(list["robots"][0]["stream"], stream.as_str());
    assert!(!list.to_string().contains(&session), "{list}");
    for (query, bearer) in [(&stream, &admins), (&session, &robots)] {
        let other = connect(&format!("?session={query}"), bearer).await;
        assert!(!other.hello.resumed && other.hello.session != session);
    }
    assert!(connect(&format!("?session={session}"), &admins).await.hello.resumed);
}
