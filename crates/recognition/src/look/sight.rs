//! What opinions see of a frame.

use crate::look::laser::LaserShape;
use crate::look::lens::Lens;
use crate::look::local::LocalFeatures;
use roomsight_vision::camera::CameraKind;
use roomsight_vision::describe::{Descriptor, FrameLbp, SiftDescriptor};
use roomsight_vision::detect::Detector;
use roomsight_vision::matrix::Matrix;
use roomsight_vision::network::XFeat;
use roomsight_vision::plane::Levels;
use serde::Serialize;

/// The most memory that the scale space of one frame may take.
const MAX_SCALE_SPACE_BYTES: u64 = 1 << 30;

/// A way to look at a frame. Opinions that look the same way share what is seen.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Sight {
    /// Keypoints, each described.
    Keypoints {
        /// How they are found.
        detector: Detector,
        /// How they are described.
        descriptor: Descriptor,
    },
    /// Histograms of the local binary patterns of the whole frame.
    Patterns(FrameLbp),
    /// The vector of a network.
    Vector(Lens),
    /// The cells of a network's grid, each described.
    Grid {
        /// The network.
        lens: Lens,
        /// Which of its grids.
        grid: String,
    },
    /// Keypoints of a network that finds and describes them as XFeat does.
    XFeat {
        /// The network.
        lens: Lens,
        /// The most keypoints of a frame.
        target: usize,
    },
    /// The shape of the space around, by the scan of a laser beside the picture.
    Laser(LaserShape),
}

/// What a look at a frame costs, about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum LookCost {
    /// A millisecond or two.
    Cheap,
    /// That of a scale space.
    ScaleSpace,
    /// That of a network.
    Network,
}

/// What is seen of a frame in one way.
#[derive(Clone, Debug, PartialEq)]
pub enum Seen {
    /// Places in the frame, each described.
    Local(LocalFeatures),
    /// The frame as a whole: as many numbers as all frames have; none where nothing could be seen.
    Whole(Vec<f32>),
}

impl Sight {
    /// The length of a descriptor, or of what is seen of the whole frame.
    pub(crate) fn n_dimensions(&self, camera: CameraKind) -> usize {
        match self {
            Self::Keypoints { descriptor, .. } => descriptor.n_dimensions(),
            Self::Patterns(histograms) => histograms.n_dimensions(camera),
            Self::Vector(lens) => lens.vector_len(),
            Self::Grid { lens, grid } => lens.grid_len(grid),
            Self::XFeat { .. } => XFeat::N_DIMENSIONS,
            Self::Laser(_) => LaserShape::N_DIMENSIONS,
        }
    }

    /// Whether it sees places in a frame, each described; else the frame as a whole.
    pub(crate) fn sees_places(&self) -> bool {
        match self {
            Self::Keypoints { .. } | Self::Grid { .. } | Self::XFeat { .. } => true,
            Self::Patterns(_) | Self::Vector(_) | Self::Laser(_) => false,
        }
    }

    /// How it looks at the scan of a laser, if it does; else it looks at the picture.
    pub(crate) fn laser(&self) -> Option<&LaserShape> {
        match self {
            Self::Laser(shape) => Some(shape),
            _ => None,
        }
    }

    /// Whether it looks at colors, where a frame has any.
    pub(crate) fn wants_colors(&self) -> bool {
        match self {
            Self::Keypoints { .. } | Self::Patterns(_) | Self::Laser(_) => false,
            Self::Vector(_) | Self::Grid { .. } | Self::XFeat { .. } => true,
        }
    }

