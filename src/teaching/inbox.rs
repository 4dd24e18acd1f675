//! The inbox: frames that the model doubted, which wait for a person to say what they show.
//!
//! | file | what |
//! |---|---|
//! | `keep` | frames come in, and old ones go |
//! | `list` | what is asked for |
//! | `label` | what people say of frames |
//!
//! It is a ring: rows in the database and pictures as files, named by their content, within the bounds of a rule that people
//! set. It keeps nothing until they do.

mod keep;
mod label;
mod list;

use super::TeachingError;
use super::sets::{FrameFile, Sets};
use super::store::{Clock, Store};
use crate::teaching::pictures::type_of;
use roomsight_protocol::inbox::{InboxFrame, InboxRule};
use rusqlite::{OptionalExtension, Row};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The folder of the pictures, in the data directory.
const INBOX_FOLDER: &str = "inbox";
/// The name of the rule in the database.
const RULE: &str = "inbox";

/// The bounds of what a rule may say.
const MAX_FRAMES: u64 = 100_000;
const LEAST_BYTES: u64 = 1_000_000;
const MAX_DAYS: u32 = 3650;
const MAX_NAMES: usize = 1000;

/// The inbox of a data directory.
pub struct Inbox {
    folder: PathBuf,
    store: Arc<Store>,
    sets: Arc<Sets>,
    /// Held while frames come, go and get labels.
    changing: Mutex<()>,
    clock: Clock,
}

/// How much there is in the inbox.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InboxSize {
    pub frames: u64,
    pub bytes: u64,
    /// Those without a label.
    pub open: u64,
    pub open_bytes: u64,
}

/// A frame as it is kept.
struct Kept {
    frame: InboxFrame,
    /// The name of its file.
    content: String,
}

impl Inbox {
    /// That of a data directory.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn open(data: &Path, store: Arc<Store>, sets: Arc<Sets>) -> Result<Self, TeachingError> {
        let folder = data.join(INBOX_FOLDER);
        fs::create_dir_all(&folder).map_err(TeachingError::io(&folder))?;
        Ok(Self { folder, store, sets, changing: Mutex::default(), clock: Clock::now() })
    }

    /// Which frames are kept.
    ///
    /// # Errors
    /// A database that cannot be read.
    pub fn rule(&self) -> Result<InboxRule, TeachingError> {
        self.store.rule(RULE)
    }

    /// Lets other frames be kept; those that are beyond the new bounds go.
    ///
    /// # Errors
    /// A rule that makes no sense.
    pub fn set_rule(&self, rule: &InboxRule) -> Result<(), TeachingError> {
        let wrong = |text: String| Err(TeachingError::Invalid(text));
        if !(0.0..=86_400.0).contains(&rule.every_s) {
            return wrong("`every_s` must be from 0 to 86400".to_owned());
        }
        if !(0.0..=1.0).contains(&rule.probability) {
            return wrong("`probability` must be from 0 to 1".to_owned());
        }
        if !(1..=MAX_FRAMES).contains(&rule.max_frames) {
            return wrong(format!("`max_frames` must be from 1 to {MAX_FRAMES}"));
        }
        if rule.max_bytes < LEAST_BYTES {
            return wrong(format!("`max_bytes` must be at least {LEAST_BYTES}"));
        }
        if !(1..=MAX_DAYS).contains(&rule.max_days) {
            return wrong(format!("`max_days` must be from 1 to {MAX_DAYS}"));
        }
        if rule.robots.len() + rule.keys.len() > MAX_NAMES {
            return wrong(format!("it names more than {MAX_NAMES} robots and keys"));
        }
        self.store.set_rule(RULE, rule)?;
        self.make_room(rule)
    }

    /// A frame's picture.
    ///
    /// # Errors
    /// No such frame.
    pub fn picture(&self, id: i64) -> Result<FrameFile, TeachingError> {
        let Kept { content, .. } = self.get(id)?.ok_or_else(|| absent(id))?;
        let path = self.path_of(&content);
        let bytes = fs::read(&path).map_err(TeachingError::io(&path))?;
        Ok(FrameFile { media_type: type_of(&bytes).media_type, bytes })
    }

    fn get(&self, id: i64) -> Result<Option<Kept>, TeachingError> {
        let query = format!("SELECT {COLUMNS} FROM inbox_frame WHERE id = ?1");
        let found = self.store.lock().query_row(&query, [id], |row| Ok(kept(row))).optional()?;
        found.transpose()
    }

    /// Where a picture lies, by its name.
    fn path_of(&self, content: &str) -> PathBuf {
        self.folder.join(content.get(..2).unwrap_or_default()).join(content)
    }

    fn changing(&self) -> MutexGuard<'_, ()> {
        self.changing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What [`kept`] reads.
const COLUMNS: &str = "id, revision, content, info";

fn kept(row: &Row) -> Result<Kept, TeachingError> {
    let info: String = row.get(3)?;
    let frame: InboxFrame = serde_json::from_str(&info)?;
    Ok(Kept { frame: InboxFrame { id: row.get(0)?, revision: row.get(1)?, ..frame }, content: row.get(2)? })
}

fn absent(id: i64) -> TeachingError {
    TeachingError::Absent(format!("the inbox has no frame {id} (any more)"))
}

#[cfg(test)]
mod tests;
