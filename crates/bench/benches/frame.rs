//! Milliseconds a 640 x 480 JPEG frame takes on one thread, step by step and as a whole.
//!
//! The frames show the simulated lab and are rendered at the start; the model is trained on them. Each
//! measured call takes the next frame.
//!
//! `cargo bench -p roomsight-bench --bench frame`

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first surprise")]

use criterion::Criterion;
use roomsight_bench::drive::Drive;
use roomsight_bench::prepared::{FRAMES_PER_SECOND, Prepared, camera_name};
use roomsight_bench::step::{self, Step};
use roomsight_lab::simulate::CameraKind;
use std::time::Duration;

fn main() {
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_secs(1))
        .measurement_time(Duration::from_secs(4))
        .configure_from_args();
    for &camera in CameraKind::ALL {
        let folder = tempfile::tempdir().unwrap();
        Prepared::write(folder.path(), &Drive::render(camera, FRAMES_PER_SECOND));
        let prepared = Prepared::read(folder.path(), usize::MAX);
        let mut group = criterion.benchmark_group(camera_name(camera));
        for name in step::OF_A_FRAME.into_iter().chain(step::WORDS) {
            let mut step = Step::new(name, &prepared);
            let mut next = (0..step.n_frames()).cycle();
            group.bench_function(name, |bencher| {
                bencher.iter(|| next.next().map(|frame_idx| step.take_frame(frame_idx)));
            });
        }
        group.finish();
    }
    criterion.final_summary();
}
