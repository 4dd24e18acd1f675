//! Settings of which a part is nobody's business: it is left out where settings are shown.

use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use std::marker::PhantomData;
use std::net::{Ipv6Addr, SocketAddr};

/// What is shown in the place of a secret.
const HIDDEN: &str = "(hidden)";

/// A text that is shown to nobody; empty where there is none.
#[derive(Clone, Default, PartialEq, Eq, Deserialize)]
#[serde(transparent)]
pub struct Secret(String);

/// The address of a server that passes messages on, such as `mqtt://USER:PASSWORD@HOST:PORT`, of which the password is shown to
/// nobody; empty where there is none.
#[derive(Clone, Default, PartialEq, Eq, Deserialize)]
#[serde(transparent)]
pub struct ServerUrl<P>(String, #[serde(skip)] PhantomData<P>);

/// How a server is spoken to.
pub trait Protocol {
    /// What its addresses begin with.
    const SCHEME: &'static str;
    /// Those of servers that want TLS.
    const SCHEME_OF_TLS: &'static str;
    const DEFAULT_PORT: u16;
}

/// As MQTT has it.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct Mqtt;

/// As NATS has it.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct Nats;

/// The address of a broker of MQTT.
pub type BrokerUrl = ServerUrl<Mqtt>;

/// The address of a server of NATS.
pub type NatsUrl = ServerUrl<Nats>;

impl Protocol for Mqtt {
    const SCHEME: &'static str = "mqtt://";
    const SCHEME_OF_TLS: &'static str = "mqtts://";
    const DEFAULT_PORT: u16 = 1883;
}

impl Protocol for Nats {
    const SCHEME: &'static str = "nats://";
    const SCHEME_OF_TLS: &'static str = "tls://";
    const DEFAULT_PORT: u16 = 4222;
}

/// Where a server is.
#[derive(Clone, PartialEq, Eq)]
pub struct Broker {
    pub host: String,
    pub port: u16,
    /// Who the service is to it, and its password.
    pub user: Option<(String, Secret)>,
}

impl Secret {
    /// The text.
    pub fn reveal(&self) -> &str {
        &self.0
    }
}

impl From<&str> for Secret {
    fn from(text: &str) -> Self {
        Self(text.to_owned())
    }
}

impl<P> From<&str> for ServerUrl<P> {
    fn from(text: &str) -> Self {
        Self(text.to_owned(), PhantomData)
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(if self.0.is_empty() { "" } else { HIDDEN })
    }
}

impl Serialize for Secret {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{self:?}"))
    }
}

impl<P: Protocol> ServerUrl<P> {
    /// Whether there is one.
    pub fn is_set(&self) -> bool {
        !self.0.is_empty()
    }

    /// What the address says; none where there is none.
    ///
    /// # Errors
    /// Why it is no such address.
    pub fn broker(&self) -> Result<Option<Broker>, String> {
        if !self.is_set() {
            return Ok(None);
        }
        if self.0.starts_with(P::SCHEME_OF_TLS) {
            let advice = "TLS is not spoken to brokers: let a broker beside the service, which has it, pass on what it hears";
            return Err(advice.to_owned());
        }
        let scheme = P::SCHEME;
        let wrong =
            || format!("{self:?} is not {scheme}USER:PASSWORD@HOST:PORT, or the same without user or port");
        let rest = self.0.strip_prefix(scheme).ok_or_else(wrong)?.trim_end_matches('/');
        let (user, address) = match rest.rsplit_once('@') {
            Some((user, address)) => (Some(user), address),
            None => (None, rest),
        };
        let user = user.map(|user| {
            let (name, password) = user.split_once(':').unwrap_or((user, ""));
            Some((unescaped(name)?, Secret(unescaped(password)?)))
        });
        let user = user.map(|user| user.ok_or_else(wrong)).transpose()?;
        let (host, port) = host_and_port(address, P::DEFAULT_PORT).ok_or_else(wrong)?;
        Ok(Some(Broker { host, port, user }))
    }
}

