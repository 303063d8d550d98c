//! Bare rays: `trace/SCENE/CLASS/BACKEND`, the scene's own camera, bounce and shadow rays, one thread, the plan's query
//! modes. What the backends meet is compared before anything is timed.

mod common;

use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput};
use pathspace::backend;
use pathspace::bench::agree::Agreement;
use pathspace::bench::rates::MOST_DIFFERENT;
use pathspace::bench::record::{RayClass, Recording, count};
use pathspace::bench::replay;
use pathspace::render::Renderer;

fn trace(criterion: &mut Criterion) {
    let pool = replay::pool(1).expect("one thread");
    let scenes = [
        ("cornell-box", common::scene("cornell-box")),
        ("env-object", common::scene("env-object")),
        ("spheres", common::spheres()),
    ];
    for (name, scene) in scenes {
        let renderer = Renderer::new(&scene, common::options(64, 16)).unwrap_or_else(|e| panic!("{e}"));
        let (recording, _) = Recording::of(&renderer, 32 << 20).unwrap_or_else(|e| panic!("{e}"));
        let waves: Vec<_> = recording.waves.iter().map(Vec::as_slice).collect();
        let rays = count(&waves);
        let mut reference = None;
        for kind in common::kinds() {
            let options = renderer.plan().backend_options();
            let backend = backend::select::build(kind, renderer.geometry(), &options).unwrap_or_else(|e| panic!("{e}"));
            let outcomes = replay::outcomes(backend.as_ref(), &waves);
            let reference = reference.get_or_insert_with(|| outcomes.clone());
            let agreement = Agreement::of(&waves, &outcomes, reference);
            assert!(agreement.fraction() <= MOST_DIFFERENT, "{name}, {}: {agreement:?}", kind.name());

            for class in RayClass::ALL.into_iter().filter(|class| rays[*class as usize] > 0) {
                let mut group = criterion.benchmark_group(format!("trace/{name}/{}", class.name()));
                group.throughput(Throughput::Elements(rays[class as usize]));
                group.bench_function(BenchmarkId::from_parameter(kind.name()), |bencher| {
                    // Only the time inside the backend counts.
                    bencher.iter_custom(|times| {
                        let once = || replay::replay(backend.as_ref(), &waves, Some(class), &pool);
                        Duration::from_secs_f64((0..times).map(|_| once().seconds[class as usize]).sum())
                    });
                });
            }
        }
    }
}

fn main() {
    let mut criterion = common::criterion();
    trace(&mut criterion);
    criterion.final_summary();
}
