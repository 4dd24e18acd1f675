//! Streams: a robot sends frames over a WebSocket as it takes them, and hears of each what became of it.
//!
//! | file | what |
//! |---|---|
//! | `settings` | how a stream is configured |
//! | `wire` | the bytes of a WebSocket, taken apart |
//! | `inbox` | its messages, put together within limits |
//! | `intake` | the memory of frames under way, and who gives way where it is short |
//! | `socket` | the WebSocket: messages in and out |
//! | `places` | who may have a stream, and who gives way where places are short |
//! | `session` | one stream from its first connection to its end |
//! | `lane` | its frames that wait, and its one place in the queue of the threads |
//! | `turn` | one of its frames on a thread |
//! | `ledger` | its frames without an answer, told in order |
//! | `teller` | what it says: answers, the filter's answers, changes of the model |
//! | `moment` | when a frame was taken, by the robot's clock or by ours |
//! | `kept` | what it has said, for a robot that comes back |
//!
//! A frame's way: `wire` → `inbox`: its share of memory → `session`: a number → `lane` → a thread takes the
//! stream's first frame when its turn comes → `ledger` → `teller` → `socket`.

mod inbox;
mod intake;
mod kept;
mod lane;
mod ledger;
mod moment;
mod places;
mod session;
mod settings;
mod socket;
mod teller;
mod turn;
mod wire;

use super::auth::{Key, subprotocols};
use super::caller::CallerId;
use super::openapi::StreamProblems;
use super::problem::Problem;
use super::robots::Record;
use super::{App, Settings};
use axum::Extension;
use axum::extract::{Query, Request, State};
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::Response;
use hyper::upgrade::OnUpgrade;
use inbox::{Inbox, Limits};
use intake::Intake;
use places::{NoPlace, Place, Places};
use roomsight_protocol::stream::{KEY_SUBPROTOCOL_PREFIX, SUBPROTOCOL, StreamQuery, StreamSettings};
use session::{Identity, Session};
use socket::{Close, Socket};
use std::sync::Arc;
use tokio::sync::{Semaphore, mpsc};
use tokio_util::task::TaskTracker;
use tracing::Instrument;

/// All streams.
pub struct Streams {
    places: Places,
    intake: Arc<Intake>,
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
struct Caller {
    key: Option<Arc<Key>>,
    id: CallerId,
    query: StreamQuery,
    settings: StreamSettings,
}

impl Streams {
    /// As many as the settings allow, whose frames take their bytes from `memory`.
    pub fn new(settings: &Settings, memory: Arc<Semaphore>) -> Self {
        Self {
            places: Places::new(settings.max_streams, settings.max_streams_of_one()),
            intake: Arc::new(Intake::new(memory, settings.max_buffered_bytes, settings.max_frame_bytes)),
            tasks: TaskTracker::new(),
        }
    }

    /// What dashboards may know, the stream that began first first.
    pub fn records(&self) -> Vec<Arc<Record>> {
        self.places.records()
    }

    /// Ready when the last stream has ended, after a stop.
    pub async fn finished(&self) {
        self.tasks.close();
        self.tasks.wait().await;
    }

    /// Runs a task that a stop waits for.
    fn spawn(&self, task: impl Future<Output = ()> + Send + 'static) {
        self.tasks.spawn(task.in_current_span());
    }
}

/// Streams frames over a WebSocket
///
/// The subprotocol is `roomsight.v1`; `asyncapi.json` describes its messages. A key may also be offered as a
/// second subprotocol, `key.KEY`, since browsers cannot set headers here.
#[utoipa::path(
    get, path = "/v1/stream", tag = "recognize", security(("key" = [])), params(StreamQuery),
    responses((status = SWITCHING_PROTOCOLS, description = "The stream begins with `hello`"), StreamProblems)
)]
pub async fn connect(
    State(app): State<App>,
    key: Option<Extension<Arc<Key>>>,
    mut request: Request,
) -> Result<Response, Problem> {
    let Query(query) = Query::<StreamQuery>::try_from_uri(request.uri())
        .map_err(|error| Problem::Query(error.body_text()))?;
    if app.is_draining() {
        return Err(Problem::Draining);
    }
    let key = key.map(|Extension(key)| key);
    if let Some(robot) = &query.robot {
        app.keyring.check_robot(key.as_deref(), robot)?;
    }
    let initial = settings::initial(&app.registry, key.as_ref().map(|key| key.robot()));
    let settings = settings::changed(&initial, query.change(), &app.registry)?;
    let (mut response, upgrade) = socket::handshake(&mut request).map_err(Problem::NoWebSocket)?;
    if let Some(protocol) = spoken(request.headers())? {
        response.headers_mut().insert(header::SEC_WEBSOCKET_PROTOCOL, protocol);
    }
    let caller = Caller { key, id: CallerId::of(request.extensions()), query, settings };
    app.streams.spawn(welcome(app.clone(), upgrade, caller));
    Ok(response)
}

