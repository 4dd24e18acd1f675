//! Topics of ROS 2 for a program without ROS: subscriptions that give messages as they travel, publishers of the room, over
//! DDS and over zenoh.
//!
//! | module | what |
//! |---|---|
//! | `session` | a node: it subscribes and publishes |
//! | `session/dds` | over DDS, by RustDDS |
//! | `session/zenoh` | over zenoh, as `rmw_zenoh` names things |
//! | `names` | names of nodes and topics |
//! | `types` | types of messages and their hashes |
//! | `messages`, `cdr` | the messages that are published; how they are written |
//! | `error` | why topics cannot be had |

mod cdr;
mod error;
mod messages;
mod names;
mod session;
mod types;

pub use error::{NameError, RosError};
pub use messages::{Diagnostics, Header, Level, RoomAnswer, RoomProbability, Status};
pub use names::{NodeName, Remap};
pub use session::{
    DdsOptions, OnMessage, Options, Publisher, Quality, Session, Subscription, Transport, ZenohOptions,
};
pub use types::{COMPRESSED_IMAGE, DIAGNOSTIC_ARRAY, IMAGE, LASER_SCAN, MessageType, ODOMETRY, ROOM_ANSWER};
