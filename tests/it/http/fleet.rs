//! Services that tell each other of their robots over NATS. Skipped, and said so, where its server is not installed.

use crate::http::command::free_address;
use crate::http::robot::{Robot, result};
use crate::http::service::{SOON, Server, known_room, problem, room, success};
use roomsight::settings::Settings;
use roomsight_protocol::event::{RobotInfo, RobotList};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use tokio::time::{sleep, timeout};

/// A server of NATS that runs.
struct Nats {
    child: Child,
    address: String,
}

impl Nats {
    async fn start_at(address: String) -> Option<Self> {
        let places = ["/usr/sbin/nats-server", "/usr/bin/nats-server", "/usr/local/bin/nats-server"];
        let Some(program) = places.into_iter().find(|place| Path::new(place).exists()) else {
            eprintln!(
                "LEFT OUT: services that tell each other. They take NATS, Debian's package nats-server."
            );
            return None;
        };
        let (host, port) = address.split_once(':').unwrap();
        let mut command = Command::new(program);
        command.args(["--addr", host, "--port", port, "--user", "rooms", "--pass", "s3cret"]);
        let child = command.stdin(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let nats = Self { child, address };
        let listens = async {
            while TcpStream::connect(&nats.address).is_err() {
                sleep(Duration::from_millis(20)).await;
            }
        };
        timeout(SOON, listens).await.expect("it listens");
        Some(nats)
    }

    fn settings(&self, name: &str) -> Settings {
        Settings {
            nats: format!("nats://rooms:s3cret@{}", self.address).as_str().into(),
            service_name: name.to_owned(),
            ..Settings::default()
        }
    }
}

impl Drop for Nats {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

async fn recognize(server: &Server, robot: &str, frame: Vec<u8>) {
    success(server.post(&format!("/v1/recognize?robot={robot}"), frame).send().await.unwrap()).await;
}

async fn robots(server: &Server, scope: &str) -> Vec<RobotInfo> {
    let answer = server.get(&format!("/v1/robots{scope}")).send().await.unwrap();
    serde_json::from_value::<RobotList>(success(answer).await).unwrap().robots
}

/// Who is where, as a service tells of its fleet: `id@service`, of its own robots `id@`.
async fn everybody(server: &Server) -> Vec<String> {
    let place = |robot: RobotInfo| {
        let state = robot.state;
        format!("{}@{}", state.who.id, state.service.unwrap_or_default())
    };
    robots(server, "?scope=fleet").await.into_iter().map(place).collect()
}

/// Waits until a service tells so of its fleet.
async fn until(server: &Server, wanted: &[&str]) {
    let is_so = async {
        while everybody(server).await != wanted {
            sleep(Duration::from_millis(50)).await;
        }
    };
    if timeout(SOON, is_so).await.is_err() {
        panic!("{:?} instead of {wanted:?}", everybody(server).await);
    }
}

/// The first piece of server-sent events that says this.
async fn hears(mut events: reqwest::Response, wanted: &str) -> String {
    let mut text = String::new();
    let read = async {
        while !text.contains(wanted) {
            text += std::str::from_utf8(&events.chunk().await.unwrap().expect("it goes on")).unwrap();
        }
    };
    timeout(SOON, read).await.expect("it is told soon");
    text
}

#[tokio::test(flavor = "multi_thread")]
async fn services_tell_each_other_of_their_robots() {
    let Some(nats) = Nats::start_at(free_address()).await else { return };
    let attic = Server::start_sure(nats.settings("attic")).await;
    let mut cellar = Server::start_sure(nats.settings("cellar")).await;
    recognize(&attic, "eve", known_room(0)).await;
    let mut stream = Robot::connect(&cellar, "?mode=lossless&robot=wall-e").await;
    stream.send(known_room(1)).await;
    result(stream.next().await);
    until(&attic, &["eve@", "wall-e@cellar"]).await;
    until(&cellar, &["eve@attic", "wall-e@"]).await;
    // As that service tells of it, without what it keeps to itself.
    let fleet = robots(&attic, "?scope=fleet").await;
    let [_, wall_e] = &fleet[..] else { panic!("{fleet:?}") };
    assert_eq!((wall_e.state.room.as_deref(), wall_e.state.frames.results), (Some("bars"), 1));
    assert!(wall_e.state.frame.is_none() && wall_e.answers.is_empty());
    assert_eq!(robots(&attic, "").await.len(), 1, "of itself it tells its own alone");
    let elsewhere = attic.get("/v1/robots/wall-e").send().await.unwrap();
    let detail = problem(elsewhere, 404, "not-found").await;
    assert!(detail["detail"].as_str().unwrap().contains("at the service cellar"), "{detail}");
    // What happens there is heard here, as is where its robots are.
    let events = attic.get("/v1/events?scope=fleet").send().await.unwrap();
    let live = attic.get("/v1/live?scope=fleet").send().await.unwrap();
    for shift in 0..3 {
        stream.send(room(0, shift)).await;
        result(stream.next().await);
    }
    recognize(&cellar, "auto", known_room(0)).await;
    hears(live, "\"id\":\"auto\"").await;
    drop(stream);
    let heard = hears(events, "robot_left").await;
    assert!(heard.contains("\"robot\":\"wall-e\""), "{heard}");
    // A robot is where it was last.
    recognize(&attic, "auto", known_room(0)).await;
    recognize(&attic, "wall-e", known_room(0)).await;
    until(&cellar, &["auto@attic", "eve@attic", "wall-e@attic"]).await;
    // One that stops says so.
    recognize(&cellar, "mo", known_room(0)).await;
    until(&attic, &["auto@", "eve@", "mo@cellar", "wall-e@"]).await;
    cellar.stop();
    cellar.stopped().await;
    until(&attic, &["auto@", "eve@", "wall-e@"]).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn they_hear_each_other_again_when_nats_comes_back() {
    let address = free_address();
    let Some(nats) = Nats::start_at(address.clone()).await else { return };
    let (attic, cellar) =
        (Server::start_sure(nats.settings("attic")).await, Server::start_sure(nats.settings("cellar")).await);
    recognize(&cellar, "eve", known_room(0)).await;
    until(&attic, &["eve@cellar"]).await;
    drop(nats);
    // Robots do not notice.
    recognize(&cellar, "mo", known_room(0)).await;
    let metrics = async |server: &Server| server.get("/metrics").send().await.unwrap().text().await.unwrap();
    let is_told = async {
        while !metrics(&attic).await.contains("roomsight_nats_connected 0") {
            sleep(Duration::from_millis(50)).await;
        }
    };
    timeout(SOON, is_told).await.expect("it is told that nobody is heard");
    let _nats = Nats::start_at(address).await;
    until(&attic, &["eve@cellar", "mo@cellar"]).await;
    assert!(metrics(&attic).await.contains("roomsight_nats_connected 1"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_service_alone_is_its_fleet() {
    let server = Server::start_sure(Settings::default()).await;
    recognize(&server, "eve", known_room(0)).await;
    assert_eq!(everybody(&server).await, ["eve@"]);
    let events = server.get("/v1/events?scope=fleet").send().await.unwrap();
    let _stream = Robot::connect(&server, "?robot=wall-e").await;
    hears(events, "robot_joined").await;
    let wrong = server.get("/v1/robots?scope=world").send().await.unwrap();
    problem(wrong, 400, "bad-request").await;
    let metrics = server.get("/metrics").send().await.unwrap().text().await.unwrap();
    assert!(!metrics.lines().any(|line| line.starts_with("roomsight_nats_connected")), "{metrics}");
}