/// Hands the connection to the stream it resumes, or begins a stream.
async fn welcome(app: App, upgrade: OnUpgrade, Caller { key, id, query, settings }: Caller) {
    let upgraded = match upgrade.await {
        Ok(upgraded) => upgraded,
        Err(error) => return tracing::debug!(%error, "a connection did not become a stream"),
    };
    let limits = Limits {
        max_bytes: app.settings.max_frame_bytes,
        message_timeout: app.settings.stream_message_timeout(),
    };
    let holder = id.clone().with_robot(settings.robot.as_deref());
    let inbox = Inbox::new(&limits, app.streams.intake.clone(), holder.clone());
    let socket = Socket::new(upgraded, inbox, app.settings.stream_write_timeout());
    let mut arrival = Arrival { socket, is_resumed: true, last_seq: query.last_seq };
    let resumed = query.session.and_then(|session| app.streams.places.arrivals(&session, key.as_deref()));
    if let Some(arrivals) = resumed {
        match arrivals.send(arrival).await {
            Ok(()) => return,
            // The stream has just ended.
            Err(refused) => arrival = refused.0,
        }
    }
    arrival.is_resumed = false;
    let (session, stream) = match (random_name::<16>(), random_name::<8>()) {
        (Ok(session), Ok(stream)) => (session, stream),
        (Err(error), _) | (_, Err(error)) => {
            tracing::error!(%error, "there are no random bytes for a stream's name");
            return arrival.socket.close(Close::Full).await;
        }
    };
    let record = Arc::new(Record::new(stream.clone(), key));
    let identity = Identity { session: session.clone(), stream: stream.clone(), caller: id };
    let conversation = match Session::new(app.clone(), identity, settings, record.clone()) {
        Ok(conversation) => conversation,
        Err(problem) => {
            tracing::warn!(%problem, "a stream has no model");
            return arrival.socket.close(Close::NoModel).await;
        }
    };
    let (sender, arrivals) = mpsc::channel(1);
    let given_up = conversation.given_up().clone();
    let place = Place { arrivals: sender, holder, record, given_up };
    if let Err(no_place) = app.streams.places.take(session.clone(), place) {
        let why = match no_place {
            NoPlace::Full => Close::Full,
            NoPlace::Share => Close::Share,
        };
        return arrival.socket.close(why).await;
    }
    tracing::info!(stream, "a stream begins");
    conversation.run(arrival, arrivals).await;
    app.streams.places.leave(&session);
    tracing::info!(stream, "a stream ended");
}

/// So many random bytes, in hexadecimal digits.
fn random_name<const N_BYTES: usize>() -> Result<String, getrandom::Error> {
    let mut bytes = [0; N_BYTES];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// The subprotocol of the response, if any was offered.
fn spoken(headers: &HeaderMap) -> Result<Option<HeaderValue>, Problem> {
    let mut offered =
        subprotocols(headers).filter(|name| !name.starts_with(KEY_SUBPROTOCOL_PREFIX.as_bytes()));
    let Some(first) = offered.next() else { return Ok(None) };
    if first == SUBPROTOCOL.as_bytes() || offered.any(|name| name == SUBPROTOCOL.as_bytes()) {
        Ok(Some(HeaderValue::from_static(SUBPROTOCOL)))
    } else {
        Err(Problem::NoWebSocket("the subprotocols that are offered are not spoken here".to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(header::HeaderName, &'static str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.clone(), HeaderValue::from_static(value))).collect()
    }

    #[test]
    fn the_subprotocol_is_chosen_from_what_is_offered_beside_a_key() {
        let offer = |text| spoken(&headers(&[(header::SEC_WEBSOCKET_PROTOCOL, text)]));
        assert_eq!(offer("roomsight.v1, key.rs_abc").unwrap().unwrap(), SUBPROTOCOL);
        assert_eq!(offer("mqtt,roomsight.v1").unwrap().unwrap(), SUBPROTOCOL);
        assert_eq!(offer("key.rs_abc").unwrap(), None);
        assert!(offer("mqtt").is_err());
        assert_eq!(spoken(&HeaderMap::new()).unwrap(), None);
    }
}
