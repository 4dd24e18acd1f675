//! A service that does what a test wants, to see clients by themselves.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use futures_util::{SinkExt, StreamExt};
use reqwest::header::{AUTHORIZATION, SEC_WEBSOCKET_PROTOCOL};
use roomsight_protocol::header::Header;
use roomsight_protocol::rest::{Answer, ModelName, ProblemBody, TimingsMs};
use roomsight_protocol::stream::{
    Hello, Mode, SUBPROTOCOL, ServerMessage, StreamLimits, StreamResult, StreamSettings,
};
use tokio::net::{TcpListener, TcpStream};
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tokio_tungstenite::tungstenite::http::{HeaderValue, StatusCode};
use tokio_tungstenite::tungstenite::protocol::CloseFrame;

/// What callers without a key are told.
pub const NO_KEY: &str = "send a key";

/// A stream that has been opened, after its `hello`.
pub struct Connection {
    socket: WebSocketStream<TcpStream>,
    /// Path and query of the upgrade.
    pub uri: String,
}

/// Hands every stream that is opened to `answer`; returns the address. Callers without a key are refused.
pub async fn serve<A, F>(answer: A) -> String
where
    A: Fn(Connection) -> F + Send + 'static,
    F: Future<Output = ()> + Send + 'static,
{
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    tokio::spawn(async move {
        loop {
            let (stream, _) = listener.accept().await.unwrap();
            if let Some(connection) = Connection::open(stream).await {
                tokio::spawn(answer(connection));
            }
        }
    });
    url
}

impl Connection {
    #[allow(clippy::result_large_err, reason = "the library's own type")]
    async fn open(stream: TcpStream) -> Option<Self> {
        let mut uri = String::new();
        let greet = |request: &Request, mut response: Response| {
            uri = request.uri().to_string();
            if request.headers().get(AUTHORIZATION).is_none() {
                let body = serde_json::to_string(&problem(NO_KEY)).unwrap();
                let mut refusal = ErrorResponse::new(Some(body));
                *refusal.status_mut() = StatusCode::UNAUTHORIZED;
                return Err(refusal);
            }
            response.headers_mut().insert(SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(SUBPROTOCOL));
            Ok(response)
        };
        let socket = tokio_tungstenite::accept_hdr_async(stream, greet).await.ok()?;
        let mut connection = Self { socket, uri };
        connection.say(&ServerMessage::Hello(Box::new(hello()))).await;
        Some(connection)
    }

    /// Sends a message.
    pub async fn say(&mut self, message: &ServerMessage) {
        let text = serde_json::to_string(message).unwrap();
        // A test may end while it is being answered.
        let _ = self.socket.send(Message::text(text)).await;
    }

    /// The next frame; none when the client has left.
    pub async fn frame(&mut self) -> Option<(Option<Header>, Vec<u8>)> {
        loop {
            if let Message::Binary(message) = self.socket.next().await?.ok()? {
                let header = Header::split(&message).unwrap();
                let start = header.map_or(0, |header| header.n_bytes());
                return Some((header, message[start..].to_vec()));
            }
        }
    }

    /// The next text; none when the client has left.
    pub async fn text(&mut self) -> Option<String> {
        loop {
            if let Message::Text(text) = self.socket.next().await?.ok()? {
                return Some(text.to_string());
            }
        }
    }

    /// Closes the stream with this code and reason.
    pub async fn close(&mut self, code: u16, reason: &str) {
        let frame = CloseFrame { code: code.into(), reason: reason.into() };
        let _ = self.socket.close(Some(frame)).await;
    }
}

/// A problem with this detail.
pub fn problem(detail: &str) -> ProblemBody {
    ProblemBody {
        r#type: "/problems/test".into(),
        title: "Wrong".into(),
        status: 400,
        detail: detail.into(),
        request_id: "fake".into(),
    }
}

/// An answer that every frame may get.
pub fn result(seq: u64, room: &str) -> ServerMessage {
    let answer = Answer {
        room: room.into(),
        known: true,
        unknown: None,
        novelty: Some(0.0),
        probability: 1.0,
        probabilities: vec![],
        model: model(),
        keypoints: 9,
        damaged_rows: 0,
        timings_ms: TimingsMs { queue: 0.0, decode: 0.0, features: 0.0, classify: 0.0 },
        request_id: "fake".into(),
        robot: None,
        captured_at: None,
        evidence: None,
        nearest: None,
        pose: None,
    };
    ServerMessage::Result(Box::new(StreamResult {
        seq,
        answer,
        filtered: None,
        age_ms: Some(1.0),
        notice: None,
        resume: None,
    }))
}

fn model() -> ModelName {
    ModelName { name: "fake".into(), version: 1, epoch: 1, digest: "0".into() }
}

fn hello() -> Hello {
    Hello {
        protocol: SUBPROTOCOL.into(),
        session: "fake".into(),
        stream: "known as fake".into(),
        resumed: false,
        filter: None,
        resume: None,
        next_seq: 0,
        settings: StreamSettings {
            robot: None,
            model: "fake".into(),
            mode: Mode::Latest,
            interval_ms: None,
            sure_interval_ms: None,
            filter: None,
            deadline_ms: None,
            top: None,
            explain: false,
        },
        limits: StreamLimits {
            max_frame_bytes: 1 << 20,
            max_frame_pixels: 1 << 20,
            window: 8,
            idle_timeout_ms: 1000,
            message_timeout_ms: 1000,
            resume_ms: 1000,
        },
        modes: vec![Mode::Latest],
        model: model(),
        rooms: vec!["lab".into()],
    }
}
