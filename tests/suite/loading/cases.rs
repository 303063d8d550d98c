//! Small files that went wrong once: those of `../shared/cases` that are about loading, with the expected values of
//! their README, and others of the same kinds. Renders are held within 4.9 standard errors (10⁻⁶ each); the rest is
//! exact.

use std::time::{Duration, Instant};

use glam::Vec3;
use pathspace::backend::BackendKind;
use pathspace::plan::options::Strategy;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Camera, Environment, LoadOptions, Material, PunctualKind};
use pathspace::{Error, Scene};
use serde_json::json;

use super::fixture::{Fixture, write};
use crate::common::{Estimate, options, probe, render, shared};

/// The case of that name, loaded as it stands.
fn case(name: &str) -> Option<Scene> {
    let path = shared(name)?.join("cases").join(name);
    Some(Scene::load(&path).unwrap_or_else(|error| panic!("{name}: {error}")))
}

/// A file made here, with its own lights only.
fn load(fixture: &Fixture) -> Result<Scene, Error> {
    let directory = tempfile::tempdir().expect("a temporary directory");
    Scene::load_with(fixture.write(directory.path()), &LoadOptions::default().fallback_light(false))
}

fn warns(scene: &Scene, words: &str) -> bool {
    scene.warnings.iter().any(|warning| warning.what.contains(words))
}

/// Holds the mean of a small picture to `expected`, on every backend.
fn expect(name: &str, scene: &Scene, strategy: Strategy, expected: [f64; 3]) {
    for &backend in BackendKind::available() {
        let film = render(scene, options(16, 16, 16).strategy(strategy).backend(backend)).film;
        let estimate = Estimate::of_pixels(&film);
        for c in 0..3 {
            let (mean, limit) = (estimate.mean[c], 4.9 * estimate.standard_error(c) + 2e-5);
            assert!((mean - expected[c]).abs() <= limit, "{name}, {backend:?}, channel {c}: {mean} ± {limit}");
        }
    }
}

/// A unit quad in the plane z = 0 and a camera before it, as every file here has them, unlit in that colour.
#[test]
fn files_that_were_refused_load() {
    let color = [0.5, 0.25, 0.125];
    for name in ["integers-as-decimals/count.gltf", "data-uri-percent/percent.gltf", "unused-material-image/scene.gltf"]
    {
        let Some(scene) = case(name) else { return };
        expect(name, &scene, Strategy::MIS, color);
    }
    let scene = case("primitive-without-position/nopos.gltf").expect("the cases are there");
    assert!(scene.triangle_count() == 4 && warns(&scene, "no POSITION"), "{:?}", scene.warnings);
    assert_eq!(scene.warnings.len(), 1);
}

/// Half a sky, as `--crop` writes it, and a surface that faces the other half. Oracle: 0 outside of the data window.
#[test]
fn what_an_environment_does_not_store_is_black() {
    let Some(mut scene) = case("exr-data-window/looks-to-minus-x.gltf") else { return };
    let sky = shared("exr-data-window").expect("the cases are there").join("cases/exr-data-window/right-half.exr");
    scene.load_environment(sky, 0.0, 1.0).unwrap_or_else(|error| panic!("{error}"));
    expect("exr-data-window", &scene, Strategy::MIS, [0.0; 3]);
}

/// Oracle: I/(π d²) of a Lambert surface of albedo 1.
#[test]
fn cones_whose_angles_differ_in_f64_alone_are_cones() {
    let Some(scene) = case("spot-angles-f32/spot.gltf") else { return };
    assert!(matches!(scene.punctual[0].kind, PunctualKind::Spot { cos_inner, cos_outer } if cos_inner == cos_outer));
    let expected = 10.0 / (4.0 * std::f64::consts::PI);
    expect("spot", &scene, Strategy::MIS, [expected; 3]);
}

