//! `roomsight health`: whether a service answers frames, for scripts and containers.

use super::output::say;
use crate::client::http;
use anyhow::{Context, bail};
use clap::Args;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(5);

/// Ask a service whether it answers frames; exit code 0 where it does
#[derive(Args)]
pub(super) struct HealthArgs {
    /// The service
    #[arg(default_value = "http://127.0.0.1:8080")]
    url: String,
}

/// Asks once, and fails unless the answer is yes.
pub(super) fn run(args: &HealthArgs) -> anyhow::Result<()> {
    let url = format!("{}/readyz", args.url.trim_end_matches('/'));
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let status = runtime.block_on(async {
        // A container asks itself by an address that its certificate does not name, and tells no secret.
        let client = http(PATIENCE).tls_danger_accept_invalid_certs(true).build()?;
        client.get(&url).send().await.map(|response| response.status())
    });
    let status = status.with_context(|| format!("no answer from {url}"))?;
    if !status.is_success() {
        bail!("{url} answers {status}");
    }
    say!("ready")?;
    Ok(())
}
