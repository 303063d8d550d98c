//! What each effect costs, in instructions per camera sample, and that what a scene does not call for costs nothing.
//! `make gates` runs it; not a criterion bench, because counts of instructions repeat and times do not.
//!
//! Every row is a pair of small scenes, without and with one effect, rendered under callgrind (obvhs backend, one
//! thread, the code that ships). Only the work on tiles is counted, so reading, building, starting and waiting are not
//! in it. The same scene gives the same count, mostly to the instruction. Held to:
//!
//! * a scene full of things that do nothing (materials that are placed nowhere, a black environment, a dark light,
//!   unread textures and texture coordinates) costs what it costs without them, within 0.1 % (HARDCASES §7.4);
//! * machinery that is forced upon a scene that does not call for it leaves the film's bits alone and saves nothing;
//! * no scene costs over 1 % more than recorded in `benches/gates.baseline`, if the compiler is the same: an effect
//!   that is added behind a gate must not make the others dearer. `make gates BASELINE=write` records anew.
//!
//! `FILTER=word` measures only the rows whose name holds it. Without valgrind it says so and is content.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{Affine3A, Vec2, Vec3, Vec4};
use pathspace::Scene;
use pathspace::backend::BackendKind;
use pathspace::plan::{Aov, Gate};
use pathspace::render::{
    Backfaces, FilterKind, Fog, Lens, LightPaths, RenderOptions, Renderer, Roulette, SamplerKind, Strategy,
};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::geometry::BAKE_MESH_TRIANGLES;
use pathspace::scene::motion::{Shutter, Track};
use pathspace::scene::{
    AlphaMode, ColorSpace, Environment, Instance, Material, MaterialId, Mesh, PunctualKind, Shape, Texture, TextureId,
    TextureSlot, Wrap,
};

/// Frame of a child. Four samples are always passes of 1, 1 and 2, whatever the clock says.
const SIDE: u32 = 32;
const SPP: u64 = 4;

/// What is counted: the work on tiles. The pool's waiting, which depends on how busy the machine is, lies outside.
const COUNTED: &str = "*::run_tile";

/// Counts of one scene differ by less, per sample: a worker that meets another thread at a lock turns round some 100
/// times, which is 2800 instructions, or 0.7 per sample, each time.
const NOISE: f64 = 3.0;

/// Largest part by which things that do nothing, and the code of today, may be dearer.
const NOTHING: f64 = 1e-3;
const BASELINE_SLACK: f64 = 1e-2;

const BASELINE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/gates.baseline");

/// An effect: a scene without it, one with it, and the gate that keeps its machinery from the first.
struct Row {
    effect: &'static str,
    without: &'static str,
    with: &'static str,
    gate: Option<Gate>,
}

const fn row(effect: &'static str, without: &'static str, with: &'static str, gate: Option<Gate>) -> Row {
    Row { effect, without, with, gate }
}

