//! The kind of camera a frame comes from, and where its pixels are valid.

use serde::{Deserialize, Serialize};

/// How a camera projects the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraKind {
    /// An ordinary lens.
    Perspective,
    /// A full panorama, longitude by latitude; the left and right edges meet.
    Equirectangular,
    /// A camera that looks up into a curved mirror.
    Omnidirectional,
}
