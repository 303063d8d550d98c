//! What accuracy costs: convergence, the study behind `pathspace accuracy`, FLIP against its published implementation,
//! and the options that trade accuracy for time or space.
//!
//! Oracles: the rate N⁻¹ of independent samples; the closed furnace, whose terms are ρᵏ; numbers printed by the
//! authors' `flip-evaluator` 1.7. Seeds are fixed. What depends on the clock (how much a budget affords) is asserted
//! only where the answer does not depend on it.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use glam::Vec3;
use pathspace::accuracy::flip;
use pathspace::film::Film;
use pathspace::film::exr::{ExrOptions, read_exr, through_half};
use pathspace::plan::options::{Crop, RenderOptions, Roulette, SamplerKind, Strategy};
use pathspace::render::{Absent, leave_out};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{AlphaMode, ColorSpace, Environment, Material, Scene, Texture, TextureId, TextureSlot, Wrap};
use pathspace::study::clock::Cost;
use pathspace::study::effects::{EffectRow, Kind, Side};
use pathspace::study::findings::Study;
use pathspace::study::measure::{self, Request};
use pathspace::study::report::{Report, Row, Setup};
use pathspace::study::{html, reference, runs, table};

use crate::common::{options, probe, render, shared};

/// A floor under an unoccluded square light, seen from above: one bounce, a smooth integrand.
fn lit_floor() -> Scene {
    let mut b = SceneBuilder::new();
    let floor = b.lambert(Vec3::new(0.8, 0.5, 0.3));
    let light = b.emitter(Vec3::ZERO, Vec3::splat(4.0));
    let square = |y: f32, r: f32| [[-r, -r], [r, -r], [r, r], [-r, r]].map(|[x, z]| Vec3::new(x, y, z));
    let mut up = square(0.0, 20.0);
    up.reverse();
    b.quad(up, floor);
    b.quad(square(3.0, 1.0), light);
    b.camera(Vec3::new(0.0, 2.0, 4.0), Vec3::ZERO, Vec3::Y, 0.5);
    b.build()
}

/// Slope of ln MSE against ln N over 4 to 128 samples, four runs each, 48×48 pixels, with the largest standard error.
fn convergence(scene: &Scene, sampler: SamplerKind, reference: &[f64]) -> (f64, f64) {
    let mut points = Vec::new();
    for level in 2..8 {
        for run in 0..4 {
            let base = floor_options(1 << level).seed(100 + 16 * run + level).sampler(sampler);
            let film = render(scene, base).film;
            let squares = film.pixels.iter().flat_map(|p| p.mean().into_iter().take(3));
            let mse = squares.zip(reference).map(|(v, r)| (v - r).powi(2)).sum::<f64>() / reference.len() as f64;
            points.push((((1u64 << level) as f64).ln(), mse.ln()));
        }
    }
    let line = runs::line(&points).expect("24 points");
    (line.slope, line.slope_error)
}

fn floor_options(spp: u64) -> RenderOptions {
    options(48, 48, spp).strategy(Strategy::LIGHT).max_depth(2)
}

/// HARDCASES §6.3. 4·2304·3 values a level scatter ln MSE by 1.6 % or so (channels move together), its slope by
/// 0.005: ±0.05 is ten of that. The reference has 4096 Sobol' points, whose error is 10⁻² of the smallest that is
/// measured, or less.
#[test]
fn independent_samples_converge_with_their_number_and_sobol_points_faster() {
    let scene = lit_floor();
    let reference: Vec<Film> = (0..2).map(|run| render(&scene, floor_options(2048).seed(9000 + run)).film).collect();
    let pixels = reference[0].pixels.iter().zip(&reference[1].pixels);
    let values: Vec<f64> = pixels.flat_map(|(a, b)| (0..3).map(|c| 0.5 * (a.mean()[c] + b.mean()[c]))).collect();
    assert!(values.iter().all(|v| *v > 1e-3), "the floor is lit everywhere");

    let (independent, error) = convergence(&scene, SamplerKind::Independent, &values);
    eprintln!("independent: slope {independent:.4} ± {error:.4}");
    assert!((independent + 1.0).abs() < 0.05, "independent: {independent} ± {error}");
    assert!(error < 0.01, "too noisy to tell: ± {error}");
    let (sobol, error) = convergence(&scene, SamplerKind::Sobol, &values);
    eprintln!("sobol: slope {sobol:.4} ± {error:.4}");
    // Steeper by far more than the scatter of either.
    assert!(sobol + 10.0 * error < -1.2, "sobol: {sobol} ± {error}");
}

