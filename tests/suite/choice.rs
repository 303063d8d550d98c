//! The choice of a backend by counted work. Exact, no false alarms: counts are whole numbers, drawn from fixed numbers.

use std::thread;

use glam::{Affine3A, Vec3};
use pathspace::backend::count::{self, Counts};
use pathspace::backend::{BackendKind, select};
use pathspace::bench::suite::scenes;
use pathspace::plan::RenderPlan;
use pathspace::plan::view::view_of;
use pathspace::scene::Scene;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::geometry::Geometry;

use crate::common::options;

fn counts(scene: &Scene) -> Counts {
    let geometry = Geometry::build(scene);
    count::of(&geometry, &view_of(scene, &geometry), &select::DIVISION)
}

/// The scenes of the suite that tests can afford.
fn small() -> impl Iterator<Item = Scene> {
    scenes::ALL.iter().filter(|entry| (300..9_000).contains(&entry.about)).map(|entry| (entry.make)())
}

/// A room with instances in it, one of which moves, and a lamp: balls of 1200 triangles.
fn instances() -> Scene {
    let mut builder = SceneBuilder::new();
    let (white, lamp) = (builder.lambert(Vec3::splat(0.7)), builder.emitter(Vec3::ZERO, Vec3::splat(5.0)));
    builder.cuboid(Vec3::splat(-2.0), Vec3::splat(2.0), true, white);
    builder.quad([(-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3)].map(|(x, z)| Vec3::new(x, 1.9, z)), lamp);
    let mut ball = Scene::default();
    {
        let mut inner = SceneBuilder::new();
        let white = inner.lambert(Vec3::splat(0.7));
        inner.sphere(Vec3::ZERO, 0.4, 18, false, false, white);
        ball.meshes = inner.build().meshes;
    }
    let mesh = builder.mesh(ball.meshes[0].positions.clone(), ball.meshes[0].triangles.clone(), white);
    let at = |x: f32| Affine3A::from_translation(Vec3::new(x, -0.5, 0.0));
    builder.place(mesh, at(-1.0)).place(mesh, at(0.0)).place_moving(mesh, vec![at(1.0), at(1.3)]);
    builder.camera(Vec3::Z * 1.9, Vec3::ZERO, Vec3::Y, 1.0);
    builder.build()
}

/// Oracle: another run, on another thread, beside others. Every class has rays, and every ray of a closed room ends.
#[test]
fn counts_are_the_same_every_time() {
    for scene in small().chain([instances()]) {
        let first = counts(&scene);
        let again: Vec<Counts> = thread::scope(|scope| {
            let threads: Vec<_> = (0..2).map(|_| scope.spawn(|| counts(&scene))).collect();
            threads.into_iter().map(|thread| thread.join().expect("it counts")).collect()
        });
        assert!(again.iter().all(|counts| *counts == first));
        assert!(first.rays[0] == 512 && first.rays[1] > 100 && first.rays[2] > 100, "{:?}", first.rays);
        let visits = count::sum(&first.whole);
        assert!(visits.nodes > 0 && visits.leaves > 0, "{visits:?}");
    }
}

/// Oracle: what the scene has in it. Instances are entered, in the whole and in the rest; behind large faces go fewer
/// rays, which visit less.
#[test]
fn counts_see_instances_and_walls() {
    let counts = counts(&instances());
    let divided = counts.divided.as_ref().expect("walls");
    assert!(count::sum(&counts.whole).instances > 0);
    assert_eq!((divided.faces, divided.volumes), (7, 3));
    let near = divided.near.iter().sum::<u64>();
    assert!(near > 0 && near < counts.all_rays(), "{near} of {}", counts.all_rays());
    let (whole, rest) = (count::sum(&counts.whole), count::sum(&divided.rest));
    assert!(rest.nodes < whole.nodes && rest.leaves < whole.leaves, "{rest:?} of {whole:?}");
}

/// Oracle: the plan itself. The choice is the least of the candidates' costs, its reason has the figures, and neither
/// camera, size, seed nor threads change it.
#[test]
fn choices_follow_from_counts_alone() {
    for scene in small().chain([instances()]) {
        let geometry = Geometry::build(&scene);
        let plan = |options| RenderPlan::new(&scene, &geometry, &options).unwrap_or_else(|e| panic!("{e}"));
        let first = plan(options(8, 8, 1));
        let costs = select::candidates(&counts(&scene), select::few_faces(&geometry));
        let least = costs.iter().copied().reduce(|a, b| if b.1 < a.1 { b } else { a }).expect("candidates");
        assert_eq!(first.backend, least.0);
        for (kind, cost) in &costs {
            let figure = format!("{} {cost:.1}", kind.name());
            assert!(first.backend_reason.contains(&figure), "{figure}: {}", first.backend_reason);
        }
        let other = plan(options(31, 9, 4).seed(7).threads(3));
        assert_eq!((other.backend, &other.backend_reason), (first.backend, &first.backend_reason));
        let again = first.again(&scene, &geometry, &options(9, 9, 2)).expect("valid options");
        assert_eq!((again.backend, &again.backend_reason), (first.backend, &first.backend_reason));
    }
}

/// Without a ray nothing costs anything, and the first backend of the build is taken.
#[test]
fn scenes_that_nobody_looks_at_take_the_first_backend() {
    let nothing = count::of(&Geometry::default(), &Default::default(), &select::DIVISION);
    assert_eq!(nothing, Counts::default());
    let scene = small().last().expect("a scene");
    let geometry = Geometry::build(&scene);
    let choice = select::fastest(&geometry, Default::default);
    assert_eq!(choice.kind, BackendKind::available()[0], "{}", choice.reason);
}
