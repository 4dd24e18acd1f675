//! Every error that a caller can see. What each is stands beside what it comes from, as a conversion.

mod kind;

pub use kind::Kind;

use roomsight_protocol::rest::ProblemBody;
use std::fmt;
use std::time::Duration;

/// What went wrong with a call.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    kind: Kind,
    /// For the caller; where it is ours, for the log alone.
    cause: String,
    /// What the caller may know of a failure of ours.
    hint: Option<&'static str>,
    retry_after: Option<Duration>,
}

impl Problem {
    /// A problem and what caused it.
    pub fn new(kind: Kind, cause: impl fmt::Display) -> Self {
        Self { kind, cause: cause.to_string(), hint: None, retry_after: None }
    }

    /// The query, the path or a header is wrong.
    pub fn query(cause: impl fmt::Display) -> Self {
        Self::new(Kind::BadRequest, cause)
    }

    /// The service stops.
    pub fn draining() -> Self {
        Self::new(Kind::Draining, "the service is stopping; send the request to another, or again in a while")
    }

    /// What the caller may know of a failure of ours.
    #[must_use]
    pub fn with_hint(self, hint: Option<&'static str>) -> Self {
        Self { hint, ..self }
    }

    /// When it may be worth to try again.
    #[must_use]
    pub fn with_retry_after(self, retry_after: Option<Duration>) -> Self {
        Self { retry_after, ..self }
    }

    /// The same where one of several frames got no answer, and the others therefore none either. The frame is counted
    /// from 0. That one is no image is then told of the request as a whole.
    #[must_use]
    pub fn of_frame(self, frame_idx: usize) -> Self {
        let kind = if self.kind == Kind::NotAnImage { Kind::BadRequest } else { self.kind };
        Self { kind, cause: format!("frame {frame_idx} (counted from 0): {}", self.cause), ..self }
    }

    /// Its kind.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// When it may be worth to try again.
    pub fn retry_after(&self) -> Option<Duration> {
        self.retry_after
    }

    /// What the caller reads. Causes of failures of ours stay in the log.
    pub fn body(&self, request_id: &str) -> ProblemBody {
        let kind = self.kind;
        let detail = match (kind, self.hint) {
            (Kind::NoRepository, Some(hint)) => format!("{hint}: {}", kind.advice()),
            (Kind::Internal | Kind::NoRepository, _) => kind.advice().to_owned(),
            _ => self.cause.clone(),
        };
        ProblemBody {
            r#type: kind.uri(),
            title: kind.title().to_owned(),
            status: kind.status(),
            detail,
            request_id: request_id.to_owned(),
        }
    }
}

/// Where nothing more exact is known.
impl From<Kind> for Problem {
    fn from(kind: Kind) -> Self {
        Self::new(kind, kind.advice())
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.cause)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cause_of_our_own_failure_is_not_told() {
        let body = Problem::new(Kind::Internal, "a panic").body("id");
        assert_eq!((body.status, body.request_id.as_str()), (500, "id"));
        assert!(!body.detail.contains("panic"), "{}", body.detail);
        let full =
            Problem::new(Kind::NoRepository, "/srv/models: no space").with_hint(Some("the disk is full"));
        let detail = full.body("id").detail;
        assert!(detail.starts_with("the disk is full: ") && !detail.contains("/srv"), "{detail}");
    }

    #[test]
    fn a_frame_that_is_no_image_makes_a_bad_request() {
        let problem = Problem::new(Kind::NotAnImage, "no JPEG").of_frame(3);
        assert_eq!(problem.kind(), Kind::BadRequest);
        assert_eq!(problem.to_string(), "frame 3 (counted from 0): no JPEG");
        assert_eq!(Problem::from(Kind::TooLarge).of_frame(0).kind(), Kind::TooLarge);
    }
}
