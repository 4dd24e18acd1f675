//! What services of a fleet tell each other, as JSON over NATS: under `SUBJECT.robots.SERVICE` and `SUBJECT.events.SERVICE`.

use crate::event::{Event, RobotState};
use serde::{Deserialize, Serialize};
#[cfg(feature = "schema")]
use utoipa::{IntoParams, ToSchema};

/// Whose robots and events are asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
#[serde(rename_all = "lowercase")]
pub enum Scope {
    /// Those of the service that is asked.
    #[default]
    Service,
    /// Those of all services that tell each other (the setting `nats`); of a service alone its own.
    Fleet,
}

/// The query of calls about robots and events.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(IntoParams))]
#[serde(deny_unknown_fields, default)]
#[cfg_attr(feature = "schema", into_params(parameter_in = Query))]
pub struct ScopeQuery {
    /// Whose; left out: those of the service that is asked.
    #[cfg_attr(feature = "schema", param(inline))]
    pub scope: Scope,
}

/// Robots of one service that changed, or all in turn, since listeners come later and messages get lost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FleetRobots {
    /// The robots as they are.
    pub robots: Vec<RobotState>,
    /// The ids under which no robot is found there any more.
    pub gone: Vec<String>,
    /// Whether the service stops: none is found there any more.
    #[serde(default)]
    pub stops: bool,
}

/// Something that happened at a service; never an answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FleetEvent {
    /// What happened.
    pub event: Event,
}
