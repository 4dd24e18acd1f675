//! Errors as callers read them: RFC 9457 `application/problem+json`, or as the Open Inference Protocol has it.

use crate::problem::{Kind, Problem};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use roomsight_protocol::oip;
use roomsight_protocol::rest::KindInfo;
use std::sync::Arc;

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

impl ErrorForm {
    /// The form of the errors at a path.
    pub fn of(path: &str) -> Self {
        match path.strip_prefix(OIP_PATH) {
            Some(rest) if rest.is_empty() || rest.starts_with('/') => Self::Oip,
            _ => Self::Problem,
        }
    }

    pub fn media_type(self) -> &'static str {
        match self {
            Self::Problem => "application/problem+json",
            Self::Oip => "application/json",
        }
    }
}

/// A response that `render` completes where the request's id is known.
impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let mut response = status(self.kind()).into_response();
        response.extensions_mut().insert(Arc::new(self));
        response
    }
}

impl From<Kind> for KindInfo {
    fn from(kind: Kind) -> Self {
        Self {
            r#type: kind.uri(),
            title: kind.title().to_owned(),
            status: kind.status(),
            advice: kind.advice().to_owned(),
        }
    }
}

/// The problem that an answer of the framework with an error's status is.
pub fn of_framework(status: StatusCode) -> Problem {
    Kind::from_status(status.as_u16()).into()
}

/// Puts what the caller reads into a response, and what we want to know into the log.
pub fn render(problem: &Problem, response: Response, request_id: &str, form: ErrorForm) -> Response {
    let kind = problem.kind();
    match kind {
        Kind::Internal | Kind::NoRepository => tracing::error!(cause = problem.to_string(), "failed"),
        _ => tracing::debug!(cause = problem.to_string(), "refused"),
    }
    let body = problem.body(request_id);
    let body = match form {
        ErrorForm::Problem => serde_json::to_vec(&body),
        ErrorForm::Oip => serde_json::to_vec(&oip::ErrorBody { error: body.detail }),
    };
    let (mut parts, _) = response.into_parts();
    parts.status = status(kind);
    parts.headers.remove(header::CONTENT_LENGTH);
    parts.headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(form.media_type()));
    if kind == Kind::Unauthorized {
        parts.headers.insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
    }
    if kind == Kind::NoWebSocket {
        for (name, value) in [
            (header::CONNECTION, "Upgrade"),
            (header::UPGRADE, "websocket"),
            (header::SEC_WEBSOCKET_VERSION, "13"),
        ] {
            parts.headers.insert(name, HeaderValue::from_static(value));
        }
    }
    if let Some(wait) = problem.retry_after() {
        parts
            .headers
            .insert(header::RETRY_AFTER, HeaderValue::from(wait.as_secs_f64().ceil().max(1.0) as u64));
    }
    Response::from_parts(parts, body.unwrap_or_default().into())
}

fn status(kind: Kind) -> StatusCode {
    StatusCode::from_u16(kind.status()).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::pool::{QueueFull, Whose};
    use std::time::Duration;

    #[test]
    fn a_wait_below_a_second_is_told_as_one() {
        for (milliseconds, told) in [(0, "1"), (20, "1"), (1001, "2"), (5000, "5")] {
            let retry_after = Duration::from_millis(milliseconds);
            let problem = Problem::from(QueueFull { whose: Whose::All, retry_after });
            let response = render(&problem, Response::default(), "id", ErrorForm::Problem);
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
}
