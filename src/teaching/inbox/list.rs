//! What is asked for.

use super::{COLUMNS, Inbox, kept};
use crate::teaching::TeachingError;
use roomsight_protocol::inbox::{InboxFilter, InboxList, InboxOrder, InboxQuery};
use rusqlite::ToSql;

/// Frames of one answer, where the caller says nothing else.
const DEFAULT_LIMIT: u64 = 100;
const MAX_LIMIT: u64 = 500;

impl Inbox {
    /// Some of the frames.
    ///
    /// # Errors
    /// A database that cannot be read.
    pub fn list(&self, query: &InboxQuery) -> Result<InboxList, TeachingError> {
        let mut conditions = vec![match query.state {
            InboxFilter::Open => "is_labeled = 0",
            InboxFilter::Labeled => "is_labeled = 1",
            InboxFilter::All => "TRUE",
        }];
        let mut values: Vec<Box<dyn ToSql>> = Vec::new();
        if let Some(reason) = query.reason {
            let word = serde_json::to_value(reason)?;
            conditions.push("instr(reasons, ?) > 0");
            values.push(Box::new(format!(",{},", word.as_str().unwrap_or_default())));
        }
        if let Some(robot) = &query.robot {
            conditions.push("robot = ?");
            values.push(Box::new(robot.clone()));
        }
        if let Some(room) = &query.room {
            conditions.push("room = ?");
            values.push(Box::new(room.clone()));
        }
        let conditions = conditions.join(" AND ");
        let order = match query.sort {
            InboxOrder::Value => "value DESC, id DESC",
            InboxOrder::Newest => "id DESC",
        };
        let limit = query.limit.unwrap_or(DEFAULT_LIMIT).clamp(1, MAX_LIMIT);
        let after = query.after.unwrap_or_default().min(super::MAX_FRAMES);

        let connection = self.store.lock();
        let count = format!("SELECT COUNT(*) FROM inbox_frame WHERE {conditions}");
        let parameters = || rusqlite::params_from_iter(values.iter());
        let total: u64 = connection.query_row(&count, parameters(), |row| row.get(0))?;
        let open = "SELECT COUNT(*) FROM inbox_frame WHERE is_labeled = 0";
        let open = connection.query_row(open, [], |row| row.get(0))?;
        let select = format!(
            "SELECT {COLUMNS} FROM inbox_frame WHERE {conditions} ORDER BY {order} LIMIT {limit} OFFSET {after}"
        );
        let mut statement = connection.prepare_cached(&select)?;
        let rows = statement.query_and_then(parameters(), kept)?;
        let frames = rows.map(|row| Ok(row?.frame)).collect::<Result<Vec<_>, TeachingError>>()?;
        let next = after + frames.len() as u64;
        Ok(InboxList { total, open, next: (next < total && !frames.is_empty()).then_some(next), frames })
    }
}
