//! The model file: all arrays as safetensors, everything else as one JSON text in its metadata.
//!
//! | array | type and shape |
//! |---|---|
//! | `vocabulary.centers` | f32, words x dimensions; where bags are classified |
//! | `svm.weights`, `svm.rho` | f32, machines x words, machines; of a linear SVM |
//! | `svm.n_support_vectors` | u32, machines; of a linear SVM |
//! | `kernel.support_vectors` | f32, support vectors x words; of a kernel SVM |
//! | `kernel.labels` | u32, support vectors: the room of each; not in files of older versions |
//! | `kernel.parameters` | f64, gamma and coef0 as far as the kernel has them |
//! | `match.descriptors` | f32, descriptors x dimensions, of the support frames of a match SVM |
//! | `match.n_descriptors` | u32, support frames |
//! | `dual.coefficients`, `dual.rho` | f32, machines x support vectors, machines; of a kernel or match SVM |
//! | `boost.n_stumps` | u32, rooms |
//! | `boost.features`, `boost.thresholds`, `boost.weights` | u32, f32, f32, stumps |
//! | `calibration.slopes`, `calibration.offsets` | f32, machines |
//! | `transitions.dwells`, `transitions.next` | f32, rooms, rooms x rooms; unlearned when left out |
//! | `cue.weights`, `cue.rho`, `cue.n_support_vectors` | as those of a linear SVM, over what a cue sees; only with a cue |
//! | `cue.slopes`, `cue.offsets` | as those of the calibration |
//! | `held_out.values`, `held_out.labels` | f32, frames x machines, u32, frames: held-out decision values and the room shown; of a kernel SVM, not in files of older versions |
//! | `camera.mask` | u8, height x width; only with a mask |

use super::arrays::{self, Array, require};
use super::cue::{Opinion, Sight};
use super::held_out::HeldOutDecisions;
use super::machines::Machines;
use super::networks::{self, NetworkEntry, Networks};
use super::{Card, Classification, Config, Extractor, Model};
use crate::camera::{Camera, Mask, Projection};
use crate::filter::Transitions;
use crate::svm::Calibration;
use safetensors::SafeTensors;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// The version of the file's layout. A file of another version is refused.
pub const FORMAT_VERSION: u32 = 1;

/// The longest header that is read; it holds names and shapes, not arrays.
const MAX_HEADER_BYTES: u64 = 16 << 20;

const METADATA_KEY: &str = "roomsight";

/// Why bytes are no model; the text says what is wrong.
#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    /// Not a safetensors file, or damaged.
    #[error("not a roomsight model, or damaged: {0}")]
    NotAModel(String),
    /// A model of another layout.
    #[error(
        "the model has format version {found}; this program reads version {FORMAT_VERSION}: \
         train it again or use another version of roomsight"
    )]
    OtherVersion {
        /// The version it has.
        found: u32,
    },
    /// A model whose parts do not fit.
    #[error("the model is damaged: {0}")]
    Damaged(String),
    /// A model that is given other networks than it was trained with, or none.
    #[error(
        "the model file and model.json name different networks: send the model's whole folder as `train` writes it"
    )]
    OtherNetworks,
}

/// All that is not an array.
#[derive(Serialize, Deserialize)]
pub(super) struct Metadata {
    format_version: u32,
    pub places: Vec<String>,
    pub camera: Projection,
    known_probability: f32,
    pub config: Config,
    pub card: Card,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub networks: Vec<NetworkEntry>,
}

/// Stands in a file for a known probability that no answer reaches.
const NEVER_KNOWN: f32 = 2.0;

/// Read first, so that other versions are told apart from damage.
#[derive(Deserialize)]
struct Version {
    format_version: u32,
}

impl Model {
    /// The model file. The same model always gives the same bytes.
    pub fn to_bytes(&self) -> Result<Vec<u8>, FormatError> {
        let damaged = |error: &dyn std::fmt::Display| FormatError::Damaged(error.to_string());
        let metadata = serde_json::to_string(&self.metadata()).map_err(|error| damaged(&error))?;
        let mut arrays = Vec::new();
        for (sight, Opinion { machines, calibration, .. }) in
            self.config.sights().zip(&self.classification.opinions)
        {
            arrays.extend(machines.to_arrays());
            let [slopes, offsets] = calibration_names(sight);
            arrays.push(Array::vector(slopes, calibration.slopes()));
            arrays.push(Array::vector(offsets, calibration.offsets()));
        }
        arrays.extend(self.held_out.iter().flat_map(HeldOutDecisions::to_arrays));
        arrays.push(Array::vector("transitions.dwells", self.transitions.dwells()));
        arrays.push(Array::matrix("transitions.next", self.transitions.next()));
        if let Some(mask) = &self.camera().mask {
            arrays.push(Array::picture("camera.mask", mask.picture()));
        }
        arrays::serialize(&arrays, (METADATA_KEY, metadata))
    }

