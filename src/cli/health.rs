//! `roomsight health`: whether a service answers frames, for scripts and containers.

use super::output::say;
use super::serve::environment;
use crate::settings::Settings;
use anyhow::{Context, bail};
use clap::Args;
use roomsight_client::http;
use std::collections::HashMap;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::PathBuf;
use std::time::Duration;

/// Shorter than what the Dockerfile gives the whole command.
const PATIENCE: Duration = Duration::from_secs(4);

/// Ask a service whether it answers frames; exit code 0 where it does
#[derive(Args)]
pub(super) struct HealthArgs {
    /// The service, such as http://127.0.0.1:8080 [default: the one that the settings let listen on this machine]
    url: Option<String>,
    /// The same, as other commands take it
    #[arg(long = "url", value_name = "URL", conflicts_with = "url")]
    named_url: Option<String>,
    /// The TOML file of settings that the service has
    #[arg(long, value_name = "FILE", env = "ROOMSIGHT_CONFIG")]
    config: Option<PathBuf>,
}

/// Asks once, and fails unless the answer is yes.
pub(super) fn run(args: &HealthArgs) -> anyhow::Result<()> {
    let base = match args.url.as_ref().or(args.named_url.as_ref()) {
        Some(url) => url.trim_end_matches('/').to_owned(),
        None => url_of(&Settings::load(args.config.as_deref(), environment(), HashMap::new())?),
    };
    let url = format!("{base}/readyz");
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

/// Where a service of these settings can be called from its own machine.
fn url_of(settings: &Settings) -> String {
    let scheme = if settings.tls_certificate.as_os_str().is_empty() { "http" } else { "https" };
    format!("{scheme}://{}", reachable(&settings.listen))
}

/// Where a service that listens on all addresses can be reached; any other address as it is.
fn reachable(listen: &str) -> String {
    match listen.parse::<SocketAddr>() {
        Ok(address) if address.ip().is_unspecified() => {
            let ip = if address.is_ipv4() {
                IpAddr::from(Ipv4Addr::LOCALHOST)
            } else {
                Ipv6Addr::LOCALHOST.into()
            };
            SocketAddr::new(ip, address.port()).to_string()
        }
        _ => listen.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_listens_on_all_addresses_is_asked_on_its_own_machine() {
        for (listen, url) in [
            ("127.0.0.1:8080", "http://127.0.0.1:8080"),
            ("0.0.0.0:80", "http://127.0.0.1:80"),
            ("[::]:9000", "http://[::1]:9000"),
            ("[::1]:9000", "http://[::1]:9000"),
            ("localhost:1", "http://localhost:1"),
            ("10.0.0.7:8080", "http://10.0.0.7:8080"),
        ] {
            let settings = Settings { listen: listen.to_owned(), ..Settings::default() };
            assert_eq!(url_of(&settings), url);
        }
    }
}
