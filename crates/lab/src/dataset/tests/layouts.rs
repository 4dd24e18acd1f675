//! Folders as other tools, systems and cameras leave them.

use super::*;
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::PermissionsExt;
use std::process::{Command, Stdio};

/// `split:sequence:room:name` of each frame.
fn split_frames(dataset: &Dataset) -> Vec<String> {
    let labels = frames(dataset).into_iter().zip(&dataset.frames);
    labels.map(|(label, frame)| format!("{}:{label}", frame.split)).collect()
}

#[test]
fn splits_above_the_rooms_are_no_rooms() {
    for around in ["", "photos/", "archive/photos/"] {
        let files =
            ["train/hall/1.jpg", "train/kitchen/a/2.jpg", "Val/hall/3.jpg", "Val/kitchen/4.jpg", "Val/5.jpg"];
        let files = files.map(|file| format!("{around}{file}"));
        let set = tree(&files.each_ref().map(String::as_str));
        let dataset = open(set.path()).unwrap();
        assert_eq!(
            split_frames(&dataset),
            ["Val::hall:3.jpg", "Val::kitchen:4.jpg", "train::hall:1.jpg", "train:a:kitchen:2.jpg"]
        );
        assert_eq!(reasons(&dataset), ["not in the folder of a room"]);
        let note = &told(&set, &dataset.notes).pop().unwrap();
        assert!(note.contains("`Val` and `train` are taken as splits"), "{note}");
        assert_eq!(split_frames(&dataset.with_split("train").unwrap()).len(), 2);
    }
    let one = open(tree(&["train/hall/1.jpg", "train/kitchen/1.jpg"]).path()).unwrap();
    assert_eq!(split_frames(&one), ["train::hall:1.jpg", "train::kitchen:1.jpg"]);
}

#[test]
fn splits_below_the_rooms_are_no_drives() {
    let set =
        tree(&["hall/train/1.jpg", "hall/test/2.jpg", "kitchen/train/monday/1.jpg", "kitchen/test/2.jpg"]);
    let dataset = open(set.path()).unwrap();
    assert_eq!(
        split_frames(&dataset),
        ["test::hall:2.jpg", "train::hall:1.jpg", "test::kitchen:2.jpg", "train:monday:kitchen:1.jpg"]
    );
    let drives = open(tree(&["hall/train/1.jpg", "hall/monday/2.jpg", "kitchen/1.jpg"]).path()).unwrap();
    assert_eq!(split_frames(&drives), ["::kitchen:1.jpg", ":monday:hall:2.jpg", ":train:hall:1.jpg"]);
}

#[test]
fn splits_that_cannot_be_read_are_told() {
    let error = |files: &[&str]| open(tree(files).path()).unwrap_err().to_string();
    let direct = error(&["train/1.jpg", "val/2.jpg"]);
    assert!(
        direct.contains("`train` and `val` are no rooms") && direct.contains("train/kitchen/1.jpg"),
        "{direct}"
    );
    let beside = error(&["train/hall/1.jpg", "val/hall/2.jpg", "extra/1.jpg"]);
    assert!(beside.contains("`train` and `val` look like splits") && beside.contains("`extra`"), "{beside}");
    let room = open(tree(&["test/1.jpg", "hall/1.jpg", "kitchen/1.jpg"]).path()).unwrap();
    assert_eq!(room.rooms(), ["hall", "kitchen", "test"]);
}

#[test]
fn folders_around_the_rooms_are_no_rooms() {
    for around in ["photos", "home/photos"] {
        let file = |file: &str| format!("{around}/{file}");
        let files = [file("hall/1.jpg"), file("kitchen/monday/1.jpg"), "__MACOSX/photos/._1.jpg".to_owned()];
        let set = tree(&files.each_ref().map(String::as_str));
        let dataset = open(set.path()).unwrap();
        assert_eq!(frames(&dataset), [":hall:1.jpg", "monday:kitchen:1.jpg"]);
        assert_eq!(
            told(&set, &dataset.notes),
            [format!("{around}: the folders in it are taken as the rooms")]
        );
        dataset.check().unwrap();
    }
    let list = tree(&["photos/frames.csv = file,place\n1.jpg,hall", "photos/1.jpg"]);
    assert_eq!(frames(&open(list.path()).unwrap()), [":hall:1.jpg"]);
}

#[test]
fn a_room_beside_one_without_a_picture_is_no_folder_around_rooms() {
    let drives = ["kitchen/monday/1.jpg", "kitchen/tuesday/1.jpg"];
    let heic = "hall/1.HEIC = \0\0\0\x18ftypheic\0\0\0\0mif1heic";
    let set = tree(&[drives[0], drives[1], heic]);
    assert_eq!(open(set.path()).unwrap().rooms(), ["kitchen"]);
    let set = tree(&drives);
    fs::create_dir(set.path().join("hall")).unwrap();
    assert_eq!(open(set.path()).unwrap().rooms(), ["kitchen"]);
    let set = tree(&["images/hall/1.jpg", "images/kitchen/1.jpg", "notes/1.txt"]);
    assert_eq!(open(set.path()).unwrap().rooms(), ["hall", "kitchen"]);
}

