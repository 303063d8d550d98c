//! What of a file is shown: morph targets by weight, scenes, variants, animations, hidden nodes. Oracle: the
//! specification's sums and rules, by hand on a quad. Deterministic.

use std::collections::HashSet;

use glam::{DVec3, Vec3, Vec4};
use pathspace::render::Strategy;
use pathspace::scene::geometry::Geometry;
use pathspace::scene::{LoadOptions, Shutter};
use pathspace::{Error, Scene};
use serde_json::{Value, json};

use super::fixture::Fixture;
use crate::common::{options, render, shared};

fn with(fixture: &Fixture, options: LoadOptions) -> Result<Scene, Error> {
    let directory = tempfile::tempdir().expect("a temporary directory");
    Scene::load_with(fixture.write(directory.path()), &options.fallback_light(false))
}

fn load(fixture: &Fixture) -> Scene {
    with(fixture, LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

fn at(time_s: f64) -> LoadOptions {
    LoadOptions::default().shutter(Shutter::new(time_s, time_s).expect("a time"))
}

/// The quad with normals, colours and two targets: one lifts it and tilts its normals, one moves it along x by bytes
/// (KHR_mesh_quantization) and moves its texture coordinates; and a second node that shows the same mesh.
fn morphing() -> Fixture {
    let mut fixture = Fixture::quad();
    let normals = fixture.floats(&[0.0, 0.0, 1.0].repeat(4), "VEC3");
    let colors = fixture.floats(&[0.2, 0.4, 0.8, 1.0].repeat(4), "VEC4");
    let up = fixture.floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0], "VEC3");
    let tilt = fixture.floats(&[2.0, 0.0, 0.0].repeat(4), "VEC3");
    let paint = fixture.floats(&[0.4, 0.4, 0.8, 0.0].repeat(4), "VEC4");
    // Four bytes an element, the last one padding.
    let along = fixture.accessor(&[3, 0, 0, 0].repeat(4), 5120, "VEC3", 4);
    fixture.json["bufferViews"][along]["byteStride"] = 4.into();
    let slide = fixture.floats(&[0.5, 0.25].repeat(4), "VEC2");
    let primitive = &mut fixture.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["NORMAL"] = normals.into();
    primitive["attributes"]["COLOR_0"] = colors.into();
    primitive["targets"] = json!([
        {"POSITION": up, "NORMAL": tilt, "COLOR_0": paint}, {"POSITION": along, "TEXCOORD_0": slide}
    ]);
    fixture.json["nodes"].as_array_mut().expect("an array").push(json!({"mesh": 0, "translation": [0.0, 5.0, 0.0]}));
    fixture.set("/scenes/0/nodes", json!([0, 1, 2]))
}

/// Oracle: base + Σ weight·displacement (glTF 2.0 §3.7.2.2): weights of the mesh by default, of the node before
/// them. Two nodes with equal weights share a mesh.
#[test]
fn targets_are_added_by_weight() {
    let still = load(&morphing());
    assert_eq!((still.meshes.len(), still.instances.len()), (1, 2));
    assert_eq!(still.meshes[0].positions[2], Vec3::new(1.0, 1.0, 0.0));

    let by_mesh = load(&morphing().set("/meshes/0/weights", json!([0.5, 0.0])));
    assert_eq!(by_mesh.meshes.len(), 1);
    let mesh = &by_mesh.meshes[0];
    assert_eq!(mesh.positions[0], Vec3::new(0.0, 0.0, 0.5));
    assert_eq!(mesh.positions[2], Vec3::new(1.0, 1.0, 1.0));
    let normal = mesh.normals.as_ref().expect("normals")[1];
    assert!(normal.distance(Vec3::new(1.0, 0.0, 1.0).normalize()) < 1e-6, "{normal}");
    // 0.8 + 0.5·0.8 is clamped, as the text says.
    let color = mesh.colors.as_ref().expect("colours")[3];
    assert!(color.distance(Vec4::new(0.4, 0.6, 1.0, 1.0)) < 1e-6, "{color}");
    assert!(by_mesh.warnings.is_empty(), "{:?}", by_mesh.warnings);

    let both = morphing().set("/meshes/0/weights", json!([0.5, 0.0])).set("/nodes/0/weights", json!([0.0, 2.0]));
    let both = load(&both);
    assert_eq!((both.meshes.len(), both.instances.len()), (2, 2));
    let moved = &both.meshes[both.instances[0].mesh.index()];
    assert_eq!(moved.positions[1], Vec3::new(7.0, 0.0, 0.0));
    assert_eq!(moved.uvs.as_ref().expect("coordinates")[0].to_array(), [1.0, 1.5]);
    assert_eq!(both.meshes[both.instances[1].mesh.index()].positions[2].z, 1.0);
}

