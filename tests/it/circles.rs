//! Files that lie beside each other use each other in one direction: in no folder is there a circle.
//!
//! What counts are the paths that a file names, `use` or not, followed through what is passed on by `pub use`. A file and
//! the folder of its own parts are one; tests do not count.

use super::architecture::{code, each_source, sources};
use std::collections::{BTreeMap, BTreeSet};

type Path = Vec<String>;

/// The modules of one crate, by their paths.
#[derive(Default)]
struct Modules {
    code: BTreeMap<Path, String>,
    /// What a module passes on under a name of its own.
    passed_on: BTreeMap<Path, Path>,
}

fn path_of(text: &str) -> Path {
    text.split("::").map(|part| part.trim().to_owned()).filter(|part| !part.is_empty()).collect()
}

/// The paths of a tree such as `a::{b, c::{d, e as f}}`.
fn expand(tree: &str, before: &Path, paths: &mut Vec<Path>) {
    let Some((prefix, list)) = tree.split_once('{') else {
        let name = tree.split(" as ").next().unwrap_or_default();
        return paths.push([before.clone(), path_of(name)].concat());
    };
    let before = [before.clone(), path_of(prefix)].concat();
    let list = list.trim_end().strip_suffix('}').unwrap_or(list);
    let (mut depth, mut start) = (0, 0);
    for (position, character) in list.char_indices().chain([(list.len(), ',')]) {
        match character {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                if !list[start..position].trim().is_empty() {
                    expand(&list[start..position], &before, paths);
                }
                start = (position + 1).min(list.len());
            }
            _ => {}
        }
    }
}

/// The paths that a file names, and whether it passes them on.
fn named(code: &str) -> Vec<(bool, Path)> {
    let mut named = Vec::new();
    for (start, _) in code.match_indices("use ") {
        let line = &code[code[..start].rfind('\n').map_or(0, |end| end + 1)..start];
        let is_statement = line.trim().is_empty() || line.trim().starts_with("pub");
        if let Some(end) = code[start..].find(';').filter(|_| is_statement) {
            let mut paths = Vec::new();
            expand(&code[start + "use ".len()..start + end], &Path::new(), &mut paths);
            named.extend(paths.into_iter().map(|path| (line.contains("pub"), path)));
        }
    }
    for root in ["crate::", "super::"] {
        for (start, _) in code.match_indices(root) {
            let is_path = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
            let path: String = code[start..].chars().take_while(|&c| is_path(c)).collect();
            named.push((false, path_of(&path)));
        }
    }
    named
}

impl Modules {
    fn add(&mut self, path: &str, source: &str) {
        let mut module = path.trim_end_matches(".rs").split('/').map(str::to_owned).collect::<Path>();
        if module.last().is_some_and(|name| name == "mod" || name == "lib") {
            module.pop();
        }
        if !module.iter().any(|part| part.contains("tests") || part == "main") {
            let code = code(source);
            let tests = code.find("#[cfg(test)]\nmod tests {").unwrap_or(code.len());
            self.code.insert(module, code[..tests].to_owned());
        }
    }

    /// Notes what modules pass on; all have been added.
    fn whole(mut self) -> Self {
        for (module, code) in &self.code {
            for (_, path) in named(code).into_iter().filter(|(is_passed_on, _)| *is_passed_on) {
                if let Some(target) = self.absolute(module, &path) {
                    let name = target.last().cloned().into_iter().collect();
                    self.passed_on.insert([module.clone(), name].concat(), target);
                }
            }
        }
        self
    }

    /// From the root of the crate; none for what lies outside.
    fn absolute(&self, module: &Path, path: &Path) -> Option<Path> {
        let n_up = path.iter().take_while(|part| *part == "super").count();
        match path.first()?.as_str() {
            "crate" => Some(path[1..].to_vec()),
            "self" => Some([module, &path[1..]].concat()),
            "super" => Some([&module[..module.len().checked_sub(n_up)?], &path[n_up..]].concat()),
            first => {
                let child = [module.clone(), vec![first.to_owned()]].concat();
                self.code.contains_key(&child).then(|| [module.clone(), path.clone()].concat())
            }
        }
    }

