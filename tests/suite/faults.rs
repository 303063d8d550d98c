//! Files that lead elsewhere, wait or never end; limits of the machine; signals. Oracle: what is said, and what is left
//! behind. Deterministic: where a clock has a part in it, the bound is far from what is measured.

use std::path::{Path, PathBuf};
use std::process::{Child, Output, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::Command;
use pathspace::backend::batch::{RayBlock, RayHitBlock};
use pathspace::backend::past::Past;
use pathspace::backend::{Backend, BackendInfo, Coherence};
use pathspace::film::exr::read_exr;
use pathspace::render::{RenderOptions, StopReason};
use pathspace::scene::{LoadOptions, MissingTexture};
use pathspace::{Renderer, Scene};
use serde_json::json;

use crate::common::{signal, wait_for_samples};
use crate::loading::fixture::{Fixture, write};

/// The scene that the rendering tests use.
fn cornell_box() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.gltf")
}

/// Runs the command; one that takes a minute hangs.
fn run(args: &[&str]) -> Output {
    let mut command = Command::cargo_bin("pathspace").expect("the package has this binary");
    command.args(args).timeout(Duration::from_secs(60)).output().expect("the binary starts")
}

fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn text(path: &Path) -> &str {
    path.to_str().expect("temporary folders have plain names")
}

/// A pipe that nobody writes to, where the system has them.
fn pipe(folder: &Path) -> Option<PathBuf> {
    let path = folder.join("pipe");
    let made = std::process::Command::new("mkfifo").arg(&path).status();
    made.is_ok_and(|status| status.success()).then_some(path)
}

/// Buffers and images come from the scene's folder; `..`, absolute paths and links that leave it are refused by an
/// error that names the way out, which works.
#[test]
fn uris_stay_in_the_folder_of_the_scene() {
    let outer = tempfile::tempdir().expect("a temporary folder");
    let inner = outer.path().join("inner");
    std::fs::create_dir_all(inner.join("deep")).expect("a temporary folder");
    let quad = Fixture::quad();
    let outside = write(outer.path(), "outside.bin", &quad.binary);
    write(&inner, "deep/inside.bin", &quad.binary);
    std::os::unix::fs::symlink(&outside, inner.join("link.bin")).expect("a link");
    let load = |uri: &str, allow_outside: bool| {
        let path = quad.clone().set("/buffers/0/uri", json!(uri)).write(&inner);
        Scene::load_with(path, &LoadOptions::default().allow_outside(allow_outside))
    };
    for uri in ["deep/inside.bin", "deep/../scene.bin", "../inner/scene.bin"] {
        load(uri, false).unwrap_or_else(|error| panic!("{uri}: {error}"));
    }
    for uri in ["../outside.bin", "%2e%2e/outside.bin", "link.bin", text(&outside)] {
        let error = load(uri, false).expect_err("it leads out").to_string();
        assert!(error.contains("/buffers/0/uri") && error.contains("--allow-outside"), "{error}");
        load(uri, true).unwrap_or_else(|error| panic!("{uri}: {error}"));
    }

    // Images: as one that is missing.
    write(outer.path(), "white.png", &image_1x1());
    let textured = quad
        .set("/textures", json!([{"source": 0}]))
        .set("/images", json!([{"uri": "../white.png"}]))
        .set("/materials/0/pbrMetallicRoughness", json!({"baseColorTexture": {"index": 0}}));
    let path = textured.write(&inner);
    let error = Scene::load(&path).expect_err("it leads out").to_string();
    assert!(error.contains("--allow-outside"), "{error}");
    let magenta = LoadOptions::default().missing_texture(MissingTexture::Magenta);
    let scene = Scene::load_with(&path, &magenta).expect("a warning");
    assert!(scene.warnings.iter().any(|warning| warning.what.contains("--allow-outside")), "{:?}", scene.warnings);
    Scene::load_with(&path, &LoadOptions::default().allow_outside(true)).expect("allowed");
}

fn image_1x1() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(1, 1).write_to(&mut bytes, image::ImageFormat::Png).expect("a PNG in memory");
    bytes.into_inner()
}

