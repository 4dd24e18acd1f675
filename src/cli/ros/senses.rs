//! What else the robot senses: scans of its laser and its odometry, found by the time of a picture.

use super::Node;
use super::recent::Recent;
use roomsight_lab::dataset::scan_of;
use roomsight_recognition::model::{Pose, Scan};
use roomsight_recording::message::{Located, located, stamp_ns};
use roomsight_recording::{Encoding, Topic};
use roomsight_ros::{LASER_SCAN, MessageType, ODOMETRY, Quality, Subscription};
use std::sync::Arc;

/// As laser scanners and wheels publish: what is lost is old, and some wait for their picture.
const SENSOR: Quality = Quality { is_reliable: false, depth: 10 };

/// What was sensed lately.
pub(super) struct Senses {
    scans: Arc<Recent<Arc<Scan>>>,
    odometry: Arc<Recent<Pose>>,
    _subscriptions: Vec<Subscription>,
}

/// A topic whose messages are in the representation of DDS.
pub(super) fn topic_of(name: &str, message: &MessageType) -> Topic {
    let (name, type_name) = (name.to_owned(), message.name.to_owned());
    Topic { name, type_name, encoding: Encoding::Cdr, n_messages: None }
}

impl Senses {
    /// Hears what is wanted.
    pub(super) async fn subscribe(node: &Node, laser: bool, odometry: bool) -> anyhow::Result<Self> {
        let mut subscriptions = Vec::new();
        let scans = Arc::new(Recent::new());
        if laser {
            subscriptions.push(
                hear(node, "scan", &LASER_SCAN, Arc::clone(&scans), |topic, message| {
                    scan_of(topic, message).ok().map(Arc::new)
                })
                .await?,
            );
        }
        let kept = Arc::new(Recent::new());
        if odometry {
            subscriptions.push(hear(node, "odom", &ODOMETRY, Arc::clone(&kept), pose_of).await?);
        }
        Ok(Self { scans, odometry: kept, _subscriptions: subscriptions })
    }

    /// What the laser measured about then.
    pub(super) fn scan(&self, at_ns: u64) -> Option<Arc<Scan>> {
        self.scans.at(at_ns)
    }

    /// Where the wheels were about then.
    pub(super) fn odometry(&self, at_ns: u64) -> Option<Pose> {
        self.odometry.at(at_ns)
    }
}

/// Keeps what the messages of a topic hold; those that cannot be read are as if they had not come.
async fn hear<T: Clone + Send + Sync + 'static>(
    node: &Node,
    name: &str,
    message: &'static MessageType,
    kept: Arc<Recent<T>>,
    read: fn(&Topic, &[u8]) -> Option<T>,
) -> anyhow::Result<Subscription> {
    let name = node.topic(name)?;
    let topic = topic_of(&name, message);
    let on_message = move |heard: Result<Vec<u8>, String>| {
        if let Ok(bytes) = heard
            && let Ok(Some(at_ns)) = stamp_ns(&topic, &bytes)
            && let Some(what) = read(&topic, &bytes)
        {
            kept.add(at_ns, what);
        }
    };
    Ok(node.session.subscribe(&name, message, SENSOR, Box::new(on_message)).await?)
}

fn pose_of(topic: &Topic, message: &[u8]) -> Option<Pose> {
    let Located { x, y, yaw, .. } = located(topic, message).ok()?.pop()?;
    Some(Pose { x, y, angle: yaw })
}
