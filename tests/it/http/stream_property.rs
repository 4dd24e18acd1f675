//! Whatever a robot does, each of its accepted frames is told once, in order.

use crate::http::robot::{Heard, Robot, in_parts, seq_of};
use crate::http::service::{Server, models, pgm, room, write_model};
use proptest::prelude::*;
use roomsight::settings::Settings;
use roomsight_protocol::header::Header;
use roomsight_protocol::stream::ServerMessage;
use std::time::Duration;
use tokio::time::{sleep, timeout};

/// What a robot, or an operator, may do.
#[derive(Clone, Debug)]
enum Act {
    Send(Frame),
    Say(&'static str),
    /// Hear one message, if one comes soon.
    Hear,
    Wait(u64),
    /// The connection breaks, and the robot comes back.
    Break,
    Activate(u8),
}

#[derive(Clone, Copy, Debug)]
enum Frame {
    Good(u8),
    /// With a header, which may say anything of the time.
    Dated(u64),
    InParts(u8),
    Large,
    Bad(u16),
}

fn act() -> impl Strategy<Value = Act> {
    let texts = [
        r#"{"type":"configure","mode":"latest"}"#,
        r#"{"type":"configure","mode":"lossless"}"#,
        r#"{"type":"configure","mode":"sampled","interval_ms":5}"#,
        r#"{"type":"configure","deadline_ms":1}"#,
        r#"{"type":"configure","deadline_ms":0}"#,
        r#"{"type":"configure","filter":false}"#,
        "no JSON",
    ];
    prop_oneof![
        6 => any::<u8>().prop_map(|shift| Act::Send(Frame::Good(shift))),
        2 => any::<u64>().prop_map(|stamp| Act::Send(Frame::Dated(stamp))),
        1 => any::<u8>().prop_map(|shift| Act::Send(Frame::InParts(shift))),
        1 => Just(Act::Send(Frame::Large)),
        2 => (0..3000_u16).prop_map(|n_bytes| Act::Send(Frame::Bad(n_bytes))),
        2 => prop::sample::select(texts.to_vec()).prop_map(Act::Say),
        3 => Just(Act::Hear),
        1 => (0..20_u64).prop_map(Act::Wait),
        1 => Just(Act::Break),
        1 => (1..=2_u8).prop_map(Act::Activate),
    ]
}

/// A robot's own account of its stream.
struct Account {
    robot: Robot,
    /// Frames that the service took in, and those sent since it last said how many these are.
    n_accepted: u64,
    /// The numbers that were told, in the order in which they were.
    told: Vec<u64>,
}

impl Account {
    fn note(&mut self, message: &ServerMessage) {
        self.told.extend(seq_of(message));
    }

    async fn perform(&mut self, act: Act, server: &Server) {
        match act {
            Act::Send(frame) => {
                match frame {
                    Frame::InParts(_) => self.robot.send_raw(&in_parts(&bytes(frame))).await,
                    Frame::Dated(stamp) => {
                        let header =
                            Header { seq: self.n_accepted, captured_at_ns: Some(stamp), ..Header::default() };
                        self.robot.send(header.join(&bytes(frame))).await;
                    }
                    _ => self.robot.send(bytes(frame)).await,
                }
                self.n_accepted += 1;
            }
            Act::Say(text) => self.robot.say(text).await,
            Act::Hear => {
                if let Ok(Heard::Message(message)) =
                    timeout(Duration::from_millis(10), self.robot.heard()).await
                {
                    self.note(&message);
                }
            }
            Act::Wait(ms) => sleep(Duration::from_millis(ms)).await,
            Act::Break => {
                let session = &self.robot.hello.session;
                let mut query = format!("?session={session}");
                if let Some(last) = self.told.last() {
                    query.push_str(&format!("&last_seq={last}"));
                }
                self.robot = Robot::connect(server, &query).await;
                assert!(self.robot.hello.resumed);
                self.n_accepted = self.robot.hello.next_seq;
            }
            Act::Activate(version) => {
                let path = format!("/v1/models/lab/versions/{version}/activate");
                let answer = server.post(&path, vec![]).send().await.unwrap();
                // Another robot's operator may be faster.
                assert!([200, 409].contains(&answer.status().as_u16()), "{answer:?}");
            }
        }
    }
}

fn bytes(frame: Frame) -> Vec<u8> {
    match frame {
        Frame::Good(shift) | Frame::InParts(shift) => room(u32::from(shift) % 3, u32::from(shift)),
        Frame::Dated(stamp) => room((stamp % 3) as u32, (stamp % 97) as u32),
        Frame::Large => pgm(640, 480, |column, row| (column / 9 * 57 + row / 7 * 91) as u8),
        // Never the beginning of a header.
        Frame::Bad(n_bytes) => vec![b'x'; usize::from(n_bytes)],
    }
}

async fn told_by_a_stream_of(acts: Vec<Act>, server: &Server) -> (Vec<u64>, u64) {
    let robot = Robot::connect(server, "").await;
    let mut account = Account { robot, n_accepted: 0, told: Vec::new() };
    for act in acts {
        account.perform(act, server).await;
    }
    while account.told.last().is_none_or(|&last| last + 1 < account.n_accepted) && account.n_accepted > 0 {
        let message = account.robot.next().await;
        account.note(&message);
    }
    (account.told, account.n_accepted)
}

#[test]
fn each_accepted_frame_is_told_once_and_in_order() {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let folder = models();
    write_model(&folder.path().join("lab/2"));
    // Memory is short: two large frames are more than there is.
    let max_bytes = 320_000;
    let settings = Settings {
        models: folder.path().to_owned(),
        threads: 2,
        max_frame_bytes: max_bytes,
        max_batch_bytes: max_bytes,
        max_buffered_bytes: max_bytes,
        ..Settings::default()
    };
    let server = runtime.block_on(Server::of(settings));
    let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig {
        cases: 24,
        failure_persistence: None,
        ..ProptestConfig::default()
    });
    let streams = prop::collection::vec(prop::collection::vec(act(), 1..50), 1..4);
    let result = runner.run(&streams, |streams| {
        let told = runtime.block_on(async {
            futures_util::future::join_all(streams.into_iter().map(|acts| told_by_a_stream_of(acts, &server)))
                .await
        });
        for (told, n_accepted) in told {
            prop_assert_eq!(told, (0..n_accepted).collect::<Vec<_>>());
        }
        Ok(())
    });
    result.unwrap();
}
