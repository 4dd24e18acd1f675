//! A robot that streams, for tests.

use crate::http::service::{SOON, Server};
use futures_util::{SinkExt, StreamExt};
use roomsight_protocol::stream::{ClientMessage, Configure, Hello, ServerMessage, StreamResult};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::http::HeaderValue;
use tokio_tungstenite::tungstenite::{self, Message};
use tokio_tungstenite::{WebSocketStream, client_async};

/// One end of a stream.
pub struct Robot {
    pub socket: WebSocketStream<TcpStream>,
    pub hello: Hello,
}

/// A message that must be a result.
pub fn result(message: ServerMessage) -> StreamResult {
    match message {
        ServerMessage::Result(result) => *result,
        other => panic!("{other:?}"),
    }
}

/// What came last on a stream.
#[derive(Debug)]
pub enum Heard {
    Message(ServerMessage),
    /// With the code, where there was one.
    Closed(Option<u16>),
}

impl Robot {
    /// Begins a stream; the query begins with `?` where it is not empty.
    pub async fn connect(server: &Server, query: &str) -> Self {
        Self::try_connect(server, query, &[]).await.expect("a stream")
    }

    /// The same with headers.
    pub async fn try_connect(
        server: &Server,
        query: &str,
        headers: &[(&'static str, &str)],
    ) -> Result<Self, tungstenite::Error> {
        Self::try_connect_to(&server.address.to_string(), query, headers).await
    }

    /// The same at an address.
    pub async fn try_connect_to(
        address: &str,
        query: &str,
        headers: &[(&'static str, &str)],
    ) -> Result<Self, tungstenite::Error> {
        let mut request = format!("ws://{address}/v1/stream{query}").into_client_request()?;
        for (name, value) in headers {
            request.headers_mut().insert(*name, HeaderValue::from_str(value).expect("a header"));
        }
        let stream = TcpStream::connect(address).await.expect("a connection");
        let (mut socket, _) = client_async(request, stream).await?;
        let hello = match heard(&mut socket).await {
            Heard::Message(ServerMessage::Hello(hello)) => *hello,
            other => panic!("{other:?}"),
        };
        Ok(Self { socket, hello })
    }

    pub async fn send(&mut self, frame: Vec<u8>) {
        self.socket.send(Message::Binary(frame.into())).await.expect("the stream is open");
    }

    /// Sends bytes as they are, which need be no message.
    pub async fn send_raw(&mut self, bytes: &[u8]) {
        tokio::io::AsyncWriteExt::write_all(self.socket.get_mut(), bytes).await.expect("the stream is open");
    }

    pub async fn say(&mut self, text: &str) {
        self.socket.send(Message::Text(text.into())).await.expect("the stream is open");
    }

    /// Configures the stream and hears that it is.
    pub async fn configure(&mut self, change: Configure) -> ServerMessage {
        let message = ClientMessage::Configure(change);
        self.say(&serde_json::to_string(&message).expect("JSON")).await;
        self.next().await
    }

    pub async fn heard(&mut self) -> Heard {
        heard(&mut self.socket).await
    }

    /// The next message; there must be one.
    pub async fn next(&mut self) -> ServerMessage {
        match self.heard().await {
            Heard::Message(message) => message,
            Heard::Closed(code) => panic!("closed with {code:?}"),
        }
    }

    /// All messages until the stream closes, and the code it closes with.
    pub async fn rest(&mut self) -> (Vec<ServerMessage>, Option<u16>) {
        let mut messages = Vec::new();
        loop {
            match self.heard().await {
                Heard::Message(message) => messages.push(message),
                Heard::Closed(code) => return (messages, code),
            }
        }
    }
}

async fn heard(socket: &mut WebSocketStream<TcpStream>) -> Heard {
    loop {
        match timeout(SOON, socket.next()).await.expect("something is heard soon") {
            Some(Ok(Message::Text(text))) => {
                return Heard::Message(serde_json::from_str(&text).expect("a message of the protocol"));
            }
            Some(Ok(Message::Close(frame))) => return Heard::Closed(frame.map(|frame| frame.code.into())),
            Some(Ok(_)) => {}
            Some(Err(_)) | None => return Heard::Closed(None),
        }
    }
}

/// A frame of a WebSocket as bytes, masked with zeros.
pub fn raw(first: u8, n_bytes: usize, payload: &[u8]) -> Vec<u8> {
    [&[first, 0xff][..], &(n_bytes as u64).to_be_bytes(), &[0; 4], payload].concat()
}

/// A message in two frames, so that nobody knows how long it will be.
pub fn in_parts(message: &[u8]) -> Vec<u8> {
    let (begin, end) = message.split_at(message.len() / 3);
    [raw(0x02, begin.len(), begin), raw(0x80, end.len(), end)].concat()
}

/// The code with which a stream is closed before it begins.
pub async fn closed_at_the_door(server: &Server, query: &str) -> u16 {
    let request = format!("ws://{}/v1/stream{query}", server.address);
    let stream = TcpStream::connect(&server.address).await.unwrap();
    let (mut socket, _) = client_async(request, stream).await.unwrap();
    match timeout(SOON, socket.next()).await.unwrap().unwrap().unwrap() {
        Message::Close(Some(frame)) => frame.code.into(),
        other => panic!("{other:?}"),
    }
}

/// The number of the frame that a message is about.
pub fn seq_of(message: &ServerMessage) -> Option<u64> {
    match message {
        ServerMessage::Result(result) => Some(result.seq),
        ServerMessage::Dropped { seq, .. } => Some(*seq),
        ServerMessage::Error { seq, .. } => *seq,
        _ => None,
    }
}
