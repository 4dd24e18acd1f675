//! The commands as a person at a terminal sees them: output, files, exit codes.

mod camera;
mod check;
mod data;
mod defaults;
mod manners;
mod models;
mod recordings;
mod train;

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::LazyLock;
use tempfile::TempDir;

const DONE: i32 = 0;
const FAILED: i32 = 1;
const WRONG_USAGE: i32 = 2;
const GATE_FAILED: i32 = 3;

/// Parameters that make training quick.
const QUICK: [&str; 4] = ["--set", "representation.n_words=20", "--set", "detector.threshold.fixed=20"];

const ROOMS: [&str; 3] = ["bars", "dots", "stripes"];
const N_FRAMES: u32 = 12;

/// What a command did.
struct Told {
    code: i32,
    out: String,
    err: String,
}

fn roomsight<S: AsRef<std::ffi::OsStr>>(arguments: &[S]) -> Told {
    let mut command = Command::new(env!("CARGO_BIN_EXE_roomsight"));
    let output = command.args(arguments).stdin(Stdio::null()).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    Told { code: output.status.code().unwrap(), out: text(&output.stdout), err: text(&output.stderr) }
}

/// What a command prints that must succeed.
fn done(arguments: &[&str]) -> String {
    let told = roomsight(arguments);
    assert_eq!(told.code, DONE, "{arguments:?}: {}", told.err);
    told.out
}

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&done(arguments)).unwrap()
}

/// What a command says on standard error that must end with this code.
fn refused(code: i32, arguments: &[&str]) -> String {
    let told = roomsight(arguments);
    assert_eq!(told.code, code, "{arguments:?}: {}{}", told.out, told.err);
    told.err
}

/// A folder a room, and a model trained on it, shared by all tests.
struct Lab {
    folder: TempDir,
    /// What `train` printed.
    trained: String,
}

static LAB: LazyLock<Lab> = LazyLock::new(|| {
    let folder = TempDir::new().unwrap();
    write_rooms(&folder.path().join("rooms"));
    let (data, model) = (path(&folder, "rooms"), path(&folder, "models/lab/1"));
    let trained = done(&[&["train", &data, "--output", &model], &QUICK[..]].concat());
    Lab { folder, trained }
});

impl Lab {
    fn data(&self) -> String {
        path(&self.folder, "rooms")
    }

    fn model(&self) -> String {
        path(&self.folder, "models/lab/1")
    }

    fn frame(&self, room: &str) -> String {
        path(&self.folder, &format!("rooms/{room}/5.png"))
    }
}

fn path(folder: &TempDir, name: &str) -> String {
    text(&folder.path().join(name))
}

fn text(path: &Path) -> String {
    path.to_str().unwrap().to_owned()
}

fn write_rooms(folder: &Path) {
    for room in ROOMS {
        fs::create_dir_all(folder.join(room)).unwrap();
        for shift in 0..N_FRAMES {
            frame(room, 7 * shift).save(folder.join(format!("{room}/{shift}.png"))).unwrap();
        }
    }
}

/// A small frame of a room, seen from somewhere.
fn frame(room: &str, shift: u32) -> image::GrayImage {
    image::GrayImage::from_fn(96, 72, |column, row| {
        let (x, y) = (column + shift % 24, row + shift / 24);
        let is_bright = match room {
            "stripes" => x % 24 < 6 && y % 12 < 9,
            "bars" => y % 24 < 6 && x % 12 < 9,
            _ => x % 12 < 4 && y % 12 < 4,
        };
        image::Luma([if is_bright { 200 } else { 40 + ((column * 31 + row * 17 + shift) % 5) as u8 }])
    })
}

