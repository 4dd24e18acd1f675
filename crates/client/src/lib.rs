//! A client of the service: single frames over REST, a robot's frames over a stream.
//!
//! ```no_run
//! # async fn drive(frames: Vec<Vec<u8>>) -> Result<(), roomsight_client::ClientError> {
//! use roomsight_client::Client;
//! use roomsight_protocol::stream::{Configure, ServerMessage};
//!
//! let client = Client::new("http://127.0.0.1:8080", None)?;
//! let robot = Configure { robot: Some("wall-e".into()), ..Configure::default() };
//! let mut stream = client.stream(&robot).await?;
//! for frame in frames {
//!     stream.send(frame).await?;
//!     if let ServerMessage::Result(result) = stream.receive().await? {
//!         println!("{} ({:.2})", result.answer.room, result.answer.probability);
//!     }
//! }
//! # Ok(()) }
//! ```

#[cfg(any(test, feature = "testing"))]
pub mod fake;
mod lasting;
mod models;
mod stream;
mod tls;

use lasting::SILENCE;

pub use lasting::LastingStream;
pub use stream::{ResumePoint, Stream, StreamReceiver, StreamSender};
pub use tls::install_provider;

use reqwest::header::{AUTHORIZATION, CONTENT_TYPE, HeaderMap, HeaderValue, RETRY_AFTER};
use reqwest::multipart::{Form, Part};
use reqwest::{ClientBuilder, Response, StatusCode, Url};
use roomsight_protocol::rest::{Answer, ProblemBody, RecognizeQuery};
use roomsight_protocol::scan::LaserScan;
use roomsight_protocol::stream::Configure;
use rustls::ClientConfig;
use serde::de::DeserializeOwned;
use std::sync::Arc;
use std::time::Duration;
use tokio_tungstenite::tungstenite;

/// How long to wait for a connection, and for the answer to a call.
const PATIENCE: Duration = Duration::from_secs(30);

