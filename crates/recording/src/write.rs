//! Recordings of JSON messages, for those who look at what was recorded, such as Foxglove.

pub mod schema;

use mcap::records::MessageHeader;
use mcap::{McapError, WriteOptions, Writer};

use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

/// What writing comes to.
pub type RecordingResult<T> = mcap::McapResult<T>;

/// Bytes of a chunk before it is packed.
const CHUNK_BYTES: u64 = 4 << 20;

/// A topic of a recording that is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel(u16);

/// Writes a recording.
pub struct JsonRecording {
    writer: Writer<BufWriter<File>>,
    n_written: BTreeMap<u16, u32>,
}

impl JsonRecording {
    /// A new file, or in the place of an old one.
    ///
    /// # Errors
    /// What the system says.
    pub fn create(path: &Path) -> RecordingResult<Self> {
        let options = WriteOptions::new()
            .library(concat!("roomsight ", env!("CARGO_PKG_VERSION")))
            .chunk_size(Some(CHUNK_BYTES))
            .compression(Some(mcap::Compression::Zstd));
        let writer = options.create(BufWriter::new(File::create(path)?))?;
        Ok(Self { writer, n_written: BTreeMap::new() })
    }

    /// A topic whose messages are of a type that a JSON Schema describes.
    ///
    /// # Errors
    /// What the system says, more than 65,535 topics.
    pub fn channel(
        &mut self,
        topic: &str,
        type_name: &str,
        schema: &serde_json::Value,
    ) -> RecordingResult<Channel> {
        let schema = self.writer.add_schema(type_name, "jsonschema", schema.to_string().as_bytes())?;
        Ok(Channel(self.writer.add_channel(schema, topic, "json", &BTreeMap::new())?))
    }

    /// Writes a message of a time in nanoseconds.
    ///
    /// # Errors
    /// What the system says.
    pub fn write(&mut self, channel: Channel, time_ns: u64, message: &impl Serialize) -> RecordingResult<()> {
        let n_written = self.n_written.entry(channel.0).or_default();
        let header = MessageHeader {
            channel_id: channel.0,
            sequence: *n_written,
            log_time: time_ns,
            publish_time: time_ns,
        };
        *n_written += 1;
        let message = serde_json::to_vec(message).map_err(|error| McapError::Io(error.into()))?;
        self.writer.write_to_known_channel(&header, &message)
    }

    /// Ends the recording, without which it has no index.
    ///
    /// # Errors
    /// What the system says.
    pub fn finish(mut self) -> RecordingResult<()> {
        self.writer.finish().map(drop)
    }
}
