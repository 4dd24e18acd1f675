//! What commands say of mistakes, how much they say, and in which colors.

use super::{DONE, FAILED, LAB, QUICK, WRONG_USAGE, done, frame, path, refused, roomsight};
use std::fs;
use std::process::Command;
use tempfile::TempDir;

#[test]
fn mistakes_are_answered_with_the_nearest_name_and_no_types() {
    let (data, folder) = (LAB.data(), TempDir::new().unwrap());
    let train = |parameter: &str| refused(FAILED, &["train", &data, "-o", "unused", "--set", parameter]);
    let error = train("n_words=300");
    assert!(error.contains("--set n_words=300 (did you mean representation.n_words?)"), "{error}");
    let error = train("representation.n_words=many");
    assert!(error.contains("--set representation.n_words=many: \"many\" is not a whole number"), "{error}");
    assert!(train("detektor.kind=sift").contains("did you mean detector"));
    let (config, settings) = (path(&folder, "model.toml"), path(&folder, "roomsight.toml"));
    fs::write(&config, "[descriptor]\nknd = \"lbp\"\n").unwrap();
    let error = refused(FAILED, &["train", &data, "-o", "unused", "--config", &config]);
    assert!(error.contains("model.toml") && !error.contains("expected"), "{error}");
    fs::write(&settings, "quue = 3\n").unwrap();
    let error = refused(FAILED, &["serve", "--config", &settings, "--print-config"]);
    assert!(error.contains("there is no setting quue; did you mean queue?"), "{error}");
    let error = refused(FAILED, &["recognize", &LAB.frame("bars"), &LAB.model()]);
    assert!(error.contains("the model's folder comes first"), "{error}");
    let error = refused(FAILED, &["health", "--url", "http://127.0.0.1:1"]);
    assert!(error.contains("no answer from http://127.0.0.1:1"), "{error}");
}

#[test]
fn quiet_commands_say_what_is_asked_for_alone() {
    let (data, model) = (LAB.data(), LAB.model());
    let versions = model.trim_end_matches("/1");
    let told = roomsight(&["recognize", versions, &LAB.frame("bars")]);
    assert!(told.code == DONE && told.err.contains("taking the highest version"), "{}", told.err);
    let told = roomsight(&["recognize", "--quiet", versions, &LAB.frame("bars")]);
    assert!(told.code == DONE && told.err.is_empty() && told.out.contains("bars"), "{}", told.err);
    let told = roomsight(&["-v", "evaluate", &model, &data]);
    assert!(told.err.contains("describing frames: 0."), "{}", told.err);
    refused(WRONG_USAGE, &["evaluate", "-q", "-v", &model, &data]);
}

#[test]
fn colors_are_for_terminals_and_those_who_want_them() {
    let told = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_roomsight"));
        String::from_utf8(command.args(arguments).output().unwrap().stderr).unwrap()
    };
    assert!(!told(&["train"]).contains('\u{1b}'));
    assert!(told(&["train", "--color", "always"]).contains('\u{1b}'));
    assert!(told(&["--color=always", "train"]).contains('\u{1b}'));
    assert!(!told(&["train", "--color", "never"]).contains('\u{1b}'));
}

#[test]
fn tables_fit_the_terminal() {
    let folder = TempDir::new().unwrap();
    for (idx, room) in ["bars", "dots", "stripes"].into_iter().cycle().take(6).enumerate() {
        let name = folder.path().join(format!("rooms/a long name of room {idx}"));
        fs::create_dir_all(&name).unwrap();
        for shift in 0..6 {
            frame(room, 9 * shift + idx as u32).save(name.join(format!("{shift}.png"))).unwrap();
        }
    }
    let model = path(&folder, "model");
    done(&[&["train", &path(&folder, "rooms"), "-o", &model], &QUICK[..]].concat());
    let told = |columns: &str, arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_roomsight"));
        let output = command.env("COLUMNS", columns).args(arguments).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    let picture = path(&folder, "rooms/a long name of room 3/2.png");
    for columns in [100, 80, 60] {
        for arguments in
            [&["evaluate", &model, &path(&folder, "rooms")][..], &["recognize", &model, &picture]]
        {
            let told = told(&columns.to_string(), arguments);
            let tables = told.lines().filter(|line| line.starts_with([' ', '\u{2500}', '\u{2550}']));
            let widest = tables.map(|line| line.chars().count()).max().unwrap();
            assert!(widest <= columns, "{widest} of {columns}:\n{told}");
        }
    }
    let evaluated = |columns: &str| told(columns, &["evaluate", &model, &path(&folder, "rooms")]);
    assert!(evaluated("100").contains("shown \\ answered") && evaluated("100").contains("a lon."));
    assert!(!evaluated("60").contains("shown \\ answered"));
}

#[test]
fn shells_and_manuals_know_the_commands() {
    assert!(done(&["completions", "bash"]).contains("roomsight"));
    refused(WRONG_USAGE, &["completions", "cmd.exe"]);
    let folder = TempDir::new().unwrap();
    done(&["man", &path(&folder, "man1")]);
    let page = fs::read_to_string(path(&folder, "man1/roomsight-train.1")).unwrap();
    assert!(page.contains("labeled frames") && page.starts_with(".ie"), "{page:.200}");
}
