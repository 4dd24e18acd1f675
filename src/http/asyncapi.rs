//! The AsyncAPI document of the stream, made from the types of its messages.

use roomsight_protocol::event::Event;
use roomsight_protocol::stream::{ClientMessage, KEY_SUBPROTOCOL_PREFIX, SUBPROTOCOL, ServerMessage};
use serde_json::{Value, json};
use utoipa::OpenApi;

/// The schemas of all messages, collected by the means of OpenAPI.
#[derive(OpenApi)]
#[openapi(components(schemas(ClientMessage, ServerMessage, Event)))]
struct Schemas;

/// What a robot may say, by name.
const CLIENT_EXAMPLES: [(&str, &str); 3] = [
    ("lossless", r#"{"type": "configure", "robot": "wall-e", "mode": "lossless", "top": 3}"#),
    ("sampled", r#"{"type": "configure", "mode": "sampled", "interval_ms": 200, "sure_interval_ms": 2000}"#),
    ("filter", r#"{"type": "configure", "filter": {"trust": 0.5}, "deadline_ms": 300}"#),
];

/// What the service may say, by name.
const SERVER_EXAMPLES: [(&str, &str); 7] = [
    (
        "hello",
        r#"{"type": "hello", "protocol": "roomsight.v1", "session": "0f3a5d1c9b7e48262d10c4f58e93ab67",
            "stream": "c41f07d2a95be836",
            "resumed": false, "next_seq": 0,
            "settings": {"robot": "wall-e", "model": "lab", "mode": "latest", "interval_ms": null, "sure_interval_ms": null,
                "filter": {"trust": 2.0}, "deadline_ms": null, "top": null, "explain": false},
            "limits": {"max_frame_bytes": 16777216, "max_frame_pixels": 50000000, "window": 16,
                "idle_timeout_ms": 180000, "message_timeout_ms": 120000, "resume_ms": 30000},
            "modes": ["latest", "lossless", "sampled"],
            "model": {"name": "lab", "version": 1, "epoch": 1, "digest": "5f0c2a9be1d34c77"},
            "rooms": ["corridor", "kitchen"]}"#,
    ),
    (
        "configured",
        r#"{"type": "configured", "settings": {"robot": "wall-e", "model": "lab", "mode": "lossless",
            "interval_ms": null, "sure_interval_ms": null, "filter": null, "deadline_ms": null, "top": 3, "explain": false}}"#,
    ),
    (
        "result",
        r#"{"type": "result", "seq": 12, "room": "kitchen", "known": true, "novelty": 0.08, "probability": 0.75,
            "probabilities": [{"room": "kitchen", "probability": 0.75}, {"room": "corridor", "probability": 0.25}],
            "model": {"name": "lab", "version": 1, "epoch": 1, "digest": "5f0c2a9be1d34c77"}, "keypoints": 182,
            "timings_ms": {"queue": 0.05, "decode": 1.9, "features": 2.4, "classify": 0.3},
            "request_id": "c41f07d2a95be836", "robot": "wall-e",
            "filtered": {"room": "kitchen", "known": false, "novelty": 0.02, "probability": 0.875,
                "probabilities": [{"room": "kitchen", "probability": 0.875},
                    {"room": "corridor", "probability": 0.125}]},
            "age_ms": 21.5}"#,
    ),
    ("dropped", r#"{"type": "dropped", "seq": 13, "reason": "superseded"}"#),
    (
        "error",
        r#"{"type": "error", "seq": 14, "problem": {"type": "/problems/not-an-image",
            "title": "The body is not an image that can be read", "status": 422,
            "detail": "the image ends in the middle", "request_id": "c41f07d2a95be836"}}"#,
    ),
    (
        "model_changed",
        r#"{"type": "model_changed",
            "from": {"name": "lab", "version": 1, "epoch": 1, "digest": "5f0c2a9be1d34c77"},
            "to": {"name": "lab", "version": 2, "epoch": 2, "digest": "9d27e0b1440c8e5a"},
            "epoch": 2, "first_seq": 15, "filter": "kept", "rooms": ["corridor", "kitchen"]}"#,
    ),
    ("draining", r#"{"type": "draining"}"#),
];

