//! Animations as the loader poses nodes by them. Oracle: glTF 2.0 §3.11 and Appendix C, by hand; poses are f32, so
//! they are held to 10⁻⁶ of their size. Broken animations: the pointer and the clause beside each. Deterministic.

use base64::Engine;
use glam::{Affine3A, DVec3, Quat, Vec3};
use pathspace::backend::batch::{LANES, RayHitBlock};
use pathspace::backend::{self, BackendKind, BackendOptions, Coherence};
use pathspace::scene::geometry::Geometry;
use pathspace::scene::{LoadOptions, Shutter};
use pathspace::{Error, Scene};
use serde_json::{Value, json};

use super::fixture::Fixture;

/// The quad with one animation of one channel: `path` of node 0 by `values` (of accessor type `kind`) at `keys`.
fn animated(path: &str, interpolation: &str, keys: &[f32], values: &[f32], kind: &str) -> Fixture {
    let mut fixture = Fixture::quad();
    add_animation(&mut fixture, 0, path, interpolation, (keys, values, kind));
    fixture
}

fn add_animation(
    fixture: &mut Fixture,
    node: usize,
    path: &str,
    interpolation: &str,
    (keys, values, kind): (&[f32], &[f32], &str),
) {
    let (input, output) = (fixture.floats(keys, "SCALAR"), fixture.floats(values, kind));
    let animation = json!({
        "samplers": [{"input": input, "output": output, "interpolation": interpolation}],
        "channels": [{"sampler": 0, "target": {"node": node, "path": path}}]
    });
    let root = fixture.json.as_object_mut().expect("an object");
    root.entry("animations").or_insert(json!([])).as_array_mut().expect("an array").push(animation);
}

fn try_load(fixture: &Fixture, open_s: f64, close_s: f64) -> Result<Scene, Error> {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let shutter = Some(Shutter::new(open_s, close_s).expect("an interval"));
    Scene::load_with(fixture.write(directory.path()), &LoadOptions::default().shutter(shutter))
}

fn load(fixture: &Fixture, open_s: f64, close_s: f64) -> Scene {
    try_load(fixture, open_s, close_s).unwrap_or_else(|e| panic!("{e}"))
}

/// Where the quad's node takes a point at a time.
fn at(fixture: &Fixture, time_s: f64, point: Vec3) -> DVec3 {
    let scene = load(fixture, time_s, time_s);
    scene.instances[0].world_from_object.transform_point3(point).as_dvec3() + scene.origin
}

#[track_caller]
fn expect(got: DVec3, expected: DVec3) {
    assert!(got.distance(expected) < 1e-6 * (1.0 + expected.length()), "{got}, expected {expected}");
}

/// A camera under a parent that enlarges a hundredfold turns by 100°: it moves rigidly, so its way is judged in metres
/// of its own. One whose parent flattens it so that it turns about between two looks stands still. Names are told on
/// one line.
#[test]
fn cameras_turn_without_the_scale_of_their_parents() {
    let turning = |scale: [f32; 3]| {
        let mut fixture = Fixture::quad();
        let nodes = fixture.json["nodes"].as_array_mut().expect("an array");
        nodes[1]["name"] = json!("a\nb\u{1b}[31m");
        nodes.push(json!({"scale": scale, "children": [1]}));
        fixture.json["scenes"][0]["nodes"] = json!([0, 2]);
        let sin = 50f32.to_radians().sin();
        let turn = [0.0, 0.0, 0.0, 1.0, sin, 0.0, 0.0, (1.0 - sin * sin).sqrt()];
        add_animation(&mut fixture, 1, "rotation", "LINEAR", (&[0.0, 1.0], &turn, "VEC4"));
        load(&fixture, 0.0, 1.0)
    };
    let scene = turning([100.0; 3]);
    let track = scene.motion.of_camera(0).expect("the camera moves");
    assert!(track.problem().is_none() && track.steps.len() > 2, "{track:?}");
    let off = scene.motion.off.as_ref().expect("a turn is not straight");
    // A 1024th of the diagonal of a cube of 2 m in any position.
    assert!(off.distance_m > 1e-4 && off.distance_m < 6e-3, "{off:?}");

    let scene = turning([1.0, 1.0, 1000.0]);
    assert!(scene.motion.of_camera(0).is_none());
    let told = [&off.name, &scene.cameras[0].name, &scene.motion.unmoved[0].what];
    assert!(told.iter().all(|name| !name.contains(char::is_control)), "{told:?}");
}

