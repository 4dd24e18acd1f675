//! How commands call a service.

use anyhow::Context;
use clap::Args;
use roomsight_client::Client;
use std::fs;
use std::path::PathBuf;

/// What a service asks of its callers.
#[derive(Args)]
pub(super) struct ServiceArgs {
    /// A key of the service, where it asks for one
    #[arg(long, global = true, value_name = "KEY", env = "ROOMSIGHT_KEY", hide_env_values = true)]
    key: Option<String>,
    /// The authority of the service's certificate, a file of PEM [default: those that the system believes]
    #[arg(long, global = true, value_name = "FILE", env = "ROOMSIGHT_CA")]
    ca: Option<PathBuf>,
}

impl ServiceArgs {
    /// A client of the service at an address.
    pub(super) fn client(&self, url: &str) -> anyhow::Result<Client> {
        let key = self.key.as_deref();
        let Some(path) = &self.ca else { return Ok(Client::new(url, key)?) };
        let authorities = fs::read(path).with_context(|| format!("{} cannot be read", path.display()))?;
        Ok(Client::believing(url, key, &authorities)?)
    }
}
