//! The start, and what changes in the repository while the service runs: versions that come and go, and what
//! others have decided is to serve.

use super::state::{Loaded, Version};
use super::table::Table;
use super::{Book, ChangeError, RegisteredModel, Registry, RegistryError, lock};
use crate::engine::events::Events;
use crate::engine::metrics::{Metrics, SwapKind};
use crate::repository::{Change, Listing, Repository, RepositoryError, Scan, ServingRecord};
use crate::settings::{Policy, Settings};
use arc_swap::ArcSwap;
use roomsight_protocol::version_id::VersionId;
use roomsight_recognition::model::NetworkStore;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

impl Registry {
    /// Looks at the repository and loads what is to serve: what served when the service stopped; with the
    /// policy `latest` a higher version that came since. Where that does not work, the version before it.
    ///
    /// # Errors
    /// Nothing can serve. With the policy `manual` that is none.
    pub fn open(
        repository: Repository,
        settings: &Settings,
        events: Events,
        metrics: Arc<Metrics>,
    ) -> Result<Self, RegistryError> {
        let registry = Self {
            repository,
            policy: settings.policy,
            default_setting: settings.model.clone(),
            table: ArcSwap::from_pointee(Table {
                default: Some(settings.model.clone()).filter(|name| !name.is_empty()),
                ..Table::default()
            }),
            book: Mutex::new(Book::default()),
            committing: Mutex::default(),
            looking: Mutex::default(),
            loading: Mutex::default(),
            is_open: AtomicBool::new(false),
            n_threads: settings.n_threads(),
            networks: NetworkStore::default(),
            events,
            metrics,
        };
        for name in registry.look(None)? {
            registry.start(&name);
        }
        // Where people teach the service, the first model comes later.
        if settings.policy == Policy::Latest && !settings.keeps_data() {
            registry.check(&settings.models.to_string_lossy())?;
        }
        registry.settle_default();
        registry.tell_default();
        registry.is_open.store(true, Ordering::Relaxed);
        Ok(registry)
    }

    /// Looks at the repository again and does what follows from what changed in it. It blocks.
    ///
    /// # Errors
    /// A repository that cannot be read: nothing changes then.
    pub fn poll(&self) -> Result<(), RepositoryError> {
        for name in self.look(None)? {
            self.follow(&name);
        }
        self.settle_default();
        Ok(())
    }

    /// Takes a version that was just published for settled: it is whole.
    pub fn found(&self, id: &VersionId) -> Result<(), RepositoryError> {
        self.look(Some(id))?;
        self.follow(&id.name);
        self.settle_default();
        Ok(())
    }

    /// Writes what there is into the book, one version of which is known to be whole; returns the models.
    fn look(&self, whole: Option<&VersionId>) -> Result<Vec<String>, RepositoryError> {
        let _looking = lock(&self.looking);
        let Scan { models, foreign, default } = self.repository.scan()?;
        let mut guard = self.book();
        if let Some(default) = &default {
            self.note_default(&mut guard, default);
        }
        let Book { models: entries, reported, .. } = &mut *guard;
        let is_start = entries.is_empty();
        for path in foreign {
            if !reported.contains(&path) {
                tracing::warn!(path, "not a version of a model, left alone");
                reported.insert(path);
            }
        }
        for (name, listing) in &models {
            entries.entry(name.clone()).or_default().note(name, listing, is_start);
        }
        entries.retain(|name, entry| {
            let is_there = models.contains_key(name);
            if !is_there {
                entry.note(name, &Listing::default(), is_start);
            }
            is_there || !entry.versions.is_empty()
        });
        if let Some(id) = whole
            && let Some(entry) = entries.get_mut(&id.name)
            && let Some(version) = entry.versions.get_mut(&id.version)
        {
            version.mark_whole();
        }
        Ok(models.into_keys().collect())
    }

    /// Loads the first that works of what may serve under a name.
    fn start(&self, name: &str) {
        let Ok(entry) = self.entry(name) else { return };
        let record = &entry.record;
        if record.epoch == 0
            && let Err(error @ RepositoryError::ServingRecord { .. }) = self.repository.record(name)
        {
            let advice = "the highest version that works serves, if the policy is `latest`";
            tracing::error!(model = name, %error, advice, "what somebody has decided is to serve is not known");
        }
        let is_latest = self.policy == Policy::Latest;
        let (newer, older): (Vec<u64>, Vec<u64>) =
            entry.versions.keys().rev().filter(|_| is_latest).partition(|&&version| entry.is_newer(version));
        // After `unload` nothing is to serve, until something newer comes.
        let decided = record.stable.into_iter().chain(record.previous);
        let fallback = decided.chain(older).filter(|_| !entry.is_unloaded());
        let first = newer
            .into_iter()
            .chain(fallback)
            .find_map(|version| Some((version, self.load(name, version).ok()?)));
        let _committing = lock(&self.committing);
        let mut record = record.clone();
        match &first {
            Some((version, _)) if entry.is_newer(*version) => {
                record = record.activated(*version);
                // A first one too: whoever changes the repository by a command must see what serves.
                if record != entry.record {
                    // Of two that start at once the first has written it; the other follows it.
                    let _ = self.keep(name, &record);
                }
            }
            Some((version, _)) if record.stable != Some(*version) => {
                tracing::error!(model = name, serves = version, "the version that is to serve does not work");
                if let Some(entry) = self.book().models.get_mut(name) {
                    entry.fallback = Some(*version);
                }
            }
            _ => {}
        }
        self.adopt(name, record, first.as_ref());
    }

