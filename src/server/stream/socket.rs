//! One WebSocket: messages in and out, and an end that reaches the other side.

use axum::body::Bytes;
use axum::extract::Request;
use axum::response::Response;
use futures_util::{SinkExt, StreamExt};
use hyper::upgrade::{OnUpgrade, Upgraded};
use hyper_util::rt::TokioIo;
use std::time::Duration;
use tokio::io::AsyncReadExt;
use tokio::time::timeout;
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::error::{CapacityError, Error, ProtocolError};
use tokio_tungstenite::tungstenite::handshake::server::create_response;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};
use tokio_tungstenite::tungstenite::{Message, Utf8Bytes};

/// What is read ahead on one connection, in bytes. A thousand idle streams hold this each.
const READ_BUFFER_BYTES: usize = 8 << 10;
/// How long the other side may take to close after it was told to.
const CLOSE_PATIENCE: Duration = Duration::from_secs(1);
/// What is read and thrown away of a message that is too long, so that the reason arrives before a reset.
const LINGER_BYTES: u64 = 64 << 20;

/// A WebSocket of a robot.
pub struct Socket {
    stream: WebSocketStream<TokioIo<Upgraded>>,
    /// How long the other side may take to read an answer.
    write_timeout: Duration,
}

/// What came.
pub enum Incoming {
    /// A frame.
    Binary(Bytes),
    /// JSON.
    Text(Utf8Bytes),
    /// An answer to a ping, or a ping.
    Alive,
    /// The other side closed the stream.
    Closed,
    /// A message longer than allowed.
    TooLong,
    /// Bytes that are no message of a WebSocket, or a text that is no UTF-8.
    Malformed,
    /// The connection broke.
    Lost(Error),
}

/// Why a stream is closed by the service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Close {
    /// The service stops.
    Draining,
    /// Nothing was heard for too long.
    Idle,
    /// A message was too long.
    TooLong,
    /// What came was no message.
    Malformed,
    /// There are as many streams as there may be.
    TooMany,
    /// The stream goes on over another connection.
    Replaced,
    /// The key that opened it is valid no longer.
    Revoked,
}

impl Close {
    fn frame(self) -> CloseFrame {
        let (code, reason) = match self {
            Self::Draining => (CloseCode::Away, "draining"),
            Self::Idle => (CloseCode::Policy, "nothing was heard for too long"),
            Self::TooLong => (CloseCode::Size, "the message is longer than limits.max_frame_bytes"),
            Self::Malformed => (CloseCode::Policy, "no valid message; frames are binary, all else is text"),
            Self::TooMany => (CloseCode::Again, "too many streams; try again later"),
            Self::Revoked => (CloseCode::Policy, "the key that opened the stream is valid no longer"),
            Self::Replaced => (CloseCode::Policy, "the stream was resumed over another connection"),
        };
        CloseFrame { code, reason: Utf8Bytes::from_static(reason) }
    }
}

/// The response that begins a WebSocket, and what the connection then becomes.
///
/// # Errors
/// Why the request asks for none.
pub fn handshake(request: &mut Request) -> Result<(Response, OnUpgrade), String> {
    let mut plain = hyper::Request::new(());
    *plain.method_mut() = request.method().clone();
    *plain.version_mut() = request.version();
    *plain.headers_mut() = request.headers().clone();
    let response = create_response(&plain).map_err(|error| error.to_string())?;
    Ok((response.map(|()| axum::body::Body::empty()), hyper::upgrade::on(request)))
}

impl Socket {
    /// The robot's end of the connection is open; messages of up to `max_bytes` are read.
    pub async fn open(upgraded: Upgraded, max_bytes: usize, write_timeout: Duration) -> Self {
        let config = WebSocketConfig::default()
            .read_buffer_size(READ_BUFFER_BYTES)
            .write_buffer_size(0)
            .max_message_size(Some(max_bytes))
            .max_frame_size(Some(max_bytes));
        let io = TokioIo::new(upgraded);
        let stream = WebSocketStream::from_raw_socket(io, Role::Server, Some(config)).await;
        Self { stream, write_timeout }
    }

    /// What comes next. Nothing is lost when the future is dropped.
    pub async fn receive(&mut self) -> Incoming {
        match self.stream.next().await {
            Some(Ok(Message::Binary(bytes))) => Incoming::Binary(bytes),
            Some(Ok(Message::Text(text))) => Incoming::Text(text),
            Some(Ok(Message::Ping(_) | Message::Pong(_) | Message::Frame(_))) => Incoming::Alive,
            Some(Ok(Message::Close(_))) | None => Incoming::Closed,
            Some(Err(Error::Capacity(CapacityError::MessageTooLong { .. }))) => Incoming::TooLong,
            Some(Err(error @ Error::Protocol(ProtocolError::ResetWithoutClosingHandshake))) => {
                Incoming::Lost(error)
            }
            Some(Err(Error::Protocol(_) | Error::Utf8(_))) => Incoming::Malformed,
            Some(Err(error)) => Incoming::Lost(error),
        }
    }

    /// Sends a text.
    ///
    /// # Errors
    /// The connection broke, or the other side reads nothing.
    pub async fn send(&mut self, text: Utf8Bytes) -> Result<(), Error> {
        self.send_message(Message::Text(text)).await
    }

    /// Asks for a sign of life.
    ///
    /// # Errors
    /// As [`Socket::send`].
    pub async fn ping(&mut self) -> Result<(), Error> {
        self.send_message(Message::Ping(Bytes::new())).await
    }

    /// Answers the other side, which has closed the stream.
    pub async fn finish(mut self) {
        let answered = async { while let Some(Ok(_)) = self.stream.next().await {} };
        let _ = timeout(CLOSE_PATIENCE, answered).await;
    }

    /// Tells the other side why, and waits for a moment until it has heard.
    pub async fn close(mut self, why: Close) {
        if self.send_message(Message::Close(Some(why.frame()))).await.is_err() {
            return;
        }
        let heard = async {
            if matches!(why, Close::TooLong | Close::Malformed) {
                // What follows can no longer be told apart into messages.
                let mut rest = self.stream.get_mut().take(LINGER_BYTES);
                let _ = tokio::io::copy(&mut rest, &mut tokio::io::sink()).await;
            } else {
                while let Some(Ok(_)) = self.stream.next().await {}
            }
        };
        let _ = timeout(CLOSE_PATIENCE, heard).await;
    }

    async fn send_message(&mut self, message: Message) -> Result<(), Error> {
        let timed_out = || Error::Io(std::io::ErrorKind::TimedOut.into());
        timeout(self.write_timeout, self.stream.send(message)).await.unwrap_or_else(|_| Err(timed_out()))
    }
}
