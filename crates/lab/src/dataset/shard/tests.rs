//! Parts written and read again, damaged, mixed and missing.

use super::*;
use crate::dataset::{Described, open};
use image::GrayImage;
use roomsight_recognition::model::Config;
use roomsight_vision::camera::Camera;
use roomsight_vision::image::Limits;
use tempfile::TempDir;

const N_FRAMES: usize = 7;

/// Two rooms with so many frames in two drives, of which the first of a room is damaged.
fn pictures() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (room_idx, room) in ["hall", "lab"].into_iter().enumerate() {
        for idx in 0..N_FRAMES {
            let path = folder.path().join(format!("{room}/drive{}/{idx}.png", idx % 2));
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            let pixel = |x: u32, y: u32| [((x * (idx as u32 + 3)) ^ (y * (room_idx as u32 * 9 + 5))) as u8];
            let picture = GrayImage::from_fn(96, 72, |x, y| pixel(x, y).into());
            picture.save(&path).unwrap();
        }
    }
    fs::write(folder.path().join("lab/drive0/0.png"), "no picture").unwrap();
    folder
}

fn extractor() -> Extractor {
    let config = Config { longest_side: 96, ..Config::default() };
    Extractor::new(&config, Camera::new(Projection::Perspective))
}

fn describe(dataset: &Dataset) -> Described {
    dataset.describe(&extractor(), &Limits::default(), || ())
}

fn part(text: &str) -> Part {
    text.parse().unwrap()
}

/// Writes a part as the command does.
fn write(pictures: &Path, name: &str, folder: &Path) -> Shard {
    let dataset = open(pictures).unwrap().with_part(part(name));
    let key = dataset.part_key(&extractor());
    dataset.write_part(part(name), key, &describe(&dataset), &extractor(), folder).unwrap()
}

fn parts_of(pictures: &TempDir, names: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    names.iter().for_each(|name| drop(write(pictures.path(), name, folder.path())));
    folder
}

/// What there is to train and measure with.
fn told(dataset: &Dataset, described: &Described) -> String {
    let Described { samples, frame_idxs, digests, looks, problems, .. } = described;
    let frames: Vec<&Frame> = frame_idxs.iter().map(|&idx| &dataset.frames[idx]).collect();
    let mut problems: Vec<String> =
        dataset.problems.iter().chain(problems).map(|problem| problem.reason.clone()).collect();
    problems.sort();
    format!("{frames:?} {samples:?} {digests:?} {looks:?} {problems:?} {:?}", dataset.rooms())
}

#[test]
fn parts_are_the_pictures_that_they_were_made_of() {
    let pictures = pictures();
    let dataset = open(pictures.path()).unwrap();
    for names in [vec!["1/1"], vec!["2/3", "3/3", "1/3"]] {
        let folder = parts_of(&pictures, &names);
        let parts = open(folder.path()).unwrap();
        assert!(parts.notes.is_empty(), "{:?}", parts.notes);
        assert_eq!(told(&parts, &describe(&parts)), told(&dataset, &describe(&dataset)));
        assert_eq!(parts.described_size(), Some([96, 72]));
    }
}

#[test]
fn no_picture_is_read_again() {
    let pictures = pictures();
    let folder = parts_of(&pictures, &["1/2", "2/2"]);
    let before = open(folder.path()).map(|parts| told(&parts, &describe(&parts))).unwrap();
    drop(pictures);
    let parts = open(folder.path()).unwrap();
    assert_eq!(told(&parts, &describe(&parts)), before);
}

#[test]
fn sequences_of_parts_are_taken_as_of_pictures() {
    let pictures = pictures();
    let folder = parts_of(&pictures, &["1/2", "2/2"]);
    let some = |path: &Path| open(path).unwrap().with_sequences("*1").unwrap();
    let (parts, dataset) = (some(folder.path()), some(pictures.path()));
    assert_eq!(describe(&parts).samples.len(), describe(&dataset).samples.len());
    let elsewhere = vec![pictures.path().join("hall/drive0/0.png")];
    let parts = parts.with_elsewhere(elsewhere, CameraKind::Perspective);
    assert!(describe(&parts).samples.last().unwrap().is_elsewhere());
}

