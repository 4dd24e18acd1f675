//! Changes that cross.

use super::*;
use crate::engine::events::Events;
use crate::engine::metrics::Metrics;
use crate::repository::Repository;
use crate::settings::{Policy, Settings};
use roomsight_protocol::rest::VersionState;
use std::fs;

/// A registry of three versions of the model that lies with the project, and its folder.
fn registry() -> (TempDir, Registry) {
    let folder = TempDir::new().unwrap();
    (1..=3).for_each(|version| write_version(&folder, version));
    let registry = open(&folder, Policy::Manual);
    (folder, registry)
}

fn write_version(folder: &TempDir, version: u64) {
    let into = folder.path().join(format!("lab/{version}"));
    fs::create_dir_all(&into).unwrap();
    for file in ["model.safetensors", "model.json"] {
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/simulated-lab/1").join(file);
        fs::copy(from, into.join(file)).unwrap();
    }
}

fn open(folder: &TempDir, policy: Policy) -> Registry {
    let settings = Settings { policy, ..Settings::default() };
    let repository = Repository::open(&folder.path().to_string_lossy(), Path::new("unused")).unwrap();
    let metrics = Arc::new(Metrics::new().unwrap());
    Registry::open(repository, &settings, Events::default(), metrics).unwrap()
}

fn wanted(change: Change, ticket: u64) -> Wanted {
    Wanted { change, ticket, expected_epoch: None, is_automatic: false }
}

fn stable(registry: &Registry) -> Option<u64> {
    registry.serving("lab").stable.map(|served| served.version)
}

#[test]
fn a_load_that_ends_after_a_younger_change_has_lost() {
    let (_folder, registry) = registry();
    let older = registry.begin("lab", None).unwrap();
    let loaded = (2, registry.load("lab", 2).unwrap());
    registry.change("lab", Change::Activate(3), None).unwrap();
    let late = registry.commit("lab", wanted(Change::Activate(2), older), Some(&loaded));
    assert!(matches!(late, Err(ChangeError::Superseded)));
    assert_eq!(stable(&registry), Some(3));
}

#[test]
fn a_label_that_is_set_while_a_version_is_loading_does_not_keep_it_from_serving() {
    let (_folder, registry) = registry();
    registry.change("lab", Change::Activate(1), None).unwrap();
    let older = registry.begin("lab", None).unwrap();
    let loaded = (2, registry.load("lab", 2).unwrap());
    registry.change("lab", Change::Shadow(Some(3)), None).unwrap();
    registry.commit("lab", wanted(Change::Activate(2), older), Some(&loaded)).unwrap();
    assert_eq!(stable(&registry), Some(2));
    // Unloading ends all roles.
    let older = registry.begin("lab", None).unwrap();
    registry.change("lab", Change::Unload, None).unwrap();
    let late = registry.commit("lab", wanted(Change::Shadow(Some(2)), older), Some(&loaded));
    assert!(matches!(late, Err(ChangeError::Superseded)));
}

#[test]
fn a_rollback_that_waited_leads_back_from_what_serves_then() {
    let (_folder, registry) = registry();
    registry.change("lab", Change::Activate(1), None).unwrap();
    registry.change("lab", Change::Activate(2), None).unwrap();
    // Decided when 1 was previous; when its turn comes, 2 is.
    let loaded = (1, registry.load("lab", 1).unwrap());
    registry.change("lab", Change::Activate(3), None).unwrap();
    let ticket = registry.begin("lab", None).unwrap();
    let wants = registry.commit("lab", wanted(Change::Rollback, ticket), Some(&loaded)).unwrap();
    assert!(matches!(wants, Commit::Wants(2)));
    assert_eq!(stable(&registry), Some(3), "nothing is done yet");
}

