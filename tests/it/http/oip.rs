//! The Open Inference Protocol as its clients see it.

use crate::http::service::{
    Server, frame, models, pgm, problem, read_raw, room, success, write_damaged_model, write_model,
};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use roomsight::access::{Key, Role};
use roomsight::settings::Settings;
use serde_json::{Value, json};

const LENGTH: &str = "inference-header-content-length";
const INFER: &str = "/v2/models/lab/infer";

/// A request whose frames stand in it.
fn in_json(frames: &[Vec<u8>]) -> Value {
    let data: Vec<String> = frames.iter().map(|frame| BASE64_STANDARD.encode(frame)).collect();
    json!({"inputs": [{"name": "frame", "datatype": "BYTES", "shape": [frames.len()], "data": data}]})
}

fn post_json(server: &Server, path: &str, request: &Value) -> reqwest::RequestBuilder {
    server.post_as(path, "application/json", request.to_string().into_bytes())
}

/// A request whose frames follow it, with what is added to its JSON.
fn post_binary(server: &Server, frames: &[Vec<u8>], more: Value) -> reqwest::RequestBuilder {
    let tail: Vec<u8> =
        frames.iter().flat_map(|frame| [&(frame.len() as u32).to_le_bytes()[..], frame].concat()).collect();
    let mut request = more;
    request["inputs"] = json!([{
        "name": "frame", "datatype": "BYTES", "shape": [frames.len(), 1],
        "parameters": {"binary_data_size": tail.len()}
    }]);
    let json = request.to_string().into_bytes();
    let length = json.len();
    server.post(INFER, [json, tail].concat()).header(LENGTH, length)
}

/// Reads an answer's JSON and what follows it.
async fn read(response: reqwest::Response) -> (Value, Vec<u8>) {
    assert_eq!(response.status(), 200);
    assert_eq!(response.headers()["content-type"], "application/octet-stream");
    let length: usize = response.headers()[LENGTH].to_str().unwrap().parse().unwrap();
    let body = response.bytes().await.unwrap();
    let (json, binary) = body.split_at(length);
    (serde_json::from_slice(json).unwrap(), binary.to_vec())
}

/// Reads an answer that must be an error of this status that says this.
async fn refused(response: reqwest::Response, status: u16, says: &str) {
    let headers = response.headers().clone();
    let told = response.status().as_u16();
    let body: Value = serde_json::from_str(&response.text().await.unwrap()).unwrap();
    assert_eq!(told, status, "{body}");
    assert_eq!(headers["content-type"], "application/json", "{body}");
    assert!(headers.contains_key("x-request-id"), "{body}");
    assert_eq!(body.as_object().unwrap().len(), 1, "{body}");
    assert!(body["error"].as_str().unwrap().contains(says), "{body} does not say {says:?}");
}

/// The values of an output in JSON.
fn data<'a>(answer: &'a Value, output: &str) -> &'a Value {
    let outputs = answer["outputs"].as_array().unwrap();
    &outputs.iter().find(|found| found["name"] == output).unwrap()["data"]
}

#[tokio::test]
async fn the_service_and_its_models_tell_what_they_are() {
    let server = Server::start(Settings::default()).await;
    let get = async |path: &str| success(server.get(path).send().await.unwrap()).await;
    assert_eq!(get("/v2/health/live").await, json!({"live": true}));
    assert_eq!(get("/v2/health/ready").await, json!({"ready": true}));
    let service = get("/v2").await;
    assert_eq!(service["name"], "roomsight");
    assert_eq!(
        service["extensions"],
        json!(["binary_tensor_data", "model_configuration", "model_repository", "statistics"])
    );
    let model = get("/v2/models/lab").await;
    assert_eq!(
        model,
        json!({
            "name": "lab", "versions": ["1"], "platform": "roomsight",
            "inputs": [{"name": "frame", "datatype": "BYTES", "shape": [-1]}],
            "outputs": [
                {"name": "room", "datatype": "BYTES", "shape": [-1]},
                {"name": "probability", "datatype": "FP32", "shape": [-1]},
                {"name": "known", "datatype": "BOOL", "shape": [-1]},
                {"name": "novelty", "datatype": "FP32", "shape": [-1]},
                {"name": "probabilities", "datatype": "FP32", "shape": [-1, 3]},
                {"name": "rooms", "datatype": "BYTES", "shape": [3]}
            ]
        })
    );
    assert_eq!(get("/v2/models/lab/versions/1").await, model);
    for path in ["/v2/models/lab/ready", "/v2/models/lab/versions/1/ready"] {
        assert_eq!(get(path).await, json!({"name": "lab", "ready": true}));
    }
}

