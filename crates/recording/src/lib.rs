//! What robots record: MCAP, the databases of rosbag2, bags of ROS 1.
//!
//! A [`Recording`] is opened once, tells its [`Topic`]s, and lists the messages of those that are wanted without holding
//! any; each is then read at its place, by as many threads as like. What a message holds is told by [`message`]. Files
//! that were not ended, or are damaged, are read as far as they go, and say so ([`Recording::problems`]).
//!
//! | module | what |
//! |---|---|
//! | `recording` | a recording: a file, or a folder of rosbag2 |
//! | `file` | the files that recordings are in |
//! | `topic` | what is recorded under a name |
//! | `error` | why something cannot be read |
//! | `message`, `fields` | what messages tell; the fields of a message |
//! | `write` | recordings of JSON messages |

mod error;
mod fields;
mod file;
pub mod message;
mod recording;
mod topic;
pub mod write;

pub use error::{MessageError, RecordingError};
pub use recording::{Message, Recording, is_called_so};
pub use topic::{Encoding, Kind, Topic};
