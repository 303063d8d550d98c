//! The built binary as a stranger uses it: exit codes, messages, files. Oracle: the command line's contract. All
//! deterministic.

use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use pathspace::film::Film;
use pathspace::film::exr::{ExrOptions, read_exr};
use pathspace::render::Crop;

fn pathspace(args: &[&str]) -> Command {
    let mut command = Command::cargo_bin("pathspace").expect("the package has this binary");
    command.args(args).env_remove("SLURM_CPUS_PER_TASK");
    command
}

/// Runs and expects an exit code; returns what was printed.
fn run(code: i32, args: &[&str]) -> Output {
    let output = pathspace(args).output().expect("the binary starts");
    assert_eq!(output.status.code(), Some(code), "{args:?}\nstdout: {}\nstderr: {}", out(&output), err(&output));
    output
}

fn out(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn text(path: &Path) -> &str {
    path.to_str().expect("temporary folders have plain names")
}

fn json(bytes: &[u8]) -> serde_json::Value {
    serde_json::from_slice(bytes).expect("valid JSON")
}

fn keys(value: &serde_json::Value) -> Vec<String> {
    value.as_object().expect("an object").keys().cloned().collect()
}

/// The scene that the rendering tests use.
fn cornell_box() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.gltf")
}

/// An EXR of `width × height` pixels of grey `value`, except the first pixel, which is `first`.
fn write_grey(path: &Path, size: (u32, u32), value: f32, first: f32) {
    let window = Crop { x: 0, y: 0, width: size.0, height: size.1 };
    let mut film = Film::new(size, window);
    for (i, pixel) in film.pixels.iter_mut().enumerate() {
        pixel.add(0, [if i == 0 { first } else { value }; 3], 1.0, 1.0);
    }
    film.write_exr(path, &ExrOptions::default()).expect("a writable folder");
}

#[test]
fn help_and_version_go_to_stdout() {
    let help = out(&run(0, &["--help"]));
    for word in ["render", "info", "compare", "verify", "doctor", "Exit codes", "128+n"] {
        assert!(help.contains(word), "{word} is missing in:\n{help}");
    }
    assert_eq!(out(&run(0, &["--version"])), format!("pathspace {}\n", env!("CARGO_PKG_VERSION")));
    let help = out(&run(0, &["render", "--help"]));
    let headings =
        ["Output:", "Stopping:", "Picture:", "Camera:", "Environment:", "Light transport:", "Machine:", "Reporting:"];
    let flags = [
        "--output",
        "--png",
        "--jpg",
        "--exposure",
        "--tone-map",
        "--transparent",
        "--background",
        "--size",
        "--fov",
        "--look-at",
        "--camera-orbit",
        "--make-path",
        "--quick",
        "--aov",
        "--reproducible",
        "--stats",
        "--spp",
        "--samples",
        "--time",
        "--error",
        "--min-spp",
        "--width",
        "--height",
        "--crop",
        "--filter",
        "--camera",
        "--aperture-radius",
        "--focus-distance",
        "--env",
        "--env-rotation",
        "--env-intensity",
        "--max-depth",
        "--roulette",
        "--strategy",
        "--sampler",
        "--seed",
        "--threads",
        "--backend",
        "--rays",
        "--isa",
        "--progress",
        "--quiet",
        "--verbose",
    ];
    for word in headings.iter().chain(&flags) {
        assert!(help.contains(word), "{word} is missing in:\n{help}");
    }
    // No colour where no terminal is.
    assert!(!help.contains('\x1b'));
}

