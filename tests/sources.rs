//! What is kept on disk is named by the sources that made it.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

#[path = "../build/sources.rs"]
mod sources;

use std::fs;
use std::path::Path;

const PACKAGE: &str = env!("CARGO_MANIFEST_DIR");

/// A package with these files of one line each.
fn package(files: &[(&str, &str)]) -> tempfile::TempDir {
    let package = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = package.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    package
}

const FILES: [(&str, &str); 5] = [
    ("src/detect.rs", "mod fast;"),
    ("src/detect/fast.rs", "const RADIUS: usize = 3;"),
    ("src/server.rs", "fn serve() {}"),
    ("src/simulate/plan.rs", "fn plan() {}"),
    ("Cargo.lock", "zune-jpeg 0.5"),
];

#[test]
fn the_crate_knows_its_sources() {
    let package = Path::new(PACKAGE);
    assert_eq!(sources::of_answers(package).unwrap(), env!("ROOMSIGHT_ANSWER_SOURCES"));
    assert_eq!(sources::of_simulation(package).unwrap(), env!("ROOMSIGHT_SIMULATION_SOURCES"));
}

#[test]
fn a_change_of_what_matters_changes_the_digest_and_of_nothing_else() {
    let digests = |files: &[(&str, &str)]| {
        let package = package(files);
        [sources::of_answers(package.path()).unwrap(), sources::of_simulation(package.path()).unwrap()]
    };
    let before = digests(&FILES);
    for (file_idx, changes) in
        [[true, false], [true, false], [false, false], [false, true], [true, true]].into_iter().enumerate()
    {
        let mut files = FILES;
        files[file_idx].1 = "something else";
        let after = digests(&files);
        assert_eq!([0, 1].map(|idx| after[idx] != before[idx]), changes, "{}", files[file_idx].0);
    }
    let mut moved = FILES;
    moved[1].0 = "src/detect/faster.rs";
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
            let foreign = line.replace("crate::simulate", "");
            assert!(!foreign.contains("crate::"), "{}: {line}", path.display());
        }
    }
    let src = Path::new(PACKAGE).join("src");
    visit(&src.join("simulate.rs"));
    visit(&src.join("simulate"));
}