#[tokio::test]
async fn models_tell_tritons_tools_how_they_are_run() {
    let server = Server::start(Settings { threads: 2, ..Settings::default() }).await;
    let get = async |path: &str| success(server.get(path).send().await.unwrap()).await;
    let config = get("/v2/models/lab/config").await;
    assert_eq!(get("/v2/models/lab/versions/1/config").await, config);
    assert_eq!((&config["name"], &config["max_batch_size"]), (&json!("lab"), &json!(0)));
    assert_eq!(config["version_policy"], json!({"specific": {"versions": [1]}}));
    assert_eq!(config["input"], json!([{"name": "frame", "data_type": "TYPE_STRING", "dims": [-1]}]));
    let outputs = config["output"].as_array().unwrap();
    assert_eq!(outputs[4], json!({"name": "probabilities", "data_type": "TYPE_FP32", "dims": [-1, 3]}));
    assert_eq!(outputs[2]["data_type"], "TYPE_BOOL");
    assert_eq!(config["instance_group"], json!([{"name": "lab", "kind": "KIND_CPU", "count": 2}]));
    assert_eq!(config["model_transaction_policy"], json!({"decoupled": false}));
    let get = |path: &'static str| server.get(path).send();
    refused(get("/v2/models/none/config").await.unwrap(), 404, "none").await;
    refused(get("/v2/models/lab/versions/9/config").await.unwrap(), 404, "9").await;
}

#[tokio::test]
async fn models_tell_tritons_tools_what_they_have_done() {
    let server = Server::start(Settings::default()).await;
    let stats =
        async |path: &str| success(server.get(path).send().await.unwrap()).await["model_stats"].take();
    let before = stats("/v2/models/lab/stats").await;
    assert_eq!((&before[0]["name"], &before[0]["version"]), (&json!("lab"), &json!("1")));
    assert_eq!((&before[0]["last_inference"], &before[0]["inference_count"]), (&json!(0), &json!(0)));
    assert_eq!(before[0]["batch_stats"], json!([]));
    success(post_json(&server, INFER, &in_json(&[room(0, 3), room(1, 8)])).send().await.unwrap()).await;
    success(server.post("/v1/recognize", frame()).send().await.unwrap()).await;
    problem(server.post("/v1/recognize", b"no image".to_vec()).send().await.unwrap(), 422, "not-an-image")
        .await;
    let after = stats("/v2/models/lab/stats").await;
    assert_eq!(stats("/v2/models/lab/versions/1/stats").await, after);
    assert_eq!(stats("/v2/models/stats").await, after);
    let after = &after[0];
    assert_eq!((&after["inference_count"], &after["execution_count"]), (&json!(3), &json!(3)));
    assert!(after["last_inference"].as_u64().unwrap() > 0, "{after}");
    let steps = &after["inference_stats"];
    assert_eq!((&steps["success"]["count"], &steps["fail"]["count"]), (&json!(3), &json!(1)));
    let ns = |step: &str| steps[step]["ns"].as_u64().unwrap();
    assert_eq!(ns("success"), ns("queue") + ns("compute_input") + ns("compute_infer"));
    assert!(ns("compute_input") > 0 && ns("compute_infer") > 0, "{after}");
    assert_eq!(after["batch_stats"][0]["batch_size"], 1);
    assert_eq!(after["batch_stats"][0]["compute_infer"], steps["compute_infer"]);
    let get = |path: &'static str| server.get(path).send();
    refused(get("/v2/models/none/stats").await.unwrap(), 404, "none").await;
    refused(get("/v2/models/lab/versions/9/stats").await.unwrap(), 404, "9").await;
}

#[tokio::test]
async fn frames_get_the_answers_of_the_rest_api() {
    let server = Server::start(Settings::default()).await;
    let frames = [room(0, 3), room(1, 8), room(2, 40)];
    let answer = success(post_json(&server, INFER, &in_json(&frames)).send().await.unwrap()).await;
    assert_eq!((&answer["model_name"], &answer["model_version"]), (&json!("lab"), &json!("1")));
    let rooms = data(&answer, "rooms").as_array().unwrap();
    for (frame_idx, frame) in frames.iter().enumerate() {
        let alone = success(server.post("/v1/recognize", frame.clone()).send().await.unwrap()).await;
        for output in ["room", "probability", "known"] {
            assert_eq!(data(&answer, output)[frame_idx], alone[output], "{output}");
        }
        for (room_idx, room) in rooms.iter().enumerate() {
            let of_room = alone["probabilities"].as_array().unwrap().iter().find(|p| p["room"] == *room);
            let probability = &data(&answer, "probabilities")[frame_idx * rooms.len() + room_idx];
            assert_eq!(*probability, of_room.unwrap()["probability"]);
        }
    }
    let versioned = post_json(&server, "/v2/models/lab/versions/1/infer", &in_json(&frames));
    assert_eq!(success(versioned.send().await.unwrap()).await, answer);
    let nested = json!({"inputs": [{
        "name": "frame", "datatype": "BYTES", "shape": [1, 1], "data": [[BASE64_STANDARD.encode(&frames[0])]]
    }]});
    let one = success(post_json(&server, INFER, &nested).send().await.unwrap()).await;
    assert_eq!(data(&one, "room")[0], data(&answer, "room")[0]);
}

