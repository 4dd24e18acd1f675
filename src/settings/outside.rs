//! Whether what the service tells others can work: webhooks and MQTT.

use super::{Settings, SettingsError};
use reqwest::Url;

/// The most webhooks.
const MAX_WEBHOOKS: usize = 16;
const MAX_TOPIC_BYTES: usize = 64;

impl Settings {
    /// Checks the settings of what is told to others.
    pub(super) fn check_outside(&self) -> Result<(), SettingsError> {
        let wrong = |name, reason: String| Err(SettingsError::Wrong { name, reason });
        if self.webhooks.len() > MAX_WEBHOOKS {
            return wrong("webhooks", format!("there may be {MAX_WEBHOOKS} at most"));
        }
        for (idx, url) in self.webhooks.iter().enumerate() {
            let is_url = Url::parse(url).is_ok_and(|url| matches!(url.scheme(), "http" | "https"));
            if !is_url {
                return wrong("webhooks", format!("entry {} is no http:// or https:// address", idx + 1));
            }
        }
        if let Err(reason) = self.mqtt.broker() {
            return wrong("mqtt", reason);
        }
        if !is_topic(&self.mqtt_prefix) {
            return wrong("mqtt_prefix", TOPIC.into());
        }
        if !self.mqtt_discovery.is_empty() && !is_topic(&self.mqtt_discovery) {
            return wrong("mqtt_discovery", TOPIC.into());
        }
        Ok(())
    }
}

const TOPIC: &str = "it must be the beginning of a topic, such as roomsight or home/roomsight";

fn is_topic(text: &str) -> bool {
    let is_part = |part: &str| {
        let is_usual = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
        !part.is_empty() && part.chars().all(is_usual)
    };
    text.len() <= MAX_TOPIC_BYTES && text.split('/').all(is_part)
}
