//! Holds the shape that the crate doc promises: who imports whom, and who knows what.
//!
//! The table of groups is read from `src/lib.rs`. Comments are not code and are left out. Each rule is
//! first seen to fail on a source made for it, so that it cannot pass by matching nothing.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

const SRC: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src");

/// Words that only some modules may say, with the modules that may. A `core` rule binds only the core.
struct Reserved {
    words: &'static [&'static str],
    only: &'static [&'static str],
    core: bool,
    why: &'static str,
}

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
        only: &["image"],
        core: false,
        why: "only image decodes, within its limits",
    },
    Reserved { words: &["unsafe", "unsafe_code"], only: &["simd"], core: false, why: "only simd is unsafe" },
    Reserved {
        words: &["tokio", "axum"],
        only: &["repository", "client", "server", "cli", "main"],
        core: false,
        why: "only client, server, cli and the repository's bucket are async and speak HTTP",
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
        only: &[],
        core: true,
        why: "the core reads no clock, environment or global randomness: pass the value or a seed",
    },
];

/// What the crate doc says.
struct Map {
    /// From the rows ``| 1 | [`matrix`], [`image`] | ... |``.
    groups: BTreeMap<String, usize>,
    /// From `Groups 1 to N are the recognition core`.
    last_core_group: usize,
}

fn map(crate_doc: &str) -> Map {
    let (_, core) =
        crate_doc.split_once("Groups 1 to ").expect("the crate doc says which groups are the core");
    let last_core_group = core.chars().take_while(char::is_ascii_digit).collect::<String>().parse().unwrap();
    let mut groups = BTreeMap::new();
    for row in crate_doc.lines().filter_map(|line| line.strip_prefix("//! | ")) {
        let mut cells = row.split('|').map(str::trim);
        let (Some(Ok(group)), Some(modules)) = (cells.next().map(str::parse), cells.next()) else { continue };
        for module in modules.split(',').map(str::trim) {
            let name = module.strip_prefix("[`").and_then(|rest| rest.strip_suffix("`]"));
            groups.insert(
                name.unwrap_or_else(|| panic!("`{module}` is no link to a module")).to_owned(),
                group,
            );
        }
    }
    Map { groups, last_core_group }
}

/// The source without comments. Strings stay: what they mention is rarely a path.
fn code(source: &str) -> String {
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

/// The first names of all `crate::` paths, those in `crate::{a, b::{c, d}}` included.
fn imports(code: &str) -> Vec<String> {
    let first_name = |path: &str| path.trim().chars().take_while(|&c| is_word(c)).collect::<String>();
    let mut names = Vec::new();
    for (start, path) in code.match_indices("crate::") {
        let rest = &code[start + path.len()..];
        match rest.strip_prefix('{') {
            None => names.push(first_name(rest)),
            Some(list) => names.extend(top_level(list).into_iter().map(first_name)),
        }
    }
    names.retain(|name| !name.is_empty());
    names
}

/// The items of a braced list, up to its closing brace; inner braces stay whole.
fn top_level(list: &str) -> Vec<&str> {
    let (mut items, mut item_start, mut depth) = (Vec::new(), 0, 0);
    for (position, character) in list.char_indices() {
        match character {
            '{' => depth += 1,
            '}' if depth > 0 => depth -= 1,
            ',' | '}' if depth == 0 => {
                items.push(&list[item_start..position]);
                item_start = position + 1;
                if character == '}' {
                    break;
                }
            }
            _ => {}
        }
    }
    items
}

/// What is wrong in one file of module `module`.
fn violations(module: &str, source: &str, map: &Map) -> Vec<String> {
    let code = code(source);
    let mut found = Vec::new();
    // main.rs stands outside of the library, behind every group.
    let group = match (module, map.groups.get(module)) {
        ("main", _) => usize::MAX,
        (_, Some(group)) => *group,
        (_, None) => return vec![format!("{module} is not in the table of groups in src/lib.rs")],
    };
    for import in imports(&code).into_iter().filter(|import| import != module) {
        match map.groups.get(&import) {
            None => found.push(format!("{module} uses crate::{import}, which is not in the table of groups")),
            Some(other) if *other >= group => {
                found.push(format!("{module} (group {group}) uses crate::{import} (group {other})"));
            }
            Some(_) => {}
        }
    }
    for Reserved { words, only, core, why } in &RESERVED {
        if only.contains(&module) || (*core && group > map.last_core_group) {
            continue;
        }
        let said = words.iter().filter(|word| says(&code, word));
        found.extend(said.map(|word| format!("{module} says `{word}`: {why}")));
    }
    found
}

/// Calls `visit` with the path, relative to `src`, and the text of each source file.
fn each_source(folder: &Path, visit: &mut impl FnMut(&str, &str)) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            each_source(&path, visit);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let relative = path.strip_prefix(SRC).unwrap().to_string_lossy().into_owned();
            visit(&relative, &fs::read_to_string(&path).unwrap());
        }
    }
}