    /// The module that a path leads to.
    fn resolve(&self, path: &[String], depth: usize) -> Option<Path> {
        (0..=path.len()).rev().find_map(|length| {
            let (start, rest) = path.split_at(length);
            let passed_on = self.passed_on.get(start).filter(|_| depth < 8);
            let further = passed_on.and_then(|to| self.resolve(&[to, rest].concat(), depth + 1));
            further.or_else(|| self.code.contains_key(start).then(|| start.to_vec()))
        })
    }

    /// For each folder, which of its files use which.
    fn neighbors(&self) -> BTreeMap<Path, BTreeMap<String, BTreeSet<String>>> {
        let mut folders = BTreeMap::<Path, BTreeMap<String, BTreeSet<String>>>::new();
        for (module, code) in &self.code {
            let targets = named(code).into_iter().filter_map(|(_, path)| self.absolute(module, &path));
            for target in targets.filter_map(|target| self.resolve(&target, 0)) {
                let n_shared = module.iter().zip(&target).take_while(|(a, b)| a == b).count();
                if let (Some(from), Some(to)) = (module.get(n_shared), target.get(n_shared)) {
                    let files = folders.entry(module[..n_shared].to_vec()).or_default();
                    files.entry(from.clone()).or_default().insert(to.clone());
                }
            }
        }
        folders
    }

    /// Files of one folder that lead back to themselves.
    fn circles(&self) -> Vec<String> {
        let mut circles = Vec::new();
        for (folder, uses) in self.neighbors() {
            for file in uses.keys() {
                let mut reached = BTreeSet::new();
                let mut next: Vec<&String> = uses[file].iter().collect();
                while let Some(other) = next.pop() {
                    if reached.insert(other) {
                        next.extend(uses.get(other).into_iter().flatten());
                    }
                }
                if reached.contains(file) {
                    circles.push(format!("{}::{file}", folder.join("::")));
                }
            }
        }
        circles
    }
}

#[test]
fn no_files_stand_in_a_circle() {
    let mut n_files = 0;
    for folder in sources() {
        let mut modules = Modules::default();
        each_source(&folder, &mut |path, source| {
            let (_, inside) = path.split_once("src/").unwrap();
            modules.add(inside, source);
            n_files += 1;
        });
        let circles = modules.whole().circles();
        assert!(circles.is_empty(), "{}: {circles:?}", folder.display());
    }
    assert!(n_files > 300, "{n_files} files were read");
}

#[test]
fn circles_are_found() {
    let circles = |files: &[(&str, &str)]| {
        let mut modules = Modules::default();
        files.iter().for_each(|(path, source)| modules.add(path, source));
        modules.whole().circles().join(" ")
    };
    let two = |a, b| circles(&[("lib.rs", "pub mod a;\npub mod b;"), ("a.rs", a), ("b.rs", b)]);
    assert_eq!(two("use crate::b::B;", "pub struct B;"), "");
    assert_eq!(two("use super::b;", "fn f() { crate::a::f() }"), "::a ::b");
    assert_eq!(
        two("use crate::{b::{self, B}};", "// use crate::a;\n/// See [`super::a`].\npub struct B;"),
        ""
    );
    assert_eq!(two("use crate::b;", "#[cfg(test)]\nmod tests {\n    use crate::a;\n}"), "");
    let passed_on = [
        ("lib.rs", "mod p;"),
        ("p.rs", "mod x;\nmod y;\nmod z;\npub use y::{Other, Y};"),
        ("p/x.rs", "use super::Y;"),
        ("p/y.rs", "use super::z::Z as Name;"),
        ("p/z.rs", "use crate::p::x;"),
    ];
    assert_eq!(circles(&passed_on), "p::x p::y p::z");
    assert_eq!(circles(&passed_on[..4]), "");
}
