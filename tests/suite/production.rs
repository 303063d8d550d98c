//! Renders that are killed, gone on with, split and joined, by the built binary. Oracle: one render without all that,
//! bit for bit (`film_hash`, and the EXR byte for byte with `--reproducible`). Deterministic, whenever the kills come.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.gltf");

/// Times that a render is killed.
const KILLS: u64 = 6;

/// A folder, and the command run in it.
struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        Bench { folder: tempfile::tempdir().expect("a temporary folder") }
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_pathspace"));
        command.args(args).current_dir(self.folder.path()).env_remove("SLURM_CPUS_PER_TASK");
        command
    }

    /// A render of the Cornell box with the arguments `args`, split at spaces.
    fn render(&self, args: &str) -> Command {
        let size = ["render", SCENE, "-q", "--width", "24", "--height", "20", "--reproducible"];
        self.command(&[&size[..], &args.split(' ').collect::<Vec<_>>()].concat())
    }

    /// The same for a part of a picture, which is no picture.
    fn part(&self, args: &str) -> Command {
        let size = ["render", SCENE, "-q", "--width", "24", "--height", "20"];
        self.command(&[&size[..], &args.split(' ').collect::<Vec<_>>()].concat())
    }

    /// Runs with exit code `code`; what was said.
    fn run(&self, code: i32, mut command: Command) -> String {
        let Output { status, stderr, .. } = command.output().expect("the binary starts");
        let said = String::from_utf8_lossy(&stderr).into_owned();
        assert_eq!(status.code(), Some(code), "{command:?}\n{said}");
        said
    }

    fn merge(&self, code: i32, args: &str) -> String {
        self.run(code, self.command(&[&["merge", "-q"][..], &args.split(' ').collect::<Vec<_>>()].concat()))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// A value of a file of statistics.
    fn stat(&self, name: &str, key: &str) -> serde_json::Value {
        let stats: serde_json::Value = serde_json::from_slice(&self.bytes(name)).expect("valid JSON");
        stats[key].clone()
    }

    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).expect("a folder");
        let mut names: Vec<String> =
            entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

