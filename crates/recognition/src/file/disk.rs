//! Files of models: read within limits, written anew.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// The model itself.
pub const MODEL_FILE: &str = "model.safetensors";

/// The longest `model.json`, `golden.json` or golden frame that is read.
pub const MAX_SIDE_FILE_BYTES: u64 = 32 << 20;

/// Why a model was not loaded; the text says what is wrong.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {reason}", path = path.display())]
pub struct LoadError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub reason: String,
    /// The file is good, and ONNX Runtime is missing: it may be there at the next try.
    pub may_pass: bool,
}

pub(crate) fn read_bounded(path: &Path, max_bytes: u64) -> Result<Vec<u8>, LoadError> {
    let file = File::open(path).map_err(|error| refused(path, error.to_string()))?;
    let n_bytes = file.metadata().map_err(|error| refused(path, error.to_string()))?.len();
    if n_bytes > max_bytes {
        return Err(refused(path, format!("{n_bytes} bytes are too many; the limit is {max_bytes}")));
    }
    let mut bytes = Vec::with_capacity(n_bytes as usize);
    file.take(max_bytes).read_to_end(&mut bytes).map_err(|error| refused(path, error.to_string()))?;
    Ok(bytes)
}

pub(crate) fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    File::create_new(path)?.write_all(bytes)
}

pub(crate) fn refused(path: &Path, reason: impl Into<String>) -> LoadError {
    LoadError { path: path.to_owned(), reason: reason.into(), may_pass: false }
}