/// The AsyncAPI 3.0 document of `GET /v1/stream`.
pub fn stream_document() -> Value {
    let schemas =
        serde_json::to_value(Schemas::openapi()).unwrap_or_default()["components"]["schemas"].take();
    json!({
        "asyncapi": "3.0.0",
        "info": {
            "title": "roomsight stream",
            "version": env!("CARGO_PKG_VERSION"),
            "description": "A robot sends frames over a WebSocket as it takes them, and hears of each what \
                became of it. Every accepted frame gets exactly one of `result`, `dropped` or `error` with its \
                `seq`, in increasing order of `seq`. Close codes: 1001 the service stops; 1002 what came is not \
                what RFC 6455 allows; 1007 a text is no UTF-8; 1008 nothing was heard for too long, a message was \
                not complete in time, the stream goes on over another connection, or the key that opened it is \
                valid no longer; 1009 a message is too long; \
                1013 try again later: no place is free, this caller has its share of them, no model serves, the \
                stream gave its place to another while it had no connection, or a message stood still while \
                others waited for its room. Fields that are not described here may come later: pass over them."
        },
        "servers": {"local": {"host": "127.0.0.1:8080", "protocol": "ws"}},
        "channels": {"stream": {
            "address": "/v1/stream",
            "description": format!(
                "The subprotocol is `{SUBPROTOCOL}`. Where keys are asked for: the header \
                 `Authorization: Bearer KEY`, or a second subprotocol `{KEY_SUBPROTOCOL_PREFIX}KEY`. The query \
                 takes what `configure` takes, and `session` and `last_seq` to resume, with the key that opened \
                 the stream; and, where the service told one, the last `resume` and `sent_seq`, the last frame that \
                 was sent: then a service that never had the stream goes on with it too, and tells frames that no \
                 answer came to as dropped, `lost`. In the mode `lossless` \
                 nothing is read beyond `limits.window` frames without an answer, nor while the service has no \
                 memory for a frame: a client that keeps to the window has its own pings answered in time. In \
                 the other modes the largest frames under way of the caller who holds most are dropped with \
                 `overload` where memory is short."
            ),
            "messages": {
                "frame": {
                    "contentType": "application/octet-stream",
                    "summary": "A frame, a binary message",
                    "description": "The encoded image as it is, numbered 0, 1, 2, ... by the service. Or a \
                        header before it: the bytes RSF1, flags (little-endian u32, bit 0: the time is \
                        given, bit 1: odometry follows, bit 2: a scan follows), the frame's number (little-endian u64, larger than \
                        those before it, at most 2^52, so that every reader of JSON can tell numbers apart), the time of capture \
                        (little-endian u64, nanoseconds since 1970); with bit 1 the robot's x and y in meters and its heading in \
                        radians (little-endian f64), in coordinates that may begin anywhere and drift; with bit 2 what its laser \
                        measured: the number of ranges (little-endian u32), angle_min, angle_increment and range_max \
                        (little-endian f32, radians and meters), and the ranges (little-endian f32, infinite or no number where a \
                        beam met nothing). Where frames tell odometry the filter takes the way instead of the time. The filter goes \
                        by these times where they advance by at most an hour more than the service's clock; else by the times \
                        at which frames arrive, which the first such `result` says in `notice`."
                },
                "client": message("What a robot says, a text message", "ClientMessage", &CLIENT_EXAMPLES),
                "server": message("What the service says, a text message", "ServerMessage", &SERVER_EXAMPLES)
            }
        }},
        "operations": {
            "send": {
                "action": "send", "channel": {"$ref": "#/channels/stream"},
                "messages": [
                    {"$ref": "#/channels/stream/messages/frame"}, {"$ref": "#/channels/stream/messages/client"}
                ]
            },
            "receive": {
                "action": "receive", "channel": {"$ref": "#/channels/stream"},
                "messages": [{"$ref": "#/channels/stream/messages/server"}]
            }
        },
        "components": {"schemas": schemas}
    })
}

fn message(summary: &str, schema: &str, examples: &[(&str, &str)]) -> Value {
    let example = |(name, text): &(&str, &str)| json!({"name": name, "payload": serde_json::from_str::<Value>(text).unwrap_or_default()});
    json!({
        "contentType": "application/json",
        "summary": summary,
        "payload": {"$ref": format!("#/components/schemas/{schema}")},
        "examples": examples.iter().map(example).collect::<Vec<_>>()
    })
}
