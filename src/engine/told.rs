//! What the core says, as it travels.

use roomsight_protocol::rest::{RoomProbability, Unknown};
use roomsight_recognition::model;

/// Why an answer is not known, as it travels.
pub fn unknown(why: model::Unknown) -> Unknown {
    match why {
        model::Unknown::Unsure => Unknown::Unsure,
        model::Unknown::NewPlace => Unknown::NewPlace,
        model::Unknown::NoDetail => Unknown::NoDetail,
        model::Unknown::Dark => Unknown::Dark,
        model::Unknown::Covered => Unknown::Covered,
    }
}

/// The `top` most probable rooms, or all, the most probable first.
pub fn by_probability(rooms: &[String], probabilities: &[f32], top: Option<usize>) -> Vec<RoomProbability> {
    let room = |idx: usize| RoomProbability { room: rooms[idx].clone(), probability: probabilities[idx] };
    model::by_probability(probabilities, top).into_iter().map(room).collect()
}
