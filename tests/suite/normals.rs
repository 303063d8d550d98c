//! Normals that normal maps tilt: no light is lost where facets face away or lobes reach below the surface. Oracles: a
//! furnace; one strategy against another. Renders within 4.9 standard errors of their pixels (two-sided 10⁻⁶).

use glam::Vec3;
use pathspace::backend::BackendKind;
use pathspace::plan::options::Strategy;
use pathspace::scene::{Environment, LoadOptions, Material, Scene};

use crate::common::{Estimate, options, render, shared};

/// A Lambert floor with bumps of up to 27°, seen at 20°.
fn floor(change: impl Fn(&mut Material), environment: Environment) -> Option<Scene> {
    let file = shared("bumps seen at 20 degrees")?.join("cases/normal-map-black/floor.gltf");
    let options = LoadOptions::default().fallback_light(false);
    let mut scene = Scene::load_with(file, &options).unwrap_or_else(|e| panic!("{e}"));
    scene.materials.iter_mut().for_each(change);
    scene.environment = Some(environment);
    Some(scene)
}

fn found(scene: &Scene, strategy: Strategy, spp: u64) -> Estimate {
    let options = options(16, 16, spp).backend(BackendKind::Obvhs).strategy(strategy).max_depth(8);
    Estimate::of_pixels(&render(scene, options).film)
}

/// The file that went wrong: 0.6 and black streaks, and 0.8 of light goes in.
#[test]
fn bumps_lose_no_light() {
    let Some(scene) = floor(|_| (), Environment::constant(Vec3::ONE)) else { return };
    for strategy in [Strategy::MIS, Strategy::BSDF, Strategy::LIGHT] {
        let found = found(&scene, strategy, 64);
        let (mean, allowed) = (found.mean[0], 4.9 * found.standard_error(0));
        assert!((mean - 0.8).abs() < allowed + 1e-4 && allowed < 0.02, "{mean} ± {allowed} by {strategy}");
    }
}

/// Coats and metals over the same bumps, under light from one side: strategies agree.
#[test]
fn strategies_agree_on_bumps() {
    let metal = |material: &mut Material| (material.metallic, material.roughness) = (1.0, 0.4);
    let coat = |material: &mut Material| {
        (material.metallic, material.roughness, material.specular) = (0.0, 0.5, 1.0);
    };
    let changes: [&dyn Fn(&mut Material); 2] = [&metal, &coat];
    for change in changes {
        let mut sky = Environment::constant(Vec3::ONE);
        (sky.width, sky.height) = (4, 2);
        sky.texels = [0.1, 2.0, 0.3, 0.1, 0.5, 0.5, 0.5, 0.5].map(Vec3::splat).into();
        let Some(scene) = floor(|material| change(material), sky) else { return };
        let [mis, bsdf, light] =
            [Strategy::MIS, Strategy::BSDF, Strategy::LIGHT].map(|strategy| found(&scene, strategy, 4096));
        for other in [bsdf, light] {
            let error = mis.standard_error(0).hypot(other.standard_error(0));
            let off = (mis.mean[0] - other.mean[0]).abs();
            assert!(off < 4.9 * error && error < 0.05 * mis.mean[0], "{} {} ± {error}", mis.mean[0], other.mean[0]);
        }
    }
}
