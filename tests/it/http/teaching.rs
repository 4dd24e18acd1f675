//! Rooms taught over HTTP: data sets, trainings, what serves then, the inbox, keys, and what is kept when the service is
//! killed.

use crate::http::command::Running;
use crate::http::service::{SOON, client, pgm, problem, room, success};
use reqwest::{Method, Response};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::time::{sleep, timeout};

const ROOMS: [&str; 3] = ["stripes", "bars", "dots"];

/// A service with a data directory, and models beside it.
struct Taught {
    folder: TempDir,
    running: Running,
}

impl Taught {
    fn start() -> Self {
        let folder = TempDir::new().unwrap();
        fs::create_dir(folder.path().join("models")).unwrap();
        let running = Self::run(folder.path());
        Self { folder, running }
    }

    fn run(folder: &Path) -> Running {
        let at = |name: &str| folder.join(name).to_str().unwrap().to_owned();
        Running::start_unready(&["--models", &at("models"), "--data", &at("data")])
    }

    fn again(self) -> Self {
        let Self { folder, mut running } = self;
        running.kill();
        let running = Self::run(folder.path());
        Self { folder, running }
    }

    async fn call(&self, method: Method, path: &str, body: Option<Value>) -> Response {
        let call = client().request(method, format!("{}{path}", self.running.url));
        match body {
            Some(body) => call.json(&body),
            None => call,
        }
        .send()
        .await
        .unwrap()
    }

    async fn get(&self, path: &str) -> Value {
        success(self.call(Method::GET, path, None).await).await
    }

    /// Posts JSON that is taken.
    async fn post(&self, path: &str, body: Value) -> Value {
        let response = self.call(Method::POST, path, Some(body)).await;
        let status = response.status();
        let text = response.text().await.unwrap();
        assert!(status.is_success(), "{path}: {text}");
        serde_json::from_str(&text).unwrap()
    }

    async fn post_picture(&self, path: &str, picture: Vec<u8>) -> Response {
        let call = client().post(format!("{}{path}", self.running.url));
        call.header("content-type", "application/octet-stream").body(picture).send().await.unwrap()
    }

    /// Teaches three rooms with so many frames of each.
    async fn teach(&self, n_frames: u32) {
        self.call(Method::PUT, "/v1/sets/home", None).await.error_for_status().unwrap();
        for (idx, name) in ROOMS.into_iter().enumerate() {
            for shift in 0..n_frames {
                let path = format!("/v1/sets/home/frames?room={name}&drive=monday");
                success(self.post_picture(&path, room(idx as u32, 7 * shift)).await).await;
            }
        }
    }

    /// Trains and waits for the end.
    async fn train(&self) -> Value {
        let begun =
            self.post("/v1/trainings", json!({"set": "home", "model": "home", "effort": "fast"})).await;
        self.ended(&begun).await
    }

    async fn ended(&self, begun: &Value) -> Value {
        let path = format!("/v1/trainings/{}", begun["id"]);
        let until = Instant::now() + SOON;
        loop {
            let training = self.get(&path).await;
            if training["state"] != "running" {
                return training;
            }
            assert!(Instant::now() < until, "{training}");
            sleep(Duration::from_millis(50)).await;
        }
    }

    async fn what_was_done(&self) -> Vec<String> {
        let audit = self.get("/v1/audit").await;
        let entries = audit["entries"].as_array().unwrap();
        entries.iter().map(|entry| entry["what"].as_str().unwrap().to_owned()).collect()
    }
}