#[test]
fn a_single_room_that_a_model_knows_is_no_folder_around_rooms() {
    let set = tree(&["kitchen/monday/1.jpg", "kitchen/tuesday/1.jpg"]);
    let rooms = ["hall", "kitchen"].map(str::to_owned);
    assert_eq!(open_for(set.path(), &rooms, &Taking::default()).unwrap().rooms(), ["kitchen"]);
    assert_eq!(open(set.path()).unwrap().rooms(), ["monday", "tuesday"]);
}

#[test]
fn what_is_a_picture_is_told_by_its_content() {
    let set = tree(&[
        "hall/1.jpg",
        "hall/2.JFIF",
        "hall/3.txt = P5\n",
        "hall/4 = GIF89a",
        "hall/7 = P2\n",
        "hall/5.txt",
        "hall/6 = ",
        "k/1.jpg",
    ]);
    let dataset = open(set.path()).unwrap();
    assert_eq!(frames(&dataset), [":hall:1.jpg", ":hall:2.JFIF", ":hall:3.txt", ":hall:7", ":k:1.jpg"]);
    assert_eq!(
        told(&set, &dataset.problems),
        [
            "hall/4: a GIF is not read here; convert it to JPEG or PNG",
            "hall/5.txt: not a picture",
            "hall/6: an empty file"
        ]
    );
}

#[test]
fn what_systems_and_cameras_leave_is_no_room() {
    let set = tree(&[
        "hall/1.jpg",
        "hall/@eaDir/1.jpg/SYNOPHOTO_THUMB_M.jpg",
        "hall/._1.jpg",
        "hall/MVI_1.THM",
        "hall/DCIM/100CANON/2.jpg",
        "kitchen/1.jpg",
        "$RECYCLE.BIN/1.jpg",
        "System Volume Information/1.jpg",
        "#recycle/hall/1.jpg",
        ".Trashes/501/1.jpg",
        "lost+found/1.jpg",
        "DCIM/101CANON/3.jpg",
    ]);
    let dataset = open(set.path()).unwrap();
    assert_eq!(frames(&dataset), [":hall:1.jpg", ":kitchen:1.jpg", "100CANON:hall:2.jpg"]);
    let kinds: Vec<usize> = by_kind(&dataset.problems).iter().map(|kind| kind.n_problems).collect();
    assert_eq!(kinds, [8, 1], "{:?}", told(&set, &dataset.problems));
    assert!(
        dataset.problems[8].to_string().ends_with("in a camera's folder: put it into the folder of a room")
    );
}

#[test]
fn names_that_look_the_same_are_not_two_rooms() {
    let decomposed = tree(&["Ku\u{308}che/1.jpg", "K\u{fc}che/2.jpg", "hall/1.jpg", "hall /2.jpg"]);
    let dataset = open(decomposed.path()).unwrap();
    assert_eq!(dataset.rooms(), ["K\u{fc}che", "hall"]);
    let notes: Vec<&str> = dataset.notes.iter().map(|note| note.reason.as_str()).collect();
    let why = "differ in spaces or in how letters are encoded: taken as one room";
    assert_eq!(
        notes,
        [format!("`Ku\\u{{308}}che` and `K\u{fc}che` {why}"), format!("`hall` and `hall ` {why}")]
    );
    dataset.check().unwrap();

    let cases = tree(&["Kitchen/1.jpg", "kitchen/2.jpg", "hall/1.jpg"]);
    let error = open(cases.path()).unwrap().check().unwrap_err().to_string();
    assert!(error.starts_with("`Kitchen` and `kitchen` are the name of one room"), "{error}");
    assert!(error.contains("Kitchen/1.jpg; ") && error.contains("kitchen/2.jpg"), "{error}");
    let of_model =
        open(tree(&["Attic/1.jpg"]).path()).unwrap().check_names(&["attic".to_owned()]).unwrap_err();
    assert!(of_model.to_string().contains("(a room of the model; "), "{of_model}");
    let list = tree(&["frames.csv = file,place\n1.jpg,hall\n2.jpg,h\u{200b}all", "1.jpg", "2.jpg"]);
    let error = open(list.path()).unwrap().check().unwrap_err().to_string();
    assert!(error.contains("`h\\u{200b}all`"), "{error}");
}

