//! Poses that are none: morph targets that cancel, joints that flatten, motion to nowhere; and samples far beyond
//! what a render takes (T01–T05, R09, R10). Oracles: glTF's sums by hand, the scene at rest, the whole render.

use glam::Vec3;
use pathspace::render::Renderer;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::motion::Track;
use pathspace::scene::{LoadOptions, Scene, Shutter};
use serde_json::json;

use super::Case;
use super::modes::Mode;
use crate::common::{options, render};
use crate::loading::fixture::Fixture;

fn load(fixture: &Fixture) -> Result<Scene, pathspace::Error> {
    let directory = tempfile::tempdir().expect("a temporary directory");
    Scene::load_with(fixture.write(directory.path()), &LoadOptions::default())
}

/// Where the corners of the first mesh are.
fn corners(scene: &Scene) -> Vec<Vec3> {
    let place = |p: &Vec3| scene.instances[0].world_from_object.transform_point3(*p) + scene.origin.as_vec3();
    scene.meshes[scene.instances[0].mesh.index()].positions.iter().map(place).collect()
}

fn compare(case: &mut Case, on: &str, expected: &[Vec3], got: &[Vec3]) {
    let pairs = expected.iter().zip(got).map(|(e, g)| (1.0, 1.0 + f64::from(e.distance(*g)), 1e-5));
    case.numbers(on, pairs);
}

#[test]
fn t01_morphs_that_cancel() {
    let mut case = Case::open("T01", "morph targets that cancel", "sums of large displacements");
    let base = corners(&load(&Fixture::quad()).expect("valid"));
    for size in [1.0f32, 1e6, 1e30] {
        let mut fixture = Fixture::quad();
        let [out, back] = [size, -size].map(|x| fixture.floats(&[x, 2.0 * x, -x].repeat(4), "VEC3"));
        fixture.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": out}, {"POSITION": back}]);
        for weights in [[1.0, 1.0], [0.75, 0.75], [1e-3, 1e-3]] {
            let scene = load(&fixture.clone().set("/meshes/0/weights", json!(weights))).expect("valid");
            compare(&mut case, &format!("{size:e}, weights {}", weights[0]), &base, &corners(&scene));
        }
    }
    case.close();
}

/// The quad, skinned to two joints of these matrices by equal weights; `bind` is the inverse bind matrix of the first.
fn skinned(scales: [[f32; 3]; 2], bind: Option<[f32; 16]>, weights: [f32; 4]) -> Fixture {
    let mut fixture = Fixture::quad();
    let normals = fixture.floats(&[0.0, 0.0, 1.0].repeat(4), "VEC3");
    let joints = fixture.accessor(&[0u8, 1, 0, 0].repeat(4), 5121, "VEC4", 4);
    let weights = fixture.floats(&weights.repeat(4), "VEC4");
    fixture.json["skins"] = json!([{"joints": [2, 3]}]);
    if let Some(bind) = bind {
        let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0f32];
        let bytes: Vec<u8> = bind.iter().chain(&identity).flat_map(|x| x.to_le_bytes()).collect();
        let matrices = fixture.accessor(&bytes, 5126, "MAT4", 2);
        fixture.json["skins"][0]["inverseBindMatrices"] = matrices.into();
    }
    let nodes = fixture.json["nodes"].as_array_mut().expect("nodes");
    nodes[0]["skin"] = 0.into();
    scales.into_iter().for_each(|scale| nodes.push(json!({"scale": scale})));
    fixture.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    let attributes = json!({"POSITION": 0, "NORMAL": normals, "JOINTS_0": joints, "WEIGHTS_0": weights});
    fixture.set("/meshes/0/primitives/0/attributes", attributes)
}

/// A joint that flattens space leaves what the others do; normals stay of unit length or nothing is seen of them.
#[test]
fn t02_singular_joints() {
    let mut case = Case::open("T02", "skins with singular joints", "inverses of matrices that have none");
    let base = corners(&load(&Fixture::quad()).expect("valid"));
    let half: Vec<Vec3> = base.iter().map(|p| *p * Vec3::new(0.5, 1.0, 1.0)).collect();
    let flat = load(&skinned([[0.0, 1.0, 1.0], [1.0, 1.0, 1.0]], None, [0.5, 0.5, 0.0, 0.0])).expect("valid");
    compare(&mut case, "one flat joint of two", &half, &corners(&flat));
    for (name, scales) in
        [("a line", [[0.0, 1.0, 0.0]; 2]), ("a point", [[0.0; 3]; 2]), ("a plane", [[1.0, 1.0, 0.0]; 2])]
    {
        let scene = load(&skinned(scales, None, [0.5, 0.5, 0.0, 0.0]));
        let Ok(scene) = scene else {
            case.row(name, "loads or is refused", "refused", "-", true);
            continue;
        };
        let normals = scene.meshes.iter().filter_map(|mesh| mesh.normals.as_ref()).flatten();
        case.count(
            format!("{name}: normals that are no numbers"),
            0,
            normals.filter(|n| !n.is_finite()).count() as u64,
        );
        for mode in Mode::all() {
            let film = render(&scene, mode.options(options(4, 4, 2))).film;
            let bad = film.pixels.iter().flat_map(|p| p.mean()).filter(|v| !v.is_finite()).count();
            case.count(format!("{}, {name}: pixels that are none", mode.name), 0, bad as u64);
        }
    }
    case.close();
}