/// Pipes, and files of `/proc` that look regular and never end, are refused without waiting.
#[test]
fn files_that_wait_or_never_end_are_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let start = Instant::now();
    for endless in ["/proc/self/pagemap", "/proc/kmsg"].into_iter().filter(|path| Path::new(path).exists()) {
        let path = Fixture::quad().set("/buffers/0/uri", json!(endless)).write(folder.path());
        Scene::load_with(&path, &LoadOptions::default().allow_outside(true)).expect_err("no bytes there");
    }
    let Some(pipe) = pipe(folder.path()) else { return };
    let (pipe, scene) = (text(&pipe), cornell_box());
    for args in [
        &["info", pipe][..],
        &["compare", pipe, pipe],
        &["render", pipe, "-o", "/dev/null/a.exr"],
        &["info", text(&scene), "--env", pipe],
    ] {
        let output = run(args);
        assert!(output.status.code().is_some_and(|code| code != 0), "{args:?}: {}", err(&output));
    }
    assert!(start.elapsed() < Duration::from_secs(30), "{:?}", start.elapsed());
}

/// A backend that fails on camera rays that go steeply down: those of the last tiles.
struct Failing<'b>(&'b dyn Backend);

impl Backend for Failing<'_> {
    fn info(&self) -> &BackendInfo {
        self.0.info()
    }

    fn closest_hit(&self, blocks: &mut [RayHitBlock], len: usize, hint: Coherence) -> u64 {
        let down = |i: usize| blocks[i / 16].ray.dir_y[i % 16] < -0.25;
        assert!(hint != Coherence::Coherent || !(0..len).any(down), "a ray went\ndown");
        self.0.closest_hit(blocks, len, hint)
    }

    fn closest_hit_past(&self, blocks: &mut [RayHitBlock], len: usize, past: &Past) -> u64 {
        self.0.closest_hit_past(blocks, len, past)
    }

    fn any_hit(&self, blocks: &mut [RayBlock], len: usize, hint: Coherence) -> u64 {
        self.0.any_hit(blocks, len, hint)
    }
}

/// A worker that fails ends the render within a second: what the others rendered is there, and the sample is named.
#[test]
fn a_worker_that_fails_is_a_result() {
    let scene = Scene::load(cornell_box()).expect("an own scene");
    let renderer = Renderer::new(&scene, RenderOptions::new(64, 64).spp(1 << 20).threads(2)).expect("valid options");
    let start = Instant::now();
    let render = renderer
        .render_through(&Failing(renderer.backend()), |_| std::ops::ControlFlow::Continue(()))
        .expect("failing is a result");
    assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
    let fault = render.fault.expect("a worker failed");
    assert_eq!((render.stop, fault.repeats, fault.problem.as_str()), (StopReason::Fault, true, "a ray went; down"));
    assert!(fault.pixel.1 >= 48, "{fault}");
    let spp = render.film.spp();
    assert!(spp.min == 0 && spp.max > 0, "{spp:?}");
}

/// Starts the command and waits for the first line on stderr that contains `words`.
fn start(args: &[&str], words: &str) -> Child {
    let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin!("pathspace"));
    let mut child = command.args(args).stderr(Stdio::piped()).spawn().expect("the binary starts");
    let lines = std::io::BufRead::lines(std::io::BufReader::new(child.stderr.take().expect("piped")));
    let mut lines = lines.map_while(Result::ok);
    assert!(lines.any(|line| line.contains(words)), "{args:?} did not say {words}");
    // The rest is read until the end, so that nobody waits for a full pipe.
    std::thread::spawn(move || lines.for_each(drop));
    child
}

/// SIGHUP ends a render as SIGTERM does: the picture is written. A folder that vanished meanwhile is made again.
#[test]
fn a_hang_up_and_a_folder_that_vanishes_keep_the_picture() {
    let outer = tempfile::tempdir().expect("a temporary folder");
    let folder = outer.path().join("folder");
    std::fs::create_dir(&folder).expect("a temporary folder");
    let (scene, picture) = (cornell_box(), folder.join("o.exr"));
    let size = ["--width", "64", "--height", "64", "--spp", "1000000000", "--progress", "ndjson", "-q"];
    let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin!("pathspace"));
    command.args(["render", text(&scene), "-o", text(&picture)]).args(size).stdout(Stdio::piped());
    let mut child = command.spawn().expect("the binary starts");
    wait_for_samples(&mut child);
    std::fs::remove_dir_all(&folder).expect("a folder");
    signal(&child, "HUP");
    assert_eq!(child.wait().expect("it ends").code(), Some(129));
    let names: Vec<_> = std::fs::read_dir(&folder).expect("made again").flatten().map(|e| e.file_name()).collect();
    assert_eq!(names, ["o.exr"]);
    assert_eq!(read_exr(&picture).expect("whole").width, 64);
}

