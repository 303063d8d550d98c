//! Renders that are killed, gone on with, split and joined, by the built binary. Oracle: one render without all that,
//! bit for bit (`film_hash`, and the EXR byte for byte with `--reproducible`). Deterministic, whenever the kills come.

mod limits;

use std::io::{BufRead, BufReader, Read};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use pathspace::render::checkpoint::Checkpoint;
use pathspace::render::{Keeper, Render, State, StopReason};
use pathspace::{RenderOptions, Renderer};
use serde_json::json;

use crate::common::{signal, wait_for_samples};
use crate::loading::fixture::Fixture;

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.gltf");

/// Times that each of the [`KILLED`] is killed.
const KILLS: u64 = 10;

/// Settings of the renders that are killed.
const KILLED: [&str; 5] = [
    "--aov bounces,albedo,Z,crypto_material",
    "--seed 7 --filter box -t 1",
    "--backend obvhs --max-depth 4",
    "--aov variance,spp --sampler independent",
    "--strategy light --crop 9x7+3+2",
];

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

/// When a render is killed.
enum Moment {
    /// So long after it has begun.
    Milliseconds(u64),
    /// When it has saved its state so many times.
    Checkpoints(u64),
}

/// Starts a render with `--progress ndjson` and kills it.
fn kill_at(checkpoint: &Path, mut command: Command, moment: Moment) {
    let age = || std::fs::metadata(checkpoint).and_then(|data| data.modified()).ok();
    let mut before = age();
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("the binary starts");
    // The first object of progress says that it renders.
    let mut stdout = child.stdout.take().expect("piped");
    stdout.read_exact(&mut [0; 2]).expect("progress");
    match moment {
        Moment::Milliseconds(time) => std::thread::sleep(Duration::from_millis(time)),
        Moment::Checkpoints(count) => (0..count).for_each(|_| {
            while age() == before && child.try_wait().expect("a child").is_none() {
                std::thread::sleep(Duration::from_millis(1));
            }
            before = age();
        }),
    }
    assert!(child.try_wait().expect("a child").is_none(), "it runs until it is killed");
    child.kill().and_then(|()| child.wait()).expect("a child that runs");
}

/// 50 kills, each a while after the start of the render or after some checkpoints. Nothing is left but what was asked
/// for.
#[test]
fn killed_renders_go_on_to_the_same_bits() {
    let mut state = 20u64;
    let mut chance = |below: u64| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) % below
    };
    for settings in KILLED {
        let b = Bench::new();
        let common = format!("--width 16 --height 12 --reproducible {settings}");
        let render =
            |args: &str| b.command(&[&["render", SCENE, "-q"][..], &args.split(' ').collect::<Vec<_>>()].concat());
        let args = format!("{common} -o run.exr --stats run.json --checkpoint 5ms");
        for round in 0..KILLS {
            let resume = if b.path("run.checkpoint").exists() { " --resume run.checkpoint" } else { "" };
            // Far more than is ever rendered.
            let command = render(&format!("{args} --spp 1000000000 --progress ndjson{resume}"));
            let moment = match round % 2 {
                0 => Moment::Checkpoints(1 + chance(3)),
                _ => Moment::Milliseconds(5 + chance(56)),
            };
            kill_at(&b.path("run.checkpoint"), command, moment);
        }
        let state = Checkpoint::restore(b.path("run.checkpoint")).expect("whole");
        // An odd number of samples, so that there are several blocks.
        let spp = state.render.film.spp().max.next_multiple_of(64) + 23;
        b.run(0, render(&format!("{args} --spp {spp} --resume run.checkpoint")));
        b.run(0, render(&format!("{common} --spp {spp} -o whole.exr --stats whole.json")));
        assert_eq!(b.stat("run.json", "film_hash"), b.stat("whole.json", "film_hash"), "{settings}: {spp} spp");
        assert_eq!(b.stat("run.json", "paths"), b.stat("whole.json", "paths"), "{settings}");
        assert_eq!(b.bytes("run.exr"), b.bytes("whole.exr"), "{settings}");
        assert_eq!(b.names(), ["run.checkpoint", "run.exr", "run.json", "whole.exr", "whole.json"], "{settings}");
    }
}

