//! The service is killed while models come and go: what it acknowledged is there when it is back.

use crate::http::command::Running;
use crate::http::service::{MODEL, OTHER_MODEL, client, room};
use roomsight::repository::package::pack;
use roomsight_recognition::model::Model;
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::time::Duration;
use tempfile::TempDir;
use tokio::time::timeout;

/// How often the service is killed. `ROOMSIGHT_KILLS=200 cargo test --test it http::kill` kills it more often.
fn n_kills() -> u64 {
    std::env::var("ROOMSIGHT_KILLS").map_or(12, |n| n.parse().unwrap())
}

#[derive(Clone, Copy, Debug)]
enum Operation {
    Upload(u64),
    Activate(u64),
    Delete(u64),
    /// Lets a model answer requests that name none.
    Default(&'static str),
}

/// What the service has acknowledged.
#[derive(Debug)]
struct Acknowledged {
    versions: BTreeSet<u64>,
    stable: u64,
    default: &'static str,
    /// What it was asked for and has not acknowledged: it may have been done, or not.
    open: Option<Operation>,
    n_uploaded: u64,
}

impl Acknowledged {
    /// The operation that comes next: many uploads, some activations, and few versions left.
    fn next(&self, idx: u64) -> Operation {
        let others = || self.versions.iter().copied().filter(|&version| version != self.stable);
        match idx % 5 {
            4 => Operation::Default(if self.default == "lab" { "attic" } else { "lab" }),
            1 | 3 => others().next_back().map_or(Operation::Upload(self.n_uploaded + 2), Operation::Activate),
            2 if self.versions.len() > 3 => {
                others().next().map_or(Operation::Activate(self.stable), Operation::Delete)
            }
            _ => Operation::Upload(self.n_uploaded + 2),
        }
    }

    fn done(&mut self, operation: Operation) {
        match operation {
            Operation::Upload(version) => {
                self.versions.insert(version);
            }
            Operation::Activate(version) => self.stable = version,
            Operation::Delete(version) => {
                self.versions.remove(&version);
            }
            Operation::Default(name) => self.default = name,
        }
    }

    /// Takes over what the service that is back says of the operation that was open.
    fn settle(&mut self, models: &Value) {
        let lab = &models["models"][1];
        let default = models["default"].as_str().unwrap();
        let number = |version: &Value| version.as_u64().unwrap();
        let versions: BTreeSet<u64> =
            lab["versions"].as_array().unwrap().iter().map(|version| number(&version["version"])).collect();
        let stable = number(&lab["serving"]);
        let before = format!("{self:?}");
        if let Some(operation) = self.open.take()
            && (versions != self.versions || stable != self.stable || default != self.default)
        {
            self.done(operation);
        }
        let expected = (&self.versions, self.stable, self.default);
        assert_eq!((&versions, stable, default), expected, "{before}");
    }
}

/// Odd versions call the rooms by other names than even ones.
fn model_of(version: u64) -> &'static Model {
    if version % 2 == 1 { &MODEL } else { &OTHER_MODEL }
}

fn packed(version: u64) -> Vec<u8> {
    let folder = TempDir::new().unwrap();
    model_of(version).save(&folder.path().join("1"), &[]).unwrap();
    let mut body = Vec::new();
    pack(&folder.path().join("1"), &mut body).unwrap();
    body
}

/// Does one operation after the other until the connection breaks.
async fn operate(url: &str, known: &mut Acknowledged, bodies: [&[u8]; 2]) {
    for idx in 0.. {
        let operation = known.next(idx);
        known.open = Some(operation);
        let call = match operation {
            Operation::Upload(version) => {
                known.n_uploaded += 1;
                client()
                    .put(format!("{url}/lab/versions/{version}"))
                    .body(bodies[version as usize % 2].to_vec())
            }
            Operation::Activate(version) => client().post(format!("{url}/lab/versions/{version}/activate")),
            Operation::Delete(version) => client().delete(format!("{url}/lab/versions/{version}")),
            Operation::Default(name) => client().put(format!("{url}/{name}/default")),
        };
        let Ok(answer) = call.send().await else { return };
        assert!(answer.status().is_success(), "{operation:?}: {answer:?}");
        known.done(operation);
        known.open = None;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_acknowledged_is_there_after_the_service_was_killed() {
    let folder = TempDir::new().unwrap();
    MODEL.save(&folder.path().join("lab/1"), &[]).unwrap();
    MODEL.save(&folder.path().join("attic/1"), &[]).unwrap();
    // Somebody has decided that they serve.
    for name in ["lab", "attic"] {
        let record = r#"{"epoch": 1, "settled": 1, "stable": 1}"#;
        fs::write(folder.path().join(name).join("serving.json"), record).unwrap();
    }
    let bodies = [packed(0), packed(1)];
    let versions = BTreeSet::from([1]);
    let mut known = Acknowledged { versions, stable: 1, default: "attic", open: None, n_uploaded: 0 };
    for kill_idx in 0..=n_kills() {
        let mut running =
            Running::start(&["--models", folder.path().to_str().unwrap(), "--policy", "manual"]);
        let url = format!("{}/v1/models", running.url);
        let models = client().get(&url).send().await.unwrap().json::<Value>().await.unwrap();
        known.settle(&models);
        let recognize = client().post(format!("{}/v1/recognize?model=lab", running.url)).body(room(0, 0));
        let recognize = recognize.header("content-type", "application/octet-stream");
        let answer = recognize.send().await.unwrap().json::<Value>().await.unwrap();
        assert_eq!(answer["model"]["version"], known.stable, "{answer}");
        let expected = if known.stable % 2 == 1 { "stripes" } else { "x" };
        assert_eq!(answer["room"], expected, "{answer}");
        for version in &known.versions {
            Model::load(&folder.path().join("lab").join(version.to_string())).expect("each version is whole");
        }
        // Moments spread over what a few operations take.
        let moment = Duration::from_micros(kill_idx * 7919 % 40_000);
        let operating = operate(&url, &mut known, [&bodies[0], &bodies[1]]);
        let _ = timeout(moment, operating).await;
        running.kill();
    }
    println!("killed {} times during {} uploads", n_kills() + 1, known.n_uploaded);
    assert!(known.n_uploaded > 0, "nothing was under way");
    drop(Running::start(&["--models", folder.path().to_str().unwrap(), "--policy", "manual"]));
    let left: Vec<_> = fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.starts_with(".staged-"))
        .collect();
    assert!(left.is_empty(), "what an interrupted operation left is removed at the next start: {left:?}");
}
