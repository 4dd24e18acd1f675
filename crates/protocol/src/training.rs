//! Trainings that the service runs.

use serde::{Deserialize, Serialize};
#[cfg(feature = "schema")]
use utoipa::ToSchema;

/// What is to be trained.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(deny_unknown_fields)]
pub struct TrainingJson {
    /// The data set.
    pub set: String,
    /// The name of the model that it is to be a version of.
    pub model: String,
    /// How much a frame may cost; left out: as `train` does by itself.
    #[serde(default)]
    pub effort: TrainingEffort,
    /// The camera, as `train --camera` takes it; left out: perspective.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<TrainingCamera>,
}

/// How much a frame may cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum TrainingEffort {
    /// A few milliseconds.
    Fast,
    /// What is usual.
    #[default]
    Default,
    /// More, for more right answers.
    Best,
}

/// What made the frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum TrainingCamera {
    /// An ordinary lens.
    Perspective,
    /// A panorama, twice as wide as high.
    Equirectangular,
    /// A mirror.
    Omnidirectional,
}

/// The trainings there were.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct TrainingList {
    /// The newest first.
    pub trainings: Vec<TrainingInfo>,
}

/// A training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct TrainingInfo {
    /// Its number.
    pub id: i64,
    /// The data set.
    pub set: String,
    /// The name of the model.
    pub model: String,
    /// How much a frame may cost.
    pub effort: TrainingEffort,
    /// How far it has come.
    pub state: TrainingState,
    /// What it does just now.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<String>,
    /// How much of that is done, 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub progress: Option<f64>,
    /// When it began, by RFC 3339.
    pub began_at: String,
    /// When it ended, by RFC 3339.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ended_at: Option<String>,
    /// Who began it: the name of a key, an address, or `policy`.
    pub by: String,
    /// Why it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// The share of held-out frames that were answered right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
    /// How many frames it learned from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub n_frames: Option<usize>,
    /// How the model does beside the version that served when it was trained.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub comparison: Option<ModelComparison>,
    /// The version that it became.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub published: Option<PublishedVersion>,
    /// What it said, line by line; of one training only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log: Option<Vec<String>>,
    /// What `roomsight train --json` printed; of one training only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Option<Object>))]
    pub report: Option<serde_json::Value>,
}

/// How far a training has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum TrainingState {
    /// It is under way.
    Running,
    /// There is a model.
    Done,
    /// There is none.
    Failed,
    /// Somebody wanted none any more.
    Cancelled,
}

/// How a model does beside another one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct ModelComparison {
    /// The other one, the version that served.
    pub serving: String,
    /// What both were compared on.
    pub compared_on: ComparedOn,
    /// How the other one did.
    pub before: RightOf,
    /// How the model did.
    pub now: RightOf,
    /// Whether it is worse by more than chance.
    pub is_worse: bool,
}

/// What two models are compared by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum ComparedOn {
    /// Frames that neither had learned when it answered them.
    SameFrames,
    /// The frames that each held out when it was trained.
    OwnHeldOut,
}

/// How many frames are right, of how many.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RightOf {
    /// So many are right.
    pub n_right: usize,
    /// Of so many.
    pub n_frames: usize,
}

/// A version of a model.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct PublishedVersion {
    /// The model's name.
    pub name: String,
    /// The version's number.
    pub version: u64,
}

/// How a trained model is to be published.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(deny_unknown_fields)]
pub struct PublishJson {
    /// Also where the version that serves answers more frames right.
    #[serde(default)]
    pub even_if_worse: bool,
}

/// What follows from labels by itself.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LearningPolicy {
    /// The data set that is trained on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub set: Option<String>,
    /// The model that gets a version.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// How much a frame may cost.
    #[serde(default)]
    pub effort: TrainingEffort,
    /// What made the frames; left out: an ordinary lens.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<TrainingCamera>,
    /// Train when so many frames were labelled since the last training; 0: never.
    #[serde(default)]
    pub train_after: u64,
    /// How far a model that is not worse may go by itself.
    #[serde(default)]
    pub publish: PublishAs,
}

/// What a trained model becomes by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum PublishAs {
    /// Nothing: a person decides.
    #[default]
    Nothing,
    /// It sees what the stable version sees, and answers nobody.
    Shadow,
    /// It answers a tenth of the robots.
    Canary,
    /// It answers.
    Stable,
}
