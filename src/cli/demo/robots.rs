//! Robots that drive through the simulated lab again and again, for the page.

use anyhow::Context;
use roomsight_client::Client;
use roomsight_lab::dataset::Frame;
use roomsight_protocol::stream::{Configure, ServerMessage};
use std::fs;
use std::time::Duration;
use tokio::task::JoinSet;
use tokio::time::{MissedTickBehavior, interval, sleep};

/// Between two frames of a robot.
const PACE: Duration = Duration::from_millis(500);

/// Before a robot whose connection broke comes back.
const PAUSE: Duration = Duration::from_secs(2);

/// A robot and the way that it drives.
pub struct Robot {
    pub name: String,
    pub frames: Vec<Frame>,
}

/// Lets all of them stream until this is dropped.
pub fn drive(url: &str, robots: Vec<Robot>) -> JoinSet<()> {
    let mut driving = JoinSet::new();
    for robot in robots {
        let url = url.to_owned();
        driving.spawn(async move {
            loop {
                if let Err(error) = stream(&url, &robot).await {
                    tracing::warn!(robot = robot.name, %error, "a robot of the demo lost its connection");
                }
                sleep(PAUSE).await;
            }
        });
    }
    driving
}

async fn stream(url: &str, robot: &Robot) -> anyhow::Result<()> {
    let configure = Configure { robot: Some(robot.name.clone()), ..Configure::default() };
    let mut stream = Client::new(url, None)?.stream(&configure).await?;
    let mut pace = interval(PACE);
    pace.set_missed_tick_behavior(MissedTickBehavior::Delay);
    for frame in robot.frames.iter().cycle() {
        pace.tick().await;
        let bytes = fs::read(&frame.path).with_context(|| frame.path.display().to_string())?;
        stream.send(bytes).await?;
        while !matches!(stream.receive().await?, ServerMessage::Result(_) | ServerMessage::Dropped { .. }) {}
    }
    Ok(())
}
