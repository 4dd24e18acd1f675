//! What a robot sends, put together from the pieces of its WebSocket, within limits on bytes, time and memory.

use super::intake::{Intake, Lossless, Room, Share, Whole, Yielding};
use super::wire::{Broken, Decoder, Piece};
use crate::engine::caller::CallerId;
use bytes::BytesMut;
use roomsight_protocol::header::Header;
use std::future::poll_fn;
use std::io;
use std::mem::MaybeUninit;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Poll, ready};
use std::time::{Duration, Instant};
use tokio::io::{AsyncRead, ReadBuf};
use tokio::time::timeout_at;
use tokio_tungstenite::tungstenite::protocol::CloseFrame;

/// The longest text message, in bytes. Of a longer one nothing is kept.
pub const MAX_TEXT_BYTES: usize = 16 << 10;
/// What is read at once.
const READ_BYTES: usize = 16 << 10;
/// How long a frame in the mode `lossless` may stand still while others wait for its room.
const STANDSTILL: Duration = Duration::from_secs(5);

/// What may be sent.
pub struct MessageLimits {
    /// The longest message, in bytes.
    pub max_bytes: usize,
    /// How long a message may take to come in.
    pub message_timeout: Duration,
}

/// The messages of one connection, as they come in.
pub struct Inbox {
    decoder: Decoder,
    message: Option<Underway>,
    message_timeout: Duration,
    standstill: Duration,
    intake: Arc<Intake>,
    holder: CallerId,
    /// The holder's room for frames in the mode `lossless`.
    room: Arc<Room>,
    heard: Instant,
}

pub enum Incoming {
    /// A frame.
    Frame(Box<Received>),
    /// A text; none where it is longer than is read.
    Text(Option<String>),
    /// A ping, with its payload.
    Ping(BytesMut),
    /// An answer to a ping.
    Pong,
    /// The other side closed the stream, and may have said why.
    Closed(Option<CloseFrame>),
    /// What is no message, or none that is read here.
    Broken(Broken),
    /// A message did not come in in time.
    Slow,
    /// A message stood still while others waited for its room.
    Stalled,
    /// The connection broke.
    Lost(io::Error),
}

/// A frame that came in.
pub struct Received {
    /// The beginning of the message, as much as a header takes.
    pub head: Vec<u8>,
    /// How long the message was, in bytes.
    pub n_bytes: usize,
    /// The message; none where there was no memory for it.
    pub message: Option<Whole>,
    /// Its share of what frames in the mode `lossless` may have.
    pub share: Option<Share>,
}

/// A message of which more is to come.
struct Underway {
    content: Content,
    due: Instant,
    /// Since when it has been waiting for memory.
    waits_since: Option<Instant>,
}

enum Content {
    Text(Text),
    Frame { head: Vec<u8>, n_bytes: usize, hold: Hold },
}

/// Where the bytes of a frame are.
enum Hold {
    Yielding(Yielding),
    Lossless(Box<Lossless>),
    Nowhere,
}

impl Inbox {
    /// Of a connection of `holder`, whose frames come into `intake`.
    pub fn new(limits: &MessageLimits, intake: Arc<Intake>, holder: CallerId) -> Self {
        Self {
            decoder: Decoder::new(limits.max_bytes),
            message: None,
            message_timeout: limits.message_timeout,
            standstill: STANDSTILL,
            room: intake.room_of(&holder),
            intake,
            holder,
            heard: Instant::now(),
        }
    }

    /// When the last byte arrived, or might have: while we wait for memory we do not listen.
    pub fn heard(&self) -> Instant {
        let is_waiting = self.message.as_ref().is_some_and(|message| message.waits_since.is_some());
        if is_waiting { Instant::now() } else { self.heard }
    }

    /// What comes next over `io`. Frames that begin now are `lossless` or may be dropped. Nothing is lost when
    /// the future is dropped.
    pub async fn receive(&mut self, io: &mut (impl AsyncRead + Unpin), lossless: bool) -> Incoming {
        loop {
            if let Some(message) = &mut self.message
                && message.let_in().await
            {
                self.heard = Instant::now();
            }
            match self.decoder.next() {
                Ok(Some(piece)) => {
                    if let Some(incoming) = self.take(piece, lossless) {
                        return incoming;
                    }
                }
                Ok(None) => {
                    if let Err(why) = self.read(io).await {
                        return why;
                    }
                }
                Err(broken) => return Incoming::Broken(broken),
            }
        }
    }