/// Oracle: KHR_materials_ior: Fresnel's term is 1, so the tint of KHR_materials_specular is the reflectance.
#[test]
fn an_index_of_0_reflects_everything() {
    let Some(mut scene) = case("ior-zero/opaque.gltf") else { return };
    scene.environment = Some(Environment::constant(Vec3::ONE));
    expect("ior 0", &scene, Strategy::MIS, [0.9, 0.5, 0.1]);
    expect("ior 0, bsdf", &scene, Strategy::BSDF, [0.9, 0.5, 0.1]);
    assert!(scene.warnings.iter().all(|warning| !warning.what.contains("out of range")), "{:?}", scene.warnings);
    let solid = json!({"extensions": {"KHR_materials_ior": {"ior": 0},
        "KHR_materials_transmission": {"transmissionFactor": 1}}});
    let solid = load(&Fixture::quad().set("/materials/0", solid)).expect("valid");
    assert!(solid.materials[0].transmission == 0.0 && warns(&solid, "nothing is transmitted"));
}

/// Oracle: the file's radiance, whichever side is seen.
#[test]
fn double_sided_lamps_are_seen_from_behind() {
    let Some(mut scene) = case("double-sided-emission/seen-from-behind.gltf") else { return };
    for strategy in [Strategy::MIS, Strategy::BSDF, Strategy::LIGHT] {
        expect("from behind", &scene, strategy, [0.5; 3]);
    }
    scene.materials[0].double_sided = false;
    expect("one side", &scene, Strategy::MIS, [0.0; 3]);
}

/// Oracle: the form factor of a square of 2 m, 1 m from a parallel element at its centre, on both sides of it:
/// 2/π · atan(1/√2)/√2 · 2. Strategies and backends agree with it.
#[test]
fn double_sided_lamps_light_both_sides() {
    let mut b = SceneBuilder::new();
    let lamp = Material { double_sided: true, ..Material::default() };
    let lamp = b.material(Material {
        base_color: Vec3::ZERO,
        metallic: 0.0,
        specular: 0.0,
        emissive: Vec3::splat(2.0),
        ..lamp
    });
    let white = b.lambert(Vec3::splat(0.5));
    let square = |y: f32| [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, z)| Vec3::new(x, y, z));
    b.quad(square(0.0), lamp).quad(square(1.0), white).quad(square(-1.0), white);
    let scene = b.build();
    let root = 0.5f64.sqrt();
    let expected = 0.5 * 2.0 * 4.0 * root * root.atan() / std::f64::consts::PI;
    for &backend in BackendKind::available() {
        for strategy in [Strategy::MIS, Strategy::BSDF, Strategy::LIGHT] {
            for y in [1.0f32, -1.0] {
                // Seen from the lamp's middle, between it and the surface.
                let (eye, towards) = (Vec3::new(0.0, 0.5 * y, 0.0), Vec3::Y * y);
                let options = options(1, 1, 16).strategy(strategy).backend(backend).max_depth(2);
                let seen = probe(&scene, eye, towards, 1 << 12, options);
                seen.expect(&format!("{strategy:?} on {backend:?}, side {y}"), expected, 1e-6, 0.05);
            }
        }
    }
}

/// Oracle: the extension's window, 1 − (d/range)⁴ at 2 m of 4, nothing at 2 m of 2.
#[test]
fn lights_end_at_their_range() {
    let Some(mut scene) = case("spot-angles-f32/spot.gltf") else { return };
    let whole = 10.0 / (4.0 * std::f64::consts::PI);
    for (range_m, share) in [(4.0, 1.0 - 1.0 / 16.0), (2.0, 0.0), (1.0, 0.0)] {
        scene.punctual[0].range_m = range_m;
        expect("range", &scene, Strategy::MIS, [whole * share; 3]);
    }
    let lights = json!({"KHR_lights_punctual": {"lights": [{"type": "point", "range": 0}]}});
    let mut lit = Fixture::quad().set("/extensions", lights);
    lit.json["nodes"][1]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    let error = load(&lit).expect_err("a range of 0").to_string();
    assert!(error.contains("/extensions/KHR_lights_punctual/lights/0/range"), "{error}");
}

