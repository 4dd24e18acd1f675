//! What it costs callers that models come and go.
//!
//! A service whose threads are all busy, by requests and by streams, is watched with swaps and for as long without,
//! again and again. Each swap loads its version from the disk and tries it, since three
//! versions take turns of which two are kept; after some of them a rollback follows. Every answer must be of
//! one version from start to end. Then many swaps without load, for the memory.
//!
//! MODEL names the folder of another model than the committed one, ROUNDS says how often.

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first surprise")]

mod service;

use hdrhistogram::Histogram;
use roomsight::repository::package;
use roomsight_client::Client;
use roomsight_protocol::rest::{Answer, RecognizeQuery};
use roomsight_protocol::stream::{Configure, Mode, ServerMessage};
use roomsight_protocol::version_id::VersionId;
use roomsight_recognition::model::{GOLDEN_FOLDER, write_about};
use service::{MODEL, Service, frames_of, memory_kib};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use std::{env, fs};
use tempfile::TempDir;
use tokio::task::JoinSet;
use tokio::time::sleep;

const NAME: &str = "lab";
/// Where ROUNDS does not say otherwise.
const ROUNDS: usize = 20;
const SWAPS_A_ROUND: u64 = 5;
const ROLLBACKS_A_ROUND: u64 = 1;
const PAUSE: Duration = Duration::from_millis(250);
const N_CALLERS: usize = 3;
const N_STREAMS: usize = 2;
const N_SWAPS_AT_REST: u64 = 500;

fn main() {
    let from = env::var_os("MODEL").map_or_else(|| PathBuf::from(MODEL), PathBuf::from);
    let n_rounds = env::var("ROUNDS").map_or(ROUNDS, |rounds| rounds.parse().unwrap());
    let models = models(&from);
    let folder = models.path().to_str().unwrap();
    let service = Service::start(&["--models", folder, "--policy", "manual", "--set", "models_poll_ms=0"]);
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    runtime.block_on(measure(&service, &Arc::new(frames_of(&from)), n_rounds));
}

/// Three versions; the second calls the same rooms by other names.
fn models(from: &Path) -> TempDir {
    let folder = TempDir::new().unwrap();
    for version in 1..=3 {
        let to = folder.path().join(NAME).join(version.to_string());
        fs::create_dir_all(&to).unwrap();
        package::copy(from, &to).unwrap();
        if version == 2 {
            fs::remove_dir_all(to.join(GOLDEN_FOLDER)).unwrap();
            let model = fs::read(to.join("model.safetensors")).unwrap();
            fs::write(to.join("model.safetensors"), with_other_names(model)).unwrap();
            fs::remove_file(to.join("model.json")).unwrap();
            write_about(&to).unwrap();
        }
    }
    folder
}

