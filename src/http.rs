//! The HTTP service: frames in, rooms out.
//!
//! | file | what |
//! |---|---|
//! | `connection` | connections: how many, how long, and how they end |
//! | `seats`, `linger` | which connection gives way; reading on after an early answer |
//! | `observe` | around every request: its id, its log line, its error in one form |
//! | `auth`, `cors` | keys and pages of other sites, checked before a byte of the body is read |
//! | `caller` | who calls, as a request tells it |
//! | `query`, `body` | what is asked for; untrusted bytes into frames, within limits |
//! | `blocking` | work that waits for the disk or the network |
//! | `routes` | the calls, a file for each resource; who may call them |
//! | `problem` | errors as callers read them |
//! | `openapi`, `asyncapi` | the description of what travels |
//! | `refusals` | many refusals of one caller told as one |
//! | `tls`, `reload` | certificates; what changes without a restart |
//! | `trace` | the caller's trace, which a request's spans belong to |
//!
//! A frame's way: `observe` → `auth` → `query` (which model?) → `body` (size, bytes) → the engine: a slot, a thread,
//! an answer or a [`Problem`](crate::problem::Problem).

mod asyncapi;
mod auth;
mod blocking;
mod body;
mod caller;
mod connection;
mod cors;
mod linger;
mod observe;
mod openapi;
mod problem;
mod query;
mod refusals;
mod reload;
mod routes;
mod seats;
mod tls;
mod trace;

pub use asyncapi::stream_document;
pub use connection::serve;
pub use reload::{ReloadError, Reloaded};
pub use routes::{document, router};
pub use tls::TlsError;

use crate::access::Sites;
use crate::engine::{Engine, EngineError};
use crate::settings::{Settings, SettingsError};
use observe::RequestIds;
use refusals::Refusals;
use std::ops::Deref;
use std::sync::Arc;
use tls::Tls;
use tokio::sync::Semaphore;

/// The running service, without a socket. Cheap to clone; all clones are one.
#[derive(Clone)]
pub struct App(Arc<AppState>);

/// What all requests share.
pub struct AppState {
    engine: Engine,
    sites: Sites,
    /// None where the service speaks plain HTTP.
    tls: Option<Tls>,
    refusals: Refusals,
    /// One permit for each upload at one time.
    uploads: Semaphore,
    request_ids: RequestIds,
}

/// Why the service cannot start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// Nothing answers frames.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A setting that cannot work.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// No certificate that works.
    #[error(transparent)]
    Tls(#[from] TlsError),
}

impl App {
    /// Loads the models, sends a frame through each that is to serve, and starts the threads.
    ///
    /// # Errors
    /// What is missing, or set wrongly.
    pub fn start(settings: Settings) -> Result<Self, StartError> {
        let (sites, tls) = (settings.sites()?, Tls::open(&settings)?);
        Ok(Self(Arc::new(AppState {
            sites,
            tls,
            refusals: Refusals::default(),
            uploads: Semaphore::new(settings.max_uploads),
            request_ids: RequestIds::new(),
            engine: Engine::start(settings)?,
        })))
    }

    /// Refuses frames from now on; those accepted are answered.
    pub fn drain(&self) {
        self.engine.drain();
    }

    /// Whether callers reach the service over TLS.
    pub fn speaks_tls(&self) -> bool {
        self.tls.is_some()
    }
}

impl Deref for App {
    type Target = AppState;

    fn deref(&self) -> &AppState {
        &self.0
    }
}