/// Between link and rename a kill may leave a name behind (film/atomic.rs).
fn is_partial(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(".partial")
}

#[test]
fn signals_save_the_state_and_usr1_the_picture_so_far() {
    let b = Bench::new();
    let mut command = b.part("--time 60s -o a.exr --checkpoint 1h --progress ndjson");
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("the binary starts");
    let mut stdout = child.stdout.take().expect("piped");
    // The first object of progress says that it listens. The rest is read, so that the child never waits for room.
    stdout.read_exact(&mut [0; 2]).expect("progress");
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

/// Slurm tells every process of a task, and its shell passes on to the render what it was told.
#[test]
fn signals_that_come_twice_are_one() {
    for (name, code) in [("TERM", 143), ("HUP", 129)] {
        let b = Bench::new();
        let mut command = b.part("--time 60s -o a.exr --checkpoint 1h --progress ndjson");
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("the binary starts");
        wait_for_samples(&mut child);
        // The second may come when all is done.
        let twice = format!("kill -{name} {0}; sleep 0.01; kill -{name} {0}", child.id());
        let _ = Command::new("sh").args(["-c", &twice]).stderr(Stdio::null()).status().expect("a shell");
        assert_eq!(child.wait().expect("it ends").code(), Some(code));
        assert!(b.path("a.exr").exists() && b.stat_of_resumed() > 0, "{name}");
    }
}

impl Bench {
    /// Resumes `a.checkpoint` to twice its samples, and compares with one render; the samples that were done.
    fn stat_of_resumed(&self) -> u64 {
        let state = Checkpoint::restore(self.path("a.checkpoint")).expect("saved");
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

/// Takes every state that has as many samples everywhere: those after a pass, before the error is checked, among them.
#[derive(Default)]
struct Keep(Vec<Render>);

impl Keeper for Keep {
    fn is_due(&mut self) -> bool {
        true
    }

    fn keep(&mut self, state: State) {
        let render = state.into_render();
        let spp = render.film.spp();
        if spp.min == spp.max && spp.min > 0 && self.0.last().is_none_or(|last| last.film.spp() != spp) {
            self.0.push(render);
        }
    }
}

/// A state from between the end of a pass and the check of the error that was due comes to the same end: the check is
/// made at once. Oracle: the render without a stop. Deterministic.
#[test]
fn checks_that_were_due_are_made_when_a_render_goes_on() {
    let scene = pathspace::Scene::load(SCENE).expect("an own scene");
    let renderer = Renderer::new(&scene, RenderOptions::new(32, 24).error(0.4)).expect("valid options");
    let mut kept = Keep::default();
    let whole = renderer.render_kept(None, |_| ControlFlow::Continue(()), None, &mut kept).expect("it renders");
    let spp = whole.film.spp().max;
    assert_eq!(whole.stop, StopReason::Error);
    assert_eq!(kept.0.last().map(|last| last.film.spp().max), Some(spp), "the last state is from before the check");
    for state in kept.0 {
        let from = state.film.spp().max;
        let resumed = renderer.resume(state).expect("goes on");
        assert_eq!((resumed.film.spp().max, resumed.stop), (spp, StopReason::Error), "from {from}");
        assert_eq!(resumed.film.digest(), whole.film.digest(), "from {from}");
    }
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
    std::fs::copy(b.path("a.checkpoint"), b.path("a.json")).expect("a copy");
    refused(2, "--spp 4 --resume a.json --stats a.json", "also read");
    assert_eq!(b.bytes("a.json"), b.bytes("a.checkpoint"));
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
        .render("--spp 1000000000 -o a.exr --checkpoint 20ms folder/a.checkpoint")
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    wait_for(&b.path("folder/a.checkpoint"), &mut child);
    // The folder goes away: every later one fails.
    std::fs::rename(b.path("folder"), b.path("gone")).expect("a folder");
    // It says so at once, goes on, and says nothing more.
    let mut lines = BufReader::new(child.stderr.take().expect("piped")).lines().map_while(Result::ok);
    let said = lines.next().expect("a line");
    assert!(said.contains("folder/a.checkpoint"), "{said}");
    assert!(child.try_wait().expect("a child").is_none(), "it goes on");
    signal(&child, "INT");
    assert_eq!(lines.collect::<Vec<_>>(), [""; 0]);
    assert_eq!(child.wait().expect("it ends").code(), Some(1));
    assert!(b.path("a.exr").exists(), "the picture is written");
    let left = std::fs::read_dir(b.path("gone")).expect("a folder").flatten();
    let left = left.map(|entry| entry.file_name().to_string_lossy().into_owned());
    assert_eq!(left.filter(|name| !is_partial(name)).collect::<Vec<_>>(), ["a.checkpoint"]);
    b.run(0, b.render("--spp 4 -o b.exr --resume gone/a.checkpoint"));
}

/// Where 16 parts of 64 samples begin and end.
const SIXTEENTHS: [u64; 17] = [0, 4, 8, 12, 16, 20, 24, 28, 32, 36, 40, 44, 48, 52, 56, 60, 64];

#[test]
fn parts_by_samples_are_joined_to_the_bits_of_one_render() {
    let b = Bench::new();
    let aovs = "--aov bounces,albedo,Z,variance,crypto_object --filter mitchell";
    for (spp, splits) in [
        // Of 2, 3, 10 and 16 parts; of 7 and 3.
        (64, &[&[0, 32, 64][..], &[0, 16, 32, 64], &[0, 4, 8, 16, 20, 24, 28, 32, 48, 56, 64], &SIXTEENTHS][..]),
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
    b.run(0, b.render("--spp 12 --aov N,Z,crypto_material -o whole.exr"));
    let windows = ["24x7+0+0", "10x13+0+7", "14x13+10+7"];
    for (i, window) in windows.iter().enumerate() {
        b.run(
            0,
            b.part(&format!("--sample-range 0..8 --aov N,Z,crypto_material --crop {window} --checkpoint {i}.part")),
        );
        b.run(
            0,
            b.part(&format!("--sample-range 8..12 --aov N,Z,crypto_material --crop {window} --checkpoint {i}b.part")),
        );
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
    refused(2, "a.part seed.part", &["seed.part: its seed is 2, that of a.part is 0"]);
    refused(1, "a.part e.part", &["e.part"]);
    std::fs::write(b.path("text.part"), "text").expect("a writable folder");
    refused(1, "a.part text.part", &["text.part: cannot restore: expected a saved state, found something else"]);
    // A part that was stopped between two passes, and one that does not begin where sums of its size do.
    let changed = |name: &str, change: &dyn Fn(&mut Checkpoint)| {
        let mut part = Checkpoint::restore(b.path("b.part")).expect("just saved");
        change(&mut part);
        part.save(b.path(name)).expect("a writable folder");
    };
    changed("stopped.part", &|part| part.about.goal.spp = Some(8));
    refused(2, "a.part stopped.part", &["stopped.part: it was stopped after 4 of 8 samples"]);
    changed("odd.part", &|part| part.render.film.first_sample = 6);
    refused(2, "a.part odd.part --allow-gaps", &["odd.part: it has 4 samples from 6 on", "no multiple"]);
    // A part has its state beside it; a picture is none.
    b.run(0, b.part("--sample-range 4..8 -o beside.exr"));
    refused(2, "a.part beside.exr", &["beside.exr: it is a picture", "--sample-range A..B"]);
    b.merge(0, "a.part beside.checkpoint -o n.exr");
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

    // Previews of another look are others.
    run(0, "--frames 4,8 --fps 8 -o p.#.exr --png p.#.png --skip-existing");
    let first = written("p.4.png");
    run(0, "--frames 4,8 --fps 8 -o p.#.exr --png p.#.png --skip-existing");
    assert_eq!(written("p.4.png"), first);
    run(0, "--frames 4,8 --fps 8 -o p.#.exr --png p.#.png --skip-existing --exposure 1");
    assert_ne!(written("p.4.png"), first);

    for alone in ["--fps 8", "--frame-start 2", "--fixed-seed", "--skip-existing", "--turntable 2 --fps 8"] {
        run(2, &format!("{alone} -o g.exr"));
    }
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

/// The scene's files are no frame's output, and a camera that was put on an orbit stays there while things move.
/// Oracle: the attribute of the EXR; the file.
#[test]
fn frames_spare_the_scene_and_keep_its_orbit() {
    let b = Bench::new();
    let mut moving = Fixture::quad()
        .set("/textures", json!([{"source": 0}]))
        .set("/images", json!([{"uri": "t.0002.png"}]))
        .set("/materials/0/pbrMetallicRoughness", json!({"baseColorTexture": {"index": 0}}));
    let input = moving.floats(&[0.0, 1.0], "SCALAR");
    let output = moving.floats(&[0.0, 0.0, 0.0, 4.0, 0.0, 0.0], "VEC3");
    let animation = json!({
        "samplers": [{"input": input, "output": output}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]
    });
    moving.set("/animations", json!([animation])).write(b.folder.path());
    let image = image::RgbImage::from_pixel(1, 1, image::Rgb([90, 120, 30]));
    image.save(b.path("t.0002.png")).expect("a writable folder");
    let run = |code: i32, args: &str| {
        let size = ["render", "scene.gltf", "-q", "--width", "16", "--height", "12", "--spp", "1", "--fixed-seed"];
        b.run(code, b.command(&[&size[..], &args.split(' ').collect::<Vec<_>>()].concat()))
    };
    run(0, "--frames 0,12 --camera-orbit 30,20 -o o.#.exr --stats o.#.json");
    let camera = |name: &str| {
        let (bytes, attribute) = (b.bytes(name), b"worldToCamera\0m44f\0");
        let at = bytes.windows(attribute.len()).position(|bytes| bytes == attribute).expect("an attribute");
        bytes[at + attribute.len()..][..4 + 64].to_vec()
    };
    assert_eq!(camera("o.0.exr"), camera("o.12.exr"));
    assert_ne!(b.stat("o.0.json", "film_hash"), b.stat("o.12.json", "film_hash"), "things move");
    let before = b.bytes("t.0002.png");
    let said = run(2, "--frames 1-2 -o p.####.exr --png t.####.png");
    assert!(said.contains("t.0002.png is also read"), "{said}");
    assert!(b.bytes("t.0002.png") == before && !b.path("p.0001.exr").exists());
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
    // The last ones are the merge's: a part is no picture.
    let options = ["--width", "48", "--height", "40", "-q", "--half", "--reproducible", "--colorspace", "acescg"];
    let farm =
        ["farm", "slurm", SCENE, "-q", "--spp", "192", "--tasks", "3", "-o", "m.exr", "--job", "it's a job", "--"];
    b.run(0, b.command(&[&farm[..], &options, &["--png", "m.png", "--stats=m.json"]].concat()));
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
    // Warned at its first line of progress, which says that it renders. One that was done by then is tried again.
    let warned = || {
        let _ = std::fs::remove_file(b.path("it's a job/parts/1.part"));
        let mut child = task("1").stderr(Stdio::piped()).spawn().expect("bash starts");
        let mut lines = BufReader::new(child.stderr.take().expect("piped")).lines().map_while(Result::ok);
        lines.next().expect("a line of progress");
        signal(&child, "TERM");
        lines.for_each(drop);
        let code = child.wait().expect("it ends").code();
        assert!(code == Some(143) || code == Some(0), "{code:?}");
        assert_eq!(b.path("requeued").exists(), code == Some(143));
        code == Some(143)
    };
    assert!((0..20).any(|_| warned()), "no task was warned in time");
    assert!(b.path("it's a job/parts/1.part").exists(), "it saved its state");
    for number in ["1", "2"] {
        b.run(0, task(number));
    }
    let mut merge = Command::new("bash");
    merge.arg(b.path("it's a job/merge.sh")).current_dir(b.folder.path());
    b.run(0, merge);
    b.run(0, b.command(&[&["render", SCENE, "--spp", "192", "-o", "one.exr"][..], &options].concat()));
    assert_eq!(b.bytes("m.exr"), b.bytes("one.exr"));
    assert!(b.path("m.png").exists() && b.stat("m.json", "command") == "merge");
    let submit = String::from_utf8(b.bytes("it's a job/submit.sh")).expect("text");
    assert!(submit.contains("--dependency=afterok:$job"), "{submit}");
    // What a render refuses is refused before anything is written.
    let wrong = [&farm[..], &["--no-such-option"]].concat();
    assert!(b.run(2, b.command(&wrong)).contains("--no-such-option"));
    b.run(2, b.command(&[&farm[..], &["--progress", "none"]].concat()));
    for unknown in [&["--jpg", "m.jpg"][..], &["--png", "m.png", "--transparent"], &["-o", "part.exr"]] {
        assert!(b.run(2, b.command(&[&farm[..], unknown].concat())).contains("a part is no picture"));
    }
}

/// The array of a sequence: its frames, and no states once they are there.
#[test]
fn a_slurm_sequence_leaves_its_frames_alone() {
    let b = Bench::new();
    let farm = ["farm", "slurm", SCENE, "-q", "--frames", "1-3", "--tasks", "2", "-o", "f.exr", "--job", "job", "--"];
    let options = ["--width", "8", "--height", "6", "--spp", "1", "-q"];
    b.run(0, b.command(&[&farm[..], &options].concat()));
    for number in ["0", "1"] {
        let mut task = Command::new("bash");
        task.arg("job/array.sh").env("SLURM_ARRAY_TASK_ID", number).env_remove("SLURM_CPUS_PER_TASK");
        task.current_dir(b.folder.path());
        b.run(0, task);
    }
    assert_eq!(b.names(), ["f.0001.exr", "f.0002.exr", "f.0003.exr", "job"]);
    assert_eq!(std::fs::read_dir(b.path("job/parts")).expect("a folder").count(), 0);
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
    assert_eq!(*parts, json!(["0..4", "4..8"]));
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

/// Tasks of one frame each write files of their own. Oracle: their names.
#[test]
fn tasks_of_single_frames_lose_none() {
    let b = Bench::new();
    let farm = ["farm", "openjd", SCENE, "-q", "--frames", "1-2", "--tasks", "2", "-o", "f.exr", "--job", "job", "--"];
    let options = ["--width", "8", "--height", "6", "--spp", "1", "--png", "p.png", "--stats=s.json"];
    b.run(0, b.command(&[&farm[..], &options].concat()));
    let template: serde_json::Value = serde_json::from_slice(&b.bytes("job/template.json")).expect("valid JSON");
    let script = &template["steps"][0]["script"]["embeddedFiles"][0]["data"];
    let script = script.as_str().expect("a script").replace("{{Task.Param.Part}}", "$1");
    std::fs::write(b.path("run"), script.replace("'$1'", "\"$1\"")).expect("a writable folder");
    for part in ["1", "2"] {
        let mut command = Command::new("bash");
        command.args(["run", part]).current_dir(b.folder.path());
        b.run(0, command);
    }
    let expected = ["f.0001.exr", "f.0002.exr", "job", "p.0001.png", "p.0002.png", "run", "s.0001.json", "s.0002.json"];
    assert_eq!(b.names(), expected);
    let states = || std::fs::read_dir(b.path("job/parts")).expect("a folder").count();
    assert_eq!(states(), 2);
    let clean = &template["steps"][1]["script"]["actions"]["onRun"];
    let mut command = Command::new(clean["command"].as_str().expect("a command"));
    command.args(clean["args"].as_array().expect("words").iter().map(|word| word.as_str().expect("text")));
    b.run(0, command);
    assert_eq!(states(), 0);
    for wrong in [&["-o", "g.exr"][..], &["--skip-existing"], &["--resume", "a"], &["--png", "{{a}}.png"]] {
        b.run(2, b.command(&[&farm[..], wrong].concat()));
    }
}
