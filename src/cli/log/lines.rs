//! Lines that a thread of their own writes, so that a log nobody reads holds nobody up.

use std::io::{self, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

/// The most bytes of lines that wait; further lines are lost, and counted.
const MAX_BYTES: usize = 1 << 20;
/// How long the last lines may take to be written.
const PATIENCE: Duration = Duration::from_secs(1);

/// Where lines go. Cheap to clone; writing never waits for a reader.
#[derive(Clone)]
pub struct Lines(Arc<Shared>);

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    waiting: Vec<u8>,
    n_lost: u64,
    is_writing: bool,
}

impl Lines {
    /// Starts the thread. It calls `tell_lost` when lines that were lost can be told of again.
    pub fn start(
        mut to: impl Write + Send + 'static,
        tell_lost: impl Fn(u64) + Send + 'static,
    ) -> io::Result<Self> {
        let shared = Arc::new(Shared { state: Mutex::default(), changed: Condvar::new() });
        let lines = Self(shared.clone());
        thread::Builder::new().name("log".to_owned()).spawn(move || {
            loop {
                let (waiting, n_lost) = shared.next();
                // A log that is gone, or full, is no reason to stop.
                let _ = to.write_all(&waiting).and_then(|()| to.flush());
                if n_lost > 0 {
                    tell_lost(n_lost);
                }
                shared.state().is_writing = false;
                shared.changed.notify_all();
            }
        })?;
        Ok(lines)
    }

    /// Waits a moment until all lines are written.
    pub fn flush_for_a_moment(&self) {
        let is_busy = |state: &mut State| state.is_writing || state.has_news();
        let _ = self.0.changed.wait_timeout_while(self.0.state(), PATIENCE, is_busy);
    }
}

impl Write for Lines {
    /// Takes a whole line, or loses it.
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        let mut state = self.0.state();
        if state.waiting.len() + line.len() > MAX_BYTES {
            state.n_lost += 1;
        } else {
            state.waiting.extend_from_slice(line);
        }
        drop(state);
        self.0.changed.notify_all();
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Shared {
    /// Waits for lines; returns all of them, and how many were lost.
    fn next(&self) -> (Vec<u8>, u64) {
        let waits = |state: &mut State| !state.has_news();
        let state = self.changed.wait_while(self.state(), waits);
        let mut state = state.unwrap_or_else(PoisonError::into_inner);
        state.is_writing = true;
        (std::mem::take(&mut state.waiting), std::mem::take(&mut state.n_lost))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn has_news(&self) -> bool {
        !self.waiting.is_empty() || self.n_lost > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::{Receiver, Sender, channel};

    /// A reader that takes what is written only when it is told to.
    struct Stuck {
        goes_on: Receiver<()>,
        read: Sender<Vec<u8>>,
    }

    impl Write for Stuck {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let _ = self.goes_on.recv();
            self.read.send(bytes.to_vec()).map_err(io::Error::other)?;
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_log_that_nobody_reads_holds_nobody_up_and_says_what_was_lost() {
        let (go_on, goes_on) = channel();
        let (read, reads) = channel();
        let (tell, told) = channel();
        let tell_lost = move |n_lost| tell.send(n_lost).unwrap();
        let mut lines = Lines::start(Stuck { goes_on, read }, tell_lost).unwrap();
        let line = [b'x'; 1024];
        // The first one may be in the thread's hands.
        let n_lines = 2 * MAX_BYTES / line.len();
        (0..n_lines).for_each(|_| lines.write_all(&line).unwrap());
        drop(go_on);
        let n_lost = told.recv().unwrap();
        lines.flush_for_a_moment();
        let n_read: usize = reads.try_iter().map(|bytes| bytes.len()).sum();
        assert_eq!(n_read / line.len() + n_lost as usize, n_lines);
        assert!(n_lost > 0);
        lines.write_all(b"after").unwrap();
        assert_eq!(reads.recv().unwrap(), b"after");
    }
}
