//! What messages tell: pictures, poses, texts.
//!
//! | file | what |
//! |---|---|
//! | `picture` | pictures, packed or not |
//! | `pixels` | pixels as cameras have them, to a picture that every decoder reads |
//! | `foxglove` | the messages of Foxglove, in protocol buffers and JSON |
//! | `pose` | where a robot is |

mod foxglove;
mod picture;
mod pixels;
mod pose;

pub use picture::Picture;
pub use pose::{Located, located};

use crate::fields::Fields;
use crate::topic::{Encoding, Kind, Topic};

/// Why a message tells nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MessageError {
    /// It ends too early.
    #[error("a message ends before what it should hold")]
    Short,
    /// Fields lie in a way that is not read.
    #[error("a message is written in a representation that is not read ({0:02x?}): plain CDR is")]
    Representation([u8; 2]),
    /// A message of another type is asked for a picture or the like.
    #[error("messages of the type {0} are not read")]
    Type(String),
    /// Pixels that are not read.
    #[error("pictures of the encoding `{0}` are not read: {1}")]
    Pixels(String, &'static str),
    /// Fewer pixels than the message says.
    #[error("a picture of {width} x {height} pixels, {step} bytes a row, has {n_bytes} bytes")]
    TooFewPixels {
        /// In pixels.
        width: u32,
        /// In pixels.
        height: u32,
        /// Bytes from a row to the next.
        step: u32,
        /// That are there.
        n_bytes: usize,
    },
    /// No protocol buffer, or no JSON.
    #[error("a message is damaged: {0}")]
    Damaged(String),
}

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
        Kind::FoxgloveCompressedImage | Kind::FoxgloveRawImage => Ok(Picture::read(topic, message)?.stamp_ns),
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
