//! `roomsight models` and `train --publish`, in a folder and in a running service.

use super::{
    DONE, FAILED, GATE_FAILED, LAB, QUICK, ROOMS, WRONG_USAGE, done, frame, json, path, refused, roomsight,
    write_rooms,
};
use flate2::Compression;
use flate2::write::GzEncoder;
use roomsight::repository::package::pack;
use serde_json::Value;
use std::fs;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;

const PATIENCE: Duration = Duration::from_secs(20);

/// What `models` prints of a place, as JSON.
fn models(store: &[&str], arguments: &[&str]) -> Value {
    json(&[&["models", "--json"], store, arguments].concat())
}

/// The versions of a model, the highest first, with their labels.
fn labels(model: &Value) -> Vec<String> {
    let told = |version: &Value| {
        let labels = version["labels"].as_array().unwrap().iter().map(|label| label.as_str().unwrap());
        format!("{} {}", version["version"], labels.collect::<Vec<_>>().join(",")).trim_end().to_owned()
    };
    model["versions"].as_array().unwrap().iter().map(told).collect()
}

/// Pushes twice, lets versions serve, tries them, and removes one; `store` is a repository or a service.
fn walk(store: &[&str]) {
    let model = LAB.model();
    let step = |arguments: &[&str]| models(store, arguments);
    for version in [1, 2, 3] {
        assert_eq!(step(&["push", &model, "lab"])["version"], version);
    }
    step(&["activate", "lab/1"]);
    step(&["activate", "lab/2"]);
    // Nothing changes.
    step(&["activate", "lab/2"]);
    let shown = step(&["show", "lab"]);
    assert_eq!(labels(&shown), ["3", "2 stable", "1 previous"]);
    assert_eq!(step(&["rollback", "lab"])["version"], 1);
    let shown = step(&["label", "canary", "lab/3", "--share", "0.25"]);
    assert_eq!(labels(&shown), ["3 canary", "2 previous", "1 stable"]);
    assert_eq!(shown["versions"][0]["share"], 0.25);

    let failing = |arguments: &[&str]| refused(FAILED, &[&["models"], store, arguments].concat());
    let stale = failing(&["activate", "lab/2", "--epoch", "1"]);
    assert!(stale.contains("epoch"), "{stale}");
    let used = failing(&["delete", "lab/3"]);
    assert!(used.contains("canary"), "{used}");
    let stable = failing(&["label", "shadow", "lab/1"]);
    assert!(stable.contains("stable"), "{stable}");
    let unknown = failing(&["activate", "lab/9"]);
    assert!(unknown.contains("no version"), "{unknown}");
    let unfit = failing(&["label", "shadow", "lab/3", "--share", "0.5"]);
    assert!(unfit.contains("--share"), "{unfit}");

    assert_eq!(step(&["default", "lab"])["default"], true);
    assert!(done(&[&["models"], store, &["default", "lab"]].concat()).contains("lab answers"));
    let listed = done(&[&["models"], store, &["list"]].concat());
    assert!(listed.contains("lab answers requests that name no model"), "{listed}");
    let unknown = failing(&["default", "attic"]);
    assert!(unknown.contains("attic"), "{unknown}");

    let epoch = shown["epoch"].as_u64().unwrap().to_string();
    step(&["label", "canary", "lab", "--remove", "--epoch", &epoch]);
    step(&["delete", "lab/3"]);
    assert_eq!(labels(&step(&["list"])[0]), ["2 previous", "1 stable"]);
    let version = step(&["show", "lab/1"]);
    assert_eq!(version["rooms"], serde_json::json!(ROOMS));
    assert_eq!(version["digest"].as_str().unwrap().len(), 64);
    assert!(version["card"]["n_frames"].is_number(), "{version}");
    let table = done(&[&["models"], store, &["show", "lab/1"]].concat());
    assert!(table.contains("trained on") && table.contains("dots"), "{table}");
    assert!(done(&[&["models"], store, &["list"]].concat()).contains("stable"));
    // 3 was canary, and is gone: no other version gets its number.
    assert_eq!(step(&["push", &model, "lab"])["version"], 4);
}

#[test]
fn models_come_and_go_in_a_folder() {
    let folder = TempDir::new().unwrap();
    walk(&["--models", &path(&folder, "models")]);
}

