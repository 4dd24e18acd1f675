//! A model on disk: a folder, which is all of it but the program and ONNX Runtime.
//!
//! | file | what |
//! |---|---|
//! | `model.safetensors` | the model; it names its networks by their digests |
//! | `model.json` | what people and tools read about it, the digest of the model file, and its list of networks |
//! | `networks/DIGEST.onnx`, `networks/DIGEST.toml` | each network; see [`super::networks`] |
//! | `golden/` | frames with the answers to them |
//!
//! The digest of the model file covers all that answers depend on: a network that was exchanged is refused, and so is a
//! `model.json` whose list is not that of the model file. A repository keeps these folders whole, and networks that
//! several versions have once; see `crate::repository`.

use crate::file::disk::{LoadError, MAX_SIDE_FILE_BYTES, MODEL_FILE, read_bounded, refused, write_new};
use crate::file::error::FormatError;
use crate::file::networks;
use crate::file::networks::{NetworkEntry, NetworkStore, write_networks};
use crate::model::Model;
use crate::model::card::Card;
use crate::model::config::Config;
use crate::model::format::Metadata;
use crate::model::golden::{GOLDEN_FOLDER, GoldenFrame, write_golden};
use roomsight_vision::camera::Projection;
use roomsight_vision::network::NetworkError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// What people and tools read about it.
pub const ABOUT_FILE: &str = "model.json";

/// The longest model file that is read.
pub const MAX_MODEL_BYTES: u64 = 1 << 30;

/// A model as it was loaded.
#[derive(Debug)]
pub struct LoadedModel {
    /// The model.
    pub model: Model,
    /// The BLAKE3 digest of its file: 64 hexadecimal digits.
    pub digest: String,
}

/// A model file whose digest is the one that is written beside it, as are those of its networks.
pub struct VerifiedFile {
    folder: PathBuf,
    bytes: Vec<u8>,
    digest: String,
    networks: Vec<NetworkEntry>,
}

/// Why a model was not saved.
#[derive(Debug, thiserror::Error)]
pub enum SaveError {
    /// There is something already.
    #[error("{path} exists already; a model never changes: choose another folder", path = .0.display())]
    Exists(PathBuf),
    /// The model has no bytes.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The disk said no.
    #[error("cannot write {path}: {source}", path = path.display())]
    Io {
        /// What was written.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
}

/// `model.json`.
#[derive(Serialize, Deserialize)]
struct About {
    format_version: u32,
    file: String,
    /// Of the model file.
    n_bytes: u64,
    blake3: String,
    #[serde(rename = "places")]
    rooms: Vec<String>,
    camera: Projection,
    card: Card,
    config: Config,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    networks: Vec<NetworkEntry>,
}

/// What `model.json` says of the files beside it.
struct Promise {
    blake3: String,
    networks: Vec<NetworkEntry>,
}

impl Model {
    /// Loads the model in a folder, or the model file itself, which needs its `model.json` and its networks beside
    /// it. The digests of all must be those that `model.json` says.
    pub fn load(path: &Path) -> Result<LoadedModel, LoadError> {
        let folder = if path.is_file() { path.parent().unwrap_or(Path::new(".")) } else { path };
        VerifiedFile::read(folder)?.load(&NetworkStore::default())
    }

    /// Writes the model into a new folder; it is there whole or not at all.
    pub fn save(&self, folder: &Path, golden_frames: &[GoldenFrame]) -> Result<(), SaveError> {
        if folder.exists() {
            return Err(SaveError::Exists(folder.to_owned()));
        }
        let parent = parent_of(folder);
        let bytes = self.to_bytes()?;
        let write = || -> io::Result<()> {
            fs::create_dir_all(parent)?;
            let unfinished = tempfile::Builder::new().prefix(".unfinished-").tempdir_in(parent)?;
            write_new(&unfinished.path().join(MODEL_FILE), &bytes)?;
            let about = About::new(self.metadata(), &bytes);
            write_new(&unfinished.path().join(ABOUT_FILE), &serde_json::to_vec_pretty(&about)?)?;
            write_networks(unfinished.path(), self.networks())?;
            if !golden_frames.is_empty() {
                write_golden(&unfinished.path().join(GOLDEN_FOLDER), golden_frames)?;
            }
            move_into_place(unfinished, folder)
        };
        write().map_err(|source| SaveError::Io { path: folder.to_owned(), source })
    }
}

impl About {
    fn new(metadata: Metadata, bytes: &[u8]) -> Self {
        let Metadata { format_version, rooms, camera, card, config, networks, .. } = metadata;
        Self {
            format_version,
            file: MODEL_FILE.to_owned(),
            n_bytes: bytes.len() as u64,
            blake3: blake3::hash(bytes).to_hex().to_string(),
            rooms,
            camera,
            card,
            config,
            networks,
        }
    }
}

impl Promise {
    /// Reads it from the `model.json` of a folder.
    fn read(folder: &Path) -> Result<Self, LoadError> {
        let path = folder.join(ABOUT_FILE);
        let about = read_bounded(&path, MAX_SIDE_FILE_BYTES)?;
        Self::parse(&about).map_err(|reason| refused(&path, reason))
    }

