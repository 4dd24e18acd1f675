//! Streams of which few frames are looked at.

use crate::http::robot::{Robot, result, seq_of};
use crate::http::service::{Server, room};
use crate::http::stream::error;
use roomsight::settings::Settings;
use roomsight_protocol::stream::{Configure, FilterChoice, Mode, ServerMessage};

#[tokio::test(flavor = "multi_thread")]
async fn at_most_one_frame_an_interval_is_looked_at() {
    let server = Server::start(Settings::default()).await;
    let mut robot = Robot::connect(&server, "?mode=sampled&interval_ms=60000").await;
    for seq in 0..5 {
        robot.send(room(0, seq)).await;
        if seq == 0 {
            assert_eq!(result(robot.next().await).seq, 0);
        }
    }
    for seq in 1..4 {
        let told = robot.next().await;
        assert!(matches!(told, ServerMessage::Dropped { .. }) && seq_of(&told) == Some(seq), "{told:?}");
    }
    // The fifth waits for its time; with another mode it need not.
    let change = Configure { mode: Some(Mode::Latest), ..Configure::default() };
    assert!(matches!(robot.configure(change).await, ServerMessage::Configured { .. }));
    assert_eq!(result(robot.next().await).seq, 4);
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_of_a_robot_whose_room_is_sure_are_looked_at_less_often() {
    let server = Server::start(Settings::default()).await;
    let mut robot =
        Robot::connect(&server, "?mode=sampled&interval_ms=1&sure_interval_ms=60000&filter=true").await;
    let mut next_seq: u32 = 0;
    let mut is_sure = false;
    while !is_sure {
        robot.send(room(0, next_seq)).await;
        let told = result(robot.next().await);
        let filtered = told.filtered.unwrap();
        is_sure = filtered.known && told.answer.known && filtered.room == told.answer.room;
        next_seq += 1;
        assert!(next_seq < 100, "{filtered:?}");
    }
    for shift in 0..3 {
        robot.send(room(1, shift)).await;
    }
    let first = u64::from(next_seq);
    for seq in [first, first + 1] {
        let told = robot.next().await;
        assert!(matches!(told, ServerMessage::Dropped { .. }) && seq_of(&told) == Some(seq), "{told:?}");
    }
    let change = Configure { sure_interval_ms: Some(0), ..Configure::default() };
    let ServerMessage::Configured { settings } = robot.configure(change).await else { panic!("refused") };
    assert_eq!(settings.sure_interval_ms, None);
    assert_eq!(result(robot.next().await).seq, first + 2);
    let too_short = Configure { sure_interval_ms: Some(1), interval_ms: Some(2), ..Configure::default() };
    let unfiltered = FilterChoice::Switch(false);
    let unfiltered =
        Configure { sure_interval_ms: Some(9), filter: Some(unfiltered), ..Configure::default() };
    for change in [too_short, unfiltered] {
        assert_eq!(error(&robot.configure(change).await), (None, "bad-request"));
    }
}
