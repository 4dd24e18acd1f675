//! `GET /v1/live`: the robots as they are, as that changes.

use super::events::{KEEP_ALIVE, X_ACCEL_BUFFERING};
use crate::access::Key;
use crate::http::App;
use crate::http::openapi::ViewerProblems;
use axum::Extension;
use axum::body::{Body, Bytes};
use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use futures_util::stream;
use roomsight_protocol::event::LiveUpdate;
use std::convert::Infallible;
use std::sync::Arc;
use tokio::time::timeout;

/// The robots as they are, as server-sent events
///
/// Events are called `live` and are one [`LiveUpdate`] each, as JSON: all robots at first, then every half a second those
/// that changed. They are made once for all readers. One that is slow loses the oldest, and then hears all robots again
/// and how many it lost. The events end when the service stops or the key is withdrawn.
#[utoipa::path(
    get, path = "/v1/live", tag = "dashboards", security(("key" = [])),
    responses(
        (status = OK, description = "Updates until the caller leaves", body = LiveUpdate,
            content_type = "text/event-stream"),
        ViewerProblems
    )
)]
pub async fn watch_robots(State(app): State<App>, key: Option<Extension<Arc<Key>>>) -> impl IntoResponse {
    let reader = app.engine.live.subscribe();
    let key = key.map(|Extension(key)| key);
    let updates = stream::unfold((reader, app, key), async |(mut reader, app, key)| {
        let event = tokio::select! {
            event = timeout(KEEP_ALIVE, reader.next(&app.engine.robots)) => event,
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
        Some((Ok::<_, Infallible>(bytes), (reader, app, key)))
    });
    ([(CONTENT_TYPE, "text/event-stream")], [(X_ACCEL_BUFFERING, "no")], Body::from_stream(updates))
}
