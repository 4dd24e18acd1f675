//! What the commands say of data sets that hold more, less or other than a folder a room.

use super::{DONE, FAILED, LAB, QUICK, Told, done, frame, json, path, refused, roomsight, text, write_rooms};
use serde_json::Value;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// A folder a room, and whatever else `add` puts there.
fn rooms(add: impl FnOnce(&Path)) -> TempDir {
    let folder = TempDir::new().unwrap();
    write_rooms(&folder.path().join("rooms"));
    add(&folder.path().join("rooms"));
    folder
}

fn train(folder: &TempDir, data: &str) -> Told {
    let (data, model) = (path(folder, data), path(folder, "model"));
    let told = roomsight(&[&["train", &data, "--output", &model], &QUICK[..]].concat());
    assert_eq!(told.code, DONE, "{}", told.err);
    told
}

#[test]
fn files_that_are_skipped_are_counted_and_named_by_reason() {
    let folder = rooms(|rooms| {
        for number in 0..7 {
            fs::write(rooms.join(format!("dots/bad{number}.png")), "no image").unwrap();
            fs::write(rooms.join(format!("bars/notes{number}.txt")), "no image").unwrap();
        }
        fs::write(rooms.join(".DS_Store"), "").unwrap();
        fs::create_dir(rooms.join("attic")).unwrap();
        fs::write(rooms.join("attic/1.png"), "no image").unwrap();
        fs::rename(rooms.join("dots/3.png"), rooms.join("dots/3.jpg")).unwrap();
        fs::rename(rooms.join("dots/4.png"), rooms.join("dots/4")).unwrap();
    });
    let told = train(&folder, "rooms");
    let lines: Vec<&str> = told.err.lines().collect();
    assert_eq!(lines.len(), 4, "{}", told.err);
    assert!(lines[0].contains(".DS_Store: hidden"), "{}", told.err);
    assert!(lines[1].contains("notes0.txt and 6 more: not a picture"), "{}", told.err);
    assert!(lines[2].contains("attic/1.png and 7 more: "), "{}", told.err);
    assert_eq!(lines[3], "left out: the room attic: none of its frames can be used");
    assert!(told.out.contains("36 of 36"), "{}", told.out);
}

#[test]
fn copies_are_left_out_of_training_and_told_by_evaluation() {
    let folder = rooms(|rooms| {
        for copy in ["dots/copy.png", "dots/copy (2).png"] {
            fs::copy(rooms.join("dots/0.png"), rooms.join(copy)).unwrap();
        }
        fs::copy(rooms.join("bars/0.png"), rooms.join("stripes/wrong.png")).unwrap();
    });
    let told = train(&folder, "rooms");
    assert!(told.err.contains("and 1 more: a copy of another picture of its room"), "{}", told.err);
    assert!(
        told.err.contains("and 1 more: the same picture, byte for byte, lies in another room"),
        "{}",
        told.err
    );
    // Neither `bars/0.png` nor its copy can be trusted.
    assert!(told.out.contains("35 of 35"), "{}", told.out);
    let evaluated = roomsight(&["evaluate", &LAB.model(), &path(&folder, "rooms")]);
    assert!(
        evaluated.err.contains("note: ") && evaluated.err.contains("a copy of another"),
        "{}",
        evaluated.err
    );
}

#[test]
fn pictures_that_train_are_not_answered() {
    let mut rows = "file,place,split\n".to_owned();
    let folder = rooms(|rooms| {
        fs::copy(rooms.join("dots/0.png"), rooms.join("dots/copy.png")).unwrap();
        for room in crate::cli::ROOMS {
            for number in 0..crate::cli::N_FRAMES {
                let split = if number < 6 { "gallery" } else { "query" };
                rows += &format!("{room}/{number}.png,{room},{split}\n");
            }
        }
        rows += "dots/copy.png,dots,query\n";
        fs::write(rooms.join("frames.csv"), &rows).unwrap();
    });
    let data = path(&folder, "rooms");
    let arguments = ["validate", "--json", &data, "--train-split", "gallery", "--test-split", "query"];
    let report = json(&[&arguments[..], &QUICK[..]].concat());
    assert_eq!(report[0]["evaluations"][0]["overall"]["n_frames"], 18, "{report}");
}

