//! The digest of source files: what names results that are kept, so that other code never reads them.

use std::collections::hash_map::DefaultHasher;
use std::fs;
use std::hash::Hasher;
use std::io;
use std::path::{Path, PathBuf};

/// What the answers of experiments do not depend on: the modules round the core. A new module counts until it is
/// named here.
const NOT_THE_CORE: [&str; 9] =
    ["check", "cli", "client", "main", "page", "protocol", "repository", "server", "simulate"];

/// The digest of all that answers depend on: the sources of the core, of data sets and of experiments, and the
/// versions of what they are built with.
///
/// # Errors
/// A file that cannot be read.
pub fn of_answers(package: &Path) -> io::Result<String> {
    digest(package, |module| !NOT_THE_CORE.contains(&module))
}

/// The digest of all that simulated frames depend on; the simulator uses no other module.
///
/// # Errors
/// A file that cannot be read.
pub fn of_simulation(package: &Path) -> io::Result<String> {
    digest(package, |module| module == "simulate")
}

/// Of the modules that are wanted, by their name, and of the lock file where there is one. It is no
/// cryptographic digest, and another compiler may compute another one: then results are computed again.
fn digest(package: &Path, is_wanted: impl Fn(&str) -> bool) -> io::Result<String> {
    let mut files = Vec::new();
    for entry in fs::read_dir(package.join("src"))? {
        let path = entry?.path();
        if path.file_stem().and_then(|name| name.to_str()).is_none_or(&is_wanted) {
            add_files(path, &mut files)?;
        }
    }
    files.extend(Some(package.join("Cargo.lock")).filter(|lock| lock.is_file()));
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
