//! A connection of a robot: what it sends reaches the service through a socket, as it does in use.

use roomsight::access::{Key, Role};
use roomsight::http::{App, serve};
use roomsight::settings::Settings;
use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::path::Path;
use std::sync::OnceLock;
use std::time::Duration;

/// How long an answer may take; slow processors have other reasons to be late.
const PATIENCE: Duration = Duration::from_secs(5);

/// The key that the service knows; a robot's, so that nothing that serves is changed.
pub fn robots_key() -> String {
    key().0
}

fn key() -> (String, Key) {
    Key::new(Role::Robot, "wall-e", &[7; 32]).expect("a name of letters")
}

/// Starts the service, before the time of an input is taken.
pub fn start_service() {
    address();
}

/// One connection, which sends these bytes: requests, or a handshake and the messages of a stream. It is never
/// answered with an internal error, and comes to an end.
pub fn service(bytes: &[u8]) {
    let answer = exchange(bytes).unwrap_or_default();
    let is_internal = answer.windows(13).any(|window| window == b"HTTP/1.1 500 ");
    assert!(!is_internal, "{}", String::from_utf8_lossy(&answer));
}

/// What comes back until the service has nothing more to say.
///
/// # Errors
/// A connection that breaks.
pub fn exchange(bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut connection = TcpStream::connect(address())?;
    connection.set_read_timeout(Some(PATIENCE))?;
    connection.set_write_timeout(Some(PATIENCE))?;
    connection.write_all(bytes)?;
    let mut answer = Vec::new();
    let read = connection.read_to_end(&mut answer);
    let _closed = connection.shutdown(Shutdown::Both);
    // What breaks off has said something before.
    if answer.is_empty() { read.map(|_| answer) } else { Ok(answer) }
}

/// Of a service that runs until the process ends.
fn address() -> SocketAddr {
    static ADDRESS: OnceLock<SocketAddr> = OnceLock::new();
    *ADDRESS.get_or_init(|| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
        let model = "models/simulated-lab/1";
        let models = [folder.join(model), folder.join("..").join(model)];
        // Whoever says nothing more is soon sent away.
        let settings = Settings {
            models: models.into_iter().find(|path| path.is_dir()).expect("the model of the repository"),
            keys: vec![key().1],
            threads: 1,
            max_frame_side: 2048,
            max_frame_pixels: 1 << 20,
            max_decode_bytes: 64 << 20,
            header_timeout_ms: 50,
            body_timeout_ms: 50,
            stream_ping_ms: 100,
            stream_idle_timeout_ms: 100,
            stream_write_timeout_ms: 100,
            stream_resume_ms: 100,
            ..Settings::default()
        };
        let runtime = tokio::runtime::Runtime::new().expect("threads");
        let bind = || tokio::net::TcpListener::bind("127.0.0.1:0");
        let listener = runtime.block_on(async { bind().await }).expect("a free port");
        let address = listener.local_addr().expect("it is bound");
        let app = App::start(settings).expect("the model of the repository serves");
        std::thread::spawn(move || runtime.block_on(serve(app, listener, std::future::pending())));
        address
    })
}
