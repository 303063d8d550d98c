//! Image files as textures: formats, folding, UDIM, what is missing or broken, and memory.
//!
//! Unlit quads show their textures as they are, so pictures are compared to the bit wherever two ways lead to one
//! texel. Nothing random is judged: no false alarms.

use std::path::{Path, PathBuf};
use std::process::Command;

use pathspace::render::{Crop, RenderOptions, TextureFilter};
use pathspace::scene::image::load_environment;
use pathspace::scene::{Budget, LoadOptions, MissingTexture, Scene, Texels};
use pathspace::texture::decode::Decoder;
use pathspace::texture::lookup;
use serde_json::{Value, json};

use crate::common::{options, render};
use crate::loading::fixture::Fixture;

/// A row of unlit quads, one for each image.
fn gallery(directory: &Path, images: &[Value]) -> PathBuf {
    let n = images.len();
    let mut fixture = Fixture::quad();
    let members = |i: usize| {
        json!({"name": format!("picture {i}"), "extensions": {"KHR_materials_unlit": {}},
        "pbrMetallicRoughness": {"baseColorTexture": {"index": i}}})
    };
    let meshes = |i: usize| {
        let attributes = json!({"POSITION": 0, "TEXCOORD_0": 2});
        json!({"primitives": [{"attributes": attributes, "indices": 1, "material": i}]})
    };
    let mut nodes: Vec<Value> = (0..n).map(|i| json!({"mesh": i, "translation": [i, 0.0, 0.0]})).collect();
    let half = n as f64 / 2.0;
    nodes.push(json!({"camera": 0, "translation": [half, 0.5, 1.0]}));
    fixture = fixture
        .set("/extensionsUsed", json!(["KHR_materials_unlit"]))
        .set("/images", json!(images))
        .set("/textures", (0..n).map(|i| json!({"source": i})).collect())
        .set("/materials", (0..n).map(members).collect())
        .set("/meshes", (0..n).map(meshes).collect())
        .set("/scenes/0/nodes", (0..=n).collect())
        .set("/nodes", nodes.into())
        .set(
            "/cameras/0",
            json!({"type": "orthographic", "orthographic": {"xmag": half, "ymag": 0.5, "znear": 0.1, "zfar": 10.0}}),
        );
    fixture.write(directory)
}

/// Texels without a pattern, the same for the same seed.
fn noise(side: u32, seed: u32) -> image::RgbImage {
    let mut state = u64::from(seed) + 1;
    image::RgbImage::from_fn(side, side, |_, _| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let [a, b, c, ..] = (state >> 33).to_le_bytes();
        image::Rgb([a, b, c])
    })
}

fn load(path: &Path, megabytes: u64) -> Scene {
    let options = LoadOptions::default().texture_budget(Budget { bytes: megabytes << 20, ..Budget::default() });
    Scene::load_with(path, &options).unwrap_or_else(|e| panic!("{e}"))
}

fn picture(scene: &Scene, width: u32, height: u32) -> u64 {
    render(scene, options(width, height, 4)).film.hash()
}

/// A set of textures of 4 times the budget gives the same bits as all of it in memory, and takes no more memory than a
/// render without textures and the budget, 10 % on top.
#[test]
fn a_set_of_four_times_the_budget_stays_within_it() {
    const BUDGET: u64 = 64;
    let directory = tempfile::tempdir().expect("a temporary directory");
    // 2048² texels of 4 bytes and a third for the pyramid: 21.3 MB each.
    let n = 12;
    let images: Vec<Value> = (0..n)
        .map(|i| {
            let name = format!("{i}.png");
            noise(2048, i).save(directory.path().join(&name)).expect("a temporary directory can be written");
            json!({"uri": name})
        })
        .collect();
    let path = gallery(directory.path(), &images);
    let small = tempfile::tempdir().expect("a temporary directory");
    noise(8, 1).save(small.path().join("0.png")).expect("a temporary directory can be written");
    let plain = gallery(small.path(), &vec![json!({"uri": "0.png"}); n as usize]);

    // A temporary folder for these renders alone: what other tests keep in the common one is theirs.
    let temporary = tempfile::tempdir().expect("a temporary directory");
    let run = |scene: &Path, megabytes: u64| -> (String, u64, Value, String) {
        let stats = directory.path().join("stats.json");
        let output = Command::new(env!("CARGO_BIN_EXE_pathspace"))
            .env("TMPDIR", temporary.path())
            .args(["render", "--width", "480", "--height", "40", "--spp", "16", "--threads", "2"])
            .args(["--texture-memory", &megabytes.to_string()])
            .arg(scene)
            .args([Path::new("-o"), &directory.path().join("out.exr"), Path::new("--stats"), &stats])
            .output()
            .expect("the binary runs");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        let stats: Value = serde_json::from_slice(&std::fs::read(stats).expect("written")).expect("JSON");
        let hash = stats["film_hash"].as_str().expect("a hash").to_string();
        (hash, stats["peak_rss_bytes"].as_u64().expect("Linux"), stats["textures"].clone(), said)
    };
    let (all, in_memory, counts, _) = run(&path, 1024);
    assert!(counts["lookups"].as_u64() > Some(480 * 40 * 15) && counts["cache_misses"] == 0, "{counts}");
    let (same, bounded, counts, _) = run(&path, BUDGET);
    assert_eq!(all, same);
    let (_, without, _, _) = run(&plain, BUDGET);
    let used = bounded.saturating_sub(without) as f64 / f64::from(1 << 20);
    eprintln!("{used:.1} MB used of {BUDGET}; all in memory {} MB; {counts}", (in_memory - without) >> 20);
    assert!(used <= 1.1 * BUDGET as f64, "{used} MB used, {BUDGET} allowed; {counts}");
    assert!(counts["cache_misses"].as_u64() > Some(100) && counts["failed"] == 0, "{counts}");
    assert!(counts["cache_peak_bytes"].as_u64() <= Some(BUDGET << 20), "{counts}");
    assert!(counts["cache_seconds"].as_f64() > Some(0.0), "{counts}");
    // Nothing is left behind.
    assert_eq!(std::fs::read_dir(temporary.path()).expect("readable").count(), 0);
}

