//! Broken and hostile files: each gives the right kind of error with the right pointer, on one line, in bounded time.

use std::path::Path;
use std::time::{Duration, Instant};

use pathspace::{Error, Scene};
use serde_json::{Value, json};

use super::fixture::{Fixture, write};

/// Far above what any of them takes (milliseconds), far below what an attack aims at.
const PATIENCE: Duration = Duration::from_secs(10);

fn load(path: &Path) -> Result<Scene, Error> {
    let start = Instant::now();
    let result = Scene::load(path);
    assert!(start.elapsed() < PATIENCE, "{} took {:?}", path.display(), start.elapsed());
    result
}

/// Checks that loading fails as a broken scene, at `pointer`, with `words` in the message.
fn expect_invalid(path: &Path, pointer: &str, words: &str) {
    let error = load(path).err().unwrap_or_else(|| panic!("expected an error at {pointer}"));
    let text = error.to_string();
    assert!(
        matches!(&error, Error::InvalidScene { pointer: found, .. } if found == pointer),
        "expected {pointer}, found {text}"
    );
    assert_eq!(error.exit_code(), 4);
    assert!(text.contains(words), "expected `{words}` in {text}");
    assert!(text.contains(path.file_name().and_then(|name| name.to_str()).expect("a name")), "{text}");
    assert!(!text.contains('\n'), "{text}");
}

