//! A repository in a folder, as services and operators use it.

use super::*;
use crate::repository::{Canary, Repository};

fn repository() -> (TempDir, Repository) {
    let root = TempDir::new().unwrap();
    let repository = open(root.path());
    (root, repository)
}

fn open(root: &Path) -> Repository {
    Repository::open(root.to_str().unwrap(), Path::new("")).unwrap()
}

/// A folder with something that passes for a model.
fn write_version(folder: &Path, content: &str) {
    fs::create_dir_all(folder).unwrap();
    fs::write(folder.join(MODEL_FILE), content).unwrap();
}

fn publish(repository: &Repository, id: &VersionId, content: &str) -> Result<(), RepositoryError> {
    let staged = repository.stage().unwrap();
    write_version(staged.path(), content);
    repository.publish(id, staged)
}

fn found(repository: &Repository) -> Vec<String> {
    let models = repository.scan().unwrap().models;
    let ids = |(name, listing): (String, Listing)| {
        listing.versions.into_keys().map(move |version| format!("{name}/{version}")).collect::<Vec<_>>()
    };
    models.into_iter().flat_map(ids).collect()
}

#[test]
fn versions_are_ordered_as_numbers_and_foreign_things_named() {
    let (root, repository) = repository();
    for name in ["lab/9", "lab/10", "lab/latest", "lab/007", ".git/1", "two words/1", "lab/.hidden"] {
        write_version(&root.path().join(name), "");
    }
    fs::create_dir_all(root.path().join("lab/11")).unwrap();
    fs::create_dir_all(root.path().join("empty")).unwrap();
    fs::write(root.path().join("notes.txt"), "").unwrap();
    fs::write(root.path().join("lab/12"), "").unwrap();
    assert_eq!(found(&repository), ["lab/9", "lab/10"]);
    let foreign = repository.scan().unwrap().foreign;
    let named: Vec<&str> = foreign.iter().filter_map(|line| Some(line.split_once(": ")?.0)).collect();
    assert_eq!(named, ["lab/007", "lab/11", "lab/12", "lab/latest", "notes.txt", "two words"]);
}

/// A link at `path`, whose folder is made.
#[cfg(unix)]
fn link(to: &Path, path: &Path) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::os::unix::fs::symlink(to, path).unwrap();
}

#[cfg(unix)]
#[test]
fn links_are_followed_wherever_they_lead_and_broken_ones_named() {
    let (root, repository) = repository();
    let outside = TempDir::new().unwrap();
    write_version(&outside.path().join("attic/1"), "of the attic");
    write_version(&root.path().join("lab/1"), "");
    let link = |to: &Path, name: &str| link(to, &root.path().join(name));
    link(&outside.path().join("attic"), "attic");
    link(&outside.path().join("attic/1"), "lab/2");
    link(&outside.path().join("attic/1").join(MODEL_FILE), "lab/3/model.safetensors");
    link(Path::new("1"), "lab/4");
    link(Path::new("nowhere"), "lab/5");
    link(Path::new("nowhere"), "cellar");
    link(Path::new("loop"), "loop");
    assert_eq!(found(&repository), ["attic/1", "lab/1", "lab/2", "lab/3", "lab/4"]);
    let foreign: Vec<String> = repository.scan().unwrap().foreign.into_iter().collect();
    assert_eq!(foreign.len(), 3, "{foreign:?}");

    // A link is deleted, what it leads to is not.
    repository.delete(&VersionId::new("lab", 2)).unwrap();
    assert_eq!(found(&repository), ["attic/1", "lab/1", "lab/3", "lab/4"]);
    publish(&repository, &VersionId::new("attic", 2), "").unwrap();
    assert!(outside.path().join("attic/2").join(MODEL_FILE).is_file());
    repository.write_record("attic", &ServingRecord::default().activated(2)).unwrap();
    assert_eq!(repository.scan().unwrap().models["attic"].record.stable, Some(2));
}