/// The same image by name, inside the buffer and as a data URI, held and through the cache: the same bits.
#[test]
fn embedded_images_go_the_same_way() {
    use base64::Engine;
    let directory = tempfile::tempdir().expect("a temporary directory");
    let mut png = std::io::Cursor::new(Vec::new());
    noise(1600, 5).write_to(&mut png, image::ImageFormat::Png).expect("a PNG in memory");
    let png = png.into_inner();
    std::fs::write(directory.path().join("a.png"), &png).expect("a temporary directory can be written");
    let data = format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(&png));
    let others = json!({"uri": "b.png"});
    noise(1800, 6).save(directory.path().join("b.png")).expect("a temporary directory can be written");
    let mut hashes = Vec::new();
    for (image, megabytes) in [
        (json!({"uri": "a.png"}), 4096),
        (json!({"uri": data.clone()}), 4096),
        (json!({"uri": data}), 24),
        (json!({"uri": "a.png"}), 24),
    ] {
        let scene = load(&gallery(directory.path(), &[image, others.clone()]), megabytes);
        let held = scene.textures.iter().filter(|texture| matches!(texture.texels, Texels::Eight(_))).count();
        assert_eq!(held == 2, megabytes > 24);
        hashes.push(picture(&scene, 80, 40));
    }
    let glb = {
        let path = gallery(directory.path(), &[json!({"bufferView": 3, "mimeType": "image/png"}), others]);
        let mut fixture = Fixture::quad();
        fixture.json = serde_json::from_slice(&std::fs::read(path).expect("written")).expect("JSON");
        assert_eq!(fixture.view(&png), 3);
        crate::loading::fixture::write(directory.path(), "scene.glb", &fixture.glb())
    };
    hashes.push(picture(&load(&glb, 4096), 80, 40));
    hashes.push(picture(&load(&glb, 24), 80, 40));
    assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{hashes:?}");
}

/// Scenes that end on another thread than the one that loaded them leave nothing behind that the next load meets: each
/// shows its own image. Oracle: the same image in memory, to the bit. Nothing random is judged.
#[test]
fn scenes_that_end_elsewhere_are_forgotten() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    for round in 0..6 {
        for name in ["a.png", "b.png"] {
            noise(1500, 70 + round).save(directory.path().join(name)).expect("a temporary directory can be written");
        }
        let path = gallery(directory.path(), &[json!({"uri": "a.png"}), json!({"uri": "b.png"})]);
        let expected = picture(&load(&path, 4096), 20, 10);
        let scene = load(&path, 24);
        assert_eq!(picture(&scene, 20, 10), expected, "round {round}");
        std::thread::spawn(move || drop(scene)).join().expect("an end");
    }
}

/// A PNG is decoded to the same texels in every build, and the pictures are the same bits.
#[test]
fn decoders_agree() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    noise(64, 9).save(directory.path().join("a.png")).expect("a temporary directory can be written");
    let path = gallery(directory.path(), &[json!({"uri": "a.png"})]);
    let of = |decoder| {
        let texture_budget = Budget { decoder, ..Budget::default() };
        let options = LoadOptions::default().texture_budget(texture_budget);
        Scene::load_with(&path, &options).unwrap_or_else(|e| panic!("{e}"))
    };
    let (a, b) = (of(Decoder::Default), of(Decoder::Crates));
    assert_eq!(a.textures[0].texels.eight(), b.textures[0].texels.eight());
    assert_eq!(picture(&a, 32, 32), picture(&b, 32, 32));
}

