//! The encoded frames that robots send: in memory as far as a bound allows, else read ahead of their time.

use super::schedule::Schedule;
use crate::cli::service;
use roomsight_lab::dataset::{Frame, Problem};
use roomsight_protocol::scan::LaserScan;
use roomsight_vision::image::Limits;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::task::spawn_blocking;

/// The most bytes of encoded frames that are kept in memory.
const MAX_KEPT_BYTES: usize = 256 << 20;
/// How many frames a robot reads ahead.
const N_AHEAD: usize = 4;

/// A data set's frames.
pub struct Frames {
    frames: Vec<Frame>,
    /// What is sent, as far as it is kept.
    kept: Vec<Loaded>,
}

/// A frame as it is sent.
#[derive(Clone)]
pub struct Loaded {
    /// The encoded image.
    pub image: Arc<[u8]>,
    /// What the laser measured beside it.
    pub scan: Option<Arc<LaserScan>>,
}

/// A frame that waits for its time.
pub struct Ready {
    /// Which frame.
    pub frame_idx: usize,
    /// When it is due, counted from the robot's start.
    pub at: Duration,
    /// What is sent, or why it cannot be read.
    pub loaded: Result<Loaded, Problem>,
}

impl Frames {
    /// Reads the first frames into memory, up to the bound or the first that cannot be read.
    pub fn load(frames: Vec<Frame>) -> Self {
        let mut n_bytes = 0;
        let kept = frames
            .iter()
            .map_while(|frame| read(frame).ok())
            .take_while(|Loaded { image, scan }| {
                n_bytes += image.len() + scan.as_ref().map_or(0, |scan| scan.n_bytes());
                n_bytes <= MAX_KEPT_BYTES
            })
            .collect();
        Self { frames, kept }
    }

    /// A frame and its labels.
    pub fn get(&self, frame_idx: usize) -> &Frame {
        &self.frames[frame_idx]
    }

    /// Frames in the order of a schedule, a few of them read ahead.
    pub fn ahead(self: Arc<Self>, schedule: Schedule) -> mpsc::Receiver<Ready> {
        let (sender, receiver) = mpsc::channel(N_AHEAD);
        tokio::spawn(async move {
            for due in schedule {
                let loaded = self.loaded(due.frame_idx).await;
                let ready = Ready { frame_idx: due.frame_idx, at: due.at, loaded };
                // The robot has stopped.
                if sender.send(ready).await.is_err() {
                    break;
                }
            }
        });
        receiver
    }

    async fn loaded(&self, frame_idx: usize) -> Result<Loaded, Problem> {
        if let Some(loaded) = self.kept.get(frame_idx) {
            return Ok(loaded.clone());
        }
        let frame = self.frames[frame_idx].clone();
        let path = frame.path.clone();
        let reading = spawn_blocking(move || read(&frame)).await;
        reading.unwrap_or_else(|error| Err(Problem::new(&path, error.to_string())))
    }
}

fn read(frame: &Frame) -> Result<Loaded, Problem> {
    let image = frame.read_encoded(&Limits::default())?.into();
    let scan = frame.read_scan()?.map(|scan| Arc::new(service::sent_scan(&scan)));
    Ok(Loaded { image, scan })
}
