//! `--backfaces`: who meets the backs of surfaces that are not `doubleSided`, on every backend and query mode, by every
//! strategy. Oracles are closed forms; where nothing is random they are held to rounding. Chance of a false alarm: that
//! of [`Estimate::expect`](crate::common::Estimate::expect).

use glam::{Affine3A, Vec3};
use pathspace::Aov;
use pathspace::backend::{BackendKind, QueryMode};
use pathspace::render::{Backfaces, FilterKind, LightPaths, RenderOptions, Renderer, Strategy};
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{AlphaMode, Environment, Material, MaterialId, PunctualKind, Scene};

use crate::common::{options, probe, probe_film, single_ray};

const MODES: [Backfaces; 3] = [Backfaces::Show, Backfaces::Hide, Backfaces::HideAll];

/// Every backend with the query modes that it tells apart.
fn variants() -> Vec<(BackendKind, QueryMode)> {
    let modes = |kind| if kind == BackendKind::Embree { &QueryMode::ALL[..] } else { &QueryMode::ALL[..1] };
    BackendKind::available().iter().flat_map(|&kind| modes(kind).iter().map(move |&mode| (kind, mode))).collect()
}

/// A square of half side 1 about the y axis, facing up or down.
fn square(b: &mut SceneBuilder, y: f32, up: bool, material: MaterialId) {
    let mut corners = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].map(|(x, z)| Vec3::new(x, y, z));
    if !up {
        corners.reverse();
    }
    b.quad(corners, material);
}

fn material(double_sided: bool) -> Material {
    let black = Material { base_color: Vec3::ZERO, metallic: 0.0, specular: 0.0, ..Material::default() };
    Material { double_sided, ..black }
}

/// A slanted ray, so that it crosses nothing at an edge.
const DOWN: Vec3 = Vec3::new(0.013, -1.0, 0.021);

fn radiance(scene: &Scene, eye: Vec3, dir: Vec3, options: RenderOptions) -> f64 {
    probe(scene, eye, dir, 16, options).mean[1]
}

/// A black sheet over a lamp: seen from its front it hides the lamp, from behind it does so where it is two-sided.
#[test]
fn camera_rays_pass_backs() {
    let scene = |up: bool, material: Material, mirrored: bool| {
        let mut b = SceneBuilder::new();
        let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
        square(&mut b, 0.0, true, lamp);
        let sheet = b.material(material);
        if !mirrored {
            square(&mut b, 1.0, up, sheet);
            return b.build();
        }
        // Placed twice, so that it stays instanced; a mirrored placement turns no face over.
        let z = if up { 1.0 } else { -1.0 };
        let mesh = b.mesh(vec![Vec3::X, -Vec3::X - z * Vec3::Z, z * Vec3::Z - Vec3::X], vec![[0, 1, 2]], sheet);
        for x in [0.2, 40.0] {
            b.place(
                mesh,
                Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0)) * Affine3A::from_translation(Vec3::new(x, 1.0, 0.0)),
            );
        }
        b.build()
    };
    let masked = Material { base_alpha: 0.3, alpha_mode: AlphaMode::Mask { cutoff: 0.2 }, ..material(false) };
    for (kind, rays) in variants() {
        for mode in MODES {
            for (up, double_sided, mirrored) in [
                (true, false, false),
                (false, false, false),
                (false, true, false),
                (true, false, true),
                (false, false, true),
            ] {
                let options = options(1, 1, 1).backend(kind).rays(rays).backfaces(mode);
                let what = format!("{kind:?} {rays:?} {mode:?}, up {up}, double-sided {double_sided}, {mirrored}");
                let passes = !up && !double_sided && mode != Backfaces::Show;
                let scene = scene(up, material(double_sided), mirrored);
                let seen = radiance(&scene, Vec3::new(0.0, 9.0, 0.0), DOWN, options);
                assert_eq!(seen, f64::from(u8::from(passes)), "{what}");
            }
            let options = options(1, 1, 1).backend(kind).rays(rays).backfaces(mode);
            let seen = radiance(&scene(false, masked.clone(), false), Vec3::new(0.0, 9.0, 0.0), DOWN, options);
            assert_eq!(seen, f64::from(u8::from(mode != Backfaces::Show)), "masked {kind:?} {rays:?} {mode:?}");
        }
    }
}

/// A sheet between a floor and the sun: shadow rays pass its back where paths do.
#[test]
fn shadow_rays_pass_backs_where_all_do() {
    let scene = |up: bool| {
        let mut b = SceneBuilder::new();
        let floor = b.lambert(Vec3::splat(0.5));
        square(&mut b, 0.0, true, floor);
        let sheet = b.material(material(false));
        square(&mut b, 1.0, up, sheet);
        b.punctual(Vec3::ZERO, -Vec3::Y, Vec3::ONE, PunctualKind::Directional);
        b.build()
    };
    for (kind, rays) in variants() {
        for mode in MODES {
            for up in [true, false] {
                let options = options(1, 1, 1).backend(kind).rays(rays).backfaces(mode);
                let expected = if up && mode == Backfaces::HideAll { 0.5 / std::f64::consts::PI } else { 0.0 };
                let seen = radiance(&scene(up), Vec3::new(0.2, 0.5, 0.1), DOWN, options);
                assert!((seen - expected).abs() < 1e-6, "{kind:?} {rays:?} {mode:?}, up {up}: {seen}, not {expected}");
            }
        }
    }
}