#[test]
fn translations_follow_their_interpolation() {
    let (keys, values) = ([0.5, 1.5, 2.0], [0.0, 0.0, 0.0, 4.0, 2.0, 0.0, 4.0, 2.0, -8.0]);
    let x = |fixture: &Fixture, time| at(fixture, time, Vec3::ZERO);
    let linear = animated("translation", "LINEAR", &keys, &values, "VEC3");
    for (time, expected) in [
        // Before the first key and behind the last one values stand.
        (0.0, DVec3::ZERO),
        (0.5, DVec3::ZERO),
        (0.75, DVec3::new(1.0, 0.5, 0.0)),
        (1.5, DVec3::new(4.0, 2.0, 0.0)),
        (1.75, DVec3::new(4.0, 2.0, -4.0)),
        (2.0, DVec3::new(4.0, 2.0, -8.0)),
        (1e9, DVec3::new(4.0, 2.0, -8.0)),
    ] {
        expect(x(&linear, time), expected);
    }
    let mut default = linear.clone();
    default.json["animations"][0]["samplers"][0].as_object_mut().expect("a sampler").remove("interpolation");
    expect(x(&default, 0.75), DVec3::new(1.0, 0.5, 0.0));

    let step = animated("translation", "STEP", &keys, &values, "VEC3");
    for (time, expected) in [(0.1, 0.0), (1.499, 0.0), (1.5, 4.0), (1.9, 4.0), (9.0, 4.0)] {
        expect(DVec3::X * x(&step, time).x, DVec3::X * expected);
    }

    // In-tangent, value, out-tangent of each key: from 1 leaving at 3 a second, to 2 arriving at −1, in two seconds.
    let spline =
        [[9.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [7.0, 0.0, 0.0]];
    let cubic = animated("translation", "CUBICSPLINE", &[1.0, 3.0], spline.as_flattened(), "VEC3");
    // p(½) = (v₀ + v₁)/2 + Δt·(b₀ − a₁)/8; p(¼) by the weights 27/32, 9/64·Δt, 5/32, −3/64·Δt.
    for (time, expected) in [
        (0.0, 1.0),
        (1.0, 1.0),
        (1.5, 27.0 / 32.0 + 3.0 * 2.0 * 9.0 / 64.0 + 2.0 * 5.0 / 32.0 + 2.0 * 3.0 / 64.0),
        (2.0, 1.5 + 2.0 * 4.0 / 8.0),
        (3.0, 2.0),
        (8.0, 2.0),
    ] {
        expect(x(&cubic, time), DVec3::X * expected);
    }
}

#[test]
fn rotations_run_on_great_circles_the_short_way() {
    let turn = |degrees: f32| Quat::from_rotation_z(degrees.to_radians()).to_array();
    let by = |degrees: f64| DVec3::new(degrees.to_radians().cos(), degrees.to_radians().sin(), 0.0);
    let fixture = |interpolation, values: &[[f32; 4]]| {
        animated("rotation", interpolation, &[0.0, 1.0], values.as_flattened(), "VEC4")
    };
    // A third of the way is a third of the angle, which blending would not give; lengths do not matter.
    let linear = fixture("LINEAR", &[turn(0.0), turn(120.0).map(|x| 3.0 * x)]);
    expect(at(&linear, 1.0 / 3.0, Vec3::X), by(40.0));
    let negated = fixture("LINEAR", &[turn(10.0), turn(100.0).map(|x| -x)]);
    expect(at(&negated, 0.5, Vec3::X), by(55.0));
    expect(at(&fixture("STEP", &[turn(10.0), turn(100.0)]), 0.9, Vec3::X), by(10.0));
    // Without tangents half way is the normalised middle.
    let still = [0.0; 4];
    let cubic = fixture("CUBICSPLINE", &[still, turn(0.0), still, still, turn(90.0), still]);
    expect(at(&cubic, 0.5, Vec3::X), by(45.0));
    expect(at(&cubic, 0.5, Vec3::new(1.0, 0.0, 5.0)), by(45.0) + DVec3::Z * 5.0);

    // 16-bit integers stand for numbers in [−1, 1].
    let mut small = Fixture::quad();
    let words = [[0i16, 0, 0, i16::MAX], [0, 0, i16::MAX, 0]];
    let bytes: Vec<u8> = words.as_flattened().iter().flat_map(|word| word.to_le_bytes()).collect();
    let (input, output) = (small.floats(&[0.0, 1.0], "SCALAR"), small.accessor(&bytes, 5122, "VEC4", 2));
    small.json["accessors"][output]["normalized"] = true.into();
    small.json["animations"] = json!([{"samplers": [{"input": input, "output": output}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}]}]);
    expect(at(&small, 0.5, Vec3::X), by(90.0));
}

