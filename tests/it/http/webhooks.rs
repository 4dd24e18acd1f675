//! Webhooks: what an address is told, how it can trust it, and that nobody waits for it.

use crate::http::service::{SOON, Server, frame, known_room, models, pgm, success, write_damaged_model};
use ring::hmac;
use roomsight::settings::Settings;
use serde_json::Value;
use std::collections::BTreeMap;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};

/// A call that came.
struct Call {
    headers: BTreeMap<String, String>,
    body: Vec<u8>,
}

impl Call {
    fn told(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap()
    }
}

/// An address that answers with these statuses in turn, and with 204 then.
struct Address {
    url: String,
    calls: mpsc::UnboundedReceiver<Call>,
}

impl Address {
    async fn listen(mut statuses: Vec<&'static str>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}/hook?token=1", listener.local_addr().unwrap());
        let (sender, calls) = mpsc::unbounded_channel();
        statuses.reverse();
        tokio::spawn(async move {
            while let Ok((mut stream, _)) = listener.accept().await {
                let call = read(&mut stream).await;
                let status = statuses.pop().unwrap_or("204 No Content");
                let answer = format!(
                    "HTTP/1.1 {status}\r\nlocation: /elsewhere\r\ncontent-length: 0\r\nconnection: close\r\n\r\n"
                );
                stream.write_all(answer.as_bytes()).await.unwrap();
                let _ = sender.send(call);
            }
        });
        Self { url, calls }
    }

    async fn next(&mut self) -> Call {
        timeout(SOON, self.calls.recv()).await.expect("it is told soon").unwrap()
    }
}

async fn read(stream: &mut TcpStream) -> Call {
    let mut bytes = Vec::new();
    let head_end = loop {
        if let Some(end) = bytes.windows(4).position(|window| window == b"\r\n\r\n") {
            break end;
        }
        assert!(stream.read_buf(&mut bytes).await.unwrap() > 0, "the call ends early");
    };
    let head = String::from_utf8(bytes[..head_end].to_vec()).unwrap();
    assert!(head.starts_with("POST /hook?token=1 HTTP/1.1\r\n"), "{head}");
    let pairs = head.lines().skip(1).filter_map(|line| line.split_once(": "));
    let headers: BTreeMap<String, String> =
        pairs.map(|(name, value)| (name.to_lowercase(), value.to_owned())).collect();
    let n_bytes: usize = headers["content-length"].parse().unwrap();
    while bytes.len() < head_end + 4 + n_bytes {
        assert!(stream.read_buf(&mut bytes).await.unwrap() > 0, "the call ends early");
    }
    Call { headers, body: bytes.split_off(head_end + 4) }
}

fn telling(urls: &[&str]) -> Settings {
    Settings {
        webhooks: urls.iter().map(|&url| url.to_owned()).collect(),
        webhook_secret: "secret".into(),
        lost_after_ms: 1,
        ..Settings::default()
    }
}

async fn recognize(server: &Server, frame: Vec<u8>) {
    success(server.post("/v1/recognize?robot=eve", frame).send().await.unwrap()).await;
}

async fn outcomes(server: &Server, outcome: &str, n: u32) {
    let series = format!("roomsight_webhook_deliveries_total{{outcome=\"{outcome}\"}} {n}\n");
    let told = async {
        while !server.get("/metrics").send().await.unwrap().text().await.unwrap().contains(&series) {
            sleep(Duration::from_millis(20)).await;
        }
    };
    timeout(SOON, told).await.unwrap_or_else(|_| panic!("not {series}"));
}

#[tokio::test(flavor = "multi_thread")]
async fn an_address_hears_of_robots_signed_and_again_where_it_did_not_take_it() {
    let mut address = Address::listen(vec!["503 Service Unavailable"]).await;
    let server = Server::start_sure(telling(&[&address.url])).await;
    recognize(&server, known_room(0)).await;
    let (refused, taken) = (address.next().await, address.next().await);
    assert_eq!(
        (&refused.body, &refused.headers["roomsight-delivery"]),
        (&taken.body, &taken.headers["roomsight-delivery"])
    );
    let told = taken.told();
    assert_eq!(
        (&told["type"], &told["id"], &told["to"]),
        (&"room_changed".into(), &"eve".into(), &"stripes".into())
    );
    assert_eq!(told["delivery"], taken.headers["roomsight-delivery"].as_str());
    let signed = [taken.headers["roomsight-timestamp"].as_bytes(), b".", &taken.body].concat();
    let signature = taken.headers["roomsight-signature"].strip_prefix("v1=").unwrap();
    let signature: Vec<u8> =
        (0..64).step_by(2).map(|at| u8::from_str_radix(&signature[at..at + 2], 16).unwrap()).collect();
    hmac::verify(&hmac::Key::new(hmac::HMAC_SHA256, b"secret"), &signed, &signature).unwrap();
    for _ in 0..2 {
        recognize(&server, pgm(96, 72, |_, _| 128)).await;
        sleep(Duration::from_millis(5)).await;
    }
    assert_eq!(address.next().await.told()["type"], "robot_lost");
    recognize(&server, known_room(0)).await;
    assert_eq!(address.next().await.told()["type"], "robot_found");
    outcomes(&server, "delivered", 3).await;
    outcomes(&server, "retried", 1).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_address_that_leads_elsewhere_or_is_not_there_costs_others_nothing() {
    let mut elsewhere = Address::listen(vec!["307 Temporary Redirect"]).await;
    let mut address = Address::listen(Vec::new()).await;
    let server = Server::start_sure(telling(&["http://127.0.0.1:1/", &elsewhere.url, &address.url])).await;
    recognize(&server, known_room(0)).await;
    assert_eq!(address.next().await.told()["type"], "room_changed");
    elsewhere.next().await;
    outcomes(&server, "refused", 1).await;
    assert!(elsewhere.calls.try_recv().is_err(), "nothing is followed");
    recognize(&server, frame()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_version_that_does_not_come_to_serve_is_told() {
    let mut address = Address::listen(Vec::new()).await;
    let folder = models();
    let settings =
        Settings { models: folder.path().to_owned(), models_poll_ms: 20, ..telling(&[&address.url]) };
    let _server = Server::of(settings).await;
    write_damaged_model(&folder.path().join("lab/2"));
    let told = address.next().await.told();
    assert_eq!(
        (&told["type"], &told["model"], &told["change"]),
        (&"swap_failed".into(), &"lab".into(), &"latest".into())
    );
    assert!(told["reason"].as_str().is_some_and(|reason| !reason.is_empty()), "{told}");
}
