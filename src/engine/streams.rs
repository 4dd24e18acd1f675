//! Streams: a robot sends frames over a WebSocket as it takes them, and hears of each what became of it.
//!
//! | file | what |
//! |---|---|
//! | `settings` | how a stream is configured |
//! | `wire` | the bytes of a WebSocket, taken apart |
//! | `inbox` | its messages, put together within limits |
//! | `intake` | the memory of frames under way, and who gives way where it is short |
//! | `socket` | the WebSocket: messages in and out |
//! | `permits` | who may have a stream, and who gives way where places are short |
//! | `session` | one stream from its first connection to its end |
//! | `lane` | its frames that wait, and its one place in the queue of the threads |
//! | `turn` | one of its frames on a thread |
//! | `ledger` | its frames without an answer, told in order |
//! | `teller` | what it says: answers, the filter's answers, changes of the model |
//! | `belief` | what its frames say together, here and for another process |
//! | `moment` | when a frame was taken, by the robot's clock or by ours |
//! | `message` | messages as they are sent |
//! | `kept` | what it has said, for a robot that comes back |
//! | `token` | how it stands, sealed for its robot, which may take that to another process |
//!
//! A frame's way: `wire` → `inbox`: its share of memory → `session`: a number → `lane` → a thread takes the
//! stream's first frame when its turn comes → `ledger` → `teller` → `socket`.

mod belief;
mod inbox;
mod intake;
mod kept;
mod lane;
mod ledger;
mod message;
mod moment;
mod permits;
mod session;
pub mod settings;
mod socket;
mod teller;
mod token;
mod turn;
mod wire;

use crate::access::Key;
use crate::engine::Engine;
use crate::engine::caller::CallerId;
use crate::engine::metrics::TakeoverOutcome;
use crate::engine::registry::Choice;
use crate::engine::robots::RobotRecord;
use crate::problem::Problem;
use crate::settings::Settings;
use hyper::upgrade::OnUpgrade;
use inbox::{Inbox, MessageLimits};
use intake::Intake;
use permits::{NoPermit, Permit, Permits};
use roomsight_protocol::stream::{StreamQuery, StreamSettings};
use session::{Identity, Session, TakenOver};
use socket::{Close, Socket};
use std::sync::Arc;
use token::{Standing, Tokens};
use tokio::sync::{Semaphore, mpsc};
use tokio_util::task::TaskTracker;
use tracing::Instrument;

/// All streams.
pub struct Streams {
    permits: Permits,
    intake: Arc<Intake>,
    tokens: Tokens,
    tasks: TaskTracker,
}

/// A connection for a stream.
struct Arrival {
    socket: Socket,
    /// The stream was there before.
    is_resumed: bool,
    /// The last frame whose answer the robot has.
    last_seq: Option<u64>,
}

/// A robot at the door.
pub struct Caller {
    pub key: Option<Arc<Key>>,
    pub id: CallerId,
    pub query: StreamQuery,
    pub settings: StreamSettings,
}

impl Streams {
    /// As many as the settings allow, whose frames take their bytes from `memory`.
    ///
    /// # Errors
    /// There are no random bytes.
    pub fn new(settings: &Settings, memory: Arc<Semaphore>) -> Result<Self, getrandom::Error> {
        Ok(Self {
            permits: Permits::new(settings.max_streams, settings.max_streams_of_one()),
            intake: Arc::new(Intake::new(memory, settings.max_buffered_bytes, settings.max_frame_bytes)),
            tokens: Tokens::new(settings)?,
            tasks: TaskTracker::new(),
        })
    }

    /// The robots of all streams, the stream that began first first.
    pub fn records(&self) -> Vec<Arc<RobotRecord>> {
        self.permits.records()
    }

    /// Ready when the last stream has ended, after a stop.
    pub async fn finished(&self) {
        self.tasks.close();
        self.tasks.wait().await;
    }

    /// Runs a task that a stop waits for.
    pub fn spawn(&self, task: impl Future<Output = ()> + Send + 'static) {
        self.tasks.spawn(task.in_current_span());
    }
}