#[cfg(target_os = "linux")]
#[test]
fn a_model_may_lie_on_another_disk() {
    use std::os::unix::fs::MetadataExt;
    let (root, repository) = repository();
    let device = |path: &Path| fs::metadata(path).map(|metadata| metadata.dev()).ok();
    let Ok(elsewhere) = TempDir::new_in("/dev/shm") else { return };
    if device(elsewhere.path()) == device(root.path()) {
        return;
    }
    link(elsewhere.path(), &root.path().join("lab"));
    let (id, staged) = (VersionId::new("lab", 1), repository.stage().unwrap());
    write_version(staged.path(), "far away");
    fs::write(staged.path().join(model::ABOUT_FILE), "{}").unwrap();
    repository.publish(&id, staged).unwrap();
    repository.write_record("lab", &ServingRecord::default().activated(2)).unwrap();
    assert_eq!(found(&repository), ["lab/1"]);
    repository.delete(&id).unwrap();
    let left = fs::read_dir(elsewhere.path()).unwrap().map(|entry| entry.unwrap().file_name());
    let mut left: Vec<_> = left.collect();
    left.sort();
    assert_eq!(left, [LOCK_FILE, RECORD_FILE]);
}

/// As volumes of Kubernetes and checkouts that are synced exchange all of it at once.
#[cfg(unix)]
#[test]
fn a_root_that_is_exchanged_is_followed() {
    let parent = TempDir::new().unwrap();
    let at = |name: &str| parent.path().join(name);
    write_version(&at("..first/lab/1"), "first");
    write_version(&at("..second/lab/2"), "second");
    link(Path::new("..first"), &at("..data"));
    link(Path::new("..data"), &at("root"));
    let repository = open(&at("root"));
    assert_eq!(found(&repository), ["lab/1"]);
    link(Path::new("..second"), &at("..data_tmp"));
    fs::rename(at("..data_tmp"), at("..data")).unwrap();
    assert_eq!(found(&repository), ["lab/2"]);
    publish(&repository, &VersionId::new("lab", 3), "").unwrap();
    assert!(at("..second/lab/3").join(MODEL_FILE).is_file());
    // It is held as the first one was: whoever opens it now removes nothing of what is under way.
    let staged = repository.stage().unwrap();
    drop(open(&at("root")));
    assert!(staged.path().is_dir());
}

#[test]
fn what_tools_leave_and_have_not_finished_is_no_part_of_a_version() {
    let (root, repository) = repository();
    let folder = root.path().join("lab/1");
    write_version(&folder, "first");
    let fingerprint = || repository.scan().unwrap().models["lab"].versions[&1].clone();
    let before = fingerprint();
    for name in [".DS_Store", "._model.json", ".model.safetensors.Xy12Zz", ".nfs0001"] {
        fs::write(folder.join(name), "").unwrap();
    }
    assert_eq!(fingerprint(), before);
    for name in ["lab/2.partial", "lab/~2.tmp"] {
        write_version(&root.path().join(name), "");
    }
    write_version(&root.path().join("lab/.3.aB12cD"), "");
    assert_eq!(found(&repository), ["lab/1"]);
}

/// `rsync --times` and the like give a file that they repair the time that it had before.
#[cfg(unix)]
#[test]
fn a_file_that_is_repaired_with_its_old_time_is_another_one() {
    let (root, repository) = repository();
    let folder = root.path().join("lab/1");
    write_version(&folder, "damaged");
    let fingerprint = || repository.scan().unwrap().models["lab"].versions[&1].clone();
    let before = fingerprint();
    let path = folder.join(MODEL_FILE);
    let modified = fs::metadata(&path).unwrap().modified().unwrap();
    fs::write(&path, "repairs").unwrap();
    File::options().append(true).open(&path).unwrap().set_modified(modified).unwrap();
    assert_eq!(fs::metadata(&path).unwrap().modified().unwrap(), modified);
    assert_ne!(fingerprint(), before);
}

