//! A model with the name under which it serves.

use roomsight_recognition::model::{Expected, Model};
use std::sync::{Arc, OnceLock};

/// A model with the name under which it serves.
#[derive(Debug)]
pub struct ServedModel {
    /// Its name, that of its folder.
    pub name: String,
    /// Its version, a whole number.
    pub version: u64,
    /// The epoch of the model at which this version came to serve as what it serves.
    pub epoch: u64,
    pub model: Arc<Model>,
    /// The BLAKE3 digest of its file, 64 hexadecimal digits.
    pub digest: String,
    /// See [`ServedModel::expected`].
    expected: OnceLock<Option<Expected>>,
}

impl ServedModel {
    /// A model that serves so; the digest is the BLAKE3 digest of its file, 64 hexadecimal digits.
    pub fn new(name: &str, version: u64, epoch: u64, model: Arc<Model>, digest: String) -> Self {
        Self { name: name.to_owned(), version, epoch, model, digest, expected: OnceLock::new() }
    }

    /// What training lets expect of its answers, found out when it is first asked for.
    pub fn expected(&self) -> Option<Expected> {
        *self.expected.get_or_init(|| self.model.expected())
    }
}
