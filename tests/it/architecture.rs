//! Holds of the shape of the house what Cargo cannot refuse: who may say what.
//!
//! Which crate may use which stands in their `Cargo.toml`s; that no files stand in a circle is held by `circles`. Comments are not code and are left out. Each rule is first seen
//! to fail on a source made for it, so that it cannot pass by matching nothing.

use std::fs;
use std::path::Path;

const HOUSE: &str = env!("CARGO_MANIFEST_DIR");

/// Words that only some files may say.
struct Reserved {
    words: &'static [&'static str],
    /// Where the rule holds: the beginnings of paths.
    within: &'static [&'static str],
    /// Who may say them there.
    only: &'static [&'static str],
    why: &'static str,
}

const EVERYWHERE: &[&str] = &["crates/", "src/"];
const CORE: &[&str] = &["crates/vision/", "crates/recognition/"];

const RESERVED: [Reserved; 4] = [
    Reserved {
        words: &[
            "ImageReader",
            "ImageDecoder",
            "JpegDecoder",
            "PngDecoder",
            "WebPDecoder",
            "BmpDecoder",
            "PnmDecoder",
            "load_from_memory",
            "load_from_memory_with_format",
            "image::open",
        ],
        within: EVERYWHERE,
        only: &["crates/vision/src/image"],
        why: "only vision's image decodes, within its limits",
    },
    Reserved {
        words: &["axum", "tower_http"],
        within: &["src/"],
        only: &["src/http"],
        why: "only http knows the framework",
    },
    Reserved {
        words: &["unsafe", "unsafe_code"],
        within: EVERYWHERE,
        only: &["crates/vision/src/simd"],
        why: "only vision's simd is unsafe",
    },
    Reserved {
        words: &[
            "std::time",
            "SystemTime",
            "Instant",
            "std::env",
            "env::var",
            "env::args",
            "rand::rng",
            "thread_rng",
            "from_os_rng",
            "from_entropy",
        ],
        within: CORE,
        only: &[],
        why: "the core reads no clock, environment or global randomness: pass the value or a seed",
    },
];

/// The source without comments. Strings stay: what they mention is rarely a path.
pub fn code(source: &str) -> String {
    let strip = |line: &str| match line.trim_start().starts_with("//") {
        true => String::new(),
        false => line.split_once(" // ").map_or(line, |(code, _)| code).to_owned(),
    };
    source.lines().map(strip).collect::<Vec<_>>().join("\n")
}

fn is_word(character: char) -> bool {
    character.is_alphanumeric() || character == '_'
}

/// Whether `word` stands in `code`, not as a part of a longer word.
fn says(code: &str, word: &str) -> bool {
    code.match_indices(word).any(|(start, _)| {
        !code[..start].ends_with(is_word) && !code[start + word.len()..].starts_with(is_word)
    })
}

/// Whether a path is one of these files, or in one of these folders.
fn is_in(path: &str, starts: &[&str]) -> bool {
    starts.iter().filter_map(|start| path.strip_prefix(start)).any(|rest| !rest.starts_with(is_word))
}

/// What is wrong in one file.
fn violations(path: &str, source: &str) -> Vec<String> {
    let code = code(source);
    let mut found = Vec::new();
    for Reserved { words, within, only, why } in &RESERVED {
        if within.iter().any(|start| path.starts_with(start)) && !is_in(path, only) {
            let said = words.iter().filter(|word| says(&code, word));
            found.extend(said.map(|word| format!("{path} says `{word}`: {why}")));
        }
    }
    found
}

/// Calls `visit` with the path, relative to the house, and the text of each source file.
pub fn each_source(folder: &Path, visit: &mut impl FnMut(&str, &str)) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            each_source(&path, visit);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let relative = path.strip_prefix(HOUSE).unwrap().to_string_lossy().into_owned();
            visit(&relative, &fs::read_to_string(&path).unwrap());
        }
    }
}

/// The source folders of all crates.
pub fn sources() -> Vec<std::path::PathBuf> {
    let house = Path::new(HOUSE);
    let crates = fs::read_dir(house.join("crates")).unwrap().map(|entry| entry.unwrap().path().join("src"));
    crates.chain([house.join("src")]).collect()
}

#[test]
fn every_file_keeps_to_its_words() {
    let (mut found, mut n_files) = (Vec::new(), 0);
    for folder in sources() {
        each_source(&folder, &mut |path, source| {
            n_files += 1;
            found.extend(violations(path, source));
        });
    }
    assert!(n_files > 300, "{n_files} files are not all");
    assert!(found.is_empty(), "\n{}", found.join("\n"));
}

#[test]
fn reserved_words_are_found() {
    for (path, source) in [
        ("src/http/body.rs", "use image::ImageReader;"),
        ("src/cli/train.rs", "let image = image::open(path);"),
        ("src/engine/recognize.rs", "use axum::body::Bytes;"),
        ("crates/recognition/src/model/train.rs", "unsafe { f() }"),
        ("crates/lab/src/page.rs", "#![allow(unsafe_code)]"),
        ("crates/vision/src/images.rs", "use image::ImageReader;"),
        ("crates/vision/src/simd/nearest.rs", "let start = Instant::now();"),
        ("crates/recognition/src/model.rs", "use std::{env, fs};\nlet home = env::var(\"HOME\");"),
        ("crates/recognition/src/model.rs", "let mut rng = rand::rng();"),
    ] {
        assert!(violations(path, source).join("; ").contains("says `"), "{path}: {source}");
    }
    for (path, source) in [
        ("crates/vision/src/image/decode.rs", "use image::ImageReader;"),
        ("crates/vision/src/image.rs", "use image::ImageReader;"),
        ("crates/vision/src/simd.rs", "unsafe { f() }"),
        ("src/engine/pool.rs", "use std::time::Instant;"),
        ("src/http/body.rs", "use axum::body::Bytes;"),
        ("src/cli/train.rs", "use image::codecs::jpeg::JpegEncoder;"),
        ("crates/recognition/src/model.rs", "use rand::rngs::StdRng; let unsafely = Instantaneous;"),
        ("crates/recognition/src/model.rs", "/// As fast as an Instant.\nfn f() {} // no Instant"),
    ] {
        assert!(violations(path, source).is_empty(), "{path}: {source}");
    }
}
