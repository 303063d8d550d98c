//! Only the effects a scene calls for: machinery that the plan leaves out changes no bit when it is made to run, and a
//! scene gets the stages that it asks for and no others. Oracle: the film's hash, and tables written by hand.
//! Deterministic.

use std::path::Path;

use glam::{Affine3A, Vec2, Vec3, Vec4};
use pathspace::backend::select::FLAT_FACES;
use pathspace::backend::{BackendKind, QueryMode};
use pathspace::math::simd::detect;
use pathspace::plan::{Aov, Features, Gate, RenderPlan};
use pathspace::render::{Backfaces, Lens, RenderOptions, Renderer, Strategy, Techniques, TextureFilter};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::geometry::Geometry;
use pathspace::scene::{
    AlphaMode, ColorSpace, Environment, Instance, Material, MaterialId, Mesh, MeshId, Projection, PunctualKind,
    Texture, TextureId, TextureSlot, Wrap,
};
use pathspace::{Result, Scene};

use crate::common::{options, render, shared};

const EYE: Vec3 = Vec3::new(0.1, 0.2, 2.6);

/// A room without a front wall, so that rays escape, and a camera before it.
fn room(builder: &mut SceneBuilder) {
    let wall = builder.lambert(Vec3::new(0.7, 0.6, 0.5));
    for normal in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z] {
        let (center, u) = (-normal, normal.any_orthonormal_vector());
        let v = normal.cross(u);
        builder.quad([center - u - v, center + u - v, center + u + v, center - u + v], wall);
    }
    builder.camera(EYE, Vec3::ZERO, Vec3::Y, 0.7);
}

fn lamp(builder: &mut SceneBuilder) {
    let light = builder.emitter(Vec3::ZERO, Vec3::splat(8.0));
    builder.quad([(-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3)].map(|(x, z)| Vec3::new(x, 0.98, z)), light);
}

fn ball(builder: &mut SceneBuilder, material: MaterialId) {
    builder.sphere(Vec3::new(0.1, -0.4, 0.1), 0.4, 8, false, false, material);
}

/// Diffuse surfaces, one lamp.
fn diffuse() -> Scene {
    let mut builder = SceneBuilder::new();
    room(&mut builder);
    lamp(&mut builder);
    let red = builder.lambert(Vec3::new(0.8, 0.2, 0.1));
    ball(&mut builder, red);
    builder.build()
}

/// Glass, a mirror and a coat under a point light; nothing emits.
fn shiny() -> Scene {
    let mut builder = SceneBuilder::new();
    room(&mut builder);
    let glass = builder.glass(1.5);
    ball(&mut builder, glass);
    let mirror = builder.metal(Vec3::splat(0.9), 0.0);
    builder.cuboid(Vec3::new(-0.9, -0.9, -0.8), Vec3::new(-0.3, 0.3, -0.3), false, mirror);
    let coat = builder.material(Material { metallic: 0.0, roughness: 0.4, ..Material::default() });
    builder.cuboid(Vec3::new(0.4, -0.9, -0.8), Vec3::new(0.8, 0.1, -0.4), false, coat);
    builder.point_light(Vec3::new(0.2, 0.8, 0.5), Vec3::splat(4.0));
    builder.build()
}

/// A flat textured square in an environment.
fn textured() -> Scene {
    let mut builder = SceneBuilder::new();
    room(&mut builder);
    let slot = Some(TextureSlot { texture: TextureId(0), uv_set: 0 });
    let paper =
        builder.material(Material { metallic: 0.0, specular: 0.0, base_color_texture: slot, ..Material::default() });
    let corners = [(-0.8, -0.8), (0.8, -0.7), (0.7, 0.8), (-0.7, 0.8)];
    let mesh = builder.full_mesh(Mesh {
        name: "paper".into(),
        positions: corners.map(|(x, y)| Vec3::new(x, y, 0.3 * x - 0.2)).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: Some(corners.map(|(x, y)| Vec2::new(x, -y)).to_vec()),
        material: paper,
        ..Mesh::default()
    });
    builder.place(mesh, Affine3A::IDENTITY);
    builder.environment(Environment::constant(Vec3::new(0.4, 0.5, 0.6)));
    let mut scene = builder.build();
    scene.textures.push(Texture {
        name: "noise".into(),
        width: 16,
        height: 16,
        texels: (0..256u32).map(|i| i.wrapping_mul(0x9e37_79b9).to_le_bytes()).collect(),
        color_space: ColorSpace::Srgb,
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
        bilinear: true,
    });
    scene
}

