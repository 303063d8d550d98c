//! What kernels know of light paths: part of the [`World`](super::super::world::World).

use crate::camera::CameraRays;
use crate::plan::RenderPlan;
use crate::scene::geometry::Geometry;
use crate::scene::{Fact, Facts, Material, Scene};
use crate::shading::light::Lights;
use crate::shading::light::aim::Aim;
use crate::shading::light::emit::Emitters;
use crate::shading::medium::Media;
use crate::texture::Texture;

/// What a material is to light paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Role {
    /// They are aimed at it.
    pub caster: bool,
    /// They scatter there; else they only arrive.
    pub passes: bool,
}

impl Role {
    /// Of a material of a scene with these textures.
    pub fn of(material: &Material, textures: &[Texture]) -> Self {
        let facts = Facts::with_textures(material, textures);
        let mapped = material.normal_texture.is_some() || material.clearcoat_normal_texture.is_some();
        let passes = !(mapped || facts.has(Fact::Unlit));
        Role { caster: passes && facts.has(Fact::Casts), passes }
    }
}

/// Light paths of a render, as kernels see them.
#[derive(Clone, Copy)]
pub struct LightPaths<'a> {
    /// Where they start.
    pub emitters: &'a Emitters,
    /// How many there are for each sample index.
    pub per_sample: f32,
    /// Whether what they can find is left to them alone.
    pub alone: bool,
    /// One entry a material.
    pub roles: &'a [Role],
    /// The solids around each light; empty where paths keep none.
    pub media: &'a [Media],
}

/// What [`LightPaths`] are made of.
pub struct Tables {
    emitters: Emitters,
    roles: Vec<Role>,
    media: Vec<Media>,
}

/// Bits of a sum below the value of a light path that is about the usual one.
const BITS_BELOW: i32 = 24;

impl Tables {
    /// Of a scene; `None` where no light sends anything towards something that bundles it, and where the plan has no
    /// light paths.
    pub fn new(scene: &Scene, geometry: &Geometry, lights: &Lights, plan: &RenderPlan) -> Option<Self> {
        if !plan.features.light_paths {
            return None;
        }
        let roles: Vec<Role> = scene.materials.iter().map(|material| Role::of(material, &scene.textures)).collect();
        let aim = Aim::of(geometry, |material| roles[material as usize].caster)?;
        let emitters = Emitters::new(lights, aim, geometry)?;
        let around = |light| lights.place(light).map_or(Media::NONE, |p| Media::of(&geometry.solids_around(p).0));
        let media = if plan.features.media { (0..lights.len() as u32).map(around).collect() } else { Vec::new() };
        Some(Tables { emitters, roles, media })
    }

    /// As kernels see them.
    pub fn view(&self, plan: &RenderPlan) -> LightPaths<'_> {
        let Tables { emitters, roles, media } = self;
        let (per_sample, alone) = (per_sample(plan) as f32, plan.light_paths_alone);
        LightPaths { emitters, per_sample, alone, roles, media }
    }

    /// The power of two in which sums are counted: what a usual light path brings to a pixel, and [`BITS_BELOW`] more.
    pub fn exponent(&self, plan: &RenderPlan, camera: &CameraRays, geometry: &Geometry) -> i32 {
        let (low, high) = geometry.bounds;
        let distance_m = (0.5 * (low + high)).distance(camera.position()).max(geometry.bounding_radius());
        let on_film = f64::from(camera.per_area(camera.forward(), distance_m));
        let usual = self.emitters.power_w() / per_sample(plan) as f64 * on_film;
        (usual.log2().floor().clamp(-900.0, 900.0)) as i32 - BITS_BELOW
    }
}

/// Light paths of a sample index: a power of two.
pub fn per_sample(plan: &RenderPlan) -> u64 {
    let (width, height) = plan.resolution;
    let wanted = f64::from(plan.light_paths) * f64::from(width) * f64::from(height);
    1 << (wanted.max(1.0).log2() as u32)
}
