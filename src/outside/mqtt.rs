//! Where robots are, kept at a broker of MQTT: for home automation, where that needs no code.
//!
//! What is kept follows the robots: a room at once, the rest of a robot's state every few seconds at most. After each
//! connection all of it is told again, since the broker may have forgotten it.

use super::patience::Patience;
use super::topics::{OFFLINE, ONLINE, Topics};
use crate::engine::Engine;
use crate::engine::events::Reader;
use crate::engine::robots::{Revision, RobotRecord};
use crate::settings::Broker;
use roomsight_protocol::event::{Event, RobotState};
use rumqttc::{AsyncClient, ClientError, EventLoop, LastWill, MqttOptions, Packet, QoS};
use std::collections::{BTreeMap, BTreeSet};
use std::convert::Infallible;
use std::time::{Duration, Instant};
use tokio::sync::watch;
use tokio::time::{sleep, timeout};

/// How often the rest of a robot's state is told at most.
const STATE_INTERVAL: Duration = Duration::from_secs(5);
const KEEP_ALIVE: Duration = Duration::from_secs(30);
/// How many messages may wait for the connection.
const N_WAITING: usize = 64;
/// The longest message that the broker may send: it is asked for none.
const MAX_PACKET_BYTES: usize = 16 << 10;
const QOS: QoS = QoS::AtLeastOnce;

/// Tells the broker for ever; nothing where there is none.
pub async fn tell(engine: &Engine) {
    let Ok(Some(broker)) = engine.settings.mqtt.broker() else { return };
    let topics = Topics::new(&engine.settings.mqtt_prefix, &engine.settings.mqtt_discovery);
    let Some(options) = options(&broker, &topics) else { return };
    let (client, connection) = AsyncClient::new(options, N_WAITING);
    // Counts connections; none while there is none.
    let connections = watch::Sender::new(None);
    let teller = Teller {
        engine,
        topics,
        client,
        events: engine.events.subscribe_to_changes(),
        rooms: BTreeMap::new(),
        told: BTreeMap::new(),
    };
    tokio::select! {
        never = connect(engine, connection, &connections) => match never {},
        never = teller.run(connections.subscribe()) => match never {},
    }
}

fn options(Broker { host, port, user }: &Broker, topics: &Topics) -> Option<MqttOptions> {
    let mut random = [0; 4];
    getrandom::fill(&mut random).ok()?;
    let id = format!("roomsight-{:08x}", u32::from_be_bytes(random));
    let mut options = MqttOptions::new(id, host, *port);
    options.set_keep_alive(KEEP_ALIVE);
    options.set_max_packet_size(MAX_PACKET_BYTES, MAX_PACKET_BYTES);
    options.set_last_will(LastWill::new(topics.status(), OFFLINE, QOS, true));
    if let Some((name, password)) = user {
        options.set_credentials(name, password.reveal());
    }
    Some(options)
}

/// Keeps the connection for ever, with pauses that grow where it cannot be had.
async fn connect(
    engine: &Engine,
    mut connection: EventLoop,
    connections: &watch::Sender<Option<u64>>,
) -> Infallible {
    let (mut n_connections, mut patience) = (0, Patience::default());
    loop {
        match connection.poll().await {
            Ok(rumqttc::Event::Incoming(Packet::ConnAck(_))) => {
                n_connections += 1;
                patience = Patience::default();
                engine.metrics.beside().broker(true);
                connections.send_replace(Some(n_connections));
                tracing::info!("the broker of MQTT is connected");
            }
            Ok(_) => {}
            Err(error) => {
                engine.metrics.beside().broker(false);
                connections.send_replace(None);
                match patience.n_failed() {
                    0 => tracing::warn!(%error, "the broker of MQTT is not connected; it is tried again"),
                    _ => tracing::debug!(%error, "the broker of MQTT is not connected"),
                }
                sleep(patience.pause()).await;
            }
        }
    }
}

/// What tells the broker.
struct Teller<'a> {
    engine: &'a Engine,
    topics: Topics,
    client: AsyncClient,
    events: Reader,
    /// The last known room of each robot.
    rooms: BTreeMap<String, String>,
    /// What was told of each robot over this connection.
    told: BTreeMap<String, Told>,
}

/// What was told of one robot.
#[derive(Default)]
struct Told {
    /// What is kept under which topic.
    kept: BTreeMap<String, String>,
    /// Its state, and when that was told.
    state: Option<(Revision, Urgent, Instant)>,
}

/// The part of a state that is told at once.
#[derive(PartialEq)]
struct Urgent {
    room: Option<String>,
    lost: bool,
    connected: bool,
}

