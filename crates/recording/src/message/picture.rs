//! Pictures in messages.

use super::foxglove::Time;
use super::pixels::{Layout, Pixels};
use super::{Header, fields, foxglove};
use crate::error::MessageError;
use crate::topic::{Encoding, Kind, Topic};

/// A picture that a robot took.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// When it was taken, in nanoseconds by the clock of the camera's driver; none where it does not say.
    pub stamp_ns: Option<u64>,
    /// The frame of coordinates of its camera.
    pub frame_id: String,
    /// The picture as a file: as the camera encoded it, or of pixels as they are, PGM or PPM.
    pub encoded: Vec<u8>,
}

impl Picture {
    /// The picture of a message.
    ///
    /// # Errors
    /// A damaged message, one of another type, pixels that are not read.
    pub fn read(topic: &Topic, message: &[u8]) -> Result<Self, MessageError> {
        match (topic.kind(), topic.encoding) {
            (Kind::CompressedImage, _) => {
                let mut fields = fields(topic, message)?;
                let header = Header::read(&mut fields, topic.encoding)?;
                let format = fields.text()?;
                Self::encoded(header, &format, fields.bytes()?.to_vec())
            }
            (Kind::Image, _) => {
                let mut fields = fields(topic, message)?;
                let header = Header::read(&mut fields, topic.encoding)?;
                let (height, width, encoding) = (fields.u32()?, fields.u32()?, fields.text()?);
                let (is_big_endian, step) = (fields.u8()? != 0, fields.u32()?);
                let layout = Layout { width, height, step, is_big_endian };
                Self::of_pixels(header, &Pixels { encoding: &encoding, layout, bytes: fields.bytes()? })
            }
            (Kind::FoxgloveCompressedImage, Encoding::Protobuf | Encoding::Json) => {
                let image: foxglove::CompressedImage = foxglove::read(topic.encoding, message)?;
                let stamp_ns = image.timestamp.and_then(Time::nanoseconds);
                let header = Header { stamp_ns, frame_id: image.frame_id };
                Self::encoded(header, &image.format, image.data)
            }
            (Kind::FoxgloveRawImage, Encoding::Protobuf | Encoding::Json) => {
                let image: foxglove::RawImage = foxglove::read(topic.encoding, message)?;
                let (stamp_ns, step) = (image.timestamp.and_then(Time::nanoseconds), image.step);
                let layout = Layout { width: image.width, height: image.height, step, is_big_endian: false };
                let pixels = Pixels { encoding: &image.encoding, layout, bytes: &image.data };
                Self::of_pixels(Header { stamp_ns, frame_id: image.frame_id.clone() }, &pixels)
            }
            // The same types as messages of ROS: a time and a frame instead of a header.
            (Kind::FoxgloveCompressedImage, _) => {
                let mut fields = fields(topic, message)?;
                let header = Header::unnumbered(&mut fields)?;
                let data = fields.bytes()?.to_vec();
                Self::encoded(header, &fields.text()?, data)
            }
            (Kind::FoxgloveRawImage, _) => {
                let mut fields = fields(topic, message)?;
                let header = Header::unnumbered(&mut fields)?;
                let (width, height, encoding) = (fields.u32()?, fields.u32()?, fields.text()?);
                let layout = Layout { width, height, step: fields.u32()?, is_big_endian: false };
                Self::of_pixels(header, &Pixels { encoding: &encoding, layout, bytes: fields.bytes()? })
            }
            _ => Err(MessageError::Type(topic.type_name.clone())),
        }
    }

    /// One that the camera, or a driver, encoded.
    fn encoded(header: Header, format: &str, encoded: Vec<u8>) -> Result<Self, MessageError> {
        if format.contains("compressedDepth") {
            return Err(MessageError::Pixels(format.to_owned(), "it is of distances, and shows nothing"));
        }
        let Header { stamp_ns, frame_id } = header;
        Ok(Self { stamp_ns, frame_id, encoded })
    }

    fn of_pixels(header: Header, pixels: &Pixels) -> Result<Self, MessageError> {
        let Header { stamp_ns, frame_id } = header;
        Ok(Self { stamp_ns, frame_id, encoded: pixels.to_pnm()? })
    }
}