#[test]
fn usage_errors_exit_2_and_name_the_option() {
    let cases: [(&[&str], &str); 36] = [
        (&[], "Usage"),
        (&["paint"], "paint"),
        (&["render"], "SCENE"),
        (&["render", "a.gltf", "-o", "a.gif"], "--output"),
        (&["render", "a.gltf", "-o", "a.exr", "--error", "5"], "5% or 0.05"),
        (&["render", "a.gltf", "-o", "a.exr", "--width", "512x512"], "--size 512x512"),
        (&["render", "a.gltf", "-o", "a.exr", "--size", "512"], "1920x1080"),
        (&["render", "a.gltf", "-o", "a.exr", "--size", "5x5", "--width", "5"], "--width"),
        (&["render", "a.gltf", "-o", "a.exr", "--texture-memory", "4 parsecs"], "4G"),
        (&["render", "a.gltf", "-o", "a.exr", "--fov", "180"], "--fov"),
        (&["render", "a.gltf", "-o", "a.exr", "--camera-orbit", "30"], "AZ,EL"),
        (&["render", "a.gltf", "-o", "f_%04d.exr"], "pattern"),
        (&["render", "a.gltf", "-o", "a.exr", "--env", "b.gltf"], "b.gltf is a scene"),
        (&["render", "a.gltf", "-o", "a.jpg", "--transparent"], "JPEG has no transparency"),
        (&["render", "a.gltf", "-o", "-", "--stats", "-"], "stdout"),
        (&["render", "a.gltf", "-o", "a.exr", "--time", "soon"], "--time"),
        (&["render", "a.gltf", "-o", "a.exr", "--error", "-1"], "--error"),
        (&["render", "a.gltf", "-o", "a.exr", "--crop", "10x10"], "--crop"),
        (&["render", "a.gltf", "-o", "a.exr", "--spp", "0"], "--spp"),
        (&["render", "a.gltf", "-o", "a.exr", "--width", "0"], "--width"),
        (&["render", "a.gltf", "-o", "a.exr", "--filter", "lanczos"], "blackman-harris"),
        (&["render", "a.gltf", "-o", "a.exr", "--aov", "colour"], "bounces"),
        (&["render", "a.gltf", "-o", "a.png", "--aov", "spp"], "--aov"),
        (&["render", "a.gltf", "-o", "a.exr", "--aov", "spp,stderr,spp"], "--aov: 'spp'"),
        (&["render", "a.gltf", "-o", "a.exr", "--aperture-radius", "0.1"], "--focus-distance"),
        (&["render", "a.gltf", "-o", "a.exr", "--env-rotation", "90"], "--env"),
        (&["render", "a.gltf", "-o", "a.exr", "--aperture-radius", "-1", "--focus-distance", "1"], "--aperture-radius"),
        (&["render", "a.gltf", "-o", "a.exr", "--stats", "a.gltf"], "--stats"),
        (&["render", "a.gltf", "-o", "a.png", "--png", "./a.png"], "two outputs"),
        (&["render", "a.gltf", "-o", "a.exr", "--isa", "mmx"], "sse4.2"),
        (&["render", "a.gltf", "-o", "a.exr", "--isa", "sse2", "--backend", "obvhs"], "--isa: backend 'obvhs'"),
        (&["render", "a.gltf", "-o", "a.exr", "--isa", "avx2", "--backend", "brute"], "--isa: backend 'brute'"),
        (&["render", "a.gltf", "-o", "a.exr", "--reference", "b.exr"], "--error-log"),
        (&["render", "a.gltf", "-o", "a.exr", "--error-log", "b.csv"], "--reference"),
        (&["render", "a.gltf", "-o", "a.exr", "--reference", "b.exr", "--error-log", "b.txt"], ".csv"),
        (&["info", "a.gltf", "--env-intensity", "2"], "--env"),
    ];
    // Outputs are named without a folder: run where they could be written.
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (args, word) in cases {
        let output = pathspace(args).current_dir(folder.path()).output().expect("the binary starts");
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", err(&output));
        assert!(err(&output).contains(word), "{args:?}: {word} is missing in: {}", err(&output));
        assert!(out(&output).is_empty(), "{args:?}: {}", out(&output));
    }
}

