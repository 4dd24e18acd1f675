//! What answers the pictures of a camera: a model in this process, or a service.

use crate::cli::data;
use anyhow::bail;
use roomsight_client::{Client, LastingStream};
use roomsight_protocol::stream::{Configure, FilterChoice, ServerMessage};
use roomsight_recognition::filter::{RoomFilter, Trust};
use roomsight_recognition::model::{Model, Scratch};
use roomsight_vision::image::Limits;
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, SystemTime};
use tokio::task::block_in_place;

/// The room of a camera, of its pictures up to this one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Told {
    pub(super) room: String,
    pub(super) known: bool,
    pub(super) probability: f32,
    /// What the picture says by itself.
    frame_room: String,
    frame_known: bool,
    frame_probability: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    novelty: Option<f32>,
}

/// Answers the pictures of one camera.
pub(super) enum Answering {
    Model(Box<Following>),
    Service(Box<LastingStream>),
}

/// A model that follows a camera.
pub(super) struct Following {
    model: Model,
    filter: RoomFilter,
    scratch: Scratch,
    last: Option<SystemTime>,
}

impl Answering {
    pub(super) fn by_model(folder: &Path) -> anyhow::Result<Self> {
        let model = data::load_model(folder)?.model;
        let filter = RoomFilter::new(model.rooms().len(), Trust::default());
        Ok(Self::Model(Box::new(Following { model, filter, scratch: Scratch::default(), last: None })))
    }

    pub(super) async fn by_service(client: &Client, robot: &str, patience: Duration) -> anyhow::Result<Self> {
        let filter = Some(FilterChoice::Switch(true));
        let configure = Configure { robot: Some(robot.to_owned()), filter, ..Configure::default() };
        Ok(Self::Service(Box::new(client.lasting_stream(&configure, patience).await?)))
    }

    /// The answer to a picture, or why it has none.
    ///
    /// # Errors
    /// A service that cannot be reached for too long.
    pub(super) async fn answer(
        &mut self,
        picture: Arc<[u8]>,
        at: SystemTime,
    ) -> anyhow::Result<Result<Told, String>> {
        match self {
            Self::Model(following) => Ok(block_in_place(|| following.answer(&picture, at))),
            Self::Service(stream) => {
                let since = at.duration_since(SystemTime::UNIX_EPOCH).ok();
                let captured_at_ns = since.and_then(|since| u64::try_from(since.as_nanos()).ok());
                let sent = stream.send(&picture, captured_at_ns).await?;
                loop {
                    match stream.receive().await? {
                        ServerMessage::Result(result) if result.seq == sent => {
                            let answer = result.answer;
                            let single = (answer.room.clone(), answer.known, answer.probability);
                            let filtered = result
                                .filtered
                                .map(|filtered| (filtered.room, filtered.known, filtered.probability));
                            let (room, known, probability) = filtered.unwrap_or_else(|| single.clone());
                            let (frame_room, frame_known, frame_probability) = single;
                            let novelty = answer.novelty;
                            return Ok(Ok(Told {
                                room,
                                known,
                                probability,
                                frame_room,
                                frame_known,
                                frame_probability,
                                novelty,
                            }));
                        }
                        ServerMessage::Dropped { seq, reason } if seq == sent => {
                            return Ok(Err(format!("it was dropped: {reason:?}")));
                        }
                        ServerMessage::Error { seq: Some(seq), problem } if seq == sent => {
                            return Ok(Err(problem.detail));
                        }
                        ServerMessage::Error { seq: None, problem } => bail!("{}", problem.detail),
                        _ => (),
                    }
                }
            }
        }
    }
}

impl Following {
    fn answer(&mut self, picture: &[u8], at: SystemTime) -> Result<Told, String> {
        let image = self.model.decode(picture, &Limits::default()).map_err(|error| error.to_string())?;
        let features = self.model.features(&image, &mut self.scratch);
        let recognition = self.model.classify(&features);
        let elapsed = self.last.and_then(|last| at.duration_since(last).ok()).unwrap_or_default();
        self.last = Some(at);
        self.filter.update(self.model.transitions(), elapsed.as_secs_f64(), recognition.observation());
        let room_idx = self.filter.room_idx();
        Ok(Told {
            room: self.model.rooms()[room_idx].clone(),
            known: self.model.knows(&self.filter),
            probability: self.filter.belief()[room_idx],
            frame_room: self.model.rooms()[recognition.room_idx].clone(),
            frame_known: recognition.known,
            frame_probability: recognition.probability(),
            novelty: recognition.novelty,
        })
    }
}
