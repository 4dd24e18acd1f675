//! Every error that a caller can see, as RFC 9457 `application/problem+json`, or as the Open Inference
//! Protocol has it. The only place that knows status codes.

mod kind;

pub use kind::Kind;

use super::auth::AuthError;
use super::body::BodyError;
use super::pool::QueueFull;
use super::recognize::RecognizeError;
use super::registry::{ChangeError, LookupError};
use super::upload::{UPLOAD_WAIT, UploadError};
use crate::repository::RepositoryError;
use Kind as K;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use roomsight_protocol::oip;
use roomsight_protocol::oip::request::RequestError;
use roomsight_protocol::rest::ProblemBody;
use roomsight_protocol::version_id::VersionIdError;
use roomsight_vision::image::ImageError;
use std::sync::Arc;
use std::time::Duration;

/// The path of the Open Inference Protocol, and what begins all others of it.
const OIP_PATH: &str = "/v2";

/// How callers read errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorForm {
    /// As RFC 9457 has it.
    Problem,
    /// As the Open Inference Protocol has it.
    Oip,
}

/// What went wrong with a request.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// The caller may not.
    #[error(transparent)]
    Auth(#[from] AuthError),
    /// The body is wrong.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The model is not there.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// The queue is full.
    #[error(transparent)]
    Busy(#[from] QueueFull),
    /// The frame got no answer.
    #[error(transparent)]
    Recognize(#[from] RecognizeError),
    /// One of several frames got no answer, and the others therefore none either.
    #[error("frame {frame_idx} (counted from 0): {cause}")]
    Frame {
        /// Which, from 0.
        frame_idx: usize,
        /// Why.
        cause: Box<Problem>,
    },
    /// A request of the Open Inference Protocol cannot be read.
    #[error(transparent)]
    Oip(#[from] RequestError),
    /// The query or the path is wrong.
    #[error("{0}")]
    Query(String),
    /// No WebSocket was asked for.
    #[error(
        "open a WebSocket with the subprotocol roomsight.v1 here, and let a proxy on the way pass the headers \
         Upgrade and Connection: {0}"
    )]
    NoWebSocket(String),
    /// What serves is not changed.
    #[error(transparent)]
    Change(#[from] ChangeError),
    /// A version does not come in.
    #[error(transparent)]
    Upload(#[from] UploadError),
    /// Nobody of this name streams.
    #[error("no robot {0:?} streams; GET /v1/robots lists those that do")]
    NoRobot(String),
    /// What came is no HTTP.
    #[error("{}", K::NotHttp.advice())]
    NotHttp,
    /// There is nothing of this name.
    #[error("{}", K::NotFound.advice())]
    NotFound,
    /// The service stops.
    #[error("the service is stopping; send the request to another, or again in a while")]
    Draining,
    /// An answer of the framework with an error's status.
    #[error("{}", Kind::from_status(*.0).advice())]
    Framework(StatusCode),
}

impl ErrorForm {
    /// The form of the errors at a path.
    pub fn of(path: &str) -> Self {
        match path.strip_prefix(OIP_PATH) {
            Some(rest) if rest.is_empty() || rest.starts_with('/') => Self::Oip,
            _ => Self::Problem,
        }
    }

    /// Its media type.
    pub fn media_type(self) -> &'static str {
        match self {
            Self::Problem => "application/problem+json",
            Self::Oip => "application/json",
        }
    }
}

impl Problem {
    /// Its kind.
    pub fn kind(&self) -> Kind {
        match self {
            Self::Auth(AuthError::Missing | AuthError::Unknown | AuthError::Session) => K::Unauthorized,
            Self::Auth(AuthError::Forbidden { .. }) => K::Forbidden,
            Self::Auth(AuthError::Origin(_)) => K::ForeignSite,
            Self::Auth(AuthError::Host(_)) => K::UnknownHost,
            Self::Auth(AuthError::Robot(_)) => K::RobotOfAnother,
            Self::Body(BodyError::TooLarge { .. } | BodyError::TooManyFrames(_)) => K::TooLarge,
            Self::Body(BodyError::Slow(_)) => K::SlowBody,
            Self::Body(BodyError::UnsupportedType(..) | BodyError::Encoded(_)) => K::UnsupportedType,
            Self::Body(
                BodyError::Empty | BodyError::Stripped | BodyError::Malformed(_) | BodyError::Broken(_),
            ) => K::BadRequest,
            Self::Body(BodyError::NoMemory(_)) => K::QueueFull,
            Self::Lookup(error) => lookup_kind(error),
            Self::Change(error) => change_kind(error),
            Self::Upload(error) => error.kind(),
            Self::Busy(_) => K::QueueFull,
            Self::Recognize(error) => Kind::from(error),
            // The protocol has no place for one frame's error: it is the request that cannot be read.
            Self::Frame { cause, .. } if cause.kind() == K::NotAnImage => K::BadRequest,
            Self::Frame { cause, .. } => cause.kind(),
            Self::Oip(RequestError::TooManyFrames(_)) => K::TooLarge,
            Self::Oip(_) | Self::Query(_) => K::BadRequest,
            Self::NoWebSocket(_) => K::NoWebSocket,
            Self::NotHttp => K::NotHttp,
            Self::NotFound | Self::NoRobot(_) => K::NotFound,
            Self::Draining => K::Draining,
            Self::Framework(status) => Kind::from_status(*status),
        }
    }

    /// What the caller reads. Causes of failures of ours stay in the log.
    pub fn body(&self, request_id: &str) -> ProblemBody {
        let kind = self.kind();
        let detail = match kind {
            K::Internal => kind.advice().to_owned(),
            K::NoRepository => match self.disk_error() {
                Some(reason) => format!("{reason}: {}", kind.advice()),
                None => kind.advice().to_owned(),
            },
            _ => self.to_string(),
        };
        ProblemBody {
            r#type: kind.uri(),
            title: kind.title().to_owned(),
            status: kind.status().as_u16(),
            detail,
            request_id: request_id.to_owned(),
        }
    }

    /// Puts what the caller reads into a response, and what we want to know into the log.
    pub fn render(&self, response: Response, request_id: &str, form: ErrorForm) -> Response {
        let kind = self.kind();
        match kind {
            K::Internal | K::NoRepository => tracing::error!(cause = self.to_string(), "failed"),
            _ => tracing::debug!(cause = self.to_string(), "refused"),
        }
        let body = self.body(request_id);
        let body = match form {
            ErrorForm::Problem => serde_json::to_vec(&body),
            ErrorForm::Oip => serde_json::to_vec(&oip::ErrorBody { error: body.detail }),
        };
        let (mut parts, _) = response.into_parts();
        parts.status = kind.status();
        parts.headers.remove(header::CONTENT_LENGTH);
        parts.headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(form.media_type()));
        if kind == K::Unauthorized {
            parts.headers.insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        if kind == K::NoWebSocket {
            for (name, value) in [
                (header::CONNECTION, "Upgrade"),
                (header::UPGRADE, "websocket"),
                (header::SEC_WEBSOCKET_VERSION, "13"),
            ] {
                parts.headers.insert(name, HeaderValue::from_static(value));
            }
        }
        if let Some(wait) = self.retry_after() {
            parts
                .headers
                .insert(header::RETRY_AFTER, HeaderValue::from(wait.as_secs_f64().ceil().max(1.0) as u64));
        }
        Response::from_parts(parts, body.unwrap_or_default().into())
    }

    /// What a disk has said of the models' folder.
    fn disk_error(&self) -> Option<&'static str> {
        match self {
            Self::Change(error) => error.disk_error(),
            Self::Upload(error) => error.disk_error(),
            _ => None,
        }
    }

    fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::Upload(UploadError::TooMany { .. }) => Some(UPLOAD_WAIT),
            Self::Busy(QueueFull { retry_after, .. })
            | Self::Recognize(RecognizeError::PushedOut(QueueFull { retry_after, .. }))
            | Self::Body(BodyError::NoMemory(QueueFull { retry_after, .. })) => Some(*retry_after),
            Self::Frame { cause, .. } => cause.retry_after(),
            _ => None,
        }
    }
}

