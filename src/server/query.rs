//! What a request asks for beside its frame, checked before its body is read.

use super::App;
use super::auth::KeyName;
use super::caller::CallerId;
use super::metrics::Transport;
use super::observe::RequestContext;
use super::problem::Problem;
use super::recognize::Task;
use super::registry::Choice;
use crate::protocol::rest::RecognizeQuery;
use axum::extract::{FromRequestParts, Query};
use axum::http::request::Parts;
use axum::http::{Extensions, StatusCode};
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
    /// The name of its key, where it has one.
    key: Option<KeyName>,
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
        let key = extensions.get::<KeyName>().cloned();
        Ok(Self { context, key, id: CallerId::of(extensions), transport })
    }
}

impl Asked {
    /// Checks a query, and chooses the model that answers it.
    pub fn new(app: &App, query: RecognizeQuery, caller: Caller) -> Result<Self, Problem> {
        check("robot", query.robot.as_deref())?;
        check("captured_at", query.captured_at.as_deref())?;
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

/// Texts that are sent back and logged are short and have no control characters.
pub fn check(name: &str, text: Option<&str>) -> Result<(), Problem> {
    match text {
        Some(text) if text.len() > MAX_TEXT_BYTES || text.chars().any(char::is_control) => {
            Err(Problem::Query(format!(
                "`{name}` must be at most {MAX_TEXT_BYTES} bytes without control characters"
            )))
        }
        _ => Ok(()),
    }
}
