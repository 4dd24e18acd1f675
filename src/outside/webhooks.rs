//! What happens to robots and models, told to addresses by POST.
//!
//! Each address has a bounded queue and a task of its own. What cannot be delivered is tried again, with pauses that grow, and
//! given up after a bounded number of tries.

use super::patience::Patience;
use crate::engine::Engine;
use crate::engine::metrics::{Metrics, WebhookOutcome};
use crate::settings::Secret;
use bytes::Bytes;
use reqwest::redirect::Policy;
use reqwest::{Client, StatusCode, Url};
use ring::hmac;
use roomsight_protocol::event::Event;
use roomsight_protocol::training::TrainingState;
use serde::Serialize;
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tokio::sync::mpsc::{self, Receiver};
use tokio::task::JoinSet;
use tokio::time::sleep;

/// How many events may wait for one address.
const N_WAITING: usize = 256;
/// How long an address may take to answer.
const ANSWER_TIME: Duration = Duration::from_secs(10);
/// How often it is tried to deliver one event: for two minutes and what the answers take.
const MAX_TRIES: u32 = 8;
const DELIVERY: &str = "roomsight-delivery";
const TIMESTAMP: &str = "roomsight-timestamp";
const SIGNATURE: &str = "roomsight-signature";

/// An event as it is told, the same to all addresses and with every try.
struct Delivery {
    id: String,
    body: Bytes,
}

/// The body.
#[derive(Serialize)]
struct Told<'a> {
    /// The same as in the header.
    delivery: &'a str,
    at: String,
    #[serde(flatten)]
    event: &'a Event,
}

/// What brings events to one address.
struct Courier {
    http: Client,
    url: Url,
    secret: Option<hmac::Key>,
    metrics: Arc<Metrics>,
}

/// How a try ended.
enum Try {
    Delivered,
    /// Another try would end in the same way.
    Refused(StatusCode),
    Failed(String),
}

/// Tells all addresses for ever; nothing where there are none.
pub async fn tell(engine: &Engine) {
    let settings = &engine.settings;
    let (mut queues, mut couriers) = (Vec::new(), JoinSet::new());
    for url in &settings.webhooks {
        let courier = match Courier::new(url, &settings.webhook_secret, engine.metrics.clone()) {
            Ok(courier) => courier,
            Err(error) => {
                tracing::error!(%error, "a webhook cannot be told");
                continue;
            }
        };
        let (queue, waiting) = mpsc::channel(N_WAITING);
        couriers.spawn(courier.run(waiting));
        queues.push(queue);
    }
    if queues.is_empty() {
        return;
    }
    let mut events = engine.events.subscribe_to_changes();
    while let Some(event) = events.next().await {
        if !is_told(&event) {
            continue;
        }
        let Some(delivery) = Delivery::new(&event) else { continue };
        let delivery = Arc::new(delivery);
        for queue in &queues {
            if queue.try_send(delivery.clone()).is_err() {
                engine.metrics.webhook(WebhookOutcome::Dropped);
            }
        }
    }
}

/// Whether addresses hear of it: not of every stream that begins.
fn is_told(event: &Event) -> bool {
    match event {
        Event::RobotLost(_)
        | Event::RobotFound(_)
        | Event::RoomChanged(_)
        | Event::ModelChanged { .. }
        | Event::SwapFailed { .. } => true,
        Event::Training { state, .. } => *state != TrainingState::Running,
        Event::Answer(_)
        | Event::RobotJoined(_)
        | Event::RobotLeft(_)
        | Event::InboxChanged { .. }
        | Event::SetChanged { .. }
        | Event::Lost { .. } => false,
    }
}

impl Delivery {
    fn new(event: &Event) -> Option<Self> {
        let mut random = [0; 16];
        getrandom::fill(&mut random).ok()?;
        let id: String = random.iter().map(|byte| format!("{byte:02x}")).collect();
        let at = humantime::format_rfc3339_millis(SystemTime::now()).to_string();
        let body = serde_json::to_vec(&Told { delivery: &id, at, event }).ok()?.into();
        Some(Self { id, body })
    }
}

impl Courier {
    fn new(url: &str, secret: &Secret, metrics: Arc<Metrics>) -> Result<Self, Box<dyn std::error::Error>> {
        let url = Url::parse(url)?;
        let builder = match url.scheme() {
            "https" => roomsight_client::https(ANSWER_TIME)?,
            _ => roomsight_client::http(ANSWER_TIME),
        };
        // An address that leads elsewhere is not what the operator has set.
        let http = builder.redirect(Policy::none()).build()?;
        let secret = secret.reveal();
        let secret = (!secret.is_empty()).then(|| hmac::Key::new(hmac::HMAC_SHA256, secret.as_bytes()));
        Ok(Self { http, url, secret, metrics })
    }

