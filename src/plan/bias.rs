//! The ledger of biases: everything that makes the expected picture differ from the true one. The plan lists what it
//! knows before the first ray, with a bound where scene and options give one; the statistics add what was measured.
//!
//! The depth limit M cuts the Neumann series after paths of M edges, that is M − 1 scatterings. Each scattering takes at most
//! the largest reflectance ρ, so the radiance that is missing anywhere is at most ρ^M·L with L = Le/(1 − ρ) the largest
//! radiance there can be (HARDCASES P12). There is no such L where a surface may reflect everything (ρ = 1: metals, coats
//! and glass at grazing angles) or beside a point light.

use serde::Serialize;

use super::options::{RenderOptions, Strategy};
use crate::scene::{Material, PunctualKind, Scene};

/// Something that makes the expected image differ from the true one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bias {
    /// Name, with its parameter: "max-depth 64".
    pub what: String,
    /// Fraction of the true picture's energy (sum of R, G and B) that it removes, measured; `None` until measured, and
    /// where it cannot be.
    pub energy_removed: Option<f64>,
    /// Upper bound of that fraction (95 %); `None` where there is none.
    pub energy_removed_at_most: Option<f64>,
    /// Upper bound of what any radiance lacks, W·sr⁻¹·m⁻², known before the render; `None` where there is none.
    pub radiance_removed_at_most: Option<f64>,
}

impl Bias {
    /// One of which nothing is known but that it is there.
    pub fn unmeasured(what: impl Into<String>) -> Self {
        Bias { what: what.into(), energy_removed: None, energy_removed_at_most: None, radiance_removed_at_most: None }
    }
}

/// Largest index of refraction of a solid dielectric that is simulated as it is; see `shading::bsdf::dielectric`.
const LARGEST_INDEX: f32 = 16.0;

/// Roughness (√alpha) below which a lobe is a mirror; see `shading::bsdf::microfacet`.
const MIRROR_ROUGHNESS: f32 = 0.01;

/// What is known to bias a render of `scene` under `options`, the depth limit first.
pub(super) fn ledger(scene: &Scene, options: &RenderOptions, footprints: bool) -> Vec<Bias> {
    let mut ledger = vec![depth_limit(scene, options.max_depth)];
    if options.strategy == Strategy::BsdfOnly && scene.punctual.iter().any(|l| l.intensity.max_element() > 0.0) {
        ledger.push(Bias::unmeasured("strategy bsdf: punctual lights are not found"));
    }
    if !options.robust {
        ledger.push(Bias::unmeasured("robust off: rays slip between triangles"));
    }
    if footprints {
        ledger.push(Bias::unmeasured("texture-filter trilinear: textures are averaged over the width of paths"));
    }
    if let Some(off) = &scene.motion.off {
        let what = format!(
            "shutter: motion is taken as straight in parts; '{}' is off by up to {:.1e} m",
            off.name, off.distance_m
        );
        ledger.push(Bias::unmeasured(what));
    }
    for material in placed(scene).filter(|material| !material.unlit && material.transmission > 0.0) {
        if !(1.0..=LARGEST_INDEX).contains(&material.ior) {
            let what = format!("index of refraction {} of '{}' taken as {LARGEST_INDEX}", material.ior, material.name);
            push_once(&mut ledger, what);
        }
    }
    for material in
        placed(scene).filter(|material| !material.unlit && material.reflectance_bound().max_element() >= 1.0)
    {
        if material.roughness > 0.0 && material.roughness < MIRROR_ROUGHNESS {
            push_once(&mut ledger, format!("roughness {} of '{}' taken as 0", material.roughness, material.name));
        }
    }
    ledger
}

fn push_once(ledger: &mut Vec<Bias>, what: String) {
    if !ledger.iter().any(|bias| bias.what == what) {
        ledger.push(Bias::unmeasured(what));
    }
}

fn depth_limit(scene: &Scene, max_depth: u32) -> Bias {
    let rho = largest_reflectance(scene);
    let lost = radiance_bound(scene)
        .map(|l| (0..3).map(|c| l[c] * rho[c].powi(max_depth as i32)).fold(0.0, f64::max))
        .filter(|lost| lost.is_finite());
    Bias { radiance_removed_at_most: lost, ..Bias::unmeasured(format!("max-depth {max_depth}")) }
}

/// Materials of everything that is placed.
fn placed(scene: &Scene) -> impl Iterator<Item = &Material> {
    scene.instances.iter().map(|instance| &scene.materials[scene.meshes[instance.mesh.index()].material.index()])
}

fn largest_reflectance(scene: &Scene) -> [f64; 3] {
    let largest = placed(scene).map(Material::reflectance_bound).fold(glam::Vec3::ZERO, glam::Vec3::max);
    largest.to_array().map(f64::from)
}

/// Largest radiance that can arrive anywhere, by channel, W·sr⁻¹·m⁻²: emission over 1 − ρ. Directional lights count with
/// what a surface makes of them, E·ρ/π. `None` where nothing bounds it.
pub fn radiance_bound(scene: &Scene) -> Option<[f64; 3]> {
    let rho = largest_reflectance(scene);
    let mut emitted = placed(scene)
        .map(|material| if material.unlit { material.base_color } else { material.emissive })
        .fold(glam::Vec3::ZERO, glam::Vec3::max);
    if let Some(environment) = &scene.environment {
        let brightest = environment.texels.iter().copied().fold(glam::Vec3::ZERO, glam::Vec3::max);
        emitted = emitted.max(brightest * environment.intensity);
    }
    let mut irradiance = glam::Vec3::ZERO;
    for light in scene.punctual.iter().filter(|light| light.intensity.max_element() > 0.0) {
        match light.kind {
            PunctualKind::Directional => irradiance += light.intensity,
            PunctualKind::Point | PunctualKind::Spot { .. } => return None,
        }
    }
    let bound = std::array::from_fn(|c| {
        let source = f64::from(emitted[c]) + rho[c] * f64::from(irradiance[c]) / std::f64::consts::PI;
        source / (1.0 - rho[c])
    });
    (rho.iter().all(|&rho| rho < 1.0) && bound.iter().all(|b| b.is_finite())).then_some(bound)
}
