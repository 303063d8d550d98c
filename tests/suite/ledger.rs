//! The ledger of biases: what a depth limit removes, measured, against closed forms.

use glam::Vec3;
use pathspace::plan::Bias;
use pathspace::plan::options::{RenderOptions, Roulette, Strategy};
use pathspace::render::Renderer;
use pathspace::scene::Scene;
use pathspace::scene::builder::SceneBuilder;
use pathspace::stats::{Seconds, Stats};

use crate::common::{options, shared};

/// Renders and returns the statistics.
pub fn stats(scene: &Scene, options: RenderOptions) -> Stats {
    let renderer = Renderer::new(scene, options).expect("valid options");
    let render = renderer.render().expect("renders");
    Stats::new(&renderer, &render, Seconds::default())
}

/// A closed room that emits 1 and reflects `albedo` everywhere.
fn furnace(albedo: f32) -> Scene {
    let mut b = SceneBuilder::new();
    let material = b.emitter(Vec3::splat(albedo), Vec3::ONE);
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, material);
    b.camera(Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 0.3, 0.1), Vec3::Y, 1.0);
    b.build()
}

fn energy_removed(bias: &Bias) -> (f64, f64) {
    (bias.energy_removed.expect("measured"), bias.energy_removed_at_most.expect("bounded"))
}

/// P03: a limit of M edges removes the fraction ρ^M. Deterministic under cosine sampling without roulette: all that is
/// left is the rounding of M products and of ρ itself. The bound lies above by the uncertainty of the number of capped
/// paths, 1.645/√n of it and a little, unless all paths are capped: in a furnace the largest radiance is the mean.
#[test]
fn a_furnace_lacks_exactly_what_the_ledger_says() {
    for (albedo, edges) in [(0.5f32, 1u32), (0.5, 9), (0.8, 17), (0.9, 9), (0.9, 65), (0.99, 65)] {
        let options = options(16, 16, 4).strategy(Strategy::BSDF).roulette(Roulette::Off).max_depth(edges);
        let stats = stats(&furnace(albedo), options);
        let (removed, most) = energy_removed(&stats.bias[0]);
        let expected = f64::from(albedo).powi(edges as i32);
        let rounding = (f64::from(edges) + 4.0) * 2f64.powi(-23);
        assert!((removed / expected - 1.0).abs() < rounding, "ρ = {albedo}, {edges} edges: {removed} for {expected}");
        assert!(most >= removed * (1.0 - 1e-6) && most < 1.1 * removed, "at most {most} for {removed}");

        // The bound of the plan is the radiance that is missing, ρ^M/(1 − ρ).
        let radiance = stats.bias[0].radiance_removed_at_most.expect("bounded");
        assert!((radiance * (1.0 - f64::from(albedo)) / expected - 1.0).abs() < 1e-6, "{radiance}");
        assert_eq!(stats.bias[0].what, format!("max-depth {edges}"));
    }
}

/// The same with roulette and light sampling: a path carries at most 1, so the mean of n paths has a standard error of
/// at most √(W/n); 4.9 of them, false alarms 10⁻⁶.
#[test]
fn roulette_does_not_change_what_the_ledger_expects() {
    let (n, edges) = (64.0 * 64.0 * 16.0, 9);
    let stats = stats(&furnace(0.9), options(64, 64, 16).max_depth(edges));
    let (removed, most) = energy_removed(&stats.bias[0]);
    let expected = 0.9f64.powi(edges as i32);
    assert!((removed - expected).abs() < 4.9 * (expected / n).sqrt(), "{removed} for {expected}");
    assert!(most > removed && stats.capped_paths > 0);
}

/// A default render of a diffuse scene lists the depth limit alone, with a bound; glass has none, and says so by
/// `null`.
#[test]
fn default_renders_list_the_depth_limit_only() {
    let Some(shared) = shared("the ledgers of the shared scenes") else { return };
    for (name, bounded) in [("cornell-box", true), ("veach-mis", false), ("glass-caustics", false)] {
        let scene = Scene::load(shared.join(format!("scenes/{name}.gltf"))).expect("a shared scene");
        let stats = stats(&scene, options(16, 16, 4));
        let what: Vec<&str> = stats.bias.iter().map(|bias| bias.what.as_str()).collect();
        assert_eq!(what, ["max-depth 64"], "{name}");
        assert!(stats.bias[0].energy_removed.is_some(), "{name}");
        assert_eq!(stats.bias[0].energy_removed_at_most.is_some(), bounded, "{name}");
        assert_eq!(stats.bias[0].radiance_removed_at_most.is_some(), bounded, "{name}");
    }
}

