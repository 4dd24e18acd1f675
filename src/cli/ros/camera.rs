//! One camera: its latest picture is answered.

use super::latest::Latest;
use super::senses::{Senses, topic_of};
use super::{ImageTransport, Node, RosArgs};
use crate::cli::answering::{Answering, Printer, Shot, Told};
use crate::cli::manners::note;
use roomsight_protocol::rest;
use roomsight_recording::Topic;
use roomsight_recording::message::Picture;
use roomsight_ros::{
    COMPRESSED_IMAGE, Header, IMAGE, Publisher, Quality, ROOM_ANSWER, RoomAnswer, RoomProbability,
    Subscription,
};
use std::str::FromStr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};
use tokio::time::{Instant, sleep_until};

/// As cameras publish: what is lost is old.
const CAMERA: Quality = Quality { is_reliable: false, depth: 1 };

/// How many answers may wait for a subscriber.
pub(super) const ANSWERS: Quality = Quality { is_reliable: true, depth: 10 };

/// What the topics of compressed pictures end in.
const COMPRESSED: &str = "/compressed";

/// The pictures of a camera: `topic`, or `name=topic`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct CameraTopic {
    pub(super) name: Option<String>,
    pub(super) topic: String,
}

/// A picture as it came.
struct Taken {
    message: Vec<u8>,
    came_at: SystemTime,
}

/// A camera that is heard, and what its answers go to.
pub(super) struct Camera {
    topic: Topic,
    latest: Arc<Latest<Taken>>,
    watched: Arc<Watched>,
    answers: Publisher,
    printer: Printer,
    gap: Duration,
    _subscription: Subscription,
}

/// How a camera does, for who watches it.
pub(super) struct Watched {
    /// What it is called, where there are several.
    pub(super) name: Option<String>,
    /// The topic of its pictures.
    pub(super) topic: String,
    state: Mutex<State>,
}

/// What became of the pictures of a camera.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) n_received: u64,
    pub(super) n_answered: u64,
    /// A newer one took their place.
    pub(super) n_superseded: u64,
    /// They could not be read or answered.
    pub(super) n_failed: u64,
    /// What is wrong, of the last one.
    pub(super) problem: Option<String>,
    /// The room of the last answer, where it is known.
    pub(super) room: Option<String>,
    /// When the last one came, or all began.
    pub(super) last: Instant,
}

impl FromStr for CameraTopic {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, topic) = text.split_once('=').map_or((None, text), |(name, topic)| (Some(name), topic));
        Ok(Self { name: name.map(str::to_owned), topic: topic.to_owned() })
    }
}

