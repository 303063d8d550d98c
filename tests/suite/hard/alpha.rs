//! B20: surfaces that are there in part. Sheets that rays pass by chance or by a mask, light that passes them, and
//! lights that are cut out themselves; on every backend and query mode.
//!
//! Oracles: powers of the fraction that each sheet lets pass; the same scene without what is cut out. α = 0.3 is
//! stored as the nearest f32, and the powers are of that.

use glam::{Affine3A, Vec2, Vec3};
use pathspace::backend::{BackendKind, QueryMode};
use pathspace::plan::Aov;
use pathspace::plan::Gate;
use pathspace::render::{RenderOptions, Strategy};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{
    AlphaMode, ColorSpace, Material, MaterialId, Mesh, PunctualKind, Scene, Texture, TextureId, TextureSlot, Wrap,
};

use super::Case;
use crate::common::{Estimate, options, probe, render};

const ALPHA: f32 = 0.3;

/// Every backend with the query modes that it tells apart.
fn variants() -> Vec<(BackendKind, QueryMode)> {
    let modes = |kind| if kind == BackendKind::Embree { &QueryMode::ALL[..] } else { &QueryMode::ALL[..1] };
    BackendKind::available().iter().flat_map(|&kind| modes(kind).iter().map(move |&mode| (kind, mode))).collect()
}

fn on((kind, mode): (BackendKind, QueryMode), options: RenderOptions) -> RenderOptions {
    options.backend(kind).rays(mode)
}

fn named((kind, mode): (BackendKind, QueryMode)) -> String {
    format!("{}/{mode}", kind.name())
}

/// What a stack of `n` sheets lets through.
fn through(n: u32) -> f64 {
    (1.0 - f64::from(ALPHA)).powi(n as i32)
}

fn sheet(alpha: f32) -> Material {
    let black = Material { base_color: Vec3::ZERO, metallic: 0.0, specular: 0.0, ..Material::default() };
    Material { base_alpha: alpha, alpha_mode: AlphaMode::Blend, ..black }
}

/// A square of side 2 at height `y`, facing up, with texture coordinates that run from 0 to 1 along x and z.
fn square(b: &mut SceneBuilder, y: f32, material: MaterialId) {
    let corners = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
    let mesh = b.full_mesh(Mesh {
        name: format!("square at {y}"),
        positions: corners.map(|(x, z)| Vec3::new(x, y, z)).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: Some(corners.map(|(x, z)| Vec2::new(0.5 + 0.5 * x, 0.5 + 0.5 * z)).to_vec()),
        material,
        ..Mesh::default()
    });
    b.place(mesh, Affine3A::IDENTITY);
}

/// Sheets at heights 0.1, 0.2, … over a floor that shines.
fn stack(n: u32) -> Scene {
    let mut b = SceneBuilder::new();
    let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
    square(&mut b, 0.0, lamp);
    let sheet = b.material(sheet(ALPHA));
    (1..=n).for_each(|i| square(&mut b, 0.1 * i as f32, sheet));
    b.build()
}

/// Sheets between a floor and a sun straight above.
fn shaded(n: u32) -> Scene {
    let mut b = SceneBuilder::new();
    let floor = b.lambert(Vec3::splat(0.5));
    square(&mut b, 0.0, floor);
    let sheet = b.material(sheet(ALPHA));
    (1..=n).for_each(|i| square(&mut b, 0.5 + 0.1 * i as f32, sheet));
    b.punctual(Vec3::ZERO, Vec3::new(0.1, -1.0, 0.05), Vec3::ONE, PunctualKind::Directional);
    b.build()
}

/// A slanted ray, so that it crosses nothing at an edge.
const DOWN: Vec3 = Vec3::new(0.013, -1.0, 0.021);

#[test]
fn b20_stacked_layers() {
    let mut case = Case::open("B20", "stacked alpha layers", "opacity, shadow rays, depth limits");
    for variant in variants() {
        let name = named(variant);
        // Passing takes no edges: with two, a scattering on the way would end the path.
        let limited = options(1, 1, 1).max_depth(2);
        let ask = |n: u32, samples: u32| {
            probe(&stack(n), Vec3::new(0.2, 9.0, 0.1), DOWN, samples, on(variant, limited.clone()))
        };
        for (n, samples, delta) in [(1, 1 << 16, 0.02), (4, 1 << 16, 0.04)] {
            case.mean(format!("{name}, camera ray, n = {n}"), [through(n); 3], 0.0, delta, &ask(n, samples));
        }
        if variant == variants()[0] {
            case.mean(format!("{name}, camera ray, n = 16"), [through(16); 3], 0.0, 0.06, &ask(16, 1 << 21));
        }
        // 4096 samples of a probability of 10⁻¹⁰: one would be an error of the sort that sheets share a number.
        case.number(format!("{name}, camera ray, n = 64"), 0.0, ask(64, 4096).mean[0], 0.0);

        let sun = |n: u32| {
            let eye = Vec3::new(0.2, 0.4, 0.1);
            probe(&shaded(n), eye, DOWN, 16, on(variant, limited.clone())).mean[1]
        };
        let open = sun(0);
        case.numbers(format!("{name}, shadow ray"), [1, 4, 16, 64].map(|n| (through(n) * open, sun(n), 1e-6)));
    }
    case.close();
}

