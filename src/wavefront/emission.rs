//! What a surface gives and takes by itself, one lane at a time: emission with its MIS weight, emission textures,
//! absorption on the way to it.

use glam::Vec3;

use super::state::{NO_MEDIUM, PathLane};
use super::{Context, estimator};
use crate::backend::batch::Hit;
use crate::scene::{Material, TextureSlot};
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
    if path.last_pdf_sa == f32::INFINITY {
        return 1.0;
    }
    let light_pdf = light_pdf_sa(context, path, org, hit);
    estimator::emission_weight(context.plan.strategy, path.last_pdf_sa, light_pdf)
}

/// Density with which light sampling at `org` would have found the emissive triangle, sr⁻¹; 0 where it does not take part.
#[inline(always)]
pub fn light_pdf_sa(context: &Context, path: &PathLane, org: Vec3, hit: &Emitter) -> f32 {
    if !context.plan.samples_lights() || hit.light == u32::MAX {
        return 0.0;
    }
    let &Emitter { light, distance_m, cos_light } = hit;
    let hit = EmitterHit { light, distance_m, cos_light, area_m2: context.lights.area_m2(light) };
    context.lights.pdf_triangle(org, path.last_n, &hit)
}

/// Value of the emission texture at a sampled light point, times the probability that the emitter is there.
#[inline(always)]
pub fn texel(context: &Context, point: &TexturePoint) -> Vec3 {
    let triangle = &context.geometry.triangles[point.triangle as usize];
    let slot = context.scene.materials[triangle.material as usize].emissive_texture;
    let there = if context.plan.features.alpha {
        context.alpha.coverage(context, triangle.material, (triangle.attributes, point.barycentric))
    } else {
        1.0
    };
    match slot.and_then(|slot| texel_at(context, slot, triangle.attributes, point.barycentric)) {
        Some(texel) => texel * there,
        None => Vec3::splat(there),
    }
}

/// A factor times its texture at a hit, where there is one.
#[inline(always)]
pub fn textured(context: &Context, hit: &Hit, factor: Vec3, slot: Option<TextureSlot>) -> Vec3 {
    let attributes = context.geometry.triangle(hit.geom, hit.prim).attributes;
    match slot.and_then(|slot| texel_at(context, slot, attributes, [hit.u, hit.v])) {
        Some(texel) => factor * texel,
        None => factor,
    }
}

/// What an unlit surface shows.
#[inline(always)]
pub fn unlit_color(context: &Context, hit: &Hit, material: &Material) -> Vec3 {
    let color = textured(context, hit, material.base_color, material.base_color_texture);
    if material.vertex_colors {
        let attributes = context.geometry.triangle(hit.geom, hit.prim).attributes;
        color * context.geometry.color(attributes, [hit.u, hit.v]).truncate()
    } else {
        color
    }
}

#[inline(always)]
fn texel_at(context: &Context, slot: TextureSlot, attributes: u32, weights: [f32; 2]) -> Option<Vec3> {
    let uv = |channel| context.geometry.uv(attributes, channel, weights);
    let uv = uv(slot.uv_set).or_else(|| uv(0))?;
    Some(texture::lookup(&context.scene.textures[slot.texture.index()], uv).truncate())
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
