//! Commands of this program that run aside: in a process of their own, which gets the processors after those that
//! recognize, and which cannot take the service along.

use super::TeachingError;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::{env, io, process, thread};

/// As far as can be below the service.
#[cfg(target_os = "linux")]
const NICENESS: i32 = 19;

/// The longest line of what it says that is kept, in bytes.
const MAX_LINE: u64 = 4096;

/// The most that is read of what it prints, in bytes.
const MAX_PRINTED: u64 = 64 << 20;

/// A command that runs.
pub struct Command {
    child: Arc<Mutex<Child>>,
    said: Box<dyn Read + Send>,
    printed: Box<dyn Read + Send>,
}

/// Ends a command early.
#[derive(Clone)]
pub struct Stop(Arc<Mutex<Child>>);

/// What came of a command.
pub struct Outcome {
    status: io::Result<ExitStatus>,
    printed: String,
    /// The last line of what it said.
    last_line: String,
}

impl Command {
    /// Starts a command of this program with these arguments.
    ///
    /// # Errors
    /// A process that cannot be started.
    pub fn start(arguments: &[&OsStr]) -> Result<Self, TeachingError> {
        let program = env::current_exe().map_err(TeachingError::io(Path::new("roomsight")))?;
        let mut command = process::Command::new(&program);
        command.args(arguments).arg("--progress=lines").stdin(Stdio::null());
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().map_err(TeachingError::io(&program))?;
        #[cfg(target_os = "linux")]
        stand_aside(&child);
        let (Some(printed), Some(said)) = (child.stdout.take(), child.stderr.take()) else {
            return Err(TeachingError::io(&program)(io::ErrorKind::BrokenPipe.into()));
        };
        Ok(Self { child: Arc::new(Mutex::new(child)), said: Box::new(said), printed: Box::new(printed) })
    }

    /// What ends it early.
    pub fn stopper(&self) -> Stop {
        Stop(self.child.clone())
    }

    /// Waits for its end; each line of what it says meanwhile is told.
    pub fn finish(self, mut tell: impl FnMut(&str)) -> Outcome {
        let Self { child, said, printed } = self;
        let printing = thread::spawn(move || {
            let mut text = String::new();
            let _ = printed.take(MAX_PRINTED).read_to_string(&mut text);
            text
        });
        let mut last_line = String::new();
        let mut reader = BufReader::new(said);
        let mut line = Vec::new();
        while reader.by_ref().take(MAX_LINE).read_until(b'\n', &mut line).is_ok_and(|n_bytes| n_bytes > 0) {
            let text = String::from_utf8_lossy(&line);
            let text = text.trim_end();
            if !text.is_empty() {
                tell(text);
                text.clone_into(&mut last_line);
            }
            line.clear();
        }
        let printed = printing.join().unwrap_or_default();
        Outcome { status: lock(&child).wait(), printed, last_line }
    }
}

impl Stop {
    /// Ends it now.
    pub fn now(&self) {
        // It may have ended by itself.
        let _ = lock(&self.0).kill();
    }
}

impl Outcome {
    /// What it printed, or why it failed.
    pub fn printed(&self) -> Result<&str, String> {
        match &self.status {
            Ok(status) if status.success() => Ok(&self.printed),
            Ok(_) if !self.last_line.is_empty() => {
                Err(self.last_line.strip_prefix("roomsight: ").unwrap_or(&self.last_line).to_owned())
            }
            Ok(status) => Err(format!("the process ended early: {status}")),
            Err(error) => Err(error.to_string()),
        }
    }
}

#[cfg(target_os = "linux")]
fn stand_aside(child: &Child) {
    let id = i32::try_from(child.id()).ok().and_then(rustix::process::Pid::from_raw);
    if let Err(error) = rustix::process::setpriority_process(id, NICENESS) {
        tracing::debug!(%error, "the niceness of a process could not be set");
    }
}

fn lock(child: &Mutex<Child>) -> MutexGuard<'_, Child> {
    child.lock().unwrap_or_else(PoisonError::into_inner)
}
