//! Normals and fronts under transforms that stretch and mirror (HARDCASES G17), baked into the world mesh and
//! instanced. Oracle: the inverse transpose, closed form.

use glam::{Affine3A, Vec3};
use pathspace::plan::Aov;
use pathspace::plan::options::RenderOptions;
use pathspace::render::Renderer;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::geometry::BAKE_MESH_TRIANGLES;
use pathspace::scene::{Mesh, Projection, PunctualKind, Scene};

use super::Case;
use crate::common::{options, probe};
use crate::conformance::variants;

/// (0.4472136, 0.8944272, 0): the object's normal (1, 1, 0)/√2 after a scale of (2, 1, 1).
const NORMAL: [f64; 3] = [0.447_213_595_499_957_9, 0.894_427_190_999_915_9, 0.0];

/// A square of `n`² cells across (1, 1, 0), white, in the sun of irradiance π from +y, scaled by (`x`, 1, 1); beside
/// it the same again, so that a fine one is instanced.
fn leaning(n: u32, x: f32, smooth: bool) -> Scene {
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::ONE);
    let point = |i: u32, j: u32| {
        let [s, t] = [i, j].map(|i| 2.0 * i as f32 / n as f32 - 1.0);
        Vec3::new(s, -s, t)
    };
    let positions: Vec<Vec3> = (0..=n).flat_map(|i| (0..=n).map(move |j| point(i, j))).collect();
    let at = |i: u32, j: u32| i * (n + 1) + j;
    let triangles = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
        [[a, b, c], [a, c, d]]
    });
    let normal = Vec3::new(1.0, 1.0, 0.0).normalize();
    let mesh = Mesh {
        name: "leaning".into(),
        normals: smooth.then(|| vec![normal; positions.len()]),
        triangles: triangles.collect(),
        positions,
        material: white,
        ..Mesh::default()
    };
    let mesh = b.full_mesh(mesh);
    for z in [0.0, -5.0] {
        b.place(mesh, Affine3A::from_translation(Vec3::Z * z) * Affine3A::from_scale(Vec3::new(x, 1.0, 1.0)));
    }
    b.punctual(Vec3::ZERO, Vec3::NEG_Y, Vec3::splat(std::f32::consts::PI), PunctualKind::Directional);
    let away = Vec3::new(x.signum(), 1.0, 0.25);
    b.any_camera(away, Vec3::ZERO, Vec3::Z, Projection::Orthographic { xmag_m: 0.25, ymag_m: 0.25 });
    b.build()
}

/// A closed box that shines outwards, mirrored.
fn mirrored_lamp() -> Scene {
    let mut b = SceneBuilder::new();
    let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
    b.cuboid(Vec3::splat(-0.5), Vec3::splat(0.5), false, lamp);
    let mut scene = b.build();
    scene.instances[0].world_from_object = Affine3A::from_scale(Vec3::new(-2.0, 1.0, 1.0));
    scene
}

#[test]
fn g17_stretched_and_mirrored() {
    let mut case =
        Case::open("G17", "non-uniform scale and mirrored instance", "transformation of normals, orientation");
    // Fine enough to be instanced, and coarse enough to be baked.
    let fine = ((BAKE_MESH_TRIANGLES / 2) as f32).sqrt() as u32 + 1;
    for row in variants() {
        for (name, n) in [("baked", 2), ("instanced", fine)] {
            for (x, smooth) in [(2.0, false), (-2.0, false), (2.0, true), (-2.0, true)] {
                let scene = leaning(n, x, smooth);
                let options = options(8, 8, 1).aovs(vec![Aov::NORMAL]).backend(row.kind).rays(row.mode);
                let renderer = Renderer::new(&scene, options).expect("a valid scene");
                assert_eq!(renderer.geometry().instances.len(), if n == fine { 2 } else { 0 });
                let render = renderer.render().expect("renders");
                let expected = [NORMAL[0] * f64::from(x.signum()), NORMAL[1], 0.0];
                let normals = render.film.layer(Aov::NORMAL).expect("asked for");
                let normals = normals.iter().flat_map(|n| (0..3).map(|c| (expected[c], n[c], 2e-7)));
                let radiance = render.film.pixels.iter().map(|p| (NORMAL[1], p.mean()[0], 2e-7));
                let shading = if smooth { "smooth" } else { "flat" };
                case.numbers(format!("{}, {name}, {shading}, × {x}", row.name()), normals.chain(radiance));
            }
        }
        // Outside of the lamp, then inside: 1 and 0 to the bit.
        let lamp = mirrored_lamp();
        let on = RenderOptions::default().backend(row.kind).rays(row.mode);
        let seen = |from: Vec3, dir: Vec3| probe(&lamp, from, dir, 64, on.clone());
        let outside = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Z].map(|d| seen(d * 3.0, -d));
        let inside = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Z].map(|d| seen(Vec3::splat(0.1), d));
        let wrong = outside.iter().filter(|e| e.mean != [1.0; 3] || e.variance != [0.0; 3]).count()
            + inside.iter().filter(|e| e.mean != [0.0; 3]).count();
        case.bits(format!("{}, mirrored lamp", row.name()), wrong);
    }
    case.close();
}