/// Parents, properties that are not driven, and several animations compose.
#[test]
fn chains_and_animations_compose() {
    let mut fixture = Fixture::quad()
        .set("/scenes/0/nodes", json!([2, 1]))
        .set("/nodes/0", json!({"mesh": 0, "translation": [2.0, 0.0, 0.0], "scale": [3.0, 3.0, 3.0]}));
    fixture.json["nodes"].as_array_mut().expect("nodes").push(json!({"children": [0], "translation": [0.0, 5.0, 0.0]}));
    let quarter = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2).to_array();
    let turns = [[0.0, 0.0, 0.0, 1.0], quarter];
    add_animation(&mut fixture, 2, "rotation", "LINEAR", (&[0.0, 1.0], turns.as_flattened(), "VEC4"));
    add_animation(&mut fixture, 0, "scale", "LINEAR", (&[0.0, 1.0], &[1.0, 1.0, 1.0, 2.0, 2.0, 2.0], "VEC3"));
    // (1, 0, 0) → scaled by 2, moved by 2 → turned to y → up by 5.
    expect(at(&fixture, 1.0, Vec3::X), DVec3::new(0.0, 9.0, 0.0));
    // The same property twice: the first animation has it.
    add_animation(&mut fixture, 0, "scale", "STEP", (&[0.0], &[9.0, 9.0, 9.0], "VEC3"));
    expect(at(&fixture, 1.0, Vec3::X), DVec3::new(0.0, 9.0, 0.0));
    let scene = load(&fixture, 1.0, 1.0);
    let driven = scene.warnings.iter().find(|warning| warning.place == "/animations");
    assert!(driven.is_some_and(|warning| warning.what.contains("animation 1 runs")), "{:?}", scene.warnings);
}

