//! What a command says, and what it must not keep silent: files that could not be written, states that have all
//! already, frames that are there. Oracle: the command line's contract. Deterministic.

use std::path::Path;
use std::process::{Command, Stdio};

use pathspace::render::checkpoint::Checkpoint;
use pathspace::scene::{LoadOptions, MissingTexture, Scene};
use serde_json::json;

use crate::common::{signal, wait_for_samples};
use crate::loading::fixture::Fixture;

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.gltf");

fn pathspace(folder: &Path, args: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pathspace"));
    command.args(args.split(' ')).current_dir(folder).env_remove("SLURM_CPUS_PER_TASK").env("TMPDIR", folder);
    command
}

/// Runs with exit code `code`; what was said, without steps of a machine that is busy.
fn run(code: i32, folder: &Path, args: &str) -> String {
    let output = pathspace(folder, args).output().expect("the binary starts");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{args}\n{said}");
    let step = |line: &&str| line.contains(" … ") || line.contains(" %  ");
    said.lines().filter(|line| !step(line)).map(|line| format!("{line}\n")).collect()
}

fn render(args: &str) -> String {
    format!("render {SCENE} --size 16x12 {args}")
}

/// Each file that cannot be written is named, in the order of writing, and those behind it are written all the same.
#[test]
fn every_file_that_is_not_written_is_told() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    std::fs::create_dir(folder.join("gone")).expect("a folder");
    let files = "-o gone/a.exr --png b.png --stats gone/c.json --report gone/d.html --checkpoint 1h gone/e.checkpoint";
    let args = render(&format!("-q --spp 1000000000 --progress ndjson {files}"));
    let mut child =
        pathspace(folder, &args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the binary starts");
    wait_for_samples(&mut child);
    // A file in the place of the folder: it cannot be made again.
    std::fs::remove_dir(folder.join("gone")).expect("an empty folder");
    std::fs::write(folder.join("gone"), "").expect("a writable folder");
    signal(&child, "INT");
    let output = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    let lines: Vec<&str> = said.lines().collect();
    let named = ["gone/e.checkpoint", "gone/a.exr", "gone/c.json", "gone/d.html"];
    assert!(lines.len() == named.len() && lines.iter().zip(named).all(|(line, name)| line.contains(name)), "{said}");
    assert!(folder.join("b.png").is_file(), "what can be written is");
}

/// A state that is gone on with is saved where it was; one that has all is said to.
#[test]
fn states_are_kept_where_they_were() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let spp = || Checkpoint::restore(folder.join("a.checkpoint")).expect("saved").render.film.spp().min;
    let said = run(0, folder, &render("-o a.exr --spp 2 --checkpoint 1h --stats a.json"));
    assert!(said.starts_with("wrote a.exr, a.json, a.checkpoint (16x12, 2 spp)"), "{said}");
    run(0, folder, &render("-o a.exr --spp 4 --resume a.checkpoint"));
    assert_eq!(spp(), 4);
    let said = run(0, folder, &render("-o b.exr --spp 3 --resume a.checkpoint"));
    let told =
        "a.checkpoint has 4 samples per pixel already, more than the 3 asked for: its picture is written as it is";
    assert!(said.lines().next() == Some(told) && said.contains("wrote b.exr, a.checkpoint"), "{said}");
    assert_eq!(spp(), 4);
    let said = run(0, folder, &render("-o b.exr --resume a.checkpoint"));
    assert!(said.starts_with("a.checkpoint has 4 samples per pixel already: its picture"), "{said}");
}

#[test]
fn parts_and_frames_are_told() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let said = run(0, folder, &render("--sample-range 2..4 --checkpoint p.part"));
    assert!(said.starts_with("wrote p.part (16x12, samples 2..4): ") && said.lines().count() == 1, "{said}");
    let said = run(1, folder, &format!("merge p.part {SCENE} -o m.exr"));
    assert!(said.contains("scene.gltf: cannot restore: expected a saved state, found JSON"), "{said}");

    let frames = render("--spp 1 --turntable 2 --fixed-seed -o f.exr");
    run(0, folder, &frames);
    let said = run(0, folder, &format!("{frames} --skip-existing"));
    assert_eq!(said, "2 frames are there already\n");
    std::fs::remove_file(folder.join("f.0001.exr")).expect("written");
    let said = run(0, folder, &format!("{frames} --skip-existing"));
    assert!(said.starts_with("frame 1 (1 of 2)\n") && said.ends_with("\n1 frame is there already\n"), "{said}");
}

