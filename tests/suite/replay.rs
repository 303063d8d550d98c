//! The path of one sample, told again: its bits are those of the picture, and its story adds up to them. Samples that
//! are not finite: which ones are listed, where, and how the command ends.
//!
//! Oracles: the film of the same options (exact), the sum of the listed contributions (exact), the depth limit as a
//! second opinion on the bounce. Deterministic, no false alarms.

use std::path::Path;

use glam::{Affine3A, Vec2, Vec3, Vec4};
use pathspace::backend::{BackendKind, QueryMode};
use pathspace::film::Pixel;
use pathspace::film::exr::read_exr;
use pathspace::plan::options::{
    Crop, FilterKind, Lens, LightPaths, RenderOptions, SamplerKind, Strategy, TextureFilter,
};
use pathspace::render::Renderer;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{
    AlphaMode, ColorSpace, Environment, Instance, Material, MaterialId, Mesh, MeshId, Scene, Texture, TextureId,
    TextureSlot, Wrap,
};
use pathspace::transport::vertex::{End, Met, Shadow};
use serde_json::Value;

use crate::common::{options, render, shared};

/// A box with every kind of surface: diffuse, metal, mirror, coat, rough and smooth glass, and a lamp.
fn every_lobe() -> Scene {
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::splat(0.7));
    let light = b.emitter(Vec3::splat(0.2), Vec3::splat(4.0));
    let metal = b.metal(Vec3::new(0.9, 0.6, 0.4), 0.3);
    let mirror = b.metal(Vec3::splat(0.95), 0.0);
    let glass = b.glass(1.5);
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
    b.quad([[-0.3, 0.99, -0.3], [0.3, 0.99, -0.3], [0.3, 0.99, 0.3], [-0.3, 0.99, 0.3]].map(Vec3::from), light);
    b.sphere(Vec3::new(-0.5, -0.6, -0.4), 0.4, 12, false, true, metal);
    b.sphere(Vec3::new(0.5, -0.6, -0.4), 0.35, 12, false, true, mirror);
    b.sphere(Vec3::new(0.1, -0.65, 0.2), 0.35, 12, false, true, glass);
    b.camera(Vec3::new(0.0, 0.0, 0.95), Vec3::ZERO, Vec3::Y, 1.4);
    b.build()
}

/// Every sample of every `stride`-th pixel again: the sums have the film's bits, and the stories the samples'.
fn holds(what: &str, scene: &Scene, options: RenderOptions, stride: u32) {
    let spp = options.spp.expect("a number of samples");
    // What light paths add belongs to no sample.
    let options = options.light_paths(LightPaths::Off);
    let renderer = Renderer::new(scene, options).unwrap_or_else(|e| panic!("{what}: {e}"));
    let film = renderer.render().expect("a render").film;
    for number in (0..film.pixels.len() as u32).step_by(stride as usize) {
        let (x, y) = (number % film.window.width, number / film.window.width);
        let place = (film.window.x + x, film.window.y + y);
        let mut samples = Vec::new();
        for sample in 0..spp {
            let replay = renderer.replay(place, sample).expect("a pixel of the picture");
            let bits = |rgb: [f32; 3]| rgb.map(f32::to_bits);
            let told = replay.told();
            assert_eq!(
                bits(told),
                bits(replay.radiance.map(|c| c.0)),
                "{what}: {place:?} sample {sample}: {replay:#?}"
            );
            samples.push(replay.film);
            assert!(replay.vertices.last().is_some_and(|vertex| vertex.end.is_some()), "{what}: {replay:#?}");
        }
        let pixel = Pixel::of_samples(0, &samples);
        let bits = |pixel: &Pixel| pixel.sum.map(|half| half.map(f64::to_bits));
        assert_eq!(bits(&pixel), bits(film.pixel(x, y)), "{what}: pixel {place:?}: {pixel:?}, {:?}", film.pixel(x, y));
    }
}