/// Oracle: Appendix C for arrays: all weights of a key together, tangents around them in cubic splines. Hermite at ½
/// of a span of 2 s: (v₀ + v₁)/2 + Δt·(b₀ − a₁)/8.
#[test]
fn animations_drive_weights() {
    let animate = |interpolation: &str, values: &[f32]| {
        let mut fixture = morphing().set("/meshes/0/weights", json!([9.0, 9.0]));
        let (input, output) = (fixture.floats(&[1.0, 3.0], "SCALAR"), fixture.floats(values, "SCALAR"));
        fixture.set(
            "/animations",
            json!([{
                "name": "smile", "samplers": [{"input": input, "output": output, "interpolation": interpolation}],
                "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]
            }]),
        )
    };
    // Height of corner 0, and how far it is along x.
    let shape = |fixture: &Fixture, time_s: f64| {
        let scene = with(fixture, at(time_s)).unwrap_or_else(|error| panic!("{error}"));
        let point = scene.meshes[scene.instances[0].mesh.index()].positions[0];
        (point.z, point.x)
    };
    let linear = animate("LINEAR", &[0.0, 1.0, 4.0, 2.0]);
    assert_eq!([0.0, 1.5, 3.0].map(|time| shape(&linear, time)), [(0.0, 3.0), (1.0, 3.75), (4.0, 6.0)]);
    assert_eq!(shape(&animate("STEP", &[0.0, 1.0, 4.0, 2.0]), 2.9), (0.0, 3.0));
    let cubic = animate("CUBICSPLINE", &[8.0, 8.0, 1.0, 0.0, 2.0, 4.0, -2.0, 0.0, 3.0, 1.0, 8.0, 8.0]);
    assert_eq!(shape(&cubic, 2.0), (3.0, 3.0 * 1.5));

    let short = animate("LINEAR", &[0.0, 1.0, 4.0]);
    let error = with(&short, at(0.0)).expect_err("three values for two keys of two targets").to_string();
    assert!(error.contains("expected 4 values for 2 keys"), "{error}");
}

/// Oracle: exit code 4 at the accessor that is wrong, whatever the weights are not used for.
#[test]
fn broken_targets_are_refused() {
    let weighted = morphing().set("/meshes/0/weights", json!([1.0, 1.0]));
    for (pointer, value, words) in [
        ("/meshes/0/primitives/0/targets/0/POSITION", json!(1), "expected 4 elements"),
        ("/meshes/0/primitives/0/targets/0/NORMAL", json!(2), "expected VEC3"),
        ("/meshes/0/primitives/0/targets/1/POSITION", json!(99), "expected an index below"),
        ("/meshes/0/weights", json!([1.0, "x"]), "expected a number"),
        ("/nodes/0/weights", json!(3), "expected an array"),
        ("/meshes/0/weights", json!([1e39, 1.0]), "expected finite positions"),
    ] {
        let error = with(&weighted.clone().set(pointer, value), LoadOptions::default()).expect_err(pointer);
        assert!(error.exit_code() == 4 && error.to_string().contains(words), "{error}");
    }
}

