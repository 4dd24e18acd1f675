//! A network that several versions use takes room once: its file in one of them is a hard link to that in another.
//!
//! So each version's folder is whole, and nothing counts who uses what: versions are copied, served and removed as if they
//! were alone, and the last to go takes the network with it. Where a file system has no links, or between two of
//! them, a version keeps a copy of its own.

use roomsight_recognition::model::{self, NETWORKS_FOLDER, NetworkEntry};
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};

/// A link before it takes the place of a file, in the folder of that.
const UNFINISHED: &str = ".link";

/// Gives the version in a staged folder those of its networks that it came without and one of the other versions has.
/// Those that none has are still missing then, which is told when the version is tried.
pub(super) fn complete(staged: &Path, others: &[PathBuf]) -> io::Result<()> {
    for entry in missing(staged) {
        let Some(other) = others.iter().find(|other| entry.verify(other).is_ok()) else { continue };
        fs::create_dir_all(staged.join(NETWORKS_FOLDER))?;
        for path in [entry.onnx_path(), entry.toml_path()] {
            let (from, to) = (other.join(&path).canonicalize()?, staged.join(&path));
            if !to.exists() && fs::hard_link(&from, &to).is_err() {
                fs::copy(&from, &to)?;
            }
        }
    }
    Ok(())
}

/// The networks that the version in a folder uses and has not. None where its `model.json` cannot be read, which is told
/// when the version is tried.
pub(super) fn missing(folder: &Path) -> Vec<NetworkEntry> {
    let is_missing = |entry: &NetworkEntry| {
        [entry.onnx_path(), entry.toml_path()].iter().any(|path| !folder.join(path).exists())
    };
    model::networks_of(folder).unwrap_or_default().into_iter().filter(is_missing).collect()
}

/// Makes one file of each network that a staged version and another one have. Where that cannot be done it takes room
/// twice.
pub(super) fn share(staged: &Path, others: &[PathBuf]) {
    let Ok(entries) = fs::read_dir(staged.join(NETWORKS_FOLDER)) else { return };
    for own in entries.flatten().map(|entry| entry.path()) {
        let Some(name) = own.file_name().filter(|_| own.extension().is_some_and(|end| end == "onnx")) else {
            continue;
        };
        let same = others.iter().map(|other| other.join(NETWORKS_FOLDER).join(name));
        let same = same
            .filter_map(|path| path.canonicalize().ok())
            .find(|path| are_equal(&own, path).unwrap_or(false));
        if let Some(same) = same
            && let Err(error) = replace_by_link(&own, &same)
        {
            tracing::debug!(%error, file = %own.display(), "a network takes room once more");
        }
    }
}

/// Puts a link to `same` in the place of `own`. Two links to one file are not renamed over each other, so that `own` is
/// removed first; nobody sees it yet.
fn replace_by_link(own: &Path, same: &Path) -> io::Result<()> {
    let unfinished = own.with_file_name(UNFINISHED);
    fs::hard_link(same, &unfinished)?;
    fs::remove_file(own)?;
    fs::rename(&unfinished, own)
}

