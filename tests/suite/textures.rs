//! Texture look-ups (HARDCASES I06) and environment files.

use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3, Vec4};
use pathspace::Error;
use pathspace::scene::image::load_environment;
use pathspace::scene::{
    ColorSpace, Environment, EnvironmentFile, LoadOptions, MissingTexture, Scene, Texels, Texture, Wrap,
};
use pathspace::texture::{SRGB_TO_LINEAR, lookup};

use crate::loading::fixture::Fixture;

const WRAPS: [Wrap; 3] = [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::ClampToEdge];

/// A texture whose texel n is (37·n mod 256, 255 − n, 7, 100).
fn texture(width: usize, height: usize, wrap: Wrap, bilinear: bool) -> Texture {
    let texels: Texels = (0..width * height).map(|n| [(n * 37 % 256) as u8, 255 - (n % 256) as u8, 7, 100]).collect();
    let color_space = ColorSpace::Linear;
    Texture { name: "test".into(), width, height, texels, color_space, wrap_u: wrap, wrap_v: wrap, bilinear }
}

fn texel(texture: &Texture, x: usize, y: usize) -> Vec4 {
    Vec4::from(texture.texels.eight().expect("8 bits")[y * texture.width + x].map(|channel| f32::from(channel) / 255.0))
}

/// Oracle: at texel centres bilinear and nearest both give the texel; halfway between, bilinear gives the mean. v = 0
/// is the top.
#[test]
fn texel_centres_and_midpoints() {
    for wrap in WRAPS {
        for bilinear in [false, true] {
            let texture = texture(5, 3, wrap, bilinear);
            for y in 0..3 {
                for x in 0..5 {
                    let uv = Vec2::new((x as f32 + 0.5) / 5.0, (y as f32 + 0.5) / 3.0);
                    assert!(
                        (lookup(&texture, uv) - texel(&texture, x, y)).abs().max_element() < 1e-5,
                        "{wrap:?} {x} {y}"
                    );
                }
            }
        }
        let texture = texture(4, 2, wrap, true);
        let mean =
            (texel(&texture, 1, 0) + texel(&texture, 2, 0) + texel(&texture, 1, 1) + texel(&texture, 2, 1)) / 4.0;
        assert!((lookup(&texture, Vec2::splat(0.5)) - mean).abs().max_element() < 1e-6);
    }
}

/// Oracle: the definition of each wrap on a row of four texels, at and beyond the edges.
#[test]
fn wraps_fold_as_they_are_defined() {
    let at = |wrap: Wrap, bilinear: bool, u: f32| {
        let texture = texture(4, 1, wrap, bilinear);
        (lookup(&texture, Vec2::new(u, 0.5)), texture)
    };
    for (wrap, u, expected) in [
        (Wrap::Repeat, -0.125, 3),
        (Wrap::Repeat, 1.0, 0),
        (Wrap::Repeat, 2.375, 1),
        (Wrap::Repeat, -1e-9, 0),
        (Wrap::MirroredRepeat, -0.125, 0),
        (Wrap::MirroredRepeat, 1.125, 3),
        (Wrap::MirroredRepeat, 1.0, 3),
        (Wrap::MirroredRepeat, 2.125, 0),
        (Wrap::MirroredRepeat, -1.125, 3),
        (Wrap::ClampToEdge, -7.0, 0),
        (Wrap::ClampToEdge, 1.0, 3),
        (Wrap::ClampToEdge, 9.0, 3),
    ] {
        let (found, texture) = at(wrap, false, u);
        assert!((found - texel(&texture, expected, 0)).abs().max_element() < 1e-6, "{wrap:?} {u}");
    }
    // Bilinear at u = 0: the mean with the neighbour across the edge.
    for (wrap, neighbour) in [(Wrap::Repeat, 3), (Wrap::MirroredRepeat, 0), (Wrap::ClampToEdge, 0)] {
        let (found, texture) = at(wrap, true, 0.0);
        let mean = (texel(&texture, 0, 0) + texel(&texture, neighbour, 0)) / 2.0;
        assert!((found - mean).abs().max_element() < 1e-6, "{wrap:?}");
    }
}

