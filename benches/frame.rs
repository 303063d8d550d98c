//! Whole frames: `frame/SCENE/BACKEND`, one thread, paths per second.

mod common;

use criterion::{BenchmarkId, Criterion, SamplingMode, Throughput};
use pathspace::render::Renderer;

const SIDE: u32 = 48;
const SPP: u64 = 16;

fn frame(criterion: &mut Criterion) {
    let scenes = ["cornell-box", "veach-mis", "glass-caustics", "env-object"].map(|name| (name, common::scene(name)));
    for (name, scene) in scenes.into_iter().chain([("spheres", common::spheres())]) {
        let mut group = criterion.benchmark_group(format!("frame/{name}"));
        group.throughput(Throughput::Elements(u64::from(SIDE * SIDE) * SPP)).sampling_mode(SamplingMode::Flat);
        for kind in common::kinds() {
            let options = common::options(SIDE, SPP).backend(kind);
            let renderer = Renderer::new(&scene, options).unwrap_or_else(|e| panic!("{e}"));
            group.bench_function(BenchmarkId::from_parameter(kind.name()), |bencher| {
                bencher.iter_custom(|times| (0..times).map(|_| renderer.render().expect("a render").render_time).sum());
            });
        }
    }
}

fn main() {
    let mut criterion = common::criterion();
    frame(&mut criterion);
    criterion.final_summary();
}