/// What only the scene can tell to be wrong, and what would destroy an input or exhaust the memory.
#[test]
fn hostile_renders_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (exr, env) = (folder.path().join("a.exr"), folder.path().join("env.exr"));
    write_grey(&env, (4, 2), 1.0, 1.0);
    let before = std::fs::read(&env).expect("just written");
    let same = folder.path().join("./env.exr");
    let (exr, env, same) = (text(&exr), text(&env), text(&same));
    let log = folder.path().join("run.csv");
    let log = text(&log);
    let cases: [(&str, &[&str], &str); 8] = [
        (exr, &["--camera", "nosuch"], "--camera"),
        (exr, &["--camera", "7"], "--camera"),
        (exr, &["--width", "16", "--crop", "8x8+12+0"], "--crop"),
        (exr, &["--width", "65536"], "--width"),
        (env, &["--env", env], "--output"),
        (same, &["--env", env], "--output"),
        (exr, &["--width", "16", "--reference", env, "--error-log", log], "--reference"),
        (env, &["--width", "16", "--reference", env, "--error-log", log], "--output"),
    ];
    for (output, more, word) in cases {
        let scene = cornell_box();
        let output = run(2, &[&["render", text(&scene), "-o", output], more].concat());
        assert!(err(&output).contains(word) && err(&output).lines().count() == 1, "{more:?}: {}", err(&output));
    }
    assert_eq!(std::fs::read(env).expect("still there"), before);
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1);
}

#[test]
fn missing_files_and_folders_exit_1_and_are_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let picture = folder.path().join("a.exr");
    let output = run(1, &["render", "no-such-scene.gltf", "-o", text(&picture)]);
    assert!(err(&output).contains("no-such-scene.gltf"), "{}", err(&output));
    assert!(out(&output).is_empty() && std::fs::read_dir(folder.path()).expect("a folder").count() == 0);

    // The output's folder is looked at before the scene.
    let missing = folder.path().join("missing/a.exr");
    let output = run(1, &["render", "no-such-scene.gltf", "-o", text(&missing)]);
    assert!(err(&output).contains("missing") && err(&output).contains("--make-path"), "{}", err(&output));

    let output = run(1, &["info", "no-such-scene.glb"]);
    assert!(err(&output).contains("no-such-scene.glb") && err(&output).lines().count() == 1, "{}", err(&output));
    assert_eq!(err(&output).matches("os error 2").count(), 1, "the cause is said once: {}", err(&output));

    let picture_folder = folder.path().join("folder.exr");
    std::fs::create_dir(&picture_folder).expect("a writable folder");
    let output = run(1, &["render", "no-such-scene.gltf", "-o", text(&picture_folder)]);
    assert!(err(&output).contains("folder.exr: cannot write: it is a folder\n"), "{}", err(&output));

    let output = run(1, &["render", "no-such-scene.gltf", "-o", text(&picture), "--progress", "ndjson"]);
    let line = json(&output.stdout);
    assert_eq!((line["type"].as_str(), line["exit"].as_u64()), (Some("failed"), Some(1)));
}