/// Why a call or a stream failed.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// No address that can be called.
    #[error("{url:?} is no address of a service ({reason}); give one such as http://127.0.0.1:8080")]
    Url {
        /// What was given.
        url: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A key that no header can carry.
    #[error("the key has characters that no key has")]
    Key,
    /// Certificates of authorities that cannot be used.
    #[error("the certificates of those to believe cannot be used: {0}")]
    Authorities(String),
    /// The service cannot be reached, or the call broke.
    #[error(transparent)]
    Call(#[from] reqwest::Error),
    /// The service has refused the frame or the stream, and says why.
    #[error("{}: {}", problem.title, problem.detail)]
    Refused {
        /// What is wrong.
        problem: Box<ProblemBody>,
        /// When to try again, where the service knows.
        retry_after: Option<Duration>,
    },
    /// An answer that the service does not give: something else is at the address, or between.
    #[error("the address answers {0}, but not as roomsight does")]
    Foreign(StatusCode),
    /// The stream cannot be opened, or broke. It may be resumed.
    #[error("the stream broke: {0}")]
    Broken(Box<tungstenite::Error>),
    /// The service did not open the stream in time.
    #[error("the stream was not opened within {} s", PATIENCE.as_secs())]
    Late,
    /// Nothing came over a lasting stream, not even an answer to a ping.
    #[error("nothing was heard over the stream for {} s", SILENCE.as_secs())]
    Silent,
    /// The stream was closed by the service.
    #[error("the stream was closed with {code} {reason}")]
    Closed {
        /// Why: 1001 it stops, 1008 silence or a message that took too long, 1009 a message too long, 1013 try
        /// again later. The AsyncAPI document lists all.
        code: u16,
        /// Why, in words.
        reason: String,
    },
    /// A message that this version of the protocol does not have.
    #[error("a message of the stream cannot be read: {0}")]
    Message(#[from] serde_json::Error),
}

/// A service that can be called. Clones share their connections.
#[derive(Clone, Debug)]
pub struct Client {
    http: reqwest::Client,
    url: Url,
    /// The value of the header `Authorization`.
    authorization: Option<HeaderValue>,
    /// For `https://`.
    tls: Option<Arc<ClientConfig>>,
}

impl Client {
    /// A client of the service at `url`, such as `http://127.0.0.1:8080`, with a key where one is needed. At an
    /// `https://` the certificate must come from an authority that the system believes. Nothing is sent yet.
    ///
    /// # Errors
    /// An address of neither kind, a key that no header can carry, a system without authorities.
    pub fn new(url: &str, key: Option<&str>) -> Result<Self, ClientError> {
        Self::build(url, key, None)
    }

    /// The same, but only the authorities in this PEM are believed.
    ///
    /// # Errors
    /// The same, and a PEM without certificates.
    pub fn believing(url: &str, key: Option<&str>, authorities: &[u8]) -> Result<Self, ClientError> {
        Self::build(url, key, Some(authorities))
    }

    fn build(url: &str, key: Option<&str>, authorities: Option<&[u8]>) -> Result<Self, ClientError> {
        let wrong = |reason: String| ClientError::Url { url: url.to_owned(), reason };
        let parsed = Url::parse(url.trim_end_matches('/')).map_err(|error| wrong(error.to_string()))?;
        let tls = match parsed.scheme() {
            "http" => None,
            "https" => Some(tls::believing(authorities)?),
            other => return Err(wrong(format!("{other} is not spoken here"))),
        };
        let authorization = key.map(|key| bearer(key).ok_or(ClientError::Key)).transpose()?;
        let headers: HeaderMap = authorization.iter().map(|value| (AUTHORIZATION, value.clone())).collect();
        let http = match &tls {
            None => http(PATIENCE),
            Some(config) => plain(PATIENCE).tls_backend_preconfigured(config.clone()),
        };
        let http = http.default_headers(headers).build()?;
        Ok(Self { http, url: parsed, authorization, tls: tls.map(Arc::new) })
    }

    /// The room of one encoded image.
    pub async fn recognize(&self, frame: Vec<u8>, query: &RecognizeQuery) -> Result<Answer, ClientError> {
        let call = self.http.post(self.endpoint("v1/recognize")).query(query).body(frame);
        read(call.header(CONTENT_TYPE, "application/octet-stream").send().await?).await
    }

    /// The same with what the robot's laser measured beside it, for models that look at that.
    ///
    /// # Errors
    /// A service that cannot be reached, or refuses the frame or the scan.
    pub async fn recognize_with_scan(
        &self,
        frame: Vec<u8>,
        scan: &LaserScan,
        query: &RecognizeQuery,
    ) -> Result<Answer, ClientError> {
        let form = Form::new().part("frame", Part::bytes(frame)).text("scan", serde_json::to_string(scan)?);
        read(self.http.post(self.endpoint("v1/recognize")).query(query).multipart(form).send().await?).await
    }

    /// Whether the service answers frames.
    ///
    /// # Errors
    /// A service that cannot be reached.
    pub async fn is_ready(&self) -> Result<bool, ClientError> {
        Ok(self.http.get(self.endpoint("readyz")).send().await?.status().is_success())
    }

    /// Opens a stream that is configured so from its first frame on.
    pub async fn stream(&self, configure: &Configure) -> Result<Stream, ClientError> {
        Stream::open(self, configure).await
    }

    /// Goes on with a stream whose connection broke: the session, its filter and its settings.
    /// `hello().resumed` tells whether the service still had it, or could take it over.
    pub async fn resume(&self, point: &ResumePoint) -> Result<Stream, ClientError> {
        Stream::resume(self, point, &Configure::default()).await
    }

    /// Opens a stream that goes on by itself where its connection breaks or its service stops, as long as the service can be
    /// reached again within `patience`.
    pub async fn lasting_stream(
        &self,
        configure: &Configure,
        patience: Duration,
    ) -> Result<LastingStream, ClientError> {
        LastingStream::open(self.clone(), configure.clone(), patience).await
    }

    fn endpoint(&self, path: &str) -> Url {
        let mut url = self.url.clone();
        url.set_path(&format!("{}/{path}", self.url.path().trim_end_matches('/')));
        url
    }
}

/// A client of plain HTTP, which does without the certificates that a small system may not have.
pub fn http(patience: Duration) -> ClientBuilder {
    plain(patience).tls_certs_only([])
}

/// A client that speaks TLS too, and believes the authorities that the system believes.
///
/// # Errors
/// A system without authorities.
pub fn https(patience: Duration) -> Result<ClientBuilder, ClientError> {
    Ok(plain(patience).tls_backend_preconfigured(tls::believing(None)?))
}

fn plain(patience: Duration) -> ClientBuilder {
    install_provider();
    reqwest::Client::builder().timeout(patience).no_proxy()
}

fn bearer(key: &str) -> Option<HeaderValue> {
    let mut value = HeaderValue::try_from(format!("Bearer {key}")).ok()?;
    value.set_sensitive(true);
    Some(value)
}

async fn read<T: DeserializeOwned>(response: Response) -> Result<T, ClientError> {
    let status = response.status();
    if status.is_success() {
        return serde_json::from_slice(&response.bytes().await?).map_err(|_| ClientError::Foreign(status));
    }
    Err(failure_of(response).await?)
}

/// What a response says that is no success.
async fn failure_of(response: Response) -> Result<ClientError, reqwest::Error> {
    let (status, retry_after) = (response.status(), retry_after(response.headers()));
    Ok(refused(status, retry_after, &response.bytes().await?))
}

/// The error in an answer that is no success.
fn refused(status: StatusCode, retry_after: Option<Duration>, body: &[u8]) -> ClientError {
    match serde_json::from_slice(body) {
        Ok(problem) => ClientError::Refused { problem: Box::new(problem), retry_after },
        Err(_) => ClientError::Foreign(status),
    }
}

fn retry_after(headers: &HeaderMap) -> Option<Duration> {
    headers.get(RETRY_AFTER)?.to_str().ok()?.parse().ok().map(Duration::from_secs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_and_keys_are_checked_before_anything_is_sent() {
        let refused = |url: &str, key| Client::new(url, key).unwrap_err().to_string();
        assert!(refused("127.0.0.1:8080", None).contains("http://127.0.0.1:8080"));
        assert!(refused("ftp://lab", None).contains("ftp is not spoken"));
        assert!(refused("http://lab", Some("a\nb")).contains("key"));
        let debugged = format!("{:?}", Client::new("http://lab", Some("rs_secret")).unwrap());
        assert!(!debugged.contains("rs_secret"), "{debugged}");
    }

    #[test]
    fn calls_keep_the_path_of_the_address() {
        let endpoint = |url: &str| Client::new(url, None).unwrap().endpoint("v1/models").as_str().to_owned();
        assert_eq!(endpoint("http://lab:80"), "http://lab/v1/models");
        assert_eq!(endpoint("http://lab/rooms/"), "http://lab/rooms/v1/models");
    }

    #[test]
    fn what_is_no_problem_of_the_service_is_foreign() {
        let problem = br#"{"type":"/problems/queue-full","title":"The queue is full","status":429,
            "detail":"try again","request_id":"7"}"#;
        let error = refused(StatusCode::TOO_MANY_REQUESTS, Some(Duration::from_secs(2)), problem);
        assert_eq!(error.to_string(), "The queue is full: try again");
        let error = refused(StatusCode::BAD_GATEWAY, None, b"<html>");
        assert!(matches!(error, ClientError::Foreign(StatusCode::BAD_GATEWAY)));
    }
}
