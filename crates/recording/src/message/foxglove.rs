//! The messages of Foxglove (<https://docs.foxglove.dev/docs/visualization/message-schemas>) that hold pictures.

use crate::error::MessageError;
use crate::topic::Encoding;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use prost::Message;
use serde::{Deserialize, Deserializer};

/// `google.protobuf.Timestamp`; in JSON `{"sec": ..., "nsec": ...}`.
#[derive(Clone, Copy, PartialEq, Message, Deserialize)]
pub(super) struct Time {
    #[prost(int64, tag = "1")]
    #[serde(rename = "sec")]
    seconds: i64,
    #[prost(int32, tag = "2")]
    #[serde(rename = "nsec")]
    nanoseconds: i32,
}

impl Time {
    /// Since 1970; none where nobody set it.
    pub(super) fn nanoseconds(self) -> Option<u64> {
        let seconds = u64::try_from(self.seconds).ok()?.checked_mul(1_000_000_000)?;
        seconds.checked_add(u64::try_from(self.nanoseconds).ok()?).filter(|stamp_ns| *stamp_ns > 0)
    }
}

/// What all of them begin with; the rest is passed over.
#[derive(Clone, PartialEq, Message, Deserialize)]
pub(super) struct Stamped {
    #[prost(message, optional, tag = "1")]
    #[serde(default)]
    pub(super) timestamp: Option<Time>,
}

/// `foxglove.CompressedImage`.
#[derive(Clone, PartialEq, Message, Deserialize)]
pub(super) struct CompressedImage {
    #[prost(message, optional, tag = "1")]
    #[serde(default)]
    pub(super) timestamp: Option<Time>,
    #[prost(bytes = "vec", tag = "2")]
    #[serde(deserialize_with = "base64_bytes")]
    pub(super) data: Vec<u8>,
    #[prost(string, tag = "3")]
    #[serde(default)]
    pub(super) format: String,
    #[prost(string, tag = "4")]
    #[serde(default)]
    pub(super) frame_id: String,
}

/// `foxglove.RawImage`.
#[derive(Clone, PartialEq, Message, Deserialize)]
pub(super) struct RawImage {
    #[prost(message, optional, tag = "1")]
    #[serde(default)]
    pub(super) timestamp: Option<Time>,
    #[prost(fixed32, tag = "2")]
    pub(super) width: u32,
    #[prost(fixed32, tag = "3")]
    pub(super) height: u32,
    #[prost(string, tag = "4")]
    pub(super) encoding: String,
    #[prost(fixed32, tag = "5")]
    pub(super) step: u32,
    #[prost(bytes = "vec", tag = "6")]
    #[serde(deserialize_with = "base64_bytes")]
    pub(super) data: Vec<u8>,
    #[prost(string, tag = "7")]
    #[serde(default)]
    pub(super) frame_id: String,
}

fn base64_bytes<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
    let text = String::deserialize(deserializer)?;
    BASE64_STANDARD.decode(text).map_err(serde::de::Error::custom)
}

/// A message in protocol buffers or in JSON.
pub(super) fn read<T: Message + Default + for<'de> Deserialize<'de>>(
    encoding: Encoding,
    message: &[u8],
) -> Result<T, MessageError> {
    match encoding {
        Encoding::Json => {
            serde_json::from_slice(message).map_err(|error| MessageError::Damaged(error.to_string()))
        }
        _ => T::decode(message).map_err(|error| MessageError::Damaged(error.to_string())),
    }
}
