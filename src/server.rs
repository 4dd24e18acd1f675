//! The HTTP service: frames in, rooms out.
//!
//! # Layout
//!
//! | file | what |
//! |---|---|
//! | `settings` | what an operator may set |
//! | `listen` | connections, and the graceful stop |
//! | `places`, `write_timeout` | which connection gives way, and which is given up |
//! | `misread` | what never becomes a request is told why |
//! | `observe` | around every request: its id, its log line, its error in one form |
//! | `routes` | the paths, grouped by who may call them |
//! | `tls` | certificates, and their renewal |
//! | `auth` | keys, roles and pages of other sites, checked before a byte of the body is read; see there |
//! | `refusals` | many refusals of one caller told as one |
//! | `reload` | what changes without a restart |
//! | `bodies` | the memory for bodies, and who gives way when it is short |
//! | `query`, `body` | what is asked for; untrusted bytes into frames, within limits |
//! | `media_type` | what a body is, by its type and by its bytes |
//! | `answers` | the frames of one request, admitted and answered together |
//! | `caller` | who calls, for what callers share |
//! | `recognize` | the one path from bytes to an answer |
//! | `pool` | the threads that recognize, and the bounded queue before them |
//! | `registry` | the models that serve; see there |
//! | `models`, `upload` | the calls about them; a version that comes in |
//! | `watch` | looking for what is new among them |
//! | `stream` | frames over a WebSocket; see there |
//! | `oip` | the Open Inference Protocol, `/v2` |
//! | `events`, `robots` | what dashboards are told |
//! | `metrics` | what is counted and measured, for Prometheus |
//! | `trace` | the caller's trace, which a request's spans belong to |
//! | `problem` | every error a caller can see; the only place with status codes |
//! | `api`, `openapi`, `asyncapi` | what travels, and its description |
//! | `linger` | reading on after an early answer |
//!
//! A frame's way: `observe` → `auth` → `query` (which model?) → `body` (size, a free slot, bytes) →
//! `recognize` → a thread of `pool`: decode, features, classify → `api::Answer` or
//! `problem::Problem`.

mod answers;
mod api;
mod asyncapi;
mod auth;
mod bodies;
mod body;
mod caller;
mod events;
mod linger;
mod listen;
mod media_type;
mod metrics;
mod misread;
mod models;
mod observe;
mod oip;
mod openapi;
mod places;
mod pool;
mod problem;
mod query;
mod recognize;
mod refusals;
mod registry;
mod reload;
mod robots;
mod routes;
mod settings;
mod stream;
mod tls;
mod trace;
mod upload;
mod watch;
mod write_timeout;

pub use api::network_infos;
pub use asyncapi::stream_document;
pub use auth::{Key, KeyError, Role};
pub use listen::serve;
pub use registry::RegistryError;
pub use reload::{ReloadError, Reloaded};
pub use routes::{document, router};
pub use settings::{ENVIRONMENT_PREFIX, LogFormat, Policy, Settings, SettingsError};
pub use tls::TlsError;

use self::metrics::Metrics;
use crate::repository::Repository;
use auth::{Keyring, Sites};
use bodies::Bodies;
use events::Events;
use observe::RequestIds;
use pool::Pool;
use refusals::Refusals;
use registry::Registry;
use std::io;
use std::ops::Deref;
use std::sync::Arc;
use stream::Streams;
use tls::Tls;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

/// The running service, without a socket. Cheap to clone; all clones are one.
#[derive(Clone)]
pub struct App(Arc<AppState>);

/// What all requests share.
pub struct AppState {
    /// As they were at the start; the keys in force are in `keyring`.
    settings: Settings,
    keyring: Keyring,
    sites: Sites,
    /// None where the service speaks plain HTTP.
    tls: Option<Tls>,
    refusals: Refusals,
    registry: Registry,
    pool: Pool,
    /// One permit for each byte of a body that may be held.
    body_memory: Arc<Semaphore>,
    /// One permit for each upload at one time.
    uploads: Semaphore,
    bodies: Arc<Bodies>,
    request_ids: RequestIds,
    streams: Streams,
    events: Events,
    metrics: Arc<Metrics>,
    stopping: CancellationToken,
}

/// Why the service cannot start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// Nothing to serve.
    #[error(transparent)]
    Registry(#[from] RegistryError),
    /// No threads.
    #[error("the recognizing threads cannot be started: {0}")]
    Threads(#[from] io::Error),
    /// A setting that cannot work.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// No certificate that works.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// No random numbers.
    #[error("the system gives no random numbers: {0}")]
    Random(#[from] getrandom::Error),
    /// No metrics.
    #[error("the metrics cannot be set up: {0}")]
    Metrics(#[from] metrics_exporter_prometheus::BuildError),
}

impl App {
    /// Loads the models, sends a frame through each that is to serve, and starts the threads.
    pub fn start(settings: Settings) -> Result<Self, StartError> {
        let (sites, tls) = (Sites::new(&settings)?, Tls::open(&settings)?);
        let location = settings.models.to_string_lossy();
        let repository = Repository::open(&location, &settings.models_cache).map_err(RegistryError::from)?;
        let (events, metrics) = (Events::default(), Arc::new(Metrics::new()?));
        let registry = Registry::open(repository, &settings, (events.clone(), metrics.clone()))?;
        let body_memory = Arc::new(Semaphore::new(settings.max_buffered_bytes));
        let bodies = Bodies::new(body_memory.clone(), settings.body_limits());
        Ok(Self(Arc::new(AppState {
            keyring: Keyring::new(&settings.keys)?,
            sites,
            tls,
            refusals: Refusals::default(),
            registry,
            uploads: Semaphore::new(settings.max_uploads),
            pool: Pool::new(settings.pool_size())?,
            streams: Streams::new(&settings, body_memory.clone()),
            body_memory,
            bodies: Arc::new(bodies),
            request_ids: RequestIds::new(),
            events,
            metrics,
            stopping: CancellationToken::new(),
            settings,
        })))
    }

    /// Refuses frames from now on; those accepted are answered.
    pub fn drain(&self) {
        self.stopping.cancel();
    }

    /// Whether callers reach the service over TLS.
    pub fn speaks_tls(&self) -> bool {
        self.tls.is_some()
    }

    /// Whether the service is stopping.
    pub fn is_draining(&self) -> bool {
        self.stopping.is_cancelled()
    }
}

impl Deref for App {
    type Target = AppState;

    fn deref(&self) -> &AppState {
        &self.0
    }
}
