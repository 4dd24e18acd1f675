//! Under what topics robots are told, and how Home Assistant finds them.

use serde_json::{Value, json};

/// What is kept at the broker while the service is connected to it, and what while it is not.
pub const ONLINE: &str = "online";
pub const OFFLINE: &str = "offline";

/// All topics of one service.
#[derive(Clone)]
pub struct Topics {
    prefix: String,
    discovery: String,
}

impl Topics {
    /// Those that the settings `mqtt_prefix` and `mqtt_discovery` name.
    pub fn new(prefix: &str, discovery: &str) -> Self {
        Self { prefix: prefix.to_owned(), discovery: discovery.to_owned() }
    }

    /// Whether the service is there.
    pub fn status(&self) -> String {
        format!("{}/status", self.prefix)
    }

    /// Something of a robot.
    pub fn of_robot(&self, robot: &str, what: &str) -> String {
        format!("{}/robots/{}/{what}", self.prefix, part(robot))
    }

    /// What Home Assistant is told of a robot: topics and what is kept under them. None where it is to be told nothing.
    pub fn discovery(&self, robot: &str) -> Vec<(String, Value)> {
        if self.discovery.is_empty() {
            return Vec::new();
        }
        let id = format!("{}_{}", self.prefix.replace('/', "_"), part(robot));
        let device = json!({
            "identifiers": [id], "name": robot, "manufacturer": "roomsight", "sw_version": env!("CARGO_PKG_VERSION")
        });
        let availability = json!([
            {"topic": self.status()}, {"topic": self.of_robot(robot, "availability")}
        ]);
        let entity = |kind: &str, what: &str, own: Value| {
            let mut config = json!({
                "unique_id": format!("{id}_{what}"), "object_id": format!("{id}_{what}"), "device": device,
                "availability": availability, "availability_mode": "all"
            });
            if let (Some(config), Value::Object(own)) = (config.as_object_mut(), own) {
                config.extend(own);
            }
            (format!("{}/{kind}/{id}/{what}/config", self.discovery), config)
        };
        let flag = |field: &str| format!("{{{{ 'ON' if value_json.{field} else 'OFF' }}}}");
        let state = self.of_robot(robot, "state");
        vec![
            entity(
                "sensor",
                "room",
                json!({"name": "Room", "icon": "mdi:map-marker", "state_topic": self.of_robot(robot, "room"),
                    "json_attributes_topic": state}),
            ),
            entity(
                "binary_sensor",
                "lost",
                json!({"name": "Lost", "device_class": "problem", "state_topic": state,
                    "value_template": flag("lost")}),
            ),
            entity(
                "binary_sensor",
                "known",
                json!({"name": "Room known", "state_topic": state, "value_template": flag("known")}),
            ),
        ]
    }
}

/// A robot's name as a part of a topic. Where it has characters that mean something there or that Home Assistant does not take,
/// a digest keeps it apart from others.
fn part(robot: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_');
    if robot.chars().all(is_plain) {
        return robot.to_owned();
    }
    let plain: String = robot.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
    format!("{plain}_{}", &blake3::hash(robot.as_bytes()).to_hex()[..8])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_parts_of_topics_that_differ() {
        let topics = Topics::new("roomsight", "homeassistant");
        assert_eq!(topics.of_robot("wall-e", "room"), "roomsight/robots/wall-e/room");
        let strange = ["a/b", "a+b", "a#b", "a b", "küche"].map(|name| topics.of_robot(name, "room"));
        for topic in &strange {
            assert!(
                topic.is_ascii() && topic.matches('/').count() == 3 && !topic.contains(['+', '#', ' ']),
                "{topic}"
            );
        }
        assert!(strange[..4].iter().enumerate().all(|(idx, topic)| !strange[..idx].contains(topic)));
    }

    #[test]
    fn home_assistant_is_told_where_it_is_wanted() {
        assert!(Topics::new("roomsight", "").discovery("eve").is_empty());
        let told = Topics::new("home/rooms", "homeassistant").discovery("eve");
        let topics: Vec<&str> = told.iter().map(|(topic, _)| topic.as_str()).collect();
        assert_eq!(
            topics,
            [
                "homeassistant/sensor/home_rooms_eve/room/config",
                "homeassistant/binary_sensor/home_rooms_eve/lost/config",
                "homeassistant/binary_sensor/home_rooms_eve/known/config"
            ]
        );
        assert_eq!(told[0].1["state_topic"], "home/rooms/robots/eve/room");
        assert_eq!(told[1].1["value_template"], "{{ 'ON' if value_json.lost else 'OFF' }}");
        assert_eq!(told[1].1["availability"][1]["topic"], "home/rooms/robots/eve/availability");
    }
}