/// A closed inward sphere that emits 1 and reflects a half, seen from inside.
fn furnace() -> Scene {
    let mut b = SceneBuilder::new();
    let material = b.emitter(Vec3::splat(0.5), Vec3::ONE);
    b.sphere(Vec3::ZERO, 1.0, 12, true, false, material);
    b.camera(Vec3::new(0.1, 0.2, -0.1), Vec3::new(0.3, -0.5, 0.8), Vec3::Y, 1.0);
    b.build()
}

/// Budgets of a study whose findings do not depend on how long it takes, in seconds: a study takes all that it is
/// given, so each is twice the last, and a machine that is busy with other tests pays at most twice what it needs.
const BUDGETS: [f64; 6] = [2.0, 4.0, 8.0, 16.0, 32.0, 64.0];

fn study_of(scene: &Scene, base: RenderOptions, budget: f64) -> (Study, Report) {
    let budget = Duration::from_secs_f64(budget);
    let (full, effects) = (false, false);
    let request = Request { base, budget, full, effects, reference: None, classes: None, load_s: 0.0 };
    let study = measure::run(scene, &request, Instant::now(), &mut |_| ControlFlow::Continue(()))
        .unwrap_or_else(|error| panic!("{error}"));
    let report = Report::new(&study, Setup { resolution: [8, 8], ..Setup::default() }, None);
    (study, report)
}

/// P03: by BSDF sampling without roulette every path of the furnace carries ρᵏ exactly, so a depth limit of M leaves
/// out ρᴹ of the mean and has a bias² of (ρᴹ·L)²/(L² + 0.01·L²), whatever the clock affords. Exact up to
/// f32: 10⁻⁵, in every pixel, so that few pixels show what many do.
#[test]
fn the_study_finds_the_truncation_of_the_furnace() {
    let base = options(8, 8, 1).strategy(Strategy::BSDF).roulette(Roulette::Off);
    let studies = BUDGETS.into_iter().map(|budget| study_of(&furnace(), base.clone(), budget));
    let (study, report) = studies.into_iter().find(|(study, _)| study.rounds >= 2).expect("two rounds within a minute");
    assert!(!study.interrupted);
    let rows: BTreeMap<&str, &Row> = report.settings.iter().map(|row| (row.name.as_str(), row)).collect();
    for depth in [2, 4, 8] {
        let row = rows[format!("--max-depth {depth}").as_str()];
        let left_out = 0.5f64.powi(depth);
        let mean = row.mean_error.expect("measured").value;
        assert!((mean + left_out).abs() < 1e-5, "depth {depth}: mean error {mean}");
        let square = row.bias_squared.expect("four runs at least").value;
        assert!((square - left_out * left_out / 1.01).abs() < 1e-5, "depth {depth}: bias² {square}");
    }
    let lengths = report.lengths.as_ref().expect("a round was finished");
    for (i, (share, left_out)) in lengths.share.iter().zip(&lengths.truncation).enumerate() {
        let rho = 0.5f64.powi(i as i32);
        assert!((share.value - 0.5 * rho).abs() < 1e-5, "{} edges: share {share:?}", i + 1);
        assert!((left_out.value + 0.5 * rho).abs() < 1e-5, "{} edges: left out {left_out:?}", i + 1);
    }
    assert!(lengths.default_truncation.abs() < 1e-12, "{}", lengths.default_truncation);
    // A picture without noise has no error, and nothing divides by it.
    let default = rows["default"];
    assert!(default.relmse.expect("measured").value.abs() < 1e-9 && default.efficiency.is_none());
    assert!(rows["--half"].mean_error.expect("measured").value.abs() < 2f64.powi(-11));
    for text in [table::text(&report), table::csv(&report), html::page(&report, &study)] {
        assert!(text.contains("--max-depth 4") && !text.contains("NaN") && !text.contains("inf"), "{text}");
    }
}