/// Hands the connection to the stream it resumes, or begins a stream.
pub async fn welcome(engine: Engine, upgrade: OnUpgrade, Caller { key, id, query, settings }: Caller) {
    let upgraded = match upgrade.await {
        Ok(upgraded) => upgraded,
        Err(error) => return tracing::debug!(%error, "a connection did not become a stream"),
    };
    let limits = MessageLimits {
        max_bytes: engine.settings.max_frame_bytes,
        message_timeout: engine.settings.stream_message_timeout(),
    };
    let holder = id.clone().with_robot(settings.robot.as_deref());
    let inbox = Inbox::new(&limits, engine.streams.intake.clone(), holder.clone());
    let socket = Socket::new(upgraded, inbox, engine.settings.stream_write_timeout());
    let StreamQuery { session, last_seq, resume, sent_seq, .. } = query;
    let mut arrival = Arrival { socket, is_resumed: true, last_seq };
    let resumed = session.and_then(|session| engine.streams.permits.arrivals(&session, key.as_deref()));
    if let Some(arrivals) = resumed {
        match arrivals.send(Box::new(arrival)).await {
            Ok(()) => return,
            // The stream has just ended.
            Err(refused) => arrival = *refused.0,
        }
    }
    let taken_over = resume
        .and_then(|token| brought(&engine, &token, key.as_deref()))
        .map(|standing| TakenOver { standing, last_seq, sent_seq });
    arrival.is_resumed = taken_over.is_some();
    let (session, stream) = match (random_name::<16>(), random_name::<8>()) {
        (Ok(session), Ok(stream)) => (session, stream),
        (Err(error), _) | (_, Err(error)) => {
            tracing::error!(%error, "there are no random bytes for a stream's name");
            return arrival.socket.close(Close::Full).await;
        }
    };
    let record = Arc::new(RobotRecord::of_stream(stream.clone(), key));
    let identity = Identity { session: session.clone(), stream: stream.clone(), caller: id };
    let conversation = match taken_over {
        Some(taken_over) => Session::take_over(engine.clone(), identity, taken_over, record.clone()),
        None => Session::new(engine.clone(), identity, settings, record.clone()),
    };
    let conversation = match conversation {
        Ok(conversation) => conversation,
        Err(problem) => {
            tracing::warn!(%problem, "a stream has no model");
            return arrival.socket.close(Close::NoModel).await;
        }
    };
    let (sender, arrivals) = mpsc::channel(1);
    let given_up = conversation.given_up().clone();
    let permit = Permit { arrivals: sender, holder, record: record.clone(), given_up };
    if let Err(no_permit) = engine.streams.permits.take(session.clone(), permit) {
        let why = match no_permit {
            NoPermit::Full => Close::Full,
            NoPermit::Share => Close::Share,
        };
        return arrival.socket.close(why).await;
    }
    tracing::info!(stream, "a stream begins");
    engine.robots.enter(&record);
    conversation.run(arrival, arrivals).await;
    engine.streams.permits.leave(&session);
    engine.robots.left(&record);
    tracing::info!(stream, "a stream ended");
}

/// How a stream stood that its robot brings from elsewhere, with the key that opened it; none where it cannot go on here: then
/// the robot begins anew.
fn brought(engine: &Engine, token: &str, key: Option<&Key>) -> Option<Standing> {
    let (standing, outcome) = match opened(engine, token, key) {
        Ok(standing) => {
            tracing::info!(from = standing.stream, "a stream goes on here");
            (Some(standing), TakeoverOutcome::Done)
        }
        Err(problem) => {
            tracing::info!(%problem, "a robot's stream from elsewhere does not go on");
            (None, TakeoverOutcome::Refused)
        }
    };
    engine.metrics.taken_over(outcome);
    standing
}

fn opened(engine: &Engine, token: &str, key: Option<&Key>) -> Result<Standing, Problem> {
    let standing =
        engine.streams.tokens.open(token, key).map_err(|error| Problem::query(error.to_string()))?;
    let StreamSettings { robot, model, .. } = &standing.settings;
    if let Some(robot) = robot {
        engine.keyring.check_robot(key, robot)?;
    }
    engine.registry.choose(Some(model), &Choice::Serving, robot.as_deref())?;
    Ok(standing)
}

/// So many random bytes, in hexadecimal digits.
fn random_name<const N_BYTES: usize>() -> Result<String, getrandom::Error> {
    let mut bytes = [0; N_BYTES];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}
