//! Only the effects a scene calls for: machinery that the plan leaves out changes no bit when it is made to run, and a
//! scene gets the stages that it asks for and no others. Oracle: the film's hash, and tables written by hand.
//! Deterministic.

use glam::{Affine3A, Vec2, Vec3, Vec4};
use pathspace::Scene;
use pathspace::backend::{BackendKind, QueryMode};
use pathspace::plan::Gate;
use pathspace::render::{Lens, RenderOptions, Renderer, Strategy};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{
    AlphaMode, ColorSpace, Environment, Instance, Material, MaterialId, Mesh, MeshId, Projection, PunctualKind,
    Texture, TextureId, TextureSlot, Wrap,
};

use crate::common::{options, render};

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
        scene.instances.push(Instance { mesh: MeshId(scene.meshes.len() as u32 - 1), world_from_object });
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
            let small = RenderOptions { backend: Some(kind), threads: 2, ..options(24, 24, 4) };
            let hash = |forced: &[Gate], options: &RenderOptions| {
                render(&scene, RenderOptions { forced: forced.to_vec(), ..options.clone() }).film.hash()
            };
            let plain = hash(&[], &small);
            for gate in Gate::ALL {
                assert_eq!(hash(&[gate], &small), plain, "{name} on {}: {}", kind.name(), gate.name());
            }
            assert_eq!(hash(&Gate::ALL, &small), plain, "{name} on {}: all gates", kind.name());
            for strategy in [Strategy::BsdfOnly, Strategy::LightOnly, Strategy::MisBalance] {
                let options = RenderOptions { strategy, ..small.clone() };
                assert_eq!(hash(&Gate::ALL, &options), hash(&[], &options), "{name} on {}: {strategy:?}", kind.name());
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
    let options = RenderOptions { camera, ..options(24, 24, 4) };
    let forced = RenderOptions { forced: Gate::ALL.to_vec(), ..options.clone() };
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
    assert_eq!(of(&shiny()), "raygen closest-hit roulette glossy dielectric light-sampling any-hit accumulate");
    assert_eq!(of(&textured()), "raygen closest-hit environment roulette textures light-sampling any-hit accumulate");
    assert_eq!(of(&dark()), "raygen closest-hit emission roulette accumulate");
    assert_eq!(
        of(&sheer()),
        "raygen closest-hit alpha environment emission roulette textures vertex-colours light-sampling transmittance \
         accumulate"
    );

    let lens = Some(Lens { radius_m: 0.01, focus_m: 2.0 });
    assert!(stages(&diffuse(), RenderOptions { lens, ..plain() }).contains(&"raygen-lens"));
    let bsdf = RenderOptions { strategy: Strategy::BsdfOnly, ..plain() };
    assert!(!stages(&diffuse(), bsdf).contains(&"light-sampling"));
    let forced = stages(&dark(), RenderOptions { forced: Gate::ALL.to_vec(), ..plain() });
    for stage in
        ["raygen-lens", "environment", "absorption", "smooth-normals", "textures", "light-sampling", "transmittance"]
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
        assert_eq!(features(&scene, RenderOptions { lens, camera, ..options(8, 8, 1) }).lens, expected);
    }
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

/// Small scenes are traced without a hierarchy; whoever asks for what only Embree has, or for more faces, gets a hierarchy.
#[test]
fn small_scenes_take_no_hierarchy() {
    let first = BackendKind::available()[0];
    let taken = |scene: &Scene, options: RenderOptions| Renderer::new(scene, options).expect("renders").plan().backend;
    let small = {
        let mut builder = SceneBuilder::new();
        room(&mut builder);
        builder.build()
    };
    assert_eq!(taken(&small, options(8, 8, 1)), BackendKind::Flat);
    let rays = RenderOptions { rays: Some(QueryMode::Packet8), ..options(8, 8, 1) };
    assert_eq!(taken(&small, rays), first);
    assert_eq!(
        taken(&small, RenderOptions { backend: Some(BackendKind::Obvhs), ..options(8, 8, 1) }),
        BackendKind::Obvhs
    );
    let mut builder = SceneBuilder::new();
    room(&mut builder);
    let paper = builder.lambert(Vec3::ONE);
    for i in 0..60 {
        let at = Vec3::new(0.0, 0.0, 0.01 * i as f32);
        builder.quad([at, at + Vec3::X, at + Vec3::X + Vec3::Y, at + Vec3::Y], paper);
    }
    assert_eq!(taken(&builder.build(), options(8, 8, 1)), first, "65 faces");
}

/// Rooms with large meshes in them are divided; whoever asks for what only Embree has gets Embree. Small things, and large ones
/// without a room, take the first backend of the build, which divides rooms of any size where it is not Embree.
#[test]
fn rooms_with_large_things_are_divided() {
    let first = BackendKind::available()[0];
    let plan = |scene: &Scene, options: RenderOptions| Renderer::new(scene, options).expect("renders").plan().backend;
    let scene = |walls: bool, stacks: u32| {
        let mut builder = SceneBuilder::new();
        if walls {
            room(&mut builder);
        } else {
            builder.camera(Vec3::Z * 3.0, Vec3::ZERO, Vec3::Y, 0.7);
        }
        let white = builder.lambert(Vec3::ONE);
        builder.sphere(Vec3::ZERO, 0.3, stacks, false, false, white);
        builder.build()
    };
    let large = scene(true, 100);
    assert!(large.triangle_count() > 1 << 14);
    assert_eq!(plan(&large, options(8, 8, 1)), BackendKind::FlatObvhs);
    let rays = RenderOptions { rays: Some(QueryMode::Packet8), ..options(8, 8, 1) };
    assert_eq!(plan(&large, rays), first);
    assert_eq!(plan(&scene(false, 100), options(8, 8, 1)), first);
    let small = if first == BackendKind::Obvhs { BackendKind::FlatObvhs } else { first };
    assert_eq!(plan(&scene(true, 20), options(8, 8, 1)), small);
}
