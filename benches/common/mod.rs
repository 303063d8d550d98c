//! What the benches share: the scenes, the backends, one page of facts about the machine, short measurements.

#![allow(dead_code)] // Each bench uses its part.

use std::path::Path;
use std::time::Duration;

use criterion::Criterion;
use glam::Vec3;
use pathspace::Scene;
use pathspace::backend::{self, BackendKind, BackendOptions};
use pathspace::machine::Processor;
use pathspace::render::RenderOptions;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::geometry::Geometry;

/// Short measurements: all benches together take less than three minutes. For small differences ask criterion for
/// longer ones (`cargo bench --bench trace -- --measurement-time 10`).
pub fn criterion() -> Criterion {
    facts();
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(800))
        .configure_from_args()
}

/// The backends that are compared. `brute` is the oracle of the tests, not a competitor.
pub fn kinds() -> impl Iterator<Item = BackendKind> {
    BackendKind::available().iter().copied().filter(|kind| *kind != BackendKind::Brute)
}

/// Prints processor, instruction sets, versions and the query modes that really run.
pub fn facts() {
    let processor = Processor::detect();
    println!("machine {} ({}), pathspace {}", processor.name, processor.isa(), env!("CARGO_PKG_VERSION"));
    for kind in kinds() {
        let empty = backend::select::build(kind, &Geometry::default(), &BackendOptions::default());
        let info = empty.as_ref().map(|backend| backend.info()).unwrap_or_else(|e| panic!("{e}"));
        println!(
            "{} {} ({}), camera {}, bounce {}, shadow {}",
            kind.name(),
            info.version,
            info.isa,
            info.rays_coherent,
            info.rays_incoherent,
            info.rays_shadow
        );
    }
}

/// A scene that comes along, by its folder; with its environment if it has one.
pub fn scene(name: &str) -> Scene {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let mut scene = Scene::load(folder.join("scene.gltf")).unwrap_or_else(|e| panic!("{e}"));
    let environment = folder.join("env.exr");
    if environment.is_file() {
        scene.load_environment(environment, 0.0, 1.0).unwrap_or_else(|e| panic!("{e}"));
    }
    scene
}

/// 595 214 triangles: 160 smooth spheres in a lit room.
pub fn spheres() -> Scene {
    room(31)
}

/// The same room with about `triangles` triangles: spheres of fewer or more rows.
pub fn spheres_of(triangles: f64) -> Scene {
    // A sphere of n rows has 4n(n − 1) triangles.
    room((0.5 + (0.25 + triangles / 640.0).sqrt()).round() as u32)
}

fn room(rows: u32) -> Scene {
    let mut builder = SceneBuilder::new();
    let (white, lamp) = (builder.lambert(Vec3::splat(0.7)), builder.emitter(Vec3::ZERO, Vec3::splat(10.0)));
    builder.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
    let ceiling = [(-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3)];
    builder.quad(ceiling.map(|(x, z)| Vec3::new(x, 0.99, z)), lamp);
    for i in 0..160u32 {
        // The lattice of the plastic number fills the room evenly.
        let at = |alpha: f64| (((f64::from(i) + 0.5) * alpha).fract() * 1.8 - 0.9) as f32;
        let center = Vec3::new(at(0.819_172_513_396_164_4), at(0.671_043_606_703_789_2), at(0.549_700_477_901_970_9));
        builder.sphere(center, 0.08, rows, false, true, white);
    }
    builder.camera(Vec3::new(0.0, 0.0, 0.95), Vec3::ZERO, Vec3::Y, 1.2);
    builder.build()
}

/// A small frame for one thread.
pub fn options(side: u32, spp: u64) -> RenderOptions {
    RenderOptions::new(side, side).spp(spp).threads(1)
}
