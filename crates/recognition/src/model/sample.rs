//! Labeled frames.

use crate::look::features::Features;
use crate::model::pose::Pose;

/// One labeled frame, described.
#[derive(Clone, Debug)]
pub struct Sample {
    /// The room that it shows, or [`ELSEWHERE`].
    pub room: String,
    /// The drive that it comes from; empty when unknown.
    pub sequence: String,
    /// What it is called, such as its path in the data set; may be empty.
    pub name: String,
    /// Where it was taken, if that is known.
    pub pose: Option<Pose>,
    /// What tells its picture from others: the first bytes of the BLAKE3 digest of its file, if it came from one.
    pub picture: Option<u64>,
    /// What an [`Extractor`](crate::model::Extractor) of the model's configuration and camera found.
    pub features: Features,
}

/// The place of frames that show none of the rooms: they tell what new places look like, and are never a room.
pub const ELSEWHERE: &str = "elsewhere";

impl Sample {
    /// Whether it shows none of the rooms.
    pub fn is_elsewhere(&self) -> bool {
        self.room == ELSEWHERE
    }
}
