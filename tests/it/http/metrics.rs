//! What `GET /metrics` tells after known traffic, and that no caller can add to its series.

use crate::http::load::{fill, one_thread, slow_frame, very_slow_frame};
use crate::http::robot::{Robot, seq_of};
use crate::http::service::{
    FORM, SOON, Server, client, form, frame, models, problem, room, success, write_model,
};
use roomsight::access::{Key, Role};
use roomsight::settings::Settings;
use roomsight_protocol::stream::{Configure, DropReason, ServerMessage};
use std::collections::{BTreeMap, BTreeSet};
use tokio::time::timeout;

const DOCUMENT: &str = include_str!("../../../docs/METRICS.md");

/// What one scrape told.
struct Scrape {
    text: String,
    /// By name and labels as they are written.
    values: BTreeMap<String, f64>,
}

impl Scrape {
    async fn of(server: &Server) -> Self {
        let response = server.get("/metrics").send().await.unwrap();
        assert_eq!(response.status(), 200);
        assert_eq!(response.headers()["content-type"], "text/plain; version=0.0.4; charset=utf-8");
        let text = response.text().await.unwrap();
        let lines = text.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
        let pair = |line: &str| {
            let (series, value) = line.rsplit_once(' ').unwrap();
            (series.to_owned(), value.parse().unwrap())
        };
        Self { values: lines.map(pair).collect(), text }
    }

    /// The value of a series; 0 where there is none.
    fn value(&self, series: &str) -> f64 {
        self.values.get(series).copied().unwrap_or_default()
    }

    fn frames(&self, transport: &str, outcome: &str) -> f64 {
        self.value(&format!(
            r#"roomsight_frames_total{{model="lab",version="1",transport="{transport}",outcome="{outcome}"}}"#
        ))
    }

    fn requests(&self, route: &str, method: &str, status: u16) -> f64 {
        self.value(&format!(
            r#"roomsight_requests_total{{route="{route}",method="{method}",status="{status}"}}"#
        ))
    }

    fn series(&self) -> BTreeSet<&str> {
        self.values.keys().map(String::as_str).collect()
    }
}

/// Scrapes until it tells what must come to be.
async fn scrape_until(server: &Server, is_so: impl Fn(&Scrape) -> bool) -> Scrape {
    let scraped = async {
        loop {
            let scrape = Scrape::of(server).await;
            if is_so(&scrape) {
                return scrape;
            }
        }
    };
    timeout(SOON, scraped).await.expect("it comes to be so")
}

