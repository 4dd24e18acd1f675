//! What messages tell: pictures, poses, scans, texts.
//!
//! | file | what |
//! |---|---|
//! | `picture` | pictures, packed or not |
//! | `pixels` | pixels as cameras have them, to a picture that every decoder reads |
//! | `foxglove` | the messages of Foxglove, in protocol buffers and JSON |
//! | `pose` | where a robot is |
//! | `laser` | what its laser measures |

mod foxglove;
mod laser;
mod picture;
mod pixels;
mod pose;

pub use laser::{Sweep, sweep};
pub use picture::Picture;
pub use pose::{Located, located};

use crate::error::MessageError;
use crate::fields::Fields;
use crate::topic::{Encoding, Kind, Topic};
use foxglove::Time;

/// The fields of a message of ROS.
fn fields<'a>(topic: &Topic, message: &'a [u8]) -> Result<Fields<'a>, MessageError> {
    match topic.encoding {
        Encoding::Cdr => Fields::cdr(message),
        Encoding::Ros1 => Ok(Fields::packed(message)),
        _ => Err(MessageError::Type(topic.type_name.clone())),
    }
}

/// `std_msgs/Header`.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Header {
    /// In nanoseconds; none where nobody set it.
    stamp_ns: Option<u64>,
    frame_id: String,
}

impl Header {
    fn read(fields: &mut Fields, encoding: Encoding) -> Result<Self, MessageError> {
        if encoding == Encoding::Ros1 {
            // The number that ROS 1 gives each message.
            fields.u32()?;
        }
        Self::unnumbered(fields)
    }

    /// A time and a frame of coordinates, as Foxglove's messages begin too.
    fn unnumbered(fields: &mut Fields) -> Result<Self, MessageError> {
        let stamp_ns = Some(fields.time_ns()?).filter(|stamp_ns| *stamp_ns > 0);
        Ok(Self { stamp_ns, frame_id: fields.text()? })
    }
}

/// When the sender of a message says it is of, in nanoseconds by the sender's clock; `None` where it does not say.
///
/// # Errors
/// A damaged message, one of a type that is not read.
pub fn stamp_ns(topic: &Topic, message: &[u8]) -> Result<Option<u64>, MessageError> {
    match topic.kind() {
        Kind::FoxgloveCompressedImage | Kind::FoxgloveRawImage => match topic.encoding {
            Encoding::Protobuf | Encoding::Json => {
                Ok(foxglove::read::<foxglove::Stamped>(topic.encoding, message)?
                    .timestamp
                    .and_then(Time::nanoseconds))
            }
            _ => Ok(Header::unnumbered(&mut fields(topic, message)?)?.stamp_ns),
        },
        Kind::Transforms => {
            let mut fields = fields(topic, message)?;
            if fields.u32()? == 0 {
                Ok(None)
            } else {
                Ok(Header::read(&mut fields, topic.encoding)?.stamp_ns)
            }
        }
        Kind::Text | Kind::Other => Ok(None),
        _ => Ok(Header::read(&mut fields(topic, message)?, topic.encoding)?.stamp_ns),
    }
}

/// The text of a `std_msgs/String`.
///
/// # Errors
/// A damaged message, one of another type.
pub fn text(topic: &Topic, message: &[u8]) -> Result<String, MessageError> {
    match topic.kind() {
        Kind::Text => fields(topic, message)?.text(),
        _ => Err(MessageError::Type(topic.type_name.clone())),
    }
}
