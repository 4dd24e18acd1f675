//! What is kept of trainings.

use crate::teaching::TeachingError;
use crate::teaching::store::{Store, moment, now_ms};
use roomsight_protocol::training::{TrainingInfo, TrainingState};
use rusqlite::{OptionalExtension, Row};
use std::sync::Arc;

/// The trainings that are told.
const MAX_TOLD: usize = 200;

/// The table of trainings.
pub struct Records(Arc<Store>);

impl Records {
    pub fn new(store: Arc<Store>) -> Self {
        Self(store)
    }

    /// Numbers a new training.
    pub fn add(&self, info: TrainingInfo) -> Result<TrainingInfo, TeachingError> {
        let connection = self.0.lock();
        connection.execute("INSERT INTO training (info) VALUES (?1)", [serde_json::to_string(&info)?])?;
        Ok(TrainingInfo { id: connection.last_insert_rowid(), ..info })
    }

    /// Keeps what is known of a training now.
    pub fn keep(&self, info: &TrainingInfo) -> Result<(), TeachingError> {
        let text = serde_json::to_string(info)?;
        self.0.lock().execute("UPDATE training SET info = ?2 WHERE id = ?1", (info.id, text))?;
        Ok(())
    }

    /// Those of late, the newest first.
    pub fn list(&self) -> Result<Vec<TrainingInfo>, TeachingError> {
        let connection = self.0.lock();
        let mut statement =
            connection.prepare_cached("SELECT id, info FROM training ORDER BY id DESC LIMIT ?1")?;
        let rows = statement.query_and_then([MAX_TOLD], info)?;
        rows.collect()
    }

    /// One of them.
    pub fn get(&self, id: i64) -> Result<TrainingInfo, TeachingError> {
        let query = "SELECT id, info FROM training WHERE id = ?1";
        let found = self.0.lock().query_row(query, [id], |row| Ok(info(row))).optional()?;
        found.unwrap_or_else(|| Err(TeachingError::Absent(format!("there is no training {id}"))))
    }

    /// Those that ran when the service ended have failed.
    pub fn fail_interrupted(&self) -> Result<(), TeachingError> {
        for info in self.list()? {
            if info.state == TrainingState::Running {
                let error = Some("the service was stopped while it ran; begin it again".to_owned());
                let ended_at = Some(moment(now_ms()));
                self.keep(&TrainingInfo { state: TrainingState::Failed, ended_at, error, ..info })?;
            }
        }
        Ok(())
    }
}

fn info(row: &Row) -> Result<TrainingInfo, TeachingError> {
    let (id, text): (i64, String) = (row.get(0)?, row.get(1)?);
    Ok(TrainingInfo { id, ..serde_json::from_str(&text)? })
}
