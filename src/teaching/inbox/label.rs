//! What people say of frames.

use super::{COLUMNS, Inbox, Kept, absent, kept};
use crate::teaching::sets::Place;
use crate::teaching::store::{moment, now_ms};
use crate::teaching::{TeachingError, Who};
use chrono::DateTime;
use roomsight_protocol::inbox::{
    InboxFrame, InboxLabel, LabelConflict, LabeledFrames, LabelsJson, SeenFrame,
};
use std::path::{Path, PathBuf};

/// The most frames that one call labels.
const MAX_FRAMES: usize = 1000;

impl Inbox {
    /// Labels frames: they come into a data set, where they can be moved and undone as all others. A frame that somebody else
    /// has labelled since it was seen is left as it is.
    ///
    /// # Errors
    /// Names that cannot be, a disk that is full: nothing is labelled then.
    pub fn label(&self, who: Who, wanted: &LabelsJson) -> Result<LabeledFrames, TeachingError> {
        check_number(wanted.frames.len())?;
        let at = now_ms();
        let drive = wanted.drive.clone().unwrap_or_else(|| {
            let day = DateTime::from_timestamp_millis(at).unwrap_or_default();
            format!("inbox-{}", day.format("%Y-%m-%d"))
        });
        let place = Place::new(&wanted.room, Some(&drive))?;
        let _changing = self.changing();
        let mut result = LabeledFrames { labeled: Vec::new(), conflicts: Vec::new(), change: None };
        let mut frames = Vec::new();
        for seen in &wanted.frames {
            match self.as_seen(seen)? {
                Ok(kept) => frames.push(kept),
                Err(conflict) => result.conflicts.push(conflict),
            }
        }
        if frames.is_empty() {
            return Ok(result);
        }
        self.sets.create(&wanted.set)?;
        let files: Vec<PathBuf> = frames.iter().map(|frame| self.path_of(&frame.content)).collect();
        let files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
        let added = self.sets.add_kept(&wanted.set, who, &place, &files)?;
        let mut connection = self.store.lock();
        let transaction = connection.transaction()?;
        for (Kept { frame, .. }, path) in frames.into_iter().zip(added.paths) {
            let (set, room, by) = (wanted.set.clone(), place.room.clone(), who.0.to_owned());
            let label = Some(InboxLabel { set, room, path, by, at: moment(at) });
            let frame = InboxFrame { label, revision: frame.revision + 1, ..frame };
            let update = "UPDATE inbox_frame SET is_labeled = 1, revision = ?2, info = ?3 WHERE id = ?1";
            transaction.execute(update, (frame.id, frame.revision, serde_json::to_string(&frame)?))?;
            result.labeled.push(frame);
        }
        transaction.commit()?;
        result.change = added.change;
        Ok(result)
    }

    /// Throws frames away that teach nothing; those that changed since they were seen stay. How many went.
    ///
    /// # Errors
    /// A database that cannot be written.
    pub fn discard(&self, frames: &[SeenFrame]) -> Result<usize, TeachingError> {
        check_number(frames.len())?;
        let _changing = self.changing();
        let mut gone = Vec::new();
        for seen in frames {
            gone.extend(self.as_seen(seen)?.ok());
        }
        self.delete(&gone)?;
        Ok(gone.len())
    }

    /// Takes labels away whose frames are no longer in their data set, since that change was undone.
    ///
    /// # Errors
    /// A database that cannot be written.
    pub fn forget_labels(&self, set: &str) -> Result<(), TeachingError> {
        let _changing = self.changing();
        let folder = self.sets.existing(set)?;
        let labeled: Vec<Kept> = {
            let connection = self.store.lock();
            let select = format!("SELECT {COLUMNS} FROM inbox_frame WHERE is_labeled = 1");
            let mut statement = connection.prepare_cached(&select)?;
            let rows = statement.query_and_then([], kept)?;
            rows.collect::<Result<_, _>>()?
        };
        for Kept { frame, .. } in labeled {
            let is_gone = |label: &InboxLabel| label.set == set && !folder.join(&label.path).is_file();
            if frame.label.as_ref().is_some_and(is_gone) {
                let frame = InboxFrame { label: None, revision: frame.revision + 1, ..frame };
                let update = "UPDATE inbox_frame SET is_labeled = 0, revision = ?2, info = ?3 WHERE id = ?1";
                let info = serde_json::to_string(&frame)?;
                self.store.lock().execute(update, (frame.id, frame.revision, info))?;
            }
        }
        Ok(())
    }

    /// The frame, if it is as somebody has seen it and has no label; else what stands in the way.
    fn as_seen(&self, seen: &SeenFrame) -> Result<Result<Kept, LabelConflict>, TeachingError> {
        let conflict = |label, reason: String| Ok(Err(LabelConflict { id: seen.id, label, reason }));
        match self.get(seen.id)? {
            None => conflict(None, absent(seen.id).to_string()),
            Some(Kept { frame: InboxFrame { label: Some(label), .. }, .. }) => {
                let reason = format!("{} has labelled it as {} already", label.by, label.room);
                conflict(Some(label), reason)
            }
            Some(Kept { frame, .. }) if frame.revision != seen.revision => {
                conflict(None, "it was changed since it was seen; look again".to_owned())
            }
            Some(kept) => Ok(Ok(kept)),
        }
    }
}

fn check_number(n_frames: usize) -> Result<(), TeachingError> {
    if (1..=MAX_FRAMES).contains(&n_frames) {
        return Ok(());
    }
    Err(TeachingError::Invalid(format!("name from 1 to {MAX_FRAMES} frames")))
}
