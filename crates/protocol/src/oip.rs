//! The Open Inference Protocol over HTTP, `/v2`, as KServe defines it, with four extensions of Triton:
//! `binary_tensor_data`, tensors as bytes behind the JSON, `model_repository`, `model_configuration` and
//! `statistics`.
//!
//! | module | what |
//! |---|---|
//! | [`request`] | frames to recognize: untrusted bytes |
//! | [`response`] | the tensors that answer them |
//! | [`tensor`] | the elements of tensors, as bytes and in JSON |
//! | [`model_config`] | how a model is run |
//! | [`statistics`] | what a model has done |
//!
//! A frame is an element of the input `frame`, an encoded image. JSON cannot carry its bytes: there an
//! element is a string in base64. Rooms are text, and stand in JSON as they are.

pub mod model_config;
pub mod request;
pub mod response;
pub mod statistics;
pub mod tensor;

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
#[cfg(feature = "schema")]
use utoipa::ToSchema;

/// The header that tells how many bytes of a body are JSON; binary tensors follow them.
pub const JSON_LENGTH_HEADER: &str = "inference-header-content-length";
/// The one input: encoded images.
pub const FRAME: &str = "frame";
/// What is served besides the protocol itself.
pub const EXTENSIONS: [&str; 4] =
    ["binary_tensor_data", "model_configuration", "model_repository", "statistics"];
/// What recognizes frames, in the place of a framework's name.
pub const PLATFORM: &str = "roomsight";

/// What serves.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({
    "name": "roomsight", "version": "0.1.0", "extensions": EXTENSIONS
})))]
pub struct ServerMetadata {
    /// The service.
    pub name: String,
    /// Its version.
    pub version: String,
    /// The protocol's extensions that it knows.
    pub extensions: Vec<String>,
}

/// Whether the service lives.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct ServerLive {
    /// It does, where it answers.
    pub live: bool,
}

/// Whether frames are answered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct ServerReady {
    /// They are, where the status is 200.
    pub ready: bool,
}

/// Whether a model answers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct ModelReady {
    /// The model.
    pub name: String,
    /// It does, where the status is 200.
    pub ready: bool,
}

/// What a model takes and gives.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct ModelMetadata {
    /// Its name.
    pub name: String,
    /// The versions that can be asked for.
    pub versions: Vec<String>,
    /// What recognizes frames.
    #[cfg_attr(feature = "schema", schema(example = "roomsight"))]
    pub platform: String,
    /// What it takes: `frame`, encoded images.
    pub inputs: Vec<TensorMetadata>,
    /// What it gives.
    pub outputs: Vec<TensorMetadata>,
}

/// A tensor of a model.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({"name": "probabilities", "datatype": "FP32", "shape": [-1, 9]})))]
pub struct TensorMetadata {
    /// Its name.
    pub name: String,
    /// What its elements are.
    pub datatype: Datatype,
    /// How many elements it has in each direction; -1: as many as there are frames.
    pub shape: Vec<i64>,
}

/// What the elements of a tensor are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "UPPERCASE")]
pub enum Datatype {
    /// Bytes of any length.
    Bytes,
    /// Floating-point numbers of 32 bits.
    Fp32,
    /// True or false.
    Bool,
}

/// The outputs there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum OutputName {
    /// The most probable room of each frame.
    Room,
    /// Its probability.
    Probability,
    /// Whether the answer is trusted and the place is one of those trained.
    Known,
    /// How probable it is that the frame shows a place that was never trained; 0 where the model cannot tell.
    Novelty,
    /// The probabilities of all rooms, in the order of `rooms`.
    Probabilities,
    /// The rooms that the model tells apart.
    Rooms,
}

/// An error, whatever went wrong.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({"error": "there is no model \"lab\"; GET /v1/models lists those that are"})))]
pub struct ErrorBody {
    /// What is wrong and what to do about it.
    pub error: String,
}

/// Which versions to list.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct IndexRequest {
    /// Only those that are ready.
    #[serde(default)]
    pub ready: bool,
}

/// A version of a model in the repository.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct IndexEntry {
    /// The model.
    pub name: String,
    /// The version.
    pub version: String,
    /// Whether it answers.
    pub state: IndexState,
    /// Why it does not.
    pub reason: String,
}

/// Whether a version answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "UPPERCASE")]
pub enum IndexState {
    /// It does.
    Ready,
    /// It does not.
    Unavailable,
}

/// How to load a model.
#[derive(Debug, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct LoadRequest {
    /// Triton's `config` and files; models are loaded as they are, so that any parameter is refused.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(value_type = Object))]
    pub parameters: BTreeMap<String, IgnoredAny>,
}

impl OutputName {
    /// All of them, in the order of the metadata.
    pub const ALL: [Self; 6] =
        [Self::Room, Self::Probability, Self::Known, Self::Novelty, Self::Probabilities, Self::Rooms];

    /// What its elements are.
    pub fn datatype(self) -> Datatype {
        match self {
            Self::Room | Self::Rooms => Datatype::Bytes,
            Self::Probability | Self::Novelty | Self::Probabilities => Datatype::Fp32,
            Self::Known => Datatype::Bool,
        }
    }

    /// Its shape, for so many frames and rooms.
    pub fn shape(self, n_frames: i64, n_rooms: i64) -> Vec<i64> {
        match self {
            Self::Room | Self::Probability | Self::Known | Self::Novelty => vec![n_frames],
            Self::Probabilities => vec![n_frames, n_rooms],
            Self::Rooms => vec![n_rooms],
        }
    }

    /// As it travels.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Room => "room",
            Self::Probability => "probability",
            Self::Known => "known",
            Self::Novelty => "novelty",
            Self::Probabilities => "probabilities",
            Self::Rooms => "rooms",
        }
    }
}

impl ModelMetadata {
    /// Of a model that tells so many rooms apart; `versions` can be asked for.
    pub fn new(name: &str, versions: Vec<String>, n_rooms: usize) -> Self {
        let any_number = -1;
        let n_rooms = i64::try_from(n_rooms).unwrap_or(i64::MAX);
        let output = |output: OutputName| TensorMetadata {
            name: output.as_str().to_owned(),
            datatype: output.datatype(),
            shape: output.shape(any_number, n_rooms),
        };
        let frame =
            TensorMetadata { name: FRAME.to_owned(), datatype: Datatype::Bytes, shape: vec![any_number] };
        Self {
            name: name.to_owned(),
            versions,
            platform: PLATFORM.to_owned(),
            inputs: vec![frame],
            outputs: OutputName::ALL.into_iter().map(output).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_output_travels_under_the_name_that_the_metadata_tells() {
        for output in OutputName::ALL {
            assert_eq!(serde_json::to_value(output).unwrap(), output.as_str());
        }
    }
}