/// An unlit cube: no light at all.
fn dark() -> Scene {
    let mut builder = SceneBuilder::new();
    room(&mut builder);
    let sign = builder.material(Material { unlit: true, base_color: Vec3::new(0.2, 0.9, 0.4), ..Material::default() });
    ball(&mut builder, sign);
    builder.build()
}

/// Cut out, blended and coloured at its vertices, before a wall, under a lamp that is cut out as well.
fn sheer() -> Scene {
    let mut scene = textured();
    let half = Material { base_alpha: 0.5, alpha_mode: AlphaMode::Blend, ..scene.materials[0].clone() };
    let paper = scene.meshes.iter().find(|mesh| mesh.uvs.is_some()).expect("the paper").clone();
    let cut = Material {
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        vertex_colors: true,
        ..scene.materials[paper.material.index()].clone()
    };
    let lamp = Material { emissive: Vec3::splat(3.0), ..cut.clone() };
    for (material, offset) in [(half, 0.3), (cut, 0.5), (lamp, 0.7)] {
        scene.materials.push(material);
        let colors = (0..4).map(|i| Vec4::new(1.0, 0.25 * i as f32, 0.5, 1.0)).collect();
        scene.meshes.push(Mesh {
            material: MaterialId(scene.materials.len() as u32 - 1),
            colors: Some(colors),
            ..paper.clone()
        });
        let world_from_object = Affine3A::from_translation(Vec3::new(0.0, 0.0, offset));
        scene.instances.push(Instance::new(MeshId(scene.meshes.len() as u32 - 1), world_from_object));
    }
    scene
}

fn scenes() -> [(&'static str, Scene); 5] {
    [("diffuse", diffuse()), ("shiny", shiny()), ("textured", textured()), ("dark", dark()), ("sheer", sheer())]
}

fn backends() -> impl Iterator<Item = BackendKind> {
    BackendKind::available().iter().copied().filter(|kind| *kind != BackendKind::Brute)
}

#[test]
fn forced_gates_change_no_bit() {
    for (name, scene) in scenes() {
        for kind in backends() {
            let small = options(24, 24, 4).backend(kind).threads(2);
            let hash = |forced: &[Gate], options: &RenderOptions| {
                render(&scene, options.clone().forced(forced.to_vec())).film.hash()
            };
            let plain = hash(&[], &small);
            for gate in Gate::ALL {
                assert_eq!(hash(&[gate], &small), plain, "{name} on {}: {}", kind.name(), gate.name());
            }
            assert_eq!(hash(&Gate::ALL, &small), plain, "{name} on {}: all gates", kind.name());
            for strategy in [Strategy::BSDF, Strategy::LIGHT, Strategy::MIS_BALANCE] {
                let options = small.clone().strategy(strategy);
                assert_eq!(hash(&Gate::ALL, &options), hash(&[], &options), "{name} on {}: {strategy}", kind.name());
            }
        }
    }
}

/// A camera with parallel rays has no lens, forced or not; a black environment is not there.
#[test]
fn forced_gates_change_no_bit_of_odd_scenes() {
    let mut builder = SceneBuilder::new();
    room(&mut builder);
    lamp(&mut builder);
    builder.any_camera(EYE, Vec3::ZERO, Vec3::Y, Projection::Orthographic { xmag_m: 1.5, ymag_m: 1.5 });
    builder.environment(Environment::constant(Vec3::ZERO));
    let scene = builder.build();
    let camera = pathspace::render::CameraChoice::Index(1);
    let options = options(24, 24, 4).camera(camera);
    let forced = options.clone().forced(Gate::ALL);
    let (plain, forced) = (render(&scene, options).film, render(&scene, forced).film);
    assert_eq!(plain.hash(), forced.hash());
    assert!(plain.pixels.iter().any(|p| p.sum[0][3] == 0.0), "some rays leave the scene");
}

/// What the plan of `scene` runs.
fn stages(scene: &Scene, options: RenderOptions) -> Vec<&'static str> {
    Renderer::new(scene, options).unwrap_or_else(|e| panic!("{e}")).plan().stages.clone()
}