#[test]
fn compare_has_the_exit_codes_of_idiff() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name);
    let (a, b, small, broken) = (path("a.exr"), path("b.exr"), path("small.exr"), path("broken.exr"));
    write_grey(&a, (20, 5), 0.5, 0.5);
    write_grey(&b, (20, 5), 0.5, 0.75);
    write_grey(&small, (5, 20), 0.5, 0.5);
    std::fs::write(&broken, b"not an image").expect("a writable folder");
    let (a, b) = (text(&a), text(&b));

    let output = run(0, &["compare", a, a]);
    assert!(out(&output).contains("verdict         ok"), "{}", out(&output));
    run(2, &["compare", a, b]);
    // One of 100 pixels differs by 0.25: within --fail it only warns; within --warn too it is fine.
    run(1, &["compare", a, b, "--fail", "0.3"]);
    run(0, &["compare", a, b, "--fail", "0.3", "--warn", "0.3"]);
    run(1, &["compare", a, b, "--failpercent", "1"]);
    run(2, &["compare", a, b, "--failpercent", "0.5"]);
    run(2, &["compare", a, b, "--failpercent", "1", "--hardfail", "0.2"]);
    run(3, &["compare", a, text(&small)]);
    let output = run(4, &["compare", a, text(&broken)]);
    assert!(err(&output).contains("broken.exr") && out(&output).is_empty());
    run(4, &["compare", a, "no-such-image.exr"]);
    // Where the difference cannot be written there is no verdict.
    run(4, &["compare", a, b, "-o", "no-such-folder/difference.png"]);

    // A picture of the difference: all black but for the pixel that is off by half of what is there, which is yellow.
    let drawn = path("diff.png");
    run(2, &["compare", b, a, "-o", text(&drawn)]);
    assert!(std::fs::read(&drawn).expect("drawn").starts_with(b"\x89PNG"));
    let output = run(4, &["compare", a, "seen.png"]);
    assert!(err(&output).contains("only OpenEXR"), "{}", err(&output));

    // By hand: (I − R)² = 1/16 in one of 100 pixels, R = 0.5 there.
    let record = json(&run(2, &["compare", b, a, "--json"]).stdout);
    let number = |key: &str| record[key].as_f64().unwrap_or(f64::NAN);
    assert!((number("mse") - 1.0 / 1600.0).abs() < 1e-9);
    assert!((number("epsilon") - 0.0025).abs() < 1e-9);
    assert!((number("relmse") - 1.0 / 1600.0 / 0.2525).abs() < 1e-9);
    assert!((record["mean_ratio"][1].as_f64().unwrap_or(f64::NAN) - 1.005).abs() < 1e-6);
    assert!(number("flip") > 0.0 && number("flip") < 0.1, "{record}");
    assert_eq!(keys(&record)[..6], ["mse", "relmse", "relmse_trimmed", "epsilon", "flip", "mean_ratio"]);
}

#[test]
fn doctor_says_what_is_there_and_what_to_install() {
    let text = out(&run(0, &["doctor"]));
    for word in ["embree", "obvhs", "brute", "threads", "features", "libembree-dev", "ready to render"] {
        assert!(text.contains(word), "{word} is missing in:\n{text}");
    }
}

#[test]
fn info_prints_the_plan_as_json_with_the_contracted_keys() {
    let scene = cornell_box();
    let record = json(&run(0, &["info", text(&scene), "--json"]).stdout);
    assert_eq!(keys(&record)[..6], ["scene", "effects", "stages", "rays", "wave", "bias"]);
    assert_eq!(keys(&record["effects"]), ["found", "simulated", "ignored"]);
    assert_eq!(keys(&record["rays"]), ["camera", "bounce", "shadow"]);
    assert!(record["scene"]["triangles"].as_u64().is_some_and(|n| n > 30), "{record}");
    // An environment is one more light.
    let folder = tempfile::tempdir().expect("a temporary folder");
    let env = folder.path().join("env.exr");
    write_grey(&env, (4, 2), 1.0, 1.0);
    let more = ["info", text(&scene), "--json", "--env", text(&env), "--env-rotation", "-90", "--env-intensity", "2"];
    let lit = json(&run(0, &more).stdout);
    let lights = |record: &serde_json::Value| record["scene"]["lights"].as_u64().expect("a count");
    assert_eq!(lights(&lit), lights(&record) + 1, "{lit}");
    // What an artist asks first, and the machine's part with -v.
    let plain = out(&run(0, &["info", text(&scene)]));
    let words: Vec<_> = plain.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert_eq!(words[..4], ["scene", "size", "cameras", "picture"], "{plain}");
    // On a busy machine the pilot may see too little to predict from, and says so.
    assert!(plain.contains("\ntime ") && plain.contains("triangles") && !plain.contains("stages"), "{plain}");
    let whole = out(&run(0, &["info", text(&scene), "-v", "--width", "64", "--max-depth", "3"]));
    assert!(whole.contains("stages") && whole.contains("64x64"), "{whole}");
}

