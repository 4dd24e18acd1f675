//! How a model is run, as Triton's extension `model_configuration` tells it. Tools that were made for Triton,
//! such as NVIDIA's `perf_analyzer`, ask for it before they send anything.
//!
//! The fields are those of Triton's `ModelConfig` that mean something here; the others have its defaults, and
//! are left out as Triton's own tools allow.

use super::{Datatype, ModelMetadata, TensorMetadata};
use serde::{Deserialize, Serialize};
#[cfg(feature = "schema")]
use utoipa::ToSchema;

/// How a model is run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct ModelConfig {
    /// The model.
    pub name: String,
    /// What recognizes frames.
    #[cfg_attr(feature = "schema", schema(example = "roomsight"))]
    pub platform: String,
    /// The same, by its newer name.
    #[cfg_attr(feature = "schema", schema(example = "roomsight"))]
    pub backend: String,
    /// Which versions answer.
    pub version_policy: VersionPolicy,
    /// 0: requests are not put together, and the shapes of the tensors name the number of frames themselves.
    pub max_batch_size: u32,
    /// What the model takes.
    pub input: Vec<TensorConfig>,
    /// What it gives.
    pub output: Vec<TensorConfig>,
    /// What works on it.
    pub instance_group: Vec<InstanceGroup>,
    /// The file that holds it.
    #[cfg_attr(feature = "schema", schema(example = "model.safetensors"))]
    pub default_model_filename: String,
    /// How requests and answers go together.
    pub model_transaction_policy: TransactionPolicy,
}

/// Which versions of a model answer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct VersionPolicy {
    /// These.
    pub specific: SpecificVersions,
}

/// Versions by number.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct SpecificVersions {
    /// Those that can be asked for.
    pub versions: Vec<u64>,
}

/// A tensor of a model.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({"name": "probabilities", "data_type": "TYPE_FP32", "dims": [-1, 9]})))]
pub struct TensorConfig {
    /// Its name.
    pub name: String,
    /// What its elements are.
    pub data_type: ConfigType,
    /// How many elements it has in each direction; -1: as many as there are frames.
    pub dims: Vec<i64>,
}

/// What the elements of a tensor are, as configurations name it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub enum ConfigType {
    /// Bytes of any length.
    #[serde(rename = "TYPE_STRING")]
    String,
    /// Floating-point numbers of 32 bits.
    #[serde(rename = "TYPE_FP32")]
    Fp32,
    /// True or false.
    #[serde(rename = "TYPE_BOOL")]
    Bool,
}

/// Threads that recognize.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct InstanceGroup {
    /// Of which model. All models share the threads.
    pub name: String,
    /// `KIND_CPU`.
    #[cfg_attr(feature = "schema", schema(example = "KIND_CPU"))]
    pub kind: String,
    /// How many there are.
    pub count: usize,
}

/// How requests and answers go together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct TransactionPolicy {
    /// False: each request has one answer.
    pub decoupled: bool,
}

impl From<Datatype> for ConfigType {
    fn from(datatype: Datatype) -> Self {
        match datatype {
            Datatype::Bytes => Self::String,
            Datatype::Fp32 => Self::Fp32,
            Datatype::Bool => Self::Bool,
        }
    }
}

impl From<TensorMetadata> for TensorConfig {
    fn from(TensorMetadata { name, datatype, shape }: TensorMetadata) -> Self {
        Self { name, data_type: datatype.into(), dims: shape }
    }
}

impl ModelConfig {
    /// Of a model with this metadata, whose `versions` answer on `n_threads` threads; `file` holds a version.
    pub fn new(metadata: ModelMetadata, versions: Vec<u64>, n_threads: usize, file: &str) -> Self {
        let configs = |tensors: Vec<TensorMetadata>| tensors.into_iter().map(TensorConfig::from).collect();
        Self {
            platform: metadata.platform.clone(),
            backend: metadata.platform,
            version_policy: VersionPolicy { specific: SpecificVersions { versions } },
            max_batch_size: 0,
            input: configs(metadata.inputs),
            output: configs(metadata.outputs),
            instance_group: vec![InstanceGroup {
                name: metadata.name.clone(),
                kind: "KIND_CPU".to_owned(),
                count: n_threads,
            }],
            default_model_filename: file.to_owned(),
            model_transaction_policy: TransactionPolicy { decoupled: false },
            name: metadata.name,
        }
    }
}
