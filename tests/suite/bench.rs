//! `pathspace bench` and what it stands on: the rays of a frame are recorded as they were traced, replays meet what the
//! render met, and the report has the keys that programs read. Deterministic but for the rates, of which only signs are
//! judged.

use std::path::Path;

use assert_cmd::Command;
use pathspace::Scene;
use pathspace::backend::{self, BackendKind, BackendOptions, QueryMode};
use pathspace::bench::agree::Agreement;
use pathspace::bench::record::{RayClass, Recording, count};
use pathspace::bench::replay;
use pathspace::render::Renderer;

use crate::common::options;

/// More than any recording here takes.
const AMPLE_BYTES: usize = 1 << 30;

fn cornell_box() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.gltf");
    Scene::load(path).expect("the scene comes along")
}

/// Oracle: the render's own counters, and the film of a render without a recorder.
#[test]
fn a_recording_holds_every_ray_of_the_frame_and_changes_nothing() {
    let scene = cornell_box();
    let options = options(40, 24, 6).threads(2);
    let renderer = Renderer::new(&scene, options).expect("valid options");
    let (recording, render) = Recording::of(&renderer, AMPLE_BYTES).expect("a render");
    let counters = &render.counters;
    assert_eq!(recording.stride, 1);
    assert_eq!(recording.rays(), [counters.rays_camera, counters.rays_bounce, counters.rays_shadow]);
    assert_eq!(render.film.hash(), renderer.render().expect("a render").film.hash());
    for wave in &recording.waves {
        assert_eq!(wave[0].class, RayClass::Camera, "a wave begins with its camera rays");
        assert!(wave[1..].iter().all(|batch| batch.class != RayClass::Camera && batch.len > 0));
    }
}

/// Oracle: the budget, and the counters. Waves of one render differ in size, so the kept part is held to a factor of 2.
#[test]
fn a_small_budget_keeps_waves_spread_over_the_frame() {
    let scene = cornell_box();
    let renderer = Renderer::new(&scene, options(64, 64, 4)).expect("valid options");
    let budget = 4 << 20;
    let (recording, render) = Recording::of(&renderer, budget).expect("a render");
    let bytes: usize = recording.waves.iter().flatten().map(|batch| size_of_val(batch.rays.as_slice())).sum();
    assert!(bytes <= budget && recording.stride >= 2, "{bytes} bytes, one wave of {}", recording.stride);
    let kept = (recording.rays()[0] * recording.stride) as f64 / render.counters.rays_camera as f64;
    assert!((0.5..2.0).contains(&kept), "{kept} of the frame's camera rays");

    let sample = recording.sample(1000);
    assert!(sample.len() < recording.waves.len());
    assert!(count(&sample).iter().all(|rays| *rays >= 1000), "{:?}", count(&sample));
}

/// Oracle: `brute`, whose hits obvhs has bit for bit; those of the others differ by rounding only, so no ray of this
/// closed box may change from hit to miss or move by more than the stated tolerance.
#[test]
fn replays_meet_the_same_in_every_backend_and_mode() {
    let scene = cornell_box();
    let renderer = Renderer::new(&scene, options(24, 24, 4)).expect("valid options");
    let (recording, _) = Recording::of(&renderer, AMPLE_BYTES).expect("a render");
    let waves: Vec<_> = recording.waves.iter().map(Vec::as_slice).collect();
    let build = |kind, mode| {
        backend::select::build(kind, renderer.geometry(), &BackendOptions::with_mode(mode))
            .unwrap_or_else(|e| panic!("{e}"))
    };
    let reference = replay::outcomes(build(BackendKind::Brute, QueryMode::Single).as_ref(), &waves);
    assert_eq!(reference.len() as u64, recording.rays().iter().sum::<u64>());
    for &kind in BackendKind::available() {
        for mode in QueryMode::ALL {
            let outcomes = replay::outcomes(build(kind, mode).as_ref(), &waves);
            let agreement = Agreement::of(&waves, &outcomes, &reference);
            assert_eq!(agreement.rays, reference.len() as u64);
            assert_eq!((agreement.hit_differs, agreement.distance_differs), (0, 0), "{} {mode}", kind.name());
            let is_exact = matches!(kind, BackendKind::Obvhs | BackendKind::Brute);
            assert!(!is_exact || outcomes == reference, "{} {mode}", kind.name());
        }
    }

    // Every ray is timed once a replay, whoever traces it.
    let pool = replay::pool(2).expect("two threads");
    let bare = replay::replay(renderer.backend(), &waves, None, &pool);
    assert_eq!(bare.rays, recording.rays());
    assert!(bare.seconds.iter().all(|seconds| *seconds > 0.0) && bare.copy_seconds > 0.0);
    let shadow = replay::replay(renderer.backend(), &waves, Some(RayClass::Shadow), &pool);
    assert_eq!(shadow.rays, [0, 0, recording.rays()[2]]);
}

fn bench(arguments: &[&str]) -> std::process::Output {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.gltf");
    let mut command = Command::cargo_bin("pathspace").expect("the package has this binary");
    command.arg("bench").arg(scene).args(arguments).env_remove("SLURM_CPUS_PER_TASK");
    command.output().expect("the binary starts")
}

