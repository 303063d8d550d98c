//! How wide a path is where it meets a surface, for textures that are averaged over that width: a cone of rays that starts
//! with the camera's pixel and widens with every rough scattering.
//!
//! Kept by camera sample, which a path is for life, so that nothing has to be moved with the paths; without filtered textures
//! there are no cones at all.
//!
//! Source: Akenine-Möller et al., "Texture Level of Detail Strategies for Real-Time Ray Tracing" (Ray Tracing Gems, 2019), §20.6,
//! with the exact area ratio of the triangle's texture coordinates. A rough scattering widens the cone to a 64th of the solid
//! angle that its density spreads over, as though 64 samples shared the lobe. Limit: curvature of mirrors and lenses does not
//! bend the cone; a lens at the camera does not open it.

use glam::{Vec3, Vec4};

use super::Context;
use super::columns::{Lane, Mask, get};
use super::state::PathBlock;
use super::vertices::Vertices;
use crate::backend::batch::{INVALID_ID, LANES, RayHitBlock};
use crate::scene::{Material, TextureSlot};
use crate::texture;

/// A path's cone at the origin of its ray.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cone {
    /// Width at the ray's origin, metres.
    pub width_m: f32,
    /// Widening per metre.
    pub spread: f32,
}

/// Samples that share a lobe, see above.
const SHARE: f32 = 64.0;

/// Widths of the paths of a block where they hit, metres.
#[inline(always)]
pub fn widths(cones: &[Cone], rays: &RayHitBlock, paths: &PathBlock, lanes: u16) -> Lane {
    std::array::from_fn(|i| {
        if lanes >> i & 1 == 0 {
            return 0.0;
        }
        let cone = cones[paths.slot[i] as usize];
        cone.width_m + cone.spread * rays.ray.tfar[i]
    })
}

/// Opens the cones of the paths of `keep` for their next edge. `pdf_sa` are the densities with which they were scattered.
#[inline(always)]
pub fn scatter(cones: &mut [Cone], vertices: &Vertices, paths: &PathBlock, pdf_sa: &Lane, keep: &Mask) {
    for i in (0..LANES).filter(|&i| keep[i] != 0) {
        let cone = &mut cones[paths.slot[i] as usize];
        // A mirror's density is infinite: its cone stays as narrow as it was.
        let lobe = (1.0 / (SHARE * std::f32::consts::PI * pdf_sa[i].max(f32::MIN_POSITIVE))).sqrt();
        // Half of a sphere's width is as wide as any cone gets.
        *cone = Cone { width_m: vertices.width[i], spread: cone.spread.max(2.0 * lobe.min(1.0)) };
    }
}

/// Value of a texture at the hit of lane `i`, averaged over the path's width there; white where there are no coordinates.
#[inline(never)]
pub fn lookup(context: &Context, rays: &RayHitBlock, vertices: &Vertices, i: usize, slot: TextureSlot) -> Vec4 {
    let texture = &context.scene.textures[slot.texture.index()];
    let triangle = context.geometry.triangle(rays.hit.geom[i], rays.hit.prim[i]);
    let at = |channel| context.geometry.uv(triangle.attributes, channel, [rays.hit.u[i], rays.hit.v[i]]);
    // As everywhere: a triangle without the channel is read by its first.
    let Some((channel, uv)) = at(slot.uv_set).map(|uv| (slot.uv_set, uv)).or_else(|| at(0).map(|uv| (0, uv))) else {
        return Vec4::ONE;
    };
    let (mut e1, mut e2) = (Vec3::from(triangle.e1), Vec3::from(triangle.e2));
    if rays.hit.inst[i] != INVALID_ID {
        let world = context.geometry.world_from_object(rays.hit.inst[i], rays.ray.time[i]);
        (e1, e2) = (world.transform_vector3(e1), world.transform_vector3(e2));
    }
    let cos = get(&vertices.n_g, i).dot(get(&vertices.wo, i)).abs();
    let per_metre = (uv_area(context, triangle.attributes, channel) / e1.cross(e2).length()).sqrt();
    texture::lookup_filtered(texture, uv, per_metre * vertices.width[i] / cos)
}

/// Colour of an unlit surface at the hit of lane `i`, its texture averaged likewise.
pub fn unlit_color(context: &Context, rays: &RayHitBlock, vertices: &Vertices, i: usize, material: &Material) -> Vec3 {
    let mut color = material.base_color;
    if let Some(slot) = material.base_color_texture {
        color *= lookup(context, rays, vertices, i, slot).truncate();
    }
    if material.vertex_colors {
        let attributes = context.geometry.triangle(rays.hit.geom[i], rays.hit.prim[i]).attributes;
        color *= context.geometry.color(attributes, [rays.hit.u[i], rays.hit.v[i]]).truncate();
    }
    color
}

/// Twice the area of a triangle in texture coordinates.
fn uv_area(context: &Context, attributes: u32, channel: u32) -> f32 {
    let at = |u, v| context.geometry.uv(attributes, channel, [u, v]).unwrap_or_default();
    let corner = at(0.0, 0.0);
    (at(1.0, 0.0) - corner).perp_dot(at(0.0, 1.0) - corner).abs()
}