/// Poses over the shutter. Oracle: the ends, the way between them, and the tolerance of a 1024th of the object's size.
#[test]
fn motion_is_cut_into_parts_that_follow_it() {
    let straight = animated("translation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 0.0, 8.0, 0.0], "VEC3");
    let scene = load(&straight, 0.25, 0.5);
    let [track] = &scene.motion.instances[..] else { panic!("one track: {:?}", scene.motion) };
    let height = |step: &Affine3A| f64::from(step.translation.y) + scene.origin.y;
    assert_eq!((track.index, track.steps.len()), (0, 2), "straight lines need no parts");
    assert_eq!((height(&track.steps[0]), height(&track.steps[1])), (2.0, 4.0));
    assert_eq!(track.steps[0], scene.instances[0].world_from_object);
    assert!(scene.motion.off.is_none() && scene.motion.cameras.is_empty());

    let turn = |degrees: f32| Quat::from_rotation_z(degrees.to_radians()).to_array();
    let turning = animated("rotation", "LINEAR", &[0.0, 1.0], [turn(0.0), turn(90.0)].as_flattened(), "VEC4");
    let scene = load(&turning, 0.0, 1.0);
    let track = &scene.motion.instances[0];
    // Sagitta of a part: 1 − cos(45°/parts) of √2 within √2/1024 of the diagonal, at most √2 · √2 when
    // turned by 45°.
    assert_eq!(track.steps.len(), 17, "sixteen parts");
    for (i, step) in track.steps.iter().enumerate() {
        let angle = (90.0 * i as f64 / 16.0).to_radians();
        let corner = step.transform_point3(Vec3::X).as_dvec3() + scene.origin;
        expect(corner, DVec3::new(angle.cos(), angle.sin(), 0.0));
    }
    let off = scene.motion.off.as_ref().expect("an arc is not straight");
    let sagitta = (1.0 - (45f64 / 16.0).to_radians().cos()) * 2f64.sqrt();
    assert!(off.name == "quad" && (off.distance_m / sagitta - 1.0).abs() < 1e-6, "{off:?}, expected {sagitta}");
}

/// A half turn at once, out of existence and back: not shown, and said. Cameras move; lights do not.
#[test]
fn what_cannot_be_shown_is_said() {
    let half = [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]];
    let flipped = animated("rotation", "STEP", &[0.0, 0.51], half.as_flattened(), "VEC4");
    let vanished =
        animated("scale", "LINEAR", &[0.0, 0.5, 1.0], &[1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0], "VEC3");
    for fixture in [flipped, vanished] {
        let scene = load(&fixture, 0.0, 1.0);
        assert!(scene.motion.instances.is_empty());
        assert_eq!(scene.motion.unmoved.len(), 1);
        assert!(scene.motion.unmoved[0].what.contains("'quad'"), "{:?}", scene.motion.unmoved);
    }
    // Node 1 is the camera.
    let mut camera = Fixture::quad();
    add_animation(&mut camera, 1, "translation", "LINEAR", (&[0.0, 1.0], &[0.0, 0.0, 3.0, 1.0, 0.0, 3.0], "VEC3"));
    let scene = load(&camera, 0.0, 1.0);
    assert!(scene.motion.instances.is_empty() && scene.motion.cameras.len() == 1);
    assert_eq!(scene.motion.cameras[0].steps[1].translation.x, 1.0);

    let mut light = Fixture::quad()
        .set("/extensions/KHR_lights_punctual/lights", json!([{"type": "point"}]))
        .set("/nodes/0/extensions/KHR_lights_punctual/light", json!(0));
    add_animation(&mut light, 0, "translation", "LINEAR", (&[0.0, 1.0], &[0.0, 0.0, 3.0, 1.0, 0.0, 3.0], "VEC3"));
    let scene = load(&light, 0.0, 1.0);
    assert!(scene.motion.unmoved[0].what.contains("light of node 'quad'") && scene.motion.instances.len() == 1);

    // Weights of a mesh without targets drive nothing.
    let mut morph = animated("weights", "LINEAR", &[0.0, 1.0], &[0.0, 1.0], "SCALAR");
    assert!(load(&morph, 0.0, 1.0).warnings.iter().any(|warning| warning.what.contains("morph targets of a node")));
    let raised = morph.floats(&[1.0; 12], "VEC3");
    let morph = morph.set("/meshes/0/primitives/0/targets", json!([{"POSITION": raised}]));
    let scene = load(&morph, 0.25, 1.0);
    assert!(scene.motion.unmoved.is_empty(), "{:?}", scene.motion.unmoved);
    assert_eq!(scene.meshes[0].positions[0], Vec3::splat(0.25));
    assert_eq!(scene.meshes[0].later[0].positions[0], Vec3::ONE);
    let mut painted = morph.clone();
    let colors = painted.floats(&[0.5; 12], "VEC3");
    let painted = painted.set("/meshes/0/primitives/0/targets/0/COLOR_0", json!(colors));
    let unmoved = load(&painted, 0.0, 1.0).motion.unmoved;
    assert_eq!(unmoved[0].what, "colours and texture coordinates of the morph targets of node 'quad'");
}

/// What moves over the shutter: a corner of the quad by a joint that turns, all of it by a target whose weight goes up
/// and down, under a node that moves.
fn changing() -> Fixture {
    let mut fixture = Fixture::quad();
    let normals = fixture.floats(&[[0.0, 0.0, 1.0]; 4].concat(), "VEC3");
    let (raised, tilted) = (fixture.floats(&[0.0, 0.0, 0.5].repeat(4), "VEC3"), fixture.floats(&[0.1; 12], "VEC3"));
    let corner = [[0u8; 4], [0; 4], [1, 0, 0, 0], [0; 4]].concat();
    let joints = fixture.accessor(&corner, 5121, "VEC4", 4);
    let weights = fixture.floats(&[1.0, 0.0, 0.0, 0.0].repeat(4), "VEC4");
    let attributes =
        json!({"POSITION": 0, "TEXCOORD_0": 2, "NORMAL": normals, "JOINTS_0": joints, "WEIGHTS_0": weights});
    let mut fixture = fixture
        .set("/meshes/0/primitives/0/attributes", attributes)
        .set("/meshes/0/primitives/0/targets", json!([{"POSITION": raised, "NORMAL": tilted}]))
        .set("/skins", json!([{"joints": [2, 3]}]))
        .set("/nodes/0/skin", json!(0))
        .set("/scenes/0/nodes", json!([0, 1, 2, 3]));
    fixture.json["nodes"].as_array_mut().expect("nodes").extend([json!({}), json!({})]);
    let turns: Vec<f32> =
        [0.0f32, 45.0, 90.0].iter().flat_map(|a| Quat::from_rotation_z(a.to_radians()).to_array()).collect();
    add_animation(&mut fixture, 3, "rotation", "LINEAR", (&[0.0, 0.5, 1.0], &turns, "VEC4"));
    add_animation(&mut fixture, 2, "translation", "LINEAR", (&[0.0, 1.0], &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0], "VEC3"));
    add_animation(&mut fixture, 0, "weights", "LINEAR", (&[0.0, 0.25, 1.0], &[0.0, 1.0, 0.0], "SCALAR"));
    fixture
}

