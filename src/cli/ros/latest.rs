//! The last of what comes: one that is not taken in time goes.

use std::sync::{Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;

/// Room for one.
#[derive(Debug, Default)]
pub(super) struct Latest<T> {
    slot: Mutex<Option<T>>,
    put: Notify,
}

impl<T> Latest<T> {
    pub(super) fn new() -> Self {
        Self { slot: Mutex::new(None), put: Notify::new() }
    }

    fn slot(&self) -> MutexGuard<'_, Option<T>> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts one in; whether it took the place of another.
    pub(super) fn put(&self, what: T) -> bool {
        let is_instead = self.slot().replace(what).is_some();
        self.put.notify_one();
        is_instead
    }

    /// Takes the one that is there, or the next; for one taker.
    pub(super) async fn take(&self) -> T {
        loop {
            let taken = self.slot().take();
            match taken {
                Some(what) => return what,
                None => self.put.notified().await,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[tokio::test]
    async fn the_last_is_taken() {
        let latest = Arc::new(Latest::new());
        assert!(!latest.put(1));
        assert!(latest.put(2));
        assert_eq!(latest.take().await, 2);
        let taking = tokio::spawn({
            let latest = Arc::clone(&latest);
            async move { latest.take().await }
        });
        tokio::task::yield_now().await;
        assert!(!latest.put(3));
        assert_eq!(taking.await.unwrap(), 3);
    }
}