/// The prices of effects of a wall of alpha ¼ before white: without alpha it is black, an error of 0.75²/(0.75²·1.01),
/// whatever the clock affords. What it does not is told, in every form. Intervals miss once in 20, so the value
/// is held: of the mean of 2·10³ pixel samples at least, noise of 1 % at most, limit ten times that.
#[test]
fn the_study_prices_the_effects_of_a_scene() {
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::ONE);
    let black = b.material(Material {
        base_color: Vec3::ZERO,
        metallic: 0.0,
        specular: 0.0,
        alpha_mode: AlphaMode::Blend,
        base_alpha: 0.25,
        ..Material::default()
    });
    b.quad([(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)].map(|(x, y)| Vec3::new(x, y, 0.0)), black);
    b.cuboid(Vec3::new(-1.0, -1.0, 8.0), Vec3::new(1.0, 1.0, 9.0), false, white);
    b.environment(Environment::constant(Vec3::ONE));
    b.camera(Vec3::new(0.0, 0.0, 1.0), Vec3::ZERO, Vec3::Y, 0.5);
    let scene = b.build();
    let studies = BUDGETS.into_iter().map(|seconds| {
        let (base, budget) = (options(16, 16, 1).threads(1), Duration::from_secs_f64(seconds));
        let request = Request { base, budget, full: false, effects: true, classes: None, reference: None, load_s: 0.0 };
        measure::run(&scene, &request, Instant::now(), &mut |_| ControlFlow::Continue(()))
            .unwrap_or_else(|error| panic!("{error}"))
    });
    let priced = |study: &Study| {
        let missing = study.effects.iter().find_map(|row| Some((&row.name, row.not_measured.as_ref()?)));
        missing.is_none_or(|missing| {
            eprintln!("not priced: {missing:?}");
            false
        })
    };
    let study = studies.into_iter().find(priced).expect("all effects are priced within a minute");
    let report = Report::new(&study, Setup { resolution: [16, 16], ..Setup::default() }, None);
    let rows: BTreeMap<&str, &EffectRow> = study.effects.iter().map(|row| (row.name.as_str(), row)).collect();
    let names: Vec<&str> = rows.keys().copied().collect();
    let techniques = ["technique:bsdf", "technique:light"];
    let effects = ["alpha-blending", "depth:2", "depth:4", "depth:8", "environment"];
    assert_eq!(names, [&effects[..], &techniques].concat());
    // The white box is out of sight: no pixel has light that one technique alone would find.
    for name in techniques {
        let error = rows[name].error.expect("pairs").value;
        assert!(rows[name].kind == Kind::Technique && error < 0.05, "{:?}", rows[name]);
    }
    let alpha = rows["alpha-blending"];
    let error = alpha.error.expect("pairs").value;
    assert!((error - 1.0 / 1.01f64.sqrt()).abs() < 0.1, "{alpha:?}");
    assert!((alpha.mean_change.expect("pairs").value + 1.0).abs() < 1e-6, "{alpha:?}");
    assert!(alpha.pairs >= 4 && alpha.rays_per_path[0] > alpha.rays_per_path[1], "{alpha:?}");
    // Nothing in this picture has more than two edges.
    for depth in ["depth:4", "depth:8"] {
        assert_eq!(rows[depth].error_squared.map(|e| [e.low, e.value, e.high].map(f64::abs)), Some([0.0; 3]));
    }
    assert_eq!(study.shown.len(), 3);
    for text in [table::text(&report), html::page(&report, &study)] {
        assert!(text.contains("depth:8") && !text.contains("NaN") && !text.contains("inf"), "{text}");
    }
    let json = serde_json::to_value(&report).expect("numbers and names");
    assert_eq!(json["effects"].as_array().map(Vec::len), Some(7));
    assert_eq!(json["effects"][0]["kind"].as_str().map(|kind| kind.to_lowercase() == kind), Some(true));
    // No time at all: every row says so.
    let base = options(16, 16, 1).threads(1);
    let budget = Duration::from_millis(1);
    let request = Request { base, budget, full: false, effects: true, classes: None, reference: None, load_s: 0.0 };
    let study = measure::run(&scene, &request, Instant::now(), &mut |_| ControlFlow::Continue(()))
        .unwrap_or_else(|error| panic!("{error}"));
    assert!(study.effects.iter().all(|row| row.not_measured.is_some()), "{:?}", study.effects);
    let report = Report::new(&study, Setup { resolution: [16, 16], ..Setup::default() }, None);
    let told = "not measured, 7 of 7: alpha-blending, environment, technique:bsdf";
    assert!(table::text(&report).contains(told), "{}", table::text(&report));
}

