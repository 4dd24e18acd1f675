//! Streams that pass from one service to another, by what their robots keep of them.

use crate::http::command::Running;
use crate::http::robot::{Robot, result};
use crate::http::service::{SOON, Server, client, known_room, models, room, write_model, write_other_model};
use roomsight::access::{Key, Role};
use roomsight::settings::Settings;
use roomsight_client::{Client, LastingStream};
use roomsight_protocol::header::Header;
use roomsight_protocol::stream::{Configure, DropReason, FilterChange, Mode, ServerMessage, StreamResult};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tempfile::TempDir;
use tokio::io::copy_bidirectional;
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{sleep, timeout};

const KEY: &str = "0123456789abcdef0123456789abcdef";
const NEWER_KEY: &str = "fedcba9876543210fedcba9876543210";

fn settings(resume_keys: &[&str]) -> Settings {
    Settings { resume_keys: resume_keys.iter().map(|&key| key.into()).collect(), ..Settings::default() }
}

/// Frames half a second apart, of which some look like another room.
async fn drive(robot: &mut Robot, seqs: std::ops::Range<u64>) -> Vec<StreamResult> {
    let mut results = Vec::new();
    for seq in seqs {
        let header = Header {
            seq,
            captured_at_ns: Some(1_800_000_000_000_000_000 + seq * 500_000_000),
            ..Header::default()
        };
        let frame = if seq % 5 == 3 { room(1, seq as u32) } else { known_room(0) };
        robot.send(header.join(&frame)).await;
        results.push(result(robot.next().await));
    }
    results
}

/// Where a robot goes on that has this answer, and has sent so much.
fn place(last: &StreamResult, sent_seq: u64) -> String {
    format!("?last_seq={}&sent_seq={sent_seq}&resume={}", last.seq, last.resume.as_ref().unwrap())
}

