//! TLS: the certificate of the service, what callers must show, and both anew when their files change.

use crate::http::App;
use crate::settings::Settings;
use arc_swap::ArcSwap;
use rustls::crypto::ring;
use rustls::pki_types::pem::{self, PemObject};
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::{VerifierBuilderError, WebPkiClientVerifier};
use rustls::{RootCertStore, ServerConfig};
use std::convert::Infallible;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::io::{AsyncWriteExt, copy, sink};
use tokio::net::TcpStream;
use tokio::task::spawn_blocking;
use tokio::time::{interval, timeout};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;

/// How often the files are looked at.
const LOOK_EVERY: Duration = Duration::from_secs(2);
/// How long a handshake may take.
const HANDSHAKE_PATIENCE: Duration = Duration::from_secs(10);
/// How long a caller that speaks plain HTTP may take to hear that this is TLS.
const LINGER: Duration = Duration::from_secs(1);
/// What callers hear that do not begin one.
const PLAIN_HTTP: &[u8] =
    b"HTTP/1.1 400 Bad Request\r\ncontent-type: text/plain\r\nconnection: close\r\n\r\n\
    this port speaks TLS: begin the address with https://, or wss:// for a stream\n";
/// What is spoken inside, for callers that ask.
const PROTOCOL: &[u8] = b"http/1.1";

/// The certificate in force.
pub struct Tls {
    files: Files,
    config: ArcSwap<ServerConfig>,
    /// What the files held when they were read last, whether it could be used or not.
    seen: Mutex<blake3::Hash>,
}

