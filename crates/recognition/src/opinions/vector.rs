//! Machines over what a network says of the whole frame.

use crate::classify::svm;
use crate::look::lens::Lens;
use crate::look::sight::Sight;
use crate::opinions::calibration::Way;
use crate::opinions::whole::{WHOLE_SIGNS, Whole, WholeConfig};
use crate::opinions::{Sign, Tries};
use serde::{Deserialize, Serialize};

/// Support vector machines with the linear kernel, one a room, over the vector of a network. The defaults were
/// chosen on held-out frames (docs/RESULTS.md).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VectorConfig {
    /// The network.
    pub lens: Lens,
    /// The cost C of an error of the machines, see [`svm::Config::c`].
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

    pub(crate) fn lens_mut(&mut self) -> Option<&mut Lens> {
        Some(&mut self.lens)
    }

    pub(crate) fn check(&self) -> Result<(), String> {
        self.machines().check().map_err(|error| error.to_string())
    }

    pub(crate) fn is_random(&self) -> bool {
        false
    }

    pub(crate) fn tries(&self) -> Vec<Tries> {
        vec![Tries { parameter: "c", values: &["0.3", "1", "3", "10"] }]
    }

    pub(crate) fn way(&self) -> Way {
        // Machines of a small cost of errors stay nearer to zero.
        Way::Softmax { prior_slope: if self.c < 3.0 { 4.0 } else { 3.0 } }
    }

    pub(crate) fn prior_weight(&self) -> f64 {
        1.0
    }

    pub(crate) fn signs(&self) -> &'static [Sign] {
        &WHOLE_SIGNS
    }
}

impl WholeConfig for VectorConfig {
    fn machines(&self) -> svm::Config {
        svm::Config { c: self.c, ..svm::Config::default() }
    }
}

/// The machines.
pub(crate) type Vector = Whole<VectorConfig>;
