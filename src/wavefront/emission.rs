//! What a surface gives and takes by itself, one lane at a time: emission with its MIS weight, emission textures,
//! absorption on the way to it.

use glam::Vec3;

use super::state::{NO_MEDIUM, PathLane};
use super::{Context, estimator};
use crate::backend::batch::Hit;
use crate::scene::{Material, TextureSlot};
use crate::shading::interaction;
use crate::shading::light::{EmitterHit, TexturePoint};
use crate::texture;

/// An emissive triangle as a ray met it.
pub struct Emitter {
    /// Its light, or `u32::MAX`.
    pub light: u32,
    /// Length of the ray, metres.
    pub distance_m: f32,
    /// Cosine between the front's normal and the way back along the ray.
    pub cos_light: f32,
}

/// Weight of the emission of an emissive triangle met by the path's last BSDF sample from `org`.
#[inline(always)]
pub fn weight(context: &Context, path: &PathLane, org: Vec3, hit: &Emitter) -> f32 {
    if path.last_pdf_sa == f32::INFINITY || !context.plan.samples_lights() || hit.light == u32::MAX {
        return 1.0;
    }
    let &Emitter { light, distance_m, cos_light } = hit;
    let hit = EmitterHit { light, distance_m, cos_light, area_m2: context.lights.area_m2(light) };
    let light_pdf = context.lights.pdf_triangle(org, path.last_n, &hit);
    estimator::emission_weight(context.plan.strategy, path.last_pdf_sa, light_pdf)
}

/// Value of the emission texture at a sampled light point.
#[inline(always)]
pub fn texel(context: &Context, point: &TexturePoint) -> Vec3 {
    let triangle = &context.geometry.triangles[point.triangle as usize];
    let slot = context.scene.materials[triangle.material as usize].emissive_texture;
    match (slot, interaction::uv(context.geometry, triangle.attributes, point.barycentric)) {
        (Some(slot), Some(uv)) => texture::lookup(&context.scene.textures[slot.texture.index()], uv).truncate(),
        _ => Vec3::ONE,
    }
}

/// A factor times its texture at a hit, where there is one.
#[inline(always)]
pub fn textured(context: &Context, hit: &Hit, factor: Vec3, slot: Option<TextureSlot>) -> Vec3 {
    let Some(slot) = slot else { return factor };
    let attributes = context.geometry.triangle(hit.geom, hit.prim).attributes;
    match interaction::uv(context.geometry, attributes, [hit.u, hit.v]) {
        Some(uv) => factor * texture::lookup(&context.scene.textures[slot.texture.index()], uv).truncate(),
        None => factor,
    }
}

/// Beer–Lambert over the last edge, `distance_m` long: through the medium the path carries, or, when the camera started
/// inside a solid, through the solid whose inside was hit (`material`, not from its `front`).
#[inline(always)]
pub fn absorption(context: &Context, material: &Material, medium: u32, front: bool, distance_m: f32) -> Vec3 {
    let inside = if medium != NO_MEDIUM {
        &context.scene.materials[medium as usize]
    } else if !front && material.transmission > 0.0 && material.thickness > 0.0 {
        material
    } else {
        return Vec3::ONE;
    };
    transmittance(inside, distance_m)
}

/// Fraction of light left after `distance_m` inside a solid of this material.
pub fn transmittance(material: &Material, distance_m: f32) -> Vec3 {
    let exponent = distance_m / material.attenuation_distance_m;
    let c = material.attenuation_color;
    if exponent == 0.0 { Vec3::ONE } else { Vec3::new(c.x.powf(exponent), c.y.powf(exponent), c.z.powf(exponent)) }
}
