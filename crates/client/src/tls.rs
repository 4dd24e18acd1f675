//! TLS as callers see it: whom they believe.

use super::ClientError;
use reqwest::Url;
use rustls::crypto::ring;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, ServerName};
use rustls::{ClientConfig, RootCertStore};
use rustls_platform_verifier::BuilderVerifierExt;
use std::io;
use std::sync::Arc;
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;
use tokio_util::either::Either;

/// Lets clients of HTTP in this process encrypt by `ring`, where nothing else was chosen before.
pub fn install_provider() {
    // That something was chosen is no error.
    let _ = ring::default_provider().install_default();
}

/// A connection, with TLS or without.
pub(super) type Connection = Either<TcpStream, TlsStream<TcpStream>>;

/// Believes the authorities of a PEM, or those that the system believes.
pub(super) fn believing(authorities: Option<&[u8]>) -> Result<ClientConfig, ClientError> {
    let wrong = |error: &dyn ToString| ClientError::Authorities(error.to_string());
    let builder = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .map_err(|error| wrong(&error))?;
    let builder = match authorities {
        None => builder.with_platform_verifier().map_err(|error| wrong(&error))?,
        Some(pem) => {
            let mut roots = RootCertStore::empty();
            for authority in CertificateDer::pem_slice_iter(pem) {
                roots.add(authority.map_err(|error| wrong(&error))?).map_err(|error| wrong(&error))?;
            }
            if roots.is_empty() {
                return Err(wrong(&"there is no certificate in it"));
            }
            builder.with_root_certificates(roots)
        }
    };
    Ok(builder.with_no_client_auth())
}

/// Connects to the host of an address, with TLS where there is a configuration of it.
pub(super) async fn connect(url: &Url, tls: Option<&Arc<ClientConfig>>) -> io::Result<Connection> {
    // An address of IPv6 stands in brackets.
    let host = url.host_str().unwrap_or_default().trim_matches(['[', ']']);
    let stream = TcpStream::connect((host, url.port_or_known_default().unwrap_or(80))).await?;
    // Without Nagle's algorithm: a frame leaves at once.
    stream.set_nodelay(true)?;
    let Some(config) = tls else { return Ok(Either::Left(stream)) };
    let name = ServerName::try_from(host.to_owned()).map_err(io::Error::other)?;
    Ok(Either::Right(TlsConnector::from(config.clone()).connect(name, stream).await?))
}
