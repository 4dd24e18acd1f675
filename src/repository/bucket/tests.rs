//! Against a real S3 server: moto's, which `make test-python` installs. ROOMSIGHT_MOTO_SERVER names another.

mod networks;

use super::*;
use roomsight_recognition::model::GOLDEN_FOLDER;
use std::io::{BufRead, BufReader, Read};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Once, Weak};
use std::thread;

/// Long enough for a server on this machine, short enough for a test.
const BRIEF: Duration = Duration::from_secs(10);

/// How long a call may take that is known to fail.
const BRIEFEST: Duration = Duration::from_millis(300);

/// A server that is stopped when the last test is done with it.
struct Moto {
    child: Child,
    port: u16,
}

impl Moto {
    /// The server that all tests share; none, and a word about it, where there is no program.
    fn shared() -> Option<Arc<Self>> {
        static SHARED: Mutex<Weak<Moto>> = Mutex::new(Weak::new());
        let mut shared = SHARED.lock().unwrap();
        if let Some(moto) = shared.upgrade() {
            return Some(moto);
        }
        let installed = concat!(env!("CARGO_MANIFEST_DIR"), "/target/python/bin/moto_server");
        let program = std::env::var("ROOMSIGHT_MOTO_SERVER").unwrap_or_else(|_| installed.to_owned());
        if !Path::new(&program).exists() {
            static TOLD: Once = Once::new();
            // Past the test's own output, which is shown of failed tests only.
            TOLD.call_once(|| {
                let what = "LEFT OUT: models in a bucket";
                writeln!(io::stderr(), "{what}. {program} is missing; `make test-python` installs it.")
                    .unwrap();
            });
            return None;
        }
        let moto = Arc::new(Self::start(&program));
        *shared = Arc::downgrade(&moto);
        Some(moto)
    }