#[test]
fn verify_prints_a_table_or_json_and_refuses_by_material() {
    let scene = cornell_box();
    let small = ["--patches", "200", "--spp", "32", "--width", "16"];
    let table = out(&run(0, &[&["verify", text(&scene)], &small[..]].concat()));
    for word in ["bounce_00", "bounce_tail", "spectral radius", "depth limit 64", "all 80 terms agree"] {
        assert!(table.contains(word), "{word} is missing in:\n{table}");
    }
    let record = json(&run(0, &[&["verify", text(&scene), "--json"], &small[..]].concat()).stdout);
    assert_eq!(record["agrees"].as_bool(), Some(true));
    assert_eq!(record["terms"].as_array().map(Vec::len), Some(80));
    assert_eq!(record["terms"][3]["length"].as_str(), Some("bounce_03"));

    let glass = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/glass-caustics/scene.gltf");
    let output = run(4, &["verify", text(&glass)]);
    assert!(err(&output).contains("/materials/") && err(&output).contains("Lambert"), "{}", err(&output));
    let lines = err(&output).lines().filter(|line| !line.starts_with("loading")).count();
    assert!(out(&output).is_empty() && lines == 1, "{}", err(&output));
}

/// Oracle: the other file. With the clock in it a file differs in the clock alone, so attributes are in a fixed order.
#[test]
fn reproducible_renders_are_equal_files() {
    let scene = cornell_box();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str, more: &[&str]| {
        let exr = folder.path().join(name);
        let mut args = vec!["render", text(&scene), "-o", text(&exr), "--width", "40", "--height", "24", "--spp", "3"];
        let layers = pathspace::plan::Aov::all().map(pathspace::plan::Aov::name).collect::<Vec<_>>().join(",");
        args.extend(["--aov", &layers, "--backend", "flat"]);
        args.extend(more);
        run(0, &args);
        std::fs::read(&exr).expect("just written")
    };
    let one = file("a.exr", &["--reproducible", "-t", "1"]);
    assert!(one == file("b.exr", &["--reproducible", "-t", "2"]), "the files differ");
    assert!(!one.windows(17).any(|bytes| bytes == b"renderTimeSeconds"));
    let [mut c, mut d] = ["c.exr", "d.exr"].map(|name| file(name, &[]));
    for bytes in [&mut c, &mut d] {
        let key: &[u8] = b"renderTimeSeconds\0float\0\x04\0\0\0";
        let at = bytes.windows(key.len()).position(|bytes| bytes == key).expect("the clock is in it") + key.len();
        bytes[at..at + 4].fill(0);
    }
    assert!(c == d, "the files differ in more than the clock");
    let output = run(2, &["render", text(&scene), "-o", "a.png", "--reproducible"]);
    assert!(err(&output).contains("--reproducible"), "{}", err(&output));
}