#[tokio::test]
async fn tensors_travel_as_bytes_where_asked() {
    let server = Server::start(Settings::default()).await;
    let frames = [room(0, 3), room(1, 8)];
    let answer = success(post_json(&server, INFER, &in_json(&frames)).send().await.unwrap()).await;
    let more = json!({
        "id": "42", "parameters": {"binary_data_output": true},
        "outputs": [
            {"name": "probability"}, {"name": "rooms", "parameters": {"binary_data": false}}, {"name": "known"},
            {"name": "room", "parameters": {"binary_data": true}}
        ]
    });
    let (json, binary) = read(post_binary(&server, &frames, more).send().await.unwrap()).await;
    assert_eq!(json["id"], "42");
    let outputs = json["outputs"].as_array().unwrap();
    let names: Vec<&str> = outputs.iter().map(|output| output["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["probability", "rooms", "known", "room"]);
    assert_eq!(outputs[1]["data"], *data(&answer, "rooms"));
    let mut expected = Vec::new();
    for probability in data(&answer, "probability").as_array().unwrap() {
        expected.extend((probability.as_f64().unwrap() as f32).to_le_bytes());
    }
    expected.extend(data(&answer, "known").as_array().unwrap().iter().map(|known| u8::from(known == true)));
    for room in data(&answer, "room").as_array().unwrap() {
        let room = room.as_str().unwrap();
        expected.extend((room.len() as u32).to_le_bytes());
        expected.extend(room.bytes());
    }
    assert_eq!(binary, expected);
    let sizes: Vec<u64> =
        outputs.iter().filter_map(|output| output["parameters"]["binary_data_size"].as_u64()).collect();
    assert_eq!(sizes, [8, 2, binary.len() as u64 - 10]);
    assert_eq!(outputs[0]["shape"], json!([2]));
    let plain = success(post_binary(&server, &frames, json!({})).send().await.unwrap()).await;
    assert_eq!(plain["outputs"], answer["outputs"]);
    assert!(plain.get("id").is_none());
}

#[tokio::test]
async fn a_frame_that_cannot_be_read_fails_the_request_by_its_index() {
    let server = Server::start(Settings { max_frame_side: 100, ..Settings::default() }).await;
    let send = |frames: &[Vec<u8>]| post_binary(&server, frames, json!({})).send();
    let truncated = frame()[..frame().len() / 2].to_vec();
    refused(send(&[frame(), truncated]).await.unwrap(), 400, "frame 1 (counted from 0)").await;
    refused(send(&[vec![], frame()]).await.unwrap(), 400, "frame 0 (counted from 0)").await;
    let wide = pgm(101, 1, |_, _| 0);
    refused(send(&[frame(), frame(), wide]).await.unwrap(), 413, "frame 2 (counted from 0)").await;
}

#[tokio::test]
async fn malformed_requests_are_told_why() {
    let server = Server::start(Settings { max_batch_frames: 2, ..Settings::default() }).await;
    let json = |body: &str| server.post_as(INFER, "application/json", body.as_bytes().to_vec());
    refused(json("").send().await.unwrap(), 400, "empty").await;
    refused(json("{").send().await.unwrap(), 400, "JSON").await;
    refused(json("{\"inputs\": []}").send().await.unwrap(), 400, "`frame`").await;
    for (length, says) in [("9", "JSON"), ("-1", "whole number"), ("900", "900"), ("x", "whole number")] {
        refused(json("{\"a\": []}").header(LENGTH, length).send().await.unwrap(), 400, says).await;
    }
    let frames = |n_frames: usize| in_json(&vec![frame(); n_frames]);
    refused(post_json(&server, INFER, &frames(3)).send().await.unwrap(), 413, "2 frames").await;
    let mut strange = frames(1);
    strange["outputs"] = json!([{"name": "mood"}]);
    refused(post_json(&server, INFER, &strange).send().await.unwrap(), 400, "mood").await;
    let mut late = frames(1);
    late["parameters"] = json!({"deadline_ms": 0});
    refused(post_json(&server, INFER, &late).send().await.unwrap(), 504, "deadline").await;
    late["parameters"] = json!({"robot": "a\nb"});
    refused(post_json(&server, INFER, &late).send().await.unwrap(), 400, "robot").await;
    let zipped = post_json(&server, INFER, &frames(1)).header("content-encoding", "gzip");
    refused(zipped.send().await.unwrap(), 415, "gzip").await;
    let plain = post_json(&server, INFER, &frames(1)).header("content-encoding", "identity");
    success(plain.send().await.unwrap()).await;
}

#[tokio::test]
async fn limits_hold_before_bodies_are_read() {
    let settings = Settings { max_batch_bytes: 1000, threads: 1, queue: 0, ..Settings::default() };
    let server = Server::start(settings).await;
    let head = |path: &str, n_bytes: usize| {
        format!("POST {path} HTTP/1.1\r\nhost: localhost\r\ncontent-length: {n_bytes}\r\n\r\n")
    };
    let long = read_raw(server.send_raw(head(INFER, 1001).as_bytes())).await;
    assert!(long.starts_with("HTTP/1.1 413 ") && long.contains("{\"error\":"), "{long}");
    let nowhere = read_raw(server.send_raw(head("/v2/models/none/infer", 1000).as_bytes())).await;
    assert!(nowhere.starts_with("HTTP/1.1 404 "), "{nowhere}");
    let small = pgm(8, 8, |_, _| 0);
    let full = post_binary(&server, &[small.clone(), small], json!({})).send().await.unwrap();
    assert!(full.headers().contains_key("retry-after"));
    refused(full, 429, "queue is full").await;
    let index = vec![b' '; 1 << 20];
    refused(server.post("/v2/repository/index", index).send().await.unwrap(), 413, "bytes").await;
}

#[tokio::test]
async fn errors_have_the_protocols_form_under_its_path_only() {
    let server = Server::start(Settings::default()).await;
    let get = |path: &'static str| server.get(path).send();
    refused(get("/v2/nothing").await.unwrap(), 404, "/docs").await;
    refused(get("/v2/models/none").await.unwrap(), 404, "none").await;
    refused(get("/v2/models/lab/versions/9").await.unwrap(), 404, "9").await;
    refused(get("/v2/models/lab/versions/9/ready").await.unwrap(), 404, "9").await;
    refused(get("/v2/models/lab/versions/x").await.unwrap(), 400, "x").await;
    refused(post_json(&server, "/v2/models/none/infer", &json!({})).send().await.unwrap(), 404, "none").await;
    let response = get("/v2/models/lab/infer").await.unwrap();
    assert_eq!(response.headers()["allow"], "POST");
    refused(response, 405, "Allow").await;
    problem(get("/v22").await.unwrap(), 404, "not-found").await;
}

#[tokio::test]
async fn keys_open_what_their_role_may() {
    let made = [Role::Robot, Role::Viewer, Role::Admin]
        .map(|role| Key::new(role, "someone", &[role as u8; 32]).unwrap());
    let keys = made.iter().map(|(_, key)| key.clone()).collect();
    let server = Server::start(Settings { keys, ..Settings::default() }).await;
    let [robot, viewer, admin] = made.map(|(secret, _)| secret);
    let load = "/v2/repository/models/lab/load";
    let cases: [(&str, &str, &[&String]); 7] = [
        ("GET", "/v2", &[&robot, &viewer]),
        ("GET", "/v2/models/lab", &[&robot, &viewer]),
        ("GET", "/v2/models/lab/versions/1/ready", &[&robot, &viewer]),
        ("POST", "/v2/repository/index", &[&viewer]),
        ("POST", INFER, &[&robot]),
        ("POST", "/v2/models/lab/versions/1/infer", &[&robot]),
        ("POST", load, &[]),
    ];
    for (method, path, holders) in cases {
        for key in [&robot, &viewer, &admin] {
            let body = if path.ends_with("/infer") { in_json(&[frame()]).to_string() } else { String::new() };
            let request = match method {
                "GET" => server.get(path),
                _ => server.post_as(path, "application/json", body.into_bytes()),
            };
            let response = request.bearer_auth(key).send().await.unwrap();
            if holders.contains(&key) || *key == admin {
                assert_eq!(response.status(), 200, "{path}");
            } else {
                refused(response, 403, "role").await;
            }
        }
    }
    let unload = server.post("/v2/repository/models/lab/unload", Vec::new()).bearer_auth(&viewer);
    refused(unload.send().await.unwrap(), 403, "role").await;
    refused(server.get("/v2").send().await.unwrap(), 401, "key").await;
    success(server.get("/v2/health/ready").send().await.unwrap()).await;
    let head = format!("POST {INFER} HTTP/1.1\r\nhost: localhost\r\ncontent-length: 1000000\r\n\r\n");
    let unread = read_raw(server.send_raw(head.as_bytes())).await;
    assert!(unread.starts_with("HTTP/1.1 401 ") && unread.contains("{\"error\":"), "{unread}");
}

#[tokio::test]
async fn the_repository_is_listed_and_loaded() {
    let folder = models();
    write_model(&folder.path().join("lab/2"));
    write_damaged_model(&folder.path().join("lab/3"));
    write_damaged_model(&folder.path().join("attic/1"));
    let server = Server::of(Settings { models: folder.path().to_owned(), ..Settings::default() }).await;
    let post = |path: &'static str, body: &'static str| server.post(path, body.into()).send();
    let index = success(post("/v2/repository/index", "").await.unwrap()).await;
    let told: Vec<[&str; 3]> = index
        .as_array()
        .unwrap()
        .iter()
        .map(|entry| ["name", "version", "state"].map(|field| entry[field].as_str().unwrap()))
        .collect();
    assert_eq!(
        told,
        [
            ["attic", "1", "UNAVAILABLE"],
            ["lab", "1", "UNAVAILABLE"],
            ["lab", "2", "READY"],
            ["lab", "3", "UNAVAILABLE"]
        ]
    );
    assert_eq!(index[1]["reason"], "not loaded");
    assert!(index[3]["reason"].as_str().unwrap().contains("verifying failed"), "{index}");
    let ready = success(post("/v2/repository/index", "{\"ready\": true}").await.unwrap()).await;
    assert_eq!(ready, json!([{"name": "lab", "version": "2", "state": "READY", "reason": ""}]));
    refused(post("/v2/repository/index", "{\"ready\": 1}").await.unwrap(), 400, "JSON").await;
    let attic = server.get("/v2/models/attic/ready").send().await.unwrap();
    refused(attic, 503, "attic").await;
    refused(post("/v2/repository/models/lab/load", "{}").await.unwrap(), 409, "serves on").await;
    refused(post("/v2/repository/models/none/load", "").await.unwrap(), 404, "none").await;
    refused(post("/v2/repository/models/none/load", "null").await.unwrap(), 404, "none").await;
    refused(post("/v2/repository/models/none/load", "[]").await.unwrap(), 400, "object").await;
    refused(post("/v2/repository/index", "[true]").await.unwrap(), 400, "object").await;
    assert_eq!(success(post("/v2/repository/index", "null").await.unwrap()).await, index);
    let config = "{\"parameters\": {\"config\": \"{}\"}}";
    refused(post("/v2/repository/models/lab/load", config).await.unwrap(), 400, "parameters").await;
    refused(post("/v2/repository/models/none/unload", "").await.unwrap(), 404, "none").await;
    success(post_json(&server, INFER, &in_json(&[frame()])).send().await.unwrap()).await;
    assert_eq!(post("/v2/repository/models/lab/unload", "").await.unwrap().status(), 200);
    refused(server.get("/v2/models/lab/ready").send().await.unwrap(), 503, "no version").await;
    refused(post_json(&server, INFER, &in_json(&[frame()])).send().await.unwrap(), 503, "no version").await;
    refused(server.get("/v2/health/ready").send().await.unwrap(), 503, "no version of the model").await;
}

#[tokio::test]
async fn the_highest_version_is_loaded_and_answers() {
    let folder = models();
    write_model(&folder.path().join("lab/2"));
    let server = Server::of(Settings { models: folder.path().to_owned(), ..Settings::default() }).await;
    let back = server.post("/v1/models/lab/versions/1/activate", Vec::new()).send().await.unwrap();
    assert_eq!(success(back).await["version"], 1);
    let version = async || {
        let answer = post_json(&server, INFER, &in_json(&[frame()])).send().await.unwrap();
        success(answer).await["model_version"].clone()
    };
    assert_eq!(version().await, "1");
    let load = server.post("/v2/repository/models/lab/load", Vec::new()).send().await.unwrap();
    assert_eq!(load.status(), 200);
    assert_eq!(version().await, "2");
    let model = success(server.get("/v2/models/lab").send().await.unwrap()).await;
    assert_eq!(model["versions"], json!(["1", "2"]));
}
