//! What a request asks for beside its frame, checked before its body is read.

use super::App;
use super::auth::KeyName;
use super::metrics::Transport;
use super::observe::RequestContext;
use super::problem::Problem;
use super::recognize::Task;
use super::registry::Choice;
use crate::protocol::rest::RecognizeQuery;
use axum::extract::{FromRequestParts, Query};
use axum::http::request::Parts;
use axum::http::{Extensions, StatusCode};
use chrono::{DateTime, NaiveDateTime};
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
}

impl FromRequestParts<App> for Asked {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Self, Problem> {
        let Query(query) = Query::<RecognizeQuery>::try_from_uri(&parts.uri)
            .map_err(|error| Problem::Query(error.body_text()))?;
        let caller = Caller::of(&parts.extensions, Transport::Rest)?;
        Self::new(app, query, caller)
    }
}

/// Who asks, and how.
pub struct Caller {
    context: RequestContext,
    /// The name of its key, where it has one.
    key: Option<KeyName>,
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
        Ok(Self { context, key: extensions.get::<KeyName>().cloned(), transport })
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
        let robot = query.robot.as_deref().or(caller.key.as_ref().map(|key| key.0.as_str()));
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
        Ok(Self { query, context: caller.context, task })
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

/// Texts that are sent back and logged are there, short, and look like what they are.
pub fn check(name: &str, text: Option<&str>) -> Result<(), Problem> {
    match text {
        Some(text) if !(1..=MAX_TEXT_BYTES).contains(&text.len()) || text.chars().any(is_hidden) => {
            Err(Problem::Query(format!(
                "`{name}` must be 1 to {MAX_TEXT_BYTES} bytes without control characters; leave it out for none"
            )))
        }
        _ => Ok(()),
    }
}

/// Whether a character cannot be seen or lets others be seen elsewhere than they stand: control characters, ends
/// of lines and paragraphs, directions of writing, marks of no width. The two joiners are a part of words.
fn is_hidden(character: char) -> bool {
    character.is_control()
        || matches!(
            character,
            '\u{AD}' | '\u{61C}' | '\u{180E}' | '\u{200B}' | '\u{200E}' | '\u{200F}' | '\u{2028}'..='\u{202E}'
                | '\u{2060}'..='\u{206F}' | '\u{FEFF}' | '\u{FFF9}'..='\u{FFFB}'
        )
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
    fn a_name_is_there_short_and_seen_as_it_is() {
        let check = |text: &str| check("robot", Some(text)).is_ok();
        for good in ["wall-e", "Wall\u{B7}E \u{1F916}", "\u{645}\u{6CC}\u{200C}\u{62E}", &"x".repeat(64)] {
            assert!(check(good), "{good:?}");
        }
        let bad =
            ["", "a\nb", "a\u{202E}b", "a\u{200B}", "a\u{2028}b", "\u{FEFF}a", "a\u{85}b", &"x".repeat(65)];
        for bad in bad {
            assert!(!check(bad), "{bad:?}");
        }
    }
}
