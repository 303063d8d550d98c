//! The ledger of biases: everything that makes the expected picture differ from the true one. The plan lists what it
//! knows before the first ray, with a bound where scene and options give one; the statistics add what was measured.
//!
//! The depth limit M cuts the Neumann series after paths of M edges, that is M − 1 scatterings. Each scattering takes
//! at most the largest reflectance ρ, so the radiance that is missing anywhere is at most ρ^M·L with L = Le/(1 −
//! ρ) the largest radiance there can be (HARDCASES P12). There is no such L where a surface may reflect everything (ρ
//! = 1: metals, coats and glass at grazing angles) or beside a point light.

use serde::Serialize;

use super::effects::asked::{Asked, Placed};
use super::effects::table::Features;
use crate::plain::one_line;
use crate::scene::geometry::Solid;
use crate::scene::material::facts::MIRROR_ROUGHNESS;
use crate::scene::{Fact, Facts, Material, Projection, PunctualKind, PunctualLight, Scene};

/// Something that makes the expected image differ from the true one.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
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

/// What is approximated of a material: one rule each, which tells it of a material that it applies to.
const APPROXIMATIONS: [fn(&Material, &Facts) -> Option<String>; 5] = [
    |material, facts| {
        let clear = facts.has(Fact::Solid) || facts.has(Fact::Thin);
        let off = clear && !(1.0..=LARGEST_INDEX).contains(&material.ior);
        off.then(|| {
            format!("index of refraction {} of '{}' taken as {LARGEST_INDEX}", material.ior, one_line(&material.name))
        })
    },
    |material, facts| {
        let off = facts.has(Fact::Mirror) && material.roughness > 0.0 && material.roughness < MIRROR_ROUGHNESS;
        off.then(|| format!("roughness {} of '{}' taken as 0", material.roughness, one_line(&material.name)))
    },
    |material, _| {
        let off = material.sheen_color.max_element() > 0.0 && material.sheen_roughness < MIRROR_ROUGHNESS;
        let what = || format!("sheen of roughness {} of '{}'", material.sheen_roughness, one_line(&material.name));
        off.then(|| format!("{} left out: it is seen at the horizon alone", what()))
    },
    |material, facts| {
        let off = facts.has(Fact::Translucent) && material.thickness > 0.0;
        let name = || one_line(&material.name);
        off.then(|| format!("volume below the diffuse base of '{}' not entered: light passes at a point", name()))
    },
    |material, facts| {
        let off = facts.has(Fact::Clearcoat) && facts.has(Fact::Emits);
        off.then(|| format!("emission of '{}' not darkened by its clearcoat", one_line(&material.name)))
    },
];

/// What is known to bias a render of `scene` under `options`, the depth limit first.
pub(super) fn ledger(asked: &Asked, features: &Features) -> Vec<Bias> {
    let Asked { scene, options, .. } = *asked;
    let mut ledger = vec![depth_limit(asked)];
    ledger.extend(scene.left_out.iter().filter_map(|left_out| Some(Bias::unmeasured(left_out.bias()?))));
    if !options.strategy.techniques.light && scene.punctual.iter().any(|l| l.intensity.max_element() > 0.0) {
        ledger.push(Bias::unmeasured("strategy bsdf: punctual lights are not found"));
    }
    if !options.robust {
        ledger.push(Bias::unmeasured("robust off: rays slip between triangles"));
    }
    if features.normal_maps && !features.folded_normals {
        ledger.push(Bias::unmeasured("fold-normals off: light that normal maps send below the surface is lost"));
    }
    ledger.extend(unfound(asked, features.nested, features.light_paths).map(Bias::unmeasured));
    if asked.geometry.coincident.crowded() {
        ledger.push(Bias::unmeasured(
            "coincident faces: in crowded planes not all are known; which of them is met is open",
        ));
    }
    if asked.geometry.coincident.unsearched() {
        ledger.push(Bias::unmeasured(
            "coincident faces: those of instanced placements were not all looked for; which of them is met is open",
        ));
    }
    if asked.geometry.coincident.moving() {
        ledger.push(Bias::unmeasured(
            "coincident faces: placements move with faces that lie on one another; which of them is met is open",
        ));
    }
    if features.media {
        ledger.extend(unclear_media(asked).into_iter().map(Bias::unmeasured));
    }
    if features.footprints {
        ledger.push(Bias::unmeasured("texture-filter trilinear: textures are averaged over the width of paths"));
    }
    if let Some(off) = &scene.motion.off {
        let what = format!(
            "shutter: motion is taken as straight in parts; '{}' is off by up to {:.1e} m",
            one_line(&off.name),
            off.distance_m
        );
        ledger.push(Bias::unmeasured(what));
    }
    for rule in APPROXIMATIONS {
        for what in placed(scene).filter_map(|material| rule(material, &Facts::of(material))) {
            push_once(&mut ledger, what);
        }
    }
    ledger
}