/// Oracle: the keys of the contract, and what the numbers mean.
#[test]
fn the_report_has_the_keys_that_programs_read() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let chart = folder.path().join("rates.svg");
    let chart_name = chart.to_str().expect("a plain name");
    let output = bench(&["--json", "-q", "-o", chart_name, "--width", "48", "--spp", "4", "--pairs", "1", "-t", "2"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON on stdout");

    let has = |value: &serde_json::Value, keys: &[&str]| {
        for key in keys {
            assert!(value.get(key).is_some_and(|v| !v.is_null()), "no {key} in {value}");
        }
    };
    has(&report, &["machine", "backends", "agreement", "frame"]);
    has(&report["machine"], &["cpu", "isa", "threads"]);
    has(&report["agreement"], &["rays", "hit_differs", "distance_differs"]);
    has(&report["frame"], &["spp", "render_s", "bare_trace_s", "tracing_efficiency", "mpaths_per_s"]);
    assert_eq!(report["frame"]["spp"], 4);
    let efficiency = report["frame"]["tracing_efficiency"].as_f64().expect("a number");
    assert!(efficiency > 0.0 && efficiency < 1.5, "tracing efficiency {efficiency}");
    assert_eq!(report["agreement"]["hit_differs"], 0);
    let elsewhere = report["elsewhere"].as_array().expect("a list");
    assert_eq!(elsewhere.len(), BackendKind::available().len());
    assert!(elsewhere.iter().all(|other| other["bare_trace_s"].as_f64().is_some_and(|s| s > 0.0)), "{elsewhere:?}");

    let backends = report["backends"].as_array().expect("a list");
    // Those that trace any scene, and `flat`, which this one is rendered with.
    assert_eq!(backends.len(), BackendKind::available().len() + 1);
    for backend in backends {
        has(backend, &["name", "version", "build_s", "bvh_bytes", "rays"]);
        let rates = backend["rays"].as_array().expect("a list");
        for rate in rates {
            has(rate, &["class", "mode", "mode_effective", "threads", "mrays_per_s"]);
            assert!(rate["mrays_per_s"].as_f64().is_some_and(|r| r > 0.0 && r.is_finite()), "{rate}");
        }
        let modes = if backend["name"] == "embree" { QueryMode::ALL.len() } else { 1 };
        assert_eq!(rates.len(), modes * RayClass::ALL.len() * 2, "{}", backend["name"]);
    }

    let drawing = std::fs::read_to_string(chart).expect("the chart");
    assert!(drawing.starts_with("<svg") && drawing.ends_with("</svg>\n"));
}

#[test]
fn usage_errors_come_before_any_work() {
    for arguments in [&["-o", "rates.png"][..], &["--backend", "obvhs", "--isa", "sse2"], &["--pairs", "0"]] {
        let output = bench(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

/// Oracle: the definitions of the columns, and the names of the scenes. The three smallest of the suite, and a file.
#[test]
fn the_suite_is_a_table_of_backends_and_scenes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let map = folder.path().join("heat.svg");
    let mut arguments = vec!["--suite", "--suite-triangles", "400", "--width", "16", "--height", "16", "-t", "2", "-q"];
    let mut table = arguments.clone();
    arguments.extend(["--json", "-o", map.to_str().expect("a plain name")]);
    let output = bench(&arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON on stdout");
    let rows = report["scenes"].as_array().expect("a list");
    let names: Vec<&str> = rows.iter().map(|row| row["name"].as_str().expect("a name")).collect();
    assert_eq!(names[..3], ["boxes-in-the-open", "room-of-8-boxes", "room-of-30-boxes"]);
    assert!(names.len() == 4 && names[3].ends_with("scene.gltf"), "{names:?}");
    let parts: Vec<&str> = rows.iter().map(|row| row["part"].as_str().expect("a part")).collect();
    assert_eq!(parts, ["fit", "test", "fit", "file"]);
    for row in rows {
        let timed = row["timed"].as_array().expect("a list");
        let over: Vec<f64> = timed.iter().map(|timed| timed["over_fastest"].as_f64().expect("a number")).collect();
        assert_eq!(over.iter().copied().fold(f64::INFINITY, f64::min), 1.0, "{over:?}");
        let chosen = timed.iter().position(|timed| timed["name"] == row["chosen"]).expect("the choice is measured");
        assert_eq!(row["chosen_over_fastest"], over[chosen]);
        assert!(row["reason"].as_str().is_some_and(|reason| !reason.is_empty()));
    }
    let verdicts = report["verdicts"].as_array().expect("a list");
    let fastest: u64 = verdicts.iter().map(|verdict| verdict["fastest"].as_u64().expect("a number")).sum();
    assert_eq!((verdicts.len(), fastest), (BackendKind::available().len(), 4));
    let drawing = std::fs::read_to_string(&map).expect("the map");
    assert!(drawing.starts_with("<svg") && names.iter().all(|name| drawing.contains(name)));

    table[2] = "110";
    let output = bench(&table);
    let text = String::from_utf8(output.stdout).expect("text");
    assert!(output.status.success() && text.contains("room-of-8-boxes") && text.contains("within 5 %"), "{text}");
}
