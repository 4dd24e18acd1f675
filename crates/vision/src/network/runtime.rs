//! ONNX Runtime, a shared library that is loaded when a network is first needed.

use ort::LoadDynamicError;
use ort::environment::Environment;
use ort::logging::LogLevel;
use ort::session::builder::{GraphOptimizationLevel, SessionBuilder};
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// ONNX Runtime, loaded. A process has one; copies are the same.
#[derive(Clone, Debug)]
pub struct Runtime {
    environment: Environment,
}

/// Why there is no ONNX Runtime.
#[derive(Debug, thiserror::Error)]
pub enum RuntimeError {
    /// No file has the name of the library.
    #[error(
        "there is no ONNX Runtime in {}: run `make networks`, which fetches it, or name the library of an installed one", .0.display()
    )]
    NoneInFolder(PathBuf),
    /// The named file is not there, or cannot be read.
    #[error(
        "there is no ONNX Runtime at {}: run `make networks`, which fetches it, or name the library of an installed one", .0.display()
    )]
    Missing(PathBuf),
    /// Something else than ONNX Runtime.
    #[error(
        "{} is not the library of ONNX Runtime ({why}): run `make networks`, which fetches it, or name the right file", path.display()
    )]
    Wrong {
        /// The file.
        path: PathBuf,
        /// What the system said.
        why: String,
    },
    /// One that lacks what is needed.
    #[error(
        "{} is ONNX Runtime {version}; 1.{} or newer is needed: run `make networks`, which fetches one", path.display(), ort::MINOR_VERSION
    )]
    TooOld {
        /// The file.
        path: PathBuf,
        /// What it says of itself.
        version: String,
    },
    /// It was loaded, and cannot start.
    #[error("ONNX Runtime cannot start: {0}")]
    CannotStart(String),
}

/// Where the library may be.
#[derive(Debug)]
struct Places {
    /// The library itself, if somebody named it: no other is taken then.
    named: Option<PathBuf>,
    folders: Vec<PathBuf>,
}

static PLACES: Mutex<Places> = Mutex::new(Places { named: None, folders: Vec::new() });

/// Where `make networks` leaves it, seen from where the program runs.
const FOLDER: &str = "networks";

/// The one of this process. `ort` keeps the library in a variable of its own, and allows one environment.
static LOADED: Mutex<Option<Runtime>> = Mutex::new(None);

impl Runtime {
    /// Names the library that [`Runtime::get`] loads.
    pub fn name_library(library: PathBuf) {
        PLACES.lock().unwrap_or_else(PoisonError::into_inner).named = Some(library);
    }

    /// Lets [`Runtime::get`] look into `folder` before all others.
    pub fn look_into(folder: PathBuf) {
        PLACES.lock().unwrap_or_else(PoisonError::into_inner).folders.insert(0, folder);
    }

    /// The ONNX Runtime of this process: the library that was named, or else the first that is found in the folders
    /// that were named or in `networks/`.
    pub fn get() -> Result<Self, RuntimeError> {
        let places = PLACES.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(library) = &places.named {
            return Self::load(library);
        }
        let found = places.folders.iter().find_map(|folder| Self::find(folder).ok());
        Self::load(&found.map_or_else(|| Self::find(Path::new(FOLDER)), Ok)?)
    }

    /// Loads the library `library`. Once one is loaded the process keeps to it, whatever is named later.
    pub fn load(library: &Path) -> Result<Self, RuntimeError> {
        let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(runtime) = &*loaded {
            return Ok(runtime.clone());
        }
        // Absolute, since the system would look for a bare name elsewhere.
        let path = library.canonicalize().map_err(|_| RuntimeError::Missing(library.to_owned()))?;
        let wrong = |why: String| RuntimeError::Wrong { path: path.clone(), why };
        // A library that has the right names and answers them wrongly makes `ort` panic.
        let environment = catch_unwind(|| -> Result<Environment, RuntimeError> {
            let builder = ort::init_from(&path).map_err(|error| match error {
                LoadDynamicError::BadVersion { version_str: version, .. } => {
                    RuntimeError::TooOld { path: path.clone(), version }
                }
                LoadDynamicError::Dlopen { error, .. } => wrong(first_line(&error.to_string())),
                LoadDynamicError::MissingApi { .. } => wrong("it lacks OrtGetApiBase".to_owned()),
                LoadDynamicError::InvalidVersionString => wrong("its version is no text".to_owned()),
            })?;
            let environment = builder.with_telemetry(false).build();
            environment.map_err(|error| RuntimeError::CannotStart(first_line(&error.to_string())))
        })
        .map_err(|_| wrong("it offers no interface".to_owned()))??;
        // Errors come back as such; the log would only repeat them.
        environment.set_log_level(LogLevel::Fatal);
        Ok(loaded.insert(Self { environment }).clone())
    }

    /// The library in the folder `folder`, as `make networks` leaves it there.
    pub fn find(folder: &Path) -> Result<PathBuf, RuntimeError> {
        let names = ["libonnxruntime.so", "libonnxruntime.dylib", "onnxruntime.dll"];
        let mut paths = names.iter().map(|name| folder.join(name));
        paths.find(|path| path.is_file()).ok_or_else(|| RuntimeError::NoneInFolder(folder.to_owned()))
    }

    /// Options of a session: one thread, which never spins; deterministic.
    pub(super) fn session(&self, optimization: GraphOptimizationLevel) -> ort::Result<SessionBuilder> {
        Ok(ort::session::Session::builder(&self.environment)?
            .with_intra_threads(1)?
            .with_inter_threads(1)?
            .with_intra_op_spinning(false)?
            .with_inter_op_spinning(false)?
            .with_log_level(LogLevel::Fatal)?
            .with_optimization_level(optimization)?)
    }
}

/// What ONNX Runtime or the system said, without the lines of details behind it.
pub(super) fn first_line(message: &str) -> String {
    message.lines().next().unwrap_or_default().trim().trim_end_matches('.').to_owned()
}