#[test]
fn a_scene_runs_the_stages_that_it_calls_for() {
    let plain = || options(8, 8, 1);
    let of = |scene: &Scene| stages(scene, plain()).join(" ");
    assert_eq!(of(&diffuse()), "raygen closest-hit emission roulette light-sampling any-hit accumulate");
    assert_eq!(
        of(&shiny()),
        "raygen closest-hit roulette glossy dielectric light-sampling any-hit accumulate light-paths"
    );
    assert_eq!(of(&textured()), "raygen closest-hit environment roulette textures light-sampling any-hit accumulate");
    assert_eq!(of(&dark()), "raygen closest-hit emission roulette accumulate");
    assert_eq!(
        of(&sheer()),
        "raygen closest-hit alpha environment emission roulette textures vertex-colours light-sampling transmittance \
         accumulate"
    );

    let lens = Some(Lens { radius_m: 0.01, focus_m: 2.0 });
    assert!(stages(&diffuse(), plain().lens(lens)).contains(&"raygen-lens"));
    let bsdf = plain().strategy(Strategy::BSDF);
    assert!(!stages(&diffuse(), bsdf).contains(&"light-sampling"));
    let forced = stages(&dark(), plain().forced(Gate::ALL));
    for stage in
        ["raygen-lens", "environment", "media", "smooth-normals", "textures", "light-sampling", "transmittance"]
    {
        assert!(forced.contains(&stage), "{stage} is not in {forced:?}");
    }
}

/// Traps of HARDCASES §7.5: what is present but does nothing calls for nothing.
#[test]
fn what_does_nothing_calls_for_nothing() {
    let features = |scene: &Scene, options: RenderOptions| {
        Renderer::new(scene, options).unwrap_or_else(|e| panic!("{e}")).plan().features
    };
    let mut builder = SceneBuilder::new();
    room(&mut builder);
    let black_glow = builder.emitter(Vec3::splat(0.5), Vec3::ZERO);
    ball(&mut builder, black_glow);
    builder.environment(Environment::constant(Vec3::ZERO));
    builder.punctual(Vec3::ZERO, Vec3::NEG_Y, Vec3::ZERO, PunctualKind::Point);
    // Defined but placed nowhere.
    builder.glass(1.5);
    let scene = builder.build();
    let found = features(&scene, options(8, 8, 1));
    assert!(!found.area_lights && !found.environment && !found.punctual && !found.light_sampling, "{found:?}");
    assert!(!found.dielectric && !found.absorption && !found.smooth_normals && !found.textures, "{found:?}");
    assert!(!found.lens && !found.per_length && !found.all_general && !found.lights_at_deltas, "{found:?}");

    // The lens belongs to the camera that looks, not to the first.
    let mut builder = SceneBuilder::new();
    room(&mut builder);
    builder.any_camera(EYE, Vec3::ZERO, Vec3::Y, Projection::Orthographic { xmag_m: 1.0, ymag_m: 1.0 });
    let scene = builder.build();
    for (camera, expected) in [(0, true), (1, false)] {
        let lens = Some(Lens { radius_m: 0.01, focus_m: 2.0 });
        let camera = pathspace::render::CameraChoice::Index(camera);
        assert_eq!(features(&scene, options(8, 8, 1).lens(lens).camera(camera)).lens, expected);
    }
}

/// Every loadable glTF file under `folder`.
fn scenes_in(folder: &Path, scenes: &mut Vec<(String, Scene)>) {
    for entry in std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()) {
        if entry.is_dir() {
            scenes_in(&entry, scenes);
        } else if entry.extension().is_some_and(|extension| extension == "gltf" || extension == "glb")
            && let Ok(scene) = Scene::load(&entry)
        {
            scenes.push((entry.display().to_string(), scene));
        }
    }
}

