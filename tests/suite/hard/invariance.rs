//! A scene scaled or moved is the same scene (HARDCASES G10–G12): bit for bit where binary arithmetic allows it, else
//! within the specification's tolerance of the radiances of the room P07, which another solver computed (§4.3).

use glam::{Affine3A, DAffine3, DMat3, DVec3, Quat, Vec3};
use pathspace::math::float::{hit_error, hit_error_instanced, hit_point, shadow_segment, spawn_origin};
use pathspace::math::warp;
use pathspace::plan::options::{Lens, RenderOptions};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Environment, PunctualKind, Scene};

use super::Case;
use super::room::lamp_room;
use crate::common::{options, probe, render};
use crate::conformance::shapes::Rng;
use crate::conformance::{Row, variants};
use crate::loading::fixture::Fixture;

/// Reflected radiance of P07 at the floor's centre and at the centre of the wall x = 1.
const FLOOR_CENTER: f64 = 0.056_927_479_275_137_25;
const WALL_CENTER: f64 = 0.087_273_949_657_054_47;

/// Paths of one mean: 4.9 standard errors at the floor's centre are 0.46 %.
const PATHS: u32 = 170_000;

/// P07 with its positions mapped in f64 and rounded once.
fn room(place: impl Fn(DVec3) -> DVec3) -> Scene {
    let mut scene = lamp_room();
    for p in scene.meshes.iter_mut().flat_map(|mesh| &mut mesh.positions) {
        *p = place(p.as_dvec3()).as_vec3();
    }
    let camera = &mut scene.cameras[0].world_from_camera;
    camera.translation = place(camera.translation.as_dvec3()).as_vec3a();
    scene
}

/// A bit of everything that has a length: an area light, a point light, a sun, a sky, metal, and absorbing glass, with
/// all lengths multiplied by 2^k, intensities by 4^k.
fn everything(k: i32) -> Scene {
    let s = 2f32.powi(k);
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::splat(0.7));
    let lamp = b.emitter(Vec3::splat(0.2), Vec3::splat(4.0));
    let metal = b.metal(Vec3::new(0.9, 0.6, 0.4), 0.2);
    let glass = b.glass(1.5);
    b.cuboid(Vec3::new(-1.0, -1.0, -1.0) * s, Vec3::new(1.0, -0.9, 1.0) * s, false, white);
    b.cuboid(Vec3::new(-1.0, -0.9, -1.0) * s, Vec3::new(1.0, 1.0, -0.9) * s, false, white);
    b.quad([[-0.3, 0.9, -0.3], [0.3, 0.9, -0.3], [0.3, 0.9, 0.3], [-0.3, 0.9, 0.3]].map(|p| Vec3::from(p) * s), lamp);
    b.sphere(Vec3::new(-0.4, -0.5, -0.3) * s, 0.375 * s, 8, false, true, metal);
    b.sphere(Vec3::new(0.4, -0.55, 0.1) * s, 0.3125 * s, 8, false, true, glass);
    b.point_light(Vec3::new(0.5, 0.5, 0.75) * s, Vec3::splat(0.25) * (s * s));
    b.punctual(Vec3::ZERO, Vec3::new(-1.0, -2.0, -1.5), Vec3::splat(0.5), PunctualKind::Directional);
    b.environment(Environment::constant(Vec3::new(0.2, 0.3, 0.4)));
    b.camera(Vec3::new(0.25, 0.0, 2.5) * s, Vec3::new(0.0, -0.25, 0.0) * s, Vec3::Y, 0.9);
    let mut scene = b.build();
    let solid = &mut scene.materials[3];
    (solid.attenuation_color, solid.attenuation_distance_m) = (Vec3::new(0.9, 0.5, 0.3), 0.5 * s);
    // Spheres are evaluated in f64 and rounded; their scaled positions are the rounded ones scaled.
    let unscaled = if k == 0 { None } else { Some(everything(0)) };
    if let Some(unscaled) = unscaled {
        for (mesh, from) in scene.meshes.iter().zip(&unscaled.meshes) {
            assert!(mesh.positions.iter().zip(&from.positions).all(|(p, q)| *p == *q * s), "positions scale exactly");
        }
    }
    scene
}

fn on(row: &Row, options: RenderOptions) -> RenderOptions {
    options.backend(row.kind).rays(row.mode)
}

/// Pixels of which a bit differs.
fn differing(a: &pathspace::film::Film, b: &pathspace::film::Film) -> usize {
    a.pixels.iter().zip(&b.pixels).filter(|(a, b)| a != b).count()
}