#[test]
fn replays_have_the_bits_of_the_film_on_every_backend_and_in_every_query_mode() {
    let scene = every_lobe();
    for &backend in BackendKind::available() {
        for mode in std::iter::once(None).chain(QueryMode::ALL.map(Some)) {
            if backend != BackendKind::Embree && mode.is_some() {
                continue;
            }
            let what = format!("{} {mode:?}", backend.name());
            holds(&what, &scene, options(24, 24, 5).backend(backend).rays(mode), 7);
        }
    }
}

#[test]
fn replays_have_the_bits_of_the_film_under_every_option() {
    let mut scene = every_lobe();
    scene.environment = Some(Environment::constant(Vec3::new(0.1, 0.2, 0.3)));
    let base = || options(16, 16, 4);
    let lens = Some(Lens { radius_m: 0.02, focus_m: 1.2 });
    let crop = Some(Crop { x: 5, y: 3, width: 6, height: 7 });
    let cases = [
        ("lens", base().lens(lens)),
        ("crop", base().crop(crop)),
        ("mitchell", base().filter(FilterKind::Mitchell).seed(9)),
        ("independent", base().sampler(SamplerKind::Independent)),
        ("balance", base().strategy(Strategy::MIS_BALANCE)),
        ("bsdf", base().strategy(Strategy::BSDF)),
        ("light", base().strategy(Strategy::LIGHT)),
        ("depth", base().max_depth(3)),
        ("all gates", base().forced(pathspace::plan::Gate::ALL.to_vec())),
        ("roulette", base().roulette(pathspace::render::Roulette::Constant(0.6))),
    ];
    for (what, options) in cases {
        holds(what, &scene, options, 5);
    }
}

/// Veils and a lamp that is there by half: rays pass them in a replay where they did in the render, and light that a
/// veil dims is told dimmed.
#[test]
fn replays_pass_what_the_render_passed() {
    let mut scene = every_lobe();
    let veil = Material { base_alpha: 0.4, alpha_mode: AlphaMode::Blend, ..scene.materials[0].clone() };
    scene.materials[1] = Material { base_alpha: 0.5, alpha_mode: AlphaMode::Blend, ..scene.materials[1].clone() };
    scene.materials.push(veil);
    for y in [-0.1, 0.3, 0.6] {
        let positions = [[-0.9, y, -0.9], [0.9, y, -0.9], [0.9, y, 0.5], [-0.9, y, 0.5]].map(Vec3::from).to_vec();
        let material = MaterialId(scene.materials.len() as u32 - 1);
        scene.meshes.push(Mesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], material, ..Mesh::default() });
        let mesh = MeshId(scene.meshes.len() as u32 - 1);
        scene.instances.push(Instance::new(mesh, Affine3A::IDENTITY));
    }
    for &backend in BackendKind::available() {
        holds(backend.name(), &scene, options(24, 24, 5).backend(backend), 7);
    }
}