    fn start(program: &str) -> Self {
        let arguments = ["-H", "127.0.0.1", "-p", "0"];
        let mut child = Command::new(program).args(arguments).stderr(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
        let port = lines.by_ref().find_map(|line| {
            let line = line.unwrap();
            let (_, port) = line.split_once("http://127.0.0.1:")?;
            port.trim().parse().ok()
        });
        // It must not wait for somebody to read what it says.
        thread::spawn(move || lines.for_each(drop));
        Self { child, port: port.unwrap() }
    }

    /// Makes a bucket, for which this server asks no key.
    fn make(&self, bucket: &str) {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        write!(stream, "PUT /{bucket} HTTP/1.0\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(answer.lines().next().is_some_and(|status| status.contains(" 200 ")), "{answer}");
    }
}

impl Drop for Moto {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Between a bucket and its server: lets everything through, nothing, or is gone.
struct Proxy {
    port: u16,
    stalls: Arc<AtomicBool>,
    is_gone: Arc<AtomicBool>,
}

impl Proxy {
    fn before(moto: &Moto) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let (port, behind) = (listener.local_addr().unwrap().port(), moto.port);
        let (stalls, is_gone) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        let proxy = Self { port, stalls: stalls.clone(), is_gone: is_gone.clone() };
        thread::spawn(move || {
            for client in listener.incoming() {
                let client = client.unwrap();
                // Dropping the connection is all that a server does that is gone.
                if is_gone.load(Ordering::SeqCst) {
                    continue;
                }
                let server = TcpStream::connect(("127.0.0.1", behind)).unwrap();
                for (from, to) in [(&client, &server), (&server, &client)] {
                    let (from, to) = (from.try_clone().unwrap(), to.try_clone().unwrap());
                    let (stalls, is_gone) = (stalls.clone(), is_gone.clone());
                    thread::spawn(move || {
                        pass(from, to, &|| (stalls.load(Ordering::SeqCst), is_gone.load(Ordering::SeqCst)));
                    });
                }
            }
        });
        proxy
    }
}

/// Passes bytes on until one side ends; `state` says whether to swallow them, and whether to end.
fn pass(mut from: TcpStream, mut to: TcpStream, state: &dyn Fn() -> (bool, bool)) {
    let mut buffer = [0; 4096];
    while let Ok(n_bytes @ 1..) = from.read(&mut buffer) {
        let (stalls, is_gone) = state();
        if is_gone || (!stalls && to.write_all(&buffer[..n_bytes]).is_err()) {
            break;
        }
    }
    let _ = from.shutdown(Shutdown::Both);
    let _ = to.shutdown(Shutdown::Both);
}

/// A bucket of its own for a test, seen through a proxy, and a cache.
struct Lab {
    /// Runs as long as this is held.
    _moto: Arc<Moto>,
    proxy: Proxy,
    bucket: &'static str,
    cache: TempDir,
}

impl Lab {
    fn new(bucket: &'static str) -> Option<Self> {
        let moto = Moto::shared()?;
        moto.make(bucket);
        Some(Self { proxy: Proxy::before(&moto), _moto: moto, bucket, cache: TempDir::new().unwrap() })
    }

    fn open(&self, patience: Duration) -> Bucket {
        let builder = AmazonS3Builder::new()
            .with_endpoint(format!("http://127.0.0.1:{}", self.proxy.port))
            .with_region("us-east-1")
            .with_access_key_id("test")
            .with_secret_access_key("test");
        let location = format!("s3://{}/of/robots", self.bucket);
        Bucket::connect(builder, &location, self.cache.path(), patience).unwrap()
    }
}

/// Writes an object past the repository.
fn overwrite(bucket: &Bucket, path: &str, content: &str) {
    bucket.remote.write(path, content.into(), PutMode::Overwrite).unwrap();
}

/// Publishes what passes for a model.
fn publish(bucket: &Bucket, id: &VersionId, content: &str) -> Result<(), RepositoryError> {
    let staged = bucket.stage().unwrap();
    let about = format!("{{\"blake3\":\"{}\"}}", blake3::hash(content.as_bytes()).to_hex());
    fs::create_dir(staged.path().join(GOLDEN_FOLDER)).unwrap();
    for (name, content) in [(MODEL_FILE, content), (ABOUT_FILE, &about), ("golden/k\u{fc}che.jpg", "a frame")]
    {
        fs::write(staged.path().join(name), content).unwrap();
    }
    bucket.publish(id, &staged)
}

fn content(bucket: &Bucket, id: &VersionId) -> String {
    fs::read_to_string(bucket.fetch(id).unwrap().join(MODEL_FILE)).unwrap()
}

fn versions(scan: &Scan) -> Vec<u64> {
    scan.models.get("lab").map(|listing| listing.versions.keys().copied().collect()).unwrap_or_default()
}

#[test]
fn a_version_goes_there_and_back_and_away() {
    let Some(lab) = Lab::new("round-trip") else { return };
    let bucket = lab.open(BRIEF);
    assert_eq!(bucket.scan().unwrap(), Scan::default());
    let (first, second) = (VersionId::new("lab", 1), VersionId::new("lab", 12));
    publish(&bucket, &first, "first").unwrap();
    publish(&bucket, &second, "second").unwrap();
    assert!(matches!(publish(&bucket, &first, "other"), Err(RepositoryError::Exists(_))));
    assert_eq!(versions(&bucket.scan().unwrap()), [1, 12]);
    assert_eq!((content(&bucket, &first), content(&bucket, &second)), ("first".into(), "second".into()));
    let golden = bucket.fetch(&first).unwrap().join("golden/k\u{fc}che.jpg");
    assert_eq!(fs::read_to_string(golden).unwrap(), "a frame");

    let record = ServingRecord::default().activated(12);
    bucket.write_record("lab", &record).unwrap();
    let other = lab.open(BRIEF);
    assert_eq!(other.record("lab").unwrap(), record);
    assert_eq!(other.record("attic").unwrap(), ServingRecord::default());
    assert_eq!(other.scan().unwrap().models["lab"].record, record);

    bucket.delete(&first).unwrap();
    assert!(matches!(bucket.delete(&first), Err(RepositoryError::NoVersion(_))));
    assert_eq!(versions(&bucket.scan().unwrap()), [12]);
    let left = fs::read_dir(lab.open(BRIEF).cache.root()).unwrap().count();
    lab.open(BRIEF).scan().unwrap();
    let kept = fs::read_dir(bucket.cache.root()).unwrap().count();
    assert_eq!(left, kept + 1, "what was deleted is cached no longer");
}

#[test]
fn what_is_not_whole_is_no_version() {
    let Some(lab) = Lab::new("foreign") else { return };
    let bucket = lab.open(BRIEF);
    for path in ["lab/1/model.safetensors", "lab/07/model.json", "notes.txt", "two words/1/model.json"] {
        overwrite(&bucket, path, "{}");
    }
    let scan = bucket.scan().unwrap();
    assert_eq!((versions(&scan), scan.foreign.len()), (vec![], 4), "{:?}", scan.foreign);
    let id = VersionId::new("lab", 1);
    assert!(matches!(bucket.fetch(&id), Err(RepositoryError::NoVersion(_))));
    publish(&bucket, &id, "the upload comes again").unwrap();
    assert_eq!(content(&bucket, &id), "the upload comes again");
}

#[test]
fn of_two_who_publish_the_same_version_one_does_and_the_other_writes_nothing() {
    let Some(lab) = Lab::new("publishers") else { return };
    let (bucket, other) = (lab.open(BRIEF), lab.open(BRIEF));
    let id = VersionId::new("lab", 1);
    // The first has begun.
    let about = |content: &str| format!("{{\"blake3\":\"{}\"}}", blake3::hash(content.as_bytes()).to_hex());
    overwrite(&bucket, "lab/1/model.json", &about("ours"));
    overwrite(&bucket, "lab/1/golden/ours.jpg", "a frame of ours");
    assert_eq!(versions(&bucket.scan().unwrap()), [0_u64; 0], "it is not whole");
    let begun: Vec<String> = bucket.files(&id).unwrap().into_iter().map(|file| file.tag).collect();
    let late = publish(&other, &id, "theirs").unwrap_err();
    assert!(matches!(late, RepositoryError::HalfUploaded(_)), "{late}");
    assert!(late.to_string().contains("models delete lab/1"), "{late}");
    assert_eq!(bucket.files(&id).unwrap().into_iter().map(|file| file.tag).collect::<Vec<_>>(), begun);
    // It broke off, and comes again.
    publish(&bucket, &id, "ours").unwrap();
    assert_eq!(content(&bucket, &id), "ours");
    assert!(matches!(publish(&other, &id, "ours"), Err(RepositoryError::Exists(_))));
    assert_eq!(bucket.files(&id).unwrap().len(), 3, "what was left is gone");

    overwrite(&bucket, "lab/2/model.json", &about("ours"));
    bucket.delete(&VersionId::new("lab", 2)).unwrap();
    publish(&other, &VersionId::new("lab", 2), "theirs").unwrap();
}

#[test]
fn the_default_model_is_kept_in_the_bucket_and_for_a_start_without_it() {
    let Some(lab) = Lab::new("default") else { return };
    let (bucket, other) = (lab.open(BRIEF), lab.open(BRIEF));
    publish(&bucket, &VersionId::new("lab", 1), "a model").unwrap();
    assert_eq!(bucket.default_model().unwrap(), None);
    let first = DefaultModel::after(None, "lab");
    bucket.write_default(&first).unwrap();
    let late = other.write_default(&DefaultModel::after(None, "attic"));
    assert!(matches!(late, Err(RepositoryError::DefaultOvertaken(model)) if model == "lab"));
    other.write_default(&DefaultModel::after(Some(&first), "attic")).unwrap();
    let scan = bucket.scan().unwrap();
    assert_eq!(scan.default.as_ref().map(|default| default.model.as_str()), Some("attic"));
    assert!(scan.foreign.is_empty(), "{:?}", scan.foreign);
    lab.proxy.is_gone.store(true, Ordering::SeqCst);
    assert_eq!(lab.open(BRIEFEST).scan().unwrap().default, scan.default);
}

#[test]
fn damaged_bytes_do_not_enter_the_cache() {
    let Some(lab) = Lab::new("damaged") else { return };
    let bucket = lab.open(BRIEF);
    let id = VersionId::new("lab", 1);
    publish(&bucket, &id, "a model").unwrap();
    let before = bucket.scan().unwrap();
    assert_eq!(content(&bucket, &id), "a model");
    overwrite(&bucket, "lab/1/model.safetensors", "A model");
    let after = bucket.scan().unwrap();
    assert_ne!(before.models["lab"].versions, after.models["lab"].versions);
    let error = bucket.fetch(&id).unwrap_err().to_string();
    assert!(error.contains("lab/1 is damaged") && error.contains("digest"), "{error}");
    overwrite(&bucket, "lab/serving.json", "{");
    let scan = bucket.scan().unwrap();
    assert!(scan.foreign.iter().any(|line| line.contains(RECORD_FILE)), "{:?}", scan.foreign);
    assert_eq!(versions(&scan), [1]);
}

#[test]
fn of_two_who_decide_at_once_one_is_told_so() {
    let Some(lab) = Lab::new("both") else { return };
    let (bucket, other) = (lab.open(BRIEF), lab.open(BRIEF));
    let first = ServingRecord::default().activated(1);
    for _ in 0..2 {
        let (before, mode) = bucket.read_record("lab").unwrap();
        let theirs = before.activated(before.epoch + 1);
        other.write_record("lab", &theirs).unwrap();
        let ours = serde_json::to_vec(&before.activated(9)).unwrap();
        assert!(!bucket.remote.write("lab/serving.json", ours, mode).unwrap());
        assert!(matches!(bucket.write_record("lab", &first), Err(RepositoryError::Overtaken { .. })));
        assert_eq!(bucket.record("lab").unwrap(), theirs);
    }
}

#[test]
fn without_its_server_a_bucket_has_what_it_had() {
    let Some(lab) = Lab::new("gone") else { return };
    let bucket = lab.open(BRIEF);
    let (id, never_fetched) = (VersionId::new("lab", 1), VersionId::new("lab", 2));
    publish(&bucket, &id, "a model").unwrap();
    publish(&bucket, &never_fetched, "another").unwrap();
    bucket.write_record("lab", &ServingRecord::default().activated(1)).unwrap();
    let scan = bucket.scan().unwrap();
    bucket.fetch(&id).unwrap();

    lab.proxy.is_gone.store(true, Ordering::SeqCst);
    let error = bucket.scan().unwrap_err().to_string();
    assert!(error.contains("s3://gone/of/robots") && error.contains("cannot be reached"), "{error}");
    let restarted = lab.open(BRIEFEST);
    assert_eq!(restarted.scan().unwrap().models, scan.models);
    assert_eq!(content(&restarted, &id), "a model");
    assert!(matches!(restarted.fetch(&never_fetched), Err(RepositoryError::Bucket { .. })));
    assert!(matches!(
        publish(&restarted, &VersionId::new("lab", 3), ""),
        Err(RepositoryError::Bucket { .. })
    ));

    lab.proxy.is_gone.store(false, Ordering::SeqCst);
    let back = lab.open(BRIEF);
    assert_eq!(back.scan().unwrap(), scan);
    lab.proxy.is_gone.store(true, Ordering::SeqCst);
    assert!(back.scan().is_err(), "it was seen since it was opened");
}

#[test]
fn a_server_that_stalls_is_not_waited_for() {
    let Some(lab) = Lab::new("slow") else { return };
    let id = VersionId::new("lab", 1);
    publish(&lab.open(BRIEF), &id, "a model").unwrap();
    lab.proxy.stalls.store(true, Ordering::SeqCst);
    let bucket = lab.open(BRIEFEST);
    let error = bucket.scan().unwrap_err().to_string();
    assert!(error.contains("in time"), "{error}");
    assert!(bucket.fetch(&id).unwrap_err().to_string().contains("in time"));
    assert!(bucket.record("lab").unwrap_err().to_string().contains("in time"));
    let written = bucket.write_record("lab", &ServingRecord::default());
    assert!(written.unwrap_err().to_string().contains("in time"));
}

#[test]
fn a_location_that_is_no_bucket_says_how_to_give_one() {
    let cache = TempDir::new().unwrap();
    for location in ["s3://", "s3:///models", "s3://bucket//models", "s3://bucket/../models"] {
        let error = Bucket::open(location, cache.path()).unwrap_err().to_string();
        assert!(error.contains("s3://bucket/prefix"), "{location}: {error}");
    }
}
