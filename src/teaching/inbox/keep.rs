//! Frames come in, and old ones go.

use super::{COLUMNS, Inbox, InboxSize, Kept, kept};
use crate::engine::doubts::DoubtedFrame;
use crate::teaching::TeachingError;
use crate::teaching::pictures::file_name;
use crate::teaching::store::{moment, now_ms};
use roomsight_protocol::inbox::{Doubt, InboxFrame, InboxRule};
use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::path::Path;

const MS_A_DAY: i64 = 24 * 3600 * 1000;

impl Inbox {
    /// Takes a frame in; older ones go where there is no room.
    ///
    /// # Errors
    /// A disk that is full.
    pub fn keep(&self, doubted: DoubtedFrame) -> Result<InboxFrame, TeachingError> {
        let _changing = self.changing();
        let content = file_name(&doubted.bytes);
        let path = self.path_of(&content);
        write_once(&path, &doubted.bytes)?;
        let at = now_ms();
        let DoubtedFrame { bytes, robot, key, answer, filtered_room, shadow_room, reasons, value, said } =
            doubted;
        let frame = InboxFrame {
            id: 0,
            at: moment(at),
            robot,
            key,
            room: answer.room,
            known: answer.known,
            unknown: answer.unknown,
            probability: answer.probability,
            probabilities: answer.probabilities,
            novelty: answer.novelty,
            filtered_room,
            shadow_room,
            reasons,
            value,
            model: answer.model,
            revision: 0,
            label: None,
            said,
        };
        let insert = "INSERT INTO inbox_frame (at, robot, room, content, bytes, reasons, value, info) \
            VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)";
        let (words, info) = (words(&frame.reasons)?, serde_json::to_string(&frame)?);
        let id = {
            let connection = self.store.lock();
            let (robot, room) = (&frame.robot, &frame.room);
            connection.execute(insert, (at, robot, room, &content, bytes.len(), words, value, info))?;
            connection.last_insert_rowid()
        };
        self.make_room_for(&self.rule()?, at)?;
        Ok(InboxFrame { id, ..frame })
    }

    /// Deletes what is too old by the rule.
    ///
    /// # Errors
    /// A database that cannot be written.
    pub fn tidy(&self) -> Result<(), TeachingError> {
        self.make_room(&self.rule()?)
    }

    /// Deletes what is beyond the bounds of a rule.
    pub(super) fn make_room(&self, rule: &InboxRule) -> Result<(), TeachingError> {
        let _changing = self.changing();
        self.make_room_for(rule, now_ms())
    }

    /// Deletes frames that are too old, and frames beyond the bounds: those without a label first, the oldest first.
    pub(super) fn make_room_for(&self, rule: &InboxRule, now: i64) -> Result<(), TeachingError> {
        // A clock that jumps makes nothing old.
        if self.clock.is_steady(now) {
            let oldest = now - i64::from(rule.max_days) * MS_A_DAY;
            let too_old = self.select("WHERE at < ?1", &[&oldest])?;
            self.delete(&too_old)?;
        }
        loop {
            let InboxSize { frames, bytes, .. } = self.size()?;
            if frames <= rule.max_frames && bytes <= rule.max_bytes || frames == 0 {
                return Ok(());
            }
            let n_over = frames.saturating_sub(rule.max_frames).max(1);
            let first = self.select("ORDER BY is_labeled, at, id LIMIT ?1", &[&n_over])?;
            self.delete(&first)?;
        }
    }

    /// How many frames there are, and how many bytes they take.
    ///
    /// # Errors
    /// A database that cannot be read.
    pub fn size(&self) -> Result<InboxSize, TeachingError> {
        let query = "SELECT COUNT(*), COALESCE(SUM(bytes), 0), COALESCE(SUM(is_labeled = 0), 0), \
            COALESCE(SUM(bytes * (is_labeled = 0)), 0) FROM inbox_frame";
        let size = |row: &rusqlite::Row| {
            let [frames, bytes] = [row.get(0)?, row.get(1)?];
            Ok(InboxSize { frames, bytes, open: row.get(2)?, open_bytes: row.get(3)? })
        };
        Ok(self.store.lock().query_row(query, [], size)?)
    }

    fn select(&self, rest: &str, values: &[&dyn rusqlite::ToSql]) -> Result<Vec<Kept>, TeachingError> {
        let connection = self.store.lock();
        let mut statement =
            connection.prepare_cached(&format!("SELECT {COLUMNS} FROM inbox_frame {rest}"))?;
        let rows = statement.query_and_then(values, kept)?;
        rows.collect()
    }

    /// Deletes frames, and the pictures that no other frame has. Whoever calls this holds `changing`.
    pub(super) fn delete(&self, frames: &[Kept]) -> Result<(), TeachingError> {
        if frames.is_empty() {
            return Ok(());
        }
        {
            let mut connection = self.store.lock();
            let transaction = connection.transaction()?;
            for Kept { frame, .. } in frames {
                transaction.execute("DELETE FROM inbox_frame WHERE id = ?1", [frame.id])?;
            }
            transaction.commit()?;
        }
        for Kept { content, .. } in frames {
            let query = "SELECT EXISTS (SELECT 1 FROM inbox_frame WHERE content = ?1)";
            let is_used: bool = self.store.lock().query_row(query, [content], |row| row.get(0))?;
            if !is_used {
                // One that cannot be deleted only takes room.
                let _ = fs::remove_file(self.path_of(content));
            }
        }
        Ok(())
    }
}

/// Writes a picture where it is not there yet; it is whole when it has its name.
fn write_once(path: &Path, bytes: &[u8]) -> Result<(), TeachingError> {
    if path.is_file() {
        return Ok(());
    }
    let folder = path.parent().unwrap_or(path);
    let write = || {
        fs::create_dir_all(folder)?;
        let mut file = tempfile::NamedTempFile::new_in(folder)?;
        file.write_all(bytes)?;
        file.as_file().sync_all()?;
        match file.persist_noclobber(path) {
            Err(error) if error.error.kind() != ErrorKind::AlreadyExists => return Err(error.error),
            _ => {}
        }
        File::open(folder)?.sync_all()
    };
    write().map_err(TeachingError::io(path))
}

/// Reasons as they are kept: separated by commas, with one at both ends.
fn words(reasons: &[Doubt]) -> Result<String, TeachingError> {
    let mut text = ",".to_owned();
    for reason in reasons {
        text += serde_json::to_value(reason)?.as_str().unwrap_or_default();
        text.push(',');
    }
    Ok(text)
}
