//! Data sets made in a temporary folder, opened as a user would.

mod layouts;
mod senses;

use super::cold::{DrivenPath, Illumination, Part, SequenceName};
use super::*;
use proptest::prelude::*;
use roomsight_vision::image::ImageError;
use std::os::unix::fs::symlink;
use tempfile::TempDir;

/// Writes files of one byte, or with the text after ` = `.
fn tree(files: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for file in files {
        let (name, content) = file.split_once(" = ").unwrap_or((file, "x"));
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
    folder
}

/// `sequence:room:name` of each frame.
fn frames(dataset: &Dataset) -> Vec<String> {
    let describe = |frame: &Frame| format!("{}:{}:{}", frame.sequence, frame.room, files::name(&frame.path));
    dataset.frames.iter().map(describe).collect()
}

fn reasons(dataset: &Dataset) -> Vec<&str> {
    dataset.problems.iter().map(|problem| problem.reason.as_str()).collect()
}

/// `path: reason` of problems, below the folder of the data set.
fn told(set: &TempDir, problems: &[Problem]) -> Vec<String> {
    let folder = format!("{}/", set.path().display());
    problems.iter().map(|problem| problem.to_string().replace(&folder, "")).collect()
}

const T1: &str = "t1.0_x0.0_y0.0_a0.0.jpeg";
const T2: &str = "t2.0_x1.5_y0.0_a-1.0.jpeg";

fn cold_tree(sequences: &[&str]) -> TempDir {
    let folder = tree(&[]);
    for sequence in sequences {
        let sequence = folder.path().join(sequence);
        for camera in ["std_cam", "omni_cam"] {
            fs::create_dir_all(sequence.join(camera)).unwrap();
            fs::write(sequence.join(camera).join(T1), "x").unwrap();
            fs::write(sequence.join(camera).join(T2), "x").unwrap();
        }
        fs::create_dir_all(sequence.join("localization")).unwrap();
        fs::write(sequence.join("localization/places.lst"), format!("{T2} KT-B\n{T1} CR-B\n")).unwrap();
    }
    folder
}

#[test]
fn a_folder_a_room() {
    let set = tree(&[
        "kitchen/10.jpg",
        "kitchen/9.JPG",
        "kitchen/notes.txt",
        "kitchen/.hidden.jpg",
        "hall/day1/1.png",
        "hall/day1/deep/1.png",
        "empty/readme.md",
        "stray.webp",
    ]);
    let dataset = open(set.path()).unwrap();
    assert_eq!(dataset.format, Format::Folder);
    assert_eq!(frames(&dataset), [":kitchen:9.JPG", ":kitchen:10.jpg", "day1:hall:1.png"]);
    assert_eq!(dataset.rooms(), ["hall", "kitchen"]);
    assert_eq!(
        told(&set, &dataset.problems),
        [
            "empty/readme.md: not a picture",
            "kitchen/.hidden.jpg: hidden, or left by a system, a camera or a network drive",
            "kitchen/notes.txt: not a picture",
            "stray.webp: not in the folder of a room",
            "empty: a room without a frame",
            "hall/day1/deep/1.png: deeper than ROOM/SEQUENCE, not read",
        ]
    );
    dataset.check().unwrap();
}

#[test]
fn a_manifest_is_opened_by_its_folder_or_itself() {
    let rows =
        "file,place,sequence,split\n2.jpg,hall,s,test\n1.jpg,kitchen,s,train\n3.jpg,,s,\ngone.jpg,hall,s,";
    let set = tree(&[&format!("frames.csv = {rows}"), "1.jpg", "2.jpg", "3.jpg"]);
    for path in [set.path().to_owned(), set.path().join("frames.csv")] {
        let dataset = open(&path).unwrap();
        assert_eq!(dataset.format, Format::Manifest);
        assert_eq!(frames(&dataset), ["s:kitchen:1.jpg", "s:hall:2.jpg"]);
        assert_eq!(dataset.unlabeled.len(), 1);
        assert_eq!(reasons(&dataset), ["listed in the manifest, but there is no such file"]);
        assert_eq!(frames(&dataset.with_split("train").unwrap()), ["s:kitchen:1.jpg"]);
    }
}

#[test]
fn cold_is_opened_from_any_level() {
    let sequence = "cold-saarbruecken/part_b/seq3_cloudy1";
    let set = cold_tree(&[sequence]);
    for level in sequence.match_indices('/').map(|(end, _)| &sequence[..end]).chain(["", sequence]) {
        let dataset = open(&set.path().join(level)).unwrap();
        assert_eq!(dataset.format, Format::Cold);
        assert_eq!(reasons(&dataset), [""; 0]);
        let dataset = dataset.with_camera(CameraKind::Omnidirectional).unwrap();
        let name = "saarbruecken/part_b/seq3_cloudy1";
        assert_eq!(frames(&dataset), [format!("{name}:corridor:{T1}"), format!("{name}:kitchen:{T2}")]);
        assert_eq!(dataset.frames[1].time, Some(2.0));
        assert_eq!(dataset.frames[1].pose, Some(Pose { x: 1.5, y: 0.0, angle: -1.0 }));
        dataset.check().unwrap();
    }
}

#[test]
fn older_archives_have_no_part_folder() {
    let set = cold_tree(&["freiburg/seq1_night2", "lab7/seq1_night2", "seq4_sunny1"]);
    let dataset = open(set.path()).unwrap().with_sequences("*night?, seq4*").unwrap();
    let sequences: BTreeSet<&str> = dataset.frames.iter().map(|frame| frame.sequence.as_str()).collect();
    assert_eq!(Vec::from_iter(sequences), ["freiburg/seq1_night2", "lab7/seq1_night2", "seq4_sunny1"]);
    let one = open(&set.path().join("lab7/seq1_night2")).unwrap();
    assert_eq!(one.frames[0].sequence, "seq1_night2", "a folder above counts only when its name says lab");
}

#[test]
fn what_is_wrong_in_a_sequence_is_reported() {
    let set = cold_tree(&["seq1_cloudy1", "seq1_cloudy2", "seq1_cloudy3"]);
    let sequence = |name: &str| set.path().join(name);
    fs::write(
        sequence("seq1_cloudy1/localization/places.lst"),
        format!("{T1} XY\ngarbage\nt9_x0_y0_a0.jpeg CR"),
    )
    .unwrap();
    fs::remove_dir_all(sequence("seq1_cloudy1/std_cam")).unwrap();
    fs::remove_dir_all(sequence("seq1_cloudy2/std_cam")).unwrap();
    fs::remove_dir_all(sequence("seq1_cloudy2/omni_cam")).unwrap();
    fs::remove_file(sequence("seq1_cloudy3/localization/places.lst")).unwrap();
    fs::remove_dir_all(sequence("seq1_cloudy3/omni_cam")).unwrap();
    let dataset = open(set.path()).unwrap();
    assert_eq!(frames(&dataset), [format!("seq1_cloudy1:XY:{T1}")]);
    let labels = "seq1_cloudy1/localization/places.lst";
    assert_eq!(
        told(&set, &dataset.notes),
        [format!("{labels}: the label `XY` is none of COLD's: taken as the name of a room (frames: 1)")]
    );
    assert_eq!(dataset.problems[0].line, Some(2));
    assert_eq!(
        reasons(&dataset),
        [
            "not a file name and a label",
            "no label in places.lst",
            "labeled in places.lst, but there is no such file",
            "labels: 2, but neither std_cam nor omni_cam",
            "no such file: the frames of this sequence have no place",
            "no label in places.lst",
            "no label in places.lst",
        ]
    );
    // One label file that cannot be read leaves the others.
    for (bytes, reason) in
        [(&b" \n"[..], "empty: it labels no frame"), (b"\xff", "not UTF-8 text (line 1): save it as UTF-8")]
    {
        fs::write(set.path().join(labels), bytes).unwrap();
        assert_eq!(told(&set, &open(set.path()).unwrap().problems)[0], format!("{labels}: {reason}"));
    }
}

#[test]
fn cold_frames_that_were_encoded_anew_keep_their_labels() {
    let set = tree(&[
        &format!("seq1_sunny1/localization/places.lst = \u{feff}{T1} CR-A\r\n{T2} KT-A\r\n"),
        "seq1_sunny1/std_cam/t1.0_x0.0_y0.0_a0.0.JPEG",
        "seq1_sunny1/std_cam/t2.0_x1.5_y0.0_a-1.0.png",
        "seq1_sunny1/std_cam/t2.0_x1.5_y0.0_a-1.0.webp",
    ]);
    let dataset = open(set.path()).unwrap();
    assert_eq!(dataset.rooms(), ["corridor", "kitchen"]);
    assert_eq!(reasons(&dataset), ["the same frame as another file beside it, but for the ending"]);
    assert_eq!(dataset.notes, []);
}

#[test]
fn sequences_of_one_name_are_not_mixed() {
    let set = cold_tree(&["cold-freiburg/part_a/seq1_sunny1", "freiburg/part_a/seq1_sunny1"]);
    let dataset = open(set.path()).unwrap();
    assert_eq!(dataset.frames.len(), 4);
    assert_eq!(
        reasons(&dataset),
        ["its name, of lab, part and sequence, is that of another: open them one by one"]
    );
}

#[test]
fn a_sequence_name_says_lab_part_path_and_light() {
    let name = SequenceName::parse("saarbruecken/part_b/seq4_night12").unwrap();
    assert_eq!(
        (name.lab.as_str(), name.part, name.path, name.illumination, name.run),
        ("saarbruecken", Part::B, DrivenPath::Extended, Illumination::Night, 12)
    );
    assert_eq!(SequenceName::parse("freiburg/seq1_cloudy1").unwrap().lab, "freiburg");
    assert_eq!(SequenceName::parse("part_a/seq1_sunny1").unwrap().lab, "");
    for other in ["", "seq5_night1", "seq1_dawn1", "seq1_night", "seq1", "b0_basement_lift"] {
        assert_eq!(SequenceName::parse(other), None, "{other}");
    }
}

#[test]
fn sets_that_cannot_be_used_are_refused() {
    let refused = |dataset: Result<Dataset, DatasetError>| {
        dataset.and_then(|dataset| dataset.check()).unwrap_err().to_string()
    };
    assert!(refused(open(Path::new("no/such/set"))).contains("no/such/set: no such file or folder"));
    assert!(refused(open(tree(&[]).path())).contains("not a data set (no picture in it); what can be read"));
    assert!(refused(open(&tree(&["a.txt"]).path().join("a.txt"))).contains("not a data set"));
    assert!(refused(open(tree(&["1.jpg"]).path())).contains("pictures lie in it directly"));
    assert!(refused(open(tree(&["hall/1.jpg"]).path())).contains("every frame shows `hall`"));
    let gone = tree(&["frames.csv = file,place\n1.jpg,hall"]);
    assert!(refused(open(gone.path())).contains("no usable frame (problems: 1, the first: "));
    let unlabeled = tree(&["frames.csv = file,place\n1.jpg,", "1.jpg"]);
    assert!(refused(open(unlabeled.path())).contains("frames without a place: 1"));
    let mixed = refused(open(cold_tree(&["seq1_cloudy1"]).path()));
    assert!(mixed.contains("(omnidirectional, perspective): choose one"), "{mixed}");
}

#[test]
fn a_selection_without_a_frame_names_what_there_is() {
    let set = cold_tree(&["seq1_cloudy1", "seq1_night1"]);
    let dataset = open(set.path()).unwrap();
    let error = dataset.clone().with_sequences("*sunny?").unwrap_err().to_string();
    assert_eq!(error, "no frame has the sequence `*sunny?`; there are: seq1_cloudy1, seq1_night1");
    let error = dataset.clone().with_split("train").unwrap_err().to_string();
    assert_eq!(error, "no frame has the split `train`; there are: none");
    let error = dataset.with_camera(CameraKind::Equirectangular).unwrap_err().to_string();
    assert!(error.ends_with("there are: omnidirectional, perspective"), "{error}");
}

#[test]
fn folders_take_the_camera_that_is_asked_for() {
    let set = tree(&["hall/1.jpg", "kitchen/1.jpg"]);
    let dataset = open(set.path()).unwrap().with_camera(CameraKind::Equirectangular).unwrap();
    assert!(dataset.frames.iter().all(|frame| frame.camera == CameraKind::Equirectangular));
}

#[test]
fn links_that_loop_end() {
    let set = tree(&["hall/1.jpg", "kitchen/1.jpg"]);
    symlink(set.path(), set.path().join("hall/up")).unwrap();
    symlink(set.path().join("hall"), set.path().join("hall/self")).unwrap();
    symlink(set.path().join("hall"), set.path().join("lobby")).unwrap();
    symlink(set.path().join("nowhere"), set.path().join("kitchen/broken.jpg")).unwrap();
    symlink(set.path().join("kitchen/mirror.jpg"), set.path().join("kitchen/mirror.jpg")).unwrap();
    let dataset = open(set.path()).unwrap();
    assert_eq!(frames(&dataset), [":hall:1.jpg", ":kitchen:1.jpg", ":lobby:1.jpg"]);
    let told = told(&set, &dataset.problems);
    assert!(told[0].starts_with("kitchen/mirror.jpg: cannot be read: "), "{told:?}");
    assert_eq!(
        told[1..],
        [
            "hall/self: a link back to a folder that it lies in",
            "hall/up: a link back to a folder that it lies in",
            "kitchen/broken.jpg: a link that leads nowhere",
            "lobby/self: a link back to a folder that it lies in",
            "lobby/up: a link back to a folder that it lies in",
        ]
    );
}

#[test]
fn links_that_lead_to_each_other_end() {
    let set = tree(&["hall/1.jpg", "kitchen/1.jpg"]);
    symlink(set.path().join("kitchen"), set.path().join("hall/next")).unwrap();
    symlink(set.path().join("hall"), set.path().join("kitchen/next")).unwrap();
    let dataset = open(set.path()).unwrap();
    assert_eq!(dataset.frames.len(), 4);
    assert_eq!(
        told(&set, &dataset.problems),
        [
            "hall/next/next: a link back to a folder that it lies in",
            "kitchen/next/next: a link back to a folder that it lies in",
        ]
    );
}

#[test]
fn frames_that_cannot_be_read_are_problems() {
    let set = tree(&["hall/text.jpg = not an image"]);
    let frame = &open(set.path()).unwrap().frames[0];
    let problem = |max_bytes| frame.read(&Limits { max_bytes, ..Limits::default() }).unwrap_err().to_string();
    let not_an_image = format!("hall/text.jpg: {}", ImageError::UnknownFormat);
    assert!(problem(100).ends_with(&not_an_image), "{}", problem(100));
    assert!(problem(5).ends_with("hall/text.jpg: 12 bytes long, at most 5 are read"), "{}", problem(5));
    fs::write(&frame.path, "").unwrap();
    assert!(problem(100).ends_with("hall/text.jpg: an empty file"), "{}", problem(100));
    let folder = Frame { path: set.path().to_owned(), ..frame.clone() };
    assert!(folder.read(&Limits::default()).unwrap_err().to_string().ends_with("not a regular file"));
}

#[test]
fn label_files_of_absurd_size_are_refused_unread() {
    let set = tree(&["frames.csv"]);
    let csv = fs::File::create(set.path().join("frames.csv")).unwrap();
    csv.set_len(files::MAX_LABEL_BYTES + 1).unwrap();
    assert!(open(set.path()).unwrap_err().to_string().contains("67108865 bytes long"));
}

#[test]
fn problems_of_one_kind_are_one_line() {
    let problem = |path: &str, reason: &str| Problem::new(Path::new(path), reason);
    let problems = [
        problem("a/1.jpg", "5 bytes long, at most 4 are read").with("one"),
        problem("l.csv", "names no file").at(3),
        problem("a/2.jpg", "7 bytes long, at most 4 are read").with("two"),
        problem("b\u{1b}[2J\n.jpg", "damaged"),
        problem("l.csv", "names no file").at(9),
        problem("l.csv", "names no file").at(11),
    ];
    let kinds: Vec<String> = by_kind(&problems).iter().map(ToString::to_string).collect();
    assert_eq!(
        kinds,
        [
            "a/1.jpg and 1 more: 5 bytes long, at most 4 are read (one)",
            "l.csv, line 3 and 2 more: names no file",
            "b\\u{1b}[2J\\n.jpg: damaged",
        ]
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever lies in a folder: nothing panics, and each file is a frame or named.
    #[test]
    fn no_file_is_skipped_in_silence(
        files in proptest::collection::btree_set(
            "((train|val|DCIM|a|b|c|@eaDir)/){0,4}(1[.]jpg|2|x[.]txt|Thumbs[.]db|l[.]csv|[.]y)", 1..12,
        ),
    ) {
        // A name cannot be a file and a folder.
        let is_folder = |file: &String| files.iter().any(|other| other.starts_with(&format!("{file}/")));
        let files: Vec<&str> = files.iter().filter(|file| !is_folder(file)).map(String::as_str).collect();
        let set = tree(&files);
        if let Ok(dataset) = open(set.path()) {
            let frames = dataset.frames.iter().map(|frame| frame.path.clone());
            let named: BTreeSet<PathBuf> = frames.chain(dataset.problems.iter().map(|problem| problem.path.clone())).collect();
            for file in files {
                let is_named = set.path().join(file).ancestors().any(|path| named.contains(path));
                prop_assert!(is_named, "{file}: {named:?}");
            }
        }
    }
}