/// Oracle: the extension's rule: a primitive has the material that it has in the variant, else its own; and the file's
/// list of names, from which an index is chosen where no name fits.
#[test]
fn variants_change_materials() {
    let name = "KHR_materials_variants";
    let fixture = Fixture::quad()
        .set("/materials", json!([{"name": "plain"}, {"name": "red"}, {"name": "blue"}]))
        .set(&format!("/extensions/{name}/variants"), json!([{"name": "evening"}, {"name": "morning"}, {"name": "0"}]))
        .set(
            &format!("/meshes/0/primitives/0/extensions/{name}/mappings"),
            json!([{"material": 1, "variants": [0, 2]}, {"material": 2, "variants": [1]}]),
        )
        .set("/extensionsRequired", json!([name]));
    let shown = |variant: Option<&str>| {
        let scene = with(&fixture, LoadOptions::default().variant(variant.map(str::to_owned)))?;
        assert_eq!(scene.variants, ["evening", "morning", "0"]);
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        Ok::<String, Error>(scene.materials[scene.meshes[0].material.index()].name.clone())
    };
    for (variant, material) in
        [(None, "plain"), (Some("evening"), "red"), (Some("morning"), "blue"), (Some("1"), "blue"), (Some("0"), "red")]
    {
        assert_eq!(shown(variant).as_deref().ok(), Some(material), "{variant:?}");
    }
    let error = shown(Some("noon")).expect_err("there is no such variant");
    assert!(error.exit_code() == 2 && error.to_string().contains("'evening', 'morning', '0'"), "{error}");
    let broken =
        fixture.clone().set(&format!("/meshes/0/primitives/0/extensions/{name}/mappings/0/material"), 7.into());
    assert_eq!(with(&broken, LoadOptions::default()).expect_err("no such material").exit_code(), 4);
}

/// Oracle: the scenes' own lists of nodes; the default one is the file's.
#[test]
fn scenes_are_chosen_by_name_or_index() {
    let mut fixture = Fixture::quad();
    let nodes = fixture.json["nodes"].as_array_mut().expect("an array");
    nodes.push(json!({"mesh": 0, "translation": [8.0, 0.0, 0.0], "name": "other"}));
    let fixture = fixture.set("/scenes", json!([{"nodes": [0, 1], "name": "a"}, {"nodes": [2, 1], "name": "b"}]));
    let x = |scene: Option<&str>| {
        let scene = with(&fixture, LoadOptions::default().scene(scene.map(str::to_owned)));
        scene.map(|scene| (scene.instances[0].world_from_object.translation.x + scene.origin.as_vec3().x, scene.scenes))
    };
    let names = vec!["a".to_owned(), "b".to_owned()];
    for (scene, expected) in [(None, 0.0), (Some("b"), 8.0), (Some("1"), 8.0), (Some("a"), 0.0)] {
        assert_eq!(x(scene).ok(), Some((expected, names.clone())), "{scene:?}");
    }
    assert_eq!(x(Some("2")).expect_err("two scenes").exit_code(), 2);
}

/// Oracle: one animation alone moves its own node; without a choice both run, as exporters mean that write one for each
/// object.
#[test]
fn one_animation_runs_alone() {
    let mut fixture = morphing();
    let (keys, up) = (fixture.floats(&[0.0, 1.0], "SCALAR"), fixture.floats(&[0.0, 0.0, 0.0, 0.0, 0.0, 4.0], "VEC3"));
    let animation = |node: usize, name: &str| {
        json!({
            "name": name, "samplers": [{"input": keys, "output": up}],
            "channels": [{"sampler": 0, "target": {"node": node, "path": "translation"}}]
        })
    };
    let fixture = fixture.clone().set("/animations", json!([animation(0, "first"), animation(2, "second")]));
    let heights = |animation: Option<&str>| {
        let scene = with(&fixture, at(0.5).animation(animation.map(str::to_owned)));
        let scene = scene.unwrap_or_else(|error| panic!("{error}"));
        [0, 1].map(|i| f64::from(scene.instances[i].world_from_object.translation.z) + scene.origin.z)
    };
    assert_eq!(heights(None), [2.0, 2.0]);
    assert_eq!(heights(Some("first")), [2.0, 0.0]);
    assert_eq!(heights(Some("1")), [0.0, 2.0]);
    assert!(with(&fixture, at(0.5).animation(Some("third".to_owned()))).is_err());
}

