//! Another version comes to serve: it is loaded and tried first, then takes the place of the old one at once.

use super::state::{Loaded, State};
use super::table::{STABLE, Table};
use super::{
    ChangeError, Failure, LookupError, RegisteredModel, Registry, ServedModel, Serving, Shadow, lock,
};
use crate::engine::aside::aside;
use crate::engine::metrics::{SwapKind, SwapOutcome};
use crate::repository::{Canary, Change, RecordError, RepositoryError, ServingRecord};
use roomsight_protocol::event::Event;
use roomsight_protocol::rest::ModelName;
use roomsight_protocol::version_id::VersionId;
use roomsight_recognition::model::{LoadedModel, NetworkStore, Stage, try_model};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;
use tempfile::TempDir;

/// How often a change is tried where others change the repository meanwhile.
const MAX_TRIES: usize = 3;

/// A change that somebody wants.
#[derive(Clone, Copy)]
struct Wanted {
    change: Change,
    /// Its number among those of its model, by when they began.
    ticket: u64,
    /// The epoch at which its caller looked at what serves, where nothing must have been changed since.
    expected_epoch: Option<u64>,
    /// Nobody has asked for it: it takes effect even where it cannot be written down, as at the start.
    is_automatic: bool,
}

/// What became of a try to commit.
enum Commit {
    Done,
    /// The change, on top of others that were faster, takes this version.
    Wants(u64),
}

impl From<Change> for SwapKind {
    fn from(change: Change) -> Self {
        match change {
            Change::Activate(_) => Self::Activate,
            Change::Rollback => Self::Rollback,
            Change::Canary(_) | Change::Shadow(_) => Self::Label,
            Change::Unload => Self::Unload,
        }
    }
}

impl Registry {
    /// Changes what serves under a name. Where the caller says at which epoch it looked, nothing must have
    /// been changed since. What is to serve is loaded and tried first; it blocks for as long as that takes.
    /// Frames in work finish on the model that they began with.
    ///
    /// # Errors
    /// Nothing is changed then, and what served serves on.
    pub fn change(&self, name: &str, change: Change, expected_epoch: Option<u64>) -> Result<(), ChangeError> {
        self.apply(name, change.into(), change, expected_epoch)?;
        self.settle_default();
        Ok(())
    }

    /// Counts and times a change.
    fn counted(
        &self,
        kind: SwapKind,
        change: impl FnOnce() -> Result<(), ChangeError>,
    ) -> Result<(), ChangeError> {
        let began = Instant::now();
        let result = change();
        let outcome = match &result {
            Ok(()) => SwapOutcome::Done,
            Err(ChangeError::Superseded | ChangeError::Stale { .. }) => SwapOutcome::Lost,
            Err(_) => SwapOutcome::Failed,
        };
        self.metrics.swapped(kind, began.elapsed(), outcome);
        result
    }

    /// Makes a change, counted as one of its kind.
    pub(super) fn apply(
        &self,
        name: &str,
        kind: SwapKind,
        change: Change,
        expected_epoch: Option<u64>,
    ) -> Result<(), ChangeError> {
        let is_automatic = matches!(kind, SwapKind::Latest);
        let wanted = Wanted { change, ticket: 0, expected_epoch, is_automatic };
        self.counted(kind, || self.insist(name, wanted)).inspect_err(|error| {
            // Whoever asked hears of it; of the others only what concerns all.
            if !matches!(error, ChangeError::Superseded | ChangeError::Stale { .. }) {
                let (model, change) = (name.to_owned(), kind.name().to_owned());
                self.events.tell(Event::SwapFailed { model, change, reason: error.to_string() });
            }
        })
    }

    /// Tries to make a change for as long as others are faster.
    fn insist(&self, name: &str, wanted: Wanted) -> Result<(), ChangeError> {
        let expected_epoch = wanted.expected_epoch;
        let ticket = self.begin(name, expected_epoch)?;
        let mut loaded = None;
        let wanted = Wanted { ticket, ..wanted };
        let mut result = self.try_to_apply(name, wanted, &mut loaded);
        for _ in 1..MAX_TRIES {
            // A command, or a service beside this one, was faster.
            let Err(ChangeError::Repository(RepositoryError::Overtaken { epoch: current, .. })) = result
            else {
                break;
            };
            result = match expected_epoch {
                Some(expected) => Err(ChangeError::Stale { expected, current }),
                None => self.catch_up(name).and_then(|()| self.try_to_apply(name, wanted, &mut loaded)),
            };
        }
        if result.is_err() {
            self.leave(name, loaded.map(|(version, _)| version));
        }
        result
    }