/// One value everywhere is a factor. Oracle: the product by hand; no texture stage is left.
#[test]
fn constant_textures_are_folded() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let write = |name: &str, side, texel: [u8; 4]| {
        let image = image::RgbaImage::from_pixel(side, side, image::Rgba(texel));
        image.save(directory.path().join(name)).expect("a temporary directory can be written");
    };
    write("base.png", 1, [255, 188, 0, 255]);
    write("mr.png", 4, [0, 51, 255, 255]);
    write("flat.png", 2, [128, 127, 255, 255]);
    write("tilted.png", 2, [200, 128, 255, 255]);
    write("clear.png", 2, [255, 188, 0, 100]);
    let with = |base: &str, normal: &str| {
        let material = json!({"normalTexture": {"index": 2}, "pbrMetallicRoughness": {"roughnessFactor": 0.5,
            "baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}},
            "emissiveTexture": {"index": 0}, "emissiveFactor": [0.5, 0.5, 0.5]});
        let images = json!([{"uri": base}, {"uri": "mr.png"}, {"uri": normal}]);
        let fixture = Fixture::quad()
            .set("/images", images)
            .set("/textures", json!([{"source": 0}, {"source": 1}, {"source": 2}]))
            .set("/materials/0", material);
        load(&fixture.write(directory.path()), 4096)
    };
    let scene = with("base.png", "flat.png");
    let material = &scene.materials[0];
    assert!(!material.reads_textures());
    let green = pathspace::texture::SRGB_TO_LINEAR[188];
    assert_eq!(material.base_color.to_array(), [1.0, green, 0.0]);
    assert_eq!(material.emissive.to_array(), [0.5, 0.5 * green, 0.0]);
    assert_eq!((material.roughness, material.metallic), (0.5 * (51.0 * (1.0 / 255.0)), 1.0));
    let renderer = pathspace::Renderer::new(&scene, options(8, 8, 1)).unwrap_or_else(|e| panic!("{e}"));
    assert!(!renderer.plan().stages.contains(&"textures"), "{:?}", renderer.plan().stages);
    // Alpha is no factor of the colour, and a tilt is no flat normal.
    let scene = with("clear.png", "tilted.png");
    assert!(scene.materials[0].base_color_texture.is_some() && scene.materials[0].normal_texture.is_some());
}

/// Images that cannot be used: one error that names file and material, or a warning and magenta; never more memory than
/// the file's bytes account for. Oracle: the words.
#[test]
fn unusable_images_are_named() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let mut png = std::io::Cursor::new(Vec::new());
    noise(64, 3).write_to(&mut png, image::ImageFormat::Png).expect("a PNG in memory");
    let png = png.into_inner();
    let mut jpeg = std::io::Cursor::new(Vec::new());
    noise(64, 3).write_to(&mut jpeg, image::ImageFormat::Jpeg).expect("a JPEG in memory");
    let jpeg = jpeg.into_inner();
    let header = |width: u32, height: u32| {
        format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes()
    };
    for (name, bytes, words) in [
        ("absent.png", None, "cannot read"),
        ("cut.png", Some(png[..png.len() / 2].to_vec()), "valid PNG"),
        ("cut.jpg", Some(jpeg[..jpeg.len() / 2].to_vec()), "valid JPEG"),
        ("empty.png", Some(Vec::new()), "found bytes that begin"),
        ("huge.hdr", Some(header(100_000, 100_000)), "100000 × 100000"),
        ("zero.hdr", Some(header(0, 0)), "found"),
        ("nan.exr", Some(exr_of(f32::NAN)), "4 texels with NaN"),
        ("infinite.exr", Some(exr_of(f32::INFINITY)), "4 texels with NaN or infinity"),
    ] {
        if let Some(bytes) = &bytes {
            std::fs::write(directory.path().join(name), bytes).expect("a temporary directory can be written");
        }
        let path = gallery(directory.path(), &[json!({"uri": name})]);
        let error = Scene::load(&path).expect_err(name).to_string();
        for word in [words, name, "picture 0"] {
            assert!(error.contains(word), "{name}: {error}");
        }
        assert!(!error.contains('\n'), "{error}");

        let options = LoadOptions::default().missing_texture(MissingTexture::Magenta);
        let scene = Scene::load_with(&path, &options).unwrap_or_else(|e| panic!("{e}"));
        let warning = scene.warnings.iter().find(|w| w.what.contains("magenta")).unwrap_or_else(|| panic!("{name}"));
        assert!(warning.what.contains(name) && warning.what.contains("picture 0"), "{warning:?}");
        assert_eq!(scene.materials[0].base_color.to_array(), [1.0, 0.0, 1.0]);
    }
}