    /// Reads and throws away what still comes, until the other side closes.
    pub async fn discard(&mut self, io: &mut (impl AsyncRead + Unpin)) {
        self.message = None;
        loop {
            match self.decoder.next() {
                Ok(Some(Piece::Close(_))) | Err(_) => return,
                Ok(Some(_)) => {}
                Ok(None) => {
                    if self.read(io).await.is_err() {
                        return;
                    }
                }
            }
        }
    }

    /// Reads more bytes, if they come in time.
    async fn read(&mut self, io: &mut (impl AsyncRead + Unpin)) -> Result<(), Incoming> {
        let arrived = self.decoder.arrived();
        if arrived.is_empty() {
            // What was taken from it lies in memory that it would hold on to.
            *arrived = BytesMut::new();
        }
        let Some(message) = &self.message else {
            return heard(read_some(io, arrived).await, &mut self.heard);
        };
        let mut listened_since = self.heard;
        loop {
            let stalls_at = listened_since + self.standstill;
            let until = if message.is_lossless() { message.due.min(stalls_at) } else { message.due };
            if let Ok(read) = timeout_at(until.into(), read_some(io, arrived)).await {
                return heard(read, &mut self.heard);
            }
            if message.due <= Instant::now() {
                return Err(Incoming::Slow);
            }
            if self.room.is_awaited() || self.intake.room().is_awaited() {
                return Err(Incoming::Stalled);
            }
            listened_since = Instant::now();
        }
    }

    fn take(&mut self, piece: Piece, lossless: bool) -> Option<Incoming> {
        match piece {
            Piece::Begin { is_text, most } => {
                let content = if is_text {
                    Content::Text(Text::default())
                } else {
                    let hold = self.hold(most, lossless);
                    Content::Frame { head: Vec::with_capacity(Header::MAX_BYTES), n_bytes: 0, hold }
                };
                let due = Instant::now() + self.message_timeout;
                self.message = Some(Underway { content, due, waits_since: None });
                None
            }
            Piece::Bytes(bytes) => self.message.as_mut()?.content.push(bytes).err().map(Incoming::Broken),
            Piece::End => Some(self.message.take()?.content.finish()),
            Piece::Ping(payload) => Some(Incoming::Ping(payload)),
            Piece::Pong => Some(Incoming::Pong),
            Piece::Close(frame) => Some(Incoming::Closed(frame)),
        }
    }

    fn hold(&self, most: usize, lossless: bool) -> Hold {
        if lossless {
            Hold::Lossless(Box::new(Lossless::begin(&self.intake, self.room.clone(), most)))
        } else {
            Yielding::begin(&self.intake, &self.holder, most).map_or(Hold::Nowhere, Hold::Yielding)
        }
    }
}

/// Appends what has come, once something has. Until then no memory is held for it: most streams wait most of the time.
async fn read_some(io: &mut (impl AsyncRead + Unpin), arrived: &mut BytesMut) -> io::Result<usize> {
    poll_fn(|context| {
        let mut space = [MaybeUninit::uninit(); READ_BYTES];
        let mut read = ReadBuf::uninit(&mut space);
        ready!(Pin::new(&mut *io).poll_read(context, &mut read))?;
        arrived.extend_from_slice(read.filled());
        Poll::Ready(Ok(read.filled().len()))
    })
    .await
}

/// What follows from a read.
fn heard(read: io::Result<usize>, heard: &mut Instant) -> Result<(), Incoming> {
    match read {
        Ok(0) => Err(Incoming::Lost(io::ErrorKind::UnexpectedEof.into())),
        Ok(_) => {
            *heard = Instant::now();
            Ok(())
        }
        Err(error) => Err(Incoming::Lost(error)),
    }
}

impl Underway {
    /// Waits until there is memory for what arrived, if need be: then true. That is not the robot's time.
    async fn let_in(&mut self) -> bool {
        match &mut self.content {
            Content::Frame { hold: Hold::Lossless(frame), .. } if frame.is_waiting() => {
                let since = *self.waits_since.get_or_insert_with(Instant::now);
                frame.let_in().await;
                self.due += since.elapsed();
                self.waits_since = None;
                true
            }
            _ => false,
        }
    }

