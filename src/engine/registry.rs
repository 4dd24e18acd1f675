//! The models that serve: what the repository has, what of it is in memory, and what answers whom.
//!
//! | file | what |
//! |---|---|
//! | `served` | which model answers whom: what every frame reads |
//! | `state` | what is true of each version, now and before |
//! | `change` | another version comes to serve: loaded and tried first, then swapped at once |
//! | `default` | which model answers requests that name none |
//! | `follow` | the start, and what changes in the repository while the service runs |
//! | `shadow` | a version that is compared with the stable one |
//!
//! Frames read one pointer, to a table that is never changed but replaced. All else is kept in a book behind a
//! lock that is never held while files are read or models tried. Loading happens on the threads of the callers,
//! never on those that recognize.

mod change;
mod default;
mod error;
mod follow;
mod info;
mod served;
mod shadow;
mod state;
mod table;

pub use error::{ChangeError, Failure, LookupError, RegistryError, repository_kind};
pub use info::{model_info, network_infos, short_digest, version_info, version_info_with_card};
pub use served::ServedModel;
pub use shadow::{Shadow, ShadowPermit, Tally, distance};
pub use state::Version;
pub use table::{CANARY, Choice, PREVIOUS, SHADOW, STABLE, Serving};

use crate::engine::events::Events;
use crate::engine::metrics::Metrics;
use crate::repository::{DefaultModel, Repository, Role, ServingRecord};
use crate::settings::Policy;
use arc_swap::{ArcSwap, Guard};
use roomsight_recognition::model::NetworkStore;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use table::Table;

/// All models by name.
pub struct Registry {
    repository: Repository,
    policy: Policy,
    /// The setting that names the model of requests that name none; empty: the one that the repository names.
    default_setting: String,
    table: ArcSwap<Table>,
    book: Mutex<Book>,
    /// Held while a change is written down and the table replaced: changes come one after the other.
    committing: Mutex<()>,
    /// Held while the repository is looked at and the book brought up to date, so that no older look undoes
    /// what a younger one found.
    looking: Mutex<()>,
    /// Held while a model is read and tried: one at a time, so that frames keep the processors.
    loading: Mutex<()>,
    /// Whether frames may come. Before that nothing has to be held back for them.
    is_open: AtomicBool,
    /// The threads that recognize, for which models are made ready.
    n_threads: usize,
    /// Versions in memory share the networks that are the same.
    networks: NetworkStore,
    events: Events,
    metrics: Arc<Metrics>,
}

/// What is known beside what serves.
#[derive(Default)]
struct Book {
    models: BTreeMap<String, RegisteredModel>,
    /// What was said of the default model; with the epoch 0, what was taken where nothing could be written.
    default: Option<DefaultModel>,
    /// What was reported of the repository, so that it is reported once.
    reported: BTreeSet<String>,
}

#[derive(Clone, Debug, Default)]
pub struct RegisteredModel {
    /// What is to serve.
    pub record: ServingRecord,
    pub versions: BTreeMap<u64, Version>,
    /// What served at the start in the place of the stable version, which did not work.
    fallback: Option<u64>,
    /// The table is as the record says, as far as that works.
    is_followed: bool,
    /// Changes that were begun.
    n_begun: u64,
    /// The youngest change of each role that took effect: an older one that ends later has lost.
    committed: BTreeMap<Role, u64>,
}

impl Registry {
    /// What serves, as it is now.
    pub fn table(&self) -> Guard<Arc<Table>> {
        self.table.load()
    }

    /// The model that answers a request of a robot, where one is named.
    pub fn choose(
        &self,
        name: Option<&str>,
        choice: &Choice,
        robot: Option<&str>,
    ) -> Result<Arc<ServedModel>, LookupError> {
        let table = self.table();
        let Some(name) = name else {
            let default = table.default.as_deref().ok_or(LookupError::Empty)?;
            let chosen = self.choose(Some(default), choice, robot);
            // It is not the caller who named it.
            return chosen.map_err(|error| match error {
                LookupError::NoModel(name) => LookupError::NoDefault(name),
                error => error,
            });
        };
        let Some(serving) = table.models.get(name) else { return Err(self.absent(name)) };
        match (serving.choose(name, choice, robot), choice) {
            (Err(LookupError::NotReady(..)), Choice::Version(version)) => {
                self.entry(name)?.version(name, *version)?;
                Err(LookupError::NotReady(name.to_owned(), *version))
            }
            // It may have been deleted.
            (Err(LookupError::NothingServes(_)), _) => Err(self.absent(name)),
            (chosen, _) => chosen.cloned(),
        }
    }

    /// A place for a frame that this model has answered beside its shadow, if it has one and few frames wait.
    pub fn permit_in_shadow(&self, served: &Arc<ServedModel>) -> Option<ShadowPermit> {
        self.table().models.get(&served.name)?.shadow_of(served)?.admit()
    }

    /// Whether this model, or the shadow that sees what it sees, looks at the colors of frames.
    pub fn wants_colors(&self, served: &Arc<ServedModel>) -> bool {
        let table = self.table();
        let shadow = table.models.get(&served.name).and_then(|serving| serving.shadow_of(served));
        served.model.wants_colors() || shadow.is_some_and(|shadow| shadow.served.model.wants_colors())
    }

    /// All models, as they are now.
    pub fn entries(&self) -> BTreeMap<String, RegisteredModel> {
        let mut book = self.book();
        book.models.values_mut().for_each(RegisteredModel::settle);
        book.models.clone()
    }

    /// One model, as it is now.
    pub fn entry(&self, name: &str) -> Result<RegisteredModel, LookupError> {
        let mut book = self.book();
        let entry = book.models.get_mut(name).ok_or_else(|| LookupError::NoModel(name.to_owned()))?;
        entry.settle();
        Ok(entry.clone())
    }

    /// What serves under a name.
    pub fn serving(&self, name: &str) -> Serving {
        self.table().models.get(name).cloned().unwrap_or_default()
    }

    /// Why nothing serves under a name.
    fn absent(&self, name: &str) -> LookupError {
        self.entry(name).err().unwrap_or_else(|| LookupError::NothingServes(name.to_owned()))
    }

    fn book(&self) -> MutexGuard<'_, Book> {
        lock(&self.book)
    }
}

impl RegisteredModel {
    /// One version of the model, whose name is for the message.
    pub fn version(&self, name: &str, version: u64) -> Result<&Version, LookupError> {
        self.versions.get(&version).ok_or_else(|| LookupError::NoVersion(name.to_owned(), version))
    }

    fn settle(&mut self) {
        self.versions.values_mut().for_each(Version::settle);
    }
}

/// What a panic left behind is still whole: every change of it is one assignment.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