/// Images are what their bytes say, whatever their names do; what is not on the list is refused before any reader sees
/// it, and read where that is asked for. Names of other files are never opened. Oracle: the words, and the texel.
#[test]
fn formats_are_told_by_their_bytes() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(directory.path().join(name), bytes).expect("a temporary directory can be written");
    };
    let load_as = |name: &str, decoder: Decoder| {
        let budget = Budget { decoder, ..Budget::default() };
        let path = gallery(directory.path(), &[json!({"uri": name})]);
        Scene::load_with(&path, &LoadOptions::default().texture_budget(budget))
    };
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_pixel(1, 1, image::Rgb([255, 0, 255])).write_to(&mut png, image::ImageFormat::Png).expect("");
    let magenta = [1.0, 0.0, 1.0];
    for name in ["a.foo", "b.ico", "c.jpg", "d", "e.mp4"] {
        write(name, png.get_ref());
        let scene = load_as(name, Decoder::Default).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(scene.materials[0].base_color.to_array(), magenta, "{name}");
    }
    // Readers of these crash on mutated files (FAULTS.md), those of movies open other files, and the last names one.
    write("ppm", b"P6 1 1 255\n\xff\0\xff");
    for (name, begin) in [
        ("a.ico", &b"\0\0\x01\0\x01\0"[..]),
        ("a.pic", b"\x53\x80\xf6\x34"),
        ("a.iff", b"FOR4"),
        ("a.dds", b"DDS "),
        ("a.psd", b"8BPS"),
        ("a.mov", b"\0\0\0\x14ftypqt  "),
        ("a.txt", b"ffconcat version 1.0"),
        ("x.ppm", b"nothing"),
        ("x.png", b"P6 1 1 255\n\xff\0\xff"),
    ] {
        write(name, begin);
        let error = load_as(name, Decoder::Default).expect_err(name).to_string();
        let begin = begin[..begin.len().min(8)].escape_ascii().to_string();
        for word in ["expected PNG, JPEG", &begin, name, "picture 0"] {
            assert!(error.contains(word), "{name}: {error}");
        }
        assert!(error.contains("--image-formats all") == cfg!(feature = "oiio"), "{error}");
    }
    write("y.ppm", b"P6 1 1 255\n\xff\0\xff");
    let unknown = load_as("y.ppm", Decoder::Any);
    assert_eq!(unknown.is_ok(), cfg!(feature = "oiio"), "{:?}", unknown.err());
    for name in ["a.mov", "a.txt"] {
        let error = load_as(name, Decoder::Any).expect_err(name).to_string();
        assert!(error.contains("no reader") || cfg!(not(feature = "oiio")), "{error}");
    }
}

/// What a killed process had copied goes with it: the copies have no names. Oracle: the folder of temporary files.
#[test]
fn a_process_that_is_killed_leaves_no_copies() {
    use std::io::BufRead;
    let directory = tempfile::tempdir().expect("a temporary directory");
    let temporary = tempfile::tempdir().expect("a temporary directory");
    let images: Vec<Value> = (0..2)
        .map(|i| {
            noise(1600, 50 + i).save(directory.path().join(format!("{i}.png"))).expect("written");
            json!({"uri": format!("{i}.png")})
        })
        .collect();
    let path = gallery(directory.path(), &images);
    let mut child = Command::new(env!("CARGO_BIN_EXE_pathspace"))
        .env("TMPDIR", temporary.path())
        .args(["render", "-v", "--width", "32", "--height", "16", "--spp", "1000000000", "--texture-memory", "24"])
        .arg(&path)
        .args([Path::new("-o"), &directory.path().join("out.exr")])
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("the binary starts");
    let mut lines = std::io::BufReader::new(child.stderr.take().expect("piped")).lines().map_while(Result::ok);
    assert!(lines.any(|line| line.contains("simulated")), "it renders");
    child.kill().expect("SIGKILL");
    child.wait().expect("it ends");
    assert_eq!(std::fs::read_dir(temporary.path()).expect("readable").count(), 0);
}

/// A 2 × 2 OpenEXR of one value.
fn exr_of(value: f32) -> Vec<u8> {
    use exr::prelude::{Image, SpecificChannels, WritableImage};
    let mut bytes = std::io::Cursor::new(Vec::new());
    let channels = SpecificChannels::rgb(|_| (value, value, value));
    Image::from_channels((2, 2), channels).write().to_buffered(&mut bytes).expect("an EXR in memory");
    bytes.into_inner()
}