/// Gates of the plan and names in its lists, written by hand.
fn named(f: &Features) -> Vec<(&'static str, bool)> {
    vec![
        ("lens", f.lens),
        ("smooth-normals", f.smooth_normals),
        ("base-colour-textures", f.base_color_textures),
        ("metallic-roughness-textures", f.metallic_roughness_textures),
        ("normal-maps", f.normal_maps),
        ("emissive-textures", f.emissive_textures),
        ("texture-filter", f.footprints),
        ("more-texture-coordinates", f.more_uvs),
        ("vertex-colours", f.vertex_colors),
        ("unlit", f.unlit),
        ("area-lights", f.area_lights),
        ("double-sided-lamps", f.double_sided_lamps),
        ("dielectric-coat", f.coated),
        ("solid-dielectric", f.dielectric),
        ("absorption", f.absorption),
        ("thin-transmission", f.thin),
        ("environment", f.environment),
        ("punctual-lights", f.punctual),
        ("instancing", f.instancing),
        ("per-length-images", f.per_length),
        ("light-groups", f.light_groups),
        ("lobe-layers", f.lobes),
        ("first-hit", f.first_hit),
        ("denoiser-layers", f.followed),
        ("shutter", f.shutter),
        ("hidden-backs", f.hidden_backs),
        ("multiple-scattering", f.multiscatter),
    ]
}

/// Oracle: the contract of `effects`, and the gates. Nothing that is found is lost, whatever else is found: a gate that
/// is open has its name in `simulated`, and what is found is either simulated or ignored, each thing once. Forcing
/// gates finds nothing and leaves out no stage.
#[test]
fn nothing_found_is_lost() {
    let mut all: Vec<_> = scenes().into_iter().map(|(name, scene)| (name.to_string(), scene)).collect();
    if let Some(folder) = shared("the effects of the shared scenes") {
        ["scenes", "cases", "assets"].iter().for_each(|part| scenes_in(&folder.join(part), &mut all));
    }
    let plain = || options(8, 8, 1);
    let lens = Some(Lens { radius_m: 0.01, focus_m: 2.0 });
    let variants = [
        plain(),
        plain().texture_filter(TextureFilter::Trilinear).lens(lens),
        plain().multiscatter(true).backfaces(Backfaces::HideAll),
        plain().strategy(Strategy::BSDF).aovs([Aov::BOUNCES, Aov::ALBEDO, Aov::LIGHT_GROUPS, Aov::GLOSSY]),
    ];
    for (name, scene) in &all {
        let geometry = Geometry::build(scene);
        for options in &variants {
            let plan = |forced: &[Gate]| {
                let options = options.clone().forced(forced);
                RenderPlan::new(scene, &geometry, &options).unwrap_or_else(|e| panic!("{name}: {e}"))
            };
            let of_scene = plan(&[]);
            let effects = &of_scene.effects;
            for (effect, open) in named(&of_scene.features) {
                let count = effects.simulated.iter().filter(|simulated| *simulated == effect).count();
                assert_eq!(count, usize::from(open), "{name}: {effect} in {:?}", effects.simulated);
            }
            let alpha = effects.simulated.iter().any(|effect| effect.starts_with("alpha-"));
            assert_eq!(alpha, of_scene.features.alpha, "{name}: {:?}", effects.simulated);
            let (simulated, ignored) = effects.found.split_at(effects.simulated.len());
            let is_of = |(found, name): (&String, &String)| found.starts_with(&format!("{name} ("));
            assert!(simulated.iter().zip(&effects.simulated).all(is_of), "{name}: {simulated:?}");
            assert!(ignored.iter().eq(effects.ignored.iter().map(|ignored| &ignored.what)), "{name}: {ignored:?}");
            for gates in Gate::ALL.iter().map(std::slice::from_ref).chain([&Gate::ALL[..]]) {
                let forced = plan(gates);
                assert_eq!(forced.effects, *effects, "{name}: {gates:?}");
                let others = [("raygen", "raygen-lens"), ("any-hit", "transmittance")];
                for stage in &of_scene.stages {
                    let other = others.iter().find_map(|(of, other)| (of == stage).then_some(other)).unwrap_or(stage);
                    let runs = forced.stages.contains(stage) || forced.stages.contains(other);
                    assert!(runs, "{name}: {stage} is not in {:?}", forced.stages);
                }
            }
        }
    }
}