/// Oracle: the extension's text: meshes and lights of a hidden node and of those below it are gone, cameras stay.
#[test]
fn hidden_nodes_show_nothing() {
    let lamp = json!({"KHR_lights_punctual": {"light": 0}});
    let mut fixture = Fixture::quad().set("/extensions/KHR_lights_punctual/lights", json!([{"type": "point"}]));
    let nodes = fixture.json["nodes"].as_array_mut().expect("an array");
    nodes.push(json!({"children": [3, 1], "extensions": {"KHR_node_visibility": {"visible": false}}}));
    nodes.push(json!({
        "mesh": 0, "extensions": {"KHR_node_visibility": {"visible": true}, "KHR_lights_punctual": {"light": 0}}
    }));
    nodes.push(json!({"extensions": lamp}));
    let hidden = fixture.set("/scenes/0/nodes", json!([0, 2, 4]));
    let scene = load(&hidden);
    assert_eq!((scene.instances.len(), scene.punctual.len(), scene.cameras.len()), (1, 1, 1));
    let scene = load(&hidden.clone().set("/nodes/2/extensions/KHR_node_visibility/visible", Value::Bool(true)));
    assert_eq!((scene.instances.len(), scene.punctual.len()), (2, 2));
    let broken = hidden.set("/nodes/2/extensions/KHR_node_visibility/visible", json!(1));
    assert!(with(&broken, LoadOptions::default()).is_err_and(|error| error.exit_code() == 4));
}

/// Oracle: the same model quantized has the same size at every time, within its steps.
#[test]
fn models_with_targets_are_morphed() {
    let Some(shared) = shared("models with morph targets") else { return };
    let folder = shared.join("assets/khronos");
    let bounds = |scene: &Scene| {
        let points = scene.meshes.iter().flat_map(|mesh| &mesh.positions);
        points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(least, most), p| {
            (least.min(p.as_dvec3()), most.max(p.as_dvec3()))
        })
    };
    let cube = folder.join("AnimatedMorphCube/glTF-Binary/AnimatedMorphCube.glb");
    let quantized = folder.join("AnimatedMorphCube/glTF-Quantized/AnimatedMorphCube.gltf");
    for time_s in [0.0, 1.0, 2.5] {
        let load = |path| Scene::load_with(path, &at(time_s)).expect("the model");
        let (plain, quantized) = (load(&cube), load(&quantized));
        let ((a, b), (c, d)) = (bounds(&plain), bounds(&quantized));
        let scale = plain.instances[0].world_from_object.matrix3.x_axis.length() as f64;
        let other = quantized.instances[0].world_from_object.matrix3.x_axis.length() as f64;
        assert!(((b - a) * scale).distance((d - c) * other) < 1e-2 * (b - a).length() * scale, "{time_s} s");
    }
}

/// Oracle: the values at the keys, by linear interpolation: a node's translation moves as in any other channel; the
/// colour of a material, the intensity of a light and the switch of a node are as the shutter opens; what an animation
/// must not make is named.
#[test]
fn pointers_animate_what_they_name() {
    let mut fixture = Fixture::quad()
        .set("/extensions/KHR_lights_punctual/lights", json!([{"type": "point", "intensity": 1.0}]))
        .set("/nodes/0/extensions/KHR_lights_punctual/light", json!(0));
    fixture.json["nodes"].as_array_mut().expect("an array").push(json!({"mesh": 0, "translation": [0.0, 3.0, 0.0]}));
    let keys = fixture.floats(&[0.0, 1.0], "SCALAR");
    let along = fixture.floats(&[0.0, 0.0, 0.0, 4.0, 0.0, 0.0], "VEC3");
    let colors = fixture.floats(&[1.0, 0.0, 0.0, 1.0, 0.0, 0.5, 1.0, 1.0], "VEC4");
    let brighter = fixture.floats(&[1.0, 9.0], "SCALAR");
    let switch = fixture.accessor(&[1, 0], 5121, "SCALAR", 2);
    let (mut samplers, mut channels) = (Vec::new(), Vec::new());
    for (pointer, output, interpolation) in [
        ("/nodes/0/translation", along, "LINEAR"),
        ("/materials/0/pbrMetallicRoughness/baseColorFactor", colors, "LINEAR"),
        ("/extensions/KHR_lights_punctual/lights/0/intensity", brighter, "LINEAR"),
        ("/nodes/2/extensions/KHR_node_visibility/visible", switch, "STEP"),
        ("/materials/0/normalTexture/scale", brighter, "LINEAR"),
        ("/meshes/0/name", brighter, "LINEAR"),
    ] {
        channels.push(json!({"sampler": samplers.len(), "target": {
            "path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}
        }}));
        samplers.push(json!({"input": keys, "output": output, "interpolation": interpolation}));
    }
    let fixture = fixture
        .set("/animations", json!([{"samplers": samplers, "channels": channels}]))
        .set("/scenes/0/nodes", json!([0, 1, 2]))
        .set("/extensionsUsed", json!(["KHR_animation_pointer"]));
    let scene = with(&fixture, at(0.5)).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(f64::from(scene.instances[0].world_from_object.translation.x) + scene.origin.x, 2.0);
    assert_eq!(scene.materials[0].base_color, Vec3::new(0.5, 0.25, 0.5));
    assert_eq!(scene.punctual[0].intensity, Vec3::splat(5.0));
    assert_eq!(scene.instances.len(), 2);
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
    assert!(scene.warnings[0].what.ends_with("not animated (and 1 more like it)"), "{:?}", scene.warnings);
    assert!(scene.motion.unmoved.is_empty());

    let late = with(&fixture, at(1.0)).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(late.instances.len(), 1);
    let shutter = LoadOptions::default().shutter(Shutter::new(0.0, 0.5).expect("an interval"));
    let blurred = with(&fixture, shutter).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(blurred.motion.instances.len(), 1);
    // The colour, the intensity, and the lamp of the node that moves.
    assert_eq!(blurred.motion.unmoved.len(), 3, "{:?}", blurred.motion.unmoved);
}