/// A room with a textured floor, a sheet that a texture cuts out, an unlit picture with vertex colours, and a second
/// channel of coordinates that only some meshes have. Colours of the base are out of range.
fn textured_room() -> Scene {
    let mut scene = every_lobe();
    let texels = (0..1024u32).map(|i| i.wrapping_mul(0x9e37_79b9).to_le_bytes()).collect();
    scene.textures.push(Texture {
        name: "noise".into(),
        width: 32,
        height: 32,
        texels,
        color_space: ColorSpace::Srgb,
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
        bilinear: true,
    });
    let slot = |uv_set| Some(TextureSlot { texture: TextureId(0), uv_set });
    let plain = Material { metallic: 0.0, specular: 0.0, base_color: Vec3::new(1.5, 0.9, 0.8), ..Material::default() };
    let floor = Material { base_color_texture: slot(0), metallic_roughness_texture: slot(0), ..Material::default() };
    let cut = Material { base_color_texture: slot(1), alpha_mode: AlphaMode::Mask { cutoff: 0.5 }, ..plain.clone() };
    let picture = Material { base_color_texture: slot(0), vertex_colors: true, unlit: true, ..plain.clone() };
    let sheets = [(floor, -0.9, 1.0), (cut, -0.2, 0.6), (picture, 0.3, 0.3), (plain, 0.5, 0.2)];
    for (k, (material, y, size)) in sheets.into_iter().enumerate() {
        scene.materials.push(material);
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, z)| (x * size, z * size));
        scene.meshes.push(Mesh {
            positions: corners.map(|(x, z)| Vec3::new(x, y, z - 0.2)).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            uvs: Some(corners.map(|(x, z)| Vec2::new(2.0 * x, 2.0 * z)).to_vec()),
            more_uvs: if k == 0 { vec![corners.map(|(x, z)| Vec2::new(z, x)).to_vec()] } else { Vec::new() },
            colors: (k == 2).then(|| (0..4).map(|c| Vec4::splat(0.4 + 0.1 * c as f32)).collect()),
            material: MaterialId(scene.materials.len() as u32 - 1),
            ..Mesh::default()
        });
        let mesh = MeshId(scene.meshes.len() as u32 - 1);
        scene.instances.push(Instance::new(mesh, Affine3A::IDENTITY));
    }
    scene
}

/// Regression: a replay read unlit surfaces and factors without the widths of the render.
#[test]
fn replays_read_the_textures_of_the_render() {
    let scene = textured_room();
    for &backend in BackendKind::available() {
        for filter in [TextureFilter::Exact, TextureFilter::Trilinear] {
            let what = format!("{} {filter:?}", backend.name());
            holds(&what, &scene, options(24, 24, 5).backend(backend).texture_filter(filter), 3);
        }
    }
}

/// One rule for every reader of textures. Oracle: the same scene with the numbers written differently, bit for bit:
/// base colours above 1 are 1 in the lean kernel as in the others; a mask whose channel of coordinates the mesh lacks
/// is read by the first channel.
#[test]
fn one_rule_reads_all_textures() {
    let film = |scene: &Scene, gates: &[pathspace::plan::Gate]| {
        render(scene, options(24, 24, 4).backend(BackendKind::Obvhs).forced(gates.to_vec())).film
    };
    let mut bright = every_lobe();
    bright.materials[0].base_color = Vec3::new(1.4, 0.7, 0.5);
    let mut clamped = every_lobe();
    clamped.materials[0].base_color = Vec3::new(1.0, 0.7, 0.5);
    assert_eq!(film(&bright, &[]).hash(), film(&clamped, &[]).hash(), "the lean kernel clamps");
    assert_eq!(
        film(&bright, &[pathspace::plan::Gate::GENERAL]).hash(),
        film(&clamped, &[]).hash(),
        "the general one too"
    );

    let second = textured_room();
    let mut first = second.clone();
    for material in &mut first.materials {
        material.base_color_texture = material.base_color_texture.map(|slot| TextureSlot { uv_set: 0, ..slot });
    }
    assert_eq!(film(&second, &[]).hash(), film(&first, &[]).hash(), "the mask is read by channel 0");
}

/// Every path has its own time, in a replay as in the render.
#[test]
fn replays_stand_at_the_time_of_the_path() {
    for &backend in BackendKind::available() {
        let options = options(24, 24, 5).backend(backend);
        holds(backend.name(), &crate::shutter::moving_room(), options, 7);
    }
}

