//! `roomsight data`: what a service keeps in its data directory.

use super::output::{progress, say};
use crate::teaching::{DATABASE_FILE, Store};
use anyhow::{Context, ensure};
use clap::{Args, Subcommand};
use std::fs;
use std::path::{Path, PathBuf};

/// What begins the names of files that are of no use in a copy: locks, and what SQLite has beside its file.
const LEFT_OUT: [&str; 3] = [".", "roomsight.db-wal", "roomsight.db-shm"];

/// Look after the data directory of a service
#[derive(Args)]
pub(super) struct DataDirectoryArgs {
    #[command(subcommand)]
    command: Action,
}

#[derive(Subcommand)]
enum Action {
    Backup(BackupArgs),
}

/// Copy the data directory of a service, which may run meanwhile
///
/// The copy is a data directory itself: `roomsight serve --data COPY` serves it.
#[derive(Args)]
struct BackupArgs {
    /// The data directory, as `serve --data` has it
    #[arg(value_name = "DATA")]
    data: PathBuf,
    /// A new folder for the copy
    #[arg(value_name = "COPY")]
    copy: PathBuf,
}

/// Does what is asked for.
pub(super) fn run(args: &DataDirectoryArgs) -> anyhow::Result<()> {
    let Action::Backup(BackupArgs { data, copy }) = &args.command;
    ensure!(
        data.join(DATABASE_FILE).is_file(),
        "{} is no data directory: there is no {DATABASE_FILE} in it",
        data.display()
    );
    ensure!(!copy.exists(), "{} exists already; give a new folder", copy.display());
    fs::create_dir_all(copy).with_context(|| copy.display().to_string())?;
    // The pictures that it names are there when it is copied; those that go meanwhile are missed by nobody.
    Store::back_up(data, &copy.join(DATABASE_FILE))?;
    let mut files = Vec::new();
    walk(data, Path::new(""), &mut files)?;
    let bar = progress("copying", files.len());
    for file in &files {
        let to = copy.join(file);
        fs::create_dir_all(to.parent().unwrap_or(copy))?;
        match fs::copy(data.join(file), &to) {
            // It was moved meanwhile.
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            copied => drop(copied.with_context(|| to.display().to_string())?),
        }
        bar.inc(1);
    }
    drop(bar);
    say!("{} files are copied to {}", files.len() + 1, copy.display())?;
    Ok(())
}

/// All files below a folder, by their paths in it, without the database's.
fn walk(root: &Path, inside: &Path, files: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    let folder = root.join(inside);
    for entry in fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
        let entry = entry?;
        let name = entry.file_name();
        let text = name.to_string_lossy();
        let path = inside.join(&name);
        if text == DATABASE_FILE || LEFT_OUT.iter().any(|start| text.starts_with(start)) {
            continue;
        }
        if entry.file_type()?.is_dir() {
            walk(root, &path, files)?;
        } else {
            files.push(path);
        }
    }
    Ok(())
}