#[tokio::test]
async fn rooms_are_taught_trained_served_corrected_and_served_better() {
    let taught = Taught::start();
    taught.teach(8).await;
    let trained = taught.train().await;
    assert_eq!(trained["state"], "done", "{trained}");
    assert_eq!(trained["n_frames"], 24);
    assert!(trained["report"]["card"].is_object() && trained["rate"].as_f64().unwrap() > 0.5, "{trained}");
    // Nothing serves until somebody says so, though the policy is `latest`.
    let published = taught.post("/v1/trainings/1/publish", json!({})).await;
    assert_eq!(published, json!({"name": "home", "version": 1}));
    sleep(Duration::from_millis(2500)).await;
    let model = taught.get("/v1/models/home").await;
    assert_eq!(model["serving"], Value::Null, "{model}");
    taught.call(Method::POST, "/v1/models/home/versions/1/activate", None).await.error_for_status().unwrap();
    let answer = taught.post_picture("/v1/recognize", room(1, 3)).await.json::<Value>().await.unwrap();
    assert_eq!(answer["room"], "bars", "{answer}");

    // Somebody says that an answer was wrong, labels it and trains again.
    let wrong = taught.post_picture("/v1/inbox?robot=eve&right=hall", room(2, 100)).await;
    assert_eq!(wrong.status(), 201);
    let wrong = wrong.json::<Value>().await.unwrap();
    assert_eq!(
        (&wrong["reasons"], &wrong["said"], &wrong["robot"]),
        (&json!(["wrong"]), &json!("hall"), &json!("eve"))
    );
    let frames = json!([{"id": wrong["id"], "revision": wrong["revision"]}]);
    let labels = json!({"set": "home", "room": "hall", "frames": frames});
    let labeled = taught.post("/v1/inbox/labels", labels.clone()).await;
    assert_eq!(labeled["labeled"][0]["label"]["room"], "hall", "{labeled}");
    let late = taught.post("/v1/inbox/labels", labels).await;
    assert_eq!((late["labeled"].as_array().unwrap().len(), &late["conflicts"][0]["id"]), (0, &wrong["id"]));
    let rooms = taught.get("/v1/sets/home").await["rooms"].clone();
    assert_eq!(rooms[2]["name"], "hall", "{rooms}");
    let undone = taught.post(&format!("/v1/sets/home/changes/{}/undo", labeled["change"]), json!({})).await;
    assert_eq!(undone["undone"], true);
    assert_eq!(taught.get("/v1/inbox").await["open"], 1, "it can be labeled again");

    let second = taught.train().await;
    assert_eq!(second["comparison"]["serving"], "home/1", "{second}");
    taught.post("/v1/trainings/2/publish", json!({"even_if_worse": true})).await;
    let again = taught.call(Method::POST, "/v1/trainings/2/publish", None).await;
    problem(again, 409, "conflict").await;
    let shadow = taught.call(Method::PUT, "/v1/models/home/labels/shadow", Some(json!({"version": 2}))).await;
    let shadow = success(shadow).await;
    assert_eq!(shadow["versions"][0]["labels"], json!(["shadow"]), "{shadow}");
    let stale = client().post(format!("{}/v1/models/home/versions/2/activate", taught.running.url));
    problem(stale.header("if-match", "\"1\"").send().await.unwrap(), 412, "stale-epoch").await;
    taught.call(Method::POST, "/v1/models/home/versions/2/activate", None).await.error_for_status().unwrap();
    taught.call(Method::POST, "/v1/models/home/rollback", None).await.error_for_status().unwrap();
    let done = taught.what_was_done().await;
    let expected = [
        "rollback",
        "activate",
        "label",
        "publish",
        "train",
        "undo",
        "label_frames",
        "wrong",
        "activate",
        "publish",
        "train",
        "set_created",
    ];
    assert_eq!(done, expected);
}

#[tokio::test]
async fn doubted_frames_come_into_the_inbox_by_the_rule_and_labels_lead_to_a_shadow_by_the_policy() {
    let taught = Taught::start();
    taught.teach(8).await;
    taught.train().await;
    taught.post("/v1/trainings/1/publish", json!({})).await;
    taught.call(Method::POST, "/v1/models/home/versions/1/activate", None).await.error_for_status().unwrap();
    let odd = |shade: u32| pgm(96, 72, move |x, y| ((x * 7 + y * 13 + shade) % 251) as u8);
    let send = async |robot: &str, shade: u32| {
        let answer = taught.post_picture(&format!("/v1/recognize?robot={robot}"), odd(shade)).await;
        assert_eq!(success(answer).await["known"], false);
    };
    let n_open = async || taught.get("/v1/inbox").await["open"].as_u64().unwrap();
    send("eve", 1).await;
    assert_eq!(n_open().await, 0, "nothing is kept until somebody says so");
    let rule = json!({"robots": ["eve"], "every_s": 0});
    let told = success(taught.call(Method::PUT, "/v1/inbox/rule", Some(rule)).await).await;
    assert_eq!(
        (&told["all"], &told["max_days"]),
        (&json!(false), &json!(30)),
        "what is left out is as usual"
    );
    for shade in 0..3 {
        send("eve", shade).await;
        send("wall-e", 100 + shade).await;
    }
    let until = Instant::now() + SOON;
    while n_open().await < 3 {
        assert!(Instant::now() < until);
        sleep(Duration::from_millis(20)).await;
    }
    let inbox = taught.get("/v1/inbox?reason=unknown").await;
    let frames = inbox["frames"].as_array().unwrap();
    assert!(frames.len() == 3 && frames.iter().all(|frame| frame["robot"] == "eve"), "{inbox}");
    let picture = format!("{}/v1/inbox/{}/picture", taught.running.url, frames[0]["id"]);
    let picture = client().get(picture).send().await.unwrap();
    assert!(picture.headers()["cache-control"].to_str().unwrap().contains("private"));

    let policy =
        json!({"set": "home", "model": "home", "train_after": 3, "publish": "shadow", "effort": "fast"});
    success(taught.call(Method::PUT, "/v1/inbox/policy", Some(policy)).await).await;
    let seen: Vec<Value> =
        frames.iter().map(|frame| json!({"id": frame["id"], "revision": frame["revision"]})).collect();
    for (n_labels, seen) in [(2, &seen[..2]), (3, &seen[2..])] {
        assert_eq!(taught.get("/v1/trainings").await["trainings"].as_array().unwrap().len(), 1, "{n_labels}");
        taught.post("/v1/inbox/labels", json!({"set": "home", "room": "attic", "frames": seen})).await;
    }
    let by_policy = taught.ended(&json!({"id": 2})).await;
    assert_eq!((&by_policy["by"], &by_policy["state"]), (&json!("policy"), &json!("done")), "{by_policy}");
    if by_policy["comparison"]["is_worse"] == false {
        let until = Instant::now() + SOON;
        while taught.get("/v1/models/home").await["versions"][0]["labels"] != json!(["shadow"]) {
            assert!(Instant::now() < until, "{by_policy}");
            sleep(Duration::from_millis(20)).await;
        }
    }
    assert_eq!(taught.get("/v1/models/home").await["serving"], 1, "nothing that was trained so serves");
}