fn lookup_kind(error: &LookupError) -> Kind {
    match error {
        LookupError::NoModel(_) | LookupError::NoVersion(..) => K::NoSuchModel,
        LookupError::NotReady(..) | LookupError::NoLabel(..) => K::NotReady,
        LookupError::NothingServes(_) | LookupError::NoDefault(_) | LookupError::Empty => K::NoModel,
    }
}

/// The kind of a change that was refused.
pub fn change_kind(error: &ChangeError) -> Kind {
    match error {
        ChangeError::Lookup(error) => lookup_kind(error),
        ChangeError::Failed(_) | ChangeError::NotServing(_) => K::NotReady,
        ChangeError::Stale { .. } => K::StaleEpoch,
        ChangeError::Superseded | ChangeError::DefaultIsSet(_) | ChangeError::Record(_) => K::Conflict,
        ChangeError::Repository(error) => repository_kind(error),
    }
}

/// The kind of a repository that does not do what was asked.
pub fn repository_kind(error: &RepositoryError) -> Kind {
    match error {
        RepositoryError::Id(VersionIdError::Name(_)) => K::BadRequest,
        RepositoryError::NoVersion(_) => K::NoSuchModel,
        RepositoryError::Exists(_)
        | RepositoryError::HalfUploaded(_)
        | RepositoryError::Id(VersionIdError::NoNumber)
        | RepositoryError::ReadOnly(_)
        | RepositoryError::Overtaken { .. }
        | RepositoryError::DefaultOvertaken(_) => K::Conflict,
        _ => K::NoRepository,
    }
}

