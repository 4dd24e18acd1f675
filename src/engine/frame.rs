//! An encoded frame, and the memory that it holds.

use bytes::Bytes;
use std::sync::Arc;

/// What is told of a frame without a byte.
pub const EMPTY_FRAME: &str =
    "the body is empty; send the image itself, for example with `curl --data-binary @frame.jpg`";

/// The bytes of one frame, and their share of the memory for bodies.
pub struct Frame {
    pub bytes: Bytes,
    /// Gives the memory back when it is dropped.
    held: Arc<dyn Send + Sync>,
}

impl Frame {
    /// Bytes whose memory is `held`.
    pub fn new(bytes: Bytes, held: impl Send + Sync + 'static) -> Self {
        Self { bytes, held: Arc::new(held) }
    }

    /// Bytes that are a part of these, or were decoded from them: they share their memory.
    pub fn part(&self, bytes: Bytes) -> Self {
        Self { bytes, held: self.held.clone() }
    }
}
