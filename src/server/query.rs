//! What a request asks for beside its frame, checked before its body is read.

use super::App;
use super::auth::Key;
use super::caller::CallerId;
use super::metrics::Transport;
use super::observe::RequestContext;
use super::problem::Problem;
use super::recognize::Task;
use super::registry::Choice;
use axum::extract::{FromRequestParts, Query};
use axum::http::request::Parts;
use axum::http::{Extensions, StatusCode};
use chrono::{DateTime, NaiveDateTime};
use roomsight_protocol::rest::RecognizeQuery;
use std::sync::Arc;
use std::time::Duration;

const MAX_TEXT_BYTES: usize = 64;

/// What is asked about frames, and what follows from it.
pub struct Asked {
    /// As it was asked.
    pub query: RecognizeQuery,
    /// The request.
    pub context: RequestContext,
    /// What to do with each frame.
    pub task: Task,
    /// Whose share of the threads and of the queue it takes.
    pub caller: CallerId,
}

impl FromRequestParts<App> for Asked {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Self, Problem> {
        let Query(query) = Query::<RecognizeQuery>::try_from_uri(&parts.uri)
            .map_err(|error| Problem::Query(error.body_text()))?;
        let caller = Caller::of(&parts.extensions, Transport::Rest)?;
        let asked = Self::new(app, query, caller)?;
        // The body that follows is received in the same one's share.
        parts.extensions.insert(asked.caller.clone());
        Ok(asked)
    }
}

/// Who asks, and how.
pub struct Caller {
    context: RequestContext,
    /// Its key, where it has one.
    key: Option<Arc<Key>>,
    id: CallerId,
    transport: Transport,
}

impl Caller {
    /// Of a request with these extensions.
    ///
    /// # Errors
    /// A request that was not observed: a defect of ours.
    pub fn of(extensions: &Extensions, transport: Transport) -> Result<Self, Problem> {
        let context = extensions.get::<RequestContext>().cloned();
        let context = context.ok_or(Problem::Framework(StatusCode::INTERNAL_SERVER_ERROR))?;
        let key = extensions.get::<Arc<Key>>().cloned();
        Ok(Self { context, key, id: CallerId::of(extensions), transport })
    }
}

impl Asked {
    /// Checks a query, and chooses the model that answers it.
    pub fn new(app: &App, query: RecognizeQuery, caller: Caller) -> Result<Self, Problem> {
        check("robot", query.robot.as_deref())?;
        check("captured_at", query.captured_at.as_deref())?;
        if query.captured_at.as_deref().is_some_and(|text| !is_moment(text)) {
            return Err(Problem::Query(
                "`captured_at` must be a date and a time such as 2030-01-31T12:00:00.250Z, or a number since 1970; \
                 in a query `+` is written %2B"
                    .to_owned(),
            ));
        }
        if query.top == Some(0) {
            return Err(Problem::Query("`top` must be at least 1; leave it out for all rooms".into()));
        }
        if let Some(robot) = &query.robot {
            app.keyring.check_robot(caller.key.as_deref(), robot)?;
        }
        let robot = query.robot.as_deref().or(caller.key.as_ref().map(|key| key.robot()));
        let served = app.registry.choose(query.model.as_deref(), &choice(&query)?, robot)?;
        let span = tracing::Span::current();
        span.record("model", &served.name);
        if let Some(robot) = &query.robot {
            span.record("robot", robot);
        }
        let wait = query.deadline_ms.map(Duration::from_millis);
        let task = Task {
            served,
            deadline: wait.and_then(|wait| caller.context.arrived.checked_add(wait)),
            explain: query.explain,
            transport: caller.transport,
        };
        let id = caller.id.with_robot(query.robot.as_deref());
        Ok(Self { query, context: caller.context, task, caller: id })
    }
}

