//! Data sets: folders `SET/ROOM/DRIVE/FRAME.jpg`, as `roomsight train` reads them.
//!
//! | file | what |
//! |---|---|
//! | `names` | how sets, rooms, drives and frames may be called |
//! | `folder` | what lies in a set's folder |
//! | `change` | moving files so that a change is done or not, and can be undone |
//! | `edit` | what people change: frames move, rooms get names |
//! | `add` | new frames |
//! | `advice` | what is missing |
//! | `check` | what is odd |
//!
//! The folders are the truth: what somebody copies there by hand counts too. The database has the changes that were
//! made here.

mod add;
mod advice;
mod change;
mod check;
mod edit;
mod folder;
mod names;

pub use add::NewFrame;
pub use names::{Place, check_room};

use super::TeachingError;
use super::pictures::type_of;
use super::store::Store;
use change::Journal;
use check::Check;
use folder::Found;
use names::{FramePath, check_set};
use roomsight_protocol::sets::{
    FrameList, FramesQuery, SetChange, SetDrive, SetFrame, SetInfo, SetList, SetRoom, SetSummary,
};
use roomsight_recognition::model::ELSEWHERE;
use roomsight_vision::image::Limits;
use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The folder of the sets, in the data directory.
const SETS_FOLDER: &str = "sets";
/// Frames of one answer, where the caller says nothing else.
const DEFAULT_LIMIT: usize = 200;
const MAX_LIMIT: usize = 1000;
/// Changes that are told with a set.
const N_CHANGES: usize = 20;

/// The data sets.
pub struct Sets {
    /// The data directory.
    data: PathBuf,
    journal: Journal,
    /// Held while files move: one change after the other.
    changing: Mutex<()>,
    limits: Limits,
    checks: Mutex<BTreeMap<String, Check>>,
}

/// A frame's file.
pub struct FrameFile {
    pub bytes: Vec<u8>,
    pub media_type: &'static str,
}

impl Sets {
    /// The sets of a data directory; changes that were begun are finished, and frames that were removed long ago go.
    ///
    /// # Errors
    /// A folder or a database that cannot be written.
    pub fn open(data: &Path, store: Arc<Store>, limits: Limits) -> Result<Self, TeachingError> {
        let root = data.join(SETS_FOLDER);
        fs::create_dir_all(&root).map_err(TeachingError::io(&root))?;
        let journal = Journal::new(data, store);
        journal.finish()?;
        journal.forget_old()?;
        let changing = Mutex::default();
        Ok(Self { data: data.to_owned(), journal, changing, limits, checks: Mutex::default() })
    }

    /// All sets, by name.
    ///
    /// # Errors
    /// A folder that cannot be read.
    pub fn list(&self) -> Result<SetList, TeachingError> {
        let mut names = Vec::new();
        let root = self.data.join(SETS_FOLDER);
        for entry in fs::read_dir(&root).map_err(TeachingError::io(&root))? {
            let path = entry.map_err(TeachingError::io(&root))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if check_set(&name).is_ok() && path.is_dir() {
                names.push(name);
            }
        }
        names.sort();
        let sets = names.iter().map(|name| self.summary(name)).collect::<Result<_, _>>()?;
        Ok(SetList { sets })
    }

