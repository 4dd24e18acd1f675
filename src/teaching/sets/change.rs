//! Moving files so that a change is done or not, whenever the process ends, and can be undone.
//!
//! A change is written down with all its moves before the first file moves; at the next start one that was begun is
//! finished. What is taken out of a set moves to a grave, a folder below `removed/`; what comes into one is laid into
//! a grave first. So undoing a change is moving everything back.

use super::names::as_text;
use crate::teaching::store::{Store, moment, now_ms};
use crate::teaching::{TeachingError, Who};
use roomsight_protocol::sets::SetChange;
use rusqlite::{OptionalExtension, Row};
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

/// The folder of graves, in the data directory.
const REMOVED_FOLDER: &str = "removed";

/// How long what was removed can be brought back.
const KEPT_FOR: Duration = Duration::from_secs(30 * 24 * 3600);

/// A file moves. Paths are in the data directory.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Move {
    pub from: String,
    pub to: String,
}

/// What is to be changed.
pub struct Planned<'a> {
    pub set: &'a str,
    pub action: &'static str,
    /// What is done, for people.
    pub text: String,
    pub moves: Vec<Move>,
}

/// The changes of all sets.
pub struct Journal {
    data: PathBuf,
    store: Arc<Store>,
}

/// How far a change has come.
#[derive(Clone, Copy)]
enum State {
    Begun,
    Done,
    Undoing,
    Undone,
}

impl State {
    fn word(self) -> &'static str {
        match self {
            Self::Begun => "begun",
            Self::Done => "done",
            Self::Undoing => "undoing",
            Self::Undone => "undone",
        }
    }
}

/// A change as it is written down.
struct Written {
    change: SetChange,
    moves: Vec<Move>,
    state: String,
}

const SELECT: &str = "SELECT id, at, who, action, text, frames, state, moves FROM set_change";

impl Journal {
    pub fn new(data: &Path, store: Arc<Store>) -> Self {
        Self { data: data.to_owned(), store }
    }

