//! Machines over the local binary patterns of the whole frame.

use crate::look::sight::Sight;
use crate::opinions::Tries;
use crate::opinions::calibration::Way;
use crate::opinions::whole::{Whole, WholeConfig};
use roomsight_vision::describe::FrameLbp;
use serde::{Deserialize, Serialize};

/// Support vector machines with the linear kernel, one a room, over histograms of the whole frame. The defaults
/// were chosen on held-out frames (docs/RESULTS.md).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PatternsConfig {
    /// The histograms.
    pub histograms: FrameLbp,
    /// The cost C of an error of the machines, see [`svm::Config::c`](crate::classify::svm::Config::c).
    pub c: f64,
}

impl Default for PatternsConfig {
    fn default() -> Self {
        Self { histograms: FrameLbp::default(), c: 10.0 }
    }
}

impl PatternsConfig {
    pub(crate) fn sight(&self) -> Sight {
        Sight::Patterns(self.histograms.clone())
    }

    pub(crate) fn tries(&self) -> Vec<Tries> {
        vec![Tries { parameter: "c", values: &["1", "10", "100"] }]
    }

    pub(crate) fn way(&self) -> Way {
        Way::Softmax { prior_slope: 1.5 }
    }
}

impl WholeConfig for PatternsConfig {
    fn c(&self) -> f64 {
        self.c
    }
}

/// The machines.
pub(crate) type Patterns = Whole<PatternsConfig>;
