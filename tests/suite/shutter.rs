//! Pictures of what moves while the shutter is open. Oracles: the mean of pictures of the scene at rest, at times all
//! over the shutter; one strategy against another; bits. Comparisons: Welch's t per block of 8×8 pixels over
//! independent seeds, family-wise false-alarm rate 10⁻⁴ each; seeds fixed. The closed form is hard case M06, the
//! backends' agreement is in the conformance matrix.

use glam::{Affine3A, Quat, Vec3};
use pathspace::backend::BackendKind;
use pathspace::plan::Gate;
use pathspace::plan::options::{Lens, LightPaths, RenderOptions, SamplerKind, Strategy};
use pathspace::render::Renderer;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::motion::{Span, Track, between, part_of};
use pathspace::scene::{AlphaMode, LoadOptions, Material, Mesh, MeshId, Scene, Shape, Shutter};
use pathspace_stat::{Moments, welch};

use crate::common::{options, render};

const SIDE: u32 = 32;
const BLOCK: u32 = 8;
const SEEDS: u64 = 8;

/// A room with a lamp, in which a mirror turns, a smooth ball and a veil go by, a small lamp crosses, and the camera
/// passes.
pub fn moving_room() -> Scene {
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::new(0.7, 0.6, 0.5));
    let light = b.emitter(Vec3::ZERO, Vec3::splat(5.0));
    let small = b.emitter(Vec3::splat(0.3), Vec3::new(2.0, 6.0, 9.0));
    let mirror = b.metal(Vec3::splat(0.9), 0.0);
    let gold = b.metal(Vec3::new(0.9, 0.7, 0.4), 0.15);
    let veil =
        Material { base_alpha: 0.5, alpha_mode: AlphaMode::Blend, specular: 0.0, metallic: 0.0, ..Material::default() };
    let veil = b.material(veil);
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
    b.quad([[-0.4, 0.99, -0.4], [0.4, 0.99, -0.4], [0.4, 0.99, 0.4], [-0.4, 0.99, 0.4]].map(Vec3::from), light);

    let square = |b: &mut SceneBuilder, half: f32, material| {
        let corners = [(-half, -half), (half, -half), (half, half), (-half, half)];
        b.mesh(corners.map(|(x, y)| Vec3::new(x, y, 0.0)).to_vec(), vec![[0, 1, 2], [0, 2, 3]], material)
    };
    let way = |parts: usize, at: &dyn Fn(f32) -> Affine3A| (0..=parts).map(|i| at(i as f32 / parts as f32)).collect();
    let glass = square(&mut b, 0.4, mirror);
    b.place_moving(
        glass,
        way(4, &|t| {
            Affine3A::from_rotation_translation(Quat::from_rotation_y(0.9 * t - 0.6), Vec3::new(-0.45, -0.3, -0.5))
        }),
    );
    let sheet = square(&mut b, 0.35, veil);
    b.place_moving(sheet, way(1, &|t| Affine3A::from_translation(Vec3::new(0.7 - 0.9 * t, 0.3, -0.2))));
    let lamp = square(&mut b, 0.12, small);
    b.place_moving(lamp, way(1, &|t| Affine3A::from_translation(Vec3::new(0.6 * t - 0.3, 0.45, -0.9))));
    let ball = ball(&mut b, gold);
    b.place_moving(
        ball,
        way(1, &|t| {
            Affine3A::from_scale_rotation_translation(
                Vec3::splat(1.1),
                Quat::IDENTITY,
                Vec3::new(0.4, 0.8 * t - 0.8, -0.3),
            )
        }),
    );
    b.camera(Vec3::new(-0.1, 0.0, 0.95), Vec3::new(-0.1, 0.0, 0.0), Vec3::Y, 1.3);
    let mut scene = b.build();
    let from = scene.cameras[0].world_from_camera;
    let to = Affine3A::from_translation(Vec3::new(0.2, 0.0, 0.0)) * from;
    scene.motion.cameras = vec![Track { index: 0, steps: vec![from, to] }];
    scene.validate().expect("a sound scene");
    scene
}

/// A smooth ball around the origin, not placed. (Stretched, its interpolated normals would depend on whether it is
/// baked.)
fn ball(b: &mut SceneBuilder, material: pathspace::scene::MaterialId) -> MeshId {
    let mut alone = SceneBuilder::new();
    let any = alone.lambert(Vec3::ONE);
    alone.sphere(Vec3::ZERO, 0.3, 8, false, true, any);
    let mesh = alone.build().meshes.remove(0);
    b.full_mesh(pathspace::scene::Mesh { material, ..mesh })
}