    async fn run(self, mut waiting: Receiver<Arc<Delivery>>) {
        while let Some(delivery) = waiting.recv().await {
            let outcome = self.deliver(&delivery).await;
            self.metrics.webhook(outcome);
        }
    }

    async fn deliver(&self, delivery: &Delivery) -> WebhookOutcome {
        let mut patience = Patience::default();
        loop {
            let why = match self.attempt(delivery).await {
                Try::Delivered => return WebhookOutcome::Delivered,
                Try::Refused(status) => {
                    tracing::warn!(host = self.url.host_str(), %status, "a webhook does not take what it is told");
                    return WebhookOutcome::Refused;
                }
                Try::Failed(why) => why,
            };
            let pause = patience.pause();
            if patience.n_failed() >= MAX_TRIES {
                tracing::warn!(host = self.url.host_str(), why, "a webhook cannot be told");
                return WebhookOutcome::Failed;
            }
            tracing::debug!(host = self.url.host_str(), why, "a webhook is told again later");
            self.metrics.webhook(WebhookOutcome::Retried);
            sleep(pause).await;
        }
    }

    async fn attempt(&self, Delivery { id, body }: &Delivery) -> Try {
        let timestamp = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
        let mut call = self
            .http
            .post(self.url.clone())
            .header("content-type", "application/json")
            .header("user-agent", concat!("roomsight/", env!("CARGO_PKG_VERSION")))
            .header(DELIVERY, id)
            .header(TIMESTAMP, timestamp);
        if let Some(secret) = &self.secret {
            call = call.header(SIGNATURE, signature(secret, timestamp, body));
        }
        // Nothing of the answer but its head is read.
        match call.body(body.clone()).send().await.map(|answer| answer.status()) {
            Ok(status) if status.is_success() => Try::Delivered,
            Ok(status) if may_pass(status) => Try::Failed(status.to_string()),
            Ok(status) => Try::Refused(status),
            // The address may have a secret in it.
            Err(error) => Try::Failed(error.without_url().to_string()),
        }
    }
}

fn may_pass(status: StatusCode) -> bool {
    status.is_server_error() || matches!(status, StatusCode::TOO_MANY_REQUESTS | StatusCode::REQUEST_TIMEOUT)
}

/// The HMAC-SHA256 of the timestamp, a dot and the body.
fn signature(secret: &hmac::Key, timestamp: u64, body: &[u8]) -> String {
    let mut context = hmac::Context::with_key(secret);
    context.update(timestamp.to_string().as_bytes());
    context.update(b".");
    context.update(body);
    let digits: String = context.sign().as_ref().iter().map(|byte| format!("{byte:02x}")).collect();
    format!("v1={digits}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As `printf '1700000000.{}' | openssl dgst -sha256 -hmac secret` says.
    #[test]
    fn a_signature_is_what_others_compute() {
        let secret = hmac::Key::new(hmac::HMAC_SHA256, b"secret");
        let expected = "v1=b8569b78799ff9e3cbff0fc2d63a33a2b57f3282abd07c37ae5e8e7d79a5f163";
        assert_eq!(signature(&secret, 1_700_000_000, b"{}"), expected);
    }

    #[test]
    fn only_what_may_pass_is_tried_again() {
        let passes = [500, 502, 503, 429, 408].map(|status| StatusCode::from_u16(status).unwrap());
        let stays = [301, 307, 400, 401, 404, 410].map(|status| StatusCode::from_u16(status).unwrap());
        assert!(passes.into_iter().all(may_pass) && !stays.into_iter().any(may_pass));
    }

    #[test]
    fn an_event_is_told_with_its_fields() {
        let delivery = Delivery::new(&Event::SwapFailed {
            model: "lab".into(),
            change: "latest".into(),
            reason: "it is damaged".into(),
        });
        let delivery = delivery.unwrap();
        let told: serde_json::Value = serde_json::from_slice(&delivery.body).unwrap();
        assert_eq!(
            (told["delivery"].as_str(), told["type"].as_str()),
            (Some(&*delivery.id), Some("swap_failed"))
        );
        assert!(told["at"].is_string() && told["model"] == "lab");
    }
}
