//! Which node has which readers and writers, as ROS 2 tells it over DDS (`rmw_dds_common/msg/ParticipantEntitiesInfo`): what
//! `ros2 node list` shows.

use super::plain::{AsItIs, Plain};
use super::{policies, told};
use crate::cdr::Writer;
use crate::error::RosError;
use crate::names::NodeName;
use crate::session::Quality;
use rustdds::no_key::DataWriter;
use rustdds::policy::Durability;
use rustdds::{DomainParticipant, GUID, Publisher, RTPSEntity, TopicKind};

/// Where it is told.
const TOPIC: &str = "ros_discovery_info";
const TYPE: &str = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";

/// Zeros behind an identifier where these are long.
const LONG: [u8; 8] = [0; 8];

/// What is told of the one node of a participant.
pub(super) struct Graph {
    writer: DataWriter<Plain, AsItIs>,
    participant: GUID,
    node: NodeName,
    readers: Vec<GUID>,
    writers: Vec<GUID>,
    has_long_ids: bool,
}

impl Graph {
    pub(super) fn new(
        participant: &DomainParticipant,
        publisher: &Publisher,
        node: &NodeName,
        has_long_ids: bool,
    ) -> Result<Self, RosError> {
        // Those who come later are told too.
        let policies = policies(Quality { is_reliable: true, depth: 1 });
        let policies = policies.durability(Durability::TransientLocal).build();
        let topic = participant
            .create_topic(TOPIC.to_owned(), TYPE.to_owned(), &policies, TopicKind::NoKey)
            .map_err(told)?;
        let writer = publisher.create_datawriter_no_key(&topic, Some(policies)).map_err(told)?;
        let (participant, node) = (participant.guid(), node.clone());
        let graph =
            Self { writer, participant, node, readers: Vec::new(), writers: Vec::new(), has_long_ids };
        graph.tell()?;
        Ok(graph)
    }

    pub(super) fn add_reader(&mut self, reader: GUID) -> Result<(), RosError> {
        self.readers.push(reader);
        self.tell()
    }

    pub(super) fn add_writer(&mut self, writer: GUID) -> Result<(), RosError> {
        self.writers.push(writer);
        self.tell()
    }

    fn tell(&self) -> Result<(), RosError> {
        let mut message = Writer::new();
        let write_id = |message: &mut Writer, id: &GUID| {
            message.raw(&id.to_bytes());
            if self.has_long_ids {
                message.raw(&LONG);
            }
        };
        write_id(&mut message, &self.participant);
        message.length(1);
        message.text(self.node.namespace());
        message.text(self.node.name());
        for ids in [&self.readers, &self.writers] {
            message.length(ids.len());
            ids.iter().for_each(|id| write_id(&mut message, id));
        }
        self.writer.write(Plain(message.into_bytes()), None).map_err(told)
    }
}
