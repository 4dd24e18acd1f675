//! The experiments of the papers on a small data set laid out exactly as COLD: three labs, both cameras.

use image::{GrayImage, Luma};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

const DRIVES: [(&str, &str); 10] = [
    ("cold-saarbruecken/part_b", "seq3_cloudy1"),
    ("cold-saarbruecken/part_b", "seq3_cloudy2"),
    ("cold-saarbruecken/part_b", "seq3_night1"),
    ("cold-saarbruecken/part_b", "seq3_night2"),
    ("cold-saarbruecken/part_b", "seq3_sunny1"),
    ("cold-saarbruecken/part_b", "seq3_sunny2"),
    ("cold-freiburg/part_a", "seq1_cloudy1"),
    ("cold-freiburg/part_a", "seq2_cloudy2"),
    ("cold-ljubljana", "seq1_cloudy1"),
    ("cold-ljubljana", "seq1_cloudy2"),
];
const LABELS: [&str; 3] = ["CR-A", "PA-A", "BR-A"];
const FRAMES_A_ROOM: usize = 20;
const EXPERIMENTS: [&str; 13] = [
    "features",
    "stability",
    "keypoints",
    "words",
    "kernels",
    "illumination",
    "best",
    "occlusion",
    "cost",
    "opinions",
    "dynamic",
    "geographic",
    "categorical",
];

