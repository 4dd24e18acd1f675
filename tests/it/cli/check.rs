//! `check`: what is odd about labeled pictures.

use super::{DONE, done, frame, json, path, roomsight, write_rooms};
use serde_json::Value;
use std::fs;
use tempfile::TempDir;

/// Rooms with a copy in another room, a picture that is one of another brightness, a black one, one of another shape, and bars that are
/// called dots.
fn odd_rooms() -> TempDir {
    let folder = TempDir::new().unwrap();
    write_rooms(&folder.path().join("rooms"));
    let at = |name: &str| folder.path().join("rooms").join(name);
    fs::copy(at("bars/3.png"), at("stripes/copy.png")).unwrap();
    let brighter = image::open(at("bars/4.png")).unwrap().brighten(9);
    brighter.save(at("bars/brighter.png")).unwrap();
    image::GrayImage::new(96, 72).save(at("dots/black.png")).unwrap();
    frame("bars", 40).save(at("dots/wrong.png")).unwrap();
    image::open(at("stripes/6.png")).unwrap().crop_imm(0, 0, 60, 72).save(at("stripes/cut.png")).unwrap();
    folder
}

fn found(report: &Value, oddity: &str) -> Vec<String> {
    let findings = report["findings"].as_array().unwrap().iter();
    let of_kind = findings.filter(|finding| finding["oddity"] == oddity);
    let name = |finding: &Value| {
        let picture = finding["picture"].as_str().unwrap();
        picture.rsplit_once("rooms/").unwrap().1.to_owned()
    };
    of_kind.map(name).collect()
}

#[test]
fn odd_pictures_and_wrong_labels_are_found_and_shown() {
    let folder = odd_rooms();
    let (data, page) = (path(&folder, "rooms"), path(&folder, "odd.html"));
    let report = json(&["check", &data, "--networks", "none", "--json", "--html", &page]);
    assert_eq!(report["n_frames"], 41);
    assert_eq!(found(&report, "two_rooms"), ["bars/3.png", "stripes/copy.png"]);
    assert_eq!(found(&report, "near_copy"), ["bars/brighter.png"]);
    assert_eq!(found(&report, "dark"), ["dots/black.png"]);
    assert_eq!(found(&report, "shape"), ["stripes/cut.png"]);
    let labels = found(&report, "label");
    assert!(labels.contains(&"dots/wrong.png".to_owned()) && labels.len() <= 4, "{labels:?}");
    let html = fs::read_to_string(&page).unwrap();
    assert!(html.contains("<img") && html.contains("dots/wrong.png"), "{html:.300}");

    let told = done(&["check", &data, "--networks", "none", "--pictures-only"]);
    assert!(told.contains("dots/black.png") && told.contains("Labels were not doubted"), "{told}");
    assert!(!told.contains("contradict"), "{told}");
}

#[test]
fn what_is_not_odd_is_not_named_and_one_room_has_no_doubtful_labels() {
    let folder = TempDir::new().unwrap();
    write_rooms(&folder.path().join("rooms"));
    let told = done(&["check", &path(&folder, "rooms"), "--networks", "none", "--pictures-only"]);
    assert!(
        told.contains("36 frames of 3 rooms") && !told.contains("opies") && !told.contains("Nearly"),
        "{told}"
    );
    for room in ["bars", "dots"] {
        fs::remove_dir_all(folder.path().join("rooms").join(room)).unwrap();
    }
    let told = roomsight(&["check", &path(&folder, "rooms"), "--networks", "none"]);
    assert!(told.code == DONE && told.out.contains("Labels were not doubted: a model needs"), "{}", told.err);
}
