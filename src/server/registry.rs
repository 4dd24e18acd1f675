//! The models that serve: a folder `NAME/VERSION/`. At the start the highest version of a name serves;
//! another one that was found then can be activated while frames are answered.
//!
//! A version that comes while the service runs is not looked at.

use crate::model::{GoldenFrame, LoadError, LoadedModel, Model, load_golden_frames};
use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};

/// The label of the version that answers requests that ask for none.
pub const STABLE: &str = "stable";
const MODEL_FILE: &str = "model.safetensors";
const MAX_NAME_BYTES: usize = 64;

/// All models by name.
#[derive(Debug)]
pub struct Registry {
    models: RwLock<BTreeMap<String, Versions>>,
    default_name: String,
}

/// All versions of one model.
#[derive(Clone, Debug, Default)]
pub struct Versions {
    /// By number.
    pub states: BTreeMap<u64, State>,
    /// The one that answers where none is asked for.
    pub serving: Option<Arc<ServedModel>>,
}

/// What is true of one version.
#[derive(Clone, Debug)]
pub enum State {
    /// It lies in this folder; another version serves.
    Discovered(PathBuf),
    /// It can answer.
    Ready(Arc<ServedModel>),
    /// It was tried and will not serve.
    Failed(Failure),
}

/// Why a version does not serve.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error("{stage} failed: {reason}")]
pub struct Failure {
    /// Where on its way it failed.
    pub stage: Stage,
    /// What was wrong.
    pub reason: String,
}

/// A step on the way to serving.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Reading and checking the files.
    Loading,
    /// Recognizing a first frame.
    Warming,
}

/// A model with the name under which it serves.
#[derive(Debug)]
pub struct ServedModel {
    /// Its name, that of its folder.
    pub name: String,
    /// Its version, a whole number.
    pub version: u64,
    /// How many times the serving version of this name was set; 1 for what the start found.
    pub epoch: u64,
    /// The model itself.
    pub model: Arc<Model>,
    /// The BLAKE3 digest of its file, 64 hexadecimal digits.
    pub digest: String,
}

/// Which version of a model a caller asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The one that serves.
    Serving,
    /// One number.
    Version(u64),
    /// The one that carries a label.
    Label(String),
}

/// Why the folder of models gives nothing to serve.
#[derive(Debug, thiserror::Error)]
pub enum RegistryError {
    /// The folder cannot be read.
    #[error("the folder of models {0} cannot be read: {1}")]
    Unreadable(PathBuf, io::Error),
    /// No model in it.
    #[error(
        "no model in {0}: put one at NAME/VERSION/{MODEL_FILE} in it (VERSION is a whole number), \
         for example with `roomsight train`"
    )]
    Empty(PathBuf),
    /// Models, but none that works.
    #[error("no model in {folder} can serve:\n{}", failures.join("\n"))]
    AllFailed {
        /// The folder.
        folder: PathBuf,
        /// A line for each version that was tried.
        failures: Vec<String>,
    },
    /// The default model is not among those that serve.
    #[error("the setting `model` names {wanted:?}, which does not serve; these do: {}", serving.join(", "))]
    NoDefault {
        /// What was asked for.
        wanted: String,
        /// What there is.
        serving: Vec<String>,
    },
}

/// Why another version does not come to serve.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
pub enum ActivateError {
    /// It is not there.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// It does not work.
    #[error("the version does not come to serve, what served serves on: {0}")]
    Failed(#[from] Failure),
}

/// Why a request gets no model.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
pub enum LookupError {
    /// No model of this name.
    #[error("there is no model {0:?}; GET /v1/models lists those that are")]
    NoModel(String),
    /// No such version of it.
    #[error("the model {0:?} has no version {1}; GET /v1/models/{0} lists those it has")]
    NoVersion(String, u64),
    /// It is there, and does not serve.
    #[error("version {1} of the model {0:?} does not serve; GET /v1/models/{0} tells which does")]
    NotReady(String, u64),
    /// No version serves, or none carries the label.
    #[error("no version of the model {0:?} serves as {1:?}; leave the label out for the one that serves")]
    NoLabel(String, String),
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Loading => "loading",
            Self::Warming => "warming",
        })
    }
}

impl Registry {
    /// Reads the folder of models, or one model's folder. Of each name the highest version that
    /// loads and passes `warm` serves; those above it are kept as failed, and logged.
    pub fn open(
        folder: &Path,
        default_name: &str,
        warm: impl Fn(&Model, &[GoldenFrame]) -> Result<(), String>,
    ) -> Result<Self, RegistryError> {
        let unreadable = |error| RegistryError::Unreadable(folder.to_owned(), error);
        let mut models = BTreeMap::new();
        for (name, paths) in scan(folder).map_err(unreadable)? {
            let versions = load_highest(&name, &paths, &warm);
            models.insert(name, versions);
        }
        let serving: Vec<String> =
            models.iter().filter(|(_, v)| v.serving.is_some()).map(|(name, _)| name.clone()).collect();
        let Some(first) = serving.first() else {
            return Err(nothing_serves(folder, &models));
        };
        let default_name = if default_name.is_empty() { first } else { default_name };
        if !serving.iter().any(|name| name == default_name) {
            return Err(RegistryError::NoDefault { wanted: default_name.to_owned(), serving });
        }
        Ok(Self { default_name: default_name.to_owned(), models: RwLock::new(models) })
    }