/// Rows of the table. Scenes are named in [`scene`].
const ROWS: &[Row] = &[
    row("things that do nothing", "base", "idle", None),
    row("lens", "base", "lens", Some(Gate::LENS)),
    row("shutter: a ball that moves", "base", "shutter", Some(Gate::SHUTTER)),
    row("shutter: two heaps that move", "instances", "moving", None),
    row("shutter: they change their shape", "moving", "changing", None),
    row("base-colour texture", "base", "base-colour-texture", Some(Gate::TEXTURES)),
    row("metallic-roughness texture", "metal-paper", "metallic-roughness-texture", Some(Gate::TEXTURES)),
    row("normal map (with tangents)", "base", "normal-map", None),
    row("emissive texture", "base", "emissive-texture", None),
    row("vertex colours", "base", "vertex-colours", Some(Gate::VERTEX_COLORS)),
    row("second set of coordinates", "base-colour-texture", "second-set", None),
    row("alpha mask", "base-colour-texture", "alpha-mask", Some(Gate::ALPHA)),
    row("alpha blending", "base", "alpha-blend", Some(Gate::ALPHA)),
    row("smooth normals", "base", "smooth-normals", Some(Gate::SMOOTH_NORMALS)),
    row("specular lobes at all: a coat", "base", "coat", Some(Gate::GENERAL)),
    row("rough metal", "base", "metal", None),
    row("delta: a mirror", "base", "mirror", None),
    row("no light samples at deltas", "mirror", "mirror", Some(Gate::LIGHTS_AT_DELTAS)),
    row("smooth transmission, solid", "base", "glass", None),
    row("rough transmission, solid", "base", "rough-glass", None),
    row("transmission, thin wall", "base", "thin", None),
    row("absorption", "glass", "absorption", Some(Gate::MEDIA)),
    row("ratios of light paths", "mirror", "light-paths", None),
    row("clearcoat", "coat", "clearcoat", None),
    row("sheen", "coat", "sheen", None),
    row("iridescence", "coat", "iridescence", None),
    row("anisotropy", "metal", "anisotropy", None),
    row("diffuse transmission", "coat", "diffuse-transmission", None),
    row("dispersion", "glass", "dispersion", None),
    row("solid that scatters", "rough-glass", "scattering", None),
    row("fog", "base", "fog", None),
    row("light between facets", "rough-glass", "multiscatter", None),
    row("backs that camera rays pass", "base", "hidden-backs", None),
    row("coincident faces", "base", "coincident", Some(Gate::COINCIDENT)),
    row("unlit", "base", "unlit", None),
    row("light sampling at all", "dark", "base", Some(Gate::LIGHT_SAMPLING)),
    row("choice: two lights for one", "one-light", "base", None),
    row("choice: 128 lights for two", "base", "many-lights", None),
    row("environment", "base", "environment", Some(Gate::ENVIRONMENT)),
    row("punctual light", "base", "point-light", None),
    row("instancing", "copies", "instances", None),
    row("roulette", "no-roulette", "base", None),
    row("Sobol' points for independent", "independent", "base", None),
    row("filter for box", "box", "base", None),
    row("per-length images", "base", "per-length", Some(Gate::PER_LENGTH)),
    row("light groups", "base", "light-groups", Some(Gate::LIGHT_GROUPS)),
    row("lobe layers", "coat", "lobe-layers", Some(Gate::LOBES)),
];