impl Watched {
    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Camera {
    /// Hears a camera.
    pub(super) async fn open(node: &Node, camera: &CameraTopic, args: &RosArgs) -> anyhow::Result<Self> {
        let mut topic = node.topic(&camera.topic)?;
        let message = match args.transport {
            ImageTransport::Raw => &IMAGE,
            ImageTransport::Compressed => {
                if !topic.ends_with(COMPRESSED) {
                    topic = node.topic(&format!("{topic}{COMPRESSED}"))?;
                }
                &COMPRESSED_IMAGE
            }
        };
        let answers = camera.name.as_ref().map_or("~/answer".to_owned(), |name| format!("~/{name}/answer"));
        let answers = node.topic(&answers)?;
        note!("listening to {topic} ({}); answers go to {answers}", message.name);
        let publisher = node.session.publisher(&answers, &ROOM_ANSWER, ANSWERS).await?;
        let state = State {
            n_received: 0,
            n_answered: 0,
            n_superseded: 0,
            n_failed: 0,
            problem: None,
            room: None,
            last: Instant::now(),
        };
        let watched =
            Arc::new(Watched { name: camera.name.clone(), topic: topic.clone(), state: Mutex::new(state) });
        let latest = Arc::new(Latest::new());
        let on_message = {
            let (watched, latest) = (Arc::clone(&watched), Arc::clone(&latest));
            move |heard: Result<Vec<u8>, String>| {
                let mut state = watched.state();
                state.n_received += 1;
                state.last = Instant::now();
                match heard {
                    Ok(message) => {
                        let taken = Taken { message, came_at: SystemTime::now() };
                        state.n_superseded += u64::from(latest.put(taken));
                    }
                    Err(problem) => state.failed(problem),
                }
            }
        };
        let subscription = node.session.subscribe(&topic, message, CAMERA, Box::new(on_message)).await?;
        Ok(Self {
            topic: topic_of(&topic, message),
            latest,
            watched,
            answers: publisher,
            printer: Printer::new(args.json, camera.name.clone()),
            gap: args.gap(),
            _subscription: subscription,
        })
    }

    /// How it does.
    pub(super) fn watched(&self) -> Arc<Watched> {
        Arc::clone(&self.watched)
    }

    /// Answers its pictures for ever.
    ///
    /// # Errors
    /// A service that is out of reach for too long; nobody to print to.
    pub(super) async fn work(mut self, mut answering: Answering, senses: Arc<Senses>) -> anyhow::Result<()> {
        let mut due = Instant::now();
        loop {
            let Taken { message, came_at } = self.latest.take().await;
            let picture = match Picture::read(&self.topic, &message) {
                Ok(picture) => picture,
                Err(error) => {
                    self.failed(error.to_string());
                    continue;
                }
            };
            let stamp =
                picture.stamp_ns.map(|stamp_ns| SystemTime::UNIX_EPOCH + Duration::from_nanos(stamp_ns));
            let at_ns = picture.stamp_ns.unwrap_or_else(|| nanoseconds(came_at));
            let scan = senses.scan(at_ns);
            let shot = Shot {
                picture: &picture.encoded,
                at: stamp.unwrap_or(came_at),
                odometry: senses.odometry(at_ns),
                scan: scan.as_deref(),
            };
            match answering.answer(shot).await? {
                Ok(told) => {
                    let answer = message_of(&told, picture.stamp_ns.unwrap_or(0), picture.frame_id);
                    match self.answers.publish(answer.to_cdr()).await {
                        Ok(()) => self.watched.state().answered(&told),
                        Err(error) => self.failed(error.to_string()),
                    }
                    self.printer.print(came_at, &told)?;
                }
                Err(problem) => self.failed(problem),
            }
            if !self.gap.is_zero() {
                // Steadily, as far as the answers allow.
                due = (due + self.gap).max(Instant::now());
                sleep_until(due).await;
            }
        }
    }

    fn failed(&self, problem: String) {
        let mut state = self.watched.state();
        if state.problem.as_ref() != Some(&problem) {
            note!("note: a picture of {} is not answered: {problem}", self.watched.topic);
        }
        state.failed(problem);
    }
}

impl State {
    fn answered(&mut self, told: &Told) {
        self.n_answered += 1;
        self.problem = None;
        self.room = told.known.then(|| told.room.clone());
    }

    fn failed(&mut self, problem: String) {
        self.n_failed += 1;
        self.problem = Some(problem);
    }
}

/// Since 1970.
pub(super) fn nanoseconds(at: SystemTime) -> u64 {
    let since = at.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

fn message_of(told: &Told, stamp_ns: u64, frame_id: String) -> RoomAnswer {
    let probability = |of_room: &rest::RoomProbability| RoomProbability {
        room: of_room.room.clone(),
        probability: of_room.probability,
    };
    RoomAnswer {
        header: Header { stamp_ns, frame_id },
        room: told.room.clone(),
        known: told.known,
        probability: told.probability,
        frame_room: told.frame_room.clone(),
        frame_known: told.frame_known,
        frame_probability: told.frame_probability,
        unknown: told.unknown.map(rest::Unknown::name).unwrap_or_default().to_owned(),
        novelty: told.novelty.unwrap_or(f32::NAN),
        probabilities: told.probabilities.iter().map(probability).collect(),
        model: told.model.clone(),
    }
}
