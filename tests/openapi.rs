//! The OpenAPI document in the repository is the one the service gives out.
//!
//! `UPDATE=1 cargo test --test openapi` writes it anew.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use serde_json::Value;
use std::fs;

const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/openapi/openapi.json");

fn document() -> String {
    roomsight::server::document().to_pretty_json().unwrap() + "\n"
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
fn the_file_is_up_to_date() {
    if std::env::var_os("UPDATE").is_some() {
        fs::write(PATH, document()).unwrap();
    }
    let file = fs::read_to_string(PATH).unwrap_or_default();
    assert!(file == document(), "openapi/openapi.json is stale: UPDATE=1 cargo test --test openapi");
}

#[test]
fn every_call_says_what_can_go_wrong() {
    let document = parsed();
    for (name, operation) in operations(&document) {
        let responses = operation["responses"].as_object().unwrap();
        assert!(responses.contains_key("200"), "{name}");
        for (status, response) in responses.iter().filter(|(status, _)| status.as_str() >= "400") {
            let schema = &response["content"]["application/problem+json"]["schema"]["$ref"];
            assert_eq!(schema, "#/components/schemas/ProblemBody", "{name} {status}");
        }
        let needs_key = operation.get("security").is_some();
        assert_eq!(needs_key, name.contains("/v1/"), "{name}");
        assert_eq!(needs_key, responses.contains_key("401") && responses.contains_key("403"), "{name}");
    }
    let recognize = &document["paths"]["/v1/recognize"]["post"]["responses"];
    for status in ["400", "401", "403", "404", "408", "409", "413", "415", "422", "429", "500", "503", "504"]
    {
        assert!(recognize.get(status).is_some(), "{status}");
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
