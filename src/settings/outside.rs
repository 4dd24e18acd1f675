//! Whether what the service tells others can work: webhooks, MQTT and NATS.

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
        if let Err(reason) = self.nats.broker() {
            return wrong("nats", reason);
        }
        let is_subject = |text: &str| text.split('.').all(is_token);
        if self.nats_prefix.len() > MAX_TOPIC_BYTES || !is_subject(&self.nats_prefix) {
            return wrong(
                "nats_prefix",
                "it must be the beginning of a subject, such as roomsight or home.rooms".into(),
            );
        }
        if self.service_name.len() > MAX_TOPIC_BYTES
            || !(self.service_name.is_empty() || is_token(&self.service_name))
        {
            return wrong("service_name", "it may have letters, digits, - and _, such as cellar-2".into());
        }
        Ok(())
    }

    /// What this service is called in its fleet; `None` where the system gives no random numbers.
    pub fn name_in_fleet(&self) -> Option<String> {
        let own = Some(self.service_name.clone()).filter(|name| !name.is_empty());
        let of_machine = || {
            let name = std::env::var("HOSTNAME").ok()?;
            let port = self.listen.rsplit(':').next()?;
            Some(format!("{name}-{port}").replace(|c: char| !is_usual(c), "-")).filter(|_| !name.is_empty())
        };
        own.or_else(of_machine).or_else(|| {
            let mut random = [0; 4];
            getrandom::fill(&mut random).ok()?;
            Some(format!("service-{:08x}", u32::from_be_bytes(random)))
        })
    }
}

/// Whether it is a part of a subject of NATS.
fn is_token(text: &str) -> bool {
    !text.is_empty() && text.chars().all(is_usual)
}

/// What parts of subjects are made of.
fn is_usual(c: char) -> bool {
    c.is_ascii_alphanumeric() || matches!(c, '-' | '_')
}

const TOPIC: &str = "it must be the beginning of a topic, such as roomsight or home/roomsight";

fn is_topic(text: &str) -> bool {
    let is_part = |part: &str| !part.is_empty() && part.chars().all(|c| is_usual(c) || c == '.');
    text.len() <= MAX_TOPIC_BYTES && text.split('/').all(is_part)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(settings: &Settings) -> &'static str {
        match settings.check_outside() {
            Err(SettingsError::Wrong { name, .. }) => name,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_fleet_has_a_server_and_services_have_names() {
        assert_eq!(refused(&Settings { nats: "http://home".into(), ..Settings::default() }), "nats");
        for wrong in ["", "a..b", "a b", "a.*", ">"] {
            assert_eq!(
                refused(&Settings { nats_prefix: wrong.into(), ..Settings::default() }),
                "nats_prefix",
                "{wrong}"
            );
        }
        for wrong in ["a.b", "a b", "*", &"x".repeat(65)] {
            assert_eq!(
                refused(&Settings { service_name: wrong.into(), ..Settings::default() }),
                "service_name",
                "{wrong}"
            );
        }
        let named = Settings {
            service_name: "cellar-2".into(),
            nats_prefix: "home.rooms".into(),
            ..Settings::default()
        };
        named.check_outside().unwrap();
        assert_eq!(named.name_in_fleet().unwrap(), "cellar-2");
        let unnamed = Settings::default().name_in_fleet().unwrap();
        assert!(is_token(&unnamed), "{unnamed}");
    }

    #[test]
    fn what_cannot_be_told_is_refused_at_the_start() {
        let defaults = Settings::default();
        defaults.check_outside().unwrap();
        let hook = |url: &str| Settings { webhooks: vec![url.to_owned()], ..Settings::default() };
        hook("https://ops.lab/hook?token=1").check_outside().unwrap();
        for wrong in ["ops.lab", "ftp://ops.lab", ""] {
            assert_eq!(refused(&hook(wrong)), "webhooks", "{wrong}");
        }
        let many = vec!["http://ops.lab".to_owned(); MAX_WEBHOOKS + 1];
        assert_eq!(refused(&Settings { webhooks: many, ..Settings::default() }), "webhooks");
        assert_eq!(refused(&Settings { mqtt: "http://home".into(), ..Settings::default() }), "mqtt");
        for wrong in ["", "/a", "a/", "a//b", "a/#", "a b"] {
            let settings = Settings { mqtt_prefix: wrong.to_owned(), ..Settings::default() };
            assert_eq!(refused(&settings), "mqtt_prefix", "{wrong}");
        }
        Settings { mqtt_discovery: String::new(), ..Settings::default() }.check_outside().unwrap();
        assert_eq!(
            refused(&Settings { mqtt_discovery: "+".to_owned(), ..Settings::default() }),
            "mqtt_discovery"
        );
    }

    #[test]
    fn secrets_that_change_are_told_by_name_and_not_shown() {
        let with = |secret: &str, mqtt: &str| Settings {
            webhook_secret: secret.into(),
            mqtt: mqtt.into(),
            ..Settings::default()
        };
        let (old, new) = (with("one", "mqtt://me:one@home"), with("other", "mqtt://me:other@home"));
        assert_eq!(old.changes_to(&new).unwrap(), ["webhook_secret", "mqtt"]);
        assert!(old.changes_to(&old).unwrap().is_empty());
        let shown = old.to_toml().unwrap();
        assert!(shown.contains("(hidden)") && !shown.contains("one"), "{shown}");
    }
}
