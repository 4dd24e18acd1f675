//! Events for dashboards, as they happen: lossy for slow readers, and never in the way of a robot.

use crate::server::App;
use crate::server::auth::Key;
use axum::Extension;
use axum::extract::State;
use axum::http::HeaderName;
use axum::response::IntoResponse;
use axum::response::sse::{self, KeepAlive, Sse};
use futures_util::stream;
use roomsight_protocol::event::Event;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::broadcast::{self, Receiver};

/// How many events a reader may be behind before it loses the oldest.
const N_KEPT: usize = 256;
/// How often a reader hears something when nothing happens, so that nobody between cuts the line.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

/// Tells nginx, and those that learned it from nginx, to pass each event on as it comes.
const X_ACCEL_BUFFERING: HeaderName = HeaderName::from_static("x-accel-buffering");

/// Where events are told, and who listens.
#[derive(Clone)]
pub struct Events(broadcast::Sender<Arc<Event>>);

impl Default for Events {
    fn default() -> Self {
        Self(broadcast::Sender::new(N_KEPT))
    }
}

impl Events {
    /// How many listen.
    pub fn n_readers(&self) -> usize {
        self.0.receiver_count()
    }

    /// Tells all readers; where there are none the event is not even made. Never waits.
    pub fn tell(&self, event: impl FnOnce() -> Event) {
        if self.n_readers() > 0 {
            let _ = self.0.send(Arc::new(event()));
        }
    }
}

/// What happens, as server-sent events
///
/// One [`Event`] each, as JSON; the event's name is its `type`. A reader that is slow loses the oldest events
/// and is told how many by an event `lost`. The stream ends when the service stops or the key is withdrawn.
#[utoipa::path(
    get, path = "/v1/events", tag = "dashboards", security(("key" = [])),
    responses(
        (status = OK, description = "Events until the caller leaves", body = Event, content_type = "text/event-stream"),
        super::openapi::ViewerProblems
    )
)]
pub async fn events(State(app): State<App>, key: Option<Extension<Arc<Key>>>) -> impl IntoResponse {
    let reader = app.events.0.subscribe();
    let key = key.map(|Extension(key)| key);
    let events = stream::unfold((reader, app, key), async |(mut reader, app, key)| {
        let event = tokio::select! {
            event = next(&mut reader) => event?,
            () = app.stopping.cancelled() => return None,
            () = app.keyring.revoked(key.as_deref(), || None) => return None,
        };
        if let Event::Lost { events } = *event {
            app.metrics.events_lost(events);
        }
        Some((Ok::<_, Infallible>(as_sent(&event)), (reader, app, key)))
    });
    ([(X_ACCEL_BUFFERING, "no")], Sse::new(events).keep_alive(KeepAlive::new().interval(KEEP_ALIVE)))
}

async fn next(reader: &mut Receiver<Arc<Event>>) -> Option<Arc<Event>> {
    match reader.recv().await {
        Ok(event) => Some(event),
        Err(RecvError::Lagged(events)) => Some(Arc::new(Event::Lost { events })),
        Err(RecvError::Closed) => None,
    }
}

fn as_sent(event: &Event) -> sse::Event {
    let name = match event {
        Event::Answer(_) => "answer",
        Event::RobotJoined(_) => "robot_joined",
        Event::RobotLeft(_) => "robot_left",
        Event::ModelChanged { .. } => "model_changed",
        Event::Lost { .. } => "lost",
    };
    // Plain values always have a JSON form.
    sse::Event::default().event(name).data(serde_json::to_string(event).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_slow_reader_loses_the_oldest_and_is_told_how_many() {
        let events = Events::default();
        events.tell(|| panic!("nobody listens"));
        let mut reader = events.0.subscribe();
        for idx in 0..N_KEPT as u64 + 5 {
            events.tell(|| Event::Lost { events: 1000 + idx });
        }
        assert_eq!(*next(&mut reader).await.unwrap(), Event::Lost { events: 5 });
        assert_eq!(*next(&mut reader).await.unwrap(), Event::Lost { events: 1005 });
    }
}
