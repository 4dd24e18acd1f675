//! What the frames of one robot say together.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use roomsight_recognition::filter::{Interval, RoomFilter, Trust};
use roomsight_recognition::model::{self, Model, Pose, Recognition};
use std::sync::{Arc, Mutex, PoisonError};

/// The belief about where a robot is, for frames of one model.
#[pyclass(frozen, module = "roomsight._core")]
pub struct Filter {
    model: Arc<Model>,
    followed: Mutex<Followed>,
}

/// What is known of a robot.
struct Followed {
    filter: RoomFilter,
    /// Where it was when the last frame was taken, by its wheels.
    at: Option<Pose>,
}

/// What a filter says, as `roomsight.Filtered` has it.
#[derive(IntoPyObject)]
pub struct Filtered {
    room: String,
    known: bool,
    probability: f32,
    probabilities: Vec<RoomProbability>,
    novelty: Option<f32>,
}

/// A room and its probability, from 0 to 1.
#[derive(IntoPyObject)]
pub struct RoomProbability {
    pub room: String,
    pub probability: f32,
}

impl Filter {
    /// One that has seen nothing.
    ///
    /// # Errors
    /// `ValueError` where `trust` is none.
    pub fn new(model: Arc<Model>, trust: Option<f32>) -> PyResult<Self> {
        let trust = trust.map_or(Ok(Trust::default()), Trust::try_from);
        let trust = trust.map_err(|error| PyValueError::new_err(error.to_string()))?;
        let filter = RoomFilter::new(model.rooms().len(), trust);
        Ok(Self { model, followed: Mutex::new(Followed { filter, at: None }) })
    }

    /// Takes in a frame of the filter's model, `elapsed` seconds after the one before, taken there by the wheels.
    pub fn update(
        &self,
        recognition: &Recognition,
        elapsed: f64,
        at: Option<Pose>,
        top: Option<usize>,
    ) -> Filtered {
        let mut followed = self.followed.lock().unwrap_or_else(PoisonError::into_inner);
        let since = Interval::between(elapsed, followed.at, at);
        followed.at = at;
        let filter = &mut followed.filter;
        filter.update(self.model.transitions(), since, recognition.observation());
        let (rooms, room_idx) = (self.model.rooms(), filter.room_idx());
        Filtered {
            room: rooms[room_idx].clone(),
            known: self.model.knows(filter),
            probability: filter.belief()[room_idx],
            probabilities: by_probability(rooms, filter.belief(), top),
            novelty: filter.novelty(),
        }
    }

    /// Whether its frames are those of this model.
    pub fn is_of(&self, model: &Arc<Model>) -> bool {
        Arc::ptr_eq(&self.model, model)
    }
}

/// The `top` most probable rooms, or all, the most probable first.
pub fn by_probability(rooms: &[String], probabilities: &[f32], top: Option<usize>) -> Vec<RoomProbability> {
    let room = |idx: usize| RoomProbability { room: rooms[idx].clone(), probability: probabilities[idx] };
    model::by_probability(probabilities, top).into_iter().map(room).collect()
}