/// Shapes over the shutter are those that the mesh has at rest at their times, to the bit, and so many that straight
/// lines between them stay close. Oracle: the loader at those times, whose poses are held by other tests.
#[test]
fn shapes_are_those_of_the_mesh_at_rest() {
    let fixture = changing();
    let scene = load(&fixture, 0.0, 1.0);
    let mesh = &scene.meshes[0];
    let parts = mesh.later.len();
    assert!((4..=32).contains(&parts), "{parts}");
    assert!(scene.motion.unmoved.is_empty() && scene.motion.instances.len() == 1);
    let track = &scene.motion.instances[0].steps;
    assert!(track.len() == 2 && track[0] == track[1], "the node of a skin does not count");
    let mut still = mesh.clone();
    for part in 0..=parts {
        if let Some(shape) = part.checked_sub(1).map(|later| &mesh.later[later]) {
            still = mesh.shaped(shape);
        }
        let time_s = part as f64 / parts as f64;
        let at_rest = load(&fixture, time_s, time_s);
        // A skin poses in the world's space.
        assert_eq!(still.positions, at_rest.meshes[0].positions, "part {part} of {parts}");
        assert_eq!(still.normals, at_rest.meshes[0].normals, "part {part} of {parts}");
    }
    // Between two shapes: within a thousandth of its size, about 4 m.
    let between = load(&fixture, 0.515625, 0.515625);
    let (part, fraction) = pathspace::scene::motion::part_of(0.515625, parts);
    let shape = |part: usize| part.checked_sub(1).map_or(&mesh.positions, |later| &mesh.later[later].positions);
    for (vertex, p) in between.meshes[0].positions.iter().enumerate() {
        let straight = shape(part)[vertex].lerp(shape(part + 1)[vertex], fraction);
        assert!((straight - *p).length() < 6e-3, "vertex {vertex}");
    }
    let off = scene.motion.off.as_ref().expect("a turn is not straight");
    assert!(off.distance_m > 0.0 && off.distance_m < 6e-3 && off.name == "mesh 0/primitive 0", "{off:?}");
    // At rest, and with a normal map, whose tangents are computed in every shape.
    assert!(load(&fixture, 0.25, 0.25).meshes[0].later.is_empty());
    assert!(load(&fixture, 2.0, 3.0).meshes[0].later.is_empty(), "behind the keys nothing moves");
    let pixel = base64::engine::general_purpose::STANDARD.encode(super::png(1, 1));
    let pixel = format!("data:image/png;base64,{pixel}");
    let mapped = fixture
        .set("/images", json!([{"uri": pixel}]))
        .set("/textures", json!([{"source": 0}]))
        .set("/materials/0/normalTexture", json!({"index": 0}));
    let mapped = load(&mapped, 0.0, 1.0);
    let mesh = &mapped.meshes[0];
    let tangents = mesh.later[mesh.later.len() - 1].tangents.as_ref().expect("computed");
    // The first corner has turned by a right angle; the others have gone on.
    assert!(mesh.later.iter().all(|shape| shape.tangents.as_ref().map(Vec::len) == Some(mesh.positions.len())));
    assert!(tangents.iter().all(|t| (t.truncate().length() - 1.0).abs() < 1e-5));
}

