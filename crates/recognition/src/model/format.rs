//! The model file: all arrays as safetensors, everything else as one JSON text in its metadata.
//!
//! | array | type and shape |
//! |---|---|
//! | `NAME/...` | those of the opinion of this name, as below |
//! | `transitions.dwells`, `transitions.next` | f32, rooms, rooms x rooms; unlearned when left out |
//! | `transitions.speed` | f32, one; where drives said where they went |
//! | `held_out.labels`, `left_out.labels` | u32, frames: the rooms of held-out frames, and of frames whose room was left out |
//! | `novelty.means`, `novelty.deviations`, `novelty.weights` | f64, signs of all opinions and of the pool; what tells new places |
//! | `novelty.offset` | f64, one |
//! | `frames.rooms`, `frames.drives` | u32, frames that were learned |
//! | `frames.drive_names`, `frames.names` | u8, lines of text |
//! | `camera.mask` | u8, height x width; only with a mask |
//!
//! | array of an opinion | type and shape |
//! |---|---|
//! | `calibration.slopes`, `calibration.offsets` | f32, machines; of sigmoids |
//! | `calibration.slope` | f32, one; of a softmax |
//! | `held_out.values`, `left_out.values` | f32, frames x machines or rooms; not-a-number where nothing was seen |
//! | `held_out.signs`, `left_out.signs` | f32, frames x signs of the opinion, likewise |
//! | `kept.values`, `kept.units` | i8, frames x numbers, f32, frames: training rows of linear machines |
//! | `vocabulary.centers` | f32, words x dimensions; where bags are classified |
//! | `svm.weights`, `svm.rho` | f32, machines x numbers, machines; of linear machines |
//! | `svm.n_support_vectors` | u32, machines; of linear machines |
//! | `kernel.support_vectors` | f32, support vectors x words; of a kernel SVM |
//! | `kernel.labels` | u32, support vectors: the room of each; not in files of older versions |
//! | `kernel.parameters` | f64, gamma and coef0 as far as the kernel has them |
//! | `match.descriptors` | f32, descriptors x dimensions, of the support frames of a match SVM |
//! | `match.n_descriptors` | u32, support frames |
//! | `dual.coefficients`, `dual.rho` | f32, machines x support vectors, machines; of a kernel or match SVM |
//! | `boost.n_stumps` | u32, rooms |
//! | `boost.features`, `boost.thresholds`, `boost.weights` | u32, f32, f32, stumps |
//!
//! Opinions that answer early have, under `early.N/` for those that are asked first (N = 0) and so on, what tells new places and
//! their calibration once more, as `early.0/novelty.means` and `early.0/NAME/calibration.slope`. Files in which some do are of
//! format version 3, since a program that does not know of it would answer otherwise; others are of version 2.
//!
//! Files of format version 1 have one opinion on local features, whose arrays are named without it, and perhaps a
//! cue, whose arrays are `cue.weights`, `cue.rho`, `cue.n_support_vectors`, `cue.slopes` and `cue.offsets`.

mod early;

use super::Classification;
use crate::file::arrays::{Array, Arrays, require};
use crate::file::error::{FORMAT_VERSION, FormatError, VERSION_OF_ALL};
use crate::file::networks::{NetworkEntry, Networks};
use crate::file::{arrays, networks};
use crate::filter::Transitions;
use crate::model::Model;
use crate::model::card::Card;
use crate::model::config::Config;
use crate::model::extractor::Extractor;
use crate::model::held_out::{HELD_OUT, HeldOutFrames, LEFT_OUT};
use crate::model::known::Known;
use crate::model::learned::LearnedFrames;
use crate::model::novelty::Novelty;
use crate::opinions::calibration::Calibration;
use crate::opinions::{Opinion, Shape};
use early::{EarlyEntry, early_arrays};
use roomsight_vision::camera::{Camera, Mask, Projection};
use safetensors::SafeTensors;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The first version, which is read as well. Files of others are refused.
const FIRST_VERSION: u32 = 1;

/// The longest header that is read; it holds names and shapes, not arrays.
const MAX_HEADER_BYTES: u64 = 16 << 20;

const METADATA_KEY: &str = "roomsight";

/// All that is not an array.
#[derive(Serialize, Deserialize)]
pub(crate) struct Metadata {
    pub format_version: u32,
    #[serde(rename = "places")]
    pub rooms: Vec<String>,
    pub camera: Projection,
    known_probability: f32,
    #[serde(default = "any_novelty")]
    known_novelty: f32,
    /// How much each opinion counts, by name.
    #[serde(default)]
    weights: BTreeMap<String, f64>,
    /// The share of frames that show what was never seen.
    #[serde(default)]
    doubt: f64,
    /// Who answers early, in the order of being asked.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    early: Vec<EarlyEntry>,
    pub config: Config,
    pub card: Card,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub networks: Vec<NetworkEntry>,
}

