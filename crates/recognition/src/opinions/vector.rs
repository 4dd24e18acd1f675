//! Machines over what a network says of the whole frame.

use crate::look::lens::Lens;
use crate::look::sight::Sight;
use crate::opinions::Tries;
use crate::opinions::calibration::Way;
use crate::opinions::whole::{Whole, WholeConfig};
use serde::{Deserialize, Serialize};

/// Support vector machines with the linear kernel, one a room, over the vector of a network. The defaults were
/// chosen on held-out frames (docs/RESULTS.md).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VectorConfig {
    /// The network.
    pub lens: Lens,
    /// The cost C of an error of the machines, see [`svm::Config::c`](crate::classify::svm::Config::c).
    pub c: f64,
}

impl Default for VectorConfig {
    fn default() -> Self {
        Self { lens: Lens::default(), c: 1.0 }
    }
}

impl VectorConfig {
    pub(crate) fn sight(&self) -> Sight {
        Sight::Vector(self.lens.clone())
    }

    pub(crate) fn tries(&self) -> Vec<Tries> {
        vec![Tries { parameter: "c", values: &["0.3", "1", "3", "10"] }]
    }

    pub(crate) fn way(&self) -> Way {
        // Machines of a small cost of errors stay nearer to zero.
        Way::Softmax { prior_slope: if self.c < 3.0 { 4.0 } else { 3.0 } }
    }
}

impl WholeConfig for VectorConfig {
    fn c(&self) -> f64 {
        self.c
    }

    fn lens_mut(&mut self) -> Option<&mut Lens> {
        Some(&mut self.lens)
    }
}

/// The machines.
pub(crate) type Vector = Whole<VectorConfig>;
