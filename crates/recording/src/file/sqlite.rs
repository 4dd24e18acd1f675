//! Databases of rosbag2: tables of topics and of messages, each of which may be packed.

use super::blocks::{Packing, Unpacked};
use super::{Contents, Entry, Index, Place, Span, ZSTD_MAGIC};
use crate::error::RecordingError;
use crate::topic::{Encoding, Topic};
use rusqlite::{Connection, OpenFlags, OptionalExtension};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A database.
#[derive(Debug)]
pub(crate) struct SqliteFile {
    path: PathBuf,
    connection: Mutex<Connection>,
    /// By the number that the database has for it.
    topic_of_row: HashMap<i64, usize>,
}

impl SqliteFile {
    /// Opens a database and finds what is in it.
    pub(super) fn open(path: &Path) -> Result<(Self, Contents), RecordingError> {
        let failed = failed(path);
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let connection = Connection::open_with_flags(path, flags).map_err(&failed)?;
        // Its schema is a stranger's.
        connection.pragma_update(None, "trusted_schema", false).map_err(&failed)?;
        let mut topics = Vec::new();
        let mut topic_of_row = HashMap::new();
        let mut read = || {
            let mut query =
                connection.prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id")?;
            let mut rows = query.query([])?;
            while let Some(row) = rows.next()? {
                topic_of_row.insert(row.get(0)?, topics.len());
                let encoding = Encoding::of(&row.get::<_, String>(3)?);
                topics.push(Topic { name: row.get(1)?, type_name: row.get(2)?, encoding, n_messages: None });
            }
            Ok(())
        };
        read().map_err(&failed)?;
        let file = Self { path: path.to_owned(), connection: Mutex::new(connection), topic_of_row };
        let (mut span, mut problems) = (None, Vec::new());
        let counted = file.each_message(|topic_idx, _, time_ns| {
            let n_messages = &mut topics[topic_idx].n_messages;
            *n_messages = Some(n_messages.unwrap_or_default() + 1);
            span = Some(Span::with(span, Span::at(time_ns)));
        });
        if let Err(error) = counted {
            problems.push(format!("it is damaged, and read up to there: {error}"));
        }
        Ok((file, Contents { topics, span, problems }))
    }

    fn lock(&self) -> MutexGuard<'_, Connection> {
        self.connection.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Calls `on_message` with the topic, the row and the time of each message.
    fn each_message(&self, mut on_message: impl FnMut(usize, i64, u64)) -> rusqlite::Result<()> {
        let connection = self.lock();
        let mut query = connection.prepare("SELECT topic_id, id, timestamp FROM messages")?;
        let mut rows = query.query([])?;
        while let Some(row) = rows.next()? {
            let Some(&topic_idx) = self.topic_of_row.get(&row.get(0)?) else { continue };
            let time_ns = u64::try_from(row.get::<_, i64>(2)?).unwrap_or_default();
            on_message(topic_idx, row.get(1)?, time_ns);
        }
        Ok(())
    }

    /// The messages of the topics that are wanted.
    pub(super) fn index(&self, wanted: &[bool]) -> Result<Index, RecordingError> {
        let mut index = Index::default();
        // What is wrong was told when the file was opened.
        let _ = self.each_message(|topic_idx, row, time_ns| {
            if wanted[topic_idx] {
                let place = Place { at: row.cast_unsigned(), within: None };
                index.entries.push(Entry { topic_idx, time_ns, place });
            }
        });
        Ok(index)
    }

    /// A message.
    pub(super) fn message(&self, place: Place) -> Result<Vec<u8>, RecordingError> {
        let query = "SELECT data FROM messages WHERE id = ?1";
        let row = self.lock().query_row(query, [place.at.cast_signed()], |row| row.get(0)).optional();
        let message: Option<Vec<u8>> = row.map_err(failed(&self.path))?;
        let damaged = |reason: String| RecordingError::Damaged { path: self.path.clone(), reason };
        let message = message.ok_or_else(|| damaged("a message is not there".to_owned()))?;
        // No message of CDR begins so.
        if !message.starts_with(ZSTD_MAGIC) {
            return Ok(message);
        }
        let Unpacked { bytes, cut } = Unpacked::from(&message, Packing::Zstd);
        cut.map_or(Ok(bytes), |reason| Err(damaged(format!("a message is damaged: {reason}"))))
    }
}

fn failed(path: &Path) -> impl Fn(rusqlite::Error) -> RecordingError + '_ {
    |error| RecordingError::Damaged { path: path.to_owned(), reason: error.to_string() }
}