/// Whether two files have the same bytes: one that was damaged is linked to by nobody.
fn are_equal(one: &Path, other: &Path) -> io::Result<bool> {
    let (one, other) = (File::open(one)?, File::open(other)?);
    if one.metadata()?.len() != other.metadata()?.len() {
        return Ok(false);
    }
    let (mut one, mut other) = (BufReader::new(one), BufReader::new(other));
    loop {
        let (left, right) = (one.fill_buf()?, other.fill_buf()?);
        let n_bytes = left.len().min(right.len());
        if left[..n_bytes] != right[..n_bytes] || (n_bytes == 0 && left.len() != right.len()) {
            return Ok(false);
        }
        if n_bytes == 0 {
            return Ok(true);
        }
        one.consume(n_bytes);
        other.consume(n_bytes);
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use crate::repository::{Repository, package};
    use roomsight_protocol::version_id::VersionId;
    use roomsight_recognition::model::{ABOUT_FILE, Digest, MODEL_FILE, VerifiedFile};
    use serde_json::json;
    use std::os::unix::fs::MetadataExt;
    use tempfile::TempDir;

    const TOML: &[u8] = b"size = [224, 224]\n";

    /// Writes what passes for a model that uses a network; returns the paths of the network's files.
    fn write_version(folder: &Path, model: &str, onnx: &[u8]) -> [String; 2] {
        let entry = json!({
            "name": "lite0", "blake3": Digest::of(onnx), "n_bytes": onnx.len(), "toml_blake3": Digest::of(TOML),
        });
        let about = json!({ "blake3": Digest::of(model.as_bytes()), "networks": [entry] });
        fs::create_dir_all(folder.join(NETWORKS_FOLDER)).unwrap();
        fs::write(folder.join(MODEL_FILE), model).unwrap();
        fs::write(folder.join(ABOUT_FILE), about.to_string()).unwrap();
        let entry = model::networks_of(folder).unwrap().remove(0);
        fs::write(folder.join(entry.onnx_path()), onnx).unwrap();
        fs::write(folder.join(entry.toml_path()), TOML).unwrap();
        [entry.onnx_path(), entry.toml_path()]
    }

    fn repository() -> (TempDir, Repository) {
        let root = TempDir::new().unwrap();
        let repository = Repository::open(root.path().to_str().unwrap(), Path::new("")).unwrap();
        (root, repository)
    }

    fn publish(repository: &Repository, id: &str, onnx: &[u8]) -> (PathBuf, [String; 2]) {
        let (staged, id): (_, VersionId) = (repository.stage().unwrap(), id.parse().unwrap());
        let paths = write_version(staged.path(), &id.to_string(), onnx);
        repository.publish(&id, staged).unwrap();
        (repository.fetch(&id).unwrap(), paths)
    }

    fn n_links(path: &Path) -> u64 {
        fs::metadata(path).unwrap().nlink()
    }

    #[test]
    fn versions_with_the_same_network_keep_it_once_and_the_last_takes_it_along() {
        let (_root, repository) = repository();
        let (first, [onnx, _]) = publish(&repository, "lab/1", b"a network");
        let before = repository.scan().unwrap().models["lab"].versions[&1].clone();
        let (second, _) = publish(&repository, "attic/7", b"a network");
        let (other, [other_onnx, _]) = publish(&repository, "lab/2", b"another network");
        assert_eq!((n_links(&first.join(&onnx)), n_links(&other.join(&other_onnx))), (2, 1));
        assert_eq!(repository.scan().unwrap().models["lab"].versions[&1], before, "it looks as before");
        assert!(!second.join(NETWORKS_FOLDER).join(UNFINISHED).exists());
        repository.delete(&"lab/1".parse().unwrap()).unwrap();
        assert_eq!(n_links(&second.join(&onnx)), 1);
        VerifiedFile::read(&second).unwrap();
    }

    #[test]
    fn a_version_that_comes_without_its_network_gets_that_of_another() {
        let (_root, repository) = repository();
        let (first, paths) = publish(&repository, "lab/1", b"a network");
        let staged = repository.stage().unwrap();
        write_version(staged.path(), "second", b"a network");
        fs::remove_dir_all(staged.path().join(NETWORKS_FOLDER)).unwrap();
        repository.complete(staged.path()).unwrap();
        VerifiedFile::read(staged.path()).unwrap();
        assert_eq!(n_links(&first.join(&paths[0])), 2);
        let unknown = repository.stage().unwrap();
        write_version(unknown.path(), "third", b"a network that is nowhere else");
        fs::remove_dir_all(unknown.path().join(NETWORKS_FOLDER)).unwrap();
        repository.complete(unknown.path()).unwrap();
        let told = VerifiedFile::read(unknown.path()).err().unwrap().to_string();
        assert!(told.contains("missing") && told.contains("lite0"), "{told}");
    }

    #[test]
    fn a_damaged_network_is_given_to_nobody() {
        let (_root, repository) = repository();
        let (first, [onnx, _]) = publish(&repository, "lab/1", b"a network");
        fs::write(first.join(&onnx), b"A network").unwrap();
        let (second, _) = publish(&repository, "lab/2", b"a network");
        VerifiedFile::read(&second).unwrap();
        let staged = repository.stage().unwrap();
        write_version(staged.path(), "third", b"a network");
        fs::remove_file(staged.path().join(&onnx)).unwrap();
        repository.complete(staged.path()).unwrap();
        assert_eq!((n_links(&first.join(&onnx)), n_links(&second.join(&onnx))), (1, 2));
    }

    #[test]
    fn links_to_networks_are_followed() {
        let (root, repository) = repository();
        let outside = TempDir::new().unwrap();
        let [onnx, _] = write_version(&outside.path().join("1"), "outside", b"a network");
        let hand_made = root.path().join("lab/1");
        package::copy(&outside.path().join("1"), &hand_made).unwrap();
        fs::remove_file(hand_made.join(&onnx)).unwrap();
        std::os::unix::fs::symlink(outside.path().join("1").join(&onnx), hand_made.join(&onnx)).unwrap();
        VerifiedFile::read(&hand_made).unwrap();
        let (second, _) = publish(&repository, "lab/2", b"a network");
        assert!(second.join(&onnx).symlink_metadata().unwrap().is_file());
        drop(outside);
        VerifiedFile::read(&second).unwrap();
    }

    #[test]
    fn equal_files_are_told_from_others_at_every_length() {
        let folder = TempDir::new().unwrap();
        let write = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            fs::write(&path, bytes).unwrap();
            path
        };
        for n_bytes in [0, 1, 8191, 8192, 8193, 20_000] {
            let mut bytes = vec![7; n_bytes];
            let [one, same] = ["one", "same"].map(|name| write(name, &bytes));
            assert!(are_equal(&one, &same).unwrap(), "{n_bytes}");
            if let Some(last) = bytes.last_mut() {
                *last = 8;
                assert!(!are_equal(&one, &write("other", &bytes)).unwrap(), "{n_bytes}");
            }
            bytes.push(7);
            assert!(!are_equal(&one, &write("longer", &bytes)).unwrap(), "{n_bytes}");
        }
    }
}