#[test]
fn t03_skins_of_odd_weights() {
    let mut case = Case::open("T03", "skins of weights that do not add up", "division by a sum of weights");
    let base = corners(&load(&Fixture::quad()).expect("valid"));
    let skin = |weights| load(&skinned([[1.0; 3]; 2], None, weights));
    for weights in [[3.0, 1.0, 0.0, 0.0], [1e-30, 1e-30, 0.0, 0.0], [1e30, 1e30, 0.0, 0.0]] {
        let scene = skin(weights).expect("valid");
        compare(&mut case, &format!("weights {weights:?}"), &base, &corners(&scene));
    }
    for weights in [[0.0; 4], [1.0, -1.0, 0.0, 0.0]] {
        // Either a message or numbers.
        let finite = skin(weights).map_or(true, |scene| corners(&scene).iter().all(|p| p.is_finite()));
        case.count(format!("weights {weights:?}: places that are none"), 0, u64::from(!finite));
    }
    case.close();
}

#[test]
fn t04_singular_bind_matrices() {
    let mut case = Case::open("T04", "bind matrices of zeros", "poses that were never bound");
    let base = corners(&load(&Fixture::quad()).expect("valid"));
    let mut zero = [0.0; 16];
    zero[15] = 1.0;
    let scene = load(&skinned([[1.0; 3]; 2], Some(zero), [0.25, 0.75, 0.0, 0.0])).expect("valid");
    let expected: Vec<Vec3> = base.iter().map(|p| *p * 0.75).collect();
    compare(&mut case, "a quarter at the origin", &expected, &corners(&scene));
    case.close();
}

/// A floor under a lamp.
fn lit() -> Scene {
    let mut b = SceneBuilder::new();
    let (floor, lamp) = (b.lambert(Vec3::splat(0.5)), b.emitter(Vec3::ZERO, Vec3::splat(3.0)));
    b.quad([(-5.0, 5.0), (5.0, 5.0), (5.0, -5.0), (-5.0, -5.0)].map(|(x, z)| Vec3::new(x, 0.0, z)), floor);
    b.quad([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, z)| Vec3::new(x, 3.0, z)), lamp);
    b.camera(Vec3::new(0.0, 2.0, 4.0), Vec3::ZERO, Vec3::Y, 0.5);
    b.build()
}

/// What moves to where it stands already shows what is at rest.
#[test]
fn t05_motion_to_nowhere() {
    let mut case = Case::open("T05", "motion that goes nowhere", "times of paths, boxes of no width in time");
    let still = lit();
    let mut moving = still.clone();
    let placed = moving.instances[0].world_from_object;
    moving.motion.shutter = Shutter::new(0.0, 1.0).ok();
    moving.motion.instances = vec![Track { index: 0, steps: vec![placed, placed] }];
    for mode in Mode::all() {
        let picture = |scene: &Scene| render(scene, mode.options(options(8, 8, 2))).film;
        let (a, b) = (picture(&still), picture(&moving));
        let pairs = a.pixels.iter().zip(&b.pixels).flat_map(|(a, b)| [0, 1, 2].map(|c| (a.mean()[c], b.mean()[c])));
        case.numbers(&mode.name, pairs.map(|(expected, got)| (expected, got, 1e-4)));
    }
    case.close();
}

/// Renders that cross 2³² and 2³³ samples, where indices within a half leave 31 and 32 bits: parts add up to the whole,
/// and go on from a state.
#[test]
fn r09_resumes_at_many_samples() {
    let mut case = Case::open("R09", "resumes at 2³² samples and beyond", "indices of more than 32 bits");
    let scene = lit();
    for first in [(1u64 << 32) - 16, (1 << 33) - 16, (1 << 40) - 16] {
        for mode in Mode::all() {
            let options = |start, spp| mode.options(options(6, 6, spp).sample_start(start));
            let whole = render(&scene, options(first, 32)).film;
            let renderer = Renderer::new(&scene, options(first, 32)).unwrap_or_else(|e| panic!("{e}"));
            let resumed = renderer.resume(render(&scene, options(first, 16))).unwrap_or_else(|e| panic!("{e}")).film;
            let mut merged = render(&scene, options(first, 16)).film;
            merged.merge(&render(&scene, options(first + 16, 16)).film).expect("the same picture");
            let differing =
                |film: &pathspace::film::Film| film.pixels.iter().zip(&whole.pixels).filter(|(a, b)| a != b).count();
            let on = format!("{}, from 2^{:.0}", mode.name, (first as f64).log2());
            case.bits(format!("{on}, resumed"), differing(&resumed));
            case.bits(format!("{on}, merged"), differing(&merged));
        }
    }
    case.close();
}

/// Samples 2³³ apart have the same low 32 bits of their index, and other numbers.
#[test]
fn r10_samples_far_apart() {
    let mut case = Case::open("R10", "samples that differ by 2³³ and more", "reuse of random numbers");
    let scene = lit();
    for mode in Mode::all() {
        let of = |start| render(&scene, mode.options(options(6, 6, 2).sample_start(start))).film;
        let near = of(0);
        for start in [1u64 << 32, 1 << 33, 1 << 34, 1 << 62] {
            let far = of(start);
            let equal = near.pixels.iter().zip(&far.pixels).filter(|(a, b)| a == b).count();
            case.count(format!("{}, 2^{:.0}: pixels alike", mode.name, (start as f64).log2()), 0, equal as u64);
        }
    }
    case.close();
}
