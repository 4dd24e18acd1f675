//! Trainings: each a process of its own, one at a time, whose model serves nobody until somebody says so.
//!
//! | file | what |
//! |---|---|
//! | `run` | the process, what it says, how it ends |
//! | `records` | what is kept of trainings |
//! | `publish` | a trained model becomes a version |
//! | `policy` | what follows from labels by itself |

mod policy;
mod publish;
mod records;
mod run;

pub use publish::Trainer;

use super::TeachingError;
use super::command::Stop;
use super::sets::Sets;
use super::store::Store;
use records::Records;
use roomsight_protocol::training::{TrainingInfo, TrainingList};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The folder of what trainings write, in the data directory.
const TRAININGS_FOLDER: &str = "trainings";
/// The model, in a training's folder.
const MODEL_FOLDER: &str = "model";
/// What the command printed.
const REPORT_FILE: &str = "report.json";
/// What the command said.
const LOG_FILE: &str = "log.txt";
/// The last lines of a log that are told.
const MAX_LOG_LINES: usize = 500;

/// The trainings of a data directory.
pub struct Trainings {
    folder: PathBuf,
    records: Records,
    store: Arc<Store>,
    sets: Arc<Sets>,
    running: Mutex<Option<Running>>,
}

/// The training that is under way.
struct Running {
    info: TrainingInfo,
    stop: Stop,
    is_cancelled: bool,
    log: Vec<String>,
}

impl Trainings {
    /// Those of a data directory. One that ran when the service was stopped has failed.
    ///
    /// # Errors
    /// A folder or a database that cannot be written.
    pub fn open(data: &Path, store: Arc<Store>, sets: Arc<Sets>) -> Result<Self, TeachingError> {
        let folder = data.join(TRAININGS_FOLDER);
        fs::create_dir_all(&folder).map_err(TeachingError::io(&folder))?;
        let records = Records::new(store.clone());
        records.fail_interrupted()?;
        Ok(Self { folder, records, store, sets, running: Mutex::default() })
    }

    /// All trainings, the newest first.
    ///
    /// # Errors
    /// A database that cannot be read.
    pub fn list(&self) -> Result<TrainingList, TeachingError> {
        let mut trainings = self.records.list()?;
        if let Some(running) = &*self.running()
            && let Some(info) = trainings.iter_mut().find(|info| info.id == running.info.id)
        {
            *info = running.info.clone();
        }
        Ok(TrainingList { trainings })
    }

    /// A training with its log and, when it is done, its report.
    ///
    /// # Errors
    /// No such training.
    pub fn show(&self, id: i64) -> Result<TrainingInfo, TeachingError> {
        if let Some(running) = &*self.running()
            && running.info.id == id
        {
            return Ok(TrainingInfo { log: Some(running.log.clone()), ..running.info.clone() });
        }
        let info = self.records.get(id)?;
        let read = |file: &str| fs::read_to_string(self.folder_of(id).join(file)).ok();
        let log = read(LOG_FILE).map(|log| log.lines().map(str::to_owned).collect());
        let report = read(REPORT_FILE).and_then(|report| serde_json::from_str(&report).ok());
        Ok(TrainingInfo { log, report, ..info })
    }

    /// Ends a training that runs.
    ///
    /// # Errors
    /// No such training, or one that has ended.
    pub fn cancel(&self, id: i64) -> Result<TrainingInfo, TeachingError> {
        let mut running = self.running();
        match running.as_mut().filter(|running| running.info.id == id) {
            Some(running) => {
                running.is_cancelled = true;
                running.stop.now();
                Ok(running.info.clone())
            }
            None => {
                self.records.get(id)?;
                Err(TeachingError::Conflict(format!("the training {id} has ended")))
            }
        }
    }

    /// Whether one runs.
    pub fn is_busy(&self) -> bool {
        self.running().is_some()
    }

    /// Ends what runs, since the service stops.
    pub fn stop(&self) {
        if let Some(running) = &*self.running() {
            running.stop.now();
        }
    }

    fn folder_of(&self, id: i64) -> PathBuf {
        self.folder.join(id.to_string())
    }

    fn running(&self) -> MutexGuard<'_, Option<Running>> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
