//! What services of a fleet tell each other over NATS: their robots, and what happens. It is lossy, and nothing waits for it.

use crate::engine::Engine;
use crate::engine::events::Reader;
use crate::engine::fleet::TOLD_AGAIN;
use crate::engine::live::{INTERVAL, Told};
use crate::settings::Broker;
use async_nats::connection::State;
use async_nats::{Client, ConnectOptions, Event as Happening, Message, Subscriber};
use futures_util::StreamExt;
use roomsight_protocol::event::Event;
use roomsight_protocol::fleet::{FleetEvent, FleetRobots, Scope};
use serde::Serialize;
use std::time::Instant;
use tokio::time::{MissedTickBehavior, interval};

/// So many robots fit a message of the size that servers take by default, 1 MiB.
const ROBOTS_A_MESSAGE: usize = 250;
/// Tells and hears other services until this one has said that it stops; at once where there is no server.
pub async fn tell(engine: Engine) {
    let Ok(Some(server)) = engine.settings.nats.broker() else { return };
    let Some(service) = engine.settings.name_in_fleet() else { return };
    let follow = async {
        let client = connected(&engine, &server, &service).await?;
        Line { engine: &engine, client, service }.follow().await
    };
    if let Err(error) = follow.await {
        tracing::error!(%error, "no service of the fleet is told or heard");
    }
}

/// A connection that comes back by itself.
async fn connected(
    engine: &Engine,
    Broker { host, port, user }: &Broker,
    service: &str,
) -> Result<Client, async_nats::Error> {
    let metrics = engine.metrics.clone();
    let mut options = ConnectOptions::new()
        .name(format!("roomsight {service}"))
        .retry_on_initial_connect()
        .event_callback(move |happening| {
            let metrics = metrics.clone();
            async move {
                match happening {
                    Happening::Connected => {
                        metrics.beside().fleet(true);
                        tracing::info!("NATS is connected");
                    }
                    Happening::Disconnected | Happening::Closed => {
                        metrics.beside().fleet(false);
                        tracing::warn!("NATS is not connected; it is tried again");
                    }
                    other => tracing::debug!(%other, "NATS"),
                }
            }
        });
    if let Some((name, password)) = user {
        options = options.user_and_password(name.clone(), password.reveal().to_owned());
    }
    let host = if host.contains(':') { format!("[{host}]") } else { host.clone() };
    Ok(options.connect(format!("nats://{host}:{port}")).await?)
}

/// What a service tells and hears.
struct Line<'a> {
    engine: &'a Engine,
    client: Client,
    service: String,
}

impl Line<'_> {
    async fn follow(&self) -> Result<(), async_nats::Error> {
        let prefix = &self.engine.settings.nats_prefix;
        let robots = self.client.subscribe(format!("{prefix}.robots.*")).await?;
        let events = self.client.subscribe(format!("{prefix}.events.*")).await?;
        let own = self.engine.events.subscribe_to_changes();
        let rest = async {
            tokio::join!(self.hear_robots(robots), self.hear_events(events), self.tell_events(own));
            // The connection was closed for good.
            std::future::pending::<()>().await;
        };
        tokio::select! {
            () = self.tell_robots() => {}
            () = rest => {}
        }
        Ok(())
    }

    async fn hear_robots(&self, mut messages: Subscriber) {
        while let Some(message) = messages.next().await {
            if let Some((service, told)) = self.other(&message) {
                self.engine.fleet.hear(&service, told, Instant::now());
            }
        }
    }

    async fn hear_events(&self, mut messages: Subscriber) {
        while let Some(message) = messages.next().await {
            if let Some((_, FleetEvent { event })) = self.other::<FleetEvent>(&message) {
                self.engine.fleet.events.tell(event);
            }
        }
    }

    /// Another service, and what it says; what is no such message is passed over.
    fn other<T: serde::de::DeserializeOwned>(&self, message: &Message) -> Option<(String, T)> {
        let service = message.subject.rsplit('.').next().filter(|service| *service != self.service)?;
        match serde_json::from_slice(&message.payload) {
            Ok(told) => Some((service.to_owned(), told)),
            Err(error) => {
                tracing::debug!(%error, service, "a message of the fleet cannot be read");
                None
            }
        }
    }

    /// Tells of robots that changed, and of all of them from time to time.
    async fn tell_robots(&self) {
        let (mut told, mut told_all) = (Told::default(), Instant::now());
        let mut ticks = interval(INTERVAL);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                _ = ticks.tick() => {}
                () = self.engine.stopping.cancelled() => break,
            }
            // What is said to nobody is said again when somebody hears.
            if self.client.connection_state() != State::Connected {
                told = Told::default();
                continue;
            }
            if told_all.elapsed() >= TOLD_AGAIN {
                (told, told_all) = (Told::default(), Instant::now());
            }
            let Some(update) = told.update(self.engine.view(Scope::Service)) else { continue };
            let mut gone = update.gone;
            let mut robots = update.robots;
            while !robots.is_empty() || !gone.is_empty() {
                let later = robots.split_off(robots.len().min(ROBOTS_A_MESSAGE));
                let part = FleetRobots { robots, gone: std::mem::take(&mut gone), stops: false };
                self.publish("robots", &part).await;
                robots = later;
            }
        }
        let last = FleetRobots { robots: Vec::new(), gone: Vec::new(), stops: true };
        self.publish("robots", &last).await;
        // Whoever does not hear it forgets the robots by and by.
        let _ = self.client.flush().await;
    }

    /// Tells what happens here, to those who listen here too.
    async fn tell_events(&self, mut own: Reader) {
        while let Some(event) = own.next().await {
            if matches!(*event, Event::Answer(_) | Event::Lost { .. }) {
                continue;
            }
            self.engine.fleet.events.tell((*event).clone());
            if self.client.connection_state() == State::Connected {
                self.publish("events", &FleetEvent { event: (*event).clone() }).await;
            }
        }
    }

    async fn publish(&self, what: &str, message: &impl Serialize) {
        // Plain values always have a JSON form.
        let bytes = serde_json::to_vec(message).unwrap_or_default();
        let subject = format!("{}.{what}.{}", self.engine.settings.nats_prefix, self.service);
        if let Err(error) = self.client.publish(subject, bytes.into()).await {
            tracing::debug!(%error, "the fleet is not told");
        }
    }
}