/// Every model of the sample set loads, at rest and in the middle of its animations, each of its scenes and variants.
/// Oracle: no error but that of an extension of materials that is required and not read, or that this build leaves out;
/// something to see; a camera.
#[test]
fn every_model_of_the_sample_set_loads() {
    let Some(shared) = shared("the Khronos sample models") else { return };
    let mut files = Vec::new();
    let mut folders = vec![shared.join("assets/khronos")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let is_scene = path.extension().is_some_and(|end| end == "gltf" || end == "glb");
            if path.is_dir() {
                folders.push(path)
            } else if is_scene {
                files.push(path)
            }
        }
    }
    files.sort();
    assert!(files.len() >= 25, "{files:?}");
    for file in files {
        let plain = LoadOptions::default();
        let loaded = Scene::load_with(&file, &plain);
        if let Err(Error::UnsupportedExtension { extension, .. }) = &loaded {
            let left_out = match extension.as_str() {
                "KHR_draco_mesh_compression" => !cfg!(feature = "draco"),
                "EXT_meshopt_compression" | "KHR_meshopt_compression" => !cfg!(feature = "meshopt"),
                "KHR_texture_basisu" => !cfg!(feature = "basisu"),
                other => other.starts_with("KHR_materials_"),
            };
            assert!(left_out, "{}: {extension}", file.display());
            continue;
        }
        let scene = loaded.unwrap_or_else(|error| panic!("{error}"));
        assert!(scene.triangle_count() > 0 && !scene.cameras.is_empty(), "{}", file.display());
        let mut others = Vec::new();
        others.extend((1..scene.scenes.len()).map(|i| plain.clone().scene(Some(i.to_string()))));
        others.extend((0..scene.variants.len()).map(|i| plain.clone().variant(Some(i.to_string()))));
        for (i, span) in scene.motion.animations.iter().enumerate() {
            let (first, last) = span.seconds.expect("stated times");
            others.push(at(0.5 * (first + last)).animation(Some(i.to_string())));
        }
        for options in others {
            let scene = Scene::load_with(&file, &options).unwrap_or_else(|error| panic!("{error}"));
            assert!(scene.triangle_count() > 0, "{} {options:?}", file.display());
        }
    }
}