impl Teller<'_> {
    async fn run(mut self, mut connections: watch::Receiver<Option<u64>>) -> Infallible {
        loop {
            // The sender outlives this, so that it only waits.
            let _ = connections.wait_for(Option::is_some).await;
            connections.mark_unchanged();
            self.told.clear();
            tokio::select! {
                Err(error) = self.follow() => tracing::error!(%error, "the broker of MQTT is told nothing more"),
                _ = connections.changed() => {}
            }
        }
    }

    /// Tells what changes, for as long as the connection stands.
    async fn follow(&mut self) -> Result<Infallible, ClientError> {
        self.client.publish(self.topics.status(), QOS, true, ONLINE).await?;
        loop {
            self.tell_all().await?;
            if let Ok(Some(event)) = timeout(STATE_INTERVAL, self.events.next()).await
                && let Event::RoomChanged(change) = &*event
                && let Some(robot) = &change.who.robot
            {
                self.rooms.insert(robot.clone(), change.to.clone());
            }
        }
    }

    /// Tells of all robots with names what the broker does not know yet.
    async fn tell_all(&mut self) -> Result<(), ClientError> {
        let records = self.engine.robots.all();
        let named = records.iter().filter_map(|record| Some((record.robot()?, record)));
        // Of two streams with one name the younger one has it.
        let by_name: BTreeMap<String, &RobotRecord> = named
            .filter(|(robot, record)| record.id() == *robot)
            .map(|(robot, record)| (robot, &**record))
            .collect();
        for (robot, record) in &by_name {
            self.tell_of(robot, record).await?;
        }
        let gone: BTreeSet<String> =
            self.told.keys().filter(|robot| !by_name.contains_key(*robot)).cloned().collect();
        for robot in gone {
            self.rooms.remove(&robot);
            for topic in self.told.remove(&robot).unwrap_or_default().kept.into_keys() {
                // What is empty is kept no longer.
                self.client.publish(topic, QOS, true, "").await?;
            }
        }
        Ok(())
    }

    async fn tell_of(&mut self, robot: &str, record: &RobotRecord) -> Result<(), ClientError> {
        let (now, revision) = (Instant::now(), record.revision(Instant::now()));
        let told = self.told.entry(robot.to_owned()).or_default();
        if told.state.as_ref().is_some_and(|(told, ..)| *told == revision) {
            return Ok(());
        }
        let state = self.engine.robots.state(record);
        if state.known
            && let Some(room) = &state.room
        {
            self.rooms.insert(robot.to_owned(), room.clone());
        }
        let room = self.rooms.get(robot).cloned();
        let urgent = Urgent { room: room.clone(), lost: state.lost, connected: state.connected };
        let mut wanted = Vec::new();
        if told.kept.is_empty() {
            let discovery = self.topics.discovery(robot).into_iter();
            wanted.extend(discovery.map(|(topic, config)| (topic, config.to_string())));
        }
        let availability = if state.connected { ONLINE } else { OFFLINE };
        wanted.push((self.topics.of_robot(robot, "availability"), availability.to_owned()));
        wanted.extend(room.map(|room| (self.topics.of_robot(robot, "room"), room)));
        let is_due = told
            .state
            .as_ref()
            .is_none_or(|(_, before, at)| *before != urgent || now.duration_since(*at) >= STATE_INTERVAL);
        if is_due {
            wanted.push((self.topics.of_robot(robot, "state"), state_json(&state)));
            told.state = Some((revision, urgent, now));
        }
        for (topic, payload) in wanted {
            if told.kept.get(&topic) != Some(&payload) {
                self.client.publish(&topic, QOS, true, payload.as_str()).await?;
                told.kept.insert(topic, payload);
            }
        }
        Ok(())
    }
}

/// Plain values always have a JSON form.
fn state_json(state: &RobotState) -> String {
    serde_json::to_string(state).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;

    #[test]
    fn a_broker_is_called_as_the_settings_say() {
        let topics = Topics::new("roomsight", "");
        let settings = Settings { mqtt: "mqtt://me:secret@home:1884".into(), ..Settings::default() };
        let broker = settings.mqtt.broker().unwrap().unwrap();
        let options = options(&broker, &topics).unwrap();
        assert_eq!(options.broker_address(), ("home".to_owned(), 1884));
        let login = options.credentials().unwrap();
        assert_eq!((login.username.as_str(), login.password.as_str()), ("me", "secret"));
        assert_eq!(options.last_will().unwrap().topic, "roomsight/status");
    }
}
