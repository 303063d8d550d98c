//! Time to build the hierarchy: `bvh_build/SCENE/BACKEND`, one thread, triangles per second.

mod common;

use criterion::{BenchmarkId, Criterion, Throughput};
use pathspace::backend::{self, BackendOptions};
use pathspace::scene::geometry::Geometry;

fn bvh_build(criterion: &mut Criterion) {
    let scenes = [
        ("cornell-box", common::scene("cornell-box")),
        ("env-object", common::scene("env-object")),
        ("spheres", common::spheres()),
    ];
    for (name, scene) in scenes {
        let geometry = Geometry::build(&scene);
        let mut group = criterion.benchmark_group(format!("bvh_build/{name}"));
        group.throughput(Throughput::Elements(geometry.triangles.len() as u64));
        for kind in common::kinds() {
            let options = BackendOptions { build_threads: 1, ..BackendOptions::default() };
            group.bench_function(BenchmarkId::from_parameter(kind.name()), |bencher| {
                bencher.iter(|| backend::select::build(kind, &geometry, &options).expect("the backend is there"));
            });
        }
    }
}

fn main() {
    let mut criterion = common::criterion();
    bvh_build(&mut criterion);
    criterion.final_summary();
}
