//! How the rooms of a model lie, for maps.

use serde::{Deserialize, Serialize};
#[cfg(feature = "schema")]
use utoipa::ToSchema;

/// How the rooms of a model lie.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct ModelMap {
    /// All rooms.
    pub rooms: Vec<String>,
    /// Which room leads to which, as it was learned.
    pub transitions: Vec<RoomTransition>,
    /// Where training frames were taken, at most 2000; empty where they came without poses.
    pub positions: Vec<MapPosition>,
}

/// A way from one room to another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct RoomTransition {
    /// The room that is left.
    pub from: String,
    /// The next one.
    pub to: String,
    /// How often who leaves the one comes to the other next, 0 to 1.
    pub rate: f32,
}

/// Where a training frame was taken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(ToSchema))]
pub struct MapPosition {
    /// Its room.
    pub room: String,
    /// In meters.
    pub x: f64,
    /// In meters.
    pub y: f64,
}