/// A normal map without bumps (scaled by 0) is worth nothing: it changes the picture by rounding alone, 10⁻⁴ of it at
/// most. Oracle: the map. Pairs of equal seeds by hand, no clock.
#[test]
fn a_normal_map_without_bumps_is_worth_nothing() {
    let mut b = SceneBuilder::new();
    let slot = Some(TextureSlot { texture: TextureId(0), uv_set: 0 });
    let bumps =
        Material { metallic: 0.0, roughness: 0.5, normal_texture: slot, normal_scale: 0.0, ..Material::default() };
    let floor = b.material(bumps);
    let corners = [(-2.0, 2.0), (2.0, 2.0), (2.0, -2.0), (-2.0, -2.0)].map(|(x, z)| Vec3::new(x, 0.0, z));
    b.quad(corners, floor);
    b.point_light(Vec3::new(1.0, 2.0, 0.0), Vec3::splat(5.0));
    b.environment(Environment::constant(Vec3::splat(0.3)));
    b.camera(Vec3::new(0.0, 2.0, 3.0), Vec3::ZERO, Vec3::Y, 0.8);
    let mut scene = b.build();
    scene.textures = vec![Texture {
        name: "bumps".into(),
        width: 2,
        height: 2,
        texels: [[100, 90, 200, 255], [10, 120, 250, 255], [200, 128, 255, 255], [0, 0, 180, 255]]
            .into_iter()
            .collect(),
        color_space: ColorSpace::Linear,
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
        bilinear: true,
    }];
    for mesh in &mut scene.meshes {
        mesh.uvs = Some(mesh.positions.iter().map(|p| glam::Vec2::new(p.x, p.z)).collect());
        mesh.tangents = Some(vec![glam::Vec4::new(1.0, 0.0, 0.0, 1.0); mesh.positions.len()]);
    }
    let (mut bare, mut rest) = (scene.clone(), options(16, 16, 8));
    leave_out(&mut bare, &mut rest, &["normal-maps".to_string()], Absent::Refused).unwrap_or_else(|e| panic!("{e}"));
    let side = |scene: &Scene, seed: u64| {
        let film = render(scene, options(16, 16, 8).seed(seed)).film;
        let relmse = film.error_estimate().map(|estimate| estimate.relmse);
        let cost = Cost { wall_s: 1.0, cpu_s: 1.0 };
        Side { cost, relmse, rays_per_path: 1.0, picture: reference::values(&film) }
    };
    let pairs: Vec<[Side; 2]> = (0..4).map(|seed| [side(&scene, seed), side(&bare, seed)]).collect();
    let (row, _) = EffectRow::of(&bare.left_out[0], 8, 16, &pairs);
    assert!(row.error.expect("four pairs").high < 1e-4, "{row:?}");
    assert!(row.flip.expect("four pairs").value.abs() < 1e-4, "{row:?}");
    assert!(row.time_share.expect("four pairs").value.abs() < 1e-3, "{row:?}");
}