/// Oracle: the pointer and clause written beside each bent file. Deterministic.
#[test]
fn bent_files_are_refused_at_the_bent_place() {
    let view = |length: usize| json!({"buffer": 0, "byteOffset": 0, "byteLength": length});
    let sparse = |indices: usize, count: u64| {
        json!({"componentType": 5126, "type": "VEC3", "count": 4, "sparse": {"count": count,
            "indices": {"bufferView": indices, "componentType": 5123}, "values": {"bufferView": 0}}})
    };
    let cases: Vec<(&str, Value, &str, &str)> = vec![
        // Document
        ("", json!([1, 2]), "/", "expected a JSON object"),
        ("/asset/version", json!("1.0"), "/asset/version", "2.0"),
        ("/asset", json!({}), "/asset/version", "found nothing"),
        ("/asset/minVersion", json!("2.1"), "/asset/minVersion", "2.0"),
        ("/accessors", json!({"a": 1}), "/accessors", "expected an array"),
        ("/scene", json!(7), "/scene", "below 1"),
        ("/scene", json!(-1), "/scene", "expected an index"),
        // Accessors and views
        ("/accessors/0/count", json!(5), "/accessors/0", "expected 5 elements"),
        ("/accessors/0/count", json!(1u64 << 40), "/accessors/0", "1099511627776"),
        ("/accessors/0/count", json!(u64::MAX), "/accessors/0", "18446744073709551615"),
        ("/accessors/0/count", json!(0), "/accessors/0/count", "found 0"),
        ("/accessors/0/count", json!(-4), "/accessors/0/count", "-4"),
        ("/accessors/0/count", json!("four"), "/accessors/0/count", "four"),
        ("/accessors/0/count", json!(1e40), "/accessors/0/count", "1e"),
        ("/accessors/0/byteOffset", json!(u64::MAX), "/accessors/0", "fit in /bufferViews/0"),
        ("/accessors/0/componentType", json!(9999), "/accessors/0/componentType", "9999"),
        ("/accessors/0/componentType", json!(5126u64 + (1 << 32)), "/accessors/0/componentType", "4294967295"),
        ("/accessors/0/type", json!("VEC9"), "/accessors/0/type", "VEC9"),
        ("/accessors/0/type", json!("MAT4"), "/accessors/0", "64 bytes"),
        ("/accessors/0/type", json!("MAT2"), "/accessors/0/type", "scalar, a vector or MAT4"),
        ("/accessors/0/type", json!("VEC2"), "/accessors/0/type", "VEC3"),
        ("/accessors/0/bufferView", json!(17), "/accessors/0/bufferView", "below 3"),
        ("/accessors/0/bufferView", json!(1u64 << 32), "/accessors/0/bufferView", "below 3"),
        ("/bufferViews/0/byteLength", json!(1u64 << 50), "/bufferViews/0", "length of its buffer"),
        ("/bufferViews/0/byteOffset", json!(u64::MAX), "/bufferViews/0", "length of its buffer"),
        ("/bufferViews/0/byteStride", json!(-12), "/bufferViews/0/byteStride", "-12"),
        ("/bufferViews/0/byteStride", json!(2), "/bufferViews/0/byteStride", "4 to 252"),
        ("/bufferViews/0/byteStride", json!(8), "/bufferViews/0/byteStride", "overlap"),
        ("/bufferViews/0/byteStride", json!(252), "/accessors/0", "every 252"),
        ("/bufferViews/0/buffer", json!(3), "/bufferViews/0/buffer", "below 1"),
        ("/bufferViews/0", view(8), "/accessors/0", "found only 8 bytes"),
        // Buffers
        ("/buffers/0/byteLength", json!(1u64 << 45), "/buffers/0/byteLength", "35184372088832"),
        ("/buffers/0/uri", json!("missing.bin"), "/buffers/0/uri", "missing.bin"),
        ("/buffers/0/uri", json!("."), "/buffers/0/uri", "not a regular file"),
        ("/buffers/0/uri", json!("/dev/zero"), "/buffers/0/uri", "not a regular file"),
        ("/buffers/0/uri", json!("http://example.org/a.bin"), "/buffers/0/uri", "http"),
        ("/buffers/0/uri", json!("data:application/octet-stream;base64,????"), "/buffers/0/uri", "base64"),
        ("/buffers/0/uri", json!("data:;base64,AAAA"), "/buffers/0/byteLength", "3 bytes"),
        ("/buffers/0/uri", json!("two\nlines.bin"), "/buffers/0/uri", "two"),
        ("/buffers/0", json!({"byteLength": 4}), "/buffers/0", "found none"),
        // Sparse accessors: accessor 1 holds 0 1 2 0 2 3 as 16-bit numbers
        ("/accessors/0", sparse(1, 4), "/accessors/0/sparse/indices", "0 after 2"),
        ("/accessors/0", sparse(1, 5), "/accessors/0/sparse/count", "1 to 4"),
        ("/accessors/0", sparse(1, 1 << 40), "/accessors/0/sparse/count", "1099511627776"),
        ("/accessors/0", sparse(9, 2), "/accessors/0/sparse/indices/bufferView", "below 3"),
        // Meshes
        (
            "/meshes/0/primitives/0/attributes/POSITION",
            json!(99),
            "/meshes/0/primitives/0/attributes/POSITION",
            "below 3",
        ),
        (
            "/meshes/0/primitives/0/attributes/POSITION",
            json!((1u64 << 32) + 1),
            "/meshes/0/primitives/0/attributes/POSITION",
            "below 3",
        ),
        ("/meshes/0/primitives/0/attributes", json!({}), "/meshes", "triangle"),
        ("/meshes/0/primitives/0/indices", json!(99), "/meshes/0/primitives/0/indices", "below 3"),
        ("/meshes/0/primitives/0/indices", json!(0), "/accessors/0/type", "SCALAR"),
        ("/meshes/0/primitives/0/material", json!(4), "/meshes/0/primitives/0/material", "below 1"),
        ("/meshes/0/primitives/0/mode", json!(12), "/meshes/0/primitives/0/mode", "12"),
        ("/meshes/0/primitives/0/mode", json!(0), "/meshes", "triangle"),
        ("/meshes/0/primitives", json!([]), "/meshes", "triangle"),
        ("/meshes/0/primitives", json!(1), "/meshes/0/primitives", "expected a sequence"),
        ("/accessors/2/count", json!(3), "/accessors/2/count", "expected 4 elements"),
        // Nodes
        ("/scenes/0/nodes", json!([0, 5]), "/scenes/0/nodes/1", "below 2"),
        ("/scenes/0/nodes", json!([0, 0]), "/scenes/0/nodes/1", "second time"),
        ("/scenes/0/nodes", json!([1]), "/meshes", "triangle"),
        ("/nodes/0/children", json!([0]), "/nodes/0/children/0", "cycle"),
        ("/nodes/0/children", json!([1]), "/scenes/0/nodes/1", "second time"),
        ("/nodes/0/children", json!("all"), "/nodes/0/children", "expected an array"),
        ("/nodes/0/mesh", json!(3), "/nodes/0/mesh", "below 1"),
        ("/nodes/0/matrix", json!([1, 2, 3]), "/nodes/0/matrix", "16 numbers"),
        ("/nodes/0/scale", json!([1, "x", 1]), "/nodes/0/scale/1", "expected a number"),
        ("/nodes/0/rotation", json!([0, 0, 0, 0]), "/nodes/0/rotation", "quaternion"),
        ("/nodes/0/translation", json!([1e300, 0, 0]), "/nodes/0", "world coordinates"),
        ("/nodes/0/scale", json!([1e300, 1, 1]), "/nodes/0", "32-bit"),
        ("/nodes/0/scale", json!([1e-300, 0, 0]), "/nodes", "at least one node"),
        // Materials, cameras, lights
        (
            "/materials/0",
            json!({"pbrMetallicRoughness": {"roughnessFactor": 1e39}}),
            "/materials/0/pbrMetallicRoughness/roughnessFactor",
            "finite",
        ),
        (
            "/materials/0",
            json!({"pbrMetallicRoughness": {"baseColorFactor": [1, 1]}}),
            "/materials/0/pbrMetallicRoughness/baseColorFactor",
            "length",
        ),
        (
            "/materials/0",
            json!({
                "emissiveFactor": [1, 1, 1],
                "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": "loud"}}
            }),
            "/materials/0/extensions/KHR_materials_emissive_strength/emissiveStrength",
            "loud",
        ),
        ("/materials/0", json!({"alphaMode": "GLOW"}), "/materials/0/alphaMode", "GLOW"),
        ("/materials/0", json!({"normalTexture": {"index": 3}}), "/materials/0/normalTexture/index", "below 0"),
        ("/cameras/0/perspective/yfov", json!(3.2), "/cameras/0/perspective/yfov", "(0, π)"),
        ("/cameras/0/perspective/yfov", json!(0), "/cameras/0/perspective/yfov", "(0, π)"),
        ("/cameras/0/perspective/aspectRatio", json!(-1), "/cameras/0/perspective/aspectRatio", "above 0"),
        (
            "/cameras/0",
            json!({"type": "orthographic", "orthographic": {"xmag": 0, "ymag": 1, "znear": 0, "zfar": 1}}),
            "/cameras/0/orthographic/xmag",
            "other than 0",
        ),
        ("/cameras/0/type", json!("fisheye"), "/cameras/0/type", "fisheye"),
        ("/nodes/1/camera", json!(1), "/nodes/1/camera", "below 1"),
        (
            "/nodes/1/extensions",
            json!({"KHR_lights_punctual": {"light": 0}}),
            "/nodes/1/extensions/KHR_lights_punctual/light",
            "below 0",
        ),
    ];
    let directory = tempfile::tempdir().expect("a temporary directory");
    for (pointer, value, expected_pointer, words) in cases {
        let bent = Fixture::quad().set(pointer, value);
        expect_invalid(&bent.write(directory.path()), expected_pointer, words);
    }
}

