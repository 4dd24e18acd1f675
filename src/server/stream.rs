//! Streams: a robot sends frames over a WebSocket as it takes them, and hears of each what became of it.
//!
//! | file | what |
//! |---|---|
//! | `settings` | how a stream is configured |
//! | `socket` | the WebSocket: messages in and out |
//! | `session` | one stream from its first connection to its end |
//! | `lane` | its frames that wait, and its one place in the queue of the threads |
//! | `turn` | one of its frames on a thread |
//! | `ledger` | its frames without an answer, told in order |
//! | `teller` | what it says: answers, the filter's answers, changes of the model |
//!
//! A frame's way: `socket` → `session`: a number, its share of memory → `lane` → a thread takes the stream's
//! first frame when its turn comes → `ledger` → `teller` → `socket`.

mod lane;
mod ledger;
mod session;
mod settings;
mod socket;
mod teller;
mod turn;

use super::App;
use super::auth::{Key, KeyName, subprotocols};
use super::openapi::StreamProblems;
use super::problem::Problem;
use super::robots::Record;
use crate::protocol::stream::{KEY_SUBPROTOCOL_PREFIX, SUBPROTOCOL, StreamQuery, StreamSettings};
use axum::Extension;
use axum::extract::{Query, Request, State};
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::Response;
use hyper::upgrade::OnUpgrade;
use session::Session;
use socket::{Close, Socket};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::{Semaphore, mpsc};
use tokio_util::task::TaskTracker;
use tracing::Instrument;

/// All streams.
pub struct Streams {
    entries: Mutex<BTreeMap<String, Entry>>,
    permits: Arc<Semaphore>,
    tasks: TaskTracker,
}

/// What is known of one stream outside its task.
struct Entry {
    arrivals: mpsc::Sender<Arrival>,
    key: Option<KeyName>,
    record: Arc<Record>,
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
    query: StreamQuery,
    settings: StreamSettings,
}

impl Streams {
    /// At most this many at one time.
    pub fn new(max_streams: usize) -> Self {
        Self {
            entries: Mutex::default(),
            permits: Arc::new(Semaphore::new(max_streams)),
            tasks: TaskTracker::new(),
        }
    }

    /// What dashboards may know, by session.
    pub fn records(&self) -> Vec<Arc<Record>> {
        self.entries().values().map(|entry| entry.record.clone()).collect()
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

    /// How to reach a stream of the same key.
    fn arrivals(&self, session: &str, key: Option<&KeyName>) -> Option<mpsc::Sender<Arrival>> {
        let entries = self.entries();
        let entry = entries.get(session).filter(|entry| entry.key.as_ref() == key)?;
        Some(entry.arrivals.clone())
    }

    fn entries(&self) -> MutexGuard<'_, BTreeMap<String, Entry>> {
        self.entries.lock().unwrap_or_else(PoisonError::into_inner)
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
    let caller = Caller { key, query, settings };
    app.streams.spawn(welcome(app.clone(), upgrade, caller));
    Ok(response)
}

/// Hands the connection to the stream it resumes, or begins a stream.
async fn welcome(app: App, upgrade: OnUpgrade, Caller { key, query, settings }: Caller) {
    let upgraded = match upgrade.await {
        Ok(upgraded) => upgraded,
        Err(error) => return tracing::debug!(%error, "a connection did not become a stream"),
    };
    let write_timeout = app.settings.stream_write_timeout();
    let socket = Socket::open(upgraded, app.settings.max_frame_bytes, write_timeout).await;
    let mut arrival = Arrival { socket, is_resumed: true, last_seq: query.last_seq };
    let key_name = key.as_ref().map(|key| KeyName(key.name().to_owned()));
    if let Some(arrivals) = query.session.and_then(|id| app.streams.arrivals(&id, key_name.as_ref())) {
        match arrivals.send(arrival).await {
            Ok(()) => return,
            // The stream has just ended.
            Err(refused) => arrival = refused.0,
        }
    }
    arrival.is_resumed = false;
    let (Ok(_permit), Ok(id)) = (app.streams.permits.clone().try_acquire_owned(), new_id()) else {
        return arrival.socket.close(Close::TooMany).await;
    };
    let record = Arc::new(Record::new(id.clone(), key));
    let session = match Session::new(app.clone(), id.clone(), settings, record.clone()) {
        Ok(session) => session,
        Err(problem) => return tracing::warn!(%problem, "a stream has no model"),
    };
    let (sender, arrivals) = mpsc::channel(1);
    app.streams.entries().insert(id.clone(), Entry { arrivals: sender, key: key_name, record });
    tracing::info!(session = id, "a stream begins");
    session.run(arrival, arrivals).await;
    app.streams.entries().remove(&id);
    tracing::info!(session = id, "a stream ended");
}

/// A name that cannot be guessed: who knows it may resume the stream.
fn new_id() -> Result<String, getrandom::Error> {
    let mut bytes = [0; 16];
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
