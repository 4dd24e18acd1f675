//! One WebSocket: messages in and out, and an end that reaches the other side.

use super::inbox::{Inbox, Incoming};
use super::wire::Broken;
use bytes::Bytes;
use hyper::upgrade::Upgraded;
use hyper_util::rt::TokioIo;
use std::io;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::Utf8Bytes;
use tokio_tungstenite::tungstenite::protocol::CloseFrame;
use tokio_tungstenite::tungstenite::protocol::frame::Frame;
use tokio_tungstenite::tungstenite::protocol::frame::coding::{CloseCode, Data, OpCode};

/// How long the other side may take to close after it was told to.
const CLOSE_PATIENCE: Duration = Duration::from_secs(1);
/// What is read and thrown away of a message that is too long, so that the reason arrives before a reset.
const LINGER_BYTES: u64 = 64 << 20;

/// A WebSocket of a robot.
pub struct Socket {
    io: TokioIo<Upgraded>,
    inbox: Inbox,
    /// What the last ping brought that has no answer yet.
    ping: Option<Bytes>,
    /// What the other side said when it closed.
    farewell: Option<CloseFrame>,
    /// How long the other side may take to read an answer.
    write_timeout: Duration,
}

/// Why a connection is closed by the service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Close {
    Draining,
    /// Nothing was heard for too long.
    Idle,
    /// What came was no message that is read here.
    Broken(Broken),
    /// A message took too long.
    Slow,
    /// A message stood still while others waited for its room.
    Stalled,
    /// There are as many streams as there may be.
    Full,
    /// The caller has as many streams as one may have.
    Share,
    /// The stream gave its place to another.
    GivenUp,
    NoModel,
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
            Self::Broken(Broken::TooLong) => {
                (CloseCode::Size, "the message is longer than limits.max_frame_bytes")
            }
            Self::Broken(Broken::Protocol) => (CloseCode::Protocol, "not what RFC 6455 allows"),
            Self::Broken(Broken::NotUtf8) => {
                (CloseCode::Invalid, "the text is no UTF-8; frames are binary messages")
            }
            Self::Slow => {
                (CloseCode::Policy, "the message was not complete in time; resume and send smaller ones")
            }
            Self::Stalled => {
                (CloseCode::Again, "the message stood still while others waited; resume the stream")
            }
            Self::Full => (CloseCode::Again, "too many streams; try again later"),
            Self::Share => (CloseCode::Again, "you have as many streams as one caller may have; close one"),
            Self::GivenUp => (CloseCode::Again, "the stream gave its place to another; begin a new one"),
            Self::NoModel => (CloseCode::Again, "no model serves; try again later"),
            Self::Revoked => (CloseCode::Policy, "the key that opened the stream is valid no longer"),
            Self::Replaced => (CloseCode::Policy, "the stream was resumed over another connection"),
        };
        CloseFrame { code, reason: Utf8Bytes::from_static(reason) }
    }
}

impl Socket {
    /// The robot's end of the connection is open; its messages come into `inbox`.
    pub fn new(upgraded: Upgraded, inbox: Inbox, write_timeout: Duration) -> Self {
        Self { io: TokioIo::new(upgraded), inbox, ping: None, farewell: None, write_timeout }
    }

    /// What comes next; see [`Inbox::receive`]. Nothing is lost when the future is dropped.
    pub async fn receive(&mut self, lossless: bool) -> Incoming {
        self.inbox.receive(&mut self.io, lossless).await
    }

    /// When something was heard last; see [`Inbox::heard`].
    pub fn heard(&self) -> Instant {
        self.inbox.heard()
    }

    /// Notes a ping. Of several only the last is answered, as RFC 6455 allows.
    pub fn note_ping(&mut self, payload: Bytes) {
        self.ping = Some(payload);
    }

    /// Notes what the other side said when it closed.
    pub fn note_farewell(&mut self, farewell: Option<CloseFrame>) {
        self.farewell = farewell;
    }

    /// Answers the last ping, if it has no answer, and sends what there is to say.
    ///
    /// # Errors
    /// As [`Socket::send`].
    pub async fn say(&mut self, said: Vec<Utf8Bytes>) -> io::Result<()> {
        if let Some(payload) = self.ping.take() {
            self.write(Frame::pong(payload)).await?;
        }
        for text in said {
            self.send(text).await?;
        }
        Ok(())
    }

    /// Sends a text.
    ///
    /// # Errors
    /// The connection broke, or the other side reads nothing.
    pub async fn send(&mut self, text: Utf8Bytes) -> io::Result<()> {
        self.write(Frame::message(text, OpCode::Data(Data::Text), true)).await
    }

    /// Asks for a sign of life.
    ///
    /// # Errors
    /// As [`Socket::send`].
    pub async fn ping(&mut self) -> io::Result<()> {
        self.write(Frame::ping(Bytes::new())).await
    }

    /// Answers the other side, which has closed the stream.
    pub async fn finish(mut self) {
        let farewell = Frame::close(self.farewell.take());
        if self.write(farewell).await.is_ok() {
            self.shut_down().await;
        }
    }

    /// Tells the other side why, and waits for a moment until it has heard.
    pub async fn close(mut self, why: Close) {
        if self.write(Frame::close(Some(why.frame()))).await.is_err() {
            return;
        }
        let heard = async {
            if matches!(why, Close::Broken(_)) {
                // What follows can no longer be told apart into messages, the other side's farewell neither.
                let _ = self.io.shutdown().await;
                let mut rest = (&mut self.io).take(LINGER_BYTES);
                let _ = tokio::io::copy(&mut rest, &mut tokio::io::sink()).await;
            } else {
                self.inbox.discard(&mut self.io).await;
            }
        };
        let _ = timeout(CLOSE_PATIENCE, heard).await;
        self.shut_down().await;
    }

    async fn shut_down(&mut self) {
        let _ = timeout(CLOSE_PATIENCE, self.io.shutdown()).await;
    }

    async fn write(&mut self, frame: Frame) -> io::Result<()> {
        let mut bytes = Vec::with_capacity(frame.len());
        frame.format(&mut bytes).map_err(io::Error::other)?;
        let written = async {
            self.io.write_all(&bytes).await?;
            self.io.flush().await
        };
        timeout(self.write_timeout, written).await.unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()))
    }
}
