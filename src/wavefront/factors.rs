//! Material factors of sixteen lanes after their textures, and normal maps. Each texture slot is a loop of its own over the
//! lanes, so that the waits for memory of sixteen look-ups overlap.

use glam::{Vec2, Vec3, Vec4};

use super::columns::{Lane, Lane3, Mask, ZERO, ZERO3, get, set};
use super::vertices::Vertices;
use super::{Context, footprint};
use crate::backend::batch::{LANES, RayHitBlock};
use crate::scene::{Material, TextureSlot};
use crate::shading::interaction;
use crate::shading::surface::Textured;
use crate::texture;

/// See the module.
#[repr(C, align(64))]
pub struct Factors {
    /// Linear base colour.
    pub base_color: Lane3,
    /// 0 dielectric … 1 metal.
    pub metallic: Lane,
    /// glTF roughness.
    pub roughness: Lane,
    /// Lanes whose shading normal a map has tilted.
    pub mapped: Mask,
}

impl Factors {
    /// Looks the materials of the active lanes up. Tilts the shading normals of `vertices`; one may then face away from the viewer.
    #[inline(always)]
    pub fn look_up(context: &Context, rays: &RayHitBlock, vertices: &mut Vertices) -> Self {
        let mut factors = Factors { base_color: ZERO3, metallic: ZERO, roughness: ZERO, mapped: [0; LANES] };
        for i in 0..LANES {
            let material = &context.scene.materials[vertices.material[i] as usize];
            set(&mut factors.base_color, i, material.base_color);
            factors.metallic[i] = material.metallic;
            factors.roughness[i] = material.roughness;
        }
        if context.plan.features.textures {
            factors.apply_textures(context, rays, vertices);
        }
        if context.plan.features.vertex_colors {
            for i in (0..LANES).filter(|&i| vertices.active[i] != 0) {
                if context.scene.materials[vertices.material[i] as usize].vertex_colors {
                    let attributes = context.geometry.triangle(rays.hit.geom[i], rays.hit.prim[i]).attributes;
                    let vertex = context.geometry.color(attributes, [rays.hit.u[i], rays.hit.v[i]]).truncate();
                    let color = get(&factors.base_color, i) * vertex;
                    set(&mut factors.base_color, i, color);
                }
            }
        }
        factors
    }

    /// The factors of one lane.
    #[inline(always)]
    pub fn textured(&self, i: usize) -> Textured {
        Textured { base_color: get(&self.base_color, i), metallic: self.metallic[i], roughness: self.roughness[i] }
    }

    #[inline(always)]
    fn apply_textures(&mut self, context: &Context, rays: &RayHitBlock, vertices: &mut Vertices) {
        let materials = &context.scene.materials;
        let material = |vertices: &Vertices, i: usize| -> &Material { &materials[vertices.material[i] as usize] };
        // Channel 0 of the texture coordinates; slots with another look it up themselves.
        let mut uv = [Vec2::ZERO; LANES];
        let mut corners = [(0, [0.0; 2]); LANES];
        let mut reads: Mask = [0; LANES];
        for i in 0..LANES {
            if vertices.active[i] != 0 && material(vertices, i).reads_textures() {
                let attributes = context.geometry.triangle(rays.hit.geom[i], rays.hit.prim[i]).attributes;
                corners[i] = (attributes, [rays.hit.u[i], rays.hit.v[i]]);
                if let Some(found) = context.geometry.uv(attributes, 0, corners[i].1) {
                    (uv[i], reads[i]) = (found, 1);
                }
            }
        }
        let features = &context.plan.features;
        let fetch = |vertices: &Vertices, slot: Option<TextureSlot>, i: usize| -> Option<Vec4> {
            let slot = slot?;
            if features.footprints {
                return Some(footprint::lookup(context, rays, vertices, i, slot));
            }
            let uv = match slot.uv_set {
                0 => uv[i],
                channel => context.geometry.uv(corners[i].0, channel, corners[i].1).unwrap_or(uv[i]),
            };
            Some(texture::lookup(&context.scene.textures[slot.texture.index()], uv))
        };
        if features.base_color_textures {
            for i in (0..LANES).filter(|&i| reads[i] != 0) {
                if let Some(texel) = fetch(vertices, material(vertices, i).base_color_texture, i) {
                    let color = get(&self.base_color, i) * texel.truncate();
                    set(&mut self.base_color, i, color);
                }
            }
        }
        if features.metallic_roughness_textures {
            for i in (0..LANES).filter(|&i| reads[i] != 0) {
                if let Some(texel) = fetch(vertices, material(vertices, i).metallic_roughness_texture, i) {
                    self.roughness[i] *= texel.y;
                    self.metallic[i] *= texel.z;
                }
            }
        }
        if features.normal_maps {
            for i in (0..LANES).filter(|&i| reads[i] != 0) {
                let scale = material(vertices, i).normal_scale;
                let Some(texel) = fetch(vertices, material(vertices, i).normal_texture, i) else { continue };
                // Maps are authored for normals of the front side.
                let (n_s, side) = (get(&vertices.n_s, i) * vertices.side[i], vertices.side[i]);
                let hit = rays.hit_unchecked(i);
                if let Some(tangent) = interaction::tangent(context.geometry, &hit, n_s) {
                    let map =
                        Vec3::new((texel.x * 2.0 - 1.0) * scale, (texel.y * 2.0 - 1.0) * scale, texel.z * 2.0 - 1.0);
                    set(&mut vertices.n_s, i, interaction::tilt(n_s, tangent, map) * side);
                    self.mapped[i] = 1;
                }
            }
        }
    }
}