    /// All models by name, as they are now.
    pub fn models(&self) -> RwLockReadGuard<'_, BTreeMap<String, Versions>> {
        self.models.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// The model of requests that name none.
    pub fn default_name(&self) -> &str {
        &self.default_name
    }

    /// The versions of one model.
    pub fn versions(&self, name: &str) -> Result<Versions, LookupError> {
        self.models().get(name).cloned().ok_or_else(|| LookupError::NoModel(name.to_owned()))
    }

    /// The model that answers a request.
    pub fn choose(&self, name: Option<&str>, choice: &Choice) -> Result<Arc<ServedModel>, LookupError> {
        let name = name.unwrap_or(&self.default_name);
        let models = self.models();
        let versions = models.get(name).ok_or_else(|| LookupError::NoModel(name.to_owned()))?;
        let no_label = |label: &str| LookupError::NoLabel(name.to_owned(), label.to_owned());
        match choice {
            Choice::Serving => versions.serving.clone().ok_or_else(|| no_label(STABLE)),
            Choice::Label(label) if label == STABLE => {
                versions.serving.clone().ok_or_else(|| no_label(STABLE))
            }
            Choice::Label(label) => Err(no_label(label)),
            Choice::Version(version) => match versions.state(name, *version)? {
                State::Ready(served) => Ok(served.clone()),
                State::Discovered(_) | State::Failed(_) => {
                    Err(LookupError::NotReady(name.to_owned(), *version))
                }
            },
        }
    }

    /// Lets another version of a model serve, loading and warming it first. Frames in work finish on the old
    /// one.
    ///
    /// # Errors
    /// There is no such version, or it does not load or pass `warm`: then the old one serves on.
    pub fn activate(
        &self,
        name: &str,
        version: u64,
        warm: impl Fn(&Model, &[GoldenFrame]) -> Result<(), String>,
    ) -> Result<Arc<ServedModel>, ActivateError> {
        let (model, digest) = match self.versions(name)?.state(name, version)? {
            State::Ready(served) => (served.model.clone(), served.digest.clone()),
            State::Discovered(path) => {
                let loaded = load(path, warm)?;
                (Arc::new(loaded.model), loaded.digest)
            }
            State::Failed(failure) => return Err(failure.clone().into()),
        };
        let mut models = self.models.write().unwrap_or_else(PoisonError::into_inner);
        let versions = models.get_mut(name).ok_or_else(|| LookupError::NoModel(name.to_owned()))?;
        let epoch = versions.serving.as_ref().map_or(1, |served| served.epoch + 1);
        let served = Arc::new(ServedModel { name: name.to_owned(), version, epoch, model, digest });
        versions.serve(&served);
        Ok(served)
    }
}

impl Versions {
    /// The state of one version of this model, whose name is for the message.
    pub fn state(&self, name: &str, version: u64) -> Result<&State, LookupError> {
        self.states.get(&version).ok_or_else(|| LookupError::NoVersion(name.to_owned(), version))
    }

    fn serve(&mut self, served: &Arc<ServedModel>) {
        self.states.insert(served.version, State::Ready(served.clone()));
        self.serving = Some(served.clone());
    }
}

/// The folders of all versions, by name and number.
fn scan(folder: &Path) -> io::Result<BTreeMap<String, BTreeMap<u64, PathBuf>>> {
    let folder = folder.canonicalize()?;
    if folder.join(MODEL_FILE).is_file() {
        let (name, version) = name_of(&folder);
        return Ok(BTreeMap::from([(name, BTreeMap::from([(version, folder)]))]));
    }
    let mut models = BTreeMap::new();
    for (name, path) in subfolders(&folder)? {
        let mut versions = BTreeMap::new();
        for (version, path) in subfolders(&path)? {
            match version.parse::<u64>() {
                Ok(number) if is_name(&name) && path.join(MODEL_FILE).is_file() => {
                    versions.insert(number, path);
                }
                _ => tracing::warn!(path = %path.display(), "not a version of a model, left alone"),
            }
        }
        if !versions.is_empty() {
            models.insert(name, versions);
        }
    }
    Ok(models)
}