/// Before, the buffer was read anew for every view: the square of its size. Oracle: time, with room for a busy machine.
#[test]
fn a_buffer_in_its_uri_is_read_once() {
    use base64::Engine;
    let mut fixture = Fixture::quad();
    let primitive = json!({"attributes": {"POSITION": 0}, "indices": 1});
    fixture.json["meshes"][0]["primitives"] = vec![primitive; 2000].into();
    fixture.binary.resize(8 << 20, 0);
    let text = base64::engine::general_purpose::STANDARD.encode(&fixture.binary);
    let whole = fixture.set("/buffers/0/uri", format!("data:application/octet-stream;base64,{text}").into());
    let start = Instant::now();
    let scene = load(&whole).expect("valid");
    assert_eq!(scene.meshes.len(), 2000);
    assert!(start.elapsed() < Duration::from_secs(6), "{:?}", start.elapsed());
}

#[test]
fn byte_order_marks_are_passed_over() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path = Fixture::quad().write(directory.path());
    let text = std::fs::read(&path).expect("written");
    let marked = write(directory.path(), "marked.gltf", &[b"\xef\xbb\xbf", &text[..]].concat());
    Scene::load(marked).expect("a mark is no error");
}

/// `znear` belongs to rasterisers: it is not needed, and not blamed on another member.
#[test]
fn cameras_need_what_is_used_alone() {
    let bare = Fixture::quad().set("/cameras/0", json!({"type": "perspective", "perspective": {"yfov": 0.7}}));
    load(&bare).expect("valid for what a path tracer reads");
    let Camera { name, .. } = &load(&bare.set("/cameras/0/name", json!("eye"))).expect("valid").cameras[0];
    assert_eq!(name, "eye");
    for (camera, place) in [
        (json!({"type": "perspective", "perspective": {"znear": 0.1}}), "/cameras/0/perspective/yfov"),
        (json!({"type": "orthographic", "orthographic": {"ymag": 1}}), "/cameras/0/orthographic/xmag"),
        (json!({"perspective": {"yfov": 0.7}}), "/cameras/0/type"),
    ] {
        let error = load(&Fixture::quad().set("/cameras/0", camera)).expect_err("incomplete").to_string();
        assert!(error.contains(place), "{error}");
    }
}

/// Normals that are not finite are those of the surface, and it is said.
#[test]
fn normals_that_are_not_finite_are_replaced() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut fixture = Fixture::quad();
        let normals = fixture.floats(&[bad, 0.0, 1.0, 0.0, bad, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, bad], "VEC3");
        let scene = load(&fixture.set("/meshes/0/primitives/0/attributes/NORMAL", normals.into())).expect("valid");
        assert!(warns(&scene, "3 normals have no direction"), "{bad}: {:?}", scene.warnings);
        assert_eq!(scene.meshes[0].normals.as_deref(), Some(&[Vec3::Z; 4][..]));
    }
}

/// References past the end of their tables, in what is used and what is not.
#[test]
fn references_out_of_bounds_are_refused_everywhere() {
    let mut base = Fixture::quad();
    let line = base.floats(&[0.0; 9], "VEC3");
    let animation = json!([{"channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
        "samplers": [{"input": 0, "output": 0}]}]);
    let texture = || json!([{"source": 0}]);
    let cases = [
        ("/materials/0/occlusionTexture", json!({"index": 5}), "/materials/0/occlusionTexture/index"),
        (
            "/materials/0/extensions",
            json!({"KHR_materials_sheen": {"sheenColorTexture": {"index": 1}}}),
            "/materials/0/extensions/KHR_materials_sheen/sheenColorTexture/index",
        ),
        ("/textures", json!([{"sampler": 3}]), "/textures/0/sampler"),
        ("/textures", texture(), "/textures/0/source"),
        ("/nodes/0/skin", json!(0), "/nodes/0/skin"),
        ("/skins", json!([{"joints": [0, 9]}]), "/skins/0/joints/1"),
        ("/skins", json!([{"joints": [0], "inverseBindMatrices": 9}]), "/skins/0/inverseBindMatrices"),
        (
            "/meshes/0/primitives/1",
            json!({"attributes": {"POSITION": line}, "material": 7}),
            "/meshes/0/primitives/1/material",
        ),
        ("/meshes/0/primitives/0/targets", json!([{"POSITION": 50}]), "/meshes/0/primitives/0/targets/0/POSITION"),
        ("/animations/0/samplers/0/input", json!(99), "/animations/0/samplers/0/input"),
        ("/animations/0/channels/0/sampler", json!(2), "/animations/0/channels/0/sampler"),
        ("/animations/0/channels/0/target/node", json!(1u64 << 33), "/animations/0/channels/0/target/node"),
    ];
    for (pointer, value, place) in cases {
        let mut bent = base.clone();
        bent.json["animations"] = animation.clone();
        bent.json["meshes"][0]["primitives"].as_array_mut().expect("primitives").push(json!({"attributes": {}}));
        let error = load(&bent.set(pointer, value)).expect_err(pointer);
        let found = matches!(&error, Error::InvalidScene { pointer, .. } if pointer == place);
        assert!(found && error.to_string().contains("expected an index below"), "{pointer}: {error}");
    }
}

