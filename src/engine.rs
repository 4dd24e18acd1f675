//! What answers frames, whatever brings them: it knows no HTTP.
//!
//! | file | what |
//! |---|---|
//! | `caller` | who calls, for what callers share |
//! | `bodies`, `frame` | the memory for bodies, and who gives way when it is short; a frame and what it holds |
//! | `pool` | the threads that recognize, and the bounded queue before them |
//! | `registry` | the models that serve; see there |
//! | `watch` | looking for what is new among them |
//! | `recognize` | the one path from bytes to an answer |
//! | `answers`, `answer` | the frames of one request; what callers read of each |
//! | `streams` | robots that send frames as they take them; see there |
//! | `doubts` | frames that the model doubted, for whoever keeps them |
//! | `events`, `robots` | what happens, and who is there: what dashboards are told |
//! | `fleet` | the robots of other services |
//! | `live`, `thumbnails` | the robots for pages that show them, and small pictures of what they see |
//! | `recordings`, `shown` | what robots send and are told, into files; pictures as viewers of these show them |
//! | `metrics`, `scrape` | what is counted and measured, and its text |
//! | `history` | the last hour of it |
//! | `aside` | work that stands aside for frames |
//! | `timings`, `spans`, `text` | where time goes, for answers and for traces; names that callers give |
//! | `told` | what the core says, as it travels |

pub mod answer;
pub mod answers;
pub mod aside;
pub mod bodies;
pub mod caller;
pub mod doubts;
pub mod events;
pub mod fleet;
pub mod frame;
pub mod history;
pub mod live;
pub mod metrics;
pub mod pool;
pub mod recognize;
pub mod recordings;
pub mod registry;
pub mod robots;
pub mod scrape;
pub mod shown;
pub mod spans;
pub mod streams;
pub mod text;
pub mod thumbnails;
pub mod timings;
pub mod told;
pub mod watch;

use crate::access::Keyring;
use crate::repository::Repository;
use crate::settings::Settings;
use bodies::{Bodies, BodyLimits};
use doubts::Doubts;
use events::Events;
use fleet::Fleet;
use history::History;
use live::{Live, View};
use metrics::Metrics;
use pool::{Pool, Size};
use recordings::Recordings;
use registry::{Registry, RegistryError};
use robots::Robots;
use roomsight_protocol::fleet::Scope;
use std::fs;
use std::io;
use std::ops::Deref;
use std::sync::Arc;
use streams::Streams;
use thumbnails::Thumbnails;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

/// The running engine. Cheap to clone; all clones are one.
#[derive(Clone)]
pub struct Engine(Arc<EngineState>);

/// What all frames share.
pub struct EngineState {
    /// As they were at the start; the keys in force are in `keyring`.
    pub settings: Settings,
    pub keyring: Keyring,
    pub registry: Registry,
    pub pool: Pool,
    /// One permit for each byte of a body that may be held.
    pub body_memory: Arc<Semaphore>,
    pub bodies: Arc<Bodies>,
    pub streams: Streams,
    pub robots: Robots,
    pub recordings: Recordings,
    pub live: Live,
    pub fleet: Fleet,
    /// The same as `live`, of all services.
    pub fleet_live: Live,
    pub thumbnails: Thumbnails,
    pub events: Events,
    pub doubts: Doubts,
    pub metrics: Arc<Metrics>,
    pub history: History,
    pub stopping: CancellationToken,
}

/// Why the engine cannot start.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    #[error(transparent)]
    Registry(#[from] RegistryError),
    #[error("the recognizing threads cannot be started: {0}")]
    Threads(io::Error),
    #[error("the folder of models cannot be made: {0}")]
    Models(io::Error),
    #[error("the system gives no random numbers: {0}")]
    Random(#[from] getrandom::Error),
    #[error("the metrics cannot be set up: {0}")]
    Metrics(#[from] metrics_exporter_prometheus::BuildError),
}

impl Engine {
    /// Loads the models, sends a frame through each that is to serve, and starts the threads.
    ///
    /// # Errors
    /// What is missing.
    pub fn start(settings: Settings) -> Result<Self, EngineError> {
        let location = settings.models.to_string_lossy();
        // Where people teach the service, the first model comes later. A bucket has no folder.
        if settings.keeps_data() && !Repository::is_bucket(&location) {
            fs::create_dir_all(&settings.models).map_err(EngineError::Models)?;
        }
        let repository = Repository::open(&location, &settings.models_cache).map_err(RegistryError::from)?;
        let (events, metrics) = (Events::default(), Arc::new(Metrics::new()?));
        let registry = Registry::open(repository, &settings, events.clone(), metrics.clone())?;
        let body_memory = Arc::new(Semaphore::new(settings.max_buffered_bytes));
        let bodies = Bodies::new(body_memory.clone(), BodyLimits::of(&settings));
        Ok(Self(Arc::new(EngineState {
            keyring: Keyring::new(&settings.keys)?,
            registry,
            pool: Pool::new(Size::of(&settings)).map_err(EngineError::Threads)?,
            streams: Streams::new(&settings, body_memory.clone())?,
            robots: Robots::new(&settings, events.clone()),
            recordings: Recordings::new(&settings),
            body_memory,
            bodies: Arc::new(bodies),
            live: Live::default(),
            fleet: Fleet::default(),
            fleet_live: Live::default(),
            thumbnails: Thumbnails::default(),
            events,
            doubts: Doubts::default(),
            metrics,
            history: History::default(),
            stopping: CancellationToken::new(),
            settings,
        })))
    }

    /// Whose robots are told of.
    pub fn view(&self, scope: Scope) -> View<'_> {
        let fleet = match scope {
            Scope::Service => None,
            Scope::Fleet => Some(&self.fleet),
        };
        View { robots: &self.robots, fleet }
    }

    /// Where robots are told of as they change.
    pub fn live_of(&self, scope: Scope) -> &Live {
        match scope {
            Scope::Service => &self.live,
            Scope::Fleet => &self.fleet_live,
        }
    }

    /// Where it is told what happens; of a service that knows no others its own.
    pub fn events_of(&self, scope: Scope) -> &Events {
        match scope {
            Scope::Fleet if self.settings.nats.is_set() => &self.fleet.events,
            _ => &self.events,
        }
    }

    /// Refuses frames from now on; those accepted are answered.
    pub fn drain(&self) {
        self.stopping.cancel();
    }

    /// Whether the service is stopping.
    pub fn is_draining(&self) -> bool {
        self.stopping.is_cancelled()
    }
}

impl Deref for Engine {
    type Target = EngineState;

    fn deref(&self) -> &EngineState {
        &self.0
    }
}
