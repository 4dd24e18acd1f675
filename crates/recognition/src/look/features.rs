//! What a frame shows, before it is classified.

use crate::look::flaw::Flaw;
use crate::look::sight::{Seen, Sight};
use roomsight_vision::detect::Keypoint;
use roomsight_vision::matrix::Matrix;
use std::sync::Arc;

/// What a frame shows, before it is classified.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// How it was looked at: [`Config::sights`](crate::model::Config::sights) of the extractor's
    /// configuration. A model that looks in fewer of these ways
    /// can classify it.
    pub sights: Arc<Vec<Sight>>,
    /// What each of these saw.
    pub seen: Vec<Seen>,
    /// Pixels of the frame as it came for one pixel at working size, at least 1.
    pub scale: f32,
    /// Why nothing can be seen in the picture, if so.
    pub flaw: Option<Flaw>,
}

impl Features {
    /// The keypoints of all sights.
    pub fn keypoints(&self) -> impl Iterator<Item = &Keypoint> {
        self.seen.iter().filter_map(Seen::local).flat_map(|local| &local.keypoints)
    }

    /// The descriptors of the first sight that has keypoints, even if it found none; none without such a sight.
    pub fn descriptors(&self) -> Option<&Matrix> {
        self.seen.iter().find_map(Seen::local).map(|local| &local.descriptors)
    }

    /// What one sight sees; `None` where the extractor was not configured to look so.
    pub fn of(&self, sight: &Sight) -> Option<&Seen> {
        self.sights.iter().zip(&self.seen).find(|(other, _)| *other == sight).map(|(_, seen)| seen)
    }

    /// Whether the scan of a laser showed something.
    pub(crate) fn has_scan(&self) -> bool {
        let mut seen = self.sights.iter().zip(&self.seen);
        seen.any(|(sight, seen)| sight.laser().is_some() && !seen.is_nothing())
    }

    /// Why nothing can be seen in the frame, if so: where a scan shows something, no picture hides that.
    pub(crate) fn hidden(&self) -> Option<Flaw> {
        self.flaw.filter(|_| !self.has_scan())
    }

    /// The number of keypoints that were found.
    pub fn n_keypoints(&self) -> usize {
        self.keypoints().count()
    }

    /// What some of the sights saw.
    pub(crate) fn through(&self, sights: &[Sight]) -> Vec<&Seen> {
        sights.iter().filter_map(|sight| self.of(sight)).collect()
    }

    /// What each sight saw.
    pub(crate) fn by_sight(self) -> Vec<(Sight, Seen)> {
        self.sights.iter().cloned().zip(self.seen).collect()
    }
}