#[test]
fn the_default_model_is_kept_and_of_two_who_name_it_at_once_one_is_told_so() {
    let (root, repository) = repository();
    assert_eq!(repository.default_model().unwrap(), None);
    let first = DefaultModel::after(None, "lab");
    repository.write_default(&first).unwrap();
    let late = repository.write_default(&DefaultModel::after(None, "attic"));
    assert!(matches!(late, Err(RepositoryError::DefaultOvertaken(model)) if model == "lab"));
    assert_eq!(open(root.path()).scan().unwrap().default, Some(first.clone()));
    let second = DefaultModel::after(Some(&first), "attic");
    repository.write_default(&second).unwrap();
    assert_eq!(repository.default_model().unwrap(), Some(second));
    fs::write(root.path().join(DEFAULT_FILE), "lab").unwrap();
    let scan = repository.scan().unwrap();
    assert_eq!(scan.default, None);
    assert!(scan.foreign.iter().any(|line| line.starts_with(DEFAULT_FILE)), "{:?}", scan.foreign);
    assert!(matches!(repository.default_model(), Err(RepositoryError::ServingRecord { .. })));
}

#[test]
fn names_lead_nowhere_else() {
    let (_root, repository) = repository();
    for name in ["..", "../lab", "/lab", "a/b", ""] {
        let id = VersionId::new(name, 1);
        assert!(matches!(repository.fetch(&id), Err(RepositoryError::Id(_))), "{name}");
        assert!(matches!(publish(&repository, &id, ""), Err(RepositoryError::Id(_))), "{name}");
        assert!(matches!(repository.delete(&id), Err(RepositoryError::Id(_))), "{name}");
        assert!(matches!(repository.record(name), Err(RepositoryError::Id(_))), "{name}");
        let written = repository.write_record(name, &ServingRecord::default());
        assert!(matches!(written, Err(RepositoryError::Id(_))), "{name}");
    }
}

#[test]
fn a_version_is_published_once_and_deleted_once() {
    let (root, repository) = repository();
    let id = VersionId::new("lab", 3);
    assert!(matches!(repository.fetch(&id), Err(RepositoryError::NoVersion(_))));
    publish(&repository, &id, "first").unwrap();
    assert!(matches!(publish(&repository, &id, "second"), Err(RepositoryError::Exists(_))));
    let folder = repository.fetch(&id).unwrap();
    assert_eq!(fs::read_to_string(folder.join(MODEL_FILE)).unwrap(), "first");
    assert_eq!(found(&repository), ["lab/3"]);
    repository.delete(&id).unwrap();
    assert!(matches!(repository.delete(&id), Err(RepositoryError::NoVersion(_))));
    assert_eq!(found(&repository), [""; 0]);
    let left = fs::read_dir(root.path()).unwrap().map(|entry| entry.unwrap().file_name());
    assert_eq!(left.filter(|name| name != LOCK_FILE).collect::<Vec<_>>(), ["lab"]);
}

#[test]
fn a_version_that_has_got_a_label_meanwhile_is_not_deleted() {
    let (_root, repository) = repository();
    let id = VersionId::new("lab", 1);
    publish(&repository, &id, "").unwrap();
    repository.write_record("lab", &ServingRecord::default().activated(1)).unwrap();
    assert!(matches!(repository.delete(&id), Err(RepositoryError::Overtaken { epoch: 1, .. })));
    assert_eq!(found(&repository), ["lab/1"]);
}

/// As a command leaves them that somebody else has run. It says nothing to root, who may write all.
#[cfg(unix)]
#[test]
fn locks_that_may_only_be_read_lock_nobody_out() {
    use std::os::unix::fs::PermissionsExt;
    let (root, repository) = repository();
    repository.write_record("lab", &ServingRecord::default().activated(1)).unwrap();
    for lock in [root.path().join(LOCK_FILE), root.path().join("lab").join(LOCK_FILE)] {
        fs::set_permissions(lock, fs::Permissions::from_mode(0o444)).unwrap();
    }
    let repository = open(root.path());
    repository.write_record("lab", &ServingRecord::default().activated(1).activated(2)).unwrap();
    assert_eq!(repository.record("lab").unwrap().stable, Some(2));
}