#[tokio::test]
async fn requests_and_their_frames_are_counted() {
    let server = Server::start(Settings::default()).await;
    for shift in 0..2 {
        success(server.post("/v1/recognize", room(0, shift)).send().await.unwrap()).await;
    }
    problem(server.post("/v1/recognize", b"no image".to_vec()).send().await.unwrap(), 422, "not-an-image")
        .await;
    let late = server.post("/v1/recognize?deadline_ms=0", frame()).send().await.unwrap();
    problem(late, 504, "deadline-passed").await;
    let batch = form(&[&frame(), b"no image", &frame()]);
    success(server.post_as("/v1/recognize/batch", FORM, batch).send().await.unwrap()).await;
    let scrape = Scrape::of(&server).await;
    assert_eq!(scrape.frames("rest", "answered"), 4.0, "{}", scrape.text);
    let answers = scrape.values.iter().filter(|(series, _)| series.starts_with("roomsight_answers_total{"));
    assert_eq!(answers.map(|(_, value)| value).sum::<f64>(), 4.0, "{}", scrape.text);
    assert_eq!(scrape.value(r#"roomsight_answer_probability_ratio_count{model="lab"}"#), 4.0);
    assert_eq!(scrape.frames("rest", "not-an-image"), 2.0);
    assert_eq!(scrape.frames("rest", "deadline-passed"), 1.0);
    assert_eq!(scrape.requests("/v1/recognize", "POST", 200), 2.0);
    assert_eq!(scrape.requests("/v1/recognize", "POST", 422), 1.0);
    assert_eq!(scrape.requests("/v1/recognize", "POST", 504), 1.0);
    assert_eq!(scrape.requests("/v1/recognize/batch", "POST", 200), 1.0);
    for stage in ["queue", "decode", "features", "classify"] {
        let count = format!(r#"roomsight_frame_stage_duration_seconds_count{{model="lab",stage="{stage}"}}"#);
        assert_eq!(scrape.value(&count), 4.0, "{count}");
    }
    let count = r#"roomsight_request_duration_seconds_count{route="/v1/recognize"}"#;
    assert_eq!(scrape.value(count), 4.0);
    let sum = scrape.value(r#"roomsight_frame_stage_duration_seconds_sum{model="lab",stage="features"}"#);
    assert!(sum > 0.0 && sum < SOON.as_secs_f64(), "{sum}");
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_of_a_stream_are_counted_as_they_are_told() {
    let server = one_thread(0).await;
    let mut robot = Robot::connect(&server, "?robot=wall-e").await;
    robot.send(very_slow_frame()).await;
    for shift in 1..20 {
        robot.send(room(0, shift)).await;
    }
    robot.send(b"no image".to_vec()).await;
    let (mut n_results, mut n_superseded, mut last_seq) = (0, 0, None);
    while last_seq != Some(20) {
        let message = robot.next().await;
        last_seq = seq_of(&message);
        match message {
            ServerMessage::Result(_) => n_results += 1,
            ServerMessage::Dropped { reason: DropReason::Superseded, .. } => n_superseded += 1,
            ServerMessage::Error { .. } => {}
            other => panic!("{other:?}"),
        }
    }
    assert!(n_superseded > 0, "while the first was decoded, newer ones came");
    let scrape = Scrape::of(&server).await;
    assert_eq!(scrape.frames("stream", "answered"), f64::from(n_results), "{}", scrape.text);
    assert_eq!(scrape.frames("stream", "not-an-image"), 1.0);
    let dropped = |reason| scrape.value(&format!(r#"roomsight_frames_dropped_total{{reason="{reason}"}}"#));
    assert_eq!(dropped("superseded"), f64::from(n_superseded));
    assert_eq!(dropped("overload"), 0.0);
    assert_eq!(scrape.requests("/v1/stream", "GET", 101), 1.0);
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_are_counted_by_whether_their_robot_is_there() {
    let server = Server::start(Settings::default()).await;
    let robots = [
        Robot::connect(&server, "?robot=wall-e").await,
        Robot::connect(&server, "?robot=wall-e").await,
        Robot::connect(&server, "?robot=eve").await,
        Robot::connect(&server, "").await,
    ];
    let streams = |scrape: &Scrape| {
        ["connected", "resumable"]
            .map(|state| scrape.value(&format!(r#"roomsight_streams{{state="{state}"}}"#)))
    };
    let scrape = scrape_until(&server, |scrape| streams(scrape)[0] == 4.0).await;
    assert_eq!((streams(&scrape), scrape.value("roomsight_robots")), ([4.0, 0.0], 2.0));
    drop(robots);
    let scrape = scrape_until(&server, |scrape| streams(scrape)[0] == 0.0).await;
    assert_eq!((streams(&scrape), scrape.value("roomsight_robots")), ([0.0, 4.0], 0.0));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_queue_shows_and_so_does_a_caller_that_left_it() {
    let server = one_thread(1).await;
    let working = tokio::spawn(server.post("/v1/recognize", very_slow_frame()).send());
    scrape_until(&server, |scrape| scrape.value("roomsight_threads_busy") == 1.0).await;
    let waiting = tokio::spawn(server.post("/v1/recognize", frame()).send());
    let scrape = scrape_until(&server, |scrape| scrape.value("roomsight_queue_depth") == 1.0).await;
    assert_eq!(scrape.value("roomsight_threads"), 1.0);
    assert_eq!((scrape.value("roomsight_slots"), scrape.value("roomsight_slots_in_use")), (2.0, 2.0));
    assert!(scrape.value("roomsight_body_bytes") >= frame().len() as f64);
    waiting.abort();
    let scrape = scrape_until(&server, |scrape| scrape.frames("rest", "caller-left") == 1.0).await;
    assert_eq!(scrape.frames("rest", "answered"), 0.0);
    success(working.await.unwrap().unwrap()).await;
    let scrape = scrape_until(&server, |scrape| scrape.value("roomsight_threads_busy") == 0.0).await;
    let idle = ["roomsight_queue_depth", "roomsight_slots_in_use", "roomsight_body_bytes"];
    assert_eq!(idle.map(|name| scrape.value(name)), [0.0; 3]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_service_that_stops_says_so() {
    // A single frame could be done before the service is looked at.
    let mut server = one_thread(5).await;
    let working = fill(&server, 6).await;
    let scrape = scrape_until(&server, |scrape| scrape.value("roomsight_threads_busy") == 1.0).await;
    assert_eq!(scrape.value("roomsight_draining"), 0.0);
    server.stop();
    scrape_until(&server, |scrape| scrape.value("roomsight_draining") == 1.0).await;
    for answer in working {
        success(answer.await.unwrap().unwrap()).await;
    }
}

#[tokio::test]
async fn an_activation_is_counted_and_the_new_version_shown() {
    let folder = models();
    let settings = Settings { models: folder.path().to_owned(), ..Settings::default() };
    write_model(&folder.path().join("lab/2"));
    let server = Server::of(settings).await;
    let stable = |scrape: &Scrape| {
        let infos = scrape.values.keys().filter(|series| series.starts_with("roomsight_model_info"));
        infos.cloned().collect::<Vec<_>>()
    };
    let before = Scrape::of(&server).await;
    let activate =
        |version: u64| client().post(format!("{}/v1/models/lab/versions/{version}/activate", server.url));
    success(activate(1).send().await.unwrap()).await;
    problem(activate(9).send().await.unwrap(), 404, "no-such-model").await;
    let after = Scrape::of(&server).await;
    let [before, now] = [before, after].map(|scrape| (stable(&scrape), scrape));
    assert!(before.0[0].contains(r#"version="2",label="stable",epoch="1""#), "{:?}", before.0);
    assert!(now.0[0].contains(r#"version="1",label="stable",epoch="2""#), "{:?}", now.0);
    assert_eq!((before.0.len(), now.0.len()), (1, 2), "one with each label: {:?}", now.0);
    assert!(now.0[1].contains(r#"version="2",label="previous""#), "{:?}", now.0);
    let swaps =
        |outcome| now.1.value(&format!(r#"roomsight_swaps_total{{kind="activate",outcome="{outcome}"}}"#));
    assert_eq!((swaps("done"), swaps("failed"), swaps("lost")), (1.0, 1.0, 0.0));
    assert_eq!(now.1.value(r#"roomsight_swap_duration_seconds_count{kind="activate"}"#), 2.0);
    assert_eq!(now.1.value(r#"roomsight_model_versions{state="ready"}"#), 2.0);
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_that_a_caller_makes_up_becomes_a_label() {
    let server = Server::start(Settings { max_frame_pixels: 100_000, ..Settings::default() }).await;
    // What is counted the first time makes its series.
    for _ in 0..2 {
        make_up(&server, "first").await;
        Scrape::of(&server).await;
    }
    let before = Scrape::of(&server).await;
    for name in ["strange-1", "strange-2", "strange-3"] {
        make_up(&server, name).await;
    }
    let after = Scrape::of(&server).await;
    assert_eq!(after.series(), before.series());
    assert!(!after.text.contains("strange") && !after.text.contains("STRANGE"), "{}", after.text);
    assert!(after.requests("(none)", "other", 404) >= 3.0, "they were counted: {}", after.text);
}

/// Sends what a caller may name freely.
async fn make_up(server: &Server, name: &str) {
    let method = name.to_uppercase().parse::<reqwest::Method>().unwrap();
    for path in [format!("/{name}"), format!("/docs/{name}"), format!("/problems/{name}"), "/livez".into()] {
        let url = format!("{}{path}", server.url);
        assert!(client().request(method.clone(), &url).send().await.unwrap().status().is_client_error());
        client().get(&url).send().await.unwrap();
    }
    for path in [
        format!("/v1/recognize?robot={name}&captured_at={name}"),
        format!("/v1/recognize?model={name}"),
        format!("/v1/recognize?label={name}"),
        format!("/v1/recognize?version={}", name.len()),
        format!("/v1/recognize?{name}={name}"),
    ] {
        let request = server.post(&path, frame()).header("x-request-id", name).header("user-agent", name);
        request.send().await.unwrap();
    }
    server.post_as("/v1/recognize", &format!("image/{name}"), frame()).send().await.unwrap();
    server.post("/v1/recognize", slow_frame()).send().await.unwrap();
    for path in [format!("/v1/models/{name}"), format!("/v1/robots/{name}")] {
        server.get(&path).send().await.unwrap();
    }
    let activate = format!("/v1/models/{name}/versions/{}/activate", name.len());
    server.post(&activate, Vec::new()).send().await.unwrap();
    let mut robot = Robot::connect(server, &format!("?robot={name}&mode=lossless")).await;
    robot.send(frame()).await;
    robot.next().await;
    robot.configure(Configure { model: Some(name.to_owned()), ..Configure::default() }).await;
    robot.send(name.as_bytes().to_vec()).await;
    robot.next().await;
}

#[tokio::test]
async fn viewers_may_scrape() {
    let made = [Role::Robot, Role::Viewer].map(|role| Key::new(role, "someone", &[role as u8; 32]).unwrap());
    let keys = made.iter().map(|(_, key)| key.clone()).collect();
    let server = Server::start(Settings { keys, ..Settings::default() }).await;
    let [robot, viewer] = made.map(|(secret, _)| secret);
    let scrape = |key: &str| server.get("/metrics").bearer_auth(key).send();
    assert_eq!(scrape(&viewer).await.unwrap().status(), 200);
    problem(scrape(&robot).await.unwrap(), 403, "forbidden").await;
    problem(server.get("/metrics").send().await.unwrap(), 401, "unauthorized").await;
}

#[tokio::test]
async fn all_that_is_documented_is_told_and_nothing_else() {
    let folder = models();
    write_model(&folder.path().join("lab/2"));
    let settings = Settings {
        models: folder.path().to_owned(),
        mqtt: "mqtt://127.0.0.1:1".into(),
        nats: "nats://127.0.0.1:1".into(),
        ..Settings::default()
    };
    let server = Server::of(settings).await;
    success(server.post("/v1/recognize", frame()).send().await.unwrap()).await;
    let activate = format!("{}/v1/models/lab/versions/1/activate", server.url);
    success(client().post(activate).send().await.unwrap()).await;
    let shadow = client().put(format!("{}/v1/models/lab/labels/shadow", server.url));
    let shadow = shadow.header("content-type", "application/json").body(r#"{"version": 2}"#);
    success(shadow.send().await.unwrap()).await;
    let scrape = scrape_until(&server, |scrape| scrape.requests("/metrics", "GET", 200) > 0.0).await;
    assert_eq!(told(&scrape), documented());
    for line in scrape.text.lines().filter_map(|line| line.strip_prefix("# HELP ")) {
        let (name, help) = line.split_once(' ').unwrap();
        assert!(DOCUMENT.contains(&format!("`{name}`")) && DOCUMENT.contains(help), "{line}");
    }
}

/// Name, type and labels of each row of the document's table.
fn documented() -> BTreeMap<String, (String, BTreeSet<String>)> {
    let rows = DOCUMENT.lines().filter_map(|line| line.strip_prefix("| `"));
    let metric = |row: &str| {
        let cells: Vec<&str> = row.split(" | ").collect();
        let labels = cells[2].split(", ").map(|label| label.trim_matches('`').to_owned());
        let labels = labels.filter(|label| !label.is_empty()).collect();
        (cells[0].trim_end_matches('`').to_owned(), (cells[1].to_owned(), labels))
    };
    let only_on_linux = |name: &str| name.starts_with("process_");
    rows.map(metric).filter(|(name, _)| cfg!(target_os = "linux") || !only_on_linux(name)).collect()
}

/// The same of what was scraped.
fn told(scrape: &Scrape) -> BTreeMap<String, (String, BTreeSet<String>)> {
    let mut told = BTreeMap::new();
    for line in scrape.text.lines().filter_map(|line| line.strip_prefix("# TYPE ")) {
        let (name, kind) = line.split_once(' ').unwrap();
        let suffix = if kind == "histogram" { "_count" } else { "" };
        let wanted = format!("{name}{suffix}");
        let is_of = |series: &&&str| series.split('{').next() == Some(wanted.as_str());
        let all = scrape.series();
        let series = all.iter().find(is_of).unwrap_or_else(|| panic!("{name} has no series"));
        let labels = series.split_once('{').map_or("", |(_, labels)| labels.trim_end_matches('}'));
        let labels = labels.split(',').filter_map(|label| Some(label.split_once('=')?.0.to_owned()));
        told.insert(name.to_owned(), (kind.to_owned(), labels.collect()));
    }
    told
}