/// Scenes without a light, of several animations, and of nothing.
#[test]
fn scenes_are_told_in_a_sentence() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let mut quad = Fixture::quad();
    let (keys, values) = (quad.floats(&[0.0, 1.0], "SCALAR"), quad.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], "VEC3"));
    let animation = |name: &str| {
        let target = json!({"node": 0, "path": "translation"});
        json!({"name": name, "samplers": [{"input": keys, "output": values}],
            "channels": [{"sampler": 0, "target": target}]})
    };
    let quad = quad.set("/animations", json!([animation("walk"), animation("run")]));
    quad.write(folder);
    let said = run(0, folder, "scene.gltf --size 8x8 -s 1");
    assert!(
        said.contains("lit by the studio") && said.contains("--animation NAME by one of its 2 animations"),
        "{said}"
    );
    let said = run(0, folder, "render scene.gltf --size 8x8 -s 1 --at 0.5");
    assert!(said.contains("of which animation 'walk' runs; --animation NAME runs another"), "{said}");
    assert!(!run(0, folder, "render scene.gltf --size 8x8 -s 1 --at 0.5 --animation run").contains("/animations"));

    std::fs::write(folder.join("empty.glb"), "").expect("a writable folder");
    assert!(run(4, folder, "empty.glb").contains("found an empty file"));
    std::fs::write(folder.join("bare.gltf"), r#"{"asset": {"version": "2.0"}}"#).expect("a writable folder");
    assert!(run(4, folder, "bare.gltf").contains("found none: there is nothing to render"));
    assert!(run(2, folder, &render("--spp 0")).contains("write 1 or more"));
}

/// A mesh without texture coordinates shows no texture, not even one of a single colour.
#[test]
fn textures_without_coordinates_are_ignored() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let textured = |quad: Fixture| {
        quad.set("/images", json!([{"uri": "missing.png"}]))
            .set("/textures", json!([{"source": 0}]))
            .set("/materials/0/pbrMetallicRoughness", json!({"baseColorTexture": {"index": 0}}))
    };
    let load = |quad: &Fixture| {
        let options = LoadOptions::default().missing_texture(MissingTexture::Magenta);
        Scene::load_with(quad.write(folder.path()), &options).expect("a warning")
    };
    let red_and_green = |scene: &Scene| scene.materials[0].base_color.truncate().to_array();
    let mut quad = textured(Fixture::quad());
    assert_eq!(red_and_green(&load(&quad)), [1.0, 0.0], "magenta where it is read");
    let attributes = quad.json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().expect("an object");
    attributes.remove("TEXCOORD_0");
    let scene = load(&quad);
    assert_eq!(red_and_green(&scene), [1.0, 1.0]);
    let told = |what: &str| scene.warnings.iter().any(|warning| warning.what.contains(what));
    assert!(told("has no TEXCOORD_0") && told("are ignored"), "{:?}", scene.warnings);
}

/// On a terminal, which `script` makes, the picture is drawn; elsewhere `--show` is refused before the work.
#[test]
fn a_picture_is_drawn_in_a_terminal_alone() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let args = render("--spp 1 -o a.exr --show");
    assert!(run(2, folder.path(), &args).contains("--show: stdout is no terminal"));
    let program = env!("CARGO_BIN_EXE_pathspace");
    let line = format!("stty cols 40 rows 20; '{program}' {args}");
    let script = Command::new("script").args(["-qec", &line, "/dev/null"]).current_dir(folder.path()).output();
    let Ok(drawn) = script else {
        eprintln!("SKIPPED a_picture_is_drawn_in_a_terminal_alone: there is no `script`");
        return;
    };
    let drawn = String::from_utf8_lossy(&drawn.stdout).into_owned();
    assert_eq!(drawn.matches('▀').count(), 16 * 6, "{drawn}");
    assert!(drawn.contains("\x1b[38;2;") && drawn.contains("wrote a.exr"), "{drawn}");
}