#[test]
fn a_render_writes_picture_preview_and_statistics() {
    let scene = cornell_box();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name);
    let (exr, png, stats) = (path("a.exr"), path("a.png"), path("a.json"));
    let mut args = vec!["render", text(&scene), "-o", text(&exr), "--png", text(&png), "--stats", text(&stats)];
    args.extend(["--width", "32", "--crop", "16x8+4+20", "--spp", "4", "--aov", "variance,spp", "--seed", "7"]);
    let output = run(0, &args);
    assert!(out(&output).is_empty(), "{}", out(&output));
    assert!(err(&output).contains("wrote ") && err(&output).contains(text(&exr)), "{}", err(&output));
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 3);

    let picture = read_exr(&exr).expect("just written");
    assert_eq!((picture.display, picture.position), ((32, 32), (4, 20)));
    assert_eq!((picture.width, picture.height), (16, 8));
    assert!(picture.rgb.iter().flatten().any(|v| *v > 0.0));

    let record = json(&std::fs::read(&stats).expect("just written"));
    let expected = [
        "schema",
        "command",
        "scene",
        "seconds",
        "resolution",
        "spp",
        "seed",
        "threads",
        "paths",
        "rays",
        "mpaths_per_s",
        "mrays_per_s",
        "peak_rss_bytes",
        "nonfinite",
        "stop",
        "backend",
        "effects",
        "bias",
        "error",
    ];
    assert_eq!(keys(&record)[..expected.len()], expected);
    assert_eq!(keys(&record["scene"]), ["file", "triangles", "instances", "materials", "lights", "textures"]);
    assert_eq!(keys(&record["seconds"]), ["load", "build", "render", "write", "total"]);
    assert_eq!(keys(&record["backend"])[..4], ["name", "version", "isa", "rays"]);
    assert_eq!(keys(&record["error"])[..3], ["relmse", "stderr_mean", "confidence"]);
    let tail = ["verdict", "k", "k_stderr", "k_limit", "pixels", "unseen_share", "unseen_at_most"];
    assert_eq!(keys(&record["tail"]), tail);
    assert_eq!((record["schema"].as_u64(), record["stop"].as_str()), (Some(1), Some("spp")));
    assert_eq!((record["seed"].as_u64(), record["paths"].as_u64()), (Some(7), Some(16 * 8 * 4)));
}

/// A picture of other random numbers as reference: twice its variance is what the last line has to show, known to some
/// 10 % on 1024 pixels; a factor of two never fails by chance.
#[test]
fn the_error_log_has_a_line_for_every_pass() {
    let scene = cornell_box();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name);
    let (reference, exr, log) = (path("reference.exr"), path("a.exr"), path("run.csv"));
    let common = ["render", text(&scene), "--width", "32", "--spp", "32", "-o"];
    run(0, &[&common[..], &[text(&reference), "--seed", "1"]].concat());
    let more = [text(&exr), "--crop", "20x32+4+0", "--reference", text(&reference), "--error-log", text(&log)];
    run(0, &[&common[..], &more].concat());
    let lines = std::fs::read_to_string(&log).expect("just written");
    let mut lines = lines.lines();
    let header: Vec<_> = lines.next().expect("a header").split(',').collect();
    assert_eq!(header[..5], ["seconds", "spp", "mse", "relmse", "relmse_trimmed"]);
    assert_eq!(header[5..], ["estimated_relmse", "estimated_low", "estimated_high", "limit"]);
    let rows: Vec<Vec<Option<f64>>> = lines.map(|l| l.split(',').map(|v| v.parse().ok()).collect()).collect();
    assert!(rows.len() >= 3 && rows.iter().all(|row| row.len() == 9), "{rows:?}");
    assert!(rows.windows(2).all(|pair| pair[0][0] < pair[1][0] && pair[0][1] < pair[1][1]), "{rows:?}");
    // After one sample a half is empty: no estimate.
    assert_eq!((rows[0][1], rows[0][5]), (Some(1.0), None));
    let last = &rows[rows.len() - 1];
    let ratio = last[3].expect("a number") / last[5].expect("a number");
    assert!(last[1] == Some(32.0) && (1.0..4.0).contains(&ratio), "{last:?}");
}

#[test]
fn a_missed_error_target_exits_3_and_still_writes() {
    let scene = cornell_box();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let exr = folder.path().join("a.exr");
    let args = ["render", text(&scene), "-o", text(&exr), "--width", "16", "--spp", "4", "--error", "0.001%"];
    run(3, &args);
    assert!(exr.is_file());
    // A generous target is met.
    run(0, &["render", text(&scene), "-o", text(&exr), "--width", "16", "--error", "1000%", "--min-spp", "2"]);
}