/// The model file with its rooms in capital letters.
fn with_other_names(mut model: Vec<u8>) -> Vec<u8> {
    let begin = model.windows(8).position(|window| window == br#"places\""#).unwrap();
    let length = model[begin..].iter().position(|&byte| byte == b']').unwrap();
    model[begin + 8..begin + length].make_ascii_uppercase();
    model
}

async fn measure(service: &Service, frames: &Arc<Vec<Vec<u8>>>, n_rounds: usize) {
    let admin = Client::new(&service.url, None).unwrap();
    swap(&admin, 1).await;
    let (mut ratios, mut n_answers) = (Vec::new(), 0);
    let mut next = 2;
    for _ in 0..n_rounds {
        let began = Instant::now();
        let swapping = async {
            for idx in 0..SWAPS_A_ROUND {
                swap(&admin, next).await;
                next = next % 3 + 1;
                sleep(PAUSE).await;
                if idx % (SWAPS_A_ROUND / ROLLBACKS_A_ROUND) == 0 {
                    admin.rollback(NAME, None).await.unwrap();
                    sleep(PAUSE).await;
                }
            }
        };
        let (with, n_with) = load(service, frames, swapping).await;
        let took = began.elapsed();
        let (without, n_without) = load(service, frames, sleep(took)).await;
        let ms = |latencies: &Histogram<u64>, quantile| latencies.value_at_quantile(quantile) as f64 / 1e3;
        println!(
            "{:.1} s: p50 {:.2} ms with swaps, {:.2} without; p99 {:.2} and {:.2}",
            took.as_secs_f64(),
            ms(&with, 0.5),
            ms(&without, 0.5),
            ms(&with, 0.99),
            ms(&without, 0.99),
        );
        ratios.push(ms(&with, 0.99) / ms(&without, 0.99));
        n_answers += n_without + n_with;
    }
    ratios.sort_by(f64::total_cmp);
    println!(
        "{} swaps and {} rollbacks under full load: {n_answers} frames, all answered, each by one version; p99 \
         with swaps is {:.3} of that without (median of {n_rounds} rounds)",
        n_rounds as u64 * SWAPS_A_ROUND,
        n_rounds as u64 * ROLLBACKS_A_ROUND,
        ratios[n_rounds / 2],
    );
    let mut memory = Vec::new();
    for idx in 0..=N_SWAPS_AT_REST {
        if idx % (N_SWAPS_AT_REST / 5) == 0 {
            memory.push(format!("{:.1}", memory_kib(service.process.id()) / 1024.0));
        }
        swap(&admin, idx % 3 + 1).await;
    }
    println!("memory over {N_SWAPS_AT_REST} further swaps, in MiB: {}", memory.join(", "));
}

async fn swap(admin: &Client, version: u64) {
    admin.activate(&VersionId::new(NAME, version), None).await.unwrap();
}

/// Keeps the service busy for as long as `during` takes: the latencies of all requests in microseconds, and
/// the number of all answers.
async fn load(
    service: &Service,
    frames: &Arc<Vec<Vec<u8>>>,
    during: impl Future<Output = ()>,
) -> (Histogram<u64>, u64) {
    let is_over = Arc::new(AtomicBool::new(false));
    let mut callers = JoinSet::new();
    for _ in 0..N_CALLERS {
        callers.spawn(post(Client::new(&service.url, None).unwrap(), frames.clone(), is_over.clone()));
    }
    let mut streams = JoinSet::new();
    for _ in 0..N_STREAMS {
        streams.spawn(stream(Client::new(&service.url, None).unwrap(), frames.clone(), is_over.clone()));
    }
    during.await;
    is_over.store(true, Ordering::Relaxed);
    let mut all = Histogram::new(3).unwrap();
    for latencies in callers.join_all().await {
        all.add(latencies).unwrap();
    }
    let n_posted = all.len();
    (all, n_posted + streams.join_all().await.iter().sum::<u64>())
}

async fn post(client: Client, frames: Arc<Vec<Vec<u8>>>, is_over: Arc<AtomicBool>) -> Histogram<u64> {
    let mut latencies = Histogram::new(3).unwrap();
    for frame in frames.iter().cycle() {
        if is_over.load(Ordering::Relaxed) {
            break;
        }
        let began = Instant::now();
        let answer = client.recognize(frame.clone(), &RecognizeQuery::default()).await.unwrap();
        latencies.record(began.elapsed().as_micros() as u64).unwrap();
        check(&answer);
    }
    latencies
}

async fn stream(client: Client, frames: Arc<Vec<Vec<u8>>>, is_over: Arc<AtomicBool>) -> u64 {
    let lossless = Configure { mode: Some(Mode::Lossless), ..Configure::default() };
    let mut stream = client.stream(&lossless).await.unwrap();
    let (mut n_sent, mut n_done) = (0, 0);
    while !is_over.load(Ordering::Relaxed) || n_done < n_sent {
        while n_sent - n_done < 2 && !is_over.load(Ordering::Relaxed) {
            stream.send(frames[n_sent as usize % frames.len()].clone()).await.unwrap();
            n_sent += 1;
        }
        match stream.receive().await.unwrap() {
            ServerMessage::Result(result) => {
                assert_eq!(result.seq, n_done);
                check(&result.answer);
                n_done += 1;
            }
            ServerMessage::ModelChanged(changed) => assert_eq!(changed.first_seq, n_done),
            other => panic!("{other:?}"),
        }
    }
    n_done
}

/// All of an answer is of the version that it names.
fn check(answer: &Answer) {
    let is_of_version = |room: &str| room.chars().any(char::is_lowercase) == (answer.model.version != 2);
    assert!(is_of_version(&answer.room), "{answer:?}");
    assert!(answer.probabilities.iter().all(|room| is_of_version(&room.room)), "{answer:?}");
}
