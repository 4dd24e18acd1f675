//! A model on disk: a folder with `model.safetensors`, `model.json` and `golden/`.
//!
//! `model.json` tells people and tools what the model is, and holds the digest of the model file. `golden/`
//! holds a few frames and, in `golden.json`, the answers the model gave when it was saved: whoever loads it
//! can tell that it still answers the same.

use super::format::{FORMAT_VERSION, FormatError};
use super::{Card, Config, Model};
use crate::camera::Projection;
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

const MODEL_FILE: &str = "model.safetensors";
const ABOUT_FILE: &str = "model.json";
const GOLDEN_FOLDER: &str = "golden";
const GOLDEN_FILE: &str = "golden.json";

/// The longest model file that is read.
const MAX_MODEL_BYTES: u64 = 1 << 30;

/// The longest `model.json`, `golden.json` or golden frame that is read.
const MAX_SIDE_FILE_BYTES: u64 = 32 << 20;

/// A model as it was loaded.
#[derive(Debug)]
pub struct LoadedModel {
    /// The model.
    pub model: Model,
    /// The BLAKE3 digest of its file: 64 hexadecimal digits.
    pub digest: String,
}

/// A frame with the answer that the model gave when it was saved.
#[derive(Clone, Debug, PartialEq)]
pub struct GoldenFrame {
    /// Its file name.
    pub name: String,
    /// The encoded image.
    pub bytes: Vec<u8>,
    /// The room answered.
    pub place: String,
    /// Its probability.
    pub probability: f32,
}

/// Why a model was not loaded; the text says what is wrong.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {reason}", path = path.display())]
pub struct LoadError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub reason: String,
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
    places: Vec<String>,
    camera: Projection,
    card: Card,
    config: Config,
}

#[derive(Serialize, Deserialize)]
struct GoldenAnswer {
    file: String,
    place: String,
    probability: f32,
}

impl Model {
    /// Loads the model in a folder, or the model file itself, which needs its `model.json` beside it. The
    /// file's digest must be the one that `model.json` says.
    pub fn load(path: &Path) -> Result<LoadedModel, LoadError> {
        let folder = if path.is_file() { path.parent().unwrap_or(Path::new(".")) } else { path };
        let about_path = folder.join(ABOUT_FILE);
        let about = read_bounded(&about_path, MAX_SIDE_FILE_BYTES)?;
        let about: serde_json::Value = serde_json::from_slice(&about)
            .map_err(|error| refused(&about_path, format!("no JSON: {error}")))?;
        let expected = about.get("blake3").and_then(serde_json::Value::as_str);
        let expected = expected.ok_or_else(|| refused(&about_path, "it holds no digest of the model"))?;

        let model_path = folder.join(MODEL_FILE);
        let bytes = read_bounded(&model_path, MAX_MODEL_BYTES)?;
        let digest = blake3::hash(&bytes).to_hex().to_string();
        if digest != expected {
            let reason = format!("damaged or replaced: its digest is {digest}, {ABOUT_FILE} says {expected}");
            return Err(refused(&model_path, reason));
        }
        let model = Model::from_bytes(&bytes).map_err(|error| refused(&model_path, error.to_string()))?;
        Ok(LoadedModel { model, digest })
    }

    /// Writes the model into a new folder; it is there whole or not at all.
    pub fn save(&self, folder: &Path, golden_frames: &[GoldenFrame]) -> Result<(), SaveError> {
        if folder.exists() {
            return Err(SaveError::Exists(folder.to_owned()));
        }
        let parent = match folder.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        let bytes = self.to_bytes()?;
        self.write_new(folder, parent, &bytes, golden_frames)
            .map_err(|source| SaveError::Io { path: folder.to_owned(), source })
    }

    fn write_new(
        &self,
        folder: &Path,
        parent: &Path,
        bytes: &[u8],
        golden_frames: &[GoldenFrame],
    ) -> io::Result<()> {
        fs::create_dir_all(parent)?;
        let unfinished = tempfile::Builder::new().prefix(".unfinished-").tempdir_in(parent)?;
        write_synced(&unfinished.path().join(MODEL_FILE), bytes)?;
        let about = serde_json::to_vec_pretty(&self.about(bytes))?;
        write_synced(&unfinished.path().join(ABOUT_FILE), &about)?;
        if !golden_frames.is_empty() {
            write_golden(&unfinished.path().join(GOLDEN_FOLDER), golden_frames)?;
        }
        File::open(unfinished.path())?.sync_all()?;
        make_readable(unfinished.path())?;
        fs::rename(unfinished.path(), folder)?;
        // The folder has its name: nothing temporary is left to remove.
        let _ = unfinished.keep();
        File::open(parent)?.sync_all()
    }

    fn about(&self, bytes: &[u8]) -> About {
        About {
            format_version: FORMAT_VERSION,
            file: MODEL_FILE.to_owned(),
            n_bytes: bytes.len() as u64,
            blake3: blake3::hash(bytes).to_hex().to_string(),
            places: self.places().to_vec(),
            camera: self.camera().projection,
            card: self.card().clone(),
            config: self.config().clone(),
        }
    }
}

/// The golden frames of a model folder; none when it has none.
pub fn load_golden_frames(folder: &Path) -> Result<Vec<GoldenFrame>, LoadError> {
    let folder = folder.join(GOLDEN_FOLDER);
    let list_path = folder.join(GOLDEN_FILE);
    if !list_path.exists() {
        return Ok(Vec::new());
    }
    let answers: Vec<GoldenAnswer> = serde_json::from_slice(&read_bounded(&list_path, MAX_SIDE_FILE_BYTES)?)
        .map_err(|error| refused(&list_path, error.to_string()))?;
    let load = |answer: GoldenAnswer| {
        if Path::new(&answer.file).file_name() != Some(answer.file.as_ref()) {
            return Err(refused(&list_path, format!("{:?} is no file name", answer.file)));
        }
        let bytes = read_bounded(&folder.join(&answer.file), MAX_SIDE_FILE_BYTES)?;
        Ok(GoldenFrame { name: answer.file, bytes, place: answer.place, probability: answer.probability })
    };
    answers.into_iter().map(load).collect()
}

fn write_golden(folder: &Path, frames: &[GoldenFrame]) -> io::Result<()> {
    fs::create_dir(folder)?;
    for frame in frames {
        write_synced(&folder.join(&frame.name), &frame.bytes)?;
    }
    let answer = |frame: &GoldenFrame| GoldenAnswer {
        file: frame.name.clone(),
        place: frame.place.clone(),
        probability: frame.probability,
    };
    let answers: Vec<GoldenAnswer> = frames.iter().map(answer).collect();
    write_synced(&folder.join(GOLDEN_FILE), &serde_json::to_vec_pretty(&answers)?)
}

fn write_synced(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::create_new(path)?;
    file.write_all(bytes)?;
    file.sync_all()
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

fn read_bounded(path: &Path, max_bytes: u64) -> Result<Vec<u8>, LoadError> {
    let file = File::open(path).map_err(|error| refused(path, error.to_string()))?;
    let n_bytes = file.metadata().map_err(|error| refused(path, error.to_string()))?.len();
    if n_bytes > max_bytes {
        return Err(refused(path, format!("{n_bytes} bytes are too many; the limit is {max_bytes}")));
    }
    let mut bytes = Vec::with_capacity(n_bytes as usize);
    file.take(max_bytes).read_to_end(&mut bytes).map_err(|error| refused(path, error.to_string()))?;
    Ok(bytes)
}

fn refused(path: &Path, reason: impl Into<String>) -> LoadError {
    LoadError { path: path.to_owned(), reason: reason.into() }
}
