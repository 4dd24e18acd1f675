//! The documents in `openapi/` are those of the code: OpenAPI for the calls, AsyncAPI for the stream.
//!
//! `UPDATE=1 cargo test --test it openapi` writes them anew.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use roomsight_protocol::stream::{ClientMessage, FilterSettings, ServerMessage};
use roomsight_recognition::filter::Trust;
use roomsight_vision::image::{Image, Limits};
use serde::Serialize;
use serde_json::{Value, json};
use std::fs;

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/openapi/");

fn document() -> String {
    roomsight::http::document().to_pretty_json().unwrap() + "\n"
}

fn stream_document() -> String {
    serde_json::to_string_pretty(&roomsight::http::stream_document()).unwrap() + "\n"
}

fn parsed() -> Value {
    serde_json::from_str(&document()).unwrap()
}

fn operations(document: &Value) -> Vec<(String, &Value)> {
    let paths = document["paths"].as_object().unwrap();
    paths
        .iter()
        .flat_map(|(path, item)| {
            item.as_object().unwrap().iter().map(move |(method, op)| (format!("{method} {path}"), op))
        })
        .collect()
}

#[test]
fn the_files_are_up_to_date() {
    for (name, text) in [("openapi.json", document()), ("asyncapi.json", stream_document())] {
        let path = FOLDER.to_owned() + name;
        if std::env::var_os("UPDATE").is_some() {
            fs::write(&path, &text).unwrap();
        }
        let file = fs::read_to_string(&path).unwrap_or_default();
        assert!(file == text, "openapi/{name} is stale: UPDATE=1 cargo test --test it openapi");
    }
}

/// As it travels: numbers have the digits that they are written with.
fn rewritten(message: &impl Serialize) -> Value {
    serde_json::from_str(&serde_json::to_string(message).unwrap()).unwrap()
}

#[test]
fn the_examples_of_the_stream_are_messages_of_it() {
    let document: Value = serde_json::from_str(&stream_document()).unwrap();
    let messages = &document["channels"]["stream"]["messages"];
    let examples = |of: &str| messages[of]["examples"].as_array().unwrap().clone();
    for example in examples("server") {
        let message: ServerMessage = serde_json::from_value(example["payload"].clone()).unwrap();
        assert_eq!(rewritten(&message), example["payload"], "nothing is lost or added");
    }
    for example in examples("client") {
        let message: ClientMessage = serde_json::from_value(example["payload"].clone()).unwrap();
        assert_eq!(rewritten(&message), example["payload"], "nothing is lost or added");
    }
    let schemas = document["components"]["schemas"].as_object().unwrap();
    for name in ["ClientMessage", "ServerMessage", "Event", "StreamResult", "Answer"] {
        assert!(schemas.contains_key(name), "{name}");
    }
}

#[test]
fn every_call_says_what_can_go_wrong() {
    let document = parsed();
    for (name, operation) in operations(&document) {
        let responses = operation["responses"].as_object().unwrap();
        let successes = ["200", "201", "202", "204", "101"];
        assert!(successes.iter().any(|status| responses.contains_key(*status)), "{name}");
        let (media_type, schema) = match name.contains("/v2") {
            false => ("application/problem+json", "#/components/schemas/ProblemBody"),
            true => ("application/json", "#/components/schemas/ErrorBody"),
        };
        for (status, response) in responses.iter().filter(|(status, _)| status.as_str() >= "400") {
            assert_eq!(response["content"][media_type]["schema"]["$ref"], schema, "{name} {status}");
        }
        let needs_key = !operation["security"].as_array().unwrap().is_empty();
        let of_v2 = name.contains("/v2") && !name.contains("/health/");
        // A code stands for a key.
        let takes_code = name.ends_with("/session/code");
        let of_v1 = name.contains("/v1/") && !takes_code;
        assert_eq!(needs_key, of_v1 || of_v2 || name.ends_with("/metrics"), "{name}");
        assert_eq!(
            needs_key || takes_code,
            responses.contains_key("401") && responses.contains_key("403"),
            "{name}"
        );
    }
    let recognize = &document["paths"]["/v1/recognize"]["post"]["responses"];
    for status in ["400", "401", "403", "404", "408", "409", "413", "415", "422", "429", "500", "503", "504"]
    {
        assert!(recognize.get(status).is_some(), "{status}");
    }
}

