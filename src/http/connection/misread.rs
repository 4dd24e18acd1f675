//! What hyper refuses by itself, told as all other errors are.
//!
//! Bytes that are no HTTP, and heads that are too long, never become a request. hyper answers them with a
//! status and nothing else, and offers no way to say more. Here that answer is recognized where it is
//! written, by the id that every answer of ours carries and hyper's does not, and a problem takes its place.
//! Nothing else that is written can look like it: what callers chose stands in JSON, which has no bare ends
//! of lines, and WebSockets have frames of their own.

use crate::http::App;
use crate::http::caller::Peer;
use crate::http::problem::of_framework;
use crate::problem::{Kind, Problem};
use axum::http::StatusCode;
use std::io::{self, IoSlice};
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Sleep, sleep};

/// How an answer of ours names its request.
const REQUEST_ID: &[u8] = b"\r\nx-request-id: ";
/// What hyper says of the body of an answer that has none.
const NO_BODY: &[u8] = b"content-length: 0\r\n";
/// What is read and thrown away after a refusal, at most this long, so that the reason arrives before the
/// reset that unread bytes cause.
const LINGER: Duration = Duration::from_secs(2);

/// A connection whose refusals say why.
pub struct Misread<T> {
    io: T,
    app: App,
    peer: Peer,
    told: Option<Told>,
}

/// A refusal in place of hyper's.
struct Told {
    bytes: Vec<u8>,
    n_written: usize,
    /// Runs since the connection is to end.
    patience: Option<Pin<Box<Sleep>>>,
}

impl<T> Misread<T> {
    /// Those of one connection.
    pub fn new(io: T, app: App, peer: Peer) -> Self {
        Self { io, app, peer, told: None }
    }
}

impl<T: AsyncWrite + Unpin> Misread<T> {
    /// Writes the refusal that takes the place of `head`, all of it before this is ready.
    fn poll_told(&mut self, context: &mut Context, head: &[u8]) -> Poll<io::Result<usize>> {
        let Self { io, app, peer, told } = self;
        let told = told.get_or_insert_with(|| Told::instead_of(head, app, *peer));
        while told.n_written < told.bytes.len() {
            match ready!(Pin::new(&mut *io).poll_write(context, &told.bytes[told.n_written..]))? {
                0 => return Poll::Ready(Err(io::ErrorKind::WriteZero.into())),
                n_bytes => told.n_written += n_bytes,
            }
        }
        Poll::Ready(Ok(head.len()))
    }
}

impl Told {
    fn instead_of(head: &[u8], app: &App, Peer(peer): Peer) -> Self {
        let problem: Problem = match status(head) {
            Some(StatusCode::BAD_REQUEST) | None => Kind::NotHttp.into(),
            Some(status) => of_framework(status),
        };
        let id = app.request_ids.next();
        let status = problem.kind().status();
        if app.refusals.is_news(peer.ip(), status) {
            tracing::info!(request_id = %id, status, %peer, "refused before it was a request");
        }
        let body = serde_json::to_vec(&problem.body(&id)).unwrap_or_default();
        let mut bytes = Vec::with_capacity(head.len() + body.len() + 128);
        for line in
            head.split_inclusive(|&byte| byte == b'\n').filter(|&line| line != b"\r\n" && line != NO_BODY)
        {
            bytes.extend(line);
        }
        let rest = format!(
            "content-type: application/problem+json\r\ncontent-length: {}\r\nx-request-id: {id}\r\n\r\n",
            body.len()
        );
        bytes.extend(rest.as_bytes());
        bytes.extend(body);
        Self { bytes, n_written: 0, patience: None }
    }
}

/// Whether these bytes are an answer of hyper's own.
fn refused(head: &[u8]) -> bool {
    let is_error = status(head).is_some_and(|status| status.is_client_error());
    let has = |part: &[u8]| head.windows(part.len()).any(|window| window == part);
    is_error && head.ends_with(b"\r\n\r\n") && has(NO_BODY) && !has(REQUEST_ID)
}

fn status(head: &[u8]) -> Option<StatusCode> {
    let version = b"HTTP/1.1 ".len();
    let is_head = head.starts_with(b"HTTP/1.1 ") || head.starts_with(b"HTTP/1.0 ");
    if is_head { StatusCode::from_bytes(head.get(version..version + 3)?).ok() } else { None }
}

impl<T: AsyncRead + Unpin> AsyncRead for Misread<T> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context,
        buffer: &mut ReadBuf,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_read(context, buffer)
    }
}

impl<T: AsyncRead + AsyncWrite + Unpin> AsyncWrite for Misread<T> {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context, bytes: &[u8]) -> Poll<io::Result<usize>> {
        if refused(bytes) {
            self.poll_told(context, bytes)
        } else {
            Pin::new(&mut self.io).poll_write(context, bytes)
        }
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context,
        slices: &[IoSlice],
    ) -> Poll<io::Result<usize>> {
        match slices {
            [head] if refused(head) => self.poll_told(context, head),
            _ => Pin::new(&mut self.io).poll_write_vectored(context, slices),
        }
    }

    fn is_write_vectored(&self) -> bool {
        self.io.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_flush(context)
    }

    fn poll_shutdown(self: Pin<&mut Self>, context: &mut Context) -> Poll<io::Result<()>> {
        let Self { io, told, .. } = self.get_mut();
        ready!(Pin::new(&mut *io).poll_shutdown(context))?;
        let Some(told) = told else { return Poll::Ready(Ok(())) };
        let patience = told.patience.get_or_insert_with(|| Box::pin(sleep(LINGER)));
        let mut scratch = [0; 4096];
        loop {
            let mut buffer = ReadBuf::new(&mut scratch);
            match Pin::new(&mut *io).poll_read(context, &mut buffer) {
                Poll::Ready(Ok(())) if !buffer.filled().is_empty() && !patience.is_elapsed() => {}
                Poll::Ready(_) => return Poll::Ready(Ok(())),
                Poll::Pending => return patience.as_mut().poll(context).map(Ok),
            }
        }
    }
}