    fn is_lossless(&self) -> bool {
        matches!(self.content, Content::Frame { hold: Hold::Lossless(_), .. })
    }
}

impl Content {
    fn push(&mut self, bytes: BytesMut) -> Result<(), Broken> {
        match self {
            Self::Text(text) => return text.push(&bytes),
            Self::Frame { head, n_bytes, hold } => {
                let n_missing = (Header::MAX_BYTES - head.len()).min(bytes.len());
                head.extend_from_slice(&bytes[..n_missing]);
                *n_bytes += bytes.len();
                match hold {
                    Hold::Yielding(frame) => frame.push(&bytes),
                    Hold::Lossless(frame) => frame.push(bytes),
                    Hold::Nowhere => {}
                }
            }
        }
        Ok(())
    }

    fn finish(self) -> Incoming {
        match self {
            Self::Text(text) => text.finish(),
            Self::Frame { head, n_bytes, hold } => {
                let (message, share) = match hold {
                    Hold::Yielding(frame) => (frame.is_here().then_some(Whole::Yielding(frame)), None),
                    Hold::Lossless(frame) => {
                        frame.finish().map(|(frame, share)| (Whole::Kept(frame), share)).unzip()
                    }
                    Hold::Nowhere => (None, None),
                };
                Incoming::Frame(Box::new(Received { head, n_bytes, message, share }))
            }
        }
    }
}

/// A text under way: checked as it arrives, and kept where it is not too long.
#[derive(Default)]
struct Text {
    bytes: Vec<u8>,
    /// How many of them are UTF-8; at most the beginning of one letter follows.
    n_checked: usize,
    is_too_long: bool,
}

impl Text {
    fn push(&mut self, more: &[u8]) -> Result<(), Broken> {
        self.bytes.extend_from_slice(more);
        self.n_checked = match std::str::from_utf8(&self.bytes[self.n_checked..]) {
            Ok(_) => self.bytes.len(),
            Err(error) if error.error_len().is_some() => return Err(Broken::NotUtf8),
            Err(error) => self.n_checked + error.valid_up_to(),
        };
        self.is_too_long |= self.bytes.len() > MAX_TEXT_BYTES;
        if self.is_too_long {
            self.bytes.drain(..self.n_checked);
            self.n_checked = 0;
        }
        Ok(())
    }