#[cfg(unix)]
#[test]
fn a_published_version_can_be_read_by_others() {
    use std::os::unix::fs::PermissionsExt;
    let (_root, repository) = repository();
    let id = VersionId::new("lab", 1);
    publish(&repository, &id, "").unwrap();
    let mode = fs::metadata(repository.fetch(&id).unwrap()).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o755);
}

#[test]
fn the_fingerprint_changes_with_any_file() {
    let (root, repository) = repository();
    let folder = root.path().join("lab/1");
    write_version(&folder, "first");
    let fingerprint = || repository.scan().unwrap().models["lab"].versions[&1].clone();
    let before = fingerprint();
    assert_eq!(fingerprint(), before);
    fs::create_dir(folder.join("golden")).unwrap();
    fs::write(folder.join("golden/kitchen.jpg"), "").unwrap();
    let with_golden = fingerprint();
    assert_ne!(with_golden, before);
    fs::write(folder.join(MODEL_FILE), "longer than before").unwrap();
    assert_ne!(fingerprint(), with_golden);
}

#[test]
fn records_are_kept_and_a_broken_one_stops_nothing_else() {
    let (root, repository) = repository();
    assert_eq!(repository.record("lab").unwrap(), ServingRecord::default());
    let canary = Canary { version: 2, share: 0.25 };
    let record = ServingRecord::default().activated(1).with_canary(canary).unwrap();
    repository.write_record("lab", &record).unwrap();
    publish(&repository, &VersionId::new("lab", 1), "").unwrap();
    publish(&repository, &VersionId::new("attic", 1), "").unwrap();
    let repository = open(root.path());
    assert_eq!(repository.record("lab").unwrap(), record);
    assert_eq!(repository.scan().unwrap().models["lab"].record, record);
    let late = repository.write_record("lab", &ServingRecord::default().activated(2));
    assert!(matches!(late, Err(RepositoryError::Overtaken { epoch: 2, .. })));
    assert_eq!(repository.record("lab").unwrap(), record);
    fs::write(root.path().join("lab").join(RECORD_FILE), "{").unwrap();
    assert!(matches!(repository.record("lab"), Err(RepositoryError::ServingRecord { .. })));
    let scan = repository.scan().unwrap();
    assert_eq!(scan.models["lab"].record, ServingRecord::default());
    assert!(scan.foreign.iter().any(|line| line.contains(RECORD_FILE)), "{:?}", scan.foreign);
    assert!(scan.models.contains_key("attic"));
}

#[test]
fn what_a_killed_process_left_is_removed_when_nobody_else_is_at_work() {
    let (root, repository) = repository();
    let left = repository.stage().unwrap().keep();
    let other = open(root.path());
    assert!(left.is_dir(), "the first may still be at work in it");
    assert_eq!(found(&other), [""; 0]);
    drop((repository, other));
    let repository = open(root.path());
    assert!(!left.exists());
    let staged = repository.stage().unwrap().path().to_owned();
    assert!(!staged.exists(), "it was dropped");
}

#[test]
fn a_missing_folder_and_a_models_own_folder_say_what_they_are() {
    let root = TempDir::new().unwrap();
    let missing = root.path().join("missing");
    let error = Repository::open(missing.to_str().unwrap(), Path::new("")).unwrap_err().to_string();
    assert!(error.contains("missing"), "{error}");
    write_version(&root.path().join("lab/7"), "");
    let own = open(&root.path().join("lab/7"));
    assert_eq!(found(&own), ["lab/7"]);
    assert!(own.fetch(&VersionId::new("lab", 7)).is_ok());
    assert!(matches!(own.fetch(&VersionId::new("lab", 8)), Err(RepositoryError::NoVersion(_))));
    assert!(matches!(own.stage(), Err(RepositoryError::ReadOnly(_))));
    let written = own.write_record("lab", &ServingRecord::default());
    assert!(matches!(written, Err(RepositoryError::ReadOnly(_))));
}