/// What else the options or the scene take away is named.
#[test]
fn other_biases_are_listed_by_name() {
    let mut b = SceneBuilder::new();
    let (white, glass) = (b.lambert(Vec3::splat(0.5)), b.glass(40.0));
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
    b.sphere(Vec3::ZERO, 0.2, 4, false, false, glass);
    b.point_light(Vec3::new(0.0, 0.9, 0.0), Vec3::ONE);
    b.camera(Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 0.3, 0.1), Vec3::Y, 1.0);
    let stats = stats(&b.build(), options(8, 8, 2).strategy(Strategy::BSDF));
    let what: Vec<&str> = stats.bias.iter().map(|bias| bias.what.as_str()).collect();
    assert_eq!(what.len(), 3, "{what:?}");
    assert!(what[1].contains("punctual") && what[2].contains("index of refraction 40"), "{what:?}");
}

/// A mirror, glass, and lamps in a room; the lamps are `shine` bright.
fn lamps(mirror: Option<f32>, glass: Option<f32>, shine: f32) -> Scene {
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::splat(0.5));
    b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
    if let Some(alpha) = mirror {
        let metal = b.metal(Vec3::splat(0.9), alpha);
        b.sphere(Vec3::ZERO, 0.2, 4, false, false, metal);
    }
    if let Some(ior) = glass {
        let glass = b.glass(ior);
        b.sphere(Vec3::new(0.5, 0.0, 0.0), 0.2, 4, false, false, glass);
    }
    let lamp = b.emitter(Vec3::ZERO, Vec3::ONE);
    b.quad([[-0.3, 0.99, -0.3], [0.3, 0.99, -0.3], [0.3, 0.99, 0.3], [-0.3, 0.99, 0.3]].map(Vec3::from), lamp);
    b.point_light(Vec3::new(0.0, 0.9, 0.0), Vec3::splat(shine));
    b.camera(Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 0.3, 0.1), Vec3::Y, 1.0);
    let mut scene = b.build();
    scene.punctual[0].name = "bulb\u{1b}".into();
    for (material, name) in scene.materials.iter_mut().skip(1).zip(["first ball", "second ball"]) {
        material.name = name.into();
    }
    scene
}

/// Light without extent by way of mirrors and smooth glass is found by no technique: each strategy says so, in `info`
/// and in the statistics; where there is no such light or no such surface, none does. Oracle: the list of techniques.
#[test]
fn punctual_light_by_way_of_mirrors_and_glass_is_listed() {
    let plan = |scene: &Scene, strategy| {
        let renderer = Renderer::new(scene, options(8, 8, 2).strategy(strategy)).expect("valid options");
        let text = renderer.plan().to_string();
        let listed = stats(scene, options(8, 8, 2).strategy(strategy)).bias;
        assert!(listed.iter().all(|bias| text.contains(&bias.what)), "{text}");
        listed.into_iter().map(|bias| bias.what).filter(|what| what.contains("found")).collect::<Vec<_>>()
    };
    let both = lamps(Some(0.0), Some(1.5), 1.0);
    for strategy in [Strategy::MIS, Strategy::MIS_BALANCE, Strategy::LIGHT] {
        let [what] = &plan(&both, strategy)[..] else { panic!("one entry") };
        for name in ["'first ball'", "'second ball'", "'bulb", "no technique"] {
            assert!(what.contains(name), "{name}: {what}");
        }
        assert!(!what.contains('\u{1b}'), "{what}");
    }
    // BSDF sampling finds none of that light in any way.
    assert_eq!(plan(&both, Strategy::BSDF), ["strategy bsdf: punctual lights are not found"]);
    let lists = |mirror, glass, shine| !plan(&lamps(mirror, glass, shine), Strategy::MIS).is_empty();
    assert!(lists(Some(0.0), None, 1.0) && lists(None, Some(1.5), 1.0));
    // Diffuse and rough surfaces, no light, and glass that light goes straight through.
    assert!(!lists(None, None, 1.0) && !lists(Some(0.1), None, 1.0) && !lists(Some(0.0), None, 0.0));
    assert!(!lists(None, Some(1.0), 1.0));
}