#[test]
fn progress_is_lines_or_objects_as_asked() {
    let scene = cornell_box();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let exr = folder.path().join("a.exr");
    let common = ["render", text(&scene), "-o", text(&exr), "--width", "16", "--spp", "4"];
    let with = |more: &[&str]| run(0, &[&common[..], more].concat());

    let ndjson = out(&with(&["--progress", "ndjson"]));
    let lines: Vec<_> = ndjson.lines().map(|line| json(line.as_bytes())).collect();
    let types: Vec<_> = lines.iter().filter_map(|line| line["type"].as_str()).collect();
    assert_eq!(types.iter().filter(|t| **t == "completed").count(), 1, "{ndjson}");
    assert_eq!(types.last(), Some(&"completed"), "{ndjson}");
    assert_eq!(keys(&lines[0]), ["type", "t", "spp", "pct", "err", "target", "eta", "mrays"]);

    // The line of 100 % is that of the finished film, and there is one.
    let done: Vec<_> = lines.iter().filter(|line| line["pct"].as_f64() == Some(100.0)).collect();
    assert_eq!((done.len(), done[0]["spp"].as_u64()), (1, Some(4)), "{ndjson}");

    let plain = err(&with(&["--progress", "plain"]));
    let percents: Vec<_> = plain.lines().filter_map(|line| line.split_once(" %  ")).collect();
    assert!(percents.iter().filter(|(percent, _)| *percent == "100").count() == 1, "{plain}");
    assert!(percents.last().is_some_and(|(percent, facts)| *percent == "100" && facts.contains(" 4 spp")), "{plain}");
    let tens = percents.iter().map(|(percent, _)| percent.trim().parse::<u32>().expect("a number") / 10);
    assert_eq!(tens.collect::<std::collections::BTreeSet<_>>().len(), percents.len(), "{plain}");
    assert!(err(&with(&["--progress", "none", "-v"])).contains(" 1.02 k paths"));
    // Nobody asked, and it is done within a second: no line of progress, and one that says how it went.
    assert!(err(&with(&[])).lines().count() == 1 && err(&with(&[])).contains("noise "), "{}", err(&with(&[])));
    assert!(err(&with(&["--progress", "tty"])).contains('\x1b'));
    // Not a terminal: no control sequences, and quiet means silent.
    assert!(!err(&with(&[])).contains('\x1b'));
    assert_eq!(err(&with(&["--quiet"])), "");
    assert!(err(&with(&["--progress", "none", "-v"])).contains("backend "));
}

#[test]
fn a_signal_writes_what_was_rendered() {
    let scene = cornell_box();
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (signal, code) in [("INT", 130), ("TERM", 143)] {
        let exr = folder.path().join(format!("{signal}.exr"));
        let child = std::process::Command::new(assert_cmd::cargo::cargo_bin!("pathspace"))
            .args(["render", text(&scene), "-o", text(&exr), "--width", "32", "--time", "60s", "--progress", "ndjson"])
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn();
        let mut child = child.expect("the binary starts");
        // The first object says that rendering has begun.
        let mut line = String::new();
        let stdout = child.stdout.take().expect("piped");
        let mut reader = std::io::BufReader::new(stdout);
        std::io::BufRead::read_line(&mut reader, &mut line).expect("a line of progress");
        // The shell's own `kill`: a bare Debian has no program of that name.
        let kill = format!("kill -{signal} {}", child.id());
        let kill = std::process::Command::new("sh").args(["-c", &kill]).status();
        assert!(kill.is_ok_and(|status| status.success()));
        // The rest is read to the end, so that the child never waits for room in the pipe.
        std::io::Read::read_to_string(&mut reader, &mut line).expect("text");
        assert_eq!(child.wait().expect("it ends").code(), Some(code));
        assert!(read_exr(&exr).expect("written on the signal").rgb.iter().flatten().any(|v| *v > 0.0));
        assert!(line.contains(r#""stop":"signal""#) && !line.contains(r#""pct":100.0"#), "{line}");
    }
}