/// The moving room, in which the ball changes its shape, and a soft sheet and a lamp besides.
fn changing_room() -> Scene {
    let mut scene = moving_room();
    let changed = |of: &dyn Fn(Vec3) -> Vec3, mesh: &Mesh| mesh.positions.iter().map(|&p| of(p)).collect::<Vec<Vec3>>();
    for mesh in scene.motion.instances.iter().map(|track| scene.instances[track.index].mesh.index()).collect::<Vec<_>>()
    {
        let mesh = &mut scene.meshes[mesh];
        // The mirror stays plane, and turns in itself.
        let squeezed =
            |s: f32| move |p: Vec3| p * Vec3::new(1.0 + s, 1.0 - 0.5 * s, 1.0) + Vec3::new(0.1 * s, 0.0, 0.0);
        mesh.later = [0.3, 0.7]
            .iter()
            .map(|&s| {
                let positions = changed(&squeezed(s), mesh);
                let normals = mesh.normals.as_ref().map(|normals| {
                    normals.iter().map(|&n| (n / Vec3::new(1.0 + s, 1.0 - 0.5 * s, 1.0)).normalize()).collect()
                });
                Shape { positions, normals, tangents: None }
            })
            .collect();
    }
    scene.validate().expect("a sound scene");
    scene
}

/// Positions, normals, mirrors, shadows, veils and emission of what changes its shape, as of what moves.
#[test]
fn a_picture_of_changing_shapes_is_the_mean_of_those_at_rest() {
    expect_mean_of_those_at_rest(&changing_room());
}

/// The scene as it stands at `time`, without a shutter.
fn at_rest(scene: &Scene, time: f32) -> Scene {
    let mut still = scene.clone();
    let motion = std::mem::take(&mut still.motion);
    let pose = |track: &Track| {
        let (part, fraction) = part_of(time, track.steps.len() - 1);
        between(&track.steps[part], &track.steps[part + 1], fraction)
    };
    motion.instances.iter().for_each(|track| still.instances[track.index].world_from_object = pose(track));
    motion.cameras.iter().for_each(|track| still.cameras[track.index].world_from_camera = pose(track));
    for mesh in still.meshes.iter_mut().filter(|mesh| !mesh.later.is_empty()) {
        let (part, fraction) = part_of(time, mesh.later.len());
        let to = mesh.later[part].clone();
        let from = part.checked_sub(1).map_or_else(|| mesh.clone(), |part| mesh.shaped(&mesh.later[part].clone()));
        mesh.positions = from.positions.iter().zip(&to.positions).map(|(a, &b)| a.lerp(b, fraction)).collect();
        let normals = from.normals.iter().flatten().zip(to.normals.iter().flatten());
        let normals: Vec<Vec3> = normals.map(|(a, &b)| a.lerp(b, fraction).normalize()).collect();
        mesh.normals = mesh.normals.is_some().then_some(normals);
        mesh.later.clear();
    }
    still
}

/// Means of the blocks of a picture.
fn blocks(scene: &Scene, options: RenderOptions) -> Vec<f64> {
    let film = render(scene, options).film;
    let mut sums = vec![0.0; (SIDE / BLOCK * (SIDE / BLOCK)) as usize];
    for (i, pixel) in (0u32..).zip(&film.pixels) {
        let m = pixel.mean();
        let block = i / SIDE / BLOCK * (SIDE / BLOCK) + i % SIDE / BLOCK;
        sums[block as usize] += (m[0] + m[1] + m[2]) / f64::from(3 * BLOCK * BLOCK);
    }
    sums
}

/// Moments of every block over the seeds.
fn moments(picture: impl Fn(u64) -> Vec<f64>) -> Vec<Moments> {
    let mut moments = vec![Moments::default(); (SIDE / BLOCK * (SIDE / BLOCK)) as usize];
    for seed in 0..SEEDS {
        moments.iter_mut().zip(picture(seed)).for_each(|(block, mean)| block.push(mean));
    }
    moments
}

