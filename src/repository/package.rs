//! A version as one body, to be uploaded: an archive of its files, or the bare model file.
//!
//! | file | what |
//! |---|---|
//! | `form` | what a body is, told by its first bytes |
//! | `unpacker` | which entries of an archive are taken, whatever its form, and their limits |
//! | `tar`, `zip` | the forms |

mod form;
mod tar;
#[cfg(test)]
mod tests;
mod unpacker;
mod zip;

use ::tar::{Builder, Header};
use flate2::read::MultiGzDecoder;
use form::Form;
use roomsight_recognition::model::{
    self, ABOUT_FILE, Digest, GOLDEN_FOLDER, LoadError, MAX_MODEL_BYTES, MAX_NETWORK_BYTES,
    MAX_SIDE_FILE_BYTES, MODEL_FILE, NETWORKS_FOLDER,
};
use std::fs::{self, File};
use std::io::{self, BufReader, ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};
use unpacker::Unpacker;

/// What an unpacked version may take.
#[derive(Clone, Copy, Debug)]
pub struct PackageLimits {
    /// The most entries.
    pub max_entries: usize,
    /// The longest model file.
    pub max_model_bytes: u64,
    /// The longest network.
    pub max_network_bytes: u64,
    /// The longest other file.
    pub max_side_file_bytes: u64,
    /// The most bytes of all files together.
    pub max_bytes: u64,
}

