//! Everything but tracing: `shade/SCENE`, a frame whose hits are answered from memory, one thread, paths per second.
//! The copying of the hits is included, about a tenth of it.

mod common;

use std::ops::ControlFlow;

use criterion::{BenchmarkId, Criterion, SamplingMode, Throughput};
use pathspace::bench::playback::Playback;
use pathspace::render::Renderer;

const SIDE: u32 = 32;
const SPP: u64 = 8;

fn shade(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("shade");
    group.throughput(Throughput::Elements(u64::from(SIDE * SIDE) * SPP)).sampling_mode(SamplingMode::Flat);
    for name in ["cornell-box", "veach-mis", "glass-caustics", "env-object"] {
        let scene = common::scene(name);
        let renderer = Renderer::new(&scene, common::options(SIDE, SPP)).unwrap_or_else(|e| panic!("{e}"));
        let memory = Playback::new(renderer.backend());
        let render = || renderer.render_through(&memory, |_| ControlFlow::Continue(())).expect("a render");
        assert_eq!(render().film.hash(), render().film.hash(), "{name}: what is remembered is what was traced");
        group.bench_function(BenchmarkId::from_parameter(name), |bencher| {
            bencher.iter_custom(|times| (0..times).map(|_| render().render_time).sum());
        });
    }
}

fn main() {
    let mut criterion = common::criterion();
    shade(&mut criterion);
    criterion.final_summary();
}