/// I06. Oracle: results stay within the texture's range, a constant texture is itself everywhere, odd and 1 × 1 sizes
/// included. Deterministic.
#[test]
fn extreme_coordinates_stay_inside() {
    let coordinates = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.999_999_94,
        -1e-9,
        1e-45,
        1e6,
        -1e6,
        1e6 + 0.5,
        16_777_217.0,
        3e38,
        -3e38,
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
    ];
    for wrap in WRAPS {
        for bilinear in [false, true] {
            for (width, height) in [(1, 1), (1, 7), (3, 2), (4097, 3), (16_384, 1)] {
                let mut texture = texture(width, height, wrap, bilinear);
                texture.texels = vec![[51, 102, 153, 204]; width * height].into();
                for u in coordinates {
                    for v in coordinates {
                        let found = lookup(&texture, Vec2::new(u, v));
                        assert!((found - Vec4::new(0.2, 0.4, 0.6, 0.8)).abs().max_element() < 1e-6, "{u} {v} {found}");
                    }
                }
            }
            let texture = texture(5, 3, wrap, bilinear);
            assert_eq!(lookup(&texture, Vec2::new(f32::NAN, f32::INFINITY)), lookup(&texture, Vec2::ZERO));
        }
    }
}

/// I06: the mean over whole periods is the texture's mean. Oracle: exact mean; a regular grid finer than the texels
/// integrates the bilinear surface to rounding.
#[test]
fn mean_over_a_period_is_the_textures_mean() {
    for wrap in [Wrap::Repeat, Wrap::MirroredRepeat] {
        let texture = texture(4, 4, wrap, true);
        let mean = (0..16).map(|n| texel(&texture, n % 4, n / 4)).sum::<Vec4>() / 16.0;
        for start in [0.0f32, -4.0, 1000.0] {
            let steps = 128;
            let grid = |n: usize| start + 2.0 * (n as f32 + 0.5) / steps as f32;
            let sum: Vec4 =
                (0..steps * steps).map(|n| lookup(&texture, Vec2::new(grid(n % steps), grid(n / steps)))).sum();
            assert!((sum / (steps * steps) as f32 - mean).abs().max_element() < 1e-4, "{wrap:?} {start}");
        }
    }
}

/// sRGB is decoded before filtering: halfway between black and white is 0.5 in linear light. Alpha is not decoded.
#[test]
fn colours_are_filtered_in_linear_light() {
    let mut texture = texture(2, 1, Wrap::ClampToEdge, true);
    texture.texels = vec![[0, 0, 0, 0], [255, 255, 255, 255]].into();
    texture.color_space = ColorSpace::Srgb;
    assert_eq!(lookup(&texture, Vec2::splat(0.5)), Vec4::splat(0.5));
    texture.texels = vec![[188, 10, 0, 188]; 2].into();
    let found = lookup(&texture, Vec2::splat(0.5));
    assert_eq!(found, Vec4::new(SRGB_TO_LINEAR[188], SRGB_TO_LINEAR[10], 0.0, 188.0 / 255.0));
}

/// An EXR of the given texels, in half or float.
fn write_exr(path: &Path, width: usize, texels: &[Vec3], half: bool) {
    use exr::prelude::{Image, SpecificChannels, WritableImage, f16};
    let size = (width, texels.len() / width);
    let at = |position: exr::math::Vec2<usize>| texels[position.1 * width + position.0].to_array();
    let written = if half {
        let channels = SpecificChannels::rgb(|position| {
            let [r, g, b] = at(position).map(f16::from_f32);
            (r, g, b)
        });
        Image::from_channels(size, channels).write().to_file(path)
    } else {
        let channels = SpecificChannels::rgb(|position| {
            let [r, g, b] = at(position);
            (r, g, b)
        });
        Image::from_channels(size, channels).write().to_file(path)
    };
    written.expect("a temporary directory can be written");
}

fn texels_of(path: &Path) -> (usize, usize, Vec<Vec3>) {
    let environment = load_environment(path, 0.5, 2.0).expect("a valid environment");
    assert_eq!((environment.rotation_rad, environment.intensity), (0.5, 2.0));
    (environment.width, environment.height, environment.texels.to_vec())
}

