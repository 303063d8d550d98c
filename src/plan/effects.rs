//! What a scene calls for: found from scene and options, with the first object that asks for each effect. Pure.

use std::collections::BTreeMap;

use serde::Serialize;

use super::options::{Aov, RenderOptions, Strategy, TextureFilter};
use crate::scene::{AlphaMode, Material, Mesh, Projection, PunctualKind, Scene};

/// An effect that is not simulated, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Ignored {
    /// Name of the effect, with the object that asks for it.
    pub what: String,
    /// Why it is not simulated.
    pub why: String,
}

/// Effects of a scene, for people and programs.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Effects {
    /// What the file and the options ask for: "smooth-normals (mesh 'ball')".
    pub found: Vec<String>,
    /// What will run.
    pub simulated: Vec<String>,
    /// What will not.
    pub ignored: Vec<Ignored>,
}

/// The gates that the stages read. Each is true only if something in the scene or the options calls for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Features {
    /// A finite aperture.
    pub lens: bool,
    /// Something moves while the shutter is open: paths have times.
    pub shutter: bool,
    /// Vertex normals on some placed mesh.
    pub smooth_normals: bool,
    /// Any texture at all; the four below say which.
    pub textures: bool,
    /// Textures are averaged over the width of paths, which have to be kept.
    pub footprints: bool,
    /// Base-colour textures.
    pub base_color_textures: bool,
    /// Surfaces that are not there everywhere: alpha masks and blending.
    pub alpha: bool,
    /// Colours at vertices.
    pub vertex_colors: bool,
    /// More than one channel of texture coordinates on some mesh.
    pub more_uvs: bool,
    /// Metallic-roughness textures.
    pub metallic_roughness_textures: bool,
    /// Normal maps.
    pub normal_maps: bool,
    /// Emissive textures.
    pub emissive_textures: bool,
    /// Specular reflection on an opaque surface (metal, or a dielectric coat).
    pub glossy: bool,
    /// Dielectric coats over a diffuse base: needs the albedo tables.
    pub coated: bool,
    /// Solid dielectrics.
    pub dielectric: bool,
    /// Thin-walled transmission.
    pub thin: bool,
    /// Absorption inside solid dielectrics.
    pub absorption: bool,
    /// Unlit materials.
    pub unlit: bool,
    /// Light from infinity all around.
    pub environment: bool,
    /// Point, spot and directional lights.
    pub punctual: bool,
    /// Emissive triangles.
    pub area_lights: bool,
    /// Placements that stay instanced.
    pub instancing: bool,
    /// One accumulator per path length.
    pub per_length: bool,
    /// Light samples at surfaces: there is a light, and the strategy wants them.
    pub light_sampling: bool,
    /// Every material is shaded by the general kernel; only by force.
    pub all_general: bool,
    /// Light samples where only delta lobes scatter; only by force.
    pub lights_at_deltas: bool,
    /// A pass of its own over what camera rays meet first.
    pub first_hit: bool,
}

/// A stage, or a part of one, that can be made to run although nothing calls for it: for tests that it changes nothing,
/// and for counts of what it would cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Gate {
    /// Camera rays from a lens, here of radius 0. (Cameras with parallel rays have none.)
    Lens,
    /// Interpolated normals, here of flat triangles.
    SmoothNormals,
    /// Look-ups, here of materials that read no texture.
    Textures,
    /// The general kernel, here for materials that a lean one serves.
    General,
    /// Absorption, here of solids that absorb nothing.
    Absorption,
    /// Escaped rays, here into blackness.
    Environment,
    /// Light samples, here of no light.
    LightSampling,
    /// Light samples where only delta lobes scatter, which reflect nothing of them.
    LightsAtDeltas,
    /// One accumulator per path length, here for nobody.
    PerLength,
    /// Passing rays, here through nothing; shadow rays look for their closest hit.
    Alpha,
    /// Colours at vertices, here of materials that read none.
    VertexColors,
    /// Times of paths, here of scenes at rest.
    Shutter,
}

