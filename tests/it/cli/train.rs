//! What `train`, `tune` and `forget` do and say.

use super::{FAILED, LAB, QUICK, ROOMS, WRONG_USAGE, done, frame, json, path, refused};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

#[test]
fn train_prints_held_out_rates_and_what_to_try_next() {
    let trained = &LAB.trained;
    assert!(trained.contains("Held-out answers to 36 of 36 frames"), "{trained}");
    for word in ROOMS.into_iter().chain(["all frames", "recognize", "serve --models"]) {
        assert!(trained.contains(word), "{word}: {trained}");
    }
    assert!(!trained.contains("simulated"), "{trained}");
}

#[test]
fn described_parts_train_the_same_model() {
    let folder = TempDir::new().unwrap();
    let (parts, model) = (path(&folder, "parts"), path(&folder, "model"));
    for part in ["2/2", "1/2"] {
        let written =
            json(&[&["describe", &LAB.data(), "-o", &parts, "--part", part, "--json"], &QUICK[..]].concat());
        assert_eq!((&written["n_frames"], &written["was_there"]), (&18.into(), &false.into()), "{written}");
    }
    let again = done(&[&["describe", &LAB.data(), "-o", &parts, "--part", "1/2"], &QUICK[..]].concat());
    assert!(again.contains("Part 1/2 is there already: 18 frames"), "{again}");
    done(&[&["train", &parts, "-o", &model], &QUICK[..]].concat());
    let file = |folder: &str, name: &str| fs::read(Path::new(folder).join(name)).unwrap();
    for name in ["model.safetensors", "model.json", "golden/golden.json"] {
        assert!(file(&model, name) == file(&LAB.model(), name), "{name}");
    }
    let rates = |data: &str| json(&["evaluate", &model, data, "--json"])["evaluation"].clone();
    assert_eq!(rates(&parts), rates(&LAB.data()));
    let split = |data: &str| done(&[&["validate", data, "--folds", "3"], &QUICK[..]].concat());
    assert_eq!(split(&parts), split(&LAB.data()));
    let error =
        refused(FAILED, &["train", &parts, "-o", &path(&folder, "other"), "--set", "longest_side=80"]);
    assert!(error.contains("described in another way (at another working size)"), "{error}");
    let error = refused(FAILED, &["describe", &parts, "-o", &path(&folder, "again")]);
    assert!(error.contains("is described already"), "{error}");
    let error =
        refused(FAILED, &[&["describe", &LAB.data(), "-o", &parts, "--part", "1/50"], &QUICK[..]].concat());
    assert!(error.contains("part 1/50 of 36 frames is empty"), "{error}");
    let error = refused(WRONG_USAGE, &["describe", &LAB.data(), "-o", &parts, "--part", "3/2"]);
    assert!(error.contains("a part is NUMBER/OF"), "{error}");
}

#[test]
fn described_like_a_model_they_measure_it() {
    let folder = TempDir::new().unwrap();
    let parts = path(&folder, "parts");
    done(&["describe", &LAB.data(), "-o", &parts, "--like", &LAB.model()]);
    let rates = |data: &str| json(&["evaluate", &LAB.model(), data, "--json"])["evaluation"].clone();
    assert_eq!(rates(&parts), rates(&LAB.data()));
}

#[test]
fn a_model_is_never_overwritten() {
    let file = Path::new(&LAB.model()).join("model.safetensors");
    let before = fs::read(&file).unwrap();
    let error = refused(FAILED, &["train", &LAB.data(), "--output", &LAB.model()]);
    assert!(error.contains("exists already"), "{error}");
    assert_eq!(fs::read(&file).unwrap(), before);
}

#[test]
fn tuning_writes_a_configuration_that_training_takes() {
    let folder = TempDir::new().unwrap();
    for drive in ["monday", "tuesday"] {
        for room in ROOMS {
            fs::create_dir_all(folder.path().join("rooms").join(room).join(drive)).unwrap();
            for shift in 0..4 {
                let shift = shift + if drive == "monday" { 0 } else { 40 };
                frame(room, 7 * shift)
                    .save(folder.path().join(format!("rooms/{room}/{drive}/{shift}.png")))
                    .unwrap();
            }
        }
    }
    let (data, best) = (path(&folder, "rooms"), path(&folder, "best.toml"));
    let tune = ["tune", &data, "--output", &best, "--try", "classifier.c=0.5,2", "--folds", "2", "--json"];
    let tried = json(&[&tune, &QUICK[..]].concat());
    assert_eq!(tried.as_array().unwrap().len(), 2);
    assert_eq!(tried[1]["parameters"][0], "classifier.c=2");
    let mean = |idx: usize| tried[idx]["rate"]["mean"].as_f64().unwrap();
    let config: toml::Table = fs::read_to_string(&best).unwrap().parse().unwrap();
    assert_eq!(
        config["opinions"]["bag"]["classifier"]["c"].as_float(),
        Some(if mean(1) > mean(0) { 2.0 } else { 0.5 })
    );
    assert_eq!(tried[usize::from(mean(1) > mean(0))]["taken"], true);
    done(&["train", &data, "--config", &best, "--output", &path(&folder, "models/rooms/1")]);

    assert!(refused(FAILED, &tune).contains("exists already"));
    let nan = ["tune", &data, "--output", &path(&folder, "other.toml"), "--try", "classifier.c=1,nan"];
    assert!(refused(FAILED, &nan).contains("c is NaN"));

    // What cannot be trained does not keep the rest from it, unless there is no rest.
    let other = path(&folder, "other.toml");
    let tune = ["tune", &data, "--output", &other, "--folds", "2", "--json", "--try"];
    let said = refused(FAILED, &[&tune[..], &["representation.n_words=50000,60000"]].concat());
    assert!(said.contains("too few for a vocabulary of 50000 words"), "{said}");
    assert!(!Path::new(&other).exists());
    let tried = json(&[&tune[..], &["representation.n_words=60000,20"]].concat());
    assert!(tried[0]["impossible"].as_str().unwrap().contains("too few") && tried[0]["rate"].is_null());
    assert!(tried[1]["impossible"].is_null() && tried[1]["rate"]["mean"].is_number());

    let one_drive = [data.as_str(), "--sequences", "monday"];
    let other = path(&folder, "folds.toml");
    let more_folds_than_frames = [&["tune", "--output", &other, "--folds", "500"][..], &one_drive].concat();
    assert!(refused(FAILED, &more_folds_than_frames).contains("fewer than 500 folds"));
    let more_folds_than_frames = [&["validate", "--folds", "500"][..], &one_drive].concat();
    assert!(refused(FAILED, &more_folds_than_frames).contains("fewer than 500 folds"));
}

