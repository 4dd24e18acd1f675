//! Messages as they travel, which are read and written elsewhere.

use bytes::Bytes;
use rustdds::RepresentationIdentifier;
use rustdds::no_key::{Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter};
use std::convert::Infallible;

/// Bytes before a message: two that say how it is represented, two of options.
const HEAD_BYTES: usize = 4;

/// The representations that ROS 2 uses, by what stands for them before a message.
const REPRESENTATIONS: [(RepresentationIdentifier, [u8; HEAD_BYTES]); 2] =
    [(RepresentationIdentifier::CDR_LE, [0, 1, 0, 0]), (RepresentationIdentifier::CDR_BE, [0, 0, 0, 0])];

/// A message with its head.
#[derive(Clone, Debug)]
pub(super) struct Plain(pub(super) Vec<u8>);

/// Takes messages as they are.
pub(super) struct AsItIs;

/// The same for one message.
#[derive(Clone)]
pub(super) struct Taking;

impl DeserializerAdapter<Plain> for AsItIs {
    type Error = Infallible;
    type Decoded = Plain;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        const SUPPORTED: [RepresentationIdentifier; 2] = [REPRESENTATIONS[0].0, REPRESENTATIONS[1].0];
        &SUPPORTED
    }

    fn transform_decoded(decoded: Plain) -> Plain {
        decoded
    }
}

impl DefaultDecoder<Plain> for AsItIs {
    type Decoder = Taking;
    const DECODER: Taking = Taking;
}

impl Decode<'_, Plain> for Taking {
    type Error = Infallible;

    fn decode_bytes(self, bytes: &[u8], encoding: RepresentationIdentifier) -> Result<Plain, Infallible> {
        let named = REPRESENTATIONS.iter().find(|(representation, _)| *representation == encoding);
        let head = named.map_or(REPRESENTATIONS[0].1, |(_, head)| *head);
        Ok(Plain([&head, bytes].concat()))
    }
}

impl SerializerAdapter<Plain> for AsItIs {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(message: &Plain) -> Result<Bytes, Infallible> {
        Ok(Bytes::copy_from_slice(message.0.get(HEAD_BYTES..).unwrap_or_default()))
    }
}
