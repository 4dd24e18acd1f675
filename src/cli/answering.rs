//! What answers the pictures of a camera: a model in this process, or a service.

mod args;
mod printer;

pub(super) use args::AnsweringArgs;
pub(super) use printer::Printer;

use super::{data, service};
use crate::engine::told;
use anyhow::bail;
use roomsight_client::{Client, LastingStream};
use roomsight_protocol::header::Beside;
use roomsight_protocol::rest::{RoomProbability, Unknown};
use roomsight_protocol::stream::{
    Configure, FilterChoice, FilterSettings, Filtered, ServerMessage, StreamResult,
};
use roomsight_recognition::filter::{Interval, RoomFilter, Trust};
use roomsight_recognition::model::{self, Model, Pose, Scan, Scratch};
use roomsight_vision::image::Limits;
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, SystemTime};
use tokio::task::block_in_place;

/// A picture, and what else was sensed when it was taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shot<'a> {
    /// As a file.
    pub(super) picture: &'a [u8],
    pub(super) at: SystemTime,
    /// Where the robot was by its wheels.
    pub(super) odometry: Option<Pose>,
    /// What its laser measured.
    pub(super) scan: Option<&'a Scan>,
}

/// The room of a camera, of its pictures up to this one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Told {
    pub(super) room: String,
    pub(super) known: bool,
    pub(super) probability: f32,
    /// What the picture says by itself.
    pub(super) frame_room: String,
    pub(super) frame_known: bool,
    pub(super) frame_probability: f32,
    /// Why the picture is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) unknown: Option<Unknown>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) novelty: Option<f32>,
    /// Of every room, of the pictures up to this one.
    #[serde(skip)]
    pub(super) probabilities: Vec<RoomProbability>,
    /// What answered.
    #[serde(skip)]
    pub(super) model: String,
}

/// Answers the pictures of one camera.
pub(super) enum Answering {
    Model(Box<Following>),
    Service(Box<LastingStream>),
}

/// A model that several cameras may share.
#[derive(Clone)]
pub(super) struct LoadedModel {
    pub(super) model: Arc<Model>,
    /// Its folder.
    name: String,
}

/// A model that follows a camera.
pub(super) struct Following {
    loaded: LoadedModel,
    filter: RoomFilter,
    scratch: Scratch,
    last: Option<(SystemTime, Option<Pose>)>,
}

impl LoadedModel {
    fn load(folder: &Path) -> anyhow::Result<Self> {
        let model = Arc::new(data::load_model(folder)?.model);
        Ok(Self { model, name: folder.display().to_string() })
    }
}

impl Answering {
    /// By a model, which trusts single pictures so far, or as by default.
    fn by_model(loaded: LoadedModel, trust: Option<Trust>) -> Self {
        let filter = RoomFilter::new(loaded.model.rooms().len(), trust.unwrap_or_default());
        Self::Model(Box::new(Following { loaded, filter, scratch: Scratch::default(), last: None }))
    }

    /// By a service, which may be out of reach for so long.
    ///
    /// # Errors
    /// It cannot be reached, or refuses the stream.
    async fn by_service(
        client: &Client,
        robot: &str,
        trust: Option<Trust>,
        patience: Duration,
    ) -> anyhow::Result<Self> {
        let with = |trust: Trust| FilterChoice::With(FilterSettings { trust: trust.into() });
        let filter = Some(trust.map_or(FilterChoice::Switch(true), with));
        let configure = Configure { robot: Some(robot.to_owned()), filter, ..Configure::default() };
        Ok(Self::Service(Box::new(client.lasting_stream(&configure, patience).await?)))
    }

    /// The answer to a picture, or why it has none.
    ///
    /// # Errors
    /// A service that cannot be reached for too long.
    pub(super) async fn answer(&mut self, shot: Shot<'_>) -> anyhow::Result<Result<Told, String>> {
        match self {
            Self::Model(following) => Ok(block_in_place(|| following.answer(shot))),
            Self::Service(stream) => {
                let since = shot.at.duration_since(SystemTime::UNIX_EPOCH).ok();
                let scan = shot.scan.map(service::sent_scan);
                let beside = Beside {
                    captured_at_ns: since.and_then(|since| u64::try_from(since.as_nanos()).ok()),
                    odometry: shot.odometry.map(service::sent_odometry),
                    scan: scan.as_ref(),
                };
                let sent = stream.send_with(beside, shot.picture).await?;
                loop {
                    match stream.receive().await? {
                        ServerMessage::Result(result) if result.seq == sent => {
                            return Ok(Ok(Told::of(*result)));
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

impl Told {
    /// What a service says.
    fn of(StreamResult { answer, filtered, .. }: StreamResult) -> Self {
        let filtered = filtered.unwrap_or_else(|| Filtered {
            room: answer.room.clone(),
            known: answer.known,
            novelty: answer.novelty,
            probability: answer.probability,
            probabilities: answer.probabilities,
        });
        Self {
            room: filtered.room,
            known: filtered.known,
            probability: filtered.probability,
            frame_room: answer.room,
            frame_known: answer.known,
            frame_probability: answer.probability,
            unknown: answer.unknown,
            novelty: answer.novelty,
            probabilities: filtered.probabilities,
            model: format!("{}/{}", answer.model.name, answer.model.version),
        }
    }
}

impl Following {
    fn answer(&mut self, shot: Shot<'_>) -> Result<Told, String> {
        let since = self.since(shot.at, shot.odometry);
        let LoadedModel { model, name } = &self.loaded;
        let image = model.decode(shot.picture, &Limits::default()).map_err(|error| error.to_string())?;
        let scan = shot.scan.filter(|_| model.wants_scans());
        if let Some(scan) = scan {
            model.extractor().check_scan(scan).map_err(|error| error.to_string())?;
        }
        let features = model.features(model::Frame { image: &image, scan }, &mut self.scratch);
        let recognition = model.classify(&features);
        self.filter.update(model.transitions(), since, recognition.observation());
        let (rooms, room_idx) = (model.rooms(), self.filter.room_idx());
        Ok(Told {
            room: rooms[room_idx].clone(),
            known: model.knows(&self.filter),
            probability: self.filter.belief()[room_idx],
            frame_room: rooms[recognition.room_idx].clone(),
            frame_known: recognition.known,
            frame_probability: recognition.probability(),
            unknown: recognition.unknown.map(told::unknown),
            novelty: recognition.novelty,
            probabilities: told::by_probability(rooms, self.filter.belief(), None),
            model: name.clone(),
        })
    }

    /// What lies between the picture before and this one.
    fn since(&mut self, at: SystemTime, odometry: Option<Pose>) -> Interval {
        let Some((last, last_odometry)) = self.last.replace((at, odometry)) else { return 0.0.into() };
        let seconds = at.duration_since(last).unwrap_or_default().as_secs_f64();
        Interval::between(seconds, last_odometry, odometry)
    }
}
