//! What changes without a restart: keys and certificates.

use crate::http::App;
use crate::http::tls::{Tls, TlsError};
use crate::settings::{Settings, SettingsError};
use crate::teaching::TeachingError;

/// What a reload has done.
#[derive(Debug)]
pub struct Reloaded {
    /// How many keys are valid now.
    pub n_keys: usize,
    /// Whether the certificate was read again; none where the service has none. A certificate that cannot be
    /// used leaves the old one in force.
    pub tls: Option<Result<(), TlsError>>,
    /// Settings that have changed but take a restart, by name.
    pub waiting: Vec<String>,
}

/// Why nothing was reloaded.
#[derive(Debug, thiserror::Error)]
pub enum ReloadError {
    /// Settings that cannot be read.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// Keys that were made on the page cannot be read.
    #[error(transparent)]
    Teaching(#[from] TeachingError),
    /// There were keys, and there would be none.
    #[error(
        "no key is left: the keys stay as they are, since without keys anyone could call; restart for that"
    )]
    NoKeys,
}

impl App {
    /// Takes over the keys of fresh settings, and reads the certificate again. Streams and events of callers
    /// whose key is gone end.
    ///
    /// # Errors
    /// Nothing changes where the settings cannot be, or would open a service that had keys.
    pub fn reload(&self, fresh: &Settings) -> Result<Reloaded, ReloadError> {
        let keys = match &self.teaching {
            Some(teaching) => teaching.keys.beside(&fresh.keys)?,
            None => fresh.keys.clone(),
        };
        if keys.is_empty() && !self.engine.keyring.is_open() {
            return Err(ReloadError::NoKeys);
        }
        let waiting = self.engine.settings.changes_to(fresh)?;
        self.engine.keyring.replace(&keys);
        let tls = self.tls.as_ref().map(Tls::reload_asked);
        Ok(Reloaded { n_keys: keys.len(), tls, waiting })
    }
}
