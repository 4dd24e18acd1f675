//! The memory of places: to answer a frame of 200 descriptors from 320,000 that are remembered, on one thread, and
//! to make that memory from its parts.
//!
//! `cargo bench --bench memory`

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first surprise")]

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use roomsight_recognition::classify::memory::{Config, Memory, Origin, Prepared};
use roomsight_vision::matrix::Matrix;

const N_FRAMES: usize = 1600;
const N_PLACES: usize = 25;
const N_DESCRIPTORS: usize = 200;
const WIDTH: usize = 72;

/// Things that can be seen; real descriptors cluster as well.
const N_THINGS: usize = 4000;

/// Frames that show things, a little changed.
struct World {
    things: Vec<Vec<f32>>,
    random: ChaCha8Rng,
}

impl World {
    fn new() -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let thing = |_| (0..WIDTH).map(|_| random.random_range(0.0..1.0f32).powi(4)).collect();
        let things = (0..N_THINGS).map(thing).collect();
        Self { things, random }
    }

    fn frame(&mut self) -> Matrix {
        let mut rows = Matrix::new(WIDTH);
        for _ in 0..N_DESCRIPTORS {
            let thing = &self.things[self.random.random_range(0..N_THINGS)];
            let seen: Vec<f32> =
                thing.iter().map(|value| value + self.random.random_range(0.0..0.3)).collect();
            let length = seen.iter().map(|value| value * value).sum::<f32>().sqrt();
            rows.push_row(&seen.iter().map(|value| value / length).collect::<Vec<_>>());
        }
        rows
    }
}

fn remembered(world: &mut World) -> Memory {
    let frames: Vec<Matrix> = (0..N_FRAMES).map(|_| world.frame()).collect();
    let prepared = Prepared::new(&frames.iter().collect::<Vec<_>>(), &Config::default(), 1).unwrap();
    let origin = |frame_idx| Origin { room_idx: frame_idx % N_PLACES, frame_idx };
    let chosen: Vec<(usize, Origin)> =
        (0..N_FRAMES).map(|frame_idx| (frame_idx, origin(frame_idx))).collect();
    prepared.memory(&chosen, N_PLACES)
}

fn bench(criterion: &mut Criterion) {
    let mut world = World::new();
    let memory = remembered(&mut world);
    let queries: Vec<Matrix> = (0..50).map(|_| world.frame()).collect();
    let mut next = queries.iter().cycle();
    criterion.bench_function("a frame's answer", |bencher| {
        bencher.iter(|| memory.recall(next.next().unwrap()));
    });
    let mut group = criterion.benchmark_group("slow");
    group.sample_size(10);
    group.bench_function("a frame's exact answer", |bencher| {
        bencher.iter(|| memory.recall_visiting(&queries[0], memory.n_lists()));
    });
    let parts = memory.to_parts();
    group.bench_function("a memory from its parts", |bencher| {
        let from_parts = |parts| Memory::from_parts(parts, &Config::default(), N_PLACES).unwrap();
        bencher.iter_batched(|| parts.clone(), from_parts, BatchSize::LargeInput);
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