#[test]
fn replays_have_the_bits_of_the_film_in_the_shared_scenes() {
    let Some(shared) = shared("replay of the shared scenes") else { return };
    for name in ["cornell-box", "veach-mis", "glass-caustics", "many-lights", "env-object", "interior"] {
        let mut scene = Scene::load(shared.join(format!("scenes/{name}.gltf"))).expect("a shared scene");
        let environment = shared.join(format!("scenes/{name}.env.exr"));
        if environment.is_file() {
            scene.load_environment(&environment, 0.3, 1.5).expect("a shared environment");
        }
        for &backend in BackendKind::available() {
            if backend == BackendKind::Brute && scene.triangle_count() > 5000 {
                continue;
            }
            let what = format!("{name}, {}", backend.name());
            holds(&what, &scene, options(20, 20, 3).backend(backend), 13);
        }
    }
}

/// Two facing lamps that also reflect: seen directly each is finite, the sum over a few scatterings often is not.
fn too_bright() -> Scene {
    let mut b = SceneBuilder::new();
    let lamp = b.emitter(Vec3::splat(0.9), Vec3::new(1.3e38, 1.0, 1.0));
    b.quad([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0], [-1.0, 2.0, 0.0]].map(Vec3::from), lamp);
    b.quad([[-1.0, 0.0, 0.5], [-1.0, 2.0, 0.5], [1.0, 2.0, 0.5], [1.0, 0.0, 0.5]].map(Vec3::from), lamp);
    b.camera(Vec3::new(0.0, 1.0, 0.45), Vec3::new(0.0, 1.0, 0.0), Vec3::Y, 1.2);
    b.build()
}

#[test]
fn samples_that_are_not_finite_are_located_down_to_the_bounce() {
    let scene = too_bright();
    let made = |options| Renderer::new(&scene, options).expect("a valid scene");
    let render = made(options(24, 24, 8)).render().expect("a render");
    assert!(render.counters.nonfinite > 100, "{} samples are not finite", render.counters.nonfinite);
    let listed = &render.counters.nonfinite_first;
    assert_eq!(listed.len(), 16);

    // The film holds 0 for them, and nothing that is not finite.
    assert!(render.film.pixels.iter().flat_map(|pixel| pixel.sum).flatten().all(f64::is_finite));
    let mut depths = std::collections::BTreeSet::new();
    for met in listed {
        let bounce = met.bounce.expect("a replay is not finite either");
        depths.insert(bounce);
        // Without the paths of that many scatterings the sample is finite, with them it is not.
        let (x, y) = met.pixel;
        let crop = Some(Crop { x, y, width: 1, height: 1 });
        let limited = |max_depth| {
            let renderer = made(options(24, 24, met.sample + 1).max_depth(max_depth).crop(crop));
            let render = renderer.render().expect("a render");
            render.counters.nonfinite_first.iter().any(|n| n.sample == met.sample)
        };
        assert!(limited(bounce + 1), "{met:?}: finite with paths of {bounce} scatterings");
        assert!(bounce > 0 && !limited(bounce), "{met:?}: not finite without paths of {bounce} scatterings");

        let replay = made(options(24, 24, 8)).replay(met.pixel, met.sample).expect("a pixel of the picture");
        assert_eq!(replay.nonfinite_bounce, met.bounce);
        assert_eq!(replay.film[..3], [0.0; 3]);
        assert!(!replay.radiance[0].0.is_finite());
    }
    assert!(depths.len() > 1, "only bounces {depths:?} were seen");
}

/// Which samples are listed depends on nothing but the picture: not on threads, tiles, or how samples are cut into
/// passes.
#[test]
fn the_first_samples_that_are_not_finite_are_listed_in_order() {
    let scene = too_bright();
    let listed = |threads, spp, time| {
        let options = options(40, 24, spp).threads(threads).time(time);
        render(&scene, options).counters.nonfinite_first
    };
    let one = listed(1, 64, None);
    assert_eq!(one, listed(3, 64, Some(std::time::Duration::from_secs(600))));
    assert_eq!(one, listed(2, 2, None), "samples 0 and 1 hold more than are listed");
    assert!(one.is_sorted_by_key(|met| (met.sample, met.pixel.1, met.pixel.0)), "{one:?}");
}