/// A strip of squares, 2 m long each, of more triangles than are baked; `meshes` materials of exact colours, one square
/// and one glTF mesh for each, over the same accessors or over copies of them.
fn swatches(colors: &[[f32; 3]], share: bool) -> Fixture {
    const SIDE: usize = 24;
    let mut fixture = Fixture::quad();
    let at = |i: usize| 2.0 * i as f32 / SIDE as f32;
    let grid = |i: usize| [at(i % (SIDE + 1)), at(i / (SIDE + 1)), 0.0];
    let positions: Vec<f32> = (0..(SIDE + 1) * (SIDE + 1)).flat_map(grid).collect();
    let cell = |i: usize| {
        let a = i / SIDE * (SIDE + 1) + i % SIDE;
        [a, a + 1, a + SIDE + 2, a, a + SIDE + 2, a + SIDE + 1]
    };
    let indices: Vec<u8> = (0..SIDE * SIDE).flat_map(cell).flat_map(|i| (i as u16).to_le_bytes()).collect();
    let (mut materials, mut meshes, mut nodes) = (Vec::new(), Vec::new(), Vec::new());
    let mut accessors = None;
    for (i, [r, g, b]) in colors.iter().enumerate() {
        let fresh = |fixture: &mut Fixture| {
            (fixture.floats(&positions, "VEC3"), fixture.accessor(&indices, 5123, "SCALAR", indices.len() / 2))
        };
        let (position, index) = *accessors.get_or_insert_with(|| fresh(&mut fixture));
        accessors = accessors.filter(|_| share);
        materials.push(json!({
            "name": format!("swatch {i}"), "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}},
            "pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0}
        }));
        meshes.push(json!({"primitives": [
            {"attributes": {"POSITION": position}, "indices": index, "material": i}
        ]}));
        nodes.push(json!({"mesh": i, "translation": [2.0 * i as f32, 0.0, 0.0]}));
    }
    let width = colors.len() as f32;
    nodes.push(json!({"camera": 0, "translation": [width, 1.0, 5.0]}));
    let all: Vec<usize> = (0..nodes.len()).collect();
    let camera =
        json!({"type": "orthographic", "orthographic": {"xmag": width, "ymag": 1.0, "znear": 0.1, "zfar": 9.0}});
    let fixture = fixture.set("/materials", json!(materials)).set("/meshes", json!(meshes));
    fixture.set("/nodes", json!(nodes)).set("/scenes/0/nodes", json!(all)).set("/cameras", json!([camera]))
}

/// Oracle: a Lambert surface under white light from everywhere shows its colour; with copies of the accessors in the
/// place of shared ones the same. Shared triangles are stored once, and each placement keeps its colour.
#[test]
fn meshes_over_the_same_accessors_are_one() {
    let colors = [[0.75, 0.0, 0.25], [0.0, 0.5, 0.0], [0.125, 0.25, 1.0]];
    for share in [true, false] {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let scene = Scene::load(swatches(&colors, share).write(directory.path())).expect("valid");
        assert_eq!((scene.meshes.len(), scene.instances.len()), (if share { 1 } else { 3 }, 3));
        let geometry = Geometry::build(&scene);
        assert_eq!(geometry.triangles.len(), 1152 * scene.meshes.len());
        let seen: HashSet<u32> = scene.instances.iter().map(|instance| scene.material_of(instance).0).collect();
        assert_eq!(seen.len(), 3);
        let shown = render(&scene, options(24, 8, 4).strategy(Strategy::BSDF));
        for (i, color) in colors.iter().enumerate() {
            let mean = shown.film.pixel(8 * i as u32 + 4, 4).mean();
            let off = (0..3).map(|c| (mean[c] - f64::from(color[c])).abs()).fold(0.0, f64::max);
            assert!(off < 1e-5, "{share} {i}: {mean:?}");
        }
    }
    // What is not alike is not shared: a lamp, glass, and vertex colours.
    for (member, value) in [
        ("/materials/1/emissiveFactor", json!([1, 1, 1])),
        ("/materials/1/extensions", json!({"KHR_materials_transmission": {"transmissionFactor": 1}})),
        ("/materials/1/alphaMode", json!("BLEND")),
    ] {
        assert_eq!(load(&swatches(&colors, true).set(member, value)).meshes.len(), 2, "{member}");
    }
}

/// Oracle: the case's own text: one grid of 100,352 triangles, stored once in a hundred colours.
#[test]
fn a_mesh_in_a_hundred_colours_is_stored_once() {
    let Some(shared) = shared("the case of shared geometry") else { return };
    let scene = Scene::load(shared.join("cases/shared-geometry-limit/colours.glb")).expect("the case loads");
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.triangle_count()), (1, 100, 10_035_200));
    let seen: HashSet<u32> = scene.instances.iter().map(|instance| scene.material_of(instance).0).collect();
    assert_eq!(seen.len(), 100);
}