/// Runs the command; its exit code, and what it says.
fn roomsight(arguments: &[&str]) -> (i32, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_roomsight")).args(arguments).output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    (output.status.code().unwrap(), String::from_utf8(said).unwrap())
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Writes drives, each through all rooms, seen by both cameras.
fn write_cold(root: &Path, drives: &[(&str, &str)], labels: &[&str]) {
    for (drive_idx, (lab, sequence)) in drives.iter().enumerate() {
        let folder = root.join(lab).join(sequence);
        ["std_cam", "omni_cam", "localization"]
            .iter()
            .for_each(|name| fs::create_dir_all(folder.join(name)).unwrap());
        let mut rooms = String::new();
        for frame_idx in 0..labels.len() * FRAMES_A_ROOM {
            let room = frame_idx / FRAMES_A_ROOM;
            let name = format!(
                "t11529{frame_idx:05}.{drive_idx:06}_x{}.{:06}_y0.{drive_idx:02}0000_a0.100000.jpeg",
                room * 4,
                frame_idx % FRAMES_A_ROOM * 100_000
            );
            rooms += &format!("{name} {}\n", labels[room]);
            let seed = (drive_idx * 100 + frame_idx) as u32;
            frame(room, seed, false).save(folder.join("std_cam").join(&name)).unwrap();
            frame(room, seed, true).save(folder.join("omni_cam").join(&name)).unwrap();
        }
        fs::write(folder.join("localization/places.lst"), rooms).unwrap();
    }
}

/// Tiles whose size tells the room, in gray values that no other frame has; in a mirror or not.
fn frame(room: usize, seed: u32, in_mirror: bool) -> GrayImage {
    let side = [5, 8, 13][room];
    GrayImage::from_fn(192, 144, |column, row| {
        let radius = (f64::from(column) - 96.0).hypot(f64::from(row) - 72.0);
        if in_mirror && !(12.0..69.0).contains(&radius) {
            return Luma([0]);
        }
        let tile = (column / side).wrapping_mul(2_654_435_761)
            ^ (row / side).wrapping_mul(40_503)
            ^ seed.wrapping_mul(97);
        Luma([((tile.wrapping_mul(2_246_822_519) >> 13) % 200 + 30) as u8])
    })
}

fn run(data: &Path, report: &Path, name: &str) -> (i32, String) {
    // Few words of few descriptors: what they tell is not looked at closely.
    let words = ["--set", "representation.n_words=40", "--set", "representation.max_descriptors=2000"];
    let experiment = ["experiment", name, "--quick", "--data", text(data), "--report", text(report)];
    roomsight(&[&experiment[..], &words].concat())
}

#[test]
fn all_experiments_run_on_colds_layout_and_a_second_time_from_what_was_kept() {
    let folder = TempDir::new().unwrap();
    let (data, report) = (folder.path().join("cold"), folder.path().join("report"));
    write_cold(&data, &DRIVES, &LABELS);
    let (code, said) = run(&data, &report, "all");
    assert_eq!(code, 0, "{said}");

    let json = fs::read_to_string(report.join("report.json")).unwrap();
    let parsed: Value = serde_json::from_str(&json).unwrap();
    let entries = parsed["entries"].as_array().unwrap();
    let names: Vec<&str> =
        entries.iter().map(|entry| entry["plan"]["experiment"].as_str().unwrap()).collect();
    assert_eq!(names, EXPERIMENTS);
    for measured in entries.iter().flat_map(|entry| entry["measured"].as_array().unwrap()) {
        match measured["kind"].as_str().unwrap() {
            "rates" => {
                let rate = measured["rate"]["mean"].as_f64().unwrap();
                assert!((0.0..=1.0).contains(&rate));
                assert!(measured["best"]["overall"]["n_frames"].as_u64().unwrap() > 0);
            }
            "matches" => {
                let figure = |name: &str| measured[name].as_f64().unwrap();
                assert!(measured["found"][1].as_f64().unwrap() > figure("matched"));
                assert!(figure("matched") >= figure("correct") && figure("n_pairs") > 1.0);
            }
            "cost" => assert!(measured["model_bytes"].as_u64().unwrap() > 0, "{measured}"),
            _ => panic!("{measured}"),
        }
    }
    // The tiles tell the rooms apart.
    assert!(entries[6]["measured"][0]["rate"]["mean"].as_f64().unwrap() > 0.6, "{said}");
    // What the report says of itself, and the papers' figures in columns of their own.
    let html = fs::read_to_string(report.join("report.html")).unwrap();
    let command = format!("roomsight experiment all --quick --data {}", text(&data));
    let digest = parsed["data"]["blake3"].as_str().unwrap();
    for fact in [
        "Lu, Li, Zhang, Hu, Zheng",
        "Ullah, Pronobis, Caputo, Luo, Jensfelt, Christensen",
        &command,
        digest,
        parsed["origin"]["created"].as_str().unwrap(),
        "of each drive one frame in 5",
        "<dd>0 to 1; one run",
        "<a href=\"#words\">The number of words</a>",
        "<section id=\"words\">",
        "<th>cloudy2, paper (%)</th>",
        "<td>98.1</td>",
        "number of words k</text>",
        "x (m)</text>",
    ] {
        assert!(html.contains(fact), "{fact}");
    }
    assert!(html.contains("<svg") && !html.contains("http") && !html.contains("class=\"wall\""));
    assert_eq!(entries[6]["plan"]["cells"][0]["printed"], 0.9806);

    // Each table has its files, and the page links to them.
    let tables = report.join("tables");
    let csv = fs::read_to_string(tables.join("best.csv")).unwrap();
    let header = "model,cloudy2 mean,cloudy2 std,cloudy2 best,\"cloudy2, paper\",";
    assert!(csv.starts_with(header) && csv.contains(",0.9806,"), "{csv}");
    let best = entries[6]["measured"][0]["rate"]["mean"].as_f64().unwrap();
    assert!(csv.contains(&format!("\n\"FAST+CS-LBP, bag\",{best},")), "{csv}");
    for entry in fs::read_dir(&tables).unwrap().map(|entry| entry.unwrap()) {
        let name = entry.file_name().into_string().unwrap();
        assert!(html.contains(&format!("href=\"tables/{name}\"")), "{name}");
        let latex = fs::read_to_string(entry.path()).unwrap();
        if name.ends_with(".tex") {
            let tabular = |word: &str| latex.matches(&format!("\\{word}{{tabular}}")).count();
            assert!(tabular("begin") == 1 && tabular("end") == 1 && latex.contains("\\midrule"), "{latex}");
        }
    }
    assert!(tables.join("best-confusion-fast-cs-lbp-bag-night1.tex").exists());
    assert!(tables.join("categorical-rooms.csv").exists());

    let n_answers = || fs::read_dir(report.join("answers")).unwrap().count();
    let before = n_answers();
    // Marked as simulated, the frames stand beside no figure of a paper.
    fs::write(data.join("SIMULATED.txt"), "").unwrap();
    let walls = data.join("cold-saarbruecken/part_b/seq3_cloudy2/localization/walls.csv");
    fs::write(walls, "x1,y1,x2,y2\n0,0,4,0\n").unwrap();
    let (code, said) = run(&data, &report, "all");
    assert_eq!(code, 0, "{said}");
    assert_eq!(n_answers(), before);
    let json = fs::read_to_string(report.join("report.json")).unwrap();
    let html = fs::read_to_string(report.join("report.html")).unwrap();
    assert!(
        html.contains("Simulated frames.") && !html.contains("paper (%)") && !html.contains("In the paper")
    );
    assert!(!json.contains("\"printed\""));
    assert!(!fs::read_to_string(tables.join("best.csv")).unwrap().contains("paper"));
    let again: Value = serde_json::from_slice(&fs::read(report.join("report.json")).unwrap()).unwrap();
    for (again, entry) in again["entries"].as_array().unwrap().iter().zip(entries) {
        // Time is measured anew.
        assert!(again["measured"] == entry["measured"] || entry["plan"]["experiment"] == "cost");
    }
    fs::remove_file(data.join("SIMULATED.txt")).unwrap();

    // What cannot be trained is told in its place, and the rest goes on.
    let other = folder.path().join("other");
    let words = ["--stride", "5", "--seeds", "1", "--set", "representation.n_words=60000"];
    let experiment = ["experiment", "words", "--data", text(&data), "--report", text(&other)];
    let (code, said) =
        roomsight(&[&experiment[..], &words, &["--set", "representation.max_rounds=2"]].concat());
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("k = 60000, night1: not measured") && said.contains("too few"), "{said}");
    let parsed: Value = serde_json::from_slice(&fs::read(other.join("report.json")).unwrap()).unwrap();
    let kinds: Vec<&str> = parsed["entries"][0]["measured"]
        .as_array()
        .unwrap()
        .iter()
        .map(|measured| measured["kind"].as_str().unwrap())
        .collect();
    assert_eq!(kinds, [&["rates"; 24][..], &["impossible"; 3]].concat());
    assert!(
        fs::read_to_string(other.join("report.html")).unwrap().contains("k = 60000, night1: not measured")
    );

    // As JSON the report is all that standard output has.
    let experiment =
        ["experiment", "keypoints", "--quick", "--json", "--data", text(&data), "--report", text(&other)];
    let output = Command::new(env!("CARGO_BIN_EXE_roomsight")).args(experiment).output().unwrap();
    let printed: Value = serde_json::from_slice(&output.stdout).unwrap();
    let written: Value = serde_json::from_slice(&fs::read(other.join("report.json")).unwrap()).unwrap();
    assert!(printed == written && printed["entries"][0]["plan"]["experiment"] == "keypoints");

    // A changed frame changes what is answered of its drive, and of the models trained on it.
    let frames = data.join("cold-freiburg/part_a/seq1_cloudy1/std_cam");
    let first = fs::read_dir(frames).unwrap().map(|entry| entry.unwrap().path()).min().unwrap();
    frame(2, 9999, false).save(first).unwrap();
    assert_eq!(run(&data, &report, "categorical").0, 0);
    assert!(n_answers() > before);
}

