//! The simulated drive that all benchmarks take their frames from.

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first surprise")]

use roomsight_lab::simulate::{Illumination, Lab, Part, Route, SequenceSpec, Simulation};

/// Saarbruecken, part B, standard path, cloudy.
pub fn drive(frames_per_second: f32) -> Simulation {
    let spec = SequenceSpec {
        lab: Lab::Saarbruecken,
        part: Part::B,
        route: Route::Standard,
        illumination: Illumination::Cloudy,
        run: 1,
        seed: 0,
        frames_per_second,
    };
    Simulation::new(&spec).unwrap()
}