/// A decal that is cut out everywhere, in the plane of an opaque roof or just beside it, opens no hole: neither for
/// what looks up nor for the sun. By order of the file, whichever is met first.
#[test]
fn b20_a_decal_opens_no_hole() {
    let mut case = Case::open("B20g", "decal in the plane of a roof", "equal distances");
    let scene = |roof_first: bool, below: f32| {
        let mut b = SceneBuilder::new();
        let floor = b.lambert(Vec3::splat(0.5));
        square(&mut b, 0.0, floor);
        let sky = b.emitter(Vec3::ZERO, Vec3::ONE);
        square(&mut b, 3.0, sky);
        let black = b.lambert(Vec3::ZERO);
        let decal = b.material(sheet(0.0));
        let heights = [(1.0, black), (1.0 - below, decal)];
        let order = if roof_first { [0, 1] } else { [1, 0] };
        order.into_iter().for_each(|i| square(&mut b, heights[i].0, heights[i].1));
        b.punctual(Vec3::ZERO, Vec3::new(0.1, -1.0, 0.05), Vec3::ONE, PunctualKind::Directional);
        b.build()
    };
    for variant in variants() {
        for (roof_first, below) in [(true, 0.0), (false, 0.0), (true, 1e-7), (false, 1e-6), (true, -1e-7)] {
            let seen = |dir: Vec3| {
                let options = on(variant, options(1, 1, 1).max_depth(2));
                f64::from(probe(&scene(roof_first, below), Vec3::new(0.2, 0.5, 0.1), dir, 16, options).mean[1] as f32)
            };
            let name = format!("{}, roof first {roof_first}, decal {below} below", named(variant));
            case.numbers(name, [-DOWN, DOWN].map(|dir| (0.0, seen(dir), 0.0)));
        }
    }
    case.close();
}

/// Random sheets a hair's breadth apart: each shadow ray must cross each exactly once. Half passes each, so that the
/// fraction is a power of two and the film has the bits of the scene without sheets, scaled.
#[test]
fn b20_no_sheet_is_met_twice_or_skipped() {
    let mut case = Case::open("B20b", "sheets close together", "where rays go on");
    let n = 6;
    let scene = |sheets: u32, scale: f32, at: Vec3, gap: f32| {
        let mut b = SceneBuilder::new();
        let floor = b.lambert(Vec3::splat(0.5));
        let place = |p: Vec3| at + p * scale;
        let corners = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
        b.quad(corners.map(|(x, z)| place(Vec3::new(x, 0.0, z))), floor);
        let half = b.material(sheet(0.5));
        for i in 0..sheets {
            let tilt = |x: f32, z: f32| 0.5 + 0.31 * x - 0.17 * z + gap * i as f32;
            b.quad(corners.map(|(x, z)| place(Vec3::new(3.0 * x, tilt(3.0 * x, 3.0 * z), 3.0 * z))), half);
        }
        b.punctual(Vec3::ZERO, Vec3::new(0.3, -1.0, 0.2), Vec3::ONE, PunctualKind::Directional);
        b.any_camera(
            place(Vec3::new(0.0, 0.1, 0.0)),
            place(Vec3::ZERO),
            Vec3::Z,
            pathspace::scene::Projection::Orthographic { xmag_m: 0.2 * scale, ymag_m: 0.2 * scale },
        );
        b.build()
    };
    for variant in variants() {
        // Gaps in units of the rounding of coordinates that are as large as the place.
        for (scale, at, gap) in [
            (1.0, Vec3::ZERO, 1e-5),
            (1e-3, Vec3::ZERO, 1e-5),
            (1e3, Vec3::ZERO, 1e-5),
            (1.0, Vec3::new(100.0, 50.0, -70.0), 1e-3),
        ] {
            let film = |sheets| {
                let options = options(48, 48, 1).max_depth(2);
                render(&scene(sheets, scale, at, gap), on(variant, options)).film
            };
            let (open, shaded) = (film(0), film(n));
            let differing = (open.pixels.iter().zip(&shaded.pixels))
                .filter(|(open, shaded)| {
                    open.mean()[1] == 0.0 || open.mean()[1] * 0.5f64.powi(n as i32) != shaded.mean()[1]
                })
                .count();
            case.bits(format!("{}, scale {scale} at {}", named(variant), at.x), differing);
        }
    }
    case.close();
}