#[test]
fn recognize_names_the_room_of_each_frame() {
    let frames: Vec<String> = ROOMS.iter().map(|room| LAB.frame(room)).collect();
    let model = LAB.model();
    let mut arguments = vec!["recognize", "--json", "--top", "2", model.as_str()];
    arguments.extend(frames.iter().map(String::as_str));
    let lines: Vec<Value> =
        done(&arguments).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), ROOMS.len());
    for (line, room) in lines.iter().zip(ROOMS) {
        assert_eq!(line["room"], room, "{line}");
        assert_eq!(line["probabilities"].as_array().unwrap().len(), 2, "{line}");
    }
    let why = json(&["recognize", "--json", "--explain", &model, &frames[0]]);
    let nearest = &why["nearest"][0];
    assert_eq!((&nearest["room"], &nearest["frame"]), (&why["room"], &"bars/5.png".into()), "{why}");
    let why = done(&["recognize", "--explain", &model, &frames[0]]);
    assert!(why.contains("most like") && why.contains("bars/5.png"), "{why}");
    let table = done(&["recognize", &model, &frames[0]]);
    assert!(table.contains(ROOMS[0]) && table.contains("probability"), "{table}");
}

#[test]
fn limits_and_missing_rows_are_told() {
    let told = refused(FAILED, &["recognize", "--max-pixels", "6911", &LAB.model(), &LAB.frame("dots")]);
    assert!(told.contains("96 x 72; the limit is 6911 pixels"), "{told}");
    done(&["recognize", "--max-pixels", "6912", &LAB.model(), &LAB.frame("dots")]);
    let told = refused(FAILED, &["recognize", "--max-bytes", "20", &LAB.model(), &LAB.frame("dots")]);
    assert!(told.contains("the limit is 20"), "{told}");

    let folder = TempDir::new().unwrap();
    let cut = path(&folder, "cut.jpg");
    frame("dots", 3).save(&cut).unwrap();
    let bytes = fs::read(&cut).unwrap();
    fs::write(&cut, &bytes[..bytes.len() - 200]).unwrap();
    let told = roomsight(&["recognize", &LAB.model(), &cut]);
    assert_eq!(told.code, DONE, "{}", told.err);
    assert!(told.err.contains("rows are damaged or missing"), "{}", told.err);
}

#[test]
fn recognize_answers_the_frames_that_it_can_read_and_fails_for_the_others() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("text.png"), "no image").unwrap();
    let told = roomsight(&[
        "recognize",
        &LAB.model(),
        &path(&folder, "text.png"),
        &path(&folder, "missing.png"),
        &LAB.frame("dots"),
    ]);
    assert_eq!(told.code, FAILED);
    assert!(told.out.contains("dots"), "{}", told.out);
    for reason in ["not an image", "missing.png", "2 of 3 frames"] {
        assert!(told.err.contains(reason), "{reason}: {}", told.err);
    }
}

#[test]
fn evaluate_counts_every_frame() {
    let report = json(&["evaluate", "--json", &LAB.model(), &LAB.data()]);
    assert_eq!(report["evaluation"]["overall"]["n_frames"], 3 * N_FRAMES);
    assert_eq!(report["evaluation"]["places"], serde_json::json!(ROOMS));
    assert_eq!(report["simulated"], false);
    assert_eq!(report["n_of_unknown_rooms"], 0);
    let table = done(&["evaluate", &LAB.model(), &LAB.data()]);
    assert!(table.contains("all frames") && !table.contains("Simulated"), "{table}");
}

#[test]
fn evaluate_tells_sequences_apart() {
    let folder = TempDir::new().unwrap();
    for (drive, shown) in [("monday", "dots"), ("tuesday", "stripes")] {
        fs::create_dir_all(folder.path().join("dots").join(drive)).unwrap();
        for shift in 0..4 {
            let file = folder.path().join(format!("dots/{drive}/{shift}.png"));
            frame(shown, shift).save(file).unwrap();
        }
    }
    let report = json(&["evaluate", "--json", &LAB.model(), &path(&folder, "")]);
    let rate = |drive: &str| report["by_sequence"][drive]["overall"]["rate"].clone();
    assert_eq!((rate("monday"), rate("tuesday")), (1.0.into(), 0.0.into()), "{report}");
    let table = done(&["evaluate", &LAB.model(), &path(&folder, "")]);
    assert!(table.contains("monday") && table.contains("tuesday"), "{table}");
}

