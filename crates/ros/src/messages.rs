//! The messages that are published.

use crate::cdr::Writer;

/// `std_msgs/msg/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// In nanoseconds since 1970.
    pub stamp_ns: u64,
    /// The frame of coordinates.
    pub frame_id: String,
}

/// `roomsight_msgs/msg/RoomAnswer`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RoomAnswer {
    /// The stamp and the frame of the picture that is answered.
    pub header: Header,
    /// What the pictures up to this one say together.
    pub room: String,
    /// Whether that can be acted on.
    pub known: bool,
    /// From 0 to 1.
    pub probability: f32,
    /// What the picture says by itself.
    pub frame_room: String,
    /// Whether that can be acted on.
    pub frame_known: bool,
    /// From 0 to 1.
    pub frame_probability: f32,
    /// Why the picture is not known; empty where it is.
    pub unknown: String,
    /// How probable a place is that was never trained, from 0 to 1; no number where the model cannot tell.
    pub novelty: f32,
    /// Of every room, what the pictures up to this one say together.
    pub probabilities: Vec<RoomProbability>,
    /// What answered.
    pub model: String,
}

/// `roomsight_msgs/msg/RoomProbability`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RoomProbability {
    /// The room.
    pub room: String,
    /// From 0 to 1.
    pub probability: f32,
}

/// `diagnostic_msgs/msg/DiagnosticArray`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Diagnostics {
    /// When it was so.
    pub header: Header,
    /// What is told.
    pub status: Vec<Status>,
}

/// `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Status {
    /// How bad it is.
    pub level: Level,
    /// What it is of.
    pub name: String,
    /// What it is.
    pub message: String,
    /// Numbers and texts by their names.
    pub values: Vec<(String, String)>,
}

/// How bad something is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// All is well.
    Ok = 0,
    /// It may be well.
    Warning = 1,
    /// It is not.
    Error = 2,
}

impl Header {
    fn write(&self, writer: &mut Writer) {
        let (seconds, nanoseconds) = (self.stamp_ns / 1_000_000_000, self.stamp_ns % 1_000_000_000);
        writer.i32(i32::try_from(seconds).unwrap_or(i32::MAX));
        writer.u32(nanoseconds as u32);
        writer.text(&self.frame_id);
    }
}

impl RoomAnswer {
    /// The message as it travels.
    pub fn to_cdr(&self) -> Vec<u8> {
        let mut writer = Writer::new();
        self.header.write(&mut writer);
        for (room, known, probability) in [
            (&self.room, self.known, self.probability),
            (&self.frame_room, self.frame_known, self.frame_probability),
        ] {
            writer.text(room);
            writer.bool(known);
            writer.f32(probability);
        }
        writer.text(&self.unknown);
        writer.f32(self.novelty);
        writer.length(self.probabilities.len());
        for RoomProbability { room, probability } in &self.probabilities {
            writer.text(room);
            writer.f32(*probability);
        }
        writer.text(&self.model);
        writer.into_bytes()
    }
}

impl Diagnostics {
    /// The message as it travels.
    pub fn to_cdr(&self) -> Vec<u8> {
        let mut writer = Writer::new();
        self.header.write(&mut writer);
        writer.length(self.status.len());
        for status in &self.status {
            writer.u8(status.level as u8);
            writer.text(&status.name);
            writer.text(&status.message);
            // It is of no device.
            writer.text("");
            writer.length(status.values.len());
            for (key, value) in &status.values {
                writer.text(key);
                writer.text(value);
            }
        }
        writer.into_bytes()
    }
}
