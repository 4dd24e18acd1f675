//! The keys under which `rmw_zenoh` looks for messages, nodes and what they have.

use crate::names::NodeName;
use crate::session::Quality;
use crate::types::MessageType;
use std::time::SystemTime;

/// Where tokens lie.
const TOKENS: &str = "@ros2_lv";

/// An enclave that is not used, and every name that is empty: no part of a key may be.
const EMPTY: &str = "%";

/// What the keys of one node have in common.
#[derive(Clone, Debug)]
pub(super) struct Naming {
    pub(super) domain: u16,
    /// The number of the session, in hexadecimal digits.
    pub(super) session: String,
    pub(super) node: NodeName,
}

/// What a node has.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entity<'a> {
    pub(super) kind: Kind,
    /// Its number among those of the node.
    pub(super) id: u64,
    pub(super) topic: &'a str,
    pub(super) message: &'a MessageType,
    pub(super) quality: Quality,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Publisher,
    Subscription,
}

impl Naming {
    /// Where messages are published.
    pub(super) fn messages(&self, topic: &str, message: &MessageType) -> String {
        self.messages_of(topic, message, &message.hash())
    }

    /// Where messages are heard: also of those who hash types otherwise, or, up to Humble, not at all.
    pub(super) fn messages_of_any_hash(&self, topic: &str, message: &MessageType) -> String {
        self.messages_of(topic, message, "*")
    }

    fn messages_of(&self, topic: &str, message: &MessageType, hash: &str) -> String {
        format!("{}/{}/{}/{hash}", self.domain, topic.trim_matches('/'), message.dds_name())
    }

    /// What says that the node is there.
    pub(super) fn node_token(&self) -> String {
        self.beginning(0, "NN")
    }

    /// What says that the node has something.
    pub(super) fn token(&self, entity: &Entity) -> String {
        let kind = match entity.kind {
            Kind::Publisher => "MP",
            Kind::Subscription => "MS",
        };
        format!(
            "{}/{}/{}/{}/{}",
            self.beginning(entity.id, kind),
            mangled(entity.topic),
            entity.message.dds_name(),
            entity.message.hash(),
            quality(entity.quality)
        )
    }

    fn beginning(&self, id: u64, kind: &str) -> String {
        let (namespace, name) = (mangled(self.node.namespace()), mangled(self.node.name()));
        format!("{TOKENS}/{}/{}/0/{id}/{kind}/{EMPTY}/{namespace}/{name}", self.domain, self.session)
    }
}

fn mangled(name: &str) -> String {
    name.replace('/', EMPTY)
}

/// Quality as tokens tell it: what is as usual is left out, but for the depth. Reliability, durability, history and depth,
/// deadline, lifespan, liveliness.
fn quality(quality: Quality) -> String {
    let reliability = if quality.is_reliable { "" } else { "2" };
    format!("{reliability}::,{}:,:,:,,", quality.depth)
}

/// What travels beside a message: its number, when it was sent, by whom.
pub(super) fn attachment(sequence: i64, at: SystemTime, publisher: &[u8; 16]) -> Vec<u8> {
    let since = at.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let nanoseconds = i64::try_from(since.as_nanos()).unwrap_or(i64::MAX);
    let length = [publisher.len() as u8];
    [&sequence.to_le_bytes()[..], &nanoseconds.to_le_bytes(), &length, publisher].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::COMPRESSED_IMAGE;
    use std::time::Duration;

    #[test]
    fn keys_are_those_of_rmw_zenoh() {
        let node = NodeName::new("/robot1", "roomsight").unwrap();
        let naming = Naming { domain: 7, session: "abc".to_owned(), node };
        let hash = COMPRESSED_IMAGE.hash();
        assert_eq!(naming.node_token(), "@ros2_lv/7/abc/0/0/NN/%/%robot1/roomsight");
        let message = &COMPRESSED_IMAGE;
        assert_eq!(
            naming.messages("/robot1/image", message),
            format!("7/robot1/image/sensor_msgs::msg::dds_::CompressedImage_/{hash}")
        );
        let quality = Quality { is_reliable: false, depth: 1 };
        let entity = Entity { kind: Kind::Subscription, id: 3, topic: "/robot1/image", message, quality };
        assert_eq!(
            naming.token(&entity),
            format!(
                "@ros2_lv/7/abc/0/3/MS/%/%robot1/roomsight/%robot1%image/sensor_msgs::msg::dds_::CompressedImage_/{hash}/2::,1:,:,:,,"
            )
        );
    }

    #[test]
    fn an_attachment_has_33_bytes() {
        let at = SystemTime::UNIX_EPOCH + Duration::from_nanos(0x0102);
        let expected = [&[7, 0, 0, 0, 0, 0, 0, 0, 2, 1, 0, 0, 0, 0, 0, 0, 16][..], &[9; 16]].concat();
        assert_eq!(attachment(7, at, &[9; 16]), expected);
    }
}
