//! `GET /v1/live`: the robots as they are, as that changes.

use super::events::{KEEP_ALIVE, X_ACCEL_BUFFERING};
use crate::access::Key;
use crate::http::App;
use crate::http::openapi::ViewerProblems;
use crate::problem::Problem;
use axum::Extension;
use axum::body::{Body, Bytes};
use axum::extract::rejection::QueryRejection;
use axum::extract::{Query, State};
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use futures_util::stream;
use roomsight_protocol::event::LiveUpdate;
use roomsight_protocol::fleet::ScopeQuery;
use std::convert::Infallible;
use std::sync::Arc;
use tokio::time::timeout;

/// The robots as they are, as server-sent events
///
/// Events are called `live` and are one [`LiveUpdate`] each, as JSON: all robots at first, then every half a second those
/// that changed. They are made once for all readers. One that is slow loses the oldest, and then hears all robots again
/// and how many it lost. The events end when the service stops or the key is withdrawn.
#[utoipa::path(
    get, path = "/v1/live", tag = "dashboards", security(("key" = [])), params(ScopeQuery),
    responses(
        (status = OK, description = "Updates until the caller leaves", body = LiveUpdate,
            content_type = "text/event-stream"),
        ViewerProblems
    )
)]
pub async fn watch_robots(
    State(app): State<App>,
    query: Result<Query<ScopeQuery>, QueryRejection>,
    key: Option<Extension<Arc<Key>>>,
) -> Result<impl IntoResponse, Problem> {
    let Query(ScopeQuery { scope }) = query.map_err(|error| Problem::query(error.body_text()))?;
    let reader = app.engine.live_of(scope).subscribe();
    let key = key.map(|Extension(key)| key);
    let updates = stream::unfold((reader, app, key, scope), async |(mut reader, app, key, scope)| {
        let event = tokio::select! {
            event = timeout(KEEP_ALIVE, reader.next(app.engine.view(scope))) => event,
            () = app.engine.stopping.cancelled() => return None,
            () = app.engine.keyring.revoked(key.as_deref(), || None) => return None,
        };
        let bytes = match event {
            // A comment.
            Err(_) => Bytes::from_static(b":\n\n"),
            Ok(event) => {
                let event = event?;
                app.engine.metrics.events_lost(event.n_lost);
                event.bytes
            }
        };
        Some((Ok::<_, Infallible>(bytes), (reader, app, key, scope)))
    });
    Ok(([(CONTENT_TYPE, "text/event-stream")], [(X_ACCEL_BUFFERING, "no")], Body::from_stream(updates)))
}
