//! A stream of frames, as a robot sees it.

use super::tls::{self, Connection};
use super::{Client, ClientError, PATIENCE, refused, retry_after};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use reqwest::header::{AUTHORIZATION, SEC_WEBSOCKET_PROTOCOL};
use roomsight_protocol::header::Beside;
use roomsight_protocol::stream::{
    ClientMessage, Configure, FilterChoice, Hello, SUBPROTOCOL, ServerMessage, StreamQuery,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::http::HeaderValue;
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::{self, Message};
use tokio_tungstenite::{WebSocketStream, client_async_with_config};

/// The longest message that is read, in bytes: a result names every room.
const MAX_MESSAGE_BYTES: usize = 1 << 20;

type Socket = WebSocketStream<Connection>;

/// An open stream. Frames go out in their order, and every accepted one gets one answer, in that order.
#[derive(Debug)]
pub struct Stream {
    hello: Hello,
    sender: StreamSender,
    receiver: StreamReceiver,
}

/// The half of a stream that sends.
#[derive(Debug)]
pub struct StreamSender {
    socket: SplitSink<Socket, Message>,
    next: NextSeq,
}

/// The number of the next frame that brings none, as both halves know it.
#[derive(Clone, Debug)]
struct NextSeq(Arc<AtomicU64>);

/// The half of a stream that receives. It must be read all the time: that also answers pings.
#[derive(Debug)]
pub struct StreamReceiver {
    socket: SplitStream<Socket>,
    next: NextSeq,
    session: String,
    last_seq: Option<u64>,
    resume: Option<String>,
    /// When anything came, pings and their answers among it.
    heard: Instant,
}

/// Where a stream can go on after its connection broke.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ResumePoint {
    /// The stream's session, a secret: who has it can go on with the stream.
    pub session: String,
    /// The last frame whose answer arrived.
    pub last_seq: Option<u64>,
    /// The last frame that was sent.
    pub sent_seq: Option<u64>,
    /// How the stream stood, for a service that never had it; a secret, too. None where the service tells none.
    pub resume: Option<String>,
}

impl Stream {
    pub(super) async fn open(client: &Client, configure: &Configure) -> Result<Self, ClientError> {
        let mut stream = Self::connect(client, &query_of(configure)).await?;
        stream.weigh(configure).await?;
        Ok(stream)
    }

    /// An address has no words for how the filter weighs frames.
    async fn weigh(&mut self, configure: &Configure) -> Result<(), ClientError> {
        match configure.filter {
            Some(FilterChoice::With(_)) => {
                self.configure(&Configure { filter: configure.filter, ..Configure::default() }).await
            }
            _ => Ok(()),
        }
    }

    /// A stream that cannot go on begins as is configured.
    pub(super) async fn resume(
        client: &Client,
        point: &ResumePoint,
        configure: &Configure,
    ) -> Result<Self, ClientError> {
        let ResumePoint { session, last_seq, sent_seq, resume } = point.clone();
        let query = StreamQuery { session: Some(session), last_seq, sent_seq, resume, ..query_of(configure) };
        let mut stream = Self::connect(client, &query).await?;
        if stream.hello.resumed {
            stream.receiver.last_seq = last_seq;
        } else {
            stream.weigh(configure).await?;
        }
        Ok(stream)
    }

    /// What the service said first: the session, its settings, limits and rooms.
    pub fn hello(&self) -> &Hello {
        &self.hello
    }

    /// Sends an encoded image, which the service numbers.
    pub async fn send(&mut self, frame: Vec<u8>) -> Result<(), ClientError> {
        self.sender.send(frame).await
    }

    /// Sends an encoded image with its number, the time at which it was taken, and what else was sensed then.
    pub async fn send_with(&mut self, seq: u64, beside: Beside<'_>, frame: &[u8]) -> Result<(), ClientError> {
        self.sender.send_with(seq, beside, frame).await
    }

    /// Changes the stream; what is left out stays. The service answers with `configured`.
    pub async fn configure(&mut self, configure: &Configure) -> Result<(), ClientError> {
        self.sender.configure(configure).await
    }

    /// The next message.
    ///
    /// # Errors
    /// A connection that was closed or broke.
    pub async fn receive(&mut self) -> Result<ServerMessage, ClientError> {
        self.receiver.receive().await
    }

    /// Where to go on if the connection breaks.
    pub fn resume_point(&self) -> ResumePoint {
        self.receiver.resume_point()
    }

    /// When anything was heard.
    pub(super) fn heard(&self) -> Instant {
        self.receiver.heard
    }

    /// Asks for a sign of life.
    pub(super) async fn ping(&mut self) -> Result<(), ClientError> {
        self.sender.socket.send(Message::Ping(Vec::new().into())).await.map_err(broken)
    }

    /// Halves for two tasks, so that frames go out while answers are awaited.
    pub fn split(self) -> (StreamSender, StreamReceiver) {
        (self.sender, self.receiver)
    }

    /// Connects, and waits for `hello`.
    async fn connect(client: &Client, query: &StreamQuery) -> Result<Self, ClientError> {
        timeout(PATIENCE, Self::connect_patiently(client, query)).await.map_err(|_| ClientError::Late)?
    }