#[tokio::test]
async fn a_training_that_cannot_work_says_why_and_one_can_be_cancelled() {
    let taught = Taught::start();
    taught.call(Method::PUT, "/v1/sets/home", None).await.error_for_status().unwrap();
    for drive in ["monday", "tuesday"] {
        let path = format!("/v1/sets/home/frames?room=hall&drive={drive}");
        success(taught.post_picture(&path, room(0, drive.len() as u32)).await).await;
    }
    let wanted = json!({"set": "home", "model": "home", "effort": "fast"});
    let one_room = taught.call(Method::POST, "/v1/trainings", Some(wanted)).await;
    let told = problem(one_room, 400, "bad-request").await;
    assert!(told["detail"].as_str().unwrap().contains("one other room"), "{told}");
    // Somebody has copied files there that are no pictures.
    let attic = taught.folder.path().join("data/sets/home/attic");
    fs::create_dir(&attic).unwrap();
    fs::write(attic.join("1.jpg"), "no picture").unwrap();
    let failed = taught.train().await;
    assert_eq!(failed["state"], "failed", "{failed}");
    assert!(!failed["error"].as_str().unwrap().is_empty(), "{failed}");
    problem(taught.call(Method::POST, "/v1/trainings/1/publish", None).await, 409, "conflict").await;
    for body in [json!({"set": "nowhere", "model": "home"}), json!({"set": "home", "model": "../x"})] {
        let refused = taught.call(Method::POST, "/v1/trainings", Some(body)).await;
        assert!(refused.status().is_client_error(), "{}", refused.status());
    }
    taught.teach(12).await;
    let begun = taught.post("/v1/trainings", json!({"set": "home", "model": "home"})).await;
    let other =
        taught.call(Method::POST, "/v1/trainings", Some(json!({"set": "home", "model": "home"}))).await;
    problem(other, 409, "conflict").await;
    taught.post(&format!("/v1/trainings/{}/cancel", begun["id"]), json!({})).await;
    assert_eq!(taught.ended(&begun).await["state"], "cancelled");
    problem(taught.call(Method::POST, "/v1/trainings/99/cancel", None).await, 404, "not-found").await;
}

#[tokio::test]
async fn what_was_acknowledged_is_there_after_a_kill_and_a_training_that_ran_has_failed() {
    let mut taught = Taught::start();
    taught.teach(2).await;
    let mut n_expected = 6;
    for round in 0..6_u32 {
        let adding = async {
            for shift in 0.. {
                let path = format!("/v1/sets/home/frames?room=attic&drive={round}");
                let call = client().post(format!("{}{path}", taught.running.url));
                let sent = call
                    .header("content-type", "application/octet-stream")
                    .body(room(0, 1000 * (round + 1) + shift));
                if sent.send().await.is_ok_and(|answer| answer.status() == 200) {
                    n_expected += 1;
                }
            }
        };
        let _ = timeout(Duration::from_millis(40 + u64::from(17 * round)), adding).await;
        if round == 5 {
            taught.post("/v1/trainings", json!({"set": "home", "model": "home"})).await;
        }
        taught = taught.again();
        let total = taught.get("/v1/sets/home/frames").await["total"].as_u64().unwrap();
        // The one that was under way may be there or not.
        assert!(total == n_expected || total == n_expected + 1, "{total} of {n_expected}");
        n_expected = total;
    }
    let training = taught.get("/v1/trainings/1").await;
    assert_eq!(training["state"], "failed", "{training}");
    let newest = taught.get("/v1/sets/home").await["changes"][0].clone();
    taught.post(&format!("/v1/sets/home/changes/{}/undo", newest["id"]), json!({})).await;
    assert_eq!(taught.get("/v1/sets/home/frames").await["total"], n_expected - 1);
}