#[test]
fn a_part_that_is_missing_or_damaged_is_told() {
    let pictures = pictures();
    let folder = parts_of(&pictures, &["1/3", "3/3"]);
    let notes = |folder: &TempDir| {
        open(folder.path()).unwrap().notes.iter().map(ToString::to_string).collect::<String>()
    };
    assert!(notes(&folder).contains("a part is not there: 2/3"), "{}", notes(&folder));
    let shard = write(pictures.path(), "2/3", folder.path());
    assert!(notes(&folder).is_empty());
    let mut bytes = fs::read(shard.features_path()).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(shard.features_path(), bytes).unwrap();
    let problems = |folder: &TempDir| {
        let parts = open(folder.path()).unwrap();
        let all: Vec<Problem> = [parts.problems.clone(), describe(&parts).problems].concat();
        all.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    assert!(problems(&folder).contains("has another digest"), "{}", problems(&folder));
    fs::remove_file(shard.features_path()).unwrap();
    assert!(problems(&folder).contains("is not there"));
    let json = folder.path().join("part-1-of-3.frames.json");
    let text = fs::read_to_string(&json).unwrap();
    for (from, to, reason) in [
        ("\"version\":1,\"part\"", "\"version\":9,\"part\"", "format version 9"),
        ("\"part\":[1,3]", "\"part\":[4,3]", "a part is NUMBER/OF"),
        ("\"features\":\"", "\"features\":\"../", "digest"),
        ("\"thumbnail\":\"", "\"thumbnail\":\"g", "a thumbnail is none"),
        ("{", "", "damaged"),
    ] {
        assert!(text.contains(from), "{from}");
        fs::write(&json, text.replacen(from, to, 1)).unwrap();
        assert!(problems(&folder).contains(reason), "{from}: {}", problems(&folder));
    }
}

#[test]
fn what_was_described_in_another_way_is_told() {
    let folder = parts_of(&pictures(), &["1/1"]);
    let other = Config { longest_side: 64, ..Config::default() };
    let other = Extractor::new(&other, Camera::new(Projection::Perspective));
    let described = open(folder.path()).unwrap().describe(&other, &Limits::default(), || ());
    assert!(described.samples.is_empty());
    assert!(described.problems[0].reason.contains("at another working size"), "{:?}", described.problems[0]);
}

#[test]
fn a_part_is_kept_until_something_of_it_changes() {
    let pictures = pictures();
    let folder = parts_of(&pictures, &["1/2"]);
    let is_there = |extractor: &Extractor| {
        let dataset = open(pictures.path()).unwrap().with_part(part("1/2"));
        Shard::find(folder.path(), part("1/2"), &dataset.part_key(extractor)).is_some()
    };
    let n_files = || fs::read_dir(folder.path()).unwrap().count();
    assert!(is_there(&extractor()));
    let other = Config { longest_side: 64, ..Config::default() };
    assert!(!is_there(&Extractor::new(&other, Camera::new(Projection::Perspective))));
    let first = pictures.path().join("hall/drive0/0.png");
    fs::rename(&first, pictures.path().join("hall/drive0/00.png")).unwrap();
    assert!(!is_there(&extractor()));
    fs::copy(pictures.path().join("hall/drive0/2.png"), pictures.path().join("hall/drive0/00.png")).unwrap();
    // What it replaces is gone.
    write(pictures.path(), "1/2", folder.path());
    assert!(is_there(&extractor()));
    assert_eq!(n_files(), 2);
}

#[test]
fn a_picture_that_changes_while_it_is_described_is_described_again() {
    let (pictures, folder) = (pictures(), tempfile::tempdir().unwrap());
    let dataset = open(pictures.path()).unwrap();
    let key = dataset.part_key(&extractor());
    let described = describe(&dataset);
    fs::write(pictures.path().join("hall/drive0/0.png"), "another picture").unwrap();
    dataset.write_part(Part::WHOLE, key, &described, &extractor(), folder.path()).unwrap();
    assert!(Shard::find(folder.path(), Part::WHOLE, &dataset.part_key(&extractor())).is_none());
}