/// While a scene is loaded there is nothing to write: a signal ends the process, and an older picture stays.
#[test]
fn a_signal_while_loading_keeps_the_older_picture() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    // Half a million triangles, of 9 MB: a second of work for a machine of any load.
    let (side, mut grid) = (500u32, Fixture::quad());
    let corner = |x: u32, y: u32| [x as f32 / side as f32, y as f32 / side as f32, ((x * y) % 7) as f32 * 1e-4];
    let points: Vec<f32> = (0..=side).flat_map(|y| (0..=side).flat_map(move |x| corner(x, y))).collect();
    let square = |x: u32, y: u32| {
        let at = y * (side + 1) + x;
        [at, at + 1, at + side + 2, at, at + side + 2, at + side + 1]
    };
    let indices: Vec<u8> = (0..side)
        .flat_map(|y| (0..side).flat_map(move |x| square(x, y)))
        .flat_map(|index: u32| index.to_le_bytes())
        .collect();
    let positions = grid.floats(&points, "VEC3");
    let indices = grid.accessor(&indices, 5125, "SCALAR", (6 * side * side) as usize);
    let grid = grid.set("/meshes/0/primitives/0", json!({"attributes": {"POSITION": positions}, "indices": indices}));
    let scene = grid.write(folder.path());
    let picture = write(folder.path(), "o.exr", b"older");
    for (name, code) in [("INT", 130), ("XCPU", 152)] {
        // Where it is served is said behind the handler of signals and before the scene is read.
        let mut child = start(&["render", text(&scene), "-o", text(&picture), "--serve=127.0.0.1:0"], "see it at");
        signal(&child, name);
        assert_eq!(child.wait().expect("it ends").code(), Some(code));
        assert_eq!(std::fs::read(&picture).expect("a file"), b"older");
    }
}

/// What a render writes is none of the files that it reads, and no folder.
#[test]
fn outputs_are_no_inputs() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let image = write(folder.path(), "white.png", &image_1x1());
    let textured = Fixture::quad()
        .set("/textures", json!([{"source": 0}]))
        .set("/images", json!([{"uri": "white.png"}]))
        .set("/materials/0/pbrMetallicRoughness", json!({"baseColorTexture": {"index": 0}}));
    let scene = textured.write(folder.path());
    let picture = folder.path().join("o.exr");
    let output = run(&["render", text(&scene), "-o", text(&picture), "--png", text(&image), "--spp", "1"]);
    assert_eq!(output.status.code(), Some(2), "{}", err(&output));
    assert!(err(&output).contains("also read"), "{}", err(&output));
    assert_eq!(std::fs::read(&image).expect("a file"), image_1x1());
    let slash = format!("{}/", picture.display());
    let output = run(&["render", text(&scene), "-o", &slash, "--spp", "1"]);
    assert_eq!(output.status.code(), Some(1), "{}", err(&output));
    assert!(!err(&output).contains("wrote"), "{}", err(&output));
}

/// Names from files reach the terminal without what would move its cursor, on one line.
#[test]
fn names_are_printed_as_text() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let hostile = "a\u{1b}]0;b\u{7}\u{9b}2J\u{202e}\nbackend fake";
    let scene = Fixture::quad()
        .set("/cameras/0/name", json!(hostile))
        .set("/materials/0/name", json!(hostile))
        .set("/materials/0/extensions", json!({"KHR_materials_ior": {"ior": 1e9}}))
        .set("/animations", json!([{"name": hostile, "channels": [], "samplers": []}]))
        .set("/meshes/0/name", json!(hostile))
        .set("/nodes/1/name", json!(hostile))
        .write(folder.path());
    let scene = text(&scene);
    let size = ["--width", "4", "--height", "4", "--spp", "1"];
    for args in [
        &["info", scene][..],
        &["render", scene, "--pixel", "2,2", "--sample", "0", "--width", "4", "--height", "4"],
        &[&["render", scene, "-v", "-o", text(&folder.path().join("o.exr"))][..], &size].concat(),
    ] {
        let output = run(args);
        let all = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        assert_eq!(output.status.code(), Some(0), "{args:?}: {all}");
        assert!(!all.contains(['\u{1b}', '\u{7}', '\u{9b}', '\u{202e}']), "{args:?}: {}", all.escape_debug());
        assert!(!all.lines().any(|line| line.starts_with("backend fake")), "{args:?}: {all}");
    }
}

