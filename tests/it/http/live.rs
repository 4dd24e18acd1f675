//! Robots as pages show them: who is there, where, and what they see.

use crate::http::robot::{Robot, result};
use crate::http::service::{FORM, SOON, Server, form, known_room, pgm, problem, room, success};
use roomsight::access::{Key, Role};
use roomsight::settings::Settings;
use roomsight_protocol::event::{Event, LiveUpdate, RobotInfo, RobotState, Via};
use roomsight_protocol::map::ModelMap;
use roomsight_protocol::service::{ServiceHistory, ServiceInfo};
use roomsight_vision::image::{Image, Limits};
use serde::de::DeserializeOwned;
use std::time::Duration;
use tokio::time::{sleep, timeout};

/// Server-sent events, as they come.
struct Events {
    response: reqwest::Response,
    text: String,
}

impl Events {
    async fn of(server: &Server, path: &str) -> Self {
        let response = server.get(path).send().await.unwrap();
        assert_eq!(response.headers()["content-type"], "text/event-stream");
        Self { response, text: String::new() }
    }

    /// The name and the data of the next one.
    async fn next<T: DeserializeOwned>(&mut self) -> (String, T) {
        timeout(SOON, self.come()).await.expect("it comes soon")
    }

    async fn come<T: DeserializeOwned>(&mut self) -> (String, T) {
        loop {
            if let Some((event, rest)) = self.text.split_once("\n\n") {
                let (event, rest) = (event.to_owned(), rest.to_owned());
                self.text = rest;
                if let Some((name, data)) = event.split_once("\ndata: ") {
                    let name = name.strip_prefix("event: ").unwrap();
                    return (name.to_owned(), serde_json::from_str(data).unwrap());
                }
                continue;
            }
            let piece = self.response.chunk().await.unwrap();
            self.text += std::str::from_utf8(&piece.expect("the response goes on")).unwrap();
        }
    }

    /// Reads updates until one tells of a robot what must be so.
    async fn until(&mut self, id: &str, is_so: impl Fn(&RobotState) -> bool) -> RobotState {
        loop {
            let (name, update) = self.next::<LiveUpdate>().await;
            assert_eq!((name.as_str(), update.lost_events), ("live", 0));
            if let Some(robot) = update.robots.into_iter().find(|robot| robot.who.id == id && is_so(robot)) {
                return robot;
            }
        }
    }
}

async fn read<T: DeserializeOwned>(server: &Server, path: &str) -> T {
    serde_json::from_value(success(server.get(path).send().await.unwrap()).await).unwrap()
}

async fn recognize(server: &Server, query: &str, frame: Vec<u8>) {
    success(server.post(&format!("/v1/recognize{query}"), frame).send().await.unwrap()).await;
}