#[tokio::test]
async fn names_with_markup_are_only_names_and_paths_lead_nowhere() {
    let taught = Taught::start();
    taught.call(Method::PUT, "/v1/sets/home", None).await.error_for_status().unwrap();
    let name = "%3Cimg src=x onerror=alert(1)%3E.jpg";
    let path = format!("/v1/sets/home/frames?room=hall&name={name}");
    let refused = success(taught.post_picture(&path, b"no picture".to_vec()).await).await;
    assert_eq!(refused["refused"][0]["name"], "<img src=x onerror=alert(1)>.jpg");
    for room in ["..", "a/b", "%00", ".git", "%3Cscript%3E"] {
        let path = format!("/v1/sets/home/frames?room={room}");
        problem(taught.post_picture(&path, room_picture()).await, 400, "bad-request").await;
    }
    for path in ["../roomsight.db", "../../data/roomsight.db", "hall/../../../roomsight.db", "/etc/passwd"] {
        let path = format!("/v1/sets/home/picture?path={path}");
        assert!(taught.call(Method::GET, &path, None).await.status().is_client_error(), "{path}");
    }
    let odd = taught.call(Method::PUT, "/v1/sets/..%2F..", None).await;
    assert!(odd.status().is_client_error(), "{}", odd.status());
    problem(taught.call(Method::GET, "/v1/sets/home/frames?limit=x", None).await, 400, "bad-request").await;
    for width in ["0", "100000", "-1"] {
        let path = format!("/v1/inbox/1/picture?width={width}");
        problem(taught.call(Method::GET, &path, None).await, 400, "bad-request").await;
    }
}

fn room_picture() -> Vec<u8> {
    room(0, 5)
}

