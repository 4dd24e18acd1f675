//! `roomsight serve`, `key` and `health` as an operator runs them.

use crate::http::service::models;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(20);

pub fn roomsight(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_roomsight"));
    command.args(args).stdin(Stdio::null());
    command
}

pub fn output(args: &[&str]) -> Output {
    roomsight(args).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// What a command that must fail says.
pub fn failure(args: &[&str]) -> String {
    let output = output(args);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    text(&output.stderr)
}

pub fn free_address() -> String {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string()
}

/// A service that runs. It is killed when the test ends early.
pub struct Running {
    child: Child,
    pub url: String,
}

impl Running {
    /// Runs `serve` with these arguments, on a port of its own, until it is ready.
    pub fn start(args: &[&str]) -> Self {
        Self::start_as(roomsight(&["serve"]), args)
    }

    /// The same with a command that runs `serve`, and what stands before its arguments.
    fn start_as(mut serve: Command, args: &[&str]) -> Self {
        let address = free_address();
        let child = serve.args(["--listen", &address]).args(args).stderr(Stdio::piped()).spawn().unwrap();
        let running = Self { child, url: format!("http://{address}") };
        running.wait_until(|| output(&["health", &running.url]).status.success());
        running
    }

    /// The same without a model, so that it listens and is not ready.
    pub fn start_unready(args: &[&str]) -> Self {
        let address = free_address();
        let mut serve = roomsight(&["serve", "--listen", &address]);
        let child = serve.args(args).stderr(Stdio::null()).spawn().unwrap();
        let running = Self { child, url: format!("http://{address}") };
        running.wait_until(|| TcpStream::connect(&address).is_ok());
        running
    }

    fn wait_until(&self, is_there: impl Fn() -> bool) {
        let started = Instant::now();
        while !is_there() {
            assert!(started.elapsed() < PATIENCE, "{} never got ready", self.url);
            sleep(Duration::from_millis(20));
        }
    }

    /// Sends it a signal.
    pub fn signal(&self, name: &str) {
        let id = self.child.id().to_string();
        assert!(Command::new("kill").args([&format!("-{name}"), &id]).status().unwrap().success());
    }

    /// Kills it, whatever it is doing.
    pub fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Tells it to stop; returns its log.
    pub fn stop(&mut self) -> String {
        self.signal("TERM");
        assert!(self.child.wait().unwrap().success());
        let mut log = String::new();
        self.child.stderr.as_mut().unwrap().read_to_string(&mut log).unwrap();
        log
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
    }
}

#[test]
fn serve_gets_ready_and_ends_well_when_told() {
    let models = models();
    let mut running = Running::start(&[
        "--models",
        models.path().to_str().unwrap(),
        "--log-format",
        "json",
        "--set",
        "log_level=debug",
    ]);
    let address = running.url.strip_prefix("http://").unwrap();
    // As in a container, which listens on all addresses.
    let everywhere = address.replace("127.0.0.1", "0.0.0.0");
    let health = roomsight(&["health"]).env("ROOMSIGHT_LISTEN", everywhere).output().unwrap();
    assert!(health.status.success(), "{}", text(&health.stderr));
    let log = running.stop();
    let answered: serde_json::Value =
        serde_json::from_str(log.lines().find(|line| line.contains("answered")).unwrap()).unwrap();
    assert_eq!(answered["status"], 200, "{answered}");
    assert_eq!(answered["span"]["route"], "/readyz", "{answered}");
    assert!(answered["span"]["request_id"].is_string(), "{answered}");
    assert!(failure(&["health", &running.url]).contains(&running.url));
}

#[test]
fn serve_says_why_it_does_not_start() {
    let models = models();
    let folder = models.path().to_str().unwrap();
    let others = failure(&["serve", "--models", folder, "--listen", "0.0.0.0:0"]);
    assert!(others.contains("--allow-anonymous") && others.contains("key new"), "{others}");
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let occupied = failure(&["serve", "--models", folder, "--listen", &address]);
    assert!(occupied.contains(&address) && occupied.contains("--listen"), "{occupied}");
    let nowhere = failure(&["serve", "--models", "/no/such/folder"]);
    assert!(nowhere.contains("/no/such/folder"), "{nowhere}");
    let unknown = failure(&["serve", "--models", folder, "--set", "quue=3"]);
    assert!(unknown.contains("quue"), "{unknown}");
}

#[test]
fn a_new_key_goes_into_the_settings_and_stays_hidden() {
    let made = text(&output(&["key", "new", "--role", "robot", "--name", "wall-e"]).stdout);
    let line =
        made.lines().find_map(|line| line.trim().strip_prefix("keys = [\"")?.strip_suffix("\"]")).unwrap();
    let hash = line.strip_prefix("robot:wall-e:").unwrap();
    assert_eq!(hash.len(), 64, "{made}");
    let printed = text(&output(&["serve", "--print-config", "--set", &format!("keys={line}")]).stdout);
    assert!(printed.contains("robot:wall-e:") && !printed.contains(hash), "{printed}");
    assert!(printed.contains("max_frame_bytes = "), "{printed}");
    let again = text(&output(&["key", "new", "--role", "robot", "--name", "wall-e"]).stdout);
    assert_ne!(made, again);
    let bound = ["key", "new", "--role", "robot", "--name", "kitchen", "--robots", "wall-e,eve"];
    assert!(text(&output(&bound).stdout).contains(":wall-e+eve\"]"), "{made}");
    let viewer = failure(&["key", "new", "--role", "viewer", "--name", "x", "--robots", "eve"]);
    assert!(viewer.contains("role robot"), "{viewer}");
    assert_eq!(output(&["key", "new", "--role", "king", "--name", "x"]).status.code(), Some(2));
}

#[test]
fn a_log_that_nobody_reads_stops_nothing() {
    let models = models();
    let mut running = Running::start(&["--models", models.path().to_str().unwrap()]);
    let address = running.url.strip_prefix("http://").unwrap().to_owned();
    // More lines than a pipe takes.
    for _ in 0..1500 {
        assert_eq!(status(&address, "GET /livez"), "200");
    }
    running.stop();
}

/// The status of the answer to a request without a body.
fn status(address: &str, request: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let head =
        format!("{request} HTTP/1.1\r\nhost: {address}\r\nconnection: close\r\ncontent-length: 0\r\n\r\n");
    stream.write_all(head.as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer.split(' ').nth(1).unwrap_or_default().to_owned()
}

/// `serve` where a shell has set limits before.
#[cfg(target_os = "linux")]
fn limited(limits: &str) -> Command {
    let mut command = Command::new("sh");
    let script = format!("{limits} && exec \"$0\" serve \"$@\"");
    command.args(["-c", &script, env!("CARGO_BIN_EXE_roomsight")]).stdin(Stdio::null());
    command
}

#[cfg(target_os = "linux")]
#[test]
fn as_many_files_may_be_open_as_the_settings_need_or_it_is_told() {
    let models = models();
    let args = [
        "--models",
        models.path().to_str().unwrap(),
        "--set",
        "max_connections=300",
        "--set",
        "max_streams=40",
    ];
    let mut raised = Running::start_as(limited("ulimit -S -n 100"), &args);
    let limits = std::fs::read_to_string(format!("/proc/{}/limits", raised.child.id())).unwrap();
    let files = limits.lines().find(|line| line.starts_with("Max open files")).unwrap();
    assert_eq!(files.split_whitespace().nth(3), Some("596"), "{files}");
    assert!(!raised.stop().contains("hard limit"));
    let mut told = Running::start_as(limited("ulimit -n 100"), &args);
    let log = told.stop();
    assert!(log.contains("`max_connections`") && log.contains("596"), "{log}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_file_that_may_not_grow_ends_nothing() {
    let models = models();
    let args = ["--models", models.path().to_str().unwrap()];
    let mut running = Running::start_as(limited("ulimit -f 0"), &args);
    let address = running.url.strip_prefix("http://").unwrap().to_owned();
    assert_eq!(status(&address, "POST /v2/repository/models/lab/unload"), "503", "no record can be written");
    assert_eq!(status(&address, "GET /livez"), "200");
    running.stop();
}