/// A render that fails leaves no statistics of an earlier one; a reference without numbers is refused.
#[test]
fn records_are_of_this_render() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (scene, stats) = (cornell_box(), write(folder.path(), "s.json", br#"{"schema":1}"#));
    let broken = write(folder.path(), "broken.gltf", b"{}");
    let picture = folder.path().join("o.exr");
    let output = run(&["render", text(&broken), "-o", text(&picture), "--stats", text(&stats)]);
    assert!(output.status.code() == Some(4) && !stats.exists(), "{}", err(&output));
    // What is no such record stays, although it bears the name.
    let image = write(folder.path(), "white.json", &image_1x1());
    let textured = Fixture::quad()
        .set("/textures", json!([{"source": 0}]))
        .set("/images", json!([{"uri": "white.json"}]))
        .set("/materials/0/pbrMetallicRoughness", json!({"baseColorTexture": {"index": 0}}));
    let textured = textured.write(folder.path());
    let args = ["render", text(&textured), "-o", text(&picture), "--stats", text(&image), "--spp", "1"];
    let output = run(&args);
    assert_eq!(output.status.code(), Some(2), "{}", err(&output));
    assert_eq!(std::fs::read(&image).expect("a file"), image_1x1());

    let reference = folder.path().join("nan.exr");
    let mut film = pathspace::film::Film::new((8, 8), pathspace::render::Crop { x: 0, y: 0, width: 8, height: 8 });
    for pixel in &mut film.pixels {
        pixel.add(0, [1.0; 3], 1.0, 1.0);
    }
    film.pixels[9].sum[0][1] = f64::NAN;
    film.write_exr(&reference, &pathspace::film::exr::ExrOptions::default()).expect("a writable folder");
    let log = folder.path().join("log.csv");
    let options = ["--width", "8", "--height", "8", "--spp", "1", "--error-log", text(&log)];
    let args = [&["render", text(&scene), "-o", text(&picture), "--reference", text(&reference)][..], &options];
    let output = run(&args.concat());
    assert_eq!(output.status.code(), Some(2), "{}", err(&output));
    assert!(err(&output).contains("1 of its pixels are not finite"), "{}", err(&output));
}

/// Absurd numbers are refused or made sensible at once, and variables that nobody documents change nothing.
#[test]
fn absurd_numbers_are_answered_at_once() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (scene, picture) = (cornell_box(), folder.path().join("o.exr"));
    let (scene, begin) = (text(&scene), Instant::now());
    for args in [
        &["bench", scene, "--spp", "18446744073709551615"][..],
        &["verify", scene, "--spp", "18446744073709551615"],
        &["render", scene, "--pixel", "1,1", "--spp", "1000000000000"],
    ] {
        let output = run(args);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", err(&output));
    }
    let small = ["--width", "16", "--height", "16", "--spp", "1", "--backend", "obvhs", "-o", text(&picture)];
    let args = [&["render", scene, "-t", "4096"][..], &small].concat();
    let output = run(&args);
    assert!(output.status.success() && err(&output).contains("--threads 4096"), "{}", err(&output));
    let mut command = Command::cargo_bin("pathspace").expect("the package has this binary");
    for name in ["RAYON_NUM_THREADS", "RAYON_RS_NUM_CPUS", "OPENIMAGEIO_THREADS", "CUE_THREADS", "OIIO_THREADS"] {
        command.env(name, "100000");
    }
    let args = [&["render", scene][..], &small].concat();
    command.env("RUST_MIN_STACK", "1").args(args).timeout(Duration::from_secs(30)).assert().success();
    assert!(begin.elapsed() < Duration::from_secs(40), "{:?}", begin.elapsed());
}