    /// Makes a set; whether it is new.
    ///
    /// # Errors
    /// A name that is none, or that differs from another's in case alone.
    pub fn create(&self, name: &str) -> Result<bool, TeachingError> {
        check_set(name)?;
        let _changing = self.changing();
        let twin = self.list()?.sets.into_iter().find(|set| set.name.eq_ignore_ascii_case(name));
        match twin {
            Some(set) if set.name == name => return Ok(false),
            Some(set) => {
                return Err(TeachingError::Conflict(format!(
                    "there is a data set {:?}; give this one a name that differs by more than case",
                    set.name
                )));
            }
            None => {}
        }
        let folder = self.folder(name);
        match fs::create_dir(&folder) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(false),
            made => made.map(|()| true).map_err(TeachingError::io(&folder)),
        }
    }

    /// Takes a set away. Its folder is kept for a while among what was removed.
    ///
    /// # Errors
    /// No such set, or one that cannot be moved.
    pub fn remove(&self, name: &str) -> Result<(), TeachingError> {
        let _changing = self.changing();
        let folder = self.existing(name)?;
        let grave = self.journal.new_grave()?;
        fs::rename(&folder, grave.join(name)).map_err(TeachingError::io(&folder))?;
        self.checks().remove(name);
        Ok(())
    }

    /// A set in a line.
    ///
    /// # Errors
    /// No such set.
    pub fn summary(&self, name: &str) -> Result<SetSummary, TeachingError> {
        let found = self.found(name)?;
        let rooms: Vec<&str> = found.rooms().filter(|room| *room != ELSEWHERE).collect();
        Ok(SetSummary {
            name: name.to_owned(),
            rooms: rooms.len(),
            frames: found.frames.len(),
            bytes: found.n_bytes(),
            changed_at: self.journal.last(name, 1)?.pop().map(|change| change.at),
        })
    }

    /// A set: its rooms, what is missing, what was changed.
    ///
    /// # Errors
    /// No such set.
    pub fn show(&self, name: &str) -> Result<SetInfo, TeachingError> {
        let found = self.found(name)?;
        let mut rooms: Vec<SetRoom> = Vec::new();
        for room in found.rooms() {
            let mut drives: BTreeMap<&str, usize> = BTreeMap::new();
            for frame in found.of_room(room) {
                *drives.entry(&frame.drive).or_default() += 1;
            }
            let drive = |(name, frames): (&str, usize)| SetDrive { name: name.to_owned(), frames };
            let frames = drives.values().sum();
            rooms.push(SetRoom {
                name: room.to_owned(),
                frames,
                drives: drives.into_iter().map(drive).collect(),
            });
        }
        rooms.sort_by_key(|room| room.name == ELSEWHERE);
        let (bytes, left_out) = (found.n_bytes(), found.left_out);
        let changes = self.journal.last(name, N_CHANGES)?;
        Ok(SetInfo { name: name.to_owned(), bytes, advice: advice::advice(&rooms), rooms, left_out, changes })
    }

    /// Some of a set's frames.
    ///
    /// # Errors
    /// No such set.
    pub fn frames(&self, name: &str, query: &FramesQuery) -> Result<FrameList, TeachingError> {
        let found = self.found(name)?;
        let is_wanted = |frame: &&SetFrame| {
            query.room.as_ref().is_none_or(|room| *room == frame.room)
                && query.drive.as_ref().is_none_or(|drive| *drive == frame.drive)
        };
        let limit = query.limit.unwrap_or(DEFAULT_LIMIT).clamp(1, MAX_LIMIT);
        let total = found.frames.iter().filter(is_wanted).count();
        let after = query.after.as_deref().unwrap_or_default();
        let later = found.frames.iter().filter(is_wanted).filter(|frame| frame.path.as_str() > after);
        let mut frames: Vec<SetFrame> = later.take(limit + 1).cloned().collect();
        let has_more = frames.len() > limit;
        frames.truncate(limit);
        let next = frames.last().filter(|_| has_more).map(|last| last.path.clone());
        Ok(FrameList { total, frames, next })
    }

    /// A frame's picture.
    ///
    /// # Errors
    /// No such frame.
    pub fn picture(&self, name: &str, path: &str) -> Result<FrameFile, TeachingError> {
        let file = self.existing(name)?.join(FramePath::parse(path)?.as_str());
        let length = fs::metadata(&file).map(|metadata| metadata.len());
        let absent = || TeachingError::Absent(format!("there is no frame {path:?} in the data set {name:?}"));
        match length {
            Ok(length) if length > self.limits.max_bytes as u64 => Err(TeachingError::Invalid(format!(
                "the frame {path:?} has more than {} bytes",
                self.limits.max_bytes
            ))),
            Ok(_) => {
                let bytes = fs::read(&file).map_err(|_| absent())?;
                Ok(FrameFile { media_type: type_of(&bytes).media_type, bytes })
            }
            Err(_) => Err(absent()),
        }
    }

    /// Deletes what was removed long ago.
    ///
    /// # Errors
    /// A folder that cannot be read.
    pub fn tidy(&self) -> Result<(), TeachingError> {
        self.journal.forget_old()
    }

    /// Undoes a change.
    ///
    /// # Errors
    /// No such change, one that was undone, or later ones that stand in its way.
    pub fn undo(&self, name: &str, id: i64) -> Result<SetChange, TeachingError> {
        let _changing = self.changing();
        self.existing(name)?;
        self.journal.undo(name, id)
    }

    /// Where a set lies.
    ///
    /// # Errors
    /// No such set.
    pub fn existing(&self, name: &str) -> Result<PathBuf, TeachingError> {
        check_set(name)?;
        let folder = self.folder(name);
        if folder.is_dir() {
            Ok(folder)
        } else {
            Err(TeachingError::Absent(format!("there is no data set {name:?}; GET /v1/sets lists them")))
        }
    }

    fn folder(&self, name: &str) -> PathBuf {
        self.data.join(SETS_FOLDER).join(name)
    }

    fn found(&self, name: &str) -> Result<Found, TeachingError> {
        folder::read(&self.existing(name)?)
    }

    fn changing(&self) -> MutexGuard<'_, ()> {
        self.changing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn checks(&self) -> MutexGuard<'_, BTreeMap<String, Check>> {
        self.checks.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests;
