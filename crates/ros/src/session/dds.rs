//! Topics over DDS, as ROS 2 names them there (design.ros2.org, "Topic and Service name mapping to DDS").

mod graph;
mod plain;

use super::{DdsOptions, OnMessage, Options, Quality};
use crate::error::RosError;
use crate::types::MessageType;
use futures_util::StreamExt;
use graph::Graph;
use plain::{AsItIs, Plain};
use rustdds::no_key::{DataWriter, SimpleDataReader};
use rustdds::policy::{Durability, History, Reliability};
use rustdds::{DomainParticipant, DomainParticipantBuilder, Duration, QosPolicies, QosPolicyBuilder};
use rustdds::{RTPSEntity, Topic, TopicKind};
use std::net::Ipv4Addr;
use std::pin::pin;
use std::sync::{Mutex, PoisonError};
use tokio::task::{AbortHandle, spawn};

/// What stands before the names of topics.
const PREFIX: &str = "rt";

/// How long a publisher waits for one that hears it and has no room.
const MAX_BLOCKING: Duration = Duration::from_millis(100);

/// A participant of a domain, and its one node.
pub(super) struct Session {
    participant: DomainParticipant,
    publisher: rustdds::Publisher,
    subscriber: rustdds::Subscriber,
    graph: Mutex<Graph>,
}

/// Ends with this.
pub(super) struct Subscription(AbortHandle);

pub(super) struct Publisher(DataWriter<Plain, AsItIs>);

fn told(error: impl std::fmt::Display) -> RosError {
    RosError::Dds(error.to_string())
}

fn policies(quality: Quality) -> QosPolicyBuilder {
    let reliability = if quality.is_reliable {
        Reliability::Reliable { max_blocking_time: MAX_BLOCKING }
    } else {
        Reliability::BestEffort
    };
    QosPolicyBuilder::new()
        .reliability(reliability)
        .durability(Durability::Volatile)
        .history(History::KeepLast { depth: i32::from(quality.depth) })
}

impl Session {
    pub(super) fn open(options: &Options, dds: &DdsOptions) -> Result<Self, RosError> {
        let mut builder = DomainParticipantBuilder::new(options.domain);
        if dds.localhost {
            builder = builder.with_only_networks([Ipv4Addr::LOCALHOST]);
        }
        let participant = builder.build().map_err(told)?;
        let policies = policies(Quality { is_reliable: true, depth: 1 }).build();
        let publisher = participant.create_publisher(&policies).map_err(told)?;
        let subscriber = participant.create_subscriber(&policies).map_err(told)?;
        let graph = Mutex::new(Graph::new(&participant, &publisher, &options.node, dds.has_long_ids)?);
        Ok(Self { participant, publisher, subscriber, graph })
    }

    fn topic(&self, topic: &str, message: &MessageType, policies: &QosPolicies) -> Result<Topic, RosError> {
        let (name, message) = (format!("{PREFIX}{topic}"), message.dds_name());
        self.participant.create_topic(name, message, policies, TopicKind::NoKey).map_err(told)
    }

    pub(super) fn subscribe(
        &self,
        topic: &str,
        message: &MessageType,
        quality: Quality,
        mut on_message: OnMessage,
    ) -> Result<Subscription, RosError> {
        let policies = policies(quality).build();
        let topic = self.topic(topic, message, &policies)?;
        let reader: SimpleDataReader<Plain, AsItIs> =
            self.subscriber.create_simple_datareader_no_key(&topic, Some(policies)).map_err(told)?;
        self.graph.lock().unwrap_or_else(PoisonError::into_inner).add_reader(reader.guid())?;
        let hearing = spawn(async move {
            let mut messages = pin!(reader.as_async_stream());
            while let Some(message) = messages.next().await {
                on_message(message.map(|message| message.into_value().0).map_err(|error| error.to_string()));
            }
        });
        Ok(Subscription(hearing.abort_handle()))
    }

    pub(super) fn publisher(
        &self,
        topic: &str,
        message: &MessageType,
        quality: Quality,
    ) -> Result<Publisher, RosError> {
        let policies = policies(quality).build();
        let topic = self.topic(topic, message, &policies)?;
        let writer: DataWriter<Plain, AsItIs> =
            self.publisher.create_datawriter_no_key(&topic, Some(policies)).map_err(told)?;
        self.graph.lock().unwrap_or_else(PoisonError::into_inner).add_writer(writer.guid())?;
        Ok(Publisher(writer))
    }
}

impl Drop for Subscription {
    fn drop(&mut self) {
        self.0.abort();
    }
}

impl Publisher {
    pub(super) async fn publish(&self, message: Vec<u8>) -> Result<(), RosError> {
        self.0.async_write(Plain(message), None).await.map_err(told)
    }
}