/// OpenEXR files whose data window is another than the display window: the image is the display window, 0 where
/// nothing is stored and clipped where more is. In scan lines (decoded in Rust) and in tiles (through OpenImageIO,
/// where it is). Oracle: the value by the texel's place.
#[test]
fn the_display_window_is_the_image() {
    use exr::prelude::*;
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path = directory.path().join("sky.exr");
    let value = |x: i32, y: i32| (100 + x + 10 * y) as f32;
    let (width, height) = (8, 4);
    for (left, top, columns, rows) in
        [(0, 0, 8, 4), (4, 0, 4, 4), (1, 1, 3, 2), (-2, -1, 12, 7), (-3, 2, 6, 9), (20, 0, 4, 4), (5, -7, 2, 3)]
    {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(2, 2))] {
            let channels = SpecificChannels::rgb(|at: Vec2<usize>| {
                let value = value(left + at.0 as i32, top + at.1 as i32);
                (value, value / 2.0, 0.25)
            });
            let mut image = Image::from_channels((columns, rows), channels);
            image.attributes.display_window = IntegerBounds::new((0, 0), (width, height));
            image.layer_data.attributes.layer_position = Vec2(left, top);
            image.layer_data.encoding =
                Encoding { blocks, line_order: LineOrder::Increasing, ..Encoding::FAST_LOSSLESS };
            image.write().to_file(&path).expect("written");
            let environment = load_environment(&path, 0.0, 1.0).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!((environment.width, environment.height), (width, height));
            for (i, found) in environment.texels.iter().enumerate() {
                let (x, y) = ((i % width) as i32, (i / width) as i32);
                let inside = (left..left + columns as i32).contains(&x) && (top..top + rows as i32).contains(&y);
                let stored = glam::Vec3::new(value(x, y), value(x, y) / 2.0, 0.25);
                let expected = if inside { stored } else { glam::Vec3::ZERO };
                assert_eq!(*found, expected, "{left},{top} {columns}×{rows} {blocks:?} at {x},{y}");
            }
        }
    }
    // Chunks that a file of its length cannot have, before memory is taken for them.
    let mut bytes = std::fs::read(&path).expect("written");
    let name = b"dataWindow\0box2i\0\x10\0\0\0";
    let at = bytes.windows(name.len()).position(|part| part == name).expect("an attribute of each") + name.len();
    for edge in [at, at + 4] {
        bytes[edge..edge + 4].copy_from_slice(&0i32.to_le_bytes());
        bytes[edge + 8..edge + 12].copy_from_slice(&16_383i32.to_le_bytes());
    }
    std::fs::write(&path, &bytes).expect("written");
    let error = load_environment(&path, 0.0, 1.0).expect_err("too many chunks").to_string();
    assert!(error.contains("chunks in a file of") && error.contains("sky.exr"), "{error}");
}

/// UDIM. Oracle: which of four images shows where. v = 0 is the upper edge of the first row; rows count upwards.
#[test]
fn udim_pages_lie_side_by_side() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    for (number, grey) in [(1001, 10), (1002, 20), (1011, 30), (1012, 40)] {
        let image = image::RgbImage::from_pixel(2, 2, image::Rgb([grey; 3]));
        image.save(directory.path().join(format!("skin.{number}.png"))).expect("a temporary directory can be written");
    }
    let scene = load(&gallery(directory.path(), &[json!({"uri": "skin.%3CUDIM%3E.png"})]), 4096);
    let texture = &scene.textures[0];
    assert!(matches!(texture.texels, Texels::Udim(_)));
    let code = |u: f32, v: f32| {
        let red = lookup(texture, glam::Vec2::new(u, v)).x;
        pathspace::texture::SRGB_TO_LINEAR.iter().position(|&linear| linear == red)
    };
    assert_eq!([code(0.5, 0.5), code(1.5, 0.1), code(0.2, -0.5), code(1.9, -0.9)], [10, 20, 30, 40].map(Some));
    assert_eq!(
        [code(0.0, 1.0), code(0.0, 0.0), code(2.5, 0.5), code(f32::NAN, 0.5)],
        [Some(10), Some(30), Some(0), Some(0)]
    );
    let error = Scene::load(gallery(directory.path(), &[json!({"uri": "none.<UDIM>.png"})])).expect_err("no page");
    assert!(error.to_string().contains("1001"), "{error}");
}

/// `--texture-filter trilinear`. Oracles: seen from afar, noise is its mean (σ of a texel 0.29 in linear light; a
/// footprint of 25 texels leaves 0.012, and 6 of these are allowed); seen from near, the picture is that of exact
/// look-ups to the bit; through the cache it is the same to the bit; a scene without textures knows nothing of it.
#[test]
fn footprints_average_what_they_cover() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    for i in 0..2 {
        noise(1600, 40 + i)
            .save(directory.path().join(format!("{i}.png")))
            .expect("a temporary directory can be written");
    }
    let path = gallery(directory.path(), &[json!({"uri": "0.png"}), json!({"uri": "1.png"})]);
    let scene = load(&path, 4096);
    let filtered = |width, height| options(width, height, 4).texture_filter(TextureFilter::Trilinear);
    let far = render(&scene, filtered(128, 64)).film;
    let mean = pathspace::texture::SRGB_TO_LINEAR.iter().map(|&x| f64::from(x)).sum::<f64>() / 256.0;
    for pixel in &far.pixels {
        let found = pixel.mean();
        assert!(found[..3].iter().all(|channel| (channel - mean).abs() < 6.0 * 0.012), "{found:?} for {mean}");
    }
    let exact = render(&scene, options(128, 64, 4)).film;
    assert!(exact.pixels.iter().any(|pixel| (pixel.mean()[0] - mean).abs() > 0.2));
    assert_eq!(render(&load(&path, 24), filtered(128, 64)).film.hash(), far.hash());

    let window = |options: RenderOptions| options.crop(Crop { x: 9000, y: 4000, width: 16, height: 16 });
    let near = |options: RenderOptions| render(&scene, window(options)).film.hash();
    assert_eq!(near(filtered(12_800, 6_400)), near(options(12_800, 6_400, 4)));

    let mut plain = pathspace::scene::builder::SceneBuilder::new();
    let white = plain.lambert(glam::Vec3::ONE);
    plain.cuboid(glam::Vec3::NEG_ONE, glam::Vec3::ONE, true, white);
    plain.camera(glam::Vec3::ZERO, glam::Vec3::X, glam::Vec3::Y, 1.0);
    let plain = plain.build();
    let renderer = pathspace::Renderer::new(&plain, filtered(8, 8)).unwrap_or_else(|e| panic!("{e}"));
    assert!(!renderer.plan().features.footprints && renderer.plan().bias.len() == 1);
    let renderer = pathspace::Renderer::new(&scene, filtered(8, 8)).unwrap_or_else(|e| panic!("{e}"));
    assert!(renderer.plan().bias.iter().any(|bias| bias.what.contains("texture-filter")));
}

