//! A trained model becomes a version, which serves nobody until somebody says so.

use super::MODEL_FOLDER;
use super::run::Beside;
use crate::engine::Engine;
use crate::engine::metrics::TrainingOutcome;
use crate::engine::registry::ChangeError;
use crate::repository::{RepositoryError, package};
use crate::teaching::{Teaching, TeachingError, Who};
use roomsight_protocol::event::Event;
use roomsight_protocol::training::{PublishedVersion, TrainingInfo, TrainingJson, TrainingState};
use roomsight_protocol::version_id::VersionId;
use std::fs;
use std::path::Path;
use std::sync::Arc;

/// Other services may publish at the same time.
const MAX_TRIES: u64 = 5;

/// What people teach, beside the models that come of it.
#[derive(Clone)]
pub struct Trainer {
    pub teaching: Arc<Teaching>,
    pub engine: Engine,
}

impl Trainer {
    /// Begins a training, whose model is compared with the version that serves.
    ///
    /// # Errors
    /// As of [`Trainings::begin`](super::Trainings::begin).
    pub fn begin(&self, who: Who, wanted: &TrainingJson) -> Result<TrainingInfo, TeachingError> {
        let beside = self.beside(&wanted.model);
        let trainer = self.clone();
        let then = move |info: &TrainingInfo| {
            trainer.tell(info);
            trainer.ended(info);
        };
        let info = self.teaching.trainings.begin(who, wanted, beside.as_ref(), then)?;
        self.tell(&info);
        Ok(info)
    }

    /// Tells dashboards and metrics that a training began or ended.
    fn tell(&self, TrainingInfo { id, model, state, .. }: &TrainingInfo) {
        let metrics = &self.engine.metrics;
        metrics.beside().training(*state == TrainingState::Running);
        match state {
            TrainingState::Running => {}
            TrainingState::Done => metrics.trained(TrainingOutcome::Done),
            TrainingState::Failed => metrics.trained(TrainingOutcome::Failed),
            TrainingState::Cancelled => metrics.trained(TrainingOutcome::Cancelled),
        }
        self.engine.events.tell(Event::Training { id: *id, model: model.clone(), state: *state });
    }

    /// The version that serves as stable under a name, for a new one to be compared with.
    fn beside(&self, name: &str) -> Option<Beside> {
        let id = VersionId::new(name, self.engine.registry.serving(name).stable?.version);
        let folder = self.engine.registry.folder(&id).ok()?;
        Some(Beside { id, folder })
    }

    /// Makes the model of a training the next version of its name.
    ///
    /// # Errors
    /// A training that has no model, that was published, or whose model is worse than what served, unless that is wanted.
    pub fn publish(&self, id: i64, even_if_worse: bool) -> Result<PublishedVersion, TeachingError> {
        let info = self.teaching.trainings.records.get(id)?;
        let conflict = |text: String| Err(TeachingError::Conflict(text));
        if info.state != TrainingState::Done {
            return conflict(format!("the training {id} has no model"));
        }
        if let Some(PublishedVersion { name, version }) = &info.published {
            return conflict(format!("the training {id} is {name}/{version} already"));
        }
        if let Some(worse) =
            info.comparison.as_ref().filter(|comparison| comparison.is_worse && !even_if_worse)
        {
            return conflict(format!(
                "it is worse than {}: right on {} of {} frames, that one on {} of {}; `even_if_worse` publishes it all the same",
                worse.serving,
                worse.now.n_right,
                worse.now.n_frames,
                worse.before.n_right,
                worse.before.n_frames
            ));
        }
        let folder = self.teaching.trainings.folder_of(info.id).join(MODEL_FOLDER);
        let published = self.publish_next(&info, &folder)?;
        self.teaching.trainings.records.keep(&TrainingInfo { published: Some(published.clone()), ..info })?;
        // The repository has it; what cannot be deleted only takes room.
        let _ = fs::remove_dir_all(folder);
        Ok(published)
    }

    fn publish_next(&self, info: &TrainingInfo, folder: &Path) -> Result<PublishedVersion, TeachingError> {
        let highest = match self.engine.registry.entry(&info.model) {
            Ok(entry) => {
                entry.versions.keys().next_back().copied().unwrap_or_default().max(entry.record.settled)
            }
            Err(_) => 0,
        };
        for above in 0..MAX_TRIES {
            let id = VersionId::after(&info.model, highest + above)
                .map_err(|error| TeachingError::Conflict(error.to_string()))?;
            let staged = self.engine.registry.stage().map_err(ChangeError::from)?;
            package::copy(folder, staged.path()).map_err(TeachingError::io(folder))?;
            match self.engine.registry.publish_aside(&id, staged) {
                Ok(()) => return Ok(PublishedVersion { name: id.name, version: id.version }),
                Err(ChangeError::Repository(RepositoryError::Exists(_))) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Err(TeachingError::Conflict("others publish versions of it at the same time; try again".to_owned()))
    }
}
