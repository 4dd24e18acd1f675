//! A model with the name under which it serves.

use roomsight_recognition::model::Model;
use std::sync::Arc;

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
}