#[cfg(feature = "oiio")]
mod through_oiio {
    use super::*;
    use crate::tiff::{Texels as TiffTexels, write_tiled};
    use pathspace::render::StopReason;

    fn rgba(image: &image::RgbImage) -> Vec<[u8; 4]> {
        image.pixels().map(|p| [p[0], p[1], p[2], 255]).collect()
    }

    /// Tiled TIFF (what `maketx` writes as .tx) and PNG of the same texels: the same bits, held and through the cache;
    /// and a .tx beside the image is what is read.
    #[test]
    fn tiled_files_show_the_same_picture() {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let pictures = [noise(1600, 21), noise(1800, 22)];
        let png: Vec<Value> = (0..2)
            .map(|i| {
                pictures[i].save(directory.path().join(format!("{i}.png"))).expect("written");
                json!({"uri": format!("{i}.png")})
            })
            .collect();
        let reference = picture(&load(&gallery(directory.path(), &png), 4096), 90, 45);
        for (i, picture) in pictures.iter().enumerate() {
            let side = picture.width() as usize;
            let texels = TiffTexels::Eight(rgba(picture));
            write_tiled(&directory.path().join(format!("tiled{i}.tif")), &[(side, side, 64, &texels)]);
        }
        let tiled = [json!({"uri": "tiled0.tif"}), json!({"uri": "tiled1.tif"})];
        for megabytes in [4096, 24] {
            let scene = load(&gallery(directory.path(), &tiled), megabytes);
            assert_eq!(scene.textures.iter().all(|t| matches!(t.texels, Texels::Stored(_))), megabytes == 24);
            assert_eq!(picture(&scene, 90, 45), reference, "{megabytes} MB");
        }

        let inverted: Vec<[u8; 4]> = rgba(&pictures[0]).iter().map(|t| [255 - t[0], t[1], t[2], 255]).collect();
        let side = pictures[0].width() as usize;
        write_tiled(&directory.path().join("0.tx"), &[(side, side, 64, &TiffTexels::Eight(inverted.clone()))]);
        let scene = load(&gallery(directory.path(), &png), 4096);
        assert_eq!(scene.textures[0].texels.eight().as_deref(), Some(&inverted[..]));
    }

    /// Floats: a tiled file of linear values is the same held and through the cache, and shows what an 8-bit image of
    /// the same colours shows, to rounding.
    #[test]
    fn float_images_are_linear() {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let picture_8 = noise(1200, 31);
        picture_8.save(directory.path().join("a.png")).expect("written");
        let linear: Vec<[f32; 4]> = rgba(&picture_8)
            .iter()
            .map(|t| {
                let [r, g, b] = [t[0], t[1], t[2]].map(|c| pathspace::texture::SRGB_TO_LINEAR[usize::from(c)]);
                [r, g, b, 1.0]
            })
            .collect();
        write_tiled(&directory.path().join("a.linear.tif"), &[(1200, 1200, 64, &TiffTexels::Float(linear))]);
        let of = |name: &str, megabytes| {
            picture(&load(&gallery(directory.path(), &[json!({"uri": name})]), megabytes), 40, 40)
        };
        assert_eq!(of("a.linear.tif", 4096), of("a.png", 4096));
        assert_eq!(of("a.linear.tif", 24), of("a.png", 4096));
    }

    /// A picture of two tiled files, and the scene loaded at 24 MB: 23 MB of texels in tiles of 64.
    fn two_tiled(directory: &Path) -> (PathBuf, [PathBuf; 2]) {
        let files = [0, 1].map(|i| {
            let path = directory.join(format!("{i}.tif"));
            let texels = TiffTexels::Eight(rgba(&noise(1700, 80 + i)));
            write_tiled(&path, &[(1700, 1700, 64, &texels)]);
            path
        });
        (gallery(directory, &[json!({"uri": "0.tif"}), json!({"uri": "1.tif"})]), files)
    }