/// Why a body is no version.
#[derive(Debug, thiserror::Error)]
pub enum PackageError {
    /// An entry that no version has.
    #[error(
        "the entry {entry:?} does not belong in a version: {reason}; a version is {MODEL_FILE}, {ABOUT_FILE}, \
         plain files in {GOLDEN_FOLDER}/, and of each network that the model names {NETWORKS_FOLDER}/DIGEST.onnx and \
         {NETWORKS_FOLDER}/DIGEST.toml"
    )]
    Entry {
        entry: String,
        /// What is wrong with it.
        reason: String,
    },
    /// Too much of it.
    #[error("the archive has more than {0} entries")]
    TooMany(usize),
    /// It takes too much room when it is unpacked.
    #[error("the archive has more than {0} bytes when it is unpacked")]
    TooLarge(u64),
    /// Not a whole archive.
    #[error("the archive is damaged: {0}")]
    Damaged(String),
    /// Something that is not read here.
    #[error("{0} is not read here; send a tar, a tar.gz or a zip of the version's folder")]
    Foreign(&'static str),
    /// No model in it.
    #[error("the archive has no {MODEL_FILE}")]
    NoModel,
    /// A model without `model.json` that cannot be read.
    #[error("{0}")]
    Model(#[from] LoadError),
    /// The disk said no.
    #[error("{path}: {source}")]
    Io {
        /// What was read or written.
        path: PathBuf,
        source: io::Error,
    },
}

impl Default for PackageLimits {
    fn default() -> Self {
        Self {
            max_entries: 1024,
            max_model_bytes: MAX_MODEL_BYTES,
            max_network_bytes: MAX_NETWORK_BYTES,
            max_side_file_bytes: MAX_SIDE_FILE_BYTES,
            max_bytes: 2 * MAX_MODEL_BYTES,
        }
    }
}

impl PackageLimits {
    /// The longest file of this path in a version's folder.
    pub(super) fn of(&self, path: &str) -> u64 {
        match path {
            MODEL_FILE => self.max_model_bytes,
            _ if is_network(path) => self.max_network_bytes,
            _ => self.max_side_file_bytes,
        }
    }
}

/// Writes the files of a version as a tar. The same files always give the same bytes.
pub fn pack(folder: &Path, out: impl Write) -> io::Result<()> {
    let mut builder = Builder::new(out);
    for name in names(folder)? {
        let file = File::open(folder.join(&name))?;
        let mut header = Header::new_gnu();
        header.set_size(file.metadata()?.len());
        header.set_mode(0o644);
        builder.append_data(&mut header, &name, file)?;
    }
    builder.into_inner()?.flush()
}

/// Copies the files of a version into an empty folder.
pub fn copy(folder: &Path, into: &Path) -> io::Result<()> {
    for name in names(folder)? {
        let to = into.join(&name);
        fs::create_dir_all(to.parent().unwrap_or(into))?;
        fs::copy(folder.join(&name), to)?;
    }
    Ok(())
}

/// The files of a version, as they are called in its folder, networks and golden frames first: whoever copies them in
/// this order has a complete version when `model.json` is there. Hidden files are none of its.
pub(super) fn names(folder: &Path) -> io::Result<Vec<String>> {
    let mut names = names_in(folder, GOLDEN_FOLDER)?;
    names.extend(names_in(folder, NETWORKS_FOLDER)?.into_iter().filter(|name| is_file_of_version(name)));
    names.sort();
    names.extend([MODEL_FILE, ABOUT_FILE].map(str::to_owned));
    Ok(names)
}

/// The files in a part of a version's folder; none where it has no such part.
fn names_in(folder: &Path, part: &str) -> io::Result<Vec<String>> {
    let mut names = Vec::new();
    if folder.join(part).is_dir() {
        for entry in fs::read_dir(folder.join(part))? {
            let name = entry?.file_name().into_string();
            let name = name.map_err(|name| io::Error::other(format!("{name:?} is no Unicode")))?;
            if !name.starts_with('.') {
                names.push(format!("{part}/{name}"));
            }
        }
    }
    Ok(names)
}

/// Writes the files of the version in `body`, a file of unknown origin, into the empty folder `into`: a tar, a
/// tar.gz or a zip. What is no archive is taken for a bare model file. A missing `model.json` is written.
pub fn unpack(body: &Path, into: &Path, limits: &PackageLimits) -> Result<(), PackageError> {
    let mut file = File::open(body).map_err(io_error(body))?;
    let mut form = Form::of(&mut file).map_err(io_error(body))?;
    if form == Form::Gzip {
        file = inflated(file, body, limits)?;
        form = Form::of(&mut file).map_err(io_error(body))?;
    }
    let mut unpacker = Unpacker::new(into, limits);
    match form {
        Form::Tar => tar::unpack(file, &mut unpacker)?,
        Form::Zip => zip::unpack(file, &mut unpacker)?,
        Form::Gzip => return Err(PackageError::Foreign("what was compressed twice")),
        Form::Foreign(name) => return Err(PackageError::Foreign(name)),
        Form::Other => drop(unpacker.write(MODEL_FILE, &mut file)?),
    }
    if !into.join(MODEL_FILE).exists() {
        return Err(PackageError::NoModel);
    }
    if !into.join(ABOUT_FILE).exists() {
        model::write_about(into)?;
    }
    check_networks(into)
}

/// Refuses networks that the unpacked model does not name: nobody would look at what is in them.
fn check_networks(into: &Path) -> Result<(), PackageError> {
    let found = names_in(into, NETWORKS_FOLDER).map_err(io_error(into))?;
    if found.is_empty() {
        return Ok(());
    }
    let named = model::networks_of(into)?;
    let is_named =
        |name: &String| named.iter().any(|entry| [entry.onnx_path(), entry.toml_path()].contains(name));
    match found.iter().find(|name| !is_named(name)) {
        Some(name) => Err(unpacker::wrong(name, "the model names no such network")),
        None => Ok(()),
    }
}

/// Whether a version may have a file of this path, relative to its folder.
pub(super) fn is_file_of_version(path: &str) -> bool {
    let is_plain =
        |name: &str| !name.is_empty() && !name.starts_with('.') && !name.contains(['/', '\\', ':', '\0']);
    let golden = path.strip_prefix(GOLDEN_FOLDER).and_then(|rest| rest.strip_prefix('/'));
    let described =
        path.strip_prefix(NETWORKS_FOLDER).and_then(|rest| rest.strip_prefix('/')?.strip_suffix(".toml"));
    let is_description = described.is_some_and(|digest| Digest::parse(digest).is_some());
    path == MODEL_FILE
        || path == ABOUT_FILE
        || golden.is_some_and(is_plain)
        || is_network(path)
        || is_description
}

/// Whether a path in a version's folder is that of a network.
pub(super) fn is_network(path: &str) -> bool {
    let name = path.strip_prefix(NETWORKS_FOLDER).and_then(|rest| rest.strip_prefix('/'));
    name.and_then(|name| name.strip_suffix(".onnx")).is_some_and(|digest| Digest::parse(digest).is_some())
}

/// What was compressed, in a file without a name.
fn inflated(file: File, body: &Path, limits: &PackageLimits) -> Result<File, PackageError> {
    let folder = body.parent().unwrap_or(Path::new("."));
    let mut inflated = tempfile::tempfile_in(folder).map_err(io_error(folder))?;
    let mut from = MultiGzDecoder::new(BufReader::new(file)).take(limits.max_bytes + 1);
    let n_bytes = io::copy(&mut from, &mut inflated).map_err(copy_error(folder))?;
    if n_bytes > limits.max_bytes {
        return Err(PackageError::TooLarge(limits.max_bytes));
    }
    inflated.rewind().map_err(io_error(folder))?;
    Ok(inflated)
}

fn damaged(error: &dyn std::error::Error) -> PackageError {
    PackageError::Damaged(error.to_string())
}

fn io_error(path: &Path) -> impl Fn(io::Error) -> PackageError {
    move |source| PackageError::Io { path: path.to_owned(), source }
}

/// Why bytes could not be copied: those that read an archive say by the kind of their errors that it is damaged, which
/// no disk does.
fn copy_error(path: &Path) -> impl Fn(io::Error) -> PackageError {
    move |error| match error.kind() {
        ErrorKind::InvalidData | ErrorKind::InvalidInput | ErrorKind::UnexpectedEof | ErrorKind::Other => {
            damaged(&error)
        }
        _ => io_error(path)(error),
    }
}
