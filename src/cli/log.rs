//! The log of `roomsight serve` on standard error, and its traces where the program was built with them.

#[cfg(feature = "otlp")]
mod otlp;

use crate::server::{LogFormat, Settings};
use anyhow::Context;
use std::io::{IsTerminal, stderr};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer, Registry, fmt, registry};

/// The log of this process.
pub(super) struct Log {
    #[cfg(feature = "otlp")]
    traces: Option<otlp::Traces>,
}

/// Starts the log.
pub(super) fn start(settings: &Settings) -> anyhow::Result<Log> {
    let filter: EnvFilter = settings
        .log_level
        .parse()
        .with_context(|| format!("the setting `log_level` is wrong: {:?}", settings.log_level))?;
    let log = Log {
        #[cfg(feature = "otlp")]
        traces: otlp::Traces::start(&settings.otlp_endpoint)?,
    };
    let lines = fmt::layer().with_writer(stderr);
    match settings.log_format {
        LogFormat::Human => log.write(lines.with_target(false).with_ansi(stderr().is_terminal()), filter),
        LogFormat::Json => log.write(lines.json().flatten_event(true).with_span_list(false), filter),
    }
    Ok(log)
}

impl Log {
    /// Sends what is still to be sent.
    pub(super) fn end(self) {
        #[cfg(feature = "otlp")]
        if let Some(traces) = self.traces {
            traces.end();
        }
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