/// What counts as light, and what is said. Oracle: GUIDE.md, "Some conventions".
#[test]
fn the_white_environment_comes_where_a_file_states_no_light() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let mut dot = image::RgbImage::new(64, 64);
    dot.put_pixel(3, 3, image::Rgb([255; 3]));
    dot.save(directory.path().join("dot.png")).expect("written");
    let load = |fixture: &Fixture| Scene::load(fixture.write(directory.path())).expect("valid");
    let white = |scene: &Scene| scene.environment.is_some();

    let scene = load(&Fixture::quad());
    assert!(white(&scene) && warns(&scene, "no light of any kind"));

    let mut dimmed = Fixture::quad()
        .set("/extensions", json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 0}]}}));
    dimmed.json["nodes"][1]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    let scene = load(&dimmed);
    assert!(!white(&scene) && warns(&scene, "every light is dimmed to 0"), "{:?}", scene.warnings);

    let emissive = |material| {
        let mut fixture = Fixture::quad().set("/materials/0", material);
        fixture.json["images"] = json!([{"uri": "dot.png"}]);
        fixture.json["textures"] = json!([{"source": 0}]);
        load(&fixture)
    };
    let dotted = json!({"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}});
    let scene = emissive(dotted.clone());
    assert!(white(&scene) && warns(&scene, "emissive textures light next to nothing"), "{:?}", scene.warnings);
    let mut strong = dotted;
    strong["extensions"] = json!({"KHR_materials_emissive_strength": {"emissiveStrength": 2}});
    assert!(!white(&emissive(strong)));
    let scene = emissive(json!({"emissiveFactor": [0.001, 0, 0]}));
    assert!(!white(&scene) && scene.warnings.is_empty(), "{:?}", scene.warnings);
}

/// Oracle: a black square of 1 m² in a picture of 4 m² of white: a skinned mesh ignores its node.
#[test]
fn skinned_meshes_ignore_their_node() {
    let Some(mut scene) = case("skin-node-transform/skin.gltf") else { return };
    scene.environment = Some(Environment::constant(Vec3::ONE));
    for &backend in BackendKind::available() {
        let film = render(&scene, options(16, 16, 16).backend(backend)).film;
        let mean = Estimate::of_pixels(&film).mean[0];
        assert!((mean - 0.75).abs() < 1e-6, "{backend:?}: {mean}");
    }
}

/// Oracle: by hand. Two joints, one lifted by 2 m from where it was bound and one turned about x by 180°; weights that
/// need their sum, and a second set of which one joint is beyond the skin, by a weight of 0.
#[test]
fn joints_move_vertices_and_normals() {
    let mut fixture = Fixture::quad();
    let normals = fixture.floats(&[[0.0, 0.0, 1.0]; 4].concat(), "VEC3");
    let joints =
        fixture.accessor(&[[0u8, 1, 0, 0], [0, 1, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0]].concat(), 5121, "VEC4", 4);
    let quarter = [0.25, 0.25, 0.0, 0.0];
    let weights = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], quarter, [0.0, 3.0, 0.0, 0.0]].concat();
    let weights = fixture.floats(&weights, "VEC4");
    let (more, none) = (fixture.accessor(&[9; 16], 5121, "VEC4", 4), fixture.floats(&[0.0; 16], "VEC4"));
    // Bound at y = 1.
    let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0f32];
    let mut lowered = identity;
    lowered[13] = -1.0;
    let bytes: Vec<u8> = lowered.iter().chain(&identity).flat_map(|x| x.to_le_bytes()).collect();
    let matrices = fixture.accessor(&bytes, 5126, "MAT4", 2);
    fixture.json["skins"] = json!([{"joints": [2, 3], "inverseBindMatrices": matrices}]);
    let nodes = fixture.json["nodes"].as_array_mut().expect("nodes");
    nodes[0]["skin"] = 0.into();
    nodes[0]["translation"] = json!([100, 0, 0]);
    nodes.push(json!({"translation": [0, 3, 0]}));
    nodes.push(json!({"rotation": [1, 0, 0, 0]}));
    fixture.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    let attributes = json!({"POSITION": 0, "NORMAL": normals, "JOINTS_0": joints, "WEIGHTS_0": weights,
        "JOINTS_1": more, "WEIGHTS_1": none});
    let skinned = fixture.set("/meshes/0/primitives/0/attributes", attributes);
    let scene = load(&skinned).expect("valid");
    assert!(scene.warnings.iter().all(|warning| warning.place == "/"), "{:?}", scene.warnings);
    let mesh = &scene.meshes[0];
    let place = |vertex: usize| {
        let placed = scene.instances[0].world_from_object.transform_point3(mesh.positions[vertex]);
        placed + scene.origin.as_vec3()
    };
    let expected =
        [Vec3::new(0.0, 2.0, 0.0), Vec3::new(1.0, 0.0, 0.0), Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.0, 3.0, 0.0)];
    for (vertex, expected) in expected.into_iter().enumerate() {
        assert!((place(vertex) - expected).length() < 1e-6, "{vertex}: {} for {expected}", place(vertex));
    }
    let normals = mesh.normals.as_ref().expect("read");
    assert!((normals[0] - Vec3::Z).length() < 1e-6 && (normals[1] + Vec3::Z).length() < 1e-6, "{normals:?}");

    for (pointer, value, place, words) in [
        ("/skins/0/joints", json!([2]), "/accessors/4", "below 1, found 1"),
        ("/scenes/0/nodes", json!([0, 1, 2]), "/skins/0/joints/1", "a node of the scene"),
        ("/skins/0/joints", json!([2, 3, 2]), "/accessors/8/count", "3 matrices"),
    ] {
        let error = load(&skinned.clone().set(pointer, value)).expect_err(pointer).to_string();
        assert!(error.contains(place) && error.contains(words), "{pointer}: {error}");
    }
}

