//! What a version has learned of how rooms lie, for maps.

use crate::engine::registry::LookupError;
use crate::http::App;
use crate::problem::Problem;
use roomsight_protocol::map::{MapPosition, ModelMap, RoomTransition};
use roomsight_protocol::version_id::VersionId;
use roomsight_recognition::model::Model;

/// The most positions that are told.
const MAX_POSITIONS: usize = 2000;
/// Transitions that are rarer than this say nothing.
const LEAST_RATE: f32 = 0.001;

/// The map of a version that is in memory.
pub fn map(app: &App, id: &VersionId) -> Result<ModelMap, Problem> {
    let entry = app.engine.registry.entry(&id.name)?;
    let loaded = entry.version(&id.name, id.version)?.loaded().cloned();
    let loaded = loaded.ok_or_else(|| LookupError::NotReady(id.name.clone(), id.version))?;
    Ok(map_of(&loaded.model))
}

fn map_of(model: &Model) -> ModelMap {
    let rooms = model.rooms();
    let next = model.transitions().next();
    let transitions = (0..rooms.len()).flat_map(|from| {
        let leads = next.row(from).iter().enumerate().filter(|&(_, &rate)| rate >= LEAST_RATE);
        leads.map(move |(to, &rate)| RoomTransition {
            from: rooms[from].clone(),
            to: rooms[to].clone(),
            rate,
        })
    });
    let positions: Vec<_> = model.positions().collect();
    // Every so many of them, so that all drives are among them.
    let step = positions.len().div_ceil(MAX_POSITIONS).max(1);
    let positions = positions.into_iter().step_by(step);
    ModelMap {
        rooms: rooms.to_vec(),
        transitions: transitions.collect(),
        positions: positions
            .map(|(room_idx, pose)| MapPosition { room: rooms[room_idx].clone(), x: pose.x, y: pose.y })
            .collect(),
    }
}