/// Oracle: multiplication by 2^k commutes with every operation of binary arithmetic.
#[test]
fn g10_scale_by_a_power_of_two() {
    const EXPONENTS: [i32; 4] = [-20, -10, 10, 20];
    let mut case = Case::open("G10", "scale by a power of two: bit identity", "hidden absolute epsilons");
    let rooms = EXPONENTS.map(|k| room(|p| p * 2f64.powi(k)));
    let plain_room = room(|p| p);
    let scenes = EXPONENTS.map(everything);
    let plain = everything(0);
    for row in variants() {
        let options = on(&row, options(48, 48, 4));
        let lens = |k: i32| options.clone().lens(Lens { radius_m: 0.0625 * 2f32.powi(k), focus_m: 2.5 * 2f32.powi(k) });
        let room_film = render(&plain_room, options.clone()).film;
        let film = render(&plain, options.clone()).film;
        let lens_film = render(&plain, lens(0)).film;
        assert!(differing(&film, &lens_film) > 1000, "the lens blurs");
        for (i, k) in EXPONENTS.into_iter().enumerate() {
            let pixels = differing(&room_film, &render(&rooms[i], options.clone()).film)
                + differing(&film, &render(&scenes[i], options.clone()).film)
                + differing(&lens_film, &render(&scenes[i], lens(k)).film);
            case.bits(format!("{}, 2^{k}", row.name()), pixels);
        }
    }
    case.bits("spawn and segment functions", offsets_that_do_not_scale());
    case.close();
}

/// The functions of `math::float` on random triangles, in the world and in an instance, at 2^-20 … 2^40.
fn offsets_that_do_not_scale() -> usize {
    let mut rng = Rng::new(10);
    let mut wrong = 0;
    for _ in 0..20_000 {
        let [v0, e1, e2] = std::array::from_fn(|_| rng.cube());
        let [u, v] = warp::triangle_barycentric([rng.unit(), rng.unit()]);
        let (dir, receiver, n) = (rng.direction(), rng.cube() * 4.0, rng.direction());
        let turn = Quat::from_axis_angle(rng.direction(), 3.0 * rng.unit());
        let scale = DVec3::new(2.0, 0.5, -1.5) * (0.1 + f64::from(rng.unit()));
        let m = DAffine3 {
            matrix3: DMat3::from_quat(turn.as_dquat()) * DMat3::from_diagonal(scale),
            translation: rng.cube().as_dvec3() * 10.0,
        };
        let of = |k: i32| {
            let s = 2f32.powi(k);
            let (v0, e1, e2) = (v0 * s, e1 * s, e2 * s);
            let p = hit_point(v0, e1, e2, u, v);
            let error = hit_error(v0, e1, e2, p);
            let origin = spawn_origin(p, n, error, dir);
            let segment = shadow_segment(receiver * s, p, n, error).expect("points differ");
            // An instance scaled along: the translation alone changes.
            let affine = |m: DAffine3| Affine3A::from_mat3_translation(m.matrix3.as_mat3(), m.translation.as_vec3());
            let scaled = DAffine3 { matrix3: m.matrix3, translation: m.translation * f64::from(s) };
            let placed = hit_error_instanced((v0, e1, e2), p, &affine(scaled), &affine(scaled.inverse()));
            let lengths = [error, origin.x, origin.y, origin.z, segment.tfar, placed].map(|x| (x / s).to_bits());
            (lengths, segment.dir.to_array().map(f32::to_bits))
        };
        let one = of(0);
        wrong += [-20, -10, 10, 20, 40].into_iter().filter(|&k| of(k) != one).count();
    }
    wrong
}

/// Radiance of the room along a ray to the point `target` of its unscaled self, from the middle of the room.
fn at(row: &Row, scene: &Scene, place: impl Fn(DVec3) -> DVec3, target: DVec3, n: u32) -> crate::common::Estimate {
    let from = place(DVec3::new(0.5, 0.375, 0.375)).as_vec3();
    let dir = (place(target) - from.as_dvec3()).as_vec3();
    probe(scene, from, dir, n, on(row, RenderOptions::default().seed(11)))
}

