//! The memory of places: to answer a frame of 200 descriptors from 320,000 that are remembered, on one thread, and
//! to make that memory from its parts.
//!
//! `cargo bench -p roomsight-bench --bench memory`

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first surprise")]

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use roomsight_bench::world::{N_PLACES, World};
use roomsight_recognition::classify::memory::{Config, Memory};
use roomsight_vision::matrix::Matrix;

fn bench(criterion: &mut Criterion) {
    let mut world = World::default();
    let memory = world.remembered();
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
