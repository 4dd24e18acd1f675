//! Labeled frames to a model.

use crate::model::Model;
use crate::model::config::Config;
use crate::model::sample::Sample;
use crate::model::training::{Training, TrainingStep};
use crate::model::trials::{Trials, Unit};
use crate::opinions::error::TrainError;
use roomsight_vision::camera::Camera;

impl Model {
    /// Trains on samples that were described by `extractor`, which was made from the same `config`.
    ///
    /// Probabilities and weights of opinions are fitted on held-out folds; see [`crate::folds`]. Where no room has two
    /// frames nothing can be held out: they are those that are taken where nothing is known, and no answer is known.
    /// The result depends on the arguments alone. Samples do not say when they were taken: transitions between rooms are left to
    /// [`Training::finish`]. `progress` is called before each step.
    pub fn train(
        samples: &[&Sample],
        config: &Config,
        camera: Camera,
        mut progress: impl FnMut(TrainingStep),
    ) -> Result<Training, TrainError> {
        Trials::run(samples, config, Unit::Drives, &mut progress)?.finish(config, camera, progress)
    }
}