fn choice(query: &RecognizeQuery) -> Result<Choice, Problem> {
    match (query.version, &query.label) {
        (None, None) => Ok(Choice::Serving),
        (Some(version), None) => Ok(Choice::Version(version)),
        (None, Some(label)) => Ok(Choice::Label(label.clone())),
        (Some(_), Some(_)) => Err(Problem::Query("give `version` or `label`, not both".into())),
    }
}

/// Texts that are sent back and logged are short, and have no character that cannot be seen: none that ends a
/// line, reorders a text or makes two names look alike.
pub fn check(name: &str, text: Option<&str>) -> Result<(), Problem> {
    match text {
        Some(text)
            if text.trim() != text || text.is_empty() || text.len() > MAX_TEXT_BYTES || !is_visible(text) =>
        {
            Err(Problem::Query(format!(
                "`{name}` must be 1 to {MAX_TEXT_BYTES} bytes of characters that can be seen; leave it out for none"
            )))
        }
        _ => Ok(()),
    }
}

/// Whether Rust would print the text as it is (quotes and backslashes it escapes for another reason), and has no
/// letter that looks like nothing.
fn is_visible(text: &str) -> bool {
    let looks_like_nothing = |letter: char| {
        matches!(
            letter,
            '\u{34f}' | '\u{115f}' | '\u{1160}' | '\u{17b4}' | '\u{17b5}' | '\u{2800}' | '\u{3164}'
        ) || matches!(letter, '\u{fe00}'..='\u{fe0e}' | '\u{ffa0}' | '\u{e0100}'..='\u{e01ef}')
    };
    let text = text.replace(['"', '\'', '\\'], "-");
    text.escape_debug().eq(text.chars()) && !text.contains(looks_like_nothing)
}

/// Whether a text tells when a frame was taken.
fn is_moment(text: &str) -> bool {
    let is_number = text.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.')
        && text.bytes().filter(|&byte| byte == b'.').count() <= 1
        && text != ".";
    is_number
        || DateTime::parse_from_rfc3339(text).is_ok()
        || text.replacen(' ', "T", 1).parse::<NaiveDateTime>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moment_is_a_date_and_a_time_or_a_number() {
        for text in [
            "2030-01-31T12:00:00.250Z",
            "2030-01-31T12:00:00+01:00",
            "2030-01-31t12:00:00z",
            "2030-01-31 12:00:00.250000",
            "2030-01-31T12:00:00",
            "0",
            "1700000000",
            "1700000000.25",
            "1700000000250000000",
        ] {
            assert!(is_moment(text), "{text}");
        }
        for text in [
            "garbage",
            "now",
            ".",
            "1.2.3",
            "-5",
            "1e9",
            "inf",
            "2030-01-31",
            "12:00:00",
            "2030-02-30T12:00:00Z",
            "2030-01-31T25:00:00Z",
            "2030-01-31T12:00:00 01:00",
        ] {
            assert!(!is_moment(text), "{text}");
        }
    }

    #[test]
    fn names_are_what_they_look_like() {
        let is_taken = |text: &str| check("robot", Some(text)).is_ok();
        for good in [
            "wall-e",
            "R2 D2",
            "caf\u{e9}",
            "cafe\u{301}",
            "\u{43c}\u{430}\u{448}\u{430}",
            "\u{1f916}",
            "it's \"x\" \\",
        ] {
            assert!(is_taken(good), "{good:?}");
        }
        for bad in [
            "",
            "a\nb",
            "a\u{7f}",
            "a\u{ad}b",
            "wall\u{200b}-e",
            "a\u{202e}b",
            "a\u{2028}b",
            "a\u{2066}b",
            "\u{feff}a",
            "\u{301}a",
            "a\u{e0041}",
            "wall-e ",
            " wall-e",
            "wall-e\u{3164}",
            "wall\u{2800}e",
            &"x".repeat(65),
        ] {
            assert!(!is_taken(bad), "{bad:?}");
        }
    }
}