    async fn connect_patiently(client: &Client, query: &StreamQuery) -> Result<Self, ClientError> {
        let mut request = stream_url(client, query)?.into_client_request().map_err(broken)?;
        let headers = request.headers_mut();
        headers.insert(SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(SUBPROTOCOL));
        if let Some(authorization) = &client.authorization {
            headers.insert(AUTHORIZATION, authorization.clone());
        }
        let config = WebSocketConfig::default().max_message_size(Some(MAX_MESSAGE_BYTES));
        let connection = tls::connect(&client.url, client.tls.as_ref()).await;
        let connection = connection.map_err(|error| broken(error.into()))?;
        let (socket, _) = client_async_with_config(request, connection, Some(config)).await.map_err(
            |error| match error {
                tungstenite::Error::Http(response) => refused(
                    response.status(),
                    retry_after(response.headers()),
                    response.body().as_deref().unwrap_or_default(),
                ),
                error => broken(error),
            },
        )?;
        let (sink, socket) = socket.split();
        let next = NextSeq(Arc::default());
        let sender = StreamSender { socket: sink, next: next.clone() };
        let mut receiver = StreamReceiver {
            socket,
            next,
            session: String::new(),
            last_seq: None,
            resume: None,
            heard: Instant::now(),
        };
        loop {
            if let ServerMessage::Hello(hello) = receiver.receive().await? {
                receiver.session.clone_from(&hello.session);
                sender.next.sent_before(hello.next_seq);
                return Ok(Self { hello: *hello, sender, receiver });
            }
        }
    }
}

impl StreamSender {
    /// Sends an encoded image, which the service numbers.
    pub async fn send(&mut self, frame: Vec<u8>) -> Result<(), ClientError> {
        self.socket.send(Message::binary(frame)).await.map_err(broken)?;
        self.next.sent();
        Ok(())
    }

    /// Sends an encoded image with its number, the time at which it was taken, and what else was sensed then.
    pub async fn send_with(&mut self, seq: u64, beside: Beside<'_>, frame: &[u8]) -> Result<(), ClientError> {
        self.socket.send(Message::binary(beside.message(seq, frame))).await.map_err(broken)?;
        self.next.sent_before(seq.saturating_add(1));
        Ok(())
    }

    /// Changes the stream; what is left out stays. The service answers with `configured`.
    pub async fn configure(&mut self, configure: &Configure) -> Result<(), ClientError> {
        let text = serde_json::to_string(&ClientMessage::Configure(configure.clone()))?;
        self.socket.send(Message::text(text)).await.map_err(broken)
    }

    /// Says that the stream is at its end.
    pub async fn close(&mut self) -> Result<(), ClientError> {
        self.socket.close().await.map_err(broken)
    }
}

impl NextSeq {
    fn sent(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    fn sent_before(&self, next: u64) {
        self.0.fetch_max(next, Ordering::Relaxed);
    }

    /// The last frame that was sent.
    fn last(&self) -> Option<u64> {
        self.0.load(Ordering::Relaxed).checked_sub(1)
    }
}

impl StreamReceiver {
    /// The next message. Nothing is lost when this is dropped while it waits.
    ///
    /// # Errors
    /// A connection that was closed or broke.
    pub async fn receive(&mut self) -> Result<ServerMessage, ClientError> {
        loop {
            let came = self.socket.next().await;
            self.heard = Instant::now();
            match came {
                Some(Ok(Message::Text(text))) => {
                    let message: ServerMessage = serde_json::from_str(&text)?;
                    self.last_seq = answered_seq(&message).or(self.last_seq);
                    if let Some(resume) = resume_of(&message) {
                        self.resume = Some(resume.clone());
                    }
                    return Ok(message);
                }
                Some(Ok(Message::Close(frame))) => return Err(closed(frame)),
                // Pings are answered below us; the service sends nothing else.
                Some(Ok(_)) => {}
                Some(Err(error)) => return Err(broken(error)),
                None => return Err(closed(None)),
            }
        }
    }