fn expect_equal(what: &str, a: &[Moments], b: &[Moments]) {
    let least = 1e-4 / a.len() as f64;
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        let test = welch(a, b);
        assert!(test.p_value > least, "{what}, block {i}: {} against {}, {test:?}", a.mean, b.mean);
    }
    let z = a.iter().zip(b).map(|(a, b)| a.mean - b.mean).sum::<f64>()
        / a.iter().zip(b).map(|(a, b)| (a.variance() + b.variance()) / SEEDS as f64).sum::<f64>().sqrt();
    assert!(z.abs() <= 4.9, "{what}: the whole differs by {z:.2} standard errors");
    let noise = a.iter().map(|a| a.standard_error() / a.mean).fold(0.0, f64::max);
    assert!(noise < 0.05, "{what}: too noisy to see much, {noise}");
}

fn independent(seed: u64, spp: u64) -> RenderOptions {
    options(SIDE, SIDE, spp).seed(seed).sampler(SamplerKind::Independent)
}

/// Positions, normals, mirrors, shadows, veils, emission and camera at the time of each path: together they are the
/// mean over the shutter. Sobol' points for times as well.
#[test]
fn a_moving_picture_is_the_mean_of_those_at_rest() {
    expect_mean_of_those_at_rest(&moving_room());
}

fn expect_mean_of_those_at_rest(scene: &Scene) {
    const TIMES: u64 = 32;
    // A time in each part of the shutter, so that the times add little noise of their own.
    let still = moments(|seed| {
        let mut rng = pathspace_stat::Pcg32::new(seed, 17);
        let mut mean = vec![0.0; (SIDE / BLOCK * (SIDE / BLOCK)) as usize];
        for i in 0..TIMES {
            let time = (i as f32 + rng.next_f32()) / TIMES as f32;
            let picture = blocks(&at_rest(scene, time), independent(1000 * (seed + 1) + i, 4));
            mean.iter_mut().zip(picture).for_each(|(mean, block)| *mean += block / TIMES as f64);
        }
        mean
    });
    for &kind in BackendKind::available() {
        let moving = moments(|seed| blocks(scene, independent(seed, 64).backend(kind)));
        expect_equal(kind.name(), &moving, &still);
    }
    let sobol = moments(|seed| blocks(scene, independent(seed, 64).sampler(SamplerKind::Sobol)));
    expect_equal("sobol", &sobol, &still);
    // What the test can see: the picture at the middle of the shutter is another one.
    let middle = moments(|seed| blocks(&at_rest(scene, 0.5), independent(seed, 64)));
    let differ = |(a, b): (&Moments, &Moments)| welch(a, b).p_value < 1e-6;
    assert!(middle.iter().zip(&still).filter(|&pair| differ(pair)).count() > 3, "the middle stands for all");
}

/// Light paths find what moving mirrors throw, at the time of each path, with the weights of all three techniques.
/// Oracle: the picture without them.
#[test]
fn light_paths_have_the_time_of_what_moves() {
    let scene = moving_room();
    let of = |light_paths| moments(|seed| blocks(&scene, independent(seed, 48).light_paths(light_paths)));
    expect_equal("light paths", &of(LightPaths::Share(1.0)), &of(LightPaths::Off));
}

/// Moving lamps are found by BSDF sampling alone, whatever the strategy; the weights of the lamp at rest add up as
/// ever.
#[test]
fn strategies_agree_on_moving_lamps() {
    let scene = moving_room();
    let of = |strategy, spp| moments(|seed| blocks(&scene, independent(seed, spp).strategy(strategy)));
    let mis = of(Strategy::MIS, 64);
    for (strategy, spp) in [(Strategy::MIS_BALANCE, 64), (Strategy::LIGHT, 64), (Strategy::BSDF, 256)] {
        expect_equal(&format!("{strategy}"), &of(strategy, spp), &mis);
    }
}

/// A shutter of nearly no length shows the scene at that time. By BSDF sampling alone, which finds moving lamps as it
/// finds others, the paths are the same but for rounding: the pictures differ by less than a thousandth, those of two
/// times by more than a tenth.
#[test]
fn short_shutters_show_a_moment() {
    let scene = moving_room();
    let strategy = Strategy::BSDF;
    let picture = |scene: &Scene| blocks(scene, options(SIDE, SIDE, 64).strategy(strategy));
    let difference =
        |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>() / b.iter().sum::<f64>();
    let moments = [0.1, 0.8].map(|time| {
        let mut short = at_rest(&scene, time);
        let after = at_rest(&scene, time + 1e-5);
        let end = |i: usize| after.instances[i].world_from_object;
        short.motion.shutter = scene.motion.shutter;
        short.motion.instances = (scene.motion.instances.iter())
            .map(|t| Track { index: t.index, steps: vec![short.instances[t.index].world_from_object, end(t.index)] })
            .collect();
        let (short, moment) = (picture(&short), picture(&at_rest(&scene, time)));
        let off = difference(&short, &moment);
        assert!(off < 1e-3, "at {time} the difference is {off}");
        moment
    });
    let apart = difference(&moments[0], &moments[1]);
    assert!(apart > 0.1, "{apart}");
}

