//! Messages as they are sent.

use roomsight_protocol::stream::ServerMessage;
use tokio_tungstenite::tungstenite::Utf8Bytes;

/// A message as it is sent.
pub fn text(message: &ServerMessage) -> Utf8Bytes {
    // Plain values always have a JSON form.
    serde_json::to_string(message).unwrap_or_default().into()
}