    /// Reads what somebody else has decided.
    fn catch_up(&self, name: &str) -> Result<(), ChangeError> {
        let record = self.repository.record(name)?;
        if let Some(entry) = self.book().models.get_mut(name) {
            entry.note_record(&record);
        }
        Ok(())
    }

    fn try_to_apply(
        &self,
        name: &str,
        wanted: Wanted,
        loaded: &mut Option<(u64, Loaded)>,
    ) -> Result<(), ChangeError> {
        loop {
            match self.commit(name, wanted, loaded.as_ref())? {
                Commit::Done => return Ok(()),
                Commit::Wants(version) => *loaded = Some((version, self.load(name, version)?)),
            }
        }
    }

    /// Verifies and publishes a version that was put together in a folder of [`Registry::stage`].
    ///
    /// # Errors
    /// A model that does not work, a version that is there already, a repository that cannot be written.
    pub fn publish(&self, id: &VersionId, staged: TempDir) -> Result<(), ChangeError> {
        self.repository.complete(staged.path())?;
        let loading = lock(&self.loading);
        self.aside_of_frames(|| try_folder(staged.path(), &self.networks, |_| ()))?;
        drop(loading);
        Ok(self.repository.publish(id, staged)?)
    }

    /// The same for a version that is to serve nobody until somebody says so, whatever the policy: it counts as decided about.
    ///
    /// # Errors
    /// As of [`Registry::publish`], or a record that cannot be written.
    pub fn publish_aside(&self, id: &VersionId, staged: TempDir) -> Result<(), ChangeError> {
        {
            // Nobody here sees the version before its record.
            let _looking = lock(&self.looking);
            self.publish(id, staged)?;
            let mut decided = self.decide_about(id);
            for _ in 1..MAX_TRIES {
                if !matches!(decided, Err(RepositoryError::Overtaken { .. })) {
                    break;
                }
                decided = self.decide_about(id);
            }
            decided?;
        }
        Ok(self.found(id)?)
    }

    fn decide_about(&self, id: &VersionId) -> Result<(), RepositoryError> {
        let record = self.repository.record(&id.name)?;
        self.repository.write_record(&id.name, &record.decided_about(id.version))
    }

    /// The files of a version.
    ///
    /// # Errors
    /// A version that is not there, or cannot be fetched.
    pub fn folder(&self, id: &VersionId) -> Result<PathBuf, RepositoryError> {
        self.repository.fetch(id)
    }

    /// A new folder, where a version is put together before it is published.
    pub fn stage(&self) -> Result<TempDir, RepositoryError> {
        self.repository.stage()
    }

    /// Removes a version that serves as nothing.
    pub fn delete(&self, id: &VersionId, expected_epoch: Option<u64>) -> Result<(), ChangeError> {
        self.begin(&id.name, expected_epoch)?;
        let _committing = lock(&self.committing);
        let entry = self.entry(&id.name)?;
        entry.check_epoch(expected_epoch)?;
        entry.version(&id.name, id.version)?;
        let record = entry.record.without(id.version)?;
        // Or it answers in the place of a stable version that does not work.
        if self.serving(&id.name).stable.is_some_and(|stable| stable.version == id.version) {
            return Err(RecordError::Labeled { version: id.version, label: STABLE }.into());
        }
        if record != entry.record {
            self.repository.write_record(&id.name, &record)?;
        }
        self.adopt(&id.name, record, None);
        let _looking = lock(&self.looking);
        self.repository.delete(id)?;
        if let Some(entry) = self.book().models.get_mut(&id.name) {
            entry.versions.remove(&id.version);
        }
        tracing::info!(version = %id, "deleted");
        Ok(())
    }

    /// Numbers a change by when it began. What others decided before it is read, since what is known here may be
    /// older.
    fn begin(&self, name: &str, expected_epoch: Option<u64>) -> Result<u64, ChangeError> {
        self.entry(name)?;
        self.catch_up(name)?;
        let mut book = self.book();
        let entry = book.models.get_mut(name).ok_or_else(|| LookupError::NoModel(name.to_owned()))?;
        entry.check_epoch(expected_epoch)?;
        entry.n_begun += 1;
        Ok(entry.n_begun)
    }

