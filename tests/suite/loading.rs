//! Loading of scenes: the shared ones by their known counts, and every feature of the loader on files made here.

mod animation;
mod appearance;
mod cases;
#[cfg(any(feature = "draco", feature = "meshopt"))]
mod compressed;
mod content;
pub mod fixture;
mod hostile;
mod lights;
mod lobes;

use std::f64::consts::FRAC_1_SQRT_2;
use std::path::Path;

use glam::{Vec2, Vec3};
use pathspace::Scene;
use pathspace::scene::{AlphaMode, ColorSpace, LoadOptions, Projection, PunctualKind, TextureSlot, Wrap};
use serde_json::{Value, json};

use crate::common::shared;
use fixture::{Fixture, write};

/// A small RGB PNG whose texel (x, y) is (40·x, 40·y, 200).
fn png(width: u32, height: u32) -> Vec<u8> {
    let image = image::RgbImage::from_fn(width, height, |x, y| image::Rgb([40 * x as u8, 40 * y as u8, 200]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("a PNG in memory");
    bytes.into_inner()
}

fn load(fixture: &Fixture) -> Scene {
    let directory = tempfile::tempdir().expect("a temporary directory");
    write(directory.path(), "a b.png", &png(3, 2));
    as_filed(fixture.write(directory.path())).expect("the fixture is valid")
}

/// The scene as its file has it, also without light.
fn as_filed(path: impl AsRef<Path>) -> pathspace::Result<Scene> {
    Scene::load_with(path, &LoadOptions::default().fallback_light(false))
}

fn warns(scene: &Scene, words: &str) -> bool {
    scene.warnings.iter().any(|warning| warning.what.contains(words))
}

/// Oracle: the table of the shared scenes' README (triangles, size) and their definitions (meshes, lights, textures).
#[test]
fn shared_scenes_have_their_known_counts() {
    for (name, triangles, size, instances, lights, textures) in [
        ("cornell-box", 38, 512, 8, 0, 0),
        ("veach-mis", 1292, 512, 10, 0, 0),
        ("glass-caustics", 102_418, 256, 8, 0, 0),
        ("env-object", 260_482, 512, 3, 0, 0),
        ("many-lights", 1188, 256, 364, 2, 0),
        ("interior", 1_036_330, 256, 70, 0, 8),
    ] {
        let Some(shared) = shared("the counts of the shared scenes") else { return };
        let scene = as_filed(shared.join(format!("scenes/{name}.gltf"))).expect("a shared scene loads");
        assert_eq!(scene.triangle_count(), triangles, "{name}");
        assert_eq!(
            (scene.instances.len(), scene.punctual.len(), scene.textures.len()),
            (instances, lights, textures),
            "{name}"
        );
        assert_eq!(scene.suggested_size, Some((size, size)), "{name}");
        assert_eq!((scene.cameras.len(), scene.warnings.len(), scene.origin), (1, 0, glam::DVec3::ZERO), "{name}");
    }
}

/// Oracle: `expect.toml` beside each scene of the repository, whose environment must load, too.
#[test]
fn own_scenes_load_as_their_recipes_say() {
    let scenes = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes"));
    let caustics = ["sun-on-chrome", "lamp-through-glass", "lamp-in-glass", "pool"];
    let others = ["cornell-box", "veach-mis", "glass-caustics", "many-lights", "env-object", "interior", "in-motion"];
    for name in others.into_iter().chain(caustics) {
        let recipe = std::fs::read_to_string(scenes.join(name).join("expect.toml")).expect("a recipe");
        let recipe: toml::Table = toml::from_str(&recipe).expect("valid TOML");
        let path = scenes.join(name).join(recipe["scene"].as_str().expect("a file name"));
        let mut scene = if path.exists() {
            let scene = Scene::load(path).expect("an own scene loads");
            assert_eq!(scene.triangle_count() as i64, recipe["triangles"].as_integer().expect("a count"), "{name}");
            let (width, height) = scene.suggested_size.expect("a size");
            assert_eq!(
                recipe["size"].as_array().expect("a size"),
                &[i64::from(width).into(), i64::from(height).into()],
                "{name}"
            );
            scene
        } else {
            // The interior is written by its generator, which needs numpy.
            assert_eq!(name, "interior");
            Scene::default()
        };
        if let Some(environment) = recipe.get("env") {
            let path = scenes.join(name).join(environment.as_str().expect("a file name"));
            scene.load_environment(path, 0.0, 1.0).expect("an environment loads");
            assert_eq!(scene.environment.map(|environment| (environment.width, environment.height)), Some((1024, 512)));
            assert!(!warns(&Scene { warnings: scene.warnings, ..Scene::default() }, "negative"));
        }
    }
}

/// Oracle: the asset's published data: five materials with normal maps, no camera, normals and tangents in the file.
#[test]
fn a_real_asset_loads() {
    let Some(shared) = shared("a real asset") else { return };
    let path = shared.join("assets/FlightHelmet/FlightHelmet.gltf");
    let scene = as_filed(path).expect("the asset loads");
    assert_eq!(scene.textures.len(), 15);
    assert!(warns(&scene, "camera") && scene.warnings.len() == 1);
    assert!(scene.meshes.iter().all(|mesh| mesh.normals.is_some() && mesh.tangents.is_some()));
    assert_eq!(scene.textures.iter().filter(|texture| texture.color_space == ColorSpace::Srgb).count(), 5);
    // The automatic camera looks down on the asset from the front and the right, and sees all of it.
    let camera = &scene.cameras[0];
    let towards = -Vec3::from(camera.world_from_camera.matrix3.z_axis);
    assert!(towards.z < -0.6 && towards.x < -0.3 && (-0.5..-0.2).contains(&towards.y), "{camera:?}");
    let Projection::Perspective { yfov_rad, .. } = camera.projection else { panic!("a perspective") };
    let view = camera.world_from_camera.inverse();
    let mut most = 0.0f32;
    for instance in &scene.instances {
        for &p in &scene.meshes[instance.mesh.index()].positions {
            let p = view.transform_point3(instance.world_from_object.transform_point3(p));
            most = most.max(p.truncate().abs().max_element() / (-p.z * (0.5 * yfov_rad).tan()));
        }
    }
    assert!((0.85..1.0).contains(&most), "{most}");
}

/// The triangles of the only mesh as positions.
fn corners(scene: &Scene) -> Vec<[Vec3; 3]> {
    let mesh = &scene.meshes[0];
    mesh.triangles.iter().map(|triangle| triangle.map(|corner| mesh.positions[corner as usize])).collect()
}

/// Strips, fans, lists without indices and GLB all give the quad. Oracle: each triangle faces +Z and the areas add up
/// to 1.
#[test]
fn every_triangle_mode_gives_the_same_quad() {
    let quad = Fixture::quad();
    let indexed = |indices: &[u8], mode: u32| {
        let mut fixture = quad.clone();
        let accessor = fixture.accessor(indices, 5121, "SCALAR", indices.len());
        fixture.set("/meshes/0/primitives/0/indices", accessor.into()).set("/meshes/0/primitives/0/mode", mode.into())
    };
    let mut unindexed = quad.clone();
    let p = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let list: Vec<f32> = [0, 1, 2, 0, 2, 3].iter().flat_map(|&n: &usize| p[n]).collect();
    let accessor = unindexed.floats(&list, "VEC3");
    let unindexed = unindexed.set("/meshes/0/primitives/0", json!({"attributes": {"POSITION": accessor}}));
    let scenes = [load(&quad), load(&indexed(&[0, 1, 3, 2], 5)), load(&indexed(&[0, 1, 2, 3], 6)), load(&unindexed)];
    for scene in &scenes {
        let triangles = corners(scene);
        assert_eq!(triangles.len(), 2);
        let area = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a) * 0.5;
        assert!(triangles.iter().all(|&triangle| area(triangle) == Vec3::new(0.0, 0.0, 0.5)), "{triangles:?}");
    }
    // A strip of five: the winding alternates. Oracle: glTF 2.0 §3.7.2.1.
    let strip = load(&indexed(&[0, 1, 3, 2], 5));
    assert_eq!(corners(&strip)[1].map(|p| p.truncate().to_array()), [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    let directory = tempfile::tempdir().expect("a temporary directory");
    let glb = Scene::load(write(directory.path(), "quad.glb", &quad.glb())).expect("a GLB");
    assert_eq!(corners(&glb), corners(&scenes[0]));
}

/// Degenerate triangles are dropped and counted; points and lines too. Oracle: counted by hand.
#[test]
fn what_has_no_area_is_counted() {
    let mut fixture = Fixture::quad();
    // Repeated index, collinear (0, 0, 0)–(1, 1, 0) doubled back, then two good ones.
    let accessor = fixture.accessor(&[0, 0, 1, 0, 2, 0, 2, 2, 2, 0, 1, 2, 0, 2, 3], 5121, "SCALAR", 15);
    let mut fixture = fixture.set("/meshes/0/primitives/0/indices", accessor.into());
    for (mode, material) in [(0, 0), (1, 0), (2, 0), (3, 0)] {
        let primitives = fixture.json["meshes"][0]["primitives"].as_array_mut().expect("primitives");
        primitives.push(json!({"attributes": {"POSITION": 0}, "mode": mode, "material": material}));
    }
    let scene = load(&fixture);
    assert_eq!(corners(&scene), corners(&load(&Fixture::quad())));
    assert_eq!((scene.dropped.degenerate_triangles, scene.dropped.points_and_lines), (3, 4 + 2 + 4 + 3));
    assert!(warns(&scene, "3 triangles without area") && warns(&scene, "13 points and lines"));
}

/// Sparse, strided and integer accessors. Oracle: glTF 2.0 §3.6.2.3 and §3.11 by hand.
#[test]
fn accessors_of_every_layout_are_read() {
    // Vertex 2 of the quad is moved by a sparse accessor; with no view at all the others are zero.
    let mut fixture = Fixture::quad();
    let values: Vec<u8> = [2.0f32, 3.0, 4.0].iter().flat_map(|value| value.to_le_bytes()).collect();
    let (indices, values) = (fixture.view(&[2]), fixture.view(&values));
    let indices = json!({"bufferView": indices, "componentType": 5121});
    let sparse = json!({"count": 1, "indices": indices, "values": {"bufferView": values}});
    let scene = load(&fixture.clone().set("/accessors/0/sparse", sparse));
    assert_eq!(scene.meshes[0].positions, [Vec3::ZERO, Vec3::X, Vec3::new(2.0, 3.0, 4.0), Vec3::Y]);

    // Interleaved positions and 16-bit normalized texture coordinates, 16 bytes a vertex.
    let mut fixture = Fixture::quad();
    let mut bytes = Vec::new();
    for [x, y] in [[0.0f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
        [x, y, 0.0].iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        [x, y].iter().for_each(|value| bytes.extend(((value * 65535.0) as u16).to_le_bytes()));
    }
    let accessor = fixture.accessor(&bytes, 5123, "VEC2", 4);
    let view = fixture.json["bufferViews"].as_array().expect("views").len() - 1;
    let fixture = fixture
        .set(&format!("/bufferViews/{view}/byteStride"), json!(16))
        .set(&format!("/accessors/{accessor}/byteOffset"), json!(12))
        .set(&format!("/accessors/{accessor}/normalized"), json!(true))
        .set("/accessors/0/bufferView", json!(view))
        .set("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(accessor));
    let scene = load(&fixture);
    assert_eq!(scene.meshes[0].positions, [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y]);
    assert_eq!(scene.meshes[0].uvs.as_deref(), Some(&[Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y][..]));

    // Vertices that no triangle uses are not kept, and 8-bit normalized coordinates.
    let mut fixture = Fixture::quad();
    let (few, uvs) = (
        fixture.accessor(&[3, 1, 2], 5121, "SCALAR", 3),
        fixture.accessor(&[0, 51, 102, 153, 204, 255, 0, 255], 5121, "VEC2", 4),
    );
    let fixture = fixture
        .set("/meshes/0/primitives/0/indices", few.into())
        .set(&format!("/accessors/{uvs}/normalized"), json!(true))
        .set("/meshes/0/primitives/0/attributes/TEXCOORD_0", uvs.into());
    let mesh = &load(&fixture).meshes[0];
    assert_eq!((mesh.positions.len(), mesh.triangles[0]), (3, [2, 0, 1]));
    assert_eq!(mesh.uvs.as_deref(), Some(&[Vec2::new(0.4, 0.6), Vec2::new(0.8, 1.0), Vec2::Y][..]));
}

/// Normals are made unit, broken ones replaced; uvs that are not finite become 0. Oracle: by hand.
#[test]
fn broken_vertex_attributes_are_repaired_and_reported() {
    let mut fixture = Fixture::quad();
    let normals = fixture.floats(&[0.0, 0.0, 5.0, f32::NAN, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0], "VEC3");
    let mut fixture = fixture.set("/meshes/0/primitives/0/attributes/NORMAL", normals.into());
    fixture.binary[60..64].copy_from_slice(&f32::NAN.to_le_bytes());
    let scene = load(&fixture);
    assert_eq!(scene.meshes[0].normals.as_deref(), Some(&[Vec3::Z, Vec3::Z, Vec3::Z, Vec3::X][..]));
    assert_eq!(scene.meshes[0].uvs.as_ref().expect("uvs")[0], Vec2::new(0.0, 1.0));
    assert!(warns(&scene, "2 normals have no direction") && warns(&scene, "1 texture coordinates are not finite"));
}

/// Node transforms, recentring, cameras and lights. Oracle: by hand; positions far away keep their f32 differences
/// exactly.
#[test]
fn nodes_are_flattened_in_double_precision() {
    let lights = json!({"KHR_lights_punctual": {"lights": [
        {"type": "spot", "color": [1, 0.5, 0], "intensity": 8, "range": 4,
            "spot": {"innerConeAngle": 0.5, "outerConeAngle": 1.0}},
        {"type": "directional"}]}});
    let mut fixture = Fixture::quad().set("/extensions", lights);
    // Root at 10⁶ m with a fraction f32 cannot hold; child mirrored and stretched; camera under a scaled node.
    fixture.json["nodes"] = json!([
        {"translation": [1000000.0625, 0, -2000000.03125], "children": [1, 2, 3, 4]},
        {"mesh": 0, "scale": [-2, 3, 1]},
        {"camera": 0, "scale": [7, 7, 7], "rotation": [0, FRAC_1_SQRT_2, 0, FRAC_1_SQRT_2], "translation": [0, 0, 5]},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}, "rotation": [FRAC_1_SQRT_2, 0, 0, FRAC_1_SQRT_2]},
        {"extensions": {"KHR_lights_punctual": {"light": 1}}}]);
    fixture.json["scenes"][0]["nodes"] = json!([0]);
    let scene = load(&fixture);
    let root = glam::DVec3::new(1000000.0625, 0.0, -2000000.03125);
    assert!(warns(&scene, "far from the origin") && scene.origin.as_vec3().as_dvec3() == scene.origin);
    let placement = scene.instances[0].world_from_object;
    assert!(placement.matrix3.determinant() < 0.0);
    assert_eq!(Vec3::from(placement.translation), (root - scene.origin).as_vec3());
    // The bounds' diagonal is √13 m, so the origin has multiples of 4 m, and their centre is within half of that.
    assert_eq!(scene.origin % 4.0, glam::DVec3::ZERO);
    assert!((placement.transform_point3(Vec3::new(0.5, 0.5, 0.0))).abs().max_element() <= 2.0);

    let camera = &scene.cameras[0];
    assert!((camera.world_from_camera.matrix3.determinant() - 1.0).abs() < 1e-6);
    assert!((Vec3::from(camera.world_from_camera.matrix3.z_axis) - Vec3::X).length() < 1e-6);
    assert!(matches!(camera.projection, Projection::Perspective { yfov_rad: 0.7, aspect: None }));
    let [spot, sun] = &scene.punctual[..] else { panic!("two lights") };
    assert_eq!(spot.intensity, Vec3::new(8.0, 4.0, 0.0));
    assert!((spot.direction - Vec3::Y).length() < 1e-6 && (spot.range_m, sun.range_m) == (4.0, f32::INFINITY));
    assert_eq!(spot.kind, PunctualKind::Spot { cos_inner: 0.5f32.cos(), cos_outer: 1.0f32.cos() });
    assert_eq!((sun.kind, sun.direction, sun.intensity), (PunctualKind::Directional, Vec3::NEG_Z, Vec3::ONE));
}

/// Materials: every factor arrives, out-of-range ones are clamped, and nothing is ignored in silence. Oracle: the
/// file's numbers.
#[test]
fn materials_are_read_and_every_omission_is_named() {
    let material = json!({
        "name": "rich", "doubleSided": true, "alphaMode": "MASK", "emissiveFactor": [1, 0.5, 0.25],
        "pbrMetallicRoughness": {"baseColorFactor": [1.2, -0.1, 0.5, 1], "metallicFactor": 0.25, "roughnessFactor": 2,
            "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}},
        "normalTexture": {"index": 0, "scale": 0.5}, "emissiveTexture": {"index": 1, "texCoord": 1},
        "occlusionTexture": {"index": 0},
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 8},
            "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [0.1, 0.2, 0.3],
                "specularTexture": {"index": 0}},
            "KHR_materials_ior": {"ior": 0.5, "extras": 1},
            "KHR_materials_transmission": {"transmissionFactor": 0.75},
            "KHR_materials_sheen": {"sheenRoughnessFactor": 1},
            "KHR_materials_volume": {"thicknessFactor": 2, "attenuationDistance": 3,
                "attenuationColor": [0.5, 0.5, 1]}}});
    let fixture = Fixture::quad()
        .set("/materials/0", material)
        .set("/samplers", json!([{"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}]))
        .set("/images", json!([{"uri": "a%20b.png"}, {"uri": "a b.png"}]))
        .set("/textures", json!([{"source": 0, "sampler": 0}, {"source": 1}]));
    let scene = load(&fixture);
    let material = &scene.materials[0];
    assert_eq!((material.base_color, material.metallic, material.roughness), (Vec3::new(1.0, 0.0, 0.5), 0.25, 1.0));
    assert_eq!(material.emissive, Vec3::new(8.0, 4.0, 2.0));
    assert_eq!((material.alpha_mode, material.occlusion_texture), (AlphaMode::Mask { cutoff: 0.5 }, true));
    // Base colour, emission and normals each read coordinates of their own.
    let channel = |slot: Option<TextureSlot>| slot.expect("textured").uv_set;
    let slots = [material.base_color_texture, material.emissive_texture, material.normal_texture].map(channel);
    assert_eq!((slots, scene.meshes[0].more_uvs.len()), ([0, 1, 2], 2));
    assert!(warns(&scene, "TEXCOORD_1"));
    assert_eq!((material.specular, material.specular_color, material.ior), (0.5, Vec3::new(0.1, 0.2, 0.3), 1.0));
    assert_eq!((material.transmission, material.thickness, material.attenuation_distance_m), (0.75, 2.0, 3.0));
    assert_eq!((material.normal_scale, material.double_sided, material.unlit), (0.5, true, false));
    for words in ["baseColorFactor 1.2", "baseColorFactor -0.1", "roughnessFactor 2", "ior 0.5"] {
        let warning = scene.warnings.iter().find(|warning| warning.what.contains(words));
        assert!(warning.is_some_and(|warning| warning.place.contains("\"rich\"")), "{words}: {:?}", scene.warnings);
    }
    // One image, colour and data: two textures that share their texels.
    let [color, glow, normal] = &scene.textures[..] else { panic!("three textures: {:?}", scene.textures) };
    assert_eq!(glow.color_space, ColorSpace::Srgb);
    assert_eq!((color.color_space, normal.color_space), (ColorSpace::Srgb, ColorSpace::Linear));
    assert!(color.texels.shares(&normal.texels));
    assert_eq!((color.wrap_u, color.wrap_v, color.bilinear), (Wrap::ClampToEdge, Wrap::MirroredRepeat, false));
    assert_eq!((color.width, color.height, color.texels.eight().expect("8 bits")[5]), (3, 2, [80, 40, 200, 255]));
    // The normal map had no tangents to go with.
    assert!(scene.meshes[0].tangents.is_some() && scene.meshes[0].normals.is_some());
}

/// What a file may leave out. Oracle: glTF 2.0's defaults.
#[test]
fn defaults_apply_where_the_file_is_silent() {
    let mut fixture = Fixture::quad();
    let root = fixture.json.as_object_mut().expect("an object");
    ["scene", "scenes", "materials", "cameras"].iter().for_each(|name| drop(root.remove(*name)));
    fixture.json["nodes"] = json!([{"children": [1]}, {"mesh": 0}]);
    fixture.json["meshes"][0]["primitives"][0]["material"].take();
    let scene = load(&fixture.set("/scenes", Value::Array(vec![])));
    assert_eq!((scene.materials.len(), scene.materials[0].metallic, scene.instances.len()), (1, 1.0, 1));
    assert!(warns(&scene, "no camera") && scene.meshes[0].normals.is_none() && scene.suggested_size.is_none());
    // From above and aside, the quad's middle is straight ahead.
    let camera = scene.cameras[0].world_from_camera;
    let to_middle = Vec3::new(0.5, 0.5, 0.0) - scene.cameras[0].position();
    let off = to_middle.normalize().distance(-Vec3::from(camera.matrix3.z_axis));
    assert!(off < 1e-5 && to_middle.z < -1.0 && to_middle.y < -0.1, "{to_middle}, {off} off");
    let inline = Fixture::quad();
    let uri = format!("data:application/octet-stream;base64,{}", base64(&inline.binary));
    assert_eq!(corners(&load(&inline.set("/buffers/0/uri", uri.into()))).len(), 2);
}

fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let groups = bytes.chunks(3).flat_map(|group| {
        let word = group.iter().fold(0u32, |word, &byte| word << 8 | u32::from(byte)) << (8 * (3 - group.len()));
        (0..4).map(move |n| if n <= group.len() { ALPHABET[(word >> (18 - 6 * n) & 63) as usize] as char } else { '=' })
    });
    groups.collect()
}

/// Generated tangents agree with those that the asset's author baked. Oracle: FlightHelmet's own TANGENT accessors,
/// stripped from a copy of the file; w must agree, as glTF's bitangent is cross(normal, tangent)·w. Baking tools split
/// corners differently at seams, so a small share may differ.
#[test]
fn generated_tangents_agree_with_baked_ones() {
    let Some(shared) = shared("generated tangents") else { return };
    let path = shared.join("assets/FlightHelmet/FlightHelmet.gltf");
    let mut json: Value = serde_json::from_slice(&std::fs::read(&path).expect("the asset")).expect("JSON");
    for mesh in json["meshes"].as_array_mut().expect("meshes") {
        mesh["primitives"][0]["attributes"]
            .as_object_mut()
            .expect("attributes")
            .remove("TANGENT")
            .expect("baked tangents");
    }
    let folder = path.parent().expect("a folder").canonicalize().expect("a folder");
    for table in ["buffers", "images"] {
        for item in json[table].as_array_mut().expect("a table") {
            let uri = item["uri"].as_str().expect("a file").to_owned();
            item["uri"] = folder.join(uri).to_str().expect("UTF-8").into();
        }
    }
    let directory = tempfile::tempdir().expect("a temporary directory");
    let stripped = write(directory.path(), "stripped.gltf", json.to_string().as_bytes());
    // Its buffer stays with the asset.
    let stripped = Scene::load_with(stripped, &LoadOptions::default().allow_outside(true)).expect("still valid");
    let baked = Scene::load(&path).expect("the asset loads");
    let (mut corners, mut agreeing, mut mirrored) = (0, 0, 0);
    for (ours, theirs) in stripped.meshes.iter().zip(&baked.meshes) {
        let (our_tangents, their_tangents) =
            (ours.tangents.as_ref().expect("made"), theirs.tangents.as_ref().expect("read"));
        for (ours, theirs) in ours.triangles.as_flattened().iter().zip(theirs.triangles.as_flattened()) {
            let (ours, theirs) = (our_tangents[*ours as usize], their_tangents[*theirs as usize]);
            corners += 1;
            agreeing += usize::from(ours.truncate().dot(theirs.truncate()) > 0.98);
            mirrored += usize::from(ours.w != theirs.w);
        }
    }
    println!("{corners} corners: {agreeing} agree, {mirrored} with the other sign");
    assert!(agreeing > corners * 95 / 100, "{agreeing} of {corners}");
    assert!(mirrored < corners / 100, "{mirrored} of {corners}");
}
