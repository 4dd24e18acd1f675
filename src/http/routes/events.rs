//! `GET /v1/events`: what happens, as it happens.

use crate::access::Key;
use crate::http::App;
use crate::http::openapi::ViewerProblems;
use crate::problem::Problem;
use axum::Extension;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Query, State};
use axum::http::HeaderName;
use axum::response::IntoResponse;
use axum::response::sse::{self, KeepAlive, Sse};
use futures_util::stream;
use roomsight_protocol::event::Event;
use roomsight_protocol::fleet::ScopeQuery;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

/// How often a reader hears something when nothing happens, so that nobody between cuts the line.
pub const KEEP_ALIVE: Duration = Duration::from_secs(15);
/// Tells nginx, and those that learned it from nginx, to pass each event on as it comes.
pub const X_ACCEL_BUFFERING: HeaderName = HeaderName::from_static("x-accel-buffering");

/// What happens, as server-sent events
///
/// One [`Event`] each, as JSON; the event's name is its `type`. A reader that is slow loses the oldest events
/// and is told how many by an event `lost`. Of other services (`scope=fleet`) all but answers is told. The stream ends when the service stops or the key is withdrawn.
#[utoipa::path(
    get, path = "/v1/events", tag = "dashboards", security(("key" = [])), params(ScopeQuery),
    responses(
        (status = OK, description = "Events until the caller leaves", body = Event, content_type = "text/event-stream"),
        ViewerProblems
    )
)]
pub async fn events(
    State(app): State<App>,
    query: Result<Query<ScopeQuery>, QueryRejection>,
    key: Option<Extension<Arc<Key>>>,
) -> Result<impl IntoResponse, Problem> {
    let Query(ScopeQuery { scope }) = query.map_err(|error| Problem::query(error.body_text()))?;
    let reader = app.engine.events_of(scope).subscribe();
    let key = key.map(|Extension(key)| key);
    let events = stream::unfold((reader, app, key), async |(mut reader, app, key)| {
        let event = tokio::select! {
            event = reader.next() => event?,
            () = app.engine.stopping.cancelled() => return None,
            () = app.engine.keyring.revoked(key.as_deref(), || None) => return None,
        };
        if let Event::Lost { events } = *event {
            app.engine.metrics.events_lost(events);
        }
        Some((Ok::<_, Infallible>(as_sent(&event)), (reader, app, key)))
    });
    Ok(([(X_ACCEL_BUFFERING, "no")], Sse::new(events).keep_alive(KeepAlive::new().interval(KEEP_ALIVE))))
}

fn as_sent(event: &Event) -> sse::Event {
    let name = match event {
        Event::Answer(_) => "answer",
        Event::RobotJoined(_) => "robot_joined",
        Event::RobotLeft(_) => "robot_left",
        Event::ModelChanged { .. } => "model_changed",
        Event::SwapFailed { .. } => "swap_failed",
        Event::RobotLost(_) => "robot_lost",
        Event::RobotFound(_) => "robot_found",
        Event::RoomChanged(_) => "room_changed",
        Event::Training { .. } => "training",
        Event::InboxChanged { .. } => "inbox_changed",
        Event::SetChanged { .. } => "set_changed",
        Event::Lost { .. } => "lost",
    };
    // Plain values always have a JSON form.
    sse::Event::default().event(name).data(serde_json::to_string(event).unwrap_or_default())
}
