//! A service on a loopback port, and what is sent to it.

use roomsight::http::{App, serve};
use roomsight::settings::Settings;
use roomsight_recognition::model::{
    self, CarriedNetwork, Config, DEFAULT_NETWORK, Extractor, Model, Networks, OpinionConfig, Representation,
    Sample, Scan, Scratch, VectorConfig,
};
use roomsight_recognition::vocabulary;
use roomsight_vision::camera::{Camera, Projection};
use roomsight_vision::image::{Image, Limits};
use roomsight_vision::network::{Runtime, Size};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};
use std::time::Duration;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::{JoinHandle, spawn_blocking};

/// What a caller is told who waits before it sends a body.
pub const CONTINUE: &str = "HTTP/1.1 100 Continue\r\n\r\n";

/// Patience with what must happen, on the slowest machine.
pub const SOON: Duration = Duration::from_secs(30);

/// A running service. It stops when told, or when dropped.
pub struct Server {
    pub app: App,
    pub url: String,
    pub address: String,
    stop: Option<oneshot::Sender<()>>,
    task: JoinHandle<io::Result<()>>,
    _models: Option<TempDir>,
}

impl Server {
    /// A service of one small model, `lab`, version 1.
    pub async fn start(settings: Settings) -> Self {
        let models = models();
        let settings = Settings { models: models.path().to_owned(), ..settings };
        let mut server = Self::of(settings).await;
        server._models = Some(models);
        server
    }

    /// The same with a model whose answers are known, to frames that show something.
    pub async fn start_sure(settings: Settings) -> Self {
        let models = TempDir::new().expect("a temporary folder");
        SURE_MODEL.save(&models.path().join("lab/1"), &[]).expect("the model is saved");
        let mut server = Self::of(Settings { models: models.path().to_owned(), ..settings }).await;
        server._models = Some(models);
        server
    }

    /// A service of the models that the settings name.
    pub async fn of(settings: Settings) -> Self {
        let app = App::start(settings).expect("the service starts");
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
        let address = listener.local_addr().expect("an address").to_string();
        let (stop, stopped) = oneshot::channel();
        let task = tokio::spawn(serve(app.clone(), listener, async {
            let _ = stopped.await;
        }));
        Self { app, url: format!("http://{address}"), address, stop: Some(stop), task, _models: None }
    }

    /// Opens a connection and sends these few bytes over it.
    pub fn send_raw(&self, bytes: &[u8]) -> TcpStream {
        let mut stream = TcpStream::connect(&self.address).expect("a connection");
        stream.write_all(bytes).expect("bytes are taken");
        stream
    }

    /// Tells the service to stop.
    pub fn stop(&mut self) {
        drop(self.stop.take());
    }

    /// Waits until the service has stopped.
    pub async fn stopped(self) {
        self.task.await.expect("no panic").expect("no error");
    }

    /// Posts a body of a type.
    pub fn post_as(&self, path: &str, media_type: &str, body: Vec<u8>) -> reqwest::RequestBuilder {
        client().post(format!("{}{path}", self.url)).header("content-type", media_type).body(body)
    }

    /// Posts an image as it is.
    pub fn post(&self, path: &str, image: Vec<u8>) -> reqwest::RequestBuilder {
        self.post_as(path, "application/octet-stream", image)
    }

    pub fn get(&self, path: &str) -> reqwest::RequestBuilder {
        client().get(format!("{}{path}", self.url))
    }
}

/// A folder of models with `lab/1` in it.
pub fn models() -> TempDir {
    let folder = TempDir::new().expect("a temporary folder");
    write_model(&folder.path().join("lab/1"));
    folder
}

/// Writes a small model into a new folder.
pub fn write_model(folder: &Path) {
    MODEL.save(folder, &[]).expect("the model is saved");
}

/// Writes a model that calls the same rooms x, y and z.
pub fn write_other_model(folder: &Path) {
    OTHER_MODEL.save(folder, &[]).expect("the model is saved");
}

