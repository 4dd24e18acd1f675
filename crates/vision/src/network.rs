//! Neural networks as a source of features: an ONNX file, what belongs to it, and ONNX Runtime, which runs it.
//!
//! A network is as little trusted as a picture. Before ONNX Runtime sees its file, the file is looked into
//! (no more than a number of bytes and operations, known operators, no loops, weights that are there and finite);
//! before it computes anything, the sizes of all tensors are known, and with them memory and work are bounded.
//!
//! Numbers that come out differ between processors in their last digits. Whoever compares answers needs a tolerance.

mod budget;
mod description;
mod input;
mod onnx;
mod operators;
mod outputs;
mod refusal;
mod runtime;
mod session;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
#[cfg(test)]
mod tests;
mod weights;
mod wire;
mod xfeat;

pub use description::{
    ColorOrder, Description, GridOutput, Input, Pooling, Size, VectorOutput, XFeatOutputs,
};
pub use input::{Around, FrameInput};
pub use onnx::{MAX_FILE_BYTES, MAX_NODES};
pub use outputs::{Grid, Outputs, XFeatMaps};
pub use runtime::{Runtime, RuntimeError};
pub use session::Session;
pub use xfeat::XFeat;

use onnx::Graph;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fs::File;
use std::io::{self, Read};
use std::ops::{Deref, DerefMut};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A network: its ONNX file and its description. Copies share the file and the sessions.
#[derive(Clone, Debug)]
pub struct Network {
    name: String,
    description: Description,
    onnx: Arc<[u8]>,
    digest: blake3::Hash,
    sessions: Arc<Mutex<Sessions>>,
}

/// The sessions of a network.
#[derive(Debug, Default)]
struct Sessions {
    /// Those that nobody uses now.
    idle: Vec<Session>,
    /// The sizes of those that are lent.
    lent: Vec<Size>,
}

/// A session that is lent: its network has it back when this is dropped.
#[derive(Debug)]
pub struct Lent {
    /// Always there until then.
    session: Option<Session>,
    sessions: Arc<Mutex<Sessions>>,
}

/// Why there is no such network.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Nothing is written beside the ONNX file.
    #[error("{} is missing; start with this, and correct what is not so:\n\n{text}", path.display())]
    NoDescription {
        /// The file to write.
        path: PathBuf,
        /// What to start from.
        text: String,
    },
    /// The description is not as it should be.
    #[error("the description of the network {name}: {why}")]
    Description {
        /// The network.
        name: String,
        /// What is wrong.
        why: String,
    },
    /// The ONNX file is another than the described one.
    #[error(
        "the network {name} is another than its description is about: its digest is {found}, and not {expected}"
    )]
    OtherDigest {
        /// The network.
        name: String,
        /// Of the file.
        found: String,
        /// In the description.
        expected: String,
    },
    /// The network itself is refused.
    #[error("the network {name} {why}")]
    Refused {
        /// The network.
        name: String,
        /// Why.
        why: String,
    },
    /// Nobody has given a network of this name.
    #[error("the network {0} is not there: run `make networks`, or name the folder of its files")]
    NotThere(String),
    /// ONNX Runtime is missing or no good.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
}

impl Network {
    /// Reads `NAME.onnx`, and `NAME.toml` beside it. ONNX Runtime is not needed yet.
    pub fn open(path: &Path) -> Result<Self, NetworkError> {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let in_file = |path: &Path| {
            let path = path.to_owned();
            move |source| NetworkError::Io { path, source }
        };
        let onnx = read_limited(path, MAX_FILE_BYTES).map_err(in_file(path))?;
        let beside = path.with_extension("toml");
        match read_limited(&beside, MAX_DESCRIPTION_BYTES) {
            Ok(text) => Self::new(&name, onnx.into(), &String::from_utf8_lossy(&text)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                let graph = Graph::read(&onnx).map_err(|why| NetworkError::Refused { name, why })?;
                let digest = blake3::hash(&onnx).to_hex();
                let text = Description::to_start_from(&graph, &digest);
                Err(NetworkError::NoDescription { path: beside, text })
            }
            Err(error) => Err(in_file(&beside)(error)),
        }
    }

    /// A network from the bytes of its ONNX file and the text of its description. Both are checked, as far as
    /// that is possible without ONNX Runtime.
    pub fn new(name: &str, onnx: Arc<[u8]>, description: &str) -> Result<Self, NetworkError> {
        let name = name.to_owned();
        let description = match Description::read(description) {
            Ok(description) => description,
            Err(why) => return Err(NetworkError::Description { name, why }),
        };
        let digest = blake3::hash(&onnx);
        if description.digest != digest.to_hex().as_str() {
            let found = digest.to_hex().to_string();
            return Err(NetworkError::OtherDigest { name, found, expected: description.digest });
        }
        match Graph::read(&onnx) {
            Ok(_) => Ok(Self { name, description, onnx, digest, sessions: Arc::default() }),
            Err(why) => Err(NetworkError::Refused { name, why }),
        }
    }

