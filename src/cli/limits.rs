//! What the system allows a process: open files, and the size of a file.

use crate::settings::Settings;

/// Open files beside connections and streams: models, the log, what an upload writes.
#[cfg(target_os = "linux")]
const N_OTHER_FILES: u64 = 256;

/// Raises the limit on open files to what the settings need, or says that it is too low for them.
#[cfg(target_os = "linux")]
pub(super) fn raise_open_files(settings: &Settings) {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

    let n_needed = settings.max_connections as u64 + settings.max_streams as u64 + N_OTHER_FILES;
    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    let Some(n_allowed) = current.filter(|&n_allowed| n_allowed < n_needed) else { return };
    let raised = maximum.map_or(n_needed, |maximum| maximum.min(n_needed));
    let n_allowed = match setrlimit(Resource::Nofile, Rlimit { current: Some(raised), maximum }) {
        Ok(()) => raised,
        Err(_) => n_allowed,
    };
    if n_allowed < n_needed {
        tracing::warn!(
            allowed = n_allowed,
            needed = n_needed,
            "fewer files may be open than `max_connections` and `max_streams` need; raise the hard limit \
             (`ulimit -Hn`, or LimitNOFILE of systemd), or lower the two"
        );
    }
}

/// Lets writing beyond the limit on the size of a file fail, as on a full disk, instead of ending the process.
/// It must be called within the runtime.
#[cfg(target_os = "linux")]
pub(super) fn survive_large_files() {
    use rustix::process::Signal;
    use tokio::signal::unix::{SignalKind, signal};

    // Once a signal is listened to it ends no process, even when nobody listens any more.
    if let Err(error) = signal(SignalKind::from_raw(Signal::XFSZ.as_raw())) {
        tracing::debug!(%error, "SIGXFSZ cannot be caught");
    }
}

/// Elsewhere the limits are left as they are.
#[cfg(not(target_os = "linux"))]
pub(super) fn raise_open_files(_: &Settings) {}

/// Elsewhere there is no such limit, or it is left as it is.
#[cfg(not(target_os = "linux"))]
pub(super) fn survive_large_files() {}