    pub(super) fn metadata(&self) -> Metadata {
        Metadata {
            format_version: FORMAT_VERSION,
            places: self.places.clone(),
            camera: self.camera().projection,
            known_probability: self.known_probability().unwrap_or(NEVER_KNOWN),
            config: self.config.clone(),
            card: self.card.clone(),
            networks: self.network_entries(),
        }
    }

    /// Reads a model file of unknown origin that needs no network. A model that comes out cannot fail to recognize.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FormatError> {
        Self::from_parts(bytes, Networks::new())
    }

    /// The same of a model that uses these networks.
    pub fn from_parts(bytes: &[u8], networks: Networks) -> Result<Self, FormatError> {
        let metadata = Metadata::read(bytes)?;
        let file = SafeTensors::deserialize(bytes).map_err(not_a_model)?;
        from_parts(metadata, &file, networks)
    }
}

impl Metadata {
    /// Reads it from a model file of unknown origin.
    pub fn read(bytes: &[u8]) -> Result<Self, FormatError> {
        let header_length = bytes.first_chunk().map(|length| u64::from_le_bytes(*length));
        if header_length.is_none_or(|length| length > MAX_HEADER_BYTES) {
            return Err(FormatError::NotAModel("no safetensors header".to_owned()));
        }
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(not_a_model)?;
        let json = header.metadata().as_ref().and_then(|metadata| metadata.get(METADATA_KEY));
        let json =
            json.ok_or_else(|| FormatError::NotAModel("a safetensors file of something else".into()))?;
        let version: Version = serde_json::from_str(json).map_err(not_a_model)?;
        if version.format_version != FORMAT_VERSION {
            return Err(FormatError::OtherVersion { found: version.format_version });
        }
        let metadata: Self =
            serde_json::from_str(json).map_err(|error| FormatError::Damaged(error.to_string()))?;
        networks::check_entries(&metadata.networks).map_err(FormatError::Damaged)?;
        Ok(metadata)
    }
}

fn not_a_model(error: impl std::fmt::Display) -> FormatError {
    FormatError::NotAModel(error.to_string())
}

/// The names of the slopes and the offsets.
fn calibration_names(sight: Sight) -> [&'static str; 2] {
    match sight {
        Sight::Keypoints => ["calibration.slopes", "calibration.offsets"],
        Sight::Frame(_) => ["cue.slopes", "cue.offsets"],
    }
}

fn from_parts(metadata: Metadata, file: &SafeTensors, networks: Networks) -> Result<Model, FormatError> {
    if metadata.networks != networks::entries(&networks) {
        return Err(FormatError::OtherNetworks);
    }
    let Metadata { places, camera, known_probability, config, card, .. } = metadata;
    config.check().map_err(FormatError::Damaged)?;
    let distinct: BTreeSet<&str> = places.iter().map(String::as_str).collect();
    require(distinct.len() == places.len() && places.len() >= 2, "its rooms are not distinct")?;
    require(known_probability.is_finite(), "the probability from which answers are known is no number")?;
    if let Projection::Omnidirectional(mirror) = camera {
        require(mirror.is_valid(), "its mirror is no ring")?;
    }
    let mut opinions = Vec::new();
    for sight in config.sights() {
        let machines = Machines::from_arrays(sight, &config, (places.len(), camera.kind()), file)?;
        let [slopes, offsets] = calibration_names(sight).map(|name| arrays::read_vector(file, name));
        let calibration = Calibration::from_parts(config.scheme(sight), places.len(), slopes?, offsets?)
            .map_err(|error| FormatError::Damaged(error.to_string()))?;
        opinions.push(Opinion { machines, calibration, weight: config.weight(sight) });
    }
    let scheme = config.classifier.scheme();
    let held_out = HeldOutDecisions::from_arrays((scheme.n_machines(places.len()), places.len()), file)?;
    let transitions = transitions(places.len(), file)?;
    let mask = arrays::read_picture(file, "camera.mask")?.map(Mask::new);
    let camera = Camera { projection: camera, mask };
    Ok(Model {
        places,
        transitions,
        extractor: Extractor::new(&config, camera),
        classification: Classification {
            opinions,
            known_probability: (known_probability <= 1.0).then_some(known_probability),
        },
        held_out,
        networks,
        config,
        card,
    })
}

/// Files of models that were trained before transitions were learned hold none.
fn transitions(n_places: usize, file: &SafeTensors) -> Result<Transitions, FormatError> {
    if file.tensor("transitions.dwells").is_err() {
        return Ok(Transitions::unlearned(n_places));
    }
    let dwells = arrays::read_vector(file, "transitions.dwells")?;
    let next = arrays::read_matrix(file, "transitions.next")?;
    Transitions::from_parts(n_places, dwells, next).map_err(|error| FormatError::Damaged(error.to_string()))
}
