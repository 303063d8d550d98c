//! Looks of previews, cameras that are put somewhere, and what people type first. Oracles: scenes known by hand, the
//! EXR of the same render without a look, and the command line's contract. Deterministic.

use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};

use assert_cmd::Command;
use glam::Vec3;
use pathspace::film::Film;
use pathspace::film::exr::{ExrOptions, read_exr};
use pathspace::film::look::{Backdrop, Look, Preview};
use pathspace::plan::Aov;
use pathspace::render::{Crop, Renderer};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Environment, Projection, Scene};

use crate::common::{options, render};

/// A lamp of radiance 1/4 that covers three and a half columns of eight, seen by a parallel camera, before a sky of
/// radiance 1/2.
fn half_a_wall() -> Scene {
    let mut b = SceneBuilder::new();
    let wall = b.emitter(Vec3::ZERO, Vec3::splat(0.25));
    b.quad([(-2.0, -1.0), (-0.25, -1.0), (-0.25, 1.0), (-2.0, 1.0)].map(|(x, y)| Vec3::new(x, y, -1.0)), wall);
    let eye = Vec3::new(0.0, 0.0, 2.0);
    b.any_camera(eye, Vec3::ZERO, Vec3::Y, Projection::Orthographic { xmag_m: 1.0, ymag_m: 1.0 });
    let mut scene = b.build();
    scene.environment = Some(Environment::constant(Vec3::splat(0.5)));
    scene
}

/// By hand: sRGB of 0.25 is code 137, of 0.5 code 188; the edge cuts the fourth column in halves.
#[test]
fn what_is_behind_can_be_taken_away_and_replaced() {
    let scene = half_a_wall();
    let aovs = [Aov::BACKGROUND, Aov::COVERAGE];
    let plain = render(&scene, options(8, 4, 16));
    let renderer = Renderer::new(&scene, options(8, 4, 16).aovs(aovs)).expect("valid options");
    let render = renderer.render().expect("it renders");
    assert_eq!(render.film.hash(), plain.film.hash(), "layers change no bit of the picture");
    let preview = |backdrop| Look::default().backdrop(backdrop).preview(&render.film).expect("gathered");
    let at = |preview: &Preview, x: usize| {
        let n = if preview.alpha { 4 } else { 3 };
        preview.bytes[(8 + x) * n..][..n].to_vec()
    };

    let seen = preview(Backdrop::Seen);
    assert_eq!((at(&seen, 0), at(&seen, 7)), (vec![137; 3], vec![188; 3]));
    let transparent = preview(Backdrop::Transparent);
    assert_eq!((at(&transparent, 0), at(&transparent, 7)), (vec![137, 137, 137, 255], vec![0; 4]));
    // At the edge the colour is still the wall's: it is not premultiplied.
    let edge = at(&transparent, 3);
    assert!((136..=138).contains(&edge[0]) && (100..=156).contains(&edge[3]), "{edge:?}");
    let red = preview(Backdrop::Color([1.0, 0.0, 0.0]));
    assert_eq!((at(&red, 0), at(&red, 7)), (vec![137; 3], vec![255, 0, 0]));
    // A constant sky stays what it is out of focus.
    let blurred = preview(Backdrop::Picture(renderer.blurred_background(0.2)));
    for (a, b) in blurred.bytes.iter().zip(&seen.bytes) {
        assert!(a.abs_diff(*b) <= 1, "{a} {b}");
    }
    assert!(Look::default().backdrop(Backdrop::Transparent).preview(&plain.film).is_err(), "nothing was gathered");
}

fn pathspace(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::cargo_bin("pathspace").expect("the package has this binary");
    command.args(args).current_dir(folder).env_remove("SLURM_CPUS_PER_TASK");
    command
}

fn run(code: i32, folder: &Path, args: &[&str]) -> Output {
    let output = pathspace(folder, args).output().expect("the binary starts");
    assert_eq!(output.status.code(), Some(code), "{args:?}\n{}", err(&output));
    output
}

fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("temporary folders have plain names")
}