#[test]
fn a_second_model_is_not_the_default_and_an_archive_can_be_pushed() {
    let folder = TempDir::new().unwrap();
    let store = ["--models", &path(&folder, "models")];
    models(&store, &["push", &LAB.model(), "lab"]);
    let archive = path(&folder, "lab.tar.gz");
    let mut encoder = GzEncoder::new(fs::File::create(&archive).unwrap(), Compression::fast());
    pack(Path::new(&LAB.model()), &mut encoder).unwrap();
    encoder.finish().unwrap();
    models(&store, &["push", &archive, "annex"]);
    let defaults = |listed: &Value| {
        let default = |model: &Value| model["default"] == true;
        listed.as_array().unwrap().iter().map(default).collect::<Vec<_>>()
    };
    assert_eq!(defaults(&models(&store, &["list"])), [false, true], "annex, lab");
    models(&store, &["default", "annex"]);
    assert_eq!(defaults(&models(&store, &["list"])), [true, false]);
    // What is published is there, whatever the file of the default model says.
    fs::write(path(&folder, "models/default.json"), "{").unwrap();
    assert_eq!(models(&store, &["push", &archive, "annex"])["version"], 2);
}

/// Kills the service when the test ends.
struct Service(Child);

impl Drop for Service {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn models_come_and_go_in_a_running_service() {
    let folder = TempDir::new().unwrap();
    let repository = path(&folder, "models");
    done(&["models", "push", &LAB.model(), "first/1", "--models", &repository]);
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let arguments = ["serve", "--models", &repository, "--listen", &address, "--log-format", "json"];
    let mut serve = Command::new(env!("CARGO_BIN_EXE_roomsight"));
    let serve = serve.args(arguments).args(["--set", "policy=manual"]).stderr(Stdio::null());
    let _service = Service(serve.spawn().unwrap());
    let url = format!("http://{address}");
    let started = Instant::now();
    while roomsight(&["models", "list", "--url", &url]).code != DONE {
        assert!(started.elapsed() < PATIENCE, "it never answered");
        sleep(Duration::from_millis(20));
    }
    done(&["models", "delete", "first/1", "--url", &url]);
    walk(&["--url", &url]);
    let error = refused(FAILED, &["models", "verify", "--url", &url]);
    assert!(error.contains("models list"), "{error}");
}

#[test]
fn verify_tells_versions_that_would_not_serve() {
    let folder = TempDir::new().unwrap();
    let repository = path(&folder, "models");
    let store = ["--models", &repository];
    for version in ["lab/1", "lab/2"] {
        models(&store, &["push", &LAB.model(), version]);
    }
    let verdicts = models(&store, &["verify"]);
    assert_eq!(verdicts[0]["golden_frames"], 3, "{verdicts}");
    let list = Path::new(&repository).join("lab/2/golden/golden.json");
    let swapped = fs::read_to_string(&list).unwrap().replace("\"place\": \"dots\"", "\"place\": \"bars\"");
    fs::write(&list, swapped).unwrap();
    let told = roomsight(&["models", "--models", &repository, "verify"]);
    assert_eq!(told.code, FAILED);
    assert!(told.out.contains("dots.png: this golden frame") && told.err.contains("1 of 2"), "{}", told.out);
    assert_eq!(models(&store, &["verify", "lab/1"]).as_array().unwrap().len(), 1);
    let error = refused(FAILED, &["models", "--models", &repository, "activate", "lab/2"]);
    assert!(error.contains("golden frame"), "{error}");
    assert_eq!(models(&store, &["show", "lab"])["serving"], Value::Null);
}

#[test]
fn training_ends_in_a_repository() {
    let folder = TempDir::new().unwrap();
    let (repository, data) = (path(&folder, "models"), LAB.data());
    let train = ["train", &data, "--publish", &repository, "--name", "lab"];
    let told = done(&[&train, &QUICK[..]].concat());
    assert!(told.contains("lab/1 is ready") && told.contains("serve --models"), "{told}");
    let report = json(&[&train, &QUICK[..], &["--json"]].concat());
    assert_eq!(report["published"], "lab/2");
    assert!(Path::new(report["model"].as_str().unwrap()).join("model.safetensors").exists());
    let listed = models(&["--models", &repository], &["list"]);
    assert_eq!(labels(&listed[0]), ["2", "1"]);
    let second = ["train", &data, "--publish", &repository, "--name", "annex"];
    let told = done(&[&second, &QUICK[..]].concat());
    assert!(told.contains("answered by lab") && told.contains("models default annex --models"), "{told}");

    for (arguments, reason) in [
        (vec!["--publish", &repository], "--name"),
        (vec!["--name", "lab"], "--publish"),
        (vec!["--publish", &repository, "--name", "../lab"], "letters"),
        (vec!["--publish", &repository, "--name", "lab", "--output", "x"], "--output"),
    ] {
        let error = refused(WRONG_USAGE, &[&["train", &data], &arguments[..]].concat());
        assert!(error.contains(reason), "{arguments:?}: {error}");
    }
    let own = path(&folder, "models/lab/1");
    let error = refused(FAILED, &["train", &data, "--publish", &own, "--name", "lab"]);
    assert!(error.contains("own folder"), "{error}");
}

#[test]
fn a_worse_model_is_published_only_where_that_is_wanted() {
    let folder = TempDir::new().unwrap();
    let (repository, data) = (path(&folder, "models"), path(&folder, "rooms"));
    write_rooms(&folder.path().join("rooms"));
    let train = ["train", &data, "--publish", &repository, "--name", "lab"];
    done(&[&train, &QUICK[..]].concat());
    // All is the same in words that are two.
    let coarse = [&train[..], &["--set", "representation.n_words=2"]].concat();
    let error = refused(GATE_FAILED, &coarse);
    assert!(error.contains("Beside lab/1, which serves: right on the frames that each held out"), "{error}");
    assert_eq!(labels(&models(&["--models", &repository], &["list"])[0]), ["1"]);
    for room in ROOMS {
        for shift in 0..8 {
            let picture = folder.path().join(format!("rooms/{room}/more{shift}.png"));
            frame(room, 3 + 7 * shift).save(picture).unwrap();
        }
    }
    let error = refused(GATE_FAILED, &coarse);
    assert!(error.contains("right on frames that neither had learned") && error.contains("of 24"), "{error}");
    let report = json(&[&coarse[..], &["--even-if-worse", "--json"]].concat());
    assert_eq!((&report["published"], &report["comparison"]["is_worse"]), (&"lab/2".into(), &true.into()));
    let told = done(&[&train, &QUICK[..]].concat());
    assert!(told.contains("Beside lab/2, which serves") && told.contains("lab/3 is ready"), "{told}");

    let told = done(&["evaluate", &path(&folder, "models/lab"), &data]);
    assert!(told.contains("Of these frames the model has learned 60"), "{told}");
    let told = done(&["evaluate", &LAB.model(), &path(&folder, "rooms/bars/..")]);
    assert!(told.contains("Of these frames the model has learned 36"), "{told}");
}

#[test]
fn wrong_models_and_names_are_refused_with_a_reason() {
    let folder = TempDir::new().unwrap();
    let repository = path(&folder, "models");
    let store = ["models", "--models", &repository];
    let empty = path(&folder, "empty");
    fs::create_dir(&empty).unwrap();
    let error = refused(FAILED, &[&store[..], &["push", &empty, "lab"]].concat());
    assert!(error.contains("holds no model"), "{error}");
    done(&[&store[..], &["push", &LAB.model(), "lab/3"]].concat());
    let error = refused(FAILED, &[&store[..], &["push", &LAB.model(), "lab/3"]].concat());
    assert!(error.contains("exists already"), "{error}");
    let error = refused(WRONG_USAGE, &[&store[..], &["activate", "lab"]].concat());
    assert!(error.contains("\"lab\" is no name"), "{error}");
    for number in ["007", "+7", "18446744073709551615"] {
        let error =
            refused(WRONG_USAGE, &[&store[..], &["push", &LAB.model(), &format!("lab/{number}")]].concat());
        assert!(error.contains("such as 7"), "{error}");
    }
    done(&[&store[..], &["push", &LAB.model(), "lab/18446744073709551614"]].concat());
    let error = refused(FAILED, &[&store[..], &["push", &LAB.model(), "lab"]].concat());
    assert!(error.contains("no number is left"), "{error}");
    let error = refused(WRONG_USAGE, &[&store[..], &["show", "../lab"]].concat());
    assert!(error.contains("NAME/VERSION"), "{error}");
    let error = refused(FAILED, &["models", "--models", &path(&folder, "missing"), "list"]);
    assert!(error.contains("missing"), "{error}");
}
