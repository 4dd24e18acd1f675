//! What a stream costs beside the recognition itself, and what many streams cost.
//!
//! Each round measures one after the other, with the same frames and as many threads: recognition in this
//! process, and one robot that streams them in the mode `lossless` to a service in a process of its own. Then
//! a thousand streams that send nothing. It reads the CPU time and memory of the service from /proc, so that
//! it runs on Linux only.

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first surprise")]

mod service;

use roomsight_client::Client;
use roomsight_protocol::stream::{Configure, Mode, ServerMessage};
use roomsight_recognition::model::{Model, Scratch};
use roomsight_vision::image::{Image, Limits};
use service::{MODEL, Service, cpu_seconds, frames, memory_kib};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

const ROUNDS: usize = 5;
const ROUND: Duration = Duration::from_secs(3);
const N_IDLE: usize = 1000;

/// Frames a second, and milliseconds of CPU a frame.
#[derive(Clone, Copy)]
struct Speed {
    frames_per_second: f64,
    cpu_ms: f64,
}

fn main() {
    let frames = frames();
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    for n_threads in [1, std::thread::available_parallelism().unwrap().get()] {
        let service = Service::start(&["--models", MODEL, "--threads", &n_threads.to_string()]);
        let rounds: Vec<(Speed, Speed)> = (0..ROUNDS)
            .map(|_| {
                let in_process = in_process(&frames, n_threads);
                (in_process, runtime.block_on(streamed(&frames, &service)))
            })
            .collect();
        let median = |value: fn(&(Speed, Speed)) -> f64| {
            let mut values: Vec<f64> = rounds.iter().map(value).collect();
            values.sort_by(f64::total_cmp);
            values[ROUNDS / 2]
        };
        println!(
            "{n_threads} threads: in process {:.0} frames/s, {:.2} ms CPU a frame; streamed {:.0} frames/s, \
             {:.2} ms; ratios {:.3} and {:.3}",
            median(|(alone, _)| alone.frames_per_second),
            median(|(alone, _)| alone.cpu_ms),
            median(|(_, streamed)| streamed.frames_per_second),
            median(|(_, streamed)| streamed.cpu_ms),
            median(|(alone, streamed)| streamed.frames_per_second / alone.frames_per_second),
            median(|(alone, streamed)| streamed.cpu_ms / alone.cpu_ms),
        );
    }
    let service = Service::start(&["--models", MODEL]);
    runtime.block_on(idle(&service));
}

fn in_process(frames: &[Vec<u8>], n_threads: usize) -> Speed {
    let model = Arc::new(Model::load(Path::new(MODEL)).unwrap().model);
    let n_done = AtomicUsize::new(0);
    let cpu = cpu_seconds(std::process::id());
    let began = Instant::now();
    std::thread::scope(|scope| {
        for _ in 0..n_threads {
            scope.spawn(|| {
                let mut scratch = Scratch::default();
                while began.elapsed() < ROUND {
                    let frame = &frames[n_done.fetch_add(1, Ordering::Relaxed) % frames.len()];
                    model.recognize(&Image::decode(frame, &Limits::default()).unwrap(), &mut scratch);
                }
            });
        }
    });
    speed(n_done.into_inner(), began.elapsed(), cpu_seconds(std::process::id()) - cpu)
}

async fn streamed(frames: &[Vec<u8>], service: &Service) -> Speed {
    let lossless = Configure { mode: Some(Mode::Lossless), ..Configure::default() };
    let mut stream = Client::new(&service.url, None).unwrap().stream(&lossless).await.unwrap();
    let window = stream.hello().limits.window;
    let cpu = cpu_seconds(service.process.id());
    let began = Instant::now();
    let (mut n_sent, mut n_done) = (0, 0);
    while began.elapsed() < ROUND || n_done < n_sent {
        while n_sent - n_done < window && began.elapsed() < ROUND {
            stream.send(frames[n_sent % frames.len()].clone()).await.unwrap();
            n_sent += 1;
        }
        if let ServerMessage::Result(_) = stream.receive().await.unwrap() {
            n_done += 1;
        }
    }
    speed(n_done, began.elapsed(), cpu_seconds(service.process.id()) - cpu)
}

async fn idle(service: &Service) {
    let client = Client::new(&service.url, None).unwrap();
    let before = memory_kib(service.process.id());
    let mut streams = Vec::new();
    for _ in 0..N_IDLE {
        streams.push(client.stream(&Configure::default()).await.unwrap());
    }
    let after = memory_kib(service.process.id());
    println!("{N_IDLE} idle streams: {:.1} KiB each", (after - before) / N_IDLE as f64);
}

fn speed(n_frames: usize, wall: Duration, cpu_seconds: f64) -> Speed {
    Speed {
        frames_per_second: n_frames as f64 / wall.as_secs_f64(),
        cpu_ms: cpu_seconds * 1e3 / n_frames as f64,
    }
}