/// Frames of all rooms in drives of these names, each from places of its own.
fn write_drives(folder: &Path, drives: &[&str]) {
    for (drive, first) in drives.iter().zip((0..).step_by(40)) {
        for room in ROOMS {
            fs::create_dir_all(folder.join(room).join(drive)).unwrap();
            for shift in 0..6 {
                frame(room, 7 * (first + shift))
                    .save(folder.join(format!("{room}/{drive}/{shift}.png")))
                    .unwrap();
            }
        }
    }
}

#[test]
fn drives_are_added_to_a_model() {
    let folder = TempDir::new().unwrap();
    write_drives(&folder.path().join("rooms"), &["monday", "tuesday", "friday"]);
    let [data, first, second] = ["rooms", "models/rooms/1", "models/rooms/2"].map(|name| path(&folder, name));
    let kernel = ["--set", "classifier.kind=kernel_svm"];
    let monday =
        ["train", &data, "--sequences", "monday", "--output", &first, "--description", "three rooms"];
    done(&[&monday, &QUICK[..], &kernel].concat());

    let add = ["train", &data, "--sequences", "tuesday,friday", "--add", &first, "--output", &second];
    let added = done(&[&add[..], &["--forget", "0.05"]].concat());
    for said in ["Held-out answers to 36 of 36 frames, given before they were learned", "tuesday", "0.05"] {
        assert!(added.contains(said), "{said}: {added}");
    }
    let card = json(&["inspect", "--json", &second])["card"].clone();
    assert_eq!((&card["n_frames"], &card["description"]), (&54.into(), &"three rooms".into()), "{card}");
    assert_eq!(card["sequences"], serde_json::json!(["monday", "friday", "tuesday"]), "{card}");
    assert_eq!(card["additions"][0]["sequence"], "friday", "{card}");
    assert_eq!(card["measured"].as_array().unwrap().len(), 2, "{card}");
    assert!(done(&["inspect", &second]).contains("added later"));
    let report = json(&["evaluate", "--json", &second, &data]);
    assert!(report["evaluation"]["overall"]["rate"].as_f64().unwrap() > 0.9, "{report}");

    let again = ["train", &data, "--sequences", "tuesday", "--add", &second, "--output", &path(&folder, "3")];
    assert!(refused(FAILED, &again).contains("tuesday before"));
    let boosted = path(&folder, "boosted");
    let boost = ["--set", "classifier.kind=boost", "--set", "classifier.n_rounds=3"];
    done(&[&["train", &data, "--output", &boosted], &QUICK[..], &boost].concat());
    let to_boost = ["train", &data, "--add", &boosted, "--output", &path(&folder, "3")];
    assert!(refused(FAILED, &to_boost).contains("the classifier boost"));
    for (more, reason) in [
        (["--set", "seed=1"], "--set"),
        (["--camera", "perspective"], "--camera"),
        (["--forget", "-1"], "from 0 to below 1"),
        (["--config", "c.toml"], "--config"),
    ] {
        let said = refused(WRONG_USAGE, &[&to_boost[..], &more].concat());
        assert!(said.contains(reason), "{said}");
    }
    let alone = ["train", &data, "--output", &path(&folder, "3"), "--forget", "0.1"];
    assert!(refused(WRONG_USAGE, &alone).contains("--add"));
}

#[test]
fn a_cue_is_switched_on_by_one_line() {
    let folder = TempDir::new().unwrap();
    let model = path(&folder, "model");
    let cue = ["--set", "cue.kind=frame_lbp"];
    done(&[&["train", &LAB.data(), "--output", &model], &QUICK[..], &cue].concat());
    assert!(done(&["inspect", &model]).contains("patterns"));
    let report = json(&["evaluate", "--json", &model, &LAB.data()]);
    assert_eq!(report["evaluation"]["overall"]["rate"], 1.0);
    done(&[&["validate", &LAB.data()], &QUICK[..], &cue].concat());
    let more = path(&folder, "more");
    write_drives(Path::new(&more), &["monday", "tuesday"]);
    let grown = path(&folder, "grown");
    done(&["train", &more, "--add", &model, "--output", &grown]);
    let shrunk = path(&folder, "shrunk");
    let told = done(&["forget", &grown, "--drive", "monday", "--room", "dots", "--output", &shrunk]);
    assert!(told.contains("knows 2 rooms from"), "{told}");
    let sequences = &json(&["inspect", "--json", &shrunk])["card"]["sequences"];
    assert_eq!(sequences.as_array().unwrap().last().unwrap(), "tuesday");
    let never = ["forget", &grown, "--drive", "sunday", "--output", &path(&folder, "never")];
    assert!(refused(FAILED, &never).contains("no drive called sunday"));
}
