//! The real label files of COLD, where they are at hand: they cannot be shipped.

use roomsight_lab::dataset::cold::{SequenceName, parse_places};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

const N_LINES: usize = 16_261;

/// All `places.lst` below a folder, or none when there is no such folder.
fn label_files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut files = Vec::new();
    for path in entries.map(|entry| entry.unwrap().path()) {
        match path.is_dir() {
            true => files.extend(label_files(&path)),
            false if path.ends_with("localization/places.lst") => files.push(path),
            false => {}
        }
    }
    files
}

#[test]
fn real_label_files_read_without_a_lost_line() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/cold_labels");
    let files = label_files(&folder);
    if files.is_empty() {
        println!("skipped: the label files of COLD are not at {}", folder.display());
        return;
    }
    let mut n_lines = 0;
    let mut places = BTreeSet::new();
    for file in &files {
        let sequence = file.ancestors().nth(2).and_then(Path::file_name).unwrap().to_string_lossy();
        assert!(SequenceName::parse(&sequence).is_some(), "{sequence}");
        let text = fs::read_to_string(file).unwrap();
        let (lines, problems) = parse_places(&text, file);
        assert_eq!(problems, []);
        assert_eq!(lines.len(), text.lines().count());
        assert!(lines.iter().all(|line| line.known));
        assert!(lines.is_sorted_by(|earlier, later| earlier.time < later.time), "{}", file.display());
        n_lines += lines.len();
        places.extend(lines.into_iter().map(|line| line.place));
    }
    assert_eq!((files.len(), n_lines), (9, N_LINES));
    let expected = [
        "bathroom",
        "conference room",
        "corridor",
        "kitchen",
        "laboratory",
        "large office",
        "one-person office",
        "printer area",
        "robotics lab",
        "stairs area",
        "terminal room",
        "two-person office",
        "two-person office 1",
        "two-person office 2",
    ];
    assert_eq!(Vec::from_iter(&places), expected);
}