    fn finish(self) -> Incoming {
        match String::from_utf8(self.bytes) {
            Err(_) => Incoming::Broken(Broken::NotUtf8),
            Ok(text) => Incoming::Text((!self.is_too_long).then_some(text)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::{AsyncWriteExt, DuplexStream, duplex};
    use tokio::sync::Semaphore;

    const MAX_BYTES: usize = 100_000;

    struct Line {
        inbox: Inbox,
        ours: DuplexStream,
        theirs: DuplexStream,
        memory: Arc<Semaphore>,
    }

    fn line() -> Line {
        let memory = Arc::new(Semaphore::new(4 * MAX_BYTES));
        let intake = Arc::new(Intake::new(memory.clone(), 4 * MAX_BYTES, MAX_BYTES));
        let limits = MessageLimits { max_bytes: MAX_BYTES, message_timeout: Duration::from_secs(30) };
        let (ours, theirs) = duplex(1 << 20);
        Line { inbox: Inbox::new(&limits, intake, CallerId::Robot("wall-e".into())), ours, theirs, memory }
    }

    impl Line {
        /// Sends a frame, masked with zeros.
        async fn send(&mut self, first: u8, n_bytes: usize, payload: &[u8]) {
            let head = [&[first, 0xff][..], &(n_bytes as u64).to_be_bytes(), &[0; 4], payload].concat();
            self.theirs.write_all(&head).await.unwrap();
        }

        async fn receive(&mut self, lossless: bool) -> Incoming {
            self.inbox.receive(&mut self.ours, lossless).await
        }

        /// Reads what has arrived, of which nothing is whole.
        async fn nothing(&mut self, lossless: bool) {
            let incoming = self.inbox.receive(&mut self.ours, lossless);
            tokio::select! {
                biased;
                _ = incoming => panic!("something is whole"),
                () = tokio::task::yield_now() => {}
            }
        }
    }

    #[tokio::test]
    async fn the_bytes_of_a_frame_are_counted_as_they_arrive() {
        for lossless in [false, true] {
            let mut line = line();
            line.send(0x82, 90_000, &[5; 60_000]).await;
            let before = Instant::now();
            line.nothing(lossless).await;
            assert_eq!(line.memory.available_permits(), 4 * MAX_BYTES - 60_000);
            assert!(line.inbox.heard() >= before, "they are a sign of life");
            line.theirs.write_all(&[5; 30_000]).await.unwrap();
            let Incoming::Frame(received) = line.receive(lossless).await else { panic!("no frame") };
            assert_eq!((received.n_bytes, received.head), (90_000, vec![5; Header::MAX_BYTES]));
            assert_eq!(received.message.and_then(Whole::take).unwrap().bytes, vec![5; 90_000]);
            assert_eq!(received.share.is_some(), lossless);
            assert_eq!(line.memory.available_permits(), 4 * MAX_BYTES);
        }
    }

    #[tokio::test]
    async fn a_frame_without_memory_is_told_by_its_beginning_unless_it_is_lossless() {
        let mut line = line();
        let all = line.memory.clone().try_acquire_many_owned(4 * MAX_BYTES as u32).unwrap();
        line.send(0x82, 50_000, &[5; 50_000]).await;
        let Incoming::Frame(received) = line.receive(false).await else { panic!("no frame") };
        assert_eq!((received.n_bytes, received.head), (50_000, vec![5; Header::MAX_BYTES]));
        assert!(received.message.is_none());
        line.send(0x82, 50_000, &[5; 50_000]).await;
        line.nothing(true).await;
        drop(all);
        let Incoming::Frame(received) = line.receive(true).await else { panic!("no frame") };
        assert_eq!(received.message.and_then(Whole::take).unwrap().bytes, vec![5; 50_000]);
    }

    #[tokio::test]
    async fn a_text_is_read_if_it_is_short_and_told_if_it_is_long() {
        let mut line = line();
        let short = "ö".repeat(MAX_TEXT_BYTES / 2);
        line.send(0x81, short.len(), short.as_bytes()).await;
        assert!(matches!(line.receive(false).await, Incoming::Text(Some(text)) if text == short));
        let long = "ö".repeat(MAX_BYTES / 2);
        line.send(0x81, long.len(), long.as_bytes()).await;
        assert!(matches!(line.receive(false).await, Incoming::Text(None)));
        line.send(0x81, MAX_BYTES + 1, b"").await;
        assert!(matches!(line.receive(false).await, Incoming::Broken(Broken::TooLong)));
    }

    #[tokio::test]
    async fn what_is_no_utf8_is_noticed_before_the_message_ends() {
        for (payload, n_bytes) in [(&b"caf\xc3"[..], 4), (b"\xed\xa0\x80", 3), (b"fine \xff", 90_000)] {
            let mut line = line();
            line.send(0x81, n_bytes, payload).await;
            assert!(matches!(line.receive(false).await, Incoming::Broken(Broken::NotUtf8)), "{payload:?}");
        }
    }

    #[tokio::test]
    async fn a_message_must_come_in_in_time() {
        let mut line = line();
        line.inbox.message_timeout = Duration::ZERO;
        for lossless in [false, true] {
            line.send(0x82, 90_000, b"the beginning").await;
            assert!(matches!(line.receive(lossless).await, Incoming::Slow));
            line.inbox.decoder = Decoder::new(MAX_BYTES);
        }
    }

    #[tokio::test]
    async fn a_lossless_frame_that_stands_still_gives_its_room_to_those_who_wait() {
        // Those who fill everybody's room, and one of the same caller.
        for callers in [&["eve", "gort"][..], &["wall-e"]] {
            let mut line = line();
            line.inbox.standstill = Duration::from_millis(1);
            line.send(0x82, 90_000, b"the beginning").await;
            line.nothing(true).await;
            let room = |name: &&str| line.inbox.intake.room_of(&CallerId::Robot((*name).into()));
            let others =
                callers.iter().map(|name| Lossless::begin(&line.inbox.intake, room(name), MAX_BYTES));
            let mut others: Vec<_> = others.collect();
            let mut last = others.pop().unwrap();
            for other in &mut others {
                other.let_in().await;
            }
            tokio::select! {
                biased;
                () = last.let_in() => panic!("there is no room"),
                incoming = line.inbox.receive(&mut line.ours, true) => {
                    assert!(matches!(incoming, Incoming::Stalled));
                }
            }
        }
    }
}
