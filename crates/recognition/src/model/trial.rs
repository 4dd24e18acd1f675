//! A model is tried before it serves: its files are verified, it is loaded, and it answers its golden frames.

use crate::file::disk::LoadError;
use crate::file::networks::NetworkStore;
use crate::model::folder::{LoadedModel, VerifiedFile};
use crate::model::golden::{load_golden_frames, warm};
use std::fmt;
use std::path::Path;

/// A model that would serve.
#[derive(Debug)]
pub struct TriedModel {
    /// The model, with the digest of its file.
    pub loaded: LoadedModel,
    /// The golden frames that it answered as when it was saved.
    pub n_golden_frames: usize,
}

/// Why a model would not serve.
#[derive(Debug, thiserror::Error)]
#[error("{stage} failed: {error}")]
pub struct TrialError {
    /// Where on its way it failed.
    pub stage: Stage,
    /// The file, and what is wrong with it.
    pub error: LoadError,
}

/// A step on the way to serving.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Fetching the files and checking their digests.
    Verifying,
    /// Making a model of them.
    Loading,
    /// Recognizing first frames.
    Warming,
}

/// Tries the model in a folder, with the networks of `store` where it uses one of those. `on_stage` is called when a
/// stage after the verifying begins.
pub fn try_model(
    folder: &Path,
    store: &NetworkStore,
    mut on_stage: impl FnMut(Stage),
) -> Result<TriedModel, TrialError> {
    let failed_at = |stage| move |error| TrialError { stage, error };
    let file = VerifiedFile::read(folder).map_err(failed_at(Stage::Verifying))?;
    on_stage(Stage::Loading);
    let golden_frames = load_golden_frames(folder).map_err(failed_at(Stage::Loading))?;
    let loaded = file.load(store).map_err(failed_at(Stage::Loading))?;
    on_stage(Stage::Warming);
    warm(&loaded.model, folder, &golden_frames).map_err(failed_at(Stage::Warming))?;
    Ok(TriedModel { loaded, n_golden_frames: golden_frames.len() })
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Verifying => "verifying",
            Self::Loading => "loading",
            Self::Warming => "warming",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_of_the_first_format_answer_what_they_answered() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/model_version_1");
        let tried = try_model(&folder, &NetworkStore::default(), |_| ()).unwrap();
        assert_eq!(tried.n_golden_frames, 4);
        assert_eq!(tried.loaded.model.config().opinions.keys().collect::<Vec<_>>(), ["bag"]);
    }
}