impl Gate {
    /// Every gate: what `--no-plan` opens.
    pub const ALL: [Gate; 12] = [
        Gate::Lens,
        Gate::SmoothNormals,
        Gate::Textures,
        Gate::General,
        Gate::Absorption,
        Gate::Environment,
        Gate::LightSampling,
        Gate::LightsAtDeltas,
        Gate::PerLength,
        Gate::Alpha,
        Gate::VertexColors,
        Gate::Shutter,
    ];

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Gate::Lens => "lens",
            Gate::SmoothNormals => "smooth-normals",
            Gate::Textures => "textures",
            Gate::General => "general-kernel",
            Gate::Absorption => "absorption",
            Gate::Environment => "environment",
            Gate::LightSampling => "light-sampling",
            Gate::LightsAtDeltas => "lights-at-deltas",
            Gate::PerLength => "per-length-images",
            Gate::Alpha => "alpha",
            Gate::VertexColors => "vertex-colours",
            Gate::Shutter => "shutter",
        }
    }
}

impl Features {
    /// Opens gates that nothing calls for. The picture stays the same, bit for bit: a strategy that must not sample lights
    /// does not.
    pub fn force(&mut self, gates: &[Gate], strategy: Strategy) {
        for gate in gates {
            match gate {
                Gate::Lens => self.lens = true,
                Gate::SmoothNormals => self.smooth_normals = true,
                Gate::Textures => self.textures = true,
                Gate::General => self.all_general = true,
                Gate::Absorption => self.absorption = true,
                Gate::Environment => self.environment = true,
                Gate::LightSampling => self.light_sampling = strategy != Strategy::BsdfOnly,
                Gate::LightsAtDeltas => self.lights_at_deltas = true,
                Gate::PerLength => self.per_length = true,
                Gate::Alpha => self.alpha = true,
                Gate::VertexColors => self.vertex_colors = true,
                Gate::Shutter => self.shutter = true,
            }
        }
    }
}

