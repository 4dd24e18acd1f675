//! The HTTP service: frames in, rooms out.
//!
//! | file | what |
//! |---|---|
//! | `connection` | connections: how many, how long, and how they end |
//! | `seats`, `linger` | which connection gives way; reading on after an early answer |
//! | `observe` | around every request: its id, its log line, its error in one form |
//! | `auth`, `cors` | keys and pages of other sites, checked before a byte of the body is read |
//! | `caller`, `by` | who calls, as a request tells it: for what callers share, for the audit |
//! | `query`, `body` | what is asked for; untrusted bytes into frames, within limits |
//! | `blocking` | work that waits for the disk or the network |
//! | `routes` | the calls, a file for each resource; who may call them |
//! | `page`, `picture` | the page for people, which is a part of the program; pictures that are kept |
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
mod by;
mod caller;
mod connection;
mod cors;
mod linger;
mod observe;
mod openapi;
mod page;
mod picture;
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
pub use page::is_there as has_page;
pub use reload::{ReloadError, Reloaded};
pub use routes::{document, router};
pub use tls::TlsError;

use crate::access::{Role, Sites};
use crate::engine::{Engine, EngineError};
use crate::settings::{Settings, SettingsError};
use crate::teaching::{Teaching, TeachingError, Trainer};
use observe::RequestIds;
use refusals::Refusals;
use std::ops::Deref;
use std::sync::Arc;
use std::time::Duration;
use tls::Tls;
use tokio::sync::Semaphore;

/// The key of a service that had none.
const OWNER: &str = "owner";

/// The running service, without a socket. Cheap to clone; all clones are one.
#[derive(Clone)]
pub struct App(Arc<AppState>);

/// What all requests share.
pub struct AppState {
    engine: Engine,
    /// None where the service keeps nothing.
    teaching: Option<Arc<Teaching>>,
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
    /// No data directory that works.
    #[error(transparent)]
    Teaching(#[from] TeachingError),
}

impl App {
    /// Loads the models, sends a frame through each that is to serve, and starts the threads.
    ///
    /// # Errors
    /// What is missing, or set wrongly.
    pub fn start(settings: Settings) -> Result<Self, StartError> {
        let (sites, tls) = (settings.sites()?, Tls::open(&settings)?);
        let teaching = settings
            .keeps_data()
            .then(|| Teaching::open(&settings.data, &settings))
            .transpose()?
            .map(Arc::new);
        let engine = Engine::start(settings)?;
        if let Some(teaching) = &teaching {
            teaching.connect(&engine)?;
            engine.keyring.replace(&teaching.keys.beside(&engine.settings.keys)?);
        }
        Ok(Self(Arc::new(AppState {
            sites,
            tls,
            refusals: Refusals::default(),
            uploads: Semaphore::new(engine.settings.max_uploads),
            request_ids: RequestIds::new(),
            teaching,
            engine,
        })))
    }

    /// Refuses frames from now on; those accepted are answered. What runs aside ends.
    pub fn drain(&self) {
        self.engine.drain();
        if let Some(teaching) = &self.teaching {
            teaching.stop();
        }
    }

    /// What people teach.
    ///
    /// # Errors
    /// A service that keeps nothing.
    fn teaching(&self) -> Result<&Teaching, TeachingError> {
        self.teaching.as_deref().ok_or(TeachingError::NoData)
    }

    /// What people teach, with what serves.
    ///
    /// # Errors
    /// A service that keeps nothing.
    fn trainer(&self) -> Result<Trainer, TeachingError> {
        let teaching = self.teaching.clone().ok_or(TeachingError::NoData)?;
        Ok(Trainer { teaching, engine: self.engine.clone() })
    }

    /// Sees to it that there is a key of an admin. Where there was no key at all one is made, and what opens it is returned.
    ///
    /// # Errors
    /// A service that keeps nothing.
    pub fn owner(&self) -> Result<Option<String>, TeachingError> {
        let teaching = self.teaching()?;
        let _changing = teaching.keys.changing();
        if !self.is_open() {
            return Ok(None);
        }
        let (secret, _) = teaching.keys.make(Role::Admin, OWNER, &[], &[])?;
        self.adopt_keys()?;
        Ok(Some(secret))
    }

    /// A code that signs a browser in once, as an admin; none where there is no such key.
    ///
    /// # Errors
    /// A system that gives no random numbers.
    pub fn admin_code(&self, life: Duration) -> Result<Option<String>, TeachingError> {
        let keys = self.engine.keyring.keys();
        let admin = keys.into_iter().find(|key| key.role() == Role::Admin);
        Ok(admin.map(|key| self.engine.keyring.begin_code(&Arc::new(key), life)).transpose()?)
    }

    /// Lets the keys of the settings and those that were made here be valid.
    fn adopt_keys(&self) -> Result<(), TeachingError> {
        let keys = self.teaching()?.keys.beside(&self.engine.settings.keys)?;
        self.engine.keyring.replace(&keys);
        Ok(())
    }

    /// Whether anyone may do everything, since there are no keys.
    pub fn is_open(&self) -> bool {
        self.engine.keyring.is_open()
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