#[test]
fn a_change_builds_on_what_somebody_else_decided_just_now() {
    let (_folder, registry) = registry();
    registry.change("lab", Change::Activate(1), None).unwrap();
    let epoch = registry.entry("lab").unwrap().record.epoch;
    let of_others = registry.entry("lab").unwrap().record.with_shadow(3).unwrap();
    registry.repository.write_record("lab", &of_others).unwrap();
    let stale = registry.change("lab", Change::Activate(2), Some(epoch));
    assert!(matches!(stale, Err(ChangeError::Stale { .. })));
    registry.change("lab", Change::Activate(2), None).unwrap();
    let record = registry.repository.record("lab").unwrap();
    assert_eq!((record.stable, record.shadow, record.epoch), (Some(2), Some(3), epoch + 2));
    assert_eq!(stable(&registry), Some(2));

    // Nothing would change by what is known here.
    registry.repository.write_record("lab", &record.activated(1)).unwrap();
    registry.change("lab", Change::Activate(2), None).unwrap();
    assert_eq!(registry.repository.record("lab").unwrap().stable, Some(2));

    let record = registry.repository.record("lab").unwrap();
    registry.repository.write_record("lab", &record.activated(1)).unwrap();
    let deleted = registry.delete(&VersionId::new("lab", 1), None);
    assert!(matches!(deleted, Err(ChangeError::ServingRecord(RecordError::Labeled { label: "stable", .. }))));

    let ticket = registry.begin("lab", None).unwrap();
    let record = registry.repository.record("lab").unwrap();
    registry.repository.write_record("lab", &record.activated(2)).unwrap();
    let late = registry.commit("lab", wanted(Change::Shadow(None), ticket), None);
    assert!(matches!(late, Err(ChangeError::Repository(RepositoryError::Overtaken { .. }))));
}

#[test]
fn a_version_that_was_deleted_while_it_was_loading_does_not_serve() {
    let (_folder, registry) = registry();
    registry.change("lab", Change::Activate(1), None).unwrap();
    let loaded = (2, registry.load("lab", 2).unwrap());
    registry.delete(&VersionId::new("lab", 2), None).unwrap();
    let ticket = registry.begin("lab", None).unwrap();
    let gone = registry.commit("lab", wanted(Change::Activate(2), ticket), Some(&loaded));
    assert!(matches!(gone, Err(ChangeError::Lookup(LookupError::NoVersion(..)))));
    assert_eq!(stable(&registry), Some(1));
}

#[test]
fn a_version_whose_files_could_not_be_reached_is_tried_again() {
    let (_folder, registry) = registry();
    registry.change("lab", Change::Activate(1), None).unwrap();
    let failure =
        |may_pass| State::Failed(Failure { may_pass, ..Failure::new(Stage::Verifying, String::new()) });
    let record = registry.entry("lab").unwrap().record.activated(2);
    registry.repository.write_record("lab", &record).unwrap();
    let id = VersionId::new("lab", 2);
    registry.enter(&id, failure(false));
    registry.poll().unwrap();
    assert_eq!(stable(&registry), Some(1));
    registry.enter(&id, failure(true));
    registry.poll().unwrap();
    assert_eq!(stable(&registry), Some(2));
}

#[test]
fn after_unload_nothing_serves_until_somebody_decides() {
    let (_folder, registry) = registry();
    registry.change("lab", Change::Activate(1), None).unwrap();
    registry.change("lab", Change::Unload, None).unwrap();
    assert_eq!(stable(&registry), None);
    assert!(registry.choose(Some("lab"), &super::super::Choice::Serving, None).is_err());
    registry.change("lab", Change::Rollback, None).unwrap();
    assert_eq!(stable(&registry), Some(1));
}

#[test]
fn where_something_was_changed_since_a_caller_looked_nothing_is_committed() {
    let (_folder, registry) = registry();
    registry.change("lab", Change::Activate(1), None).unwrap();
    let epoch = registry.entry("lab").unwrap().record.epoch;
    // Both looked at the same epoch, and have loaded what they want.
    let tickets = [0, 1].map(|_| registry.begin("lab", Some(epoch)).unwrap());
    let [first, second] = [2, 3].map(|version| (version, registry.load("lab", version).unwrap()));
    let seen = |change, ticket| Wanted { expected_epoch: Some(epoch), ..wanted(change, ticket) };
    registry.commit("lab", seen(Change::Activate(2), tickets[0]), Some(&first)).unwrap();
    let late = registry.commit("lab", seen(Change::Activate(3), tickets[1]), Some(&second));
    assert!(matches!(late, Err(ChangeError::Stale { .. })));
    assert_eq!((stable(&registry), registry.entry("lab").unwrap().record.epoch), (Some(2), epoch + 1));
}