    /// A new folder outside of all sets.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn new_grave(&self) -> Result<PathBuf, TeachingError> {
        let root = self.data.join(REMOVED_FOLDER);
        fs::create_dir_all(&root).map_err(TeachingError::io(&root))?;
        let prefix = format!("{}-", now_ms());
        let grave = tempfile::Builder::new().prefix(&prefix).tempdir_in(&root);
        Ok(grave.map_err(TeachingError::io(&root))?.keep())
    }

    /// A path in the data directory, as it is written down.
    pub fn relative(&self, path: &Path) -> String {
        as_text(path.strip_prefix(&self.data).unwrap_or(path))
    }

    /// Makes a change.
    ///
    /// # Errors
    /// A file that cannot be moved: all is as it was then.
    pub fn make(&self, who: Who, planned: Planned) -> Result<SetChange, TeachingError> {
        let Planned { set, action, text, moves } = planned;
        let insert = "INSERT INTO set_change (set_name, at, who, action, text, frames, moves, state) \
            VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)";
        let (at, json) = (now_ms(), serde_json::to_string(&moves)?);
        let id = {
            let connection = self.store.lock();
            let frames = moves.len();
            connection.execute(insert, (set, at, who.0, action, &text, frames, json, State::Begun.word()))?;
            connection.last_insert_rowid()
        };
        if let Err(error) = self.carry_out(&moves) {
            self.store.lock().execute("DELETE FROM set_change WHERE id = ?1", [id])?;
            return Err(error);
        }
        self.enter(id, State::Done)?;
        let (by, action) = (who.0.to_owned(), action.to_owned());
        Ok(SetChange { id, at: moment(at), by, action, text, frames: moves.len(), undone: false })
    }

    /// Undoes a change.
    ///
    /// # Errors
    /// No such change, or files that are not where it left them.
    pub fn undo(&self, set: &str, id: i64) -> Result<SetChange, TeachingError> {
        let query = format!("{SELECT} WHERE set_name = ?1 AND id = ?2");
        let written = self.store.lock().query_row(&query, (set, id), written).optional()?;
        let Written { change, moves, .. } = written
            .transpose()?
            .ok_or_else(|| TeachingError::Absent(format!("the data set {set:?} has no change {id}")))?;
        if change.undone {
            return Err(TeachingError::Conflict(format!("the change {id} was undone already")));
        }
        let back = reversed(&moves);
        if let Some(gone) = back.iter().find(|step| !self.data.join(&step.from).is_file()) {
            let name = gone.from.rsplit('/').next().unwrap_or_default();
            return Err(TeachingError::Conflict(format!(
                "the frame {name:?} was changed since: undo the later changes first"
            )));
        }
        self.enter(id, State::Undoing)?;
        if let Err(error) = self.carry_out(&back) {
            self.enter(id, State::Done)?;
            return Err(error);
        }
        self.enter(id, State::Undone)?;
        Ok(SetChange { undone: true, ..change })
    }

    /// The last changes of a set, the newest first.
    ///
    /// # Errors
    /// A database that cannot be read.
    pub fn last(&self, set: &str, n_changes: usize) -> Result<Vec<SetChange>, TeachingError> {
        let query = format!("{SELECT} WHERE set_name = ?1 ORDER BY id DESC LIMIT ?2");
        let connection = self.store.lock();
        let mut statement = connection.prepare_cached(&query)?;
        let rows = statement.query_map((set, n_changes), written)?;
        rows.map(|row| Ok(row??.change)).collect()
    }

    /// Finishes the changes that a process began which was killed.
    ///
    /// # Errors
    /// A database that cannot be written. What cannot be moved is told by the log.
    pub fn finish(&self) -> Result<(), TeachingError> {
        let query = format!("{SELECT} WHERE state IN ('begun', 'undoing') ORDER BY id");
        let open: Vec<Written> = {
            let connection = self.store.lock();
            let mut statement = connection.prepare(&query)?;
            let rows = statement.query_map([], written)?;
            rows.map(|row| row?).collect::<Result<_, TeachingError>>()?
        };
        for Written { change, moves, state } in open {
            let (moves, end) = if state == State::Begun.word() {
                (moves, State::Done)
            } else {
                (reversed(&moves), State::Undone)
            };
            let left: Vec<Move> =
                moves.into_iter().filter(|step| self.data.join(&step.from).is_file()).collect();
            if let Err(error) = self.carry_out(&left) {
                tracing::error!(change = change.id, %error, "a change that was begun cannot be finished");
            }
            self.enter(change.id, end)?;
        }
        Ok(())
    }

    /// Deletes what was removed long ago.
    ///
    /// # Errors
    /// A folder that cannot be read.
    pub fn forget_old(&self) -> Result<(), TeachingError> {
        let root = self.data.join(REMOVED_FOLDER);
        let entries = match fs::read_dir(&root) {
            Ok(entries) => entries,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(TeachingError::io(&root)(error)),
        };
        for entry in entries.filter_map(Result::ok) {
            let modified = entry.metadata().and_then(|metadata| metadata.modified());
            let age = modified.map(|modified| SystemTime::now().duration_since(modified));
            // A clock that was set back makes nothing old.
            if matches!(age, Ok(Ok(age)) if age > KEPT_FOR) {
                // What cannot be deleted only takes room.
                let _ = fs::remove_dir_all(entry.path());
            }
        }
        Ok(())
    }

    /// Moves all files, or none.
    fn carry_out(&self, moves: &[Move]) -> Result<(), TeachingError> {
        for (idx, step) in moves.iter().enumerate() {
            if let Err(error) = self.carry(step) {
                for done in reversed(&moves[..idx]) {
                    if let Err(error) = self.carry(&done) {
                        tracing::error!(frame = done.to, %error, "a frame cannot be moved back");
                    }
                }
                return Err(error);
            }
        }
        Ok(())
    }

    fn carry(&self, Move { from, to }: &Move) -> Result<(), TeachingError> {
        let (from, to) = (self.data.join(from), self.data.join(to));
        if let Some(folder) = to.parent() {
            fs::create_dir_all(folder).map_err(TeachingError::io(folder))?;
        }
        if to.symlink_metadata().is_ok() {
            let taken = io::Error::from(ErrorKind::AlreadyExists);
            return Err(TeachingError::io(&to)(taken));
        }
        fs::rename(&from, &to).map_err(TeachingError::io(&from))?;
        if let Some(folder) = to.parent() {
            // The name is on the disk before the change counts as done.
            let _ = File::open(folder).and_then(|folder| folder.sync_all());
        }
        self.tidy(&from);
        Ok(())
    }

    /// Removes the folders that a file leaves empty, up to the set's own.
    fn tidy(&self, file: &Path) {
        let mut folder = file.parent();
        while let Some(path) = folder {
            let depth = path.strip_prefix(&self.data).map_or(0, |inside| inside.components().count());
            if depth <= 2 || fs::remove_dir(path).is_err() {
                return;
            }
            folder = path.parent();
        }
    }

    fn enter(&self, id: i64, state: State) -> Result<(), TeachingError> {
        self.store.lock().execute("UPDATE set_change SET state = ?2 WHERE id = ?1", (id, state.word()))?;
        Ok(())
    }
}

fn reversed(moves: &[Move]) -> Vec<Move> {
    moves.iter().rev().map(|Move { from, to }| Move { from: to.clone(), to: from.clone() }).collect()
}

/// Reads a row of [`SELECT`].
fn written(row: &Row) -> rusqlite::Result<Result<Written, TeachingError>> {
    let (state, moves): (String, String) = (row.get(6)?, row.get(7)?);
    let change = SetChange {
        id: row.get(0)?,
        at: moment(row.get(1)?),
        by: row.get(2)?,
        action: row.get(3)?,
        text: row.get(4)?,
        frames: row.get(5)?,
        undone: state == State::Undone.word(),
    };
    Ok(serde_json::from_str(&moves).map(|moves| Written { change, moves, state }).map_err(Into::into))
}