#[test]
fn pictures_that_end_early_are_told() {
    let folder = rooms(|rooms| {
        let mut whole = std::io::Cursor::new(Vec::new());
        frame("dots", 60).write_to(&mut whole, image::ImageFormat::Jpeg).unwrap();
        let whole = whole.into_inner();
        fs::write(rooms.join("dots/cut.jpg"), &whole[..whole.len() * 9 / 10]).unwrap();
    });
    let told = train(&folder, "rooms");
    assert!(told.err.contains("dots/cut.jpg: rows of it are damaged or missing"), "{}", told.err);
    assert!(told.out.contains("37 of 37"), "{}", told.out);
}

#[test]
fn frames_without_a_held_out_answer_are_explained() {
    let folder = rooms(|rooms| {
        fs::create_dir(rooms.join("attic")).unwrap();
        frame("dots", 99).save(rooms.join("attic/1.png")).unwrap();
        for grey in [90, 110] {
            let blank = image::GrayImage::from_pixel(96, 72, image::Luma([grey]));
            blank.save(rooms.join(format!("dots/blank{grey}.png"))).unwrap();
        }
    });
    let told = train(&folder, "rooms");
    for line in [
        "Held-out answers to 36 of 39 frames",
        "without one: 1 of rooms that no other frame shows: take more frames of them (attic)",
        "without one: 2 without anything to recognize them by (dots)",
    ] {
        assert!(told.out.contains(line), "{line}: {}", told.out);
    }
}

#[test]
fn splits_and_folders_around_the_rooms_are_seen_through() {
    let folder = TempDir::new().unwrap();
    for (split, shift) in [("train", 0), ("val", 5)] {
        for room in crate::cli::ROOMS {
            fs::create_dir_all(folder.path().join("set/photos").join(split).join(room)).unwrap();
            for number in 0..4 {
                let file = format!("set/photos/{split}/{room}/{number}.png");
                frame(room, 7 * (shift + number)).save(folder.path().join(file)).unwrap();
            }
        }
    }
    let told = train(&folder, "set");
    assert!(told.err.contains("`train` and `val` are taken as splits"), "{}", told.err);
    assert!(told.out.contains("24 of 24"), "{}", told.out);
    let (model, data) = (path(&folder, "model"), path(&folder, "set"));
    let report = json(&["evaluate", "--json", &model, &data, "--split", "val"]);
    assert_eq!(report["evaluation"]["overall"]["n_frames"], 12, "{report}");
    assert_eq!(report["evaluation"]["places"], serde_json::json!(crate::cli::ROOMS));
}

#[test]
fn a_folder_of_frames_and_a_folder_of_versions_are_what_they_are_meant_for() {
    let folder = rooms(|rooms| fs::write(rooms.join("dots/notes.txt"), "nothing").unwrap());
    let model = LAB.model();
    let versions = model.strip_suffix("/1").unwrap();
    let told = roomsight(&["recognize", "--json", versions, &path(&folder, "rooms/dots")]);
    assert_eq!(told.code, DONE, "{}", told.err);
    let answers: Vec<Value> = told.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(answers.len(), 12);
    assert!(answers.iter().all(|answer| answer["room"] == "dots"), "{}", told.out);
    assert!(
        told.err.contains("taking the highest version") && told.err.contains("notes.txt"),
        "{}",
        told.err
    );
    let empty = TempDir::new().unwrap();
    let error = refused(FAILED, &["recognize", &model, &text(empty.path())]);
    assert!(error.contains("holds no picture"), "{error}");
}

#[test]
fn a_promise_of_more_lets_fewer_answers_be_known() {
    let folder = TempDir::new().unwrap();
    let (data, model) = (LAB.data(), path(&folder, "model"));
    let train = ["train", &data, "--networks", &path(&folder, "none"), "--json", "-o", &model];
    let report = json(&[&train[..], &["--precision", "1"]].concat());
    assert_eq!(report["verdict"]["knowledge"]["known"]["n_frames"], 0, "{report}");
    let error = refused(crate::cli::WRONG_USAGE, &["train", &data, "-o", "unused", "--precision", "95"]);
    assert!(error.contains("it must be from 0 to 1"), "{error}");
}