#[test]
fn a_path_is_told_as_it_went() {
    let scene = every_lobe();
    let renderer = Renderer::new(&scene, options(32, 32, 64)).expect("a valid scene");
    let mut lobes = std::collections::BTreeSet::new();
    let (mut ends, mut shadows) = (std::collections::HashSet::new(), std::collections::HashSet::new());
    for number in (0..32 * 32).step_by(5) {
        let replay = renderer.replay((number % 32, number / 32), 1).expect("a pixel of the picture");
        let vertices = &replay.vertices;
        assert!(vertices.iter().zip(1..).all(|(vertex, edge)| vertex.edge == edge));
        assert!(vertices.split_last().is_some_and(|(_, earlier)| earlier.iter().all(|v| v.end.is_none())));
        for pair in vertices.windows(2) {
            let (Met::Surface(surface), Some(scattering)) = (&pair[0].met, &pair[0].scattering) else {
                panic!("a path went on from nowhere: {replay:#?}")
            };
            // The next ray starts at the surface within its error bound, and carries what the sample says.
            let apart = (0..3).map(|i| (pair[1].origin_m[i] - surface.position_m[i]).powi(2)).sum::<f64>().sqrt();
            assert!(apart <= 2.0 * f64::from(surface.error_m.0), "{apart} m off: {replay:#?}");
            assert_eq!(pair[1].direction, scattering.wi);
            let roulette = pair[0].roulette.expect("the path came to it");
            assert!(roulette.survived && roulette.number.0 < roulette.survival.0);
            for c in 0..3 {
                let expected = pair[0].throughput[c].0 / roulette.survival.0 * scattering.weight[c].0;
                let found = pair[1].throughput[c].0;
                assert!((found - expected).abs() <= 1e-6 * expected, "{found}, expected {expected}: {replay:#?}");
            }
        }
        for vertex in vertices {
            lobes.extend(vertex.scattering.map(|scattering| scattering.lobe));
            ends.extend(vertex.end);
            shadows.extend(vertex.light.map(|light| light.outcome));
        }
    }
    let expected = ["diffuse", "mirror", "rough specular", "smooth reflection", "smooth refraction"];
    assert!(expected.iter().all(|lobe| lobes.contains(lobe)), "{lobes:?}");
    assert!(ends.contains(&End::Roulette), "{ends:?}");
    assert!([Shadow::Visible, Shadow::Blocked].iter().all(|shadow| shadows.contains(shadow)), "{shadows:?}");
    assert!(renderer.replay((32, 0), 0).is_err());
}

/// Runs the built binary and expects an exit code.
fn command(code: i32, args: &[&str]) -> (String, String) {
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_pathspace")).args(args).output().expect("it starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(code), "{args:?}\n{out}\n{err}");
    (out, err)
}

fn path(path: &Path) -> &str {
    path.to_str().expect("temporary folders have plain names")
}