    /// Files that are cut off, overwritten or gone once they are loaded end the render: the fault names file and
    /// material, and no pixel has a value that was not read. With `magenta` they are counted and the render goes on.
    /// Oracle: the pixels of a render of the whole files, each of which is the same or was not rendered.
    #[test]
    fn files_that_change_end_the_render() {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let (path, [file, _]) = two_tiled(directory.path());
        let whole = render(&load(&path, 24), options(64, 32, 4)).film;
        let bytes = std::fs::read(&file).expect("written");
        let mut other = bytes.clone();
        other[bytes.len() / 4..bytes.len() / 2].iter_mut().for_each(|byte| *byte ^= 0x55);
        let changes: [(&str, &dyn Fn()); 3] = [
            ("cut off", &|| std::fs::write(&file, &bytes[..bytes.len() / 4]).expect("written")),
            ("other texels", &|| std::fs::write(&file, &other).expect("written")),
            ("gone", &|| std::fs::remove_file(&file).expect("removed")),
        ];
        for (name, change) in changes {
            std::fs::write(&file, &bytes).expect("written");
            let scene = load(&path, 24);
            change();
            let render = render(&scene, options(64, 32, 4));
            assert_eq!(render.stop, StopReason::Texture, "{name}");
            let error = scene.check_textures().expect_err(name).to_string();
            assert!(error.contains("0.tif") && error.contains("picture 0") && !error.contains('\n'), "{name}: {error}");
            let pixels = render.film.pixels.iter().zip(&whole.pixels);
            assert!(pixels.clone().any(|(pixel, _)| pixel.samples() == 0), "{name}");
            for (pixel, expected) in pixels {
                let so_far = pixel.samples();
                assert!(so_far < 4 || pixel.mean() == expected.mean(), "{name}: {so_far} samples");
            }

            std::fs::write(&file, &bytes).expect("written");
            let options_of = LoadOptions::default()
                .texture_budget(Budget { bytes: 24 << 20, ..Budget::default() })
                .missing_texture(MissingTexture::Magenta);
            let scene = Scene::load_with(&path, &options_of).unwrap_or_else(|e| panic!("{e}"));
            change();
            assert_eq!(crate::common::render(&scene, options(64, 32, 4)).stop, StopReason::Spp, "{name}");
            let faults = scene.texture_tiles().expect("in tiles").faults();
            assert!(faults.len() == 1 && faults[0].lookups > 0 && scene.check_textures().is_ok(), "{faults:?}");
        }
    }

    /// The command says so as well: exit code 1, one line, and the picture so far. Oracle: the words.
    #[test]
    fn a_file_that_is_cut_while_it_renders_is_an_error() {
        use std::io::BufRead;
        let directory = tempfile::tempdir().expect("a temporary directory");
        let (path, [file, _]) = two_tiled(directory.path());
        let picture = directory.path().join("out.exr");
        let mut child = Command::new(env!("CARGO_BIN_EXE_pathspace"))
            .args(["render", "--width", "64", "--height", "32", "--spp", "100000000", "--texture-memory", "24"])
            .args(["--progress", "ndjson"])
            .arg(&path)
            .args([Path::new("-o"), &picture])
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .expect("the binary starts");
        crate::common::wait_for_samples(&mut child);
        let lines = std::io::BufReader::new(child.stderr.take().expect("piped")).lines().map_while(Result::ok);
        std::fs::File::options().write(true).open(&file).expect("there").set_len(5000).expect("cut");
        let errors: Vec<String> = lines.filter(|line| line.contains("pathspace: error")).collect();
        assert_eq!(child.wait().expect("it ends").code(), Some(1), "{errors:?}");
        assert!(errors.len() == 1 && errors[0].contains("0.tif") && errors[0].contains("picture 0"), "{errors:?}");
        assert!(picture.exists());
    }