#[test]
fn rooms_that_a_model_does_not_know_are_named() {
    let folder = rooms(|rooms| fs::rename(rooms.join("dots"), rooms.join("Dots")).unwrap());
    let printed = done(&["evaluate", &LAB.model(), &path(&folder, "rooms")]);
    assert!(printed.contains("that the model does not know: 12 (Dots)"), "{printed}");
    let report = json(&["evaluate", "--wrong", "--json", &LAB.model(), &path(&folder, "rooms")]);
    let wrong = report["wrong"].as_array().unwrap();
    let of_dots = wrong.iter().filter(|frame| frame["room"] == "Dots");
    assert_eq!(of_dots.clone().count(), 12, "{report}");
    assert!(of_dots.clone().all(|frame| frame["frame"].as_str().unwrap().contains("Dots")), "{report}");
}

#[test]
fn frames_of_elsewhere_are_not_of_a_room_and_wrong_ones_are_shown() {
    let folder = rooms(|rooms| {
        fs::rename(rooms.join("dots"), rooms.join("Elsewhere")).unwrap();
        fs::rename(rooms.join("bars/3.png"), rooms.join("stripes/wrong.png")).unwrap();
    });
    let (data, page) = (path(&folder, "rooms"), path(&folder, "wrong.html"));
    let evaluate = ["evaluate", "--json", "--wrong", "--html", &page, &LAB.model(), &data];
    let report = json(&evaluate);
    assert_eq!(report["evaluation"]["overall"]["n_frames"], 24, "{report}");
    assert_eq!(report["knowledge"]["new_unknown"]["n_frames"], 12, "{report}");
    assert_eq!(report["n_of_unknown_rooms"], 0, "{report}");
    let html = fs::read_to_string(&page).unwrap();
    assert!(html.contains("stripes/wrong.png") && html.contains("answered bars"), "{html:.300}");

    let model = path(&folder, "model");
    let others = path(&folder, "others");
    fs::create_dir_all(path(&folder, "others/below")).unwrap();
    for shift in 0..5 {
        frame("bars", 3 + 7 * shift).save(path(&folder, &format!("others/below/{shift}.png"))).unwrap();
    }
    let quick = [&QUICK[..], &["--elsewhere", &others, "-o", &model]].concat();
    let error = refused(FAILED, &[&["train", &path(&folder, "rooms/bars")], &quick[..]].concat());
    assert!(error.contains("not a data set"), "{error}");
    let told = done(&[&["train", &LAB.data()], &quick[..]].concat());
    assert!(told.contains("Pictures of elsewhere that tell what is no room: 5"), "{told}");
}

#[test]
fn data_that_nothing_can_be_learned_from_is_refused_with_a_reason() {
    let folder = TempDir::new().unwrap();
    for room in [
        "one/kitchen",
        "empty",
        "case/Hall",
        "case/hall",
        "train/train",
        "train/val",
        "junk/hall",
        "junk/bath",
    ] {
        fs::create_dir_all(folder.path().join(room)).unwrap();
    }
    for picture in
        ["one/kitchen/0.png", "case/Hall/0.png", "case/hall/1.png", "train/train/0.png", "train/val/1.png"]
    {
        frame("dots", 0).save(folder.path().join(picture)).unwrap();
    }
    for picture in ["junk/hall/1.jpg", "junk/bath/1.jpg"] {
        fs::write(folder.path().join(picture), "no image").unwrap();
    }
    for (data, reason) in [
        ("missing", "no such"),
        ("empty", "not a data set"),
        ("one", "every frame shows `kitchen`"),
        ("case", "`Hall` and `hall` are the name of one room"),
        ("train", "`train` and `val` are no rooms"),
        ("junk", "none of the 2 frames can be used"),
    ] {
        let error = refused(FAILED, &["train", &path(&folder, data), "-o", &path(&folder, "model")]);
        assert!(error.contains(reason), "{data}: {error}");
    }
    let error = refused(FAILED, &["evaluate", &LAB.model(), &path(&folder, "empty")]);
    assert!(error.contains("not a data set"), "{error}");
    let file = text(&folder.path().join("one/kitchen/0.png"));
    let error = refused(FAILED, &["train", &file, "-o", &path(&folder, "model")]);
    assert!(error.contains("it is a file: give a folder"), "{error}");
}
