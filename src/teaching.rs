//! What people teach the service, and what they decide: all of it lies in one folder, the setting `data`.
//!
//! | file | what |
//! |---|---|
//! | `store` | the database: opened, brought up to date, copied |
//! | `pictures` | pictures by their content |
//! | `sets` | data sets: folders that `train` reads; see there |
//! | `inbox` | frames that the model doubted, and their labels; see there |
//! | `trainings` | trainings, in processes of their own; see there |
//! | `keys` | keys that were made here |
//! | `audit` | who changed what |
//! | `command` | commands of this program that run aside |
//! | `error` | why something is not done |
//!
//! ```text
//! DATA/roomsight.db       labels, changes, trainings, keys, the audit
//! DATA/sets/SET/ROOM/DRIVE/FRAME.jpg
//! DATA/inbox/ab/abcdef....jpg
//! DATA/removed/           frames that a change took away, until they are old
//! DATA/trainings/7/       what a training wrote
//! ```
//!
//! What was acknowledged is there after the process was killed at any moment: a change of a data set is written down
//! before its files are moved, and finished at the next start.

mod audit;
mod command;
mod error;
mod inbox;
mod keys;
mod pictures;
mod sets;
mod store;
mod trainings;

pub use audit::Audit;
pub use error::TeachingError;
pub use inbox::{Inbox, InboxSize};
pub use keys::{KeyMade, MadeKeys};
pub use pictures::type_of;
pub use sets::{FrameFile, NewFrame, Place, Sets, check_room};
pub use store::{DATABASE_FILE, Store};
pub use trainings::{Trainer, Trainings};

use crate::engine::Engine;
use crate::engine::events::Events;
use crate::engine::metrics::Metrics;
use crate::settings::Settings;
use roomsight_protocol::event::Event;
use roomsight_protocol::sets::SetChange;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

/// The file whose lock says that a service uses the folder.
const LOCK_FILE: &str = ".lock";

/// Frames that may wait to be kept.
const N_DOUBTED: usize = 64;
/// How often what is too old is looked for.
const TIDY_EVERY: Duration = Duration::from_secs(3600);

/// All that is kept in the data directory.
pub struct Teaching {
    pub audit: Audit,
    pub inbox: Arc<Inbox>,
    pub keys: MadeKeys,
    pub sets: Arc<Sets>,
    pub trainings: Arc<Trainings>,
    /// Held while the service runs.
    _lock: File,
}

/// Who does something: the name of a key, or an address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Who<'a>(pub &'a str);

impl Teaching {
    /// Opens the data directory, which is made where it is not there, and finishes what was begun.
    ///
    /// # Errors
    /// A folder that cannot be written, that another service uses, or of a newer version.
    pub fn open(folder: &Path, settings: &Settings) -> Result<Self, TeachingError> {
        fs::create_dir_all(folder).map_err(TeachingError::io(folder))?;
        let folder = folder.canonicalize().map_err(TeachingError::io(folder))?;
        let lock = lock(&folder)?;
        let store = Arc::new(Store::open(&folder)?);
        let audit = Audit::new(store.clone());
        let sets = Arc::new(Sets::open(&folder, store.clone(), settings.frame_limits())?);
        Ok(Self {
            inbox: Arc::new(Inbox::open(&folder, store.clone(), sets.clone())?),
            keys: MadeKeys::new(store.clone()),
            trainings: Arc::new(Trainings::open(&folder, store, sets.clone())?),
            sets,
            audit,
            _lock: lock,
        })
    }

    /// Keeps what the engine doubts, by the rule that people have set, for as long as the engine runs.
    ///
    /// # Errors
    /// A database that cannot be read, a thread that cannot be started.
    pub fn connect(&self, engine: &Engine) -> Result<(), TeachingError> {
        let (keeper, doubted) = sync_channel(N_DOUBTED);
        engine.doubts.connect(keeper);
        engine.doubts.adopt(&self.inbox.rule()?);
        self.inbox.tidy()?;
        self.tell_inbox(engine)?;
        let (inbox, told) = (self.inbox.clone(), InboxTold::of(engine));
        let sets = self.sets.clone();
        let keep = move || {
            let (mut was_kept, mut tidied) = (true, Instant::now());
            loop {
                let mut kept = match doubted.recv_timeout(TIDY_EVERY) {
                    Ok(frame) => inbox.keep(frame).map(drop),
                    Err(RecvTimeoutError::Timeout) => Ok(()),
                    Err(RecvTimeoutError::Disconnected) => return,
                };
                if tidied.elapsed() >= TIDY_EVERY {
                    tidied = Instant::now();
                    kept = kept.and(inbox.tidy()).and(sets.tidy());
                }
                let kept = kept.and_then(|()| told.tell(&inbox));
                if let Err(error) = &kept
                    && was_kept
                {
                    tracing::error!(%error, "frames that are doubted cannot be kept");
                }
                was_kept = kept.is_ok();
            }
        };
        let thread = thread::Builder::new().name("inbox".to_owned()).spawn(keep);
        thread.map(drop).map_err(TeachingError::io(Path::new("inbox")))
    }

    /// Tells dashboards and metrics what is in the inbox.
    ///
    /// # Errors
    /// A database that cannot be read.
    pub fn tell_inbox(&self, engine: &Engine) -> Result<(), TeachingError> {
        InboxTold::of(engine).tell(&self.inbox)
    }

    /// Ends what runs aside, since the service stops.
    pub fn stop(&self) {
        self.trainings.stop();
        self.sets.stop_checks();
    }

    /// Undoes a change of a data set.
    ///
    /// # Errors
    /// As of [`Sets::undo`].
    pub fn undo(&self, set: &str, id: i64) -> Result<SetChange, TeachingError> {
        let change = self.sets.undo(set, id)?;
        self.inbox.forget_labels(set)?;
        Ok(change)
    }
}

/// Who hears what is in the inbox.
struct InboxTold {
    events: Events,
    metrics: Arc<Metrics>,
}

impl InboxTold {
    fn of(engine: &Engine) -> Self {
        Self { events: engine.events.clone(), metrics: engine.metrics.clone() }
    }

    fn tell(&self, inbox: &Inbox) -> Result<(), TeachingError> {
        let InboxSize { open, open_bytes, .. } = inbox.size()?;
        self.metrics.beside().inbox(open, open_bytes);
        self.events.tell(Event::InboxChanged { open });
        Ok(())
    }
}

/// Takes the folder for this process.
fn lock(folder: &Path) -> Result<File, TeachingError> {
    let path: PathBuf = folder.join(LOCK_FILE);
    let file = File::options().create(true).append(true).open(&path).map_err(TeachingError::io(&path))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(_) => Err(TeachingError::InUse(folder.to_owned())),
    }
}