/// How often streams were taken over, or refused.
async fn takeovers(url: &str, outcome: &str) -> u64 {
    let text = client().get(format!("{url}/metrics")).send().await.unwrap().text().await.unwrap();
    let name = format!("roomsight_stream_takeovers_total{{outcome=\"{outcome}\"}} ");
    text.lines().find_map(|line| line.strip_prefix(&name)).unwrap().parse().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_goes_on_elsewhere_as_if_nothing_had_happened() {
    let undisturbed = Server::start_sure(settings(&[])).await;
    let mut robot = Robot::connect(&undisturbed, "?mode=lossless").await;
    let expected = drive(&mut robot, 0..12).await;
    let mut told = Vec::new();
    // While keys are exchanged, one service after the other.
    let mut query = "?mode=lossless&robot=wall-e&top=2".to_owned();
    for (part, keys) in [&[KEY][..], &[NEWER_KEY, KEY], &[NEWER_KEY]].into_iter().enumerate() {
        let server = Server::start_sure(settings(keys)).await;
        let mut robot = Robot::connect(&server, &query).await;
        assert_eq!((robot.hello.resumed, robot.hello.next_seq), (part > 0, told.len() as u64));
        assert_eq!(robot.hello.filter, (part > 0).then_some(FilterChange::Kept));
        let settings = &robot.hello.settings;
        assert_eq!(
            (settings.mode, settings.robot.as_deref(), settings.top),
            (Mode::Lossless, Some("wall-e"), Some(2))
        );
        let next = robot.hello.next_seq;
        told.extend(drive(&mut robot, next..next + 4).await);
        query = place(told.last().unwrap(), next + 3);
        assert_eq!(takeovers(&server.url, "done").await, u64::from(part > 0));
    }
    for (told, expected) in told.iter().zip(&expected) {
        let [told, expected] = [told, expected].map(|result| result.filtered.as_ref().unwrap());
        assert_eq!((&told.room, told.known), (&expected.room, expected.known));
        assert_eq!((told.probability, told.novelty), (expected.probability, expected.novelty), "bit for bit");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_that_no_answer_came_to_are_lost() {
    let [one, other] = [Server::start(settings(&[KEY])).await, Server::start(settings(&[KEY])).await];
    let mut robot = Robot::connect(&one, "?mode=lossless").await;
    let begun = robot.hello.resume.clone().unwrap();
    let results = drive(&mut robot, 0..3).await;
    // All three were answered, but the last two answers did not arrive, and two more frames were sent.
    let mut robot = Robot::connect(&other, &place(&results[0], 4)).await;
    assert_eq!(robot.hello.next_seq, 5);
    for lost in 1..5 {
        assert_eq!(robot.next().await, ServerMessage::Dropped { seq: lost, reason: DropReason::Lost });
    }
    assert_eq!(drive(&mut robot, 5..6).await[0].seq, 5);
    // Before the first answer there is the one of `hello`.
    let mut robot = Robot::connect(&other, &format!("?sent_seq=0&resume={begun}")).await;
    assert_eq!((robot.hello.next_seq, robot.hello.settings.mode), (1, Mode::Lossless));
    assert_eq!(robot.next().await, ServerMessage::Dropped { seq: 0, reason: DropReason::Lost });
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_not_sealed_for_the_caller_begins_anew() {
    let keys: Vec<_> = [1, 2].map(|seed| Key::new(Role::Robot, "wall-e", &[seed; 32]).unwrap()).into();
    let bearers = [0, 1].map(|idx: usize| format!("Bearer {}", keys[idx].0));
    let with_key =
        |idx: usize, resume: &[&str]| Settings { keys: vec![keys[idx].1.clone()], ..settings(resume) };
    let connect = async |server: &Server, query: &str, idx: usize| {
        Robot::try_connect(server, query, &[("authorization", &bearers[idx])]).await.unwrap()
    };
    let one = Server::start(with_key(0, &[KEY])).await;
    let mut robot = connect(&one, "?mode=lossless", 0).await;
    let last = drive(&mut robot, 0..2).await.pop().unwrap();
    let token = last.resume.clone().unwrap();
    let changed = token.replacen(|c: char| c.is_ascii_lowercase(), "A", 3);
    let of_other_caller = Server::start(with_key(1, &[KEY])).await;
    let of_other_key = Server::start(with_key(0, &[NEWER_KEY])).await;
    let impatient = Server::start(Settings { resume_token_ms: 0, ..with_key(0, &[KEY]) }).await;
    sleep(Duration::from_millis(5)).await;
    for (server, token, idx) in [
        (&of_other_caller, token.as_str(), 1),
        (&of_other_key, &token, 0),
        (&impatient, &token, 0),
        (&one, &changed, 0),
        (&one, "nonsense", 0),
    ] {
        let robot =
            connect(server, &format!("?mode=sampled&interval_ms=9&last_seq=1&resume={token}"), idx).await;
        assert_eq!((robot.hello.resumed, robot.hello.next_seq, robot.hello.filter), (false, 0, None));
        assert_eq!(robot.hello.settings.mode, Mode::Sampled, "as it asks for");
    }
    assert!(connect(&one, &place(&last, 1), 0).await.hello.resumed);
}

#[tokio::test(flavor = "multi_thread")]
async fn another_model_of_other_rooms_begins_its_filter_anew() {
    let one = Server::start(settings(&[KEY])).await;
    let mut robot = Robot::connect(&one, "?mode=lossless").await;
    let last = drive(&mut robot, 0..2).await.pop().unwrap();
    let models = TempDir::new().unwrap();
    write_other_model(&models.path().join("lab/1"));
    let other = Server::of(Settings { models: models.path().to_owned(), ..settings(&[KEY]) }).await;
    let robot = Robot::connect(&other, &place(&last, 1)).await;
    assert_eq!((robot.hello.resumed, robot.hello.filter), (true, Some(FilterChange::Reset)));
    assert_eq!(robot.hello.rooms, ["x", "y", "z"]);
    let elsewhere = TempDir::new().unwrap();
    write_model(&elsewhere.path().join("attic/1"));
    let other = Server::of(Settings { models: elsewhere.path().to_owned(), ..settings(&[KEY]) }).await;
    let query = format!("{}&model=attic", place(&last, 1));
    let robot = Robot::connect(&other, &query).await;
    assert_eq!((robot.hello.resumed, robot.hello.settings.model.as_str()), (false, "attic"));
    let refused = Robot::connect(&other, "?resume=nonsense").await;
    assert!(!refused.hello.resumed);
    assert_eq!(takeovers(&other.url, "refused").await, 2);
}

/// Passes connections on to the services that stand, each to the next.
struct Balancer {
    url: String,
    services: Arc<Mutex<Vec<String>>>,
}

impl Balancer {
    async fn before(services: Vec<String>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let services = Arc::new(Mutex::new(services));
        let behind = services.clone();
        tokio::spawn(async move {
            loop {
                let (mut caller, _) = listener.accept().await.unwrap();
                let mut addresses = behind.lock().unwrap().clone();
                behind.lock().unwrap().rotate_left(1);
                tokio::spawn(async move {
                    while let Some(address) = addresses.pop() {
                        if let Ok(mut service) = TcpStream::connect(address).await {
                            let _ = copy_bidirectional(&mut caller, &mut service).await;
                            return;
                        }
                    }
                });
            }
        });
        Self { url, services }
    }

    fn replace(&self, gone: &str, by: &str) {
        let mut services = self.services.lock().unwrap();
        services.iter_mut().filter(|service| *service == gone).for_each(|service| by.clone_into(service));
    }
}

/// What became of a robot's frames: how many were answered, dropped for a reason of its own, and lost.
#[derive(Debug, Default)]
struct Endings {
    n_results: u64,
    n_superseded: u64,
    n_lost: u64,
    /// Streams that began with a filter that knows nothing.
    n_begun_anew: u64,
    /// By another service.
    n_taken_over: u64,
}

/// What each robot sends.
const N_FRAMES: u64 = 60;

async fn lasting_drive(url: String, idx: u32) -> Endings {
    let mode = if idx.is_multiple_of(2) { Mode::Lossless } else { Mode::Latest };
    let configure =
        Configure { robot: Some(format!("robot-{idx}")), mode: Some(mode), ..Configure::default() };
    let client = Client::new(&url, None).unwrap();
    let mut stream: LastingStream = client.lasting_stream(&configure, SOON).await.unwrap();
    let mut endings = Endings::default();
    let (mut session, mut next) = (stream.hello().session.clone(), 0);
    for n_sent in 1..=N_FRAMES {
        stream.send(&room(idx % 3, n_sent as u32), None).await.unwrap();
        // Some answers are under way when the service is killed.
        let n_open = if n_sent == N_FRAMES { 0 } else { 3 };
        while n_sent - (endings.n_results + endings.n_superseded + endings.n_lost) > n_open {
            let seq = match stream.receive().await.unwrap() {
                ServerMessage::Result(result) => {
                    endings.n_results += 1;
                    result.seq
                }
                ServerMessage::Dropped { seq, reason: DropReason::Lost } => {
                    endings.n_lost += 1;
                    seq
                }
                ServerMessage::Dropped { seq, .. } => {
                    endings.n_superseded += 1;
                    seq
                }
                _ => continue,
            };
            assert!(seq >= next, "frame {seq} is told twice or out of order");
            next = seq + 1;
        }
        if stream.hello().session != session {
            session.clone_from(&stream.hello().session);
            let is_taken_over = stream.hello().resumed;
            endings.n_taken_over += u64::from(is_taken_over);
            endings.n_begun_anew += u64::from(!is_taken_over);
        }
        sleep(Duration::from_millis(15)).await;
    }
    endings
}

#[tokio::test(flavor = "multi_thread")]
async fn while_services_are_killed_and_stopped_every_frame_has_one_ending_and_no_filter_is_lost() {
    const N_ROBOTS: u32 = 8;
    let models = models();
    let folder = models.path().to_str().unwrap().to_owned();
    let start = move || {
        let set = format!("resume_keys={KEY}");
        Running::start(&["--models", &folder, "--set", &set, "--set", "max_streams_per_caller=64"])
    };
    let address = |service: &Running| service.url.strip_prefix("http://").unwrap().to_owned();
    let mut services = [start(), start()];
    let balancer = Balancer::before(services.iter().map(address).collect()).await;
    let robots: Vec<_> =
        (0..N_ROBOTS).map(|idx| tokio::spawn(lasting_drive(balancer.url.clone(), idx))).collect();
    let disturb = async {
        for (turn, is_kill) in [true, false, true, true].into_iter().enumerate() {
            sleep(Duration::from_millis(150)).await;
            let service = &mut services[turn % 2];
            let gone = address(service);
            if is_kill {
                // It hangs first, so that frames are under way to it for sure.
                service.signal("STOP");
                sleep(Duration::from_millis(60)).await;
                service.kill();
            } else {
                drop(service.stop());
            }
            *service = start();
            balancer.replace(&gone, &address(service));
        }
    };
    timeout(2 * SOON, disturb).await.unwrap();
    let mut all = Endings::default();
    for robot in robots {
        let endings = timeout(2 * SOON, robot).await.unwrap().unwrap();
        all.n_results += endings.n_results;
        all.n_superseded += endings.n_superseded;
        all.n_lost += endings.n_lost;
        all.n_begun_anew += endings.n_begun_anew;
        all.n_taken_over += endings.n_taken_over;
    }
    let n_told = all.n_results + all.n_superseded + all.n_lost;
    assert_eq!((n_told, all.n_begun_anew), (u64::from(N_ROBOTS) * N_FRAMES, 0), "{all:?}");
    assert!(all.n_lost > 0, "the kills cost something: {all:?}");
    // By the robots: the services that took most of them over are killed too.
    assert!(all.n_taken_over > 0, "{all:?}");
    for service in &services {
        assert_eq!(takeovers(&service.url, "refused").await, 0);
    }
}
