//! Streams over real WebSockets.

use crate::http::load::{one_thread, slow_frame, very_slow_frame};
use crate::http::robot::{Heard, Robot, closed_at_the_door, result, seq_of};
use crate::http::service::{SOON, Server, frame, models, problem, room, success, write_model};
use roomsight::access::{Key, Role};
use roomsight::settings::Settings;
use roomsight_protocol::event::RobotInfo;
use roomsight_protocol::header::{Header, MAX_SEQ};
use roomsight_protocol::stream::{
    Configure, DropReason, FilterChange, FilterChoice, FilterSettings, Mode, NoticeKind, ServerMessage,
    StreamResult,
};
use std::io::Write;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tokio::time::{sleep, timeout};
use tokio_tungstenite::tungstenite;

pub fn error(message: &ServerMessage) -> (Option<u64>, &str) {
    match message {
        ServerMessage::Error { seq, problem } => (*seq, problem.r#type.strip_prefix("/problems/").unwrap()),
        other => panic!("{other:?}"),
    }
}

fn detail(message: ServerMessage) -> String {
    match message {
        ServerMessage::Error { problem, .. } => problem.detail,
        other => panic!("{other:?}"),
    }
}

/// The status of a refused stream.
async fn refused(server: &Server, query: &str, headers: &[(&'static str, &str)]) -> u16 {
    match Robot::try_connect(server, query, headers).await {
        Err(tungstenite::Error::Http(response)) => response.status().as_u16(),
        Err(error) => panic!("{error}"),
        Ok(_) => panic!("the stream begins"),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn bare_frames_are_numbered_and_answered_in_order() {
    let server = Server::start(Settings::default()).await;
    let mut robot = Robot::connect(&server, "?mode=lossless&robot=wall-e&top=2").await;
    assert_eq!((robot.hello.next_seq, robot.hello.resumed), (0, false));
    assert_eq!(robot.hello.rooms, ["bars", "dots", "stripes"]);
    assert_eq!(robot.hello.settings.robot.as_deref(), Some("wall-e"));
    let rooms = ["stripes", "bars", "dots"];
    for seq in 0..30 {
        robot.send(room(seq % 3, 5)).await;
    }
    for seq in 0..30 {
        let StreamResult { seq: told, answer, filtered, age_ms, notice, resume } = result(robot.next().await);
        assert_eq!((notice, resume), (None, None), "without keys nothing is sealed");
        assert_eq!((told, answer.room.as_str()), (seq, rooms[seq as usize % 3]));
        assert_eq!((answer.probabilities.len(), answer.robot.as_deref()), (2, Some("wall-e")));
        assert_eq!(answer.request_id, robot.hello.stream);
        assert!(filtered.is_some() && age_ms.is_none());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_newer_frame_takes_the_place_of_one_that_waits() {
    let server = one_thread(0).await;
    let mut robot = Robot::connect(&server, "").await;
    robot.send(very_slow_frame()).await;
    for seq in 1..20 {
        robot.send(room(0, seq)).await;
    }
    let mut told = Vec::new();
    let mut n_superseded = 0;
    while told.len() < 20 {
        let message = robot.next().await;
        told.push(seq_of(&message).unwrap());
        n_superseded += usize::from(
            matches!(message, ServerMessage::Dropped { reason, .. } if reason == DropReason::Superseded),
        );
        if told.len() == 20 {
            assert_eq!(result(message).seq, 19, "the newest is never superseded");
        }
    }
    assert_eq!(told, (0..20).collect::<Vec<_>>());
    assert!(n_superseded > 0, "while the first was decoded, newer ones came");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_holds_a_bounded_number_of_bytes() {
    let server = Server::start(Settings { threads: 1, max_stream_bytes: 1, ..Settings::default() }).await;
    let mut robot = Robot::connect(&server, "").await;
    robot.send(slow_frame()).await;
    for shift in 1..6 {
        robot.send(room(0, shift)).await;
    }
    // Read one by one, none finds another waiting whose place it could take.
    for seq in 0..6 {
        assert_eq!(result(robot.next().await).seq, seq);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_header_numbers_and_dates_a_frame() {
    let server = Server::start(Settings::default()).await;
    let mut robot = Robot::connect(&server, "?mode=lossless").await;
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap() - Duration::from_secs(2);
    let header = Header { seq: 41, captured_at_ns: Some(now.as_nanos() as u64), ..Header::default() };
    robot.send(header.join(&frame())).await;
    let first = result(robot.next().await);
    assert_eq!(first.seq, 41);
    assert!((2000.0..60_000.0).contains(&first.age_ms.unwrap()), "{:?}", first.age_ms);
    robot.send(frame()).await;
    assert_eq!(result(robot.next().await).seq, 42, "a bare frame goes on from there");
    for late in [Header { seq: 42, ..Header::default() }, Header { seq: u64::MAX, ..Header::default() }] {
        robot.send(late.join(&frame())).await;
        assert_eq!(error(&robot.next().await), (None, "bad-request"));
    }
    robot.send(b"RSF1 cut".to_vec()).await;
    assert_eq!(error(&robot.next().await), (None, "bad-request"));
    robot.send(frame()).await;
    assert_eq!(result(robot.next().await).seq, 43);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_number_that_leaves_none_for_others_is_refused_with_one_that_can_be_given() {
    let server = Server::start(Settings::default()).await;
    let mut robot = Robot::connect(&server, "?mode=lossless").await;
    let numbered = |seq| Header { seq, ..Header::default() }.join(&frame());
    for (next, seq) in (0..).zip([u64::MAX, u64::MAX - 1, MAX_SEQ + 1]) {
        robot.send(numbered(seq)).await;
        let told = detail(robot.next().await);
        assert!(told.contains(&format!("from {next} to {MAX_SEQ}")), "{told}");
        robot.send(frame()).await;
        assert_eq!(result(robot.next().await).seq, next);
    }
    robot.send(numbered(MAX_SEQ)).await;
    assert_eq!(result(robot.next().await).seq, MAX_SEQ);
    robot.send(numbered(MAX_SEQ)).await;
    let told = detail(robot.next().await);
    assert!(told.contains("without a header"), "{told}");
    robot.send(frame()).await;
    assert_eq!(result(robot.next().await).seq, MAX_SEQ + 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn stamps_that_do_not_advance_are_told_once_and_the_filter_lets_go() {
    let server = Server::start(Settings::default()).await;
    let stamps: [fn(u64) -> u64; 3] =
        [|_| 0, |_| 1_800_000_000_000_000_000, |seq| (1 << 60) - seq * 1_000_000];
    for stamp in stamps {
        let mut robot = Robot::connect(&server, "?mode=lossless").await;
        let mut told = Vec::new();
        for seq in 0..40 {
            let room_idx = u32::from(seq >= 12);
            let header = Header { seq, captured_at_ns: Some(stamp(seq)), ..Header::default() };
            robot.send(header.join(&room(room_idx, seq as u32))).await;
            told.push(result(robot.next().await));
        }
        let first = told.iter().position(|result| result.notice.is_some());
        assert_eq!(first, Some(1), "with the first frame whose stamp does not advance");
        assert_eq!(told.iter().filter(|result| result.notice.is_some()).count(), 1);
        assert_eq!(told[1].notice.as_ref().unwrap().kind, NoticeKind::Stamps);
        assert_eq!(told[39].filtered.as_ref().unwrap().room, "bars");
        assert!(told.iter().all(|result| result.age_ms.is_none()), "such an age would mean nothing");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_used_is_answered_and_the_stream_lives() {
    let server = Server::start(Settings { max_frame_pixels: 100_000, ..Settings::default() }).await;
    let mut robot = Robot::connect(&server, "?mode=lossless").await;
    robot.send(b"no image".to_vec()).await;
    assert_eq!(error(&robot.next().await), (Some(0), "not-an-image"));
    robot.send(Vec::new()).await;
    assert_eq!(error(&robot.next().await), (Some(1), "bad-request"));
    robot.send(slow_frame()).await;
    assert_eq!(error(&robot.next().await), (Some(2), "too-large"));
    for text in ["/9j/4AAQSkZJRg", r#"{"type":"configure","mood":"good"}"#, "", &"/9j/4AAQ".repeat(20_000)] {
        robot.say(text).await;
        let told = robot.next().await;
        assert!(matches!(error(&told), (None, "bad-request")), "{told:?}");
        let detail = detail(told);
        assert!(detail.contains("frames are binary messages") || text.starts_with('{'), "{detail}");
    }
    robot.send(frame()).await;
    assert_eq!(result(robot.next().await).seq, 3);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_message_that_is_too_long_or_none_closes_its_stream_alone() {
    let server = Server::start(Settings { max_frame_bytes: 50_000, ..Settings::default() }).await;
    let mut robot = Robot::connect(&server, "").await;
    let mut other = Robot::connect(&server, "").await;
    robot.send(vec![0; 1 << 20]).await;
    assert!(matches!(robot.heard().await, Heard::Closed(Some(1009))));
    // Masked with zeros: a JPEG sent as text; a frame without a mask; a reserved bit; a close with half a code.
    for (bytes, code) in [
        (&[0x81, 0x83, 0, 0, 0, 0, 0xff, 0xd8, 0xff][..], 1007),
        (&[0x82, 0x01, 0], 1002),
        (&[0xc2, 0x81, 0, 0, 0, 0, 0], 1002),
        (&[0x88, 0x81, 0, 0, 0, 0, 0], 1002),
    ] {
        let mut wrong = Robot::connect(&server, "").await;
        wrong.send_raw(bytes).await;
        let heard = wrong.heard().await;
        assert!(matches!(heard, Heard::Closed(Some(told)) if told == code), "{bytes:?}: {heard:?}");
    }
    other.send(frame()).await;
    assert_eq!(result(other.next().await).seq, 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_is_configured_while_it_runs() {
    let server = Server::start(Settings::default()).await;
    let mut robot = Robot::connect(&server, "").await;
    let change = Configure {
        robot: Some("wall-e".into()),
        mode: Some(Mode::Lossless),
        filter: Some(FilterChoice::Switch(false)),
        top: Some(1),
        explain: Some(true),
        ..Configure::default()
    };
    let ServerMessage::Configured { settings } = robot.configure(change).await else { panic!() };
    assert_eq!((settings.mode, settings.filter, settings.top), (Mode::Lossless, None, Some(1)));
    robot.send(frame()).await;
    let told = result(robot.next().await);
    assert!(told.filtered.is_none() && told.answer.probabilities.len() == 1);
    assert_eq!(told.answer.nearest.unwrap()[0].room, told.answer.room);
    let filter = Some(FilterChoice::With(FilterSettings { trust: 0.5 }));
    let change = Configure { filter, top: Some(0), explain: Some(false), ..Configure::default() };
    let ServerMessage::Configured { settings } = robot.configure(change).await else { panic!() };
    assert_eq!(settings.robot.as_deref(), Some("wall-e"), "what is left out stays");
    robot.send(frame()).await;
    let told = result(robot.next().await);
    assert_eq!((told.answer.evidence, told.answer.nearest), (None, None));
    let sum: f32 = told.filtered.unwrap().probabilities.iter().map(|room| room.probability).sum();
    assert!((sum - 1.0).abs() < 1e-4 && told.answer.probabilities.len() == 3);
    let wrong = [
        Configure { mode: Some(Mode::Sampled), ..Configure::default() },
        Configure { interval_ms: Some(10), ..Configure::default() },
        Configure { sure_interval_ms: Some(10), ..Configure::default() },
        Configure { robot: Some("x".repeat(65)), ..Configure::default() },
        Configure { filter: Some(FilterChoice::With(FilterSettings { trust: 0.0 })), ..Configure::default() },
    ];
    for change in wrong {
        assert_eq!(error(&robot.configure(change).await), (None, "bad-request"));
    }
    let change = Configure { model: Some("garden".into()), ..Configure::default() };
    assert_eq!(error(&robot.configure(change).await), (None, "no-such-model"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_frame_whose_deadline_passes_is_dropped() {
    let server = one_thread(0).await;
    let mut busy = Robot::connect(&server, "?mode=lossless").await;
    for _ in 0..4 {
        busy.send(slow_frame()).await;
    }
    let mut robot = Robot::connect(&server, "?deadline_ms=1").await;
    for seq in 0.. {
        // Until the slow frames have arrived, these are in time.
        robot.send(frame()).await;
        if let ServerMessage::Dropped { seq: told, reason } = robot.next().await {
            assert_eq!((told, reason), (seq, DropReason::Deadline));
            break;
        }
        assert!(seq < 1000);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn who_may_stream_is_told_before_the_stream_begins() {
    let (robot_secret, robot_key) = Key::new(Role::Robot, "wall-e", &[1; 32]).unwrap();
    let (viewer_secret, viewer_key) = Key::new(Role::Viewer, "screen", &[2; 32]).unwrap();
    let server = Server::start(Settings { keys: vec![robot_key, viewer_key], ..Settings::default() }).await;
    assert_eq!(refused(&server, "", &[]).await, 401);
    let offer = |secret: &str| format!("roomsight.v1, key.{secret}");
    assert_eq!(refused(&server, "", &[("sec-websocket-protocol", &offer(&viewer_secret))]).await, 403);
    let bearer = format!("Bearer {robot_secret}");
    for header in [("authorization", bearer.as_str()), ("sec-websocket-protocol", &offer(&robot_secret))] {
        let mut robot = Robot::try_connect(&server, "", &[header]).await.unwrap();
        assert_eq!(robot.hello.settings.robot.as_deref(), Some("wall-e"), "the key names it");
        robot.send(frame()).await;
        assert_eq!(result(robot.next().await).seq, 0);
    }
    let bearer = ("authorization", bearer.as_str());
    assert_eq!(refused(&server, "?mode=sampled", &[bearer]).await, 400);
    assert_eq!(refused(&server, "?model=garden", &[bearer]).await, 404);
    assert_eq!(refused(&server, "", &[bearer, ("sec-websocket-protocol", "mqtt")]).await, 426);

    let open = Server::start(Settings::default()).await;
    assert_eq!(refused(&open, "", &[("origin", "http://evil.example")]).await, 403);
    problem(open.get("/v1/stream").send().await.unwrap(), 426, "no-websocket").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn further_streams_are_told_to_come_back() {
    let server = Server::start(Settings { max_streams: 1, ..Settings::default() }).await;
    let first = Robot::connect(&server, "").await;
    assert_eq!(closed_at_the_door(&server, "").await, 1013);
    drop(first);
    let server = Server::start(Settings::default()).await;
    server.post("/v2/repository/models/lab/unload", vec![]).send().await.unwrap().error_for_status().unwrap();
    assert_eq!(closed_at_the_door(&server, "").await, 1013, "no model serves");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_hears_from_which_frame_on_another_version_answers() {
    let folder = models();
    write_model(&folder.path().join("lab/2"));
    let server = Server::of(Settings { models: folder.path().to_owned(), ..Settings::default() }).await;
    let mut robot = Robot::connect(&server, "?mode=lossless").await;
    robot.send(frame()).await;
    assert_eq!(result(robot.next().await).answer.model.version, 2);
    let activated =
        success(server.post("/v1/models/lab/versions/1/activate", vec![]).send().await.unwrap()).await;
    assert_eq!((activated["epoch"].as_u64(), &activated["labels"][0]), (Some(2), &"stable".into()));
    robot.send(frame()).await;
    let ServerMessage::ModelChanged(changed) = robot.next().await else { panic!() };
    assert_eq!((changed.from.version, changed.to.version, changed.epoch), (2, 1, 2));
    assert_eq!((changed.first_seq, changed.filter), (1, FilterChange::Kept));
    let told = result(robot.next().await);
    assert_eq!((told.seq, told.answer.model.version, told.answer.model.epoch), (1, 1, 2));
    let missing = server.post("/v1/models/lab/versions/9/activate", vec![]).send().await.unwrap();
    problem(missing, 404, "no-such-model").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_answers_or_drops_what_was_accepted_and_closes() {
    let mut server = one_thread(0).await;
    let mut robots = Vec::new();
    for mode in ["lossless", "latest"] {
        let mut robot = Robot::connect(&server, &format!("?mode={mode}&robot={mode}")).await;
        for _ in 0..6 {
            robot.send(slow_frame()).await;
        }
        robots.push(robot);
    }
    let n_accepted = async |robot: &str| {
        let info = success(server.get(&format!("/v1/robots/{robot}")).send().await.unwrap()).await;
        info["frames"]["accepted"].as_u64()
    };
    let all_in =
        async { while (n_accepted("lossless").await, n_accepted("latest").await) != (Some(6), Some(6)) {} };
    timeout(SOON, all_in).await.unwrap();
    server.stop();
    for mut robot in robots {
        let (told, code) = robot.rest().await;
        assert_eq!(code, Some(1001));
        assert!(told.iter().any(|message| matches!(message, ServerMessage::Draining)), "{told:?}");
        let seqs: Vec<u64> = told.iter().filter_map(seq_of).collect();
        assert_eq!(seqs, (0..6).collect::<Vec<_>>());
    }
    timeout(SOON, server.stopped()).await.expect("it ends when the streams have");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_that_never_reads_and_one_that_stops_halfway_disturb_nobody() {
    let settings = Settings {
        stream_ping_ms: 50,
        stream_idle_timeout_ms: 400,
        // Answers to pings come as bytes of the message that is not complete.
        stream_message_timeout_ms: 400,
        stream_write_timeout_ms: 300,
        stream_resume_ms: 1,
        ..Settings::default()
    };
    let server = Server::start(settings).await;
    let deaf = Robot::connect(&server, "?mode=lossless&robot=deaf").await;
    let mut half = Robot::connect(&server, "?robot=half").await;
    // A header that announces more bytes than ever come.
    let half_stream = half.socket.get_mut();
    tokio::io::AsyncWriteExt::write_all(half_stream, &[0x82, 0xfe, 0x40, 0, 1, 2, 3, 4, 0xff]).await.unwrap();
    let half = tokio::spawn(async move { half.heard().await });
    let mut deaf_stream = deaf.socket.into_inner().into_std().unwrap();
    deaf_stream.set_nonblocking(false).unwrap();
    deaf_stream.set_write_timeout(Some(Duration::from_millis(500))).unwrap();
    let bad = [0x82, 0x81, 0, 0, 0, 0, b'x'];
    let flood = tokio::task::spawn_blocking(move || {
        // Each is answered with an error that nobody reads, until the service has had enough.
        while deaf_stream.write_all(&bad.repeat(1000)).is_ok() {}
    });
    let mut robot = Robot::connect(&server, "?mode=lossless").await;
    for seq in 0..20 {
        robot.send(frame()).await;
        assert_eq!(result(robot.next().await).seq, seq);
    }
    timeout(SOON, flood).await.expect("it is cut off").unwrap();
    assert!(matches!(half.await.unwrap(), Heard::Closed(Some(1008))));
    let gone = async {
        loop {
            let robots = success(server.get("/v1/robots").send().await.unwrap()).await;
            let n_connected =
                robots["robots"].as_array().unwrap().iter().filter(|robot| robot["connected"] == true);
            if n_connected.count() <= 1 {
                return;
            }
            sleep(Duration::from_millis(20)).await;
        }
    };
    timeout(SOON, gone).await.expect("both are gone");
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_take_turns_however_many_frames_one_has() {
    let server = one_thread(0).await;
    let mut greedy = Robot::connect(&server, "?mode=lossless&robot=greedy").await;
    for _ in 0..12 {
        greedy.send(slow_frame()).await;
    }
    let greedy_info = async || -> RobotInfo {
        let info = success(server.get("/v1/robots/greedy").send().await.unwrap()).await;
        serde_json::from_value(info).unwrap()
    };
    timeout(SOON, async { while greedy_info().await.state.frames.accepted < 12 {} }).await.unwrap();
    let mut modest = Robot::connect(&server, "").await;
    let before = greedy_info().await.state.frames.results;
    modest.send(frame()).await;
    assert_eq!(result(modest.next().await).seq, 0);
    let after = greedy_info().await.state.frames.results;
    assert!(after - before <= 3, "{} frames of the other robot came first", after - before);
}

#[tokio::test(flavor = "multi_thread")]
async fn dashboards_see_who_streams_and_what_happens() {
    let server = Server::start(Settings::default()).await;
    let mut events = server.get("/v1/events").send().await.unwrap();
    assert_eq!(events.headers()["content-type"], "text/event-stream");
    let mut robot = Robot::connect(&server, "?mode=lossless&robot=wall-e").await;
    for shift in 0..3 {
        robot.send(room(1, shift)).await;
        result(robot.next().await);
    }
    let info = success(server.get("/v1/robots/wall-e").send().await.unwrap()).await;
    let info: RobotInfo = serde_json::from_value(info).unwrap();
    let RobotInfo { state, answers, .. } = info;
    assert_eq!((state.frames.accepted, state.frames.results, state.connected), (3, 3, true));
    assert_eq!((state.room.as_deref(), answers.len(), answers[0].seq), (Some("bars"), 3, 2));
    problem(server.get("/v1/robots/eve").send().await.unwrap(), 404, "not-found").await;
    success(server.post("/v1/recognize?robot=eve", frame()).send().await.unwrap()).await;
    drop(robot);
    let mut text = String::new();
    let read = async {
        while !text.contains("event: robot_left") {
            text.push_str(&String::from_utf8_lossy(&events.chunk().await.unwrap().unwrap()));
        }
    };
    timeout(SOON, read).await.expect("the events come");
    assert!(text.starts_with("event: robot_joined\ndata: {"), "{text}");
    assert_eq!(text.matches("event: answer\n").count(), 4, "{text}");
    assert!(text.contains(r#""robot":"eve""#) && text.contains(r#""room":"bars""#), "{text}");
}
