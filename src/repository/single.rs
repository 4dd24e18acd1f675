//! One model's own folder, as `train` writes it; nothing is changed in it.

use super::{Fingerprint, Listing, RepositoryError, Scan, io_error};
use roomsight_protocol::version_id::{VersionId, is_name, version_number};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A repository of one version.
#[derive(Debug)]
pub struct Single {
    id: VersionId,
    folder: PathBuf,
}

impl Single {
    /// The model in a folder, which is called as `real` is: the same folder without links.
    pub(super) fn new(folder: PathBuf, real: &Path) -> Self {
        Self { id: id_of(real), folder }
    }

    pub(super) fn scan(&self) -> Result<Scan, RepositoryError> {
        let fingerprint = Fingerprint::of_folder(&self.folder).map_err(io_error(&self.folder))?;
        let listing =
            Listing { versions: BTreeMap::from([(self.id.version, fingerprint)]), ..Listing::default() };
        Ok(Scan { models: BTreeMap::from([(self.id.name.clone(), listing)]), ..Scan::default() })
    }

    pub(super) fn fetch(&self, id: &VersionId) -> Result<PathBuf, RepositoryError> {
        if *id == self.id { Ok(self.folder.clone()) } else { Err(RepositoryError::NoVersion(id.clone())) }
    }

    pub(super) fn read_only(&self) -> RepositoryError {
        RepositoryError::ReadOnly(self.folder.clone())
    }
}

/// Name and version of a model that is given by its own folder: `.../NAME/VERSION` or `.../NAME`.
fn id_of(folder: &Path) -> VersionId {
    let text = |path: Option<&Path>| {
        let name = path?.file_name()?.to_str()?;
        is_name(name).then(|| name.to_owned())
    };
    let own = text(Some(folder)).unwrap_or_else(|| "model".into());
    match (version_number(&own), text(folder.parent())) {
        (Some(version), Some(name)) => VersionId { name, version },
        _ => VersionId::new(own, 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_models_own_folder_gives_its_name_and_version() {
        for (folder, id) in [
            ("/models/lab/7", "lab/7"),
            ("/models/attic", "attic/1"),
            ("/models/lab/07", "07/1"),
            ("/two words/7", "7/1"),
            ("/", "model/1"),
        ] {
            assert_eq!(id_of(Path::new(folder)).to_string(), id, "{folder}");
        }
    }
}