#[test]
fn every_module_keeps_to_its_group_and_its_words() {
    let map = map(&fs::read_to_string(Path::new(SRC).join("lib.rs")).unwrap());
    let mut found = Vec::new();
    each_source(Path::new(SRC), &mut |path, source| {
        let module = path.split('/').next().unwrap().trim_end_matches(".rs");
        if module != "lib" {
            found.extend(
                violations(module, source, &map).into_iter().map(|what| format!("src/{path}: {what}")),
            );
        }
    });
    assert!(found.is_empty(), "\n{}", found.join("\n"));
}

#[test]
fn the_table_names_every_module_that_is_declared() {
    let lib = fs::read_to_string(Path::new(SRC).join("lib.rs")).unwrap();
    let map = map(&lib);
    let declared: Vec<&str> = lib
        .lines()
        .filter_map(|line| line.trim_start_matches("pub ").strip_prefix("mod ")?.strip_suffix(';'))
        .collect();
    assert!(declared.contains(&"image"), "no declaration was found: {declared:?}");
    for module in declared {
        assert!(map.groups.contains_key(module), "{module} is declared, but in no group");
    }
}

/// What `source` in `module` violates, with a table of its own.
fn violated(module: &str, source: &str) -> String {
    let doc = "//! | 1 | [`image`], [`simd`] | pixels |\n\
               //! | 5 | [`model`] | rooms |\n\
               //! | 7 | [`server`] | HTTP |\n\
               //! | 8 | [`cli`] | commands |\n\
               //!\n\
               //! Groups 1 to 5 are the recognition core.";
    violations(module, source, &map(doc)).join("; ")
}

#[test]
fn imports_against_the_direction_are_found() {
    assert_eq!(violated("model", "use crate::image::Image;\nuse crate::model::Config;"), "");
    assert_eq!(violated("main", "fn main() { crate::cli::main() }"), "");
    assert_eq!(violated("model", "use crate::server::App;"), "model (group 5) uses crate::server (group 7)");
    assert_eq!(
        violated("image", "fn f() { crate::simd::f() }"),
        "image (group 1) uses crate::simd (group 1)"
    );
    assert_eq!(violated("server", "use crate::cli;"), "server (group 7) uses crate::cli (group 8)");
    assert_eq!(
        violated("model", "use crate::{\n    image::{Image, Limits},\n    server::{App, serve},\n};"),
        "model (group 5) uses crate::server (group 7)"
    );
    assert!(violated("image", "use crate::Image;").contains("not in the table"));
    assert!(violated("cache", "").contains("cache is not in the table"));
    assert_eq!(violated("image", "/// Used by [`crate::server`].\nfn f() {} // see crate::cli"), "");
}

#[test]
fn reserved_words_are_found() {
    for (module, source) in [
        ("server", "use image::ImageReader;"),
        ("cli", "let image = image::open(path);"),
        ("model", "unsafe { f() }"),
        ("model", "#![allow(unsafe_code)]"),
        ("model", "use tokio::task;"),
        ("image", "fn f(body: axum::body::Bytes) {}"),
        ("simd", "let start = Instant::now();"),
        ("model", "use std::{env, fs};\nlet home = env::var(\"HOME\");"),
        ("model", "let mut rng = rand::rng();"),
    ] {
        assert!(violated(module, source).contains("says `"), "{module}: {source}");
    }
    for (module, source) in [
        ("image", "use image::ImageReader;"),
        ("simd", "unsafe { f() }"),
        ("server", "use std::time::Instant;\nuse tokio::net::TcpListener;"),
        ("cli", "use image::codecs::jpeg::JpegEncoder;"),
        ("model", "use rand::rngs::StdRng; let unsafely = Instantaneous;"),
    ] {
        assert_eq!(violated(module, source), "", "{module}: {source}");
    }
}