    /// What is wrong with the parameters for frames of this longest side, if anything.
    pub(crate) fn check(&self, longest_side: usize) -> Result<(), String> {
        match self {
            Self::Keypoints { detector, descriptor } => {
                detector.check()?;
                descriptor.check()?;
                if detector.repeats_points() && !descriptor.is_scaled() {
                    return Err("a grid of several scales needs a descriptor that grows with them: set \
                                descriptor.region.scaled to true, or give detector.scales one number"
                        .to_owned());
                }
                let longest_side = detector.longest_side().unwrap_or(longest_side);
                check_scale_space(detector, descriptor, longest_side)
            }
            Self::Patterns(histograms) => histograms.check(),
            Self::Laser(shape) => shape.check(),
            Self::Vector(lens) => {
                lens.check()?;
                match lens.vector_len() {
                    0 => Err(format!("the network {} has no vector", lens.network)),
                    _ => Ok(()),
                }
            }
            Self::Grid { lens, grid } => {
                lens.check()?;
                match lens.grid_len(grid) {
                    0 => Err(format!("the network {} has no grid {grid}", lens.network)),
                    _ => Ok(()),
                }
            }
            Self::XFeat { lens, target } => {
                lens.check()?;
                match (lens.has_xfeat(), target) {
                    (false, _) => Err(format!("the network {} finds no keypoints", lens.network)),
                    (true, 1..=100_000) => Ok(()),
                    _ => Err(format!("a detector's target must be from 1 to 100000 keypoints, not {target}")),
                }
            }
        }
    }
}

/// Those of the scale space that is looked at, if one is.
fn levels(detector: &Detector, descriptor: &Descriptor) -> Option<Levels> {
    match (detector.levels(), descriptor) {
        (Some(levels), _) => Some(levels),
        (None, Descriptor::Sift(_)) => Some(SiftDescriptor::LEVELS),
        _ => None,
    }
}

/// Refuses frames whose blurred copies would fill the memory of the machine.
fn check_scale_space(
    detector: &Detector,
    descriptor: &Descriptor,
    longest_side: usize,
) -> Result<(), String> {
    let Some(levels) = levels(detector, descriptor) else { return Ok(()) };
    let n_bytes = levels.max_bytes(longest_side);
    if n_bytes > MAX_SCALE_SPACE_BYTES {
        return Err(format!(
            "the scale space of a frame of {longest_side} pixels a side takes up to {:.1} GiB a thread, at most 1 is \
             allowed: lower longest_side, or look for features at fewer levels",
            n_bytes as f64 / (1_u64 << 30) as f64
        ));
    }
    Ok(())
}

impl Sight {
    /// What it costs.
    pub(crate) fn cost(&self) -> LookCost {
        match self {
            Self::Keypoints { detector, descriptor } => match levels(detector, descriptor) {
                Some(_) => LookCost::ScaleSpace,
                None => LookCost::Cheap,
            },
            Self::Patterns(_) | Self::Laser(_) => LookCost::Cheap,
            Self::Vector(_) | Self::Grid { .. } | Self::XFeat { .. } => LookCost::Network,
        }
    }

    /// The network that it looks through, if it does.
    pub(crate) fn lens(&self) -> Option<&Lens> {
        match self {
            Self::Keypoints { .. } | Self::Patterns(_) | Self::Laser(_) => None,
            Self::Vector(lens) | Self::Grid { lens, .. } | Self::XFeat { lens, .. } => Some(lens),
        }
    }
}

impl Seen {
    /// Whether nothing could be seen.
    pub fn is_nothing(&self) -> bool {
        self.descriptors().is_none() && self.whole().is_none()
    }

    /// The local features, if it is of such.
    pub fn local(&self) -> Option<&LocalFeatures> {
        match self {
            Self::Local(local) => Some(local),
            Self::Whole(_) => None,
        }
    }

    /// The descriptors of the local features, if it is of such and there are any.
    pub fn descriptors(&self) -> Option<&Matrix> {
        self.local().map(|local| &local.descriptors).filter(|descriptors| descriptors.n_rows() > 0)
    }

    /// What is seen of the whole frame, if it is of such and there is anything.
    pub fn whole(&self) -> Option<&[f32]> {
        match self {
            Self::Whole(values) if !values.is_empty() => Some(values),
            _ => None,
        }
    }
}
