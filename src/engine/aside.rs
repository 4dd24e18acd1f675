//! Work that stands aside for frames.

use std::panic::resume_unwind;
use std::thread;

/// How far below the recognizing threads it stands: as far as can be. Where these keep all processors busy, one or two
/// hundredths of one are left.
#[cfg(target_os = "linux")]
const NICENESS: i32 = 19;

/// Does the work on a thread of its own that gets the processors after those that recognize.
pub fn aside<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    thread::scope(|scope| {
        let working = scope.spawn(|| {
            stand_aside();
            work()
        });
        working.join().unwrap_or_else(|panic| resume_unwind(panic))
    })
}

/// On Linux each thread has a niceness of its own; elsewhere it is left as it is.
pub fn stand_aside() {
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::setpriority_process(Some(rustix::thread::gettid()), NICENESS) {
        tracing::debug!(%error, "the niceness of a thread could not be set");
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use rustix::process::getpriority_process;
    use rustix::thread::gettid;

    #[test]
    fn only_the_work_stands_aside() {
        let niceness = || getpriority_process(Some(gettid())).unwrap();
        let before = niceness();
        assert_eq!(aside(niceness), NICENESS);
        assert_eq!(niceness(), before);
    }
}
