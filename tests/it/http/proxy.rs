//! The service behind proxies, set up as a newcomer does and as `deploy/` says. Skipped, and said so, where a
//! proxy is not installed.

use crate::http::command::free_address;
use crate::http::robot::{Heard, Robot};
use crate::http::service::{FORM, SOON, Server, client, form, pgm, room, success};
use roomsight::settings::Settings;
use roomsight_protocol::stream::ServerMessage;
use std::fs;
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::time::{sleep, timeout};

const DEPLOY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/");
/// What nginx needs around a site, to run without being installed.
const NGINX: &str = "
    user root; daemon off; pid FOLDER/pid; worker_processes 1; events { worker_connections 64; }
    http {
        access_log off; client_body_temp_path FOLDER/body; proxy_temp_path FOLDER/proxy;
        fastcgi_temp_path FOLDER/fastcgi; uwsgi_temp_path FOLDER/uwsgi; scgi_temp_path FOLDER/scgi;
        SITE
    }";
/// Sites as the first page of a search has them.
const PLAIN_NGINX: &str = "server { listen 80; location / { proxy_pass http://127.0.0.1:8080; } }";
const PLAIN_HAPROXY: &str = "
defaults
    mode http
    timeout connect 5s
    timeout client 50s
    timeout server 50s
frontend web
    bind :80
    default_backend servers
backend servers
    server one 127.0.0.1:8080
";

/// A proxy that runs before a service, on an address of its own.
struct Proxy {
    child: Child,
    address: String,
    _folder: TempDir,
}

impl Proxy {
    async fn nginx(server: &Server, site: &str) -> Option<Self> {
        let (folder, address) = (TempDir::new().unwrap(), free_address());
        let config = NGINX
            .replace("SITE", site)
            .replace("FOLDER", folder.path().to_str().unwrap())
            .replace("listen 80;", &format!("listen {address};"))
            .replace("127.0.0.1:8080", &server.address);
        let file = folder.path().join("nginx.conf");
        fs::write(&file, config).unwrap();
        let mut command = Command::new(installed("nginx")?);
        command.args(["-e", "stderr", "-c"]).arg(file).arg("-p").arg(folder.path());
        Some(Self::start(command, address, folder).await)
    }

    async fn haproxy(server: &Server, config: &str) -> Option<Self> {
        let (folder, address) = (TempDir::new().unwrap(), free_address());
        let config = config
            .replace("bind :80\n", &format!("bind {address}\n"))
            .replace("127.0.0.1:8080", &server.address);
        let file = folder.path().join("haproxy.cfg");
        fs::write(&file, config).unwrap();
        let mut command = Command::new(installed("haproxy")?);
        command.arg("-db").arg("-f").arg(file);
        Some(Self::start(command, address, folder).await)
    }

    async fn start(mut command: Command, address: String, folder: TempDir) -> Self {
        let child = command.stdin(Stdio::null()).spawn().unwrap();
        let proxy = Self { child, address, _folder: folder };
        let started = Instant::now();
        while TcpStream::connect(&proxy.address).is_err() {
            assert!(started.elapsed() < SOON, "{command:?} does not listen");
            sleep(Duration::from_millis(20)).await;
        }
        proxy
    }

    async fn answers_frames(&self, n_rows: u32) {
        let frame = pgm(1000, n_rows, |column, row| ((column / 8 + row / 8) % 2 * 200) as u8);
        let post = |path: &str, media_type: &str, body: Vec<u8>| {
            let request = client().post(format!("http://{}{path}", self.address));
            request.header("content-type", media_type).body(body).send()
        };
        let answer = success(post("/v1/recognize", "image/jpeg", frame.clone()).await.unwrap()).await;
        assert!(answer["room"].is_string(), "{answer}");
        let batch = form(&[&frame[..], &room(1, 2)]);
        let batch = success(post("/v1/recognize/batch", FORM, batch).await.unwrap()).await;
        assert_eq!(batch["results"].as_array().unwrap().len(), 2, "{batch}");
        let refused = post("/v1/recognize", "image/jpeg", b"no image".to_vec()).await.unwrap();
        assert_eq!(refused.status(), 422);
        assert_eq!(refused.headers()["content-type"], "application/problem+json");
    }

    /// An event arrives while the response goes on.
    async fn passes_events_on(&self) {
        let url = format!("http://{}/v1", self.address);
        let mut events = client().get(format!("{url}/events")).send().await.unwrap();
        assert_eq!(events.headers()["content-type"], "text/event-stream");
        let answer = client().post(format!("{url}/recognize?robot=wall-e")).body(room(0, 0)).send().await;
        success(answer.unwrap()).await;
        let mut text = String::new();
        while !text.contains("\"robot\":\"wall-e\"") {
            let piece = timeout(SOON, events.chunk()).await.expect("the event comes at once");
            text += &String::from_utf8_lossy(&piece.unwrap().expect("the response goes on"));
        }
    }

    async fn carries_streams(&self) {
        let mut robot = Robot::try_connect_to(&self.address, "?robot=eve&mode=lossless", &[]).await.unwrap();
        for seq in 0..3 {
            robot.send(room(seq, 1)).await;
        }
        for expected in 0..3 {
            match robot.heard().await {
                Heard::Message(ServerMessage::Result(result)) => assert_eq!(result.seq, expected),
                other => panic!("{other:?}"),
            }
        }
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        // Asked to end, nginx ends its worker too.
        let asked = Command::new("kill").arg(self.child.id().to_string()).status();
        if asked.is_err() {
            let _ = self.child.kill();
        }
        let _ = self.child.wait();
    }
}

/// Where a program is; servers are often not on the path of those who may not start them.
fn installed(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::env::split_paths(&path).chain(["/usr/sbin".into(), "/usr/local/sbin".into()]);
    let found = folders.map(|folder| folder.join(name)).find(|file| file.is_file());
    if found.is_none() {
        eprintln!("LEFT OUT: the service behind {name}, which is not installed.");
    }
    found
}

#[tokio::test(flavor = "multi_thread")]
async fn behind_nginx_as_deploy_says_all_of_it_works() {
    let server = Server::start(Settings::default()).await;
    let site = fs::read_to_string(DEPLOY.to_owned() + "nginx.conf").unwrap();
    let Some(proxy) = Proxy::nginx(&server, &site).await else { return };
    proxy.answers_frames(2500).await;
    proxy.passes_events_on().await;
    proxy.carries_streams().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn behind_nginx_with_its_defaults_frames_and_events_work_and_streams_say_what_is_missing() {
    let server = Server::start(Settings::default()).await;
    let Some(proxy) = Proxy::nginx(&server, PLAIN_NGINX).await else { return };
    proxy.answers_frames(500).await;
    proxy.passes_events_on().await;
    let stream = client().get(format!("http://{}/v1/stream", proxy.address));
    let refused = stream.header("connection", "Upgrade").header("upgrade", "websocket").send().await.unwrap();
    assert_eq!(refused.status(), 426);
    let body = refused.text().await.unwrap();
    assert!(body.contains("proxy") && body.contains("Upgrade"), "{body}");
}

#[tokio::test(flavor = "multi_thread")]
async fn behind_haproxy_as_deploy_says_and_with_its_defaults_all_of_it_works() {
    let server = Server::start(Settings::default()).await;
    let config = fs::read_to_string(DEPLOY.to_owned() + "haproxy.cfg").unwrap();
    for config in [&config, PLAIN_HAPROXY] {
        let Some(proxy) = Proxy::haproxy(&server, config).await else { return };
        proxy.answers_frames(2500).await;
        proxy.passes_events_on().await;
        proxy.carries_streams().await;
    }
}