/// (a) As it lies there: every vertex is a multiple of 1/8 m, the distance of neighbouring floats. (b) Through the
/// loader, which moves a scene that lies this far away back by a vector that f32 holds exactly.
#[test]
fn g11_translate_by_two_to_the_twentieth() {
    let mut case = Case::open("G11", "translate by 2^20", "cancellation far from the origin");
    let shift = DVec3::new(1_048_576.0, -1_048_576.0, 524_288.0);
    let place = |p: DVec3| p * 256.0 + shift;
    let far = room(place);
    for row in variants() {
        let floor = at(&row, &far, place, DVec3::new(0.5, 0.5, 0.0), PATHS);
        case.mean(format!("{}, floor centre", row.name()), [FLOOR_CENTER; 3], 1e-3 * FLOOR_CENTER, 5e-3, &floor);
    }

    let directory = tempfile::tempdir().expect("a temporary directory");
    let load = |name: &str, vertices: DVec3, node: DVec3| {
        let folder = directory.path().join(name);
        std::fs::create_dir(&folder).expect("a new folder");
        Scene::load(as_gltf(vertices, node).write(&folder)).expect("a valid room")
    };
    let near = load("near", DVec3::ZERO, DVec3::ZERO);
    let moved = [
        ("vertices moved", load("vertices", shift, DVec3::ZERO)),
        ("node moved", load("node", DVec3::ZERO, shift)),
        ("both moved", load("both", shift * 0.5, shift * 0.5)),
    ];
    for (name, scene) in &moved {
        // What is subtracted is a whole number of the vertices' steps.
        let whole = (scene.origin * 8.0).fract() == DVec3::ZERO && scene.origin != DVec3::ZERO;
        case.row(format!("{name}, origin"), "multiple of 1/8 m", format!("{}", scene.origin), "exact", whole);
        for row in variants() {
            // Coordinates of the two differ by the loader's choice of origin: compare on one of its own.
            let here = recentred(&near, scene.origin - shift);
            let of = |scene: &Scene| render(scene, on(&row, options(48, 48, 4))).film;
            let (moved, here) = (of(scene), of(&here));
            assert!(moved.mean()[0] > 0.01, "the camera sees the room");
            case.bits(format!("{}, {name}, recentred", row.name()), differing(&moved, &here));
        }
    }
    case.close();
}

/// `scene` with `by` subtracted from all positions.
fn recentred(scene: &Scene, by: DVec3) -> Scene {
    let mut scene = scene.clone();
    let move_by = |m: &mut Affine3A| m.translation = (m.translation.as_dvec3() - by).as_vec3a();
    scene.instances.iter_mut().for_each(|i| move_by(&mut i.world_from_object));
    scene.cameras.iter_mut().for_each(|c| move_by(&mut c.world_from_camera));
    scene
}

/// P07 × 256 as a file: `vertices` is added to the positions, `node` to their node. The camera stands under the node
/// too.
fn as_gltf(vertices: DVec3, node: DVec3) -> Fixture {
    use serde_json::json;
    let scene = lamp_room();
    let mut fixture = Fixture::quad();
    let mut primitives = Vec::new();
    for mesh in &scene.meshes {
        let corner = |i: &u32| mesh.positions[*i as usize].as_dvec3() * 256.0 + vertices;
        let positions: Vec<f32> =
            mesh.triangles.iter().flatten().flat_map(|i| corner(i).as_vec3().to_array()).collect();
        let accessor = fixture.floats(&positions, "VEC3");
        primitives.push(json!({"attributes": {"POSITION": accessor}, "material": mesh.material.index()}));
    }
    let materials: Vec<_> = (scene.materials.iter())
        .map(|m| {
            let color = [m.base_color.x, m.base_color.y, m.base_color.z, 1.0];
            let pbr = json!({"baseColorFactor": color, "metallicFactor": 0.0});
            json!({
                "pbrMetallicRoughness": pbr, "emissiveFactor": m.emissive.to_array(),
                "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}}
            })
        })
        .collect();
    // Looks at the wall y = 1 from inside the room.
    let eye = DVec3::new(128.0, 16.0, 128.0) + vertices;
    let (eye, node) = (eye.to_array(), node.to_array());
    fixture
        .set("/materials", json!(materials))
        .set("/meshes/0/primitives", json!(primitives))
        .set(
            "/nodes",
            json!([
                {"translation": node, "children": [1, 2]},
                {"camera": 0, "rotation": [0.5, -0.5, -0.5, 0.5], "translation": eye},
                {"mesh": 0}
            ]),
        )
        .set("/scenes/0/nodes", json!([0]))
}

#[test]
fn g12_scale_by_a_million() {
    let mut case = Case::open("G12", "scale by 1e-6 and 1e6", "non-dyadic scale, micro and planetary scenes");
    for scale in [1e-6, 1e6] {
        let place = |p: DVec3| p * scale;
        let scene = room(place);
        for row in variants() {
            for (name, target, expected, paths) in [
                ("floor", DVec3::new(0.5, 0.5, 0.0), FLOOR_CENTER, PATHS),
                ("wall", DVec3::new(1.0, 0.5, 0.5), WALL_CENTER, PATHS / 4 * 3),
            ] {
                let estimate = at(&row, &scene, place, target, paths);
                case.mean(
                    format!("{}, {name} × {scale:e}", row.name()),
                    [expected; 3],
                    1e-4 * expected,
                    5e-3,
                    &estimate,
                );
            }
        }
    }
    case.close();
}