/// Why there is no certificate that works.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// A certificate without a key, or the reverse.
    #[error("the setting `{0}` is missing: TLS takes both `tls_certificate` and `tls_key`")]
    Half(&'static str),
    /// A file that cannot be read.
    #[error("the setting `{name}` is wrong: {path:?} cannot be read: {error}")]
    Unreadable { name: &'static str, path: PathBuf, error: io::Error },
    /// A file that holds something else.
    #[error("the setting `{name}` is wrong: {path:?} holds no PEM of {what}: {error}")]
    Pem {
        name: &'static str,
        path: PathBuf,
        /// What was looked for.
        what: &'static str,
        error: pem::Error,
    },
    /// A key of another certificate, for example.
    #[error("the files of `tls_certificate` and `tls_key` do not work together: {0}")]
    Unusable(#[from] rustls::Error),
    /// Authorities that cannot be believed.
    #[error("the setting `tls_client_ca` is wrong: {0}")]
    Authorities(#[from] VerifierBuilderError),
}

struct Files {
    certificate: PathBuf,
    key: PathBuf,
    client_ca: Option<PathBuf>,
}

/// What the files hold.
struct Contents {
    certificate: Vec<u8>,
    key: Vec<u8>,
    client_ca: Option<Vec<u8>>,
}

impl Tls {
    /// Reads the files that the settings name; none where they name none.
    ///
    /// # Errors
    /// Files that cannot be used, or half of them.
    pub fn open(settings: &Settings) -> Result<Option<Self>, TlsError> {
        let Some(files) = Files::of(settings)? else { return Ok(None) };
        let contents = files.read()?;
        let config = files.config(&contents)?;
        let seen = Mutex::new(contents.digest());
        Ok(Some(Self { files, config: ArcSwap::from_pointee(config), seen }))
    }

    /// Reads the files again; whether they hold something new. Where that cannot be used the old stays.
    ///
    /// # Errors
    /// Files that cannot be used, the first time that they are seen so.
    pub fn reload(&self) -> Result<bool, TlsError> {
        let contents = self.files.read();
        if !self.is_news(&contents) {
            return Ok(false);
        }
        self.take_over(contents).map(|()| true)
    }

    /// Reads the files again because somebody asked, who is told of every time that they cannot be used.
    ///
    /// # Errors
    /// Files that cannot be used; the old stays.
    pub fn reload_asked(&self) -> Result<(), TlsError> {
        let contents = self.files.read();
        self.is_news(&contents);
        self.take_over(contents)
    }

    /// Notes what the files hold; whether it was something else before.
    fn is_news(&self, contents: &Result<Contents, TlsError>) -> bool {
        let digest = match contents {
            Ok(contents) => contents.digest(),
            Err(error) => blake3::hash(error.to_string().as_bytes()),
        };
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        std::mem::replace(&mut *seen, digest) != digest
    }

    fn take_over(&self, contents: Result<Contents, TlsError>) -> Result<(), TlsError> {
        self.config.store(Arc::new(self.files.config(&contents?)?));
        Ok(())
    }

    /// Shakes hands with a caller.
    ///
    /// # Errors
    /// A caller that speaks something else, is too slow, or shows no certificate where it must.
    pub async fn accept(&self, stream: TcpStream) -> io::Result<TlsStream<TcpStream>> {
        timeout(HANDSHAKE_PATIENCE, self.shake_hands(stream)).await?
    }

    async fn shake_hands(&self, mut stream: TcpStream) -> io::Result<TlsStream<TcpStream>> {
        let mut first = [0];
        stream.peek(&mut first).await?;
        if first[0].is_ascii_alphabetic() {
            stream.write_all(PLAIN_HTTP).await?;
            stream.shutdown().await?;
            // Bytes that nobody reads would reset the connection, and the reset overtake the reason.
            let _ = timeout(LINGER, copy(&mut stream, &mut sink())).await;
            return Err(io::Error::other("plain HTTP"));
        }
        TlsAcceptor::from(self.config.load_full()).accept(stream).await
    }
}

/// Reads the files again whenever they change, for ever.
pub async fn watch(app: App) -> Infallible {
    let mut looks = interval(LOOK_EVERY);
    loop {
        looks.tick().await;
        let app = app.clone();
        let looked = spawn_blocking(move || app.tls.as_ref().map_or(Ok(false), Tls::reload));
        match looked.await {
            Ok(Ok(true)) => tracing::info!("the certificate has changed"),
            Ok(Err(error)) => tracing::warn!(%error, "the old certificate stays"),
            Ok(Ok(false)) | Err(_) => {}
        }
    }
}

impl Files {
    fn of(settings: &Settings) -> Result<Option<Self>, TlsError> {
        let given = |path: &PathBuf| (!path.as_os_str().is_empty()).then(|| path.clone());
        let client_ca = given(&settings.tls_client_ca);
        match (given(&settings.tls_certificate), given(&settings.tls_key)) {
            (Some(certificate), Some(key)) => Ok(Some(Self { certificate, key, client_ca })),
            (None, None) if client_ca.is_none() => Ok(None),
            (None, _) => Err(TlsError::Half("tls_certificate")),
            (Some(_), None) => Err(TlsError::Half("tls_key")),
        }
    }

    fn read(&self) -> Result<Contents, TlsError> {
        let read = |name, path: &Path| {
            std::fs::read(path).map_err(|error| TlsError::Unreadable { name, path: path.to_owned(), error })
        };
        Ok(Contents {
            certificate: read("tls_certificate", &self.certificate)?,
            key: read("tls_key", &self.key)?,
            client_ca: self.client_ca.as_deref().map(|path| read("tls_client_ca", path)).transpose()?,
        })
    }

    fn config(&self, contents: &Contents) -> Result<ServerConfig, TlsError> {
        let certificates = certificates("tls_certificate", &self.certificate, &contents.certificate)?;
        let key = PrivateKeyDer::from_pem_slice(&contents.key).map_err(|error| TlsError::Pem {
            name: "tls_key",
            path: self.key.clone(),
            what: "a private key",
            error,
        })?;
        let provider = Arc::new(ring::default_provider());
        let builder =
            ServerConfig::builder_with_provider(provider.clone()).with_safe_default_protocol_versions()?;
        let builder = match self.client_ca.as_deref().zip(contents.client_ca.as_deref()) {
            None => builder.with_no_client_auth(),
            Some((path, pem)) => {
                let mut roots = RootCertStore::empty();
                for authority in self::certificates("tls_client_ca", path, pem)? {
                    roots.add(authority)?;
                }
                let verifier =
                    WebPkiClientVerifier::builder_with_provider(Arc::new(roots), provider).build()?;
                builder.with_client_cert_verifier(verifier)
            }
        };
        let mut config = builder.with_single_cert(certificates, key)?;
        config.alpn_protocols = vec![PROTOCOL.to_vec()];
        Ok(config)
    }
}

impl Contents {
    fn digest(&self) -> blake3::Hash {
        let mut hasher = blake3::Hasher::new();
        for part in [&self.certificate, &self.key].into_iter().chain(&self.client_ca) {
            hasher.update(blake3::hash(part).as_bytes());
        }
        hasher.finalize()
    }
}

/// All certificates of a file; at least one.
fn certificates(
    name: &'static str,
    path: &Path,
    pem: &[u8],
) -> Result<Vec<CertificateDer<'static>>, TlsError> {
    let wrong = |error| TlsError::Pem { name, path: path.to_owned(), what: "a certificate", error };
    let found: Vec<_> = CertificateDer::pem_slice_iter(pem).collect::<Result<_, _>>().map_err(wrong)?;
    if found.is_empty() { Err(wrong(pem::Error::NoItemsFound)) } else { Ok(found) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/tls/");

    fn settings(certificate: impl Into<PathBuf>, key: impl Into<PathBuf>) -> Settings {
        Settings { tls_certificate: certificate.into(), tls_key: key.into(), ..Settings::default() }
    }

    fn path(name: &str) -> PathBuf {
        Path::new(FOLDER).join(name)
    }

    #[test]
    fn files_that_cannot_be_used_are_named() {
        let refusal = |settings: Settings| Tls::open(&settings).map(drop).unwrap_err().to_string();
        for (settings, words) in [
            (settings(path("service.pem"), ""), "tls_key"),
            (settings("", path("service.key")), "tls_certificate"),
            (settings(path("none.pem"), path("service.key")), "none.pem"),
            (settings(path("service.key"), path("service.key")), "a certificate"),
            (settings(path("service.pem"), path("service.pem")), "a private key"),
            (settings(path("service.pem"), path("renewed.key")), "do not work together"),
            (Settings { tls_client_ca: path("ca.pem"), ..Settings::default() }, "tls_certificate"),
        ] {
            let refusal = refusal(settings);
            assert!(refusal.contains(words), "{refusal}");
        }
        assert!(Tls::open(&Settings::default()).unwrap().is_none());
    }

    #[test]
    fn changed_files_are_taken_over_where_they_work() {
        let folder = tempfile::tempdir().unwrap();
        let (certificate, key) = (folder.path().join("a.pem"), folder.path().join("a.key"));
        let lay = |name: &str, to: &Path| fs::copy(path(name), to).unwrap();
        lay("service.pem", &certificate);
        lay("service.key", &key);
        let tls = Tls::open(&settings(&certificate, &key)).unwrap().unwrap();
        let first = tls.config.load_full();
        assert!(!tls.reload().unwrap());
        lay("renewed.pem", &certificate);
        assert!(tls.reload().is_err(), "the key is still the old one");
        assert!(!tls.reload().unwrap(), "and that is told once");
        assert!(Arc::ptr_eq(&first, &tls.config.load_full()));
        lay("renewed.key", &key);
        assert!(tls.reload().unwrap());
        assert!(!Arc::ptr_eq(&first, &tls.config.load_full()));
    }
}
