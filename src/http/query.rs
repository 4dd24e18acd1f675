//! What a request asks for beside its frame, checked before its body is read.

use crate::access::Key;
use crate::engine::answers::Asked;
use crate::engine::caller::CallerId;
use crate::engine::doubts::Sender;
use crate::engine::metrics::Transport;
use crate::engine::recognize::Task;
use crate::engine::registry::Choice;
use crate::engine::text::check_name;
use crate::http::App;
use crate::http::caller::caller_of;
use crate::http::observe::RequestContext;
use crate::problem::{Kind, Problem};
use axum::extract::{FromRequestParts, Query};
use axum::http::Extensions;
use axum::http::request::Parts;
use chrono::{DateTime, NaiveDateTime};
use roomsight_protocol::rest::RecognizeQuery;
use std::sync::Arc;
use std::time::Duration;

impl FromRequestParts<App> for Asked {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Self, Problem> {
        let Query(query) = Query::<RecognizeQuery>::try_from_uri(&parts.uri)
            .map_err(|error| Problem::query(error.body_text()))?;
        let caller = Caller::of(&parts.extensions, Transport::Rest)?;
        let asked = Self::new(app, query, caller)?;
        // The body that follows is received in the same one's share.
        parts.extensions.insert(asked.caller.clone());
        Ok(asked)
    }
}

impl FromRequestParts<App> for Caller {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &App) -> Result<Self, Problem> {
        Self::of(&parts.extensions, Transport::Rest)
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
        let context = context.ok_or_else(|| Problem::from(Kind::Internal))?;
        let key = extensions.get::<Arc<Key>>().cloned();
        Ok(Self { context, key, id: caller_of(extensions), transport })
    }
}

impl Asked {
    /// Checks a query, and chooses the model that answers it.
    pub fn new(app: &App, query: RecognizeQuery, caller: Caller) -> Result<Self, Problem> {
        check_name("robot", query.robot.as_deref())?;
        check_name("captured_at", query.captured_at.as_deref())?;
        if query.captured_at.as_deref().is_some_and(|text| !is_moment(text)) {
            return Err(Problem::query(
                "`captured_at` must be a date and a time such as 2030-01-31T12:00:00.250Z, or a number since 1970; \
                 in a query `+` is written %2B"
                    .to_owned(),
            ));
        }
        if query.top == Some(0) {
            return Err(Problem::query("`top` must be at least 1; leave it out for all rooms"));
        }
        if let Some(robot) = &query.robot {
            app.engine.keyring.check_robot(caller.key.as_deref(), robot)?;
        }
        let robot = query.robot.as_deref().or(caller.key.as_ref().map(|key| key.robot()));
        let served = app.engine.registry.choose(query.model.as_deref(), &choice(&query)?, robot)?;
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
            shown_for: None,
            sender: Some(Sender {
                robot: robot.map(Into::into),
                key: caller.key.as_ref().map(|key| key.name().into()),
            }),
        };
        let id = caller.id.with_robot(query.robot.as_deref());
        let RequestContext { id: request_id, arrived } = caller.context;
        Ok(Asked { query, request_id, arrived, task, caller: id, key: caller.key })
    }
}

fn choice(query: &RecognizeQuery) -> Result<Choice, Problem> {
    match (query.version, &query.label) {
        (None, None) => Ok(Choice::Serving),
        (Some(version), None) => Ok(Choice::Version(version)),
        (None, Some(label)) => Ok(Choice::Label(label.clone())),
        (Some(_), Some(_)) => Err(Problem::query("give `version` or `label`, not both")),
    }
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
}
