//! The core as other programs use it.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::env;
use std::path::Path;
use std::process::Command;

/// `cargo test` builds the examples beside the tests.
#[test]
fn the_example_names_the_room_of_each_frame() {
    let tests = env::current_exe().unwrap();
    let example = tests.parent().unwrap().with_file_name("examples").join("recognize");
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/simulated-lab/1");
    let golden = model.join("golden");
    let told = Command::new(&example)
        .arg(&model)
        .args([golden.join("corridor.jpeg"), golden.join("bathroom.jpeg")])
        .output()
        .unwrap();
    let told = String::from_utf8(told.stdout).unwrap();
    let rooms: Vec<&str> = told.lines().map(|line| line.split_once(": ").unwrap().1).collect();
    assert!(rooms[0].starts_with("corridor (") && rooms[1].starts_with("bathroom ("), "{told}");
    let refused = Command::new(example).output().unwrap();
    assert!(!refused.status.success() && !refused.stderr.is_empty());
}
