//! The digest of source files: what names results that are kept, so that other code never reads them.

use std::collections::hash_map::DefaultHasher;
use std::hash::Hasher;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// The crates that answer frames, beside this one. Packages from a registry come without them; there this one's version
/// names theirs.
const CORE: [&str; 2] = ["../vision/src", "../recognition/src"];

/// What the answers of experiments do not depend on. A new module counts until it is named here.
const NOT_FOR_ANSWERS: [&str; 3] = ["check", "page", "simulate"];

/// What names the versions of all dependencies.
const LOCK: &str = "../../Cargo.lock";

/// The folders and files that digests are taken of, where they are there.
pub fn watched(package: &Path) -> Vec<PathBuf> {
    let paths = ["src", LOCK].into_iter().chain(CORE).map(|path| package.join(path));
    paths.filter(|path| path.exists()).collect()
}

/// The digest of all that answers depend on: the sources of the core, of data sets and of experiments, and the
/// versions of what they are built with.
///
/// # Errors
/// A file that cannot be read.
pub fn of_answers(package: &Path) -> io::Result<String> {
    let mut files = modules(&package.join("src"), |module| !NOT_FOR_ANSWERS.contains(&module))?;
    for folder in CORE.map(|folder| package.join(folder)).into_iter().filter(|folder| folder.is_dir()) {
        files.extend(modules(&folder, |_| true)?);
    }
    digest(package, files)
}

/// The digest of all that simulated frames depend on; the simulator uses no other module but the layout of COLD.
///
/// # Errors
/// A file that cannot be read.
pub fn of_simulation(package: &Path) -> io::Result<String> {
    digest(package, modules(&package.join("src"), |module| ["cold_layout", "simulate"].contains(&module))?)
}

/// The files of those modules of a crate that are wanted, by their name.
fn modules(src: &Path, is_wanted: impl Fn(&str) -> bool) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(src)? {
        let path = entry?.path();
        if path.file_stem().and_then(|name| name.to_str()).is_none_or(&is_wanted) {
            add_files(path, &mut files)?;
        }
    }
    Ok(files)
}

/// Of the files and of the lock file where there is one. It is no cryptographic digest, and another compiler may
/// compute another one: then results are computed again.
fn digest(package: &Path, mut files: Vec<PathBuf>) -> io::Result<String> {
    files.extend(Some(package.join(LOCK)).filter(|lock| lock.is_file()));
    files.sort();
    let mut hasher = DefaultHasher::new();
    for file in files {
        let bytes = fs::read(&file)?;
        let name = file.strip_prefix(package).unwrap_or(&file);
        // Lengths keep what ends one file from beginning the next.
        for part in [name.as_os_str().as_encoded_bytes(), &bytes] {
            hasher.write_usize(part.len());
            hasher.write(part);
        }
    }
    Ok(format!("{:016x}", hasher.finish()))
}

/// The file, or all files of the folder.
fn add_files(path: PathBuf, files: &mut Vec<PathBuf>) -> io::Result<()> {
    if !path.is_dir() {
        files.push(path);
        return Ok(());
    }
    fs::read_dir(path)?.try_for_each(|entry| add_files(entry?.path(), files))
}