/// A grey square in a closed black box whose walls face outwards, in a white furnace: where every ray passes backs the
/// square reflects its albedo, else nothing. A lid that faces the square hides its half of the sky.
#[test]
fn light_reaches_into_boxes_alike_by_every_strategy() {
    let scene = |lid: bool| {
        let mut b = SceneBuilder::new();
        let grey = b.lambert(Vec3::splat(0.5));
        square(&mut b, 0.0, true, grey);
        let black = b.material(material(false));
        b.cuboid(Vec3::new(-2.0, -1.0, -2.0), Vec3::new(2.0, 2.0, 2.0), false, black);
        if lid {
            // A wall through the axis, wide against its distance: half of the light, cosines and all.
            let far = 1e4;
            let corner = |y: f32, z: f32| Vec3::new(0.0, y * far, z * far);
            b.quad([corner(0.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(0.0, 1.0)], black);
        }
        b.environment(Environment::constant(Vec3::ONE));
        b.build()
    };
    let eye = Vec3::new(0.2, 0.5, 0.1);
    for kind in BackendKind::available().iter().copied() {
        for strategy in [Strategy::MIS, Strategy::MIS_BALANCE, Strategy::BSDF, Strategy::LIGHT] {
            for mode in MODES {
                let options = options(1, 1, 16).backend(kind).strategy(strategy).backfaces(mode);
                let what = format!("{kind:?} {} {mode:?}", strategy.name());
                let seen = probe(&scene(false), eye, DOWN, 1 << 10, options.clone());
                if mode == Backfaces::HideAll {
                    seen.expect(&what, 0.5, 1e-6, 0.06);
                } else {
                    assert_eq!(seen.mean, [0.0; 3], "{what}");
                }
                // From outside, all see the black walls.
                let outside = radiance(&scene(false), Vec3::new(0.2, 9.0, 0.1), DOWN, options);
                assert_eq!(outside, 0.0, "{what}, outside");
            }
            // The wall faces +x: seen from there it is black, from the other side it is not there.
            let near_wall = |x: f32| {
                let options = options(1, 1, 16).backend(kind).strategy(strategy).backfaces(Backfaces::HideAll);
                probe(&scene(true), Vec3::new(x, 0.5, 0.1), -Vec3::Y, 1 << 10, options)
            };
            near_wall(1e-3).expect("front of the wall", 0.25, 1e-3, 0.1);
            near_wall(-1e-3).expect("back of the wall", 0.5, 1e-3, 0.06);
        }
    }
}

/// Solids keep both sides: a slab 1 m thick that absorbs lets through what it says, whoever passes backs.
#[test]
fn boundaries_of_solids_stay() {
    let mut b = SceneBuilder::new();
    let glass = Material {
        metallic: 0.0,
        roughness: 0.0,
        ior: 1.0,
        transmission: 1.0,
        thickness: 1.0,
        attenuation_color: Vec3::splat(0.25),
        attenuation_distance_m: 1.0,
        ..Material::default()
    };
    let glass = b.material(glass);
    b.cuboid(Vec3::new(-1.0, -0.5, -1.0), Vec3::new(1.0, 0.5, 1.0), false, glass);
    let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
    square(&mut b, -2.0, true, lamp);
    let scene = b.build();
    for mode in MODES {
        let seen = radiance(&scene, Vec3::new(0.0, 5.0, 0.1), -Vec3::Y, options(1, 1, 1).backfaces(mode));
        assert!((seen - 0.25).abs() < 1e-6, "{mode:?}: {seen}");
    }
}

/// Layers of what camera rays meet show what lies behind; the plan says what runs, what is ignored, and what light
/// paths cannot do.
#[test]
fn layers_and_plan_say_so() {
    let mut b = SceneBuilder::new();
    let floor = b.material(Material { double_sided: true, ..Material::default() });
    square(&mut b, 0.0, true, floor);
    let mirror = b.material(Material { roughness: 0.0, ..Material::default() });
    square(&mut b, 1.0, false, mirror);
    b.environment(Environment::constant(Vec3::ONE));
    let scene = b.build();
    for mode in MODES {
        let options = options(1, 1, 1).backfaces(mode);
        let film = probe_film(&scene, Vec3::new(0.0, 3.0, 0.0), -Vec3::Y, 1, options.clone().aovs([Aov::DEPTH])).film;
        let depth = film.layer(Aov::DEPTH).expect("asked for")[0][0];
        assert!((depth - if mode == Backfaces::Show { 2.0 } else { 3.0 }).abs() < 1e-6, "{mode:?}: {depth}");

        let mut scene = scene.clone();
        scene.cameras.push(single_ray(Vec3::Y, Vec3::NEG_Y));
        let renderer = Renderer::new(&scene, options.clone().filter(FilterKind::Box)).expect("a plan");
        let plan = renderer.plan();
        let hides = mode != Backfaces::Show;
        assert_eq!(plan.features.hidden_backs, hides, "{mode:?}");
        assert_eq!(plan.features.hidden_to_all, mode == Backfaces::HideAll);
        assert_eq!(plan.light_paths_reason.contains("backs of surfaces are hidden"), hides, "{plan:?}");
        let ignored = plan.effects.ignored.iter().any(|ignored| ignored.what.starts_with("one-sided-faces"));
        assert_eq!(ignored, !hides, "{:?}", plan.effects);
        // Asked for by name, light paths are refused.
        match Renderer::new(&scene, options.light_paths(LightPaths::Share(0.25))) {
            Ok(renderer) => assert!(!hides && renderer.plan().features.light_paths, "{mode:?}"),
            Err(error) => assert!(hides && error.to_string().contains("backs of surfaces are hidden"), "{error}"),
        }
    }
}
