//! What answering a frame takes.

use crate::dataset::Dataset;
use roomsight_recognition::model::{FormatError, Model, Scratch};
use roomsight_vision::image::Limits;
use serde::Serialize;
use std::time::Instant;

/// At most this many frames are timed, spread evenly over the data set.
pub(super) const MAX_FRAMES: usize = 60;

/// Medians over frames, on one thread; and the size of the model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// From pixels to what opinions see, in milliseconds.
    pub features_ms: f64,
    /// From there to probabilities, in milliseconds.
    pub classify_ms: f64,
    /// The bytes of the model file.
    pub model_bytes: usize,
}

impl Cost {
    /// Lets a model answer some frames of a data set, those that can be read.
    ///
    /// # Errors
    /// A model that cannot be written.
    pub fn measure(model: &Model, dataset: &Dataset, limits: &Limits) -> Result<Self, FormatError> {
        let limits = limits.enough_for(model.config().longest_side);
        let stride = dataset.frames.len().div_ceil(MAX_FRAMES).max(1);
        let mut scratch = Scratch::default();
        let (mut features_ms, mut classify_ms) = (Vec::new(), Vec::new());
        for image in dataset.frames.iter().step_by(stride).filter_map(|frame| frame.read(&limits).ok()) {
            let (features, time) = timed(|| model.features(&image, &mut scratch));
            features_ms.push(time);
            classify_ms.push(timed(|| model.classify(&features)).1);
        }
        let model_bytes = model.to_bytes()?.len();
        Ok(Self { features_ms: median(features_ms), classify_ms: median(classify_ms), model_bytes })
    }
}

/// The result, and the milliseconds it took.
pub fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64() * 1000.0)
}

/// The value in the middle; 0 of none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}
