//! Who changed what of the service.

use super::store::{Store, moment, now_ms};
use super::{TeachingError, Who};
use roomsight_protocol::audit::{AuditEntry, AuditList, AuditQuery, Deed};
use rusqlite::Row;
use std::sync::Arc;

/// Entries of one answer, where the caller says nothing else.
const DEFAULT_LIMIT: u64 = 100;
const MAX_LIMIT: u64 = 1000;

/// What was changed, by whom. It only grows.
pub struct Audit(Arc<Store>);

impl Audit {
    pub fn new(store: Arc<Store>) -> Self {
        Self(store)
    }

    /// Writes down what somebody has done. That it was done counts; where it cannot be written the log says so.
    pub fn note(&self, who: Who, what: Deed, target: &str, detail: &str) {
        let insert = "INSERT INTO audit (at, who, what, target, detail) VALUES (?1, ?2, ?3, ?4, ?5)";
        let noted = word(what)
            .and_then(|word| Ok(self.0.lock().execute(insert, (now_ms(), who.0, word, target, detail))?));
        if let Err(error) = noted {
            tracing::error!(who = who.0, ?what, target, detail, %error, "was done, and is not in the audit");
        }
    }

    /// What was done, the newest first.
    ///
    /// # Errors
    /// A database that cannot be read.
    pub fn list(&self, query: &AuditQuery) -> Result<AuditList, TeachingError> {
        let limit = query.limit.unwrap_or(DEFAULT_LIMIT).clamp(1, MAX_LIMIT);
        let before = query.before.unwrap_or(i64::MAX);
        let connection = self.0.lock();
        let select =
            "SELECT id, at, who, what, target, detail FROM audit WHERE id < ?1 ORDER BY id DESC LIMIT ?2";
        let mut statement = connection.prepare_cached(select)?;
        let rows = statement.query_and_then((before, limit + 1), entry)?;
        let mut entries = rows.collect::<Result<Vec<_>, TeachingError>>()?;
        let has_more = entries.len() as u64 > limit;
        entries.truncate(limit as usize);
        let next = entries.last().filter(|_| has_more).map(|last| last.id);
        Ok(AuditList { entries, next })
    }
}

fn entry(row: &Row) -> Result<AuditEntry, TeachingError> {
    let what: String = row.get(3)?;
    Ok(AuditEntry {
        id: row.get(0)?,
        at: moment(row.get(1)?),
        who: row.get(2)?,
        what: serde_json::from_value(what.into())?,
        target: row.get(4)?,
        detail: row.get(5)?,
    })
}

/// As it is kept, which is as it travels.
fn word(what: Deed) -> Result<String, TeachingError> {
    let value = serde_json::to_value(what)?;
    Ok(value.as_str().unwrap_or_default().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_come_newest_first_in_portions() {
        let folder = tempfile::tempdir().unwrap();
        let audit = Audit::new(Arc::new(Store::open(folder.path()).unwrap()));
        for version in 1..=5 {
            audit.note(Who("anna"), Deed::Activate, &format!("home/{version}"), "");
        }
        let first = audit.list(&AuditQuery { before: None, limit: Some(2) }).unwrap();
        let targets = |list: &AuditList| -> Vec<String> {
            list.entries.iter().map(|entry| entry.target.clone()).collect()
        };
        assert_eq!(targets(&first), ["home/5", "home/4"]);
        let rest = audit.list(&AuditQuery { before: first.next, limit: None }).unwrap();
        assert_eq!((targets(&rest).len(), rest.next), (3, None));
        assert_eq!(rest.entries[0].what, Deed::Activate);
    }
}