#[test]
fn threads_passes_and_instruction_sets_change_no_bit() {
    let scene = moving_room();
    for &kind in BackendKind::available() {
        let lens = Some(Lens { radius_m: 0.01, focus_m: 1.2 });
        let base = options(37, 29, 6).backend(kind).lens(lens);
        let hash = |options: RenderOptions| render(&scene, options).film.hash();
        let one = hash(base.clone().threads(1));
        for threads in [2, 5] {
            assert_eq!(hash(base.clone().threads(threads)), one, "{}, {threads} threads", kind.name());
        }
        if kind != BackendKind::Embree && kind.pins("avx2") {
            assert_eq!(hash(base.clone().isa("avx2")), one, "{}: avx2", kind.name());
        }
        let first = render(&scene, base.clone().spp(2));
        let resumed = Renderer::new(&scene, base.clone()).expect("renders").resume(first).expect("goes on");
        assert_eq!(resumed.film.hash(), one, "{}: in two parts", kind.name());
        let forced = base.clone().forced(Gate::ALL);
        assert_eq!(hash(forced), one, "{}: every gate", kind.name());
    }
}

/// What the plan says of a shutter. Oracle: written by hand.
#[test]
fn the_plan_says_what_becomes_of_a_shutter() {
    let plan = |scene: &Scene| Renderer::new(scene, options(8, 8, 1)).expect("renders").plan().clone();
    let scene = moving_room();
    let moving = plan(&scene);
    assert!(moving.features.shutter && moving.stages.contains(&"shutter"));
    assert!(moving.effects.simulated.iter().any(|name| name == "shutter"));
    let found = moving.effects.found.iter().find(|found| found.starts_with("shutter")).expect("it is found");
    assert!(found.contains("0 s to 1 s; 4 placements move") && found.ends_with("the camera)"), "{found}");
    let lamp = moving.effects.ignored.iter().find(|ignored| ignored.what.starts_with("light sampling of mesh"));
    assert!(lamp.is_some_and(|lamp| lamp.why.contains("BSDF sampling alone")), "{:?}", moving.effects.ignored);

    let mut still = at_rest(&scene, 0.0);
    let unseen = plan(&still).effects.ignored.into_iter().find(|ignored| !ignored.what.starts_with("one-sided-faces"));
    assert!(!plan(&still).features.shutter && unseen.is_none(), "{unseen:?}");
    let hash = |scene: &Scene, forced: &[Gate]| render(scene, options(24, 24, 4).forced(forced.to_vec())).film.hash();
    let bits = hash(&still, &[]);
    let spin = Span { name: "spin".into(), seconds: Some((0.0, 2.0)) };
    for (shutter, animations, why) in [
        (Shutter::new(0.0, 1.0), vec![], "no animations"),
        (Shutter::new(0.5, 0.5), vec![spin.clone()], "zero length"),
        (Shutter::new(0.0, 1.0), vec![spin], "nothing that is seen moves"),
    ] {
        still.motion.shutter = Some(shutter.expect("a shutter"));
        still.motion.animations = animations;
        let plan = plan(&still);
        assert!(!plan.features.shutter && !plan.stages.contains(&"shutter"));
        let ignored = plan.effects.ignored.iter().find(|ignored| ignored.what.starts_with("shutter"));
        assert!(ignored.is_some_and(|ignored| ignored.why.contains(why)), "{:?}", plan.effects.ignored);
        assert_eq!([hash(&still, &[]), hash(&still, &[Gate::SHUTTER]), hash(&still, &Gate::ALL)], [bits; 3]);
    }
    // The only lamp moves: nothing is left to sample.
    let mut b = SceneBuilder::new();
    let light = b.emitter(Vec3::ZERO, Vec3::ONE);
    let mesh = b.mesh(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]], light);
    b.place_moving(mesh, vec![Affine3A::IDENTITY, Affine3A::from_translation(Vec3::X)]);
    b.camera(Vec3::Z, Vec3::ZERO, Vec3::Y, 1.0);
    let plan = plan(&b.build());
    assert!(plan.features.area_lights && !plan.features.light_sampling && plan.backend != BackendKind::Flat);
}

