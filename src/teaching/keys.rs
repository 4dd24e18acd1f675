//! Keys that people make on the page, beside those of the settings.

use super::TeachingError;
use super::store::{Store, moment, now_ms};
use crate::access::{Key, KeyError, Role, check_together};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The keys that were made here.
pub struct MadeKeys {
    store: Arc<Store>,
    changing: Mutex<()>,
}

/// A key that was made here.
pub struct KeyMade {
    pub key: Key,
    /// When, by RFC 3339.
    pub at: String,
}

impl MadeKeys {
    pub fn new(store: Arc<Store>) -> Self {
        Self { store, changing: Mutex::default() }
    }

    /// Held while keys change: one change after the other.
    pub fn changing(&self) -> MutexGuard<'_, ()> {
        self.changing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// All of them, by name.
    ///
    /// # Errors
    /// A database that cannot be read.
    pub fn list(&self) -> Result<Vec<KeyMade>, TeachingError> {
        let connection = self.store.lock();
        let mut statement = connection.prepare_cached("SELECT line, at FROM made_key ORDER BY name")?;
        let rows = statement.query_and_then([], |row| {
            let line: String = row.get(0)?;
            let key = Key::try_from(line).map_err(|error| TeachingError::Invalid(error.to_string()))?;
            Ok(KeyMade { key, at: moment(row.get(1)?) })
        })?;
        rows.collect()
    }

    /// Those of the settings and those that were made here. Where one of each have the same name, or could be confused
    /// otherwise, that of the settings counts.
    ///
    /// # Errors
    /// A database that cannot be read.
    pub fn beside(&self, settings: &[Key]) -> Result<Vec<Key>, TeachingError> {
        let mut keys = settings.to_vec();
        for KeyMade { key, .. } in self.list()? {
            keys.push(key);
            if let Err(error) = check_together(&keys) {
                tracing::warn!(%error, "a key that was made on the page does not count beside those of the settings");
                keys.pop();
            }
        }
        Ok(keys)
    }

    /// Makes a key that can stand beside these; returns what its owner keeps.
    ///
    /// # Errors
    /// A name that is no plain one, or is taken.
    pub fn make(
        &self,
        role: Role,
        name: &str,
        robots: &[String],
        others: &[Key],
    ) -> Result<(String, Key), TeachingError> {
        let mut random = [0; 32];
        getrandom::fill(&mut random)?;
        let invalid = |error: KeyError| TeachingError::Invalid(error.to_string());
        let (secret, key) = Key::new(role, name, &random).map_err(invalid)?;
        let key = key.bound_to(robots.iter().map(String::as_str)).map_err(invalid)?;
        let all = [others, std::slice::from_ref(&key)].concat();
        check_together(&all).map_err(|error| TeachingError::Conflict(error.to_string()))?;
        let insert = "INSERT INTO made_key (name, line, at) VALUES (?1, ?2, ?3)";
        self.store.lock().execute(insert, (name, key.to_line(), now_ms()))?;
        Ok((secret, key))
    }

    /// Forgets a key; whether there was one.
    ///
    /// # Errors
    /// A database that cannot be written.
    pub fn revoke(&self, name: &str) -> Result<bool, TeachingError> {
        Ok(self.store.lock().execute("DELETE FROM made_key WHERE name = ?1", [name])? > 0)
    }
}