/// The scene and the options of that name.
fn scene(name: &str) -> (Scene, RenderOptions) {
    let mut options = RenderOptions::new(SIDE, SIDE).spp(SPP).backend(BackendKind::Obvhs).threads(1);
    // Rows count tiles of camera paths; light paths have one of their own.
    options = options.light_paths(LightPaths::Off);
    let mut b = SceneBuilder::new();
    room(&mut b);

    match name {
        "one-light" => drop(b.triangles(lamp_corners()[..3].to_vec(), vec![[0, 1, 2]], MaterialId(1))),
        "emissive-texture" => {
            let slot = Some(TextureSlot { texture: TextureId(0), uv_set: 0 });
            let lamp = Material { emissive_texture: slot, ..lamp() };
            let lamp = b.material(lamp);
            square(&mut b, lamp_corners(), Attributes::Uvs, lamp);
        }
        "many-lights" => {
            for i in 0..64 {
                let at = Vec3::new((i % 8) as f32 - 3.5, 0.0, (i / 8) as f32 - 3.5) * 0.2;
                b.quad(
                    lamp_corners().map(|p| Vec3::new(0.0, 0.98, 0.0) + (p - Vec3::Y * 0.98) * 0.1 + at),
                    MaterialId(1),
                );
            }
        }
        "dark" => {}
        _ => drop(b.quad(lamp_corners(), MaterialId(1))),
    }

    let coat = Material { metallic: 0.0, roughness: 0.5, base_color: RED, ..Material::default() };
    let clear = Material { metallic: 0.0, roughness: 0.0, transmission: 1.0, ior: 1.5, ..Material::default() };
    let ball = match name {
        "coat" | "lobe-layers" => b.material(coat),
        "clearcoat" => b.material(Material { clearcoat: 1.0, clearcoat_roughness: 0.1, ..coat }),
        "sheen" => b.material(Material { sheen_color: Vec3::splat(0.8), sheen_roughness: 0.4, ..coat }),
        "iridescence" => b.material(Material { iridescence: 1.0, ..coat }),
        "diffuse-transmission" => b.material(Material { diffuse_transmission: 0.5, ..coat }),
        "anisotropy" => b.material(Material {
            roughness: 0.3,
            metallic: 1.0,
            anisotropy: 0.8,
            base_color: RED,
            ..Material::default()
        }),
        "metal" => b.metal(RED, 0.1),
        "mirror" | "light-paths" => b.metal(RED, 0.0),
        "glass" => b.material(Material { thickness: 1.0, ..clear }),
        "rough-glass" | "multiscatter" => b.material(Material { thickness: 1.0, roughness: 0.5, ..clear }),
        "thin" => b.material(clear),
        "dispersion" => b.material(Material { thickness: 1.0, dispersion: 1.0, ..clear }),
        "scattering" => b.material(Material {
            thickness: 1.0,
            roughness: 0.5,
            attenuation_color: RED,
            attenuation_distance_m: 0.2,
            multiscatter_color: Vec3::splat(0.8),
            ..clear
        }),
        "absorption" => {
            b.material(Material { thickness: 1.0, attenuation_color: RED, attenuation_distance_m: 0.5, ..clear })
        }
        "unlit" => b.material(Material { unlit: true, base_color: RED, ..Material::default() }),
        _ => b.lambert(RED),
    };
    b.sphere(Vec3::new(0.4, -0.5, 0.2), 0.35, 8, false, name == "smooth-normals", ball);

    let slot = Some(TextureSlot { texture: TextureId(0), uv_set: 0 });
    let lambert = Material { metallic: 0.0, specular: 0.0, ..Material::default() };
    let metal = Material { metallic: 1.0, roughness: 1.0, ..Material::default() };
    let (material, attributes) = match name {
        "base-colour-texture" => (Material { base_color_texture: slot, ..lambert }, Attributes::Uvs),
        "metal-paper" => (metal, Attributes::None),
        "metallic-roughness-texture" => (Material { metallic_roughness_texture: slot, ..metal }, Attributes::Uvs),
        "normal-map" => (Material { normal_texture: slot, ..lambert }, Attributes::Tangents),
        "vertex-colours" => (Material { vertex_colors: true, ..lambert }, Attributes::Colors),
        "second-set" => {
            let second = Some(TextureSlot { texture: TextureId(0), uv_set: 1 });
            (Material { base_color_texture: second, ..lambert }, Attributes::SecondUvs)
        }
        // The noise's alpha is half to one: a fifth of it is cut out.
        "alpha-mask" => {
            let mode = AlphaMode::Mask { cutoff: 0.6 };
            (Material { base_color_texture: slot, alpha_mode: mode, ..lambert }, Attributes::Uvs)
        }
        "alpha-blend" => (Material { base_alpha: 0.8, alpha_mode: AlphaMode::Blend, ..lambert }, Attributes::None),
        "idle" => (lambert, Attributes::Uvs),
        _ => (lambert, Attributes::None),
    };
    let paper = b.material(material);
    square(
        &mut b,
        [(-0.9, -0.9), (-0.1, -0.8), (-0.2, 0.5), (-0.9, 0.4)].map(|(x, y)| Vec3::new(x, y, -0.5)),
        attributes,
        paper,
    );

    match name {
        "multiscatter" => options.multiscatter = true,
        "hidden-backs" => options.backfaces = Backfaces::Hide,
        "fog" => options.fog = Some(Fog { sigma_t: 0.5, albedo: 0.8, g: 0.3 }),
        // On the floor's face.
        "coincident" => {
            let on = b.lambert(RED);
            b.quad([(-0.5, 0.5), (0.0, 0.5), (0.0, 0.0), (-0.5, 0.0)].map(|(x, z)| Vec3::new(x, -1.0, z)), on);
        }
        "lens" => options.lens = Some(Lens { radius_m: 0.02, focus_m: 2.4 }),
        "environment" => drop(b.environment(Environment::constant(Vec3::splat(0.5)))),
        "point-light" => drop(b.point_light(Vec3::new(-0.5, 0.5, 0.5), Vec3::ONE)),
        "copies" | "instances" | "moving" | "changing" => {
            let bumps = [heap(&mut b), heap(&mut b)];
            b.place(bumps[0], Affine3A::from_translation(Vec3::new(-0.5, -0.6, 0.2)));
            let second = bumps[usize::from(name == "copies")];
            b.place(second, Affine3A::from_translation(Vec3::new(0.5, 0.4, -0.4)));
        }
        "light-paths" => options.light_paths = LightPaths::Share(0.25),
        "no-roulette" => options.roulette = Roulette::Off,
        "independent" => options.sampler = SamplerKind::Independent,
        "box" => options.filter = FilterKind::Box,
        "per-length" => options.per_length = true,
        "light-groups" => options.aovs = vec![Aov::LIGHT_GROUPS],
        "lobe-layers" => options.aovs = vec![Aov::DIFFUSE],
        "idle" => {
            b.glass(1.5);
            b.metal(RED, 0.2);
            b.environment(Environment::constant(Vec3::ZERO));
            b.punctual(Vec3::ZERO, Vec3::NEG_Y, Vec3::ZERO, PunctualKind::Point);
            options.strategy = Strategy::MIS;
        }
        _ => {}
    }
    let mut scene = b.build();
    scene.textures.push(noise());
    match name {
        "shutter" => move_along(&mut scene, |mesh| mesh.name.starts_with("sphere")),
        "moving" | "changing" => move_along(&mut scene, |mesh| mesh.triangles.len() > BAKE_MESH_TRIANGLES),
        _ => {}
    }
    if name == "changing" {
        for mesh in scene.meshes.iter_mut().filter(|mesh| mesh.triangles.len() > BAKE_MESH_TRIANGLES) {
            let positions = mesh.positions.iter().map(|&p| p * Vec3::new(1.1, 1.0, 0.9)).collect();
            mesh.later = vec![Shape { positions, ..Shape::default() }];
        }
    }
    (scene, options)
}

