//! The database of the data directory: one file of SQLite.

use super::TeachingError;
use chrono::{DateTime, SecondsFormat};
use rusqlite::{Connection, OptionalExtension, backup};
use rusqlite_migration::{M, Migrations};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};

/// Its file, in the data directory.
pub const DATABASE_FILE: &str = "roomsight.db";

/// Each brings the database from one version to the next; none is ever changed.
const MIGRATIONS: &[M] = &[M::up(include_str!("store/1.sql"))];

/// How long another process, which makes a backup, may hold the database.
const PATIENCE: Duration = Duration::from_secs(10);

/// Pages that a backup copies at a time; between them others may write.
const BACKUP_PAGES: i32 = 256;

/// The database.
pub struct Store(Mutex<Connection>);

impl Store {
    /// Opens the database of a data directory, and brings it up to date.
    ///
    /// # Errors
    /// A file that cannot be written, is none of a database, or is of a newer version.
    pub fn open(folder: &Path) -> Result<Self, TeachingError> {
        let mut connection = Connection::open(folder.join(DATABASE_FILE))?;
        connection.busy_timeout(PATIENCE)?;
        connection.pragma_update(None, "journal_mode", "WAL")?;
        // What is acknowledged is on the disk.
        connection.pragma_update(None, "synchronous", "FULL")?;
        connection.pragma_update(None, "foreign_keys", true)?;
        Migrations::from_slice(MIGRATIONS).to_latest(&mut connection)?;
        Ok(Self(Mutex::new(connection)))
    }

    /// The connection, for as long as others may wait for it.
    pub fn lock(&self) -> MutexGuard<'_, Connection> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What people have set under a name, or the default.
    pub fn rule<T: DeserializeOwned + Default>(&self, name: &str) -> Result<T, TeachingError> {
        let query = "SELECT value FROM rule WHERE name = ?1";
        let text: Option<String> = self.lock().query_row(query, [name], |row| row.get(0)).optional()?;
        text.map_or_else(|| Ok(T::default()), |text| Ok(serde_json::from_str(&text)?))
    }

    /// Sets it.
    pub fn set_rule(&self, name: &str, value: &impl Serialize) -> Result<(), TeachingError> {
        let text = serde_json::to_string(value)?;
        let insert = "INSERT OR REPLACE INTO rule (name, value) VALUES (?1, ?2)";
        self.lock().execute(insert, (name, text))?;
        Ok(())
    }

    /// Copies the database of a data directory, which a service may use meanwhile, into a new file.
    ///
    /// # Errors
    /// A database that cannot be read, a file that cannot be written.
    pub fn back_up(folder: &Path, into: &Path) -> Result<(), TeachingError> {
        let path = folder.join(DATABASE_FILE);
        // SQLite would make an empty one.
        fs::metadata(&path).map_err(TeachingError::io(&path))?;
        let from = Connection::open(&path)?;
        from.busy_timeout(PATIENCE)?;
        let mut to = Connection::open(into)?;
        let copying = backup::Backup::new(&from, &mut to)?;
        Ok(copying.run_to_completion(BACKUP_PAGES, Duration::ZERO, None)?)
    }
}

/// The system's clock beside one that nobody sets.
pub struct Clock {
    began: Instant,
    began_ms: i64,
}

impl Clock {
    /// From now on.
    pub fn now() -> Self {
        Self { began: Instant::now(), began_ms: now_ms() }
    }

    /// Whether the system's clock, which says this, has moved as time did, by a day at most.
    pub fn is_steady(&self, now_ms: i64) -> bool {
        let passed_ms = i64::try_from(self.began.elapsed().as_millis()).unwrap_or(i64::MAX);
        let expected_ms = self.began_ms.saturating_add(passed_ms);
        now_ms.abs_diff(expected_ms) < 24 * 3600 * 1000
    }
}

/// The time, in milliseconds since 1970.
pub fn now_ms() -> i64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_millis()).unwrap_or(i64::MAX)
}

/// A time in milliseconds since 1970, by RFC 3339.
pub fn moment(ms: i64) -> String {
    let time = DateTime::from_timestamp_millis(ms).unwrap_or_default();
    time.to_rfc3339_opts(SecondsFormat::Millis, true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_set_is_there_again_and_a_backup_has_it() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path()).unwrap();
        assert_eq!(store.rule::<Vec<String>>("x").unwrap(), Vec::<String>::new());
        store.set_rule("x", &["a"]).unwrap();
        let copy = tempfile::tempdir().unwrap();
        // While the store is open.
        Store::back_up(folder.path(), &copy.path().join(DATABASE_FILE)).unwrap();
        store.set_rule("x", &["b"]).unwrap();
        drop(store);
        assert_eq!(Store::open(folder.path()).unwrap().rule::<Vec<String>>("x").unwrap(), ["b"]);
        assert_eq!(Store::open(copy.path()).unwrap().rule::<Vec<String>>("x").unwrap(), ["a"]);
    }

    #[test]
    fn a_database_of_a_newer_version_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        drop(Store::open(folder.path()).unwrap());
        let connection = Connection::open(folder.path().join(DATABASE_FILE)).unwrap();
        connection.pragma_update(None, "user_version", MIGRATIONS.len() as i64 + 1).unwrap();
        drop(connection);
        assert!(matches!(Store::open(folder.path()), Err(TeachingError::Migration(_))));
    }

    #[test]
    fn migrations_are_valid() {
        Migrations::from_slice(MIGRATIONS).validate().unwrap();
    }

    #[test]
    fn times_are_written_with_milliseconds() {
        assert_eq!(moment(1_700_000_000_123), "2023-11-14T22:13:20.123Z");
        assert_eq!(moment(i64::MAX), "1970-01-01T00:00:00.000Z");
    }
}
