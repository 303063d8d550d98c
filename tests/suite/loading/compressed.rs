//! Compressed geometry: what streams hold is what the same models hold without compression.

#[cfg(feature = "draco")]
use std::collections::HashSet;
use std::path::Path;

use pathspace::scene::LoadOptions;
use pathspace::{Error, Scene};

#[cfg(feature = "meshopt")]
use super::fixture::Fixture;
#[cfg(feature = "draco")]
use super::fixture::write;
#[cfg(feature = "draco")]
use crate::common::shared;

fn load(path: &Path) -> Result<Scene, Error> {
    Scene::load_with(path, &LoadOptions::default().fallback_light(false))
}

#[cfg(feature = "draco")]
/// Least and most of all corners in the world.
fn bounds(scene: &Scene) -> [f32; 6] {
    let points = scene.instances.iter().flat_map(|instance| {
        let mesh = &scene.meshes[instance.mesh.index()];
        mesh.positions.iter().map(|&p| instance.world_from_object.transform_point3(p) + scene.origin.as_vec3())
    });
    let empty = [f32::INFINITY, f32::INFINITY, f32::INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY];
    points.fold(empty, |b, p| {
        let p = p.to_array();
        std::array::from_fn(|i| if i < 3 { b[i].min(p[i]) } else { b[i].max(p[i - 3]) })
    })
}

#[cfg(feature = "draco")]
/// Oracle: the models without compression: as many triangles, the same bounds and areas, attributes where they have
/// them, within the quantisation of the streams (11 bits and more).
#[test]
fn draco_streams_hold_the_same_models() {
    let Some(shared) = shared("Draco streams") else { return };
    for name in ["RiggedSimple", "MorphPrimitivesTest"] {
        let folder = shared.join("assets/khronos").join(name);
        let plain = load(&folder.join("glTF-Binary").join(format!("{name}.glb"))).expect("the plain model");
        let scene = load(&folder.join("glTF-Draco").join(format!("{name}.gltf"))).expect("the compressed model");
        assert_eq!(
            (scene.meshes.len(), scene.triangle_count()),
            (plain.meshes.len(), plain.triangle_count()),
            "{name}"
        );
        let words = |scene: &Scene| scene.warnings.iter().map(|w| w.what.clone()).collect::<HashSet<String>>();
        assert_eq!(words(&scene), words(&plain), "{name}");
        let (found, expected) = (bounds(&scene), bounds(&plain));
        let size = (0..3).map(|i| expected[i + 3] - expected[i]).fold(0.0, f32::max);
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < size / 512.0, "{name}: {found:?}, expected {expected:?}");
        }
        for (ours, theirs) in scene.meshes.iter().zip(&plain.meshes) {
            let area = |mesh: &pathspace::scene::Mesh| -> f64 {
                let at = |i: u32| mesh.positions[i as usize].as_dvec3();
                mesh.triangles.iter().map(|&[a, b, c]| (at(b) - at(a)).cross(at(c) - at(a)).length()).sum()
            };
            assert!((area(ours) / area(theirs) - 1.0).abs() < 5e-3, "{name}: {} for {}", area(ours), area(theirs));
            assert_eq!((ours.normals.is_some(), ours.uvs.is_some()), (theirs.normals.is_some(), theirs.uvs.is_some()));
            // Vertices face as their triangles do.
            let normals = ours.normals.as_ref().expect("the models have normals");
            let facing = ours.triangles.iter().filter(|&&[a, b, c]| {
                let at = |i: u32| ours.positions[i as usize];
                (at(b) - at(a)).cross(at(c) - at(a)).dot(normals[a as usize]) > 0.0
            });
            assert!(facing.count() * 10 >= ours.triangles.len() * 9, "{name}");
        }
    }
}

#[cfg(feature = "draco")]
/// Of a stream's attributes those are unpacked that the primitive names. Oracle: one that the stream lacks is missed by
/// its name alone.
#[test]
fn draco_attributes_are_unpacked_by_name() {
    let Some(shared) = shared("names in Draco streams") else { return };
    let folder = shared.join("assets/khronos/RiggedSimple/glTF-Draco");
    let directory = tempfile::tempdir().expect("a temporary directory");
    std::fs::copy(folder.join("RiggedSimple0.bin"), directory.path().join("RiggedSimple0.bin")).expect("the stream");
    let text = std::fs::read(folder.join("RiggedSimple.gltf")).expect("the model");
    let mut json: serde_json::Value = serde_json::from_slice(&text).expect("JSON");
    let mut load_it = |at: &str, value: usize| {
        json["meshes"][0]["primitives"][0].pointer_mut(at).expect("an object")["COLOR_0"] = value.into();
        load(&write(directory.path(), "scene.gltf", json.to_string().as_bytes()))
    };
    let stream = "/extensions/KHR_draco_mesh_compression/attributes";
    load_it(stream, 99).unwrap_or_else(|e| panic!("{e}"));
    let error = load_it("/attributes", 0).expect_err("a missing attribute");
    assert!(error.to_string().contains(&format!("{stream}/COLOR_0")), "{error}");
}

