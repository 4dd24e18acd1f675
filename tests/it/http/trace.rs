//! The caller's trace in the log and, where the program was built with them, in the traces it sends.

use crate::http::command::Running;
use crate::http::service::{client, frame, models, success};
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
    let told = crate::http::command::failure(&["serve", "--set", "otlp_endpoint=http://127.0.0.1:4318"]);
    assert!(told.contains("otlp_endpoint") && told.contains("--features otlp"), "{told}");
}

#[cfg(feature = "otlp")]
mod exported {
    use super::*;
    use crate::http::robot::Robot;
    use crate::http::service::SOON;
    use axum::Router;
    use axum::body::Bytes;
    use axum::extract::State;
    use axum::http::HeaderMap;
    use axum::routing::post;
    use roomsight_protocol::stream::ServerMessage;
    use std::sync::{Arc, Mutex};
    use std::time::Duration;
    use tempfile::TempDir;
    use tokio::net::TcpListener;
    use tokio::task::spawn_blocking;
    use tokio::time::{sleep, timeout};

    type Received = Arc<Mutex<Vec<u8>>>;

    /// Takes what is sent to a collector.
    async fn collect(State(received): State<Received>, headers: HeaderMap, body: Bytes) {
        assert_eq!(headers["content-type"], "application/x-protobuf");
        received.lock().unwrap().extend(body);
    }

    fn count(bytes: &[u8], part: &[u8]) -> usize {
        bytes.windows(part.len()).filter(|window| *window == part).count()
    }

    /// A service that sends its traces to a collector, and what this receives.
    async fn start(models: &TempDir) -> (Running, Received) {
        let received = Received::default();
        let collector = Router::new().route("/v1/traces", post(collect)).with_state(received.clone());
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let endpoint = format!("otlp_endpoint=http://{}", listener.local_addr().unwrap());
        tokio::spawn(async { axum::serve(listener, collector).await });
        let folder = models.path().to_str().unwrap().to_owned();
        let start = move || Running::start(&["--models", &folder, "--set", &endpoint]);
        (spawn_blocking(start).await.unwrap(), received)
    }

    async fn no_thread_is_busy(running: &Running) {
        let metrics = format!("{}/metrics", running.url);
        loop {
            let text = client().get(&metrics).send().await.unwrap().text().await.unwrap();
            if text.lines().any(|line| line == "roomsight_threads_busy 0") {
                return;
            }
            sleep(Duration::from_millis(5)).await;
        }
    }

    fn trace_id() -> [u8; 16] {
        u128::from_str_radix(TRACE_ID, 16).unwrap().to_be_bytes()
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_request_and_its_stages_are_a_part_of_the_callers_trace() {
        let models = models();
        let (mut running, received) = start(&models).await;
        recognize(&running, &format!("00-{TRACE_ID}-b7ad6b7169203331-01")).await;
        // What is not sent yet is sent at the end.
        spawn_blocking(move || running.stop()).await.unwrap();
        let received = received.lock().unwrap();
        assert_eq!(count(&received, &trace_id()), 5, "the request and its four stages");
        let parent = 0xb7ad_6b71_6920_3331_u64.to_be_bytes();
        assert!(count(&received, &parent) > 0, "the caller's span is the request's parent");
        for name in ["roomsight", "request", "queue", "decode", "features", "classify"] {
            assert!(count(&received, name.as_bytes()) > 0, "{name}");
        }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn each_frame_of_a_stream_is_a_trace_that_names_the_stream_as_its_cause() {
        let models = models();
        let (mut running, received) = start(&models).await;
        let traceparent = format!("00-{TRACE_ID}-b7ad6b7169203331-01");
        let address = running.url.trim_start_matches("http://").to_owned();
        let headers = [("traceparent", traceparent.as_str())];
        let mut robot = Robot::try_connect_to(&address, "?mode=lossless", &headers).await.unwrap();
        for _ in 0..4 {
            robot.send(frame()).await;
            assert!(matches!(robot.next().await, ServerMessage::Result(_)));
        }
        drop(robot);
        // A thread that has told its answer may still hold the stream's span.
        timeout(SOON, no_thread_is_busy(&running)).await.unwrap();
        spawn_blocking(move || running.stop()).await.unwrap();
        let received = received.lock().unwrap();
        // A span's name is its field 5.
        let named = |name: &str| count(&received, &[&[0x2a, name.len() as u8], name.as_bytes()].concat());
        for stage in ["frame", "queue", "decode", "features", "classify"] {
            // The last answer may be here before its spans have ended.
            assert!((3..=4).contains(&named(stage)), "{stage}: {}", named(stage));
        }
        let n_links = count(&received, &trace_id()) - 1;
        assert_eq!(n_links, named("frame"), "beside the stream's own span each frame names its trace");
    }
}