#[test]
fn evaluate_follows_drives_with_the_filter() {
    let manifest = Path::new(&LAB.data()).join("../drive/frames.csv");
    let folder = manifest.parent().unwrap();
    write_rooms(folder);
    let mut rows = "file,place,sequence\n".to_owned();
    for (idx, room) in (0..ROOMS.len() as u32 * N_FRAMES).map(|idx| (idx, ROOMS[(idx / N_FRAMES) as usize])) {
        rows += &format!("{room}/{}.png,{room},monday\n", idx % N_FRAMES);
    }
    fs::write(&manifest, rows).unwrap();
    let report = json(&["evaluate", "--json", "--filter=0.5,1", &LAB.model(), &text(folder)]);
    let streams = report["streams"].as_array().unwrap();
    let trusts: Vec<&Value> = streams.iter().map(|stream| &stream["trust"]).collect();
    assert_eq!(trusts, [&Value::Null, &0.5.into(), &1.0.into()]);
    for stream in streams {
        assert_eq!(stream["rate"]["n_frames"], 3 * N_FRAMES);
        assert_eq!(stream["changes"]["n_changes"], 2);
        assert_eq!(stream["by_sequence"]["monday"]["changes"], stream["changes"]);
    }
    assert_eq!(report["evaluation"]["overall"], streams[0]["rate"]);
    let table = done(&["evaluate", "--filter", &LAB.model(), &text(folder)]);
    assert!(table.contains("unfiltered") && table.contains("room changes"), "{table}");

    let error = refused(FAILED, &["evaluate", "--filter", &LAB.model(), &LAB.data()]);
    assert!(error.contains("the order they were taken"), "{error}");
    // Folders of drives within rooms: each is followed by itself.
    let folder = TempDir::new().unwrap();
    for room in ROOMS {
        fs::create_dir_all(folder.path().join(room).join("monday")).unwrap();
        for shift in 0..N_FRAMES {
            let picture = folder.path().join(format!("{room}/monday/{shift}.png"));
            frame(room, 7 * shift).save(picture).unwrap();
        }
    }
    let rooms = text(folder.path());
    let followed = json(&["evaluate", "--json", "--filter=1", &LAB.model(), &rooms]);
    assert_eq!(followed["streams"][1]["changes"]["n_changes"], 0, "{followed}");
    assert_eq!(followed["streams"][1]["rate"]["n_frames"], 3 * N_FRAMES);
    let error = refused(WRONG_USAGE, &["evaluate", "--filter=20", &LAB.model(), &LAB.data()]);
    assert!(error.contains("at most 10"), "{error}");
}

#[test]
fn validate_runs_each_protocol() {
    let data = LAB.data();
    let two_frames = ["--train-frames", "2"];
    for (protocol, n_frames, more) in [("sequences", 36, &[][..]), ("random", 30, &two_frames)] {
        let arguments = ["validate", "--json", &data, "--protocol", protocol, "--seeds", "2"];
        let report = json(&[&arguments[..], more, &QUICK[..]].concat());
        assert_eq!(report[0]["evaluations"].as_array().unwrap().len(), 2, "{report}");
        assert_eq!(report[0]["evaluations"][0]["overall"]["n_frames"], n_frames, "{report}");
    }
    let printed = done(&[&["validate", &data, "--protocol", "leave-one-out"], &QUICK[..]].concat());
    assert!(printed.contains("left-out frames"), "{printed}");
    let drawn = [&["validate", &data, "--protocol", "sequences"][..], &two_frames].concat();
    assert!(refused(FAILED, &drawn).contains("--protocol random"));
    let each = done(&[&["validate", &data, "--each", "--set", "cue.kind=frame_lbp"], &QUICK[..]].concat());
    assert!(each.contains("bag + patterns") && each.contains("model MB"), "{each}");
}

#[test]
fn inspect_prints_the_card_of_a_model() {
    let card = json(&["inspect", "--json", &LAB.model()]);
    assert_eq!(card["places"], serde_json::json!(ROOMS));
    assert_eq!(card["card"]["n_frames"], 3 * N_FRAMES);
    let table = done(&["inspect", &LAB.model()]);
    assert!(table.contains("perspective") && table.contains("n_words = 20"), "{table}");
}

