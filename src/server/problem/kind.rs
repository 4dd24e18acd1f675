//! The kinds of problem, and what each is to a caller.

use Kind as K;
use axum::http::StatusCode;

/// The kinds of problem: one `type`, title and status each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Malformed query, path or body.
    BadRequest,
    /// Bytes that are no request.
    NotHttp,
    /// No key, or one that nobody has.
    Unauthorized,
    /// A key of the wrong role.
    Forbidden,
    /// A page of another site.
    ForeignSite,
    /// A name that is not known to be the service's.
    UnknownHost,
    /// A robot that another key speaks for.
    RobotOfAnother,
    /// No such path.
    NotFound,
    /// No such model or version.
    NoSuchModel,
    /// Another method.
    MethodNotAllowed,
    /// A body that came too slowly.
    SlowBody,
    /// A version that does not serve.
    NotReady,
    /// A version that is there already, or that is in use.
    Conflict,
    /// What serves was changed since the caller looked.
    StaleEpoch,
    /// Too many bytes, pixels or frames.
    TooLarge,
    /// A path that is too long.
    PathTooLong,
    /// A type of body that is not read here.
    UnsupportedType,
    /// Bytes that are no image.
    NotAnImage,
    /// Bytes that are no model that works.
    NotAModel,
    /// A call that is no WebSocket.
    NoWebSocket,
    /// No slot is free.
    QueueFull,
    /// Headers that are too long.
    HeadTooLong,
    /// A defect of ours.
    Internal,
    /// The service stops.
    Draining,
    /// Nothing serves.
    NoModel,
    /// The repository of models cannot be used.
    NoRepository,
    /// The deadline passed.
    DeadlinePassed,
}

impl Kind {
    /// All kinds, by status.
    pub const ALL: [Self; 27] = [
        K::BadRequest,
        K::NotHttp,
        K::Unauthorized,
        K::Forbidden,
        K::ForeignSite,
        K::UnknownHost,
        K::RobotOfAnother,
        K::NotFound,
        K::NoSuchModel,
        K::MethodNotAllowed,
        K::SlowBody,
        K::NotReady,
        K::Conflict,
        K::StaleEpoch,
        K::TooLarge,
        K::PathTooLong,
        K::UnsupportedType,
        K::NotAnImage,
        K::NotAModel,
        K::NoWebSocket,
        K::QueueFull,
        K::HeadTooLong,
        K::Internal,
        K::Draining,
        K::NoModel,
        K::NoRepository,
        K::DeadlinePassed,
    ];

    /// The status code.
    pub fn status(self) -> StatusCode {
        match self {
            K::BadRequest | K::NotHttp => StatusCode::BAD_REQUEST,
            K::Unauthorized => StatusCode::UNAUTHORIZED,
            K::Forbidden | K::ForeignSite | K::UnknownHost | K::RobotOfAnother => StatusCode::FORBIDDEN,
            K::NotFound | K::NoSuchModel => StatusCode::NOT_FOUND,
            K::MethodNotAllowed => StatusCode::METHOD_NOT_ALLOWED,
            K::SlowBody => StatusCode::REQUEST_TIMEOUT,
            K::NotReady | K::Conflict => StatusCode::CONFLICT,
            K::StaleEpoch => StatusCode::PRECONDITION_FAILED,
            K::TooLarge => StatusCode::PAYLOAD_TOO_LARGE,
            K::PathTooLong => StatusCode::URI_TOO_LONG,
            K::UnsupportedType => StatusCode::UNSUPPORTED_MEDIA_TYPE,
            K::NotAnImage | K::NotAModel => StatusCode::UNPROCESSABLE_ENTITY,
            K::NoWebSocket => StatusCode::UPGRADE_REQUIRED,
            K::QueueFull => StatusCode::TOO_MANY_REQUESTS,
            K::HeadTooLong => StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE,
            K::Internal => StatusCode::INTERNAL_SERVER_ERROR,
            K::Draining | K::NoModel | K::NoRepository => StatusCode::SERVICE_UNAVAILABLE,
            K::DeadlinePassed => StatusCode::GATEWAY_TIMEOUT,
        }
    }