/// What the observer breaks off keeps what was measured, and a budget that is gone ends the study.
#[test]
fn a_study_that_is_broken_off_keeps_its_runs() {
    let scene = furnace();
    let request = Request {
        base: options(16, 16, 1),
        budget: Duration::from_secs(60),
        full: false,
        effects: false,
        reference: None,
        classes: Some(1024),
        load_s: 0.0,
    };
    let study = measure::run(&scene, &request, Instant::now(), &mut |step| {
        if step.what.starts_with("reference") { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
    .unwrap_or_else(|error| panic!("{error}"));
    assert!(
        study.interrupted
            && study.classes.is_none()
            && study.reference.is_none()
            && !study.pilot.is_empty()
            && !study.prices.is_empty()
    );
    let report = Report::new(&study, Setup { resolution: [16, 16], ..Setup::default() }, None);
    assert!(report.settings.is_empty() && report.notes[0].contains("signal"), "{:?}", report.notes);
    assert!(table::text(&report).contains("Price list") && html::page(&report, &study).contains("Price list"));
}

fn pathspace(arguments: &[&str], folder: &Path) -> std::process::Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pathspace"));
    command.args(arguments).current_dir(folder).output().expect("the binary starts")
}

#[test]
fn the_command_writes_its_report() {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.gltf");
    let folder = tempfile::tempdir().expect("a temporary folder");
    // A machine that is busy with other tests gets more time.
    let mut text = String::new();
    for budget in [4.0, 15.0, 60.0] {
        let (started, seconds) = (Instant::now(), format!("{budget}s"));
        let arguments =
            ["accuracy", scene, "--classes=1024", "--budget", &seconds, "--width", "32", "-o", "report", "--quiet"];
        let arguments = [&arguments[..], &["--price-per-core-hour", "0.04"]].concat();
        let output = pathspace(&arguments, folder.path());
        text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
        // The budget and a fifth, and what building and writing take.
        let took = started.elapsed().as_secs_f64();
        assert!(took < 1.2 * budget + 5.0, "{took:.1} s for a budget of {budget} s");
        if text.contains("Path lengths") {
            break;
        }
    }
    for part in [
        "Price list",
        "Techniques",
        "Knobs",
        "Path lengths",
        "Classes of paths",
        "--sampler independent",
        "--max-depth 2",
    ] {
        assert!(text.contains(part), "'{part}' is missing in\n{text}");
    }

    let read = |name: &str| std::fs::read_to_string(folder.path().join("report").join(name)).expect(name);
    let json: serde_json::Value = serde_json::from_str(&read("report.json")).expect("valid JSON");
    assert_eq!(json["schema"], 1);
    assert_eq!(json["setup"]["resolution"], serde_json::json!([32, 32]));
    assert_eq!(json["classes"]["paths"], 1024);
    assert!(json["prices"].as_array().is_some_and(|prices| prices.len() == 5), "{}", json["prices"]);
    // What the film's estimate takes is told: some time, and less than the study.
    let estimate = json["setup"]["estimate_s"].as_f64().expect("the pilot has a last look");
    assert!(0.0 < estimate && estimate < json["setup"]["seconds"].as_f64().expect("a number"), "{}", json["setup"]);
    assert!(json["notes"].to_string().contains("An estimate of the error takes"), "{}", json["notes"]);
    let settings = json["settings"].as_array().expect("a list");
    assert!(settings.iter().any(|row| row["name"] == "default" && row["relmse"]["value"].as_f64() > Some(0.0)));
    let csv = read("report.csv");
    let columns = csv.lines().next().expect("a header").split(',').count();
    assert!(csv.lines().count() == settings.len() + 1 && csv.lines().all(|line| line.split(',').count() == columns));
    let page = read("report.html");
    assert!(page.contains("<svg") && page.contains("data:image/png;base64,"));
    // The price of a run is that of the threads for its time; the page begins with what it looks like.
    let (run, setup) = (&json["prices"][0]["measured"], &json["setup"]);
    if let Some(seconds) = run["seconds"].as_f64() {
        let cores = setup["threads"].as_f64().expect("a number");
        let money = run["money"].as_f64().expect("a price was given");
        assert!((money / (0.04 * cores * seconds / 3600.0) - 1.0).abs() < 1e-9, "{run}");
        let at = |heading: &str| page.find(heading).expect(heading);
        assert!(at("What an error looks like") < at("The study") && page.contains("<b>10 %</b>: "));
    }
    for foreign in ["http://", "https://", "<script", "src=\"/", "@import", "NaN"] {
        assert!(!page.contains(foreign), "the page contains {foreign}");
    }
}

#[test]
fn references_of_another_size_are_refused() {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.gltf");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let film = Film::new((12, 12), Crop { x: 0, y: 0, width: 12, height: 12 });
    film.write_exr(folder.path().join("black.exr"), &ExrOptions::default()).expect("a writable folder");
    for (size, filter) in [("5", "box"), ("6", "tent"), ("24", "box")] {
        let arguments =
            ["accuracy", scene, "--reference", "black.exr", "--width", size, "--height", size, "--filter", filter];
        let output = pathspace(&arguments, folder.path());
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && error.contains("--reference"), "{size} {filter}: {error}");
    }
}

/// A deterministic number in [0, 1) for a pixel and a channel (SplitMix64's finaliser).
fn hash(i: usize, c: usize) -> f32 {
    let z = (3 * i + c) as u64 ^ 0x9e37_79b9_7f4a_7c15;
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
}

/// Three pairs made of the shared references: each reference reduced to 128 columns by averaging blocks; against it the
/// same with noise (±50 %, a value each), with fireflies (every 97th pixel times 50), and moved by one pixel and a
/// fifth darker.
///
/// The expected means were printed by the authors' program on the very same files: `pip install flip-evaluator==1.7`,
/// this test with PATHSPACE_KEEP_PICTURES=1, then `flip -r flip-NAME-reference.exr -t flip-NAME-image.exr` in
/// target/tmp (it prints six digits; more by its Python function `evaluate`). The limit is that of two summation orders
/// in f32.
#[test]
fn flip_agrees_with_the_published_implementation_on_three_scenes() {
    let Some(shared) = shared("FLIP on three scenes") else { return };
    let cases = [("cornell-box", FLIP_NOISE), ("veach-mis", FLIP_FIREFLIES), ("env-object", FLIP_MOVED)];
    for (kind, (name, expected)) in cases.into_iter().enumerate() {
        let picture = read_exr(&shared.join(format!("reference/{name}.exr"))).expect("a picture");
        let block = picture.width / 128;
        let (w, h) = (picture.width / block, picture.height / block);
        let mut reference = vec![[0.0f32; 3]; w * h];
        for (y, x) in (0..h * block).flat_map(|y| (0..w * block).map(move |x| (y, x))) {
            for c in 0..3 {
                let share = (block * block) as f32;
                reference[y / block * w + x / block][c] += picture.rgb[y * picture.width + x][c] / share;
            }
        }
        let image: Vec<[f32; 3]> = (0..w * h)
            .map(|i| match kind {
                0 => [0, 1, 2].map(|c| reference[i][c] * (0.5 + hash(i, c))),
                1 => reference[i].map(|v| if i % 97 == 0 { 50.0 * v } else { v }),
                _ => reference[i - usize::from(i % w > 0)].map(|v| 0.8 * v),
            })
            .collect();
        if std::env::var_os("PATHSPACE_KEEP_PICTURES").is_some() {
            let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
            for (what, values) in [("reference", &reference), ("image", &image)] {
                film_of(values, w)
                    .write_exr(folder.join(format!("flip-{name}-{what}.exr")), &ExrOptions::default())
                    .expect("ok");
            }
        }
        let found = flip::hdr_flip(&image, &reference, w);
        eprintln!("{name}: {found:.6}");
        assert!((found - expected).abs() < 2e-5, "{name}: {found} for {expected}");
    }
}

/// Means by flip-evaluator 1.7.
const FLIP_NOISE: f64 = 0.17733225;
const FLIP_FIREFLIES: f64 = 0.09997591;
const FLIP_MOVED: f64 = 0.25078359;

fn film_of(values: &[[f32; 3]], width: usize) -> Film {
    let (w, h) = (width as u32, (values.len() / width) as u32);
    let mut film = Film::new((w, h), Crop { x: 0, y: 0, width: w, height: h });
    film.pixels.iter_mut().zip(values).for_each(|(pixel, rgb)| pixel.add(0, *rgb, 1.0, 1.0));
    film
}

/// The soft and hard thresholds of idiff, one pixel of four off by 0.1 and one by 0.3. Exact.
#[test]
fn compare_warns_and_fails_as_idiff_does() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let images = [("a.exr", [0.5f32; 4]), ("b.exr", [0.5, 0.6, 0.8, 0.5])];
    for (name, values) in images {
        let film = film_of(&values.map(|v| [v; 3]), 2);
        film.write_exr(folder.path().join(name), &ExrOptions::default()).expect("a writable folder");
    }
    let cases: [(&[&str], i32); 8] = [
        (&[], 2),
        (&["--fail", "0.2"], 2),
        (&["--fail", "0.2", "--failpercent", "25"], 1),
        (&["--fail", "1"], 1),
        (&["--fail", "1", "--warnpercent", "50"], 0),
        (&["--fail", "1", "--warnpercent", "50", "--hardwarn", "0.2"], 1),
        (&["--fail", "1", "--warn", "0.2", "--warnpercent", "24"], 1),
        (&["--fail", "1", "--hardfail", "0.2"], 2),
    ];
    for (flags, expected) in cases {
        let arguments: Vec<&str> = ["compare", "a.exr", "b.exr"].iter().chain(flags).copied().collect();
        assert_eq!(pathspace(&arguments, folder.path()).status.code(), Some(expected), "{flags:?}");
    }
}

