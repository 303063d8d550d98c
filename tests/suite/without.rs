//! Effects that are left out on demand: what that makes of the picture, against closed forms; what it leaves in records
//! and files. Seeds are fixed.

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use glam::Vec3;
use pathspace::render::{Absent, RenderOptions, Renderer, leave_out};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{AlphaMode, Environment, Fact, Facts, Material, Scene};
use pathspace::stats::{Seconds, Stats};

use crate::common::{Estimate, options, render, shared};

/// A wall that fills the picture before an environment of radiance 1, black where it is there.
fn wall(material: Material) -> Scene {
    let mut b = SceneBuilder::new();
    let material = b.material(Material { base_color: Vec3::ZERO, metallic: 0.0, specular: 0.0, ..material });
    b.quad([(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)].map(|(x, y)| Vec3::new(x, y, 0.0)), material);
    b.environment(Environment::constant(Vec3::ONE));
    b.camera(Vec3::new(0.0, 0.0, 1.0), Vec3::ZERO, Vec3::Y, 0.5);
    b.build()
}

fn without(scene: &Scene, options: &RenderOptions, names: &[&str]) -> (Scene, RenderOptions) {
    let (mut scene, mut options) = (scene.clone(), options.clone());
    let names: Vec<String> = names.iter().map(|name| name.to_string()).collect();
    leave_out(&mut scene, &mut options, &names, Absent::Refused).unwrap_or_else(|e| panic!("{e}"));
    (scene, options)
}

/// Coverage is known: a black surface that is there with probability ¼ lets ¾ of the light pass, a masked one of alpha
/// ¼ all of it; whole they let none. Oracle: glTF 2.0 §3.9.4. Means within 4.9 standard errors (10⁻⁶); without the
/// effect the picture is exactly black.
#[test]
fn a_cut_out_of_known_coverage_is_worth_what_it_covers() {
    let blended = Material { alpha_mode: AlphaMode::Blend, base_alpha: 0.25, ..Material::default() };
    let masked = Material { alpha_mode: AlphaMode::Mask { cutoff: 0.5 }, base_alpha: 0.25, ..Material::default() };
    for (material, name, light) in [(blended, "alpha-blending", 0.75), (masked, "alpha-masks", 1.0)] {
        let (scene, options) = (wall(material), options(32, 32, 16));
        let seen = Estimate::of_pixels(&render(&scene, options.clone()).film);
        let limit = 4.9 * (seen.variance[0] / seen.n).sqrt() + 1e-6;
        assert!((seen.mean[0] - light).abs() < limit, "{name}: {seen:?}");
        let (scene, options) = without(&scene, &options, &[name]);
        assert_eq!(render(&scene, options).film.mean()[..3], [0.0; 3], "{name}");
    }
}

/// Leaving out is recorded: asked for and ignored, in the ledger, in what pictures are told apart by. Other effects
/// keep their random numbers: the picture of a scene without its coat is, bit for bit, that of a scene made without
/// one. Deterministic.
#[test]
fn what_is_left_out_is_told_and_nothing_else_changes() {
    let scene = |specular: f32| {
        let mut b = SceneBuilder::new();
        let floor = b.material(Material { metallic: 0.0, specular, roughness: 0.3, ..Material::default() });
        b.cuboid(Vec3::splat(-0.5), Vec3::splat(0.5), false, floor);
        b.environment(Environment::constant(Vec3::ONE));
        b.point_light(Vec3::new(1.0, 2.0, 2.0), Vec3::ONE);
        b.camera(Vec3::new(1.0, 1.0, 2.0), Vec3::ZERO, Vec3::Y, 1.0);
        b.build()
    };
    let plain = options(16, 16, 4);
    let (bare, options) = without(&scene(1.0), &plain, &["dielectric-coat", "depth:8"]);
    assert_eq!(options.max_depth, 8);
    let renderer = Renderer::new(&bare, options).expect("valid options");
    let picture = renderer.render().expect("renders");
    let stats = Stats::new(&renderer, &picture, Seconds::default());
    let what: Vec<&str> = stats.bias.iter().map(|bias| bias.what.as_str()).collect();
    let expected = ["max-depth 8", "left out: dielectric-coat (--without)", "left out: depth:8 (--without)"];
    assert_eq!(what, expected);
    let ignored: Vec<&str> = stats.effects.ignored.iter().map(|ignored| ignored.what.as_str()).collect();
    assert!(ignored[0].starts_with("dielectric-coat (material") && ignored[1].starts_with("paths of more than 8"));
    assert!(!stats.effects.simulated.contains(&"dielectric-coat".to_string()), "{:?}", stats.effects);
    assert!(stats.effects.found.iter().any(|found| found == ignored[0]));
    let made = render(&scene(0.0), plain.clone().max_depth(8));
    assert_eq!(picture.film.hash(), made.film.hash());
    let identity = |renderer: &Renderer| renderer.identity().expect("scenes in code have no files");
    let whole = scene(1.0);
    let other = Renderer::new(&whole, plain).expect("valid options");
    let differences = identity(&other).differences(&identity(&renderer));
    assert_eq!(differences[0], ("without".into(), "none".into(), "dielectric-coat,depth:8".into()));
}

