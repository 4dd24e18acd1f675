//! How the cameras do, each second, as ROS 2 collects it: `/diagnostics`.

use super::Node;
use super::camera::{ANSWERS, State, Watched, nanoseconds};
use crate::cli::manners::note;
use roomsight_ros::{DIAGNOSTIC_ARRAY, Diagnostics as Message, Header, Level, Publisher, Status};
use std::convert::Infallible;
use std::sync::Arc;
use std::time::{Duration, SystemTime};
use tokio::time::{MissedTickBehavior, interval};

const TOPIC: &str = "/diagnostics";

const GAP: Duration = Duration::from_secs(1);

/// Without a picture for so long, something is wrong.
const SILENCE: Duration = Duration::from_secs(5);

/// Tells how the cameras do.
pub(super) struct Diagnostics {
    node: String,
    cameras: Vec<Arc<Watched>>,
    publisher: Publisher,
    /// Whether it was said that no picture comes.
    is_silence_told: Vec<bool>,
}

impl Diagnostics {
    pub(super) async fn open(node: &Node, cameras: Vec<Arc<Watched>>) -> anyhow::Result<Self> {
        let topic = node.topic(TOPIC)?;
        let publisher = node.session.publisher(&topic, &DIAGNOSTIC_ARRAY, ANSWERS).await?;
        let is_silence_told = vec![false; cameras.len()];
        Ok(Self { node: node.name.to_string(), cameras, publisher, is_silence_told })
    }

    /// Tells it for ever.
    pub(super) async fn work(mut self) -> Infallible {
        let mut ticks = interval(GAP);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
        loop {
            ticks.tick().await;
            let status = self.cameras.iter().map(|camera| status(&self.node, camera)).collect();
            let header = Header { stamp_ns: nanoseconds(SystemTime::now()), frame_id: String::new() };
            // Where the network is gone for a while, it is told again in a second.
            let _ = self.publisher.publish(Message { header, status }.to_cdr()).await;
            for (camera, is_told) in self.cameras.iter().zip(&mut self.is_silence_told) {
                let is_silent = camera.state().last.elapsed() > SILENCE;
                if is_silent && !*is_told {
                    note!("note: no picture comes on {}", camera.topic);
                }
                *is_told = is_silent;
            }
        }
    }
}

fn status(node: &str, camera: &Watched) -> Status {
    let state = camera.state().clone();
    let silence = state.last.elapsed();
    let (level, message) = match &state {
        State { problem: Some(problem), .. } => (Level::Error, problem.clone()),
        _ if silence > SILENCE => (Level::Warning, format!("no picture for {} s", silence.as_secs())),
        State { room: Some(room), .. } => (Level::Ok, format!("room: {room}")),
        _ => (Level::Ok, "room: not known".to_owned()),
    };
    let name = camera.name.as_deref().unwrap_or("room");
    let counts = [
        ("received", state.n_received),
        ("answered", state.n_answered),
        ("superseded", state.n_superseded),
        ("failed", state.n_failed),
    ];
    let values = counts.map(|(name, count)| (name.to_owned(), count.to_string())).to_vec();
    Status { level, name: format!("{node}: {name}"), message, values }
}