/// Oracle: by hand; the Khronos model by its count of instances.
#[test]
fn instanced_meshes_are_placed_below_their_node() {
    let mut fixture = Fixture::quad();
    let moved = fixture.floats(&[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0], "VEC3");
    // Half a turn about z as bytes; the others not at all.
    let turned = fixture.accessor(&[0, 0, 0, 127, 0, 0, 127, 0, 0, 0, 0, 127], 5120, "VEC4", 3);
    fixture.json["accessors"][turned]["normalized"] = true.into();
    let attributes = json!({"TRANSLATION": moved, "ROTATION": turned, "_ID": moved});
    fixture.json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    fixture.json["nodes"][0]["scale"] = json!([2, 2, 2]);
    fixture.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let scene = load(&fixture).expect("valid");
    let corner = |i: usize| {
        let placed = scene.instances[i].world_from_object.transform_point3(Vec3::new(1.0, 0.0, 0.0));
        placed + scene.origin.as_vec3()
    };
    assert_eq!((scene.instances.len(), scene.meshes.len()), (3, 1));
    let expected = [Vec3::new(4.0, 0.0, 0.0), Vec3::new(-2.0, 0.0, 0.0), Vec3::new(2.0, 0.0, 8.0)];
    for (i, expected) in expected.into_iter().enumerate() {
        assert!((corner(i) - expected).length() < 1e-5, "{i}: {} for {expected}", corner(i));
    }
    let error = load(&fixture.set("/accessors/3/count", 2.into())).expect_err("other counts").to_string();
    assert!(error.contains("expected 2 instances"), "{error}");

    let Some(shared) = shared("instances of a Khronos model") else { return };
    let path = shared.join("assets/khronos/SimpleInstancing/glTF-Binary/SimpleInstancing.glb");
    if path.exists() {
        let scene = Scene::load(path).expect("the model loads");
        assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 125));
    }
}