#[tokio::test]
async fn keys_are_made_and_revoked_and_each_role_may_do_what_it_says() {
    let taught = Taught::start();
    let refused = taught.call(Method::POST, "/v1/keys", Some(json!({"name": "eve", "role": "robot"}))).await;
    problem(refused, 409, "conflict").await;
    let first = taught.call(Method::POST, "/v1/keys", Some(json!({"name": "anna", "role": "admin"}))).await;
    let cookie = first.headers()["set-cookie"].to_str().unwrap().to_owned();
    assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"), "{cookie}");
    let anna = first.json::<Value>().await.unwrap()["key"].as_str().unwrap().to_owned();
    problem(taught.call(Method::GET, "/v1/sets", None).await, 401, "unauthorized").await;
    let as_key = |key: &str, method: Method, path: &str, body: Option<Value>| {
        let call = client().request(method, format!("{}{path}", taught.running.url)).bearer_auth(key);
        match body {
            Some(body) => call.json(&body),
            None => call,
        }
        .send()
    };
    let mut secrets = Vec::new();
    for role in ["viewer", "robot"] {
        let body = json!({"name": role, "role": role});
        let made = as_key(&anna, Method::POST, "/v1/keys", Some(body)).await.unwrap();
        assert_eq!(made.status(), 201);
        secrets.push(made.json::<Value>().await.unwrap()["key"].as_str().unwrap().to_owned());
    }
    let set = json!({"set": "home", "model": "home"});
    for (method, path, body, by_viewer, by_robot) in [
        (Method::GET, "/v1/sets", None, 200, 403),
        (Method::GET, "/v1/inbox", None, 200, 403),
        (Method::GET, "/v1/trainings", None, 200, 403),
        (Method::GET, "/v1/audit", None, 200, 403),
        (Method::GET, "/v1/session", None, 200, 200),
        (Method::GET, "/v1/keys", None, 403, 403),
        (Method::PUT, "/v1/sets/home", None, 403, 403),
        (Method::POST, "/v1/trainings", Some(set), 403, 403),
        (Method::PUT, "/v1/inbox/rule", Some(json!({"all": true})), 403, 403),
        (Method::POST, "/v1/inbox", None, 403, 403),
        (Method::DELETE, "/v1/keys/anna", None, 403, 403),
    ] {
        for (secret, expected) in secrets.iter().zip([by_viewer, by_robot]) {
            let answer = as_key(secret, method.clone(), path, body.clone()).await.unwrap();
            assert_eq!(answer.status(), expected, "{method} {path}");
        }
    }
    let twice =
        as_key(&anna, Method::POST, "/v1/keys", Some(json!({"name": "robot", "role": "robot"}))).await;
    problem(twice.unwrap(), 409, "conflict").await;
    // Who is signed in with a key that is revoked is out at once.
    let session = as_key(&secrets[0], Method::POST, "/v1/session", None).await.unwrap();
    let cookie = session.headers()["set-cookie"].to_str().unwrap().split(';').next().unwrap().to_owned();
    let signed_in =
        || client().get(format!("{}/v1/sets", taught.running.url)).header("cookie", &cookie).send();
    assert_eq!(signed_in().await.unwrap().status(), 200);
    let gone = as_key(&anna, Method::DELETE, "/v1/keys/viewer", None).await.unwrap();
    assert_eq!(gone.status(), 204);
    assert_eq!(signed_in().await.unwrap().status(), 401);
    let last = as_key(&anna, Method::DELETE, "/v1/keys/anna", None).await.unwrap();
    problem(last, 409, "conflict").await;
    // Keys are there after a restart.
    let taught = taught.again();
    let keys =
        client().get(format!("{}/v1/keys", taught.running.url)).bearer_auth(&anna).send().await.unwrap();
    let keys = success(keys).await;
    let names: Vec<&str> =
        keys["keys"].as_array().unwrap().iter().map(|key| key["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["anna", "robot"]);
}

#[tokio::test]
async fn a_page_of_another_site_can_change_nothing() {
    let taught = Taught::start();
    for (method, path) in [
        (Method::PUT, "/v1/sets/home"),
        (Method::POST, "/v1/trainings"),
        (Method::PUT, "/v1/inbox/rule"),
        (Method::POST, "/v1/keys"),
        (Method::POST, "/v1/session/code"),
    ] {
        let call = client().request(method, format!("{}{path}", taught.running.url));
        let answer =
            call.header("origin", "http://evil.example").json(&json!({"code": "x"})).send().await.unwrap();
        problem(answer, 403, "foreign-site").await;
    }
    assert!(taught.get("/v1/sets").await["sets"].as_array().unwrap().is_empty());
}

#[tokio::test]
async fn a_service_without_a_data_directory_says_so() {
    let models = crate::http::service::models();
    let running = Running::start(&["--models", models.path().to_str().unwrap()]);
    for path in ["/v1/sets", "/v1/inbox", "/v1/trainings", "/v1/audit", "/v1/keys"] {
        let answer = client().get(format!("{}{path}", running.url)).send().await.unwrap();
        let told = problem(answer, 503, "no-data-directory").await;
        assert!(told["detail"].as_str().unwrap().contains("--data"), "{told}");
    }
}

#[tokio::test]
async fn a_disk_that_is_full_keeps_nothing_of_a_request_and_all_that_was_acknowledged() {
    let folder = TempDir::new().unwrap();
    let small = folder.path().join("data");
    fs::create_dir(&small).unwrap();
    fs::create_dir(folder.path().join("models")).unwrap();
    let mount = Command::new("mount").args(["-t", "tmpfs", "-o", "size=600k", "tmpfs"]).arg(&small).output();
    if !mount.is_ok_and(|output| output.status.success()) {
        eprintln!("SKIPPED: a disk that is full, which takes the right to mount one");
        return;
    }
    let taught = Taught { running: Taught::run(folder.path()), folder };
    taught.call(Method::PUT, "/v1/sets/home", None).await.error_for_status().unwrap();
    let mut n_kept = 0;
    let full = loop {
        let path = "/v1/sets/home/frames?room=hall&drive=monday";
        let answer = taught.post_picture(path, room(0, n_kept)).await;
        if answer.status() != 200 {
            break answer;
        }
        n_kept += 1;
        assert!(n_kept < 1000, "the disk never gets full");
    };
    problem(full, 507, "disk-full").await;
    assert_eq!(taught.get("/v1/sets/home/frames").await["total"], n_kept);
    let Taught { folder, mut running } = taught;
    running.kill();
    assert!(Command::new("umount").arg(&small).status().unwrap().success());
    drop(folder);
}
