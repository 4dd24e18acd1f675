//! The spans of streamed frames, for traces.

use tracing::{Span, debug_span};

/// The spans of a streamed frame. A stream lasts for hours, so that each of its frames is a trace of its own,
/// which names the stream's span as its cause.
pub struct FrameSpans {
    frame: Span,
    queue: Span,
}

impl FrameSpans {
    /// A frame begins to wait.
    pub fn begin(seq: u64) -> Self {
        let frame = debug_span!(parent: None, "frame", seq);
        frame.follows_from(Span::current());
        Self { queue: debug_span!(parent: &frame, "queue"), frame }
    }

    /// It waits no longer: the span in which it is looked at.
    pub fn taken(self) -> Span {
        drop(self.queue);
        self.frame
    }
}