/// Punctual light on paths that no technique finds: a light without extent is not met by chance, and light samples do
/// not bend at mirrors and smooth glass. Light paths do, but end where the camera sees by such a way as well.
pub(super) fn unfound(asked: &Asked, nested: bool, light_paths: bool) -> Option<String> {
    // Light goes straight through boundaries between equal indices, and light samples with it.
    let straight = |placed: &Placed| placed.facts.has(Fact::Clear) && !nested && placed.material.ior == 1.0;
    let shines = |light: &&PunctualLight| light.intensity.max_element() > 0.0;
    let lights: Vec<&str> = asked.scene.punctual.iter().filter(shines).map(|light| light.name.as_str()).collect();
    let smooth = |placed: &&Placed| placed.facts.has(Fact::Mirror) && !straight(placed);
    let mut casters: Vec<&str> = Vec::new();
    for placed in asked.placed.iter().filter(smooth) {
        let name = placed.material.name.as_str();
        if !casters.contains(&name) {
            casters.push(name);
        }
    }
    let wanted = asked.options.strategy.techniques.light && !lights.is_empty() && !casters.is_empty();
    let seen = if light_paths { ", seen by such a way itself," } else { "" };
    let what = || {
        format!(
            "light of {} by way of smooth reflection or transmission at {}{seen} is found by no technique",
            quoted(&lights),
            quoted(&casters)
        )
    };
    wanted.then(what)
}

/// Names for people: three at most.
fn quoted(names: &[&str]) -> String {
    let mut list = names.iter().take(3).map(|name| format!("'{}'", one_line(name))).collect::<Vec<_>>().join(", ");
    if names.len() > 3 {
        list += &format!(" and {} more", names.len() - 3);
    }
    list
}

/// What is not known of the solids around the camera, and of solids that have no certain inside.
fn unclear_media(asked: &Asked) -> Vec<String> {
    let Asked { scene, geometry, options, .. } = asked;
    let name = |solid: &Solid| scene.materials[solid.material as usize].name.as_str();
    let mut found = Vec::new();
    let mut open: Vec<&str> = geometry.solids.list().iter().filter(|solid| !solid.closed).map(name).collect();
    open.dedup();
    if !open.is_empty() {
        found.push(format!(
            "meshes of {} have a volume and are not closed: a path that enters one is in it until it meets a back face \
             of it",
            quoted(&open)
        ));
    }
    let camera = &scene.cameras[asked.camera];
    let unclear = geometry.solids_around(camera.position()).1;
    if let Some(&first) = unclear.first() {
        let solid = &geometry.solids.list()[first as usize];
        found.push(format!("whether the camera is within '{}' is not clear: it is taken as outside", name(solid)));
    }
    let places = asked.camera_places();
    let before = geometry.solids_around(places[0]).0;
    let changed = places[1..].iter().find_map(|&place| {
        let now = geometry.solids_around(place).0;
        before.iter().chain(&now).copied().find(|solid| before.contains(solid) != now.contains(solid))
    });
    if let Some(solid) = changed {
        found.push(format!(
            "all camera rays begin in the media around the camera as the shutter opens; on its way it passes the \
             boundary of '{}'",
            name(&geometry.solids.list()[solid as usize])
        ));
    }
    let reach = match camera.projection {
        Projection::Orthographic { xmag_m, ymag_m } => xmag_m.hypot(ymag_m),
        _ => options.lens.map_or(0.0, |lens| lens.radius_m),
    };
    let near = |solid: &&Solid| {
        let (low, high) = solid.bounds;
        let nearest = camera.position().clamp(low, high);
        nearest.distance(camera.position()) < reach
    };
    if let Some(solid) = geometry.solids.list().iter().find(near) {
        found.push(format!(
            "all camera rays begin in the media of the camera's centre; '{}' is as near as they start",
            name(solid)
        ));
    }
    found
}

fn push_once(ledger: &mut Vec<Bias>, what: String) {
    if !ledger.iter().any(|bias| bias.what == what) {
        ledger.push(Bias::unmeasured(what));
    }
}

fn depth_limit(Asked { scene, options, .. }: &Asked) -> Bias {
    let max_depth = options.max_depth;
    let fog = options.fog.map_or(0.0, |fog| f64::from(fog.albedo));
    let rho = largest_reflectance(scene).map(|rho| rho.max(fog));
    let lost = radiance_bound(scene)
        .filter(|_| options.fog.is_none())
        .map(|l| (0..3).map(|c| l[c] * rho[c].powi(max_depth as i32)).fold(0.0, f64::max))
        .filter(|lost| lost.is_finite());
    Bias { radiance_removed_at_most: lost, ..Bias::unmeasured(format!("max-depth {max_depth}")) }
}

/// Materials of everything that is placed.
fn placed(scene: &Scene) -> impl Iterator<Item = &Material> {
    scene.instances.iter().map(|instance| &scene.materials[scene.material_of(instance).index()])
}

fn largest_reflectance(scene: &Scene) -> [f64; 3] {
    let bounds = placed(scene).map(|material| Facts::of(material).reflectance_bound);
    let largest = bounds.fold(glam::Vec3::ZERO, glam::Vec3::max);
    largest.to_array().map(f64::from)
}

/// Largest radiance that can arrive anywhere, by channel, W·sr⁻¹·m⁻²: emission over 1 − ρ. Directional
/// lights count with what a surface makes of them, E·ρ/π. `None` where nothing bounds it.
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