    /// Writes a change down and lets it take effect, if nothing was changed since its caller looked, no younger one
    /// of the same role has taken effect, and what it takes is loaded.
    fn commit(
        &self,
        name: &str,
        Wanted { change, ticket, expected_epoch, is_automatic }: Wanted,
        loaded: Option<&(u64, Loaded)>,
    ) -> Result<Commit, ChangeError> {
        let _committing = lock(&self.committing);
        let entry = self.entry(name)?;
        entry.check_epoch(expected_epoch)?;
        let is_younger = |role| entry.committed.get(role).is_some_and(|&committed| committed > ticket);
        if change.roles().iter().any(is_younger) {
            return Err(ChangeError::Superseded);
        }
        // Older changes may have taken effect while the version was loading.
        let record = change.of(&entry.record)?;
        if let Some(wanted) = change.wants(&record) {
            // It may have been deleted.
            entry.version(name, wanted)?;
            if loaded.is_none_or(|(version, _)| *version != wanted) {
                return Ok(Commit::Wants(wanted));
            }
        }
        if record != entry.record {
            if let Some(version) = change.wants(&record) {
                // Another service may have deleted it.
                self.repository.fetch(&VersionId::new(name, version))?;
            }
            if is_automatic {
                self.keep(name, &record)?;
            } else {
                self.repository.write_record(name, &record)?;
            }
        }
        self.adopt(name, record, loaded);
        if let Some(entry) = self.book().models.get_mut(name) {
            entry.committed.extend(change.roles().iter().map(|&role| (role, ticket)));
        }
        Ok(Commit::Done)
    }

    /// The model of a version: the one in memory, or else from its files, which are tried.
    pub(super) fn load(&self, name: &str, version: u64) -> Result<Loaded, ChangeError> {
        let id = VersionId { name: name.to_owned(), version };
        let in_memory = || -> Result<Option<Loaded>, ChangeError> {
            Ok(self.entry(name)?.version(name, version)?.loaded().cloned())
        };
        if let Some(loaded) = in_memory()? {
            return Ok(loaded);
        }
        let _one = lock(&self.loading);
        // Another change may have loaded it while this one waited.
        if let Some(loaded) = in_memory()? {
            return Ok(loaded);
        }
        let try_at = |stage| self.enter(&id, State::Trying(stage));
        try_at(Stage::Verifying);
        let folder = self.repository.fetch(&id).map_err(Failure::from);
        let load = |folder: PathBuf| {
            let loaded = try_folder(&folder, &self.networks, try_at)?;
            let prepared = loaded.model.prepare(self.n_threads);
            prepared.map_err(|error| Failure::new(Stage::Warming, error.to_string()))?;
            Ok(loaded)
        };
        let tried =
            folder.and_then(|folder| self.aside_of_frames(|| load(folder))).inspect_err(|failure| {
                tracing::error!(version = %id, %failure, "does not serve");
                self.enter(&id, State::Failed(failure.clone()));
            })?;
        self.enter(&id, State::Ready(tried.clone()));
        Ok(tried)
    }

