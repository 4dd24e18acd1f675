//! The log of `roomsight serve` on standard error, and its traces where the program was built with them.

mod lines;
#[cfg(feature = "otlp")]
mod otlp;

use super::manners::Manners;
use crate::settings::{LogFormat, Settings};
use anyhow::Context;
use lines::Lines;
use std::fs::File;
use std::io::stderr;
use std::{panic, thread};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer, Registry, fmt, registry};

/// What `--verbose` logs: more than is said of the service itself, and not what libraries say.
const VERBOSE: &str = "info,roomsight=debug";

/// The log of this process.
pub(super) struct Log {
    lines: Lines,
    #[cfg(feature = "otlp")]
    traces: Option<otlp::Traces>,
}

/// Starts the log.
pub(super) fn start(settings: &Settings) -> anyhow::Result<Log> {
    let level = if Manners::adopted().verbose { VERBOSE } else { &settings.log_level };
    let filter: EnvFilter = level
        .parse()
        .with_context(|| format!("the setting `log_level` is wrong: {:?}", settings.log_level))?;
    let log = Log {
        lines: lines()?,
        #[cfg(feature = "otlp")]
        traces: otlp::Traces::start(&settings.otlp_endpoint)?,
    };
    let writer = log.lines.clone();
    let lines = fmt::layer().with_writer(move || writer.clone());
    match settings.log_format {
        LogFormat::Human => {
            log.write(lines.with_target(false).with_ansi(Manners::adopted().has_color()), filter);
        }
        LogFormat::Json => log.write(lines.json().flatten_event(true).with_span_list(false), filter),
    }
    log.take_panics();
    Ok(log)
}

/// Lines that a thread writes to standard error.
fn lines() -> anyhow::Result<Lines> {
    let tell_lost = |n_lost: u64| {
        tracing::warn!(lines = n_lost, "lines of the log were lost: they were not read in time");
    };
    Ok(Lines::start(unlocked_stderr()?, tell_lost)?)
}

/// Standard error without its lock, which a thread may hold for as long as nobody reads.
#[cfg(unix)]
fn unlocked_stderr() -> std::io::Result<File> {
    use std::os::fd::AsFd;

    Ok(File::from(stderr().as_fd().try_clone_to_owned()?))
}

/// The same where handles are not files.
#[cfg(not(unix))]
fn unlocked_stderr() -> std::io::Result<std::io::Stderr> {
    Ok(stderr())
}

impl Log {
    /// Lets panics be told in the log: on standard error they would wait for its reader.
    fn take_panics(&self) {
        let lines = self.lines.clone();
        panic::set_hook(Box::new(move |panic| {
            let told = panic.to_string().replace('\n', " ");
            tracing::error!(thread = thread::current().name(), "{told}");
            if thread::current().name() == Some("main") {
                lines.flush_for_a_moment();
            }
        }));
    }

    /// Sends and writes what is still to be sent and written.
    pub(super) fn end(self) {
        #[cfg(feature = "otlp")]
        if let Some(traces) = self.traces {
            traces.end();
        }
        self.lines.flush_for_a_moment();
    }

    fn write(&self, lines: impl Layer<Registry> + Send + Sync, filter: EnvFilter) {
        #[cfg(feature = "otlp")]
        if let Some(traces) = &self.traces {
            // Traces take spans that the log leaves out.
            return registry().with(lines.with_filter(filter)).with(traces.layer()).init();
        }
        registry().with(lines).with(filter).init();
    }
}
