//! A broker of MQTT is told where robots are, also after it was away. Skipped, and said so, where Mosquitto is not installed.

use crate::http::command::free_address;
use crate::http::service::{SOON, Server, known_room, pgm, success};
use roomsight::settings::Settings;
use rumqttc::{AsyncClient, Event, MqttOptions, Packet, QoS};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use tempfile::TempDir;
use tokio::time::{sleep, timeout};

/// A broker that runs.
struct Broker {
    child: Child,
    folder: TempDir,
    address: String,
}

impl Broker {
    async fn start() -> Option<Self> {
        Self::start_at(free_address()).await
    }

    async fn start_at(address: String) -> Option<Self> {
        let folder = TempDir::new().unwrap();
        let (host, port) = address.split_once(':').unwrap();
        let config = format!("listener {port} {host}\nallow_anonymous true\npersistence false\nuser root\n");
        let file = folder.path().join("mosquitto.conf");
        fs::write(&file, config).unwrap();
        let program = ["/usr/sbin/mosquitto", "/usr/bin/mosquitto", "/usr/local/sbin/mosquitto"]
            .into_iter()
            .find(|program| Path::new(program).exists());
        let Some(program) = program else {
            eprintln!("LEFT OUT: the broker of MQTT. It takes Mosquitto, Debian's package mosquitto.");
            return None;
        };
        let mut command = Command::new(program);
        command.arg("-c").arg(&file).stdin(Stdio::null()).stderr(Stdio::null());
        let broker = Self { child: command.spawn().unwrap(), folder, address };
        let listens = async {
            while TcpStream::connect(&broker.address).is_err() {
                sleep(Duration::from_millis(20)).await;
            }
        };
        timeout(SOON, listens).await.expect("it listens");
        Some(broker)
    }

    /// Ends it; everything that it kept is gone.
    fn stop(mut self) -> String {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
        self.folder.path().metadata().unwrap();
        std::mem::take(&mut self.address)
    }

    /// What is kept at it, once it is as it must be.
    async fn until(&self, is_so: impl Fn(&BTreeMap<String, String>) -> bool) -> BTreeMap<String, String> {
        let (host, port) = self.address.split_once(':').unwrap();
        let (client, mut connection) =
            AsyncClient::new(MqttOptions::new("reader", host, port.parse().unwrap()), 8);
        client.subscribe("#", QoS::AtLeastOnce).await.unwrap();
        let mut kept = BTreeMap::new();
        let read = async {
            while !is_so(&kept) {
                if let Event::Incoming(Packet::Publish(message)) = connection.poll().await.unwrap() {
                    kept.insert(message.topic, String::from_utf8(message.payload.to_vec()).unwrap());
                }
            }
        };
        let is_read = timeout(SOON, read).await.is_ok();
        assert!(is_read, "{kept:?}");
        kept
    }
}

impl Drop for Broker {
    fn drop(&mut self) {
        // One that was stopped is not there any more.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

async fn recognize(server: &Server, robot: &str, frame: Vec<u8>) {
    success(server.post(&format!("/v1/recognize?robot={robot}"), frame).send().await.unwrap()).await;
}

fn is(kept: &BTreeMap<String, String>, topic: &str, payload: &str) -> bool {
    kept.get(topic).is_some_and(|kept| kept == payload)
}

#[tokio::test(flavor = "multi_thread")]
async fn rooms_are_kept_at_the_broker_and_told_again_when_it_comes_back() {
    let Some(broker) = Broker::start().await else { return };
    let settings = Settings {
        mqtt: format!("mqtt://me:secret@{}", broker.address).as_str().into(),
        lost_after_ms: 1,
        ..Settings::default()
    };
    let server = Server::start_sure(settings).await;
    recognize(&server, "wall-e", known_room(0)).await;
    recognize(&server, "a%2Fb", known_room(0)).await;
    let kept = broker
        .until(|kept| {
            is(kept, "roomsight/robots/wall-e/room", "stripes")
                && kept.contains_key("roomsight/robots/wall-e/state")
                && kept
                    .keys()
                    .any(|topic| topic.starts_with("roomsight/robots/a_b_") && topic.ends_with("/room"))
        })
        .await;
    assert!(
        is(&kept, "roomsight/status", "online")
            && is(&kept, "roomsight/robots/wall-e/availability", "online")
    );
    let state: Value = serde_json::from_str(&kept["roomsight/robots/wall-e/state"]).unwrap();
    assert_eq!(
        (&state["room"], &state["known"], &state["lost"]),
        (&"stripes".into(), &true.into(), &false.into())
    );
    let config: Value =
        serde_json::from_str(&kept["homeassistant/sensor/roomsight_wall-e/room/config"]).unwrap();
    assert_eq!(config["state_topic"], "roomsight/robots/wall-e/room");
    // A room is told at once.
    recognize(&server, "wall-e", known_room(1)).await;
    broker.until(|kept| is(kept, "roomsight/robots/wall-e/room", "bars")).await;
    for _ in 0..2 {
        recognize(&server, "wall-e", pgm(96, 72, |_, _| 128)).await;
        sleep(Duration::from_millis(5)).await;
    }
    let lost = |kept: &BTreeMap<String, String>| {
        kept.get("roomsight/robots/wall-e/state").is_some_and(|state| state.contains(r#""lost":true"#))
    };
    let kept = broker.until(lost).await;
    assert!(is(&kept, "roomsight/robots/wall-e/room", "bars"), "where it was last known to be");
    // Nobody waits for a broker that is away, and one that comes back without memory is told all of it.
    let address = broker.stop();
    recognize(&server, "wall-e", known_room(2)).await;
    let broker = Broker::start_at(address).await.unwrap();
    broker
        .until(|kept| {
            is(kept, "roomsight/robots/wall-e/room", "dots") && is(kept, "roomsight/status", "online")
        })
        .await;
    let scrape = server.get("/metrics").send().await.unwrap().text().await.unwrap();
    assert!(scrape.contains("\nroomsight_mqtt_connected 1\n"), "{scrape}");
    // When the service is gone the broker says so.
    let mut server = server;
    server.stop();
    server.stopped().await;
    broker.until(|kept| is(kept, "roomsight/status", "offline")).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_broker_that_is_not_there_is_in_nobodys_way() {
    let settings = Settings { mqtt: "mqtt://127.0.0.1:1".into(), ..Settings::default() };
    let server = Server::start(settings).await;
    recognize(&server, "wall-e", known_room(0)).await;
    let scrape = server.get("/metrics").send().await.unwrap().text().await.unwrap();
    assert!(scrape.contains("\nroomsight_mqtt_connected 0\n"), "{scrape}");
}