/// Files of before say nothing of novelty.
fn any_novelty() -> f32 {
    1.0
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
        let mut arrays = self.learned.to_arrays();
        for (name, opinion) in self.config.opinions.keys().zip(&self.classification.opinions) {
            arrays.extend(opinion.to_arrays().into_iter().map(|array| array.of_opinion(name)));
        }
        for (frames, names) in [(&self.held_out, HELD_OUT), (&self.left_out, LEFT_OUT)] {
            arrays.extend(frames.to_arrays(&names, &self.config, self.rooms.len()));
        }
        arrays.extend(self.classification.novelty.iter().flat_map(Novelty::to_arrays));
        arrays.extend(early_arrays(&self.early));
        arrays.push(Array::vector("transitions.dwells", self.transitions.dwells()));
        arrays.push(Array::matrix("transitions.next", self.transitions.next()));
        let speed = self.transitions.learned_speed();
        arrays.extend(speed.map(|speed| Array::vector("transitions.speed", &[speed])));
        if let Some(mask) = &self.camera().mask {
            arrays.push(Array::picture("camera.mask", mask.picture()));
        }
        arrays::serialize(&arrays, (METADATA_KEY, metadata))
    }

    pub(crate) fn metadata(&self) -> Metadata {
        Metadata {
            format_version: if self.answers_early() { FORMAT_VERSION } else { VERSION_OF_ALL },
            rooms: self.rooms.clone(),
            camera: self.camera().projection,
            known_probability: self.known_probability().unwrap_or(NEVER_KNOWN),
            known_novelty: self.classification.known.map_or(1.0, |known| known.most_novelty),
            doubt: self.classification.doubt,
            weights: self.weights().into_iter().map(|(name, weight)| (name.to_owned(), weight)).collect(),
            early: self.early.iter().map(EarlyEntry::of).collect(),
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
        if !(FIRST_VERSION..=FORMAT_VERSION).contains(&version.format_version) {
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

fn from_parts(metadata: Metadata, file: &SafeTensors, networks: Networks) -> Result<Model, FormatError> {
    if metadata.networks != networks::entries(&networks) {
        return Err(FormatError::OtherNetworks);
    }
    let Metadata {
        rooms,
        camera,
        known_probability,
        known_novelty,
        mut config,
        card,
        format_version,
        weights,
        doubt,
        early,
        ..
    } = metadata;
    config.link(&networks)?;
    config.check().map_err(FormatError::Damaged)?;
    let distinct: BTreeSet<&str> = rooms.iter().map(String::as_str).collect();
    require(distinct.len() == rooms.len() && rooms.len() >= 2, "its rooms are not distinct")?;
    let known = read_known(known_probability, known_novelty)?;
    require((0.0..=1.0).contains(&doubt), "its doubt is no share")?;
    if let Projection::Omnidirectional(mirror) = camera {
        require(mirror.is_valid(), "its mirror is no ring")?;
    }
    let file = Arrays::new(file);
    let is_first = format_version == FIRST_VERSION;
    let arrays_of = |name| if is_first { file.of_first_version(name) } else { file.of_opinion(name) };
    let learned = LearnedFrames::from_arrays(rooms.len(), &file)?;
    let weights = match config.given_weights() {
        Some(weights) => weights,
        None => read_weights(&config, &weights)?,
    };
    let mut opinions = Vec::new();
    for ((name, opinion), weight) in config.opinions.iter().zip(weights) {
        let arrays = arrays_of(name);
        let sight = opinion.sight();
        let n_dimensions = sight.n_dimensions(camera.kind());
        let shape =
            Shape { camera: camera.kind(), n_rooms: rooms.len(), n_dimensions, n_frames: learned.n_frames() };
        let trained = Arc::new(opinion.read(shape, &arrays)?);
        let calibration = Calibration::from_arrays(opinion.way(), rooms.len(), &arrays)?;
        opinions.push(Opinion { sight, trained, calibration, weight });
    }
    let frames = |names| HeldOutFrames::from_arrays(&names, &config, rooms.len(), &file, arrays_of);
    let (held_out, left_out) = (frames(HELD_OUT)?, frames(LEFT_OUT)?);
    let novelty = Novelty::from_arrays(&config, &file)?;
    let transitions = transitions(rooms.len(), &file)?;
    let mask = file.picture("camera.mask")?.map(Mask::new);
    let camera = Camera { projection: camera, mask };
    let classification = Classification { n_rooms: rooms.len(), opinions, doubt, novelty, known };
    let early = early.into_iter().enumerate();
    let early = early.map(|(idx, entry)| entry.read(idx, &config, &classification, &file));
    Ok(Model {
        transitions,
        extractor: Extractor::new(&config, camera),
        early: early.collect::<Result<_, _>>()?,
        classification,
        rooms,
        learned,
        held_out,
        left_out,
        networks,
        config,
        card,
    })
}

/// The thresholds of known answers, where any are.
fn read_known(least_probability: f32, most_novelty: f32) -> Result<Option<Known>, FormatError> {
    require(least_probability.is_finite(), "the probability from which answers are known is no number")?;
    require((0.0..=1.0).contains(&most_novelty), "the novelty up to which answers are known is no share")?;
    Ok((least_probability <= 1.0).then_some(Known { least_probability, most_novelty }))
}

/// The weights of all opinions, in their order.
fn read_weights(config: &Config, weights: &BTreeMap<String, f64>) -> Result<Vec<f64>, FormatError> {
    let weight = |name: &String| weights.get(name).copied().filter(|weight| (0.0..=100.0).contains(weight));
    let weights: Option<Vec<f64>> = config.opinions.keys().map(weight).collect();
    weights.ok_or_else(|| FormatError::Damaged("an opinion has no weight".to_owned()))
}

/// Files of models that were trained before transitions were learned hold none.
fn transitions(n_rooms: usize, file: &Arrays) -> Result<Transitions, FormatError> {
    if !file.has("transitions.dwells") {
        return Ok(Transitions::unlearned(n_rooms));
    }
    let (dwells, next) = (file.vector("transitions.dwells")?, file.matrix("transitions.next")?);
    let speed = match file.has("transitions.speed") {
        true => file.vector("transitions.speed")?.first().copied(),
        false => None,
    };
    Transitions::from_parts(n_rooms, dwells, next, speed)
        .map_err(|error| FormatError::Damaged(error.to_string()))
}

#[cfg(test)]
mod tests;
