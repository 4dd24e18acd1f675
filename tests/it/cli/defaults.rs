//! What `train` makes of little data where it chooses the opinions itself, with networks and without.

use super::{FAILED, GATE_FAILED, ROOMS, done, frame, json, path, refused, write_rooms};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// The folder of `make networks`, where that was run, and one that is empty.
fn networks(empty: &TempDir) -> Vec<String> {
    let made = Path::new(env!("CARGO_MANIFEST_DIR")).join("networks");
    let is_made = made.join("efficientnet-lite0.onnx").is_file();
    if !is_made {
        eprintln!("LEFT OUT: training with a network. `make networks` fetches it.");
    }
    let made = is_made.then(|| made.to_str().unwrap().to_owned());
    made.into_iter().chain([path(empty, "none")]).collect()
}

#[test]
fn nobody_tells_rooms_apart_that_show_the_same() {
    let folder = TempDir::new().unwrap();
    for room in ["rooms/here", "rooms/there"] {
        fs::create_dir_all(folder.path().join(room)).unwrap();
    }
    for shift in 0..6 {
        // Files that are alike byte for byte are left out.
        for picture in ["here/1.png", "there/1.bmp"] {
            let picture = picture.replace('1', &shift.to_string());
            frame("bars", 7 * shift).save(folder.path().join("rooms").join(picture)).unwrap();
        }
    }
    for (idx, networks) in networks(&folder).iter().enumerate() {
        let model = path(&folder, &format!("model{idx}"));
        let told = done(&["train", &path(&folder, "rooms"), "--networks", networks, "-o", &model]);
        assert!(
            told.contains("no better than guessing") && told.contains("No answer will be known"),
            "{told}"
        );
        let answer = json(&["recognize", "--json", &model, &path(&folder, "rooms/here/0.png")]);
        let probability = answer["probability"].as_f64().unwrap();
        assert!((0.5..0.6).contains(&probability) && answer["known"] == false, "{answer}");
    }
}

#[test]
fn a_room_of_one_photo_is_recognized() {
    let folder = TempDir::new().unwrap();
    write_rooms(&folder.path().join("rooms"));
    for shift in 1..12 {
        fs::remove_file(folder.path().join(format!("rooms/dots/{shift}.png"))).unwrap();
    }
    for (idx, networks) in networks(&folder).iter().enumerate() {
        let model = path(&folder, &format!("model{idx}"));
        let told = done(&["train", &path(&folder, "rooms"), "--networks", networks, "-o", &model]);
        assert!(
            told.contains("1 of rooms that no other frame shows: take more frames of them (dots)"),
            "{told}"
        );
        for room in ROOMS {
            let frame = path(&folder, &format!("rooms/{room}/0.png"));
            let answer = json(&["recognize", "--json", &model, &frame]);
            assert_eq!(answer["room"], room, "{answer}");
        }
    }
}

#[test]
fn a_model_that_fails_a_gate_is_not_written() {
    let folder = TempDir::new().unwrap();
    write_rooms(&folder.path().join("rooms"));
    for shift in 0..4 {
        // Dots that are called bars: a part of the answers cannot be right.
        let picture = folder.path().join(format!("rooms/bars/dots{shift}.png"));
        frame("dots", 5 + 7 * shift).save(picture).unwrap();
    }
    let (data, networks, model) = (path(&folder, "rooms"), path(&folder, "none"), path(&folder, "model"));
    let train = ["train", &data, "--networks", &networks, "-o", &model];
    let error = refused(GATE_FAILED, &[&train[..], &["--min-rate", "0.99"]].concat());
    assert!(error.contains("right on held-out frames, below --min-rate 0.99"), "{error}");
    assert!(!Path::new(&model).exists());
    let told = done(&[&train[..], &["--min-rate", "0.1"]].concat());
    assert!(told.contains("is ready") && told.contains("Taken for another: "), "{told}");
}

#[test]
fn a_network_that_is_not_there_is_named() {
    let folder = TempDir::new().unwrap();
    write_rooms(&folder.path().join("rooms"));
    let (data, networks, model) = (path(&folder, "rooms"), path(&folder, "none"), path(&folder, "model"));
    let lens = "opinions.vector.lens.network=mine";
    let parameters = ["--set", "opinions.vector.kind=vector", "--set", lens, "--networks", &networks];
    let error = refused(FAILED, &[&["train", &data, "-o", &model], &parameters[..]].concat());
    assert!(error.contains("the network mine is not in ") && error.contains("make networks"), "{error}");
    assert!(!Path::new(&model).exists());
}