#[test]
fn no_look_touches_the_exr() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = scenes().join("cornell-box/scene.gltf");
    let mut env = Film::new((8, 4), Crop { x: 0, y: 0, width: 8, height: 4 });
    env.pixels.iter_mut().enumerate().for_each(|(i, pixel)| pixel.add(0, [i as f32 / 16.0; 3], 1.0, 1.0));
    env.write_exr(folder.path().join("env.exr"), &ExrOptions::default()).expect("a writable folder");
    let exr = |more: &[&str]| {
        let common = ["render", text(&scene), "-o", "a.exr", "--reproducible", "--size", "24x16", "-s", "2"];
        run(0, folder.path(), &[&common[..], &["--env", "env.exr"], more].concat());
        std::fs::read(folder.path().join("a.exr")).expect("just written")
    };
    let plain = exr(&[]);
    let looks: [&[&str]; 3] = [
        &["--png", "a.png", "--transparent", "--tone-map", "AgX", "--exposure", "2"],
        &["--jpg", "a.jpg", "--background", "#204060", "--tone-map", "neutral"],
        &["--png", "b.png", "--background", "blur"],
    ];
    for look in looks {
        assert!(exr(look) == plain, "{look:?} changed the EXR");
    }
    for (file, start) in [("a.png", &b"\x89PNG"[..]), ("b.png", b"\x89PNG"), ("a.jpg", b"\xff\xd8\xff")] {
        assert!(std::fs::read(folder.path().join(file)).expect("written").starts_with(start), "{file}");
    }
    // Without a preview a look is a word in vain, not an end.
    assert!(
        err(&run(0, folder.path(), &["render", text(&scene), "--size", "8x8", "-s", "1", "--exposure", "1"]))
            .contains("--exposure applies to previews alone")
    );
    assert!(folder.path().join("scene.exr").is_file(), "the default name");
}

#[test]
fn a_scene_alone_becomes_a_picture() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let cornell = scenes().join("cornell-box");
    // A folder with one scene is that scene; names are those of the scene, in the current folder.
    let output = run(0, folder.path(), &[text(&cornell), "--size", "16x16", "--spp", "2"]);
    assert!(err(&output).contains("wrote scene.exr, scene.png (16x16, 2 spp): noise "), "{}", err(&output));
    // A machine that is busy is told of steps that take their time, which come before.
    let step = |line: &&str| line.contains(" … ") || line.contains(" %  ");
    assert_eq!(err(&output).lines().filter(|line| !step(line)).count(), 1, "{}", err(&output));
    assert_eq!(read_exr(&folder.path().join("scene.exr")).expect("just written").width, 16);
    assert!(std::fs::read(folder.path().join("scene.png")).expect("written").starts_with(b"\x89PNG"));

    // Scene in, picture out; what lies beside is looked for in the current folder.
    let input = std::fs::File::open(cornell.join("scene.gltf")).expect("a shared scene");
    let piped = std::process::Command::new(assert_cmd::cargo::cargo_bin!("pathspace"))
        .args(["-", "--size", "8x8", "--spp", "1"])
        .current_dir(&cornell)
        .stdin(Stdio::from(input))
        .output()
        .expect("the binary starts");
    assert!(piped.status.success() && piped.stdout.starts_with(b"\x89PNG"), "{}", err(&piped));

    // Folders are made when asked for; several scenes are named.
    let made = ["render", text(&cornell), "-o", "a/b/c.png", "--size", "8x8", "-s", "1", "--make-path", "-q"];
    run(0, folder.path(), &made);
    assert!(folder.path().join("a/b/c.png").is_file());
    let many = tempfile::tempdir().expect("a temporary folder");
    for name in ["one.glb", "two.gltf"] {
        std::fs::write(many.path().join(name), b"glTF").expect("a writable folder");
    }
    let output = run(2, many.path(), &["render", "."]);
    assert!(err(&output).contains("one.glb, two.gltf"), "{}", err(&output));
    let output = run(2, many.path(), &["render", text(&scenes())]);
    assert!(err(&output).contains("without .gltf"), "{}", err(&output));
}

#[test]
fn other_files_are_called_by_their_names() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let files = [(&b"\x89PNG\r\n\x1a\n"[..], "PNG"), (b"Kaydara FBX Binary", "FBX"), (b"PK\x03\x04", "ZIP")];
    for (bytes, name) in files {
        std::fs::write(folder.path().join("a.glb"), bytes).expect("a writable folder");
        let output = run(4, folder.path(), &["info", "a.glb"]);
        assert!(err(&output).contains(name) && err(&output).lines().count() == 1, "{}", err(&output));
    }
}

/// Case is ignored, and names from elsewhere are known: the EXR's layers say what was understood.
#[test]
fn spellings_that_can_mean_one_thing_are_taken() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = scenes().join("cornell-box/scene.gltf");
    let args = ["render", text(&scene), "-o", "a.exr", "--size", "8X8", "-s", "1", "--aov", "n,depth,Albedo", "-q"];
    let more =
        ["--roulette=FALSE", "--backend", "Brute", "--sampler", "Sobol", "--texture-memory", "1G", "--at", "0.5"];
    run(0, folder.path(), &[&args[..], &more].concat());
    let bytes = std::fs::read(folder.path().join("a.exr")).expect("just written");
    for channel in [&b"albedo.R\0"[..], b"N.X\0", b"Z\0"] {
        assert!(bytes.windows(channel.len()).any(|window| window == channel), "{channel:?}");
    }
    let output = run(0, folder.path(), &["render", text(&scene), "-o", "a.png", "--size", "8x8", "--stats", "-"]);
    assert!(output.stdout.starts_with(b"{"), "statistics on stdout");
}
