//! The first message of a connection.

use super::Session;
use roomsight_protocol::stream::{Hello, Mode, SUBPROTOCOL, ServerMessage, StreamLimits};

impl Session {
    /// What a robot hears first; it is told once what became of the filter of a stream that was elsewhere.
    pub(super) fn hello(&mut self, resumed: bool) -> ServerMessage {
        let filter = self.taken_over.take();
        let settings = &self.engine.settings;
        ServerMessage::Hello(Box::new(Hello {
            protocol: SUBPROTOCOL.to_owned(),
            session: self.identity.session.clone(),
            stream: self.identity.stream.clone(),
            resumed,
            filter,
            resume: self.token(),
            next_seq: self.next_seq,
            settings: self.settings.clone(),
            limits: StreamLimits {
                max_frame_bytes: settings.max_frame_bytes,
                max_frame_pixels: settings.max_frame_pixels,
                window: settings.stream_window,
                idle_timeout_ms: settings.stream_idle_timeout_ms,
                message_timeout_ms: settings.stream_message_timeout_ms,
                resume_ms: settings.stream_resume_ms,
            },
            modes: vec![Mode::Latest, Mode::Lossless, Mode::Sampled],
            model: self.teller.model().clone(),
            rooms: self.teller.rooms().to_vec(),
        }))
    }
}