impl<P: Protocol> fmt::Debug for ServerUrl<P> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Some((user, address)) = self.0.rsplit_once('@') else { return f.write_str(&self.0) };
        let user = user.strip_prefix(P::SCHEME).unwrap_or_default();
        let name = user.split_once(':').map_or(user, |(name, _)| name);
        write!(f, "{}{name}:{HIDDEN}@{address}", P::SCHEME)
    }
}

impl<P: Protocol> Serialize for ServerUrl<P> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{self:?}"))
    }
}

/// The host and the port, or the usual one.
fn host_and_port(address: &str, default_port: u16) -> Option<(String, u16)> {
    if let Ok(address) = address.parse::<SocketAddr>() {
        return Some((address.ip().to_string(), address.port()));
    }
    let bare = address.trim_start_matches('[').trim_end_matches(']');
    if bare.parse::<Ipv6Addr>().is_ok() {
        return Some((bare.to_owned(), default_port));
    }
    let (host, port) = match address.split_once(':') {
        Some((host, port)) => (host, port.parse().ok().filter(|&port| port > 0)?),
        None => (address, default_port),
    };
    let is_host = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_');
    (!host.is_empty() && host.chars().all(is_host)).then(|| (host.to_owned(), port))
}

/// A text in which `%3A` stands for a colon, and so on.
fn unescaped(text: &str) -> Option<String> {
    let mut bytes = Vec::new();
    let mut rest = text.as_bytes();
    while let [first, after @ ..] = rest {
        match (first, after) {
            (b'%', [high, low, after @ ..]) => {
                let digit = |byte: u8| char::from(byte).to_digit(16);
                bytes.push((digit(*high)? * 16 + digit(*low)?) as u8);
                rest = after;
            }
            (b'%', _) => return None,
            (&byte, after) => {
                bytes.push(byte);
                rest = after;
            }
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broker_is_told_by_its_address() {
        let told = |text: &str| {
            BrokerUrl::from(text).broker().map(|broker| {
                broker.map(|Broker { host, port, user }| {
                    (host, port, user.map(|(name, password)| format!("{name}/{}", password.reveal())))
                })
            })
        };
        let broker =
            |host: &str, port, user: Option<&str>| Ok(Some((host.to_owned(), port, user.map(str::to_owned))));
        assert_eq!(told(""), Ok(None));
        assert_eq!(told("mqtt://home"), broker("home", 1883, None));
        assert_eq!(told("mqtt://me:p%40ss%3A@home.lab:1884/"), broker("home.lab", 1884, Some("me/p@ss:")));
        assert_eq!(told("mqtt://me@10.0.0.1"), broker("10.0.0.1", 1883, Some("me/")));
        assert_eq!(told("mqtt://[::1]:99"), broker("::1", 99, None));
        assert_eq!(told("mqtt://[::1]"), broker("::1", 1883, None));
        for wrong in [
            "home",
            "http://home",
            "mqtt://",
            "mqtt://a b",
            "mqtt://home:0",
            "mqtt://home:x",
            "mqtt://home/path",
            "mqtt://%4@home",
        ] {
            assert!(told(wrong).unwrap_err().contains("is not mqtt://"), "{wrong}");
        }
        assert!(told("mqtts://home").unwrap_err().contains("TLS"));
        let of_nats = |text: &str| NatsUrl::from(text).broker().map(|server| server.unwrap().port);
        assert_eq!((of_nats("nats://home"), of_nats("nats://me:s@home:99")), (Ok(4222), Ok(99)));
        assert!(of_nats("mqtt://home").unwrap_err().contains("is not nats://"));
        assert!(of_nats("tls://home").unwrap_err().contains("TLS"));
    }

    #[test]
    fn secrets_are_not_shown() {
        let shown =
            serde_json::to_string(&(Secret::from("s3cret"), BrokerUrl::from("mqtt://me:s3cr@et@home")))
                .unwrap();
        assert_eq!(shown, r#"["(hidden)","mqtt://me:(hidden)@home"]"#);
        assert_eq!(format!("{:?} {:?}", Secret::default(), BrokerUrl::from("mqtt://home")), " mqtt://home");
    }
}