/// Once lost: two effects had one number.
#[test]
fn masks_and_filtered_textures_are_both_listed() {
    let options = options(8, 8, 1).texture_filter(TextureFilter::Trilinear);
    let scene = sheer();
    let plan = RenderPlan::new(&scene, &Geometry::build(&scene), &options).unwrap_or_else(|e| panic!("{e}"));
    let expected = ["base-colour-textures", "texture-filter", "alpha-masks", "alpha-blending", "vertex-colours"];
    assert_eq!(plan.effects.simulated[..5], expected);
}

/// A strategy without any technique would find no light.
#[test]
fn a_strategy_without_techniques_is_refused() {
    let techniques = Techniques { bsdf: false, light: false };
    let options = options(8, 8, 1).strategy(Strategy { techniques, ..Strategy::MIS });
    let error = Renderer::new(&diffuse(), options).err().expect("refused").to_string();
    assert!(error.starts_with("--strategy"), "{error}");
}

/// Oracle: the fingerprint in the statistics, and the stages in them being those of a plan.
#[test]
fn the_hidden_flag_runs_every_stage_and_changes_no_bit() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/glass-caustics/scene.gltf");
    let stats = ["with", "without"].map(|name| {
        let file = |extension: &str| folder.path().join(format!("{name}.{extension}"));
        let mut command = assert_cmd::Command::cargo_bin("pathspace").expect("the package has this binary");
        command.args(["render", scene, "--width", "24", "--spp", "4", "-q", "-o"]).arg(file("exr"));
        command.arg("--stats").arg(file("json")).args((name == "without").then_some("--no-plan"));
        command.assert().success();
        let text = std::fs::read_to_string(file("json")).expect("statistics were written");
        serde_json::from_str::<serde_json::Value>(&text).expect("valid JSON")
    });
    assert_eq!(stats[0]["film_hash"], stats[1]["film_hash"]);
    assert_eq!(stats[0]["effects"], stats[1]["effects"], "forcing finds no effect");
}

fn plan(scene: &Scene, options: RenderOptions) -> Result<RenderPlan> {
    RenderPlan::new(scene, &Geometry::build(scene), &options)
}

fn taken(scene: &Scene, options: RenderOptions) -> BackendKind {
    plan(scene, options).unwrap_or_else(|e| panic!("{e}")).backend
}

/// Small scenes are traced without a hierarchy; whoever asks for it, or has more faces than are tried, gets one.
#[test]
fn small_scenes_take_no_hierarchy() {
    let small = empty_room();
    assert_eq!(taken(&small, options(8, 8, 1)), BackendKind::Flat);
    assert_eq!(taken(&small, options(8, 8, 1).backend(BackendKind::Obvhs)), BackendKind::Obvhs);
    let mut builder = SceneBuilder::new();
    room(&mut builder);
    let paper = builder.lambert(Vec3::ONE);
    for i in 0..FLAT_FACES {
        let at = Vec3::new(0.0, 0.0, 0.001 * i as f32);
        builder.quad([at, at + Vec3::X, at + Vec3::X + Vec3::Y, at + Vec3::Y], paper);
    }
    assert_ne!(taken(&builder.build(), options(8, 8, 1)), BackendKind::Flat, "{} faces", FLAT_FACES + 5);
}

/// Five faces.
fn empty_room() -> Scene {
    let mut builder = SceneBuilder::new();
    room(&mut builder);
    builder.build()
}