    /// Where to go on if the connection breaks.
    pub fn resume_point(&self) -> ResumePoint {
        ResumePoint {
            session: self.session.clone(),
            last_seq: self.last_seq,
            sent_seq: self.next.last(),
            resume: self.resume.clone(),
        }
    }
}

/// A configuration as the address of a stream says it.
fn query_of(configure: &Configure) -> StreamQuery {
    let Configure { robot, model, mode, interval_ms, sure_interval_ms, filter, deadline_ms, top, explain } =
        configure.clone();
    let filter = filter.map(|filter| filter != FilterChoice::Switch(false));
    StreamQuery {
        robot,
        model,
        mode,
        interval_ms,
        sure_interval_ms,
        filter,
        deadline_ms,
        top,
        explain,
        ..StreamQuery::default()
    }
}

fn stream_url(client: &Client, query: &StreamQuery) -> Result<String, ClientError> {
    let call = client.http.get(client.endpoint("v1/stream")).query(query).build()?;
    Ok(call.url().as_str().replacen("http", "ws", 1))
}

fn resume_of(message: &ServerMessage) -> Option<&String> {
    match message {
        ServerMessage::Hello(hello) => hello.resume.as_ref(),
        ServerMessage::Result(result) => result.resume.as_ref(),
        _ => None,
    }
}

/// The frame that a message answers.
pub(super) fn answered_seq(message: &ServerMessage) -> Option<u64> {
    match message {
        ServerMessage::Result(result) => Some(result.seq),
        ServerMessage::Dropped { seq, .. } => Some(*seq),
        ServerMessage::Error { seq, .. } => *seq,
        _ => None,
    }
}

fn broken(error: tungstenite::Error) -> ClientError {
    match error {
        tungstenite::Error::ConnectionClosed | tungstenite::Error::AlreadyClosed => closed(None),
        error => ClientError::Broken(Box::new(error)),
    }
}

fn closed(frame: Option<tungstenite::protocol::CloseFrame>) -> ClientError {
    let (code, reason) = frame
        .map_or((CloseCode::Status, String::new()), |frame| (frame.code, frame.reason.as_str().to_owned()));
    ClientError::Closed { code: code.into(), reason }
}

#[cfg(test)]
mod tests {
    use super::super::fake::{self, Connection, NO_KEY};
    use super::*;
    use roomsight_protocol::stream::{DropReason, FilterSettings, Mode};

    fn dropped(seq: u64) -> ServerMessage {
        ServerMessage::Dropped { seq, reason: DropReason::Superseded }
    }

    fn client(url: &str) -> Client {
        Client::new(url, Some("rs_k")).unwrap()
    }

    #[tokio::test]
    async fn frames_go_out_bare_or_with_a_header_and_their_answers_come_in() {
        let url = fake::serve(|mut connection: Connection| async move {
            while let Some((header, image)) = connection.frame().await {
                let seq = header.map_or(image.len() as u64, |header| header.seq);
                connection.say(&dropped(seq)).await;
            }
        });
        let mut stream = client(&url.await).stream(&Configure::default()).await.unwrap();
        assert_eq!(stream.hello().protocol, SUBPROTOCOL);
        let begun = ResumePoint { session: "fake".into(), last_seq: None, sent_seq: None, resume: None };
        assert_eq!(stream.resume_point(), begun);
        stream.send(vec![0; 3]).await.unwrap();
        assert_eq!(stream.receive().await.unwrap(), dropped(3));
        let beside = Beside { captured_at_ns: Some(1), ..Beside::default() };
        stream.send_with(7, beside, b"image").await.unwrap();
        assert_eq!(stream.receive().await.unwrap(), dropped(7));
        assert_eq!(stream.resume_point(), ResumePoint { last_seq: Some(7), sent_seq: Some(7), ..begun });
    }

    #[tokio::test]
    async fn the_address_and_a_message_carry_the_configuration() {
        let url = fake::serve(|mut connection: Connection| async move {
            let told = connection.text().await.unwrap();
            let uri = connection.uri.clone();
            connection
                .say(&ServerMessage::Error { seq: None, problem: fake::problem(&format!("{uri} {told}")) })
                .await;
        });
        let configure = Configure {
            robot: Some("wall e".into()),
            mode: Some(Mode::Lossless),
            filter: Some(FilterChoice::With(FilterSettings { trust: 0.5 })),
            ..Configure::default()
        };
        let mut stream = client(&url.await).stream(&configure).await.unwrap();
        let ServerMessage::Error { problem, .. } = stream.receive().await.unwrap() else {
            panic!("no error")
        };
        assert_eq!(
            problem.detail,
            r#"/v1/stream?robot=wall+e&mode=lossless&filter=true {"type":"configure","filter":{"trust":0.5}}"#
        );
    }

    #[tokio::test]
    async fn a_stream_goes_on_after_its_last_answer() {
        let url = fake::serve(|mut connection: Connection| async move {
            let seq = if connection.uri.ends_with("session=fake&last_seq=4&sent_seq=0") { 5 } else { 4 };
            connection.say(&dropped(seq)).await;
        });
        let client = client(&url.await);
        let mut stream = client.stream(&Configure::default()).await.unwrap();
        stream.send(vec![0]).await.unwrap();
        assert_eq!(stream.receive().await.unwrap(), dropped(4));
        let mut stream = client.resume(&stream.resume_point()).await.unwrap();
        assert_eq!(stream.receive().await.unwrap(), dropped(5));
    }

    #[tokio::test]
    async fn a_refusal_and_a_close_are_told_apart() {
        let url = fake::serve(|mut connection: Connection| async move {
            connection.close(1001, "draining").await;
        });
        let url = url.await;
        let mut stream = client(&url).stream(&Configure::default()).await.unwrap();
        let error = stream.receive().await.unwrap_err();
        assert!(
            matches!(&error, ClientError::Closed { code: 1001, reason } if reason == "draining"),
            "{error}"
        );
        let error = Client::new(&url, None).unwrap().stream(&Configure::default()).await.unwrap_err();
        let ClientError::Refused { problem, .. } = error else { panic!("{error}") };
        assert_eq!(problem.detail, NO_KEY);
    }
}
