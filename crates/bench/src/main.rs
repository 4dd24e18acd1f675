//! Writes what is measured, counts a step under callgrind, and tells how long steps take when it is asked.
//!
//! - `roomsight-bench prepare FOLDER [training]` writes frames, models and a memory, and with `training` what the training
//!   steps take.
//! - `roomsight-bench count FOLDER STEP CAMERA N` takes N frames after one that warms up. Only what happens in `take_frame` is to be
//!   counted: `valgrind --tool=callgrind --toggle-collect='*take_frame*'`.
//! - `roomsight-bench time FOLDER` reads lines of `STEP CAMERA N` and answers each, as soon as it comes, with one line of JSON:
//!   the thread's CPU milliseconds a frame, in one pass over N frames, and what was found.

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first surprise")]

use roomsight_bench::drive::Drive;
use roomsight_bench::prepared::{FRAMES_PER_SECOND, Prepared, camera_name, read_memory, write_memory};
use roomsight_bench::step::{Found, Step};
use roomsight_bench::training::Training;
use roomsight_lab::simulate::CameraKind;
use serde_json::{Value, json};
use std::env;
use std::io::{BufRead, Write, stdin, stdout};
use std::path::Path;
use std::time::Duration;

fn main() {
    let arguments: Vec<String> = env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["prepare", folder] => prepare(Path::new(folder)),
        ["prepare", folder, "training"] => {
            prepare(Path::new(folder));
            Training::write(&Path::new(folder).join("training"));
        }
        ["count", folder, name, camera, n_frames] => {
            with_step(Path::new(folder), name, camera, n_frames.parse().unwrap(), count);
        }
        ["time", folder] => answer(Path::new(folder)),
        _ => panic!("roomsight-bench prepare FOLDER [training] | count FOLDER STEP CAMERA N | time FOLDER"),
    }
}

fn prepare(folder: &Path) {
    for &camera in CameraKind::ALL {
        Prepared::write(&folder.join(camera_name(camera)), &Drive::render(camera, FRAMES_PER_SECOND));
    }
    write_memory(&folder.join("memory"));
}

fn with_step<Out>(
    folder: &Path,
    name: &str,
    camera: &str,
    n_frames: usize,
    measure: impl FnOnce(&mut Step) -> Out,
) -> Out {
    if name == "recall" {
        let (memory, frames) = read_memory(&folder.join("memory"), n_frames);
        measure(&mut Step::recall(&memory, &frames))
    } else {
        let prepared = Prepared::read(&folder.join(camera), n_frames);
        measure(&mut Step::new(name, &prepared))
    }
}

fn count(step: &mut Step) {
    step.warm_up();
    for frame_idx in 0..step.n_frames() {
        step.take_frame(frame_idx);
    }
}

fn answer(folder: &Path) {
    // Whatever would be shared among threads is done by this one, whose time is taken.
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global().unwrap();
    for line in stdin().lock().lines() {
        let line = line.unwrap();
        let [name, camera, n_frames] = line.split(' ').collect::<Vec<_>>()[..] else {
            panic!("STEP CAMERA N, not {line}")
        };
        let training = || Training::read(&folder.join("training"));
        let answer = match name {
            "k_means" => k_means(&training()),
            "svm" => train_svm(&training()),
            _ => with_step(folder, name, camera, n_frames.parse().unwrap(), time),
        };
        println!("{answer}");
        stdout().flush().unwrap();
    }
}

fn time(step: &mut Step) -> Value {
    step.warm_up();
    let start = thread_time();
    let found: Vec<Found> = (0..step.n_frames()).map(|frame_idx| step.take_frame(frame_idx)).collect();
    let ms = milliseconds_since(start) / step.n_frames() as f64;
    let n_found: usize = found.iter().map(|found| found.n).sum();
    json!({"ms": ms, "found": n_found, "places": found.iter().map(|found| found.places).sum::<f64>()})
}

fn k_means(training: &Training) -> Value {
    let start = thread_time();
    let vocabulary = training.cluster();
    let ms = milliseconds_since(start);
    json!({"ms": ms, "inertia": training.inertia(vocabulary.centers())})
}

fn train_svm(training: &Training) -> Value {
    let start = thread_time();
    let svm = training.train_svm();
    let ms = milliseconds_since(start);
    json!({"ms": ms, "support_vectors": svm.support_vectors().n_rows()})
}

fn milliseconds_since(start: Duration) -> f64 {
    (thread_time() - start).as_secs_f64() * 1000.0
}

/// What this thread has used of a CPU.
#[cfg(unix)]
fn thread_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

#[cfg(not(unix))]
fn thread_time() -> Duration {
    panic!("the CPU time of a thread is read on Unix alone")
}