/// A camera before a sphere, in a room or not.
fn sphere(walls: bool, stacks: u32) -> Scene {
    let mut builder = SceneBuilder::new();
    if walls {
        room(&mut builder);
    } else {
        builder.camera(Vec3::Z * 3.0, Vec3::ZERO, Vec3::Y, 0.7);
    }
    let white = builder.lambert(Vec3::ONE);
    builder.sphere(Vec3::ZERO, 0.3, stacks, false, false, white);
    builder.build()
}

/// Oracle: the same plan without the flag. Whatever a flag pins, the backend stays, or an error names the flag and the
/// backend.
#[test]
fn pins_never_change_the_backend() {
    type Pin = (&'static str, fn(&mut RenderOptions));
    let pins: [Pin; 12] = [
        ("--isa", |o| o.isa = Some("sse2".into())),
        ("--isa", |o| o.isa = Some("sse4.2".into())),
        ("--isa", |o| o.isa = Some("avx".into())),
        ("--isa", |o| o.isa = Some("avx2".into())),
        ("--isa", |o| o.isa = Some("avx512".into())),
        ("--rays", |o| o.rays = Some(QueryMode::Single)),
        ("--rays", |o| o.rays = Some(QueryMode::Packet4)),
        ("--rays", |o| o.rays = Some(QueryMode::Packet8)),
        ("--rays", |o| o.rays = Some(QueryMode::Packet16)),
        ("--rays", |o| o.rays = Some(QueryMode::Stream)),
        ("--robust", |o| o.robust = false),
        ("--robust", |o| o.robust = true),
    ];
    let (mut kept, mut refused) = (0, 0);
    for scene in [empty_room(), diffuse(), sphere(true, 100), sphere(false, 100), sphere(true, 20)] {
        let asked = BackendKind::ALL.into_iter().filter(|kind| kind.traces(&Geometry::build(&scene)));
        for backend in asked.map(Some).chain([None]) {
            let plain = options(8, 8, 1).backend(backend);
            let kind = taken(&scene, plain.clone());
            for (flag, pin) in pins {
                let mut pinned = plain.clone();
                pin(&mut pinned);
                match plan(&scene, pinned.clone()) {
                    Ok(plan) => {
                        assert_eq!(plan.backend, kind, "{flag}");
                        kept += 1;
                    }
                    Err(error) => {
                        let text = error.to_string();
                        assert!(text.starts_with(flag) && text.contains(&format!("'{}'", kind.name())), "{text}");
                        let advises = text.contains("--backend embree") == cfg!(feature = "embree");
                        assert!(advises && kind != BackendKind::Embree, "{text}");
                        refused += 1;
                    }
                }
            }
        }
    }
    assert!(kept > 0 && refused > 0, "{kept} kept, {refused} refused");
    let narrow = options(8, 8, 1).isa(detect::name(false));
    assert_eq!(taken(&empty_room(), narrow), BackendKind::Flat);
}

/// The plan says why: with what was counted, and the limit.
#[test]
fn the_choice_of_a_backend_has_a_reason() {
    let reason = |scene: &Scene, options: RenderOptions| plan(scene, options).expect("valid options").backend_reason;
    let plain = || options(8, 8, 1);
    assert_eq!(reason(&empty_room(), plain()), "faces: 5, at most 24");
    let brute = plain().backend(BackendKind::Brute);
    assert_eq!(reason(&diffuse(), brute), "asked for");
    let divided = reason(&sphere(true, 100), plain());
    assert!(divided.starts_with("node visits a ray: ") && divided.contains("or 5 large faces, 1 volumes"), "{divided}");
    let alone = reason(&sphere(false, 100), plain());
    assert!(alone.contains("counted on ") && !alone.contains("large faces"), "{alone}");
}

/// Rooms with large meshes in them are divided, large meshes without a room are not.
#[test]
fn rooms_with_large_things_are_divided() {
    let large = sphere(true, 100);
    assert!(large.triangle_count() > 1 << 14);
    assert_eq!(taken(&large, options(8, 8, 1)), BackendKind::FlatObvhs);
    assert_ne!(taken(&sphere(false, 100), options(8, 8, 1)), BackendKind::FlatObvhs);
}
