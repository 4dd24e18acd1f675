//! The caller's trace in the log and, where the program was built with them, in the traces it sends.

use crate::command::Running;
use crate::service::{client, frame, models, success};
use serde_json::Value;

const TRACE_ID: &str = "0af7651916cd43dd8448eb211c80319c";

async fn recognize(running: &Running, traceparent: &str) {
    let post = client().post(format!("{}/v1/recognize", running.url)).header("traceparent", traceparent);
    success(post.body(frame()).send().await.unwrap()).await;
}

#[tokio::test]
async fn a_request_is_logged_with_its_callers_trace() {
    let models = models();
    let mut running = Running::start(&["--models", models.path().to_str().unwrap(), "--log-format", "json"]);
    recognize(&running, &format!("00-{TRACE_ID}-b7ad6b7169203331-01")).await;
    recognize(&running, &format!("00-{}-b7ad6b7169203331-01", "0".repeat(32))).await;
    let log = running.stop();
    let lines = log.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let spans: Vec<Value> = lines
        .filter(|line| line["message"] == "answered" && line["span"]["route"] == "/v1/recognize")
        .map(|line| line["span"]["trace_id"].clone())
        .collect();
    assert_eq!(spans, [TRACE_ID.into(), Value::Null]);
}

#[cfg(not(feature = "otlp"))]
#[test]
fn a_program_without_traces_says_so() {
    let told = crate::command::failure(&["serve", "--set", "otlp_endpoint=http://127.0.0.1:4318"]);
    assert!(told.contains("otlp_endpoint") && told.contains("--features otlp"), "{told}");
}

#[cfg(feature = "otlp")]
mod exported {
    use super::*;
    use axum::Router;
    use axum::body::Bytes;
    use axum::extract::State;
    use axum::http::HeaderMap;
    use axum::routing::post;
    use std::sync::{Arc, Mutex};
    use tokio::net::TcpListener;
    use tokio::task::spawn_blocking;

    type Received = Arc<Mutex<Vec<u8>>>;

    /// Takes what is sent to a collector.
    async fn collect(State(received): State<Received>, headers: HeaderMap, body: Bytes) {
        assert_eq!(headers["content-type"], "application/x-protobuf");
        received.lock().unwrap().extend(body);
    }

    fn contains(bytes: &[u8], part: &[u8]) -> bool {
        bytes.windows(part.len()).any(|window| window == part)
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_request_and_its_stages_are_a_part_of_the_callers_trace() {
        let received = Received::default();
        let collector = Router::new().route("/v1/traces", post(collect)).with_state(received.clone());
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let endpoint = format!("otlp_endpoint=http://{}", listener.local_addr().unwrap());
        tokio::spawn(async { axum::serve(listener, collector).await });
        let models = models();
        let folder = models.path().to_str().unwrap().to_owned();
        let mut running =
            spawn_blocking(move || Running::start(&["--models", &folder, "--set", &endpoint])).await.unwrap();
        recognize(&running, &format!("00-{TRACE_ID}-b7ad6b7169203331-01")).await;
        // What is not sent yet is sent at the end.
        spawn_blocking(move || running.stop()).await.unwrap();
        let received = received.lock().unwrap();
        let trace_id = u128::from_str_radix(TRACE_ID, 16).unwrap().to_be_bytes();
        let of_trace = received.windows(16).filter(|window| *window == trace_id).count();
        assert_eq!(of_trace, 5, "the request and its four stages");
        let parent = 0xb7ad_6b71_6920_3331_u64.to_be_bytes();
        assert!(contains(&received, &parent), "the caller's span is the request's parent");
        for name in ["roomsight", "request", "queue", "decode", "features", "classify"] {
            assert!(contains(&received, name.as_bytes()), "{name}");
        }
    }
}
