//! Events for dashboards, as they happen: lossy for slow readers, and never in the way of a robot.

use roomsight_protocol::event::Event;
use std::sync::Arc;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::broadcast::{self, Receiver};

/// How many events a reader may be behind before it loses the oldest.
const N_KEPT: usize = 256;

/// Where events are told, and who listens.
#[derive(Clone)]
pub struct Events(broadcast::Sender<Arc<Event>>);

impl Default for Events {
    fn default() -> Self {
        Self(broadcast::Sender::new(N_KEPT))
    }
}

/// One who reads events.
pub struct Reader(Receiver<Arc<Event>>);

impl Events {
    /// A reader of what happens from now on.
    pub fn subscribe(&self) -> Reader {
        Reader(self.0.subscribe())
    }

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

impl Reader {
    /// The next event, or how many were lost; none when the service ends.
    pub async fn next(&mut self) -> Option<Arc<Event>> {
        match self.0.recv().await {
            Ok(event) => Some(event),
            Err(RecvError::Lagged(events)) => Some(Arc::new(Event::Lost { events })),
            Err(RecvError::Closed) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_slow_reader_loses_the_oldest_and_is_told_how_many() {
        let events = Events::default();
        events.tell(|| panic!("nobody listens"));
        let mut reader = events.subscribe();
        for idx in 0..N_KEPT as u64 + 5 {
            events.tell(|| Event::Lost { events: 1000 + idx });
        }
        assert_eq!(*reader.next().await.unwrap(), Event::Lost { events: 5 });
        assert_eq!(*reader.next().await.unwrap(), Event::Lost { events: 1005 });
    }
}
