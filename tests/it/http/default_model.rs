//! Which model answers requests that name none.

use crate::http::models::{manual, settings, until};
use crate::http::service::{Server, frame, models, problem, room, success, write_model, write_other_model};
use roomsight::settings::Settings;
use serde_json::Value;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

impl Server {
    /// The model that answers a request that names none.
    async fn default_answer(&self) -> String {
        let answer = success(self.post("/v1/recognize", room(0, 0)).send().await.unwrap()).await;
        answer["model"]["name"].as_str().unwrap().to_owned()
    }

    async fn told_default(&self) -> Value {
        success(self.get("/v1/models").send().await.unwrap()).await["default"].clone()
    }

    async fn make_default(&self, name: &str) -> reqwest::Response {
        self.put(&format!("/v1/models/{name}/default"), "").send().await.unwrap()
    }

    async fn serves(&self, name: &str) -> bool {
        let model = self.get(&format!("/v1/models/{name}")).send().await.unwrap();
        model.json::<Value>().await.unwrap()["serving"].is_number()
    }

    async fn restarted(mut self, settings: Settings) -> Self {
        self.stop();
        self.stopped().await;
        Self::of(settings).await
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_second_model_does_not_become_the_default_by_its_name() {
    let folder = models();
    let server = Server::of(settings(&folder)).await;
    assert_eq!(server.default_answer().await, "lab");
    write_other_model(&folder.path().join("annex/1"));
    until(async || server.serves("annex").await).await;
    assert_eq!((server.default_answer().await.as_str(), server.told_default().await), ("lab", "lab".into()));
    let server = server.restarted(settings(&folder)).await;
    assert_eq!(server.default_answer().await, "lab");

    let made = success(server.make_default("annex").await).await;
    assert_eq!((&made["name"], &made["default"]), (&"annex".into(), &true.into()));
    assert_eq!(server.default_answer().await, "annex");
    let lab = success(server.get("/v1/models/lab").send().await.unwrap()).await;
    assert_eq!(lab["default"], false);
    let server = server.restarted(settings(&folder)).await;
    assert_eq!(
        (server.default_answer().await.as_str(), server.told_default().await),
        ("annex", "annex".into())
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_model_that_comes_while_no_service_runs_is_not_the_default_either() {
    let folder = models();
    let mut server = Server::of(settings(&folder)).await;
    server.stop();
    server.stopped().await;
    write_other_model(&folder.path().join("annex/1"));
    let server = Server::of(settings(&folder)).await;
    assert!(server.serves("annex").await);
    assert_eq!(server.default_answer().await, "lab");
}

#[tokio::test(flavor = "multi_thread")]
async fn services_of_one_repository_have_one_default() {
    let folder = models();
    write_other_model(&folder.path().join("annex/1"));
    let first = Server::of(settings(&folder)).await;
    // Nobody had said anything.
    assert_eq!(first.default_answer().await, "annex");
    let second = Server::of(settings(&folder)).await;
    success(second.make_default("lab").await).await;
    until(async || first.default_answer().await == "lab").await;
    // By a command, say.
    fs::write(folder.path().join("default.json"), r#"{"epoch": 9, "model": "annex"}"#).unwrap();
    for server in [&first, &second] {
        until(async || server.default_answer().await == "annex").await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn with_the_policy_manual_the_first_that_serves_is_the_default() {
    let folder = models();
    write_other_model(&folder.path().join("annex/1"));
    let server = Server::of(manual(&folder)).await;
    assert_eq!(server.told_default().await, Value::Null);
    problem(server.make_default("lab").await, 409, "version-not-ready").await;
    success(server.activate(1).await).await;
    assert_eq!(server.told_default().await, "lab");
    let activated = server.post("/v1/models/annex/versions/1/activate", vec![]).send().await.unwrap();
    success(activated).await;
    assert_eq!(server.default_answer().await, "lab");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_the_default_is_refused_and_the_setting_comes_first() {
    let folder = models();
    write_other_model(&folder.path().join("annex/1"));
    let set = Settings { model: "lab".into(), ..settings(&folder) };
    let server = Server::of(set).await;
    assert_eq!(server.default_answer().await, "lab");
    problem(server.make_default("attic").await, 404, "no-such-model").await;
    let told = problem(server.make_default("annex").await, 409, "conflict").await;
    assert!(told["detail"].as_str().unwrap().contains("setting `model`"), "{told}");
    success(server.make_default("lab").await).await;
    assert_eq!(server.default_answer().await, "lab");
    assert!(
        !folder.path().join("default.json").exists(),
        "another service may have another setting, or none"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn where_the_default_is_gone_no_other_takes_its_place() {
    let folder = models();
    let server = Server::of(settings(&folder)).await;
    write_other_model(&folder.path().join("annex/1"));
    until(async || server.serves("annex").await).await;
    let unload = server.post("/v2/repository/models/lab/unload", vec![]).send().await.unwrap();
    assert_eq!(unload.status(), 200);
    problem(server.post("/v1/recognize", frame()).send().await.unwrap(), 503, "no-model").await;
    assert_eq!(server.delete("/v1/models/lab/versions/1").send().await.unwrap().status(), 204);
    fs::remove_dir_all(folder.path().join("lab")).unwrap();
    let gone = async |server: &Server| {
        let told =
            problem(server.post("/v1/recognize", frame()).send().await.unwrap(), 503, "no-model").await;
        told["detail"].as_str().unwrap().contains("\"lab\" is not there")
    };
    until(async || gone(&server).await).await;
    problem(server.get("/readyz").send().await.unwrap(), 503, "no-model").await;
    let server = server.restarted(settings(&folder)).await;
    assert!(gone(&server).await);
    success(server.post("/v1/recognize?model=annex", frame()).send().await.unwrap()).await;
    success(server.make_default("annex").await).await;
    success(server.get("/readyz").send().await.unwrap()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn where_it_cannot_be_kept_it_stays_for_as_long_as_the_service_runs() {
    let folder = models();
    // Nobody writes over a folder.
    fs::create_dir(folder.path().join("default.json")).unwrap();
    let server = Server::of(settings(&folder)).await;
    write_model(&folder.path().join("annex/1"));
    until(async || server.serves("annex").await).await;
    assert_eq!(server.default_answer().await, "lab");
    problem(server.make_default("annex").await, 503, "no-repository").await;
    assert_eq!(server.default_answer().await, "lab");

    let own = Settings { models: folder.path().join("lab/1"), ..Settings::default() };
    let server = Server::of(own).await;
    assert_eq!(server.default_answer().await, "lab");
}

/// What operators deploy is exchanged as a whole, behind a link.
#[cfg(unix)]
#[tokio::test(flavor = "multi_thread")]
async fn a_repository_behind_a_link_is_followed_when_the_link_leads_elsewhere() {
    use std::os::unix::fs::symlink;
    let parent = TempDir::new().unwrap();
    let at = |name: &str| parent.path().join(name);
    write_model(&at("..1/lab/1"));
    write_model(&at("..2/lab/1"));
    write_other_model(&at("..2/lab/2"));
    symlink("..1", at("..data")).unwrap();
    symlink("..data", at("models")).unwrap();
    let served = Settings { models: at("models"), models_poll_ms: 20, ..Settings::default() };
    let server = Server::of(served).await;
    assert_eq!(server.default_answer().await, "lab");
    symlink(Path::new("..2"), at("..data_tmp")).unwrap();
    fs::rename(at("..data_tmp"), at("..data")).unwrap();
    until(async || {
        server.get("/v1/models/lab").send().await.unwrap().json::<Value>().await.unwrap()["serving"] == 2
    })
    .await;
    assert_eq!(server.default_answer().await, "lab");
}