    /// Does what follows from what is in the book: the versions that are to serve are loaded, and with the
    /// policy `latest` a version that is newer than all that served comes to serve.
    fn follow(&self, name: &str) {
        let Ok(entry) = self.entry(name) else { return };
        if !entry.is_followed {
            self.adopt_known(name, None);
        }
        for version in entry.untried() {
            if let Ok(loaded) = self.load(name, version) {
                self.adopt_known(name, Some(&(version, loaded)));
            }
        }
        if self.policy == Policy::Latest
            && let Some(version) = entry.newest_untried()
            && let Err(error) = self.take(name, version)
        {
            tracing::warn!(model = name, version, %error, "a newer version does not come to serve");
        }
    }

    /// Lets a version serve that is newer than all that served.
    fn take(&self, name: &str, version: u64) -> Result<(), ChangeError> {
        self.apply(name, SwapKind::Latest, Change::Activate(version), None)
    }

    /// Lets the record that is known take effect.
    fn adopt_known(&self, name: &str, loaded: Option<&(u64, Loaded)>) {
        let _committing = lock(&self.committing);
        if let Ok(entry) = self.entry(name) {
            self.adopt(name, entry.record, loaded);
        }
    }

    /// Writes down what comes to serve by itself: where that cannot be done, it serves nevertheless.
    ///
    /// # Errors
    /// Somebody else has decided meanwhile.
    pub(super) fn keep(&self, name: &str, record: &ServingRecord) -> Result<(), RepositoryError> {
        match self.repository.write_record(name, record) {
            Err(overtaken @ RepositoryError::Overtaken { .. }) => return Err(overtaken),
            // One model's own folder has none.
            Ok(()) | Err(RepositoryError::ReadOnly(_)) => {}
            Err(error) => tracing::warn!(model = name, %error, "what serves is not kept for the next start"),
        }
        Ok(())
    }

    /// Refuses to start where nothing can serve, or not the model that requests without a name ask for.
    fn check(&self, location: &str) -> Result<(), RegistryError> {
        let table = self.table();
        let serving: Vec<String> = table.stable().map(str::to_owned).collect();
        let entries = self.entries();
        if serving.is_empty() && !entries.values().any(RegisteredModel::is_unloaded) {
            return Err(nothing_serves(location, &entries));
        }
        let wanted = &self.default_setting;
        if wanted.is_empty()
            || serving.contains(wanted)
            || entries.get(wanted).is_some_and(RegisteredModel::is_unloaded)
        {
            return Ok(());
        }
        Err(RegistryError::NoDefault { wanted: wanted.clone(), serving })
    }
}

impl RegisteredModel {
    /// Writes down what the repository has of this model.
    fn note(&mut self, name: &str, Listing { versions, record }: &Listing, is_start: bool) {
        for (&number, fingerprint) in versions {
            match self.versions.get_mut(&number) {
                Some(version) => version.look(&format!("{name}/{number}"), fingerprint),
                None => {
                    self.versions.insert(number, Version::new(fingerprint.clone(), is_start));
                }
            }
        }
        self.versions.retain(|number, version| versions.contains_key(number) || version.loaded().is_some());
        self.note_record(record);
    }

    /// Takes over what somebody else decided: later than what is known here, or at the same time, and written down.
    pub(super) fn note_record(&mut self, record: &ServingRecord) {
        let is_later = record.epoch > self.record.epoch;
        if is_later || (record.epoch == self.record.epoch && record.epoch > 0) {
            self.is_followed = self.is_followed && self.record == *record;
            self.record = record.clone();
        }
    }

    /// Whether a version is newer than all that somebody has decided about.
    fn is_newer(&self, version: u64) -> bool {
        self.record.epoch == 0 || version > self.record.settled
    }

    /// Whether somebody decided that nothing is to serve.
    fn is_unloaded(&self) -> bool {
        self.record.epoch > 0 && self.record.stable.is_none()
    }

    /// The versions that are to be in memory, are not, and may work.
    fn untried(&self) -> Vec<u64> {
        let ServingRecord { stable, previous, canary, shadow, .. } = &self.record;
        let canary = canary.map(|canary| canary.version);
        let wanted = stable.iter().chain(&canary).chain(shadow).chain(previous);
        wanted
            .copied()
            .filter(|version| self.versions.get(version).is_some_and(Version::is_untried))
            .collect()
    }

    /// The highest version that may come to serve by itself.
    fn newest_untried(&self) -> Option<u64> {
        let mut newer = self.versions.iter().rev().filter(|&(&version, _)| self.is_newer(version));
        newer.find(|(_, version)| version.is_new()).map(|(&version, _)| version)
    }
}

fn nothing_serves(location: &str, entries: &BTreeMap<String, RegisteredModel>) -> RegistryError {
    let mut failures = Vec::new();
    for (name, entry) in entries {
        for (number, version) in &entry.versions {
            if let Some(failure) = version.failure() {
                failures.push(format!("  {name}/{number}: {failure}"));
            }
        }
    }
    if failures.is_empty() {
        RegistryError::Empty(location.to_owned())
    } else {
        RegistryError::AllFailed { location: location.to_owned(), failures }
    }
}
