//! A connection that ends when the caller takes nothing of what it is sent.

use std::io::{self, IoSlice};
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll, ready};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Sleep, sleep};

/// A connection on which writing fails with [`io::ErrorKind::TimedOut`] when for some time not one byte could be
/// written that should be. Time in which nothing is to be written does not count.
pub struct WriteTimeout<S> {
    stream: S,
    patience: Duration,
    is_off: Arc<AtomicBool>,
    /// Since something could not be written.
    stuck: Option<Pin<Box<Sleep>>>,
}

impl<S> WriteTimeout<S> {
    /// Allows the caller to take nothing for this long.
    pub fn new(stream: S, patience: Duration) -> Self {
        Self { stream, patience, is_off: Arc::default(), stuck: None }
    }

    /// Turns this off, when set, for whoever has a time-out of its own.
    pub fn switch(&self) -> Arc<AtomicBool> {
        self.is_off.clone()
    }

    /// What came of writing, or that it takes too long.
    fn watched<T>(&mut self, context: &mut Context, result: Poll<io::Result<T>>) -> Poll<io::Result<T>> {
        if result.is_ready() {
            self.stuck = None;
            return result;
        }
        if self.is_off.load(Ordering::Relaxed) {
            return Poll::Pending;
        }
        let patience = self.patience;
        let stuck = self.stuck.get_or_insert_with(|| Box::pin(sleep(patience)));
        ready!(stuck.as_mut().poll(context));
        Poll::Ready(Err(io::Error::new(io::ErrorKind::TimedOut, "the caller does not read what it is sent")))
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for WriteTimeout<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context,
        buffer: &mut ReadBuf,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, buffer)
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for WriteTimeout<S> {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let result = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.watched(context, result)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context,
        pieces: &[IoSlice],
    ) -> Poll<io::Result<usize>> {
        let result = Pin::new(&mut self.stream).poll_write_vectored(context, pieces);
        self.watched(context, result)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context) -> Poll<io::Result<()>> {
        let result = Pin::new(&mut self.stream).poll_flush(context);
        self.watched(context, result)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context) -> Poll<io::Result<()>> {
        let result = Pin::new(&mut self.stream).poll_shutdown(context);
        self.watched(context, result)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::future::poll_fn;
    use tokio::io::{AsyncReadExt, AsyncWriteExt, duplex};

    const SOON: Duration = Duration::from_secs(30);

    #[tokio::test]
    async fn a_caller_that_reads_nothing_is_given_up() {
        let (here, there) = duplex(16);
        let mut connection = WriteTimeout::new(here, Duration::from_millis(20));
        let written = tokio::time::timeout(SOON, connection.write_all(&[0; 100])).await.unwrap();
        assert_eq!(written.unwrap_err().kind(), io::ErrorKind::TimedOut);
        drop(there);
    }

    #[tokio::test]
    async fn a_caller_that_reads_slowly_gets_all_of_it() {
        let (here, mut there) = duplex(16);
        let mut connection = WriteTimeout::new(here, SOON);
        let writes = tokio::spawn(async move { connection.write_all(&[7; 100]).await });
        let mut read = Vec::new();
        while read.len() < 100 {
            read.push(there.read_u8().await.unwrap());
            tokio::task::yield_now().await;
        }
        writes.await.unwrap().unwrap();
        assert_eq!(read, [7; 100]);
    }

    #[tokio::test]
    async fn what_could_be_written_in_the_end_does_not_count() {
        let (here, mut there) = duplex(4);
        let mut connection = WriteTimeout::new(here, SOON);
        connection.write_all(&[0; 4]).await.unwrap();
        assert!(is_stuck(&mut connection).await && connection.stuck.is_some());
        there.read_exact(&mut [0; 4]).await.unwrap();
        connection.write_all(&[0; 4]).await.unwrap();
        assert!(connection.stuck.is_none());
    }

    #[tokio::test]
    async fn it_can_be_turned_off() {
        let (here, _there) = duplex(4);
        let mut connection = WriteTimeout::new(here, Duration::ZERO);
        connection.switch().store(true, Ordering::Relaxed);
        connection.write_all(&[0; 4]).await.unwrap();
        assert!(is_stuck(&mut connection).await && connection.stuck.is_none());
    }

    /// Whether one more byte has to wait.
    async fn is_stuck(connection: &mut WriteTimeout<tokio::io::DuplexStream>) -> bool {
        poll_fn(|context| Poll::Ready(Pin::new(&mut *connection).poll_write(context, &[0]).is_pending()))
            .await
    }
}