/// Oracle: glTF 2.0 §4.4 and RFC 8259. Deterministic.
#[test]
fn broken_containers_are_refused() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let glb = Fixture::quad().glb();
    Scene::load(write(directory.path(), "whole.glb", &glb)).expect("the whole file is valid");
    for length in [0, 3, 4, 11, 12, 19, 20, 100, glb.len() - 1] {
        let words = if length == 0 {
            "empty"
        } else if length < 4 {
            "magic"
        } else {
            "expected"
        };
        expect_invalid(&write(directory.path(), "cut.glb", &glb[..length]), "/", words);
    }
    let bent = |at: usize, word: u32| {
        let mut bent = glb.clone();
        bent[at..at + 4].copy_from_slice(&word.to_le_bytes());
        bent
    };
    for (at, word, words) in [
        (0, 7, "magic"),
        (4, 1, "version 2"),
        (8, 0, "JSON chunk"),
        (8, 5, "JSON chunk"),
        (8, u32::MAX, "4294967295"),
        (12, u32::MAX, "chunk"),
    ] {
        expect_invalid(&write(directory.path(), "bent.glb", &bent(at, word)), "/", words);
    }
    expect_invalid(&write(directory.path(), "bad.gltf", b"{\"asset\": {\"version\": "), "/", "JSON");
    expect_invalid(&write(directory.path(), "binary.gltf", &[0xff; 64]), "/", "JSON");
    let nested = "[".repeat(1_000_000);
    expect_invalid(&write(directory.path(), "nested.gltf", nested.as_bytes()), "/", "recursion");
    assert!(matches!(load(&directory.path().join("absent.gltf")), Err(Error::Io { .. })));
    assert!(matches!(load(directory.path()), Err(Error::Io { .. })));
}