    /// Does the work on models that are read and tried; where frames may come, on a thread that stands aside for them.
    /// Whoever calls this holds `loading`.
    fn aside_of_frames<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        if self.is_open.load(Ordering::Relaxed) { aside(work) } else { work() }
    }

    /// Gives up what was loaded for a change that did not take effect.
    fn leave(&self, name: &str, version: Option<u64>) {
        let mut book = self.book();
        // Under the same lock as the table is replaced, so that it does not come to serve in between.
        let is_serving =
            |version: u64| self.serving(name).answering().any(|served| served.version == version);
        if let Some(number) = version.filter(|&version| !is_serving(version))
            && let Some(version) = book.models.get_mut(name).and_then(|entry| entry.versions.get_mut(&number))
        {
            version.enter(State::Unloaded);
        }
    }

    /// Lets a record take effect as far as its versions are in memory, or `loaded` just now. Whoever calls
    /// this holds `committing`.
    pub(super) fn adopt(&self, name: &str, record: ServingRecord, loaded: Option<&(u64, Loaded)>) {
        let mut book = self.book();
        let Some(entry) = book.models.get_mut(name) else { return };
        if let Some((version, loaded)) = loaded
            && let Some(version) = entry.versions.get_mut(version)
            && version.loaded().is_none()
        {
            version.enter(State::Ready(loaded.clone()));
        }
        entry.record = record;
        entry.is_followed = true;
        let before = self.serving(name);
        let serving = entry.serving(name, &before);
        let resident: Vec<u64> = serving.answering().map(|served| served.version).collect();
        self.swap(name, &before, serving);
        drop(before);
        for (number, version) in &mut entry.versions {
            if !resident.contains(number) {
                version.retire();
            }
        }
    }

    /// Replaces the table; whoever asks from now on is answered by what is in it.
    fn swap(&self, name: &str, before: &Serving, serving: Serving) {
        let mut table = Table::clone(&self.table());
        let stable = serving.stable.clone();
        table.models.insert(name.to_owned(), serving);
        self.table.store(Arc::new(table));
        let version =
            |served: &Option<Arc<ServedModel>>| served.as_ref().map(|served| (served.version, served.epoch));
        if version(&before.stable) != version(&stable) {
            match &stable {
                Some(served) => {
                    tracing::info!(
                        model = name,
                        version = served.version,
                        epoch = served.epoch,
                        digest = served.digest,
                        "serves"
                    );
                    self.events.tell(Event::ModelChanged { to: ModelName::from(&**served) });
                }
                None => tracing::info!(model = name, "nothing serves"),
            }
        }
    }

    /// Notes how far a version has come on its way into memory. Where it is there already it stays.
    pub(super) fn enter(&self, id: &VersionId, state: State) {
        let mut book = self.book();
        if let Some(version) =
            book.models.get_mut(&id.name).and_then(|entry| entry.versions.get_mut(&id.version))
            && version.loaded().is_none()
        {
            version.enter(state);
        }
    }
}

impl RegisteredModel {
    /// Whether nothing was changed since a caller looked.
    fn check_epoch(&self, expected: Option<u64>) -> Result<(), ChangeError> {
        let current = self.record.epoch;
        match expected.filter(|&expected| expected != current) {
            Some(expected) => Err(ChangeError::Stale { expected, current }),
            None => Ok(()),
        }
    }

    /// What serves by the record. Where the stable version does not work, what served before serves on.
    fn serving(&self, name: &str, before: &Serving) -> Serving {
        let ServingRecord { stable, previous, canary, shadow, epoch, .. } = self.record.clone();
        let served = |version: Option<u64>, old: Option<&Arc<ServedModel>>| {
            let version = version?;
            let Loaded { model, digest } = self.versions.get(&version)?.loaded()?.clone();
            let same = old.filter(|old| old.version == version && Arc::ptr_eq(&old.model, &model));
            let new = || Arc::new(ServedModel::new(name, version, epoch, model.clone(), digest));
            Some(same.cloned().unwrap_or_else(new))
        };
        let old_canary = before.canary.as_ref().map(|(served, _)| served);
        let shadow = served(shadow, before.shadow.as_ref().map(|shadow| &shadow.served));
        let old_shadow = |served: &Arc<ServedModel>| {
            before.shadow.clone().filter(|shadow| Arc::ptr_eq(&shadow.served, served))
        };
        Serving {
            stable: stable.and_then(|_| {
                let works = served(stable, before.stable.as_ref());
                works.or_else(|| before.stable.clone()).or_else(|| served(self.fallback, None))
            }),
            previous: served(previous, before.previous.as_ref()),
            canary: canary
                .and_then(|Canary { version, share }| Some((served(Some(version), old_canary)?, share))),
            shadow: shadow.map(|served| old_shadow(&served).unwrap_or_else(|| Arc::new(Shadow::new(served)))),
        }
    }
}

/// Verifies, loads and tries a model, with the networks of `store`.
fn try_folder(folder: &Path, store: &NetworkStore, on_stage: impl FnMut(Stage)) -> Result<Loaded, Failure> {
    let LoadedModel { model, digest } = try_model(folder, store, on_stage)?.loaded;
    Ok(Loaded { model: Arc::new(model), digest })
}

#[cfg(test)]
mod tests;
