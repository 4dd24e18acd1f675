//! Events for dashboards, as they happen: lossy for slow readers, and never in the way of a robot.

use roomsight_protocol::event::{AnswerEvent, Event};
use std::sync::Arc;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::broadcast::{self, Receiver};

/// How many events a reader may be behind before it loses the oldest.
const N_KEPT: usize = 256;

/// Where events are told, and who listens.
#[derive(Clone)]
pub struct Events {
    all: broadcast::Sender<Arc<Event>>,
    /// All but answers, of which there are hundreds a second.
    changes: broadcast::Sender<Arc<Event>>,
}

impl Default for Events {
    fn default() -> Self {
        Self { all: broadcast::Sender::new(N_KEPT), changes: broadcast::Sender::new(N_KEPT) }
    }
}

/// One who reads events.
pub struct Reader(Receiver<Arc<Event>>);

impl Events {
    /// A reader of what happens from now on.
    pub fn subscribe(&self) -> Reader {
        Reader(self.all.subscribe())
    }

    /// The same, but without answers.
    pub fn subscribe_to_changes(&self) -> Reader {
        Reader(self.changes.subscribe())
    }

    /// How many listen to answers too.
    pub fn n_readers(&self) -> usize {
        self.all.receiver_count()
    }

    /// Tells all readers of something that is no answer. Never waits.
    pub fn tell(&self, event: Event) {
        let event = Arc::new(event);
        let _ = self.changes.send(event.clone());
        let _ = self.all.send(event);
    }

    /// Tells of an answer; where nobody reads them it is not even made. Never waits.
    pub fn answered(&self, answer: impl FnOnce() -> AnswerEvent) {
        if self.n_readers() > 0 {
            let _ = self.all.send(Arc::new(Event::Answer(Box::new(answer()))));
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
        events.answered(|| panic!("nobody listens"));
        let (mut reader, mut of_changes) = (events.subscribe(), events.subscribe_to_changes());
        for idx in 0..N_KEPT as u64 + 5 {
            events.tell(Event::Lost { events: 1000 + idx });
        }
        assert_eq!(*reader.next().await.unwrap(), Event::Lost { events: 5 });
        assert_eq!(*reader.next().await.unwrap(), Event::Lost { events: 1005 });
        assert_eq!(*of_changes.next().await.unwrap(), Event::Lost { events: 5 });
    }
}
