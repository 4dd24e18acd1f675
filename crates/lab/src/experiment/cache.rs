//! Answers that were computed once, kept in a folder.

use super::ExperimentError;
use crate::whole_file;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs;
use std::path::{Path, PathBuf};

/// A folder of answers, one file a model, seed and drive (or two drives compared), named by the digest of all that
/// the answers depend on: an interrupted run goes on where it stopped, and a second one only reads.
pub struct Cache {
    folder: PathBuf,
}

impl Cache {
    /// Uses, or makes, the folder.
    pub fn open(folder: &Path) -> Result<Self, ExperimentError> {
        fs::create_dir_all(folder)
            .map_err(|source| ExperimentError::Write { path: folder.to_owned(), source })?;
        Ok(Self { folder: folder.to_owned() })
    }

    /// The answers of this key. A damaged file counts as none.
    pub fn get<T: DeserializeOwned>(&self, key: &str) -> Option<T> {
        serde_json::from_slice(&fs::read(self.path(key)).ok()?).ok()
    }

    /// Keeps answers; a file is there as a whole or not at all.
    pub fn put(&self, key: &str, answers: &impl Serialize) -> Result<(), ExperimentError> {
        let path = self.path(key);
        let write = || whole_file::put(&path, &serde_json::to_vec(answers)?);
        write().map_err(|source| ExperimentError::Write { path: path.clone(), source })
    }

    fn path(&self, key: &str) -> PathBuf {
        self.folder.join(format!("{key}.json"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::FrameAnswer;

    #[test]
    fn answers_come_back_and_damaged_ones_count_as_none() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::open(folder.path()).unwrap();
        let answers = vec![FrameAnswer { frame_idx: 3, room: "corridor".to_owned(), n_keypoints: 120 }];
        let get = || cache.get::<Vec<FrameAnswer>>("a");
        assert_eq!(get(), None);
        cache.put("a", &answers).unwrap();
        assert_eq!(get(), Some(answers));
        let file = folder.path().join("a.json");
        let bytes = fs::read(&file).unwrap();
        fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
        assert_eq!(get(), None);
    }
}