/// Name and version of a model that is given by its own folder: `.../NAME/VERSION` or `.../NAME`.
fn name_of(folder: &Path) -> (String, u64) {
    let text = |path: Option<&Path>| {
        let name = path?.file_name()?.to_str()?;
        is_name(name).then(|| name.to_owned())
    };
    let own = text(Some(folder)).unwrap_or_else(|| "model".into());
    match (own.parse(), text(folder.parent())) {
        (Ok(version), Some(name)) => (name, version),
        _ => (own, 1),
    }
}

fn subfolders(folder: &Path) -> io::Result<Vec<(String, PathBuf)>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if let Some(name) = path.file_name().and_then(|name| name.to_str())
            && path.is_dir()
        {
            found.push((name.to_owned(), path));
        }
    }
    Ok(found)
}

/// Whether a name can stand in a path, a query and a log as it is.
fn is_name(name: &str) -> bool {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    !name.is_empty() && name.len() <= MAX_NAME_BYTES && !name.starts_with('.') && name.chars().all(is_plain)
}

fn load_highest(
    name: &str,
    paths: &BTreeMap<u64, PathBuf>,
    warm: impl Fn(&Model, &[GoldenFrame]) -> Result<(), String>,
) -> Versions {
    let mut versions = Versions::default();
    for (&version, path) in paths.iter().rev() {
        if versions.serving.is_some() {
            versions.states.insert(version, State::Discovered(path.clone()));
            continue;
        }
        match load(path, &warm) {
            Ok(LoadedModel { model, digest }) => {
                tracing::info!(model = name, version, digest, "serves");
                let (name, model) = (name.to_owned(), Arc::new(model));
                versions.serve(&Arc::new(ServedModel { name, version, epoch: 1, model, digest }));
            }
            Err(failure) => {
                tracing::error!(model = name, version, path = %path.display(), %failure, "does not serve");
                versions.states.insert(version, State::Failed(failure));
            }
        }
    }
    versions
}

fn load(
    path: &Path,
    warm: impl Fn(&Model, &[GoldenFrame]) -> Result<(), String>,
) -> Result<LoadedModel, Failure> {
    let loaded = Model::load(path).map_err(loading_failed)?;
    let golden_frames = load_golden_frames(path).map_err(loading_failed)?;
    warm(&loaded.model, &golden_frames).map_err(|reason| Failure { stage: Stage::Warming, reason })?;
    Ok(loaded)
}

/// Callers may read the reason: it names the file, not where it lies.
fn loading_failed(LoadError { path, reason }: LoadError) -> Failure {
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    Failure { stage: Stage::Loading, reason: format!("{file}: {reason}") }
}

fn nothing_serves(folder: &Path, models: &BTreeMap<String, Versions>) -> RegistryError {
    let mut failures = Vec::new();
    for (name, versions) in models {
        for (version, state) in &versions.states {
            if let State::Failed(failure) = state {
                failures.push(format!("  {name}/{version}: {failure}"));
            }
        }
    }
    if failures.is_empty() {
        RegistryError::Empty(folder.to_owned())
    } else {
        RegistryError::AllFailed { folder: folder.to_owned(), failures }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    fn folder(paths: &[&str]) -> TempDir {
        let folder = TempDir::new().unwrap();
        for path in paths {
            fs::create_dir_all(folder.path().join(path)).unwrap();
        }
        folder
    }

    fn found(folder: &Path) -> Vec<(String, Vec<u64>)> {
        let models = scan(folder).unwrap();
        models.into_iter().map(|(name, versions)| (name, versions.into_keys().collect())).collect()
    }

    fn write(folder: &TempDir, paths: &[&str]) {
        for path in paths {
            fs::write(folder.path().join(path).join(MODEL_FILE), "").unwrap();
        }
    }

    #[test]
    fn versions_are_ordered_as_numbers_and_foreign_folders_left_alone() {
        let paths = ["lab/9", "lab/10", "lab/latest", "lab/11", ".git/1", "two words/1", "empty"];
        let folder = folder(&paths);
        write(&folder, &["lab/9", "lab/10", "lab/latest", ".git/1", "two words/1"]);
        assert_eq!(found(folder.path()), [("lab".to_owned(), vec![9, 10])]);
    }

    #[test]
    fn a_models_own_folder_gives_its_name_and_version() {
        let folder = folder(&["lab/7", "attic"]);
        write(&folder, &["lab/7", "attic"]);
        assert_eq!(found(&folder.path().join("lab/7")), [("lab".to_owned(), vec![7])]);
        assert_eq!(found(&folder.path().join("attic")), [("attic".to_owned(), vec![1])]);
    }

    #[test]
    fn only_plain_names_are_taken() {
        for name in ["lab", "Lab_2.b-c", "x"] {
            assert!(is_name(name), "{name}");
        }
        for name in ["", ".lab", "..", "a b", "a/b", "caf\u{e9}", &"x".repeat(65)] {
            assert!(!is_name(name), "{name}");
        }
    }
}