/// P01 with roulette from the first, third and ninth vertex: the mean is 1/(1 − ρ) each time. 4.9 standard errors
/// (10⁻⁶ each).
#[test]
fn where_roulette_starts_does_not_move_the_mean() {
    for start in [1, 3, 9] {
        let options = RenderOptions::default().roulette_start(start).seed(31 + u64::from(start));
        let estimate = probe(&furnace(), Vec3::new(0.1, 0.2, -0.1), Vec3::new(0.3, -0.5, 0.8), 1 << 15, options);
        estimate.expect(&format!("roulette from vertex {start}"), 2.0, 2e-5, 1e-2);
    }
}

/// A 16-bit file holds every value rounded once: relative 2⁻¹¹ at most, saturated at 65504. Exact.
#[test]
fn half_pictures_are_rounded_once() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("half.exr");
    let film = film_of(&[[0.1, 1.0, 65000.0], [1e6, -1e6, 1.0 / 3.0]], 2);
    film.write_exr(&path, &ExrOptions::default().half(true)).expect("a writable folder");
    let read = read_exr(&path).expect("just written").rgb;
    assert_eq!(read[1][..2], [65504.0, -65504.0]);
    for (read, value) in [(read[0][0], 0.1f32), (read[0][1], 1.0), (read[0][2], 65000.0), (read[1][2], 1.0 / 3.0)] {
        assert_eq!(f64::from(read), through_half(f64::from(value)));
        assert!((read / value - 1.0).abs() <= 2f32.powi(-11), "{read} for {value}");
    }
    let output = pathspace(&["render", "missing.gltf", "-o", "a.png", "--half"], folder.path());
    assert_eq!(output.status.code(), Some(2));
    let output =
        pathspace(&["render", "missing.gltf", "-o", "a.exr", "--robust", "off", "--backend", "obvhs"], folder.path());
    assert!(output.status.code() == Some(2) && String::from_utf8_lossy(&output.stderr).contains("--robust"));
}