/// Two sheets that move with a face on each other's have an entry in the ledger; sheets that move apart have none.
#[test]
fn moving_faces_on_others_are_listed() {
    for (gap, listed) in [(0.0, true), (0.125, false)] {
        let mut b = SceneBuilder::new();
        let ways = [0.0, gap].map(|z| [0.0, 1.0].map(|x| Affine3A::from_translation(Vec3::new(x, 0.0, z))));
        for (way, white) in ways.into_iter().zip([true, false]) {
            let material = b.lambert(Vec3::splat(if white { 0.75 } else { 0.25 }));
            let mesh = b.mesh(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]], material);
            b.place_moving(mesh, way.to_vec());
        }
        b.camera(Vec3::new(0.5, 0.2, 2.0), Vec3::new(0.5, 0.2, 0.0), Vec3::Y, 1.0);
        let scene = b.build();
        let renderer = Renderer::new(&scene, options(8, 8, 1)).expect("renders");
        let found = renderer.plan().bias.iter().any(|bias| bias.what.contains("placements move with faces"));
        assert_eq!(found, listed, "{gap}");
    }
}

/// Tracks that are not what they promise are refused before anything is traced.
#[test]
fn unsound_motions_are_refused() {
    let sound = moving_room();
    type Bend = fn(&mut Scene);
    let bends: [(Bend, &str); 5] = [
        (|s| s.motion.instances[0].index = 99, "begins where the shutter opens"),
        (|s| s.motion.instances[0].steps[0] = Affine3A::from_scale(Vec3::splat(2.0)), "begins where"),
        (|s| s.motion.instances.swap(0, 1), "ascending"),
        (|s| s.motion.instances[1].steps.truncate(1), "less than two poses"),
        (|s| s.motion.cameras[0].steps[1] = Affine3A::from_scale(Vec3::NEG_ONE), "collapse"),
    ];
    for (bend, words) in bends {
        let mut scene = sound.clone();
        bend(&mut scene);
        let error = scene.validate().expect_err(words).to_string();
        assert!(error.contains("motion of") && error.contains(words), "{error}");
        let rendered = Renderer::new(&scene, options(8, 8, 1)).err().map(|error| error.to_string());
        assert_eq!(rendered, Some(error), "a scene made in code is held to the same");
    }
}

/// Mean radiance of `scenes/in-motion` at 64×64, by channel.
fn mean_of_own_scene(shutter: Shutter, options: RenderOptions) -> [f64; 3] {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/in-motion/scene.gltf");
    let scene = Scene::load_with(file, &LoadOptions::default().shutter(shutter));
    let film = render(&scene.expect("an own scene loads"), options).film;
    std::array::from_fn(|c| film.mean()[c])
}

/// The scene that comes along, through its animations: hinges, splines, great circles. Oracle: `expect.toml` beside it,
/// whose mean comes from pictures at rest.
#[test]
fn the_scene_in_motion_is_as_its_recipe_says() {
    let recipe = include_str!("../../scenes/in-motion/expect.toml");
    let recipe: toml::Table = recipe.parse().expect("valid TOML");
    let numbers = |value: &toml::Value| -> Vec<f64> {
        value.as_array().expect("a list").iter().map(|x| x.as_float().expect("a number")).collect()
    };
    let span = numbers(&recipe["shutter"]);
    let shutter = Shutter::new(span[0], span[1]).expect("a shutter");
    let (mean, error) = (numbers(&recipe["reference"]["mean"]), numbers(&recipe["reference"]["standard_error"]));
    let mut moments = [Moments::default(); 3];
    for seed in 0..8 {
        let found = mean_of_own_scene(shutter, options(64, 64, 64).seed(seed));
        moments.iter_mut().zip(found).for_each(|(moments, mean)| moments.push(mean));
    }
    for (c, moments) in moments.iter().enumerate() {
        let own = moments.standard_error().hypot(error[c]);
        let off = (moments.mean - mean[c]).abs();
        // Student's t with 7 degrees of freedom reaches 10.2 once in 10⁵ pictures.
        assert!(off <= 10.2 * own, "channel {c}: {} ± {own}, recorded {}", moments.mean, mean[c]);
        let tolerance = recipe["mean_tolerance"].as_float().expect("a number");
        assert!(4.9 * own <= tolerance * mean[c], "channel {c}: too noisy, {own} of {}", mean[c]);
    }
}

