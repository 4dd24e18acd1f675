//! Topics over zenoh, as `rmw_zenoh` names them (its docs/design.md): messages under the domain, the topic, its type and the
//! type's hash, an attachment to each, and a token for every node, publisher and subscription, by which others know of them.

mod keys;

use super::{OnMessage, Options, Quality, ZenohOptions};
use crate::error::RosError;
use crate::types::MessageType;
use keys::{Entity, Kind, Naming};
use ring::digest::{SHA256, digest};
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;
use zenoh::Config;
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::CongestionControl;

/// The settings of a session as `rmw_zenoh` has them: it knows the router and whom the router knows, and asks nobody else.
const SETTINGS: &str = r#"{
    mode: "peer",
    listen: { endpoints: ["tcp/localhost:0"] },
    scouting: { multicast: { enabled: false } },
    timestamping: { enabled: true },
}"#;

/// A session, and its one node.
pub(super) struct Session {
    session: zenoh::Session,
    naming: Naming,
    next_id: AtomicU64,
    _node: LivelinessToken,
}

/// Ends with this.
pub(super) struct Subscription {
    _messages: zenoh::pubsub::Subscriber<()>,
    _token: LivelinessToken,
}

pub(super) struct Publisher {
    messages: zenoh::pubsub::Publisher<'static>,
    _token: LivelinessToken,
    /// Which publisher it is, 16 bytes.
    id: [u8; 16],
    n_published: AtomicI64,
}

fn told(error: impl std::fmt::Display) -> RosError {
    RosError::Zenoh(error.to_string())
}

fn settings(options: &ZenohOptions) -> Result<Config, RosError> {
    if let Some(path) = &options.config {
        return Config::from_file(path).map_err(told);
    }
    let mut config = Config::from_json5(SETTINGS).map_err(told)?;
    let endpoints = serde_json::json!([options.router]).to_string();
    config.insert_json5("connect/endpoints", &endpoints).map_err(told)?;
    Ok(config)
}

impl Session {
    pub(super) async fn open(options: &Options, zenoh: &ZenohOptions) -> Result<Self, RosError> {
        let session = zenoh::open(settings(zenoh)?).await.map_err(told)?;
        let naming =
            Naming { domain: options.domain, session: session.zid().to_string(), node: options.node.clone() };
        let node = session.liveliness().declare_token(naming.node_token()).await.map_err(told)?;
        // The node itself is number 0.
        Ok(Self { session, naming, next_id: AtomicU64::new(1), _node: node })
    }

    /// The key of a token of something new.
    fn key(&self, kind: Kind, topic: &str, message: &MessageType, quality: Quality) -> String {
        let id = self.next_id.fetch_add(1, Ordering::Relaxed);
        self.naming.token(&Entity { kind, id, topic, message, quality })
    }

    async fn token(&self, key: String) -> Result<LivelinessToken, RosError> {
        self.session.liveliness().declare_token(key).await.map_err(told)
    }

    pub(super) async fn subscribe(
        &self,
        topic: &str,
        message: &MessageType,
        quality: Quality,
        on_message: OnMessage,
    ) -> Result<Subscription, RosError> {
        // Called by one thread at a time, which zenoh does not promise to the compiler.
        let on_message = Mutex::new(on_message);
        let messages = self
            .session
            .declare_subscriber(self.naming.messages_of_any_hash(topic, message))
            .callback(move |sample| {
                let message = sample.payload().to_bytes().into_owned();
                on_message.lock().unwrap_or_else(PoisonError::into_inner)(Ok(message));
            })
            .await
            .map_err(told)?;
        let token = self.token(self.key(Kind::Subscription, topic, message, quality)).await?;
        Ok(Subscription { _messages: messages, _token: token })
    }

    pub(super) async fn publisher(
        &self,
        topic: &str,
        message: &MessageType,
        quality: Quality,
    ) -> Result<Publisher, RosError> {
        let messages = self
            .session
            .declare_publisher(self.naming.messages(topic, message))
            // Who does not keep up misses some: nobody else waits for them.
            .congestion_control(CongestionControl::Drop)
            .await
            .map_err(told)?;
        let key = self.key(Kind::Publisher, topic, message, quality);
        // Others tell publishers apart by it, and compare it with nothing else.
        let mut id = [0; 16];
        id.copy_from_slice(&digest(&SHA256, key.as_bytes()).as_ref()[..16]);
        let token = self.token(key).await?;
        Ok(Publisher { messages, _token: token, id, n_published: AtomicI64::new(0) })
    }
}

impl Publisher {
    pub(super) async fn publish(&self, message: Vec<u8>) -> Result<(), RosError> {
        let sequence = self.n_published.fetch_add(1, Ordering::Relaxed) + 1;
        let attachment = keys::attachment(sequence, SystemTime::now(), &self.id);
        self.messages.put(message).attachment(attachment).await.map_err(told)
    }
}
