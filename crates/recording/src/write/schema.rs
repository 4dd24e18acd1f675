//! JSON Schemas of messages, as Foxglove reads them.

use serde_json::{Value, json};

/// A number.
pub fn number() -> Value {
    json!({"type": "number"})
}

/// A text.
pub fn text() -> Value {
    json!({"type": "string"})
}

/// True or false.
pub fn flag() -> Value {
    json!({"type": "boolean"})
}

/// An object of these fields.
pub fn object(fields: &Value) -> Value {
    json!({"type": "object", "properties": fields})
}

/// A list of such.
pub fn list(of: &Value) -> Value {
    json!({"type": "array", "items": of})
}

/// A time in seconds and nanoseconds.
pub fn time() -> Value {
    object(&json!({"sec": {"type": "integer"}, "nsec": {"type": "integer"}}))
}

/// A time in nanoseconds, as messages tell it.
pub fn time_of(nanoseconds: u64) -> Value {
    json!({"sec": nanoseconds / 1_000_000_000, "nsec": nanoseconds % 1_000_000_000})
}

/// `foxglove.CompressedImage`.
pub fn compressed_image() -> Value {
    object(&json!({
        "timestamp": time(), "frame_id": text(), "format": text(),
        "data": {"type": "string", "contentEncoding": "base64"},
    }))
}

/// What is said of a picture, with these fields beside: what it says by itself, and together with those before it.
pub fn answer(beside: Value) -> Value {
    let mut fields = json!({
        "timestamp": time(), "frame_id": text(), "room": text(), "probability": number(), "known": flag(), "unknown": text(),
        "novelty": number(), "keypoints": number(), "filtered_room": text(), "filtered_probability": number(),
        "filtered_known": flag(),
    });
    if let (Value::Object(fields), Value::Object(beside)) = (&mut fields, beside) {
        fields.extend(beside);
    }
    object(&fields)
}