/// All instances of such meshes go a little to the right while the shutter is open.
fn move_along(scene: &mut Scene, such: impl Fn(&Mesh) -> bool) {
    let end = Affine3A::from_translation(Vec3::new(0.1, 0.0, 0.0));
    let such = scene.instances.iter().enumerate().filter(|(_, i)| such(&scene.meshes[i.mesh.index()]));
    let track =
        |(index, i): (usize, &Instance)| Track { index, steps: vec![i.world_from_object, end * i.world_from_object] };
    scene.motion.instances = such.map(track).collect();
    scene.motion.shutter = Some(Shutter::new(0.0, 1.0).expect("a second"));
}

const RED: Vec3 = Vec3::new(0.7, 0.3, 0.2);

/// Five walls, white, and the materials of walls (0) and lamp (1).
fn room(b: &mut SceneBuilder) {
    let wall = b.lambert(Vec3::splat(0.6));
    b.material(lamp());
    for normal in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z] {
        let (center, u) = (-normal, normal.any_orthonormal_vector());
        let v = normal.cross(u);
        b.quad([center - u - v, center + u - v, center + u + v, center - u + v], wall);
    }
    b.camera(Vec3::new(0.0, 0.0, 2.8), Vec3::ZERO, Vec3::Y, 0.75);
}

fn lamp() -> Material {
    Material { base_color: Vec3::ZERO, metallic: 0.0, specular: 0.0, emissive: Vec3::splat(6.0), ..Material::default() }
}

/// Counter-clockwise seen from below.
fn lamp_corners() -> [Vec3; 4] {
    [(-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3)].map(|(x, z)| Vec3::new(x, 0.98, z))
}

/// A mesh too large to be baked where it is repeated.
fn heap(b: &mut SceneBuilder) -> pathspace::scene::MeshId {
    let mut ball = SceneBuilder::new();
    let alone = ball.lambert(Vec3::splat(0.6));
    ball.sphere(Vec3::ZERO, 0.3, 24, false, false, alone);
    let mesh = ball.build().meshes.remove(0);
    let material = b.lambert(Vec3::splat(0.6));
    b.full_mesh(Mesh { material, ..mesh })
}

#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Attributes {
    None,
    Colors,
    Uvs,
    SecondUvs,
    Tangents,
}

fn square(b: &mut SceneBuilder, corners: [Vec3; 4], attributes: Attributes, material: MaterialId) {
    let uvs = [(0.0, 0.0), (2.0, 0.1), (2.1, 2.0), (0.0, 1.9)].map(|(u, v)| Vec2::new(u, v)).to_vec();
    let mesh = b.full_mesh(Mesh {
        name: "square".into(),
        positions: corners.to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        more_uvs: if attributes == Attributes::SecondUvs { vec![uvs.clone()] } else { Vec::new() },
        uvs: (attributes >= Attributes::Uvs).then_some(uvs),
        colors: (attributes == Attributes::Colors).then(|| vec![Vec4::new(0.9, 0.5, 0.7, 1.0); 4]),
        tangents: (attributes == Attributes::Tangents).then(|| vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 4]),
        material,
        ..Mesh::default()
    });
    b.place(mesh, Affine3A::IDENTITY);
}

/// Bright noise: half a texel's range, so that normals from it point outwards.
fn noise() -> Texture {
    let texel = |i: u32| i.wrapping_mul(0x9e37_79b9).to_le_bytes().map(|byte| 128 + byte / 2);
    Texture {
        name: "noise".into(),
        width: 64,
        height: 64,
        texels: (0..64 * 64).map(texel).collect(),
        color_space: ColorSpace::Linear,
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
        bilinear: true,
    }
}

