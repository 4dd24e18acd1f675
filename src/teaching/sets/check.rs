//! What is odd about a set, as `roomsight check` finds it.

use super::Sets;
use super::names::as_text;
use crate::teaching::TeachingError;
use crate::teaching::command::{Command, Outcome, Stop};
use crate::teaching::store::{moment, now_ms};
use roomsight_protocol::sets::{CheckState, SetCheck, SetFinding};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;

/// What the command prints.
#[derive(Deserialize)]
struct Report {
    n_frames: usize,
    findings: Vec<Finding>,
    labels_unchecked: Option<String>,
}

#[derive(Deserialize)]
struct Finding {
    oddity: String,
    heading: String,
    picture: PathBuf,
    room: String,
    #[serde(default)]
    detail: String,
    other: Option<PathBuf>,
    likely_room: Option<String>,
}

/// A look at a set.
pub struct Check {
    told: SetCheck,
    /// What ends it early, while it runs.
    stop: Option<Stop>,
}

impl Sets {
    /// Ends the looks that are under way, since the service stops.
    pub fn stop_checks(&self) {
        self.checks().values().filter_map(|check| check.stop.as_ref()).for_each(Stop::now);
    }

    /// Begins to look for what is odd in a set; where it is looked at already nothing new begins.
    ///
    /// # Errors
    /// No such set, or a process that cannot be started.
    pub fn begin_check(self: &Arc<Self>, set: &str) -> Result<SetCheck, TeachingError> {
        let folder = self.existing(set)?;
        let mut checks = self.checks();
        if let Some(running) = checks.get(set).filter(|check| check.told.state == CheckState::Running) {
            return Ok(running.told.clone());
        }
        let command = Command::start(&["check".as_ref(), folder.as_os_str(), "--json".as_ref()])?;
        let check =
            SetCheck { state: CheckState::Running, at: Some(moment(now_ms())), ..SetCheck::default() };
        checks.insert(set.to_owned(), Check { told: check.clone(), stop: Some(command.stopper()) });
        let (sets, set, began) = (self.clone(), set.to_owned(), check.clone());
        thread::spawn(move || {
            let outcome = command.finish(|_| ());
            let told = checked(began, &outcome, &folder);
            sets.checks().insert(set, Check { told, stop: None });
        });
        Ok(check)
    }

    /// How far the last look has come, and what it found.
    ///
    /// # Errors
    /// No such set.
    pub fn last_check(&self, set: &str) -> Result<SetCheck, TeachingError> {
        self.existing(set)?;
        Ok(self.checks().get(set).map(|check| check.told.clone()).unwrap_or_default())
    }
}

fn checked(began: SetCheck, outcome: &Outcome, folder: &Path) -> SetCheck {
    let report = match outcome.printed() {
        Ok(text) => serde_json::from_str::<Report>(text).map_err(|error| error.to_string()),
        Err(reason) => Err(reason),
    };
    let Report { n_frames, findings, labels_unchecked } = match report {
        Ok(report) => report,
        Err(error) => return SetCheck { state: CheckState::Failed, error: Some(error), ..began },
    };
    let inside = |path: PathBuf| as_text(path.strip_prefix(folder).unwrap_or(&path));
    let finding = |found: Finding| SetFinding {
        oddity: found.oddity,
        heading: found.heading,
        path: inside(found.picture),
        room: found.room,
        detail: found.detail,
        other: found.other.map(inside),
        likely_room: found.likely_room,
    };
    SetCheck {
        state: CheckState::Done,
        error: labels_unchecked.map(|why| format!("labels were not doubted: {why}")),
        n_frames: Some(n_frames),
        findings: findings.into_iter().map(finding).collect(),
        ..began
    }
}
