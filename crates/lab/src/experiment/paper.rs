//! The papers whose experiments these are, and the database that they are on.

use super::{Drives, Experiment};
use roomsight_vision::camera::CameraKind;
use serde::Serialize;

/// The data of both papers.
pub const COLD: &str = "Pronobis, Caputo, \u{201c}COLD: The CoSy Localization Database\u{201d}, The \
                        International Journal of Robotics Research 28(5), 2009";

/// A paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Paper {
    /// Bags of words over local features of omnidirectional frames.
    Lu,
    /// The match kernel over local features of perspective frames.
    Ullah,
}

impl Paper {
    /// As lists of references have it.
    pub fn citation(self) -> &'static str {
        match self {
            Self::Lu => {
                "Lu, Li, Zhang, Hu, Zheng, \u{201c}Robust place recognition based on omnidirectional vision and real-time \
                 local visual features for mobile robots\u{201d}"
            }
            Self::Ullah => {
                "Ullah, Pronobis, Caputo, Luo, Jensfelt, Christensen, \u{201c}Towards robust place recognition for robot \
                 localization\u{201d}, IEEE International Conference on Robotics and Automation (ICRA), 2008"
            }
        }
    }

    /// Whose frames it is on.
    pub fn camera(self) -> CameraKind {
        match self {
            Self::Lu => CameraKind::Omnidirectional,
            Self::Ullah => CameraKind::Perspective,
        }
    }

    /// Whether the drives are named as those that it reports on, and seen by its camera. The lab of each figure of Ullah
    /// stands beside it; those of Lu are all of Saarbruecken.
    pub(super) fn is_on(self, drives: &Drives) -> bool {
        let is_its_lab = |lab: &String| self == Self::Ullah || lab.contains("saarbruecken");
        drives.labs().iter().any(is_its_lab)
            && drives.iter().all(|drive| drive.camera.projection.kind() == self.camera())
    }
}

impl Experiment {
    /// Whose it is; none for what is beside the papers.
    pub fn paper(self) -> Option<Paper> {
        match self {
            Self::Opinions => None,
            Self::Dynamic | Self::Geographic | Self::Categorical => Some(Paper::Ullah),
            _ => Some(Paper::Lu),
        }
    }
}