/// Oracle: the error (vertices and indices: `hard/input.rs`). Deterministic.
#[test]
fn bad_values_in_buffers_are_refused() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    // Sparse indices past the accessor's count.
    let mut sparse = Fixture::quad();
    let indices = sparse.view(&[7, 0]);
    let sparse = sparse.set(
        "/accessors/0/sparse",
        json!({"count": 1, "indices": {"bufferView": indices, "componentType": 5123}, "values": {"bufferView": 0}}),
    );
    expect_invalid(&sparse.write(directory.path()), "/accessors/0/sparse/indices", "found 7");
    let required = Fixture::quad().set("/extensionsRequired", json!(["KHR_materials_ior", "KHR_xmp_json_ld"]));
    let error = load(&required.write(directory.path())).expect_err("the extension is not supported");
    assert!(
        matches!(&error, Error::UnsupportedExtension { extension, .. } if extension == "KHR_xmp_json_ld"),
        "{error}"
    );
    assert_eq!(error.exit_code(), 4);
}

/// Small files whose numbers or references multiply must not become large scenes. Oracle: time and the error.
/// Deterministic.
#[test]
fn small_files_stay_small() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    // An accessor without a view is zeros, as many as it says.
    for count in [1u64 << 40, 4_000_000_000, 60_000_000] {
        let zeros = Fixture::quad()
            .set("/accessors/0", json!({"componentType": 5126, "type": "VEC3", "count": count}))
            .set("/meshes/0/primitives/0", json!({"attributes": {"POSITION": 0}}));
        expect_invalid(&zeros.write(directory.path()), "/meshes/0/primitives/0", "expected at most");
    }
    // Ten thousand primitives over one accessor of ten thousand triangles.
    let mut shared = Fixture::quad();
    let indices: Vec<u8> = [0u8, 1, 2].repeat(10_000);
    let accessor = shared.accessor(&indices, 5121, "SCALAR", indices.len());
    let primitive = json!({"attributes": {"POSITION": 0}, "indices": accessor});
    let shared = shared.set("/meshes/0/primitives", Value::Array(vec![primitive; 10_000]));
    let error = load(&shared.write(directory.path())).expect_err("10⁸ triangles from a megabyte");
    assert!(error.to_string().contains("expected at most"), "{error}");
    // Ten thousand nodes that each show ten thousand primitives.
    let primitive = json!({"attributes": {"POSITION": 0}, "indices": 1});
    let mut crowded = Fixture::quad().set("/meshes/0/primitives", Value::Array(vec![primitive; 10_000]));
    crowded.json["nodes"] = Value::Array(vec![json!({"mesh": 0}); 10_000]);
    crowded.json["scenes"][0]["nodes"] = (0..10_000).collect();
    let error = load(&crowded.write(directory.path())).expect_err("10⁸ instances from two megabytes");
    assert!(error.to_string().contains("instances"), "{error}");
}

/// A chain of 100,000 nodes loads (no recursion), and its transforms multiply. Oracle: 10⁵ steps of 10⁻⁵ m make 1
/// m.
#[test]
fn deep_chains_do_not_overflow_the_stack() {
    const DEPTH: usize = 100_000;
    let directory = tempfile::tempdir().expect("a temporary directory");
    let mut chain = Fixture::quad();
    let mut nodes: Vec<Value> = (0..DEPTH).map(|n| json!({"children": [n + 1], "translation": [1e-5, 0, 0]})).collect();
    nodes.push(json!({"mesh": 0}));
    chain.json["nodes"] = Value::Array(nodes);
    chain.json["scenes"][0]["nodes"] = json!([0]);
    let scene = load(&chain.write(directory.path())).expect("a deep chain is valid");
    let x = f64::from(scene.instances[0].world_from_object.translation.x) + scene.origin.x;
    assert!((x - 1.0).abs() < 1e-6, "{x}");
    chain.json["nodes"][DEPTH]["children"] = json!([50_000]);
    expect_invalid(&chain.write(directory.path()), &format!("/nodes/{DEPTH}/children/0"), "cycle");
    let without_scenes =
        Fixture::quad().set("/scenes", json!([])).set("/nodes", json!([{"children": [1]}, {"children": [0]}]));
    let mut without_scenes = without_scenes;
    without_scenes.json.as_object_mut().expect("an object").remove("scene");
    expect_invalid(&without_scenes.write(directory.path()), "/nodes", "cycle");
}