/// Prints what `expect.toml` records.
#[test]
#[ignore = "writes nothing; run by hand when the scene changes (a minute)"]
fn mean_of_the_scene_in_motion_at_rest() {
    const POSES: u32 = 2048;
    let mut rng = pathspace_stat::Pcg32::new(5, 19);
    let mut moments = [Moments::default(); 3];
    for i in 0..POSES {
        let time = 0.3 + 0.1 * (f64::from(i) + f64::from(rng.next_f32())) / f64::from(POSES);
        let shutter = Shutter::new(time, time).expect("a moment");
        let found = mean_of_own_scene(shutter, options(64, 64, 16).seed(100 + u64::from(i)));
        moments.iter_mut().zip(found).for_each(|(moments, mean)| moments.push(mean));
    }
    println!("mean = {:?}", moments.each_ref().map(|m| m.mean));
    println!("standard_error = {:?}", moments.each_ref().map(Moments::standard_error));
}

fn pathspace(code: i32, args: &[&str]) -> (String, String) {
    let mut command = assert_cmd::Command::cargo_bin("pathspace").expect("the package has this binary");
    let output = command.args(args).env_remove("SLURM_CPUS_PER_TASK").output().expect("the binary starts");
    let [out, err] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert_eq!(output.status.code(), Some(code), "{args:?}\nstdout: {out}\nstderr: {err}");
    (out, err)
}

/// `--shutter` as a user gives it. Oracle: the contract of the command line, and the fingerprint of the film.
#[test]
fn the_command_line_takes_a_shutter() {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/in-motion/scene.gltf");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("a plain name").to_owned();
    let (exr, json) = (file("a.exr"), file("a.json"));
    for wrong in ["0.5,0.4", "nan,1", "=-1,1", "0,inf", "1,", "a,b"] {
        let option = format!("--shutter{}{wrong}", if wrong.starts_with('=') { "" } else { "=" });
        for command in [&["render", scene, "-o", &exr][..], &["info", scene], &["accuracy", scene], &["bench", scene]] {
            let (_, err) = pathspace(2, &[command, &[&option]].concat());
            assert!(err.contains("--shutter") && err.contains("0 ≤ OPEN ≤ CLOSE"), "{err}");
        }
    }
    let render = |more: &[&str]| {
        let base = ["render", scene, "-o", &exr, "--stats", &json, "-q", "--width", "24", "--spp", "4"];
        pathspace(0, &[&base, more].concat());
        let text = std::fs::read_to_string(&json).expect("statistics were written");
        serde_json::from_str::<serde_json::Value>(&text).expect("valid JSON")
    };
    let moving = render(&["--shutter", "0.3,0.4"]);
    assert_eq!(moving["film_hash"], render(&["--shutter", "0.3,0.4", "--no-plan"])["film_hash"]);
    assert_ne!(moving["film_hash"], render(&["--shutter", "0.3,0.3"])["film_hash"]);
    assert!(moving["effects"]["simulated"].to_string().contains("\"shutter\""), "{}", moving["effects"]);
    assert!(moving["bias"][1]["what"].as_str().is_some_and(|what| what.starts_with("shutter: motion")), "{moving}");
    render(&["--shutter", "0.3,0.4"]);
    let exr_bytes = std::fs::read(&exr).expect("a picture was written");
    let plan = b"shutter (0.3 s to 0.4 s; 8 placements move";
    assert!(exr_bytes.windows(plan.len()).any(|window| window == plan), "pathspace/plan tells of the shutter");

    let (out, err) = pathspace(0, &["info", scene, "--shutter", "0.3,0.3"]);
    assert!(out.contains("shutter (0.3 s to 0.3 s): of zero length") && err.is_empty(), "{out}\n{err}");
    let (out, err) = pathspace(0, &["info", scene]);
    assert!(err.contains("--at SECONDS"), "{err}");
    assert!(out.contains("animations  animation 'propeller' (0 s to 1 s), animation 'bouncing'"), "{out}");
    let pixel = ["render", scene, "--width", "24", "--pixel", "7,8", "--sample", "1", "--json"];
    let (out, _) = pathspace(0, &[&pixel[..], &["--shutter", "0.3,0.4"]].concat());
    let replay: serde_json::Value = serde_json::from_str(&out).expect("valid JSON");
    assert!(replay["time"].as_f64().is_some_and(|time| (0.0..1.0).contains(&time)), "{out}");
    assert!(replay["vertices"].as_array().is_some_and(|vertices| !vertices.is_empty()), "{out}");
}