/// A small model.
pub static MODEL: LazyLock<Model> = LazyLock::new(|| train(&with_words(), ["stripes", "bars", "dots"]));
/// One that promises little of the answers that are known.
static SURE_MODEL: LazyLock<Model> = LazyLock::new(|| {
    let mut config = with_words();
    config.calibration.known_precision = 0.5;
    train(&config, ["stripes", "bars", "dots"])
});
/// One that gives the same rooms other names.
pub static OTHER_MODEL: LazyLock<Model> = LazyLock::new(|| train(&with_words(), ["x", "y", "z"]));

pub fn with_words() -> Config {
    let bag = vocabulary::Config { n_words: 12, ..vocabulary::Config::default() };
    Config::default().with_bag(|machines| machines.representation = Representation::Bag(bag))
}

/// Writes a model that looks through a network, and returns the library of ONNX Runtime; says that `what` is left out
/// where `make networks` was not run.
pub fn write_model_with_network(folder: &Path, what: &str) -> Option<PathBuf> {
    let networks = Path::new(env!("CARGO_MANIFEST_DIR")).join("networks");
    let library = Runtime::find(&networks).map_err(|error| eprintln!("LEFT OUT: {what}. {error}.")).ok()?;
    Runtime::load(&library).expect("`make networks` leaves an ONNX Runtime that loads");
    let network = CarriedNetwork::read(&networks.join(format!("{DEFAULT_NETWORK}.onnx"))).expect("a network");
    let mut vector = VectorConfig::default();
    vector.lens.size = Some(Size { width: 64, height: 64 });
    let opinions = BTreeMap::from([("vector".to_owned(), OpinionConfig::Vector(vector))]);
    let mut config = Config { opinions, ..Config::default() };
    config.link(&Networks::from([(DEFAULT_NETWORK.to_owned(), Arc::new(network))])).expect("it runs");
    train(&config, ["stripes", "bars", "dots"]).save(folder, &[]).expect("the model is saved");
    Some(library)
}

/// Trains on stripes, bars and dots.
fn train(config: &Config, names: [&str; 3]) -> Model {
    train_beside(config, names, |_| None)
}

/// The same with a scan beside the frame of each room, which are seen 16 times.
pub fn train_beside(config: &Config, names: [&str; 3], scan: impl Fn(u32) -> Option<Scan>) -> Model {
    let camera = Camera::new(Projection::Perspective);
    let extractor = Extractor::new(config, camera.clone());
    let sample = |idx: u32| {
        let image = Image::decode(&room(idx % 3, idx * 7), &Limits::default()).expect("an image");
        let scan = scan(idx % 3);
        let seen = model::Frame { image: &image, scan: scan.as_ref() };
        Sample {
            room: names[idx as usize % 3].to_owned(),
            sequence: format!("drive {}", idx % 4),
            name: format!("{idx}.jpg"),
            pose: None,
            picture: None,
            features: extractor.extract(seen, &mut Scratch::default()),
        }
    };
    let samples: Vec<Sample> = (0..48).map(sample).collect();
    Model::train(&samples.iter().collect::<Vec<_>>(), config, camera, |_| ()).expect("a model").model
}

/// A frame of the room stripes, bars or dots, seen from somewhere.
pub fn room(room_idx: u32, shift: u32) -> Vec<u8> {
    pgm(96, 72, |column, row| {
        let (x, y) = (column + shift % 24, row + shift / 24 % 24);
        let is_bright = match room_idx {
            0 => x % 24 < 6 && y % 12 < 9,
            1 => y % 24 < 6 && x % 12 < 9,
            _ => x % 12 < 4 && y % 12 < 4,
        };
        if is_bright { 200 } else { 40 + ((column * 31 + row * 17 + shift) % 5) as u8 }
    })
}

/// A frame of a room that the model of [`Server::start_sure`] knows.
pub fn known_room(room_idx: u32) -> Vec<u8> {
    let is_known = |frame: &Vec<u8>| {
        let image = Image::decode(frame, &Limits::default()).expect("an image");
        let seen = SURE_MODEL.recognize(&image, &mut Scratch::default());
        seen.known && SURE_MODEL.rooms()[seen.room_idx] == ["stripes", "bars", "dots"][room_idx as usize]
    };
    let (probability, novelty) = (SURE_MODEL.known_probability(), SURE_MODEL.known_novelty());
    let known = (0..500).map(|shift| room(room_idx, shift)).find(is_known);
    known.unwrap_or_else(|| panic!("known are those from {probability:?} on and up to {novelty:?}"))
}

