//! The networks of a bucket: each lies there once, whichever versions use it.

use super::{Bucket, Files, MAX_SIDE_FILE_BYTES, Object};
use crate::repository::package::is_network;
use crate::repository::{RepositoryError, io_error, networks};
use object_store::PutMode;
use roomsight_protocol::version_id::VersionId;
use roomsight_recognition::model::{self, ABOUT_FILE, NETWORKS_FOLDER, NetworkEntry};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Where they lie, beside the models.
const SHARED_FOLDER: &str = ".networks";

impl Bucket {
    /// Gives a staged version those of its networks that it came without: from the cache, or else from the bucket.
    pub(in crate::repository) fn complete(&self, staged: &Path) -> Result<(), RepositoryError> {
        networks::complete(staged, &self.cached_versions()).map_err(io_error(staged))?;
        let missing = networks::missing(staged);
        if missing.is_empty() {
            return Ok(());
        }
        let there = self.remote.list("")?;
        let received = self.stage()?;
        for entry in missing {
            let shared = shared_path(&entry.onnx_path());
            let (onnx, toml) = (format!("/{}", entry.onnx_path()), format!("/{}", entry.toml_path()));
            let has_it = |object: &&Object| object.path == shared || object.path.ends_with(&onnx);
            let has_it = there.iter().filter(has_it).find(|object| object.n_bytes == entry.n_bytes);
            let Some(onnx) = has_it else { continue };
            let is_small = |object: &&Object| object.n_bytes <= MAX_SIDE_FILE_BYTES;
            for toml in there.iter().filter(is_small).filter(|object| object.path.ends_with(&toml)) {
                let other = TempDir::new_in(received.path()).map_err(io_error(received.path()))?;
                self.receive(onnx, &other.path().join(entry.onnx_path()))?;
                self.receive(toml, &other.path().join(entry.toml_path()))?;
                networks::complete(staged, &[other.path().to_owned()]).map_err(io_error(staged))?;
            }
        }
        Ok(())
    }

    /// Uploads the networks of a staged version that the bucket has not.
    pub(super) fn upload_networks(&self, staged: &Path, names: &[String]) -> Result<(), RepositoryError> {
        let own: Vec<&String> = names.iter().filter(|name| is_network(name)).collect();
        if own.is_empty() {
            return Ok(());
        }
        let there = self.networks()?;
        for name in own {
            let (path, shared) = (staged.join(name), shared_path(name));
            let n_bytes = fs::metadata(&path).map_err(io_error(&path))?.len();
            if !there.iter().any(|object| object.path == shared && object.n_bytes == n_bytes) {
                let bytes = fs::read(&path).map_err(io_error(&path))?;
                self.remote.write(&shared, bytes, PutMode::Overwrite)?;
            }
        }
        Ok(())
    }

    /// The networks that a version uses and has not in its own folder, as they lie in the bucket.
    pub(super) fn shared_networks(
        &self,
        id: &VersionId,
        entries: &[NetworkEntry],
        own: &Files,
    ) -> Result<Vec<(NetworkEntry, Object)>, RepositoryError> {
        let shared: Vec<&NetworkEntry> = entries
            .iter()
            .filter(|entry| own.iter().all(|object| object.path != entry.onnx_path()))
            .collect();
        if shared.is_empty() {
            return Ok(Vec::new());
        }
        let there = self.networks()?;
        let find = |entry: &NetworkEntry| {
            let path = shared_path(&entry.onnx_path());
            match there.iter().find(|object| object.path == path) {
                Some(object) => Ok((entry.clone(), object.clone())),
                None => Err(RepositoryError::NoNetwork { id: id.clone(), network: entry.name.clone(), path }),
            }
        };
        shared.into_iter().map(find).collect()
    }

    /// Brings a network into the folder of a version: from another one in the cache, or else from the bucket.
    pub(super) fn bring_network(
        &self,
        id: &VersionId,
        (entry, object): &(NetworkEntry, Object),
        into: &Path,
    ) -> Result<(), RepositoryError> {
        networks::complete(into, &self.cached_versions()).map_err(io_error(into))?;
        let to = into.join(entry.onnx_path());
        if to.exists() {
            return Ok(());
        }
        if object.n_bytes == entry.n_bytes {
            self.receive(object, &to)?;
            if entry.verify_onnx(into).is_ok() {
                return Ok(());
            }
        }
        let reason =
            format!("the network {} at {} has another digest: remove it there", entry.name, object.path);
        Err(RepositoryError::Damaged { id: id.clone(), reason })
    }

    /// Removes what no version names; a version whose `model.json` cannot be read may name anything.
    pub(super) fn remove_unused_networks(&self) -> Result<(), RepositoryError> {
        let mut unused = self.networks()?;
        if unused.is_empty() {
            return Ok(());
        }
        for object in self.remote.list("")? {
            if !object.path.ends_with(&format!("/{ABOUT_FILE}")) {
                continue;
            }
            let Some((about, _)) = self.remote.read(&object.path, MAX_SIDE_FILE_BYTES)? else { continue };
            let Ok(entries) = model::networks_in(&about) else {
                tracing::warn!(path = object.path, "cannot be read: no network is removed");
                return Ok(());
            };
            unused.retain(|network| {
                entries.iter().all(|entry| network.path != shared_path(&entry.onnx_path()))
            });
        }
        unused.iter().try_for_each(|network| self.remote.remove(&network.path))
    }

    /// The folders of the versions in the cache.
    pub(super) fn cached_versions(&self) -> Vec<PathBuf> {
        let entries = fs::read_dir(self.cache.root()).into_iter().flatten().flatten();
        let visible = entries.filter(|entry| !entry.file_name().as_encoded_bytes().starts_with(b"."));
        visible.map(|entry| entry.path()).filter(|path| path.is_dir()).collect()
    }

    fn networks(&self) -> Result<Files, RepositoryError> {
        self.remote.list(&format!("{SHARED_FOLDER}/"))
    }

    /// Downloads an object as a file whose folder may not be there yet.
    pub(super) fn receive(&self, object: &Object, to: &Path) -> Result<(), RepositoryError> {
        if let Some(folder) = to.parent() {
            fs::create_dir_all(folder).map_err(io_error(folder))?;
        }
        self.remote.download(object, to)
    }
}

/// Where a network of this path in a version's folder lies for all versions.
fn shared_path(path: &str) -> String {
    path.replacen(NETWORKS_FOLDER, SHARED_FOLDER, 1)
}