/// Traps of HARDCASES §7.5: what an animation holds still calls for nothing, and nothing is read without a shutter.
#[test]
fn equal_keys_are_no_motion() {
    let still = animated("translation", "CUBICSPLINE", &[0.0, 1.0], &[0.0; 18], "VEC3");
    assert!(load(&still, 0.0, 1.0).motion.instances.is_empty());
    let early = animated("translation", "LINEAR", &[2.0, 3.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], "VEC3");
    assert!(load(&early, 0.0, 2.0).motion.instances.is_empty(), "before its first key");
    assert!(load(&early, 2.5, 2.5).motion.instances.is_empty(), "no time passes");
    assert_eq!(load(&early, 0.0, 2.5).motion.instances.len(), 1);

    // Some tools begin before 0.
    let negative = animated("translation", "LINEAR", &[-1.0, 1.0], &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0], "VEC3");
    expect(at(&negative, 0.5, Vec3::ZERO), DVec3::X * 1.5);

    let broken = early.set("/animations/0/samplers/0/interpolation", json!("SMOOTH"));
    let directory = tempfile::tempdir().expect("a temporary directory");
    let scene = Scene::load(broken.write(directory.path())).expect("nobody asks for the animation");
    assert!(scene.motion.shutter.is_none());
    assert!(scene.warnings.iter().any(|warning| warning.place == "/animations"), "{:?}", scene.warnings);
}