    /// The file's name, without its ending.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What belongs to it.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// The ONNX file.
    pub fn onnx(&self) -> &[u8] {
        &self.onnx
    }

    /// The same, shared.
    pub fn file(&self) -> Arc<[u8]> {
        Arc::clone(&self.onnx)
    }

    /// BLAKE3 of the ONNX file.
    pub fn digest(&self) -> blake3::Hash {
        self.digest
    }

    /// Makes the network ready for one thread and for inputs of `size`. Takes some ten milliseconds.
    pub fn session(&self, runtime: &Runtime, size: Size) -> Result<Session, NetworkError> {
        Session::new(&self.onnx, &self.description, runtime, size).map_err(|why| self.refused(why))
    }

    /// A session for inputs of `size` that has answered a gray picture and one of noise with finite numbers.
    pub fn tried(&self, runtime: &Runtime, size: Size) -> Result<Session, NetworkError> {
        let mut session = self.session(runtime, size)?;
        let Input { mean, scale, .. } = &self.description.input;
        let n_pixels = size.width as usize * size.height as usize;
        let mut noise = ChaCha8Rng::seed_from_u64(0);
        for is_noise in [false, true] {
            let mut value = || if is_noise { f32::from(noise.random::<u8>()) } else { 128.0 };
            let mut input = Vec::with_capacity(3 * n_pixels);
            for (mean, scale) in mean.iter().zip(scale) {
                input.extend((0..n_pixels).map(|_| (value() - mean) * scale));
            }
            session.try_run(&input).map_err(|why| {
                let picture = if is_noise { "a picture of noise" } else { "a gray picture" };
                self.refused(format!("was tried on {picture}, and {why}"))
            })?;
        }
        Ok(session)
    }

    /// One session for inputs of `size`, for as long as the caller needs it: one that was used before, or a new one
    /// that was tried.
    pub fn lend(&self, runtime: &Runtime, size: Size) -> Result<Lent, NetworkError> {
        // Making one takes long, and others may go on meanwhile.
        let kept = lock(&self.sessions).take(size);
        let session = match kept {
            Some(session) => session,
            None => {
                let session = self.tried(runtime, size)?;
                lock(&self.sessions).lent.push(size);
                session
            }
        };
        Ok(Lent { session: Some(session), sessions: Arc::clone(&self.sessions) })
    }

    /// Makes sure that `n_threads` threads can have a session for inputs of `size` each without waiting for it to be made.
    pub fn prepare(&self, runtime: &Runtime, size: Size, n_threads: usize) -> Result<(), NetworkError> {
        while lock(&self.sessions).n_of(size) < n_threads {
            let session = self.tried(runtime, size)?;
            lock(&self.sessions).idle.push(session);
        }
        Ok(())
    }

    fn refused(&self, why: String) -> NetworkError {
        NetworkError::Refused { name: self.name.clone(), why }
    }
}

impl Sessions {
    /// Lends an idle one, if there is one for inputs of this size.
    fn take(&mut self, size: Size) -> Option<Session> {
        let idx = self.idle.iter().position(|session| session.size() == size)?;
        self.lent.push(size);
        Some(self.idle.swap_remove(idx))
    }

    /// Takes one back.
    fn put_back(&mut self, session: Session) {
        if let Some(idx) = self.lent.iter().position(|size| *size == session.size()) {
            self.lent.swap_remove(idx);
        }
        self.idle.push(session);
    }

    /// How many there are for inputs of this size.
    fn n_of(&self, size: Size) -> usize {
        let idle = self.idle.iter().map(Session::size);
        idle.chain(self.lent.iter().copied()).filter(|&other| other == size).count()
    }
}

fn lock(sessions: &Mutex<Sessions>) -> MutexGuard<'_, Sessions> {
    sessions.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Deref for Lent {
    type Target = Session;

    fn deref(&self) -> &Session {
        self.session.as_ref().expect("it is there until it is given back")
    }
}

impl DerefMut for Lent {
    fn deref_mut(&mut self) -> &mut Session {
        self.session.as_mut().expect("it is there until it is given back")
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        if let Some(session) = self.session.take() {
            lock(&self.sessions).put_back(session);
        }
    }
}

/// The most bytes of a description.
const MAX_DESCRIPTION_BYTES: u64 = 1 << 20;

fn read_limited(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(limit + 1).read_to_end(&mut bytes)?;
    match bytes.len() as u64 > limit {
        true => Err(io::Error::other(format!("it is larger than {} MiB", limit >> 20))),
        false => Ok(bytes),
    }
}