#[test]
fn generators_find_what_they_need() {
    let document = parsed();
    assert_eq!(document["servers"][0]["url"], "/");
    let mut ids: Vec<String> = Vec::new();
    for (name, operation) in operations(&document) {
        let id = operation["operationId"].as_str().unwrap().to_owned();
        assert!(!ids.contains(&id), "{name}: {id} is the id of another call too");
        ids.push(id);
        let schemes = [json!([]), json!([{"key": []}]), json!([{"key": []}, {"session": []}])];
        assert!(schemes.contains(&operation["security"]), "{name}");
        for field in ["summary", "description"] {
            assert!(operation[field].as_str().is_some_and(|text| !text.is_empty()), "{name}: {field}");
        }
    }
    assert!(document["components"]["securitySchemes"]["key"].is_object());
}

#[test]
fn the_frame_of_the_examples_is_one() {
    let schemas = &parsed()["components"]["schemas"];
    let infer = &schemas["InferRequest"]["example"]["inputs"][0]["data"][0];
    assert_eq!(schemas["FrameJson"]["example"]["frame"], *infer);
    let bytes = BASE64_STANDARD.decode(infer.as_str().unwrap()).unwrap();
    let image = Image::decode(&bytes, &Limits::default()).unwrap();
    assert_eq!((image.width(), image.height()), (16, 16));
}

#[test]
fn the_filters_default_and_range_are_told_as_they_are() {
    let document: Value = serde_json::from_str(&stream_document()).unwrap();
    let default = FilterSettings::default();
    let trust = &document["components"]["schemas"]["FilterSettings"]["properties"]["trust"];
    assert_eq!(
        (trust["default"].as_f64(), trust["maximum"].as_f64()),
        (Some(default.trust.into()), Some(Trust::MAX.into()))
    );
    let hello = &document["channels"]["stream"]["messages"]["server"]["examples"][0]["payload"];
    assert_eq!(hello["settings"]["filter"], serde_json::to_value(default).unwrap());
    let python = concat!(env!("CARGO_MANIFEST_DIR"), "/clients/python/src/roomsight/messages.py");
    let python = fs::read_to_string(python).unwrap();
    assert!(python.contains(&format!("above 0 to {:.0}:", Trust::MAX)), "the range in messages.py");
    assert!(python.contains(&format!("has {:.1}.", default.trust)), "the default in messages.py");
}

#[test]
fn no_call_has_a_parameter_twice() {
    for (name, operation) in operations(&parsed()) {
        let parameters = operation["parameters"].as_array().map_or(&[][..], Vec::as_slice);
        let mut seen: Vec<[&Value; 2]> = Vec::new();
        for parameter in parameters {
            let identity = [&parameter["in"], &parameter["name"]];
            assert!(!seen.contains(&identity), "{name}: {identity:?}");
            seen.push(identity);
        }
    }
}

#[test]
fn every_reference_leads_somewhere() {
    fn check(value: &Value, document: &Value) {
        match value {
            Value::Object(fields) => {
                if let Some(Value::String(reference)) = fields.get("$ref") {
                    assert!(document.pointer(&reference[1..]).is_some(), "{reference}");
                }
                fields.values().for_each(|value| check(value, document));
            }
            Value::Array(values) => values.iter().for_each(|value| check(value, document)),
            _ => {}
        }
    }
    let document = parsed();
    assert_eq!(document["openapi"], "3.1.0");
    check(&document, &document);
}