/// `--time` bounds checks, replays and benchmarks, whatever else is asked for; what they did then is in their records.
/// Whether the check agrees is not judged here: its samples depend on the clock.
#[test]
fn time_bounds_checks_and_benchmarks() {
    let (scene, begin) = (cornell_box(), Instant::now());
    let verify = |args: &[&str]| run(&[&["verify", text(&scene), "--json", "--width", "8"], args].concat());
    let record = |output: &Output| serde_json::from_slice::<serde_json::Value>(&output.stdout).expect("a record");
    // A machine that is slow or busy solves nothing in 2 s.
    let within = |time: &&str| verify(&["--patches", "16", "--spp", "16777216", "--time", time]);
    let output = ["2s", "6s", "18s"].iter().map(within).find(|output| output.status.code() != Some(2));
    let output = output.expect("342 patches are solved in 18 s");
    assert!(matches!(output.status.code(), Some(0 | 3)), "{}", err(&output));
    let spp = record(&output)["spp"].as_u64().expect("a number");
    assert!((2..16_777_216).contains(&spp), "{spp}");
    let output = verify(&["--patches", "4000", "--time", "10ms"]);
    assert_eq!(output.status.code(), Some(2), "{}", err(&output));
    assert!(err(&output).contains("--time") && err(&output).contains("--patches"), "{}", err(&output));

    let output = run(&["render", text(&scene), "--pixel", "9,9", "--json", "-q", "--time", "1s"]);
    assert!(output.status.success(), "{}", err(&output));
    let samples = record(&output)["samples"].as_array().expect("a list").len();
    assert!((1..1 << 22).contains(&samples), "{samples}");

    let args = ["--json", "-q", "--width", "100", "--spp", "65536", "--pairs", "1000", "--time", "2s"];
    let output = run(&[&["bench", text(&scene)][..], &args].concat());
    assert!(output.status.success(), "{}", err(&output));
    let frame = record(&output)["frame"].clone();
    let [spp, pairs] = ["spp", "pairs"].map(|name| frame[name].as_u64().expect("a number"));
    assert!((1..65_536).contains(&spp) && (1..1000).contains(&pairs), "{frame}");
    assert!(begin.elapsed() < Duration::from_secs(200), "{:?}", begin.elapsed());
}

/// What a render takes is known before it is taken: what `-v` and the statistics state is what the process then held,
/// and what does not fit is refused by one line with the numbers. Oracle: the system's count of resident bytes.
#[test]
fn memory_is_known_before_it_is_taken() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (scene, picture, stats) = (cornell_box(), folder.path().join("o.exr"), folder.path().join("s.json"));
    let (scene, files) = (text(&scene), ["-o", text(&picture), "--stats", text(&stats), "-v", "--spp", "1", "-t", "2"]);
    // Of the small picture most is the program, and what surveys leave.
    for side in ["1000", "100"] {
        let output = run(&[&["render", scene, "--width", side, "--height", side, "--aov", "Z"][..], &files].concat());
        assert!(err(&output).contains("memory      "), "{}", err(&output));
        let record: serde_json::Value =
            serde_json::from_slice(&std::fs::read(&stats).expect("written")).expect("valid JSON");
        let [need, peak] = ["memory_need_bytes", "peak_rss_bytes"].map(|key| record[key].as_f64().expect("a count"));
        assert!((need / peak - 1.0).abs() < 0.1, "{side}: {need} bytes expected, {peak} taken");
    }

    let limited = |megabytes: u32, args: &[&str]| {
        let script = format!("ulimit -v {}; exec \"$@\"", megabytes << 10);
        let binary = assert_cmd::cargo::cargo_bin!("pathspace");
        let mut command = Command::new("sh");
        command.args(["-c", &script, "sh", text(binary)]).args(args).env_remove("RUST_BACKTRACE");
        command.timeout(Duration::from_secs(60)).output().expect("a shell")
    };
    let large = [&["render", scene, "--width", "8000", "--height", "8000"][..], &files].concat();
    let output = limited(1500, &large);
    let told = err(&output);
    let refusals: Vec<&str> = told.lines().filter(|line| line.contains("error")).collect();
    assert_eq!((output.status.code(), refusals.len()), (Some(2), 1), "{told}");
    assert!(refusals[0].contains("ulimit -v") && refusals[0].contains("--crop"), "{told}");
}