/// A technique is no effect: of two that find the same light either alone gives the picture of both. Oracle: each
/// other, within 4.9 standard errors of 4096 samples (10⁻⁶ each), which see 3 %. It is told, and is no bias; lamps are.
#[test]
fn techniques_are_left_out_without_bias_and_lamps_are_not() {
    let mut b = SceneBuilder::new();
    let (floor, lamp) = (b.lambert(Vec3::splat(0.6)), b.emitter(Vec3::ZERO, Vec3::splat(4.0)));
    let square = |y: f32, r: f32| [(-r, r), (r, r), (r, -r), (-r, -r)].map(|(x, z)| Vec3::new(x, y, z));
    b.node("floor", None).quad(square(0.0, 4.0), floor);
    let mut down = square(2.0, 1.0);
    down.reverse();
    b.node("lamp", Some("key")).quad(down, lamp);
    b.environment(Environment::constant(Vec3::splat(0.5)));
    b.camera(Vec3::new(0.0, 1.0, 3.0), Vec3::ZERO, Vec3::Y, 0.4);
    let (scene, plain) = (b.build(), options(16, 16, 16));
    let seen = |names: &[&str]| {
        let (scene, options) = without(&scene, &plain, names);
        let renderer = Renderer::new(&scene, options).expect("valid options");
        let picture = renderer.render().expect("renders");
        let stats = Stats::new(&renderer, &picture, Seconds::default());
        let biases = stats.bias.iter().filter(|bias| bias.what.starts_with("left out")).count();
        let told = stats.effects.ignored.iter().filter(|ignored| ignored.why == "left out (--without)").count();
        assert_eq!(told, names.len());
        (Estimate::of_pixels(&picture.film), biases)
    };
    let (whole, _) = seen(&[]);
    for name in ["technique:bsdf", "technique:light"] {
        let (one, biases) = seen(&[name]);
        let limit = 4.9 * (whole.variance[0] / whole.n + one.variance[0] / one.n).sqrt();
        assert!(
            (one.mean[0] - whole.mean[0]).abs() < limit && limit < 0.15 * whole.mean[0],
            "{name}: {one:?} {whole:?}"
        );
        assert_eq!(biases, 0, "{name}");
    }
    // Both groups, and no more.
    let (key, biases) = seen(&["light-group:key"]);
    let (rest, _) = seen(&["light-group:default"]);
    let limit = 4.9 * (key.variance[0] / key.n + rest.variance[0] / rest.n + whole.variance[0] / whole.n).sqrt();
    assert!((key.mean[0] + rest.mean[0] - whole.mean[0]).abs() < limit, "{key:?} {rest:?} {whole:?}");
    assert_eq!((biases, seen(&["light-group:key", "lamp:env*"]).0.mean[0]), (1, 0.0));
}