/// Left half cut out, right half there, without a blend between.
fn half_cut() -> Texture {
    Texture {
        name: "half".into(),
        width: 2,
        height: 1,
        texels: vec![[255, 255, 255, 0], [255; 4]].into(),
        color_space: ColorSpace::Srgb,
        wrap_u: Wrap::ClampToEdge,
        wrap_v: Wrap::ClampToEdge,
        bilinear: false,
    }
}

/// A lamp over a floor: a square whose left half a mask cuts out, or its right half alone.
fn lamp(cut: bool, alpha: f32, mode: AlphaMode) -> Scene {
    let mut b = SceneBuilder::new();
    let floor = b.lambert(Vec3::splat(0.7));
    b.quad([[-4.0, 0.0, 4.0], [4.0, 0.0, 4.0], [4.0, 0.0, -4.0], [-4.0, 0.0, -4.0]].map(Vec3::from), floor);
    let glow = Material {
        base_color: Vec3::ZERO,
        metallic: 0.0,
        specular: 0.0,
        emissive: Vec3::splat(2.0),
        base_color_texture: cut.then_some(TextureSlot { texture: TextureId(0), uv_set: 0 }),
        base_alpha: alpha,
        alpha_mode: mode,
        ..Material::default()
    };
    let glow = b.material(glow);
    let left = if cut { -1.0 } else { 0.0 };
    // Facing down; u runs along x.
    let corners = [(left, -1.0), (1.0, -1.0), (1.0, 1.0), (left, 1.0)];
    let mesh = b.full_mesh(Mesh {
        name: "lamp".into(),
        positions: corners.map(|(x, z)| Vec3::new(x, 1.5, z)).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: Some(corners.map(|(x, z)| Vec2::new(0.5 + 0.5 * x, 0.5 + 0.5 * z)).to_vec()),
        material: glow,
        ..Mesh::default()
    });
    b.place(mesh, Affine3A::IDENTITY);
    let mut scene = b.build();
    scene.textures.push(half_cut());
    scene
}

/// A lamp shines only where it is there: both ways to find light agree with each other and with a lamp of that shape.
/// Blended by half, it gives half. Each estimate against the exact lamp's by Welch's z, 4.9 standard errors.
#[test]
fn b20_emitters_shine_where_they_are() {
    let mut case = Case::open("B20c", "lamps in part", "coverage of emitters, MIS");
    let ask = |scene: &Scene, strategy, variant| {
        let limited = options(1, 1, 1).max_depth(2).strategy(strategy);
        // The lamp is small for those who must find it by chance.
        let samples = if strategy == Strategy::BSDF { 1 << 20 } else { 1 << 17 };
        probe(scene, Vec3::new(-0.3, 0.7, 0.4), DOWN, samples, on(variant, limited))
    };
    let strategies = [Strategy::MIS, Strategy::BSDF, Strategy::LIGHT];
    let first = variants()[0];
    let whole = ask(&lamp(false, 1.0, AlphaMode::Opaque), Strategy::LIGHT, first);
    for variant in variants() {
        for strategy in strategies {
            for (what, share, scene) in [
                ("mask", 1.0, lamp(true, 1.0, AlphaMode::Mask { cutoff: 0.5 })),
                ("blended mask", 1.0, lamp(true, 1.0, AlphaMode::Blend)),
                ("half there", 0.5, lamp(false, 0.5, AlphaMode::Blend)),
            ] {
                // The modes of one backend share all that could differ here but their hits.
                if !matches!(variant.1, QueryMode::Single) && (what, strategy) != ("mask", Strategy::LIGHT) {
                    continue;
                }
                let found = ask(&scene, strategy, variant);
                let (expected, error) = (share * whole.mean[0], share * whole.standard_error(0));
                let z = (found.mean[0] - expected) / found.standard_error(0).hypot(error);
                let what = format!("{}, {what}, {strategy}", named(variant));
                let sees = 4.9 * found.standard_error(0) < 0.03 * expected;
                case.row(what, expected, found.mean[0], format!("{z:.2} σ"), z.abs() <= 4.9 && sees);
            }
        }
    }
    case.close();
}