#[test]
fn inspect_draws_a_frame_in_colors() {
    let folder = TempDir::new().unwrap();
    let picture = path(&folder, "seen.png");
    let told = done(&["inspect", &LAB.frame("dots"), "--model", &LAB.model(), "--output", &picture]);
    assert!(told.contains("keypoints"), "{told}");
    let pixels = image::open(&picture).unwrap().to_rgb8();
    assert_eq!(pixels.dimensions(), (96, 72));
    assert!(pixels.pixels().any(|pixel| pixel.0[0] != pixel.0[1]));
}

#[test]
fn simulated_frames_are_called_so() {
    let folder = TempDir::new().unwrap();
    let (frames, model) = (path(&folder, "frames"), path(&folder, "model"));
    let drives = ["--illumination=cloudy1,sunny1", "--frames-per-second=0.04", "--camera=std"];
    let summary = json(&[&["simulate", &frames, "--json"], &drives[..]].concat());
    assert_eq!(summary[0]["was_kept"], false, "{summary}");
    let kept = json(&[&["simulate", &frames, "--json"], &drives[..]].concat());
    assert_eq!(kept[1]["was_kept"], true, "{kept}");
    let trained = done(&[&["train", &frames, "--output", &model], &QUICK[..]].concat());
    assert!(trained.contains("simulated frames"), "{trained}");
    let evaluated = done(&["evaluate", &model, &frames]);
    assert!(evaluated.contains("Simulated frames.") && evaluated.contains("seq3_sunny1"), "{evaluated}");
}

#[test]
fn a_damaged_or_missing_model_is_refused_with_a_reason() {
    let folder = TempDir::new().unwrap();
    for name in ["model.safetensors", "model.json"] {
        fs::copy(PathBuf::from(LAB.model()).join(name), folder.path().join(name)).unwrap();
    }
    let model = path(&folder, "");
    done(&["recognize", &model, &LAB.frame("dots")]);
    let file = folder.path().join("model.safetensors");
    let mut bytes = fs::read(&file).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(&file, bytes).unwrap();
    let error = refused(FAILED, &["recognize", &model, &LAB.frame("dots")]);
    assert!(error.contains("damaged"), "{error}");
    let error = refused(FAILED, &["inspect", &LAB.data()]);
    assert!(error.contains("no model"), "{error}");
}

#[test]
fn wrong_usage_ends_with_code_2_and_says_what_is_wrong() {
    let (data, model, frame) = (LAB.data(), LAB.model(), LAB.frame("dots"));
    for (arguments, reason) in [
        (vec![], "Usage"),
        (vec!["trian"], "train"),
        (vec!["train", &data], "--output"),
        (vec!["recognize", &model], "FRAMES"),
        (vec!["recognize", &model, &frame, "--top", "0"], "--top"),
        (vec!["validate", &data, "--folds", "1"], "--folds"),
        (vec!["validate", &data, "--train", "x"], "--test"),
        (vec!["simulate", "x", "--illumination", "dawn1"], "dawn1"),
        (vec!["serve", "--log-format", "xml"], "json"),
        (vec!["demo", "--listen", "0.0.0.0:80"], "this machine only"),
    ] {
        let error = refused(WRONG_USAGE, &arguments);
        assert!(error.contains(reason), "{arguments:?}: {error}");
    }
}

#[test]
fn wrong_parameters_are_named() {
    let folder = TempDir::new().unwrap();
    for (parameter, reason) in [
        ("representation.n_words=0", "words"),
        ("representation.n_wrods=9", "n_wrods"),
        ("detector.threshold.fixed=1000", "1000"),
        ("seed", "NAME=VALUE"),
        ("cue.kind=depth", "depth"),
        ("cue={ kind = 'frame_lbp', weight = 2 }", "weight"),
    ] {
        let arguments = ["train", &LAB.data(), "-o", &path(&folder, "model"), "--set", parameter];
        let error = refused(FAILED, &arguments);
        assert!(error.contains(reason), "{parameter}: {error}");
    }
}

#[test]
fn a_reader_that_leaves_is_no_failure() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_roomsight"));
    let arguments = ["recognize", "--json", &LAB.model(), &LAB.frame("dots"), &LAB.frame("bars")];
    let mut running = command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(running.stdout.take());
    let output = running.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(DONE));
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
}