#[cfg(feature = "draco")]
/// Streams with bits flipped or cut end in an error or a scene. Oracle: no panic; what is refused says what was
/// expected. The seeds are fixed.
#[test]
fn broken_draco_streams_never_panic() {
    let Some(shared) = shared("broken Draco streams") else { return };
    let folder = shared.join("assets/khronos/RiggedSimple/glTF-Draco");
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path =
        write(directory.path(), "scene.gltf", &std::fs::read(folder.join("RiggedSimple.gltf")).expect("the model"));
    let stream = std::fs::read(folder.join("RiggedSimple0.bin")).expect("the stream");
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).expect("written")).expect("JSON");
    let number = |at: String| json.pointer(&at).and_then(serde_json::Value::as_u64).map_or(0, |n| n as usize);
    let view = number("/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression/bufferView".into());
    let [offset, length] = ["byteOffset", "byteLength"].map(|member| number(format!("/bufferViews/{view}/{member}")));
    let mut random = 0x9e37_79b9_7f4a_7c15u64;
    let mut refused = 0;
    for _ in 0..300 {
        let mut bent = stream.clone();
        for _ in 0..4 {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            let at = offset + (random >> 8) as usize % length;
            bent[at] ^= 1 << (random >> 40 & 7);
        }
        write(directory.path(), "RiggedSimple0.bin", &bent);
        if let Err(error) = load(&path) {
            assert!(error.exit_code() == 4 && error.to_string().contains("expected"), "{error}");
            refused += 1;
        }
    }
    assert!(refused > 30, "{refused} of 300");
}

/// Streams of the fixture's quad by meshoptimizer 0.23 in C++: positions in versions 0 and 1 of the codec (12 bytes an
/// element), indices as triangles and as a sequence (2 bytes).
#[cfg(feature = "meshopt")]
const POSITIONS: [&str; 2] = [
    "a000000133000000ffff01330000007e7d0000010c000000ff010c0000007e00000000000000000000000000000000000000000000000000\
     0000000000000000000000",
    "a1faeaaa000000ff007f007e00007f00000000000000000000000000000000000000000000010100",
];
#[cfg(feature = "meshopt")]
const INDICES: [&str; 2] = ["e1f000007687566778a9866589689801690000", "d100040406080400000000"];

#[cfg(feature = "meshopt")]
fn unhex(text: &str) -> Vec<u8> {
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).expect("ASCII"), 16).expect("hexadecimal");
    text.as_bytes().chunks(2).map(byte).collect()
}

/// The quad with positions and indices in streams; its own buffer views then lie in a buffer that is not there.
#[cfg(feature = "meshopt")]
fn packed(name: &str, positions: &[u8], indices: &[u8], mode: &str) -> Fixture {
    let mut fixture = Fixture::quad();
    let [first, second] = [positions, indices].map(|bytes| fixture.view(bytes));
    let view = |fixture: &Fixture, view: usize| fixture.json["bufferViews"][view].clone();
    for (place, from, mode, count, stride) in [(0, first, "ATTRIBUTES", 4, 12), (1, second, mode, 6, 2)] {
        let mut stream = view(&fixture, from);
        stream["byteStride"] = stride.into();
        (stream["mode"], stream["count"]) = (mode.into(), count.into());
        fixture.json["bufferViews"][place]["buffer"] = 1.into();
        fixture = fixture.set(&format!("/bufferViews/{place}/extensions/{name}"), stream);
    }
    let fallback = serde_json::json!({"byteLength": 4000, "extensions": {name: {"fallback": true}}});
    let buffers = serde_json::json!([fixture.json["buffers"][0], fallback]);
    fixture.set("/buffers", buffers).set("/extensionsRequired", serde_json::json!([name]))
}

/// Oracle: the quad without compression; the streams are another encoder's. Exact.
#[cfg(feature = "meshopt")]
#[test]
fn meshopt_streams_hold_the_same_quad() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let plain = load(&Fixture::quad().write(directory.path())).expect("the quad");
    for name in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        for (positions, (indices, mode)) in
            POSITIONS.iter().flat_map(|p| INDICES.iter().zip(["TRIANGLES", "INDICES"]).map(move |i| (p, i)))
        {
            let scene = load(&packed(name, &unhex(positions), &unhex(indices), mode).write(directory.path()));
            let scene = scene.unwrap_or_else(|error| panic!("{name} {mode}: {error}"));
            assert_eq!(scene.meshes[0].positions, plain.meshes[0].positions, "{name}");
            let sorted = |scene: &Scene| -> Vec<[u32; 3]> {
                // Codecs turn triangles.
                scene.meshes[0].triangles.iter().map(|&[a, b, c]| if a == 0 { [a, b, c] } else { [c, a, b] }).collect()
            };
            assert_eq!(sorted(&scene), sorted(&plain), "{name} {mode}");
            assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        }
    }
}