#[test]
fn names_that_cannot_be_kept_are_named() {
    let set = tree(&["hall/1.jpg", "kitchen/1.jpg", "  /2.jpg", "bed\nroom/3.jpg"]);
    for folder in ["K\u{fc}che", "hall/Z\u{fc}g"] {
        let latin: Vec<u8> = folder.chars().map(|letter| letter as u8).collect();
        let folder = set.path().join(OsStr::from_bytes(&latin));
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("4.jpg"), "x").unwrap();
    }
    let dataset = open(set.path()).unwrap();
    assert_eq!(frames(&dataset), [":hall:1.jpg", ":kitchen:1.jpg"]);
    let mut reasons = reasons(&dataset);
    reasons.sort_unstable();
    assert_eq!(
        reasons,
        [
            "its room or drive has a line break or control character in its name: rename it",
            "the name of its room is empty: name it",
            "the name of its room is not UTF-8: rename that folder",
            "the name of its sequence is not UTF-8: rename that folder",
        ]
    );
    let file = set.path().join(OsStr::from_bytes(b"hall/\xfc.jpg"));
    fs::write(file, "x").unwrap();
    assert_eq!(open(set.path()).unwrap().frames.len(), 3, "only rooms and drives need names");
}

#[test]
fn pipes_and_folders_called_pictures_are_not_opened() {
    let set = tree(&["hall/1.jpg", "kitchen/1.jpg", "kitchen/x.jpg/2.jpg"]);
    let made = Command::new("mkfifo").arg(set.path().join("hall/pipe.jpg")).stdout(Stdio::null()).status();
    assert!(made.unwrap().success());
    symlink("/dev/zero", set.path().join("hall/zero.jpg")).unwrap();
    let dataset = open(set.path()).unwrap();
    assert_eq!(frames(&dataset), [":hall:1.jpg", ":kitchen:1.jpg", "x.jpg:kitchen:2.jpg"]);
    assert_eq!(reasons(&dataset), ["a pipe, a socket or a device: only files are read"; 2]);
}

#[test]
fn a_folder_that_cannot_be_read_leaves_the_others() {
    let set = tree(&["hall/1.jpg", "kitchen/1.jpg", "secret/1.jpg", "hall/secret/1.jpg"]);
    let locked = ["secret", "hall/secret"].map(|folder| set.path().join(folder));
    let lock = |mode| {
        for folder in &locked {
            fs::set_permissions(folder, PermissionsExt::from_mode(mode)).unwrap();
        }
    };
    lock(0);
    if fs::read_dir(&locked[0]).is_ok() {
        eprintln!("skipped: this user may read every folder");
        return;
    }
    let dataset = open(set.path()).unwrap();
    assert_eq!(frames(&dataset), [":hall:1.jpg", ":kitchen:1.jpg"]);
    let told = told(&set, &dataset.problems);
    assert!(
        told[0].starts_with("secret: cannot be read: ") && told[1].starts_with("hall/secret: cannot"),
        "{told:?}"
    );
    let error = open(&locked[0]).unwrap_err().to_string();
    assert!(error.contains("ermission denied"), "{error}");
    lock(0o755);
}

#[test]
fn lists_are_found_whatever_the_case_and_name_files_as_people_do() {
    let rows = "File;Place\nHall\\1.jpg;hall\n.\\Hall\\2.jpg;hall\nKu\u{308}che/1.jpg;k\nHall;hall\n";
    let set = tree(&[&format!("Frames.CSV = {rows}"), "Hall/1.jpg", "Hall/2.jpg", "K\u{fc}che/1.jpg"]);
    let dataset = open(set.path()).unwrap();
    assert_eq!(dataset.format, Format::Manifest);
    assert_eq!(frames(&dataset), [":hall:1.jpg", ":hall:2.jpg", ":k:1.jpg"]);
    assert_eq!(reasons(&dataset), ["listed in the manifest, but it is no file"]);
    let utf16: Vec<u8> =
        "\u{feff}file\tplace\r\nHall/1.jpg\thall\r\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    fs::write(set.path().join("list.tsv"), utf16).unwrap();
    assert_eq!(frames(&open(&set.path().join("list.tsv")).unwrap()), [":hall:1.jpg"]);
    let whole = format!("file,place\n{}/Hall/1.jpg,hall\n", fs::canonicalize(set.path()).unwrap().display());
    fs::write(set.path().join("whole.csv"), whole).unwrap();
    assert_eq!(frames(&open(&set.path().join("whole.csv")).unwrap()), [":hall:1.jpg"]);
    let other = tree(&["labels.csv = file,place", "hall/1.jpg", "kitchen/1.jpg"]);
    let told = told(&other, &open(other.path()).unwrap().problems);
    assert_eq!(
        told,
        ["labels.csv: a list, not read: give it itself in place of the folder, if it names frames"]
    );
}