    /// The last part of the `type`, `/problems/NAME`.
    pub fn name(self) -> &'static str {
        match self {
            K::BadRequest => "bad-request",
            K::NotHttp => "not-http",
            K::Unauthorized => "unauthorized",
            K::Forbidden => "forbidden",
            K::ForeignSite => "foreign-site",
            K::UnknownHost => "unknown-host",
            K::RobotOfAnother => "robot-of-another",
            K::NotFound => "not-found",
            K::NoSuchModel => "no-such-model",
            K::MethodNotAllowed => "method-not-allowed",
            K::SlowBody => "slow-body",
            K::NotReady => "version-not-ready",
            K::Conflict => "conflict",
            K::StaleEpoch => "stale-epoch",
            K::TooLarge => "too-large",
            K::PathTooLong => "path-too-long",
            K::UnsupportedType => "unsupported-type",
            K::NotAnImage => "not-an-image",
            K::NotAModel => "not-a-model",
            K::NoWebSocket => "no-websocket",
            K::QueueFull => "queue-full",
            K::HeadTooLong => "head-too-long",
            K::Internal => "internal",
            K::Draining => "draining",
            K::NoModel => "no-model",
            K::NoRepository => "no-repository",
            K::DeadlinePassed => "deadline-passed",
        }
    }

    /// What it is, in a few words that never change.
    pub fn title(self) -> &'static str {
        match self {
            K::BadRequest => "The request is malformed",
            K::NotHttp => "What came is no HTTP request",
            K::Unauthorized => "A valid key is missing",
            K::Forbidden => "The key's role may not do this",
            K::ForeignSite => "A page of another site may not do this",
            K::UnknownHost => "The service does not answer to this name",
            K::RobotOfAnother => "The key does not speak for this robot",
            K::NotFound => "There is nothing at this path",
            K::NoSuchModel => "There is no such model or version",
            K::MethodNotAllowed => "The path does not take this method",
            K::SlowBody => "The body came too slowly",
            K::NotReady => "The version does not serve",
            K::Conflict => "The version cannot be changed so",
            K::StaleEpoch => "What serves was changed in the meantime",
            K::TooLarge => "Too many bytes, pixels or frames",
            K::PathTooLong => "The path is too long",
            K::UnsupportedType => "A body of this type is not read here",
            K::NotAnImage => "The body is not an image that can be read",
            K::NotAModel => "The body is not a model that works",
            K::NoWebSocket => "The path takes a WebSocket",
            K::QueueFull => "The queue is full",
            K::HeadTooLong => "The headers are too long",
            K::Internal => "The service failed",
            K::Draining => "The service is stopping",
            K::NoModel => "No model serves",
            K::NoRepository => "The repository of models cannot be used",
            K::DeadlinePassed => "The deadline passed",
        }
    }

    /// What a caller can do about it, where nothing more exact is known.
    pub fn advice(self) -> &'static str {
        match self {
            K::BadRequest => "correct the request as the detail says; /docs describes all of them",
            K::NotHttp => {
                "send a request of HTTP/1.1 that is well formed; see that the address begins with http:// or \
                 https:// as the service is set up"
            }
            K::Unauthorized => "send a key in the header `Authorization: Bearer KEY`",
            K::Forbidden => "use a key whose role allows this, or one of an admin",
            K::ForeignSite => "let the operator add the page's origin to the setting `origins`",
            K::UnknownHost => "let the operator add the name to the setting `hosts`, or call an address",
            K::RobotOfAnother => "name a robot of the key, or use that robot's key",
            K::NotFound => "see /docs for the paths there are",
            K::NoSuchModel => "GET /v1/models lists the models there are",
            K::MethodNotAllowed => "use a method of the header Allow",
            K::SlowBody => "send smaller frames, or use a faster connection",
            K::NotReady => "ask for the version that serves, or for none",
            K::Conflict => "see GET /v1/models for what there is, and choose another version or number",
            K::StaleEpoch => "look again at what serves, and send its epoch in If-Match",
            K::TooLarge => "send fewer bytes, fewer pixels or fewer frames",
            K::PathTooLong => "send a shorter path and query; frames belong into the body",
            K::UnsupportedType => "send the image itself as image/jpeg, or multipart/form-data, or JSON",
            K::NoWebSocket => "open a WebSocket with the subprotocol roomsight.v1, for example with websocat",
            K::NotAModel => "send the folder of a version as a tar, or its model.safetensors",
            K::NotAnImage => "send a whole JPEG, PNG, WebP, BMP or PGM image",
            K::QueueFull => "try again after the time in Retry-After, or send fewer frames",
            K::HeadTooLong => "send fewer or shorter headers, at most 100 and 64 KiB in all",
            K::Internal => "try again; if it stays, give the operator the request id",
            K::NoModel => "upload or activate a version, or wait until somebody has",
            K::NoRepository => "see that the folder or the bucket of models can be reached and written",
            K::Draining => "send the request to another instance, or again in a while",
            K::DeadlinePassed => "allow more time, or send fewer frames",
        }
    }

    /// The URI path that names the kind.
    pub fn uri(self) -> String {
        format!("/problems/{}", self.name())
    }

    /// The kind that an answer of the framework with this status is.
    pub fn from_status(status: StatusCode) -> Self {
        let fallback = if status.is_server_error() { K::Internal } else { K::BadRequest };
        Self::ALL.into_iter().find(|kind| kind.status() == status).unwrap_or(fallback)
    }
}