impl From<&RecognizeError> for Kind {
    fn from(error: &RecognizeError) -> Self {
        match error {
            RecognizeError::Image(ImageError::TooLarge(_)) => K::TooLarge,
            RecognizeError::Image(_) => K::NotAnImage,
            RecognizeError::DeadlinePassed => K::DeadlinePassed,
            RecognizeError::PushedOut(_) => K::QueueFull,
            RecognizeError::CallerLeft | RecognizeError::Panicked(_) => K::Internal,
        }
    }
}

/// A response that [`Problem::render`] completes where the request's id is known.
impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let mut response = self.kind().status().into_response();
        response.extensions_mut().insert(Arc::new(self));
        response
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::server::pool::{Panicked, Whose};

    #[test]
    fn kinds_are_listed_once_with_names_of_their_own() {
        for (kind_idx, kind) in Kind::ALL.into_iter().enumerate() {
            assert!(Kind::ALL[..kind_idx].iter().all(|other| other.name() != kind.name()));
            assert!(!kind.status().is_success());
        }
    }

    #[test]
    fn the_cause_of_our_own_failure_is_not_told() {
        let body = Problem::from(RecognizeError::from(Panicked)).body("id");
        assert_eq!((body.status, body.request_id.as_str()), (500, "id"));
        assert!(!body.detail.contains("panic"), "{}", body.detail);
    }

    #[test]
    fn a_wait_below_a_second_is_told_as_one() {
        for (milliseconds, told) in [(0, "1"), (20, "1"), (1001, "2"), (5000, "5")] {
            let retry_after = Duration::from_millis(milliseconds);
            let problem = Problem::from(QueueFull { whose: Whose::All, retry_after });
            let response = problem.render(Response::default(), "id", ErrorForm::Problem);
            assert_eq!(response.status(), StatusCode::TOO_MANY_REQUESTS);
            assert_eq!(response.headers()[header::RETRY_AFTER], told);
        }
    }

    #[test]
    fn errors_have_the_form_of_their_path() {
        for (path, form) in [
            ("/v2", ErrorForm::Oip),
            ("/v2/nothing", ErrorForm::Oip),
            ("/v22", ErrorForm::Problem),
            ("/v1/v2/", ErrorForm::Problem),
            ("/", ErrorForm::Problem),
        ] {
            assert_eq!(ErrorForm::of(path), form, "{path}");
        }
    }

    #[test]
    fn the_frameworks_own_errors_get_a_kind() {
        for (status, kind) in
            [(404, K::NotFound), (405, K::MethodNotAllowed), (418, K::BadRequest), (502, K::Internal)]
        {
            assert_eq!(Problem::Framework(StatusCode::from_u16(status).unwrap()).kind(), kind);
        }
    }
}