/// Oracle: the texels written are the texels read, row 0 on top, exactly for values that the format holds.
#[test]
fn environments_are_read_as_written() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let texels: Vec<Vec3> = (0..6).map(|n| Vec3::new(n as f32, 0.5 * n as f32, 1024.0)).collect();
    for (name, half) in [("half.exr", true), ("float.exr", false)] {
        let path = directory.path().join(name);
        write_exr(&path, 3, &texels, half);
        assert_eq!(texels_of(&path), (3, 2, texels.clone()), "{name}");
    }
    // Radiance keeps a common exponent: values of one magnitude are exact here.
    let texels = vec![Vec3::new(1.0, 0.5, 0.25), Vec3::new(8.0, 4.0, 6.0)];
    let pixels: Vec<image::Rgb<f32>> = texels.iter().map(|texel| image::Rgb(texel.to_array())).collect();
    let mut bytes = Vec::new();
    image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&pixels, 1, 2).expect("an image in memory");
    let path = directory.path().join("sky.hdr");
    std::fs::write(&path, bytes).expect("a temporary directory can be written");
    assert_eq!(texels_of(&path), (1, 2, texels));
    let grey = Environment::constant(Vec3::splat(0.25));
    assert_eq!((grey.width * grey.height, grey.texels[0], grey.intensity), (1, Vec3::splat(0.25), 1.0));
}

/// Oracle: NaN and infinity are errors that say how many and where; negative radiance becomes 0 with a warning.
#[test]
fn bad_radiance_is_refused_or_clamped() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path = directory.path().join("sky.exr");
    for bad in [f32::NAN, f32::INFINITY] {
        let mut texels = vec![Vec3::ONE; 12];
        texels[7].y = bad;
        texels[9].z = bad;
        write_exr(&path, 4, &texels, false);
        let error = load_environment(&path, 0.0, 1.0).expect_err("radiance is not finite").to_string();
        assert!(error.contains("2 texels") && error.contains("(3, 1)") && error.contains("sky.exr"), "{error}");

        let options =
            LoadOptions::default().environment(EnvironmentFile::new(&path)).missing_texture(MissingTexture::Magenta);
        let scene = Scene::load_with(Fixture::quad().write(directory.path()), &options).expect("a warning instead");
        let texels = &scene.environment.as_ref().expect("loaded").texels;
        assert_eq!((texels[6], texels[7], texels[9]), (Vec3::ONE, Vec3::new(1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0)));
        let warned = |text: &str| scene.warnings.iter().any(|warning| warning.what.contains(text));
        assert!(warned("2 texels with NaN or infinity; shown in magenta"), "{:?}", scene.warnings);
    }
    write_exr(&path, 2, &[Vec3::new(-1.0, 2.0, 3.0), Vec3::ONE], false);
    let mut scene = Scene::default();
    scene.load_environment(&path, 0.0, 1.0).expect("negative radiance is clamped");
    assert_eq!(scene.environment.expect("loaded").texels[0], Vec3::new(0.0, 2.0, 3.0));
    assert!(
        scene.warnings.len() == 1 && scene.warnings[0].what.contains("1 texels with negative"),
        "{:?}",
        scene.warnings
    );
}

/// Broken, lying and mutated environment files are errors. Oracle: the kind of error, and that nothing panics. A fixed
/// LCG.
#[test]
fn broken_environments_are_errors() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path: PathBuf = directory.path().join("sky");
    let fails = |bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("a temporary directory can be written");
        load_environment(&path, 0.0, 1.0).err()
    };
    for bytes in [
        &b""[..],
        b"PNG?",
        b"#?RADIANCE\n\n-Y 99999999 +X 99999999\n",
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n",
        b"\x76\x2f\x31\x01\x02",
    ] {
        let error = fails(bytes).expect("not an environment");
        assert!(matches!(error, Error::Image { .. }) && !error.to_string().contains('\n'), "{error}");
    }
    assert!(matches!(load_environment(directory.path().join("absent.exr"), 0.0, 1.0), Err(Error::Io { .. })));

    let exr = directory.path().join("whole.exr");
    write_exr(&exr, 8, &vec![Vec3::ONE; 64], true);
    let whole = std::fs::read(&exr).expect("just written");
    let mut state = 3u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let mut refused = 0;
    for round in 0..500 {
        let mut mutated = whole.clone();
        if round % 5 == 0 {
            mutated.truncate(random(whole.len()));
        }
        for _ in 0..2 {
            let (at, bit) = (random(whole.len()), 1 << random(8));
            if let Some(byte) = mutated.get_mut(at) {
                *byte ^= bit;
            }
        }
        refused += usize::from(fails(&mutated).is_some());
    }
    assert!(refused > 100, "only {refused} of 500 were refused");
}