#[test]
fn broken_animations_are_refused_at_the_broken_place() {
    let fixture = || animated("translation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], "VEC3");
    // Accessors 3 and 4 are keys and values.
    let (channel, sampler) = ("/animations/0/channels/0", "/animations/0/samplers/0");
    let cases: Vec<(String, Value, String, &str)> = vec![
        (
            format!("{channel}/sampler"),
            json!(1),
            format!("{channel}/sampler"),
            "below 1, the length of /animations/0/samplers",
        ),
        (format!("{channel}/sampler"), Value::Null, format!("{channel}/sampler"), "expected an index"),
        (format!("{channel}/target/node"), json!(2), format!("{channel}/target/node"), "below 2"),
        (format!("{channel}/target/path"), json!("colour"), format!("{channel}/target/path"), "\"colour\""),
        (format!("{channel}/target"), json!({}), format!("{channel}/target/path"), "translation, rotation"),
        (
            "/nodes/0/matrix".into(),
            json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
            format!("{channel}/target/node"),
            "without a matrix",
        ),
        (format!("{sampler}/input"), json!(99), format!("{sampler}/input"), "below 5"),
        (format!("{sampler}/input"), json!(1u64 << 32), format!("{sampler}/input"), "below 5"),
        (format!("{sampler}/output"), json!(-1), format!("{sampler}/output"), "expected an index"),
        (format!("{sampler}/interpolation"), json!("SMOOTH"), format!("{sampler}/interpolation"), "CUBICSPLINE"),
        (
            format!("{sampler}/interpolation"),
            json!("CUBICSPLINE"),
            "/accessors/4/count".into(),
            "expected 6 values for 2 keys",
        ),
        ("/accessors/4/count".into(), json!(1), "/accessors/4/count".into(), "expected 2 values"),
        ("/accessors/4/count".into(), json!(1u64 << 40), "/accessors/4".into(), "1099511627776"),
        ("/accessors/4/type".into(), json!("VEC2"), "/accessors/4/type".into(), "VEC3"),
        ("/accessors/3/type".into(), json!("VEC2"), "/accessors/3".into(), "8 bytes"),
        ("/accessors/3/componentType".into(), json!(5125), "/accessors/3/componentType".into(), "expected floats"),
        ("/accessors/3/count".into(), json!(3), "/accessors/3".into(), "expected 3 elements"),
        ("/animations/0/channels".into(), json!({}), "/animations/0/channels".into(), "expected an array"),
        ("/animations".into(), json!(7), "/animations".into(), "expected an array"),
    ];
    let refused = |fixture: &Fixture, pointer: &str, words: &str| {
        let error = try_load(fixture, 0.0, 0.5).err().unwrap_or_else(|| panic!("expected an error at {pointer}"));
        let text = error.to_string();
        assert!(
            matches!(&error, Error::InvalidScene { pointer: found, .. } if found == pointer) && text.contains(words),
            "expected {pointer} and `{words}`, found {text}"
        );
        assert!(error.exit_code() == 4 && !text.contains('\n'), "{text}");
    };
    for (place, value, pointer, words) in cases {
        refused(&fixture().set(&place, value), &pointer, words);
    }
    let values = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
    for (keys, words) in [
        ([0.5, 0.5], "increase, found 0.5 s after 0.5 s"),
        ([1.0, 0.5], "found 0.5 s after 1 s"),
        ([f32::NAN, 1.0], "found NaN"),
        ([0.0, f32::INFINITY], "found inf"),
    ] {
        refused(&animated("translation", "LINEAR", &keys, &values, "VEC3"), "/accessors/3", words);
    }
    let nowhere = animated("rotation", "LINEAR", &[0.0, 1.0], &[0.0; 8], "VEC4");
    refused(&nowhere, "/accessors/4", "without direction");
    let infinite = [0.0, 0.0, f32::INFINITY, 1.0, 0.0, 0.0];
    refused(&animated("scale", "LINEAR", &[0.0, 1.0], &infinite, "VEC3"), "/accessors/4", "finite values");
    let huge = [1.0, 1.0, 1.0, 1.0, 1.0, 3e38];
    refused(&animated("translation", "LINEAR", &[0.0, 0.5], &huge, "VEC3"), "/nodes/0", "world coordinates");
    let twice = fixture();
    let first = twice.json["animations"][0]["channels"][0].clone();
    let twice = twice.set("/animations/0/channels", json!([first.clone(), first]));
    refused(&twice, "/animations/0/channels/1/target", "a target of its own");
}

/// Files with some bits flipped end in an error or in a scene whose motion every backend can be built over and traced
/// at any time: Embree would end the process at a pose without an inverse. Oracle: no panic. The seeds are fixed.
#[test]
fn mutated_motions_never_panic() {
    let turn = |degrees: f32| Quat::from_rotation_z(degrees.to_radians()).to_array();
    let mut fixture = animated("rotation", "LINEAR", &[0.0, 1.0], [turn(0.0), turn(170.0)].as_flattened(), "VEC4");
    let scales = [[0.0; 3], [1.0; 3], [2.0; 3], [-1.0; 3], [0.5; 3], [0.0; 3]];
    add_animation(&mut fixture, 0, "scale", "CUBICSPLINE", (&[0.0, 0.7], scales.as_flattened(), "VEC3"));
    add_animation(&mut fixture, 0, "translation", "STEP", (&[0.2, 0.6], &[0.0, 1.0, 2.0, 9.0, 0.0, 0.0], "VEC3"));
    let directory = tempfile::tempdir().expect("a temporary directory");
    let text = fixture.write(directory.path());
    let (json, binary) = (std::fs::read(&text).expect("written"), fixture.binary.clone());
    // Positions, indices and texture coordinates stay; keys and values are behind them.
    let first = fixture.json["bufferViews"][3]["byteOffset"].as_u64().expect("a number") as usize;
    let mut rng = pathspace_stat::Pcg32::new(7, 3);
    let mut random = |below: usize| (rng.next_f32() * below as f32) as usize % below;
    let (mut moving, mut refused, mut unmoved) = (0, 0, 0);
    for round in 0..1500 {
        let (mut json, mut binary) = (json.clone(), binary.clone());
        for _ in 0..1 + random(3) {
            let at = first + random(binary.len() - first);
            // Exponents and signs, where little changes much.
            let at = if random(2) == 0 { at | 3 } else { at }.min(binary.len() - 1);
            binary[at] ^= 1 << random(8);
        }
        if round % 4 == 0 {
            let at = random(json.len());
            json[at] = if json[at].is_ascii_digit() { b'0' + random(10) as u8 } else { json[at] ^ 1 << random(7) };
        }
        std::fs::write(directory.path().join("scene.bin"), &binary).expect("a writable folder");
        std::fs::write(&text, &json).expect("a writable folder");
        let shutter = Some(Shutter::new(0.0, 0.125 * random(16) as f64).expect("a shutter"));
        let Ok(scene) = Scene::load_with(&text, &LoadOptions::default().shutter(shutter)) else {
            refused += 1;
            continue;
        };
        scene.validate().expect("a scene that loads keeps its promises");
        unmoved += usize::from(!scene.motion.unmoved.is_empty());
        moving += usize::from(!scene.motion.instances.is_empty());
        let geometry = Geometry::build(&scene);
        for &kind in BackendKind::available() {
            // Scales may be too small or large for a backend, which says so.
            let Ok(backend) = backend::select::build(kind, &geometry, &BackendOptions::default()) else { continue };
            let mut block = RayHitBlock::EMPTY;
            for lane in 0..LANES {
                let [x, y] = [0.1, 0.37].map(|step| step * lane as f32 - 1.0);
                block.ray.set(lane, Vec3::new(x, y, 3.0), Vec3::NEG_Z, f32::INFINITY);
                block.ray.time[lane] = lane as f32 / LANES as f32;
            }
            backend.closest_hit(std::slice::from_mut(&mut block), LANES, Coherence::Incoherent);
        }
    }
    println!("{moving} move, {unmoved} cannot be shown, {refused} are refused");
    assert!(moving > 300 && refused > 100 && unmoved > 30, "{moving} move, {unmoved} not, {refused} refused");
}

/// The frames of a sequence, which share textures, are what each is by itself, though materials are numbered by the
/// pose: colours that a morph target paints, and two coloured props in materials of their own that joints of scale 0
/// hide in turn. Oracle: a fresh load. Deterministic.
#[test]
fn later_frames_have_their_own_materials() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let held_to_fresh_loads = |fixture: &Fixture, shown: [&[(&str, bool)]; 2]| {
        let path = fixture.write(directory.path());
        let at = |time_s| LoadOptions::default().shutter(Shutter::new(time_s, time_s).expect("a time"));
        for order in [[0, 1], [1, 0]] {
            let times = order.map(|frame| at(frame as f64));
            let first = Scene::load_with(&path, &times[0]).unwrap_or_else(|e| panic!("{e}"));
            let again = Scene::load_again(&path, &times[1], &first).unwrap_or_else(|e| panic!("{e}"));
            let fresh = Scene::load_with(&path, &times[1]).unwrap_or_else(|e| panic!("{e}"));
            for scene in [&again, &fresh] {
                let materials = scene.instances.iter().map(|instance| {
                    let material = &scene.materials[scene.material_of(instance).index()];
                    (material.name.as_str(), material.vertex_colors)
                });
                assert_eq!(materials.collect::<Vec<_>>(), shown[order[1]]);
            }
            assert_eq!((again.materials, again.meshes.len()), (fresh.materials, fresh.meshes.len()));
        }
    };

    let mut painted = animated("weights", "LINEAR", &[0.0, 1.0], &[0.0, 1.0], "SCALAR");
    let white = painted.floats(&[1.0; 16], "VEC4");
    let paint = painted.floats(&[-0.5, 0.0, 0.0, 0.0].repeat(4), "VEC4");
    let painted = painted
        .set("/meshes/0/primitives/0/attributes/COLOR_0", white.into())
        .set("/meshes/0/primitives/0/targets", json!([{"COLOR_0": paint}]));
    held_to_fresh_loads(&painted, [&[("plain", false)], &[("plain", true)]]);

    let mut props = Fixture::quad();
    let colors = props.floats(&[0.5; 16], "VEC4");
    let joints = props.accessor(&[0; 16], 5121, "VEC4", 4);
    let weights = props.floats(&[1.0, 0.0, 0.0, 0.0].repeat(4), "VEC4");
    let mut primitive = props.json["meshes"][0]["primitives"][0].clone();
    for (name, accessor) in [("COLOR_0", colors), ("JOINTS_0", joints), ("WEIGHTS_0", weights)] {
        primitive["attributes"][name] = accessor.into();
    }
    let mut other = primitive.clone();
    other["material"] = 1.into();
    let mut props = props
        .set("/materials", json!([{"name": "first"}, {"name": "second"}]))
        .set("/meshes", json!([{"primitives": [primitive]}, {"primitives": [other]}]))
        .set("/skins", json!([{"joints": [3]}, {"joints": [4]}]))
        .set("/scenes/0/nodes", json!([0, 1, 2, 3, 4]));
    let nodes = props.json["nodes"].as_array_mut().expect("an array");
    nodes[0]["skin"] = 0.into();
    nodes.extend([json!({"mesh": 1, "skin": 1}), json!({}), json!({})]);
    add_animation(&mut props, 3, "scale", "STEP", (&[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0], "VEC3"));
    add_animation(&mut props, 4, "scale", "STEP", (&[0.0, 1.0], &[1.0, 1.0, 1.0, 0.0, 0.0, 0.0], "VEC3"));
    held_to_fresh_loads(&props, [&[("second", true)], &[("first", true)]]);
}
