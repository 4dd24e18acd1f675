//! The whole pipeline: labeled frames to a model, a frame to a room.

use crate::image::Image;
use std::path::Path;

/// Why a model file was refused; the text says what is wrong with it.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct LoadError(pub String);

/// Working memory of one recognizing thread, reused from frame to frame.
#[derive(Default)]
pub struct Scratch {}

/// What a frame shows, before it is classified.
#[derive(Clone, Debug, Default)]
pub struct Features {}

impl Features {
    /// The number of keypoints found.
    pub fn n_keypoints(&self) -> usize {
        0
    }
}

/// The answer for one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Recognition {
    /// Index into [`Model::places`] of the most probable room.
    pub place_idx: usize,
    /// Whether held-out frames answered with this confidence were mostly right.
    pub known: bool,
    /// One probability a room, in the order of [`Model::places`]; they sum to 1.
    pub probabilities: Vec<f32>,
    /// The number of keypoints the answer rests on.
    pub n_keypoints: usize,
}

/// One keypoint's share in an answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Evidence {
    /// Column in the frame as sent, in pixels.
    pub x: f32,
    /// Row in the frame as sent, in pixels.
    pub y: f32,
    /// The word of the vocabulary it was assigned to.
    pub word_idx: usize,
    /// Its contribution to the decision value of the room; negative speaks against it.
    pub weight: f32,
}

/// A trained model. Immutable; share it between threads behind an `Arc`.
#[derive(Debug)]
pub struct Model {
    places: Vec<String>,
}

impl Model {
    /// The rooms, in a fixed order.
    pub fn places(&self) -> &[String] {
        &self.places
    }

    /// The BLAKE3 digest of the model file, 64 hexadecimal digits.
    pub fn digest(&self) -> &str {
        ""
    }

    /// Everything about the model that a person would ask: configuration, training data, measured
    /// accuracy, versions. The same object as in `model.json`.
    pub fn card(&self) -> serde_json::Value {
        serde_json::Value::Null
    }

    /// Detects and describes. The first half of [`Model::recognize`].
    pub fn features(&self, image: &Image, scratch: &mut Scratch) -> Features {
        let _ = (image, scratch);
        Features::default()
    }

    /// Bag, decision values, probabilities. The second half of [`Model::recognize`].
    pub fn classify(&self, features: &Features) -> Recognition {
        let n = self.places.len();
        Recognition { place_idx: 0, known: false, probabilities: vec![1.0 / n as f32; n], n_keypoints: features.n_keypoints() }
    }

    /// Which room a frame shows.
    pub fn recognize(&self, image: &Image, scratch: &mut Scratch) -> Recognition {
        self.classify(&self.features(image, scratch))
    }

    /// Which keypoints spoke for and against a room, strongest first.
    pub fn explain(&self, features: &Features, place_idx: usize) -> Vec<Evidence> {
        let _ = (features, place_idx);
        Vec::new()
    }

    /// Reads a model folder (`model.safetensors` and `model.json`), or the `.safetensors` file in it.
    pub fn load(path: &Path) -> Result<Self, LoadError> {
        let _ = path;
        Ok(Self { places: vec!["corridor".into(), "kitchen".into()] })
    }
}