/// A frame in which there is nothing to see, which no answer is known for.
fn nothing() -> Vec<u8> {
    pgm(96, 72, |_, _| 128)
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_are_seen_as_they_come_answer_and_leave() {
    let server = Server::start(Settings::default()).await;
    recognize(&server, "?robot=eve", room(0, 0)).await;
    recognize(&server, "", room(0, 0)).await;
    let mut live = Events::of(&server, "/v1/live").await;
    let (_, first) = live.next::<LiveUpdate>().await;
    let [eve] = &first.robots[..] else { panic!("{first:?}") };
    assert_eq!((eve.who.id.as_str(), eve.via, eve.connected), ("eve", Via::Rest, true));
    assert_eq!((eve.room.as_deref(), eve.frames.accepted, eve.frames.results), (Some("stripes"), 1, 1));
    assert!(eve.frame.is_some() && eve.latency_ms.is_some() && eve.probabilities.len() == 3, "{eve:?}");
    let mut robot = Robot::connect(&server, "?mode=lossless&robot=wall-e").await;
    for shift in 0..3 {
        robot.send(room(1, shift)).await;
        result(robot.next().await);
    }
    let seen = live.until("wall-e", |robot| robot.frames.results == 3).await;
    assert_eq!((seen.via, seen.who.stream.as_ref()), (Via::Stream, Some(&robot.hello.stream)));
    assert_eq!((seen.room.as_deref(), seen.model.unwrap().name.as_str()), (Some("bars"), "lab"));
    robot.send(b"no image".to_vec()).await;
    live.until("wall-e", |robot| robot.frames.errors == 1).await;
    robot.socket.close(None).await.unwrap();
    live.until("wall-e", |robot| !robot.connected).await;
    // It is told of after it left, and goes on when it comes back under its name.
    let info: RobotInfo = read(&server, "/v1/robots/wall-e").await;
    assert_eq!((info.state.connected, info.answers.len()), (false, 3));
    assert!(!info.ribbon.is_empty() && info.ribbon.iter().all(|stay| stay.room == "bars"), "{info:?}");
    let comes_back = async {
        loop {
            recognize(&server, "?robot=wall-e", room(0, 0)).await;
            let info: RobotInfo = read(&server, "/v1/robots/wall-e").await;
            if info.state.via == Via::Rest {
                return info;
            }
        }
    };
    let info = timeout(SOON, comes_back).await.expect("its stream is over soon");
    assert_eq!((info.mode, info.ribbon[0].room.as_str()), (None, "bars"));
    assert_eq!(info.ribbon.last().unwrap().room, "stripes");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_of_a_robot_is_its_name_and_only_viewers_see_it() {
    let keys: Vec<_> = [(Role::Robot, "r2", 1), (Role::Admin, "boss", 2)]
        .map(|(role, name, seed)| Key::new(role, name, &[seed; 32]).unwrap())
        .into();
    let [robot, boss] = [&keys[0].0, &keys[1].0];
    let settings =
        Settings { keys: keys.iter().map(|(_, key)| key.clone()).collect(), ..Settings::default() };
    let server = Server::start(settings).await;
    for key in [robot, boss] {
        success(server.post("/v1/recognize", room(0, 0)).bearer_auth(key).send().await.unwrap()).await;
    }
    let list = success(server.get("/v1/robots").bearer_auth(boss).send().await.unwrap()).await;
    let ids: Vec<_> = list["robots"].as_array().unwrap().iter().map(|robot| &robot["id"]).collect();
    assert_eq!(ids, ["r2"], "who is no robot is none");
    for path in ["/v1/live", "/v1/robots/r2/frame", "/v1/service", "/v1/service/history"] {
        problem(server.get(path).send().await.unwrap(), 401, "unauthorized").await;
        problem(server.get(path).bearer_auth(robot).send().await.unwrap(), 403, "forbidden").await;
        assert_eq!(server.get(path).bearer_auth(boss).send().await.unwrap().status(), 200, "{path}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_is_lost_where_answers_stay_unknown_and_found_again() {
    let server = Server::start_sure(Settings { lost_after_ms: 1, ..Settings::default() }).await;
    let mut events = Events::of(&server, "/v1/events").await;
    let mut told = async || loop {
        let (_, event) = events.next::<Event>().await;
        if !matches!(event, Event::Answer(_)) {
            return event;
        }
    };
    recognize(&server, "?robot=eve", known_room(0)).await;
    let Event::RoomChanged(change) = told().await else { panic!("no change") };
    assert_eq!((change.who.id.as_str(), change.from, change.to.as_str()), ("eve", None, "stripes"));
    recognize(&server, "?robot=eve", nothing()).await;
    sleep(Duration::from_millis(5)).await;
    recognize(&server, "?robot=eve", nothing()).await;
    let Event::RobotLost(lost) = told().await else { panic!("it is not lost") };
    assert_eq!(lost.who.id, "eve");
    let info: RobotInfo = read(&server, "/v1/robots/eve").await;
    assert!(info.state.lost && info.state.lost_s.is_some() && !info.state.known, "{info:?}");
    let scrape = server.get("/metrics").send().await.unwrap().text().await.unwrap();
    assert!(scrape.contains("\nroomsight_robots_lost 1\n"), "{scrape}");
    recognize(&server, "?robot=eve", known_room(1)).await;
    let Event::RobotFound(found) = told().await else { panic!("it is not found") };
    assert_eq!((found.who.id.as_str(), found.room.as_str()), ("eve", "bars"));
    let Event::RoomChanged(change) = told().await else { panic!("no change") };
    assert_eq!((change.from.as_deref(), change.to.as_str()), (Some("stripes"), "bars"));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_last_frame_is_shown_as_it_came_or_small() {
    let server = Server::start(Settings::default()).await;
    let frame = room(2, 5);
    let batch = form(&[&room(0, 0)[..], &frame]);
    success(server.post_as("/v1/recognize/batch?robot=eve", FORM, batch).send().await.unwrap()).await;
    let path = "/v1/robots/eve/frame";
    let whole = server.get(path).send().await.unwrap();
    let (etag, number) = (whole.headers()["etag"].clone(), whole.headers()["x-frame"].clone());
    assert_eq!(etag.to_str().unwrap().trim_matches('"'), number.to_str().unwrap());
    assert_eq!(whole.headers()["cache-control"], "no-cache");
    assert_eq!(whole.bytes().await.unwrap(), frame, "of several frames the last one");
    for _ in 0..2 {
        let small = server.get(&format!("{path}?width=32")).send().await.unwrap();
        assert_eq!(
            (&small.headers()["content-type"], &small.headers()["etag"]),
            (&"image/jpeg".parse().unwrap(), &etag)
        );
        let small = Image::decode(&small.bytes().await.unwrap(), &Limits::default()).unwrap();
        assert_eq!((small.width(), small.height()), (32, 24));
    }
    let same = server.get(path).header("if-none-match", &etag).send().await.unwrap();
    assert_eq!((same.status().as_u16(), same.bytes().await.unwrap().len()), (304, 0));
    recognize(&server, "?robot=eve", room(0, 0)).await;
    let newer = server.get(path).header("if-none-match", &etag).send().await.unwrap();
    assert!(newer.status() == 200 && newer.headers()["etag"] != etag);
    for query in ["?width=15", "?width=1921", "?width=x", "?depth=3"] {
        problem(server.get(&format!("{path}{query}")).send().await.unwrap(), 400, "bad-request").await;
    }
    problem(server.get("/v1/robots/nobody/frame").send().await.unwrap(), 404, "not-found").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_are_kept_within_their_budget_or_not_at_all() {
    let n_bytes = room(0, 0).len();
    let server = Server::start(Settings { live_frames_bytes: 2 * n_bytes, ..Settings::default() }).await;
    for robot in ["a", "b", "c"] {
        recognize(&server, &format!("?robot={robot}"), room(0, 0)).await;
    }
    problem(server.get("/v1/robots/a/frame").send().await.unwrap(), 404, "not-found").await;
    assert_eq!(server.get("/v1/robots/c/frame").send().await.unwrap().status(), 200);
    let server = Server::start(Settings { live_frames_bytes: 0, ..Settings::default() }).await;
    recognize(&server, "?robot=a", room(0, 0)).await;
    problem(server.get("/v1/robots/a/frame").send().await.unwrap(), 404, "not-found").await;
    assert!(!read::<ServiceInfo>(&server, "/v1/service").await.frames_kept);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_service_tells_of_itself_and_of_its_models() {
    let server = Server::start(Settings { threads: 1, ..Settings::default() }).await;
    let info: ServiceInfo = read(&server, "/v1/service").await;
    assert_eq!((info.version.as_str(), info.keys, info.threads), (env!("CARGO_PKG_VERSION"), false, 1));
    assert_eq!((info.lost_after_s, info.webhooks, info.mqtt, info.frames_kept), (10.0, 0, false, true));
    let history: ServiceHistory = read(&server, "/v1/service/history").await;
    assert_eq!((history.interval_s, history.points.len()), (10, 0), "the first interval is not over");
    let map: ModelMap = read(&server, "/v1/models/lab/versions/1/map").await;
    assert_eq!((map.rooms.len(), map.positions.len()), (3, 0));
    let leavings: f32 = map.transitions.iter().filter(|way| way.from == "bars").map(|way| way.rate).sum();
    assert!((leavings - 1.0).abs() < 0.01, "{map:?}");
    problem(server.get("/v1/models/lab/versions/9/map").send().await.unwrap(), 404, "no-such-model").await;
}
