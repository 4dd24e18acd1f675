//! A picture through the default network: on one thread, and on two threads that run it at the same time, each with
//! a session of its own, as recognizing threads do.
//!
//! `make networks && cargo bench --bench network`; NETWORKS names another folder of networks.

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first surprise")]

use criterion::{Criterion, criterion_group, criterion_main};
use roomsight_recognition::model::DEFAULT_NETWORK;
use roomsight_vision::network::{Network, Runtime, Session, Size};
use std::hint::black_box;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use std::{env, thread};

const SIZES: [Size; 2] = [Size { width: 224, height: 224 }, Size { width: 384, height: 224 }];

fn bench(criterion: &mut Criterion) {
    let folder = PathBuf::from(env::var_os("NETWORKS").unwrap_or_else(|| "networks".into()));
    let network = Network::open(&folder.join(format!("{DEFAULT_NETWORK}.onnx"))).unwrap();
    let runtime = Runtime::load(&Runtime::find(&folder).unwrap()).unwrap();
    for size in SIZES {
        for n_threads in [1, 2] {
            let sessions = || network.session(&runtime, size).unwrap();
            let mut sessions: Vec<Session> = (0..n_threads).map(|_| sessions()).collect();
            let name = format!("{} x {}, {n_threads} at a time", size.width, size.height);
            criterion.bench_function(&name, |bencher| {
                bencher.iter_custom(|n_rounds| at_the_same_time(&mut sessions, n_rounds));
            });
        }
    }
}

/// How long it takes until each session has run `n_rounds` pictures.
fn at_the_same_time(sessions: &mut [Session], n_rounds: u64) -> Duration {
    let start = Instant::now();
    thread::scope(|scope| {
        for session in sessions {
            scope.spawn(move || {
                let Size { width, height } = session.size();
                let picture = vec![0.1; 3 * width as usize * height as usize];
                for _ in 0..n_rounds {
                    black_box(session.run(&picture).unwrap());
                }
            });
        }
    });
    start.elapsed()
}

criterion_group!(benches, bench);
criterion_main!(benches);
