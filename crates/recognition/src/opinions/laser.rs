//! Machines over the shape of the space around, as a laser measures it.

use crate::look::laser::LaserShape;
use crate::look::sight::Sight;
use crate::opinions::Tries;
use crate::opinions::calibration::Way;
use crate::opinions::whole::{Whole, WholeConfig};
use serde::{Deserialize, Serialize};

/// Support vector machines with the linear kernel, one a room, over the features of a scan. Frames without a scan, or
/// with one that does not reach as far as is looked at, show it nothing. The defaults were chosen on held-out frames
/// (docs/RESULTS.md).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LaserConfig {
    /// How scans are described.
    pub shape: LaserShape,
    /// The cost C of an error of the machines, see [`svm::Config::c`](crate::classify::svm::Config::c).
    pub c: f64,
}

impl Default for LaserConfig {
    fn default() -> Self {
        Self { shape: LaserShape::default(), c: 30.0 }
    }
}

impl LaserConfig {
    pub(crate) fn sight(&self) -> Sight {
        Sight::Laser(self.shape)
    }

    pub(crate) fn tries(&self) -> Vec<Tries> {
        vec![Tries { parameter: "c", values: &["3", "30", "300"] }]
    }

    pub(crate) fn way(&self) -> Way {
        Way::Softmax { prior_slope: 1.5 }
    }
}

impl WholeConfig for LaserConfig {
    fn c(&self) -> f64 {
        self.c
    }
}

/// The machines.
pub(crate) type Laser = Whole<LaserConfig>;
