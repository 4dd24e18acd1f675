//! A node that subscribes and publishes, whichever way its messages travel.

mod dds;
mod zenoh;

use crate::error::RosError;
use crate::names::NodeName;
use crate::types::MessageType;
use std::any::Any;
use std::path::PathBuf;

/// How a node joins the others.
#[derive(Clone, Debug)]
pub struct Options {
    /// What it is called.
    pub node: NodeName,
    /// `ROS_DOMAIN_ID`, up to 232: only nodes of the same one hear each other.
    pub domain: u16,
    /// The way that messages travel.
    pub transport: Transport,
}

/// The way that messages travel.
#[derive(Clone, Debug)]
pub enum Transport {
    /// Over DDS, as with `rmw_fastrtps_cpp` and `rmw_cyclonedds_cpp`.
    Dds(DdsOptions),
    /// Over zenoh, as with `rmw_zenoh_cpp`.
    Zenoh(ZenohOptions),
}

/// How DDS is used.
#[derive(Clone, Debug, Default)]
pub struct DdsOptions {
    /// Nodes on this machine alone.
    pub localhost: bool,
    /// Up to Humble, identifiers in the graph of nodes are 24 bytes long; 16 since.
    pub has_long_ids: bool,
}

/// How zenoh is used.
#[derive(Clone, Debug)]
pub struct ZenohOptions {
    /// A file of zenoh's settings instead of the router.
    pub config: Option<PathBuf>,
    /// The address of the router, such as `tcp/localhost:7447`.
    pub router: String,
}

/// How messages of a topic are kept until they are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quality {
    /// Whether what is lost is sent again.
    pub is_reliable: bool,
    /// How many are kept; the oldest go.
    pub depth: u16,
}

/// What takes messages: in the representation of DDS, with its head. What cannot be read is told instead. It must be quick.
pub type OnMessage = Box<dyn FnMut(Result<Vec<u8>, String>) + Send + Sync>;

/// A node.
pub struct Session(Way);

enum Way {
    Dds(Box<dds::Session>),
    Zenoh(Box<zenoh::Session>),
}

/// A topic is heard as long as this lives.
pub struct Subscription {
    _heard: Box<dyn Any + Send + Sync>,
}

/// Publishes the messages of a topic.
pub struct Publisher(Spoken);

enum Spoken {
    Dds(Box<dds::Publisher>),
    Zenoh(Box<zenoh::Publisher>),
}

impl Session {
    /// Joins the nodes of a domain, whether or not there are any yet. Within a runtime of tokio of several threads.
    ///
    /// # Errors
    /// No network, settings that are none.
    pub async fn open(options: &Options) -> Result<Self, RosError> {
        let way = match &options.transport {
            Transport::Dds(dds) => Way::Dds(Box::new(dds::Session::open(options, dds)?)),
            Transport::Zenoh(zenoh) => Way::Zenoh(Box::new(zenoh::Session::open(options, zenoh).await?)),
        };
        Ok(Self(way))
    }

    /// Hears a topic by its whole name.
    ///
    /// # Errors
    /// What the transport says.
    pub async fn subscribe(
        &self,
        topic: &str,
        message: &'static MessageType,
        quality: Quality,
        on_message: OnMessage,
    ) -> Result<Subscription, RosError> {
        Ok(Subscription {
            _heard: match &self.0 {
                Way::Dds(session) => Box::new(session.subscribe(topic, message, quality, on_message)?),
                Way::Zenoh(session) => {
                    Box::new(session.subscribe(topic, message, quality, on_message).await?)
                }
            },
        })
    }

    /// Becomes a publisher of a topic by its whole name.
    ///
    /// # Errors
    /// What the transport says.
    pub async fn publisher(
        &self,
        topic: &str,
        message: &'static MessageType,
        quality: Quality,
    ) -> Result<Publisher, RosError> {
        Ok(Publisher(match &self.0 {
            Way::Dds(session) => Spoken::Dds(Box::new(session.publisher(topic, message, quality)?)),
            Way::Zenoh(session) => Spoken::Zenoh(Box::new(session.publisher(topic, message, quality).await?)),
        }))
    }
}

impl Publisher {
    /// Publishes a message in the representation of DDS.
    ///
    /// # Errors
    /// What the transport says.
    pub async fn publish(&self, message: Vec<u8>) -> Result<(), RosError> {
        match &self.0 {
            Spoken::Dds(publisher) => publisher.publish(message).await,
            Spoken::Zenoh(publisher) => publisher.publish(message).await,
        }
    }
}