#[test]
fn what_cannot_work_is_said_before_it_starts() {
    let folder = TempDir::new().unwrap();
    let report = folder.path().join("report");
    let refused = |data: &Path, name: &str| {
        let (code, said) = roomsight(&["experiment", name, "--data", text(data), "--report", text(&report)]);
        assert_eq!(code, 1, "{said}");
        assert!(!report.exists(), "{said}");
        said
    };
    assert!(refused(&folder.path().join("my-rooms"), "all").contains("my-rooms"));
    let few = folder.path().join("few");
    write_cold(&few, &DRIVES[..2], &LABELS);
    assert!(refused(&few, "features").contains("part B, standard path, night1"));
    assert!(refused(&few, "categorical").contains("two labs"));

    let one_room = folder.path().join("one-room");
    write_cold(&one_room, &DRIVES[..2], &LABELS[..1]);
    assert!(refused(&one_room, "best").contains("one room only"));

    let other = folder.path().join("other");
    fs::create_dir_all(other.join("kitchen")).unwrap();
    fs::create_dir_all(other.join("bath")).unwrap();
    frame(0, 1, false).save(other.join("kitchen/1.png")).unwrap();
    frame(1, 2, false).save(other.join("bath/1.png")).unwrap();
    assert!(refused(&other, "best").contains("named as those of COLD"));

    let bare = folder.path().join("bare");
    write_cold(&bare, &DRIVES[..1], &LABELS);
    let drive = bare.join(DRIVES[0].0).join(DRIVES[0].1);
    let frames = |camera: &str| fs::read_dir(drive.join(camera)).unwrap().map(|entry| entry.unwrap().path());
    frames("omni_cam").for_each(|frame| fs::write(frame, "no picture").unwrap());
    assert!(refused(&bare, "best").contains("can be read"));
    ["std_cam", "omni_cam"]
        .iter()
        .for_each(|camera| frames(camera).for_each(|frame| fs::remove_file(frame).unwrap()));
    assert!(refused(&bare, "best").contains("labeled in places.lst, but there is no such file"));
    fs::remove_file(drive.join("localization/places.lst")).unwrap();
    assert!(refused(&bare, "best").contains("have no place"));
}

#[test]
fn parameters_that_cannot_work_are_said_before_it_starts() {
    let folder = TempDir::new().unwrap();
    let (data, report) = (folder.path().join("cold"), folder.path().join("report"));
    write_cold(&data, &DRIVES[..6], &LABELS);
    let experiment = ["experiment", "words", "--data", text(&data), "--report", text(&report)];
    let refused = |parameters: &[&str], reason: &str| {
        let set = parameters.iter().flat_map(|parameter| ["--set", parameter]);
        let (code, said) = roomsight(&experiment.into_iter().chain(set).collect::<Vec<_>>());
        assert_eq!(code, 1, "{said}");
        assert!(said.contains(reason), "{said}");
        assert!(!report.exists(), "{said}");
    };
    refused(&["classifier.c=nan"], "c is NaN");
    for gamma in ["0", "nan"] {
        let gamma = format!("classifier.kernel.gamma={gamma}");
        refused(&["classifier.kind=kernel_svm", &gamma], "it must be positive and finite");
    }
    refused(&["representation.kind=descriptors", "classifier.kind=match_svm"], "words: match_svm compares");
    refused(&["calibration.sigmoids=per_machine", "calibration.n_folds=80"], "fewer than the 80 folds");
}