/// Oracle: exit code 4 and a word of what was expected, whatever the stream or its description say; streams that claim
/// more than their bytes can hold are refused before anything is allocated.
#[cfg(feature = "meshopt")]
#[test]
fn broken_meshopt_streams_are_refused() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let name = "EXT_meshopt_compression";
    let (positions, indices) = (unhex(POSITIONS[1]), unhex(INDICES[0]));
    let sound = packed(name, &positions, &indices, "TRIANGLES");
    let at = |member: &str| format!("/bufferViews/0/extensions/{name}/{member}");
    for (member, value) in [
        ("count", serde_json::json!(5)),
        ("count", serde_json::json!(1u64 << 40)),
        ("byteStride", serde_json::json!(3)),
        ("byteLength", serde_json::json!(7)),
        ("byteOffset", serde_json::json!(1u64 << 62)),
        ("buffer", serde_json::json!(9)),
        ("buffer", serde_json::json!(1)),
        ("mode", serde_json::json!("ELSE")),
        ("filter", serde_json::json!("OCTAHEDRAL")),
    ] {
        let error = load(&sound.clone().set(&at(member), value).write(directory.path())).expect_err(member);
        assert!(error.exit_code() == 4 && error.to_string().contains("expected"), "{error}");
    }
    let large = sound.clone().set(&at("count"), (1u64 << 33).into());
    let large = large.set("/bufferViews/0/byteLength", (12u64 << 33).into());
    assert_eq!(load(&large.write(directory.path())).expect_err("too large").exit_code(), 4);
    let (mut random, mut refused) = (0x9e37_79b9_7f4a_7c15u64, 0);
    for _ in 0..500 {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let (mut positions, mut indices) = (positions.clone(), indices.clone());
        let (place, bit) = ((random >> 40) as usize, 1u8 << (random >> 33 & 7));
        let length = positions.len() + indices.len();
        match (place % length).checked_sub(positions.len()) {
            None => positions[place % length] ^= bit,
            Some(place) => indices[place] ^= bit,
        }
        if let Err(error) = load(&packed(name, &positions, &indices, "TRIANGLES").write(directory.path())) {
            assert!(error.exit_code() == 4 && error.to_string().contains("expected"), "{error}");
            refused += 1;
        }
    }
    assert!(refused > 50, "{refused} of 500");
}

/// Seeds of the scene target with streams of every kind (`fuzz/seed-scenes.py`). Oracle: the ball that was put in,
/// within the quantisation; hostile ones are refused with exit code 4 and a word of what was expected.
#[cfg(all(feature = "draco", feature = "meshopt", feature = "basisu"))]
#[test]
fn seeds_with_streams_hold_a_ball_or_are_refused() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds/gltf");
    let hostile = ["cut-off", "many", "large"];
    let (mut whole, mut refused) = (0, 0);
    for entry in std::fs::read_dir(&folder).expect("the seeds") {
        let path = entry.expect("a seed").path();
        let name = path.file_stem().and_then(|name| name.to_str()).expect("ASCII").to_owned();
        let Some(kind) = ["draco-", "meshopt-", "basis"].into_iter().find(|kind| name.starts_with(kind)) else {
            continue;
        };
        match load(&path) {
            Ok(scene) => {
                assert!(!hostile.iter().any(|word| name.contains(word)), "{name} was read");
                whole += 1;
                if kind != "basis" {
                    // Four rows of six quads, or 18 of 32; without area are those that touch a pole.
                    let all: u64 = if name == "draco-valence" { 2 * 18 * 32 } else { 2 * 4 * 6 };
                    assert!(
                        (3 * all / 4..=all).contains(&scene.triangle_count()),
                        "{name}: {}",
                        scene.triangle_count()
                    );
                    let [.., x, y, _] = bounds(&scene);
                    assert!((x - 0.5).abs() < 0.01 && (y - 0.5).abs() < 0.01, "{name}: {x} and {y}");
                }
            }
            Err(error) => {
                assert!(hostile.iter().any(|word| name.contains(word)), "{error}");
                assert!(error.exit_code() == 4 && error.to_string().contains("expected"), "{error}");
                refused += 1;
            }
        }
    }
    assert_eq!((whole, refused), (11, 6));
}