    /// More files than descriptors: the same picture. A folder for copies that is not there is an error of the machine,
    /// with `magenta` as well. Oracle: the film's hash with descriptors for all; the words.
    #[test]
    fn few_descriptors_and_no_folder_change_no_picture() {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let images: Vec<Value> = (0..48)
            .map(|i| {
                let texels = TiffTexels::Eight(rgba(&noise(400, 100 + i)));
                write_tiled(&directory.path().join(format!("{i}.tif")), &[(400, 400, 64, &texels)]);
                json!({"uri": format!("{i}.tif")})
            })
            .collect();
        let path = gallery(directory.path(), &images);
        let run = |descriptors: u32, temporary: &Path, missing: &str| {
            let stats = directory.path().join("stats.json");
            let script = format!("ulimit -n {descriptors}; exec \"$@\"");
            let output = Command::new("sh")
                .args(["-c", &script, "sh", env!("CARGO_BIN_EXE_pathspace")])
                .env("TMPDIR", temporary)
                .args(["render", "--width", "192", "--height", "4", "--spp", "4", "--texture-memory", "24"])
                .args(["--missing-texture", missing, "-t", "2"])
                .arg(&path)
                .args([Path::new("-o"), &directory.path().join("out.exr"), Path::new("--stats"), &stats])
                .output()
                .expect("a shell");
            let stats = std::fs::read(stats).unwrap_or_default();
            let stats: Value = serde_json::from_slice(&stats).unwrap_or_default();
            (output.status.code(), stats["film_hash"].clone(), String::from_utf8_lossy(&output.stderr).into_owned())
        };
        let (code, hash, said) = run(256, directory.path(), "error");
        assert!(code == Some(0) && hash.is_string(), "{said}");
        let (code, few, said) = run(24, directory.path(), "error");
        assert!(code == Some(0) && few == hash, "{said}");
        let (code, _, said) = run(256, Path::new("/nonexistent/folder"), "magenta");
        assert!(code == Some(1) && said.contains("/nonexistent/folder"), "{said}");
    }

    /// Trilinear look-ups are the same bits held and in tiles, whatever the file has of a pyramid: none, all, one that
    /// ends early, one whose levels have tiles of another size; 8 and 16 bits, floats; in tiles and in scan lines.
    #[test]
    fn filtered_pictures_do_not_depend_on_memory() {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let at = |name: &str| directory.path().join(name);
        let side = 900u32;
        let base = rgba(&noise(side, 7));
        let level = |side: u32| rgba(&noise(side, side));
        let eight = |side| TiffTexels::Eight(level(side));
        let floats = |side| TiffTexels::Float(level(side).iter().map(|t| t.map(|c| f32::from(c) / 40.0)).collect());
        let sixteen = image::ImageBuffer::from_fn(side, side, |x, y| {
            let [r, g, b, a] = base[(y * side + x) as usize];
            image::Rgba([r, g, b, a].map(|c| (u16::from(c) * 257) ^ 0x1234))
        });
        sixteen.save(at("png16.png")).expect("written");
        let full = TiffTexels::Eight(base.clone());
        let write = |name: &str, levels: &[(u32, u32, TiffTexels)]| {
            let levels: Vec<_> = levels.iter().map(|(s, tile, t)| (*s as usize, *s as usize, *tile, t)).collect();
            write_tiled(&at(name), &levels);
        };
        write("none.tif", &[(side, 64, full.clone())]);
        write("early.tif", &[(side, 64, full.clone()), (450, 64, eight(450)), (225, 64, eight(225))]);
        write("sizes.tif", &[(side, 16, full.clone()), (450, 1024, eight(450))]);
        write("odd.tif", &[(side, 48, full.clone()), (450, 48, eight(450))]);
        let sides = [900, 450, 225, 112, 56, 28, 14, 7, 3, 1];
        write("all.tif", &sides.map(|side| (side, 32, eight(side))));
        write("floats.tif", &[(side, 64, floats(side)), (450, 64, floats(450))]);
        let names = ["png16.png", "none.tif", "early.tif", "sizes.tif", "odd.tif", "all.tif", "floats.tif"];
        let path = gallery(directory.path(), &names.map(|name| json!({"uri": name})));
        // One after the other leaves memory, so that some are held, some are not.
        let film = |megabytes| {
            let scene = load(&path, megabytes);
            let stored = scene.textures.iter().filter(|t| matches!(t.texels, Texels::Stored(_))).count();
            let filtered = options(7 * 20, 20, 4).texture_filter(TextureFilter::Trilinear);
            (stored, render(&scene, filtered).film.hash())
        };
        let (stored, expected) = film(4096);
        assert_eq!(stored, 0);
        for megabytes in [24, 40] {
            let (stored, found) = film(megabytes);
            assert!(stored > 2 && found == expected, "{megabytes} MB: {stored} in tiles");
        }
    }

    /// A file of half a megabyte that names one tile as large as its image is refused before memory is taken for it.
    #[test]
    fn tiles_larger_than_memory_are_refused() {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let file = directory.path().join("huge.tif");
        write_tiled(&file, &[(64, 64, 64, &TiffTexels::Eight(vec![[9; 4]; 64 * 64]))]);
        let mut bytes = std::fs::read(&file).expect("written");
        crate::tiff::resize(&mut bytes, 1 << 15);
        bytes.resize(540_000, 0);
        std::fs::write(&file, bytes).expect("written");
        for megabytes in [24, 4096] {
            let options = LoadOptions::default().texture_budget(Budget { bytes: megabytes << 20, ..Budget::default() });
            let path = gallery(directory.path(), &[json!({"uri": "huge.tif"})]);
            let error = Scene::load_with(&path, &options).expect_err("4 GB of texels").to_string();
            assert!(error.contains("huge.tif") && error.contains("at a time"), "{error}");
        }
    }
}