/// What a child says, and what callgrind counted.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Count {
    instructions: f64,
    rays: f64,
    hash: u64,
}

/// Renders the named scene once; runs under callgrind.
fn child(name: &str, forced: &str) {
    let (scene, options) = scene(name);
    let forced: Vec<Gate> = Gate::ALL.into_iter().filter(|gate| gate.name() == forced || forced == "all").collect();
    let renderer = Renderer::new(&scene, options.forced(forced)).unwrap_or_else(|e| panic!("{e}"));
    let render = renderer.render().unwrap_or_else(|e| panic!("{e}"));
    println!("{} {:016x}", render.counters.rays(), render.film.hash());
}

/// Counts the instructions per sample of a child.
fn count(name: &str, forced: &str, folder: &Path) -> Count {
    let out = folder.join(format!("{name}+{forced}"));
    let output = Command::new("valgrind")
        .args(["-q", "--tool=callgrind", "--separate-threads=yes"])
        .arg(format!("--toggle-collect={COUNTED}"))
        .arg(format!("--callgrind-out-file={}", out.display()))
        .arg(std::env::current_exe().expect("a running program has a path"))
        .args(["--child", name, forced])
        .output()
        .expect("valgrind starts");
    let said = String::from_utf8_lossy(&output.stdout);
    let mut words = said.split_whitespace();
    let (rays, hash) = (words.next(), words.next());
    let (Some(rays), Some(hash)) = (rays.and_then(|w| w.parse::<f64>().ok()), hash) else {
        panic!("{name} under callgrind: {}", String::from_utf8_lossy(&output.stderr));
    };
    // One file per thread, empty but for the one that rendered.
    let threads = (2..=9).filter_map(|thread| {
        let text = fs::read_to_string(format!("{}-{thread:02}", out.display())).ok()?;
        text.lines().find_map(|line| line.strip_prefix("summary:")?.trim().parse::<f64>().ok())
    });
    let instructions = threads.fold(0.0, f64::max);
    assert!(instructions > 0.0, "{name} under callgrind: nothing is named {COUNTED}");
    let samples = f64::from(SIDE * SIDE) * SPP as f64;
    Count {
        instructions: instructions / samples,
        rays: rays / samples,
        hash: u64::from_str_radix(hash, 16).expect("a hash in hexadecimal"),
    }
}

/// Every measurement that the rows need, once each, on all processors.
fn measure(rows: &[&Row], folder: &Path) -> BTreeMap<(String, String), Count> {
    let mut wanted = vec![("base", ""), ("base", "all"), ("base", "again")];
    for row in rows {
        wanted.extend([(row.without, ""), (row.with, "")]);
        wanted.extend(row.gate.map(|gate| (row.without, gate.name())));
    }
    wanted.sort();
    wanted.dedup();
    let (next, results) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, |n| n.get()) {
            scope.spawn(|| {
                while let Some(&(name, forced)) = wanted.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let count = count(name, forced, folder);
                    results.lock().expect("no thread panicked").insert((name.into(), forced.into()), count);
                }
            });
        }
    });
    results.into_inner().expect("no thread panicked")
}

/// Compiler and valgrind: counts under others are not comparable.
fn toolchain() -> String {
    let version = |program: &str| {
        let output = Command::new(program).arg("--version").output().ok();
        let text = output.map(|o| String::from_utf8_lossy(&o.stdout).trim().to_string());
        text.filter(|t| !t.is_empty()).unwrap_or_else(|| format!("no {program}"))
    };
    format!("{}, {}", version("rustc"), version("valgrind"))
}