/// Waits until `path` is there, as long as `child` runs.
fn wait_for(path: &Path, child: &mut Child) {
    while !path.exists() && child.try_wait().expect("a child").is_none() {
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn signal(child: &Child, name: &str) {
    // The shell's own `kill`: a bare Debian has no program of that name.
    let sent = Command::new("sh").args(["-c", &format!("kill -{name} {}", child.id())]).status();
    assert!(sent.is_ok_and(|status| status.success()));
}

#[test]
fn killed_renders_go_on_to_the_same_bits() {
    let b = Bench::new();
    // An odd number of samples, so that there are several blocks.
    let args = "--width 16 --height 12 --spp 151 --aov bounces,albedo,Z --reproducible";
    let render = |args: &str| b.command(&[&["render", SCENE, "-q"][..], &args.split(' ').collect::<Vec<_>>()].concat());
    b.run(0, render(&format!("{args} -o whole.exr --stats whole.json")));
    let checkpoint = b.path("run.checkpoint");
    let args = format!("{args} -o run.exr --stats run.json --checkpoint 5ms");
    let age = || std::fs::metadata(&checkpoint).and_then(|data| data.modified()).ok();
    let mut kills = 0;
    for round in 0..KILLS {
        let (before, resume) = (age(), if checkpoint.exists() { " --resume run.checkpoint" } else { "" });
        let mut child = render(&format!("{args}{resume}")).stderr(Stdio::null()).spawn().expect("the binary starts");
        while age() == before && child.try_wait().expect("a child").is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        // Some moment after the first checkpoint: while one is written, or between two.
        std::thread::sleep(Duration::from_millis(7 * round % 20));
        if child.try_wait().expect("a child").is_none() {
            child.kill().and_then(|()| child.wait()).expect("a child that runs");
            kills += 1;
        }
    }
    b.run(0, render(&format!("{args} --resume run.checkpoint")));
    assert!(kills > 0, "no run was killed");
    assert_eq!(b.stat("run.json", "film_hash"), b.stat("whole.json", "film_hash"), "{kills} kills");
    assert_eq!(b.stat("run.json", "paths"), b.stat("whole.json", "paths"));
    assert_eq!(b.bytes("run.exr"), b.bytes("whole.exr"));
    let files = ["run.checkpoint", "run.exr", "run.json", "whole.exr", "whole.json"];
    // Between link and rename a kill may leave a name behind (film/atomic.rs).
    let partial = |name: &String| name.starts_with(".run.") && name.ends_with(".partial");
    assert_eq!(b.names().into_iter().filter(|name| !partial(name)).collect::<Vec<_>>(), files);
}

#[test]
fn signals_save_the_state_and_usr1_the_picture_so_far() {
    let b = Bench::new();
    let mut command = b.part("--time 60s -o a.exr --checkpoint 1h --progress ndjson");
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("the binary starts");
    let mut stdout = child.stdout.take().expect("piped");
    // The first object of progress says that it listens. The rest is read, so that the child never waits for room.
    std::io::Read::read_exact(&mut stdout, &mut [0; 2]).expect("progress");
    let reader = std::thread::spawn(move || std::io::copy(&mut stdout, &mut std::io::sink()));
    // Asked for again and again: the first ones may come before there is anything to show.
    while !b.path("a.exr").exists() && child.try_wait().expect("a child").is_none() {
        signal(&child, "USR1");
        std::thread::sleep(Duration::from_millis(50));
    }
    assert!(!b.path("a.checkpoint").exists() && child.try_wait().expect("a child").is_none(), "it goes on");
    signal(&child, "HUP");
    assert_eq!(child.wait().expect("it ends").code(), Some(129));
    reader.join().expect("no panic").expect("all was read");
    let done = b.stat_of_resumed();
    assert!(done > 0);
}

impl Bench {
    /// Resumes `a.checkpoint` to twice its samples, and compares with one render; the samples that were done.
    fn stat_of_resumed(&self) -> u64 {
        let state = pathspace::render::checkpoint::Checkpoint::restore(self.path("a.checkpoint")).expect("saved");
        let spp = state.render.film.spp();
        let target = (spp.max + 1).next_multiple_of(8);
        self.run(0, self.render(&format!("--spp {target} -o b.exr --stats b.json --resume a.checkpoint")));
        self.run(0, self.render(&format!("--spp {target} -o c.exr --stats c.json")));
        assert_eq!(self.stat("b.json", "film_hash"), self.stat("c.json", "film_hash"), "from {spp:?} to {target}");
        spp.max
    }
}

/// The target of the file and the checks of its error go on as well.
#[test]
fn error_targets_are_resumed_where_they_were() {
    let b = Bench::new();
    b.run(0, b.render("--error 40% -o whole.exr --stats whole.json"));
    b.run(0, b.render("--error 40% --best-effort --spp 7 -o a.exr --checkpoint 1h --stats a.json"));
    assert_eq!(b.stat("a.json", "stop"), "spp");
    b.run(0, b.render("--error 40% -o b.exr --resume a.checkpoint --checkpoint 1h b.checkpoint --stats b.json"));
    assert_eq!(b.stat("b.json", "film_hash"), b.stat("whole.json", "film_hash"));
    // Met is met; the target is that of the file.
    b.run(0, b.render("-o c.exr --resume b.checkpoint --stats c.json"));
    assert_eq!(b.stat("c.json", "film_hash"), b.stat("whole.json", "film_hash"));
    assert_eq!(b.stat("c.json", "error")["target"], 0.4);
    b.run(3, b.render("--error 0.1% --spp 8 -o d.exr"));
    b.run(0, b.render("--error 0.1% --spp 8 -o d.exr --best-effort"));
}

#[test]
fn other_renders_are_not_gone_on_with() {
    let b = Bench::new();
    b.run(0, b.render("--spp 2 -o a.exr --checkpoint 1h"));
    let refused = |code: i32, args: &str, named: &str| {
        let said = b.run(code, b.render(&format!("{args} -o b.exr")));
        assert!(said.contains(named) && said.lines().count() == 1, "{args}: {said}");
        assert!(!b.path("b.exr").exists());
    };
    refused(2, "--spp 4 --resume a.checkpoint --seed 3", "its seed is 0, here it is 3");
    refused(2, "--spp 4 --resume a.checkpoint --filter box", "filter");
    refused(2, "--spp 4 --resume a.checkpoint --max-depth 3", "max-depth");
    refused(2, "--spp 4 --resume a.checkpoint --aov Z", "aov");
    refused(2, "--spp 4 --resume a.checkpoint --crop 4x4+0+0", "window");
    refused(1, "--spp 4 --resume b.checkpoint", "b.checkpoint");
    // Another scene.
    std::fs::copy(SCENE, b.path("scene.gltf")).expect("a writable folder");
    let text = String::from_utf8(b.bytes("scene.gltf")).expect("JSON").replace("\"scene\": 0", "\"scene\":  0");
    std::fs::write(b.path("scene.gltf"), format!("{text} ")).expect("a writable folder");
    for name in ["scene.bin", "cornell-box.bin", "geometry.bin"] {
        let from = Path::new(SCENE).with_file_name(name);
        let _ = std::fs::copy(from, b.path(name));
    }
    let size = ["render", "scene.gltf", "-q", "--width", "24", "--height", "20", "--resume", "a.checkpoint"];
    let said = b.run(2, b.command(&[&size[..], &["--spp", "4", "-o", "b.exr"]].concat()));
    assert!(said.contains("its scene is"), "{said}");
    // A damaged state.
    let mut bytes = b.bytes("a.checkpoint");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(b.path("c.checkpoint"), bytes).expect("a writable folder");
    refused(1, "--spp 4 --resume c.checkpoint", "digest");
    if pathspace::math::simd::detect::has_avx512() {
        refused(2, "--spp 4 --resume a.checkpoint --backend obvhs --isa avx2", "backend");
        b.run(0, b.render("--spp 2 -o w.exr --checkpoint 1h --backend obvhs"));
        refused(2, "--spp 4 --resume w.checkpoint --backend obvhs --isa avx2", "--accept-different isa");
        let accepted = "--spp 4 --resume w.checkpoint --backend obvhs --isa avx2 --accept-different isa";
        b.run(0, b.render(&format!("{accepted} -o x.exr")));
        let exr = b.bytes("x.exr");
        assert!(exr.windows(18).any(|bytes| bytes == b"pathspace/accepted"), "the EXR says so");
    }
}

/// A checkpoint that cannot be written does not end the render, and leaves the last good one.
#[test]
fn checkpoints_that_cannot_be_written_cost_nothing_but_the_exit_code() {
    let b = Bench::new();
    let said = b.run(1, b.render("--spp 2 -o a.exr --checkpoint 1h missing/a.checkpoint"));
    assert!(said.contains("missing") && said.lines().count() == 1, "{said}");
    std::fs::create_dir(b.path("folder")).expect("a folder");
    let mut child = b
        .render("--time 4s -o a.exr --checkpoint 20ms folder/a.checkpoint")
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    wait_for(&b.path("folder/a.checkpoint"), &mut child);
    // The folder goes away: every later one fails.
    std::fs::rename(b.path("folder"), b.path("gone")).expect("a folder");
    let output = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("folder/a.checkpoint") && said.lines().count() == 1, "{said}");
    assert!(b.path("a.exr").exists(), "the picture is written");
    assert_eq!(std::fs::read_dir(b.path("gone")).expect("a folder").count(), 1);
    b.run(0, b.render("--spp 4 --time 1s -o b.exr --resume gone/a.checkpoint"));
}

#[test]
fn parts_by_samples_are_joined_to_the_bits_of_one_render() {
    let b = Bench::new();
    let aovs = "--aov bounces,albedo,Z,variance";
    for (spp, splits) in [
        (64, &[&[0, 32, 64][..], &[0, 16, 32, 64], &[0, 4, 8, 16, 20, 24, 28, 32, 48, 56, 64]][..]),
        (112, &[&[0, 16, 32, 48, 64, 80, 96, 112], &[0, 64, 96, 112]]),
    ] {
        b.run(0, b.render(&format!("--spp {spp} {aovs} -o whole.exr")));
        for cuts in splits {
            let mut names = Vec::new();
            for ends in cuts.windows(2) {
                let name = format!("{}.part", ends[0]);
                b.run(0, b.part(&format!("--sample-range {}..{} {aovs} --checkpoint {name}", ends[0], ends[1])));
                names.push(name);
            }
            // In any order.
            names.rotate_left(1);
            b.merge(0, &format!("{} --reproducible -o m.exr --stats m.json", names.join(" ")));
            assert_eq!(b.bytes("m.exr"), b.bytes("whole.exr"), "{cuts:?}");
            assert_eq!(b.stat("m.json", "parts").as_array().map(Vec::len), Some(names.len()));
        }
    }
}

#[test]
fn parts_by_pixels_are_joined_to_the_bits_of_one_render() {
    let b = Bench::new();
    b.run(0, b.render("--spp 12 --aov N,Z -o whole.exr"));
    let windows = ["24x7+0+0", "10x13+0+7", "14x13+10+7"];
    for (i, window) in windows.iter().enumerate() {
        b.run(0, b.part(&format!("--sample-range 0..8 --aov N,Z --crop {window} --checkpoint {i}.part")));
        b.run(0, b.part(&format!("--sample-range 8..12 --aov N,Z --crop {window} --checkpoint {i}b.part")));
    }
    b.merge(0, "0.part 1.part 2.part 2b.part 0b.part 1b.part --reproducible -o m.exr");
    assert_eq!(b.bytes("m.exr"), b.bytes("whole.exr"));
    let said = b.merge(2, "0.part 1.part 2.part 0b.part 1b.part -o n.exr");
    assert!(said.contains("samples 8..12 of the pixels 14x13+10+7 are missing behind 2.part"), "{said}");
    let said = b.merge(2, "0.part 2.part -o n.exr");
    assert!(said.contains("samples 0..8 of the pixels 10x13+0+7 are missing"), "{said}");
    b.merge(0, "0.part 2.part -o n.exr --allow-gaps --png n.png");
    assert!(b.path("n.png").exists());
}

#[test]
fn parts_that_do_not_belong_together_are_refused_by_name() {
    let b = Bench::new();
    b.run(0, b.part("--sample-range 0..4 --checkpoint a.part"));
    b.run(0, b.part("--sample-range 4..8 --checkpoint b.part"));
    b.run(0, b.part("--sample-range 12..16 --checkpoint d.part"));
    b.run(0, b.part("--sample-range 4..8 --seed 2 --checkpoint seed.part"));
    let refused = |code: i32, parts: &str, named: &[&str]| {
        let said = b.merge(code, &format!("{parts} -o m.exr"));
        assert!(named.iter().all(|name| said.contains(name)) && said.lines().count() == 1, "{parts}: {said}");
        assert!(!b.path("m.exr").exists());
    };
    std::fs::copy(b.path("b.part"), b.path("c.part")).expect("a copy");
    refused(2, "a.part b.part c.part", &["b.part", "c.part", "overlap"]);
    refused(2, "b.part a.part d.part", &["samples 8..12", "missing behind b.part", "--allow-gaps"]);
    refused(2, "b.part", &["samples 0..4", "missing"]);
    refused(2, "a.part seed.part", &["a.part and seed.part differ in seed: 0, 2"]);
    refused(1, "a.part e.part", &["e.part"]);
    std::fs::write(b.path("text.part"), "text").expect("a writable folder");
    refused(1, "a.part text.part", &["text.part"]);
    b.merge(0, "a.part d.part --allow-gaps -o m.exr");
    let said = b.run(2, b.part("--sample-range 4..12 --checkpoint x.part"));
    assert!(said.contains("no multiple of 8"), "{said}");
}

/// Frames of the animated scene: each has the bits of a render with that shutter and seed; a pattern is never a name.
#[test]
fn frames_are_renders_of_their_own_times() {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/in-motion/scene.gltf");
    let b = Bench::new();
    let run = |code: i32, args: &str| {
        let size = ["render", scene, "-q", "--width", "16", "--height", "12", "--spp", "2", "--reproducible"];
        b.run(code, b.command(&[&size[..], &args.split(' ').collect::<Vec<_>>()].concat()))
    };
    let sequence =
        "--frames 4-8x4,6 --fps 8 --frame-start 2 --shutter-angle 90 --fixed-seed -o f.####.exr --stats f.json";
    run(0, sequence);
    assert_eq!(b.names(), ["f.0004.exr", "f.0004.json", "f.0006.exr", "f.0006.json", "f.0008.exr", "f.0008.json"]);
    for (frame, shutter) in [(4, "0.25,0.28125"), (6, "0.5,0.53125"), (8, "0.75,0.78125")] {
        run(0, &format!("--shutter {shutter} -o one.exr --stats one.json"));
        let hash = b.stat(&format!("f.000{frame}.json"), "film_hash");
        assert_eq!(hash, b.stat("one.json", "film_hash"), "frame {frame}");
    }
    // Centred, and not before time 0; a seed for each frame.
    run(0, "--frames 0,2 --fps 8 --shutter-angle 90,centred -o c.%02d.exr --stats c.%d.json");
    let seed = b.stat("c.2.json", "seed").as_u64().expect("a number");
    assert_ne!(b.stat("c.0.json", "seed"), seed);
    run(0, &format!("--shutter 0.234375,0.265625 --seed {seed} -o one.exr --stats one.json"));
    assert_eq!(b.stat("c.2.json", "film_hash"), b.stat("one.json", "film_hash"));
    // What is there is skipped if it is the same.
    let written = |name: &str| std::fs::metadata(b.path(name)).and_then(|data| data.modified()).expect("a file");
    let (first, last) = (written("f.0004.exr"), written("f.0008.exr"));
    std::fs::remove_file(b.path("f.0008.exr")).expect("a file");
    run(0, &format!("{sequence} --skip-existing -t 1"));
    assert_eq!(written("f.0004.exr"), first);
    assert_ne!(written("f.0008.exr"), last);
    run(0, &format!("{sequence} --skip-existing --max-depth 3"));
    assert_ne!(written("f.0004.exr"), first);

    assert!(run(2, "-o g.####.exr").contains("--frames"));
    assert!(run(2, "--frames 1 --frame-start 2 -o g.exr").contains("--frame-start"));
    run(2, "--frames 1-3 --shutter 0,1 -o g.exr");
    run(0, "--frames 3 -o g.exr");
    assert!(b.path("g.exr").exists(), "one frame needs no number");
    // The camera comes back to where it began.
    run(0, "--turntable 4 --frames 1,2,5 --fixed-seed -o t.#.exr --stats t.#.json");
    assert_eq!(b.stat("t.1.json", "film_hash"), b.stat("t.5.json", "film_hash"));
    assert_ne!(b.stat("t.1.json", "film_hash"), b.stat("t.2.json", "film_hash"));
    run(0, "-o one.exr --stats one.json");
    assert_eq!(b.stat("t.1.json", "film_hash"), b.stat("one.json", "film_hash"));
}

/// A sequence that is killed goes on with its frames and in the one at hand.
#[test]
fn killed_sequences_go_on() {
    let b = Bench::new();
    let args = "--turntable 3 --spp 40 -o f.#.exr --stats f.#.json --checkpoint 10ms --skip-existing";
    b.run(0, b.render(args));
    let whole: Vec<Vec<u8>> = (1..=3).map(|frame| b.bytes(&format!("f.{frame}.exr"))).collect();
    for name in b.names() {
        std::fs::remove_file(b.path(&name)).expect("a file");
    }
    let args = format!("{args} --resume f.#.checkpoint");
    let mut child = b.render(&args).stderr(Stdio::null()).spawn().expect("the binary starts");
    wait_for(&b.path("f.2.checkpoint"), &mut child);
    signal(&child, "TERM");
    child.wait().expect("it ends");
    assert!(b.path("f.1.exr").exists());
    // The frame that was broken off has a picture as well, which is not the one that was asked for.
    b.run(0, b.render(&args));
    let now: Vec<Vec<u8>> = (1..=3).map(|frame| b.bytes(&format!("f.{frame}.exr"))).collect();
    assert!(now == whole);
}

/// The scripts of a Slurm job run by bash, with the variables that Slurm sets: one task is warned as Slurm warns it,
/// and requeued; the merge has the bits of one render.
#[test]
fn a_slurm_job_survives_a_warning() {
    let b = Bench::new();
    let options = ["--width", "24", "--height", "20", "-q"];
    let farm =
        ["farm", "slurm", SCENE, "-q", "--spp", "96", "--tasks", "3", "-o", "m.exr", "--job", "it's a job", "--"];
    b.run(0, b.command(&[&farm[..], &options].concat()));
    // A stand-in for Slurm's own command says what it was called with.
    std::fs::write(b.path("scontrol"), "#!/bin/sh\necho \"$@\" >> requeued\n").expect("a writable folder");
    std::fs::write(b.path("sleep"), "#!/bin/sh\n").expect("a writable folder");
    for name in ["scontrol", "sleep"] {
        use std::os::unix::fs::PermissionsExt;
        let permissions = std::fs::Permissions::from_mode(0o755);
        std::fs::set_permissions(b.path(name), permissions).expect("an own file");
    }
    let path = std::env::var("PATH").unwrap_or_default();
    let task = |number: &str| {
        let mut command = Command::new("bash");
        command.arg(b.path("it's a job/array.sh")).current_dir(b.folder.path());
        command.env("SLURM_ARRAY_TASK_ID", number).env("SLURM_ARRAY_JOB_ID", "7");
        command.env("PATH", format!("{}:{path}", b.folder.path().display())).env_remove("SLURM_CPUS_PER_TASK");
        command
    };
    b.run(0, task("0"));
    let mut child = task("1").stderr(Stdio::piped()).spawn().expect("bash starts");
    let said = std::io::BufReader::new(child.stderr.take().expect("piped"));
    // Its first line of progress says that it renders; a warning before that ends it without a state.
    let mut lines = std::io::BufRead::lines(said);
    lines.next();
    signal(&child, "TERM");
    let code = child.wait().expect("it ends").code();
    assert!(code == Some(143) || code == Some(0), "{code:?}");
    assert_eq!(b.path("requeued").exists(), code == Some(143));
    for number in ["1", "2"] {
        b.run(0, task(number));
    }
    let mut merge = Command::new("bash");
    merge.arg(b.path("it's a job/merge.sh")).current_dir(b.folder.path());
    b.run(0, merge);
    b.run(0, b.command(&[&["render", SCENE, "--spp", "96", "-o", "one.exr"][..], &options].concat()));
    let picture = |name: &str| pathspace::film::exr::read_exr(&b.path(name)).expect("an EXR");
    assert_eq!(picture("m.exr"), picture("one.exr"));
    let submit = String::from_utf8(b.bytes("it's a job/submit.sh")).expect("text");
    assert!(submit.contains("--dependency=afterok:$job"), "{submit}");
    // What a render refuses is refused before anything is written.
    let wrong = [&farm[..], &["--no-such-option"]].concat();
    assert!(b.run(2, b.command(&wrong)).contains("--no-such-option"));
}

/// A bundle for OpenJD: each task's script, with its parameter filled in, and the merge.
#[test]
fn an_openjd_bundle_renders_and_merges() {
    let b = Bench::new();
    let options = ["--width", "24", "--height", "20"];
    let farm = ["farm", "openjd", SCENE, "-q", "--spp", "8", "--tasks", "2", "-o", "m.exr", "--job", "job", "--"];
    b.run(0, b.command(&[&farm[..], &options].concat()));
    let template: serde_json::Value = serde_json::from_slice(&b.bytes("job/template.json")).expect("valid JSON");
    assert_eq!(template["specificationVersion"], "jobtemplate-2023-09");
    let render = &template["steps"][0];
    let parts = &render["parameterSpace"]["taskParameterDefinitions"][0]["range"];
    assert_eq!(*parts, serde_json::json!(["0..4", "4..8"]));
    let script = render["script"]["embeddedFiles"][0]["data"].as_str().expect("a script");
    for part in ["0..4", "4..8"] {
        std::fs::write(b.path("run"), script.replace("{{Task.Param.Part}}", part)).expect("a writable folder");
        let output = Command::new("bash").arg("run").current_dir(b.folder.path()).output().expect("bash starts");
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success() && said.contains("openjd_progress: 100.0"), "{output:?}");
    }
    let merge = &template["steps"][1]["script"]["actions"]["onRun"];
    let words = merge["args"].as_array().expect("words").iter().map(|word| word.as_str().expect("text"));
    let words: Vec<&str> = words.collect();
    b.run(0, b.command(&words));
    b.run(0, b.command(&[&["render", SCENE, "--spp", "8", "-o", "one.exr"][..], &options].concat()));
    let picture = |name: &str| pathspace::film::exr::read_exr(&b.path(name)).expect("an EXR");
    assert_eq!(picture("m.exr"), picture("one.exr"));
}