    fn parse(about: &[u8]) -> Result<Self, String> {
        let mut about: serde_json::Value =
            serde_json::from_slice(about).map_err(|error| format!("no JSON: {error}"))?;
        let blake3 = about.get("blake3").and_then(serde_json::Value::as_str).map(str::to_owned);
        let blake3 = blake3.ok_or("it holds no digest of the model")?;
        let networks = about.get_mut("networks").map(serde_json::Value::take);
        let networks: Vec<NetworkEntry> = networks
            .map_or(Ok(Vec::new()), serde_json::from_value)
            .map_err(|error| format!("its list of networks: {error}"))?;
        networks::check_entries(&networks)?;
        Ok(Self { blake3, networks })
    }
}

impl VerifiedFile {
    /// Reads the model file of a folder. Its digest, and those of its networks, must be those that `model.json` says.
    pub fn read(folder: &Path) -> Result<Self, LoadError> {
        let Promise { blake3: expected, networks } = Promise::read(folder)?;
        let model_path = folder.join(MODEL_FILE);
        let bytes = read_bounded(&model_path, MAX_MODEL_BYTES)?;
        let digest = blake3::hash(&bytes).to_hex().to_string();
        if digest != expected {
            let reason = format!("damaged or replaced: its digest is {digest}, {ABOUT_FILE} says {expected}");
            return Err(refused(&model_path, reason));
        }
        networks.iter().try_for_each(|network| network.verify(folder))?;
        Ok(Self { folder: folder.to_owned(), bytes, digest, networks })
    }

    /// Makes a model of it. Networks that are in `store` are not read again.
    pub fn load(self, store: &NetworkStore) -> Result<LoadedModel, LoadError> {
        let path = self.folder.join(MODEL_FILE);
        let mut networks = BTreeMap::new();
        for entry in &self.networks {
            networks.insert(entry.name.clone(), store.open(&self.folder, entry)?);
        }
        let model = Model::from_parts(&self.bytes, networks).map_err(|error| LoadError {
            may_pass: matches!(error, FormatError::Network(NetworkError::Runtime(_))),
            ..refused(&path, error.to_string())
        })?;
        Ok(LoadedModel { model, digest: self.digest })
    }
}

/// The networks that the model in a folder uses, by its `model.json`.
pub fn networks_of(folder: &Path) -> Result<Vec<NetworkEntry>, LoadError> {
    Ok(Promise::read(folder)?.networks)
}

/// The networks that a model uses, by the bytes of its `model.json`.
///
/// # Errors
/// What is wrong with it.
pub fn networks_in(about: &[u8]) -> Result<Vec<NetworkEntry>, String> {
    Ok(Promise::parse(about)?.networks)
}

/// Writes `model.json` beside a model file that came without one. Whether the model works is not looked at.
pub fn write_about(folder: &Path) -> Result<(), LoadError> {
    let model_path = folder.join(MODEL_FILE);
    let bytes = read_bounded(&model_path, MAX_MODEL_BYTES)?;
    let metadata = Metadata::read(&bytes).map_err(|error| refused(&model_path, error.to_string()))?;
    let about_path = folder.join(ABOUT_FILE);
    let write = || -> io::Result<()> {
        write_new(&about_path, &serde_json::to_vec_pretty(&About::new(metadata, &bytes))?)
    };
    write().map_err(|error| refused(&about_path, error.to_string()))
}

/// Gives a complete folder its name beside it, for good: it is on the disk before anybody can see it.
pub fn move_into_place(unfinished: TempDir, folder: &Path) -> io::Result<()> {
    sync_all(unfinished.path())?;
    make_readable(unfinished.path())?;
    fs::rename(unfinished.path(), folder)?;
    // The folder has its name: nothing temporary is left to remove.
    let _ = unfinished.keep();
    File::open(parent_of(folder))?.sync_all()
}

fn parent_of(path: &Path) -> &Path {
    path.parent().filter(|parent| *parent != Path::new("")).unwrap_or(Path::new("."))
}

/// Waits until a folder and all in it are on the disk.
fn sync_all(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            sync_all(&entry.path())?;
        } else {
            File::open(entry.path())?.sync_all()?;
        }
    }
    File::open(folder)?.sync_all()
}

/// Temporary folders are private; a model is for whoever may read its parent folder.
fn make_readable(folder: &Path) -> io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        fs::set_permissions(folder, fs::Permissions::from_mode(0o755))?;
    }
    let _ = folder;
    Ok(())
}

#[cfg(test)]
mod tests;
