//! A training's process, what it says, and how it ends.

use super::{LOG_FILE, MAX_LOG_LINES, MODEL_FOLDER, REPORT_FILE, Running, Trainings};
use crate::teaching::command::{Command, Outcome};
use crate::teaching::store::{moment, now_ms};
use crate::teaching::{TeachingError, Who};
use roomsight_protocol::training::{
    ModelComparison, TrainingCamera, TrainingEffort, TrainingInfo, TrainingJson, TrainingState,
};
use roomsight_protocol::version_id::{VersionId, is_name};
use serde::Deserialize;
use std::ffi::OsString;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread;

/// What the lines begin with that tell how far a command has come; see `roomsight --progress`.
const PROGRESS: &str = "progress: ";

/// What is read of the report of `roomsight train --json`.
#[derive(Deserialize)]
struct Report {
    card: Card,
    held_out: HeldOut,
    comparison: Option<ModelComparison>,
}

#[derive(Deserialize)]
struct Card {
    n_frames: usize,
}

#[derive(Deserialize)]
struct HeldOut {
    overall: Overall,
}

#[derive(Deserialize)]
struct Overall {
    rate: Option<f64>,
}

/// A version that a new model is compared with.
pub struct Beside {
    pub id: VersionId,
    pub folder: PathBuf,
}

impl Trainings {
    /// Begins to train; `then` hears how it ended.
    ///
    /// # Errors
    /// One that runs already, a set that is not there, a name that is none, a process that cannot be started.
    pub fn begin(
        self: &Arc<Self>,
        who: Who,
        wanted: &TrainingJson,
        beside: Option<&Beside>,
        then: impl FnOnce(&TrainingInfo) + Send + 'static,
    ) -> Result<TrainingInfo, TeachingError> {
        if !is_name(&wanted.model) {
            return Err(TeachingError::Invalid(format!(
                "{:?} is no name of a model: use 1 to 64 letters, digits, `-`, `_` and dots inside",
                wanted.model
            )));
        }
        let set = self.sets.existing(&wanted.set)?;
        // By itself a room's folder would be taken for a set, and its drives for rooms.
        if self.sets.summary(&wanted.set)?.rooms < 2 {
            return Err(TeachingError::Invalid(format!(
                "the data set {:?} shows fewer than two rooms: add frames of at least one other room",
                wanted.set
            )));
        }
        let mut running = self.running();
        if let Some(running) = &*running {
            return Err(TeachingError::Conflict(format!(
                "the training {} of {} runs: wait for its end, or cancel it",
                running.info.id, running.info.model
            )));
        }
        let info = self.records.add(TrainingInfo {
            id: 0,
            set: wanted.set.clone(),
            model: wanted.model.clone(),
            effort: wanted.effort,
            state: TrainingState::Running,
            step: None,
            progress: None,
            began_at: moment(now_ms()),
            ended_at: None,
            by: who.0.to_owned(),
            error: None,
            rate: None,
            n_frames: None,
            comparison: None,
            published: None,
            log: None,
            report: None,
        })?;
        let folder = self.folder_of(info.id);
        fs::create_dir_all(&folder).map_err(TeachingError::io(&folder))?;
        let output = folder.join(MODEL_FOLDER);
        let mut arguments: Vec<OsString> =
            vec!["train".into(), set.into(), "--json".into(), "--output".into(), output.into()];
        match wanted.effort {
            TrainingEffort::Fast => arguments.push("--effort=fast".into()),
            TrainingEffort::Best => arguments.push("--effort=best".into()),
            TrainingEffort::Default => {}
        }
        match wanted.camera {
            None => {}
            Some(TrainingCamera::Perspective) => arguments.push("--camera=perspective".into()),
            Some(TrainingCamera::Equirectangular) => arguments.push("--camera=equirectangular".into()),
            Some(TrainingCamera::Omnidirectional) => arguments.push("--camera=omnidirectional".into()),
        }
        if let Some(Beside { id, folder }) = beside {
            arguments.extend([
                "--beside".into(),
                folder.into(),
                "--beside-name".into(),
                id.to_string().into(),
            ]);
        }
        let arguments: Vec<_> = arguments.iter().map(OsString::as_os_str).collect();
        let command = Command::start(&arguments).inspect_err(|error| {
            let state = TrainingState::Failed;
            let _ =
                self.records.keep(&TrainingInfo { state, error: Some(error.to_string()), ..info.clone() });
        })?;
        let stop = command.stopper();
        *running = Some(Running { info: info.clone(), stop, is_cancelled: false, log: Vec::new() });
        drop(running);
        let trainings = self.clone();
        thread::spawn(move || {
            let outcome = command.finish(|line| trainings.hear(line));
            then(&trainings.end(&outcome));
        });
        Ok(info)
    }

    /// Takes note of what the process says.
    fn hear(&self, line: &str) {
        let mut running = self.running();
        let Some(running) = running.as_mut() else { return };
        match line.strip_prefix(PROGRESS).and_then(step) {
            Some((step, share)) => {
                running.info.step = Some(step.to_owned());
                running.info.progress = Some(share);
            }
            None => {
                if running.log.len() == MAX_LOG_LINES {
                    running.log.remove(0);
                }
                running.log.push(line.to_owned());
            }
        }
    }

    /// Keeps what came of the training that ran.
    fn end(&self, outcome: &Outcome) -> TrainingInfo {
        let Some(Running { info, is_cancelled, log, .. }) = self.running().take() else {
            unreachable!("a training that ran is there until it ends");
        };
        let folder = self.folder_of(info.id);
        let info = TrainingInfo { ended_at: Some(moment(now_ms())), step: None, progress: None, ..info };
        let ended = if is_cancelled {
            TrainingInfo { state: TrainingState::Cancelled, ..info }
        } else {
            let report = outcome.printed().and_then(|printed| {
                fs::write(folder.join(REPORT_FILE), printed).map_err(|error| error.to_string())?;
                serde_json::from_str::<Report>(printed).map_err(|error| error.to_string())
            });
            match report {
                Ok(Report { card, held_out, comparison }) => TrainingInfo {
                    state: TrainingState::Done,
                    rate: held_out.overall.rate,
                    n_frames: Some(card.n_frames),
                    comparison,
                    ..info
                },
                Err(error) => TrainingInfo { state: TrainingState::Failed, error: Some(error), ..info },
            }
        };
        if let Err(error) = fs::write(folder.join(LOG_FILE), log.join("\n")) {
            tracing::warn!(training = ended.id, %error, "the log of a training is not kept");
        }
        if let Err(error) = self.records.keep(&ended) {
            tracing::error!(training = ended.id, %error, "what came of a training is not kept");
        }
        tracing::info!(training = ended.id, model = ended.model, state = ?ended.state, "a training has ended");
        ended
    }
}

/// What a line of progress tells: `LABEL 12/300`.
fn step(line: &str) -> Option<(&str, f64)> {
    let (label, counts) = line.rsplit_once(' ')?;
    let (done, all) = counts.split_once('/')?;
    let (done, all): (f64, f64) = (done.parse().ok()?, all.parse().ok()?);
    Some((label, if all > 0.0 { (done / all).clamp(0.0, 1.0) } else { 0.0 }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_progress_are_told_from_others() {
        assert_eq!(step("describing 30/120"), Some(("describing", 0.25)));
        assert_eq!(step("doubting labels 0/0"), Some(("doubting labels", 0.0)));
        assert_eq!(step("left out: 3"), None);
        assert_eq!(step("a b/c"), None);
    }
}
