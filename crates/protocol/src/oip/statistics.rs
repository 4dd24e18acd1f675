//! What models have done since the service started, as Triton's extension `statistics` tells it.
//!
//! Every frame counts as one inference, whatever brought it: a request of this protocol, another one, or a
//! stream. Triton's steps are these: `queue` is the wait for a thread, `compute_input` the way from bytes to
//! pixels, `compute_infer` from pixels to probabilities; writing the answer is not measured.

use serde::{Deserialize, Serialize};
use std::time::Duration;
#[cfg(feature = "schema")]
use utoipa::ToSchema;

/// What models have done.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct StatisticsList {
    /// One entry for each version that can answer.
    pub model_stats: Vec<ModelStatistics>,
}

/// What one version of a model has done since the service started.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct ModelStatistics {
    /// The model.
    pub name: String,
    /// The version.
    pub version: String,
    /// When the last frame was answered, in milliseconds since 1970; 0: none was.
    pub last_inference: u64,
    /// How many frames were answered.
    pub inference_count: u64,
    /// The same: each frame is looked at by itself.
    pub execution_count: u64,
    /// How long the frames took, together.
    pub inference_stats: InferenceStatistics,
    /// The same by the number of frames that are looked at together, which is 1; empty before the first.
    pub batch_stats: Vec<BatchStatistics>,
}

/// How long frames took, together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct InferenceStatistics {
    /// Frames that were answered, from their arrival in the queue on.
    pub success: StepStatistics,
    /// Frames that were not. How long they took is not measured.
    pub fail: StepStatistics,
    /// The wait for a thread.
    pub queue: StepStatistics,
    /// From bytes to pixels.
    pub compute_input: StepStatistics,
    /// From pixels to probabilities.
    pub compute_infer: StepStatistics,
    /// Writing the answer, which is not measured.
    pub compute_output: StepStatistics,
    /// Answers that were kept: none is.
    pub cache_hit: StepStatistics,
    /// The same.
    pub cache_miss: StepStatistics,
}

/// How often a step was done, and how long that took together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct StepStatistics {
    /// How often.
    pub count: u64,
    /// How long, in nanoseconds.
    pub ns: u64,
}

/// How long frames took that were looked at together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct BatchStatistics {
    /// How many at once.
    pub batch_size: u64,
    /// From bytes to pixels.
    pub compute_input: StepStatistics,
    /// From pixels to probabilities.
    pub compute_infer: StepStatistics,
    /// Writing the answer, which is not measured.
    pub compute_output: StepStatistics,
}

/// What was counted of the frames of one version.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameTotals {
    /// Frames that were answered.
    pub n_answered: u64,
    /// Frames whose callers got an error.
    pub n_failed: u64,
    /// When the last one was answered, in milliseconds since 1970; 0: none was.
    pub last_ms: u64,
    /// How long those that were answered waited for a thread, together.
    pub queue: Duration,
    /// How long they took from bytes to pixels.
    pub decode: Duration,
    /// How long they took from pixels to probabilities.
    pub recognize: Duration,
}

impl ModelStatistics {
    /// Of a version of a model.
    pub fn new(name: &str, version: u64, totals: FrameTotals) -> Self {
        let step = |took: Duration| StepStatistics {
            count: totals.n_answered,
            ns: u64::try_from(took.as_nanos()).unwrap_or(u64::MAX),
        };
        let inference_stats = InferenceStatistics {
            success: step(totals.queue + totals.decode + totals.recognize),
            fail: StepStatistics { count: totals.n_failed, ns: 0 },
            queue: step(totals.queue),
            compute_input: step(totals.decode),
            compute_infer: step(totals.recognize),
            compute_output: step(Duration::ZERO),
            ..InferenceStatistics::default()
        };
        let InferenceStatistics { compute_input, compute_infer, compute_output, .. } = inference_stats;
        let one_by_one = BatchStatistics { batch_size: 1, compute_input, compute_infer, compute_output };
        Self {
            name: name.to_owned(),
            version: version.to_string(),
            last_inference: totals.last_ms,
            inference_count: totals.n_answered,
            execution_count: totals.n_answered,
            inference_stats,
            batch_stats: if totals.n_answered > 0 { vec![one_by_one] } else { Vec::new() },
        }
    }
}
