//! Who does what a request asks for, for the audit.

use crate::access::Key;
use crate::http::App;
use crate::http::caller::Peer;
use crate::teaching::Who;
use axum::extract::FromRequestParts;
use axum::http::request::Parts;
use roomsight_protocol::audit::Deed;
use std::convert::Infallible;
use std::sync::Arc;

/// The name of a caller's key, else its address.
#[derive(Clone, Debug)]
pub struct By(String);

impl By {
    pub fn who(&self) -> Who<'_> {
        Who(&self.0)
    }

    /// Writes down what was done, where the service keeps an audit. It waits for the disk.
    pub fn did(&self, app: &App, deed: Deed, target: &str, detail: &str) {
        if let Some(teaching) = &app.teaching {
            teaching.audit.note(self.who(), deed, target, detail);
        }
    }
}

impl FromRequestParts<App> for By {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &App) -> Result<Self, Infallible> {
        let extensions = &parts.extensions;
        let key = extensions.get::<Arc<Key>>().map(|key| key.name().to_owned());
        let address = || extensions.get().map(|Peer(address)| address.ip().to_canonical().to_string());
        Ok(Self(key.or_else(address).unwrap_or_default()))
    }
}
