//! What is kept on disk is named by the sources that made it.

#[path = "../../build/sources.rs"]
mod digest;

use std::fs;
use std::path::Path;

const PACKAGE: &str = env!("CARGO_MANIFEST_DIR");

/// A workspace with these files of one line each.
fn workspace(files: &[(&str, &str)]) -> tempfile::TempDir {
    let workspace = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = workspace.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    workspace
}

const FILES: [(&str, &str); 7] = [
    ("crates/vision/src/detect.rs", "mod fast;"),
    ("crates/recognition/src/model/train.rs", "const N_FOLDS: usize = 5;"),
    ("src/server.rs", "fn serve() {}"),
    ("crates/lab/src/simulate/plan.rs", "fn plan() {}"),
    ("crates/lab/src/evaluate.rs", "fn evaluate() {}"),
    ("crates/lab/src/page.rs", "fn page() {}"),
    ("Cargo.lock", "zune-jpeg 0.5"),
];

#[test]
fn the_crate_knows_its_sources() {
    let package = Path::new(PACKAGE);
    let watched = digest::watched(package);
    assert_eq!(watched.len(), 4, "its own, those of the core, the lock file: {watched:?}");
    let named = |digest: String| format!("{}-{digest}", env!("CARGO_PKG_VERSION"));
    assert_eq!(named(digest::of_answers(package).unwrap()), env!("ROOMSIGHT_ANSWER_SOURCES"));
    assert_eq!(named(digest::of_simulation(package).unwrap()), env!("ROOMSIGHT_SIMULATION_SOURCES"));
}

#[test]
fn a_change_of_what_matters_changes_the_digest_and_of_nothing_else() {
    let digests = |files: &[(&str, &str)]| {
        let workspace = workspace(files);
        let package = workspace.path().join("crates/lab");
        [digest::of_answers(&package).unwrap(), digest::of_simulation(&package).unwrap()]
    };
    let before = digests(&FILES);
    let expected = [
        [true, false],
        [true, false],
        [false, false],
        [false, true],
        [true, false],
        [false, false],
        [true, true],
    ];
    for (file_idx, changes) in expected.into_iter().enumerate() {
        let mut files = FILES;
        files[file_idx].1 = "something else";
        let after = digests(&files);
        assert_eq!([0, 1].map(|idx| after[idx] != before[idx]), changes, "{}", files[file_idx].0);
    }
    let mut moved = FILES;
    moved[1].0 = "crates/recognition/src/model/teach.rs";
    assert_ne!(digests(&moved)[0], before[0]);
}

#[test]
fn the_simulator_uses_no_other_module() {
    fn visit(path: &Path) {
        if path.is_dir() {
            fs::read_dir(path).unwrap().for_each(|entry| visit(&entry.unwrap().path()));
            return;
        }
        // Tests may look at frames with the rest of the crate.
        let is_test = path.ends_with("tests.rs");
        for line in fs::read_to_string(path).unwrap().lines().filter(|_| !is_test) {
            let foreign = line.replace("crate::simulate", "").replace("crate::cold_layout", "");
            assert!(
                !foreign.contains("crate::") && !foreign.contains("roomsight_"),
                "{}: {line}",
                path.display()
            );
        }
    }
    let src = Path::new(PACKAGE).join("src");
    visit(&src.join("simulate.rs"));
    visit(&src.join("simulate"));
}