#[test]
fn the_command_tells_what_the_picture_holds() {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.gltf");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let exr = folder.path().join("one.exr");
    let common = ["render", path(&scene), "--width", "48", "--seed", "3", "--filter", "box"];
    command(0, &[&common[..], &["-o", path(&exr), "--spp", "1", "--crop", "1x1+20+30"]].concat());
    let picture = read_exr(&exr).expect("just written");

    let (told, _) = command(0, &[&common[..], &["--pixel", "20,30", "--sample", "0"]].concat());
    assert!(["vertex 1, bounce 0", "material", "scattering"].iter().filter(|word| told.contains(**word)).count() >= 2);
    let (record, _) = command(0, &[&common[..], &["--pixel", "20,30", "--sample", "0", "--json"]].concat());
    let record: Value = serde_json::from_str(&record).expect("JSON");
    let film: Vec<f32> = (0..3).map(|c| record["film"][c].as_f64().expect("a number") as f32).collect();
    assert_eq!(film, picture.rgb[0]);

    // A line a sample, and the largest marked; the mean is the picture's pixel.
    command(0, &[&common[..], &["-o", path(&exr), "--spp", "300", "--crop", "1x1+20+30"]].concat());
    let picture = read_exr(&exr).expect("just written");
    let (list, _) = command(0, &[&common[..], &["--pixel", "20,30", "--spp", "300"]].concat());
    assert_eq!(list.lines().filter(|line| line.ends_with("roulette") || line.contains(" % ")).count(), 301, "{list}");
    assert_eq!(list.lines().filter(|line| line.starts_with("* ")).count(), 2, "{list}");
    let (list, _) = command(0, &[&common[..], &["--pixel", "20,30", "--spp", "300", "--json"]].concat());
    let list: Value = serde_json::from_str(&list).expect("JSON");
    assert_eq!(list["samples"].as_array().map(Vec::len), Some(300));
    let mean: Vec<f32> = (0..3).map(|c| list["mean"][c].as_f64().expect("a number") as f32).collect();
    assert_eq!(mean, picture.rgb[0]);

    // What makes no sense is refused.
    for wrong in [&["--pixel", "48,0"][..], &["--pixel", "1"], &["--sample", "1"], &["--pixel", "1,1", "-o", "a.exr"]] {
        command(2, &[&common[..], wrong].concat());
    }
}

#[test]
fn the_command_locates_samples_that_are_not_finite_and_exits_5() {
    // The Cornell box with the brightest lamp that a file can ask for, and walls that are lamps themselves.
    let original = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let text = std::fs::read_to_string(original.join("scene.gltf")).expect("a scene");
    let mut json: Value = serde_json::from_str(&text).expect("JSON");
    for material in json["materials"].as_array_mut().expect("materials") {
        material["emissiveFactor"] = serde_json::json!([1.0, 1.0, 1.0]);
        material["extensions"]["KHR_materials_emissive_strength"] = serde_json::json!({"emissiveStrength": 2e38});
    }
    json["extensionsUsed"] = serde_json::json!(["KHR_materials_emissive_strength", "KHR_materials_specular"]);
    let scene = folder.path().join("scene.gltf");
    std::fs::write(&scene, json.to_string()).expect("a writable folder");
    std::fs::copy(original.join("scene.bin"), folder.path().join("scene.bin")).expect("a writable folder");

    let (exr, stats) = (folder.path().join("a.exr"), folder.path().join("a.json"));
    let common = ["render", path(&scene), "--width", "16"];
    let (_, err) = command(5, &[&common[..], &["-o", path(&exr), "--spp", "4", "--stats", path(&stats)]].concat());
    assert!(read_exr(&exr).expect("the picture is written").rgb.iter().flatten().all(|c| c.is_finite()));
    let record: Value = serde_json::from_slice(&std::fs::read(&stats).expect("written")).expect("JSON");
    assert!(record["nonfinite"].as_u64() > Some(16), "{record}");
    let listed = record["nonfinite_first"].as_array().expect("a list");
    assert_eq!(listed.len(), 16);
    let first = &listed[0];
    let (x, y) = (&first["pixel"][0], &first["pixel"][1]);
    let (sample, bounce) = (&first["sample"], &first["bounce"]);
    let line = format!("the first at pixel {x},{y} sample {sample} bounce {bounce};");
    assert_eq!(err.lines().filter(|told| told.contains(&line)).count(), 1, "{line}\n{err}");

    // The command that the line proposes shows it.
    let (pixel, sample) = (format!("{x},{y}"), sample.to_string());
    let (told, _) = command(5, &[&common[..], &["--pixel", &pixel, "--sample", &sample]].concat());
    assert!(told.contains(&format!("not finite from bounce {bounce} on")), "{told}");
    let (told, _) = command(5, &[&common[..], &["--pixel", &pixel, "--spp", "4"]].concat());
    assert!(told.lines().any(|line| line.starts_with("! ")), "{told}");
}