/// Image headers that lie. Oracle: the error names the image; time. Deterministic.
#[test]
fn broken_images_are_refused() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let textured = |image: Value| {
        Fixture::quad()
            .set("/images", json!([image]))
            .set("/textures", json!([{"source": 0}]))
            .set("/materials/0/pbrMetallicRoughness", json!({"baseColorTexture": {"index": 0}}))
    };
    // A PNG header alone: signature, IHDR of the given size with its checksum, an empty IDAT.
    let header = |width: u32, height: u32| {
        let mut ihdr = b"IHDR".to_vec();
        ihdr.extend(width.to_be_bytes());
        ihdr.extend(height.to_be_bytes());
        ihdr.extend([8, 6, 0, 0, 0]);
        let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\x0d".to_vec();
        png.extend(&ihdr);
        png.extend(crc32(&ihdr).to_be_bytes());
        png.extend(b"\0\0\0\0IDAT");
        png.extend(crc32(b"IDAT").to_be_bytes());
        png
    };
    for (name, bytes, words) in [
        ("huge.png", header(2_000_000_000, 2_000_000_000), "expected"),
        ("large.png", header(16_384, 16_384), "bytes of file"),
        ("cut.png", header(8, 8), "PNG"),
        ("text.png", b"not an image".to_vec(), "PNG, JPEG or WebP"),
        ("empty.png", Vec::new(), "PNG, JPEG or WebP"),
        ("cut.jpg", b"\xff\xd8\xff\xe0\0\x10JFIF".to_vec(), "JPEG"),
    ] {
        write(directory.path(), name, &bytes);
        expect_invalid(&textured(json!({"uri": name})).write(directory.path()), "/images/0/uri", words);
    }
    expect_invalid(&textured(json!({"uri": "none.png"})).write(directory.path()), "/images/0/uri", "none.png");
    expect_invalid(&textured(json!({"bufferView": 0})).write(directory.path()), "/images/0", "PNG, JPEG or WebP");
    expect_invalid(&textured(json!({})).write(directory.path()), "/images/0", "neither");
    expect_invalid(
        &textured(json!({"uri": "a.png"})).set("/textures/0/source", json!(2)).write(directory.path()),
        "/textures/0/source",
        "below 1",
    );
}

/// CRC-32 of PNG chunks, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    })
}

/// 2000 random flips and cuts of a small GLB: each loads or fails as a value, none panics or hangs. The fixture has a
/// texture, a normal map without tangents, a sparse accessor and a light, so that all readers are reached. The
/// generator is a fixed LCG (Knuth's MMIX constants): same mutations every time.
#[test]
fn mutated_files_never_panic() {
    let mut fixture = Fixture::quad();
    let pixel = fixture.view(&super::png(3, 2));
    let (indices, values) = (fixture.view(&[1, 0, 3, 0]), fixture.view(&[0u8; 24]));
    let fixture = fixture
        .set("/images", json!([{"bufferView": pixel, "mimeType": "image/png"}]))
        .set("/textures", json!([{"source": 0}]))
        .set(
            "/materials/0",
            json!({"normalTexture": {"index": 0}, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}),
        )
        .set(
            "/accessors/2/sparse",
            json!({
                "count": 2,
                "indices": {"bufferView": indices, "componentType": 5123},
                "values": {"bufferView": values}
            }),
        )
        .set("/extensions", json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {}}]}}))
        .set("/nodes/1/extensions", json!({"KHR_lights_punctual": {"light": 0}}));
    let glb = fixture.glb();
    let directory = tempfile::tempdir().expect("a temporary directory");
    load(&write(directory.path(), "whole.glb", &glb)).expect("the unmutated file is valid");
    let mut state = 2u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let mut loaded = 0;
    for round in 0..2000 {
        let mut mutated = glb.clone();
        if round % 10 == 0 {
            mutated.truncate(random(glb.len()));
        }
        for _ in 0..1 + random(3) {
            let at = random(glb.len());
            let bit = 1 << random(8);
            // Digits to digits now and then: flips of JSON text alone would mostly be syntax errors.
            match mutated.get_mut(at) {
                Some(byte) if byte.is_ascii_digit() => *byte = b'0' + random(10) as u8,
                Some(byte) => *byte ^= bit,
                None => {}
            }
        }
        loaded += usize::from(load(&write(directory.path(), "mutated.glb", &mutated)).is_ok());
    }
    assert!((100..1900).contains(&loaded), "{loaded} of 2000 loaded: the mutations no longer reach both outcomes");
}