/// Channels of the first hit look through what is cut out, and through veils that are there by less than half.
#[test]
fn b20_first_hits_look_through() {
    let mut case = Case::open("B20e", "channels of the first hit", "albedo, position behind sheets");
    let scene = |alpha: f32, mode: AlphaMode| {
        let mut b = SceneBuilder::new();
        let floor = b.lambert(Vec3::splat(0.25));
        square(&mut b, 0.0, floor);
        let sheet = b.material(Material { base_color: Vec3::ONE, alpha_mode: mode, ..sheet(alpha) });
        square(&mut b, 0.5, sheet);
        b.camera(Vec3::new(0.1, 3.0, 0.2), Vec3::new(0.1, 0.0, 0.2), Vec3::Z, 0.2);
        b.build()
    };
    for &kind in BackendKind::available() {
        for (what, alpha, mode, albedo, height) in [
            ("opaque", 0.0, AlphaMode::Opaque, 1.0, 0.5),
            ("cut out", 0.4, AlphaMode::Mask { cutoff: 0.5 }, 0.25, 0.0),
            ("there", 0.6, AlphaMode::Mask { cutoff: 0.5 }, 1.0, 0.5),
            ("a veil", 0.25, AlphaMode::Blend, 0.25 + 0.75 * 0.25, 0.0),
        ] {
            let aovs = vec![Aov::ALBEDO, Aov::POSITION];
            let options = options(32, 32, 16).backend(kind).aovs(aovs);
            let film = render(&scene(alpha, mode), options).film;
            let layer = |aov| film.layer(aov).expect("asked for");
            let estimate = Estimate::of(layer(Aov::ALBEDO).into_iter());
            let name = format!("{}, {what}", kind.name());
            if what == "a veil" {
                case.mean(format!("{name}, albedo"), [albedo; 3], 0.0, 0.05, &estimate);
            } else {
                case.number(format!("{name}, albedo"), albedo, estimate.mean[0], 1e-6);
            }
            case.number(format!("{name}, height"), height, layer(Aov::POSITION)[0][1], 1e-6);
        }
    }
    case.close();
}

/// Threads, instruction sets and machinery that nothing calls for change no bit; backends agree in the mean.
#[test]
fn b20_same_bits() {
    let mut case = Case::open("B20d", "determinism of passing rays", "same input, same bits");
    let scene = {
        let mut b = SceneBuilder::new();
        let floor = b.lambert(Vec3::splat(0.6));
        square(&mut b, 0.0, floor);
        let slot = Some(TextureSlot { texture: TextureId(0), uv_set: 0 });
        let leaf =
            Material { base_color: Vec3::new(0.3, 0.7, 0.2), metallic: 0.0, roughness: 0.4, ..Material::default() };
        let mask = b.material(Material {
            base_color_texture: slot,
            alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
            ..leaf.clone()
        });
        let veil = b.material(Material { base_alpha: 0.4, alpha_mode: AlphaMode::Blend, ..leaf });
        for i in 0..5 {
            square(&mut b, 0.1 + 0.1 * i as f32, if i % 2 == 0 { mask } else { veil });
        }
        let lamp = b.emitter(Vec3::ZERO, Vec3::splat(5.0));
        b.quad([[-0.3, 2.0, -0.3], [0.3, 2.0, -0.3], [0.3, 2.0, 0.3], [-0.3, 2.0, 0.3]].map(Vec3::from), lamp);
        b.camera(Vec3::new(0.5, 1.8, 1.9), Vec3::ZERO, Vec3::Y, 0.9);
        let mut scene = b.build();
        scene.textures.push(half_cut());
        scene
    };
    for &kind in BackendKind::available() {
        let film = |change: &dyn Fn(&mut RenderOptions)| {
            let mut options = options(48, 40, 6).backend(kind).threads(1);
            change(&mut options);
            render(&scene, options).film
        };
        let plain = film(&|_| {});
        let same = |change: &dyn Fn(&mut RenderOptions)| usize::from(film(change).hash() != plain.hash());
        case.bits(format!("{}, 3 threads", kind.name()), same(&|o| o.threads = 3));
        case.bits(format!("{}, all gates", kind.name()), same(&|o| o.forced = Gate::ALL.to_vec()));
        if kind != BackendKind::Embree && kind.pins("avx2") {
            case.bits(format!("{}, AVX2", kind.name()), same(&|o| o.isa = Some("avx2".into())));
        }
        let mean = |film: &pathspace::film::Film| film.pixels.iter().map(|p| p.mean()[1]).sum::<f64>();
        let brute = render(&scene, options(48, 40, 6).backend(BackendKind::Brute)).film;
        // The same paths but for those that rounding sends elsewhere.
        case.number(format!("{}, mean against brute", kind.name()), mean(&brute), mean(&plain), 5e-3);
    }
    case.close();
}