/// A file that claims to be a model.
pub fn write_damaged_model(folder: &Path) {
    fs::create_dir_all(folder).expect("a folder");
    fs::write(folder.join("model.safetensors"), "not a model").expect("a file");
    fs::write(folder.join("model.json"), r#"{"blake3":"0"}"#).expect("a file");
}

pub fn client() -> reqwest::Client {
    roomsight_client::install_provider();
    reqwest::Client::builder().no_proxy().build().expect("a client")
}

/// The type of what [`form`] makes.
pub const FORM: &str = "multipart/form-data; boundary=edge";

/// A form with a field `frame` for each frame.
pub fn form(frames: &[&[u8]]) -> Vec<u8> {
    let mut body = Vec::new();
    for frame in frames {
        body.extend(b"--edge\r\ncontent-disposition: form-data; name=\"frame\"; filename=\"f\"\r\n\r\n");
        body.extend(*frame);
        body.extend(b"\r\n");
    }
    body.extend(b"--edge--\r\n");
    body
}

/// A PGM whose pixels a function of column and row gives.
pub fn pgm(width: u32, height: u32, pixel: impl Fn(u32, u32) -> u8) -> Vec<u8> {
    let mut bytes = format!("P5\n{width} {height}\n255\n").into_bytes();
    bytes.extend(
        (0..height).flat_map(|row| (0..width).map(move |column| (column, row))).map(|(c, r)| pixel(c, r)),
    );
    bytes
}

/// A small frame with corners in it.
pub fn frame() -> Vec<u8> {
    room(0, 0)
}

/// Reads an answer that must be an error of this status and kind; returns it.
pub async fn problem(response: reqwest::Response, status: u16, kind: &str) -> Value {
    let headers = response.headers().clone();
    let told = response.status().as_u16();
    let text = response.text().await.expect("a body");
    assert_eq!(told, status, "{text}");
    assert_eq!(headers["content-type"], "application/problem+json", "{text}");
    let body: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(body["type"], format!("/problems/{kind}"), "{text}");
    assert_eq!(body["status"], status, "{text}");
    assert!(body["title"].as_str().is_some_and(|title| !title.is_empty()), "{text}");
    assert!(body["detail"].as_str().is_some_and(|detail| !detail.is_empty()), "{text}");
    assert!(body["request_id"].as_str().is_some_and(|id| !id.is_empty()), "{text}");
    assert_eq!(headers["x-request-id"], body["request_id"].as_str().expect("a text"), "{text}");
    body
}

/// Reads an answer that must be a success; returns it.
pub async fn success(response: reqwest::Response) -> Value {
    let status = response.status();
    let text = response.text().await.expect("a body");
    assert_eq!(status, 200, "{text}");
    serde_json::from_str(&text).expect("JSON")
}

/// Reads until an object of JSON ends, the other side closes, or says nothing for long.
pub async fn read_raw(mut stream: TcpStream) -> String {
    let read = move || {
        let (mut text, mut bytes) = (String::new(), [0; 4096]);
        stream.set_read_timeout(Some(SOON)).expect("a time-out can be set");
        while !text.ends_with('}')
            && let Ok(n_bytes @ 1..) = stream.read(&mut bytes)
        {
            text.push_str(&String::from_utf8_lossy(&bytes[..n_bytes]));
        }
        text
    };
    spawn_blocking(read).await.expect("no panic")
}

/// Waits for what must come next. It blocks: the service needs another thread.
pub fn read_exactly(stream: &mut TcpStream, text: &str) {
    let mut bytes = vec![0; text.len()];
    stream.set_read_timeout(Some(SOON)).expect("a time-out can be set");
    stream.read_exact(&mut bytes).expect("an answer");
    assert_eq!(String::from_utf8_lossy(&bytes), text);
}