fn table(rows: &[&Row], counts: &BTreeMap<(String, String), Count>, faults: &mut Vec<String>) {
    let of = |name: &str, forced: &str| counts[&(name.to_string(), forced.to_string())];
    println!(
        "{:<31} {:>9} {:>9} {:>9}   {:>5} {:>5}   {:>9}",
        "", "without", "with", "differ", "rays", "with", "forced"
    );
    for row in rows {
        let (without, with) = (of(row.without, ""), of(row.with, ""));
        let forced = row.gate.map(|gate| of(row.without, gate.name()));
        println!(
            "{:<31} {:>9.1} {:>9.1} {:>+9.1}   {:>5.2} {:>5.2}   {:>9}",
            row.effect,
            without.instructions,
            with.instructions,
            with.instructions - without.instructions,
            without.rays,
            with.rays,
            forced.map_or("-".into(), |f| format!("{:+.1}", f.instructions - without.instructions))
        );
        if let Some(forced) = forced {
            if forced.hash != without.hash {
                faults.push(format!("{}: forced upon '{}' it changes the picture", row.effect, row.without));
            }
            if forced.instructions < without.instructions - NOISE {
                faults.push(format!("{}: forced upon '{}' it saves instructions", row.effect, row.without));
            }
        }
        if row.with == "idle" && with.instructions > without.instructions * (1.0 + NOTHING) + NOISE {
            faults.push("things that do nothing cost something".into());
        }
        if row.with == "idle" && with.hash != without.hash {
            faults.push("things that do nothing change the picture".into());
        }
    }
    let (base, again, all) = (of("base", ""), of("base", "again"), of("base", "all"));
    println!(
        "base scene {:.1}, measured again {:.1}; with every gate forced {:.1}",
        base.instructions, again.instructions, all.instructions
    );
    if (base.instructions - again.instructions).abs() > NOISE {
        faults.push(format!("counts do not repeat: {:.1} and {:.1}", base.instructions, again.instructions));
    }
    if all.hash != base.hash || all.instructions < base.instructions {
        faults.push("with every gate forced, the picture differs or costs less".into());
    }
}

/// Holds every scene to its recorded cost, or records them all.
fn baseline(counts: &BTreeMap<(String, String), Count>, write: bool, faults: &mut Vec<String>) {
    let toolchain = toolchain();
    let scenes = counts.iter().filter(|((_, forced), _)| forced.is_empty());
    let now = scenes.map(|((name, _), count)| (name.as_str(), count.instructions));
    if write {
        let mut text =
            format!("# Instructions per sample of each scene; written by make gates BASELINE=write.\nby {toolchain}\n");
        now.for_each(|(name, count)| text += &format!("{name} {count:.1}\n"));
        fs::write(BASELINE, text).expect("the checkout is writable");
        return println!("recorded in {BASELINE}");
    }
    let text = fs::read_to_string(BASELINE).unwrap_or_default();
    let recorded: BTreeMap<&str, &str> = text.lines().filter_map(|line| line.split_once(' ')).collect();
    match recorded.get("by") {
        Some(by) if *by == toolchain => {}
        Some(by) => return println!("the recorded costs are of {by}; this is {toolchain}: not compared"),
        None => return println!("no cost is recorded in {BASELINE}"),
    }
    let mut most = ("", f64::NEG_INFINITY);
    for (name, count) in now {
        let Some(before) = recorded.get(name).and_then(|n| n.parse::<f64>().ok()) else {
            faults.push(format!("scene '{name}' has no recorded cost: make gates BASELINE=write"));
            continue;
        };
        let growth = count / before - 1.0;
        if growth > most.1 {
            most = (name, growth);
        }
        if growth > BASELINE_SLACK {
            faults.push(format!("scene '{name}' costs {count:.1} instructions per sample, recorded are {before:.1}"));
        }
    }
    println!("against the recorded costs: '{}' grew most, {:+.2} %", most.0, 100.0 * most.1);
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [flag, name, forced] = arguments.as_slice()
        && flag == "--child"
    {
        child(name, forced);
        return ExitCode::SUCCESS;
    }
    if Command::new("valgrind").arg("--version").output().is_err() {
        println!("SKIPPED: counts of instructions need valgrind (apt-get install valgrind)");
        return ExitCode::SUCCESS;
    }
    let filter = std::env::var("FILTER").unwrap_or_default();
    let rows: Vec<&Row> = ROWS.iter().filter(|row| row.effect.contains(&filter)).collect();
    let folder: PathBuf = std::env::temp_dir().join(format!("pathspace-gates-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a temporary folder");
    let counts = measure(&rows, &folder);
    fs::remove_dir_all(&folder).ok();

    println!("instructions and rays per camera sample; {SIDE}x{SIDE}, {SPP} spp, obvhs, one thread; {}", toolchain());
    let mut faults = Vec::new();
    table(&rows, &counts, &mut faults);
    baseline(&counts, std::env::var("BASELINE").is_ok_and(|v| v == "write"), &mut faults);
    for fault in &faults {
        println!("FAULT: {fault}");
    }
    if faults.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