/// A mesh that two materials share is shared no more where only one of them still reads its coordinates. Oracle: the
/// loader's own rule.
#[test]
fn shared_meshes_are_parted() {
    let Some(folder) = shared("effects of shared scenes, left out") else { return };
    let scenes = ["scenes", "assets"].map(|part| std::fs::read_dir(folder.join(part)).into_iter().flatten().flatten());
    let is_scene = |path: &PathBuf| path.extension().is_some_and(|end| end == "gltf" || end == "glb");
    let mut tried = 0;
    for path in scenes.into_iter().flatten().map(|entry| entry.path()).filter(is_scene) {
        // Images of some are large; what can be left out is a matter of the materials.
        let Ok(scene) = Scene::load(&path).map(|scene| Scene { textures: Vec::new(), ..scene }) else { continue };
        let options = options(4, 4, 1);
        for choice in pathspace::plan::effects::without::choices(&scene, &options) {
            let (scene, _) = without(&scene, &options, &[&choice.name]);
            for instance in &scene.instances {
                let mesh = &scene.meshes[instance.mesh.index()];
                let [own, other] = [mesh.material, scene.material_of(instance)].map(|id| &scene.materials[id.index()]);
                assert!(instance.material.is_none() || own.may_share(other), "{}: {}", path.display(), choice.name);
            }
            let drawn = scene.instances.iter().map(|instance| &scene.materials[scene.material_of(instance).index()]);
            let clear = drawn.filter(|material| Facts::of(material).has(Fact::Solid)).count();
            assert!(choice.name != "solid-dielectric" || clear == 0, "{}", path.display());
            tried += 1;
        }
    }
    assert!(tried > 10, "{tried} effects of the shared scenes");
}

fn pathspace(code: i32, folder: &Path, args: &[&str]) -> (String, String) {
    let mut command = Command::cargo_bin("pathspace").expect("the package has this binary");
    let output = command.current_dir(folder).args(args).output().expect("the binary starts");
    let [out, err] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert_eq!(output.status.code(), Some(code), "{args:?}\n{out}\n{err}");
    (out, err)
}

/// On the command line: names that are not called for are refused with those that are; a render with another list does
/// not go on from a state, nor join a part. Oracle: the contract.
#[test]
fn the_command_line_leaves_out_and_refuses() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.gltf");
    let scene = scene.to_str().expect("a plain name");
    let run = |code, more: &[&str]| {
        let fixed = ["render", scene, "--size", "8x8", "-q", "-t", "1"];
        pathspace(code, folder.path(), &[&fixed[..], more].concat())
    };
    let (_, err) = run(2, &["--spp", "1", "--without", "normal-maps,bloom", "-o", "a.exr"]);
    assert!(
        err.contains("'normal-maps' is not called for; this scene calls for ") && err.contains("area-lights"),
        "{err}"
    );
    let limited = ["--without", "depth:2", "--stats", "-", "-o", "a.exr"];
    let (out, _) = run(0, &[&limited[..], &["--sample-range", "0..4", "--checkpoint", "a.part"]].concat());
    let stats: serde_json::Value = serde_json::from_str(&out).expect("JSON");
    assert_eq!(stats["bias"][0]["what"], "max-depth 2");
    assert_eq!(stats["bias"][1]["what"], "left out: depth:2 (--without)");
    let exr = pathspace::film::exr::text_attribute(&folder.path().join("a.exr"), "pathspace/plan").expect("a plan");
    assert!(exr.contains("left out: depth:2"), "{exr}");
    run(0, &["--max-depth", "2", "--sample-range", "4..8", "--checkpoint", "b.part", "-o", "b.exr"]);
    let (_, err) = run(2, &["--spp", "16", "--resume", "a.part", "-o", "c.exr"]);
    assert!(err.contains("without"), "{err}");
    let (_, err) = pathspace(2, folder.path(), &["merge", "a.part", "b.part", "-o", "c.exr"]);
    assert!(err.contains("its without is none, that of a.part is depth:2"), "{err}");
    // The same settings go on.
    run(0, &["--sample-range", "4..8", "--checkpoint", "d.part", "-o", "d.exr", "--without", "depth:2"]);
    pathspace(0, folder.path(), &["merge", "a.part", "d.part", "-o", "c.exr"]);
}