#[test]
fn a_version_that_serves_is_not_unseated_by_a_load_of_it() {
    let (folder, registry) = registry();
    registry.change("lab", Change::Activate(1), None).unwrap();
    registry.change("lab", Change::Activate(2), None).unwrap();
    let state = |version| registry.entry("lab").unwrap().versions[&version].state().name();
    // A load that began before the version came to serve, and goes on.
    for stage in [Stage::Verifying, Stage::Warming] {
        registry.enter(&VersionId::new("lab", 2), State::Trying(stage));
    }
    registry.enter(&VersionId::new("lab", 2), State::Failed(Failure::new(Stage::Warming, String::new())));
    assert_eq!(state(2), VersionState::Ready);
    // Its files are gone; it is in memory.
    fs::remove_dir_all(folder.path().join("lab/2")).unwrap();
    registry.load("lab", 2).unwrap();
    registry.change("lab", Change::Shadow(Some(3)), None).unwrap();
    let serving = registry.serving("lab");
    assert_eq!(serving.stable.map(|served| served.version), Some(2));
    assert_eq!(serving.previous.map(|served| served.version), Some(1));
    assert_eq!([1, 2, 3].map(state), [VersionState::Ready; 3]);
}

#[test]
fn a_version_that_many_activate_at_once_is_loaded_once() {
    let (_folder, registry) = registry();
    registry.change("lab", Change::Activate(1), None).unwrap();
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| match registry.change("lab", Change::Activate(2), None) {
                Ok(()) | Err(ChangeError::Superseded) => {}
                Err(error) => panic!("{error}"),
            });
        }
    });
    assert_eq!(stable(&registry), Some(2));
    let history = registry.entry("lab").unwrap().versions[&2].history();
    let n_loads = history.iter().filter(|change| change.state == VersionState::Loading).count();
    assert_eq!((n_loads, history.last().unwrap().state), (1, VersionState::Ready), "{history:?}");
}

#[test]
fn what_serves_from_a_first_start_on_is_deleted_by_nobody() {
    let (folder, beside) = registry();
    let registry = open(&folder, Policy::Latest);
    assert_eq!(stable(&registry), Some(3));
    let record = registry.repository.record("lab").unwrap();
    assert_eq!((record.stable, record.epoch), (Some(3), 1));
    let deleted = beside.delete(&VersionId::new("lab", 3), None);
    assert!(matches!(deleted, Err(ChangeError::ServingRecord(RecordError::Labeled { label: "stable", .. }))));
}

#[test]
fn a_version_that_another_service_has_deleted_is_not_written_down() {
    let (_folder, registry) = registry();
    registry.change("lab", Change::Activate(1), None).unwrap();
    let loaded = (2, registry.load("lab", 2).unwrap());
    registry.repository.delete(&VersionId::new("lab", 2)).unwrap();
    let ticket = registry.begin("lab", None).unwrap();
    let gone = registry.commit("lab", wanted(Change::Activate(2), ticket), Some(&loaded));
    assert!(matches!(gone, Err(ChangeError::Repository(RepositoryError::NoVersion(_)))));
    assert_eq!(registry.repository.record("lab").unwrap().stable, Some(1));
}

#[test]
fn a_version_that_answers_in_the_place_of_a_damaged_one_is_not_deleted() {
    let (folder, registry) = registry();
    registry.change("lab", Change::Activate(1), None).unwrap();
    registry.change("lab", Change::Activate(2), None).unwrap();
    drop(registry);
    fs::write(folder.path().join("lab/2/model.safetensors"), "damaged").unwrap();
    let registry = open(&folder, Policy::Manual);
    assert_eq!(stable(&registry), Some(1));
    let deleted = registry.delete(&VersionId::new("lab", 1), None);
    assert!(matches!(deleted, Err(ChangeError::ServingRecord(RecordError::Labeled { version: 1, .. }))));
    assert!(folder.path().join("lab/1/model.safetensors").is_file());
}

#[cfg(unix)]
#[test]
fn where_nothing_can_be_written_the_latest_serves_nevertheless() {
    let folder = TempDir::new().unwrap();
    write_version(&folder, 1);
    std::os::unix::fs::symlink("missing/lock", folder.path().join("lab/.lock")).unwrap();
    let registry = open(&folder, Policy::Latest);
    assert_eq!(stable(&registry), Some(1));
    write_version(&folder, 2);
    registry.poll().unwrap();
    registry.poll().unwrap();
    assert_eq!(stable(&registry), Some(2));
    assert_eq!(registry.repository.record("lab").unwrap(), ServingRecord::default());
}