/// Collects effects in a fixed order, with the first reason for each.
#[derive(Default)]
struct Found {
    reasons: BTreeMap<usize, (&'static str, String)>,
}

impl Found {
    fn mark(&mut self, gate: &mut bool, order: usize, name: &'static str, reason: impl FnOnce() -> String) {
        *gate = true;
        self.reasons.entry(order).or_insert_with(|| (name, reason()));
    }
}

/// Finds the effects of `scene` under `options`, seen by the camera of that number. `instanced` tells whether placements
/// stay instanced.
pub fn find(scene: &Scene, options: &RenderOptions, camera: usize, instanced: bool) -> (Features, Effects) {
    let mut features = Features::default();
    let mut found = Found::default();
    let mut ignored = Vec::new();
    let f = &mut features;

    if let Some(lens) = options.lens {
        found.mark(&mut f.lens, 0, "lens", || format!("aperture radius {} m", lens.radius_m));
    }
    mark_shutter(f, &mut found, &mut ignored, scene, camera);
    let mut lamps_at_rest = false;
    for (index, instance) in scene.instances.iter().enumerate() {
        let mesh = &scene.meshes[instance.mesh.index()];
        let material = &scene.materials[mesh.material.index()];
        if material.is_emissive() && !material.unlit {
            if scene.motion.of_instance(index).is_none() {
                lamps_at_rest = true;
            } else {
                let why = "it moves; BSDF sampling alone finds it";
                push_once(&mut ignored, format!("light sampling of mesh '{}'", mesh.name), why);
            }
        }
        if mesh.normals.is_some() {
            found.mark(&mut f.smooth_normals, 1, "smooth-normals", || format!("mesh '{}'", mesh.name));
        }
        if mesh.uvs.is_some() {
            mark_textures(f, &mut found, material);
        } else if material.reads_textures() {
            let what = format!("textures of material '{}' on mesh '{}'", material.name, mesh.name);
            push_once(&mut ignored, what, "the mesh has no texture coordinates");
        }
        mark_parts(f, &mut found, scene, mesh, material);
        mark_material(f, &mut found, material);
    }
    let mut placed =
        scene.instances.iter().map(|instance| &scene.materials[scene.meshes[instance.mesh.index()].material.index()]);
    if let Some(material) = placed.find(|material| material.occlusion_texture) {
        let what = format!("occlusion-textures (material '{}')", material.name);
        push_once(&mut ignored, what, "light transport computes occlusion itself");
    }
    if let Some(environment) = &scene.environment {
        if environment.intensity > 0.0 && environment.texels.iter().any(|t| t.max_element() > 0.0) {
            let reason = || format!("{}×{} texels", environment.width, environment.height);
            found.mark(&mut f.environment, 20, "environment", reason);
        } else {
            push_once(&mut ignored, "environment".into(), "its radiance is 0 everywhere");
        }
    }
    for light in &scene.punctual {
        if light.intensity.max_element() <= 0.0 {
            push_once(&mut ignored, format!("light '{}'", light.name), "its intensity is 0");
            continue;
        }
        if options.strategy == Strategy::BsdfOnly {
            let why = "strategy bsdf: BSDF sampling cannot find a punctual light";
            push_once(&mut ignored, format!("light '{}'", light.name), why);
            continue;
        }
        let kind = match light.kind {
            PunctualKind::Point => "point",
            PunctualKind::Spot { .. } => "spot",
            PunctualKind::Directional => "directional",
        };
        found.mark(&mut f.punctual, 21, "punctual-lights", || format!("{kind} light '{}'", light.name));
    }
    if instanced {
        found.mark(&mut f.instancing, 30, "instancing", || format!("{} placements", scene.instances.len()));
    }
    if options.per_length || options.aovs.contains(&Aov::Bounces) {
        found.mark(&mut f.per_length, 31, "per-length-images", || "asked for".into());
    }
    if let Some(aov) = options.aovs.iter().find(|aov| aov.is_of_first_hit()) {
        found.mark(&mut f.first_hit, 32, "first-hit", || format!("channels '{}'", aov.name()));
    }
    if let Some(Projection::Orthographic { .. }) = scene.cameras.get(camera).map(|c| c.projection)
        && f.lens
    {
        f.lens = false;
        found.reasons.remove(&0);
        push_once(&mut ignored, "lens".into(), "an orthographic camera has no aperture");
    }

    if f.textures && options.texture_filter == TextureFilter::Trilinear {
        found.mark(&mut f.footprints, 6, "texture-filter", || options.texture_filter.name().into());
    }
    f.light_sampling = options.strategy != Strategy::BsdfOnly && (lamps_at_rest || f.environment || f.punctual);
    let simulated = found.reasons.values().map(|(name, _)| name.to_string()).collect();
    let mut found: Vec<String> = found.reasons.values().map(|(name, why)| format!("{name} ({why})")).collect();
    found.extend(ignored.iter().map(|i: &Ignored| i.what.clone()));
    (features, Effects { found, simulated, ignored })
}

/// What becomes of the shutter, for the camera of that number.
fn mark_shutter(f: &mut Features, found: &mut Found, ignored: &mut Vec<Ignored>, scene: &Scene, camera: usize) {
    let motion = &scene.motion;
    let Some(shutter) = motion.shutter else { return };
    let span = format!("{} s to {} s", shutter.open_s(), shutter.close_s());
    let looks = motion.of_camera(camera).is_some();
    if looks || !motion.instances.is_empty() {
        let meshes = motion.instances.iter().map(|track| &scene.meshes[scene.instances[track.index].mesh.index()]);
        found.mark(&mut f.shutter, 33, "shutter", || {
            let first = meshes.clone().next().map_or(String::new(), |mesh| format!(", mesh '{}'", mesh.name));
            let camera = if looks { ", the camera" } else { "" };
            format!("{span}; {} placements move{first}{camera}", motion.instances.len())
        });
    } else {
        let why = match (motion.animations.is_empty(), shutter.is_instant()) {
            (true, _) => "the scene has no animations",
            (false, true) => "of zero length: the scene is posed at that time and stands still",
            (false, false) => "nothing that is seen moves meanwhile",
        };
        push_once(ignored, format!("shutter ({span})"), why);
    }
    for unmoved in &motion.unmoved {
        push_once(ignored, unmoved.what.clone(), &unmoved.why);
    }
}

fn push_once(ignored: &mut Vec<Ignored>, what: String, why: &str) {
    if !ignored.iter().any(|i| i.what == what) {
        ignored.push(Ignored { what, why: why.into() });
    }
}

fn mark_textures(f: &mut Features, found: &mut Found, material: &Material) {
    let reason = || format!("material '{}'", material.name);
    if material.reads_textures() {
        f.textures = true;
    }
    if material.base_color_texture.is_some() {
        found.mark(&mut f.base_color_textures, 2, "base-colour-textures", reason);
    }
    if material.metallic_roughness_texture.is_some() {
        found.mark(&mut f.metallic_roughness_textures, 3, "metallic-roughness-textures", reason);
    }
    if material.normal_texture.is_some() {
        found.mark(&mut f.normal_maps, 4, "normal-maps", reason);
    }
    if material.emissive_texture.is_some() {
        found.mark(&mut f.emissive_textures, 5, "emissive-textures", reason);
    }
}

/// What vertices and textures say of where and how a surface is.
fn mark_parts(f: &mut Features, found: &mut Found, scene: &Scene, mesh: &Mesh, material: &Material) {
    let reason = || format!("material '{}'", material.name);
    match material.effective_alpha(&scene.textures) {
        AlphaMode::Opaque => {}
        AlphaMode::Mask { .. } => found.mark(&mut f.alpha, 6, "alpha-masks", reason),
        AlphaMode::Blend => found.mark(&mut f.alpha, 7, "alpha-blending", reason),
    }
    if material.vertex_colors && mesh.colors.is_some() {
        found.mark(&mut f.vertex_colors, 8, "vertex-colours", || format!("mesh '{}'", mesh.name));
    }
    if mesh.uvs.is_some() && !mesh.more_uvs.is_empty() && material.uv_channels() > 1 {
        found.mark(&mut f.more_uvs, 9, "more-texture-coordinates", || format!("mesh '{}'", mesh.name));
    }
}

fn mark_material(f: &mut Features, found: &mut Found, material: &Material) {
    let reason = || format!("material '{}'", material.name);
    if material.unlit {
        found.mark(&mut f.unlit, 10, "unlit", reason);
        return;
    }
    if material.is_emissive() {
        found.mark(&mut f.area_lights, 11, "area-lights", reason);
    }
    let opaque = material.transmission < 1.0 || material.metallic > 0.0;
    if opaque {
        if material.metallic > 0.0 {
            found.mark(&mut f.glossy, 12, "metal", reason);
        }
        if material.metallic < 1.0 || material.metallic_roughness_texture.is_some() {
            if material.specular > 0.0 {
                f.glossy = true;
                found.mark(&mut f.coated, 13, "dielectric-coat", reason);
            } else {
                let mut lambert = false;
                found.mark(&mut lambert, 14, "lambert", reason);
            }
        }
    }
    if material.transmission > 0.0 && material.metallic < 1.0 {
        if material.thickness > 0.0 {
            let rough = if material.roughness > 0.0 { "rough" } else { "smooth" };
            found.mark(&mut f.dielectric, 15, "solid-dielectric", || format!("{rough}, {}", reason()));
            if material.attenuation_distance_m.is_finite() && material.attenuation_color != glam::Vec3::ONE {
                found.mark(&mut f.absorption, 16, "absorption", reason);
            }
        } else {
            found.mark(&mut f.thin, 17, "thin-transmission", reason);
        }
    }
}
